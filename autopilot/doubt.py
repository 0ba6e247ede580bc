"""Whether an airspeed can be true: two witnesses that need neither a pitot tube nor a wind.

The throttle tells a speed: in level flight it rises with the airspeed, and with the climb (`autopilot.energy`),

    V_t = V_c + (throttle - throttle_trim - throttle_per_climb climb) / throttle_per_speed

and so does the elevator (`autopilot.lift`).  Each can be wrong alone: the first if the motor fails or the battery is
weak, the second if the balance has moved.  An airspeed from which both differ, and to the same side, is refused: below
the stall in level flight at full throttle, or cruise with the throttle nearly closed.  Airspeed then counts as unknown,
until one of the witnesses has agreed with it for as long.
"""

from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel

SLOWEST, FASTEST = 0.4, 2.0  # range of the speed from the throttle, over cruise


@kernel
def speed_of_throttle(climb_m_s, s, e):  # type: ignore[no-untyped-def]
    """Airspeed, m/s, that goes with the throttle and a climb, by the aircraft's polar; 0 without a motor.

    s : record with `throttle`, the last command   e : record of EnergyParams
    """
    if e.throttle_per_speed_s_m <= 0.0:
        return 0.0
    level = s.throttle - e.throttle_per_climb_s_m * climb_m_s
    v = e.airspeed_m_s + (level - e.throttle_trim) / e.throttle_per_speed_s_m
    return clip(v, SLOWEST * e.airspeed_m_s, FASTEST * e.airspeed_m_s)


@kernel
def doubt_airspeed(now_m_s, climb_m_s, s, e, dt_s):  # type: ignore[no-untyped-def]
    """Update whether an airspeed of `now_m_s` is refused, `s.refused`; call it once per tick with a claimed airspeed.

    climb_m_s : measured   e : record of EnergyParams
    s : record with `lift_m_s`, `throttle`; updates `by_throttle_m_s`, `doubt_s`, `refused`, `throttle_integral`
    """
    by_throttle_m_s = speed_of_throttle(climb_m_s, s, e)
    if by_throttle_m_s <= 0.0 or s.lift_m_s <= 0.0 or s.inverted:  # no witness
        s.doubt_s = 0.0
        s.refused = 0
        return
    if s.by_throttle_m_s <= 0.0:
        s.by_throttle_m_s = by_throttle_m_s
    s.by_throttle_m_s += dt_s / (e.doubt_filter_s + dt_s) * (by_throttle_m_s - s.by_throttle_m_s)
    nearer_m_s = min(s.by_throttle_m_s, s.lift_m_s) - now_m_s
    if nearer_m_s < 0.0:
        nearer_m_s = min(now_m_s - max(s.by_throttle_m_s, s.lift_m_s), -nearer_m_s)
    if nearer_m_s > e.doubt_m_s:
        s.doubt_s = min(s.doubt_s + dt_s, e.doubt_s)
    else:
        s.doubt_s = max(s.doubt_s - dt_s, 0.0)
    if s.doubt_s == 0.0:
        s.refused = 0
    elif s.doubt_s >= e.doubt_s and not s.refused:
        s.refused = 1
        s.throttle_integral = 0.0  # learnt at the wrong speed
