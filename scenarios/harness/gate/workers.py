"""Tasks over several processes: a process that dies or hangs costs one task.

Each worker is a pool of one process: when the process is gone, whatever its exit code, its one task is known, is
given to a new process once more, and is then reported as lost.  (pebble 5.2 offers the same for any number of
processes, but does not notice one that ends with exit code 0.)
"""

import contextlib
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from types import FrameType, ModuleType
from typing import Any, Generic, Protocol, TypeVar

from estimator.compiler import compiling
from scenarios.harness import lent
from scenarios.harness.cli import console
from scenarios.harness.gate.guard import GRACE_S
from scenarios.harness.plugins import PluginError
from sim.log import Outcome
from sim.outside.blame import show_tracebacks, tracebacks_shown
from sim.outside.processes import end_with_parent
from sim.outside.signals import Interrupted, TimedOut, limited, listening, on_extended
from sim.outside.wording import described

LIVES = 2  # processes that a task may cost before it is lost
_Result = TypeVar("_Result")
_Tells = TypeVar("_Tells", covariant=True)


class Flyable(Protocol[_Tells]):
    """A task that can be sent to a process."""

    def fly(self) -> _Tells:
        """Fly it, and return the result."""
        ...

    def lost(self, outcome: Outcome, message: str) -> _Tells:
        """The result if the process was lost; `message` is one line."""
        ...


def fly_each(
    tasks: Sequence[Flyable[_Result]],
    workers: int,
    advance: Callable[[int, int], None],
    *,
    limit_s: float | None = None,
    interrupted: Callable[[_Result], bool] = lambda _result: False,
    keep: Callable[[int, _Result], None] = lambda _i, _result: None,
) -> dict[int, _Result]:
    """Fly all `tasks`: their results by the number of the task; Ctrl-C leaves some out.

    Parameters
    ----------
    workers         processes; 0 flies one after the other in this process, which flight code may then end
    limit_s         wall-clock limit of each task; None is no limit
    interrupted     whether a result is that of a task that was interrupted: it ends the rest
    keep            is handed each result as it comes, with the number of its task
    advance         is called with the number done and the total
    """
    if _Worker.inside:
        raise ValueError('a worker process cannot start others: put such calls under if __name__ == "__main__":')
    results = _results(tasks, min(workers, len(tasks)), limit_s) if workers else _here(tasks, limit_s)
    done: dict[int, _Result] = {}
    with contextlib.suppress(KeyboardInterrupt):  # finished tasks count; the caller sees that some are missing
        for i, result in results:
            if interrupted(result):
                break
            keep(i, result)
            done[i] = result
            advance(len(done), len(tasks))
    return done


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _here(tasks: Sequence[Flyable[_Result]], limit_s: float | None) -> Iterator[tuple[int, _Result]]:
    """Number and result of each task, in this process."""
    for i, task in enumerate(tasks):
        with listening():
            result = _fly(task, limit_s)
        yield i, result


def _results(tasks: Sequence[Flyable[_Result]], workers: int, limit_s: float | None) -> Iterator[tuple[int, _Result]]:
    """Number and result of each task, as they come."""
    waiting, lives = deque(range(len(tasks))), [LIVES] * len(tasks)
    silent = compiling.compiled() > 0 or console.collecting()
    announced = multiprocessing.get_context("spawn").Value("b", silent, lock=False)
    crew: list[_Worker[_Result]] = [_Worker(limit_s, announced) for _ in range(workers)]
    try:
        while waiting or any(worker.busy for worker in crew):
            for worker in crew:
                if waiting and not worker.busy:
                    i = waiting.popleft()
                    worker.take(i, tasks[i])
            _wait(crew)
            for worker in crew:
                found = worker.look()
                if isinstance(found, _Gone) and not found.timed_out and lives[worker.number] > 1:
                    lives[worker.number] -= 1
                    waiting.appendleft(worker.number)
                elif isinstance(found, _Gone):
                    outcome = Outcome.TIMED_OUT if found.timed_out else Outcome.WORKER_DIED
                    yield worker.number, tasks[worker.number].lost(outcome, found.message)
                elif found is not None:
                    yield worker.number, found.result
    finally:
        for worker in crew:
            worker.end()


def _wait(crew: "Sequence[_Worker[Any]]") -> None:
    """Wait until a task may have finished."""
    futures = [worker.future for worker in crew if worker.future is not None]
    deadlines_s = [worker.deadline_s for worker in crew if worker.deadline_s is not None]
    timeout_s = max(0.0, min(deadlines_s) - time.monotonic()) if deadlines_s else None
    wait(futures, timeout_s, FIRST_COMPLETED)


@dataclass(frozen=True, slots=True)
class _Gone:
    """A process is gone, and its task with it."""

    timed_out: bool
    message: str


@dataclass(frozen=True, slots=True)
class _Done(Generic[_Result]):
    """The result of a task."""

    result: _Result


class _Worker(Generic[_Result]):
    """One process, restarted when it dies, and its current task.

    inside : whether this process is one
    """

    inside = False

    def __init__(self, limit_s: float | None, announced: Any) -> None:
        self.number = -1  # of the task
        self.busy = False
        self.future: Future[Any] | None = None
        self.deadline_s: float | None = None
        self._limit_s = limit_s
        self._announced = announced  # shared by all processes: whether the compile line has been printed
        self._task: Flyable[_Result] | None = None
        self._pool: ProcessPoolExecutor | None = None
        self._process: Any = None
        self._extended_s: Any = None  # shared with the process: compile time, which does not count against the limit

    def take(self, number: int, task: Flyable[_Result]) -> None:
        """Begin with a task; the time that a new process takes to start does not count."""
        self.number, self._task, self.busy = number, task, True
        if self._pool is not None:
            with contextlib.suppress(BrokenProcessPool):  # it died while it had nothing to do
                self._fly()
                return
            self.end()
            self.busy = True
        self._begin()

    def _begin(self) -> None:
        """Start a process; it begins with the task when it is ready."""
        # Spawned, not forked: numba's threads and JSBSim's globals do not survive a fork.
        context, others = multiprocessing.get_context("spawn"), set(multiprocessing.active_children())
        # Without locks: a process killed while holding one would block the others.
        self._extended_s = context.Value("d", 0.0, lock=False)
        arguments = os.getpid(), self._extended_s, self._announced, tracebacks_shown(), lent.packed()
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_set_up, initargs=arguments)
        with _held_back(), _without_main():
            self.future = self._pool.submit(os.getpid)
        self._process = next(iter(set(multiprocessing.active_children()) - others), None)

    def look(self) -> "_Done[_Result] | _Gone | None":
        """The result of the task; None while it runs."""
        if self.future is None:
            return None
        if not self.future.done():
            if self.deadline_s is None:
                return None
            self.deadline_s += self._take_extension_s()
            if time.monotonic() < self.deadline_s:
                return None
            self.end()
            return _Gone(True, f"took longer than {self._limit_s:g} s and did not answer")
        future, self.future, self.deadline_s = self.future, None, None
        try:
            result = future.result()
        except BrokenProcessPool:
            return self._gone()
        if self._task is not None:
            try:
                self._fly()
            except BrokenProcessPool:
                return self._gone()
            return None
        self.busy = False
        return _Done(result)

    def end(self) -> None:
        """Kill the process."""
        self.busy, self.future, self.deadline_s = False, None, None
        if self._pool is None:
            return
        if self._process is not None:
            self._process.kill()
        self._pool.shutdown(wait=self._process is not None, cancel_futures=True)
        self._pool = self._process = None

    def _fly(self) -> None:
        if self._pool is None or self._task is None:
            return
        self.future = self._pool.submit(_fly, self._task, self._limit_s)
        self._task = None
        self.deadline_s = None if self._limit_s is None else time.monotonic() + self._limit_s + GRACE_S

    def _take_extension_s(self) -> float:
        extended_s, self._extended_s.value = float(self._extended_s.value), 0.0
        return extended_s

    def _gone(self) -> _Gone:
        code, end_s = None, time.monotonic() + GRACE_S
        # The pool's own thread may have asked the system first, and not have written the answer down yet.
        while self._process is not None and (code := self._process.exitcode) is None and time.monotonic() < end_s:
            time.sleep(0.005)
        self.end()
        return _Gone(False, f"the process that flew it {_how(code)}")


@contextlib.contextmanager
def _held_back() -> Iterator[None]:
    """A process started inside the block ignores Ctrl-C: the parent decides when it ends."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Start a process inside the block that does not run the user's script again, which may fly as it is imported."""
    main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _how(exitcode: int | None) -> str:
    """How a process ended."""
    if exitcode is not None and exitcode < 0:
        return f"was killed by signal {-exitcode} ({signal.strsignal(-exitcode)})"
    return "ended by itself" + ("" if exitcode is None else f" (exit code {exitcode})")


def _set_up(parent: int, extended_s: Any, announced: Any, tracebacks: bool, makers: dict[str, bytes]) -> None:
    """In a new process."""
    _Worker.inside = True
    end_with_parent(parent)
    lent.receive(makers)
    show_tracebacks(tracebacks)

    def extend(seconds: float) -> None:
        extended_s.value += seconds

    def tell(_progress: compiling.Progress) -> None:
        first, announced.value = not announced.value, True
        if first:
            console.note(console.COMPILING)
        compiling.on_compile(None)

    on_extended(extend)
    compiling.on_compile(tell)
    compiling.on_trouble(lambda line: console.error(f"kernel cache: {line}"))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)  # counts as a dead process, not as an interrupted flight
    with contextlib.suppress(OSError):
        os.dup2(2, 1)  # standard output may be carrying JSON
    sys.stdout = sys.stderr


def _leave(_number: int, _frame: FrameType | None) -> None:
    os._exit(128 + signal.SIGTERM)


def _fly(task: Flyable[_Result], limit_s: float | None) -> _Result:
    """In the worker process: the result of the task, whatever it raises."""
    try:
        with limited(limit_s):
            return task.fly()
    except TimedOut:
        return task.lost(Outcome.TIMED_OUT, f"took longer than {limit_s:g} s")
    except Interrupted:
        raise
    except BaseException as error:
        flight_code = isinstance(error, PluginError)
        return task.lost(Outcome.ESTIMATOR_FAILED if flight_code else Outcome.DIVERGED, described(error))
