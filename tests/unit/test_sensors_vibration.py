"""The motor's vibration: amplitude, frequency, what a part's filter and its conversions make of it, and aliasing."""

import math

import numpy as np
import pytest

from sim.clock import Rates
from sim.log import Log
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.device import mean_gain
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import Suite, SuiteParams

DEG, G0 = math.pi / 180.0, 9.80665
NO_GYRO_ERROR = {
    "bias_deg_s": 0.0, "drift_deg_s_min": 0.0, "walk_deg_s_sqrt_s": 0.0, "noise_density_deg_s_sqrt_hz": 0.0,
    "gain": 0.0, "cross_axis": 0.0, "range_deg_s": math.inf, "bits": 0,
}  # fmt: skip
NO_FORCE_ERROR = {"bias_g": 0.0, "noise_density_ug_sqrt_hz": 0.0, "range_g": math.inf, "bits": 0}
BOARD = BoardParams(vibration_g=0.5, vibration_deg_s=8.0, vibration_rpm=8000.0)  # 133.3 Hz
N = 300  # 6 s at 50 Hz: 100 periods of 16.67 Hz


def shaken(rpm, seed=0, imu_hz=50, n_ticks=N, **device):
    """Gyro in deg/s and accelerometer in g, each (n, 3), of a resting body whose motor turns at `rpm`, (n,) or one."""
    log = Log.empty(n_ticks)
    log.truth["rotor_rpm"] = rpm
    params = SuiteParams(GyroParams(**NO_GYRO_ERROR, **device), AccelerometerParams(**NO_FORCE_ERROR, **device))
    suite = Suite(SuiteParams(params.gyro, params.accelerometer, board=BOARD), Rates(imu_hz=imu_hz), seed)
    suite.reset(log)
    for k in range(n_ticks):
        suite.measure(k)
    return log.measured["gyro_b_rad_s"] / DEG, log.measured["force_b_m_s2"] / G0


def spectrum(reading):
    """Amplitude of each bin of the discrete Fourier transform, shape (n // 2 + 1, 3)."""
    return 2.0 / len(reading) * np.abs(np.fft.rfft(reading, axis=0))


@pytest.mark.parametrize("bandwidth_hz", [math.inf, 94.0, 40.0])
def test_vibration_sampled_once_a_tick_appears_at_its_alias(bandwidth_hz):
    """133.3 Hz at 50 Hz is seen at |133.3 - 150| = 16.7 Hz, as large as the part's filter leaves it, and alone."""
    left = 1.0 / math.hypot(1.0, 8000.0 / 60.0 / bandwidth_hz)
    for reading, amplitude in zip(shaken(8000.0, conversions=1, bandwidth_hz=bandwidth_hz), (8.0, 0.5), strict=True):
        lines = spectrum(reading)
        np.testing.assert_allclose(lines[100], amplitude * left, rtol=0, atol=1e-9)
        assert np.delete(lines, 100, axis=0).max() <= 1e-9


@pytest.mark.parametrize("conversions", [2, 5, 16])
def test_vibration_averaged_over_conversions_is_what_their_sum_leaves(conversions):
    """The same line, as large as the mean of that many sines evenly spread over the tick, summed one by one."""
    instants = (np.arange(conversions) + 0.5) / conversions / 50.0
    left = abs(np.mean(np.exp(2j * math.pi * 8000.0 / 60.0 * instants)))
    gyro, force = shaken(8000.0, conversions=conversions)
    np.testing.assert_allclose(spectrum(gyro)[100], 8.0 * left, rtol=0, atol=1e-9)
    np.testing.assert_allclose(spectrum(force)[100], 0.5 * left, rtol=0, atol=1e-9)


def test_vibration_averaged_over_the_whole_tick_leaves_the_sinc():
    """A continuous mean leaves sin(x) / x, x = pi 133.3 / 50: 10 %; and nothing of 150 Hz, three turns in a tick."""
    left = abs(np.sinc(8000.0 / 60.0 / 50.0))
    gyro, _ = shaken(8000.0)
    np.testing.assert_allclose(spectrum(gyro)[100], 8.0 * left, rtol=0, atol=1e-9)
    gyro, force = shaken(9000.0)
    assert max(np.abs(gyro).max(), np.abs(force).max()) <= 1e-9


def test_vibration_grows_with_the_square_of_the_speed_and_stops_with_the_motor():
    """At half the speed a quarter, at its own frequency: 66.7 Hz is seen at 16.7 Hz as well; at rest nothing."""
    gyro, force = shaken(4000.0, conversions=1)
    np.testing.assert_allclose(spectrum(gyro)[100], 8.0 / 4.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(spectrum(force)[100], 0.5 / 4.0, rtol=0, atol=1e-9)
    for reading in shaken(0.0, conversions=1):
        np.testing.assert_array_equal(reading, 0.0)


def test_vibration_phase_follows_a_motor_that_runs_up():
    """Speed rises steadily: each sample is the sine of the whole angle turned by mid-tick.

    The speed within a tick is held at its mean, so that the angle half-way errs by 2 pi rise h^2 / 8 a tick.
    """
    rise_hz_s, h, start_hz = 8.0, 0.02, 60.0
    end = np.arange(1, N + 1) * h
    rpm = 60.0 * (start_hz + rise_hz_s * end)
    gyro, _ = shaken(rpm, conversions=1)
    # The first tick has no speed before it and turns at that of its end: rise h^2 / 2 turns ahead for good.
    middle = end - 0.5 * h
    angle = 2.0 * math.pi * (start_hz * middle + 0.5 * rise_hz_s * middle**2 + 0.5 * rise_hz_s * h**2)
    amplitude = 8.0 * ((start_hz + rise_hz_s * middle) * 60.0 / 8000.0) ** 2
    basis = np.stack([np.sin(angle), np.cos(angle)], axis=1) * amplitude[:, None]
    phase, *_ = np.linalg.lstsq(basis[1:], gyro[1:], rcond=None)
    bound = amplitude.max() * 2.0 * math.pi * rise_hz_s * h**2 / 8.0
    assert np.abs(basis[1:] @ phase - gyro[1:]).max() <= bound
    np.testing.assert_allclose(np.hypot(*phase), 1.0, rtol=0, atol=bound / amplitude.max())


def test_vibration_phases_are_drawn_per_axis_and_part():
    """Six different phases, and others in another flight."""
    first, second = (np.hstack(shaken(8000.0, seed, conversions=1)) / [8.0, 8.0, 8.0, 0.5, 0.5, 0.5] for seed in (0, 1))
    assert len(np.unique(np.round(first[0], 6))) == 6
    assert np.all(np.abs(first[0] - second[0]) > 1e-6)


@pytest.mark.parametrize("conversions", [1, 2, 3, 4, 7, 100])
@pytest.mark.parametrize("turns", [0.0, 0.3, 1.0, 2.0 - 1e-9, 2.0, 3.0, 8.0 / 3.0, 7.0, 100.0, 200.0 + 1e-7])
def test_mean_gain_is_the_mean_of_the_conversions(turns, conversions):
    """The closed form against the sum, also where every conversion meets the same phase and 0 / 0 threatens."""
    spread = (np.arange(conversions) + 0.5) / conversions - 0.5
    assert abs(mean_gain(turns, conversions) - np.mean(np.cos(2.0 * math.pi * turns * spread))) <= 1e-11
    assert abs(mean_gain(turns, 0) - np.sinc(turns)) <= 1e-14
