"""Scripts that several scenarios share, made from the configuration of the flight and its ``manoeuvre``."""

import math
from dataclasses import replace

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.config import FlightConfig


def ahead(config: FlightConfig) -> Setpoint:
    """The initial course at the height ``height_m``; turns use at most ``bank_deg`` of bank, if that is given."""
    m = config.manoeuvre
    setpoint = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
    return replace(setpoint, bank_limit_rad=math.radians(m["bank_deg"])) if "bank_deg" in m else setpoint


def straight(config: FlightConfig) -> Script:
    """Straight flight, see `ahead`."""
    return Script([Timed(0.0, ahead(config))])


def turning(config: FlightConfig) -> Script:
    """A continuous right turn with the bank ``bank_deg`` and the pitch ``pitch_deg``."""
    m = config.manoeuvre
    turn = Setpoint(Mode.STABILISE, bank_rad=math.radians(m["bank_deg"]), pitch_rad=math.radians(m["pitch_deg"]))
    return Script([Timed(0.0, turn)])


def launch(config: FlightConfig) -> Script:
    """A hand launch, then a climb to ``height_m``."""
    return Script([Timed(0.0, Setpoint(Mode.LAUNCH, height_m=config.manoeuvre["height_m"]))])


def loiter(config: FlightConfig) -> Script:
    """A circle to the right about the point ``north_m``, ``east_m``, of ``radius_m``, at ``height_m``.

    The centre is the launch point if it is not given; ``left`` not zero circles to the left.
    """
    m = config.manoeuvre
    circle = Setpoint(Mode.LOITER, height_m=m["height_m"], radius_m=m["radius_m"], left=bool(m.get("left", 0.0)))
    return Script([Timed(0.0, replace(circle, north_m=m.get("north_m", 0.0), east_m=m.get("east_m", 0.0)))])
