"""Running readers that may crash on damaged files in a separate process.

Some C parsers crash on corrupt files, allocate gigabytes or never return.  `call` runs them in a child process with
time and memory limits, and returns only arrays, texts and numbers.

One child serves many calls and is restarted if it dies.  It ends with this process in any case.
"""

import atexit
import contextlib
import importlib
import io
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from sim.outside.processes import die_with_parent

LONGEST_S = 60.0
MEMORY, PER_BYTE = 1 << 30, 10  # bytes of memory, and additional ones per byte of the file
_FRAME = 8  # bytes of the length of a request
_SAFE = {  # types allowed in an answer, besides those built into pickle
    "numpy": ("dtype", "ndarray"),
    "numpy._core.multiarray": ("_reconstruct", "scalar"),
    "numpy._core.numeric": ("_frombuffer",),
    "scipy.io.matlab._mio5_params": ("mat_struct", "MatlabObject", "MatlabFunction", "MatlabOpaque"),
    "builtins": ("complex", "bytearray", "set", "frozenset"),
    "_codecs": ("encode",),
}


class Failed(Exception):
    """The reader rejected the file, with its message."""


class Crashed(Failed):
    """The process crashed."""


class TooLong(Failed):
    """The time limit was exceeded."""


class TooLarge(Failed):
    """The memory limit was exceeded."""


def call(function: str, path: Path, *, longest_s: float = LONGEST_S, **options: Any) -> Any:
    """Run ``function(path, **options)`` in the child and return its result.

    function : ``module:name``

    Raises
    ------
    Failed      the reader raised an exception; or one of the subclasses above
    """
    child = _current()
    memory = MEMORY + PER_BYTE * os.path.getsize(path)
    try:
        return child.ask((function, os.fsencode(os.path.abspath(path)), options, memory, longest_s), longest_s)
    except BaseException as error:  # also Ctrl-C: a late answer would be taken for the next one
        if type(error) not in (Failed, TooLarge):
            _end()
        raise


class _Child:
    """The process, and the pipes to it."""

    def __init__(self) -> None:
        self.of = os.getpid()
        start = (
            f"import sys; sys.path[:] = {sys.path!r}; from sim.outside import sandbox; "
            f"sandbox.serve({os.getpid()})"
        )  # fmt: skip
        self.process = subprocess.Popen(
            [sys.executable, "-c", start], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip

    def ask(self, request: tuple[Any, ...], longest_s: float) -> Any:
        to, back = self.process.stdin, self.process.stdout
        if to is None or back is None:
            raise Crashed
        late = threading.Event()

        def kill() -> None:
            late.set()
            self.process.kill()

        clock = threading.Timer(longest_s + 5.0, kill)  # time to start; the child has its own limit
        clock.daemon = True
        clock.start()
        try:
            raw = pickle.dumps(request)
            to.write(len(raw).to_bytes(_FRAME, "little") + raw)
            to.flush()
            kind, answer = _Answer(back).load()
        except (OSError, EOFError, pickle.UnpicklingError, ValueError, ImportError, AttributeError) as error:
            code = self.process.poll() if late.is_set() else self._ended()
            if late.is_set() or (os.name == "posix" and code == -signal.SIGXCPU):
                raise TooLong from error
            raise Crashed from error
        finally:
            clock.cancel()
        if kind == "answer":
            return answer
        raise (TooLarge if kind == "memory" else Failed)(str(answer))

    def _ended(self) -> int | None:
        """Exit code of a child whose answer is incomplete, None if it is still running."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(timeout=1.0)
        return None

    def end(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


class _Answer(pickle.Unpickler):
    """Unpickles an answer without running any code in it."""

    def find_class(self, module: str, name: str) -> Any:
        if name not in _SAFE.get(module, ()):
            raise pickle.UnpicklingError(f"{module}.{name} in an answer")
        return super().find_class(module, name)


_child: _Child | None = None


def _current() -> _Child:
    """The child of this process, started if there is none or if it has ended."""
    global _child
    if _child is not None and _child.of == os.getpid() and _child.process.poll() is not None:
        _end()
    if _child is None or _child.of != os.getpid():  # not the child of a parent this process was forked from
        _child = _Child()
    return _child


def _end() -> None:
    global _child
    if _child is not None and _child.of == os.getpid():
        _child.end()
    _child = None


atexit.register(_end)


def serve(parent: int) -> None:
    """Main function of the child: answer the requests of the process `parent` until that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles it and ends this process
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # no core dumps
    die_with_parent()
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of a reader must not mix with the answers
    while os.name != "posix" or os.getppid() == parent:
        raw = requests.read(_FRAME)
        if len(raw) < _FRAME:
            return
        function, path, options, memory, longest_s = pickle.loads(requests.read(int.from_bytes(raw, "little")))
        _answer(function, path, options, memory, longest_s, answers)


def _answer(
    function: str, path: bytes, options: Mapping[str, Any], memory: int, longest_s: float, answers: BinaryIO
) -> None:
    module, _, name = function.partition(":")
    reader = getattr(importlib.import_module(module), name)
    free = _limit(memory, longest_s)
    try:
        answer: tuple[str, Any] = "answer", reader(os.fsdecode(path), **options)
        _send(answer, answers)
    except MemoryError:
        _send(("memory", str(memory)), answers)
    except Exception as error:  # reported with its message
        _send(("failed", " ".join(str(error).split()) or type(error).__name__), answers)
    finally:
        free()


def _send(answer: tuple[str, Any], answers: BinaryIO) -> None:
    """Pickle first, then send, so that a pickling error leaves nothing in the pipe."""
    if answer[0] == "answer":
        made = io.BytesIO()
        pickle.Pickler(made, protocol=5).dump(answer)
        answers.write(made.getbuffer())
    else:
        answers.write(pickle.dumps(answer))
    answers.flush()


def _limit(memory: int, longest_s: float) -> Any:
    """Limit time and memory of this process, if supported; returns a function that lifts the limits."""
    try:
        import resource
    except ImportError:
        return lambda: None
    used_s = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    _, hard_s = resource.getrlimit(resource.RLIMIT_CPU)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (_now() + memory, hard))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (int(used_s + longest_s) + 1, hard_s))

    def free() -> None:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
            resource.setrlimit(resource.RLIMIT_CPU, (hard_s, hard_s))

    return free


def _now() -> int:
    """Address space of this process in bytes; 0 if unknown."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0
