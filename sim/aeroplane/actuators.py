"""Faults of what moves the aeroplane: control surfaces and motor, between the command and the servo.

The two ailerons act as one channel.  Deflections are fractions of full deflection, by sign of the resulting rotation.

stuck       the surface stays where it is, or moves to the given deflection and stays there; a motor keeps its throttle
slow        the servo moves at no more than a rate
slack       play in the linkage: the surface follows the command with a dead band (hysteresis) of the given total width
reversed    moves opposite to the command
lost        the linkage has come off: the surface trails with the flow, at no deflection
dead        the motor gives no power; its propeller stands or windmills
weak        the motor gets only a fraction of the voltage
"""

import math
import tomllib
from pathlib import Path
from typing import Final

_AIRCRAFT: Final = Path(__file__).parents[1] / "aircraft"
SURFACES: Final = ("aileron", "elevator", "rudder")
CHANNELS: Final = (*SURFACES, "motor")
_KINDS: Final = ("stuck", "slow", "slack", "reversed", "lost")
_MOTOR_KINDS: Final = ("dead", "weak", "stuck")
_DEFAULTS: Final = {"stuck": (math.nan,), "slow": (0.5,), "slack": (0.1,), "weak": (0.6,)}


def kinds_of(channel: str) -> tuple[str, ...]:
    """Kinds of fault of one of the CHANNELS."""
    return _MOTOR_KINDS if channel == "motor" else _KINDS


def defaults_of(_channel: str, kind: str) -> tuple[float, ...]:
    """Default values of a fault, as many as it takes; NaN: may be left out."""
    return _DEFAULTS.get(kind, ())


def unit_of(channel: str, kind: str) -> str:
    """Unit of the value of a fault."""
    if channel == "motor":
        return "fractions of the voltage" if kind == "weak" else "fractions of full throttle"
    return "full deflections per second" if kind == "slow" else "fractions of full deflection"


def wrong_values(channel: str, kind: str, values: tuple[float, ...]) -> str:
    """What would be right, if the values are not."""
    if not values:
        return ""
    (value,) = values
    unit = unit_of(channel, kind)
    if kind == "stuck":
        low, high = (0.0 if channel == "motor" else -1.0), 1.0
        return "" if low <= value <= high else f"must be from {low:g} to {high:g}, in {unit}"
    if kind == "slow":
        return "" if 0.0 < value <= 100.0 else f"must be above 0 and at most 100, in {unit}"
    most = {"slack": 2.0, "weak": 1.0}[kind]
    return "" if 0.0 <= value <= most else f"must be from 0 to {most:g}, in {unit}"


def controls_of(aircraft: str) -> tuple[str, ...]:
    """The CHANNELS that an aeroplane has, from its ``airframe.toml``; all of them if there is no such aeroplane."""
    path = _AIRCRAFT / aircraft / "airframe.toml"
    if not path.is_file():  # refused elsewhere, with suggestions
        return CHANNELS
    geometry = tomllib.loads(path.read_text(encoding="utf-8"))["geometry"]
    lacks = {"aileron": not geometry["aileron_part"], "motor": not geometry["propeller_diameter_m"]}
    return tuple(channel for channel in CHANNELS if not lacks.get(channel))


def require_control(fault: str, channel: str, aircraft: str) -> None:
    """ValueError for a fault of a control that `aircraft` does not have."""
    has = controls_of(aircraft)
    if channel not in has:
        raise ValueError(f"fault {fault}: {aircraft} has no {channel}; it has {', '.join(has)}")
