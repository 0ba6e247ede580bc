"""Readers that are not to be trusted with a damaged file, in a process of their own.

Some parsers in C crash on a few flipped bytes, ask for gigabytes or never come back.  `call` runs one of them in a
child with limits on time and memory.  What comes back are arrays, texts and numbers, and nothing else.

One child serves many calls; it is started anew when it has died.  It ends with this process, however that ends.
"""

import atexit
import contextlib
import ctypes
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

LONGEST_S = 60.0
MEMORY, PER_BYTE = 1 << 30, 10  # bytes of memory, and more for each byte of the file
_PR_SET_PDEATHSIG = 1
_FRAME = 8  # bytes that tell the length of a request
_SAFE = {  # what an answer may be made of, beside what pickle knows itself
    "numpy": ("dtype", "ndarray"),
    "numpy._core.multiarray": ("_reconstruct", "scalar"),
    "numpy._core.numeric": ("_frombuffer",),
    "scipy.io.matlab._mio5_params": ("mat_struct", "MatlabObject", "MatlabFunction", "MatlabOpaque"),
    "builtins": ("complex", "bytearray", "set", "frozenset"),
    "_codecs": ("encode",),
}


class Failed(Exception):
    """The reader refused the file, in its own words."""


class Crashed(Failed):
    """The process died of the file."""


class TooLong(Failed):
    """It did not come back in time."""


class TooLarge(Failed):
    """It wanted more memory than a file of that size should need."""


def call(function: str, path: Path, *, longest_s: float = LONGEST_S, **options: Any) -> Any:
    """What ``function(path, **options)`` returns, run in the child.

    function : ``module:name``, of a module that can be imported here

    Raises
    ------
    Failed      the reader raised something, or one of its kinds above
    """
    child = _current()
    memory = MEMORY + PER_BYTE * os.path.getsize(path)
    try:
        return child.ask((function, os.fsencode(os.path.abspath(path)), options, memory, longest_s), longest_s)
    except BaseException as error:  # also Ctrl-C: what it would still answer belongs to no question
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

        clock = threading.Timer(longest_s + 5.0, kill)  # the child starts, and has a limit of its own
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
        """Exit code of a child whose answer broke off; it is ended where it has not."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(timeout=1.0)
        return None

    def end(self) -> None:
        """End the process, wherever it is."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


class _Answer(pickle.Unpickler):
    """An answer, of which nothing runs here."""

    def find_class(self, module: str, name: str) -> Any:
        if name not in _SAFE.get(module, ()):
            raise pickle.UnpicklingError(f"{module}.{name} in an answer")
        return super().find_class(module, name)


_child: _Child | None = None


def _current() -> _Child:
    """The child of this process, started where there is none, or where it has ended meanwhile."""
    global _child
    if _child is not None and _child.of == os.getpid() and _child.process.poll() is not None:
        _end()
    if _child is None or _child.of != os.getpid():  # never that of a process which this one was forked from
        _child = _Child()
    return _child


def _end() -> None:
    global _child
    if _child is not None and _child.of == os.getpid():
        _child.end()
    _child = None


atexit.register(_end)


def serve(parent: int) -> None:
    """Answer the requests of the process `parent` until it ends: what the child runs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and ends this process
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash leaves no file behind
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a reader prints does not mix with the answers
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
    except Exception as error:  # whatever it raises is told in its words
        _send(("failed", " ".join(str(error).split()) or type(error).__name__), answers)
    finally:
        free()


def _send(answer: tuple[str, Any], answers: BinaryIO) -> None:
    """Pickle first, then send: an answer that cannot be pickled leaves nothing in the pipe."""
    if answer[0] == "answer":
        made = io.BytesIO()
        pickle.Pickler(made, protocol=5).dump(answer)
        answers.write(made.getbuffer())
    else:
        answers.write(pickle.dumps(answer))
    answers.flush()


def _limit(memory: int, longest_s: float) -> Any:
    """Limit this process from here on, where the system can; returns what lifts the limits."""
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
    """Bytes of address space that this process has; 0 where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0
