"""Which mode is in force: the mode asked for, or the failsafe that takes its place.

Each tick, the first line that applies:

==================  ==========================================  ================================================
In force            When                                        What is flown
==================  ==========================================  ================================================
MANUAL, RATE        asked for, and the radio is heard           what the pilot says: nothing below takes it away
LEVEL               the estimator was healthy once, and calls   wings level at the height where it began, at least
                    itself POOR, or tells no numbers, for       `safe_height_m`, on the attitude when it was last
                    `unhealthy_s` though the GPS is alive and   healthy, carried on with the raw gyros less the
                    shows a course; until it is GOOD as long    offset believed then (Eqn 17), in the wind believed
                                                                then
LAUNCH              asked for, and not over yet, radio or not   as asked
STABILISE           asked for, and the radio is heard           as asked
GLIDE               as CIRCLE, for more than `circle_s`         the same circle, motor off, at the pitch of a glide
CIRCLE              no fix has arrived for `gps_lost_s`, after  a gentle circle at cruise and constant pitch: it
                    some had; until they have arrived for       does not fly away, and drifts with the wind alone
                    `gps_back_s`
LOW                 below `low_height_m`, until above           where it was going, with little bank, climbing
                    `safe_height_m`
RETURN              the radio is silent (``Setpoint.radio``)    back to the launch point
COURSE, RETURN,     asked for                                   as asked
LOITER, WAYPOINTS,
LAUNCH that is over
==================  ==========================================  ================================================

What counts for the GPS is that fixes ARRIVE: one that is 12 s late but alive is not lost.  An estimator that is POOR
for want of fixes is the business of CIRCLE, and one that never was healthy has left no attitude to fall back on.
A failsafe hands back what was asked for as it stands: the throw of a launch stays felt, a route goes on to the
waypoint it was on the way to.
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
    """When a failsafe takes over, and how it flies; the defaults fly the aeroplane `endurance`.

    gps_lost_s : silence after which the GPS counts as lost; longer than the pause between fixes of a slow receiver
    gps_back_s : time for which fixes must have come again, with pauses of half that silence at most; longer than such
        a pause, so that one fix alone is not taken for a GPS
    circle_s : of the circle at cruise, before the motor is switched off
    bank_rad : of the circle         glide_pitch_rad : of the glide, motor off
    unhealthy_s : an estimator that is POOR for so long is not believed, one that is GOOD for so long is again
    course_speed_m_s : over the ground; below, as against a strong wind, an estimator may want for a course, and is POOR
        for that alone
    low_height_m, safe_height_m : below the first too low, above the second no longer
    low_bank_rad : the steepest bank while too low        climb_m : height asked for above that of now, while too low
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
    """Keep the books of the GPS: how long it has been silent, and for how long it has been heard again.

    row : measured   s : record with `silent_s`, `heard_s`, `circled_s`, updated   p : record of FailsafeParams
    """
    arrived = row.gps_new != 0 and is_fix(row)
    s.silent_s = 0.0 if arrived or row.gps_valid == 0 else s.silent_s + dt_s
    heard = s.heard_s >= p.gps_back_s
    patience_s = p.gps_lost_s if heard else 0.5 * p.gps_lost_s
    s.heard_s = 0.0 if s.silent_s > patience_s else s.heard_s + dt_s
    if heard:
        s.circled_s = 0.0


@kernel
def has_course(row, p):  # type: ignore[no-untyped-def]
    """Whether the last fix moves fast enough over the ground to have a course."""
    return math.hypot(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]) >= p.course_speed_m_s


@kernel
def examine(R_eb, gyro_bias_b_rad_s, wind_e_m_s, health, row, s, p, g, dt_s):  # type: ignore[no-untyped-def]
    """Keep the books of the estimator: whether it is believed, and an attitude for when it is not.

    R_eb : shape (3, 3), estimated   gyro_bias_b_rad_s : shape (3,)   wind_e_m_s : shape (3,) or NaN
    health : what the estimator says of itself
    s : record with `poor_s`, `believed`, `healthy_once` and the attitude, offset, wind and rate kept, updated
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
    """Turn the attitude kept by one raw gyro sample less the offset kept (Eqns 16-21); no measurement turns nothing."""
    gyro, most = row.gyro_b_rad_s, GYRO_RANGE_RAD_S
    if abs(gyro[0]) <= most and abs(gyro[1]) <= most and abs(gyro[2]) <= most:
        for i in range(3):
            s.omega_kept_b_rad_s[i] = gyro[i] - s.bias_kept_b_rad_s[i]
        integrate(s.R_kept_eb, s.omega_kept_b_rad_s, dt_s)


@kernel
def led_by(asked, s):  # type: ignore[no-untyped-def]
    """The mode that would be flown if only the radio could fail."""
    if not asked.radio and not (asked.mode == LAUNCH and not s.levelled_off):
        return RETURN
    return COURSE if asked.mode == LOW else asked.mode


@kernel
def mode_in_force(asked, height_m, s, p, dt_s):  # type: ignore[no-untyped-def]
    """The mode flown in this tick, and the one that leads the way: the same, but for LOW.

    asked : record of the set-point   height_m : of now, NaN where nobody knows
    s : record of what `listen` and `examine` found, `low` and `circled_s` updated   p : record of FailsafeParams
    """
    mode = led_by(asked, s)
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
    if launched:  # wings level already, and on its way to its height
        s.low = 0
        return mode, mode
    if height_m < p.low_height_m:
        s.low = 1
    elif not height_m < p.safe_height_m:  # also where nobody knows
        s.low = 0
    return (LOW if s.low or (asked.mode == LOW and asked.radio) else mode), mode


@kernel
def circle(mode, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of CIRCLE, GLIDE and LEVEL, which go nowhere.

    s : record of the height loop, and the height kept   p : record of AutopilotParams
    """
    bank_rad = 0.0 if mode == LEVEL else min(p.failsafe.bank_rad, p.guidance.bank_limit_rad)
    if mode == GLIDE:
        return bank_rad, p.failsafe.glide_pitch_rad, 0.0
    # The climb that the GPS shows holds the pitch that gyros alone would lose; without a height, level flight.
    height_m = s.height_kept_m if mode == LEVEL else math.nan
    if height_m < p.failsafe.safe_height_m:  # not where nobody knows
        height_m = p.failsafe.safe_height_m
    pitch_rad, throttle = hold_height(height_m, row, s, p, dt_s)
    return bank_rad, pitch_rad, throttle
