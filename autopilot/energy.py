"""Total energy control of height and speed: throttle controls the sum, pitch the distribution.

The energy per weight is ``E = h + V^2 / 2 g``.  Only thrust minus drag changes the sum; the elevator exchanges the two
parts.  The demands, to climb at ``c`` and to accelerate at ``a``, equivalent to a climb of ``V a / g``, are split:

    throttle    their sum             c + V a / g
    pitch       the height part       (1 - w) c + w (e - V a / g)

with ``e`` the part of the sum that the throttle can deliver.  If it can deliver all, the pitch gets ``c`` for any
weight ``w``; if not, ``w`` determines whether height or speed suffers.  With the motor off, or none, ``w`` is 1 and
``e`` is 0 relative to the glide: the pitch holds the speed and not the height.  Near the stall the climb demand of the
pitch is limited whatever the height: the nose goes down.

If the airspeed is unknown (no pitot tube and no estimated wind), ``a`` is 0 and throttle and pitch follow the same
climb demand: the speed stays near the trim speed, open loop.

The trim at any speed comes from the polar: angle of attack goes with the lift coefficient, ``(V_c / V)^2`` relative to
cruise, negative in inverted flight; `tests/physics` compares it with the trimmed model.

Source: A. A. Lambregts, Vertical Flight Path and Speed Control Autopilot Design Using Total Energy Principles,
AIAA 83-2239.
"""

import math
from dataclasses import dataclass

from autopilot.doubt import doubt_airspeed
from autopilot.guidance import gps_age, height, is_wind, unit
from autopilot.interface import LOW
from autopilot.stabilise import far_off
from estimator.blocks.air import true_airspeed_factor
from estimator.blocks.kernels import clip
from estimator.blocks.screening import AIRSPEED_RANGE_M_S
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2


@dataclass(frozen=True, slots=True)
class EnergyParams:
    """Speeds, trim and gains; the defaults are for the aeroplane `endurance`.

    airspeed_m_s : cruise speed, an equivalent airspeed as all speeds here (m/s, default 12.6).  Higher: faster, more
        throttle
    stall_m_s : stall speed (m/s, default 6.95).  Higher: the nose goes down earlier
    best_glide_m_s : speed of best glide (m/s, default 8.6).  Higher: flies faster against headwind
    fastest_m_s : maximum speed (m/s, default 18).  Lower: may not make headway against strong wind
    inverted_m_s, inverted_stall_m_s : cruise and stall speed inverted, NaN: stays upright (m/s, default 14 and 11.3).
        Higher: flies faster inverted
    speed_trust_s : time for which a measured airspeed is used (s, default 0.5).  Higher: bridges longer dropouts
    speed_filter_s : time constant of the airspeed (s, default 1).  Higher: smoother but later
    headwind_found_s, headwind_lost_s : time constants of the headwind when rising and falling (s, default 1 and 30).
        Higher: slower speed changes
    climb_per_height_1_s : climb demand per height error (1/s, default 0.25).  Higher: faster, then oscillates
    climb_limit_m_s, sink_limit_m_s : limits of the climb demand (m/s, default 3 and 2).  Higher: steeper
    gain_per_speed_1_s, gain_limit_m_s2 : acceleration demand per speed error (1/s), and its limit (m/s2) (default 0.3
        and 1.5).  Higher: holds speed more tightly, height less
    height_weight : 1 - w, share of the pitch that holds height (default 0.5).  Higher: height first; 0: speed only
    climb_per_margin_1_s, climb_per_rough_margin_1_s : climb allowed per speed above `least_airspeed`, measured, and
        from the elevator (1/s, default 3 and 2).  Lower: more protection, and climbs less steeply when slow; higher:
        surges
    recovery_sink_m_s : sink demand at `least_airspeed` (m/s, default 1).  Higher: faster recovery, more height lost
    pitch_per_excess_rad_s_m : pitch per excess of the airspeed without a height (rad s/m, default 0.02).  Higher:
        holds the speed more tightly, follows gusts
    climb_per_excess : climb taken to be missing per excess of the airspeed without a height (default 0.5).  Higher:
        learns pitch errors faster, then surges; 0: sinks or climbs by them
    pitch_trim_rad : pitch in level flight at cruise (rad, default 1 deg).  Higher: climbs until learnt
    pitch_limit_rad : largest pitch demand (rad, default 15 deg).  Higher: steeper, nearer the stall
    pitch_per_lift_rad : pitch change per lift coefficient relative to cruise (rad, default 4.6 deg).  Higher: more
        pitch up when slow
    pitch_per_climb_rad_m : integral gain of the climb error (rad/m, default 0.01).  Higher: learns pitch errors faster
    pitch_integral_limit_rad : limit of that integral (rad, default 10 deg).  Lower: large pitch errors remain
    throttle_trim : throttle in level flight at cruise (default 0.6).  Higher: climbs or accelerates until learnt
    throttle_per_speed_s_m : extra throttle per speed above cruise (s/m, default 0.045).  Higher: overshoots in speed
    throttle_inverted : extra throttle inverted (default 0.08).  Higher: climbs inverted
    throttle_per_climb_s_m : throttle per energy rate (s/m, default 0.085).  Higher: stronger response, then surges
    throttle_per_height_1_m : integral gain of the energy error (1/m, default 0.01).  Higher: learns trim faster
    throttle_integral_limit : limit of that integral (default 0.2).  Lower: large trim errors remain
    throttle_least : minimum throttle (default 0.1), for airflow over the tail.  Higher: descends more slowly
    doubt_m_s : difference of an airspeed from those that throttle and elevator tell, beyond which it is refused (m/s,
        default 2.5).  Higher: larger errors are believed; lower: refused in gusts
    doubt_s : time for which it has to differ, and to agree again (s, default 4).  Higher: refused later
    doubt_filter_s : time constant of the airspeed from the throttle (s, default 2).  Higher: smoother but later
    elevation_m : elevation of the launch place above the sea (m, default 0).  Higher: expects faster motion at the same
        airspeed, and more throttle
    """

    airspeed_m_s: float = 12.6
    stall_m_s: float = 6.95
    best_glide_m_s: float = 8.6
    fastest_m_s: float = 18.0
    inverted_m_s: float = 14.0
    inverted_stall_m_s: float = 11.3
    speed_trust_s: float = 0.5
    speed_filter_s: float = 1.0
    headwind_found_s: float = 1.0
    headwind_lost_s: float = 30.0
    climb_per_height_1_s: float = 0.25
    climb_limit_m_s: float = 3.0
    sink_limit_m_s: float = 2.0
    gain_per_speed_1_s: float = 0.3
    gain_limit_m_s2: float = 1.5
    height_weight: float = 0.5
    climb_per_margin_1_s: float = 3.0
    climb_per_rough_margin_1_s: float = 2.0
    recovery_sink_m_s: float = 1.0
    pitch_per_excess_rad_s_m: float = 0.02
    climb_per_excess: float = 0.5
    pitch_trim_rad: float = math.radians(1.0)
    pitch_limit_rad: float = math.radians(15.0)
    pitch_per_lift_rad: float = math.radians(4.6)
    pitch_per_climb_rad_m: float = 0.01
    pitch_integral_limit_rad: float = math.radians(10.0)
    throttle_trim: float = 0.6
    throttle_per_speed_s_m: float = 0.045
    throttle_inverted: float = 0.08
    throttle_per_climb_s_m: float = 0.085
    throttle_per_height_1_m: float = 0.01
    throttle_integral_limit: float = 0.2
    throttle_least: float = 0.1
    doubt_m_s: float = 2.5
    doubt_s: float = 4.0
    doubt_filter_s: float = 2.0
    elevation_m: float = 0.0


SLOWEST, FASTEST = 0.6, 1.6  # range of a plausible airspeed over cruise
STALL_MARGIN = 1.2
SEEN_S = 300.0  # time constant with which the largest tailwind is forgotten
TURN_MARGIN = 1.15


@kernel
def believe_airspeed(wind_e_m_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the equivalent airspeed, m/s, the true airspeed over it, and whether it is known; call once per tick.

    Measured, if a pitot tube is fitted; else from GPS velocity minus estimated wind, corrected for the receiver's
    filter (time constant T), which shortens a vector turning at w by sqrt(1 + (w T)^2); else the trim speed.  Ground
    speed alone is no measure of airspeed: it is wrong by the wind, and changes by twice that between opposite legs.  An
    airspeed that throttle and elevator contradict counts as unknown (`autopilot.doubt`).

    wind_e_m_s : shape (3,) or NaN   row : measured   p : record of AutopilotParams
    s : record with `airspeed_m_s`, `true_factor`, `airspeed_known`, `air_left_s`, updated
    """
    e = p.energy
    s.true_factor = true_airspeed_factor(row, e.elevation_m)
    measured = abs(row.equivalent_airspeed_m_s) < AIRSPEED_RANGE_M_S  # False for NaN
    s.air_left_s = e.speed_trust_s if row.air_new and measured else s.air_left_s - dt_s
    if s.air_left_s > 0.0 and measured:
        now_m_s, s.airspeed_known = row.equivalent_airspeed_m_s, 1
    else:
        now_m_s, s.airspeed_known = math.nan, 0
        lag_s = gps_age(row, p.guidance)
        if math.isfinite(lag_s) and is_wind(wind_e_m_s, 3):
            v, w = row.gps_v_e_m_s, wind_e_m_s
            filtered_m_s = math.sqrt((v[0] - w[0]) ** 2 + (v[1] - w[1]) ** 2 + (v[2] - w[2]) ** 2)
            turned = s.unseen_turn_rad * p.guidance.gps_filter_s / max(lag_s, 1e-3)
            now_m_s, s.airspeed_known = filtered_m_s * math.hypot(1.0, turned) / s.true_factor, 1
    if s.airspeed_known:
        doubt_airspeed(now_m_s, -row.gps_v_e_m_s[2] if math.isfinite(gps_age(row, p.guidance)) else 0.0, s, e, dt_s)
    if s.refused:
        s.airspeed_known = 0
    if not s.airspeed_known:
        now_m_s = s.airspeed_wanted_m_s
    now_m_s = clip(now_m_s, SLOWEST * e.airspeed_m_s, FASTEST * e.airspeed_m_s)
    share = dt_s / (e.speed_filter_s + dt_s) if s.airspeed_m_s > 0.0 else 1.0
    s.airspeed_m_s += share * (now_m_s - s.airspeed_m_s)


@kernel
def see_wind(north, east, s, dt_s):  # type: ignore[no-untyped-def]
    """Update the wind that the ground speed alone shows: the largest tailwind of the last minutes, along its course.

    north, east : direction of the course   s : record with `ground_m_s`, `airspeed_m_s`, `true_factor`; updates
    `wind_seen_e_m_s`
    """
    tailwind_m_s, w = s.ground_m_s - s.true_factor * s.airspeed_m_s, s.wind_seen_e_m_s
    w[0] -= dt_s / SEEN_S * w[0]
    w[1] -= dt_s / SEEN_S * w[1]
    if tailwind_m_s > math.hypot(w[0], w[1]):
        w[0], w[1] = tailwind_m_s * north, tailwind_m_s * east


@kernel
def believe_headwind(towards_north, towards_east, circles, wind_e_m_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update ground speed and headwind along the desired direction, at least 0, m/s, in `s`.

    The headwind comes from the estimated wind; if unknown, from the difference of airspeed and ground speed along the
    track, which shows it even before a turn into the wind.  It rises quickly and falls slowly, because it is not
    visible across the wind.  On a circle or a route the whole wind counts, whatever the present track: who flies
    slowly with it is carried away before he has turned.

    towards_north, towards_east : unit vector, or (0, 0) for the present track
    circles : on a circle or a route, with a motor   wind_e_m_s : shape (3,) or NaN
    row : measured   p : record of AutopilotParams   s : record with `ground_m_s` (NaN: unknown) and `headwind_m_s`
    """
    now_m_s, lag_s = 0.0, gps_age(row, p.guidance)
    s.ground_m_s = math.nan
    if math.isfinite(lag_s):
        north, east = unit(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1])
        turned = s.unseen_turn_rad * p.guidance.gps_filter_s / max(lag_s, 1e-3)
        s.ground_m_s = math.hypot(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]) * math.hypot(1.0, turned)
        if towards_north == 0.0 and towards_east == 0.0:
            towards_north, towards_east = north, east
        now_m_s = (s.true_factor * s.airspeed_m_s - s.ground_m_s) * (towards_north * north + towards_east * east)
        see_wind(north, east, s, dt_s)
        if is_wind(wind_e_m_s, 2) and circles:
            now_m_s = math.hypot(wind_e_m_s[0], wind_e_m_s[1])
        elif circles:
            now_m_s = max(abs(now_m_s), math.hypot(s.wind_seen_e_m_s[0], s.wind_seen_e_m_s[1]))
        elif is_wind(wind_e_m_s, 2):
            now_m_s = -(towards_north * wind_e_m_s[0] + towards_east * wind_e_m_s[1])
    now_m_s = max(now_m_s, 0.0)
    filter_s = p.energy.headwind_found_s if now_m_s > s.headwind_m_s else p.energy.headwind_lost_s
    s.headwind_m_s += dt_s / (filter_s + dt_s) * (now_m_s - s.headwind_m_s)


@kernel
def speed_to_fly(headwind_m_s, e):  # type: ignore[no-untyped-def]
    """Airspeed, m/s, of minimum energy per distance against a headwind W; at least cruise.  Both are equivalent ones.

    Energy per distance over the ground is D V / (V - W).  With the drag a V^2 + b / V^2 and V_g^4 = b / a, the best
    glide, its minimum is where 2 V^3 - 3 W V^2 = V_g^4 (2 / V - W / V^2): V_g in calm air, 3/2 W in a strong wind;
    (V_g^3 + (3/2 W)^3)^(1/3) is within 5 % of it everywhere.  The same holds for a glider, in height.
    """
    cube = e.best_glide_m_s**3 + (1.5 * headwind_m_s) ** 3
    return clip(cube ** (1.0 / 3.0), e.airspeed_m_s, e.fastest_m_s)


@kernel
def want_airspeed(setpoint, travels, s, e):  # type: ignore[no-untyped-def]
    """Set the desired airspeed, m/s, `s.airspeed_wanted_m_s`: cruise; in navigation the setpoint's, or by headwind.

    setpoint : its record   travels : whether the active mode navigates
    s : record with `inverted`, `headwind_m_s`   e : record of EnergyParams
    """
    wanted_m_s = e.inverted_m_s if s.inverted else e.airspeed_m_s
    if travels and setpoint.radio and math.isfinite(setpoint.airspeed_m_s):
        wanted_m_s = clip(setpoint.airspeed_m_s, least_airspeed(s, e), e.fastest_m_s)
    elif travels:
        wanted_m_s = max(wanted_m_s, speed_to_fly(s.headwind_m_s / s.true_factor, e))
    s.airspeed_wanted_m_s = wanted_m_s


@kernel
def level_flight(s, e):  # type: ignore[no-untyped-def]
    """Pitch, rad, and throttle of level flight (without motor: of the glide) at the desired airspeed.

    s : record with `airspeed_wanted_m_s` and `inverted`   e : record of EnergyParams
    """
    v = s.airspeed_wanted_m_s
    # The drag is that of sea level; in thinner air propeller and aeroplane are faster alike.
    throttle = s.true_factor * (e.throttle_trim + e.throttle_per_speed_s_m * (v - e.airspeed_m_s))
    lift = (e.airspeed_m_s / v) ** 2
    if s.inverted:
        return -e.pitch_trim_rad + e.pitch_per_lift_rad * (lift + 1.0), throttle + e.throttle_inverted
    return e.pitch_trim_rad + e.pitch_per_lift_rad * (lift - 1.0), throttle


@kernel
def least_airspeed(s, e):  # type: ignore[no-untyped-def]
    """1.2 times the stalling speed, m/s, upright or inverted."""
    return STALL_MARGIN * (e.inverted_stall_m_s if s.inverted else e.stall_m_s)


@kernel
def by_elevator(s):  # type: ignore[no-untyped-def]
    """Whether the guards against a stall use the airspeed from the elevator."""
    return s.lift_m_s > 0.0 and not (s.airspeed_known and s.air_left_s > 0.0)


@kernel
def airspeed_to_protect(s):  # type: ignore[no-untyped-def]
    """The airspeed of the guards against a stall, m/s; infinite if unknown.

    Measured, or from the elevator (`autopilot.lift`), or from the estimated wind, which is late and may be wrong.
    """
    if by_elevator(s):
        return s.lift_m_s
    return s.airspeed_m_s if s.airspeed_known else math.inf


@kernel
def excess_airspeed(s):  # type: ignore[no-untyped-def]
    """Airspeed beyond the desired one, at least 0, m/s; 0 if unknown.

    Measured, or from the elevator (`autopilot.lift`).  Below it, the motor may be weak: that is for the guard
    against a stall.
    """
    flown_m_s = airspeed_to_protect(s)
    return max(flown_m_s - s.airspeed_wanted_m_s, 0.0) if math.isfinite(flown_m_s) else 0.0


@kernel
def most_climb(s, e):  # type: ignore[no-untyped-def]
    """Largest climb demand, m/s, that leaves the speed above the stall; infinite if the airspeed is unknown.

    Close to the ground, in LOW, an aeroplane with a motor does not dive for speed: it sinks at `recovery_sink_m_s`.

    s : record with `airspeed_m_s`, `airspeed_known`, `lift_m_s`, `mode`   e : record of EnergyParams
    """
    gain_1_s = e.climb_per_rough_margin_1_s if by_elevator(s) else e.climb_per_margin_1_s
    most_m_s = gain_1_s * (airspeed_to_protect(s) - least_airspeed(s, e)) - e.recovery_sink_m_s
    if s.mode == LOW and e.throttle_per_climb_s_m > 0.0:
        return max(most_m_s, -e.recovery_sink_m_s)
    return most_m_s


@kernel
def steepest_bank(s, e):  # type: ignore[no-untyped-def]
    """Largest bank, rad, of a level turn 15 % above its stalling speed, which grows with 1 / sqrt(cos bank)."""
    slowest_m_s = TURN_MARGIN * (e.inverted_stall_m_s if s.inverted else e.stall_m_s)
    return math.acos(min((slowest_m_s / airspeed_to_protect(s)) ** 2, 1.0))


@kernel
def throttle_of(energy_m_s, trim, s, e):  # type: ignore[no-untyped-def]
    """Throttle, 0..1, for an energy rate, and the rate it can deliver, m/s of climb; `trim` is for zero."""
    level = trim + s.throttle_integral
    throttle = clip(level + e.throttle_per_climb_s_m * energy_m_s, e.throttle_least, 1.0)
    if e.throttle_per_climb_s_m <= 0.0:  # no motor
        return throttle, 0.0
    return throttle, (throttle - level) / e.throttle_per_climb_s_m


@kernel
def hold_height(height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, that reach and hold a height and the desired airspeed.

    The integrated climb error compensates pitch errors of the estimate, the integrated energy error a wrong throttle
    trim; the second is frozen if the airspeed is unknown, as speed would change to compensate the first.

    Without a height: level flight.  At the throttle of level flight an aeroplane that is too fast descends: the excess
    of the airspeed takes the place of the missing climb.

    height_m : demanded   row : measured   p : record of AutopilotParams
    s : record with `climb_integral_rad`, `throttle_integral`, updated, and the results of `believe_airspeed`
    """
    e = p.energy
    most_m_s = most_climb(s, e)
    trim_rad, trim = level_flight(s, e)
    missing_m = height_m - height(row, p.guidance)
    climb_m_s = sinking_m_s = 0.0
    if math.isfinite(missing_m):
        climb_m_s = clip(e.climb_per_height_1_s * missing_m, -e.sink_limit_m_s, e.climb_limit_m_s)
        sinking_m_s = row.gps_v_e_m_s[2]  # velocity down
    gain_m_s = 0.0
    if s.airspeed_known:
        gain_m_s2 = e.gain_per_speed_1_s * (s.airspeed_wanted_m_s - s.airspeed_m_s)
        gain_m_s = s.true_factor * s.airspeed_m_s / G_M_S2 * clip(gain_m_s2, -e.gain_limit_m_s2, e.gain_limit_m_s2)
    energy_m_s = climb_m_s + gain_m_s
    throttle, given_m_s = throttle_of(energy_m_s, trim, s, e)
    climb_m_s = min(e.height_weight * climb_m_s + (1.0 - e.height_weight) * (given_m_s - gain_m_s), most_m_s)
    pitch_rad = trim_rad + climb_m_s / (s.true_factor * s.airspeed_wanted_m_s) + s.climb_integral_rad

    if e.height_weight > 0.0:  # otherwise the climb follows from the speed
        climb_missing_m_s = climb_m_s + sinking_m_s
        if not math.isfinite(missing_m):
            excess_m_s = excess_airspeed(s)
            pitch_rad += e.pitch_per_excess_rad_s_m * excess_m_s
            climb_missing_m_s = e.climb_per_excess * excess_m_s
    else:
        climb_missing_m_s = climb_m_s
    if climb_m_s == most_m_s or most_m_s < 0.0:  # too slow: not a pitch error
        climb_missing_m_s = min(climb_missing_m_s, 0.0)
    learns = s.airspeed_known and math.isfinite(missing_m) and abs(given_m_s - energy_m_s) < 1e-6
    learn_trim(climb_missing_m_s, energy_m_s + sinking_m_s if learns else 0.0, s, e, dt_s)
    return clip(pitch_rad, -e.pitch_limit_rad, e.pitch_limit_rad), throttle


@kernel
def learn_trim(climb_missing_m_s, energy_missing_m_s, s, e, dt_s):  # type: ignore[no-untyped-def]
    """One tick of the integrals of pitch and throttle; an error of 0 freezes one."""
    integral_rad = s.climb_integral_rad + e.pitch_per_climb_rad_m * clip(climb_missing_m_s, -5.0, 5.0) * dt_s
    s.climb_integral_rad = clip(integral_rad, -e.pitch_integral_limit_rad, e.pitch_integral_limit_rad)
    integral = s.throttle_integral + e.throttle_per_height_1_m * energy_missing_m_s * dt_s
    s.throttle_integral = clip(integral, -e.throttle_integral_limit, e.throttle_integral_limit)


@kernel
def throttle_for(pitch_rad, s, e):  # type: ignore[no-untyped-def]
    """Throttle, 0..1, for a constant pitch at about the speed of level flight, for modes without height."""
    trim_rad, throttle = level_flight(s, e)
    climb_m_s = s.airspeed_wanted_m_s * math.sin(pitch_rad - trim_rad)
    return clip(throttle + e.throttle_per_climb_s_m * climb_m_s, e.throttle_least, 1.0)


@kernel
def throttle_to_recover(r_zx, pitch_rad, throttle):  # type: ignore[no-untyped-def]
    """The throttle at a large pitch error: closed with the nose far below the demand, full far above it.

    A motor that is off, in the hand or in a glide, stays off.   r_zx : minus the sine of the pitch
    pitch_rad : demanded
    """
    dropped = r_zx + math.sin(pitch_rad)
    if throttle <= 0.0:
        return throttle
    return throttle + far_off(dropped) * ((0.0 if dropped > 0.0 else 1.0) - throttle)
