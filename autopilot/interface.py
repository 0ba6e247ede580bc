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


class ActuatorCommand(NamedTuple):
    """What the servos and the motor are told; with it, for the record, what the inner loop was asked to hold.

    aileron, elevator, rudder : -1..1, in the sense of the rotation they cause: roll right, nose up, nose right
    throttle : 0..1     mode : the mode in force     bank_demand_rad, pitch_demand_rad : NaN where none is held
    """

    aileron: float
    elevator: float
    rudder: float
    throttle: float
    mode: int = Mode.MANUAL
    bank_demand_rad: float = math.nan
    pitch_demand_rad: float = math.nan


NEUTRAL = ActuatorCommand(0.0, 0.0, 0.0, 0.0)


@runtime_checkable
class Autopilot(Protocol):
    """The seam.  Optional: ``reset()``, called before each flight."""

    def update(self, estimate: AttitudeEstimate, m: Measurements, setpoint: Setpoint) -> ActuatorCommand:
        """Steer.  Attitude comes from `estimate` alone; position, height and ground velocity from `m`."""
        ...
