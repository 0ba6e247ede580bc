"""Faults of what moves the aeroplane, and its battery: between the command and servos and motor.

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
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim.aeroplane.battery import Battery, BatteryParams

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model  # loads JSBSim
    from sim.faults import Fault

_AIRCRAFT: Final = Path(__file__).parents[1] / "aircraft"
SURFACES: Final = ("aileron", "elevator", "rudder")
CHANNELS: Final = (*SURFACES, "motor")
SERVO: Final = {"motor": "speed-controller"}  # in JSBSim; of a surface NAME-servo
PLACES: Final = ("servo/aileron", "servo/elevator", "servo/rudder", "fcs/throttle-pos-norm")
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


def require_motor(aircraft: str) -> None:
    """ValueError for a battery in an aeroplane without a motor."""
    if "motor" not in controls_of(aircraft):
        raise ValueError(f"battery.capacity_mah: {aircraft} has no motor; leave it out")


class _Acting:
    """One fault, its window in ticks, and the place of what it moves."""

    def __init__(self, fault: "Fault", release_s: float, dt_s: float) -> None:
        self.channel, self.kind = CHANNELS.index(fault.channel), fault.kind
        self.value = fault.values[0] if fault.values else math.nan
        self.first, self.end = (_first_tick(release_s + t_s, dt_s) for t_s in (fault.from_s, fault.to_s))
        self.step = self.value * dt_s
        self.jams = fault.kind == "stuck" and not fault.values
        self.place = math.nan

    def apply(self, wanted: float, position: float, trim: float) -> float:
        """The command that arrives in place of `wanted`.

        position : where the servo is, as the command that holds it there   trim : deflection at neutral command
        """
        kind = self.kind
        if kind in ("lost", "dead"):
            return -trim
        if kind == "reversed":
            return -wanted
        if kind == "weak":
            return self.value * wanted
        if kind == "stuck":
            return position if self.jams else self.value - trim
        near = self.step if kind == "slow" else 0.5 * self.value
        place = position if math.isnan(self.place) else self.place
        self.place = slew(place, wanted, near) if kind == "slow" else play(place, wanted, near)
        return self.place


def slew(place: float, wanted: float, most: float) -> float:
    """`place` after one step of at most `most` towards `wanted`."""
    return place + min(max(wanted - place, -most), most)


def play(place: float, wanted: float, half: float) -> float:
    """`place` after a linkage with a play of `half` to each side moved to `wanted`: it is pushed, or stays."""
    return min(max(place, wanted - half), wanted + half)


def _first_tick(t_s: float, dt_s: float) -> float:
    """The first tick that begins at or after `t_s` since power-up; less than a nanotick is round-off."""
    return math.ceil(t_s / dt_s - 1e-9) if math.isfinite(t_s) else math.inf


class Actuators:
    """Faults and battery of one flight, applied to each command; build a new one for each flight.

    Faults act in the order given.  Raises ValueError for a fault of a control that the aeroplane does not have, or a
    battery without a motor.
    """

    def __init__(
        self, model: "Model", faults: Sequence["Fault"], battery: BatteryParams | None, release_s: float, dt_s: float
    ) -> None:
        aircraft = model.folder.name
        for fault in faults:
            require_control(str(fault), fault.channel, aircraft)
        self._faults = [_Acting(fault, release_s, dt_s) for fault in faults]
        self._places = [model.getter(name) for name in PLACES]
        self._trims = (*model.built.trims, 0.0)
        self._jam = {
            CHANNELS.index(name): model.setter(f"fcs/{SERVO.get(name, name + '-servo')}/malfunction/fail_stuck")
            for name in controls_of(aircraft)
        }
        self._jammed = dict.fromkeys(self._jam, False)
        self.battery: Battery | None = None
        if battery is not None:
            require_motor(aircraft)
            self.battery = Battery(battery, model.folder / "motor.xml", dt_s)
            self._current_a = model.getter("propulsion/engine/current-amperes")

    def move(self, k: int, command: Sequence[float]) -> list[float]:
        """Aileron, elevator, rudder and throttle that arrive at servos and motor in tick `k`."""
        arriving, places = list(command[:4]), [read() for read in self._places]
        jammed = dict.fromkeys(self._jammed, False)
        for fault in self._faults:
            if fault.first <= k < fault.end:
                i = fault.channel
                arriving[i] = fault.apply(arriving[i], places[i] - self._trims[i], self._trims[i])
                jammed[i] = jammed[i] or fault.jams
        if jammed != self._jammed:
            for i, write in self._jam.items():
                write(float(jammed[i]))
            self._jammed = jammed
        if self.battery is not None:
            arriving[3] = self.battery.throttle(k, arriving[3], places[3], self._current_a())
        return arriving
