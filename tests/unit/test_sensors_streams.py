"""Every source of error draws from its own stream: none moves another, whatever is switched or how long it flies."""

from dataclasses import replace

import numpy as np
import pytest

from sim.clock import Rates
from sim.log import Log
from sim.sensors.gps import GpsParams
from sim.sensors.suite import NOISE, SUITES, Suite, SuiteParams

GENERIC = SUITES["generic"]
DRAWN = ("bias_deg_s", "drift_deg_s_min", "walk_deg_s_sqrt_s", "noise_density_deg_s_sqrt_hz", "gain", "cross_axis")
FITTED = [n for n in NOISE.names if n.startswith(("gyro", "force", "gps"))]  # the generic suite has nothing else


def drawn(params=GENERIC, n_ticks=200, seed=5, flight=0, rates=None):
    """What the sensors of a flight are made of: units and errors."""
    suite = Suite(params, rates or Rates(), seed, flight)
    suite.reset(Log.empty(n_ticks))
    return suite.snapshot()


def flown(params, n_ticks=200):
    """Measured rows of a flight that turns and pulls."""
    log = Log.empty(n_ticks)
    log.truth["imu_omega_b_rad_s"], log.truth["imu_force_b_m_s2"] = (0.5, -0.2, 0.1), (1.0, 0.0, -12.0)
    suite = Suite(params, Rates(), 5)
    suite.reset(log)
    for k in range(n_ticks):
        suite.measure(k)
    return log.measured


def test_gps_parameters_leave_every_inertial_bit_unchanged():
    """Another receiver, at another rate, is fitted without touching gyro or accelerometer."""
    a = flown(GENERIC)
    b = flown(replace(GENERIC, gps=GpsParams(4.0, 0.5, 0.1, 3.0, 0.7, 5.0, 9.0, 10.0)))
    for name in ("gyro_b_rad_s", "force_b_m_s2"):
        np.testing.assert_array_equal(a[name], b[name])
    assert np.any(a["gps_v_e_m_s"] != b["gps_v_e_m_s"])


@pytest.mark.parametrize("error", DRAWN)
def test_gyro_error_switched_off_leaves_every_other_draw_unchanged(error):
    """Noise, accelerometer and GPS keep their bits; only the column that holds the error changes."""
    whole = drawn()
    without = drawn(replace(GENERIC, gyro=replace(GENERIC.gyro, **{error: 0.0})))
    holds = {"noise_density_deg_s_sqrt_hz": "gyro_noise_b_rad_s", "gain": "M", "cross_axis": "M"}.get(
        error, "gyro_bias_b_rad_s"
    )
    for name in NOISE.names:
        same = np.array_equal(whole.noise[name], without.noise[name])
        assert same == (name != holds)
    assert np.array_equal(whole.unit["gyro"]["M"], without.unit["gyro"]["M"]) == (holds != "M")


def test_drift_is_added_to_an_unchanged_walk():
    """Bias with drift minus bias without is the curve of the drift alone, 300 s of the board's warming."""
    still = replace(GENERIC.gyro, drift_deg_s_min=0.0)
    name = "gyro_bias_b_rad_s"
    ramp = drawn().noise[name] - drawn(replace(GENERIC, gyro=still)).noise[name]
    curve = 1.0 - np.exp(-np.arange(1, 201)[:, None] / 50.0 / 300.0)
    np.testing.assert_allclose(ramp, curve * ramp[-1] / curve[-1], rtol=0, atol=1e-15)
    assert np.all(ramp[-1] != 0.0)


def test_longer_flight_begins_with_the_same_errors():
    """Tick k's draw does not depend on the length of the flight, bit for bit."""
    short, long = drawn(n_ticks=137), drawn(n_ticks=2000)
    np.testing.assert_array_equal(short.noise, long.noise[:137])
    np.testing.assert_array_equal(short.unit, long.unit)


def test_no_two_columns_of_errors_are_alike():
    """No two streams are the same: columns are pairwise uncorrelated (4.5 sigma of 2000 draws)."""
    noise = drawn(n_ticks=2000).noise
    names = ("gyro_noise_b_rad_s", "force_noise_b_m_s2", "gps_v_noise_e_m_s")
    wander = np.diff(noise["gps_p_wander_e_m"], axis=0, prepend=0.0)[1:]
    walk = np.diff(noise["gyro_bias_b_rad_s"], axis=0, prepend=0.0)[1:]
    columns = np.hstack([*(noise[n][1:] for n in names), wander, walk])
    correlation = np.corrcoef(columns.T) - np.eye(15)
    assert np.abs(correlation).max() <= 4.5 / np.sqrt(1999)


def test_flights_and_seeds_are_all_different():
    """Seed and flight number each change every error that is drawn."""
    first = drawn()
    for other in (drawn(seed=6), drawn(flight=1)):
        for name in FITTED:
            assert np.all(first.noise[name] != other.noise[name])
        assert np.all(first.unit["gyro"]["M"] != other.unit["gyro"]["M"])


def test_errors_switched_off_are_exactly_zero():
    """The ideal suite has no error at all."""
    ideal = drawn(SUITES["ideal"])
    for name in NOISE.names:
        np.testing.assert_array_equal(ideal.noise[name], 0.0)
    np.testing.assert_array_equal(ideal.unit["gyro"]["M"][0], np.eye(3))
    assert isinstance(SUITES["ideal"], SuiteParams)
