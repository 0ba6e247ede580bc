"""Settings of `estimator.ap_dcm`: gains, options, and the original's quirks, each of which can be had or not."""

import math
from dataclasses import dataclass, field
from enum import StrEnum

from estimator.blocks.magnetometer import FIELD_RANGE_UT, Calibration
from estimator.blocks.screening import FORCE_RANGE_M_S2, GYRO_RANGE_RAD_S

MOST_FIXES = 5


class Quirk(StrEnum):
    """Something the original did and the mended algorithm does not; the value is its name in settings and state."""

    UNWRAPPED_COURSE = "unwrapped_course"
    """The course is 0..2 pi and the yaw -pi..pi, their difference is not wrapped: on courses of 180 to 360 degrees
    heading is set to the course at every fix instead of being corrected."""
    STALE_EULER = "stale_euler"
    """Roll, pitch and yaw, where angles are used, are those of the sample before: setting the heading to the course
    loses a sample of roll and pitch."""
    VERTICAL_CLIP = "vertical_clip"
    """The vertical part of the change of velocity is limited to half a g: wrong in loops and steep turns entered."""
    STUCK_P_GAIN = "stuck_p_gain"
    """The gain that should grow from 50 to 500 deg/s compares rad/s with degrees of degrees, and is always one."""
    SHORT_FORCE = "short_force"
    """A mean specific force of less than one g keeps its length instead of being normalised."""
    DECAY_PER_SAMPLE = "decay_per_sample"
    """The proportional yaw term fades by 3 % a sample whatever the sample rate, instead of that at 50 Hz."""
    HASTY_COMPASS = "hasty_compass"
    """A compass off the course is dropped at once, without waiting two seconds."""
    COMPASS_IS_NO_YAW = "compass_is_no_yaw"
    """After 20 s of compass the first course counts as the first yaw information in 20 s: heading is set to it."""
    OVERWRITTEN_WIND = "overwritten_wind"
    """The wind estimate overwrites the older nose and velocity before it forms the sums with them."""


JULY_2013: frozenset[Quirk] = frozenset(Quirk)
"""All quirks: the original."""


@dataclass(frozen=True, slots=True)
class ApDcmParams:
    """Settings; the defaults of gains and limits are those of 2013.

    quirks : frozenset of Quirk   what of the original is not mended; also as a text, names with commas between or
                                ``JULY_2013`` for all of them
    kp, ki : float              roll-pitch gains, 1/s and 1/s^2 per unit of (sine) error; ArduPilot's AHRS_RP_P.
                                Large: errors go quickly, but accelerations and wind get in
    kp_yaw, ki_yaw : float      the same for yaw; AHRS_YAW_P
    gyro_drift_rad_s2 : float   how fast the gyro offset is allowed to drift, per axis
    gps_gain : float            share of the GPS acceleration that is believed, 0..1; AHRS_GPS_GAIN
    gps_delay_fixes : int       fixes by which the GPS velocity is late, 0..5: the specific force is compared that
                                much later (AHRS_GPS_DELAY, November 2013; its default there was 2)
    use_magnetometer : bool or None   take the magnetometer for yaw when it arrives; else the course.  True: one is
                                fitted and calibrated, and the heading is that of the nose.  None: nobody knows, and
                                it is taken if it comes
    declination_rad : float     of the magnetic field, east positive
    calibration                 of the magnetometer; the original's offsets
    fly_forward : bool          an aeroplane: its course may stand for its heading, its airspeed for its motion
    estimate_wind : bool        learn the wind from turns, and from airspeed where there is a sensor
    gyro_range_rad_s, force_range_m_s2, field_range_ut : float   samples beyond are rejected
    """

    quirks: frozenset[Quirk] = frozenset()
    kp: float = 0.3
    ki: float = 0.0087
    kp_yaw: float = 0.3
    ki_yaw: float = 0.01
    gyro_drift_rad_s2: float = math.radians(0.5 / 60.0)
    gps_gain: float = 1.0
    gps_delay_fixes: int = 0
    use_magnetometer: bool | None = None
    declination_rad: float = 0.0
    calibration: Calibration = field(default_factory=Calibration)
    fly_forward: bool = True
    estimate_wind: bool = True
    gyro_range_rad_s: float = GYRO_RANGE_RAD_S
    force_range_m_s2: float = FORCE_RANGE_M_S2
    field_range_ut: float = FIELD_RANGE_UT

    def __post_init__(self) -> None:
        if isinstance(self.quirks, str):  # as it is typed: --set quirks=vertical_clip,stuck_p_gain
            names = frozenset(filter(None, (name.strip() for name in self.quirks.split(","))))
            object.__setattr__(self, "quirks", JULY_2013 if names == {"JULY_2013"} else names)
        unknown = sorted(set(self.quirks) - JULY_2013)
        if unknown:
            raise ValueError(f"quirks has {unknown[0]!r}; there are {', '.join(sorted(JULY_2013))}")
        for name in ("kp", "ki", "kp_yaw", "ki_yaw", "gyro_drift_rad_s2"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be a finite number, zero or more")
        if not 0.0 <= self.gps_gain <= 1.0:
            raise ValueError(f"gps_gain is {self.gps_gain}; it must be 0 to 1")
        if self.gps_delay_fixes not in range(MOST_FIXES + 1):
            raise ValueError(f"gps_delay_fixes is {self.gps_delay_fixes}; it must be a whole number, 0 to {MOST_FIXES}")
        if not abs(self.declination_rad) <= math.pi:
            raise ValueError(f"declination_rad is {self.declination_rad} rad; it must be -pi to pi")
        for name in ("gyro_range_rad_s", "force_range_m_s2", "field_range_ut"):
            if not 0.0 < getattr(self, name) <= 1e4:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be more than zero, 10000 at most")
