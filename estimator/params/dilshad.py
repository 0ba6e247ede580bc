"""Parameters of `estimator.dilshad`."""

import math
from dataclasses import dataclass
from typing import ClassVar

from estimator.params.shared import MagnetometerParams


@dataclass(frozen=True, slots=True)
class DilshadParams(MagnetometerParams):
    """Gains and sensors; the paper gives no gains.  The GPS finds what the declination lacks.

    w_rp : -  weight of the roll-pitch correction
        higher: tilt errors fade sooner, but accelerations get in; lower: smoother, slower
    w_y : -  weight of the yaw correction
        higher: heading errors fade sooner, but disturbances of the field get in; lower: smoother, slower
    k_p : 1/s  proportional gain
        higher: all errors fade sooner, noise gets in; lower: smoother, drift stays longer
    k_i : 1/s^2  integral gain; k_i / k_p is how fast a gyro offset is learnt
        higher: offsets are learnt sooner, but manoeuvres are learnt as offset; lower: steadier, slower to learn
    offset_limit_rad_s : rad/s  largest gyro offset, per axis, that is learnt after the calibration
        higher: a poor calibration can be recovered; lower: a long wrong correction does less harm
    yaw_every_s : s  shortest mean time between two magnetometer headings (the paper: 125 ms)
        higher: fewer samples are used; lower: every sample is used (0)
    gps_weight_s : s  time over which GPS courses correct the magnetometer's heading
        higher: slower and smoother (inf: never); lower: faster, but a crab in wind becomes a heading error sooner
    gps_lag_s : s  age of a course formed from three positions (filter, latency, interval); an error shows after turns
        higher: more of the turn since then is added to the course; lower: less
    min_speed_m_s : m/s  slowest ground speed at which a course is used
        higher: declination errors stay for longer; lower: noisy courses of slow flight are used
    """

    _positive: ClassVar = ("offset_limit_rad_s", "gps_lag_s")
    _unlimited: ClassVar = ("gps_weight_s",)
    w_rp: float = 0.3
    w_y: float = 0.6
    k_p: float = 1.0
    k_i: float = 0.02
    offset_limit_rad_s: float = math.radians(6.0)
    yaw_every_s: float = 0.125
    gps_weight_s: float = 20.0
    gps_lag_s: float = 1.4
    min_speed_m_s: float = 3.0
