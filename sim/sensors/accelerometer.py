"""Accelerometer: bias, noise, saturation and quantisation on the specific force at the board.

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
from sim.sensors.board import BoardParams
from sim.sensors.device import carry, filter_noise, read_axis, shake, step_filter
from sim.sensors.noise import Output, Source, require, require_converter, require_device


@dataclass(frozen=True, slots=True)
class AccelerometerParams:
    """Errors of a three-axis accelerometer; each sigma is over flights and axes.

    The defaults are a cheap analogue MEMS part.  A larger figure is a worse accelerometer unless stated otherwise,
    and 0 removes that error.

    bias_g : sigma of the bias, constant in a flight (g, default 0.02)
    bias_per_k_mg : sigma of the bias change with temperature (mg per kelvin, default 0)
    bias_instability_ug : flicker noise, coefficient B of IEEE Std 952; Allan deviation 0.664 B (ug, default 0)
    walk_ug_sqrt_s : random walk, sigma of the bias after 1 s (ug per root second, default 0)
    noise_density_ug_sqrt_hz : one-sided white noise density, as in data sheets (ug per root Hz, default 4000)
    gain : sigma of the relative gain error (fraction, default 0)
    gain_per_k : sigma of its change with temperature (1/K, default 0)
    nonlinearity : sigma of the largest deviation from the straight line (fraction of full scale, default 0)
    cross_axis : sigma of each axis' sensitivity to another axis, misalignment in the part included
        (fraction, default 0)
    bandwidth_hz : -3 dB frequency of the low-pass filter (Hz, default inf: none).  Lower: less vibration, more lag
    range_g : full scale, where readings clip (g, default 3).  Lower: saturates in manoeuvres, but finer steps with
        the same bits
    bits : of the converter over +-range (default 10).  Higher: finer steps; 0 disables quantisation
    step_g : converter step (g, default 0: from range and bits).  Higher: coarser readings
    conversions : converter readings averaged per sample (default 0: continuous mean).  Lower, from 1: more aliasing
    output : digital, ratiometric (proportional to the supply) or absolute (fixed reference) (default digital)
    null_g : output voltage at zero force, in g (default 0).  Higher: a supply error adds more bias
    sensitivity_mv_g : of an analogue output (mV per g, default 0).  Higher: finer steps of the board's converter
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
        require(
            self, "bias_g", "bias_per_k_mg", "bias_instability_ug", "walk_ug_sqrt_s", "noise_density_ug_sqrt_hz",
            "gain", "gain_per_k", "nonlinearity", "cross_axis", "step_g", "null_g", "sensitivity_mv_g",
        )  # fmt: skip
        require_device(self)
        require_converter(self, "range_g")


UNIT = np.dtype([*device.DEVICE, ("off_centre", "i8")], align=True)
MEMORY = np.dtype([*device.MEMORY, ("felt", "f8", (3,))], align=True)  # mean force at the board, unfiltered
NOISE = (("force_bias_b_m_s2", "f8", (3,)), ("force_noise_b_m_s2", "f8", (3,)))


def _figures(params: AccelerometerParams, board: BoardParams) -> device.Figures:
    return device.Figures(
        "accelerometer", G_M_S2, (NOISE[0][0], NOISE[1][0]), full_scale=params.range_g,
        step=params.step_g, null=params.null_g, vibration=board.vibration_g,
        density_sqrt_hz=1e-6 * params.noise_density_ug_sqrt_hz, bias=params.bias_g,
        bias_per_k=1e-3 * params.bias_per_k_mg, drift_per_s=0.0, instability=1e-6 * params.bias_instability_ug,
        walk_sqrt_s=1e-6 * params.walk_ug_sqrt_s,
    )  # fmt: skip


def make(params: AccelerometerParams, board: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one accelerometer: draw the errors it keeps for life into `unit`, shape (1,) of UNIT."""
    device.make(_figures(params, board), params, board, rates, source, unit)
    unit["off_centre"] = any(board.lever_arm_b_m)


def draw(
    params: AccelerometerParams, board: BoardParams, rates: Rates, source: Source, noise: NDArray[np.void]
) -> None:
    """Draw bias and noise of every tick of a flight into the columns NOISE of `noise`, shape (n,)."""
    device.draw(_figures(params, board), board, rates, source, noise)


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
        turned = unit.M[i, 0] * force[0] + unit.M[i, 1] * force[1] + unit.M[i, 2] * force[2]
        reading, bias = read_axis(turned, i, errors.force_bias_b_m_s2[i], found[i], unit, state)
        measured[k].force_b_m_s2[i], row.force_bias_b_m_s2[i] = reading, bias


@kernel
def feel_force(truth, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Mean over tick k of the low-pass filtered force, lever arm and vibration included, into `memory.signal`.

    The truth holds only means of the force, h apart.  Within a tick the force is taken as the straight line with
    that mean and the rise since the mean of the tick before.  With x from mid-tick a force f(t) deviates from that
    line by (x^2 + h x - h^2 / 12) / 2 times its second derivative.  That deviation has zero mean, and a constant
    second derivative leaves no error in the filtered means: theirs is at most h^3 / 23 times the largest third
    derivative, to the next power of h, whatever the bandwidth.
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
