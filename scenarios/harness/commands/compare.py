"""Any set of estimators through one scenario: each flies it on the same seeds, through the same air and noise.

Every flight is closed loop: the autopilot steers on the estimate, so each estimator flies its own path, and one that is
wrong may fly it into the ground.  A flight is decided by scenario, seed, overrides and estimator alone: its numbers
are the same on any number of workers.  What an update costs is measured afterwards, one estimator at a time, over the
measurements of one short flight.
"""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from estimator import ESTIMATORS
from estimator.instruments import Instruments, Known, to_json
from estimator.interface import Array, HeadingReference, Measurements
from scenarios.harness.cli import console
from scenarios.harness.config import FlightConfig
from scenarios.harness.flight import Prepared, fly_scenario, prepare_config
from scenarios.harness.flight import prepare as prepare_flight
from scenarios.harness.gate.workers import fly_each
from scenarios.harness.metrics import Series, heading_error_deg, inclination_error_deg, rms
from scenarios.harness.plugins import (
    PluginError,
    equipped,
    load_estimator,
    shared_settings,
    uses_of,
    without,
)
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario
from scenarios.harness.verdict import FlightVerdict, PooledVerdict, Verdict, judge
from sim.log import Outcome
from sim.outside.blame import home_of, theirs
from sim.outside.wording import markdown, printable

FLIGHT_CODE_FAILED = {Outcome.ESTIMATOR_FAILED, Outcome.TIMED_OUT, Outcome.WORKER_DIED}
LETTERS = {"gyro": "G", "accelerometer": "A", "gps": "P", "magnetometer": "M", "airspeed": "V"}
TIMED_S, TIMED_REPEATS, TIMED_MOST_NS = 4.0, 7, 1_000_000_000
PREFIX = "estimator_params."
NO_SERIES = Series(np.empty(0), np.empty(0), np.empty(0, np.bool_))
_UNKNOWN = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")  # of a class that does not say


@dataclass(frozen=True, slots=True)
class Traced:
    """One flight of the comparison: the verdict on it, and its errors over time, for pooling and drawing."""

    verdict: FlightVerdict
    inclination: Series
    heading: Series


@dataclass(frozen=True, slots=True)
class Task:
    """One flight to be flown, by names, so that it can be sent to a process."""

    scenario: str
    seed: int
    estimator: str
    overrides: Mapping[str, Any]

    def fly(self) -> Traced:
        """Fly it, judge it, and keep its errors."""
        scenario = find(self.scenario)
        options: dict[str, Any] = {"seed": self.seed, "estimator": self.estimator, "lenient": True, "kept": True}
        flight = fly_scenario(scenario, self.overrides, **options)
        return Traced(judge(scenario, flight), inclination_error_deg(flight), heading_error_deg()(flight))

    def lost(self, outcome: Outcome, message: str) -> Traced:
        """What is to be known of it where nothing came back."""
        name = find(self.scenario).name
        return Traced(FlightVerdict(name, self.estimator, self.seed, outcome, (), {}, message), NO_SERIES, NO_SERIES)


@dataclass(frozen=True, slots=True)
class Cost:
    """What one update costs, ns: a call of `update`, and of a whole log in one call where there is a `replay`.

    failure : one line on what was raised while it was timed
    """

    update_ns: float
    replay_ns: float | None
    failure: str = ""

    @property
    def ns(self) -> float:
        """The less of the two."""
        return self.update_ns if self.replay_ns is None else self.replay_ns


@dataclass(frozen=True, slots=True)
class Entrant:
    """One estimator of the comparison: what it is given, and how its flights went.

    given : the instruments that it uses and that are fitted       n_planned : flights it was to fly
    pooled : the scenario's checks over all its flights; None where none was flown      timing : None where not measured
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
        """What an update costs; None where it was not measured, or failed."""
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
        heading = [f.heading.judged_values for f in self.flights]
        return {
            "inclination_rms_deg": _pooled_rms(inclination),
            "inclination_p95_deg": _over_all(inclination, lambda v: float(np.percentile(v, 95.0))),
            "inclination_max_deg": _over_all(inclination, lambda v: float(np.max(v))),
            "heading_rms_deg": _pooled_rms(heading),
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

        0 where all flew, 1 where flight code or the scenario's own functions failed, 3 where a simulation blew up, 130
        where it was interrupted
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


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be flown: everything that it names is there.

    named : how the scenario was named (a file may hold it)      changes, references, given : by the estimator's name
    notes : what is set for some of the estimators alone, a line each
    """

    named: str
    scenario: Scenario
    config: FlightConfig
    names: tuple[str, ...]
    seeds: tuple[int, ...]
    changes: Mapping[str, Mapping[str, Any]]
    notes: tuple[str, ...]
    references: Mapping[str, HeadingReference]
    given: Mapping[str, tuple[str, ...]]


def prepare(scenario: str, estimators: Sequence[str], seeds: Sequence[int], changes: Mapping[str, Any]) -> Plan:
    """Plan `scenario` with each of `estimators` (all that can be loaded, where none is named) on every seed.

    Raises
    ------
    ValueError      one line: what cannot be flown, before anything is
    """
    for name, instead in (("estimator", "--estimators"), ("seed", "--seeds")):
        if name in changes:
            raise ValueError(f"--set {name}={changes[name]}: name what is to be flown with {instead}")
    find(scenario)  # before anything is constructed, which may mean compiling for a while
    names = tuple(dict.fromkeys(estimators)) or tuple(name for name in ESTIMATORS if _can_be_loaded(name))
    settings = {key.removeprefix(PREFIX): value for key, value in changes.items() if key.startswith(PREFIX)}
    shared = {key: value for key, value in changes.items() if not key.startswith(PREFIX)}
    of_each = shared_settings(names, settings)
    changes_of = {name: shared | {PREFIX + key: value for key, value in of_each[name].items()} for name in names}
    prepared = {name: prepare_flight(scenario, {**changes_of[name], "estimator": name}, lenient=True) for name in names}
    first = prepared[names[0]]
    console.warn_of_faults(scenario, first.config)
    references = {name: of_it.heading_reference for name, of_it in prepared.items()}
    instruments = {name: given(of_it) for name, of_it in prepared.items()}
    notes = (*without(of_each, settings), *_unheard(prepared))
    return Plan(scenario, first.scenario, first.config, names, tuple(seeds), changes_of, notes, references, instruments)


def _unheard(prepared: Mapping[str, Prepared]) -> list[str]:
    """A line for each property of the instruments that is set and that some estimators have no parameter for.

    Raises
    ------
    ValueError      one line: one that none of them has, nor the autopilot
    """
    lines = []
    for setting, value in next(iter(prepared.values())).config.instruments.items():
        deaf = [name for name, of_it in prepared.items() if setting in of_it.unheard]
        if len(deaf) == len(prepared):
            raise ValueError(f"{setting} = {value!r}: none of them has such a parameter")
        if deaf:
            takers = ", ".join(name for name in prepared if name not in deaf)
            lines.append(f"{setting} is set for {takers}; without that parameter: {', '.join(deaf)}")
    return lines


def _can_be_loaded(name: str) -> bool:
    """Whether the package behind an estimator of the registry is there; one line says so where it is not."""
    try:
        load_estimator(name)
    except PluginError as problem:
        console.error(f"left out: {problem}")
        return False
    return True


def fly(plan: Plan, workers: int, advance: Callable[[int, int], None], *, limit_s: float | None = None) -> Comparison:
    """Fly what is planned; `advance` is told how many flights are done, of how many.

    limit_s : wall-clock limit of each flight

    Ctrl-C leaves flights out: the comparison is then of those finished.
    """
    # Seed by seed, so that an interruption leaves each estimator about as many flights as the others.
    tasks = [Task(plan.named, seed, name, plan.changes[name]) for seed in plan.seeds for name in plan.names]
    done = fly_each(
        tasks,
        workers,
        advance,
        limit_s=limit_s,
        interrupted=lambda flown: flown.verdict.outcome == Outcome.INTERRUPTED,
    )
    failed = {tasks[i].estimator for i in done if done[i].verdict.outcome in FLIGHT_CODE_FAILED}
    costs = _costs(plan, failed, limit_s) if len(done) == len(tasks) else {}
    entrants = []
    for name in plan.names:
        flights = tuple(done[i] for i in sorted(done) if tasks[i].estimator == name)
        pooled = Verdict.of((plan.scenario, f.verdict) for f in flights).pooled
        entrants.append(
            Entrant(
                name, plan.given[name], plan.references[name], len(plan.seeds), flights,
                pooled[0] if pooled else None, costs.get(name),
            )
        )  # fmt: skip
    return Comparison(plan.scenario, plan.config, plan.seeds, tuple(entrants), plan.notes)


def given(prepared: Prepared) -> tuple[str, ...]:
    """The instruments that are fitted in this flight and that its estimator uses."""
    fitted = {name for name in LETTERS if getattr(prepared.suite, name, None) is not None}
    return tuple(name for name in uses_of(prepared.estimator.code, _UNKNOWN) if name in fitted)


@dataclass(frozen=True, slots=True)
class _Timing:
    """What an update of one estimator costs, to be measured in a process of its own: it is anyone's code."""

    scenario: str
    config: str  # as JSON
    estimator: str

    def fly(self) -> Cost:
        """Measure it; its flights are kept where it raises."""
        try:
            return cost(self.estimator, *_measured(self.scenario, self.config))
        except (_NotTimed, ValueError) as problem:  # the latter of a script that asks for a longer flight
            return Cost(math.nan, None, str(problem))

    def lost(self, outcome: Outcome, message: str) -> Cost:
        """What is known of it where nothing came back."""
        return Cost(math.nan, None, f"{outcome.replace('_', ' ')}: {message}")


@lru_cache(maxsize=1)
def _measured(scenario: str, config: str) -> tuple[NDArray[Any], Instruments]:
    """Measurements of a flight, and what is known of its instruments."""
    prepared = prepare_config(find(scenario), FlightConfig.model_validate_json(config), lenient=True)
    return prepared.fly().log.measured, prepared.instruments


def _costs(plan: Plan, failed: Container[str], limit_s: float | None) -> dict[str, Cost]:
    """What an update of each that did not fail costs, over the measurements of the first seconds of a flight."""
    another = {"duration_s": TIMED_S, "estimator": "premerlani", "estimator_params": {}}
    config = plan.config.model_copy(update=another).model_dump_json()
    # The oracle answers in a flight alone.
    timed = [name for name in plan.names if name not in failed and name != "oracle"]
    found = fly_each([_Timing(plan.named, config, name) for name in timed], 1, lambda _n, _total: None, limit_s=limit_s)
    return {timed[i]: measured for i, measured in found.items()}


class _NotTimed(RuntimeError):
    """An estimator that raised while it was timed."""


def cost(name: str, rows: np.ndarray, instruments: Instruments) -> Cost:
    """Least time of several passes over `rows`, per row; a slow one is timed over fewer of them."""
    rows = rows.copy()  # an estimator may write into them
    inputs = [Measurements(rows, k) for k in range(len(rows))]
    estimator = equipped(name, instruments).code

    def stream() -> None:
        update = estimator.update
        for m in inputs:
            update(m)

    with theirs(_NotTimed, home_of(estimator)):
        replay, update_ns = getattr(estimator, "replay", None), _least_ns(stream) / len(rows)
        return Cost(update_ns, None if replay is None else _least_ns(lambda: replay(rows)) / len(rows))


def _least_ns(run: Callable[[], Any]) -> float:
    """Least time of several calls after one that does not count; of one that is slow, fewer."""
    run()
    times: list[int] = []
    while len(times) < TIMED_REPEATS and sum(times) < TIMED_MOST_NS:
        begin_ns = perf_counter_ns()
        run()
        times.append(perf_counter_ns() - begin_ns)
    return float(min(times))


def _pooled_rms(values: Sequence[Array]) -> float:
    each = np.array([rms(v) for v in values if len(v)])
    return rms(each)


def _over_all(values: Sequence[Array], reduce: Callable[[Array], float]) -> float:
    joined = np.concatenate(values) if values else np.empty(0)
    return reduce(joined) if len(joined) else math.nan


_HEADINGS = (
    "", "given", "inclination error\n  RMS   p95   max", "heading\nRMS", "us per\nupdate", "lasted,\nchecks",
)  # fmt: skip


def tell(comparison: Comparison) -> None:
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
