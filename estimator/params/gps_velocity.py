"""Parameters of `estimator.gps_velocity`."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from estimator.params.shared import MagnetometerParams

YAW_REFERENCES = ("course", "nose", "magnetometer")
YawReference = Literal["course", "nose", "magnetometer"]


@dataclass(frozen=True, slots=True)
class GpsVelocityParams(MagnetometerParams):
    """Gains and options; the default receiver is what `estimator.instruments` assumes.

    yaw_reference : choice  what the heading converges to: course, nose or magnetometer
    w_rp : -  weight of the roll-pitch error (Eqn 28 of the paper)
        higher: tilt errors fade sooner, but the noise of the reports gets in; lower: smoother, slower
    w_y : -  weight of the yaw error (Eqn 28)
        higher: heading errors fade sooner, noise gets in; lower: smoother, slower
    w_start : -  weight of the 2009 paper's roll-pitch correction, which acts before the yaw lock and without reports
        higher: tilt is found sooner, but a launch tilts it; lower: the first seconds rest on the gyros
    k_p : 1/s  proportional gain (Eqn 29)
        higher: all errors fade sooner, noise gets in; lower: smoother, drift stays longer
    k_i : 1/s^2  integral gain (Eqn 29); k_i / k_p is how fast a gyro offset is learnt
        higher: offsets are learnt sooner, but manoeuvres are learnt as offset; lower: steadier, slower to learn
    offset_limit_rad_s : rad/s  largest gyro offset, per axis, that is learnt after the calibration
        higher: a poor calibration can be recovered; lower: a long wrong correction does less harm
    integrate_below_rad_s : rad/s  the offset is learnt only while the aeroplane turns more slowly than this
        higher: learning goes on in turns (inf: always); lower: less time to learn
    gps_filter_s : s  time constant of the receiver's velocity filter; a wrong value tilts the estimate in turns
        higher: the inertial side is filtered more; lower: less (0: not at all)
    gps_latency_s : s  age of a fix on arrival, at most 12.5; a wrong value tilts it in turns
        higher: a fix is compared with an older motion; lower: with a newer one
    gps_vertical_velocity : switch  the receiver reports a vertical velocity
        on: Eqn 4 compares all three components; off: the horizontal ones only
    launch_gate : -  before the lock, no correction while the reference differs from gravity by more than this share
        higher: corrections also in launches (inf: always); lower: the gyros coast more often
    min_speed_m_s : m/s  slowest speed at which a velocity gives a heading
        higher: yaw stays uncorrected for longer at low speed; lower: noisy directions of slow flight are used
    """

    _unlimited: ClassVar = ("offset_limit_rad_s", "integrate_below_rad_s", "launch_gate")
    yaw_reference: YawReference = "course"
    w_rp: float = 0.5
    w_y: float = 1.0
    w_start: float = 0.3
    k_p: float = 1.0
    k_i: float = 0.03
    offset_limit_rad_s: float = math.radians(6.0)
    integrate_below_rad_s: float = math.radians(60.0)
    gps_filter_s: float = 0.0
    gps_latency_s: float = 0.3
    gps_vertical_velocity: bool = True
    launch_gate: float = 0.2
    min_speed_m_s: float = 3.0

    def __post_init__(self) -> None:
        MagnetometerParams.__post_init__(self)
        if self.yaw_reference not in YAW_REFERENCES:
            raise ValueError(f"yaw_reference is {self.yaw_reference!r}; it must be one of {', '.join(YAW_REFERENCES)}")


NOSE = GpsVelocityParams(yaw_reference="nose")
MAGNETOMETER = GpsVelocityParams(yaw_reference="magnetometer")
