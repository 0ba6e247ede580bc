"""How a route was flown, against routes drawn by hand."""

from itertools import pairwise

import numpy as np
import pytest

from autopilot.interface import Waypoint
from scenarios.harness.metrics import over, rms
from scenarios.harness.metrics.routes import height_missing_m, off_route_m, reached, waypoints_reached
from sim.log import Flight, Log, Outcome, Phase

SQUARE = (Waypoint(200, 0, 60), Waypoint(200, 200, 100), Waypoint(0, 200, 60), Waypoint(0, 0, 60))


def flight_of(north, east, height):
    """A flight along given positions, a metre a tick or so."""
    n = len(north)
    log = Log.empty(n)
    log.truth["t_s"] = 0.02 * np.arange(1, n + 1)
    log.truth["phase"] = Phase.FLYING
    log.truth["p_e_m"] = np.column_stack((north, east, -np.asarray(height)))
    manifest = {"config": {"duration_s": n * 0.02}}
    return Flight(log, 0.02, 0.0, Outcome.COMPLETED, "course", manifest=manifest)


def along(*corners, offset=0.0, up=0.0):
    """Positions along straight lines between corners, 200 points each, moved to the east and up."""
    points = [np.linspace(a, b, 200, endpoint=False) for a, b in pairwise(corners)]
    north, east, height = np.vstack([*points, corners[-1]]).T
    return flight_of(north, east + offset, height + up)


LAPPED = [(0, 0, 60), *SQUARE, *SQUARE]


def test_route_flown_exactly_is_never_off_it_and_reaches_every_waypoint():
    """Twice round: eight waypoints, no distance from the legs, no height missing."""
    flight = along(*LAPPED)
    assert waypoints_reached(SQUARE)(flight).value == 8
    np.testing.assert_allclose(off_route_m(SQUARE)(flight).value, 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(height_missing_m(SQUARE)(flight).value, 0.0, rtol=0, atol=1e-9)


def test_route_flown_beside_is_off_by_as_much_and_too_low_counts_as_height_missing():
    """10 m east and 5 m low: 10 m off the legs that lead north or south, on the others."""
    flight = along(*LAPPED, offset=10.0, up=-5.0)
    off = off_route_m(SQUARE)(flight).value
    np.testing.assert_allclose(off[50:150], 10.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(off[250:350], 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(height_missing_m(SQUARE)(flight).value[50:150], 5.0, rtol=0, atol=1e-9)
    assert over(off_route_m(SQUARE), rms)(flight).complete


def test_route_flown_the_other_way_round_reaches_none_in_order():
    """A waypoint counts only if it is the next one."""
    backwards = along((0, 0, 60), (0, 200, 60), (200, 200, 100), (150, 200, 100))
    assert waypoints_reached(SQUARE)(backwards).value == 0
    assert off_route_m(SQUARE)(backwards).value.max() > 150.0


@pytest.mark.parametrize(("near_m", "count"), [(30.0, 3), (20.0, 0)])
def test_waypoint_passed_at_a_distance_counts_within_it(near_m, count):
    """The square with its corners cut by 25 m."""
    inside = np.sqrt(0.5) * 25.0
    ring = [(200 - inside, inside), (200 - inside, 200 - inside), (inside, 200 - inside), (inside + 50.0, 100.0)]
    flight = along((100.0, inside, 60.0), *((n, e, 60.0) for n, e in ring))
    assert waypoints_reached(SQUARE, near_m)(flight).value == count


def test_reached_of_a_flight_that_never_flew_is_empty():
    """No waypoint is reached, and nothing raises."""
    assert len(reached(np.zeros((0, 3)), SQUARE)) == 0
    assert np.isnan(waypoints_reached(SQUARE)(flight_of([], [], [])).value)


@pytest.mark.parametrize("route", [SQUARE[:1], (*SQUARE, Waypoint(10, 0, 60))])
def test_reached_route_whose_waypoints_overlap_is_refused(route):
    """With one waypoint, or two within reach of one place, counting would never end."""
    with pytest.raises(ValueError, match=r"must be more than 60 m"):
        reached(np.zeros((10, 3)), route)
