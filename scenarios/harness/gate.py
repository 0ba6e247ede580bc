"""Many flights judged: every scenario on every seed, over several processes, the same whatever their number.

A flight is decided by its scenario, its overrides and its seed alone, and the verdicts are put together in the order
in which the flights were named, so neither the number of workers nor their speed shows in the result.
"""

import multiprocessing
import os
import re
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from rich.text import Text

from scenarios.harness import console
from scenarios.harness.flight import fly_scenario
from scenarios.harness.preflight import prepared
from scenarios.harness.registry import find, matching
from scenarios.harness.verdict import FlightVerdict, Verdict, judge
from sim.log import Outcome

LARGEST_SEED = 2**32 - 1
_Result = TypeVar("_Result")
_Told = TypeVar("_Told", covariant=True)


class WorkerDied(RuntimeError):
    """A worker process was killed from outside, so that flights are missing."""


class Flyable(Protocol[_Told]):
    """A flight that can be sent to a process."""

    def fly(self) -> _Told:
        """Fly it, and say what is to be known of it."""
        ...


@dataclass(frozen=True, slots=True)
class Task:
    """One flight to be flown, by names, so that it can be sent to a process."""

    scenario: str
    seed: int
    estimator: str | None
    overrides: Mapping[str, Any]

    def fly(self) -> FlightVerdict:
        """Fly it and judge it."""
        scenario = find(self.scenario)
        flight = fly_scenario(scenario, self.overrides, seed=self.seed, estimator=self.estimator, kept=True)
        return judge(scenario, flight)


def tasks(names: Sequence[str], seeds: Sequence[int], estimator: str | None, changes: Mapping[str, Any]) -> list[Task]:
    """Every scenario of `names` (all there are, where it is empty) on every seed.

    With an estimator of one's own, those that pass where their own estimator fails are left out, unless named in full.

    Raises
    ------
    ValueError      one line: what cannot be flown, before anything is
    """
    wanted, left_out = matching(names or ["*"]), []
    if estimator is not None:
        left_out = [name for name in wanted if name not in names and find(name).shows_failure]
        wanted = [name for name in wanted if name not in left_out]
        if not wanted:
            raise ValueError(f"{', '.join(left_out)}: passes where its own estimator fails; to fly it, name it in full")
    for name in wanted:
        _, config = prepared(name, changes if estimator is None else {**changes, "estimator": estimator})
        console.warn_of_faults(name, config)
    console.note_left_out(left_out)
    return [Task(name, seed, estimator, changes) for name in wanted for seed in seeds]


def tell(verdict: Verdict) -> None:
    """The pooled tables, then the flights that failed, each on a line."""
    out = console.out()
    for pool in verdict.pooled:
        out.print(console.verdict_table(f"{pool.scenario}, {pool.estimator}, {pool.n_flights} flights", pool.rows))
    for flight in verdict.flights:
        if not flight.passed:
            failed = ", ".join(
                f"{row.name} {console.number(row.measured)} {row.unit}".rstrip()
                for row in flight.rows
                if not row.passed
            )
            why = f"{flight.outcome.replace('_', ' ')}: {flight.message}" if flight.message else failed
            out.print(Text(f"FAIL {flight.scenario}, seed {flight.seed}: {why}", "red"), soft_wrap=True)
    flights, pooled = (f"{sum(v.passed for v in vs)} of {len(vs)}" for vs in (verdict.flights, verdict.pooled))
    out.print(f"passed: {flights} flights, {pooled} scenarios pooled")


def parse_seeds(text: str) -> list[int]:
    """Seeds of what a person types: ``0-9``, ``3``, ``0,2,5-7``; each once, in that order.

    Raises
    ------
    ValueError      naming what would be right
    """
    right = "write numbers and ranges, for instance 0-9 or 0,2,5-7"
    seeds: dict[int, None] = {}
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part)
        if not found:
            raise ValueError(f"seeds = {text!r}: {right}")
        first, last = int(found[1]), int(found[2] or found[1])
        if not first <= last <= LARGEST_SEED:
            raise ValueError(f"seeds = {text!r}: {part.strip()} is no range of seeds from 0 to {LARGEST_SEED}; {right}")
        if last - first >= 1_000_000:
            raise ValueError(f"seeds = {text!r}: {last - first + 1} flights at once are too many; split them")
        seeds |= dict.fromkeys(range(first, last + 1))
    return list(seeds)


def fly_all(tasks: Sequence[Task], workers: int, advance: Callable[[int, int], None]) -> tuple[Verdict, bool]:
    """Fly and judge all `tasks`; `advance` is told how many are done, of how many.

    Returns
    -------
    the verdict on the flights that were finished, and whether these are all: Ctrl-C leaves some out, and so does a
    worker process that was killed (one line says so)

    Raises
    ------
    ValueError      as `fly_scenario` does
    """
    done = fly_each(tasks, workers, advance, lambda verdict: verdict.outcome == Outcome.INTERRUPTED)
    return Verdict.of((find(tasks[i].scenario), done[i]) for i in sorted(done)), len(done) == len(tasks)


def fly_each(
    tasks: Sequence[Flyable[_Result]],
    workers: int,
    advance: Callable[[int, int], None],
    interrupted: Callable[[_Result], bool],
) -> dict[int, _Result]:
    """Fly all `tasks`: the results that were finished, by the number of the task; those missing as in `fly_all`."""
    done: dict[int, _Result] = {}

    def keep(i: int, result: _Result) -> None:
        if interrupted(result):
            raise KeyboardInterrupt
        done[i] = result
        advance(len(done), len(tasks))

    try:
        if workers == 1:
            for i, task in enumerate(tasks):
                keep(i, task.fly())
        else:
            _fly_over_processes(tasks, workers, keep)
    except KeyboardInterrupt:
        pass  # what has been finished is judged; the caller sees that flights are missing
    except WorkerDied as problem:
        console.error(str(problem))
    return done


def _fly_over_processes(tasks: Sequence[Flyable[_Result]], workers: int, keep: Callable[[int, _Result], None]) -> None:
    # Spawned, not forked: numba's threads and JSBSim's globals do not survive a fork.
    context = multiprocessing.get_context("spawn")
    workers = min(workers, len(tasks))
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_set_up_worker) as pool:
        waiting: dict[Future[_Result], int] = {pool.submit(task.fly): i for i, task in enumerate(tasks)}
        try:
            while waiting:
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    keep(waiting.pop(future), future.result())
        except KeyboardInterrupt:
            for worker in multiprocessing.active_children():  # what they are at is thrown away: it may take long
                worker.terminate()
            raise
        except BrokenProcessPool as error:
            raise WorkerDied(f"a worker process died with {len(waiting)} flights to go; try fewer --workers") from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _set_up_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    sys.stdout = sys.stderr  # standard output may be carrying JSON
