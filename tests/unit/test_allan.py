"""The Allan deviation against allantools, and the fit against noise whose coefficients are known."""

import math

import allantools
import numpy as np
import pytest

from sim.sensors import allan

RATE_HZ = 50.0


@pytest.mark.parametrize("n", [257, 4096])
def test_variance_equals_that_of_allantools(n: int) -> None:
    """Every axis and tau as allantools has it, round-off apart."""
    signal = np.cumsum(np.random.default_rng(1).standard_normal((n, 3)), axis=0) + 100.0
    m = allan.octaves(n)
    ours = np.sqrt(allan.variance(signal, m))
    for axis in range(3):
        _, theirs, _, _ = allantools.oadev(signal[:, axis], rate=RATE_HZ, data_type="freq", taus=m / RATE_HZ)
        np.testing.assert_allclose(ours[:, axis], theirs, rtol=1e-12, atol=0.0)


def test_octaves_stop_where_a_quarter_of_the_record_is_averaged() -> None:
    """The longest average leaves four of its length in the record."""
    assert allan.octaves(16).tolist() == [1, 2, 4]
    assert allan.octaves(31).tolist() == [1, 2, 4]
    assert allan.octaves(180_000)[-1] == 32_768


def test_fit_returns_the_coefficients_of_an_exact_curve() -> None:
    """A curve made of the three terms gives back their coefficients."""
    tau_s = allan.octaves(180_000) / RATE_HZ
    model = allan.NoiseModel(white=3e-3, flicker=4e-4, walk=2e-5)
    found = allan.fit(tau_s, model.deviation(tau_s)[:, None] ** 2)
    np.testing.assert_allclose(
        (found.white, found.flicker, found.walk), (model.white, model.flicker, model.walk), rtol=1e-9, atol=0.0
    )


@pytest.mark.parametrize("absent", ["white", "flicker", "walk"])
def test_fit_gives_nothing_to_a_term_that_is_absent(absent: str) -> None:
    """What does not shape the curve is zero, and never negative."""
    tau_s = allan.octaves(180_000) / RATE_HZ
    model = allan.NoiseModel(**({"white": 3e-3, "flicker": 4e-4, "walk": 2e-5} | {absent: 0.0}))
    found = allan.fit(tau_s, model.deviation(tau_s)[:, None] ** 2)
    assert 0.0 <= getattr(found, absent) < 1e-9


def test_fit_of_silence_is_zero() -> None:
    """A sensor without noise has none."""
    tau_s = allan.octaves(64) / RATE_HZ
    assert allan.fit(tau_s, np.zeros((len(tau_s), 3))) == allan.NoiseModel(0.0, 0.0, 0.0)


def test_fit_finds_white_noise_and_random_walk_of_a_synthetic_record() -> None:
    """White noise of a one-sided density and a random walk come out as they went in."""
    density, walk, n, axes = 0.06, 0.02, 40_000, 16
    source = np.random.default_rng(2)
    # The mean over 1/f of a one-sided density d has the variance d^2 f / 2; a walk grows by K / sqrt(f) a sample.
    signal = density * math.sqrt(RATE_HZ / 2.0) * source.standard_normal((n, axes))
    signal += np.cumsum(walk / math.sqrt(RATE_HZ) * source.standard_normal((n, axes)), axis=0)
    m = allan.octaves(n)
    found = allan.fit(m / RATE_HZ, allan.variance(signal, m))
    # Over 40 seeds the two scatter by 0.13 % and 2.5 %: 5 sigma.
    assert found.density == pytest.approx(density, rel=0.0065)
    assert found.walk == pytest.approx(walk, rel=0.125)


def test_fit_reads_flicker_noise_at_its_standard_floor() -> None:
    """Flicker noise alone, made in the frequency domain, has the deviation 0.664 B at every tau."""
    B, n, axes = 0.01, 2**16, 32
    source = np.random.default_rng(3)
    f_hz = np.fft.rfftfreq(n, 1.0 / RATE_HZ)[1:]
    # One-sided density of flicker noise, IEEE Std 952: B^2 / (pi f) (two-sided B^2 / (2 pi f)).
    amplitude = np.sqrt(B**2 / (math.pi * f_hz) * RATE_HZ * n / 2.0)
    spectrum = np.zeros((len(f_hz) + 1, axes), complex)
    spectrum[1:] = amplitude[:, None] * (
        source.standard_normal((len(f_hz), axes)) + 1j * source.standard_normal((len(f_hz), axes))
    ) / math.sqrt(2.0)  # fmt: skip
    signal = np.fft.irfft(spectrum, n, axis=0)
    m = allan.octaves(n)[3:-2]  # a sample's own mean and the record's period bend the ends
    variances = allan.variance(signal, m)
    deviation = np.sqrt(variances.mean(axis=1))
    np.testing.assert_allclose(deviation, math.sqrt(2.0 * math.log(2.0) / math.pi) * B, rtol=0.06)
    assert allan.fit(m / RATE_HZ, variances).flicker == pytest.approx(B, rel=0.05)


def test_variance_of_an_average_longer_than_half_the_record_is_refused() -> None:
    """The message names the length and what would be right."""
    with pytest.raises(ValueError, match=r"record of 10: choose from 1 to 5"):
        allan.variance(np.zeros((10, 1)), np.array([6]))
