"""The accelerometer away from the centre of gravity, against closed forms of rotation."""

import math

import numpy as np
import pytest

from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import Coning
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.suite import Suite, SuiteParams

ARM = np.array([0.11, -0.04, 0.07])
NO_ERROR = AccelerometerParams(bias_g=0.0, noise_density_ug_sqrt_hz=0.0, range_g=math.inf, bits=0)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def felt(omega_of, n_ticks, imu_hz, arm=ARM):
    """What the lever arm adds, shape (n_ticks, 3), when the body rate is `omega_of` (times) -> (n, 3)."""
    log, h = Log.empty(n_ticks), 1.0 / imu_hz
    end = np.arange(1, n_ticks + 1) * h
    log.truth["omega_b_rad_s"] = omega_of(end)
    for node, weight in zip(NODES, 0.5 * WEIGHTS, strict=True):
        log.truth["imu_omega_b_rad_s"] += weight * omega_of(end + 0.5 * h * (node - 1.0))
    suite = Suite(SuiteParams(accelerometer=NO_ERROR, board=BoardParams(tuple(arm))), Rates(imu_hz=imu_hz), 0)
    suite.reset(log)
    for k in range(n_ticks):
        suite.measure(k)
    return log.measured["force_b_m_s2"]


def test_steady_rotation_is_felt_as_the_centripetal_acceleration():
    """rate^2 times the distance from the axis, towards it: 5 rad/s about z, 0.11 m forward, 0.04 m left."""
    force = felt(lambda t: np.tile([0.0, 0.0, 5.0], (len(t), 1)), 10, 50)
    np.testing.assert_allclose(force, np.tile([-25.0 * 0.11, 25.0 * 0.04, 0.0], (10, 1)), rtol=0, atol=1e-14)


def test_steady_rotation_about_any_axis_pulls_towards_it():
    """Perpendicular to the axis, rate^2 times the distance, no part along the axis."""
    omega = np.array([2.0, -3.0, 1.5])
    force = felt(lambda t: np.tile(omega, (len(t), 1)), 3, 100)[-1]
    axis = omega / np.linalg.norm(omega)
    towards = -(ARM - axis * (axis @ ARM))
    np.testing.assert_allclose(force, omega @ omega * towards, rtol=0, atol=1e-14)


def swing_means(peak_rad_s, w, n_ticks, h):
    """Closed-form means over ticks of rate^2 and of the angular acceleration, for the rate peak sin(w t)."""
    t = np.arange(n_ticks + 1) * h
    squared = peak_rad_s**2 * (t / 2.0 - np.sin(2.0 * w * t) / (4.0 * w))
    return np.diff(squared) / h, np.diff(peak_rad_s * np.sin(w * t)) / h


@pytest.mark.parametrize("imu_hz", [40, 50, 100, 200])
def test_sinusoidal_rotation_is_felt_to_the_bound_of_the_parabola(imu_hz):
    """Pitching at 2 Hz with 3 rad/s: angular acceleration exact, centripetal within 3^2 (w h)^4 / 360 times the arm.

    The parabola misses the third Legendre component of the rate, w^3 h^3 / 120 of its peak; with the first, w h / 2,
    the mean square errs by 2/3 of their product, at most (w h)^4 / 360.  The first tick has no rate before it.
    """
    w, h, n = 4.0 * math.pi, 1.0 / imu_hz, 2 * imu_hz
    force = felt(lambda t: 3.0 * np.sin(w * t)[:, None] * [0.0, 1.0, 0.0], n, imu_hz)[1:]
    squared, acceleration = (a[1:] for a in swing_means(3.0, w, n, h))
    bound = 9.0 * (w * h) ** 4 / 360.0 * np.abs(ARM).max()
    np.testing.assert_allclose(force[:, 0], acceleration * ARM[2] - squared * ARM[0], rtol=0, atol=bound)
    np.testing.assert_allclose(force[:, 2], -acceleration * ARM[0] - squared * ARM[2], rtol=0, atol=bound)
    np.testing.assert_array_equal(force[:, 1], 0.0)
    # On the axis of the arm's other component the centripetal part is absent, and the rest is exact.
    only_up = felt(lambda t: 3.0 * np.sin(w * t)[:, None] * [0.0, 1.0, 0.0], n, imu_hz, (0.0, 0.0, 0.1))[1:]
    np.testing.assert_allclose(only_up[:, 0], 0.1 * acceleration, rtol=0, atol=1e-12)


def test_sinusoidal_rotation_error_falls_with_the_fourth_power_of_the_tick():
    """Centripetal means at 50, 100 and 200 Hz: each halving divides the error by 16, within a tenth."""
    w, errors = 4.0 * math.pi, []
    for imu_hz in (50, 100, 200):
        n = 2 * imu_hz
        force = felt(lambda t: 3.0 * np.sin(w * t)[:, None] * [0.0, 0.0, 1.0], n, imu_hz, (1.0, 0.0, 0.0))[1:, 0]
        errors.append(np.abs(force + swing_means(3.0, w, n, 1.0 / imu_hz)[0][1:]).max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.1)


def test_rate_that_is_a_parabola_about_every_axis_is_felt_exactly():
    """Means over ticks of omega x (omega x r) + d(omega)/dt x r, by a quadrature that is exact for a polynomial."""
    a, b, c = np.array([1.0, -2.0, 0.5]), np.array([30.0, 25.0, -40.0]), np.array([-900.0, 700.0, 1100.0])
    n, imu_hz = 8, 50

    def omega(t):
        return a + np.outer(t, b) + np.outer(t * t, c)

    end, h, mean = np.arange(1, n + 1) / imu_hz, 1.0 / imu_hz, 0.0
    for node, weight in zip(NODES, 0.5 * WEIGHTS, strict=True):
        t = end + 0.5 * h * (node - 1.0)
        turning = b + 2.0 * np.outer(t, c)
        mean = mean + weight * (np.cross(omega(t), np.cross(omega(t), ARM)) + np.cross(turning, ARM))
    np.testing.assert_allclose(felt(omega, n, imu_hz)[1:], mean[1:], rtol=0, atol=1e-11)  # some eps of 600 m/s^2
    bulges = 0.5 * h * h / 6.0 * np.abs(c)  # what the parabola has more than a straight line
    assert (bulges**2 / 5.0).min() * np.abs(ARM).min() > 1e-6  # and what its square adds is seen


def acceleration_from_attitude(motion, t_s, arm):
    """R^T d2(R)/dt2 arm, shape (n, 3): from the attitude alone, by the 7-point stencil (error some 1e-10)."""
    step, stencil = 5e-3, (2.0 / 180, -27.0 / 180, 270.0 / 180, -490.0 / 180, 270.0 / 180, -27.0 / 180, 2.0 / 180)
    second = sum(c * motion.at(t_s + (i - 3) * step).R_eb for i, c in enumerate(stencil)) / step**2
    return np.einsum("nji,njk,k->ni", motion.at(t_s).R_eb, second, arm)


def test_coning_is_felt_as_the_second_derivative_of_the_attitude():
    """Means over ticks of R^T R'' r, which knows neither the rate nor the formula of the lever arm.

    Bound: four products of rates of at most 0.5 rad/s, each within (0.5 rad/s)^2 (w h)^4 / 360, times the arm;
    the stencil's error is 3e-10.
    """
    motion, imu_hz, n = Coning(math.radians(5.0), 2.0 * math.pi), 50, 50
    force = felt(lambda t: motion.at(t).omega_b_rad_s, n, imu_hz)[1:]
    end, h, mean = np.arange(2, n + 1) / imu_hz, 1.0 / imu_hz, 0.0
    for node, weight in zip(NODES, 0.5 * WEIGHTS, strict=True):
        mean = mean + weight * acceleration_from_attitude(motion, end + 0.5 * h * (node - 1.0), ARM)
    rate = 2.0 * math.pi * math.sin(math.radians(5.0))
    bound = 4.0 * rate**2 * (2.0 * math.pi * h) ** 4 / 360.0 * np.abs(ARM).max() + 1e-9
    np.testing.assert_allclose(force, mean, rtol=0, atol=bound)
    assert np.abs(mean).max() >= 1e3 * bound
