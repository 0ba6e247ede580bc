"""Mean wind with height, gusts, and what a flight's air is made of, against closed forms along a prescribed path."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.air import Air, Gust, MovingAir, Thermals
from sim.log import TRUTH_DTYPE

DT_S, RELEASE_S = 0.02, 3.0
GUSTS = (Gust((3.0, -1.0, 0.5), 2.0, 1.5), Gust((0.0, 0.0, -2.0), 3.0, 4.0))


def blown(air, n_ticks=500, seed=0, flight=0, p_e_m=(10.0, 20.0, -40.0), airspeed_m_s=12.0):
    """What blows in each tick at a fixed place, shape (n, 6)."""
    truth = np.zeros(n_ticks, TRUTH_DTYPE)
    truth["p_e_m"], truth["airspeed_m_s"] = p_e_m, airspeed_m_s
    moving = MovingAir(air, 1.7, DT_S, RELEASE_S, seed, flight)
    moving.start(n_ticks, p_e_m)
    return np.array([moving.blow(truth, k) for k in range(n_ticks)])


@pytest.mark.parametrize("shear", [0.0, 0.14, 0.33])
@pytest.mark.parametrize("height_m", [0.0, 1.7, 10.0, 60.0, 300.0])
def test_wind_grows_with_height_by_the_power_law(shear, height_m):
    """W(h) = W10 (h / 10 m)^shear, the direction everywhere that at 10 m."""
    expected = np.array([3.0, -4.0, 0.0]) * ((height_m / 10.0) ** shear if shear else 1.0)
    air = Air((3.0, -4.0, 0.0), shear=shear, gusts=(Gust((0.0, 0.0, 1.0), 1e4, 1.0),))  # a gust that never comes
    np.testing.assert_allclose(air.mean_wind_e_m_s(height_m), expected, rtol=1e-14, atol=0)
    np.testing.assert_allclose(blown(air, 2, p_e_m=(0.0, 0.0, -height_m))[:, :3], [expected] * 2, rtol=1e-14, atol=0)


def test_wind_below_the_ground_is_that_on_the_ground():
    """A contact point may dip into the ground: no root of a negative height."""
    assert not Air((3.0, 0.0, 0.0), shear=0.14).mean_wind_e_m_s(-0.5).any()


def test_gust_has_exactly_its_shape_from_calm_to_calm():
    """Half the peak times 1 - cos, at the end of each tick, on time since the release; two gusts add up."""
    rows = blown(Air((1.0, 0.0, 0.0), gusts=GUSTS))
    t_s = (np.arange(len(rows)) + 1) * DT_S - RELEASE_S
    expected = np.tile([1.0, 0.0, 0.0], (len(rows), 1))
    for gust in GUSTS:
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (t_s - gust.start_s) / gust.length_s)
        share[(t_s < gust.start_s) | (t_s > gust.start_s + gust.length_s)] = 0.0
        expected += share[:, None] * gust.peak_e_m_s
    np.testing.assert_allclose(rows[:, :3], expected, rtol=0, atol=1e-12)
    assert not rows[:, 3:].any()
    peak = int(np.argmax(rows[:, 0]))
    assert t_s[peak] == pytest.approx(2.0 + 0.75, rel=0, abs=DT_S)
    assert rows[peak, 0] == pytest.approx(4.0, rel=0, abs=3.0 * (np.pi * DT_S / 2.0 / 1.5) ** 2)


def test_air_same_seed_is_bit_equal_and_another_seed_or_flight_is_not():
    """Turbulence is decided by seed and flight number, and by nothing else."""
    air = Air((4.0, 3.0, 0.0), 6.0)
    first = blown(air, seed=3)
    assert blown(air, seed=3).tobytes() == first.tobytes()
    for other in (blown(air, seed=4), blown(air, seed=3, flight=1)):
        assert (other != first).all()


def test_air_started_again_is_that_of_a_new_one():
    """Nothing is left of the flight before."""
    truth = np.zeros(50, TRUTH_DTYPE)
    truth["p_e_m"], truth["airspeed_m_s"] = (0.0, 0.0, -30.0), 9.0
    moving, flights = MovingAir(Air((4.0, 3.0, 0.0), 6.0), 1.7, DT_S, RELEASE_S, 1), []
    for _ in range(2):
        moving.start(50, (0.0, 0.0, -30.0))
        flights.append([moving.now, *(moving.blow(truth, k) for k in range(50))])
    assert flights[0] == flights[1]


def test_a_longer_flight_begins_as_the_shorter_one():
    """The noise of a tick does not depend on how many ticks are planned."""
    air = Air((4.0, 3.0, 0.0), 6.0)
    assert blown(air, 500)[:100].tobytes() == blown(air, 100).tobytes()


def test_gusts_and_thermals_change_no_number_of_the_turbulence():
    """They draw nothing: on the same path the difference is theirs alone, to the last digits of the sum."""
    plain = Air((4.0, 3.0, 0.0), 6.0)
    thermals = Thermals(((0.0, 0.0),))
    more = Air((4.0, 3.0, 0.0), 6.0, gusts=GUSTS, thermals=thermals)
    theirs = blown(Air(gusts=GUSTS, thermals=thermals))
    difference = blown(more) - blown(plain)
    np.testing.assert_allclose(difference, theirs, rtol=0, atol=1e-13)
    assert np.abs(theirs[:, 2]).max() > 1.0
    assert (blown(more)[:, 3:] == blown(plain)[:, 3:]).all()


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 50.0), st.floats(0.0, 400.0), st.floats(0.0, 60.0))
def test_air_anywhere_is_finite(seed, w20, height_m, airspeed_m_s):
    """On the ground, high up, standing and fast, in any strength."""
    air = Air((-9.0, 2.0, 0.0), w20, 0.2, GUSTS, Thermals(((0.0, 0.0),)))
    assert np.isfinite(blown(air, 5, seed, 0, (0.0, 0.0, -height_m), airspeed_m_s)).all()


@pytest.mark.parametrize(
    ("steady", "air"),
    [
        (True, Air()),
        (True, Air((5.0, 0.0, 0.0))),
        (True, Air(shear=0.14)),
        (False, Air((5.0, 0.0, 0.0), shear=0.14)),
        (False, Air(turbulence_w20_m_s=1.0)),
        (False, Air(gusts=GUSTS)),
        (False, Air(thermals=Thermals(((0.0, 0.0),)))),
    ],
)
def test_air_is_steady_where_it_blows_the_same_everywhere_and_always(steady, air):
    """A shear of no wind is none."""
    assert air.is_steady is steady


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Air((80.0, 0.0, 0.0)), "within .*50 m/s"),
        (lambda: Air(turbulence_w20_m_s=-1.0), "turbulence -1.0 m/s"),
        (lambda: Air(turbulence_w20_m_s=math.nan), "turbulence nan m/s"),
        (lambda: Air(shear=-0.1), "shear -0.1: choose an exponent"),
        (lambda: Gust((99.0, 0.0, 0.0), 1.0, 1.0), "gust of .* m/s"),
        (lambda: Gust((1.0, 0.0, 0.0), math.nan, 1.0), "start_s = nan s"),
        (lambda: Gust((1.0, 0.0, 0.0), 1.0, 0.0), "length_s = 0.0 s: must be above 0 s"),
        (lambda: Thermals(((0.0, math.nan),)), "places_e_m"),
        (lambda: Thermals(((0.0, 0.0),) * 21), "at most 20"),
        (lambda: Thermals(strength_m_s=-1.0), "strength_m_s = -1.0 m/s"),
        (lambda: Thermals(inversion_m=10.0), "inversion_m = 10.0 m"),
    ],
)
def test_air_that_cannot_be_is_refused_naming_field_and_value(make, words):
    """One line: the field, its value, what would be right."""
    with pytest.raises(ValueError, match=words) as refused:
        make()
    assert "\n" not in str(refused.value)
