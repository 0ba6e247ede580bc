"""The standby attitude: what LEVEL flies on while the estimator is ill.

A small filter of its own, which starts at the last healthy estimate and uses nothing of later ones.  Gyros carry the
attitude on (Eqns 16-21).  Three references hold it, and correct the gyro offset, which the estimator may not have
learnt yet:

* the vertical: the accelerometer less the centrifugal acceleration at the known or assumed airspeed (Eqns 25-27);
* if the accelerometer is unusable (not a number, or frozen): the bank that belongs to the turn rate in a coordinated
  turn, ``tan(bank) = V w / g``, and the pitch that belongs to the GPS climb rate, ``sin(pitch - alpha) = climb / V``;
* the heading: the GPS course (Eqns 22-24), which shows the offset of the yaw gyro.  Unlearnt, it would be flown as a
  bank of ``V offset / g``, 4 degrees for 3 deg/s.

Proportional and integral terms as in Eqns 28-29.  The integral rests in fast rotations.  Without a GPS the course is
left out; the offset in yaw then remains, as a gentle turn.

Source: Premerlani & Bizard, Direction Cosine Matrix IMU: Theory.
"""

import math
from dataclasses import dataclass

from autopilot.guidance import gps_age, unit
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from estimator.params.shared import FORCE_RANGE_M_S2, GYRO_RANGE_RAD_S
from estimator.rotation import integrate

_FROZEN_S = 0.2  # noise never repeats for so long
_LEAST_G, _MOST_G = 0.5, 1.6  # a reference outside contains other accelerations
_TURNING_RAD_S = 0.5  # faster rotations teach no offset
_MOST_YAW_ERROR = 0.3  # sine: a crab angle in strong wind is no offset


@dataclass(frozen=True, slots=True)
class StandbyParams:
    """Gains of the standby attitude; the defaults suit both aeroplanes.

    tilt_gain_1_s : correction of bank and pitch per error (1/s, default 0.3).  Higher: follows offsets with less error,
        and accelerations more; lower: drifts further before the offset is learnt
    tilt_offset_1_s2 : learning of the gyro offset from that error (1/s2, default 0.02).  Higher: learns faster, then
        oscillates; 0: the last offset of the estimator is kept
    yaw_gain_1_s, yaw_offset_1_s2 : the same in yaw, from the course (1/s and 1/s2, default 0.2 and 0.015).  Higher: a
        crab angle, which changes in gusts, counts more
    alpha_rad : angle of attack in level flight, for the pitch without an accelerometer (rad, default 1 deg).  Higher:
        flies slower then
    offset_limit_rad_s : largest offset per axis (rad/s, default 0.35).  Lower: large offsets remain
    """

    tilt_gain_1_s: float = 0.3
    tilt_offset_1_s2: float = 0.02
    yaw_gain_1_s: float = 0.2
    yaw_offset_1_s2: float = 0.015
    alpha_rad: float = math.radians(1.0)
    offset_limit_rad_s: float = 0.35


@kernel
def _feels(row, s, dt_s):  # type: ignore[no-untyped-def]
    """Whether the accelerometer of this tick is usable: numbers within its range that do change."""
    f, usable, frozen = row.force_b_m_s2, True, True
    for i in range(3):
        usable = usable and abs(f[i]) <= FORCE_RANGE_M_S2  # False for NaN
        frozen = frozen and f[i] == s.force_last_b_m_s2[i]
        s.force_last_b_m_s2[i] = f[i]
    s.force_frozen_s = s.force_frozen_s + dt_s if frozen else 0.0
    return usable and s.force_frozen_s < _FROZEN_S


@kernel
def _gravity(row, s, p, g, dt_s):  # type: ignore[no-untyped-def]
    """Unit vector down in body axes, by the references of the vertical; (0, 0, 0) if none is usable."""
    w, r_z, v = s.omega_kept_b_rad_s, s.R_kept_eb[2], s.airspeed_m_s
    if _feels(row, s, dt_s):
        f = row.force_b_m_s2
        x, y, z = -f[0], w[2] * v - f[1], -w[1] * v - f[2]  # acceleration w x (V, 0, 0), minus specific force
        length = math.sqrt(x * x + y * y + z * z)
        if _LEAST_G * G_M_S2 <= length <= _MOST_G * G_M_S2:
            return x / length, y / length, z / length
        return 0.0, 0.0, 0.0
    if r_z[2] <= 0.0:  # a coordinated turn is upright
        return 0.0, 0.0, 0.0
    turning = w[0] * r_z[0] + w[1] * r_z[1] + w[2] * r_z[2]
    x = r_z[0]  # minus the sine of the pitch
    if math.isfinite(gps_age(row, g)):
        x = -math.sin(p.alpha_rad + math.asin(clip(-row.gps_v_e_m_s[2] / v, -0.5, 0.5)))
    y, z = v * turning, G_M_S2
    across = math.sqrt(max(1.0 - x * x, 0.0)) / math.hypot(y, z)
    return x, y * across, z * across


@kernel
def _yaw_error(row, s, g, least_m_s):  # type: ignore[no-untyped-def]
    """Sine of the angle from the nose to the present course, positive right; 0 without a course."""
    v_n, v_e = row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]
    if not math.isfinite(gps_age(row, g)) or math.hypot(v_n, v_e) < least_m_s:
        return 0.0
    cosine, sine = math.cos(s.unseen_turn_rad), math.sin(s.unseen_turn_rad)
    north, east = unit(v_n * cosine - v_e * sine, v_n * sine + v_e * cosine)
    nose_north, nose_east = unit(s.R_kept_eb[0, 0], s.R_kept_eb[1, 0])
    return clip(nose_north * east - nose_east * north, -_MOST_YAW_ERROR, _MOST_YAW_ERROR)


@kernel
def carry_on(row, s, p, g, least_m_s, dt_s):  # type: ignore[no-untyped-def]
    """One tick of the standby attitude; a gyro sample that is no number leaves it as it is.

    row : measured   p, g : records of StandbyParams, GuidanceParams   least_m_s : ground speed that has a course
    s : record with `R_kept_eb`, `bias_kept_b_rad_s`, `omega_kept_b_rad_s`, `force_last_b_m_s2`, `force_frozen_s`,
        updated, and `airspeed_m_s`, `unseen_turn_rad`
    """
    gyro, most, r_z = row.gyro_b_rad_s, GYRO_RANGE_RAD_S, s.R_kept_eb[2]
    if not (abs(gyro[0]) <= most and abs(gyro[1]) <= most and abs(gyro[2]) <= most):
        return
    for i in range(3):
        s.omega_kept_b_rad_s[i] = gyro[i] - s.bias_kept_b_rad_s[i]
    w = s.omega_kept_b_rad_s
    x, y, z = _gravity(row, s, p, g, dt_s)
    yaw = _yaw_error(row, s, g, least_m_s)
    a, b, c = r_z[0], r_z[1], r_z[2]
    tilt = (y * c - z * b, z * a - x * c, x * b - y * a)  # gravity x r_z turns r_z towards gravity
    learns = w[0] * w[0] + w[1] * w[1] + w[2] * w[2] < _TURNING_RAD_S * _TURNING_RAD_S
    for i in range(3):
        rate = p.tilt_gain_1_s * tilt[i] + p.yaw_gain_1_s * yaw * r_z[i]
        offset = p.tilt_offset_1_s2 * tilt[i] + p.yaw_offset_1_s2 * yaw * r_z[i]
        s.turn_kept_b_rad_s[i] = w[i] + rate
        if learns:
            learnt = s.bias_kept_b_rad_s[i] - offset * dt_s
            s.bias_kept_b_rad_s[i] = clip(learnt, -p.offset_limit_rad_s, p.offset_limit_rad_s)
    integrate(s.R_kept_eb, s.turn_kept_b_rad_s, dt_s)
