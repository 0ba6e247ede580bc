"""Height and speed by energy: the throttle follows their sum, the pitch how it is shared.

Per weight an aeroplane has the energy ``E = h + V^2 / 2 g``.  Thrust less drag changes the sum and nothing else
does; the elevator trades the one part for the other.  So the demands, to climb at ``c`` and to gain speed at ``a``,
which is worth a climb of ``V a / g``, go

    to the throttle    their sum              c + V a / g
    to the pitch       what of it is height   (1 - w) c + w (e - V a / g)

with ``e`` the part of the sum that the throttle can give.  Where it can give all of it, that is ``c`` whatever the
weight ``w``; where it cannot, ``w`` says who goes without.  Motor off, or none: ``w`` is 1, ``e`` is 0 against the
glide, and the pitch holds the speed and no height.  Too near the stall no climb is asked of the pitch whatever the
height is: the nose goes down.

Where nobody knows the airspeed (no pitot tube, and an estimator that tells no wind) ``a`` is 0, and throttle and
pitch follow the same climb demand: open loop, the speed stays near that for which they are trimmed.

The trim of any speed comes from the polar: the angle of attack goes with the lift coefficient, ``(V_c / V)^2`` in
units of that at cruise, negative on the back; `tests/physics` holds it against the trimmed model.

Source: A. A. Lambregts, Vertical Flight Path and Speed Control Autopilot Design Using Total Energy Principles,
AIAA 83-2239.
"""

import math
from dataclasses import dataclass

from autopilot.guidance import gps_age, height, is_wind, unit
from autopilot.stabilise import far_off
from estimator.blocks.kernels import clip
from estimator.blocks.screening import AIRSPEED_RANGE_M_S
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2


@dataclass(frozen=True, slots=True)
class EnergyParams:
    """Speeds, trim and gains; the defaults fly the aeroplane `endurance`.

    airspeed_m_s : cruise        stall_m_s, best_glide_m_s, fastest_m_s : other speeds of level flight
    inverted_m_s, inverted_stall_m_s : on its back; NaN where it cannot fly there, and stays upright
    speed_trust_s : a measured airspeed is believed for so long        speed_filter_s : time constant of the belief
    headwind_found_s, headwind_lost_s : time constants of the headwind believed, growing and shrinking
    climb_per_height_1_s, climb_limit_m_s, sink_limit_m_s : climb demanded per height missing, and its limits
    gain_per_speed_1_s, gain_limit_m_s2 : acceleration demanded per airspeed missing, and its limit
    height_weight : 1 - w: 0 where the pitch is the speed's
    recovery_sink_m_s, climb_per_margin_1_s : sink demanded at `least_airspeed`, and climb allowed per speed above
    pitch_trim_rad : pitch of level flight at cruise       pitch_limit_rad : the steepest demanded
    pitch_per_lift_rad : more of it per lift coefficient, in units of that at cruise
    pitch_per_climb_rad_m, pitch_integral_limit_rad : integral of the climb missing, and the most it holds
    throttle_trim, throttle_per_speed_s_m, throttle_inverted : for level flight at cruise, faster, on its back
    throttle_per_climb_s_m, throttle_per_height_1_m : per rate of energy, and its integral
    throttle_integral_limit : the most it holds
    throttle_least : keeps air over the tail
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
    recovery_sink_m_s: float = 1.0
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


SLOWEST, FASTEST = 0.6, 1.6  # of cruise: what is believed of an airspeed
STALL_MARGIN = 1.2


@kernel
def believe_airspeed(wind_e_m_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Airspeed now, m/s, and whether anybody knows it, in `s`; call once per tick.

    Measured, where a pitot tube is fitted; else the GPS velocity less the wind, where the estimator tells one, as
    much longer as the receiver's filter (time constant T) shortens a vector that turns at w, sqrt(1 + (w T)^2); else
    the speed for which the aeroplane is trimmed.  The speed over the ground alone says nothing: in wind it is wrong
    by all of it, and twice that from one leg to the next.

    wind_e_m_s : shape (3,) or NaN   row : measured   p : record of AutopilotParams
    s : record with `airspeed_m_s`, `airspeed_known`, `air_left_s`, updated
    """
    e = p.energy
    measured = abs(row.airspeed_m_s) < AIRSPEED_RANGE_M_S  # NaN is not
    s.air_left_s = e.speed_trust_s if row.air_new and measured else s.air_left_s - dt_s
    if s.air_left_s > 0.0 and measured:
        now_m_s, s.airspeed_known = row.airspeed_m_s, 1
    else:
        now_m_s, s.airspeed_known = math.nan, 0
        lag_s = gps_age(row, p.guidance)
        if math.isfinite(lag_s) and is_wind(wind_e_m_s, 3):
            v, w = row.gps_v_e_m_s, wind_e_m_s
            filtered_m_s = math.sqrt((v[0] - w[0]) ** 2 + (v[1] - w[1]) ** 2 + (v[2] - w[2]) ** 2)
            turned = s.unseen_turn_rad * p.guidance.gps_filter_s / max(lag_s, 1e-3)
            now_m_s, s.airspeed_known = filtered_m_s * math.hypot(1.0, turned), 1
    if not s.airspeed_known:
        now_m_s = s.airspeed_wanted_m_s
    now_m_s = clip(now_m_s, SLOWEST * e.airspeed_m_s, FASTEST * e.airspeed_m_s)
    share = dt_s / (e.speed_filter_s + dt_s) if s.airspeed_m_s > 0.0 else 1.0
    s.airspeed_m_s += share * (now_m_s - s.airspeed_m_s)


@kernel
def believe_headwind(towards_north, towards_east, wind_e_m_s, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Speed over the ground now, and the wind against the way wanted, never below 0, m/s, in `s`.

    The headwind comes from the estimator's wind, where it tells one; else from what the ground speed has more or less
    than the airspeed, the wind along the track: who is to turn round and is blown away is told by that before
    he turns.  It is believed quickly and forgotten slowly, for across the wind nothing shows.

    towards_north, towards_east : way wanted, of length 1; (0, 0) is the way flown   wind_e_m_s : shape (3,) or NaN
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
        now_m_s = (s.airspeed_m_s - s.ground_m_s) * (towards_north * north + towards_east * east)
        if is_wind(wind_e_m_s, 2):
            now_m_s = -(towards_north * wind_e_m_s[0] + towards_east * wind_e_m_s[1])
    now_m_s = max(now_m_s, 0.0)
    filter_s = p.energy.headwind_found_s if now_m_s > s.headwind_m_s else p.energy.headwind_lost_s
    s.headwind_m_s += dt_s / (filter_s + dt_s) * (now_m_s - s.headwind_m_s)


@kernel
def speed_to_fly(headwind_m_s, e):  # type: ignore[no-untyped-def]
    """Airspeed, m/s, that brings one home against a headwind W for the least energy; never below cruise.

    Energy per way over the ground is D V / (V - W).  With the drag a V^2 + b / V^2 and V_g^4 = b / a, the best
    glide, its minimum is where 2 V^3 - 3 W V^2 = V_g^4 (2 / V - W / V^2): V_g in calm air, 3/2 W in a strong wind;
    (V_g^3 + (3/2 W)^3)^(1/3) keeps within 5 % of it everywhere.  So does a glider's, that pays in height.
    """
    cube = e.best_glide_m_s**3 + (1.5 * headwind_m_s) ** 3
    return clip(cube ** (1.0 / 3.0), e.airspeed_m_s, e.fastest_m_s)


@kernel
def want_airspeed(asked, travels, s, e):  # type: ignore[no-untyped-def]
    """Airspeed wanted, m/s, in `s.airspeed_wanted_m_s`: cruise; on the way somewhere as asked, or as the wind needs.

    asked : record of the set-point   travels : whether the mode in force goes somewhere
    s : record with `inverted`, `headwind_m_s`   e : record of EnergyParams
    """
    wanted_m_s = e.inverted_m_s if s.inverted else e.airspeed_m_s
    if travels and asked.radio and math.isfinite(asked.airspeed_m_s):
        wanted_m_s = clip(asked.airspeed_m_s, least_airspeed(s, e), e.fastest_m_s)
    elif travels:
        wanted_m_s = max(wanted_m_s, speed_to_fly(s.headwind_m_s, e))
    s.airspeed_wanted_m_s = wanted_m_s


@kernel
def level_flight(s, e):  # type: ignore[no-untyped-def]
    """Pitch, rad, and throttle of level flight (motor off: of the glide) at the airspeed wanted.

    s : record with `airspeed_wanted_m_s` and `inverted`   e : record of EnergyParams
    """
    v = s.airspeed_wanted_m_s
    throttle = e.throttle_trim + e.throttle_per_speed_s_m * (v - e.airspeed_m_s)
    lift = (e.airspeed_m_s / v) ** 2
    if s.inverted:
        return -e.pitch_trim_rad + e.pitch_per_lift_rad * (lift + 1.0), throttle + e.throttle_inverted
    return e.pitch_trim_rad + e.pitch_per_lift_rad * (lift - 1.0), throttle


@kernel
def least_airspeed(s, e):  # type: ignore[no-untyped-def]
    """1.2 times the stalling speed, m/s, upright or inverted."""
    return STALL_MARGIN * (e.inverted_stall_m_s if s.inverted else e.stall_m_s)


@kernel
def throttle_of(energy_m_s, trim, s, e):  # type: ignore[no-untyped-def]
    """Throttle, 0..1, for a rate of energy, and the rate that it can give, m/s of climb; `trim` is for none."""
    level = trim + s.throttle_integral
    throttle = clip(level + e.throttle_per_climb_s_m * energy_m_s, e.throttle_least, 1.0)
    if e.throttle_per_climb_s_m <= 0.0:  # no motor
        return throttle, 0.0
    return throttle, (throttle - level) / e.throttle_per_climb_s_m


@kernel
def hold_height(height_m, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, that lead slowly to a height and to the airspeed wanted, and hold both.

    The integral of the climb missing takes up an estimate that is wrong in pitch, that of the energy missing a trim
    that is wrong in throttle; the second waits where nobody knows the speed, which would pay for the first.  Without
    a height: level flight.

    height_m : demanded   row : measured   p : record of AutopilotParams
    s : record with `climb_integral_rad`, `throttle_integral`, updated, and what `believe_airspeed` wrote
    """
    e = p.energy
    trim_rad, trim = level_flight(s, e)
    missing_m = height_m - height(row, p.guidance)
    climb_m_s = sinking_m_s = 0.0
    if math.isfinite(missing_m):
        climb_m_s = clip(e.climb_per_height_1_s * missing_m, -e.sink_limit_m_s, e.climb_limit_m_s)
        sinking_m_s = row.gps_v_e_m_s[2]  # the velocity is down
    gain_m_s, most_m_s = 0.0, math.inf
    if s.airspeed_known:
        gain_m_s2 = e.gain_per_speed_1_s * (s.airspeed_wanted_m_s - s.airspeed_m_s)
        gain_m_s = s.airspeed_m_s / G_M_S2 * clip(gain_m_s2, -e.gain_limit_m_s2, e.gain_limit_m_s2)
        most_m_s = e.climb_per_margin_1_s * (s.airspeed_m_s - least_airspeed(s, e)) - e.recovery_sink_m_s
    energy_m_s = climb_m_s + gain_m_s
    throttle, given_m_s = throttle_of(energy_m_s, trim, s, e)
    climb_m_s = min(e.height_weight * climb_m_s + (1.0 - e.height_weight) * (given_m_s - gain_m_s), most_m_s)
    pitch_rad = trim_rad + climb_m_s / s.airspeed_wanted_m_s + s.climb_integral_rad

    if e.height_weight > 0.0:  # else the climb is what the speed makes it
        climb_missing_m_s = climb_m_s + sinking_m_s if math.isfinite(missing_m) else 0.0
    else:
        climb_missing_m_s = climb_m_s
    if climb_m_s == most_m_s or most_m_s < 0.0:  # too slow: what is missing is not lift
        climb_missing_m_s = min(climb_missing_m_s, 0.0)
    learns = s.airspeed_known and math.isfinite(missing_m) and abs(given_m_s - energy_m_s) < 1e-6
    learn_trim(climb_missing_m_s, energy_m_s + sinking_m_s if learns else 0.0, s, e, dt_s)
    return clip(pitch_rad, -e.pitch_limit_rad, e.pitch_limit_rad), throttle


@kernel
def learn_trim(climb_missing_m_s, energy_missing_m_s, s, e, dt_s):  # type: ignore[no-untyped-def]
    """One tick of the integrals of pitch and throttle; the caller hands 0 to the one that is to wait."""
    integral_rad = s.climb_integral_rad + e.pitch_per_climb_rad_m * clip(climb_missing_m_s, -5.0, 5.0) * dt_s
    s.climb_integral_rad = clip(integral_rad, -e.pitch_integral_limit_rad, e.pitch_integral_limit_rad)
    integral = s.throttle_integral + e.throttle_per_height_1_m * energy_missing_m_s * dt_s
    s.throttle_integral = clip(integral, -e.throttle_integral_limit, e.throttle_integral_limit)


@kernel
def throttle_for(pitch_rad, s, e):  # type: ignore[no-untyped-def]
    """Throttle, 0..1, that goes with a held pitch at about the speed of level flight: where no height is held."""
    trim_rad, throttle = level_flight(s, e)
    climb_m_s = s.airspeed_wanted_m_s * math.sin(pitch_rad - trim_rad)
    return clip(throttle + e.throttle_per_climb_s_m * climb_m_s, e.throttle_least, 1.0)


@kernel
def throttle_to_recover(r_zx, pitch_rad, throttle):  # type: ignore[no-untyped-def]
    """The throttle of a pitch nobody asked for: shut as the nose drops far below the demand, full far above it.

    A motor that is to be off, in the hand or in a glide, stays off.   r_zx : minus the sine of the pitch
    pitch_rad : demanded
    """
    dropped = r_zx + math.sin(pitch_rad)
    if throttle <= 0.0:
        return throttle
    return throttle + far_off(dropped) * ((0.0 if dropped > 0.0 else 1.0) - throttle)
