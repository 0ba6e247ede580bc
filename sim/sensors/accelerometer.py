"""Accelerometer: bias, noise, saturation and quantisation on the specific force at the centre of gravity.

reading = convert(f + bias + noise)

`f` is acceleration minus gravity, mean over the tick: level at rest (0, 0, -g).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.jit import kernel
from sim.clock import Rates
from sim.sensors.noise import (
    STANDARD_GRAVITY_M_S2,
    Source,
    convert,
    require,
    require_converter,
    sample_sigma,
    step_of,
)


@dataclass(frozen=True, slots=True)
class AccelerometerParams:
    """Errors of a three-axis accelerometer; each sigma is over flights and axes.

    The defaults are a cheap analogue MEMS part.

    bias_g : sigma of the bias, constant in a flight
    noise_g : sigma of the white noise of a sample at 50 Hz; grows with the root of the rate
    range_g : full scale, readings clip at it      bits : of the converter over +-range; 0 is not quantised
    """

    bias_g: float = 0.02
    noise_g: float = 0.02
    range_g: float = 3.0
    bits: int = 10

    def __post_init__(self) -> None:
        require(self, "g", "bias_g", "noise_g")
        require_converter(self, "g", "range_g")


UNIT = np.dtype([("step_m_s2", "f8"), ("range_m_s2", "f8")], align=True)
NOISE = (("force_bias_b_m_s2", "f8", (3,)), ("force_noise_b_m_s2", "f8", (3,)))


def make(params: AccelerometerParams, unit: NDArray[np.void]) -> None:
    """Make one accelerometer: set its converter in `unit`, shape (1,) of UNIT."""
    unit["range_m_s2"] = params.range_g * STANDARD_GRAVITY_M_S2
    unit["step_m_s2"] = step_of(params.range_g * STANDARD_GRAVITY_M_S2, params.bits)


def draw(params: AccelerometerParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw bias and noise of every tick of a flight into the columns NOISE of `noise`, shape (n,)."""
    bias_g = params.bias_g * source("accelerometer bias").standard_normal(3)
    white = source("accelerometer noise").standard_normal((len(noise), 3))
    noise["force_bias_b_m_s2"] = bias_g * STANDARD_GRAVITY_M_S2
    noise["force_noise_b_m_s2"] = sample_sigma(params.noise_g, rates.imu_hz) * STANDARD_GRAVITY_M_S2 * white


@kernel
def measure_force(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Fill the accelerometer reading of row `k`, and the bias in the truth; `unit` is a record of UNIT."""
    row, errors = truth[k], noise[k]
    for i in range(3):
        bias = errors.force_bias_b_m_s2[i]
        sensed = row.imu_force_b_m_s2[i] + bias + errors.force_noise_b_m_s2[i]
        measured[k].force_b_m_s2[i] = convert(sensed, unit.step_m_s2, unit.range_m_s2)
        row.force_bias_b_m_s2[i] = bias
