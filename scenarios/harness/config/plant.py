"""The plant of a configuration: the aeroplane in its air, or the instruments on a table."""

import math
from collections.abc import Sequence

from scenarios.harness.config.air import build_air
from scenarios.harness.config.flight import FlightConfig
from scenarios.harness.config.start import BenchStart, HandMotion, HandThrowStart
from scenarios.harness.config.tolerances import built
from sim.aeroplane.battery import Battery
from sim.aeroplane.jsbsim_plant import FlightBox, JsbsimPlant
from sim.clock import Rates
from sim.faults import Fault, of_family
from sim.motion.prescribed_plant import PrescribedPlant, Rest
from sim.plant import HandThrow, InFlight, Plant, Start


def build_plant(config: FlightConfig, rates: Rates, faults: Sequence[Fault] = ()) -> Plant:
    """The plant of a resolved configuration; of `faults` it has those of surfaces and motor."""
    start = config.start
    if isinstance(start, BenchStart):
        roll_rad, pitch_rad, heading_rad = _radians((start.roll_deg, start.pitch_deg, config.heading_deg))
        rest = Rest(roll_rad, pitch_rad, heading_rad, start.height_m)
        place = config.place
        return PrescribedPlant(rest, rates, place.latitude_deg, start.calibration_s, place.elevation_m)
    return JsbsimPlant(
        config.aircraft,
        start=build_start(config),
        air=build_air(config.air),
        rates=rates,
        seed=config.seed,
        flight=config.flight,
        box=FlightBox(config.box_radius_m, config.box_height_m),
        place=config.place.build(),
        faults=of_family("actuator", faults),
        battery=config.battery.build(),
        built=built(config.airframe),
    )


def battery_of(plant: Plant) -> Battery | None:
    """The battery of a plant that has one."""
    actuators = plant.actuators if isinstance(plant, JsbsimPlant) else None
    return actuators.battery if actuators is not None else None


def build_start(config: FlightConfig) -> Start:
    """Start of the aeroplane of a resolved configuration; ValueError if it never flies, or is not resolved."""
    start, heading_rad = config.start, math.radians(config.heading_deg)
    if isinstance(start, BenchStart):
        raise ValueError("start: a flight on a table has no start in the air")
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
        -start.push_m_s2 if start.backwards else start.push_m_s2,
        start.push_s,
        math.radians(start.roll_deg),
    )


def _radians(degrees: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (math.radians(d) for d in degrees)
    return x, y, z
