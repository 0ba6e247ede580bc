"""Parameters of `estimator.matrixpilot`, and the settings of the firmware's boards and of its earlier form."""

from dataclasses import dataclass
from typing import ClassVar

from estimator.params.shared import Params


@dataclass(frozen=True, slots=True)
class MatrixPilotParams(Params):
    """Gains and options; the defaults are the firmware's on its UDB4 board.

    k_p_rp : 1/s  proportional gain of the roll-pitch error
        higher: tilt errors fade sooner, but accelerations get in; lower: smoother, slower
    k_i_rp : 1/s^2  integral gain of the roll-pitch error
        higher: gyro offsets are learnt sooner, but manoeuvres are learnt as offset; lower: steadier, slower
    k_p_yaw : 1/s  proportional gain of the yaw error
        higher: heading errors fade sooner, but wind and course noise get in; lower: smoother, slower
    k_i_yaw : 1/s^2  integral gain of the yaw error
        higher: yaw offset is learnt sooner, but turns are learnt as offset; lower: steadier, slower
    centrifugal_from_gps : switch  centrifugal acceleration from omega x V with the GPS speed (Eqns 25-26, the firmware
        up to 2017), not from the length of the force
        on: turns tilt the estimate if the speed is missing or wrong; off: turns need no GPS
    keep_tilt : switch  how the matrix is renormalised
        on: the Z row keeps its direction (the firmware since 2017); off: Eqns 18-21
    forward_acceleration : switch  remove the change of airspeed between reports from the accelerometer
        on: launches and dives tilt the estimate less; off: a change of speed is taken for pitch
    estimate_wind : switch  learn the wind
        on: yaw follows the velocity through the air, and the heading is the nose's; off: the course
    late_by_one_report : switch  extrapolate each report by its last change
        on: right for a receiver one report late; off: right for a prompt one
    spin_boost : switch  gains rise with the rate above 50 deg/s, tenfold at 500 deg/s
        on: errors of fast rotation fade sooner; off: constant gains
    calibrate_gain : switch  learn the gyros' gain while spinning, within 10 %
        on: long rotations accumulate less error; off: the gain counts as one
    pitch_error_limit : -  largest pitch error that is used, as a share of gravity
        higher: a launch disturbs pitch more (inf: no limit); lower: a large pitch error fades more slowly
    min_speed_m_s : m/s  slowest ground speed at which a course is used
        higher: yaw stays uncorrected for longer at low speed; lower: the noisy course of a slow aeroplane is used
    climb_from_height : switch  sink rate from the change of height between two reports, as the firmware does for NMEA
        receivers, not the reported one
        on: noise of the heights tilts the estimate (0.5 m at 5 Hz is 3.5 m/s; with `crosswind`, suite apm2, seeds 0-2,
        4.3 degrees instead of 1.6); off: less noise, but the receiver must report a vertical velocity
    fixed_point : switch  arithmetic
        on: the firmware's 16-bit numbers; off: floating point
    """

    _unlimited: ClassVar = ("pitch_error_limit",)
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


UDB4 = MatrixPilotParams()
"""Analog gyros, 40 Hz."""
UDB5 = MatrixPilotParams(k_p_rp=0.119, k_i_rp=0.0074, k_p_yaw=0.141, k_i_yaw=0.0013)
"""UDB5 and AUAV3: digital gyros, 200 Hz."""
CLASSIC = MatrixPilotParams(centrifugal_from_gps=True, keep_tilt=False)
"""The firmware up to 2017, UDB4."""
