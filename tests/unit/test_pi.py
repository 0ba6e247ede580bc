"""The weighted PI controller, Eqns 28 and 29."""

import numpy as np
import pytest

from estimator.blocks.pi import feed_back, weigh


def test_weigh_two_corrections_is_eqn_28():
    """The total is the weighted sum."""
    rng = np.random.default_rng(0)
    roll_pitch, yaw, total = rng.normal(size=3), rng.normal(size=3), np.empty(3)
    weigh(0.3, roll_pitch, 1.2, yaw, total)
    np.testing.assert_allclose(total, 0.3 * roll_pitch + 1.2 * yaw, rtol=0, atol=1e-15)


def test_feed_back_small_correction_is_eqn_29():
    """P is the gain times the total, I adds up gain times dt times the total."""
    total, p, i = np.array([0.01, -0.02, 0.03]), np.zeros(3), np.array([0.001, 0.002, -0.003])
    before = i.copy()
    feed_back(total, 1.5, 0.02, 1.0, 0.02, p, i)
    np.testing.assert_allclose(p, 1.5 * total, rtol=0, atol=1e-16)
    np.testing.assert_allclose(i, before + 0.02 * 0.02 * total, rtol=0, atol=1e-16)


def test_feed_back_correction_beyond_any_offset_is_integrated_as_the_largest_offset():
    """P stays in full, I sees the same direction with the size that a believable offset would cause."""
    total, p, i = np.array([3.0, 0.0, -4.0]), np.zeros(3), np.zeros(3)
    feed_back(total, 2.0, 0.1, 0.5, 1.0, p, i)
    np.testing.assert_allclose(p, [6.0, 0.0, -8.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(i, 0.1 * np.array([0.15, 0.0, -0.2]), rtol=0, atol=1e-15)


def test_feed_back_for_ever_integral_stays_within_the_offset_limit():
    """A correction that never goes away cannot wind the integral up."""
    p, i = np.zeros(3), np.zeros(3)
    for _ in range(10_000):
        feed_back(np.array([0.2, -0.2, 0.0]), 1.0, 0.05, 0.1, 0.02, p, i)
    np.testing.assert_array_equal(i, [0.1, -0.1, 0.0])


@pytest.mark.parametrize(("w", "k_p", "k_i"), [(0.3, 1.0, 0.02), (0.3, 1.0, 0.3), (1.2, 0.5, 0.01)])
def test_feed_back_around_an_integrator_follows_the_closed_form_eigenvalues(w, k_p, k_i):
    """de/dt = b - K_P W e + w_I has the error b (exp(s1 t) - exp(s2 t)) / (s1 - s2), s^2 + K_P W s + K_I W = 0."""
    b, dt, n = 0.01, 1e-3, 60_000
    s1, s2 = np.roots([1.0, k_p * w, k_i * w])
    t = np.arange(1, n + 1) * dt
    closed = np.real(b * (np.exp(s1 * t) - np.exp(s2 * t)) / (s1 - s2))
    e, p, i, errors = 0.0, np.zeros(3), np.zeros(3), np.empty(n)
    for k in range(n):
        feed_back(np.array([-w * e, 0.0, 0.0]), k_p, k_i, np.inf, dt, p, i)
        e += dt * (b + p[0] + i[0])
        errors[k] = e
    # Euler steps: the error is of the order of |s| dt times the peak, b / (K_P W).
    np.testing.assert_allclose(errors, closed, rtol=0, atol=max(abs(s1), abs(s2)) * dt * b / (k_p * w))
