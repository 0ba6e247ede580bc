"""The interface of an autopilot: setpoints in, actuator commands out."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from estimator.interface import AttitudeEstimate, Measurements


class Mode(IntEnum):
    """Flight modes.  The last five are failsafe modes, which cannot be commanded: see `autopilot.failsafe`."""

    MANUAL = 0  # sticks move the surfaces
    RATE = 1  # sticks command body rates
    STABILISE = 2  # bank and pitch are held
    COURSE = 3  # course and height are held
    RETURN = 4  # to the launch point, then repeated passes over it
    LAUNCH = 5  # motor off until the throw is detected, then a straight climb to the height
    LOITER = 6  # around a point at a height
    WAYPOINTS = 7  # along the legs of a route
    CIRCLE = 8  # no position: a gentle circle at the present place, at cruise
    GLIDE = 9  # no position for a long time: the same circle, motor off
    LEVEL = 10  # no trusted attitude: wings level on the standby attitude
    LOW = 11  # too close to the ground: climbs on course with little bank
    LAND = 12  # no trusted attitude and nobody who can help: wings level, motor off


# As plain integers, for kernels: numba is slow with enumerations.
MANUAL, RATE, STABILISE, COURSE, RETURN, LAUNCH, LOITER, WAYPOINTS, CIRCLE, GLIDE, LEVEL, LOW, LAND = map(int, Mode)


class Waypoint(NamedTuple):
    """A point of a route, relative to the launch point."""

    north_m: float
    east_m: float
    height_m: float


MOST_WAYPOINTS = 32


_UPRIGHT_RAD = math.radians(85.0)  # limit of the attitude modes; use RATE beyond it
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
    ("north_m", -1e5, 1e5, "m"),
    ("east_m", -1e5, 1e5, "m"),
    ("radius_m", 1.0, 1e5, "m"),
    ("airspeed_m_s", 1.0, 200.0, "m/s"),
)
_MAY_BE_NAN = ("throttle", "airspeed_m_s")


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Commands of the pilot.  The mode determines which fields are used.

    aileron, elevator, rudder : -1..1    MANUAL: surface deflections, by sign of the resulting rotation
    rate_b_rad_s : (p, q, r)             RATE: body rates
    bank_rad, pitch_rad : float          STABILISE
    course_rad : float                   COURSE: over ground (or nose, if the estimator knows only that)
    height_m : float                     COURSE, RETURN, LAUNCH, LOITER: above the launch point
    bank_limit_rad : float               COURSE, RETURN, LOITER, WAYPOINTS: largest bank in turns
    throttle : 0..1 or NaN               NaN: chosen by the autopilot (MANUAL: off)
    inverted : bool                      STABILISE, COURSE: inverted flight; bank and pitch are relative to it, and a
                                         positive bank still turns right over the ground
    north_m, east_m, radius_m : float    LOITER: centre, from the launch point, and radius
    left : bool                          LOITER: turning left
    route : of `Waypoint`                WAYPOINTS: flown in order and repeated; 1 to 32
    airspeed_m_s : float or NaN          COURSE, RETURN, LOITER, WAYPOINTS; NaN: cruise, faster against strong wind
    radio : bool                         False: radio link lost; the other fields are the last ones received
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
    inverted: bool = False
    north_m: float = 0.0
    east_m: float = 0.0
    radius_m: float = 60.0
    left: bool = False
    route: tuple[Waypoint, ...] = ()
    airspeed_m_s: float = math.nan
    radio: bool = True

    def __post_init__(self) -> None:
        """Reject impossible commands before the flight: ValueError."""
        for name, low, high, unit in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high and not (name in _MAY_BE_NAN and math.isnan(value)):
                raise ValueError(f"Setpoint.{name}: {value!r} {unit} is not within {low:g} .. {high:g}")
        if len(self.rate_b_rad_s) != 3 or not all(map(math.isfinite, self.rate_b_rad_s)):
            raise ValueError(f"Setpoint.rate_b_rad_s: {self.rate_b_rad_s!r} rad/s must be finite (p, q, r)")
        if len(self.route) > MOST_WAYPOINTS or (self.mode == Mode.WAYPOINTS and not self.route):
            raise ValueError(f"Setpoint.route: {len(self.route)} waypoints: choose 1 to {MOST_WAYPOINTS}")
        for number, waypoint in enumerate(self.route):
            if len(waypoint) != 3 or not all(math.isfinite(x) and abs(x) <= 1e5 for x in waypoint):
                raise ValueError(
                    f"Setpoint.route[{number}]: {tuple(waypoint)!r} m must be north, east, height within 1e5"
                )


class ActuatorCommand(NamedTuple):
    """Commands to servos and motor, and for the recording the demands of the inner loop.

    aileron, elevator, rudder : -1..1, by the resulting rotation: roll right, nose up, nose right
    throttle : 0..1    mode : the active mode    bank_demand_rad, pitch_demand_rad : NaN if none
    (in inverted flight the bank is beyond 90 degrees)
    """

    aileron: float
    elevator: float
    rudder: float
    throttle: float
    mode: int = int(Mode.MANUAL)  # a plain int: numba needs tens of microseconds to unbox an enum
    bank_demand_rad: float = math.nan
    pitch_demand_rad: float = math.nan


NEUTRAL = ActuatorCommand(0.0, 0.0, 0.0, 0.0)


@runtime_checkable
class Autopilot(Protocol):
    """Interface of every autopilot.  Optional: ``reset()``, called before each flight."""

    def update(self, estimate: AttitudeEstimate, m: Measurements, setpoint: Setpoint) -> ActuatorCommand:
        """Compute the command.  Attitude comes only from `estimate`; position, height and ground velocity from `m`."""
        ...
