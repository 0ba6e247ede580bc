"""The building blocks of the sensors' errors against closed forms and chi-square bounds."""

import math

import numpy as np
import pytest
from scipy import stats

from sim.rng import stream
from sim.sensors.noise import gauss_markov, random_walk, sample_sigma

DOUBTED_ONCE_IN = 1e-5  # probability of a chi-square outside its bounds by chance


def assert_sigma(samples, sigma):
    """The sample variance about a mean of zero lies within the chi-square bounds of independent `samples`."""
    n = np.size(samples)
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], n)
    assert low <= np.sum(np.square(samples)) / sigma**2 <= high


def test_sample_sigma_is_the_density_times_the_root_of_half_the_rate():
    """One-sided density over the bandwidth of half the sample rate: 0.06 per root Hz is 0.3 at 50 Hz, 0.6 at 200."""
    assert sample_sigma(0.06, 50) == pytest.approx(0.3, rel=0, abs=1e-15)
    assert sample_sigma(0.06, 200) == pytest.approx(0.6, rel=0, abs=1e-15)


def test_random_walk_grows_with_the_root_of_time():
    """Sigma after t seconds is sigma sqrt(t), at several times and two rates."""
    for dt_s in (0.02, 0.005):
        walks = np.stack(
            [random_walk(stream(1, i, "w").standard_normal((round(16 / dt_s), 3)), 0.7, dt_s) for i in range(200)]
        )
        for t_s in (1, 4, 16):
            assert_sigma(walks[:, round(t_s / dt_s) - 1], 0.7 * math.sqrt(t_s))


def test_gauss_markov_is_stationary_with_the_given_sigma_and_correlation_time():
    """Sigma is the same at the start and later; the correlation after T is 1 / e."""
    sigma, T_s, dt_s = np.array([1.5, 1.5, 2.5]), 3.0, 0.02
    runs = np.stack([gauss_markov(stream(2, i, "g").standard_normal((301, 3)), sigma, T_s, dt_s) for i in range(1500)])
    for k in (0, 50, 300):
        assert_sigma(runs[:, k] / sigma, 1.0)
    before, after = runs[:, 100] / sigma, runs[:, 250] / sigma  # 150 ticks of 0.02 s: T apart
    # What is new after T is independent of what was: its variance is 1 - exp(-2).
    assert_sigma(after - before / math.e, math.sqrt(1.0 - math.exp(-2.0)))
    assert abs(np.mean(before * after) - 1.0 / math.e) <= 4.5 * math.sqrt(1.0 + math.exp(-2.0)) / math.sqrt(before.size)
