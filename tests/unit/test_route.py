"""Circles and legs: the guidance law against closed forms, and flown by a point with a bank that lags."""

import math
from dataclasses import astuple
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.airframes import AutopilotParams
from autopilot.dcm import _PARAMS, _SETPOINT, _STATE, _write
from autopilot.energy import EnergyParams
from autopilot.guidance import GuidanceParams, gps_age, unseen_turn
from autopilot.interface import Mode, Setpoint, Waypoint
from autopilot.route import (
    RouteParams,
    aim_at_circle,
    aim_at_line,
    bank_along_route,
    bank_to_circle,
    bank_to_reach,
    begin_of_turn,
    height_on_leg,
    leg_flown,
    position,
    speed_along,
)
from estimator.interface import MEASURED_DTYPE

G, V, DT_S, LATENCY_S = 9.80665, EnergyParams().airspeed_m_s, 0.02, 0.3
LIMIT_RAD = math.radians(35.0)
SQUARE = (Waypoint(250, 0, 60), Waypoint(250, 250, 60), Waypoint(0, 250, 60), Waypoint(0, 0, 60))
angle = st.floats(-math.pi, math.pi)
CALM, UNKNOWN = 0j, np.full(3, np.nan)


def records(route=None):
    """Records of RouteParams and GuidanceParams, and a state."""
    params, whole = np.zeros(1, _PARAMS)[0], AutopilotParams(route=route or RouteParams())
    for name in ("route", "guidance"):
        params[name] = astuple(getattr(whole, name))
    s = np.zeros(1, _STATE)[0]
    s["airspeed_m_s"] = s["airspeed_wanted_m_s"] = V
    s["true_factor"] = 1.0
    return params["route"], params["guidance"], s


def asked_of(setpoint):
    asked = np.zeros(1, _SETPOINT)
    _write(setpoint, asked[0])
    return asked[0]


class Receiver:
    """A GPS with a first-order filter of 1 s on position and velocity, 0.3 s late, 4 fixes a second; no noise."""

    def __init__(self, at, v):
        self.at, self.v = at - v, v  # the filter has been running for long
        self.past = [(self.at, self.v)] * round(LATENCY_S / DT_S)
        self.row = np.zeros(1, MEASURED_DTYPE)[0]
        self.row["gps_valid"], self.ticks = 1, 0

    def report(self, at, v):
        keep = math.exp(-DT_S)
        self.at, self.v = at + (self.at - at) * keep, v + (self.v - v) * keep
        self.past.append((self.at, self.v))
        then = self.past.pop(0)
        self.row["t_s"] = t_s = self.ticks * DT_S
        if self.ticks % 12 == 0:
            self.row["gps_t_s"] = t_s - LATENCY_S
            self.row["gps_p_e_m"] = then[0].real, then[0].imag, -60.0
            self.row["gps_v_e_m_s"] = then[1].real, then[1].imag, 0.0
        self.ticks += 1
        return self.row


def turned(bank):
    """Attitude that points north with that bank: only its third row counts."""
    return np.array([[1.0, 0.0, 0.0], [0.0, math.cos(bank), -math.sin(bank)], [0.0, math.sin(bank), math.cos(bank)]])


def flown(setpoint, seconds, *, start=0j, heading=0.0, wind=CALM, route=None, wind_known=False):
    """Positions (north + i east), banks and waypoints due of a point at cruise whose bank lags by 0.4 s."""
    p, g, s = records(route)
    asked, at, bank, path = asked_of(setpoint), complex(start), 0.0, []
    wind_e_m_s = np.array([wind.real, wind.imag, 0.0]) if wind_known else UNKNOWN
    receiver = Receiver(at, V * np.exp(1j * heading) + wind)
    for _ in range(round(seconds / DT_S)):
        v = V * complex(math.cos(heading), math.sin(heading)) + wind
        row, turn, r_zy = receiver.report(at, v), G / V * math.tan(bank), math.sin(bank)
        omega = turn * np.array([0.0, r_zy, math.cos(bank)])
        s["unseen_turn_rad"] = unseen_turn(s["unseen_turn_rad"], turned(bank), omega, gps_age(row, g), DT_S)
        north, east = v.real / abs(v), v.imag / abs(v)
        if setpoint.mode == Mode.LOITER:
            wanted = bank_to_circle(
                north, east, r_zy, row, s, LIMIT_RAD, setpoint.north_m, setpoint.east_m, setpoint.radius_m,
                setpoint.left, p, g,
            )  # fmt: skip
        else:
            wanted, _ = bank_along_route(north, east, r_zy, wind_e_m_s, row, 60.0, asked, s, LIMIT_RAD, p, g)
        bank += (wanted - bank) * DT_S / 0.4
        heading += turn * DT_S
        at += v * DT_S
        path.append((at, bank, int(s["next_waypoint"])))
    at, bank, due = (np.array(x) for x in zip(*path, strict=True))
    return at, bank, due


@given(radius=st.floats(10.0, 500.0), share=st.floats(0.05, 1.9), course=angle, left=st.booleans())
def test_circle_being_flown_asks_for_the_bank_that_it_needs(radius, share, course, left):
    """On the circle, along it: a = V^2 / r exactly, whatever the distance of the reference point."""
    along = complex(math.cos(course), math.sin(course))
    to_centre = radius * along * (-1j if left else 1j)
    ahead = share * radius
    aim = aim_at_circle(to_centre.real, to_centre.imag, radius, left, ahead)
    bank = bank_to_reach(along.real, along.imag, *aim, V, ahead, 0.0, math.pi / 2)
    # Beyond 90 degrees the law saturates, sin(eta) = L1 / 2r is then no longer asked.
    needed = math.atan(V**2 / (G * radius)) * (-1.0 if left else 1.0)
    # 2 V^2 / g L1 is 60 at most, L1 half a metre: so many times the eps of the sine of the angle to the aim.
    np.testing.assert_allclose(bank, needed, rtol=0, atol=1e-12)


@given(
    distance=st.floats(1.0, 1000.0), bearing=angle, radius=st.floats(10.0, 500.0), left=st.booleans(),
    ahead=st.floats(1.0, 60.0),
)  # fmt: skip
def test_aim_at_circle_is_a_point_of_the_circle_further_round(distance, bearing, radius, left, ahead):
    """Some way along the aim lies the circle; outside of it and far, the aim is its tangent in the right sense."""
    centre = distance * np.exp(1j * bearing)
    north, east = aim_at_circle(centre.real, centre.imag, radius, left, ahead)
    aim = complex(north, east)
    np.testing.assert_allclose(abs(aim), 1.0, rtol=0, atol=1e-12)
    side = (centre / aim).imag  # of the centre, to the right of the line flown
    assert abs(side) <= radius + 1e-9  # as below
    if abs(side) > 1e-9:
        assert (side < 0.0) == left
    if distance > radius + ahead + 1.0:
        np.testing.assert_allclose(abs(side), radius, rtol=0, atol=1e-9)  # some eps of 1000 m, a thousand times


@given(course=angle, right_of_it=st.floats(-500.0, 500.0), ahead=st.floats(5.0, 80.0))
def test_aim_at_line_is_a_point_of_the_line_met_at_45_degrees_at_most(course, right_of_it, ahead):
    """Off to the right the aim is to the left of the line, by the sine of the distance over the way ahead."""
    along = complex(math.cos(course), math.sin(course))
    aim = complex(*aim_at_line(along.real, along.imag, right_of_it, ahead)) / along
    np.testing.assert_allclose(abs(aim), 1.0, rtol=0, atol=1e-12)
    expected = max(-math.sqrt(0.5), min(math.sqrt(0.5), -right_of_it / ahead))
    np.testing.assert_allclose(aim.imag, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("sine", "cosine", "side"), [(0.1, -0.99, 1.0), (-0.1, -0.99, -1.0)])
def test_bank_to_reach_behind_is_full_the_shorter_way(sine, cosine, side):
    """More than 90 degrees away the acceleration is that of 90; nearly dead astern, the side leant to already."""
    full = math.atan(2.0 * V**2 / (40.0 * G))
    assert bank_to_reach(1.0, 0.0, cosine, sine, V, 40.0, 0.0, 1.5) == pytest.approx(side * full, rel=0, abs=1e-12)
    leaning = bank_to_reach(1.0, 0.0, cosine, sine, V, 40.0, -side * 0.5, 1.5)
    assert leaning == pytest.approx(-side * full, rel=0, abs=1e-12)


def test_position_in_a_steady_turn_is_where_the_aeroplane_is():
    """Filter and latency undone in a circle of 40 m: within 0.5 m, where 1.3 s are 16 m of way."""
    _, g, s = records()
    w, p = V / 40.0, 40.0 * np.exp(1j * 0.0)
    receiver = Receiver(p, V * 1j)
    off, speeds = [], []
    for k in range(1000):
        p = 40.0 * np.exp(1j * w * k * DT_S)
        row = receiver.report(p, V * 1j * p / 40.0)
        s["unseen_turn_rad"] = unseen_turn(s["unseen_turn_rad"], np.eye(3), np.array([0, 0, w]), gps_age(row, g), DT_S)
        north, east, speed = position(row, s, g)
        off.append(abs(complex(north, east) - p))
        speeds.append(speed)
    assert max(off[500:]) < 0.5
    np.testing.assert_allclose(speeds[500:], V, rtol=0.02, atol=0)


def test_position_without_a_fix_is_not_a_number():
    """Nobody knows."""
    _, g, s = records()
    assert all(math.isnan(x) for x in position(np.zeros(1, MEASURED_DTYPE)[0], s, g))


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize(
    ("start", "heading"), [(200, 0.0), (0, 1.0), (60, math.pi), (-40j, 2.0), (300j, math.pi / 2), (-70, 0.0)]
)
def test_loiter_from_anywhere_ends_on_the_circle(left, start, heading):
    """60 m round a point, in calm air: within 1 m after a minute, the right way round, never past the bank limit."""
    setpoint = Setpoint(Mode.LOITER, north_m=20.0, east_m=-30.0, radius_m=60.0, left=left)
    centre = complex(20.0, -30.0)
    at, bank, _ = flown(setpoint, 90.0, start=centre + start, heading=heading)
    late = at[3000:] - centre
    np.testing.assert_allclose(abs(late), 60.0, rtol=0, atol=1.0)
    way_round = np.diff(np.unwrap(np.angle(late)))
    assert np.all(way_round < 0.0 if left else way_round > 0.0)
    assert abs(bank).max() <= LIMIT_RAD + 1e-9


@pytest.mark.parametrize("from_deg", [0, 90, 225])
@pytest.mark.parametrize("left", [False, True])
def test_loiter_in_wind_keeps_the_circle(from_deg, left):
    """5 m/s, 40 % of the airspeed: the bank breathes with the ground speed, the circle stays within 7 m."""
    wind = -5.0 * np.exp(1j * math.radians(from_deg))
    at, bank, _ = flown(Setpoint(Mode.LOITER, radius_m=60.0, left=left), 120.0, start=150, wind=wind)
    np.testing.assert_allclose(abs(at[3000:]), 60.0, rtol=0, atol=7.0)
    steep, flat = np.degrees([abs(bank[3000:]).max(), abs(bank[3000:]).min()])
    assert steep > 20.0  # g tan(bank) = 17.6^2 / 60 is 28 degrees, and 7.6^2 / 60 is 6
    assert flat < 10.0


def test_loiter_without_position_circles_gently():
    """Straight on would be away."""
    p, g, s = records()
    nothing = np.zeros(1, MEASURED_DTYPE)[0]
    bank = bank_to_circle(1.0, 0.0, 0.0, nothing, s, LIMIT_RAD, 0.0, 0.0, 60.0, False, p, g)
    assert bank == GuidanceParams().circling_bank_rad


def side_of_legs(at, due, route):
    """Distance to the right of the leg flown, shape (n,)."""
    side = np.zeros(len(at))
    points = [complex(w.north_m, w.east_m) for w in route]
    for i, end in enumerate(points):
        along = (end - points[i - 1]) / abs(end - points[i - 1])
        side[due == i] = ((at[due == i] - points[i - 1]) / along).imag
    return side


def overshoots(at, due, route):
    """Of all legs but the first, turned to by the right: the most that is flown to the left of one, the outside of
    the turn, and the largest distance from one at its end."""
    side, begins = side_of_legs(at, due, route), np.flatnonzero(np.diff(due)) + 1
    legs = [side[a:b] for a, b in pairwise(begins)]
    return max(-leg.min() for leg in legs), max(abs(leg[-1]) for leg in legs)


def test_leg_joined_from_the_side_converges_as_the_law_says():
    """Small errors obey e'' + 2/T e' + 2/T^2 e = 0 with T = L1 / V: here with a bank that lags, within 0.6 m of 5."""
    far = (Waypoint(5000, 0, 60), Waypoint(5000, 500, 60))
    p = RouteParams()
    params, g, s = records()
    asked = asked_of(Setpoint(Mode.WAYPOINTS, route=far))
    s["on_leg"], at, heading, bank, path = 1, 5j, 0.0, 0.0, []  # on a leg from the launch point
    receiver = Receiver(at, complex(V))
    for _ in range(600):
        v = V * np.exp(1j * heading)
        row, turn = receiver.report(at, v), G / V * math.tan(bank)
        omega = turn * np.array([0.0, math.sin(bank), math.cos(bank)])
        s["unseen_turn_rad"] = unseen_turn(s["unseen_turn_rad"], turned(bank), omega, gps_age(row, g), DT_S)
        wanted, _ = bank_along_route(
            v.real / V, v.imag / V, math.sin(bank), UNKNOWN, row, 60.0, asked, s, LIMIT_RAD, params, g
        )
        bank += (wanted - bank) * DT_S / 0.1
        heading, at = heading + turn * DT_S, at + v * DT_S
        path.append(at.imag)
    t = (np.arange(600) + 1) * DT_S / p.lookahead_s
    np.testing.assert_allclose(path, 5.0 * np.exp(-t) * (np.cos(t) + np.sin(t)), rtol=0, atol=0.6)


def test_waypoints_turns_are_anticipated_and_joined_without_overshoot():
    """A square in calm air: each leg is joined within 5 m, 2 % of a leg, and left within 1 m of it."""
    at, bank, due = flown(Setpoint(Mode.WAYPOINTS, route=SQUARE), 150.0)
    most, at_end = overshoots(at, due, SQUARE)
    assert list(dict.fromkeys(due)) == [0, 1, 2, 3]
    assert due[-1] in (1, 2, 3)  # on its second round
    assert most < 5.0
    assert at_end < 1.0
    assert abs(bank).max() <= LIMIT_RAD + 1e-9


def test_waypoints_turns_begun_at_the_corner_overshoot():
    """Without anticipation the radius of the turn, 23 m, is overshot nearly whole: what the test above can tell."""
    late = RouteParams(roll_s=0.0, sharpest_rad=0.0)
    at, _, due = flown(Setpoint(Mode.WAYPOINTS, route=SQUARE), 100.0, route=late)
    assert overshoots(at, due, SQUARE)[0] > 15.0


@pytest.mark.parametrize(("wind_known", "most_m"), [(False, 14.0), (True, 10.0)])
def test_waypoints_in_wind_are_joined_within_a_tenth_of_a_leg(wind_known, most_m):
    """4.5 m/s: the turn from across the wind to before it widens as it goes on; a known wind tells so before."""
    at, _, due = flown(Setpoint(Mode.WAYPOINTS, route=SQUARE), 170.0, wind=4.5 + 0j, wind_known=wind_known)
    most, at_end = overshoots(at, due, SQUARE)
    assert most < most_m
    assert at_end < 2.0


@pytest.mark.parametrize("degrees", [30.0, 90.0, 119.0])
def test_begin_of_turn_is_the_tangent_of_half_the_angle(degrees):
    """The arc of radius V^2 / (g tan(bank)) touches both legs at r tan(angle / 2) from the corner."""
    p = records()[0]
    theta, bank = math.radians(degrees), RouteParams().bank_share * LIMIT_RAD
    expected = RouteParams().roll_s * V + V**2 / (G * math.tan(bank)) * math.tan(theta / 2.0)
    for side in (1.0, -1.0):
        found = begin_of_turn(V, side * math.sin(theta), math.cos(theta), LIMIT_RAD, p)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0)


def test_begin_of_turn_back_the_way_it_came_is_finite():
    """The tangent of 90 degrees is not waited for."""
    p = records()[0]
    sharpest = begin_of_turn(V, 0.0, -1.0, LIMIT_RAD, p)
    assert sharpest == begin_of_turn(V, math.sin(math.radians(120.0)), -0.5, LIMIT_RAD, p)
    assert sharpest < 60.0


@given(course=angle, blows_to=angle, speed=st.floats(0.0, 9.0))
def test_speed_along_is_the_wind_triangle(course, blows_to, speed):
    """Minus the wind, it is the airspeed."""
    wind = speed * np.array([math.cos(blows_to), math.sin(blows_to), 0.0])
    along = np.array([math.cos(course), math.sin(course), 0.0])
    over_ground = speed_along(along[0], along[1], wind, V)
    np.testing.assert_allclose(np.linalg.norm(over_ground * along - wind), V, rtol=0, atol=1e-9)
    assert math.isnan(speed_along(along[0], along[1], UNKNOWN, V))


def test_height_on_leg_is_interpolated_along_it():
    """Half way from 60 m to 100 m it is 80 m; before its beginning and behind its end as there."""
    asked = asked_of(Setpoint(Mode.WAYPOINTS, route=(Waypoint(200, 0, 100), Waypoint(0, 200, 60))))
    _, _, s = records()
    _, _, length, left, off = leg_flown(0.0, 0.0, 60.0, asked, s)
    assert (length, left, off) == (200.0, 200.0, 0.0)
    for north, expected in ((-10.0, 60.0), (0.0, 60.0), (100.0, 80.0), (200.0, 100.0), (230.0, 100.0)):
        _, _, length, left, _ = leg_flown(north, 3.0, 0.0, asked, s)
        np.testing.assert_allclose(height_on_leg(length, left, asked, s), expected, rtol=0, atol=1e-9)


def test_leg_flown_to_the_right_is_positive():
    """Northward, 7 m to the east; eastward, 7 m to the south."""
    for way, here in (((200, 0), (50.0, 7.0)), ((0, 200), (-7.0, 50.0))):
        asked = asked_of(Setpoint(Mode.WAYPOINTS, route=(Waypoint(*way, 60), Waypoint(9, 9, 60))))
        _, _, s = records()
        leg_flown(0.0, 0.0, 60.0, asked, s)
        assert leg_flown(*here, 60.0, asked, s)[3:] == (150.0, 7.0)


def test_single_waypoint_is_circled_at_its_height():
    """The same bank as a loiter about it with the radius of the set-point."""
    p, g, s = records()
    only = asked_of(Setpoint(Mode.WAYPOINTS, route=(Waypoint(40, 50, 77),), radius_m=45.0, left=True))
    row = Receiver(0j, complex(V)).report(0j, complex(V))
    bank, height = bank_along_route(1.0, 0.0, 0.0, UNKNOWN, row, 60.0, only, s, LIMIT_RAD, p, g)
    assert bank == bank_to_circle(1.0, 0.0, 0.0, row, s, LIMIT_RAD, 40.0, 50.0, 45.0, True, p, g)
    assert height == 77.0


def test_waypoint_given_twice_and_route_back_and_forth_are_flown_on():
    """A leg of no length and turns of 180 degrees: the route goes on and on, and nothing is not a number."""
    route = (Waypoint(200, 0, 60), Waypoint(200, 0, 60), Waypoint(0, 0, 60))
    at, bank, due = flown(Setpoint(Mode.WAYPOINTS, route=route), 120.0)
    assert np.isfinite(at).all()
    assert np.isfinite(bank).all()
    assert np.count_nonzero(np.diff(due)) >= 6
