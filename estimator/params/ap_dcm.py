"""Parameters of `estimator.ap_dcm`: gains, options, and the quirks of the original, each of which can be restored."""

import math
from dataclasses import dataclass
from enum import StrEnum

from estimator.params.shared import MagnetometerParams

MOST_FIXES = 5


class Quirk(StrEnum):
    """A fault of the original that is corrected here; the value is its name in parameters and state."""

    UNWRAPPED_COURSE = "unwrapped_course"
    """Course (0..2 pi) minus yaw (-pi..pi) is not wrapped: on courses of 180 to 360 degrees the heading is set to the
    course at every fix instead of being corrected."""
    STALE_EULER = "stale_euler"
    """Roll, pitch and yaw, where angles are used, come from the previous sample: setting the heading to the course
    loses one sample of roll and pitch."""
    VERTICAL_CLIP = "vertical_clip"
    """The vertical change of velocity is limited to half a g: wrong in loops and when entering steep turns."""
    STUCK_P_GAIN = "stuck_p_gain"
    """The gain that should grow from 50 to 500 deg/s compares rad/s with twice-converted degrees: it is always one."""
    SHORT_FORCE = "short_force"
    """A mean specific force of less than one g keeps its length instead of being normalised."""
    DECAY_PER_SAMPLE = "decay_per_sample"
    """The proportional yaw term fades by 3 % per sample at any sample rate, not only at 50 Hz."""
    HASTY_COMPASS = "hasty_compass"
    """A compass that is off the course is dropped at once instead of after two seconds."""
    COMPASS_IS_NO_YAW = "compass_is_no_yaw"
    """After 20 s of compass the first course counts as the first yaw reference in 20 s: the heading is set to it."""
    OVERWRITTEN_WIND = "overwritten_wind"
    """The wind estimate overwrites the previous nose and velocity before it has summed them."""


JULY_2013: frozenset[Quirk] = frozenset(Quirk)
"""All quirks: the original."""


@dataclass(frozen=True, slots=True)
class ApDcmParams(MagnetometerParams):
    """Gains and options; the defaults of gains and limits are those of 2013.  Names in capitals are ArduPilot's.

    quirks : choice  faults of the original to restore: names of `Quirk` with commas between, or JULY_2013 for all
    kp : 1/s  proportional roll-pitch gain per unit of (sine) error, AHRS_RP_P
        higher: tilt errors fade sooner, but accelerations and wind get in; lower: smoother, slower
    ki : 1/s^2  integral roll-pitch gain
        higher: gyro offsets are learnt sooner, but manoeuvres are learnt as offset; lower: steadier, slower
    kp_yaw : 1/s  proportional yaw gain, AHRS_YAW_P
        higher: heading errors fade sooner, but wind and noise get in; lower: smoother, slower
    ki_yaw : 1/s^2  integral yaw gain
        higher: yaw offset is learnt sooner, but turns are learnt as offset; lower: steadier, slower
    gyro_drift_rad_s2 : rad/s^2  fastest drift of the gyro offset, per axis, that is followed
        higher: a warming gyro is followed, wrong corrections too; lower: the offset changes more slowly
    gps_gain : -  share of the GPS acceleration that is used, 0..1, AHRS_GPS_GAIN
        higher: tilt is right in turns; lower: noise of the fixes gets in less, turns tilt the estimate
    gps_delay_fixes : fixes  delay of the GPS velocity, 0..5; a wrong value tilts the estimate in turns.  AHRS_GPS_DELAY
        of November 2013, 2 by default there
        higher: a fix is compared with an older force; lower: with a newer one
    use_magnetometer : switch  use the magnetometer for yaw; None: if samples come, without claiming the nose's heading
        on: it is fitted and calibrated, and the heading is the nose's; off: yaw from the course only
    fly_forward : switch  the craft is an aeroplane
        on: the course can stand in for the heading, the airspeed for the motion; off: neither
    estimate_wind : switch  learn the wind in turns, and from airspeed where there is a sensor
        on: the wind is reported, and used to judge the compass; off: it counts as zero
    elevation_m : m  elevation of the launch place above the sea, for the density of the air
        higher: a measured airspeed counts as a faster motion; lower: as a slower one
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
    fly_forward: bool = True
    estimate_wind: bool = True
    elevation_m: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.quirks, str):  # as typed: --set quirks=vertical_clip,stuck_p_gain
            names = frozenset(filter(None, (name.strip() for name in self.quirks.split(","))))
            object.__setattr__(self, "quirks", JULY_2013 if names == {"JULY_2013"} else names)
        unknown = sorted(set(self.quirks) - JULY_2013)
        if unknown:
            raise ValueError(f"quirks has {unknown[0]!r}; choose from {', '.join(sorted(JULY_2013))}")
        if not 0.0 <= self.gps_gain <= 1.0:
            raise ValueError(f"gps_gain is {self.gps_gain}; it must be 0 to 1")
        if self.gps_delay_fixes not in range(MOST_FIXES + 1):
            raise ValueError(f"gps_delay_fixes is {self.gps_delay_fixes}; it must be a whole number, 0 to {MOST_FIXES}")
        MagnetometerParams.__post_init__(self)


AP_DCM_2013 = ApDcmParams(quirks=JULY_2013)
