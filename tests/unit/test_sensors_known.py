"""What the data sheets tell flight code of the noise and the biases, against draws of the same and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.clock import Rates
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.known import data_sheets
from sim.sensors.suite import SuiteParams

RATES = Rates(imu_hz=50, gps_hz=4)
G_M_S2 = 9.80665
SILENT = SuiteParams(
    gyro=GyroParams(noise_density_deg_s_sqrt_hz=0.0, bits=0),
    accelerometer=AccelerometerParams(noise_density_ug_sqrt_hz=0.0, bits=0),
)


def known(**parts):
    """The figures of a suite without noise in which some parts are others."""
    suite = replace(SILENT, **parts)
    return {name: entry.value for name, entry in data_sheets(suite, RATES, "test").items()}


def test_velocity_from_positions_is_as_noisy_and_late_as_differences_of_positions():
    """Two positions half a second apart, each 0.8 m off at random: drawn a hundred thousand times, within 1 %."""
    figures = known(gps=GpsParams(course="positions", noise_horizontal_m=0.8, latency_s=0.3))
    off = np.random.default_rng(1).normal(0.0, 0.8, (100_000, 2))
    velocity = (off[:, 1] - off[:, 0]) / (2.0 / 4.0)
    assert figures["gps_noise_m_s"] == pytest.approx(velocity.std(), rel=0.01)  # of a sigma 1 / sqrt(2e5) is 0.2 %
    assert figures["gps_latency_s"] == pytest.approx(0.3 + 0.25, rel=0, abs=1e-12)
    assert figures["gps_stamped"] is False


@pytest.mark.parametrize(
    ("resolution", "step_m_s"), [("none", 0.0), ("nmea", 0.01 * 1852.0 / 3600.0), ("binary", 1e-3)]
)
def test_velocity_noise_is_that_of_the_receiver_and_of_the_last_digit(resolution, step_m_s):
    """White noise, wander and rounding add up as squares; two lags in series delay like their sum."""
    gps = GpsParams(
        velocity_noise_m_s=3e-4, velocity_wander_m_s=4e-4, resolution=resolution, filter_s=0.6, smoothing_s=0.3
    )
    rounding = np.random.default_rng(2).uniform(-0.5, 0.5, 100_000).std() * step_m_s
    assert known(gps=gps)["gps_noise_m_s"] == pytest.approx(math.hypot(5e-4, rounding), rel=0.01)
    assert known(gps=gps)["gps_filter_s"] == pytest.approx(0.9, rel=0, abs=1e-12)


def test_converter_alone_has_the_density_of_its_rounding():
    """White over 25 Hz: a standard deviation s in every sample of 20 ms has the density s sqrt(2 x 0.02)."""
    rounding = np.random.default_rng(3).uniform(-0.5, 0.5, 100_000).std()
    part = AccelerometerParams(noise_density_ug_sqrt_hz=0.0, step_g=0.01, bits=10)
    expected = rounding * 0.01 * G_M_S2 * math.sqrt(2.0 * 0.02)
    assert known(accelerometer=part)["force_noise_m_s2_sqrt_hz"] == pytest.approx(expected, rel=0.01)
    gyro = GyroParams(noise_density_deg_s_sqrt_hz=0.0, step_deg_s=0.5, bits=12)
    expected = rounding * math.radians(0.5) * math.sqrt(2.0 * 0.02)
    assert known(gyro=gyro)["gyro_noise_rad_s_sqrt_hz"] == pytest.approx(expected, rel=0.01)


def test_density_of_an_unfiltered_part_is_its_own():
    """A continuous mean of white noise neither adds to its density nor takes from it."""
    gyro = GyroParams(noise_density_deg_s_sqrt_hz=0.05, bits=0)
    assert known(gyro=gyro)["gyro_noise_rad_s_sqrt_hz"] == pytest.approx(math.radians(0.05), rel=1e-9)
    part = AccelerometerParams(noise_density_ug_sqrt_hz=400.0, bits=0)
    assert known(accelerometer=part)["force_noise_m_s2_sqrt_hz"] == pytest.approx(4e-4 * G_M_S2, rel=1e-9)


@pytest.mark.parametrize(("rest_s", "left"), [(0.0, 1.0), (2.0, 0.0)])
def test_gyro_bias_is_what_a_calibration_at_rest_leaves(rest_s, left):
    """Warming, flicker, drift and gravity come later; the bias of power-up is known where the board rests first."""
    gyro = GyroParams(
        bias_deg_s=1.0, bias_per_k_deg_s=0.03, bias_instability_deg_s=0.1, drift_deg_s_min=0.2,
        g_sensitivity_deg_s_g=0.05, gain=0.01, gain_per_k=2e-4, nonlinearity=2e-3,
    )  # fmt: skip
    figures = known(gyro=gyro, board=BoardParams(warming_k=10.0, rest_s=rest_s))
    expected = math.hypot(left, 0.3, 2.0 * 0.1, 0.2, 0.05)
    assert figures["gyro_bias_sigma_rad_s"] == pytest.approx(math.radians(expected), rel=1e-9)
    assert figures["gyro_gain_sigma"] == pytest.approx(math.hypot(0.01, 2e-3, 2e-3), rel=1e-9)


def test_accelerometer_bias_is_all_that_looks_like_one_in_steady_flight():
    """Bias, warming, gain, cross axes and a board mounted 2 degrees off, each on 1 g."""
    part = AccelerometerParams(bias_g=0.02, bias_per_k_mg=0.5, gain=0.01, cross_axis=0.015)
    figures = known(accelerometer=part, board=BoardParams(warming_k=10.0, mounting_deg=(0.5, -2.0, 1.0)))
    expected = math.hypot(0.02, 0.005, 0.01, 0.015, math.radians(2.0)) * G_M_S2
    assert figures["force_bias_sigma_m_s2"] == pytest.approx(expected, rel=1e-9)
    assert figures["force_full_scale_m_s2"] == pytest.approx(3.0 * G_M_S2, rel=1e-12)
    crooked = math.hypot(GyroParams().cross_axis, math.radians(2.0))
    assert figures["gyro_cross_axis"] == pytest.approx(crooked, rel=1e-9)
