"""Guidance: bank from the heading error, and the return to launch.

The heading error is given by the sine (cross product) and the cosine (dot product) of the horizontal directions of
travel and demand; it works at any attitude, including inverted.  A negative cosine means an error above 90 degrees,
where the bank saturates.

Source: Premerlani & Bizard, Direction Cosine Matrix IMU: Theory, "Using DCM in control and navigation", 3, 5.
"""

import math
from dataclasses import dataclass

from autopilot.interface import COURSE, RETURN
from autopilot.stabilise import shorter_way
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel

MOST_M, MOST_M_S = 1e6, 1000.0  # limits of a valid fix
MOST_WIND_M_S = 100.0  # limit of a valid wind


@dataclass(frozen=True, slots=True)
class GuidanceParams:
    """Guidance gains and limits; the defaults are for the aeroplane `endurance` with a GPS that lags by 1.3 s.

    bank_per_heading : bank per sine of the heading error (rad, default 1.2).  Higher: faster turns, then weaves
    bank_limit_rad : largest bank in turns, whatever the setpoint allows (rad, default 85 deg).  Lower: wider turns
    slow_ground : ground speed over cruise speed below which turns are gentler, see `agility` (default 0.9).  Higher:
        gentle turns also in light headwind; lower: the heading may be lost when drifting backwards
    least_agility : fraction of the bank kept at the lowest ground speed (default 0.3).  Higher: faster turns
    blown : wind over cruise speed beyond which circles and routes take the direction from GPS velocity and wind instead
        of an estimator's course (default 0.5).  Higher: the course is lost in strong wind; lower: noisier turns
    wind_share : largest wind used for navigation, over the airspeed (default 0.8).  Higher: more crab in strong wind
    gps_filter_s : age of a fix beyond its time stamp, due to the receiver's filter (s, default 1).  Wrong: the track is
        offset in turns
    gps_patience_s : age after which a fix is no longer used (s, default 5).  Higher: flies longer on old fixes
    circling_bank_rad : bank without a position (rad, default 15 deg).  Higher: tighter circle
    passed_m : distance at which the launch point counts as passed (m, default 15).  Lower: may be missed
    turn_back_m : distance at which it turns back (m, default 60).  Higher: longer passes
    """

    bank_per_heading: float = 1.2
    bank_limit_rad: float = math.radians(85.0)
    slow_ground: float = 0.9
    least_agility: float = 0.3
    blown: float = 0.5
    wind_share: float = 0.8
    gps_filter_s: float = 1.0
    gps_patience_s: float = 5.0
    circling_bank_rad: float = math.radians(15.0)
    passed_m: float = 15.0
    turn_back_m: float = 60.0


@kernel
def is_fix(row):  # type: ignore[no-untyped-def]
    """Whether position and velocity of `row` are plausible; NaN and infinity are not."""
    good = True
    for i in range(3):
        good = good and abs(row.gps_p_e_m[i]) <= MOST_M and abs(row.gps_v_e_m_s[i]) <= MOST_M_S
    return good


@kernel
def is_wind(wind_e_m_s, components):  # type: ignore[no-untyped-def]
    """Whether the first `components` of a wind are plausible; NaN (unknown) is not."""
    good = True
    for i in range(components):
        good = good and abs(wind_e_m_s[i]) <= MOST_WIND_M_S
    return good


@kernel
def gps_age(row, p):  # type: ignore[no-untyped-def]
    """Age of the motion in the last fix, s; infinite if there is no usable fix."""
    if row.gps_valid == 0:
        return math.inf
    age_s = row.t_s - row.gps_t_s  # NaN: no time stamp
    return max(age_s, 0.0) + p.gps_filter_s if is_fix(row) and age_s < p.gps_patience_s else math.inf


@kernel
def unit(north, east):  # type: ignore[no-untyped-def]
    """Horizontal unit vector (north, east); (0, 0) for zero length."""
    length = math.hypot(north, east)
    return (north / length, east / length) if length > 1e-9 else (0.0, 0.0)


@kernel
def turn_rate(R_eb, omega_b_rad_s):  # type: ignore[no-untyped-def]
    """Rate about the vertical, rad/s: the third row of the matrix times the gyro vector (the paper's point 5)."""
    return R_eb[2, 0] * omega_b_rad_s[0] + R_eb[2, 1] * omega_b_rad_s[1] + R_eb[2, 2] * omega_b_rad_s[2]


@kernel
def unseen_turn(unseen_rad, R_eb, omega_b_rad_s, lag_s, dt_s):  # type: ignore[no-untyped-def]
    """Turn angle not yet visible in a GPS course that lags by `lag_s`, after one tick, rad."""
    turning = turn_rate(R_eb, omega_b_rad_s)
    return clip(unseen_rad + dt_s * (turning - unseen_rad / lag_s), -math.pi, math.pi)


@kernel
def turned_now(north, east, s):  # type: ignore[no-untyped-def]
    """A direction of the last fix, rotated by the unseen turn; s : record with `unseen_turn_rad`."""
    cosine, sine = math.cos(s.unseen_turn_rad), math.sin(s.unseen_turn_rad)
    return north * cosine - east * sine, north * sine + east * cosine


@kernel
def over_ground(north, east, wind_north_m_s, wind_east_m_s, airspeed_m_s, p):  # type: ignore[no-untyped-def]
    """Direction over the ground with the nose (north, east); a wind near or above the airspeed is limited."""
    wind_m_s, most_m_s = math.hypot(wind_north_m_s, wind_east_m_s), p.wind_share * airspeed_m_s
    part = most_m_s / wind_m_s if wind_m_s > most_m_s else 1.0
    return unit(airspeed_m_s * north + part * wind_north_m_s, airspeed_m_s * east + part * wind_east_m_s)


@kernel
def direction_of_travel(R_eb, wind_e_m_s, row, s, on_nose, blown, p):  # type: ignore[no-untyped-def]
    """Horizontal direction (north, east) in which the aeroplane moves over the ground.

    With a heading locked to the course it is the first column of the matrix.  With a nose heading it is nose x
    airspeed + wind or, if the wind is unknown, the GPS velocity rotated by the unseen turn.  A wind near or above the
    airspeed is limited so that the direction stays ahead of the nose: even when blown backwards, the aeroplane keeps
    pointing home instead of turning to where it drifts.

    In a turn in strong wind a course swings faster than an estimator follows, and in either sense.  There the nose is
    the GPS velocity less the wind, rotated by the unseen turn: the nose turns as the gyros say.

    R_eb : shape (3, 3)   wind_e_m_s : shape (3,) or NaN   row : measured   blown : in strong wind
    s : record with `airspeed_m_s`, `true_factor`, `unseen_turn_rad`, `wind_seen_e_m_s`
    """
    north, east = unit(R_eb[0, 0], R_eb[1, 0])
    known, v = is_wind(wind_e_m_s, 2), row.gps_v_e_m_s
    if blown and not (on_nose and known) and math.isfinite(gps_age(row, p)):
        w0, w1 = (wind_e_m_s[0], wind_e_m_s[1]) if known else (s.wind_seen_e_m_s[0], s.wind_seen_e_m_s[1])
        x, y = turned_now(v[0] - w0, v[1] - w1, s)
        north, east = unit(x, y)
        return over_ground(north, east, w0, w1, s.true_factor * s.airspeed_m_s, p)
    if not on_nose:
        return north, east
    if known:
        return over_ground(north, east, wind_e_m_s[0], wind_e_m_s[1], s.true_factor * s.airspeed_m_s, p)
    if math.isfinite(gps_age(row, p)) and math.hypot(v[0], v[1]) > 3.0:
        x, y = turned_now(v[0], v[1], s)
        return unit(x, y)
    return north, east


@kernel
def agility(s, cruise_m_s, p):  # type: ignore[no-untyped-def]
    """The part of the bank that may be used where the heading is a course, 0..1, less over slow ground.

    A sideways acceleration a turns the course at a / v, v over the ground: into a strong wind many times as quickly
    as the nose, and the late GPS, from which such an estimator has its course, can follow only so much.

    s : record with `ground_m_s`
    """
    if not math.isfinite(s.ground_m_s):
        return 1.0
    return clip(s.ground_m_s / (p.slow_ground * cruise_m_s), p.least_agility, 1.0)


@kernel
def heading_error(north, east, wanted_north, wanted_east):  # type: ignore[no-untyped-def]
    """Sine and cosine of the angle from the direction flown to that demanded (the paper's point 3)."""
    return north * wanted_east - east * wanted_north, north * wanted_north + east * wanted_east


@kernel
def bank_for_heading(sine, cosine, r_zy, limit_rad, p):  # type: ignore[no-untyped-def]
    """Bank demand, rad, positive right: gain times the sine, or the limit if the cosine is negative.

    Near 180 degrees it turns in the direction of the present bank.
    """
    if cosine < 0.0:
        return limit_rad * shorter_way(sine, cosine, 0.5 * r_zy)
    return clip(p.bank_per_heading * sine, -limit_rad, limit_rad)


@kernel
def way_home(row, p):  # type: ignore[no-untyped-def]
    """(north, east) to the launch point, m, from the last fix extrapolated by its age; NaN without a fix."""
    age_s = gps_age(row, p)
    if not math.isfinite(age_s):
        return math.nan, math.nan
    return -(row.gps_p_e_m[0] + age_s * row.gps_v_e_m_s[0]), -(row.gps_p_e_m[1] + age_s * row.gps_v_e_m_s[1])


@kernel
def way_wanted(setpoint, row, s, p):  # type: ignore[no-untyped-def]
    """Direction (north, east) of the course or of the launch point, by mode; (0, 0) for other modes.

    setpoint : its record   s : record with `led_by`, `outbound`
    """
    if s.led_by == COURSE:
        return math.cos(setpoint.course_rad), math.sin(setpoint.course_rad)
    if s.led_by == RETURN and not s.outbound:
        north, east = way_home(row, p)
        if math.isfinite(north):
            return unit(north, east)
    return 0.0, 0.0


@kernel
def bank_to_return(north, east, r_zy, row, s, limit_rad, p):  # type: ignore[no-untyped-def]
    """Bank demand, rad, that leads to the launch point, over it, away from it, and back again.

    After passing it, it flies straight on for a while; turning at once would circle for ever with the launch point
    abeam.  Without a position it circles gently.

    north, east : direction of travel   row : measured   s : record with `outbound`, updated
    """
    home_north, home_east = way_home(row, p)
    distance_m = math.hypot(home_north, home_east)
    if not math.isfinite(distance_m):
        return clip(p.circling_bank_rad, -limit_rad, limit_rad)
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
    """Height above the launch point, m, from the last fix extrapolated by its age; NaN without a fix."""
    age_s = gps_age(row, p)
    return -(row.gps_p_e_m[2] + age_s * row.gps_v_e_m_s[2]) if math.isfinite(age_s) else math.nan
