"""Settings of `estimator.matrixpilot`, and those of the firmware's boards and of its earlier form."""

import math
from dataclasses import dataclass, fields

from estimator.blocks.screening import FORCE_RANGE_M_S2, GYRO_RANGE_RAD_S


@dataclass(frozen=True, slots=True)
class MatrixPilotParams:
    """Gains and options; the defaults are the firmware's on its UDB4 board.

    k_p_rp, k_i_rp : float     roll-pitch gains, 1/s and 1/s^2 per radian of error.  Large: errors go quickly, but
                               accelerations get in
    k_p_yaw, k_i_yaw : float   the same for yaw
    centrifugal_from_gps : bool   omega x V with the speed of the GPS (Eqns 25-26, the firmware up to 2017)
    keep_tilt : bool           renormalise without touching the Z row's direction (the firmware up to 2017: Eqns 18-21)
    forward_acceleration : bool   take the change of speed between reports out of the accelerometer
    estimate_wind : bool       learn the wind, and let yaw meet the velocity through the air
    late_by_one_report : bool  carry a report on by its last change
    spin_boost : bool          gains rise with the spin rate beyond 50 deg/s, to tenfold at 500 deg/s
    calibrate_gain : bool      learn the gyros' gain while spinning, within +-10 %
    pitch_error_limit : float  largest pitch error that is believed, of gravity; for launches.  inf turns it off
    min_speed_m_s : float      slowest ground speed at which a course means anything
    climb_from_height : bool   take the sink rate from the change of the reported height between two reports, as the
                               firmware does with receivers that report none (NMEA); else the reported one, which is
                               then zero.  Heights that are 0.5 m wrong at 5 Hz make 3.5 m/s of noise: the tilt is
                               off by 4.3 degrees instead of 1.6 (`crosswind`, suite apm2, seeds 0 to 2)
    fixed_point : bool         the 16-bit arithmetic of the firmware
    gyro_range_rad_s, force_range_m_s2 : float   samples beyond are rejected
    """

    k_p_rp: float = 0.071
    k_i_rp: float = 0.0044
    k_p_yaw: float = 0.232
    k_i_yaw: float = 0.0023
    centrifugal_from_gps: bool = False
    keep_tilt: bool = True
    forward_acceleration: bool = True
    estimate_wind: bool = True
    late_by_one_report: bool = True
    spin_boost: bool = True
    calibrate_gain: bool = True
    pitch_error_limit: float = 0.25
    min_speed_m_s: float = 1.5
    climb_from_height: bool = False
    fixed_point: bool = False
    gyro_range_rad_s: float = GYRO_RANGE_RAD_S
    force_range_m_s2: float = FORCE_RANGE_M_S2

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name in ("pitch_error_limit", "gyro_range_rad_s", "force_range_m_s2"):
                if not value > 0.0:
                    raise ValueError(f"{f.name} is {value}; it must be more than zero")
            elif not 0.0 <= value < math.inf:
                raise ValueError(f"{f.name} is {value}; it must be a finite number, zero or more")
            if f.name.endswith(("range_rad_s", "range_m_s2")) and value > 1e4:
                raise ValueError(f"{f.name} is {value}; no sensor has that, 10000 is the most")


UDB4 = MatrixPilotParams()
"""Analog gyros, 40 Hz."""
UDB5 = MatrixPilotParams(k_p_rp=0.119, k_i_rp=0.0074, k_p_yaw=0.141, k_i_yaw=0.0013)
"""UDB5 and AUAV3: digital gyros, 200 Hz."""
CLASSIC = MatrixPilotParams(centrifugal_from_gps=True, keep_tilt=False)
"""The firmware up to 2017, UDB4."""
