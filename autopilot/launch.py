"""The hand launch: motor off until the aeroplane has left the hand, then a straight climb to the height.

A throw is a push along the nose and its end.  The push is detected by the acceleration along the nose and by the speed
that it has gained: a knock gains none, a wave of the hand little, and a car that accelerates stays below the
acceleration.  Gravity is removed with the matrix, so that a raised nose is no push.  The push is over when the
acceleration has fallen to a share of its peak and stays there; only then does the motor start, however long the push.
If the aeroplane is slowed down instead, it is still in the hand, and the push does not count.
"""

import math
from dataclasses import dataclass

from autopilot.energy import SLOWEST, hold_height, most_climb, throttle_for
from autopilot.guidance import height
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from estimator.params.shared import FORCE_RANGE_M_S2

TAIL_WIND_M_S = 1.0  # assumed in a launch, for with less airspeed than believed it stalls
SLOWEST_THROW_M_S = 3.0  # a slower one has no angle of attack to speak of


@dataclass(frozen=True, slots=True)
class LaunchParams:
    """Throw detection and climb.

    throw_m_s2 : mean acceleration along the nose of a throw (m/s2, default 0.45 g).  Higher: gentle throws are missed;
        lower: a car that accelerates starts the motor when it stops doing so
    throw_mean_s : time constant of that mean (s, default 0.1).  Higher: detects later; lower: knocks count
    throw_m_s : speed that the push must have gained (m/s, default 2.4).  Higher: weak throws are missed; lower: waving
        it about starts the motor
    forget_s : time constant with which gained speed is forgotten (s, default 1).  Higher: waving adds up; lower: long
        and gentle pushes are missed
    released_share : of the largest acceleration of the push, below which it is over (default 0.4).  Higher: a push that
        falters counts as over; lower: with a large pitch error of the estimate the end is missed
    brake_m_s2 : a specific force along the nose this far below zero after a slow push is the hand's, not the air's
        (m/s2, default 0.3 g).  Higher: waving counts as a throw; lower: the drag of a stalled aeroplane ends the launch
    motor_delay_s : from the end of the push to full throttle (s, default 0.03).  Higher: safer for the hand, but sinks
        more
    full_throttle_s : full throttle until this time after the throw, then that of the climb at cruise speed (s,
        default 2).  Higher: more speed before the climb
    level_off_m : the height loop takes over this far below the height (m, default 5).  Higher: smoother, slower
    climb_pitch_rad : pitch of the climb (rad, default 12 deg).  Higher: steeper and slower, up to the stall
    alpha_rad : largest angle of attack while it gathers speed, by inertial reckoning (rad, default 13 deg).  Higher:
        a slow throw stalls; lower: it sinks more
    alpha_gain_1_s : pitch rate allowed per angle left below that (1/s, default 13).  Higher: the nose drops later
        and faster
    """

    throw_m_s2: float = 0.45 * G_M_S2
    throw_mean_s: float = 0.1
    throw_m_s: float = 2.4
    forget_s: float = 1.0
    released_share: float = 0.4
    brake_m_s2: float = 0.3 * G_M_S2
    motor_delay_s: float = 0.03
    full_throttle_s: float = 2.0
    level_off_m: float = 5.0
    climb_pitch_rad: float = math.radians(12.0)
    alpha_rad: float = math.radians(13.0)
    alpha_gain_1_s: float = 13.0


@kernel
def feel_throw(R_eb, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Seconds since the end of the throw, 0 during the push, negative before; call once per tick.

    R_eb : shape (3, 3)   row : measured   p : record of LaunchParams
    s : record with `felt_m_s2`, `gained_m_s`, `peak_m_s2`, `thrown_s`, updated
    """
    if s.thrown_s >= p.motor_delay_s:
        s.thrown_s += dt_s
    elif abs(row.force_b_m_s2[0]) <= FORCE_RANGE_M_S2:  # larger ones and NaN are invalid measurements
        # Specific force is acceleration minus gravity; gravity along the nose is g r_zx.
        along_nose = row.force_b_m_s2[0] + G_M_S2 * R_eb[2, 0]
        s.felt_m_s2 += (along_nose - s.felt_m_s2) * dt_s / (p.throw_mean_s + dt_s)
        s.gained_m_s = (s.gained_m_s + along_nose * dt_s) * p.forget_s / (p.forget_s + dt_s)
        if s.thrown_s >= 0.0:
            feel_release(row.force_b_m_s2[0], along_nose, s, p, dt_s)
        elif s.felt_m_s2 > p.throw_m_s2 and s.gained_m_s > p.throw_m_s:
            s.thrown_s, s.peak_m_s2 = 0.0, s.felt_m_s2
    return s.thrown_s


@kernel
def feel_release(force_m_s2, along_nose_m_s2, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Count the time since the end of a push that was detected; back to 0 if it goes on, to -1 if it was no throw.

    force_m_s2 : specific force along the nose   along_nose_m_s2 : acceleration   s, p : as for `feel_throw`
    """
    s.peak_m_s2 = max(s.peak_m_s2, s.felt_m_s2)
    if force_m_s2 < -p.brake_m_s2 and s.gained_m_s < 2.0 * p.throw_m_s:
        s.thrown_s, s.felt_m_s2, s.gained_m_s = -1.0, 0.0, 0.0
    elif along_nose_m_s2 < p.released_share * s.peak_m_s2:
        s.thrown_s += dt_s
    else:
        s.thrown_s = 0.0


@kernel
def climb_away(thrown_s, height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, of a launch; the caller keeps the wings level.

    Motor off until `motor_delay_s` after the throw; then full throttle and climb; near the height, the height loop.

    thrown_s : see `feel_throw`   height_m : demanded   s : record with `levelled_off`, updated
    p : record of AutopilotParams
    """
    launch = p.launch
    if thrown_s < launch.motor_delay_s:
        return launch.climb_pitch_rad, 0.0
    if height(row, p.guidance) > height_m - launch.level_off_m:  # False if the height is unknown
        s.levelled_off = 1
    if s.levelled_off:
        return hold_height(height_m, row, s, p, dt_s)
    if thrown_s < launch.full_throttle_s:
        return launch.climb_pitch_rad, 1.0
    steepest_rad = p.energy.pitch_trim_rad + most_climb(s, p.energy) / s.airspeed_wanted_m_s
    pitch_rad = clip(steepest_rad, -p.energy.pitch_limit_rad, launch.climb_pitch_rad)
    return pitch_rad, throttle_for(launch.climb_pitch_rad, s, p.energy)


@kernel
def reckon_throw(R_eb, omega_b_rad_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the velocity along the nose and below it since the push, by inertial reckoning.

    ``u' = f_x + g r_zx - q w`` and ``w' = f_z + g r_zz + q u`` (Etkin & Reid, section 4.4, without sideslip).  It
    drifts, but nothing else knows the speed in the first second: the GPS is late, and has no wind.

    R_eb : shape (3, 3)   omega_b_rad_s : shape (3,)   row : measured   p : record of AutopilotParams
    s : record with `ahead_m_s`, `below_m_s` and, unless measured, `airspeed_m_s`, updated
    """
    if s.thrown_s < 0.0:
        s.ahead_m_s, s.below_m_s = s.gained_m_s - TAIL_WIND_M_S, 0.0
        return
    f, q = row.force_b_m_s2, omega_b_rad_s[1]
    if not (abs(f[0]) <= FORCE_RANGE_M_S2 and abs(f[2]) <= FORCE_RANGE_M_S2):
        return
    ahead_m_s2 = f[0] + G_M_S2 * R_eb[2, 0] - q * s.below_m_s
    below_m_s2 = f[2] + G_M_S2 * R_eb[2, 2] + q * s.ahead_m_s
    s.ahead_m_s += ahead_m_s2 * dt_s
    if s.thrown_s <= 0.0:  # the hand keeps it on the line of the nose
        return
    s.below_m_s += below_m_s2 * dt_s
    if s.air_left_s <= 0.0:
        s.airspeed_m_s = clip(s.ahead_m_s / s.true_factor, SLOWEST * p.energy.airspeed_m_s, p.energy.airspeed_m_s)


@kernel
def steepest_rate(R_eb, row, s, p):  # type: ignore[no-untyped-def]
    """Largest pitch rate, rad/s, that keeps the angle of attack below its limit; infinite before the release.

    Turning as the path does, ``-(f_z + g r_zz) / u``, keeps the angle; less of the angle is left, the slower.

    R_eb : shape (3, 3)   row : measured   s : record with the results of `reckon_throw`   p : record of LaunchParams
    """
    if s.thrown_s <= 0.0:
        return math.inf
    ahead_m_s = max(s.ahead_m_s, SLOWEST_THROW_M_S)
    path_rad_s = -(row.force_b_m_s2[2] + G_M_S2 * R_eb[2, 2]) / ahead_m_s
    return path_rad_s + p.alpha_gain_1_s * (p.alpha_rad - math.atan2(s.below_m_s, ahead_m_s))
