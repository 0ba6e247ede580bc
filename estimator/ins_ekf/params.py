"""Parameters of `estimator.ins_ekf`: what it assumes of its sensors and of the air, and the least it calculates with.

A perfect part has noise 0, bias sigma 0, gain sigma 0 and a full scale of infinity; all of these are accepted.  The
filter then calculates with the floors of `FLOORS`: a variance of exactly zero would make it deaf to that state for
ever, and would not cover what 50 samples a second leave out (a rate or force that changes within a sample).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from estimator.blocks.magnetometer import FIELD_RANGE_UT, Calibration
from estimator.blocks.screening import FORCE_RANGE_M_S2, GYRO_RANGE_RAD_S
from estimator.interface import G_M_S2

LONGEST_LATENCY_S = 12.5
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
"""The least with which the filter calculates, by parameter."""


@dataclass(frozen=True, slots=True)
class InsEkfParams:
    """What the filter assumes of its sensors and of the air.

    The defaults are what is assumed where nothing is known, see `estimator.instruments`.

    A sigma that is too small makes the estimate overconfident and slow to recover; one that is too large makes it
    noisy and slow to learn.  Sigmas of sensors may be zero, full scales infinite: see `FLOORS`.

    gyro_noise_rad_s_sqrt_hz : float    one-sided density of the white noise, quantisation included
    gyro_bias_sigma_rad_s : float       of the bias at power-up, after a calibration if there was one
    gyro_walk_rad_s_sqrt_s : float      the bias walks, sigma after one second
    gyro_gain_sigma : float             of the relative gain error of each axis
    gyro_cross_axis : float             of each axis' sensitivity to another
    gyro_full_scale_rad_s : float       readings near it or beyond may be cut off
    force_noise_m_s2_sqrt_hz : float    one-sided density of the accelerometer's white noise
    force_bias_sigma_m_s2 : float       of its bias
    force_full_scale_m_s2 : float       readings near it or beyond may be cut off
    gps_noise_m_s : float               of each velocity component of a fix
    gps_filter_s : float                time constant of the receiver's velocity filter; 0 is none
    gps_latency_s : float               from the moment a fix is true to its arrival, at most 12.5
    gps_latency_sigma_s : float         of that latency, which is learnt in flight; 0: it is known and not learnt
    gps_stamped : bool                  use the fix's own time stamp instead, where it is finite and at most 2 s old
    gps_vertical_velocity : bool        False: the third component of a fix is no measurement
    gps_lag_sigma_s : float             jitter of filter and latency from fix to fix; inflates a fix while turning
    wind_sigma_m_s : float              of each horizontal component of the wind
    wind_walk_m_s_sqrt_s : float        the wind walks, sigma after one second
    sideslip_sigma_m_s : float          of the velocity along the wing, by slip and gusts, every 0.2 s
    incidence_sigma_m_s : float         of that along the body's z axis, likewise; used without vertical velocity
    use_airspeed : bool                 use airspeeds where they come
    airspeed_noise_m_s : float          sigma of an airspeed
    use_magnetometer : bool             use the magnetometer where its samples come: one that is calibrated for the
                                        heading, any other for the heading before the first moving fix alone
    magnetometer_calibrated : bool      whether its readings are free of iron, by nature or by `calibration`
    calibration                         of the magnetometer
    declination_rad : float             magnetic north from true north, positive to the east
    magnetic_noise_rad : float          sigma of a magnetic heading
    min_speed_m_s : float               slowest ground speed that starts the heading
    gate : float                        innovations beyond so many sigmas are rejected
    gyro_range_rad_s, force_range_m_s2, field_range_ut : float   samples beyond are rejected
    """

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
    calibration: Calibration = field(default_factory=Calibration)
    field_range_ut: float = FIELD_RANGE_UT
    declination_rad: float = 0.0
    magnetic_noise_rad: float = math.radians(5.0)
    min_speed_m_s: float = 3.0
    gate: float = 5.0
    gyro_range_rad_s: float = GYRO_RANGE_RAD_S
    force_range_m_s2: float = FORCE_RANGE_M_S2

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(f.default, bool) or f.name == "calibration":
                continue
            if f.name == "declination_rad":
                if not abs(value) <= math.pi:
                    raise ValueError(f"declination_rad is {value} rad; it must lie between -pi and pi")
            elif f.name in _MAY_BE_INFINITE:
                if not value > 0.0:
                    raise ValueError(f"{f.name} is {value}; it must be more than zero, or infinity")
            elif not 0.0 <= value < math.inf or (value == 0.0 and f.name not in _MAY_BE_ZERO):
                least = "zero or more" if f.name in _MAY_BE_ZERO else "more than zero"
                raise ValueError(f"{f.name} is {value}; it must be a finite number, {least}")
        for name in ("gyro_range_rad_s", "force_range_m_s2", "field_range_ut"):
            if getattr(self, name) > 1e4:
                raise ValueError(f"{name} is {getattr(self, name)}; no sensor has that, 10000 is the most")
        if self.gps_latency_s > LONGEST_LATENCY_S:
            raise ValueError(f"gps_latency_s is {self.gps_latency_s} s; {LONGEST_LATENCY_S} s is the most")

    @property
    def longest_latency_s(self) -> float:
        """The longest latency that is learnt."""
        return max(
            LONGEST_LEARNT_S, min(self.gps_latency_s + LEARNT_SIGMAS * self.gps_latency_sigma_s, LONGEST_LATENCY_S)
        )


_MAY_BE_INFINITE = ("gyro_full_scale_rad_s", "force_full_scale_m_s2")
_MAY_BE_ZERO = (
    *FLOORS, "gps_filter_s", "gps_latency_s", "gps_latency_sigma_s", "gps_lag_sigma_s",
    "wind_walk_m_s_sqrt_s",
)  # fmt: skip
