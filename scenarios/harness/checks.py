"""The checks of a scenario: a metric, its limit, and how the flights of several seeds are judged together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scenarios.harness import metrics
from scenarios.harness.metrics import Measured, Metric, Moment, SeriesOf, end, over, start, survived
from sim.log import Flight
from sim.outside.blame import Refused, home_of, shown, theirs
from sim.rows import Row as Row
from sim.rows import Sense as Sense

Pooling = Literal["rms", "worst", "count"]
LOOSEST = 1.5  # a flight's own limit may be this much looser than the pooled one


class _NotMeasured(RuntimeError):
    """A metric that raised, or did not return a Measured."""


def _measured(value: Measured) -> Measured:
    """What a metric returned, as plain numbers; Refused if it is not a Measured."""
    if not isinstance(value, Measured):
        raise Refused(f"its metric returned {shown(value)}; it must return a Measured")
    return Measured(float(value.value), int(value.samples), int(value.expected))


@dataclass(frozen=True, slots=True)
class Check:
    """A limit on one metric, for a single flight and for several flights pooled.

    metric : value of one flight, and the number of samples it rests on
    limit, sense : of the pooled value; also of a single flight if `per_flight_limit` is None
    pooled : "rms" root of the mean square over the flights, "worst" the worst flight, "count" the flights that pass
    per_flight_limit : limit of a single flight, at most 1.5 times as loose as `limit`

    The constructors below (`rms`, `highest`, `lowest`, `settling`) reduce a series between two moments, by default from
    the release to the planned end.
    """

    name: str
    unit: str
    metric: Metric
    limit: float
    sense: Sense = "<="
    pooled: Pooling = "worst"
    per_flight_limit: float | None = None

    @classmethod
    def rms(
        cls, name: str, unit: str, series: SeriesOf, limit: float, from_: Moment = start, to: Moment = end, *,
        per_flight_limit: float | None = None, judged_share: float = 1.0,
    ) -> "Check":  # fmt: skip
        """RMS of `series`, at most `limit` over all flights and `per_flight_limit`, 1.5 times that, in each.

        judged_share : fraction of the window's ticks that must be judged, see `metrics.over`
        """
        metric = over(series, metrics.rms, from_, to, judged_share=judged_share)
        each = LOOSEST * limit if per_flight_limit is None else per_flight_limit
        return cls(name, unit, metric, limit, pooled="rms", per_flight_limit=each)

    @classmethod
    def highest(
        cls, name: str, unit: str, series: SeriesOf, limit: float, from_: Moment = start, to: Moment = end, *,
        judged_share: float = 1.0,
    ) -> "Check":  # fmt: skip
        """Largest value of `series`: at most `limit` in every flight."""
        return cls(name, unit, over(series, metrics.highest, from_, to, judged_share=judged_share), limit)

    @classmethod
    def lowest(
        cls, name: str, unit: str, series: SeriesOf, limit: float, from_: Moment = start, to: Moment = end
    ) -> "Check":
        """Smallest value of `series`: at least `limit` in every flight."""
        return cls(name, unit, over(series, metrics.lowest, from_, to), limit, ">=")

    @classmethod
    def settling(
        cls, name: str, series: SeriesOf, within: float, limit_s: float, from_: Moment = start, to: Moment = end
    ) -> "Check":
        """Time from `from_` until `series` stays at or below `within` up to `to`: at most `limit_s` in every flight."""
        return cls(name, "s", metrics.settling(series, within, from_, to), limit_s)

    def limited(self, limit: float) -> "Check":
        """The same check with another `limit`; the limit of a single flight keeps its ratio to it."""
        each = None if self.per_flight_limit is None else self.per_flight_limit * (limit / self.limit)
        return replace(self, limit=limit, per_flight_limit=each)

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
        """The result for one flight."""
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
        """The result over all flights, from that of each; a single flight is judged by the per-flight limit."""
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
        """Whether `value` is within `limit`; NaN is not."""
        return bool(value <= limit if self.sense == "<=" else value >= limit)


SURVIVED = Check("survived", "", survived, 1.0, ">=", "count")
