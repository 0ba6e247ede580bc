"""The yaw correction of `estimator.ap_dcm`, by compass or course (chapter 3.1 of the report)."""

import math

import numpy as np

from estimator.blocks.kernels import clip, dot, wrap
from estimator.compiler.jit import kernel

FIX_LIFE_S, FIELD_LIFE_S = 2.0, 0.5  # an older sample is not used
MIN_SPEED_M_S = 3.0  # slowest ground speed with a course
SPIN_LIMIT_RAD_S = math.radians(20.0)  # no offset is learnt while turning faster
YAW_LEARN_S = 2.0  # a yaw reference older than this teaches no offset
YAW_DECAY = 0.97  # of the proportional yaw term, in each sample without a reference
YAW_FADE_HZ = -50.0 * math.log(YAW_DECAY)  # the same at any sample rate, as it was at 50 Hz
LOST_S, LOST_M_S, LOST_RAD = 20.0, 9.0, 1.047  # heading is set to the course after so long, or if fast and so far off
COS_OFF_COURSE, OFF_COURSE_S = math.cos(math.radians(45.0)), 2.0  # a compass so far off for so long is not used


@kernel
def _yaw(R_eb):  # type: ignore[no-untyped-def]
    return np.arctan2(R_eb[1, 0], R_eb[0, 0])


@kernel
def set_heading(s, heading_rad):  # type: ignore[no-untyped-def]
    """Set the heading: the matrix of the Euler angles' roll and pitch, and of `heading_rad`."""
    angle = heading_rad - _yaw(s.R_euler_eb)
    c, z = np.cos(angle), np.sin(angle)
    for j in range(3):
        north, east = s.R_euler_eb[0, j], s.R_euler_eb[1, j]
        s.R_eb[0, j], s.R_eb[1, j], s.R_eb[2, j] = c * north - z * east, z * north + c * east, s.R_euler_eb[2, j]
    s.omega_yaw_p = 0.0
    s.yaw_found = 1


@kernel
def judge_compass(s):  # type: ignore[no-untyped-def]
    """Set ``s.compass``: 0 if it is further off the course than wind can explain."""
    off = False
    if s.fly_forward and s.fix_age_s <= FIX_LIFE_S and s.speed_m_s >= MIN_SPEED_M_S:
        w, x, y = s.wind_e_m_s, s.R_euler_eb[0, 0], s.R_euler_eb[1, 0]
        calm = w[0] * w[0] + w[1] * w[1] + w[2] * w[2] < (0.8 * s.speed_m_s) ** 2
        off = calm and x * s.course[0] + y * s.course[1] < COS_OFF_COURSE * np.sqrt(x * x + y * y)
    s.off_course_s = s.off_course_s + s.dt_s if off else 0.0
    s.compass = s.field_age_s <= FIELD_LIFE_S and s.off_course_s <= (0.0 if s.hasty_compass else OFF_COURSE_S)


@kernel
def compass_error(s):  # type: ignore[no-untyped-def]
    """Earth-frame yaw error of the magnetometer (Eqns 3.1 and 3.2); sets the heading the first time."""
    m = s.field_b_ut
    north, east = dot(s.R_eb[0], m), dot(s.R_eb[1], m)  # Eqn 3.1
    length = np.sqrt(north * north + east * east)
    if length < 1e-9:  # vertical: no direction
        return 0.0
    if not s.yaw_found:
        set_heading(s, _yaw(s.R_eb) + s.declination_rad - np.arctan2(east, north))
        return 0.0
    return (north * np.sin(s.declination_rad) - east * np.cos(s.declination_rad)) / length  # Eqn 3.2


@kernel
def course_error(s):  # type: ignore[no-untyped-def]
    """Earth-frame yaw error against the course; sets the heading to it where yaw is lost."""
    apart = s.course_rad - _yaw(s.R_euler_eb)
    far = abs(apart if s.unwrapped_course else wrap(apart)) >= LOST_RAD
    known_s = s.course_yaw_s if s.compass_is_no_yaw else max(s.course_yaw_s, s.compass_yaw_s)
    if not s.yaw_found or s.clock_s - known_s > LOST_S or (s.speed_m_s >= LOST_M_S and far):
        set_heading(s, s.course_rad)
        return 0.0
    return np.sin(apart)


@kernel
def correct_yaw(s):  # type: ignore[no-untyped-def]
    """Yaw correction by compass or course (Eqns 3.3-3.5): body z alone is corrected."""
    judge_compass(s)
    if s.compass and s.new_field:
        now_s = s.clock_s - s.field_age_s
        since_s = now_s - s.compass_yaw_s
        error = compass_error(s)
        s.compass_yaw_s, s.new_field = now_s, 0
    elif not s.compass and s.fly_forward and s.new_course and s.speed_m_s >= MIN_SPEED_M_S:
        now_s = s.clock_s - s.fix_age_s
        since_s = now_s - s.course_yaw_s
        error = course_error(s)
        s.course_yaw_s, s.new_course = now_s, 0
    else:
        s.omega_yaw_p *= YAW_DECAY if s.decay_per_sample else np.exp(-YAW_FADE_HZ * s.dt_s)
        return
    error *= s.R_eb[2, 2]  # Eqn 3.3
    s.omega_yaw_p = s.kp_yaw * spin_gain(s) * error  # Eqn 3.4
    if since_s < YAW_LEARN_S and s.spin_rad_s < SPIN_LIMIT_RAD_S:
        s.omega_sum_b[2] += s.ki_yaw * error * since_s  # Eqn 3.5


@kernel
def spin_gain(s):  # type: ignore[no-untyped-def]
    """One up to 50 deg/s, ten from 500 deg/s on ("Fast rotations")."""
    fast = np.degrees(50.0) if s.stuck_p_gain else np.radians(50.0)
    return clip(s.spin_rad_s / fast, 1.0, 10.0)
