"""What all sensors share: errors drawn ahead of the flight, the converter, and the check of parameters.

Every source of error has its own named stream and is drawn for every tick as unit normal numbers that the
parameters then scale; one that is zero is not drawn.  So tick k's draw depends on neither the length of the
flight nor any other source, and switching one error off changes no other.

Coefficients are those of the Allan variance of a rate, IEEE Std 952-1997, annex C:

    sigma^2(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3

N, random walk of the angle    white noise; `sample_sigma` takes the density n = sqrt(2) N
B, bias instability            `flicker`; where it rules alone the deviation is sqrt(2 ln 2 / pi) B = 0.664 B
K, random walk of the rate     `random_walk`, sigma after a second
"""

import math
from collections.abc import Callable
from typing import Any, Final, Literal, get_args

import numpy as np

from estimator.compiler.jit import kernel
from estimator.interface import Array

MOST_BITS: Final = 24
MOST_CONVERSIONS: Final = 1000

Output = Literal["digital", "ratiometric", "absolute"]
Source = Callable[[str], np.random.Generator]  # name of a source -> its own generator


def require(params: Any, unit: str, *names: str, least: float = 0.0) -> None:
    """Refuse fields of `params` that are not finite or below `least`.

    Raises
    ------
    ValueError      names the field, its value, the unit and what would be right
    """
    for name in names:
        value = getattr(params, name)
        if not least <= value < math.inf:
            owner = type(params).__name__
            raise ValueError(f"{owner}.{name} = {value!r} {unit}: choose a finite number, at least {least:g}")


def require_converter(params: Any, unit: str, name: str) -> None:
    """Refuse a full scale (field `name`, in `unit`) or a number of `bits` no converter has: ValueError."""
    full_scale, bits, owner = getattr(params, name), params.bits, type(params).__name__
    if bits not in range(MOST_BITS + 1):
        raise ValueError(
            f"{owner}.bits = {bits!r} bit: choose a whole number from 1 to {MOST_BITS}, or 0 for no converter"
        )
    if not full_scale > 0.0 or (bits and math.isinf(full_scale)):
        raise ValueError(f"{owner}.{name} = {full_scale!r} {unit}: choose a number above 0, finite unless bits is 0")


def require_device(params: Any) -> None:
    """Refuse a bandwidth, a number of conversions or a kind of output that no part has: ValueError."""
    owner = type(params).__name__
    if not params.bandwidth_hz > 0.0:
        raise ValueError(f"{owner}.bandwidth_hz = {params.bandwidth_hz!r} Hz: choose a number above 0, or infinity")
    if params.conversions not in range(MOST_CONVERSIONS + 1):
        raise ValueError(
            f"{owner}.conversions = {params.conversions!r} per sample: choose a whole number from 1 to "
            f"{MOST_CONVERSIONS}, or 0 for a continuous mean"
        )
    if params.output not in get_args(Output):
        raise ValueError(f"{owner}.output = {params.output!r}: choose {', '.join(get_args(Output))}")


def require_scale(params: Any, unit: str, range_name: str, step_name: str) -> None:
    """Refuse a full scale that is not above 0 (infinite is none), or a converter step beyond it: ValueError."""
    full_scale, step, owner = getattr(params, range_name), getattr(params, step_name), type(params).__name__
    if not full_scale > 0.0:
        raise ValueError(f"{owner}.{range_name} = {full_scale!r} {unit}: choose a number above 0, or infinity")
    if not 0.0 <= step <= full_scale or math.isinf(step):
        raise ValueError(
            f"{owner}.{step_name} = {step!r} {unit}: choose a step within the range, or 0 for no converter"
        )


def sample_sigma(density_sqrt_hz: float, imu_hz: float) -> float:
    """Sigma of the mean over dt = 1 / `imu_hz` of white noise with a one-sided spectral density n, per root Hz.

    The power of that mean is that of the bandwidth 1 / (2 dt): n^2 / (2 dt).  Data sheets give n; the
    coefficient N of IEEE Std 952 belongs to the two-sided density, N^2 = n^2 / 2 = sigma^2 dt.
    """
    return density_sqrt_hz * math.sqrt(imu_hz / 2.0)


def random_walk(steps: Array, sigma_per_sqrt_s: float, dt_s: float) -> Array:
    """Integrated white noise, shape (n, 3), from unit normal `steps`; its sigma after t is s sqrt(t).

    `sigma_per_sqrt_s` is the coefficient K of IEEE Std 952, rate random walk.
    """
    return sigma_per_sqrt_s * math.sqrt(dt_s) * np.cumsum(steps, axis=0)


def gauss_markov(steps: Array, sigma: Array, time_constant_s: float, dt_s: float) -> Array:
    """First-order Gauss-Markov process, shape (n, 3), from unit normal `steps`, stationary at once.

    Gelb, Applied Optimal Estimation, 1974: x(k) = phi x(k-1) + s sqrt(1 - phi^2) w(k), phi = exp(-dt / T).

    sigma : shape (3,), of each axis at any time      time_constant_s : > 0, where the correlation is 1 / e
    """
    process = steps.copy()
    _recur(process, math.exp(-dt_s / time_constant_s))
    return process * sigma


@kernel
def _recur(x, phi):  # type: ignore[no-untyped-def]
    fresh = np.sqrt(1.0 - phi * phi)
    for k in range(1, x.shape[0]):
        for i in range(x.shape[1]):
            x[k, i] = phi * x[k - 1, i] + fresh * x[k, i]


FLICKER_RATIO: Final = 5.0  # of neighbouring correlation times; flat to 0.1 %, see `flicker`
FLICKER_TIMES_S: Final = 0.1 * FLICKER_RATIO ** np.arange(8)  # 0.1 s to 2.2 h


def flicker_sigmas(coefficient: float) -> Array:
    """Sigma of each Gauss-Markov process in `flicker`, shape (8,), in the unit of `coefficient`.

    A process of variance s^2 and correlation time T has the one-sided spectral density
    4 s^2 T / (1 + (2 pi f T)^2) (Gelb, 1974).  Spread over all T with s^2 = B^2 / pi per unit of ln T these
    add up to B^2 / (pi f), the flicker noise of IEEE Std 952 (there two-sided, B^2 / (2 pi f)).

    The first and last also stand for the endless rows of faster and slower ones left out: at short times
    the Allan variance goes with s^2 / T, at long times with s^2 T, and 1 + 1/r + 1/r^2 + ... = r / (r - 1).
    """
    variance = np.full(len(FLICKER_TIMES_S), coefficient**2 / math.pi * math.log(FLICKER_RATIO))
    variance[[0, -1]] *= FLICKER_RATIO / (FLICKER_RATIO - 1.0)
    return np.sqrt(variance)


def flicker(steps: Array, coefficient: float, dt_s: float) -> Array:
    """Flicker noise (bias instability), shape (n, 3), from unit normal `steps`, shape (n, 8, 3), stationary at once.

    `coefficient` is B of IEEE Std 952.  The sum of independent Gauss-Markov processes of the times
    FLICKER_TIMES_S has an Allan deviation within 0.3 % of 0.664 B for means over 1 s to 1000 s, within 2 % from
    0.5 s to 5000 s; below, it falls, as the noise of a part is white there.  Its sigma at any time is 2.1 B.
    """
    total = np.zeros((len(steps), 3))
    _recur_and_sum(steps, np.exp(-dt_s / FLICKER_TIMES_S), flicker_sigmas(coefficient), total)
    return total


@kernel
def _recur_and_sum(steps, phi, sigma, total):  # type: ignore[no-untyped-def]
    """Recur as `gauss_markov`, all processes at once: 8 times fewer passes through the memory."""
    fresh = np.sqrt(1.0 - phi * phi)
    x = steps[0].copy()
    for k in range(steps.shape[0]):
        for j in range(phi.shape[0]):
            for i in range(3):
                if k > 0:
                    x[j, i] = phi[j] * x[j, i] + fresh[j] * steps[k, j, i]
                total[k, i] += sigma[j] * x[j, i]
