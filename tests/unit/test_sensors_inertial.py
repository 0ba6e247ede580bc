"""Gyro and accelerometer, one error at a time: each has the sigma, the growth and the limits of its data sheet."""

import math
from functools import partial

import numpy as np
import pytest
from scipy import stats

from sim.clock import Rates
from sim.log import Log
from sim.rng import stream
from sim.sensors import gyro
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

DEG = math.pi / 180.0
G0 = 9.80665
NO_GYRO_ERROR = {
    "bias_deg_s": 0.0, "drift_deg_s_min": 0.0, "walk_deg_s_sqrt_s": 0.0, "noise_density_deg_s_sqrt_hz": 0.0,
    "gain": 0.0, "cross_axis": 0.0, "range_deg_s": math.inf, "bits": 0,
}  # fmt: skip
NO_FORCE_ERROR = {"bias_g": 0.0, "noise_density_ug_sqrt_hz": 0.0, "range_g": math.inf, "bits": 0}
DOUBTED_ONCE_IN = 1e-5


def assert_sigma(samples, sigma):
    """The sample variance about zero lies within the chi-square bounds of independent `samples`."""
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], np.size(samples))
    assert low <= np.sum(np.square(samples)) / sigma**2 <= high


def log_of(n_ticks, rates, omega_b_rad_s=(0.0, 0.0, 0.0), force_b_m_s2=(0.0, 0.0, -G0)):
    """A log whose truth has these inertial means, a row or one for all."""
    log = Log.empty(n_ticks)
    log.truth["t_s"] = np.arange(1, n_ticks + 1) * rates.dt_s
    log.truth["imu_omega_b_rad_s"], log.truth["imu_force_b_m_s2"] = omega_b_rad_s, force_b_m_s2
    return log


def measured(params, log, rates, seed=0, flight=0):
    """The measured rows of a whole flight."""
    suite = Suite(params, rates, seed, flight)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log.measured


def flights(n, n_ticks, imu_hz=50, omega_deg_s=(0.0, 0.0, 0.0), **errors):
    """Gyro readings in deg/s, shape (n, n_ticks, 3), with only the `errors` given."""
    rates, params = Rates(imu_hz=imu_hz), SuiteParams(gyro=GyroParams(**{**NO_GYRO_ERROR, **errors}))
    rows = (measured(params, log_of(n_ticks, rates, np.multiply(omega_deg_s, DEG)), rates, 3, i) for i in range(n))
    return np.stack([r["gyro_b_rad_s"] for r in rows]) / DEG


def force_flights(n, n_ticks, imu_hz=50, **errors):
    """Errors of the accelerometer in g, shape (n, n_ticks, 3), with only the `errors` given."""
    rates = Rates(imu_hz=imu_hz)
    params = SuiteParams(accelerometer=AccelerometerParams(**{**NO_FORCE_ERROR, **errors}))
    rows = (measured(params, log_of(n_ticks, rates), rates, 3, i) for i in range(n))
    return np.stack([r["force_b_m_s2"] for r in rows]) / G0 - [0.0, 0.0, -1.0]


def test_gyro_turn_on_bias_has_its_sigma_and_stays():
    """1 deg/s over flights and axes, the same from first to last tick."""
    reading = flights(300, 20, bias_deg_s=1.0)
    assert_sigma(reading[:, 0], 1.0)
    np.testing.assert_array_equal(reading, np.broadcast_to(reading[:, :1], reading.shape))


def test_gyro_drift_begins_as_a_ramp_with_its_sigma():
    """0.2 deg/s per minute: a straight line in time whose slope scatters over flights."""
    reading = flights(300, 50, drift_deg_s_min=0.2)
    slope_deg_s_min = reading[:, -1] * 60.0
    assert_sigma(slope_deg_s_min, 0.2)
    line = reading[:, -1:] * (np.arange(1, 51) / 50.0)[:, None]
    np.testing.assert_allclose(reading, line, rtol=2e-3, atol=0)  # 1 s of 300 s: bent by 1 s / 600 s


def test_gyro_drift_levels_off_with_the_warming_of_the_board():
    """The solution of T b' = s T - b: in the end 5 min of 0.2 deg/s per minute are 1 deg/s, and never more."""
    rates, params = Rates(), GyroParams(**{**NO_GYRO_ERROR, "drift_deg_s_min": 0.2})
    hour = np.zeros(rates.ticks(3600.0), list(gyro.NOISE))
    for flight in range(4):
        gyro.draw(params, BoardParams(), rates, partial(stream, 3, flight), hour)
        slope_deg_s = 0.2 / 60.0 * stream(3, flight, "gyro drift").standard_normal(3)
        bias_deg_s = np.degrees(hour["gyro_bias_b_rad_s"])
        for t_s, time_s in ((60, 54.3808), (300, 189.6362), (1200, 294.5053), (3600, 299.9982)):
            np.testing.assert_allclose(bias_deg_s[50 * t_s - 1], slope_deg_s * time_s, rtol=1e-6, atol=0)
    slow, rate = np.zeros(3000, list(gyro.NOISE)), BoardParams(warming_s=60.0)
    gyro.draw(params, rate, rates, partial(stream, 3, 0), slow)
    np.testing.assert_allclose(
        np.degrees(slow["gyro_bias_b_rad_s"][-1]),
        0.2 * (1.0 - math.exp(-1.0)) * stream(3, 0, "gyro drift").standard_normal(3), rtol=1e-12, atol=0,
    )  # fmt: skip


def test_gyro_random_walk_grows_with_the_root_of_time():
    """0.01 deg/s after a second, twice that after four, four times after sixteen."""
    reading = flights(200, 800, walk_deg_s_sqrt_s=0.01)
    for t_s in (1, 4, 16):
        assert_sigma(reading[:, 50 * t_s - 1], 0.01 * math.sqrt(t_s))


@pytest.mark.parametrize(("imu_hz", "sigma_deg_s"), [(50, 0.3), (100, 0.3 * math.sqrt(2)), (200, 0.6)])
def test_gyro_noise_has_its_sigma_at_every_rate(imu_hz, sigma_deg_s):
    """0.3 deg/s a sample at 50 Hz, growing with the root of the rate; white: neighbours do not correlate."""
    reading = flights(4, 2000, imu_hz, noise_density_deg_s_sqrt_hz=0.06)
    assert_sigma(reading, sigma_deg_s)
    together = np.sum(reading[:, 1:] * reading[:, :-1]) / sigma_deg_s**2
    assert abs(together) <= 4.5 * math.sqrt(reading[:, 1:].size)


def test_gyro_gain_error_scales_each_axis_alone():
    """1.5 % of the rate about the turned axis, nothing about the others, none at rest."""
    reading = flights(600, 1, omega_deg_s=(100.0, -50.0, 200.0), gain=0.015)[:, 0]
    assert_sigma(reading / [100.0, -50.0, 200.0] - 1.0, 0.015)
    np.testing.assert_array_equal(flights(3, 1, gain=0.015), 0.0)


def test_gyro_cross_axis_error_leaks_into_the_other_two():
    """0.5 % of a pure roll appears in pitch and yaw, the roll itself is read exactly."""
    reading = flights(600, 1, omega_deg_s=(100.0, 0.0, 0.0), cross_axis=0.005)[:, 0]
    np.testing.assert_allclose(reading[:, 0], 100.0, rtol=0, atol=1e-12)
    assert_sigma(reading[:, 1:] / 100.0, 0.005)


def test_gyro_range_and_levels_are_exact():
    """+-300 deg/s in 1024 steps: far outside it reads -300 or 300 less a step, and only multiples of the step."""
    step_rad_s = 2.0 * math.radians(300.0) / 1024.0
    rates = Rates()
    sweep = np.linspace(-400.0, 400.0, 2001)[:, None] * [1.0, -1.0, 0.5] * DEG
    params = SuiteParams(gyro=GyroParams(**{**NO_GYRO_ERROR, "range_deg_s": 300.0, "bits": 10}))
    reading = measured(params, log_of(2001, rates, sweep), rates)["gyro_b_rad_s"]
    np.testing.assert_array_equal(reading, step_rad_s * np.round(reading / step_rad_s))
    assert reading.min() == -math.radians(300.0)
    assert reading.max() == 511 * step_rad_s
    inside = np.abs(sweep) < math.radians(299.0)
    assert np.abs(reading - sweep)[inside].max() <= step_rad_s / 2 + 1e-15


@pytest.mark.parametrize("range_g", [3.0, 6.0])
def test_accelerometer_range_and_levels_are_exact(range_g):
    """+-3 g (or 6) of standard gravity in 1024 steps, specific force: a push of 5 g clips the one, not the other."""
    step_m_s2 = 2.0 * range_g * G0 / 1024.0
    rates = Rates()
    sweep = np.linspace(-5.0, 5.0, 1001)[:, None] * [G0, 0.1 * G0, -G0]
    params = SuiteParams(accelerometer=AccelerometerParams(**{**NO_FORCE_ERROR, "range_g": range_g, "bits": 10}))
    reading = measured(params, log_of(1001, rates, force_b_m_s2=sweep), rates)["force_b_m_s2"]
    np.testing.assert_array_equal(reading, step_m_s2 * np.round(reading / step_m_s2))
    assert reading.max() == min(511 * step_m_s2, step_m_s2 * round(5.0 * G0 / step_m_s2))
    inside = np.abs(sweep) < 0.99 * range_g * G0
    assert np.abs(reading - sweep)[inside].max() <= step_m_s2 / 2 + 1e-14


def test_accelerometer_bias_has_its_sigma_and_stays():
    """0.02 g over flights and axes, constant in a flight."""
    error = force_flights(300, 10, bias_g=0.02)
    assert_sigma(error[:, 0], 0.02)
    np.testing.assert_allclose(error, np.broadcast_to(error[:, :1], error.shape), rtol=0, atol=1e-15)


@pytest.mark.parametrize(("imu_hz", "sigma_g"), [(50, 0.02), (200, 0.04)])
def test_accelerometer_noise_has_its_sigma_at_every_rate(imu_hz, sigma_g):
    """0.02 g a sample at 50 Hz, growing with the root of the rate."""
    assert_sigma(force_flights(4, 2000, imu_hz, noise_density_ug_sqrt_hz=4000.0), sigma_g)


def test_inertial_bias_in_the_truth_is_the_additive_error():
    """With nothing but bias, drift and walk, reading minus truth is the bias column of the truth."""
    rates = Rates()
    gyro = GyroParams(noise_density_deg_s_sqrt_hz=0.0, gain=0.0, cross_axis=0.0, range_deg_s=math.inf, bits=0)
    force = AccelerometerParams(noise_density_ug_sqrt_hz=0.0, range_g=math.inf, bits=0)
    log = log_of(300, rates, (0.1, -0.2, 0.3))
    rows = measured(SuiteParams(gyro, force), log, rates, seed=4)
    for reading, imu, bias in (
        ("gyro_b_rad_s", "imu_omega_b_rad_s", "gyro_bias_b_rad_s"),
        ("force_b_m_s2", "imu_force_b_m_s2", "force_bias_b_m_s2"),
    ):
        np.testing.assert_allclose(rows[reading] - log.truth[imu], log.truth[bias], rtol=0, atol=1e-14)
        assert np.all(log.truth[bias] != 0.0)


def test_generic_suite_has_the_data_sheet_of_the_reference_set_up():
    """The default sensors, number by number: campaigns that name `generic` depend on them."""
    generic = SUITES["generic"]
    assert generic.gyro == GyroParams(
        bias_deg_s=1.0, drift_deg_s_min=0.2, walk_deg_s_sqrt_s=0.01, noise_density_deg_s_sqrt_hz=0.06, gain=0.015,
        cross_axis=0.005, range_deg_s=300.0, bits=10,
    )  # fmt: skip
    assert generic.accelerometer == AccelerometerParams(
        bias_g=0.02, noise_density_ug_sqrt_hz=4000.0, range_g=3.0, bits=10
    )
    assert (generic.gps.filter_s, generic.gps.latency_s, generic.gps.velocity_noise_m_s) == (1.0, 0.3, 0.1)
    assert SUITES["generic_6g"].accelerometer.range_g == 6.0
