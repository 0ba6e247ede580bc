"""The low-pass filter of gyro and accelerometer against the closed form of a first-order lag, and the tick's mean."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from sim.clock import Rates
from sim.log import Log
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.device import low_pass
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import Suite, SuiteParams

INF = math.inf
NO_GYRO_ERROR = {
    "bias_deg_s": 0.0, "drift_deg_s_min": 0.0, "walk_deg_s_sqrt_s": 0.0, "noise_density_deg_s_sqrt_hz": 0.0,
    "gain": 0.0, "cross_axis": 0.0, "range_deg_s": INF, "bits": 0,
}  # fmt: skip
NO_FORCE_ERROR = {"bias_g": 0.0, "noise_density_ug_sqrt_hz": 0.0, "range_g": INF, "bits": 0}
AMPLITUDE = np.array([1.0, 2.0, 0.5])
PHASE = np.array([0.3, 1.7, -2.0])


def filtered(log, imu_hz, bandwidth_hz):
    """Gyro and accelerometer readings of `log` through parts with nothing but a bandwidth, each (n, 3)."""
    suite = Suite(
        SuiteParams(
            GyroParams(**NO_GYRO_ERROR, bandwidth_hz=bandwidth_hz),
            AccelerometerParams(**NO_FORCE_ERROR, bandwidth_hz=bandwidth_hz),
        ),
        rates_of(imu_hz),
        0,
    )
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log.measured["gyro_b_rad_s"], log.measured["force_b_m_s2"]


def rates_of(imu_hz):
    """Rates at which `imu_hz` is possible."""
    return Rates(physics_hz=200, imu_hz=imu_hz)


def swinging(n_ticks, imu_hz, f_hz):
    """A log whose rate and force are A sin(2 pi f t + phase), means and end values by their closed forms."""
    log, h, w = Log.empty(n_ticks), 1.0 / imu_hz, 2.0 * math.pi * f_hz
    end = np.arange(1, n_ticks + 1)[:, None] * h
    mean = AMPLITUDE * (np.cos(w * (end - h) + PHASE) - np.cos(w * end + PHASE)) / (w * h)
    log.truth["t_s"] = end[:, 0]
    log.truth["omega_b_rad_s"] = AMPLITUDE * np.sin(w * end + PHASE)
    log.truth["imu_omega_b_rad_s"] = log.truth["imu_force_b_m_s2"] = mean
    return log


def response(reading, imu_hz, f_hz):
    """Complex amplitude of each axis against the swing, by least squares at the middles of the ticks, shape (3,)."""
    middle = (np.arange(len(reading)) + 0.5) / imu_hz
    half = len(reading) // 2  # the start has died away
    e = np.exp(2j * math.pi * f_hz * middle[half:])
    c, *_ = np.linalg.lstsq(np.stack([e.imag, e.real], axis=1), reading[half:], rcond=None)
    return (c[0] + 1j * c[1]) / (AMPLITUDE * np.exp(1j * PHASE))


@pytest.mark.parametrize("imu_hz", [40, 50, 200])
@pytest.mark.parametrize("bandwidth_hz", [5.0, 42.0])
@pytest.mark.parametrize("f_hz", [1.0, 4.0, 10.0])
def test_bandwidth_amplitude_and_phase_are_those_of_a_first_order_lag(imu_hz, bandwidth_hz, f_hz):
    """1 / sqrt(1 + (f/fc)^2) and -atan(f/fc), times the sinc of the mean over a tick.

    Bounds of the reconstruction for a sine of unit amplitude, w h its angle in a tick: (w h)^4 / 720 for the gyro
    (parabola in the tick), (w h)^3 / 23 for the accelerometer (straight line); 1e-10 is the start dying away.
    """
    wh = 2.0 * math.pi * f_hz / imu_hz
    gyro, force = filtered(swinging(2 * imu_hz, imu_hz, f_hz), imu_hz, bandwidth_hz)
    ratio = f_hz / bandwidth_hz
    theory = np.sinc(f_hz / imu_hz) / math.sqrt(1.0 + ratio**2) * np.exp(-1j * math.atan(ratio))
    for reading, bound in ((gyro, wh**4 / 720.0), (force, wh**3 / 23.0)):
        error = np.abs(response(reading, imu_hz, f_hz) - theory)
        assert error.max() <= bound + 1e-10
        assert np.abs(np.abs(response(reading, imu_hz, f_hz)) - abs(theory)).max() <= bound + 1e-10


def test_bandwidth_errors_shrink_with_their_power_of_the_tick():
    """From 100 to 200 Hz the gyro's error falls 16 times, the accelerometer's 8 times, within a tenth."""
    errors = []
    for imu_hz in (100, 200):
        readings = filtered(swinging(2 * imu_hz, imu_hz, 4.0), imu_hz, 5.0)
        theory = np.sinc(4.0 / imu_hz) / (1.0 + 0.8j)
        errors.append([abs(response(r, imu_hz, 4.0) - theory).max() for r in readings])
    coarse, fine = errors
    assert coarse[0] / fine[0] == pytest.approx(16.0, rel=0.1)
    assert coarse[1] / fine[1] == pytest.approx(8.0, rel=0.1)


def test_gyro_behind_its_bandwidth_follows_a_parabola_exactly():
    """Rate t^2 from rest: the lag's answer is t^2 - 2 T t + 2 T^2 (1 - exp(-t / T)), its mean by integration."""
    imu_hz, T, n = 50, 1.0 / (2.0 * math.pi * 6.0), 60
    log, t = Log.empty(n), np.arange(n + 1) / imu_hz - 1.0 / imu_hz  # the first tick is at rest
    t[0] = 0.0
    log.truth["omega_b_rad_s"] = (t[1:] ** 2)[:, None]
    log.truth["imu_omega_b_rad_s"] = (np.diff(t**3 / 3.0) * imu_hz)[:, None]
    gyro, _ = filtered(log, imu_hz, 6.0)
    whole = t**3 / 3.0 - T * t**2 + 2.0 * T**2 * (t - T * (1.0 - np.exp(-t / T)))
    np.testing.assert_allclose(gyro[:, 1], np.diff(whole) * imu_hz, rtol=0, atol=1e-13)


def test_bandwidth_starts_in_the_steady_state():
    """A constant rate and force are read from the first tick on, to round-off."""
    log = Log.empty(100)
    log.truth["imu_omega_b_rad_s"] = log.truth["omega_b_rad_s"] = (0.4, -0.1, 2.0)
    log.truth["imu_force_b_m_s2"] = (1.0, -3.0, -9.8)
    gyro, force = filtered(log, 50, 3.0)
    np.testing.assert_allclose(gyro, log.truth["imu_omega_b_rad_s"], rtol=0, atol=1e-14)
    np.testing.assert_allclose(force, log.truth["imu_force_b_m_s2"], rtol=0, atol=1e-13)


@pytest.mark.parametrize("a", [1e-3, 0.1, 0.999, 1.001, 5.0, 100.0])
def test_low_pass_constants_are_the_integrals_they_stand_for(a):
    """J0, J1, J2 against adaptive quadrature, either side of where the arithmetic changes."""
    decay, *moments, lag = low_pass(a / (2.0 * math.pi), 1.0)
    assert (decay, lag) == (pytest.approx(math.exp(-a), rel=1e-12), pytest.approx(1.0 / a, rel=1e-12))
    legendre = (lambda s: 1.0, lambda s: 2.0 * s - 1.0, lambda s: 6.0 * s * s - 6.0 * s + 1.0)
    for got, P in zip(moments, legendre, strict=True):
        value, _ = quad(lambda s, P=P: a * math.exp(-a * (1.0 - s)) * P(s), 0.0, 1.0, epsabs=1e-13, limit=200)
        assert abs(got - value) <= 1e-12
