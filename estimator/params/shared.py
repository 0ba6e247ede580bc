"""What the parameter classes of all estimators share: two ranges, the magnetometer, and the validation."""

import math
from dataclasses import dataclass, field, fields
from typing import ClassVar

from estimator.blocks.calibration import Calibration
from estimator.instruments import DEEPEST_M, HIGHEST_M
from estimator.interface import G_M_S2

GYRO_RANGE_RAD_S = math.radians(2100.0)  # just above the full scale of the largest parts
FORCE_RANGE_M_S2 = 17.0 * G_M_S2
FIELD_RANGE_UT = 200.0  # the earth's field is 22 to 67 uT; the rest leaves room for iron
LONGEST_LATENCY_S = 12.5  # what the estimators remember of the past
RANGES = ("gyro_range_rad_s", "force_range_m_s2", "field_range_ut")


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Base class: which inertial samples are rejected.

    gyro_range_rad_s : rad/s  readings of a gyro axis beyond this are rejected
        higher: larger spikes reach the attitude; lower: fast but real rotations are lost
    force_range_m_s2 : m/s^2  readings of an accelerometer axis beyond this are rejected
        higher: larger spikes reach the tilt; lower: hard but real accelerations are lost
    """

    _positive: ClassVar[tuple[str, ...]] = ()  # numbers that must be more than zero
    _unlimited: ClassVar[tuple[str, ...]] = ()  # the same; infinity is allowed
    gyro_range_rad_s: float = GYRO_RANGE_RAD_S
    force_range_m_s2: float = FORCE_RANGE_M_S2

    def __post_init__(self) -> None:
        for name in numbers_of(type(self)):
            value = getattr(self, name)
            positive = name in self._positive or name in self._unlimited
            if name == "declination_rad":
                right, wanted = abs(value) <= math.pi, "-pi to pi"
            elif name == "elevation_m":
                right, wanted = DEEPEST_M <= value <= HIGHEST_M, f"{DEEPEST_M:g} to {HIGHEST_M:g} m above the sea"
            elif name in RANGES:
                right, wanted = 0.0 < value <= 1e4, "more than zero and at most 10000: no sensor reads more"
            else:
                right = (value > 0.0 if positive else value >= 0.0) and (value < math.inf or name in self._unlimited)
                wanted = "more than zero" if positive else "zero or more"
                wanted = wanted if name in self._unlimited else f"a finite number, {wanted}"
            if not right:
                unit = " rad" if name == "declination_rad" else ""
                raise ValueError(f"{name} is {value}{unit}; it must be {wanted}")
            if name == "gps_latency_s" and value > LONGEST_LATENCY_S:
                raise ValueError(f"gps_latency_s is {value} s; {LONGEST_LATENCY_S} s is the most")


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetometerParams(Params):
    """Base class for estimators that take a magnetometer; its `calibration` changes nothing by default.

    declination_rad : rad  angle from true to magnetic north, positive to the east
        higher: the magnetic heading turns to the right; lower: to the left
    field_range_ut : uT  readings of a magnetometer axis beyond this are rejected
        higher: stronger disturbances reach the heading; lower: readings near iron are lost
    """

    declination_rad: float = 0.0
    calibration: Calibration = field(default_factory=Calibration)
    field_range_ut: float = FIELD_RANGE_UT


def numbers_of(params: type[Params]) -> list[str]:
    """Names of the fields that hold a number or a switch, in their order."""
    return [f.name for f in fields(params) if isinstance(f.default, int | float)]
