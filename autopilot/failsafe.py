"""The active mode: the commanded one or a failsafe.

Each tick, the first row that applies:

==================  ==========================================  ================================================
Active mode         Condition                                   Flight
==================  ==========================================  ================================================
MANUAL, RATE        commanded, radio link up                    as commanded; no failsafe overrides it
LAND                as LEVEL, with GPS lost for `circle_s` or   wings level on the standby attitude, motor off, at
                    the radio link lost for `level_s`; until    the glide pitch, down to the ground
                    both have been back for `gps_back_s`
LEVEL               the estimator was GOOD once, and is not     wings level at the initial height, at least
                    trusted (below)                             `safe_height_m`, on the standby attitude
                                                                (`autopilot.standby`), with the last wind
LAUNCH              commanded and not completed, with or        as commanded; without a height it ends as below
                    without radio link
GLIDE               as CIRCLE, for more than `circle_s`; or     the same circle, motor off, at the glide pitch
                    radio link lost for `return_s`; or the
                    fence with the action `GLIDE`
CIRCLE              no fix for `gps_lost_s`, after some had     a gentle circle at cruise and constant pitch, which
                    arrived; or never one, after a LAUNCH or    stays in place except for wind drift
                    with the radio link lost; until fixes for
                    `gps_back_s`
RETURN, LOITER      about to leave the fence, by its action     back to, or around, the launch point
                    (`autopilot.fence`); also in STABILISE and
                    in a climb above `safe_height_m`
STABILISE           commanded, radio link up                    as commanded
LOW                 below `low_height_m`, until above           on course with little bank, climbing
                    `safe_height_m`
RETURN              radio link lost (``Setpoint.radio``)        back to the launch point
COURSE, RETURN,     commanded                                   as commanded
LOITER, WAYPOINTS,
completed LAUNCH
==================  ==========================================  ================================================

The estimator is not trusted once it has been POOR for `unhealthy_s` while the GPS works and shows a course; sooner if
its vertical is then `apart_rad` or more from the standby attitude, or if it is no number, for `apart_s`; until it has
been GOOD for `unhealthy_s`.

The GPS counts as working while fixes arrive, even if they are 12 s late; a fix that cannot be true is none, see
`estimator.blocks.gps_integrity`.  An estimator that is POOR for lack of fixes is handled by CIRCLE; one that was never
healthy leaves no attitude to fall back on, and is flown on as it is; if it is no number, controls are neutral and the
motor is off.  One that reports GOOD is trusted, whatever it reports.  After a failsafe the commanded mode continues
where it was: a detected throw stays detected, a route continues to its next waypoint.

No row lasts for ever without somebody who can end it.  Without a radio link, RETURN ends in GLIDE, and so does CIRCLE;
LEVEL ends in LAND.  With it, the pilot can: by any mode, in LEVEL by MANUAL or RATE.  A LAUNCH without a height ends by
the barometer, if one is fitted, else after `blind_climb` times as long as the climb takes at cruise speed; it is then a
completed one, in CIRCLE until the first fix.
"""

import math
from dataclasses import dataclass

from autopilot.energy import airspeed_to_protect, hold_height, least_airspeed, level_flight
from autopilot.fence import FENCE_GLIDE, FENCE_LOITER, mind_fence
from autopilot.guidance import gps_age, height, is_fix
from autopilot.interface import (
    CIRCLE,
    COURSE,
    GLIDE,
    LAND,
    LAUNCH,
    LEVEL,
    LOITER,
    LOW,
    MANUAL,
    RATE,
    RETURN,
    STABILISE,
    WAYPOINTS,
)
from autopilot.standby import carry_on
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, GOOD, POOR

_TURN_GAIN = 0.5  # bank demand per bank missing, in a turn without a known speed


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
    apart_rad, apart_s : difference from the standby attitude, and its time, at which a POOR estimator is distrusted
        sooner (rad and s, default 20 deg and 0.5).  Higher: follows a wrong attitude further; lower: false alarms
    kept_s : time since the last healthy estimate in which that difference counts (s, default 10).  Higher: an estimator
        that recovers is distrusted for the drift of the gyros
    level_s : time in LEVEL without radio link before the motor is switched off (s, default 60).  Higher: waits longer,
        flies further
    return_s : time without radio link before RETURN ends, motor off (s, default 900).  Higher: waits longer
    blind_climb : time of a climb without a height, over that which it takes at cruise speed (default 1.5).  Higher:
        climbs higher; lower: may level off too low
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
    apart_rad: float = math.radians(20.0)
    apart_s: float = 0.5
    kept_s: float = 10.0
    level_s: float = 60.0
    return_s: float = 900.0
    blind_climb: float = 1.5
    course_speed_m_s: float = 5.0
    low_height_m: float = 20.0
    safe_height_m: float = 30.0
    low_bank_rad: float = math.radians(15.0)
    climb_m: float = 20.0


@kernel
def listen(row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the GPS status: time without fixes, and time since the last outage.

    row : measured   p : record of FailsafeParams
    s : record with `gps_lost`, `clear_s`; `fixed`, `silent_s`, `heard_s`, `circled_s` are updated
    """
    arrived = row.gps_new != 0 and is_fix(row)
    if row.gps_valid != 0:
        s.fixed = 1
    s.silent_s = 0.0 if arrived or row.gps_valid == 0 else s.silent_s + dt_s
    heard = s.heard_s >= p.gps_back_s
    patience_s = p.gps_lost_s if heard else 0.5 * p.gps_lost_s
    s.heard_s = 0.0 if s.gps_lost or s.silent_s > patience_s else max(s.heard_s, s.clear_s) + dt_s
    if not s.gps_lost:
        s.clear_s = 0.0  # already counted
    if heard and s.fixed:
        s.circled_s = 0.0


@kernel
def has_course(row, p):  # type: ignore[no-untyped-def]
    """Whether the ground speed of the last fix is sufficient for a course."""
    return math.hypot(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]) >= p.course_speed_m_s


@kernel
def apart(R_eb, s, p):  # type: ignore[no-untyped-def]
    """Whether the vertical of an estimate is far from that of the standby attitude, while this can be compared."""
    cosine = R_eb[2, 0] * s.R_kept_eb[2, 0] + R_eb[2, 1] * s.R_kept_eb[2, 1] + R_eb[2, 2] * s.R_kept_eb[2, 2]
    return s.unwell_s < p.kept_s and cosine < math.cos(p.apart_rad)


@kernel
def examine(R_eb, gyro_bias_b_rad_s, wind_e_m_s, health, known, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the estimator status: whether it is trusted, and an attitude in case it is not.

    R_eb : shape (3, 3), estimated   gyro_bias_b_rad_s : shape (3,)   wind_e_m_s : shape (3,) or NaN
    health : reported by the estimator   known : whether the estimate is finite
    s : record with `poor_s`, `apart_s`, `unwell_s`, `believed`, `healthy_once`, and the standby attitude, updated
    p : record of AutopilotParams
    """
    f, g = p.failsafe, p.guidance
    poor = health == POOR and s.heard_s >= f.gps_back_s and math.isfinite(gps_age(row, g))
    if not known or (poor and s.healthy_once and apart(R_eb, s, f)):
        s.apart_s += dt_s
    else:
        s.apart_s = 0.0
    if known and health == GOOD:
        s.poor_s = max(s.poor_s - dt_s, 0.0)
    elif s.apart_s > f.apart_s:
        s.poor_s = f.unhealthy_s
    elif not known or (poor and has_course(row, f)):
        s.poor_s = min(s.poor_s + dt_s, f.unhealthy_s)
    if s.poor_s == 0.0:
        s.believed = 1
    elif s.poor_s == f.unhealthy_s and s.healthy_once:
        s.believed = 0
    if s.believed and known and health == GOOD:
        s.healthy_once = 1
        s.unwell_s = s.alone_s = 0.0
        for i in range(3):
            s.bias_kept_b_rad_s[i] = gyro_bias_b_rad_s[i]
            s.wind_kept_e_m_s[i] = wind_e_m_s[i]
            for j in range(3):
                s.R_kept_eb[i, j] = R_eb[i, j]
    elif s.healthy_once:
        s.unwell_s += dt_s
        carry_on(row, s, p.standby, g, f.course_speed_m_s, dt_s)


@kernel
def led_by(setpoint, s):  # type: ignore[no-untyped-def]
    """The mode if the radio link were the only possible failure."""
    if not setpoint.radio and not (setpoint.mode == LAUNCH and not s.levelled_off):
        return RETURN
    return COURSE if setpoint.mode == LOW else setpoint.mode


@kernel
def lost(launched, setpoint, s, p):  # type: ignore[no-untyped-def]
    """Whether there is no position: no fixes any more, or never one and nobody who can see where it flies."""
    if s.fixed:
        return s.heard_s < p.gps_back_s
    return launched or not setpoint.radio


@kernel
def on_standby(setpoint, s, p, dt_s):  # type: ignore[no-untyped-def]
    """LEVEL, or LAND where nobody has been able to help for too long: no GPS, or no pilot."""
    no_gps = s.heard_s < p.gps_back_s or not s.fixed
    s.helped_s = 0.0 if no_gps or not setpoint.radio else s.helped_s + dt_s
    s.alone_s = 0.0 if s.helped_s >= p.gps_back_s else s.alone_s + dt_s
    too_long = s.alone_s > (p.circle_s if no_gps else p.level_s)
    return LAND if too_long or (s.mode == LAND and s.alone_s > 0.0) else LEVEL


@kernel
def end_blind_climb(height_m, row, s, p):  # type: ignore[no-untyped-def]
    """End the climb of a LAUNCH without a GPS height: by the barometer, or by time.

    height_m : demanded   row : measured   s : record with `thrown_s`, `levelled_off`, updated
    p : record of AutopilotParams
    """
    if s.levelled_off or s.thrown_s < 0.0 or math.isfinite(height(row, p.guidance)):
        return
    trim_rad, _ = level_flight(s, p.energy)
    climb_m_s = s.airspeed_wanted_m_s * math.sin(p.launch.climb_pitch_rad - trim_rad)
    if climb_m_s <= 0.0:  # no motor: the ground ends it
        return
    if (
        row.baro_height_m > height_m - p.launch.level_off_m
        or s.thrown_s * climb_m_s > p.failsafe.blind_climb * height_m
    ):
        s.levelled_off = 1


@kernel
def at_fence(f):  # type: ignore[no-untyped-def]
    """The mode of the fence's action."""
    if f.action == FENCE_GLIDE:
        return GLIDE
    return LOITER if f.action == FENCE_LOITER else RETURN


@kernel
def mode_in_force(setpoint, height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """The active mode of this tick, and the one that determines the course: the same except in LOW.

    setpoint : its record   height_m : present, NaN if unknown   row : measured   p : record of AutopilotParams
    s : record with the results of `listen` and `examine`; updates `low`, `circled_s`, `fenced` and others
    """
    mode, f = led_by(setpoint, s), p.failsafe
    in_hand = mode == LAUNCH and s.thrown_s <= 0.0
    s.unheard_s = 0.0 if setpoint.radio or in_hand else s.unheard_s + dt_s
    if mode in (MANUAL, RATE):
        return mode, mode
    if not s.believed and not in_hand:
        mode = on_standby(setpoint, s, f, dt_s)
        return mode, mode
    launched = mode == LAUNCH and s.levelled_off
    navigates = launched or mode in (COURSE, RETURN, LOITER, WAYPOINTS)
    if navigates and lost(launched, setpoint, s, f):
        s.circled_s += dt_s
        mode = GLIDE if s.circled_s > f.circle_s else CIRCLE
        return mode, mode
    if s.unheard_s > f.return_s and navigates:
        return GLIDE, GLIDE
    guarded = navigates or mode == STABILISE or (mode == LAUNCH and not in_hand and height_m > f.safe_height_m)
    if guarded and mode != RETURN and s.heard_s >= f.gps_back_s:
        mind_fence(row, height_m, s, p.fence, p.guidance, p.energy.airspeed_m_s)
        if s.fenced:
            mode, navigates, launched = at_fence(p.fence), True, False
    if not navigates or launched or mode == GLIDE:  # launched: wings already level, climbing
        s.low = 0
        return mode, mode
    if height_m < f.low_height_m:
        s.low = 1
    elif not height_m < f.safe_height_m:  # also if unknown
        s.low = 0
    return (LOW if s.low or (setpoint.mode == LOW and setpoint.radio) else mode), mode


@kernel
def bank_for_turn(bank_rad, R_eb, omega_b_rad_s, s):  # type: ignore[no-untyped-def]
    """Bank demand, rad, that gives the turn rate of a bank, ``g tan(bank) / V``, where the estimated bank cannot.

    An estimator that has never had a fix does not know the speed, and cannot tell a coordinated turn from level flight.
    """
    turning = R_eb[2, 0] * omega_b_rad_s[0] + R_eb[2, 1] * omega_b_rad_s[1] + R_eb[2, 2] * omega_b_rad_s[2]
    turned_rad = math.atan(s.airspeed_m_s * turning / G_M_S2)
    estimated_rad = math.asin(clip(R_eb[2, 1], -0.5, 0.5))
    return clip(estimated_rad + _TURN_GAIN * (bank_rad - turned_rad), -bank_rad, bank_rad)


@kernel
def glide_pitch(s, p):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, without motor: that of the glide, with the pitch error learnt before; lower near the stall.

    s : record of the height loop   p : record of AutopilotParams
    """
    slow_m_s = min(airspeed_to_protect(s) - least_airspeed(s, p.energy), 0.0)
    return p.failsafe.glide_pitch_rad + s.climb_integral_rad + p.energy.pitch_per_excess_rad_s_m * slow_m_s


@kernel
def circle(mode, R_eb, omega_b_rad_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of CIRCLE, GLIDE, LEVEL and LAND, which do not navigate.

    R_eb : shape (3, 3)   omega_b_rad_s : shape (3,), corrected   row : measured
    s : record of the height loop, and the height kept   p : record of AutopilotParams
    """
    bank_rad = 0.0 if mode in (LEVEL, LAND) else min(p.failsafe.bank_rad, p.guidance.bank_limit_rad)
    if bank_rad > 0.0 and not s.fixed:
        bank_rad = bank_for_turn(bank_rad, R_eb, omega_b_rad_s, s)
    if mode in (GLIDE, LAND):
        return bank_rad, glide_pitch(s, p), 0.0
    # The GPS climb rate corrects the pitch drift of the gyros; level flight without a height.
    height_m = math.nan
    if mode == LEVEL:
        if not math.isfinite(s.height_kept_m):
            s.height_kept_m = height(row, p.guidance)
        height_m = s.height_kept_m
    if height_m < p.failsafe.safe_height_m:  # not if unknown
        height_m = p.failsafe.safe_height_m
    pitch_rad, throttle = hold_height(height_m, row, s, p, dt_s)
    return bank_rad, pitch_rad, throttle
