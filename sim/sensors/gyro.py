"""Rate gyro: turn-on bias, drift, random walk, noise, gain and cross-axis errors, saturation, quantisation.

reading = convert(supply(curve(M omega + G f) + bias(t) + noise)),   M = (1 + diag(gain) + cross-axis) R_sb,
bias(t) = turn-on + drift t + slope x warming(t) + flicker noise + random walk

`omega` is the mean inertial rate over the tick, f the mean force where the board sits, without its vibration.
The additive part bias(t) is what an estimator can learn as a bias; it is kept in the truth.  Terms as in IEEE Std
952 (rate ramp, bias instability, rate random walk, angle random walk).
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
from sim.sensors.device import carry, distort, filter_noise, on_supply, quantise, rate_shape, shake, step_filter
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
class GyroParams:
    """Errors of a three-axis rate gyro; each sigma is over flights and axes.

    The defaults are a cheap analogue MEMS part.

    bias_deg_s : sigma of the bias at turn-on, constant in a flight
    bias_per_k_deg_s : sigma of the change of the bias with temperature, deg/s per kelvin
    bias_instability_deg_s : flicker noise's coefficient B of IEEE Std 952; alone it has an Allan deviation of 0.664 B
    drift_deg_s_min : sigma of a steady change of the bias, deg/s per minute
    walk_deg_s_sqrt_s : the bias walks at random, sigma after one second, deg/s per root second
    noise_density_deg_s_sqrt_hz : one-sided spectral density of the white noise, as data sheets give it
    gain : sigma of the relative gain error        gain_per_k : sigma of its change with temperature, 1/K
    nonlinearity : sigma of the largest deviation from the straight line, as a fraction of the full scale
    cross_axis : sigma of each axis' sensitivity to another, crooked mounting inside the part included
    g_sensitivity_deg_s_g : sigma of each axis' response to each axis' specific force, deg/s per g
    bandwidth_hz : -3 dB frequency of its low-pass filter; infinite is none
    range_deg_s : full scale, readings clip at it  bits : of the converter over +-range; 0 is not quantised
    step_deg_s : one step of the converter, where that is not what range and bits make; 0 is what they make
    conversions : of the converter averaged in a sample; 0 is a continuous mean
    output : digital, ratiometric (in proportion to the supply) or absolute (referred to a fixed voltage)
    null_deg_s : its output voltage without rotation, expressed in deg/s; what a wrong supply adds in proportion
    sensitivity_mv_deg_s : of an analogue output; a board's converter makes its step of it
    """

    bias_deg_s: float = 1.0
    bias_per_k_deg_s: float = 0.0
    bias_instability_deg_s: float = 0.0
    drift_deg_s_min: float = 0.2
    walk_deg_s_sqrt_s: float = 0.01
    noise_density_deg_s_sqrt_hz: float = 0.06
    gain: float = 0.015
    gain_per_k: float = 0.0
    nonlinearity: float = 0.0
    cross_axis: float = 0.005
    g_sensitivity_deg_s_g: float = 0.0
    bandwidth_hz: float = math.inf
    range_deg_s: float = 300.0
    bits: int = 10
    step_deg_s: float = 0.0
    conversions: int = 0
    output: Output = "digital"
    null_deg_s: float = 0.0
    sensitivity_mv_deg_s: float = 0.0

    def __post_init__(self) -> None:
        require(self, "deg/s", "bias_deg_s", "bias_instability_deg_s", "step_deg_s", "null_deg_s")
        require(self, "mV/(deg/s)", "sensitivity_mv_deg_s")
        require(self, "deg/s/K", "bias_per_k_deg_s")
        require(self, "deg/s/sqrt(Hz)", "noise_density_deg_s_sqrt_hz")
        require(self, "1/K", "gain_per_k")
        require(self, "deg/s/g", "g_sensitivity_deg_s_g")
        require_device(self)
        require(self, "deg/s/min", "drift_deg_s_min")
        require(self, "deg/s/sqrt(s)", "walk_deg_s_sqrt_s")
        require(self, "(a fraction)", "gain", "cross_axis", "nonlinearity")
        require_converter(self, "deg/s", "range_deg_s")


UNIT = np.dtype([*device.DEVICE, ("leans", "i8"), ("off_centre", "i8"), ("g_sensitivity", "f8", (3, 3))], align=True)
MEMORY = np.dtype([*device.MEMORY, ("force", "f8", (3,))], align=True)  # mean over the tick, where the part sits
NOISE = (("gyro_bias_b_rad_s", "f8", (3,)), ("gyro_noise_b_rad_s", "f8", (3,)))


def make(params: GyroParams, board: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one gyro: draw the errors that stay for life into `unit`, shape (1,) of UNIT."""
    device.make(
        params, board, rates, source, unit, name="gyro",
        full_scale=math.radians(params.range_deg_s), step=math.radians(params.step_deg_s),
        null=math.radians(params.null_deg_s), shake=math.radians(board.vibration_deg_s),
        density_sqrt_hz=math.radians(params.noise_density_deg_s_sqrt_hz),
    )  # fmt: skip
    if params.g_sensitivity_deg_s_g:
        sigma = math.radians(params.g_sensitivity_deg_s_g) / G_M_S2
        G = sigma * source("gyro g-sensitivity").standard_normal((3, 3))
        unit["leans"], unit["g_sensitivity"] = 1, G @ device.axes(board.mounting_deg)
        unit["off_centre"] = any(board.lever_arm_b_m)


def draw(params: GyroParams, board: BoardParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw bias and noise of every tick of a flight into the columns NOISE of `noise`, shape (n,)."""
    n, dt_s = len(noise), rates.dt_s
    t_s = np.arange(1, n + 1, dtype=np.float64)[:, None] * dt_s
    bias_deg_s = np.zeros(3)
    if params.bias_deg_s:
        bias_deg_s = bias_deg_s + params.bias_deg_s * source("gyro bias").standard_normal(3)
    if params.drift_deg_s_min:
        bias_deg_s = bias_deg_s + params.drift_deg_s_min / 60.0 * source("gyro drift").standard_normal(3) * t_s
    if params.bias_per_k_deg_s and board.warming_k:
        slope_deg_s_k = params.bias_per_k_deg_s * source("gyro bias per kelvin").standard_normal(3)
        bias_deg_s = bias_deg_s + slope_deg_s_k * warming(board, t_s)
    if params.bias_instability_deg_s:
        steps = source("gyro flicker").standard_normal((n, len(FLICKER_TIMES_S), 3))
        bias_deg_s = bias_deg_s + flicker(steps, params.bias_instability_deg_s, dt_s)
    if params.walk_deg_s_sqrt_s:
        steps = source("gyro walk").standard_normal((n, 3))
        bias_deg_s = bias_deg_s + random_walk(steps, params.walk_deg_s_sqrt_s, dt_s)
    noise["gyro_bias_b_rad_s"] = np.radians(bias_deg_s)
    noise["gyro_noise_b_rad_s"] = 0.0
    if params.noise_density_deg_s_sqrt_hz:
        sigma_rad_s = np.radians(sample_sigma(params.noise_density_deg_s_sqrt_hz, rates.imu_hz))
        noise["gyro_noise_b_rad_s"] = sigma_rad_s * source("gyro noise").standard_normal((n, 3))


@kernel
def measure_rate(truth, measured, noise, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Fill the gyro reading of row `k`, and the bias in the truth.

    `unit`, `memory` : records of UNIT and MEMORY       `board`, `state` : records of the board's UNIT and MEMORY
    """
    row, errors = truth[k], noise[k]
    omega = row.imu_omega_b_rad_s
    if unit.filters or unit.shakes:
        feel_rate(truth, k, unit, board, memory, state)
        omega = memory.signal
    f = row.imu_force_b_m_s2
    if unit.leans and unit.off_centre:
        for i in range(3):
            memory.force[i] = f[i]
        carry(truth, k, board, memory.force)
        f = memory.force
    found = errors.gyro_noise_b_rad_s
    if unit.noise_filters:
        filter_noise(found, noise[max(k - 1, 0)].gyro_noise_b_rad_s, k, unit, memory.noise)
        found = memory.noise
    for i in range(3):
        bias = errors.gyro_bias_b_rad_s[i]
        turned = unit.M[i, 0] * omega[0] + unit.M[i, 1] * omega[1] + unit.M[i, 2] * omega[2]
        if unit.leans:
            G = unit.g_sensitivity
            turned += G[i, 0] * f[0] + G[i, 1] * f[1] + G[i, 2] * f[2]
        if unit.distorts:
            sensed = distort(turned, i, unit, state) + bias + found[i]
            sensed, bias = on_supply(sensed, unit, state), on_supply(bias, unit, state)
        else:
            sensed = turned + bias + found[i]
        measured[k].gyro_b_rad_s[i] = quantise(sensed, unit)
        row.gyro_bias_b_rad_s[i] = bias


@kernel
def feel_rate(truth, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Mean over tick k of the rate behind the low-pass filter, vibration included, into `memory.signal`.

    The rate in a tick is the parabola with its mean and its values at both ends; the means behind the filter err by
    at most h^4 / 720 times the largest fourth derivative, to the next power of the tick h, whatever the bandwidth.
    At power-up the filter has settled on the first rate.
    """
    for i in range(3):
        mean = truth[k].imu_omega_b_rad_s[i]
        if unit.filters:
            rise, bulge = rate_shape(truth, k, i)
            before = memory.filtered[i] if k > 0 else mean - 0.5 * rise
            after = step_filter(unit.low_pass, before, mean, rise, bulge)
            memory.filtered[i] = after
            mean -= (after - before) * unit.low_pass[4]
        memory.signal[i] = mean
    if unit.shakes:
        shake(unit, board, state, memory.signal)
