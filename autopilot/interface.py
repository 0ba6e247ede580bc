"""What is asked of an autopilot and what it answers: set-points in, actuator commands out."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from estimator.interface import AttitudeEstimate, Measurements


class Mode(IntEnum):
    """How the set-point is read."""

    MANUAL = 0  # sticks move the surfaces
    RATE = 1  # sticks command body rates
    STABILISE = 2  # bank and pitch are held
    COURSE = 3  # course and height are held
    RETURN = 4  # back to the launch point, then passes over it again and again
    LAUNCH = 5  # motor off until the throw is felt, then a straight climb to the height


_UPRIGHT_RAD = math.radians(85.0)  # the attitude modes hold no steeper bank or pitch: beyond, fly RATE
_RANGES = (
    ("aileron", -1.0, 1.0, "of full deflection"),
    ("elevator", -1.0, 1.0, "of full deflection"),
    ("rudder", -1.0, 1.0, "of full deflection"),
    ("bank_rad", -_UPRIGHT_RAD, _UPRIGHT_RAD, "rad"),
    ("pitch_rad", -_UPRIGHT_RAD, _UPRIGHT_RAD, "rad"),
    ("course_rad", -4.0 * math.pi, 4.0 * math.pi, "rad"),
    ("height_m", -1e5, 1e5, "m"),
    ("bank_limit_rad", 0.0, _UPRIGHT_RAD, "rad"),
    ("throttle", 0.0, 1.0, "of full throttle"),
)


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the aeroplane shall do from now on.  Which fields count depends on the mode.

    aileron, elevator, rudder : -1..1    MANUAL: the surfaces, sign of the rotation they cause
    rate_b_rad_s : (p, q, r)             RATE: body rates to follow
    bank_rad, pitch_rad : float          STABILISE
    course_rad : float                   COURSE: over ground (or nose, where the estimator knows only that)
    height_m : float                     COURSE, RETURN, LAUNCH: above the launch point
    bank_limit_rad : float               COURSE, RETURN: the steepest bank used to turn
    throttle : 0..1 or NaN               NaN leaves the throttle to the autopilot (MANUAL: NaN is off)
    """

    mode: Mode
    aileron: float = 0.0
    elevator: float = 0.0
    rudder: float = 0.0
    rate_b_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bank_rad: float = 0.0
    pitch_rad: float = 0.0
    course_rad: float = 0.0
    height_m: float = 50.0
    bank_limit_rad: float = math.radians(35.0)
    throttle: float = math.nan

    def __post_init__(self) -> None:
        """Refuse what no aeroplane can be asked, here and not in the air."""
        for name, low, high, unit in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high and not (name == "throttle" and math.isnan(value)):
                raise ValueError(f"Setpoint.{name}: {value!r} {unit} is not within {low:g} .. {high:g}")
        if len(self.rate_b_rad_s) != 3 or not all(map(math.isfinite, self.rate_b_rad_s)):
            raise ValueError(f"Setpoint.rate_b_rad_s: {self.rate_b_rad_s!r} rad/s must be finite (p, q, r)")


class ActuatorCommand(NamedTuple):
    """What the servos and the motor are told; with it, for the record, what the inner loop was asked to hold.

    aileron, elevator, rudder : -1..1, sense of the rotation they cause: roll right, nose up, nose right
    throttle : 0..1    mode : the mode in force    bank_demand_rad, pitch_demand_rad : NaN where none is held
    """

    aileron: float
    elevator: float
    rudder: float
    throttle: float
    mode: int = int(Mode.MANUAL)  # a plain int: numba takes tens of microseconds to look at an enum
    bank_demand_rad: float = math.nan
    pitch_demand_rad: float = math.nan


NEUTRAL = ActuatorCommand(0.0, 0.0, 0.0, 0.0)


@runtime_checkable
class Autopilot(Protocol):
    """The seam.  Optional: ``reset()``, called before each flight."""

    def update(self, estimate: AttitudeEstimate, m: Measurements, setpoint: Setpoint) -> ActuatorCommand:
        """Steer.  Attitude comes from `estimate` alone; position, height and ground velocity from `m`."""
        ...
