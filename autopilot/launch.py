"""The hand launch: the motor waits for the throw, then climbs straight ahead to the height.

The throw is felt as acceleration along the nose.  Gravity is taken off with the matrix, so that a nose held
high in the hand is not a throw; sway and knocks are short against the mean that is judged.
"""

import math
from dataclasses import dataclass

from autopilot.energy import hold_height, throttle_for
from autopilot.guidance import height
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from estimator.params.shared import FORCE_RANGE_M_S2


@dataclass(frozen=True, slots=True)
class LaunchParams:
    """When it is a throw, and how to climb away.

    throw_m_s2, throw_mean_s : mean acceleration along the nose that is a throw, time constant of that mean
    motor_delay_s : from the throw felt to full throttle; it has no thrust before the hand is gone
    full_throttle_s : after the throw the throttle is that of the climb at cruise speed
    level_off_m : below the height, where the climb at constant pitch ends and the height loop takes over
    climb_pitch_rad : demanded from the hand to the height
    """

    throw_m_s2: float = 0.8 * G_M_S2
    throw_mean_s: float = 0.1
    motor_delay_s: float = 0.1
    full_throttle_s: float = 2.0
    level_off_m: float = 5.0
    climb_pitch_rad: float = math.radians(12.0)


@kernel
def feel_throw(R_eb, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Seconds since the throw was felt, negative where it has not been; call once per tick.

    R_eb : shape (3, 3)   row : measured   s : record with `felt_m_s2`, `thrown_s`, updated
    """
    if s.thrown_s >= 0.0:
        s.thrown_s += dt_s
    elif abs(row.force_b_m_s2[0]) <= FORCE_RANGE_M_S2:  # beyond, and NaN, is no measurement and no throw
        # Specific force is acceleration minus gravity; gravity along the nose is g r_zx.
        along_nose = row.force_b_m_s2[0] + G_M_S2 * R_eb[2, 0]
        s.felt_m_s2 += (along_nose - s.felt_m_s2) * dt_s / (p.throw_mean_s + dt_s)
        if s.felt_m_s2 > p.throw_m_s2:
            s.thrown_s = 0.0
    return s.thrown_s


@kernel
def climb_away(thrown_s, height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, of a launch; wings level is the caller's.

    Waiting, motor off; thrown, full throttle and the climb; near the height, the height loop for good.

    thrown_s : since the throw, or negative   height_m : demanded   s : record with `levelled_off`, updated
    p : record of AutopilotParams
    """
    launch = p.launch
    if thrown_s < 0.0:
        return launch.climb_pitch_rad, 0.0
    if height(row, p.guidance) > height_m - launch.level_off_m:  # False where there is no height
        s.levelled_off = 1
    if s.levelled_off:
        return hold_height(height_m, row, s, p, dt_s)
    if thrown_s < launch.motor_delay_s:
        return launch.climb_pitch_rad, 0.0
    throttle = 1.0 if thrown_s < launch.full_throttle_s else throttle_for(launch.climb_pitch_rad, s, p.energy)
    return launch.climb_pitch_rad, throttle
