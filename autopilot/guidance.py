"""Where to fly: bank from the heading error, return to launch, and a slow height loop on a lagged GPS.

The heading error comes as the sine (cross product) and the cosine (dot product) of the direction of travel
and the direction wanted, horizontal components only; it works at any attitude, upside down included.  A
negative cosine means more than 90 degrees off course: the bank saturates.

Source: Premerlani & Bizard, Direction Cosine Matrix IMU: Theory, "Using DCM in control and navigation", 3, 5.
"""

import math
from dataclasses import dataclass

from autopilot.stabilise import shorter_way
from estimator.jit import kernel
from estimator.kernels import clip


@dataclass(frozen=True, slots=True)
class GuidanceParams:
    """How the aeroplane is led; the defaults fly the aeroplane `endurance` on a GPS that is 1.3 s late.

    bank_per_heading : bank demanded per unit of sine of the heading error; larger is quicker, then weaves
    bank_limit_rad : the steepest bank ever demanded to turn, whatever the set-point allows
    airspeed_m_s : of cruise, to turn a nose direction and a wind into a direction over the ground
    gps_filter_s : age of a fix beyond its time stamp, from the filter inside the receiver
    gps_patience_s : age of a fix after which it is no longer believed
    circling_bank_rad : flown where there is no position to return from
    passed_m, turn_back_m : nearer than the first is past the launch point; beyond the second it turns back
    climb_per_height_1_s, climb_limit_m_s, sink_limit_m_s : climb demanded per height missing, and its limits
    pitch_trim_rad : pitch of level flight at cruise       pitch_limit_rad : the steepest demanded
    throttle_trim, throttle_per_climb_s_m : for level flight, and per climb rate
    pitch_per_climb_rad_m, pitch_integral_limit_rad : integral of the climb missing, and the most it holds
    throttle_least : keeps air over the tail
    inverted_airspeed_m_s : of inverted flight, above its stall; NaN: this aeroplane cannot, and stays upright
    pitch_per_lift_rad : angle of attack per unit of the lift coefficient at cruise
    throttle_per_speed_s_m, throttle_inverted : for level flight faster than cruise, and for the drag on its back
    """

    bank_per_heading: float = 1.2
    bank_limit_rad: float = math.radians(85.0)
    airspeed_m_s: float = 12.6
    gps_filter_s: float = 1.0
    gps_patience_s: float = 5.0
    circling_bank_rad: float = math.radians(15.0)
    passed_m: float = 15.0
    turn_back_m: float = 60.0
    climb_per_height_1_s: float = 0.25
    climb_limit_m_s: float = 3.0
    sink_limit_m_s: float = 2.0
    pitch_trim_rad: float = math.radians(1.0)
    pitch_limit_rad: float = math.radians(15.0)
    throttle_trim: float = 0.6
    throttle_per_climb_s_m: float = 0.085
    pitch_per_climb_rad_m: float = 0.01
    pitch_integral_limit_rad: float = math.radians(10.0)
    throttle_least: float = 0.1
    inverted_airspeed_m_s: float = 14.0
    pitch_per_lift_rad: float = math.radians(4.6)
    throttle_per_speed_s_m: float = 0.045
    throttle_inverted: float = 0.08


@kernel
def gps_age(row, p):  # type: ignore[no-untyped-def]
    """Age of the motion that the last fix describes, s; infinite where there is none to believe."""
    if row.gps_valid == 0:
        return math.inf
    known = math.isfinite(row.gps_t_s)
    for i in range(3):
        known = known and math.isfinite(row.gps_p_e_m[i]) and math.isfinite(row.gps_v_e_m_s[i])
    age_s = row.t_s - row.gps_t_s
    return max(age_s, 0.0) + p.gps_filter_s if known and age_s < p.gps_patience_s else math.inf


@kernel
def unit(north, east):  # type: ignore[no-untyped-def]
    """Horizontal direction (north, east) of length 1; (0, 0) where there is none."""
    length = math.hypot(north, east)
    return (north / length, east / length) if length > 1e-9 else (0.0, 0.0)


@kernel
def unseen_turn(unseen_rad, R_eb, omega_b_rad_s, lag_s, dt_s):  # type: ignore[no-untyped-def]
    """Angle turned that a GPS course, late by `lag_s`, does not show yet, after one tick, rad.

    The rate about the vertical is the third row of the matrix times the gyro vector (the paper's point 5).
    """
    turning = R_eb[2, 0] * omega_b_rad_s[0] + R_eb[2, 1] * omega_b_rad_s[1] + R_eb[2, 2] * omega_b_rad_s[2]
    return clip(unseen_rad + dt_s * (turning - unseen_rad / lag_s), -math.pi, math.pi)


@kernel
def direction_of_travel(R_eb, wind_e_m_s, row, s, on_nose, p):  # type: ignore[no-untyped-def]
    """Horizontal direction (north, east) in which the aeroplane moves over the ground.

    A matrix whose heading is locked to the course has it in its first column.  One whose heading is the nose
    needs the wind: nose x airspeed + wind; or, where nobody knows the wind, the GPS velocity, turned by
    what it has not seen yet.

    R_eb : shape (3, 3)   wind_e_m_s : shape (3,) or NaN   row : measured   s : record with `unseen_turn_rad`
    """
    north, east = unit(R_eb[0, 0], R_eb[1, 0])
    if not on_nose:
        return north, east
    if math.isfinite(wind_e_m_s[0]) and math.isfinite(wind_e_m_s[1]):
        return unit(p.airspeed_m_s * north + wind_e_m_s[0], p.airspeed_m_s * east + wind_e_m_s[1])
    v = row.gps_v_e_m_s
    if math.isfinite(gps_age(row, p)) and math.hypot(v[0], v[1]) > 3.0:
        cosine, sine = math.cos(s.unseen_turn_rad), math.sin(s.unseen_turn_rad)
        return unit(v[0] * cosine - v[1] * sine, v[0] * sine + v[1] * cosine)
    return north, east


@kernel
def heading_error(north, east, wanted_north, wanted_east):  # type: ignore[no-untyped-def]
    """Sine and cosine of the angle from the direction flown to the one wanted (the paper's point 3)."""
    return north * wanted_east - east * wanted_north, north * wanted_north + east * wanted_east


@kernel
def bank_for_heading(sine, cosine, r_zy, limit_rad, p):  # type: ignore[no-untyped-def]
    """Bank demand, rad, positive right: gain times the sine, or the limit where the cosine is negative.

    Nearly dead astern one turns to the side to which the wings already lean.
    """
    if cosine < 0.0:
        return limit_rad * shorter_way(sine, cosine, 0.5 * r_zy)
    return clip(p.bank_per_heading * sine, -limit_rad, limit_rad)


@kernel
def bank_to_return(north, east, r_zy, row, s, limit_rad, p):  # type: ignore[no-untyped-def]
    """Bank demand, rad, that leads to the launch point, over it, away from it, and back again.

    Having passed it one flies straight on for a while: who turns at once circles round it for ever, with the
    launch point always abeam.  Without a position one circles gently where one is.

    north, east : direction of travel   row : measured   s : record with `outbound`, updated
    """
    age_s = gps_age(row, p)
    if not math.isfinite(age_s):
        return clip(p.circling_bank_rad, -limit_rad, limit_rad)
    home_north = -(row.gps_p_e_m[0] + age_s * row.gps_v_e_m_s[0])
    home_east = -(row.gps_p_e_m[1] + age_s * row.gps_v_e_m_s[1])
    distance_m = math.hypot(home_north, home_east)
    if distance_m < p.passed_m:
        s.outbound = 1
    elif distance_m > p.turn_back_m:
        s.outbound = 0
    if s.outbound:
        return 0.0
    wanted_north, wanted_east = unit(home_north, home_east)
    sine, cosine = heading_error(north, east, wanted_north, wanted_east)
    return bank_for_heading(sine, cosine, r_zy, limit_rad, p)


@kernel
def height(row, p):  # type: ignore[no-untyped-def]
    """Height above the launch point now, m: the last fix moved on by its age; NaN where there is none."""
    age_s = gps_age(row, p)
    return -(row.gps_p_e_m[2] + age_s * row.gps_v_e_m_s[2]) if math.isfinite(age_s) else math.nan


@kernel
def level_flight(up, p):  # type: ignore[no-untyped-def]
    """Airspeed, m/s, pitch, rad, and throttle of level flight: at cruise, or inverted (`up` -1).

    The angle of attack goes with the lift coefficient, `up` (V_c / V)^2 in units of that at cruise; on its back the
    aeroplane flies with the nose as far above the horizon as the wing needs below its own zero.
    """
    if up > 0.0:
        return p.airspeed_m_s, p.pitch_trim_rad, p.throttle_trim
    v = p.inverted_airspeed_m_s
    lift = -((p.airspeed_m_s / v) ** 2)
    throttle = p.throttle_trim + p.throttle_per_speed_s_m * (v - p.airspeed_m_s) + p.throttle_inverted
    return v, -(p.pitch_trim_rad + p.pitch_per_lift_rad * (lift - 1.0)), throttle


@kernel
def hold_height(height_m, up, row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Pitch demand, rad, and throttle, 0..1, that lead slowly to a height and hold it.

    Pitch and throttle follow the same climb demand, so that the speed, which nobody measures, stays near
    cruise.  The integral takes up an estimate that is wrong in pitch; were it on the throttle, the speed
    would pay for that error.  Without a height: level flight at cruise.

    height_m : demanded   up : 1 upright, -1 inverted   row : measured   s : record with `climb_integral_rad`, updated
    """
    missing_m = height_m - height(row, p)
    climb_m_s = 0.0
    if math.isfinite(missing_m):
        climb_m_s = clip(p.climb_per_height_1_s * missing_m, -p.sink_limit_m_s, p.climb_limit_m_s)
        climb_missing_m_s = clip(climb_m_s + row.gps_v_e_m_s[2], -5.0, 5.0)  # the velocity is down
        integral_rad = s.climb_integral_rad + p.pitch_per_climb_rad_m * climb_missing_m_s * dt_s
        s.climb_integral_rad = clip(integral_rad, -p.pitch_integral_limit_rad, p.pitch_integral_limit_rad)
    airspeed_m_s, trim_rad, throttle = level_flight(up, p)
    pitch_rad = trim_rad + climb_m_s / airspeed_m_s + s.climb_integral_rad
    throttle += p.throttle_per_climb_s_m * climb_m_s
    return clip(pitch_rad, -p.pitch_limit_rad, p.pitch_limit_rad), clip(throttle, p.throttle_least, 1.0)


@kernel
def throttle_for(pitch_rad, up, p):  # type: ignore[no-untyped-def]
    """Throttle, 0..1, that goes with a held pitch at about the speed of level flight: where no height is held."""
    airspeed_m_s, trim_rad, throttle = level_flight(up, p)
    climb_m_s = airspeed_m_s * math.sin(pitch_rad - trim_rad)
    return clip(throttle + p.throttle_per_climb_s_m * climb_m_s, p.throttle_least, 1.0)
