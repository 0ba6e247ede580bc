"""Allan deviation of a signal at rest, and the noise model fitted to it.

With x the integral of the signal and tau = m / rate, the overlapping Allan variance is the mean of
(x(t + 2 tau) - 2 x(t + tau) + x(t))^2 / (2 tau^2) over all t (Riley, Handbook of Frequency Stability Analysis,
NIST SP 1065, Eqn 11).  For the noise of an inertial sensor it is (IEEE Std 952-1997, Annex C)

AVAR(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3

with white noise N, flicker noise B and rate random walk K.  N is two-sided; data sheets give the one-sided density
n = sqrt(2) N.  The deviation of flicker noise alone is flat at 0.664 B.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array

FLICKER: Final = 2.0 * math.log(2.0) / math.pi  # Allan variance of flicker noise with B = 1
SHORTEST_RECORD: Final = 4  # in longest averages
MODEL_ERROR: Final = 0.01  # relative: the three terms need not fit better than this


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Coefficients of IEEE Std 952, in the unit of the signal.

    white : N, unit sqrt(s)      flicker : B, unit      walk : K, unit / sqrt(s)
    """

    white: float
    flicker: float
    walk: float

    @property
    def density(self) -> float:
        """One-sided density of the white noise, unit / sqrt(Hz), as data sheets give it."""
        return math.sqrt(2.0) * self.white

    def deviation(self, tau_s: Array) -> Array:
        """The Allan deviation of this noise at `tau_s`, shape (n,)."""
        variance = self.white**2 / tau_s + FLICKER * self.flicker**2 + self.walk**2 * tau_s / 3.0
        return np.asarray(np.sqrt(variance))


def octaves(n: int) -> NDArray[np.int64]:
    """Powers of two to average over in a record of `n` samples."""
    return 2 ** np.arange(max(1, int(math.log2(n / SHORTEST_RECORD)) + 1))


def variance(signal: Array, m: NDArray[np.int64]) -> Array:
    """Overlapping Allan variance of `signal`, shape (n, axes), averaged over `m` samples; shape (len(m), axes).

    Raises
    ------
    ValueError      an average longer than half the record, or shorter than a sample
    """
    n = len(signal)
    if np.any(m < 1) or np.any(2 * m > n):
        raise ValueError(f"averages over {m.tolist()} samples of a record of {n}: choose from 1 to {n // 2}")
    x = np.zeros((signal.shape[1], n + 1))
    np.cumsum((signal - signal.mean(axis=0)).T, axis=1, out=x[:, 1:])  # removing the mean preserves precision
    return np.asarray(_variance(x, m))


@kernel
def _variance(x, several):  # type: ignore[no-untyped-def]
    found = np.zeros((len(several), x.shape[0]))
    for j in range(len(several)):
        m = several[j]
        terms = x.shape[1] - 2 * m
        for axis in range(x.shape[0]):
            total = 0.0
            for i in range(terms):
                second = x[axis, i + 2 * m] - 2.0 * x[axis, i + m] + x[axis, i]
                total += second * second
            found[j, axis] = total / (2.0 * m * m * terms)
    return found


def fit(tau_s: Array, variances: Array) -> NoiseModel:
    """Noise model whose Allan variance is closest to the mean of `variances`, shape (n, axes), at `tau_s`, shape (n,).

    Least squares of the relative residuals, no coefficient below zero (Lawson & Hanson, Solving Least Squares
    Problems, 1974).  With several axes, residuals are weighted by the scatter of their mean: a record has few long
    averages.
    """
    from scipy.optimize import nnls

    mean, axes = variances.mean(axis=1), variances.shape[1]
    if not np.all(mean > 0.0):
        return NoiseModel(0.0, 0.0, 0.0)
    scatter = np.std(variances, axis=1, ddof=1) / mean / math.sqrt(axes) if axes > 1 else np.zeros_like(mean)
    weight = 1.0 / np.hypot(scatter, MODEL_ERROR)
    shapes = np.column_stack([1.0 / tau_s, np.full_like(tau_s, FLICKER), tau_s / 3.0])
    relative = shapes * (weight / mean)[:, None]
    scale = np.linalg.norm(relative, axis=0)  # normalised columns: they differ by many powers of ten
    squares, _ = nnls(relative / scale, weight)
    white, flicker, walk = np.sqrt(squares / scale).tolist()
    return NoiseModel(white, flicker, walk)
