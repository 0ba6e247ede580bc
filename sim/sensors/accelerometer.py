"""Accelerometer: bias, noise, saturation and quantisation on the specific force at the centre of gravity.

reading = convert(supply(curve(M f) + bias(t) + noise)),   M = (1 + diag(gain) + cross-axis) R_sb
bias(t) = turn-on + slope x warming(t) + flicker noise + random walk

`f` is acceleration minus gravity, mean over the tick: level at rest (0, 0, -g).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from sim.clock import Rates
from sim.sensors import device
from sim.sensors.board import BoardParams, warming
from sim.sensors.device import carry, distort, filter_noise, on_supply, quantise, shake, step_filter
from sim.sensors.noise import (
    FLICKER_TIMES_S,
    Output,
    Source,
    flicker,
    random_walk,
    require,
    require_converter,
    require_device,
    sample_sigma,
)


@dataclass(frozen=True, slots=True)
class AccelerometerParams:
    """Errors of a three-axis accelerometer; each sigma is over flights and axes.

    The defaults are a cheap analogue MEMS part.

    bias_g : sigma of the bias, constant in a flight
    bias_per_k_mg : sigma of the change of the bias with temperature, mg per kelvin
    bias_instability_ug : flicker noise's coefficient B of IEEE Std 952; alone it has an Allan deviation of 0.664 B
    walk_ug_sqrt_s : the bias walks at random, sigma after one second, ug per root second
    noise_density_ug_sqrt_hz : one-sided spectral density of the white noise, as data sheets give it
    gain : sigma of the relative gain error        gain_per_k : sigma of its change with temperature, 1/K
    nonlinearity : sigma of the largest deviation from the straight line, as a fraction of the full scale
    cross_axis : sigma of each axis' sensitivity to another, crooked mounting inside the part included
    bandwidth_hz : -3 dB frequency of its low-pass filter; infinite is none
    range_g : full scale, readings clip at it      bits : of the converter over +-range; 0 is not quantised
    step_g : one step of the converter, where that is not what range and bits make; 0 is what they make
    conversions : of the converter averaged in a sample; 0 is a continuous mean
    output : digital, ratiometric (in proportion to the supply) or absolute (referred to a fixed voltage)
    null_g : its output voltage without force, expressed in g; what a wrong supply adds in proportion
    sensitivity_mv_g : of an analogue output; a board's converter makes its step of it
    """

    bias_g: float = 0.02
    bias_per_k_mg: float = 0.0
    bias_instability_ug: float = 0.0
    walk_ug_sqrt_s: float = 0.0
    noise_density_ug_sqrt_hz: float = 4000.0
    gain: float = 0.0
    gain_per_k: float = 0.0
    nonlinearity: float = 0.0
    cross_axis: float = 0.0
    bandwidth_hz: float = math.inf
    range_g: float = 3.0
    bits: int = 10
    step_g: float = 0.0
    conversions: int = 0
    output: Output = "digital"
    null_g: float = 0.0
    sensitivity_mv_g: float = 0.0

    def __post_init__(self) -> None:
        require(self, "g", "bias_g", "step_g", "null_g")
        require(self, "mV/g", "sensitivity_mv_g")
        require(self, "mg/K", "bias_per_k_mg")
        require(self, "ug", "bias_instability_ug")
        require(self, "ug/sqrt(s)", "walk_ug_sqrt_s")
        require(self, "ug/sqrt(Hz)", "noise_density_ug_sqrt_hz")
        require(self, "1/K", "gain_per_k")
        require(self, "(a fraction)", "gain", "cross_axis", "nonlinearity")
        require_device(self)
        require_converter(self, "g", "range_g")


UNIT = np.dtype([*device.DEVICE, ("off_centre", "i8")], align=True)
MEMORY = np.dtype([*device.MEMORY, ("felt", "f8", (3,))], align=True)  # mean force at the part, before its filter
NOISE = (("force_bias_b_m_s2", "f8", (3,)), ("force_noise_b_m_s2", "f8", (3,)))


def make(params: AccelerometerParams, board: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one accelerometer: draw the errors that stay for life into `unit`, shape (1,) of UNIT."""
    g = G_M_S2
    device.make(
        params, board, rates, source, unit, name="accelerometer",
        full_scale=params.range_g * g, step=params.step_g * g, null=params.null_g * g,
        shake=board.vibration_g * g, density_sqrt_hz=1e-6 * params.noise_density_ug_sqrt_hz * g,
    )  # fmt: skip
    unit["off_centre"] = any(board.lever_arm_b_m)


def draw(
    params: AccelerometerParams, board: BoardParams, rates: Rates, source: Source, noise: NDArray[np.void]
) -> None:
    """Draw bias and noise of every tick of a flight into the columns NOISE of `noise`, shape (n,)."""
    n, dt_s = len(noise), rates.dt_s
    bias_g = np.zeros(3)
    if params.bias_g:
        bias_g = bias_g + params.bias_g * source("accelerometer bias").standard_normal(3)
    if params.bias_per_k_mg and board.warming_k:
        slope_g_k = 1e-3 * params.bias_per_k_mg * source("accelerometer bias per kelvin").standard_normal(3)
        t_s = np.arange(1, n + 1, dtype=np.float64)[:, None] * dt_s
        bias_g = bias_g + slope_g_k * warming(board, t_s)
    if params.bias_instability_ug:
        steps = source("accelerometer flicker").standard_normal((n, len(FLICKER_TIMES_S), 3))
        bias_g = bias_g + flicker(steps, 1e-6 * params.bias_instability_ug, dt_s)
    if params.walk_ug_sqrt_s:
        steps = source("accelerometer walk").standard_normal((n, 3))
        bias_g = bias_g + random_walk(steps, 1e-6 * params.walk_ug_sqrt_s, dt_s)
    noise["force_bias_b_m_s2"] = bias_g * G_M_S2
    noise["force_noise_b_m_s2"] = 0.0
    if params.noise_density_ug_sqrt_hz:
        sigma_m_s2 = sample_sigma(1e-6 * params.noise_density_ug_sqrt_hz, rates.imu_hz) * G_M_S2
        noise["force_noise_b_m_s2"] = sigma_m_s2 * source("accelerometer noise").standard_normal((n, 3))


@kernel
def measure_force(truth, measured, noise, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Fill the accelerometer reading of row `k`, and the bias in the truth.

    `unit`, `memory` : records of UNIT and MEMORY       `board`, `state` : records of the board's UNIT and MEMORY
    """
    row, errors = truth[k], noise[k]
    force = row.imu_force_b_m_s2
    if unit.filters or unit.shakes or unit.off_centre:
        feel_force(truth, k, unit, board, memory, state)
        force = memory.signal
    found = errors.force_noise_b_m_s2
    if unit.noise_filters:
        filter_noise(found, noise[max(k - 1, 0)].force_noise_b_m_s2, k, unit, memory.noise)
        found = memory.noise
    for i in range(3):
        bias = errors.force_bias_b_m_s2[i]
        turned = unit.M[i, 0] * force[0] + unit.M[i, 1] * force[1] + unit.M[i, 2] * force[2]
        if unit.distorts:
            sensed = distort(turned, i, unit, state) + bias + found[i]
            sensed, bias = on_supply(sensed, unit, state), on_supply(bias, unit, state)
        else:
            sensed = turned + bias + found[i]
        measured[k].force_b_m_s2[i] = quantise(sensed, unit)
        row.force_bias_b_m_s2[i] = bias


@kernel
def feel_force(truth, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Mean over tick k of the force behind the low-pass filter, lever arm and vibration included, into `memory.signal`.

    Of the force the truth holds means alone, h apart.  In a tick it is taken as the straight line with that mean
    and the rise since the mean of the tick before.  With x from mid-tick a force f(t) errs from that line by
    (x^2 + h x - h^2 / 12) / 2 times its second derivative.  That has no mean, and while it stays the same it leaves
    no error in the means behind the filter: theirs is at most h^3 / 23 times the largest third derivative, to the
    next power of h, whatever the bandwidth.
    """
    signal = memory.signal
    for i in range(3):
        signal[i] = truth[k].imu_force_b_m_s2[i]
    if unit.off_centre:
        carry(truth, k, board, signal)
    if unit.filters:
        for i in range(3):
            mean = signal[i]
            rise = mean - memory.felt[i] if k > 0 else 0.0
            before = memory.filtered[i] if k > 0 else mean
            memory.felt[i] = mean
            after = step_filter(unit.low_pass, before, mean, rise, 0.0)
            memory.filtered[i] = after
            signal[i] = mean - (after - before) * unit.low_pass[4]
    if unit.shakes:
        shake(unit, board, state, signal)
