"""The verdict: every check of every flight, the pooled checks, and the exit code."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from estimator.instruments import Known, to_json
from scenarios.harness.checks import Row
from scenarios.harness.metrics import summary
from scenarios.harness.scenario import Scenario
from sim.log import Flight, Outcome
from sim.outside.wording import json_text, markdown
from sim.rows import markdown_table

PASSED, FAILED, SIMULATION_FAILED = 0, 1, 3  # exit codes; 2 is for usage and configuration
# Outcomes that are errors: there is no complete flight to judge.
BROKEN = frozenset(
    (Outcome.DIVERGED, Outcome.ESTIMATOR_FAILED, Outcome.AUTOPILOT_FAILED, Outcome.TIMED_OUT, Outcome.WORKER_DIED,
     Outcome.SCENARIO_FAILED, Outcome.INTERRUPTED)
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FlightVerdict:
    """The verdict on one flight: which flight, its outcome, the results of its checks, and its metrics.

    rows : empty if nothing was recorded, because its process died or was stopped
    metrics : numbers by name, see `metrics_of`; empty if there are no rows
    known : what the estimator was given, or has learnt, about its instruments, by name
    wall_s : wall-clock time; None if not measured.  It is ignored by ``==``
    """

    scenario: str
    estimator: str
    seed: int
    outcome: Outcome
    rows: tuple[Row, ...]
    metrics: Mapping[str, float | None]
    message: str = ""
    flight: int = 0
    known: Mapping[str, Known] = field(default_factory=dict)
    wall_s: float | None = field(default=None, compare=False)

    @property
    def broken(self) -> bool:
        """Whether it ended in an error: flight code raised, the simulation blew up, or the process died."""
        return self.outcome in BROKEN or not self.rows

    @property
    def passed(self) -> bool:
        """Whether every check passed; False if there is none, or if the flight ended in an error."""
        return not self.broken and all(row.passed for row in self.rows)

    @property
    def ending(self) -> str:
        """The outcome in words, followed by the message if there is one."""
        words = self.outcome.replace("_", " ")
        return f"{words}: {self.message}" if self.message else words


@dataclass(frozen=True, slots=True)
class PooledVerdict:
    """The verdict on all flights of one scenario and estimator together."""

    scenario: str
    estimator: str
    n_flights: int
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        """Whether every pooled check passed."""
        return bool(self.rows) and all(row.passed for row in self.rows)


def judge(scenario: Scenario, flight: Flight) -> FlightVerdict:
    """Judge one flight of `scenario`."""
    config = flight.manifest["config"]
    known = {name: Known.from_json(entry) for name, entry in flight.manifest.get("known_to_estimator", {}).items()}
    rows = tuple(check.judge(flight) for check in scenario.checks)
    metrics = metrics_of(flight, rows)
    message = flight.message or next((f"check {row.name!r}: {row.note}" for row in rows if row.raised), "")
    if fault := flight.manifest.get("scenario_fault"):
        rows += (Row("milestones", "", math.nan, ">=", 1.0, False, fault, raised=True),)
    return FlightVerdict(
        scenario.name, config["estimator"], config["seed"], flight.outcome, rows, metrics, message,
        config["flight"], known,
    )  # fmt: skip


def metrics_of(flight: Flight, rows: Iterable[Row] = ()) -> dict[str, float | None]:
    """The numbers of one flight by name, each name with its unit; None if it could not be measured.

    First the general ones, which have the same names and meaning in every scenario (see `metrics.summary`); then the
    measured value of each check of `rows`, under the name that `metric_name` makes of it.
    """
    named: dict[str, float | None] = dict(summary(flight))
    for row in rows:
        name, n = metric_name(row.name, row.unit), 1
        while (key := name if n == 1 else f"{name}_{n}") in named:
            n += 1
        named[key] = row.measured if math.isfinite(row.measured) else None
    return named


def metric_name(check: str, unit: str) -> str:
    """The name of a check's value among the metrics: "heading error RMS", "deg" is ``heading_error_rms_deg``.

    Lower-case letters of ASCII, digits and underscores.
    """
    words = re.findall(r"[a-z0-9]+", f"{check} {unit}".lower())
    return "_".join(words) or "check"


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on all flights."""

    flights: tuple[FlightVerdict, ...]
    pooled: tuple[PooledVerdict, ...]
    missing: int = 0  # flights that were not finished

    @classmethod
    def of(cls, judged: Iterable[tuple[Scenario, FlightVerdict]], missing: int = 0) -> "Verdict":
        """The verdict on `judged` flights, pooled for each pair of scenario and estimator."""
        flights, groups = [], {}  # type: ignore[var-annotated]
        for scenario, flight in judged:
            flights.append(flight)
            groups.setdefault((scenario.name, flight.estimator), (scenario, []))[1].append(flight)
        pooled = [_pool(scenario, estimator, of_it) for (_, estimator), (scenario, of_it) in groups.items()]
        return cls(tuple(flights), tuple(pooled), missing)

    @property
    def passed(self) -> bool:
        """Whether every flight and every pooled check passed; False if there is no flight, or flights are missing."""
        return (
            bool(self.flights)
            and not self.missing
            and all(v.passed for v in self.flights)
            and all(v.passed for v in self.pooled)
        )

    @property
    def missing_text(self) -> str:
        """The number of missing flights, in words."""
        return f"{self.missing} of {len(self.flights) + self.missing} flights are missing"

    @property
    def exit_code(self) -> int:
        """0 if everything passed, 3 if a simulation blew up, else 1."""
        if any(flight.outcome == Outcome.DIVERGED for flight in self.flights):
            return SIMULATION_FAILED
        return PASSED if self.passed else FAILED

    def to_json(self) -> dict[str, Any]:
        """The verdict as plain data for JSON; None for a value that could not be measured."""
        return {
            "passed": self.passed,
            "flights": [
                {
                    "scenario": v.scenario, "estimator": v.estimator, "seed": v.seed, "flight": v.flight,
                    "outcome": str(v.outcome), "message": v.message, "passed": v.passed,
                    "checks": [row.to_json() for row in v.rows], "metrics": dict(v.metrics),
                    "known": to_json(v.known),
                }
                for v in self.flights
            ],
            "pooled": [
                {
                    "scenario": v.scenario, "estimator": v.estimator, "n_flights": v.n_flights,
                    "passed": v.passed, "checks": [row.to_json() for row in v.rows],
                }
                for v in self.pooled
            ],
        } | ({"interrupted": True} if self.missing else {})  # fmt: skip

    def to_json_text(self) -> str:
        """The verdict as JSON text."""
        return json_text(self.to_json()) + "\n"

    def flights_of(self, pool: PooledVerdict) -> list[FlightVerdict]:
        """The flights that were pooled."""
        return [v for v in self.flights if (v.scenario, v.estimator) == (pool.scenario, pool.estimator)]

    def to_junit(self) -> str:
        """The verdict as JUnit XML, see `junit`."""
        from scenarios.harness.gate.junit import junit

        return junit(self)

    def to_markdown(self) -> str:
        """The verdict as Markdown: the pooled table of each scenario, then the flights that failed."""
        lines = [f"# Verdict: {'passed' if self.passed else 'FAILED'}", ""]
        if self.missing:
            lines = ["# Verdict: INCOMPLETE", "", f"Interrupted: {self.missing_text}.", ""]
        for pool in self.pooled:
            title = f"{markdown(pool.scenario)}, {markdown(pool.estimator)}, {counted(pool.n_flights)}"
            lines += [f"## {title}", "", *markdown_table(pool.rows), ""]
            for v in self.flights_of(pool):
                if not v.passed:
                    ended = f"{v.outcome}: {v.message}" if v.message else str(v.outcome)
                    lines += [f"### seed {v.seed} flight {v.flight}: {markdown(ended)}", ""]
                    lines += [*markdown_table(v.rows), ""] if v.rows else []
        return "\n".join(lines)


def _pool(scenario: Scenario, estimator: str, flights: Sequence[FlightVerdict]) -> PooledVerdict:
    """Every check over the flights that have results; it fails if some have none."""
    judged = [v for v in flights if v.rows]
    rows = [check.pool([v.rows[i] for v in judged]) for i, check in enumerate(scenario.checks)]
    if missing := len(flights) - len(judged):
        note = f"{missing} of {len(flights)} flights missing"
        rows = [
            replace(
                row, passed=False, note="; ".join(filter(None, (note, row.note))),
                limit=len(flights) if check.pooled == "count" else row.limit,
            )
            for check, row in zip(scenario.checks, rows, strict=True)
        ]  # fmt: skip
    return PooledVerdict(scenario.name, estimator, len(flights), tuple(rows))


def counted(n: int) -> str:
    """`n` flights, in words."""
    return f"{n} flight" if n == 1 else f"{n} flights"
