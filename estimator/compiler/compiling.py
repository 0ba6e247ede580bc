"""Progress of kernel compilation, for displays and for the handling of Ctrl-C; does not import the compiler.

The first call of a kernel compiles it, in whatever command comes first; all of them take half a minute.

The compiler calls back from C, where an exception raised by a signal handler is printed and lost.  So a handler checks
`busy` and raises nothing while that is true; the function given to `on_pause` can raise it at the next safe place.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of the compiler in this process.

    compiled : kernels so far     active : whether it is still compiling     name : of the kernel that starts or ends
    """

    compiled: int
    active: bool
    name: str


Watch = Callable[[Progress], None]
Report = Callable[[str], None]


def _to_stderr(trouble: str) -> None:
    sys.stderr.write(f"wingslevel: kernel cache: {trouble}\n")


class _State:
    """State of this process."""

    watch: Watch | None = None
    report: Report = staticmethod(_to_stderr)
    pause: Callable[[], None] | None = None
    compiled = 0
    reported = False
    spent_s = 0.0  # in the compiler, by all threads


_state = _State()
_thread = threading.local()


def on_compile(watch: Watch | None) -> Watch | None:
    """Call `watch` at the start and the end of each compilation; returns the previous function.

    It is not called for a kernel loaded from the cache.  A worker process starts without one.
    """
    before, _state.watch = _state.watch, watch
    return before


def on_trouble(report: Report | None) -> None:
    """Pass the message about an unusable cache to `report`, once per process; None is standard error."""
    _state.report, _state.reported = report or _to_stderr, False


def on_pause(check: Callable[[], None]) -> None:
    """Call `check` at every place where an exception may be raised while compiling."""
    _state.pause = check


def compiled() -> int:
    """Number of kernels that this process has compiled."""
    return _state.compiled


def busy() -> bool:
    """Whether this thread is compiling a kernel or loading one."""
    return getattr(_thread, "depth", 0) > 0


@contextmanager
def held() -> Iterator[None]:
    """Inside the block this thread is `busy`."""
    enter()
    try:
        yield
    finally:
        leave()


def enter() -> None:
    """This thread enters the compiler, or goes one level deeper."""
    _thread.depth = getattr(_thread, "depth", 0) + 1
    if _thread.depth == 1:
        _thread.since_s = time.monotonic()


def leave() -> None:
    """This thread leaves the compiler, or goes one level up."""
    _thread.depth -= 1
    if _thread.depth == 0:
        _state.spent_s += time.monotonic() - _thread.since_s
    pause()


def spent_s() -> float:
    """Time in seconds that this process has spent compiling and loading kernels."""
    return _state.spent_s + (time.monotonic() - _thread.since_s if busy() else 0.0)


def pause() -> None:
    """A place where an exception may be raised."""
    if _state.pause is not None:
        _state.pause()


def begins(name: str) -> None:
    """Compilation of a kernel starts."""
    _call(Progress(_state.compiled, True, name))


def ends(name: str) -> None:
    """Compilation of a kernel has ended, or failed."""
    _state.compiled += 1
    _call(Progress(_state.compiled, _thread.depth > 1, name))


def _call(progress: Progress) -> None:
    if _state.watch is not None:
        _state.watch(progress)


def trouble(line: str) -> None:
    """Report an unusable cache, once per process."""
    if not _state.reported:
        _state.reported = True
        _state.report(line)
