"""The faults of a configuration: parsing and validation."""

import math
import re
from collections.abc import Sequence
from typing import Any

from scenarios.harness.plugins import near_misses
from sim.aeroplane.actuators import require_control
from sim.faults import CHANNELS, Fault, kinds_of
from sim.outside.numbers import number
from sim.sensors.faults import require_possible

_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
_FAULT = re.compile(rf"([^:=@]+):([^:=@]+)(?:=([^:=@]*))?@({_NUMBER})s?(-(?:({_NUMBER})s?)?)?")
_RIGHT = (
    "write channel:kind@from-to or channel:kind=value@from, for instance gyro.x:stuck@20-25, gps:jump=50@10 "
    "or motor:dead@30"
)
_SHORT = {"accel": "accelerometer", "mag": "magnetometer", "baro": "barometer", "throttle": "motor"}


def parse_fault(text: str) -> Fault:
    """Parse a fault: ``gyro.x:stuck@20-25``, ``gps:jump=50,-20@10``, ``motor:dead@30``, see `sim.faults`.

    Seconds count from the release, so that -3 is in the hand; without an end it lasts to the end of the flight.

    Raises
    ------
    ValueError      in one line: what is wrong, and what would be right
    """
    found = _FAULT.fullmatch("".join(text.lower().split()))
    if not found:
        raise ValueError(f"fault = {text!r}: {_RIGHT}")
    part, dot, axis = found[1].partition(".")
    channel, kind = f"{_SHORT.get(part, part)}{dot}{axis}", found[2]
    if channel not in CHANNELS:
        raise ValueError(f"fault = {text!r}: no channel {found[1]!r}; {near_misses(channel, CHANNELS)}")
    if channel == "gps" and kind == "dropout":
        kind = "outage"
    if kind not in kinds_of(channel):
        hint = near_misses(kind, kinds_of(channel))
        raise ValueError(f"fault = {text!r}: {channel} has no fault {kind!r}; {hint}")
    try:
        values = tuple(number(value) for value in found[3].split(",")) if found[3] is not None else ()
    except ValueError:
        raise ValueError(f"fault = {text!r}: {found[3]!r} is not a number; {_RIGHT}") from None
    from_s, to_s = float(found[4]), float(found[6]) if found[6] else math.inf
    try:
        return Fault(channel, kind, values, from_s, to_s)
    except ValueError as refused:
        raise ValueError(f"fault = {text!r}: {refused}") from None


def typed_faults(faults: Any) -> Any:
    """Faults as a configuration keeps them: each in its full spelling; a text may hold several."""
    listed = faults.split() if isinstance(faults, str) else faults
    if not isinstance(listed, list | tuple) or not all(isinstance(fault, str | Fault) for fault in listed):
        raise ValueError(f"faults = {faults!r}: {_RIGHT}")
    texts = [str(parse_fault(fault) if isinstance(fault, str) else fault) for fault in listed]
    for text in texts:
        if texts.count(text) > 1:
            raise ValueError(f"fault = {text!r}: named twice; name it once, with twice the value if it has one")
    return tuple(texts)


def never_met(scenario: str, faults: Sequence[str], held_s: float, duration_s: float) -> list[str]:
    """A line for each of `faults` that lies wholly outside the flight: `duration_s` after `held_s` in the hand."""
    lasts = f"the flight of {scenario!r} lasts from {0.0 - held_s:g} s to {duration_s:g} s after the release"
    missed = (text for text in faults if not _is_met(parse_fault(text), held_s, duration_s))
    return [f"fault {text} never happens: {lasts}" for text in missed]


def _is_met(fault: Fault, held_s: float, duration_s: float) -> bool:
    return fault.from_s < duration_s and fault.to_s > -held_s


def require_faults_possible(
    faults: Sequence[str], suite: Any, gps_hz: float | None, aircraft: str, flies: bool
) -> None:
    """ValueError for a fault that the sensors of `suite` or the controls of `aircraft` cannot have.

    gps_hz : None for the receiver's own rate       flies : whether it is not on a table
    """
    for fault in map(parse_fault, faults):
        if fault.family == "sensor":
            require_possible(fault, suite, gps_hz)
        elif fault.family == "actuator" and not flies:
            raise ValueError(f"fault {fault}: the flight is on a table, where no control moves; choose one that flies")
        elif fault.family == "actuator":
            require_control(str(fault), fault.channel, aircraft)
