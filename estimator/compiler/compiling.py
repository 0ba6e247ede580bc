"""What goes on while kernels are compiled, for those who show it and for those who handle Ctrl-C.

The first call of a kernel compiles it, somewhere inside whatever command comes first, for half a minute in all.
Nothing here imports the compiler.

The compiler calls back from C, where an exception of a signal handler is printed and lost.  So a handler asks `busy`,
and where that is true raises nothing: it is asked again, by the function handed to `on_pause`, at the next place
where an exception goes through.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the compiler is in this process.

    compiled : kernels so far     active : whether it goes on compiling     name : of the kernel that begins or ends
    """

    compiled: int
    active: bool
    name: str


Watch = Callable[[Progress], None]
Tell = Callable[[str], None]


def _to_stderr(trouble: str) -> None:
    sys.stderr.write(f"wingslevel: kernel cache: {trouble}\n")


class _State:
    """Of this process."""

    watch: Watch | None = None
    tell: Tell = staticmethod(_to_stderr)
    pause: Callable[[], None] | None = None
    compiled = 0
    told = False
    spent_s = 0.0  # in the compiler, by all threads


_state = _State()
_thread = threading.local()


def on_compile(watch: Watch | None) -> Watch | None:
    """Call `watch` when a kernel begins to be compiled and when it has been; returns who was called before.

    Nobody is called for a kernel that is loaded from the cache.  A worker process begins with nobody.
    """
    before, _state.watch = _state.watch, watch
    return before


def on_trouble(tell: Tell | None) -> None:
    """Give `tell` the line about a cache that cannot be used, once in a process; None is standard error."""
    _state.tell, _state.told = tell or _to_stderr, False


def on_pause(check: Callable[[], None]) -> None:
    """Call `check` wherever an exception may be raised while compiling."""
    _state.pause = check


def compiled() -> int:
    """Kernels that this process has compiled so far."""
    return _state.compiled


def busy() -> bool:
    """Whether this thread is inside the compiler, or loads what that has made."""
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
    """This thread goes into the compiler, or one step deeper."""
    _thread.depth = getattr(_thread, "depth", 0) + 1
    if _thread.depth == 1:
        _thread.since_s = time.monotonic()


def leave() -> None:
    """This thread comes out of the compiler, or one step up."""
    _thread.depth -= 1
    if _thread.depth == 0:
        _state.spent_s += time.monotonic() - _thread.since_s
    pause()


def spent_s() -> float:
    """Time that this process has spent compiling, and loading kernels, until now."""
    return _state.spent_s + (time.monotonic() - _thread.since_s if busy() else 0.0)


def pause() -> None:
    """A place where an exception may be raised."""
    if _state.pause is not None:
        _state.pause()


def begins(name: str) -> None:
    """A kernel begins to be compiled."""
    _call(Progress(_state.compiled, True, name))


def ends(name: str) -> None:
    """A kernel has been compiled, or could not be."""
    _state.compiled += 1
    _call(Progress(_state.compiled, _thread.depth > 1, name))


def _call(progress: Progress) -> None:
    if _state.watch is not None:
        _state.watch(progress)


def trouble(line: str) -> None:
    """Tell of a cache that cannot be used: the first time, in this process."""
    if not _state.told:
        _state.told = True
        _state.tell(line)
