"""The verdict: every check of every flight, the same pooled over the flights, and the exit code."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

from estimator.instruments import Known, to_json
from scenarios.harness.checks import Row
from scenarios.harness.metrics import summary
from scenarios.harness.scenario import Scenario
from sim.log import Flight, Outcome

PASSED, FAILED, SIMULATION_FAILED = 0, 1, 3  # exit codes; 2 is for usage and configuration


@dataclass(frozen=True, slots=True)
class FlightVerdict:
    """One flight judged: which it was, how it ended, its lines, and the numbers reported beside them.

    known : what the estimator was given of the instruments, or has learnt, by name
    """

    scenario: str
    estimator: str
    seed: int
    outcome: Outcome
    rows: tuple[Row, ...]
    metrics: dict[str, Any]
    message: str = ""
    flight: int = 0
    known: Mapping[str, Known] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether every check passed; False where there was none."""
        return bool(self.rows) and all(row.passed for row in self.rows)


@dataclass(frozen=True, slots=True)
class PooledVerdict:
    """The flights of one scenario and estimator judged together."""

    scenario: str
    estimator: str
    n_flights: int
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        """Whether every pooled check passed."""
        return bool(self.rows) and all(row.passed for row in self.rows)


def judge(scenario: Scenario, flight: Flight) -> FlightVerdict:
    """Verdict on one flight of `scenario`."""
    config = flight.manifest["config"]
    known = {name: Known.from_json(entry) for name, entry in flight.manifest.get("known_to_estimator", {}).items()}
    rows = tuple(check.judge(flight) for check in scenario.checks)
    message = flight.message or next((f"check {row.name!r}: {row.note}" for row in rows if row.raised), "")
    if fault := flight.manifest.get("scenario_fault"):
        rows += (Row("milestones", "", math.nan, ">=", 1.0, False, fault, raised=True),)
    return FlightVerdict(
        scenario.name, config["estimator"], config["seed"], flight.outcome, rows, summary(flight), message,
        config["flight"], known,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdict on all flights flown."""

    flights: tuple[FlightVerdict, ...]
    pooled: tuple[PooledVerdict, ...]

    @classmethod
    def of(cls, judged: Iterable[tuple[Scenario, FlightVerdict]]) -> "Verdict":
        """Verdict from the flights of one or several scenarios and estimators, pooled over each pair of them."""
        flights, groups = [], {}  # type: ignore[var-annotated]
        for scenario, flight in judged:
            flights.append(flight)
            groups.setdefault((scenario.name, flight.estimator), (scenario, []))[1].append(flight)
        pooled = [_pool(scenario, estimator, of_it) for (_, estimator), (scenario, of_it) in groups.items()]
        return cls(tuple(flights), tuple(pooled))

    @property
    def passed(self) -> bool:
        """Whether every flight and every pooled check passed; False where nothing was flown."""
        return bool(self.flights) and all(v.passed for v in self.flights) and all(v.passed for v in self.pooled)

    @property
    def exit_code(self) -> int:
        """0 where all passed, 3 where a simulation blew up, else 1."""
        if any(flight.outcome == Outcome.DIVERGED for flight in self.flights):
            return SIMULATION_FAILED
        return PASSED if self.passed else FAILED

    def to_json(self) -> dict[str, Any]:
        """The verdict as plain data for JSON; a value that could not be measured is None."""
        return {
            "passed": self.passed,
            "flights": [
                {
                    "scenario": v.scenario, "estimator": v.estimator, "seed": v.seed, "flight": v.flight,
                    "outcome": str(v.outcome), "message": v.message, "passed": v.passed,
                    "checks": [plain(row) for row in v.rows], "metrics": v.metrics,
                    "known": to_json(v.known),
                }
                for v in self.flights
            ],
            "pooled": [
                {
                    "scenario": v.scenario, "estimator": v.estimator, "n_flights": v.n_flights,
                    "passed": v.passed, "checks": [plain(row) for row in v.rows],
                }
                for v in self.pooled
            ],
        }  # fmt: skip

    def to_json_text(self) -> str:
        """The verdict as JSON text."""
        return json.dumps(self.to_json(), indent=2, allow_nan=False) + "\n"

    def to_junit(self) -> str:
        """The verdict as JUnit XML: a suite per scenario and estimator, a case per check of each flight and pooled."""
        root = ElementTree.Element("testsuites", name="wingslevel")
        for pool in self.pooled:
            of_it = [v for v in self.flights if (v.scenario, v.estimator) == (pool.scenario, pool.estimator)]
            cases = [(f"seed {v.seed} flight {v.flight}", row, v.message) for v in of_it for row in v.rows]
            cases += [("pooled", row, "") for row in pool.rows]
            suite = ElementTree.SubElement(
                root, "testsuite", name=f"{pool.scenario}.{pool.estimator}", tests=str(len(cases)),
                failures=str(sum(not row.passed for _, row, _ in cases)), errors="0",
            )  # fmt: skip
            for which, row, message in cases:
                case = ElementTree.SubElement(
                    suite, "testcase", classname=suite.get("name", ""), name=f"{row.name} [{which}]"
                )
                if not row.passed:
                    text = "; ".join(
                        part for part in (f"{measured_text(row)}, limit {limit_text(row)}", message) if part
                    )
                    ElementTree.SubElement(case, "failure", message=_printable(text))
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"

    def to_markdown(self) -> str:
        """The verdict as Markdown: the pooled table of each scenario, then the flights that failed."""
        lines = [f"# Verdict: {'passed' if self.passed else 'FAILED'}", ""]
        for pool in self.pooled:
            of_it = [v for v in self.flights if (v.scenario, v.estimator) == (pool.scenario, pool.estimator)]
            lines += [f"## {pool.scenario}, {pool.estimator}, {_counted(pool.n_flights)}", "", *_table(pool.rows), ""]
            for v in of_it:
                if not v.passed:
                    lines += [f"### seed {v.seed} flight {v.flight}: {v.message or v.outcome}", "", *_table(v.rows), ""]
        return "\n".join(lines)


def _pool(scenario: Scenario, estimator: str, flights: Sequence[FlightVerdict]) -> PooledVerdict:
    rows = (check.pool([v.rows[i] for v in flights]) for i, check in enumerate(scenario.checks))
    return PooledVerdict(scenario.name, estimator, len(flights), tuple(rows))


def _counted(n: int) -> str:
    return f"{n} flight" if n == 1 else f"{n} flights"


def plain(row: Row) -> dict[str, Any]:
    """A line as plain data for JSON; what could not be measured is None."""
    measured = row.measured if math.isfinite(row.measured) else None
    plain = {"name": row.name, "unit": row.unit, "measured": measured, "sense": row.sense, "limit": row.limit,
             "passed": row.passed}  # fmt: skip
    return plain | ({"note": row.note} if row.note else {})


def measured_text(row: Row) -> str:
    """The measured value as people read it, with its unit and what is missing."""
    value = f"{row.measured:.4g} {row.unit}".strip() if math.isfinite(row.measured) else "not measured"
    return f"{value} ({row.note})" if row.note else value


def limit_text(row: Row) -> str:
    """The limit as people read it."""
    return f"{row.sense} {row.limit:.4g} {row.unit}".strip()


def _table(rows: Sequence[Row]) -> list[str]:
    lines = ["| check | measured | limit | verdict |", "|-|-|-|-|"]
    return lines + [
        f"| {row.name} | {measured_text(row)} | {limit_text(row)} | {'pass' if row.passed else '**FAIL**'} |"
        for row in rows
    ]


def _printable(text: str) -> str:
    """`text` without the control characters that XML cannot hold."""
    return "".join(c for c in text if c.isprintable())
