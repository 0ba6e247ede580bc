"""From a configuration to a flight: builds the aeroplane, its air, sensors, estimator and autopilot, and flies."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from estimator.instruments import to_json
from scenarios.harness.aboard import flight_code, instruments_of, with_calibration
from scenarios.harness.air_config import build_air
from scenarios.harness.config import (
    BenchStart,
    FlightConfig,
    HandMotion,
    HandThrowStart,
    InFlightStart,
    override,
    resolve,
)
from scenarios.harness.fault_config import parse_fault
from scenarios.harness.fitted import suite_params
from scenarios.harness.plugins import Maker, learnt
from scenarios.harness.scenario import Scenario
from sim.clock import Rates
from sim.events import events_of_faults
from sim.jsbsim_plant import FlightBox, JsbsimPlant
from sim.log import Flight, Log
from sim.loop import Watch, fly
from sim.plant import HandThrow, InFlight, Plant, Start
from sim.power_up import sample_at_rest
from sim.prescribed_plant import PrescribedPlant, Rest
from sim.recording import plain
from sim.sensors.suite import Suite


def fly_scenario(
    scenario: Scenario,
    overrides: Mapping[str, Any] | None = None,
    *,
    seed: int | None = None,
    flight: int | None = None,
    estimator: str | Maker | None = None,
    watch: Watch | None = None,
) -> Flight:
    """Fly `scenario` once.

    Parameters
    ----------
    overrides       fields of the configuration by dotted names, see `config.override`
    seed, flight    name the random streams; None leaves those of the configuration
    estimator       name, ``module:Class``, ``file.py:Class`` or a class; None is the scenario's own
    watch           called once a simulated second, see `sim.loop.fly`

    Raises
    ------
    ValueError      one line: what is wrong with the configuration; nothing has been flown then
    """
    numbers = {"seed": seed, "flight": flight}
    changes: dict[str, Any] = {**(overrides or {}), **{k: v for k, v in numbers.items() if v is not None}}
    maker = None if isinstance(estimator, str) else estimator
    if maker is not None:
        changes["estimator"] = f"{maker.__module__}:{getattr(maker, '__qualname__', type(maker).__name__)}"
    elif estimator is not None:
        changes["estimator"] = estimator
    return fly_config(scenario, override(scenario.config, changes), maker=maker, watch=watch)


def fly_config(
    scenario: Scenario, config: FlightConfig, *, maker: Maker | None = None, watch: Watch | None = None
) -> Flight:
    """Fly `scenario` under `config`, drawing what it leaves to chance.

    The resolved configuration is the manifest's ``config``: ``fly_config(scenario, FlightConfig(**that))`` flies
    the same flight again.  Its ``on_ground`` is the mean inertial sample from before a flight that starts in the air,
    where there is one, its ``known`` what is known of the instruments, its ``known_to_estimator`` what of that
    the estimator was given, or has learnt.
    """
    config = resolve(config) if maker is not None else with_calibration(resolve(config))
    rates = config.rates.build()
    (estimator, known), (pilot, _) = flight_code(config, maker)
    script = scenario.script(config)
    plant = plant_of(config, rates)
    faults = [parse_fault(fault) for fault in config.faults]
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
        manifest={
            "scenario": scenario.name,
            "seed": config.seed,
            "config": config.model_dump(mode="json"),
            "known": to_json(instruments_of(config)),
        }
        | ({} if on_ground is None else {"on_ground": plain(on_ground._asdict())}),
        watch=watch,
    )
    events = (*flown.events, *events_of_faults(faults, flown), *scenario.events(flown))
    events = tuple(sorted(events, key=lambda event: event.t_s))
    manifest = {**flown.manifest, "known_to_estimator": to_json(learnt(estimator, known))}
    return replace(flown, events=events, manifest=manifest)


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
