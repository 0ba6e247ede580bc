"""What all sensors share: noise drawn before the flight, and the validation of parameters.

Each error source has its own named random stream.  Unit normal numbers are drawn for every tick and scaled by the
parameters; a source whose parameter is zero is not drawn.  The draw of tick k therefore depends neither on the
length of the flight nor on other sources, and switching one error off leaves all others unchanged.

Coefficients are those of the Allan variance of a rate, IEEE Std 952-1997, annex C:

    sigma^2(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3

N, angle random walk           white noise; `sample_sigma` takes the density n = sqrt(2) N
B, bias instability            `flicker`; where it dominates the deviation is sqrt(2 ln 2 / pi) B = 0.664 B
K, rate random walk            `random_walk`, sigma after one second
"""

import math
from collections.abc import Callable
from typing import Any, Final, Literal, NoReturn, get_args

import numpy as np

from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.params import unit_of

MOST_BITS: Final = 24
MOST_CONVERSIONS: Final = 1000

Output = Literal["digital", "ratiometric", "absolute"]
Source = Callable[[str], np.random.Generator]  # name of an error source -> its generator


def require(params: Any, *names: str, least: float = 0.0, most: float = math.inf) -> None:
    """Check that fields of `params` are finite and from `least` to `most`.

    Raises
    ------
    ValueError      names the field, its value, its unit and the valid range
    """
    for name in names:
        value = getattr(params, name)
        if not least <= value < math.inf:
            _refuse(params, name, f"a finite number, at least {least:g}")
        if value > most:
            _refuse(params, name, f"at most {most:g} {unit_of(name)}".rstrip())


def require_triple(params: Any, *names: str) -> None:
    """Check that fields of `params` are three finite numbers: ValueError."""
    for name in names:
        value = getattr(params, name)
        if len(value) != 3 or not all(map(math.isfinite, value)):
            _refuse(params, name, "three finite numbers")


def require_positive(params: Any, *names: str) -> None:
    """Check that fields of `params` are above 0, or infinite: ValueError."""
    for name in names:
        if not getattr(params, name) > 0.0:
            _refuse(params, name, "a number above 0, or infinity")


def require_choice(params: Any, name: str, *choices: Any) -> None:
    """Check that a field of `params` is one of `choices`: ValueError."""
    if getattr(params, name) not in choices:
        _refuse(params, name, f"one of {', '.join(map(str, choices))}", unit="")


def require_converter(params: Any, name: str) -> None:
    """Check the full scale (field `name`) and the number of `bits` of a converter: ValueError."""
    if params.bits not in range(MOST_BITS + 1):
        _refuse(params, "bits", f"a whole number from 1 to {MOST_BITS}, or 0 for no converter")
    full_scale = getattr(params, name)
    if not full_scale > 0.0 or (params.bits and math.isinf(full_scale)):
        _refuse(params, name, "a number above 0, finite unless bits is 0")


def require_device(params: Any) -> None:
    """Check bandwidth, number of conversions and kind of output of an inertial sensor: ValueError."""
    require_positive(params, "bandwidth_hz")
    if params.conversions not in range(MOST_CONVERSIONS + 1):
        _refuse(params, "conversions", f"a whole number from 1 to {MOST_CONVERSIONS}, or 0 for a continuous mean")
    require_choice(params, "output", *get_args(Output))


def require_scale(params: Any, range_name: str, step_name: str) -> None:
    """Check that a full scale is above 0 (infinite: no limit) and a converter step within it: ValueError."""
    require_positive(params, range_name)
    step = getattr(params, step_name)
    if not 0.0 <= step <= getattr(params, range_name) or math.isinf(step):
        _refuse(params, step_name, "a step within the range, or 0 for no converter")


def _refuse(params: Any, name: str, choose: str, unit: str | None = None) -> NoReturn:
    if unit is None:
        unit = "per sample" if name == "conversions" else unit_of(name) or "(a fraction)"
    value = f"{getattr(params, name)!r} {unit}".rstrip()
    raise ValueError(f"{type(params).__name__}.{name} = {value}: choose {choose}")


def sample_sigma(density_sqrt_hz: float, imu_hz: float) -> float:
    """Sigma of the mean over dt = 1 / `imu_hz` of white noise with a one-sided spectral density n, per root Hz.

    That mean has the power of the bandwidth 1 / (2 dt): n^2 / (2 dt).  Data sheets give n; the coefficient N of
    IEEE Std 952 is two-sided, N^2 = n^2 / 2 = sigma^2 dt.
    """
    return density_sqrt_hz * math.sqrt(imu_hz / 2.0)


def random_walk(steps: Array, sigma_per_sqrt_s: float, dt_s: float) -> Array:
    """Integrated white noise, shape (n, 3), from unit normal `steps`; sigma grows as s sqrt(t).

    `sigma_per_sqrt_s` is the rate random walk coefficient K of IEEE Std 952.
    """
    return sigma_per_sqrt_s * math.sqrt(dt_s) * np.cumsum(steps, axis=0)


def gauss_markov(steps: Array, sigma: Array, time_constant_s: float, dt_s: float) -> Array:
    """First-order Gauss-Markov process, shape (n, 3), from unit normal `steps`, stationary from the start.

    Gelb, Applied Optimal Estimation, 1974: x(k) = phi x(k-1) + s sqrt(1 - phi^2) w(k), phi = exp(-dt / T).

    sigma : shape (3,), of each axis      time_constant_s : > 0, lag at which the correlation has fallen to 1 / e
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


def levelling_off(t_s: Array, time_constant_s: float) -> Array:
    """Time for which a drift has acted at its first rate, s: it begins as `t_s` and levels off at the time constant.

    The step response of a first-order lag, T (1 - exp(-t / T)), as of a body that warms up by Newton's law of cooling.
    """
    return np.asarray(-time_constant_s * np.expm1(-t_s / time_constant_s))


def lag_weights(time_constant_s: float, dt_s: float) -> tuple[float, float, float]:
    """Weights of a first-order lag over a tick: of its output at the start, and of its input at start and end.

    The exact solution for an input that is linear within the tick: y1 = a y0 + (1 - a - b) u0 + b u1 with
    a = exp(-dt / T), b = 1 - (1 - a) T / dt.  A time constant of 0 gives y1 = u1.
    """
    step = dt_s / time_constant_s if time_constant_s > 0.0 else math.inf
    before, end = math.exp(-step), 1.0 + math.expm1(-step) / step
    return before, 1.0 - before - end, end


@kernel
def to_step(x, step):  # type: ignore[no-untyped-def]
    """The multiple of `step` nearest to `x`; `x` itself if `step` is 0."""
    return step * np.floor(x / step + 0.5) if step > 0.0 else x


FLICKER_RATIO: Final = 5.0  # of neighbouring correlation times; flat to 0.1 %, see `flicker`
FLICKER_TIMES_S: Final = 0.1 * FLICKER_RATIO ** np.arange(8)  # 0.1 s to 2.2 h


def flicker_sigmas(coefficient: float) -> Array:
    """Sigma of each Gauss-Markov process in `flicker`, shape (8,), in the unit of `coefficient`.

    A process of variance s^2 and correlation time T has the one-sided spectral density
    4 s^2 T / (1 + (2 pi f T)^2) (Gelb, 1974).  Spread over all T with s^2 = B^2 / pi per unit of ln T these
    add up to B^2 / (pi f), the flicker noise of IEEE Std 952 (there two-sided, B^2 / (2 pi f)).

    The first and the last also represent all faster and slower processes left out: at short times the Allan
    variance goes with s^2 / T, at long times with s^2 T, and 1 + 1/r + 1/r^2 + ... = r / (r - 1).
    """
    variance = np.full(len(FLICKER_TIMES_S), coefficient**2 / math.pi * math.log(FLICKER_RATIO))
    variance[[0, -1]] *= FLICKER_RATIO / (FLICKER_RATIO - 1.0)
    return np.sqrt(variance)


def flicker(steps: Array, coefficient: float, dt_s: float) -> Array:
    """Flicker noise (bias instability), shape (n, 3), from unit normal `steps`, shape (n, 8, 3); stationary.

    `coefficient` is B of IEEE Std 952.  The sum of independent Gauss-Markov processes with the correlation
    times FLICKER_TIMES_S has an Allan deviation within 0.3 % of 0.664 B for means over 1 s to 1000 s, within 2 % from
    0.5 s to 5000 s.  Below that it falls; white noise dominates there.  Its sigma is 2.1 B at any time.
    """
    total = np.zeros((len(steps), 3))
    _recur_and_sum(steps, np.exp(-dt_s / FLICKER_TIMES_S), flicker_sigmas(coefficient), total)
    return total


@kernel
def _recur_and_sum(steps, phi, sigma, total):  # type: ignore[no-untyped-def]
    """As `gauss_markov`, all processes in one pass through memory instead of eight."""
    fresh = np.sqrt(1.0 - phi * phi)
    x = steps[0].copy()
    for k in range(steps.shape[0]):
        for j in range(phi.shape[0]):
            for i in range(3):
                if k > 0:
                    x[j, i] = phi[j] * x[j, i] + fresh[j] * steps[k, j, i]
                total[k, i] += sigma[j] * x[j, i]
