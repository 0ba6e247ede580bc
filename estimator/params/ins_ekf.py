"""Parameters of `estimator.ins_ekf`: what it assumes about its sensors and the air, and the floors it computes with.

A perfect part has noise, bias sigma and gain sigma of 0 and an infinite full scale; all of these are accepted.  The
filter then uses the values of `FLOORS`: a state with zero variance would never be corrected again, and zero would not
cover what 50 samples a second leave out (a rate or force that changes within a sample).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from estimator.interface import G_M_S2
from estimator.params.shared import LONGEST_LATENCY_S, MagnetometerParams

LONGEST_LEARNT_S = 2.0  # a latency is learnt between 0 and this, or the given one plus `LEARNT_SIGMAS`
LEARNT_SIGMAS = 6.0

FLOORS: Mapping[str, float] = {
    "gyro_noise_rad_s_sqrt_hz": math.radians(0.01),
    "gyro_bias_sigma_rad_s": math.radians(0.02),
    "gyro_walk_rad_s_sqrt_s": math.radians(0.001),
    "gyro_gain_sigma": 1e-3,
    "gyro_cross_axis": 1e-3,
    "force_noise_m_s2_sqrt_hz": 0.0005 * G_M_S2,
    "force_bias_sigma_m_s2": 0.001 * G_M_S2,
    "gps_noise_m_s": 0.03,
}
"""Smallest values that the filter computes with, by parameter."""


@dataclass(frozen=True, slots=True)
class InsEkfParams(MagnetometerParams):
    """What the filter assumes about its sensors and the air; defaults as `estimator.instruments` assumes.

    A sigma that is too small makes the filter overconfident and slow to recover; one that is too large makes it noisy
    and slow to learn.  Sigmas of sensors may be zero and full scales infinite: see `FLOORS`.

    gyro_noise_rad_s_sqrt_hz : rad/s/sqrt(Hz)  one-sided density of the gyro's white noise, quantisation included
        higher: fixes correct the attitude more; lower: the gyros count more
    gyro_bias_sigma_rad_s : rad/s  sigma of the gyro bias at power-up, after a calibration if there was one
        higher: a large bias is learnt sooner, early errors too; lower: the calibration counts more
    gyro_walk_rad_s_sqrt_s : rad/s/sqrt(s)  random walk of the gyro bias, sigma after one second
        higher: a drifting bias is followed, noisily; lower: a steady bias is learnt better
    gyro_gain_sigma : -  sigma of the relative gain error of a gyro axis
        higher: gain is learnt sooner, attitude counts less after fast turns; lower: the data sheet counts more
    gyro_cross_axis : -  sigma of the sensitivity of a gyro axis to another
        higher: attitude counts less after fast rotation; lower: it counts more
    gyro_full_scale_rad_s : rad/s  readings near this or beyond may be clipped
        higher: clipped readings count as measured (inf: unknown); lower: sound ones count less
    force_noise_m_s2_sqrt_hz : m/s^2/sqrt(Hz)  one-sided density of the accelerometer's white noise
        higher: fixes correct the velocity more; lower: the accelerometer counts more
    force_bias_sigma_m_s2 : m/s^2  sigma of the accelerometer bias
        higher: tilt at rest is less certain, bias is learnt sooner; lower: tilt at rest counts more
    force_full_scale_m_s2 : m/s^2  readings near this or beyond may be clipped
        higher: clipped readings count as measured (inf: unknown); lower: sound ones count less
    gps_noise_m_s : m/s  sigma of each velocity component of a fix
        higher: smoother, slower to correct; lower: noise of the fixes gets in
    gps_filter_s : s  time constant of the receiver's velocity filter; the learnt latency absorbs most of an error
        higher: the modelled receiver lags more; lower: less (0: not at all)
    gps_latency_s : s  age of a fix on arrival, at most 12.5; an error shows until it is learnt
        higher: the filter runs further behind the present; lower: nearer to it
    gps_latency_sigma_s : s  sigma of that latency, which is learnt in flight
        higher: a wrong latency is learnt sooner; lower: the given one counts more (0: it is not learnt)
    gps_stamped : switch  use a fix's own time stamp where it is finite and at most 2 s old
        on: right for a receiver whose clock is that of the samples; off: the latency alone places the fix
    gps_vertical_velocity : switch  the receiver reports a vertical velocity
        on: the third component of a fix is used; off: small incidence is assumed instead
    gps_lag_sigma_s : s  jitter of filter and latency from fix to fix
        higher: fixes count less while turning; lower: they count fully
    wind_sigma_m_s : m/s  sigma of each horizontal component of the wind
        higher: strong wind is accepted, heading is found later; lower: strong wind becomes a heading error
    wind_walk_m_s_sqrt_s : m/s/sqrt(s)  random walk of the wind, sigma after one second
        higher: changing wind is followed, noisily; lower: steady wind is learnt better
    sideslip_sigma_m_s : m/s  sigma of the velocity along the wing, from sideslip and gusts, every 0.2 s
        higher: heading rests less on coordinated flight; lower: sideslip becomes a heading error
    incidence_sigma_m_s : m/s  sigma of the velocity along body z; used without vertical velocity
        higher: vertical motion is less certain; lower: incidence becomes a pitch error
    use_airspeed : switch  use a measured airspeed where there is one
        on: wind and speed are known sooner; off: from the fixes alone
    airspeed_noise_m_s : m/s  sigma of an airspeed
        higher: it counts less; lower: its errors become wind
    use_magnetometer : switch  use the magnetometer where its samples come
        on: for the heading if calibrated, else for a start value; off: heading from motion alone
    magnetometer_calibrated : switch  its readings are free of iron, by nature or by `calibration`
        on: they correct the heading; off: they only give a heading before the first moving fix
    magnetic_noise_rad : rad  sigma of a magnetic heading
        higher: it counts less; lower: disturbances of the field get in
    min_speed_m_s : m/s  slowest ground speed that starts the heading
        higher: the heading is found later; lower: a noisy start
    gate : sigma  innovations beyond so many of their sigmas are rejected
        higher: outliers get in; lower: good fixes are rejected in hard manoeuvres
    elevation_m : m  elevation of the launch place above the sea, for the density of the air
        higher: a measured airspeed counts as a faster motion; lower: as a slower one
    """

    _unlimited: ClassVar = ("gyro_full_scale_rad_s", "force_full_scale_m_s2")
    _positive: ClassVar = (
        "wind_sigma_m_s", "sideslip_sigma_m_s", "incidence_sigma_m_s", "airspeed_noise_m_s", "magnetic_noise_rad",
        "min_speed_m_s", "gate",
    )  # fmt: skip
    gyro_noise_rad_s_sqrt_hz: float = math.radians(0.07)
    gyro_bias_sigma_rad_s: float = math.radians(1.0)
    gyro_walk_rad_s_sqrt_s: float = math.radians(0.02)
    gyro_gain_sigma: float = 0.015
    gyro_cross_axis: float = 0.005
    gyro_full_scale_rad_s: float = math.radians(2000.0)
    force_noise_m_s2_sqrt_hz: float = 0.004 * G_M_S2
    force_bias_sigma_m_s2: float = 0.02 * G_M_S2
    force_full_scale_m_s2: float = 16.0 * G_M_S2
    gps_noise_m_s: float = 0.1
    gps_filter_s: float = 0.0
    gps_latency_s: float = 0.3
    gps_latency_sigma_s: float = 0.15
    gps_stamped: bool = True
    gps_vertical_velocity: bool = True
    gps_lag_sigma_s: float = 0.02
    wind_sigma_m_s: float = 4.0
    wind_walk_m_s_sqrt_s: float = 0.1
    sideslip_sigma_m_s: float = 1.4
    incidence_sigma_m_s: float = 3.0
    use_airspeed: bool = True
    airspeed_noise_m_s: float = 1.0
    use_magnetometer: bool = True
    magnetometer_calibrated: bool = False
    magnetic_noise_rad: float = math.radians(5.0)
    min_speed_m_s: float = 3.0
    gate: float = 5.0
    elevation_m: float = 0.0

    @property
    def longest_latency_s(self) -> float:
        """Longest latency that is learnt."""
        return max(
            LONGEST_LEARNT_S, min(self.gps_latency_s + LEARNT_SIGMAS * self.gps_latency_sigma_s, LONGEST_LATENCY_S)
        )
