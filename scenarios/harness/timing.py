"""What an update of an estimator costs, measured over the measurements of a flight."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np

from estimator.instruments import Instruments
from estimator.interface import AttitudeEstimator, Measurements
from scenarios.harness.equipping import equipped
from scenarios.harness.verdict import FAILED
from sim.outside.blame import home_of, theirs

REPEATS, MOST_NS = 7, 1_000_000_000


class NotTimed(RuntimeError):
    """A flight that ended early, or flight code that raised, while it was timed; `exit_code` as for a flight."""

    def __init__(self, why: str, exit_code: int = FAILED) -> None:
        super().__init__(why)
        self.exit_code = exit_code


@dataclass(frozen=True, slots=True)
class Cost:
    """What one update costs, ns: a call of ``update``, and of a whole log in one call if there is a ``replay``.

    failure : one line on what was raised while it was timed
    """

    update_ns: float
    replay_ns: float | None
    failure: str = ""

    @property
    def ns(self) -> float:
        """The lower of the two."""
        return self.update_ns if self.replay_ns is None else self.replay_ns


def cost(name: str, rows: np.ndarray, instruments: Instruments) -> Cost:
    """Least time of several passes over `rows`, per row; a slow estimator is timed over fewer passes.

    Raises
    ------
    NotTimed      the estimator raises
    """
    estimator = equipped(name, instruments).code
    with theirs(NotTimed, home_of(estimator)):
        return cost_of(estimator, rows)


def cost_of(estimator: AttitudeEstimator, rows: np.ndarray) -> Cost:
    """`cost` of an estimator that is powered up; what it raises is passed on."""
    rows = rows.copy()  # an estimator may write into them
    inputs = [Measurements(rows, k) for k in range(len(rows))]

    def stream() -> None:
        update = estimator.update
        for m in inputs:
            update(m)

    replay, update_ns = getattr(estimator, "replay", None), least_ns(stream) / len(rows)
    return Cost(update_ns, None if replay is None else least_ns(lambda: replay(rows)) / len(rows))


def least_ns(run: Callable[[], Any]) -> float:
    """Least time of several calls after a first one that does not count; fewer calls if they are slow."""
    run()
    times: list[int] = []
    while len(times) < REPEATS and sum(times) < MOST_NS:
        begin_ns = perf_counter_ns()
        run()
        times.append(perf_counter_ns() - begin_ns)
    return float(min(times))
