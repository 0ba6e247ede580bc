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
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from estimator import ESTIMATORS
from estimator.instruments import Instruments
from estimator.interface import HeadingReference
from scenarios.harness.cli import console
from scenarios.harness.cli.options import Changes
from scenarios.harness.cli.reports import attempt, check_file, check_picture, reporting, usage, write
from scenarios.harness.commands.comparison import (
    FLIGHT_CODE_FAILED,
    LETTERS,
    NO_SERIES,
    Comparison,
    Entrant,
    Traced,
    print_report,
)
from scenarios.harness.commands.listing import note_ignored
from scenarios.harness.config import FlightConfig, is_field
from scenarios.harness.equipping import load_estimator, uses_of
from scenarios.harness.flight import Prepared, fly_scenario, prepare_config
from scenarios.harness.flight import prepare as prepare_flight
from scenarios.harness.gate import guard
from scenarios.harness.gate.preparing import in_time
from scenarios.harness.gate.workers import fly_each, processors
from scenarios.harness.metrics import heading_error_deg, inclination_error_deg
from scenarios.harness.plugins import PluginError
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario
from scenarios.harness.seeds import parse_seeds
from scenarios.harness.settings import PREFIX, lines_on_others, shared_settings, split
from scenarios.harness.timing import Cost, NotTimed, cost
from scenarios.harness.verdict import FlightVerdict, Verdict, judge
from sim.log import Outcome

TIMED_S = 4.0
_UNKNOWN = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")  # for a class that does not say


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
        """The result if the process was lost."""
        name = find(self.scenario).name
        return Traced(FlightVerdict(name, self.estimator, self.seed, outcome, (), {}, message), NO_SERIES, NO_SERIES)


@dataclass(frozen=True, slots=True)
class Plan:
    """The flights of a comparison; all names in it have been checked.

    named : name or file of the scenario      changes, references, given : by the estimator's name
    notes : parameters that only some of the estimators have, one line each
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
    """Plan `scenario` with each of `estimators` (all that can be loaded by default) on every seed.

    Raises
    ------
    ValueError      one line: what cannot be flown, before anything is
    """
    for name, instead in (("estimator", "--estimators"), ("seed", "--seeds")):
        if name in changes:
            raise ValueError(f"--set {name}={changes[name]}: name what is to be flown with {instead}")
    flown = find(scenario).config  # before anything is constructed, since that may compile
    names = tuple(dict.fromkeys(estimators)) or tuple(name for name in ESTIMATORS if _can_be_loaded(name))
    shared, settings = split(changes, names, lambda name: is_field(name, flown, changes))
    of_each = shared_settings(names, settings)
    changes_of = {name: shared | {PREFIX + key: value for key, value in of_each[name].items()} for name in names}
    prepared = {name: prepare_flight(scenario, {**changes_of[name], "estimator": name}, lenient=True) for name in names}
    first = prepared[names[0]]
    console.warn_of_faults(scenario, first.config)
    for of_it in prepared.values():
        note_ignored(scenario, of_it.config)
    references = {name: of_it.heading_reference for name, of_it in prepared.items()}
    instruments = {name: given(of_it) for name, of_it in prepared.items()}
    notes = (*lines_on_others(of_each, settings), *_unheard(prepared))
    return Plan(scenario, first.scenario, first.config, names, tuple(seeds), changes_of, notes, references, instruments)


def _unheard(prepared: Mapping[str, Prepared]) -> list[str]:
    """A line for each property of the instruments that is set and that some estimators have no parameter for.

    Raises
    ------
    ValueError      one line: a property that neither an estimator nor the autopilot has
    """
    lines = []
    for setting, value in next(iter(prepared.values())).config.instruments.items():
        deaf = [name for name, of_it in prepared.items() if setting in of_it.unheard]
        if len(deaf) == len(prepared):
            raise ValueError(f"{setting} = {value!r}: no estimator has a parameter of that name")
        if deaf:
            takers = ", ".join(name for name in prepared if name not in deaf)
            lines.append(f"{setting} is set for {takers}; without that parameter: {', '.join(deaf)}")
    return lines


def _can_be_loaded(name: str) -> bool:
    """Whether the package behind a registered estimator is installed; prints one line if not."""
    try:
        load_estimator(name)
    except PluginError as problem:
        console.error(f"left out: {problem}")
        return False
    return True


def fly(plan: Plan, workers: int, advance: Callable[[int, int], None], *, limit_s: float | None = None) -> Comparison:
    """Fly the plan; `advance` is called with the number of flights done and the total.

    limit_s : wall-clock limit of each flight

    Ctrl-C leaves flights out: the comparison is then of those finished.
    """
    # Seed by seed, so that an interruption leaves each estimator about as many flights as the others.
    tasks = [Task(plan.named, seed, name, plan.changes[name]) for seed in plan.seeds for name in plan.names]

    def interrupted(flown: Traced) -> bool:
        return flown.verdict.outcome == Outcome.INTERRUPTED

    done = fly_each(tasks, workers, advance, limit_s=limit_s, interrupted=interrupted)
    failed = {tasks[i].estimator for i in done if done[i].verdict.outcome in FLIGHT_CODE_FAILED}
    costs = _costs(plan, failed, min(workers, 1), limit_s) if len(done) == len(tasks) else {}
    entrants = []
    for name in plan.names:
        flights = tuple(done[i] for i in sorted(done) if tasks[i].estimator == name)
        pooled = next(iter(Verdict.of((plan.scenario, f.verdict) for f in flights).pooled), None)
        about = name, plan.given[name], plan.references[name], len(plan.seeds)
        entrants.append(Entrant(*about, flights, pooled, costs.get(name)))
    return Comparison(plan.scenario, plan.config, plan.seeds, tuple(entrants), plan.notes)


def given(prepared: Prepared) -> tuple[str, ...]:
    """The instruments that are fitted in this flight and that its estimator uses."""
    fitted = {name for name in LETTERS if getattr(prepared.suite, name, None) is not None}
    return tuple(name for name in uses_of(prepared.estimator.code, _UNKNOWN) if name in fitted)


@dataclass(frozen=True, slots=True)
class _Timing:
    """The cost of an update of one estimator, measured in a separate process."""

    scenario: str
    config: str  # as JSON
    estimator: str

    def fly(self) -> Cost:
        """Measure it; its flights are kept if it raises."""
        try:
            return cost(self.estimator, *_measured(self.scenario, self.config))
        except (NotTimed, ValueError) as problem:  # the latter of a script that asks for a longer flight
            return Cost(math.nan, None, str(problem))

    def lost(self, outcome: Outcome, message: str) -> Cost:
        """The result if the process was lost."""
        return Cost(math.nan, None, f"{outcome.replace('_', ' ')}: {message}")


@lru_cache(maxsize=1)
def _measured(scenario: str, config: str) -> tuple[NDArray[Any], Instruments]:
    """Measurements of a flight, and what is known of its instruments."""
    prepared = prepare_config(find(scenario), FlightConfig.model_validate_json(config), lenient=True)
    return prepared.fly().log.measured, prepared.instruments


def _costs(plan: Plan, failed: Container[str], workers: int, limit_s: float | None) -> dict[str, Cost]:
    """Cost of an update of each estimator that did not fail, over the first seconds of a flight."""
    another = {"duration_s": TIMED_S, "estimator": "premerlani", "estimator_params": {}}
    config = plan.config.model_copy(update=another).model_dump_json()
    # The oracle works only in a flight.
    timed = [name for name in plan.names if name not in failed and name != "oracle"]
    tasks = [_Timing(plan.named, config, name) for name in timed]
    found = fly_each(tasks, workers, lambda _n, _total: None, limit_s=limit_s)
    return {timed[i]: measured for i, measured in found.items()}


def run(
    scenario: str,
    estimators: Sequence[str],
    seeds: str,
    changes: Changes,
    *,
    workers: int | None,
    limit_s: float | None,
    picture: Path | None,
    markdown: Path | None,
    json_: str | None,
) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            check_picture(picture)
            check_file(markdown)
            with in_time(limit_s):
                plan = prepare(scenario, estimators, parse_seeds(seeds), changes())
            guard.stage("while it compared", guard.BROKEN)
            with console.progress("flying", "flights") as advance:
                compared = fly(plan, workers or processors(), advance, limit_s=limit_s)
        if picture is not None:
            from scenarios.harness.commands import compare_picture

            with attempt():
                compare_picture.draw(compared, picture)
        write(markdown, compared.to_markdown)
        report(compared.to_json())
        print_report(compared)  # last: a reader who closes the pipe loses no report
    return compared.exit_code
