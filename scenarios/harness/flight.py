"""From a configuration to a flight: builds the aeroplane, its air, sensors, estimator and autopilot, and flies."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from estimator.instruments import Known, to_json
from estimator.interface import HeadingReference
from scenarios.harness.aboard import flight_code, instruments_of, require_heard, with_calibration
from scenarios.harness.config import (
    BenchStart,
    FlightConfig,
    HandMotion,
    HandThrowStart,
    InFlightStart,
    override,
    resolve,
)
from scenarios.harness.config.air import build_air
from scenarios.harness.config.faults import parse_fault
from scenarios.harness.fitted import suite_params
from scenarios.harness.plugins import Maker, PluginError, heading_reference_of, learnt, maker_name
from scenarios.harness.scenario import Scenario, ScriptFailed
from sim.aeroplane.jsbsim_plant import FlightBox, JsbsimPlant
from sim.clock import Rates
from sim.events import events_of_faults
from sim.log import Event, Flight, Log, Outcome
from sim.loop import Watch, fly
from sim.motion.prescribed_plant import PrescribedPlant, Rest
from sim.plant import HandThrow, InFlight, Plant, Start
from sim.power_up import sample_at_rest
from sim.recording import plain
from sim.sensors.faults import Fault
from sim.sensors.suite import Suite


def fly_scenario(
    scenario: Scenario,
    overrides: Mapping[str, Any] | None = None,
    *,
    seed: int | None = None,
    flight: int | None = None,
    estimator: str | Maker | None = None,
    watch: Watch | None = None,
    lenient: bool = False,
    kept: bool = False,
) -> Flight:
    """Fly `scenario` once.

    Parameters
    ----------
    overrides       fields of the configuration by dotted names, see `config.override`; numbers may be NumPy's
    seed, flight    name the random streams; None leaves those of the configuration
    estimator       name, ``module:Class``, ``file.py:Class``, a class, or a function that makes a new one for each
                    flight; it wins over the one of `overrides`, None is the scenario's own
    watch           called once a simulated second, see `sim.loop.fly`
    lenient         accept a property of the instruments that is set and that no flight code has a parameter for
    kept            of many flights: a script that raises for this one is its outcome, and no error

    Raises
    ------
    ValueError      one line: what is wrong with the configuration; nothing has been flown then
    """
    changes: dict[str, Any] = {name: _of_python(value) for name, value in (overrides or {}).items()}
    for name, number in (("seed", seed), ("flight", flight)):
        if number is not None and str(changes.get(name, number)) != str(number):
            raise ValueError(f"{name} = {number} and {name} = {changes[name]} in the overrides: name it once")
        if number is not None:
            changes[name] = _of_python(number)
    maker = None if isinstance(estimator, str) else estimator
    if estimator is not None:
        changes["estimator"] = maker_name(estimator)
    config = override(scenario.config, changes)
    return fly_config(scenario, config, maker=maker, watch=watch, lenient=lenient, kept=kept)


def _of_python(value: Any) -> Any:
    """`value` with Python's numbers in the place of NumPy's, as the manifest can hold them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return type(value)(map(_of_python, value)) if type(value) in (list, tuple) else value
    if isinstance(value, dict):
        return {name: _of_python(item) for name, item in value.items()}
    return value


def fly_config(
    scenario: Scenario,
    config: FlightConfig,
    *,
    maker: Maker | None = None,
    watch: Watch | None = None,
    lenient: bool = False,
    kept: bool = False,
) -> Flight:
    """Fly `scenario` under `config`, drawing what it leaves to chance; `maker` makes the estimator where it is given.

    The resolved configuration is the manifest's ``config``: ``fly_config(scenario, FlightConfig(**that))`` flies
    the same flight again.  Its ``on_ground`` is the mean inertial sample from before a flight that starts in the air,
    where there is one, its ``known`` what is known of the instruments, its ``known_to_estimator`` what of that
    the estimator was given, or has learnt, its ``scenario_fault`` what went wrong in the scenario's own functions.
    """
    config = with_calibration(resolve(config), maker)
    rates, faults = config.rates.build(), [parse_fault(fault) for fault in config.faults]
    (estimator, known), (pilot, _) = code = flight_code(config, maker)
    if not lenient:
        require_heard(config, code)
    manifest = {
        "scenario": scenario.name,
        "seed": config.seed,
        "config": config.model_dump(mode="json"),
        "known": to_json(instruments_of(config)),
    }
    try:
        script = scenario.scripted(config)
    except ScriptFailed as problem:
        if not kept:
            raise
        return _unflown(str(problem), rates, heading_reference_of(estimator), manifest)
    plant = plant_of(config, rates)
    sensors = suite_params(config.suite, config.sensors, config.files)
    airborne = isinstance(config.start, InFlightStart)
    on_ground = sample_at_rest(sensors, rates, config.seed, config.flight) if airborne else None
    flown = fly(
        plant,
        Suite(sensors, rates, config.seed, config.flight, faults, plant.release_s),
        estimator,
        pilot,
        script,
        Log.empty(rates.ticks(plant.release_s + config.duration_s)),
        calibration_s=config.calibration_s,
        on_ground=on_ground,
        manifest=manifest | ({} if on_ground is None else {"on_ground": plain(on_ground._asdict())}),
        watch=watch,
    )
    return _told(flown, scenario, faults, estimator, known)


def _unflown(why: str, rates: Rates, reference: HeadingReference, manifest: dict[str, Any]) -> Flight:
    """A flight that did not begin, for its script raised."""
    events = (Event(0.0, why, "error"),)
    return Flight(Log.empty(0), rates.dt_s, 0.0, Outcome.SCENARIO_FAILED, reference, why, events, manifest)


def _told(
    flown: Flight, scenario: Scenario, faults: Sequence[Fault], estimator: object, known: Mapping[str, Known]
) -> Flight:
    """`flown` with its events, and what the estimator learnt; whatever is wrong with these, the flight is kept."""
    milestones, fault = scenario.events(flown)
    events, manifest = (*flown.events, *events_of_faults(faults, flown), *milestones), dict(flown.manifest)
    outcome, message = flown.outcome, flown.message
    try:
        known = learnt(estimator, known)
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


def plant_of(config: FlightConfig, rates: Rates) -> Plant:
    """What flies under a resolved configuration: the aeroplane in its air, or what lies on a table."""
    start = config.start
    if isinstance(start, BenchStart):
        roll_rad, pitch_rad, heading_rad = _radians((start.roll_deg, start.pitch_deg, config.heading_deg))
        rest = Rest(roll_rad, pitch_rad, heading_rad, start.height_m)
        return PrescribedPlant(rest, rates, release_s=start.calibration_s)
    return JsbsimPlant(
        config.aircraft,
        start=start_of(config),
        air=build_air(config.air),
        rates=rates,
        seed=config.seed,
        flight=config.flight,
        box=FlightBox(config.box_radius_m, config.box_height_m),
    )


def start_of(config: FlightConfig) -> Start:
    """Start of the aeroplane of a resolved configuration."""
    start, heading_rad = config.start, math.radians(config.heading_deg)
    if isinstance(start, BenchStart):
        raise ValueError("start: on a table nothing starts to fly")
    if not isinstance(start, HandThrowStart):
        north_m, east_m = start.out_m * math.cos(heading_rad), start.out_m * math.sin(heading_rad)
        return InFlight(heading_rad, start.height_m, north_m, east_m, start.airspeed_m_s)
    hand = start.hand
    if not isinstance(hand, HandMotion):
        raise ValueError(f"start.hand = {hand!r}: resolve the configuration first")
    return HandThrow(
        heading_rad,
        math.radians(start.pitch_deg),
        _radians(hand.sway_deg_s),
        hand.sway_hz,
        _radians(hand.sway_phase_deg),
        _radians(hand.release_rate_deg_s),
        start.height_m,
        start.hold_s,
        start.push_m_s2,
        start.push_s,
    )


def _radians(degrees: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (math.radians(d) for d in degrees)
    return x, y, z
