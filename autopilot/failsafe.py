"""The active mode: the commanded one or a failsafe.

Each tick, the first row that applies:

==================  ==========================================  ================================================
Active mode         Condition                                   Flight
==================  ==========================================  ================================================
MANUAL, RATE        commanded, radio link up                    as commanded; no failsafe overrides it
LEVEL               the estimator was GOOD once, and is POOR    wings level at the initial height, at least
                    or not finite for `unhealthy_s` while the   `safe_height_m`, on the last healthy attitude
                    GPS works and shows a course; until it has  propagated with the raw gyros minus the last bias
                    been GOOD for as long                       (Eqn 17), with the last wind
LAUNCH              commanded and not completed, with or        as commanded
                    without radio link
STABILISE           commanded, radio link up                    as commanded
GLIDE               as CIRCLE, for more than `circle_s`         the same circle, motor off, at the glide pitch
CIRCLE              no fix for `gps_lost_s`, after some had     a gentle circle at cruise and constant pitch, which
                    arrived; until fixes for `gps_back_s`       stays in place except for wind drift
LOW                 below `low_height_m`, until above           on course with little bank, climbing
                    `safe_height_m`
RETURN              radio link lost (``Setpoint.radio``)        back to the launch point
COURSE, RETURN,     commanded                                   as commanded
LOITER, WAYPOINTS,
completed LAUNCH
==================  ==========================================  ================================================

The GPS counts as working while fixes arrive, even if they are 12 s late; a fix that cannot be true is none, see
`estimator.blocks.gps_integrity`.  An estimator that is POOR for lack of fixes
is handled by CIRCLE; one that was never healthy leaves no attitude to fall back on.  After a failsafe the commanded
mode continues where it was: a detected throw stays detected, a route continues to its next waypoint.
"""

import math
from dataclasses import dataclass

from autopilot.energy import hold_height
from autopilot.guidance import gps_age, is_fix
from autopilot.interface import (
    CIRCLE,
    COURSE,
    GLIDE,
    LAUNCH,
    LEVEL,
    LOITER,
    LOW,
    MANUAL,
    RATE,
    RETURN,
    WAYPOINTS,
)
from estimator.compiler.jit import kernel
from estimator.interface import GOOD, POOR
from estimator.params.shared import GYRO_RANGE_RAD_S
from estimator.rotation import integrate


@dataclass(frozen=True, slots=True)
class FailsafeParams:
    """Conditions and behaviour of the failsafe modes; the defaults are for the aeroplane `endurance`.

    gps_lost_s : time without fixes until the GPS counts as lost (s, default 3).  Higher: flies longer on old fixes;
        lower than the fix interval: false alarms
    gps_back_s : fixes must arrive for this time, with gaps up to half of `gps_lost_s`, until the GPS is used again (s,
        default 2).  Higher: later recovery; below that gap: a single fix is enough
    circle_s : time in CIRCLE before the motor is switched off (s, default 30).  Higher: waits longer, drifts further
    bank_rad : bank of the circle (rad, default 10 deg).  Higher: tighter circle
    glide_pitch_rad : pitch of the glide (rad, default -4 deg).  Higher: slower, nearer the stall
    unhealthy_s : time POOR until the estimator is no longer trusted, and GOOD until it is again (s, default 5).
        Higher: flies longer on a bad attitude; lower: reacts to short disturbances
    course_speed_m_s : ground speed below which POOR is ignored, as a slow estimator may just lack a course (m/s,
        default 5).  Higher: less protection at low speed
    low_height_m, safe_height_m : LOW starts below the first and ends above the second (m, default 20 and 30).
        Higher: intervenes more often
    low_bank_rad : largest bank in LOW (rad, default 15 deg).  Higher: turns more, climbs less
    climb_m : height demand above the present height in LOW (m, default 20).  Higher: steeper climb
    """

    gps_lost_s: float = 3.0
    gps_back_s: float = 2.0
    circle_s: float = 30.0
    bank_rad: float = math.radians(10.0)
    glide_pitch_rad: float = math.radians(-4.0)
    unhealthy_s: float = 5.0
    course_speed_m_s: float = 5.0
    low_height_m: float = 20.0
    safe_height_m: float = 30.0
    low_bank_rad: float = math.radians(15.0)
    climb_m: float = 20.0


@kernel
def listen(row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the GPS status: time without fixes, and time since the last outage.

    row : measured   p : record of FailsafeParams
    s : record with `gps_lost`, `clear_s`; `silent_s`, `heard_s`, `circled_s` are updated
    """
    arrived = row.gps_new != 0 and is_fix(row)
    s.silent_s = 0.0 if arrived or row.gps_valid == 0 else s.silent_s + dt_s
    heard = s.heard_s >= p.gps_back_s
    patience_s = p.gps_lost_s if heard else 0.5 * p.gps_lost_s
    s.heard_s = 0.0 if s.gps_lost or s.silent_s > patience_s else max(s.heard_s, s.clear_s) + dt_s
    if not s.gps_lost:
        s.clear_s = 0.0  # already counted
    if heard:
        s.circled_s = 0.0


@kernel
def has_course(row, p):  # type: ignore[no-untyped-def]
    """Whether the ground speed of the last fix is sufficient for a course."""
    return math.hypot(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]) >= p.course_speed_m_s


@kernel
def examine(R_eb, gyro_bias_b_rad_s, wind_e_m_s, health, row, s, p, g, dt_s):  # type: ignore[no-untyped-def]
    """Update the estimator status: whether it is trusted, and an attitude in case it is not.

    R_eb : shape (3, 3), estimated   gyro_bias_b_rad_s : shape (3,)   wind_e_m_s : shape (3,) or NaN
    health : reported by the estimator
    s : record with `poor_s`, `believed`, `healthy_once` and the kept attitude, bias, wind and rate, updated
    p, g : records of FailsafeParams, GuidanceParams
    """
    if health == GOOD:
        s.poor_s = max(s.poor_s - dt_s, 0.0)
    elif health == POOR and s.heard_s >= p.gps_back_s and math.isfinite(gps_age(row, g)) and has_course(row, p):
        s.poor_s = min(s.poor_s + dt_s, p.unhealthy_s)
    if s.poor_s == 0.0:
        s.believed = 1
    elif s.poor_s == p.unhealthy_s and s.healthy_once:
        s.believed = 0
    if s.believed and health == GOOD:
        s.healthy_once = 1
        for i in range(3):
            s.bias_kept_b_rad_s[i] = gyro_bias_b_rad_s[i]
            s.wind_kept_e_m_s[i] = wind_e_m_s[i]
            for j in range(3):
                s.R_kept_eb[i, j] = R_eb[i, j]
    elif s.healthy_once:
        carry_on(row, s, dt_s)


@kernel
def carry_on(row, s, dt_s):  # type: ignore[no-untyped-def]
    """Propagate the kept attitude by one raw gyro sample minus the kept bias (Eqns 16-21); skips invalid ones."""
    gyro, most = row.gyro_b_rad_s, GYRO_RANGE_RAD_S
    if abs(gyro[0]) <= most and abs(gyro[1]) <= most and abs(gyro[2]) <= most:
        for i in range(3):
            s.omega_kept_b_rad_s[i] = gyro[i] - s.bias_kept_b_rad_s[i]
        integrate(s.R_kept_eb, s.omega_kept_b_rad_s, dt_s)


@kernel
def led_by(setpoint, s):  # type: ignore[no-untyped-def]
    """The mode if the radio link were the only possible failure."""
    if not setpoint.radio and not (setpoint.mode == LAUNCH and not s.levelled_off):
        return RETURN
    return COURSE if setpoint.mode == LOW else setpoint.mode


@kernel
def mode_in_force(setpoint, height_m, s, p, dt_s):  # type: ignore[no-untyped-def]
    """The active mode of this tick, and the one that determines the course: the same except in LOW.

    setpoint : its record   height_m : present, NaN if unknown
    s : record with the results of `listen` and `examine`; updates `low`, `circled_s`   p : record of FailsafeParams
    """
    mode = led_by(setpoint, s)
    if mode in (MANUAL, RATE):
        return mode, mode
    in_hand = mode == LAUNCH and s.thrown_s < 0.0
    if not s.believed and not in_hand:
        return LEVEL, LEVEL
    launched = mode == LAUNCH and s.levelled_off
    if mode not in (COURSE, RETURN, LOITER, WAYPOINTS) and not launched:
        s.low = 0
        return mode, mode
    if s.heard_s < p.gps_back_s:
        s.circled_s += dt_s
        mode = GLIDE if s.circled_s > p.circle_s else CIRCLE
        return mode, mode
    if launched:  # wings already level, climbing
        s.low = 0
        return mode, mode
    if height_m < p.low_height_m:
        s.low = 1
    elif not height_m < p.safe_height_m:  # also if unknown
        s.low = 0
    return (LOW if s.low or (setpoint.mode == LOW and setpoint.radio) else mode), mode


@kernel
def circle(mode, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of CIRCLE, GLIDE and LEVEL, which do not navigate.

    s : record of the height loop, and the height kept   p : record of AutopilotParams
    """
    bank_rad = 0.0 if mode == LEVEL else min(p.failsafe.bank_rad, p.guidance.bank_limit_rad)
    if mode == GLIDE:
        return bank_rad, p.failsafe.glide_pitch_rad, 0.0
    # The GPS climb rate corrects the pitch drift of the gyros; level flight without a height.
    height_m = s.height_kept_m if mode == LEVEL else math.nan
    if height_m < p.failsafe.safe_height_m:  # not if unknown
        height_m = p.failsafe.safe_height_m
    pitch_rad, throttle = hold_height(height_m, row, s, p, dt_s)
    return bank_rad, pitch_rad, throttle
