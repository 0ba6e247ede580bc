"""The result of a comparison: a line of numbers for each estimator, printed, as JSON and as Markdown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.text import Text

from estimator.instruments import Known, to_json
from estimator.interface import Array, HeadingReference
from scenarios.harness.cli import console
from scenarios.harness.config import FlightConfig
from scenarios.harness.metrics import Series, highest, p95, rms
from scenarios.harness.scenario import Scenario
from scenarios.harness.timing import Cost
from scenarios.harness.verdict import FlightVerdict, PooledVerdict, Verdict
from sim.log import Outcome
from sim.outside.wording import markdown, printable

FLIGHT_CODE_FAILED = {Outcome.ESTIMATOR_FAILED, Outcome.TIMED_OUT, Outcome.WORKER_DIED}
LETTERS = {"gyro": "G", "accelerometer": "A", "gps": "P", "magnetometer": "M", "airspeed": "V"}
NO_SERIES = Series(np.empty(0), np.empty(0), np.empty(0, np.bool_))


@dataclass(frozen=True, slots=True)
class Traced:
    """One flight of the comparison: the verdict on it, and its errors over time, for pooling and drawing."""

    verdict: FlightVerdict
    inclination: Series
    heading: Series


@dataclass(frozen=True, slots=True)
class Entrant:
    """One estimator of the comparison: what it is given, and how its flights went.

    given : the instruments that it uses and that are fitted       n_planned : flights it was to fly
    pooled : the scenario's checks over all its flights; None if none was flown      timing : None if not measured
    """

    name: str
    given: tuple[str, ...]
    heading_reference: HeadingReference
    n_planned: int
    flights: tuple[Traced, ...]
    pooled: PooledVerdict | None
    timing: Cost | None = None

    @property
    def cost(self) -> Cost | None:
        """What an update costs; None if it was not measured, or failed."""
        return None if self.timing is None or self.timing.failure else self.timing

    @property
    def known(self) -> dict[str, Known]:
        """What it was given of the instruments; of what it learnt, the median over its flights."""
        if not self.flights:
            return {}
        each = [flown.verdict.known for flown in self.flights]
        values = {name: [k[name].value for k in each if k[name].source == "learnt"] for name in each[0]}
        return {
            name: Known(float(np.median(values[name])), "learnt") if values[name] else entry
            for name, entry in each[0].items()
        }

    @property
    def survived(self) -> int:
        """Flights that lasted as long as planned."""
        return sum(f.verdict.outcome == Outcome.COMPLETED for f in self.flights)

    @property
    def checks_passed(self) -> int:
        """Pooled checks of the scenario that it passes."""
        return sum(row.passed for row in self.pooled.rows) if self.pooled else 0

    @property
    def numbers(self) -> dict[str, float]:
        """Its errors: RMS as the root of the mean square over flights, the others over all samples of all flights."""
        inclination = [f.inclination.judged_values for f in self.flights]
        joined = np.concatenate([np.empty(0), *inclination])
        return {
            "inclination_rms_deg": _pooled_rms(inclination),
            "inclination_p95_deg": p95(joined),
            "inclination_max_deg": highest(joined),
            "heading_rms_deg": _pooled_rms([f.heading.judged_values for f in self.flights]),
        }

    def to_json(self) -> dict[str, Any]:
        """Its line as plain data; what could not be measured is None."""
        return {
            "estimator": self.name,
            "given": list(self.given),
            "known": to_json(self.known),
            "heading_reference": self.heading_reference,
            "flights": len(self.flights),
            "survived": self.survived,
            **{name: value if math.isfinite(value) else None for name, value in self.numbers.items()},
            "update_ns": self.cost.update_ns if self.cost else None,
            "replay_ns": self.cost.replay_ns if self.cost else None,
            **({"failure": self.timing.failure} if self.timing and self.timing.failure else {}),
            "checks": len(self.pooled.rows) if self.pooled else 0,
            "checks_passed": self.checks_passed,
        }


@dataclass(frozen=True, slots=True)
class Comparison:
    """What is printed, drawn and written."""

    scenario: Scenario
    config: FlightConfig
    seeds: tuple[int, ...]
    entrants: tuple[Entrant, ...]
    notes: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether every flight that was planned was finished."""
        return all(len(e.flights) == e.n_planned for e in self.entrants)

    @property
    def exit_code(self) -> int:
        """As of the command line.

        0 if all flew, 1 if flight code or the scenario's own functions failed, 3 if a simulation blew up, 130
        if it was interrupted
        """
        outcomes = {f.verdict.outcome for e in self.entrants for f in e.flights}
        if not self.whole:
            return console.INTERRUPTED
        if Outcome.DIVERGED in outcomes:
            return 3
        not_timed = any(e.timing is not None and e.timing.failure for e in self.entrants)
        raised = any(row.raised for e in self.entrants for f in e.flights for row in f.verdict.rows)
        failed = outcomes & {*FLIGHT_CODE_FAILED, Outcome.AUTOPILOT_FAILED, Outcome.SCENARIO_FAILED}
        return 1 if failed or not_timed or raised else 0

    def to_json(self) -> dict[str, Any]:
        """All of it as plain data: a line per estimator, and the verdict on every flight as `check` writes it."""
        verdicts = Verdict(tuple(f.verdict for e in self.entrants for f in e.flights), ()).to_json()["flights"]
        return {
            "scenario": self.scenario.name,
            "seeds": list(self.seeds),
            "estimators": [e.to_json() for e in self.entrants],
            "notes": list(self.notes),
            "flights": verdicts,
        } | ({} if self.whole else {"interrupted": True})

    def to_markdown(self) -> str:
        """The table as Markdown."""
        headings = (
            "estimator", "given", "survived", "inclination RMS, deg", "p95", "max", "heading RMS, deg", "against",
            "update(), ns", "replay, ns", "checks passed",
        )  # fmt: skip
        lines = [f"# {markdown(title(self))}", "", f"| {' | '.join(headings)} |", "|-|-|" + "-:|" * 5 + "-|-:|-:|-:|"]
        for e in self.entrants:
            n = e.numbers
            costs = (e.cost.update_ns, e.cost.replay_ns) if e.cost else (None, None)
            cells = [
                markdown(e.name), ", ".join(e.given), f"{e.survived} of {len(e.flights)}",
                *map(console.number, n.values()),
                e.heading_reference, *("" if c is None else f"{c:.0f}" for c in costs), checks_text(e),
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
        return "\n".join(lines) + "\n"


def title(comparison: Comparison) -> str:
    """What was flown, in a line."""
    n = len(comparison.seeds)
    return f"{comparison.scenario.name}, {n} {'seed' if n == 1 else 'seeds'}"


def checks_text(entrant: Entrant) -> str:
    """How many of the scenario's checks it passes."""
    return f"{entrant.checks_passed}/{len(entrant.pooled.rows)}" if entrant.pooled else "none"


def _pooled_rms(values: Sequence[Array]) -> float:
    return rms(np.array([rms(v) for v in values if len(v)]))


_HEADINGS = (
    "", "given", "inclination error\n  RMS   p95   max", "heading\nRMS", "us per\nupdate", "lasted,\nchecks",
)  # fmt: skip


def print_report(comparison: Comparison) -> None:
    """The table, what its letters mean, and the flights that did not end as planned."""
    out = console.out()
    rows = [_row(entrant) for entrant in comparison.entrants]
    out.print(console.table(title(comparison), _HEADINGS, rows, text=(0, 1), wrapping=(0,)))
    present = dict.fromkeys(name for e in comparison.entrants for name in e.given)
    letters = ", ".join(f"{letter} {name}" for name, letter in LETTERS.items() if name in present)
    out.print(
        Text(
            f"given: {letters}\nerrors in degrees; heading: c against the course over ground, n against the nose\n"
            "us per update: over a log in one call; * each update() called from Python\n"
            "lasted: flights that did not end early; checks: of the scenario, passed over all seeds",
            "dim",
        )
    )
    for line in comparison.notes:
        console.line(f"note        {line}")
    console.print_known({entrant.name: entrant.known for entrant in comparison.entrants})
    for entrant in comparison.entrants:
        if entrant.timing is not None and entrant.timing.failure:
            console.line(f"{entrant.name}, while it was timed: {entrant.timing.failure}", "red")
        for flown in entrant.flights:
            v = flown.verdict
            if v.outcome != Outcome.COMPLETED or any(row.raised for row in v.rows):
                at = f" at {v.metrics.get('flown_s') or 0.0:.1f} s" if v.rows else ""
                why = f"{v.outcome.replace('_', ' ')}{at}" + (f": {v.message}" if v.message else "")
                console.line(f"{entrant.name}, seed {v.seed}: {why}", "red")


def _row(e: Entrant) -> list[str]:
    """A line of the table: numbers that belong together in one cell, so that it fits 80 columns."""
    n = e.numbers
    inclination = f"{n['inclination_rms_deg']:5.2f} {n['inclination_p95_deg']:5.1f} {n['inclination_max_deg']:5.1f}"
    heading = f"{n['heading_rms_deg']:.1f} {e.heading_reference[0]}"
    letters = "".join(LETTERS[name] for name in e.given)
    spent = "" if e.cost is None else f"{e.cost.ns / 1000.0:.2f}{'' if e.cost.replay_ns else '*'}"
    return [printable(e.name), letters, inclination, heading, spent, f"{e.survived}/{len(e.flights)} {checks_text(e)}"]
