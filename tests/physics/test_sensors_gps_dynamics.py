"""How a GPS receiver follows motion: steps, latency to the tick up to 20 s, turns, static navigation, smoothing."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.signal import lfilter

from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import SteadyTurn, motion_rows
from sim.sensors.gps import GpsParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

IDEAL = SUITES["ideal"].gps
DT_S = 0.02


def flown(params, v_e_m_s, p_e_m, rates):
    """Measured rows of a flight with these velocities and positions, shape (n, 3)."""
    log = Log.empty(len(v_e_m_s))
    log.truth["t_s"] = np.arange(1, len(log) + 1) * rates.dt_s
    log.truth["v_e_m_s"], log.truth["p_e_m"] = v_e_m_s, p_e_m
    suite = Suite(SuiteParams(gps=params), rates, 0)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log.measured


def straight(v_e_m_s):
    """Positions at the ends of ticks under velocities that are linear within each tick."""
    before = np.vstack([v_e_m_s[:1], v_e_m_s[:-1]])
    return np.cumsum(0.5 * (before + v_e_m_s), axis=0) * DT_S


@pytest.mark.parametrize("gps_hz", [1, 5, 10])
@pytest.mark.parametrize("latency_s", ["0.2", "0.25", "1", "3.33", "12", "20"])
def test_gps_step_response_arrives_to_the_tick_with_its_exact_value(gps_hz, latency_s):
    """A velocity step through a filter of 1 s: every held value in every tick, from the first row on.

    Fix j is true at j / rate and held from the first tick that ends at or after j / rate + latency; its value is
    the closed form 1 - (T / dt) (1 - exp(-dt / T)) exp(-t / T), t since the end of the tick in which v rose.
    """
    n, rise, T = 24 * 50, 100, 1.0
    V = np.array([9.0, -12.0, 2.0])
    v = np.zeros((n, 3))
    v[rise:] = V
    params = replace(IDEAL, filter_s=T, latency_s=float(latency_s))
    rows = flown(params, v, straight(v), Rates(gps_hz=gps_hz))
    stamp, count = np.zeros(n), np.zeros(n, int)
    for j in range(1, 24 * gps_hz):
        tick = math.ceil((Fraction(j, gps_hz) + Fraction(latency_s)) * 50) - 1
        if tick < n:
            stamp[tick:], count[tick] = j / gps_hz, 1
    np.testing.assert_array_equal(rows["gps_new"], count)
    np.testing.assert_array_equal(rows["gps_valid"], stamp > 0.0)
    np.testing.assert_allclose(rows["gps_t_s"], stamp, rtol=0, atol=1e-12)
    since = stamp - (rise + 1) * DT_S
    response = 1.0 - (T / DT_S) * -math.expm1(-DT_S / T) * np.exp(-np.maximum(since, 0.0) / T)
    share = np.where(since > -1e-9, response, 0.0)
    np.testing.assert_allclose(rows["gps_v_e_m_s"], share[:, None] * V, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rows["gps_speed_m_s"], share * 15.0, rtol=0, atol=1e-11)


@pytest.mark.parametrize("filter_s", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("bank_deg", [20.0, -45.0])
def test_gps_velocity_shrinks_and_lags_in_a_turn(filter_s, bank_deg):
    """A vector through a first-order filter: 1 / sqrt(1 + (wT)^2) of the speed, atan(wT) behind in course.

    The truth is taken as linear within a tick, which on a circle is off by up to (w dt)^2 / 12 of the speed.
    """
    turn, rates = SteadyTurn(math.radians(bank_deg)), Rates(gps_hz=5)
    truth = motion_rows(turn, 50 * 40, rates.dt_s, 0.0)
    rows = flown(replace(IDEAL, filter_s=filter_s), truth["v_e_m_s"], truth["p_e_m"], rates)
    settled = rows[(rows["gps_new"] == 1) & (rows["gps_t_s"] > 14 * filter_s)]  # exp(-14) = 8e-7 is left
    w, V = turn.turn_rate_rad_s, turn.airspeed_m_s
    assert len(settled) >= 20
    bound = (w * DT_S) ** 2 / 12.0 + math.exp(-14.0)
    np.testing.assert_allclose(settled["gps_speed_m_s"] / V, 1.0 / math.hypot(1.0, w * filter_s), rtol=0, atol=bound)
    behind = w * settled["gps_t_s"] - settled["gps_course_rad"] - math.atan(w * filter_s)
    np.testing.assert_allclose(np.abs(np.exp(1j * behind) - 1.0), 0.0, rtol=0, atol=4.0 * bound)


def test_gps_static_navigation_holds_position_and_course_below_its_speed():
    """Fast, crawling, fast again: in between the place and the course of the last free fix, and no speed."""
    v = np.zeros((900, 3))
    v[:300], v[300:600], v[600:] = [0.0, 8.0, 0.5], [0.6, -0.6, 0.3], [-4.0, 0.0, 0.0]
    p, rates = straight(v), Rates(gps_hz=5)
    params = replace(IDEAL, hold_below_m_s=1.0)
    rows, free = flown(params, v, p, rates), flown(IDEAL, v, p, rates)
    fixes, free = rows[rows["gps_new"] == 1], free[free["gps_new"] == 1]
    slow = (fixes["gps_t_s"] > 6.01) & (fixes["gps_t_s"] < 12.01)
    last = np.flatnonzero(slow)[0] - 1
    for name in ("gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s"):
        np.testing.assert_array_equal(fixes[name][~slow], free[name][~slow])
    np.testing.assert_array_equal(fixes["gps_p_e_m"][slow], np.tile(free["gps_p_e_m"][last], (slow.sum(), 1)))
    np.testing.assert_array_equal(fixes["gps_course_rad"][slow], math.pi / 2)
    np.testing.assert_array_equal(fixes["gps_v_e_m_s"][slow], 0.0)
    np.testing.assert_array_equal(fixes["gps_speed_m_s"][slow], 0.0)


def test_gps_static_navigation_at_rest_wanders_nowhere():
    """On the table, with all its noise: one position from the first fix to the last, and a speed of zero."""
    rows = flown(GpsParams(hold_below_m_s=1.5), np.zeros((6000, 3)), 0.0, Rates())
    fixes = rows[rows["gps_new"] == 1]
    assert len(fixes) > 450
    assert np.any(fixes["gps_p_e_m"][0] != 0.0)
    np.testing.assert_array_equal(fixes["gps_p_e_m"], np.tile(fixes["gps_p_e_m"][0], (len(fixes), 1)))
    np.testing.assert_array_equal(fixes["gps_speed_m_s"], 0.0)


@pytest.mark.parametrize("gps_hz", [1, 5, 10])
def test_gps_track_smoothing_tells_straight_flight_as_it_is(gps_hz):
    """No lag at constant velocity, from the first fix on."""
    v = np.tile([12.0, -5.0, 1.0], (1000, 1))
    rows = flown(replace(IDEAL, smoothing_s=4.0), v, straight(v), Rates(gps_hz=gps_hz))
    fixes = rows[rows["gps_new"] == 1]
    np.testing.assert_allclose(fixes["gps_p_e_m"], v[0] * fixes["gps_t_s"][:, None], rtol=0, atol=1e-10)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], np.tile(v[0], (len(fixes), 1)), rtol=0, atol=1e-12)


@pytest.mark.parametrize("smoothing_s", [0.5, 3.0])
def test_gps_track_smoothing_lets_a_jump_of_position_in_slowly(smoothing_s):
    """A jump of 30 m at rest: exp(-t / T) of it is missing, t counted from the fix before the jump."""
    p = np.zeros((1000, 3))
    p[500:] = [30.0, -10.0, 4.0]
    rows = flown(replace(IDEAL, smoothing_s=smoothing_s), np.zeros((1000, 3)), p, Rates(gps_hz=5))
    fixes = rows[rows["gps_new"] == 1]
    t = np.maximum(fixes["gps_t_s"] - 10.0, 0.0)  # true at 10.0 s: the last fix before it
    expected = (1.0 - np.exp(-t / smoothing_s))[:, None] * p[-1]
    np.testing.assert_allclose(fixes["gps_p_e_m"], expected, rtol=0, atol=1e-11)


def test_gps_track_smoothing_follows_a_turn_of_course_late():
    """A right-angled turn at 5 Hz: the velocity is SciPy's first-order recursion of the unsmoothed fixes."""
    v = np.zeros((1000, 3))
    v[:500], v[500:] = [12.0, 0.0, 0.0], [0.0, 12.0, 0.0]
    rates, T = Rates(gps_hz=5), 2.0
    free = flown(IDEAL, v, straight(v), rates)
    free = free["gps_v_e_m_s"][free["gps_new"] == 1]
    rows = flown(replace(IDEAL, smoothing_s=T), v, straight(v), rates)
    fixes = rows[rows["gps_new"] == 1]
    gain = 1.0 - math.exp(-0.2 / T)
    smooth, _ = lfilter([gain], [1.0, gain - 1.0], free, axis=0, zi=(1.0 - gain) * free[:1])
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], smooth, rtol=0, atol=1e-12)
    # Course 90 degrees to go: half of it is reported when both components are alike, after T ln 2.
    half = fixes["gps_t_s"][np.argmax(fixes["gps_course_rad"] > math.pi / 4)] - 10.0
    assert T * math.log(2.0) <= half <= T * math.log(2.0) + 0.2 + 1e-9
