"""Rate gyro: turn-on bias, drift, random walk, noise, gain and cross-axis errors, saturation, quantisation.

reading = convert(supply(curve(M omega + G f) + bias(t) + noise)),   M = (1 + diag(gain) + cross-axis) R_sb,
bias(t) = turn-on + drift T (1 - exp(-t / T)) + slope x warming(t) + flicker noise + random walk

`omega` is the mean inertial rate over the tick, `f` the mean specific force at the board, vibration excluded.
bias(t), which an estimator can learn, is recorded in the truth.  Terms are those of IEEE Std 952 (bias instability,
rate random walk, angle random walk); its rate ramp is the start of the drift, which levels off with the time constant
T of the board, because what drives it is the part's own warming.

Of the default, 0.2 deg/s per minute and T = 300 s, 1 deg/s is left in the end.  Analogue gyros change by about 0.1
deg/s per kelvin (the ADXRS401 and LISY300AL of `parts`, there "typical"), so that this is a warming by 10 K.  The
warming and T are assumptions: boards like these end up 8 to 20 K above the air, within a quarter of an hour.
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
from sim.sensors.device import carry, filter_noise, rate_shape, read_axis, shake, step_filter
from sim.sensors.noise import Output, Source, require, require_converter, require_device


@dataclass(frozen=True, slots=True)
class GyroParams:
    """Errors of a three-axis rate gyro; each sigma is over flights and axes.

    The defaults are a cheap analogue MEMS part.  A larger figure is a worse gyro unless stated otherwise, and 0
    removes that error.

    bias_deg_s : sigma of the turn-on bias, constant in a flight (deg/s, default 1)
    bias_per_k_deg_s : sigma of the bias change with temperature (deg/s per kelvin, default 0)
    bias_instability_deg_s : flicker noise, coefficient B of IEEE Std 952; Allan deviation 0.664 B (deg/s, default 0)
    drift_deg_s_min : sigma of the slope of the bias drift at power-up, which levels off: in the end the bias has moved
        by this times `board.warming_s`, 1 deg/s (deg/s per minute, default 0.2)
    walk_deg_s_sqrt_s : rate random walk, sigma of the bias after 1 s (deg/s per root second, default 0.01)
    noise_density_deg_s_sqrt_hz : one-sided white noise density, as in data sheets (deg/s per root Hz, default 0.06)
    gain : sigma of the relative gain error (fraction, default 0.015)
    gain_per_k : sigma of its change with temperature (1/K, default 0)
    nonlinearity : sigma of the largest deviation from the straight line (fraction of full scale, default 0)
    cross_axis : sigma of each axis' sensitivity to another axis, misalignment in the part included
        (fraction, default 0.005)
    g_sensitivity_deg_s_g : sigma of each axis' response to the specific force along each axis (deg/s per g, default 0)
    bandwidth_hz : -3 dB frequency of the low-pass filter (Hz, default inf: none).  Lower: less vibration, more lag
    range_deg_s : full scale, where readings clip (deg/s, default 300).  Lower: saturates in fast manoeuvres, but
        finer steps with the same bits
    bits : of the converter over +-range (default 10).  Higher: finer steps; 0 disables quantisation
    step_deg_s : converter step (deg/s, default 0: from range and bits).  Higher: coarser readings
    conversions : converter readings averaged per sample (default 0: continuous mean).  Lower, from 1: more aliasing
    output : digital, ratiometric (proportional to the supply) or absolute (fixed reference) (default digital)
    null_deg_s : output voltage at zero rate, in deg/s (default 0).  Higher: a supply error adds more bias
    sensitivity_mv_deg_s : of an analogue output (mV per deg/s, default 0).  Higher: finer steps of the board's
        converter
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
        require(
            self, "bias_deg_s", "bias_per_k_deg_s", "bias_instability_deg_s", "drift_deg_s_min", "walk_deg_s_sqrt_s",
            "noise_density_deg_s_sqrt_hz", "gain", "gain_per_k", "nonlinearity", "cross_axis", "g_sensitivity_deg_s_g",
            "step_deg_s", "null_deg_s", "sensitivity_mv_deg_s",
        )  # fmt: skip
        require_device(self)
        require_converter(self, "range_deg_s")


UNIT = np.dtype([*device.DEVICE, ("leans", "i8"), ("off_centre", "i8"), ("g_sensitivity", "f8", (3, 3))], align=True)
MEMORY = np.dtype([*device.MEMORY, ("force", "f8", (3,))], align=True)  # mean over the tick at the board
NOISE = (("gyro_bias_b_rad_s", "f8", (3,)), ("gyro_noise_b_rad_s", "f8", (3,)))


def _figures(params: GyroParams, board: BoardParams) -> device.Figures:
    return device.Figures(
        "gyro", math.radians(1.0), (NOISE[0][0], NOISE[1][0]), full_scale=params.range_deg_s, step=params.step_deg_s,
        null=params.null_deg_s, vibration=board.vibration_deg_s, density_sqrt_hz=params.noise_density_deg_s_sqrt_hz,
        bias=params.bias_deg_s, bias_per_k=params.bias_per_k_deg_s, drift_per_s=params.drift_deg_s_min / 60.0,
        instability=params.bias_instability_deg_s, walk_sqrt_s=params.walk_deg_s_sqrt_s,
    )  # fmt: skip


def make(params: GyroParams, board: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one gyro: draw the errors it keeps for life into `unit`, shape (1,) of UNIT."""
    device.make(_figures(params, board), params, board, rates, source, unit)
    if params.g_sensitivity_deg_s_g:
        sigma = math.radians(params.g_sensitivity_deg_s_g) / G_M_S2
        G = sigma * source("gyro g-sensitivity").standard_normal((3, 3))
        unit["leans"], unit["g_sensitivity"] = 1, G @ device.axes(board.mounting_deg)
        unit["off_centre"] = any(board.lever_arm_b_m)


def draw(params: GyroParams, board: BoardParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw bias and noise of every tick of a flight into the columns NOISE of `noise`, shape (n,)."""
    device.draw(_figures(params, board), board, rates, source, noise)


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
        turned = unit.M[i, 0] * omega[0] + unit.M[i, 1] * omega[1] + unit.M[i, 2] * omega[2]
        if unit.leans:
            G = unit.g_sensitivity
            turned += G[i, 0] * f[0] + G[i, 1] * f[1] + G[i, 2] * f[2]
        reading, bias = read_axis(turned, i, errors.gyro_bias_b_rad_s[i], found[i], unit, state)
        measured[k].gyro_b_rad_s[i], row.gyro_bias_b_rad_s[i] = reading, bias


@kernel
def feel_rate(truth, k, unit, board, memory, state):  # type: ignore[no-untyped-def]
    """Mean over tick k of the low-pass filtered rate, vibration included, into `memory.signal`.

    Within a tick the rate is taken as the parabola with its mean and its values at both ends; the filtered means
    err by at most h^4 / 720 times the largest fourth derivative, to the next power of the tick h, whatever the
    bandwidth.  At power-up the filter has settled on the first rate.
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
