"""Thermals against the report's equations worked by hand, and against the mass of air that goes up and down."""

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, optimize

from sim.air.thermal import WIDEST, area_of, bell, place, radius_m, updraft_m_s
from sim.rng import stream

ONE = np.zeros((1, 2))
STRENGTH_M_S, INVERSION_M = 2.0, 1200.0
AREA_M2 = area_of(1, INVERSION_M)


def updraft(r_m, height_m, places=ONE):
    return updraft_m_s(r_m, 0.0, height_m, places, STRENGTH_M_S, INVERSION_M, area_of(len(places), INVERSION_M))


def by_hand(height_m):
    """Outer radius, ratio of radii, mean updraft and that at the centre (equations 11 to 13)."""
    x = height_m / INVERSION_M
    r2 = max(10.0, 0.102 * x ** (1 / 3) * (1 - 0.25 * x) * INVERSION_M)
    r1 = r2 * min(0.8, 0.0011 * r2 + 0.14)
    mean = STRENGTH_M_S * x ** (1 / 3) * (1 - 1.1 * x)
    return r2, r1 / r2, mean, 3 * mean * (r2**3 - r2**2 * r1) / (r2**3 - r1**3)


@pytest.mark.parametrize("height_m", [5.0, 60.0, 200.0, 600.0, 1000.0])
def test_updraft_at_the_centre_is_that_of_the_report(height_m):
    """The shape is 1 at the centre within 3e-5: |k1 k3| to the power of k2."""
    assert updraft(0.0, height_m) == pytest.approx(by_hand(height_m)[3], rel=4e-5)


def test_updraft_at_60_m_is_1_7_m_s_and_45_m_wide():
    """A day of w* = 2 m/s below 1200 m, worked out by pocket calculator: 0.6963, 44.53, 0.189."""
    r2, ratio, mean, peak = by_hand(60.0)
    np.testing.assert_allclose((r2, ratio, mean, peak), (44.53, 0.1890, 0.6963, 1.7056), rtol=5e-4, atol=0)
    assert radius_m(60.0, INVERSION_M) == pytest.approx(r2, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.14, 0.2, 0.25, 0.36, 0.47, 0.58, 0.69, 0.8])
def test_bell_carries_as_much_air_as_the_trapezoid_that_it_smooths(ratio):
    """The constants were fitted to a trapezoid of revolution, flat to r1, nought at r2: the same mean, within 1 %.

    With k4 from the report's table the mean is 35 % too large at 0.14, with its parentheses 74 % too small at 0.8.
    """
    trapezoid = (1.0 - ratio**3) / (3.0 * (1.0 - ratio))
    found = integrate.quad(lambda r: 2.0 * r * bell(r, ratio), 0.0, 1.0, limit=200)[0]
    assert found == pytest.approx(trapezoid, rel=0.0115)  # largest: 1.01 % at 0.58


@pytest.mark.parametrize("ratio", [0.58, 0.69, 0.8])
def test_bell_of_a_wide_core_is_half_in_the_middle_of_the_flank(ratio):
    """As the trapezoid is, within 3 % of r2."""
    half = optimize.brentq(lambda r: bell(r, ratio) - 0.5, 0.5, 1.0)
    assert half == pytest.approx(0.5 * (1.0 + ratio), rel=0, abs=0.03)


@pytest.mark.parametrize("height_m", [60.0, 300.0, 550.0])
def test_updraft_crosses_zero_at_the_edge_of_the_column(height_m):
    """Rising within, sinking without; between 0.9 and 1.4 outer radii."""
    r2 = by_hand(height_m)[0]
    crossing = optimize.brentq(lambda r: updraft(r, height_m), 0.5 * r2, 2.0 * r2)
    assert 0.9 < crossing / r2 < 1.4
    assert updraft(0.5 * crossing, height_m) > 0.0 > updraft(1.2 * crossing, height_m)


@pytest.mark.parametrize("height_m", [60.0, 300.0, 600.0, 800.0])
@pytest.mark.parametrize("number", [1, 3])
def test_sink_between_brings_down_what_the_columns_take_up(height_m, number):
    """Far from all columns: sink x ground between = mean x area of the columns, less what falls at their edges.

    The ring from r2 to 2 r2 with (pi / 6) sin(pi r / r2) carries exactly the share 2.5 (z / z_i - 0.5) down.
    """
    places = np.array([[0.0, 0.0], [0.0, 600.0], [-600.0, 0.0]])[:number]
    r2, _, mean, _ = by_hand(height_m)
    share = max(0.0, 2.5 * (height_m / INVERSION_M - 0.5))
    up = number * math.pi * r2**2 * mean
    ring = integrate.quad(lambda r: 2.0 * math.pi * r * math.pi / 6.0 * math.sin(math.pi * r), 1.0, 2.0)[0]
    down = -share * number * mean * r2**2 * ring + -updraft(5.0 * r2, height_m, places) * (
        area_of(number, INVERSION_M) - number * math.pi * r2**2
    )
    assert down == pytest.approx(up, rel=1e-9)


def test_net_flow_over_the_ground_of_one_thermal_is_small():
    """The smooth shapes balance within 8 % of what goes up, at every height."""
    for height_m in (30.0, 60.0, 120.0, 300.0, 600.0, 800.0):
        r2, _, mean, _ = by_hand(height_m)
        parts = (0.0, r2, 2.0 * r2, math.sqrt(AREA_M2 / math.pi))
        net = sum(
            integrate.quad(lambda r, h=height_m: 2.0 * math.pi * r * updraft(r, h), a, b, limit=200)[0]
            for a, b in itertools.pairwise(parts)
        )
        assert abs(net) < 0.08 * math.pi * r2**2 * mean


def test_updraft_on_the_ground_and_above_the_inversion_is_none():
    """Air neither comes out of the ground nor breaks through the lid."""
    for height_m in (-1.0, 0.0, 1200.0 * 10.0 / 11.0, 1200.0, 3000.0):
        assert updraft(0.0, height_m) == 0.0
        assert updraft(500.0, height_m) == 0.0
    assert updraft_m_s(0.0, 0.0, 60.0, np.zeros((0, 2)), STRENGTH_M_S, INVERSION_M, 0.0) == 0.0


def test_updraft_has_no_step_below_nine_tenths_of_the_inversion():
    """Along the radius and with height, over 0.1 m: no change beyond a steep flank's 0.1 m/s per metre."""
    r = np.arange(0.0, 300.0, 0.1)
    for height_m in (20.0, 60.0, 300.0, 700.0):
        along = np.array([updraft(float(x), height_m) for x in r])
        assert np.abs(np.diff(along)).max() < 0.1 * 0.1
    for r_m in (0.0, 20.0, 45.0):
        up = np.array([updraft(r_m, float(h)) for h in np.arange(1.0, 1070.0, 0.1)])
        assert np.abs(np.diff(up)).max() < 0.1 * 0.2


@pytest.mark.parametrize("number", [1, 3, 20])
def test_thermals_are_placed_by_seed_apart_and_around_the_launch_point(number):
    """Same seed, same places; no column touches another; all of them on their share of ground."""
    places = place(number, INVERSION_M, stream(4, 0, "thermals"))
    assert places == place(number, INVERSION_M, stream(4, 0, "thermals"))
    assert places != place(number, INVERSION_M, stream(5, 0, "thermals"))
    p = np.array(places)
    assert p.shape == (number, 2)
    assert np.abs(p).max() <= 0.5 * math.sqrt(area_of(number, INVERSION_M))
    gaps = np.linalg.norm(p[:, None] - p[None], axis=2)[~np.eye(number, dtype=bool)]
    assert (gaps >= 2.0 * WIDEST * INVERSION_M).all()


def test_widest_radius_is_never_exceeded():
    """The bound by which thermals are kept apart."""
    heights = np.linspace(0.0, INVERSION_M, 1000)
    assert max(radius_m(float(h), INVERSION_M) for h in heights) <= WIDEST * INVERSION_M
