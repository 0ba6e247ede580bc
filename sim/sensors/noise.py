"""What all sensors share: errors drawn ahead of the flight, the converter, and the check of parameters.

Every source of error has its own named stream and is drawn for every tick, used or not, as unit normal
numbers that the parameters then scale.  So tick k's draw depends on neither the length of the flight nor any
other source, and switching one error off changes no other.
"""

import math
from collections.abc import Callable
from typing import Any, Final, Literal, get_args

import numpy as np

from estimator.interface import Array
from estimator.jit import kernel

STANDARD_GRAVITY_M_S2: Final = 9.80665  # what a data sheet means by 1 g
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
    """Sigma of the mean over 1 / `imu_hz` of white noise with a one-sided spectral density, in its unit per root Hz.

    The power of the mean over a time dt is that of a bandwidth of 1 / (2 dt).
    """
    return density_sqrt_hz * math.sqrt(imu_hz / 2.0)


def random_walk(steps: Array, sigma_per_sqrt_s: float, dt_s: float) -> Array:
    """Integrated white noise, shape (n, 3), from unit normal `steps`; its sigma after t is s sqrt(t)."""
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


def step_of(full_scale: float, bits: int) -> float:
    """Size of one converter step over +-`full_scale` with `bits` bits; 0 where nothing is quantised."""
    return 2.0 * full_scale / 2**bits if bits else 0.0


@kernel
def convert(x, step, full_scale):  # type: ignore[no-untyped-def]
    """What the converter makes of `x`: the nearest of its levels, clipped to its range.

    Two's complement: the lowest level is -full_scale, the highest one step below +full_scale.
    """
    if step == 0.0:
        return min(max(x, -full_scale), full_scale)
    highest = full_scale / step - 1.0
    return step * min(max(np.floor(x / step + 0.5), -highest - 1.0), highest)
