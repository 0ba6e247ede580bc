"""What a scenario demands: a metric, a limit for it, and how the flights of several seeds are judged together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenarios.harness.metrics import Measured, Metric, survived
from sim.log import Flight
from sim.outside.blame import Refused, home_of, shown, theirs

Pooling = Literal["rms", "worst", "count"]
Sense = Literal["<=", ">="]
LOOSEST = 1.5  # a flight's own limit may be this much looser than the pooled one


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a verdict.

    note : what is missing where the value rests on too few samples, or what the metric raised (`raised`)
    """

    name: str
    unit: str
    measured: float
    sense: Sense
    limit: float
    passed: bool
    note: str = ""
    raised: bool = False


class _NotMeasured(RuntimeError):
    """A metric, anyone's function, that raised, or returned something else."""


def _measured(value: Measured) -> Measured:
    """What a metric returned in plain numbers; Refused where it is something else."""
    if not isinstance(value, Measured):
        raise Refused(f"its metric returned {shown(value)}, must return a Measured")
    return Measured(float(value.value), int(value.samples), int(value.expected))


@dataclass(frozen=True, slots=True)
class Check:
    """One demand on a flight, and on several flights pooled.

    metric : value of one flight, with the samples it rests on
    limit, sense : of the pooled value, and of one flight where `per_flight_limit` is None
    pooled : "rms" root of the mean square over the flights, "worst" the worst of them, "count" how many pass
    per_flight_limit : at most 1.5 times as loose as `limit`
    """

    name: str
    unit: str
    metric: Metric
    limit: float
    sense: Sense = "<="
    pooled: Pooling = "worst"
    per_flight_limit: float | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.limit):
            raise ValueError(f"check {self.name!r}: limit {self.limit} {self.unit} must be a finite number")
        if self.per_flight_limit is None:
            return
        tight, loose = sorted((self.limit, self.per_flight_limit))
        looser = self.per_flight_limit == (loose if self.sense == "<=" else tight)
        if tight < 0.0 or not looser or loose > LOOSEST * tight:
            raise ValueError(
                f"check {self.name!r}: per_flight_limit {self.per_flight_limit:g} {self.unit} must be between the "
                f"pooled limit of {self.limit:g} {self.unit} and one that is {LOOSEST:g} times as loose"
            )

    def judge(self, flight: Flight) -> Row:
        """The line of one flight."""
        limit = self.limit if self.per_flight_limit is None else self.per_flight_limit
        try:
            with theirs(_NotMeasured, home_of(self.metric)):
                measured = _measured(self.metric(flight))
        except _NotMeasured as fault:
            return Row(self.name, self.unit, math.nan, self.sense, limit, False, str(fault), raised=True)
        note = "" if measured.complete else f"{measured.samples} of {measured.expected} samples"
        passed = measured.complete and self._holds(measured.value, limit)
        return Row(self.name, self.unit, measured.value, self.sense, limit, passed, note)

    def pool(self, rows: Sequence[Row]) -> Row:
        """The line of all flights, from the lines of each; a single flight is judged by its own limit."""
        short = sum(bool(row.note) for row in rows)
        note = f"{short} of {len(rows)} flights too short" if short else ""
        note = next((row.note for row in rows if row.raised), note)
        if self.pooled == "count":
            passing = sum(row.passed for row in rows)
            whole = passing == len(rows) > 0
            return Row(f"{self.name}: flights that pass", "flights", passing, ">=", len(rows), whole, note)
        value = self._pooled_value(np.array([row.measured for row in rows]))
        limit = rows[0].limit if len(rows) == 1 else self.limit
        passed = len(rows) > 0 and not short and self._holds(value, limit)
        return Row(self.name, self.unit, value, self.sense, limit, passed, note)

    def _pooled_value(self, values: np.ndarray) -> float:
        if len(values) == 0 or np.isnan(values).any():
            return math.nan
        if self.pooled == "rms":
            return float(np.sqrt(np.mean(values**2)))
        return float(values.max() if self.sense == "<=" else values.min())

    def _holds(self, value: float, limit: float) -> bool:
        """Written so that NaN fails."""
        return bool(value <= limit if self.sense == "<=" else value >= limit)


SURVIVED = Check("survived", "", survived, 1.0, ">=", "count")
