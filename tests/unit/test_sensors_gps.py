"""The GPS receiver: filter against its closed form, latency to the tick, noise, and the time to the first fix."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

from sim.clock import Rates
from sim.log import Log
from sim.sensors.gps import GpsParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

IDEAL = SUITES["ideal"].gps
NOISELESS = GpsParams(velocity_noise_m_s=0.0, wander_horizontal_m=0.0, wander_vertical_m=0.0)
DOUBTED_ONCE_IN = 1e-5


def received(params, v_e_m_s, rates=None, p_e_m=None, seed=0, flight=0):
    """The log of a flight with this velocity, shape (n, 3), seen by this receiver."""
    rates = rates or Rates()
    log = Log.empty(len(v_e_m_s))
    log.truth["t_s"] = np.arange(1, len(log) + 1) * rates.dt_s
    log.truth["v_e_m_s"] = v_e_m_s
    log.truth["p_e_m"] = np.zeros(3) if p_e_m is None else p_e_m
    suite = Suite(SuiteParams(gps=params), rates, seed, flight)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log


@pytest.mark.parametrize("filter_s", [0.1, 1.0, 3.0])
def test_gps_filter_follows_a_step_as_the_closed_form(filter_s):
    """A velocity step (linear within its tick) leaves 1 - exp(-t / T), exactly."""
    v, dt_s, T, V = np.zeros((400, 3)), 0.02, filter_s, np.array([10.0, -4.0, 1.0])
    v[100:] = V
    inside = received(replace(NOISELESS, filter_s=T), v).truth["gps_v_e_m_s"]
    np.testing.assert_array_equal(inside[:100], 0.0)
    t_s = (np.arange(100, 400) - 100) * dt_s  # since the end of the tick in which it rose
    left = (T / dt_s) * (1.0 - math.exp(-dt_s / T)) * np.exp(-t_s / T)
    np.testing.assert_allclose(inside[100:], (1.0 - left)[:, None] * V, rtol=0, atol=1e-12)  # round-off
    # A sharp step half-way through that tick differs by dt^2 / 24 T^2 of what is left.
    sharp = np.exp(-(t_s + dt_s / 2) / T)
    np.testing.assert_allclose(left, sharp, rtol=0, atol=dt_s**2 / (20.0 * T**2))


@pytest.mark.parametrize("imu_hz", [40, 50, 100, 200])
def test_gps_filter_of_a_ramp_lags_by_its_time_constant(imu_hz):
    """Position at constant velocity, from the first row on: the filter is late by T, to round-off, at every rate."""
    rates = Rates(imu_hz=imu_hz)
    v = np.array([12.0, -3.0, 0.5])
    t_s = np.arange(1, 301)[:, None] * rates.dt_s
    log = received(NOISELESS, np.tile(v, (300, 1)), rates, p_e_m=v * t_s)
    np.testing.assert_allclose(log.truth["gps_p_e_m"], v * (t_s - 1.0), rtol=0, atol=1e-11)
    np.testing.assert_allclose(log.truth["gps_v_e_m_s"], np.tile(v, (300, 1)), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("physics_hz", "imu_hz", "gps_hz"),
    [
        (200, 50, 1), (200, 50, 2), (200, 50, 2.5), (200, 50, 4), (200, 50, 5), (200, 50, 10),
        (200, 40, 4), (400, 100, 2.5), (200, 200, 4), (100, 50, 4), (1000, 50, 4),
    ],
)  # fmt: skip
@pytest.mark.parametrize("latency_s", ["0", "0.3", "0.31", "0.123", "2"])
def test_gps_fixes_arrive_exactly_a_latency_after_they_were_true(physics_hz, imu_hz, gps_hz, latency_s):
    """Every fix, in rational numbers: stamped j / rate, in the first tick that ends at or after stamp + latency.

    4 Hz falls between the ticks of 50 Hz; the velocity grows linearly, so that a fix holds its own time.
    """
    rates = Rates(physics_hz, imu_hz, gps_hz)
    n, growth = 8 * imu_hz, np.array([1.5, -0.5, 0.25])
    v = growth * np.arange(1, n + 1)[:, None] * rates.dt_s
    rows = received(replace(IDEAL, latency_s=float(latency_s)), v, rates).measured
    due = {}
    j = 1
    while True:
        true_at = j / Fraction(str(gps_hz))
        tick = math.ceil((true_at + Fraction(latency_s)) * imu_hz) - 1
        if tick >= n:
            break
        due[tick] = float(true_at)
        j += 1
    assert len(due) >= 5
    np.testing.assert_array_equal(np.flatnonzero(rows["gps_new"]), list(due))
    fixes = rows[list(due)]
    np.testing.assert_allclose(fixes["gps_t_s"], list(due.values()), rtol=0, atol=1e-12)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], growth * fixes["gps_t_s"][:, None], rtol=0, atol=1e-12)


def test_gps_between_fixes_holds_the_last_one():
    """Held columns change in ticks with a new fix alone; valid once, valid for good."""
    rng = np.random.default_rng(3)
    rows = received(GpsParams(), rng.standard_normal((1000, 3))).measured
    held = ("gps_t_s", "gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s", "gps_valid")
    old = np.flatnonzero(rows["gps_new"][1:] == 0)
    for name in held:
        np.testing.assert_array_equal(rows[name][old + 1], rows[name][old])
    first = np.flatnonzero(rows["gps_new"])[0]
    np.testing.assert_array_equal(rows["gps_valid"], np.arange(1000) >= first)
    assert rows["gps_new"][first + 1 :].sum() > 50


@pytest.mark.parametrize(("first_fix_s", "stamp_s"), [(0.0, 0.25), (1.0, 1.0), (1.01, 1.25), (7.3, 7.5)])
def test_gps_reports_nothing_before_it_has_acquired(first_fix_s, stamp_s):
    """The first fix is the first one true at or after acquisition; until then nothing is valid, all is zero."""
    rows = received(replace(GpsParams(), first_fix_s=first_fix_s), np.ones((600, 3))).measured
    first = np.flatnonzero(rows["gps_new"])[0]
    assert rows["gps_t_s"][first] == stamp_s
    assert rows["t_s"][first] >= stamp_s + 0.3 - 1e-12
    assert not rows["gps_valid"][:first].any()
    np.testing.assert_array_equal(rows["gps_v_e_m_s"][:first], 0.0)


def test_gps_velocity_noise_is_white_with_its_sigma():
    """0.1 m/s per axis per fix, neighbours uncorrelated."""
    fixes = received(GpsParams(), np.zeros((40_000, 3))).measured
    v = fixes["gps_v_e_m_s"][fixes["gps_new"] == 1] / 0.1
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], v.size)
    assert low <= np.sum(v**2) <= high
    assert abs(np.sum(v[1:] * v[:-1])) <= 4.5 * math.sqrt(v.size)


def test_gps_position_wanders_slowly_with_its_sigma():
    """1.5 m horizontally, 2.5 m vertically over flights; hardly changed from fix to fix."""
    ends, moves = [], []
    for i in range(400):
        rows = received(GpsParams(), np.zeros((120, 3)), flight=i).measured
        fixes = rows["gps_p_e_m"][rows["gps_new"] == 1] / [1.5, 1.5, 2.5]
        ends.append(fixes[-1])
        moves.append(np.diff(fixes, axis=0))
    n = 3 * len(ends)
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], n)
    assert low <= np.sum(np.square(ends)) <= high
    # From fix to fix (about 0.25 s of 30 s) the variance is 2 (1 - exp(-dt / T)); fixes fall on ticks, +-0.02 s.
    moved = np.mean(np.square(moves)) / (2.0 * (1.0 - math.exp(-0.25 / 30.0)))
    assert abs(moved - 1.0) <= 0.08 + 4.5 * math.sqrt(2.0 / np.size(moves))


def test_gps_course_standing_still_is_anything():
    """Course is noise at rest: every eighth of the circle is reported equally often."""
    rows = received(GpsParams(), np.zeros((40_000, 3)), seed=1).measured
    course = rows["gps_course_rad"][rows["gps_new"] == 1]
    counts, _ = np.histogram(course, bins=8, range=(0.0, 2.0 * np.pi))
    assert counts.sum() == course.size
    assert stats.chisquare(counts).pvalue >= DOUBTED_ONCE_IN


@pytest.mark.parametrize("course_deg", [0.0, 45.0, 90.0, 179.9, 180.0, 225.0, 359.9])
def test_gps_course_and_speed_belong_to_the_velocity(course_deg):
    """From north over east, 0 to 360 degrees; speed is horizontal."""
    course = math.radians(course_deg)
    v = np.array([9.0 * math.cos(course), 9.0 * math.sin(course), 3.0])
    rows = received(IDEAL, np.tile(v, (30, 1))).measured
    np.testing.assert_allclose(rows["gps_course_rad"][-1], course, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rows["gps_speed_m_s"][-1], 9.0, rtol=0, atol=1e-14)


def test_gps_course_just_left_of_north_stays_below_a_full_circle():
    """A course of -1e-17 must not be reported as 2 pi."""
    rows = received(IDEAL, np.tile([1.0, -1e-17, 0.0], (30, 1))).measured
    assert 0.0 <= rows["gps_course_rad"][-1] < 2.0 * math.pi


def test_gps_latency_does_not_change_the_noise_of_a_fix():
    """A fix carries the errors of the time it was true: a later arrival of the same fix reads the same."""
    v = np.zeros((500, 3))
    prompt, late = (received(replace(GpsParams(), latency_s=s), v).measured for s in (0.0, 0.7))
    a, b = prompt[prompt["gps_new"] == 1], late[late["gps_new"] == 1]
    for name in ("gps_t_s", "gps_p_e_m", "gps_v_e_m_s"):
        np.testing.assert_array_equal(a[name][: len(b)], b[name])


def test_gps_fix_carries_the_errors_of_the_tick_it_was_true_in():
    """4 Hz and 50 Hz: the fix true at 1.25 s lies in the tick that ends at 1.26 s, row 62, and has its errors."""
    log = Log.empty(200)
    suite = Suite(SuiteParams(), Rates(), 0)
    suite.reset(log)
    for k in range(200):
        suite.measure(k)
    errors, fixes = suite.snapshot().noise, log.measured[log.measured["gps_new"] == 1]
    ticks = [math.ceil(Fraction(t) * 50) - 1 for t in fixes["gps_t_s"]]
    assert ticks[1] == 62
    np.testing.assert_array_equal(fixes["gps_v_e_m_s"], errors["gps_v_noise_e_m_s"][ticks])
    np.testing.assert_array_equal(fixes["gps_p_e_m"], errors["gps_p_wander_e_m"][ticks])


def test_gps_over_a_log_used_before_leaves_no_fix_of_the_old_flight():
    """A log flown over again, with fixes in other ticks, holds the fixes of the new flight alone."""
    log = received(GpsParams(latency_s=0.0), np.zeros((300, 3)))
    suite = Suite(SuiteParams(), Rates(), 0)
    suite.reset(log)
    for k in range(300):
        suite.measure(k)
    fresh = received(GpsParams(), np.zeros((300, 3)))
    assert log.measured.tobytes() == fresh.measured.tobytes()
