"""Circles and routes: one guidance law for circles and lines.

A reference point moves ahead on the desired path at the distance ``L1``.  With ``eta`` the angle from the direction of
travel to that point, the lateral acceleration is

    a = 2 V^2 / L1 sin(eta)                                                    (Park, Deyst & How, Eqn 1)

which is the centripetal acceleration of the circular arc to that point, tangent to the direction of travel.  On a
circle of radius r, sin(eta) = L1 / (2 r) and a = V^2 / r exactly; on a line a small error decays with the natural
frequency sqrt(2) V / L1 and a damping of 0.71.  ``L1`` is a number of seconds of flight, and tan(bank) = a / g; V is
the ground speed, so that both laws hold in wind.

If the path is further away than ``L1``, so is the reference point, and the gain stays the same: a circle is approached
along its tangent, a line at 45 degrees.

The turn to the next leg begins r tan(angle / 2) before the corner, plus the distance flown while rolling; r is the
turn radius at the ground speed and the allowed bank.  The speed is the present one or, if the wind is known, the mean
of the present one and that of the next leg.

Source: S. Park, J. Deyst, J. P. How, A New Nonlinear Guidance Logic for Trajectory Tracking, AIAA 2004-4900.
"""

import math
from dataclasses import dataclass

from autopilot.guidance import gps_age, heading_error, is_wind, unit
from autopilot.stabilise import shorter_way
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2


@dataclass(frozen=True, slots=True)
class RouteParams:
    """Following of circles and legs.

    lookahead_s : L1 in time of flight (s, default 3).  Higher: gentler, cuts corners; lower: weaves due to lags
    radius_share : largest L1 over the radius of a circle, below 2 (default 1.4).  Higher: gentler approach
    slowest_m_s : minimum ground speed in the law (m/s, default 5).  Higher: steers harder in strong wind; lower: hardly
    roll_s : time to roll into a turn (s, default 0.5).  Higher: turns begin earlier
    bank_share : share of the bank limit for planned turns, the rest is for corrections (default 0.9).  Higher: later,
        tighter turns, overshoots; lower: earlier, wider turns
    sharpest_rad : larger turn angles are planned as this one (rad, default 120 deg).  Higher: begins sharp turns very
        early; lower: overshoots sharp corners
    """

    lookahead_s: float = 3.0
    radius_share: float = 1.4
    slowest_m_s: float = 5.0
    roll_s: float = 0.5
    bank_share: float = 0.9
    sharpest_rad: float = math.radians(120.0)


@kernel
def position(row, s, g):  # type: ignore[no-untyped-def]
    """Present position (north, east) from the launch point, m, and ground speed, m/s; NaN without a usable fix.

    The receiver filters position and velocity with the same time constant T, so that ``p + T v`` is the unfiltered
    position at its time stamp, also in turns.  From there it is extrapolated with the present velocity: the reported
    one, rotated by the unseen turn and corrected for the filter, which shortens a vector turning at w by
    sqrt(1 + (w T)^2).

    row : measured   s : record with `unseen_turn_rad`   g : record of GuidanceParams
    """
    lag_s = gps_age(row, g)
    if not math.isfinite(lag_s):
        return math.nan, math.nan, math.nan
    turned = s.unseen_turn_rad
    longer = math.hypot(1.0, turned * g.gps_filter_s / max(lag_s, 1e-3))
    cosine, sine = longer * math.cos(turned), longer * math.sin(turned)
    north_m_s, east_m_s = row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]
    now_north_m_s, now_east_m_s = north_m_s * cosine - east_m_s * sine, north_m_s * sine + east_m_s * cosine
    age_s = lag_s - g.gps_filter_s
    north_m = row.gps_p_e_m[0] + g.gps_filter_s * north_m_s + age_s * now_north_m_s
    east_m = row.gps_p_e_m[1] + g.gps_filter_s * east_m_s + age_s * now_east_m_s
    return north_m, east_m, math.hypot(now_north_m_s, now_east_m_s)


@kernel
def bank_to_reach(north, east, aim_north, aim_east, speed_m_s, ahead_m, r_zy, limit_rad):  # type: ignore[no-untyped-def]
    """Bank demand, rad, positive right, from the direction of travel to the reference point (Eqn 1).

    Beyond 90 degrees it is as at 90: in the shorter direction, or near 180 degrees that of the present bank.

    north, east : direction of travel   aim_north, aim_east : direction of the point; (0, 0): straight on
    """
    sine, cosine = heading_error(north, east, aim_north, aim_east)
    side = shorter_way(sine, cosine, 0.5 * r_zy)
    return clip(math.atan(2.0 * speed_m_s * speed_m_s / (ahead_m * G_M_S2) * side), -limit_rad, limit_rad)


@kernel
def aim_at_circle(centre_north_m, centre_east_m, radius_m, left, ahead_m):  # type: ignore[no-untyped-def]
    """Direction (north, east) of the point of a circle at the distance `ahead_m`, further along.

    Outside beyond that distance, the tangent point; inside, the nearest point; at the centre (0, 0), straight on.

    centre_north_m, centre_east_m : relative to the aeroplane      left : circle flown to the left
    """
    distance_m = math.hypot(centre_north_m, centre_east_m)
    if distance_m < 1e-3:
        return 0.0, 0.0
    tangent_m = math.sqrt(max(distance_m * distance_m - radius_m * radius_m, 0.0))
    ahead_m = min(max(ahead_m, tangent_m, radius_m - distance_m), radius_m + distance_m)
    # Angle at the aeroplane in the triangle of aeroplane, centre and point, from its three sides.
    cosine = (ahead_m * ahead_m + distance_m * distance_m - radius_m * radius_m) / (2.0 * ahead_m * distance_m)
    cosine = clip(cosine, -1.0, 1.0)
    sine = math.sqrt(1.0 - cosine * cosine)
    if not left:  # in a right turn the centre is to the right of the point
        sine = -sine
    north, east = centre_north_m / distance_m, centre_east_m / distance_m
    return north * cosine - east * sine, north * sine + east * cosine


@kernel
def aim_at_line(along_north, along_east, right_of_it_m, ahead_m):  # type: ignore[no-untyped-def]
    """Direction (north, east) of the point of a line at the distance `ahead_m`, at most 45 degrees to the line.

    along_north, along_east : direction of the line   right_of_it_m : cross-track distance, positive right
    """
    ahead_m = max(ahead_m, math.sqrt(2.0) * abs(right_of_it_m))
    sine = -right_of_it_m / ahead_m
    cosine = math.sqrt(1.0 - sine * sine)
    return along_north * cosine - along_east * sine, along_north * sine + along_east * cosine


@kernel
def bank_to_circle(north, east, r_zy, row, s, limit_rad, centre_north_m, centre_east_m, radius_m, left, p, g):  # type: ignore[no-untyped-def]
    """Bank demand, rad, to reach and follow a circle; without a position, a circle at the present place.

    north, east : direction of travel   centre_north_m, centre_east_m : from the launch point
    p, g : records of RouteParams, GuidanceParams
    """
    north_m, east_m, speed_m_s = position(row, s, g)
    if not math.isfinite(speed_m_s):
        return clip(g.circling_bank_rad, -limit_rad, limit_rad)
    speed_m_s = max(speed_m_s, p.slowest_m_s)
    ahead_m = min(p.lookahead_s * speed_m_s, p.radius_share * radius_m)
    aim_north, aim_east = aim_at_circle(centre_north_m - north_m, centre_east_m - east_m, radius_m, left, ahead_m)
    return bank_to_reach(north, east, aim_north, aim_east, speed_m_s, ahead_m, r_zy, limit_rad)


@kernel
def speed_along(north, east, wind_e_m_s, airspeed_m_s):  # type: ignore[no-untyped-def]
    """Speed over the ground in a direction (north, east), m/s, by the wind triangle; NaN if the wind is unknown."""
    if not is_wind(wind_e_m_s, 2):
        return math.nan
    along_m_s = wind_e_m_s[0] * north + wind_e_m_s[1] * east
    across_m_s = wind_e_m_s[1] * north - wind_e_m_s[0] * east
    if not abs(across_m_s) < airspeed_m_s:
        return math.nan
    return along_m_s + math.sqrt(airspeed_m_s * airspeed_m_s - across_m_s * across_m_s)


@kernel
def begin_of_turn(speed_m_s, sine, cosine, limit_rad, p):  # type: ignore[no-untyped-def]
    """Distance before a corner at which the turn to the next leg begins, m: rolling plus r tan(angle / 2).

    sine, cosine : of the angle between the legs   limit_rad : bank allowed
    """
    radius_m = speed_m_s * speed_m_s / (G_M_S2 * math.tan(max(p.bank_share * limit_rad, 0.05)))
    half = 0.5 * min(math.atan2(abs(sine), cosine), p.sharpest_rad)
    return p.roll_s * speed_m_s + radius_m * math.tan(half)


@kernel
def leg_flown(north_m, east_m, height_m, setpoint, s):  # type: ignore[no-untyped-def]
    """Leg to the next waypoint: direction (north, east), length, remaining distance, cross-track distance, m.

    It starts at the previous waypoint, or if none has been reached in this mode, where the mode began.

    s : record with `next_waypoint`, `leg_from_m`, `on_leg`, updated
    """
    if not s.on_leg:
        s.on_leg = 1
        s.leg_from_m[0], s.leg_from_m[1], s.leg_from_m[2] = north_m, east_m, height_m
    to = setpoint.route[s.next_waypoint]
    leg_north_m, leg_east_m = to[0] - s.leg_from_m[0], to[1] - s.leg_from_m[1]
    left_north_m, left_east_m = to[0] - north_m, to[1] - east_m
    along_north, along_east = unit(leg_north_m, leg_east_m)
    if along_north == 0.0 and along_east == 0.0:  # leg of zero length: straight to the waypoint
        along_north, along_east = unit(left_north_m, left_east_m)
    left_m = left_north_m * along_north + left_east_m * along_east
    right_of_it_m = left_north_m * along_east - left_east_m * along_north
    return along_north, along_east, math.hypot(leg_north_m, leg_east_m), left_m, right_of_it_m


@kernel
def height_on_leg(length_m, left_m, setpoint, s):  # type: ignore[no-untyped-def]
    """Height on the straight line along the leg, m; that of the waypoint on a very short leg."""
    to_m = setpoint.route[s.next_waypoint][2]
    if not (length_m > 1.0 and math.isfinite(s.leg_from_m[2])):
        return to_m
    return to_m + (s.leg_from_m[2] - to_m) * clip(left_m / length_m, 0.0, 1.0)


@kernel
def bank_along_route(north, east, r_zy, wind_e_m_s, row, height_m, setpoint, s, limit_rad, p, g):  # type: ignore[no-untyped-def]
    """Bank demand, rad, and desired height, m, along the route; a single waypoint is circled.

    north, east : direction of travel   wind_e_m_s : shape (3,) or NaN   height_m : present   setpoint : its record
    s : record with the progress along the route, updated   p, g : records of RouteParams, GuidanceParams
    """
    if setpoint.n_waypoints == 1:
        only = setpoint.route[0]
        bank = bank_to_circle(
            north, east, r_zy, row, s, limit_rad, only[0], only[1], setpoint.radius_m, setpoint.left, p, g
        )
        return bank, only[2]
    north_m, east_m, speed_m_s = position(row, s, g)
    if not math.isfinite(speed_m_s):
        return clip(g.circling_bank_rad, -limit_rad, limit_rad), setpoint.route[s.next_waypoint][2]
    speed_m_s = max(speed_m_s, p.slowest_m_s)
    along_north, along_east, length_m, left_m, right_of_it_m = leg_flown(north_m, east_m, height_m, setpoint, s)
    to, then = setpoint.route[s.next_waypoint], setpoint.route[(s.next_waypoint + 1) % setpoint.n_waypoints]
    then_north, then_east = unit(then[0] - to[0], then[1] - to[1])
    sine, cosine = heading_error(along_north, along_east, then_north, then_east)
    then_m_s = speed_along(then_north, then_east, wind_e_m_s, s.true_factor * s.airspeed_wanted_m_s)
    mean_m_s = 0.5 * (speed_m_s + max(then_m_s, p.slowest_m_s)) if math.isfinite(then_m_s) else speed_m_s
    if left_m < begin_of_turn(mean_m_s, sine, cosine, limit_rad, p):
        s.leg_from_m[0], s.leg_from_m[1], s.leg_from_m[2] = to[0], to[1], to[2]
        s.next_waypoint = (s.next_waypoint + 1) % setpoint.n_waypoints
        along_north, along_east, length_m, left_m, right_of_it_m = leg_flown(north_m, east_m, height_m, setpoint, s)
    ahead_m = p.lookahead_s * speed_m_s
    aim_north, aim_east = aim_at_line(along_north, along_east, right_of_it_m, ahead_m)
    bank = bank_to_reach(north, east, aim_north, aim_east, speed_m_s, ahead_m, r_zy, limit_rad)
    return bank, height_on_leg(length_m, left_m, setpoint, s)
