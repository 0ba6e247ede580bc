"""A flight, prepared once and flown: every command that flies goes through here.

`prepare` looks up and makes all that a flight needs, and refuses in one line what cannot be flown.  `Prepared.fly`
flies it.  Nothing is looked up, resolved or constructed a second time on the way.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimator.instruments import Instruments, Known, to_json
from estimator.interface import HeadingReference
from scenarios.harness.aboard import equipped_estimator, instruments_of
from scenarios.harness.config import FenceConfig, FlightConfig, InFlightStart, fitted_suite, overridden, resolve
from scenarios.harness.config.faults import parse_fault
from scenarios.harness.config.plant import battery_of, build_plant
from scenarios.harness.config.tolerances import require_sound
from scenarios.harness.equipping import Equipped, equipped_autopilot, heading_reference_of, learnt
from scenarios.harness.own_files import library_named
from scenarios.harness.plugins import Maker, PluginError, maker_name
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario, ScriptFailed
from sim.aeroplane.battery import Battery
from sim.clock import Rates
from sim.events import events_of_battery, events_of_faults, events_of_fence
from sim.faults import Fault
from sim.log import Event, Flight, Log, Outcome
from sim.loop import Watch, fly
from sim.params import near_misses
from sim.power_up import sample_at_rest
from sim.recording import plain
from sim.sensors.fitting import SuiteParams
from sim.sensors.suite import Suite


@dataclass(frozen=True, slots=True)
class Prepared:
    """All that a flight needs, made once.  The plant is built when it is flown: JSBSim takes longest to load.

    config          resolved: nothing is left to chance
    suite           figures of its sensors              instruments     what is known of them aboard
    estimator, autopilot    new, each with what it was given of `instruments`
    script          the set-points, or the error of the scenario's function that should have made them
    """

    scenario: Scenario
    config: FlightConfig
    rates: Rates
    suite: SuiteParams
    instruments: Instruments
    estimator: Equipped
    autopilot: Equipped
    heading_reference: HeadingReference
    script: Any

    @property
    def unheard(self) -> list[str]:
        """Properties of the instruments that are set and that neither estimator nor autopilot has a parameter for."""
        return [name for name in self.config.instruments if name not in self.estimator.known | self.autopilot.known]

    @property
    def manifest(self) -> dict[str, Any]:
        """What goes into the recording, and from which the same flight can be prepared again."""
        library = library_named(self.config.estimator)
        return {
            "scenario": self.scenario.name,
            "seed": self.config.seed,
            "config": self.config.model_dump(mode="json"),
            "known": to_json(self.instruments),
            **({"estimator_sha256": library.sha256} if library else {}),
        }

    def fly(self, watch: Watch | None = None) -> Flight:
        """Fly it; `watch` is called once a simulated second, see `sim.loop.fly`.

        The manifest also holds ``on_ground``, the mean inertial sample from before a flight that starts in the air,
        if there is one; ``known_to_estimator``, what the estimator was given of the instruments or has learnt;
        ``battery``, what was drawn from it, if it is simulated; and ``scenario_fault``, what went wrong in the
        scenario's own functions.
        """
        config, rates, manifest = self.config, self.rates, self.manifest
        if isinstance(self.script, ScriptFailed):
            return _unflown(str(self.script), rates, self.heading_reference, manifest)
        faults = [parse_fault(fault) for fault in config.faults]
        plant = build_plant(config, rates, faults)
        airborne = isinstance(config.start, InFlightStart)
        place = config.place.build()
        on_ground = sample_at_rest(self.suite, rates, config.seed, config.flight, place) if airborne else None
        flown = fly(
            plant,
            Suite(self.suite, rates, config.seed, config.flight, faults, plant.release_s, place),
            self.estimator.code,
            self.autopilot.code,
            self.script,
            Log.empty(rates.ticks(plant.release_s + config.duration_s)),
            calibration_s=config.calibration_s,
            on_ground=on_ground,
            manifest=manifest | ({} if on_ground is None else {"on_ground": plain(on_ground._asdict())}),
            watch=watch,
        )
        flown = _with_battery(flown, battery_of(plant))
        return _with_events(flown, self.scenario, faults, self.estimator, config.fence)


def prepare(
    scenario: Scenario | str,
    overrides: Mapping[str, Any] | None = None,
    *,
    seed: int | None = None,
    flight: int | None = None,
    estimator: str | Maker | None = None,
    lenient: bool = False,
    kept: bool = False,
) -> Prepared:
    """Prepare one flight of `scenario`, which may be named.

    Parameters
    ----------
    overrides       fields of the configuration by dotted names, see `config.override`; numbers may be NumPy's
    seed, flight    name the random streams; None leaves those of the configuration
    estimator       name, ``module:Class``, ``file.py:Class``, a class, or a function that makes a new one for each
                    flight; it wins over the one of `overrides`, None is the scenario's own
    lenient         accept a property of the instruments that is set and that no flight code has a parameter for
    kept            one of many flights: a script that raises is the outcome of this one, not an error

    Raises
    ------
    ValueError      one line: what is wrong, and what would be right
    """
    scenario = find(scenario) if isinstance(scenario, str) else scenario
    changes: dict[str, Any] = {name: _of_python(value) for name, value in (overrides or {}).items()}
    for name, number in (("seed", seed), ("flight", flight)):
        if number is not None and str(changes.get(name, number)) != str(number):
            raise ValueError(f"{name} = {number} and {name} = {changes[name]} in the overrides: name it once")
        if number is not None:
            changes[name] = _of_python(number)
    maker = None if isinstance(estimator, str) else estimator
    if estimator is not None:
        changes["estimator"] = maker_name(estimator)
    config, suite = overridden(scenario.config, changes, maker)
    return _prepare(scenario, config, suite, maker, lenient, kept)


def prepare_config(scenario: Scenario, config: FlightConfig, *, lenient: bool = False) -> Prepared:
    """Prepare `scenario` under `config`; the ``config`` of a manifest prepares the same flight again."""
    return _prepare(scenario, config, fitted_suite(config), None, lenient, False)


def _prepare(
    scenario: Scenario, config: FlightConfig, suite: SuiteParams, maker: Maker | None, lenient: bool, kept: bool
) -> Prepared:
    from scenarios.harness.commands.catalogue import aircraft  # reads the folder of aircraft

    if config.aircraft not in aircraft():
        raise ValueError(f"unknown aircraft {config.aircraft!r}: {near_misses(config.aircraft, aircraft())}")
    config = resolve(config, suite)
    require_sound(config)
    instruments = instruments_of(config, suite)
    estimator, config = equipped_estimator(config, suite, instruments, maker)
    reference = heading_reference_of(estimator.code)
    autopilot = equipped_autopilot(config.autopilot, reference, config.aircraft, instruments, config.fence.build())
    try:
        script: Any = scenario.scripted(config)
    except ScriptFailed as problem:
        if not kept:
            raise
        script = problem
    prepared = Prepared(
        scenario, config, config.rates.build(), suite, instruments, estimator, autopilot, reference, script
    )
    if not lenient and prepared.unheard:
        name = prepared.unheard[0]
        raise ValueError(
            f"{name} = {config.instruments[name]!r}: neither estimator {config.estimator} nor autopilot "
            f"{config.autopilot} has a parameter of that name"
        )
    return prepared


def fly_scenario(scenario: Scenario, overrides: Mapping[str, Any] | None = None, **options: Any) -> Flight:
    """Fly `scenario` once; `overrides` and `options` as for `prepare`, and ``watch`` as for `Prepared.fly`."""
    watch = options.pop("watch", None)
    return prepare(scenario, overrides, **options).fly(watch)


def fly_config(scenario: Scenario, config: FlightConfig, *, lenient: bool = False) -> Flight:
    """Fly `scenario` under `config`: ``fly_config(scenario, FlightConfig(**manifest["config"]))`` repeats a flight."""
    return prepare_config(scenario, config, lenient=lenient).fly()


def _of_python(value: Any) -> Any:
    """`value` with Python's numbers in place of NumPy's, as the manifest can hold them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return type(value)(map(_of_python, value)) if type(value) in (list, tuple) else value
    if isinstance(value, dict):
        return {name: _of_python(item) for name, item in value.items()}
    return value


def _unflown(why: str, rates: Rates, reference: HeadingReference, manifest: dict[str, Any]) -> Flight:
    """A flight that did not begin because its script raised."""
    events = (Event(0.0, why, "error"),)
    return Flight(Log.empty(0), rates.dt_s, 0.0, Outcome.SCENARIO_FAILED, reference, why, events, manifest)


def _with_battery(flown: Flight, battery: Battery | None) -> Flight:
    """`flown` with the figures and events of its battery, if it has one."""
    if battery is None:
        return flown
    events = (*flown.events, *events_of_battery(battery))
    return replace(flown, events=events, manifest=flown.manifest | {"battery": battery.figures})


def _with_events(
    flown: Flight, scenario: Scenario, faults: list[Fault], estimator: Equipped, fence: FenceConfig
) -> Flight:
    """`flown` with its events, and what the estimator learnt; whatever is wrong with these, the flight is kept."""
    milestones, fault = scenario.events(flown)
    events, manifest = (*flown.events, *events_of_faults(faults, flown), *milestones), dict(flown.manifest)
    events += events_of_fence(fence.radius_m, fence.height_m, flown)
    outcome, message = flown.outcome, flown.message
    known: Mapping[str, Known] = estimator.known
    try:
        known = learnt(estimator.code, known)
    except PluginError as problem:
        if outcome in (Outcome.COMPLETED, Outcome.GROUND_CONTACT, Outcome.LEFT_BOX):
            outcome, message = Outcome.ESTIMATOR_FAILED, str(problem)
            events += (Event(_last_s(flown), message, "error"),)
    if fault:
        manifest["scenario_fault"] = fault
        events += (Event(_last_s(flown), fault, "error"),)
        message = message or fault
    manifest["known_to_estimator"] = to_json(known)
    events = tuple(sorted(events, key=lambda event: event.t_s))
    return replace(flown, outcome=outcome, message=message, events=events, manifest=manifest)


def _last_s(flight: Flight) -> float:
    return float(flight.log.truth["t_s"][-1]) if len(flight.log) else 0.0
