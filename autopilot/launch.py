"""The hand launch: motor off until the throw, then a straight climb to the height.

The throw is detected by the acceleration along the nose.  Gravity is removed with the matrix, so that a raised nose is
not a throw; the acceleration is averaged against sway and knocks.
"""

import math
from dataclasses import dataclass

from autopilot.energy import hold_height, most_climb, throttle_for
from autopilot.guidance import height
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from estimator.params.shared import FORCE_RANGE_M_S2


@dataclass(frozen=True, slots=True)
class LaunchParams:
    """Throw detection and climb.

    throw_m_s2 : mean acceleration along the nose of a throw (m/s2, default 0.8 g).  Higher: gentle throws are missed;
        lower: handling starts the motor
    throw_mean_s : time constant of that mean (s, default 0.1).  Higher: detects later; lower: knocks count
    motor_delay_s : from detection to full throttle (s, default 0.1).  Higher: safer for the hand, but sinks more
    full_throttle_s : full throttle until this time after the throw, then that of the climb at cruise speed (s,
        default 2).  Higher: more speed before the climb
    level_off_m : the height loop takes over this far below the height (m, default 5).  Higher: smoother, slower
    climb_pitch_rad : pitch of the climb (rad, default 12 deg).  Higher: steeper and slower, up to the stall
    """

    throw_m_s2: float = 0.8 * G_M_S2
    throw_mean_s: float = 0.1
    motor_delay_s: float = 0.1
    full_throttle_s: float = 2.0
    level_off_m: float = 5.0
    climb_pitch_rad: float = math.radians(12.0)


@kernel
def feel_throw(R_eb, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Seconds since the throw was detected, negative before; call once per tick.

    R_eb : shape (3, 3)   row : measured   s : record with `felt_m_s2`, `thrown_s`, updated
    """
    if s.thrown_s >= 0.0:
        s.thrown_s += dt_s
    elif abs(row.force_b_m_s2[0]) <= FORCE_RANGE_M_S2:  # larger ones and NaN are invalid measurements
        # Specific force is acceleration minus gravity; gravity along the nose is g r_zx.
        along_nose = row.force_b_m_s2[0] + G_M_S2 * R_eb[2, 0]
        s.felt_m_s2 += (along_nose - s.felt_m_s2) * dt_s / (p.throw_mean_s + dt_s)
        if s.felt_m_s2 > p.throw_m_s2:
            s.thrown_s = 0.0
    return s.thrown_s


@kernel
def climb_away(thrown_s, height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, of a launch; the caller keeps the wings level.

    Motor off before the throw; then full throttle and climb; near the height, the height loop.

    thrown_s : since the throw, or negative   height_m : demanded   s : record with `levelled_off`, updated
    p : record of AutopilotParams
    """
    launch = p.launch
    if thrown_s < 0.0:
        return launch.climb_pitch_rad, 0.0
    if height(row, p.guidance) > height_m - launch.level_off_m:  # False if the height is unknown
        s.levelled_off = 1
    if s.levelled_off:
        return hold_height(height_m, row, s, p, dt_s)
    if thrown_s < launch.motor_delay_s:
        return launch.climb_pitch_rad, 0.0
    if thrown_s < launch.full_throttle_s:
        return launch.climb_pitch_rad, 1.0
    steepest_rad = p.energy.pitch_trim_rad + most_climb(s, p.energy) / s.airspeed_wanted_m_s
    pitch_rad = clip(steepest_rad, -p.energy.pitch_limit_rad, launch.climb_pitch_rad)
    return pitch_rad, throttle_for(launch.climb_pitch_rad, s, p.energy)
