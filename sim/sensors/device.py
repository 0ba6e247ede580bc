"""What gyro and accelerometer share: misaligned axes, bandwidth, vibration, supply, curve and converter.

    sensed  = curve((1 + gain_per_k rise) M signal) + bias + noise        M = (1 + gain + cross-axis) R_sb
    reading = convert(supply(sensed))

The signal of a tick is the mean over it of the low-pass filtered quantity, in body axes.  `R_sb` is the mounting
misalignment, unknown to the firmware: readings labelled body are components along the board's axes.

Bandwidth.  First order, T y' = u - y with T = 1 / (2 pi bandwidth).  Integrated over a tick of length h:
mean(y) = mean(u) - (y(h) - y(0)) T / h, exactly.  Within a tick u = m + d/2 P1(s) + q P2(s), the Legendre
polynomials of s = t / h from 0 to 1, with m the mean, d the rise over the tick and q the bulge of its ends above
the mean; y(h) = exp(-a) y(0) + J0 m + J1 d/2 + J2 q, a = h / T, with Jn the integral of a exp(-a (1 - s)) Pn(s).

Supply (Premerlani & Bizard, "Gyro characteristics").  The output of a part is referred to a fixed voltage
(absolute) or to the supply (ratiometric); so is the converter's.  If the two differ, a relative supply error e
changes sensitivity and offset together: (x + null) times 1 + e or 1 / (1 + e), minus the null.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.sensors.board import BoardParams, warming
from sim.sensors.noise import FLICKER_TIMES_S, Source, flicker, levelling_off, random_walk, sample_sigma

# In SI units of the reading.  A flag per group, so that effects which are off cost no time.
DEVICE: tuple[Any, ...] = (
    ("M", "f8", (3, 3)),  # body axes to readings
    ("filters", "i8"),
    ("low_pass", "f8", (5,)),  # exp(-a), J0, J1, J2, 1 / a
    ("shakes", "i8"),
    ("shake", "f8"),  # amplitude at the reference speed of the board
    ("shake_rad", "f8", (3,)),  # phase of each axis against the rotor
    ("bandwidth_hz", "f8"),
    ("conversions", "i8"),
    ("noise_filters", "i8"),
    ("noise_filter", "f8", (3,)),  # phi, b0, b1
    ("noise_gain", "f8"),  # sigma of a sample, relative to that of unfiltered noise averaged over the tick
    ("distorts", "i8"),  # any of the terms from here to the converter
    ("gain_per_k", "f8", (3,)),
    ("bend", "f8", (3,)),  # largest deviation from the straight line
    ("supply_power", "i8"),  # of 1 + e in the reading: 1, -1, or 0 if the supply has no effect
    ("null", "f8"),
    ("range", "f8"),
    ("step", "f8"),
    ("lowest", "f8"),  # steps
    ("highest", "f8"),
)
MEMORY: tuple[Any, ...] = (
    ("filtered", "f8", (3,)),  # output of the low-pass filter at the end of the tick
    ("signal", "f8", (3,)),  # mean over the tick at the part's output
    ("noise", "f8", (3,)),  # noise at the converter
)


def axes(mounting_deg: tuple[float, float, float]) -> Array:
    """R_sb of a board misaligned by roll, pitch and yaw, shape (3, 3)."""
    R_bs: Array = from_euler(*(math.radians(angle) for angle in mounting_deg))
    return R_bs.T


def low_pass(bandwidth_hz: float, dt_s: float) -> Array:
    """Constants of the filter over a tick: exp(-a), J0, J1, J2, 1 / a; shape (5,).  See `step_filter`."""
    a = 2.0 * math.pi * bandwidth_hz * dt_s
    # Moments I_n, the integral of a exp(-a (1 - s)) s^n: by parts where a is large, else as a sum of positive terms.
    if a > 1.0:
        moments = [-math.expm1(-a)]
        for n in (1, 2):
            moments.append(1.0 - n / a * moments[-1])
    else:
        terms = [a**k / math.factorial(k) for k in range(20)]
        moments = [a * math.exp(-a) * sum(term / (n + k + 1) for k, term in enumerate(terms)) for n in range(3)]
    I0, I1, I2 = moments
    return np.array([math.exp(-a), I0, 2.0 * I1 - I0, 6.0 * I2 - 6.0 * I1 + I0, 1.0 / a])


def noise_of_one_conversion(density_sqrt_hz: float, bandwidth_hz: float, conversions: int, imu_hz: float) -> float:
    """Sigma of one conversion for a one-sided noise density, over the filter's noise bandwidth, pi/2 bandwidths.

    Without a filter the density is that of a sample: the mean of n conversions has 1 / n of the power of one.
    """
    noise_hz = conversions * imu_hz / 2.0 if math.isinf(bandwidth_hz) else math.pi / 2.0 * bandwidth_hz
    return density_sqrt_hz * math.sqrt(noise_hz)


def noise_filter(bandwidth_hz: float, conversions: int, imu_hz: float) -> tuple[Array, float]:
    """White noise after a low-pass filter and a few conversions per tick: phi, b0, b1; and its sigma.

    A part samples the noise behind its filter, autocorrelation exp(-2 pi bandwidth |lag|), at the middles of equal
    parts of the tick.  The mean of those has autocovariances r0, r1, phi r1, phi^2 r1, ... a tick apart: it is the
    process x(k) = phi x(k-1) + b0 w(k) + b1 w(k-1) of unit white noise w (Box and Jenkins, Time Series Analysis,
    1970, ARMA(1, 1)), with b0^2 + b1^2 = (1 + phi^2) r0 - 2 phi r1 and b0 b1 = r1 - phi r0.  All is relative to
    `sample_sigma`.  With few conversions, noise from above the sample rate is aliased and sigma exceeds 1; a
    continuous mean (0 conversions) or no filter leaves the noise unchanged.
    """
    n = conversions
    if n == 0 or math.isinf(bandwidth_hz):
        return np.array([0.0, 1.0, 0.0]), 1.0
    variance = (noise_of_one_conversion(1.0, bandwidth_hz, n, imu_hz) / sample_sigma(1.0, imu_hz)) ** 2
    a = 2.0 * math.pi * bandwidth_hz / imu_hz
    apart = np.arange(1, 2 * n)  # of two conversions, in n-ths of a tick
    alike = np.exp(-a / n * apart)
    r0 = variance * (n + 2.0 * np.sum((n - apart[: n - 1]) * alike[: n - 1])) / n**2
    r1 = variance * np.sum((n - np.abs(apart - n)) * alike) / n**2
    phi = math.exp(-a)
    total = math.sqrt((1.0 - phi) * ((1.0 - phi) * r0 + 2.0 * r1))  # b0 + b1
    difference = math.sqrt((1.0 + phi) * ((1.0 + phi) * r0 - 2.0 * r1))  # b0 - b1
    return np.array([phi, 0.5 * (total + difference), 0.5 * (total - difference)]), math.sqrt(r0)


def converter(step: float, full_scale: float, bits: int, conversions: int, sigma: float) -> tuple[float, float, float]:
    """Step, lowest and highest level in steps, of the mean of some `conversions`; a step of 0 does not quantise.

    `step` 0 is that of `bits` over +-`full_scale`.  Levels end with the codes, in two's complement, or with the
    range.  The mean of n conversions has n times as many levels, but only where noise moves the conversions from
    level to level: noise `sigma` of one above half a step (Microchip AN2572, DS00002572B, "Noise").  Less, and all
    conversions agree: the mean is as coarse as one.
    """
    if not bits:
        return 0.0, 0.0, 0.0
    step = step or 2.0 * full_scale / 2**bits
    codes, within = 2.0 ** (bits - 1), math.floor(full_scale / step * (1.0 + 1e-12))
    finer = conversions if conversions > 1 and sigma > 0.5 * step else 1
    return step / finer, -min(codes, within) * finer, min(codes - 1.0, within) * finer


@dataclass(frozen=True, slots=True)
class Figures:
    """Data-sheet figures of an inertial sensor under names that gyro and accelerometer share.

    All are in the unit of the data sheet (deg/s or g), rates of change per second; `si` converts them to SI.
    name : of the part's random streams            columns : of bias and noise in the NOISE of the suite
    """

    name: str
    si: float
    columns: tuple[str, str]
    full_scale: float
    step: float
    null: float
    vibration: float
    density_sqrt_hz: float
    bias: float
    bias_per_k: float
    drift_per_s: float
    instability: float
    walk_sqrt_s: float


def make(
    figures: Figures, params: Any, board: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]
) -> None:
    """Draw the errors that a part keeps for life, and fill the fields DEVICE of `unit`, shape (1,)."""

    def drawn(what: str, sigma: float, n: int = 3) -> Array:
        return sigma * source(f"{figures.name} {what}").standard_normal(n) if sigma else np.zeros(n)

    si, full_scale = figures.si, figures.full_scale * figures.si
    M = np.diag(1.0 + drawn("gain", params.gain))
    M[~np.eye(3, dtype=bool)] = drawn("cross-axis", params.cross_axis, 6)
    unit["M"] = M @ axes(board.mounting_deg)
    unit["bandwidth_hz"], unit["filters"] = params.bandwidth_hz, math.isfinite(params.bandwidth_hz)
    if math.isfinite(params.bandwidth_hz):
        unit["low_pass"] = low_pass(params.bandwidth_hz, rates.dt_s)
    unit["shakes"], unit["shake"] = figures.vibration > 0.0, figures.vibration * si
    unit["conversions"] = params.conversions
    if figures.vibration:
        unit["shake_rad"] = source(f"{figures.name} vibration").uniform(0.0, 2.0 * math.pi, 3)
    unit["noise_filter"], unit["noise_gain"] = noise_filter(params.bandwidth_hz, params.conversions, rates.imu_hz)
    unit["noise_filters"] = params.conversions > 0 and math.isfinite(params.bandwidth_hz)
    unit["gain_per_k"] = drawn("gain temperature", params.gain_per_k)
    if math.isfinite(full_scale):  # non-linearity is a fraction of the full scale
        unit["bend"] = drawn("non-linearity", params.nonlinearity * full_scale)
    unit["supply_power"] = board.supply_power(params.output)
    unit["null"], unit["range"] = figures.null * si, full_scale
    unit["distorts"] = np.any(unit["gain_per_k"]) or np.any(unit["bend"]) or np.any(unit["supply_power"])
    density = figures.density_sqrt_hz * si
    sigma = noise_of_one_conversion(density, params.bandwidth_hz, params.conversions, rates.imu_hz)
    levels = converter(figures.step * si, full_scale, params.bits, params.conversions, sigma)
    unit["step"], unit["lowest"], unit["highest"] = levels


def draw(figures: Figures, board: BoardParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw bias and noise of every tick of a flight into the columns of `figures` in `noise`, shape (n,)."""
    n, dt_s, name = len(noise), rates.dt_s, figures.name
    t_s = np.arange(1, n + 1, dtype=np.float64)[:, None] * dt_s
    bias = np.zeros(3)
    if figures.bias:
        bias = bias + figures.bias * source(f"{name} bias").standard_normal(3)
    if figures.drift_per_s:
        slope = figures.drift_per_s * source(f"{name} drift").standard_normal(3)
        bias = bias + slope * levelling_off(t_s, board.warming_s)
    if figures.bias_per_k and board.warming_k:
        slope = figures.bias_per_k * source(f"{name} bias per kelvin").standard_normal(3)
        bias = bias + slope * warming(board, t_s)
    if figures.instability:
        steps = source(f"{name} flicker").standard_normal((n, len(FLICKER_TIMES_S), 3))
        bias = bias + flicker(steps, figures.instability, dt_s)
    if figures.walk_sqrt_s:
        bias = bias + random_walk(source(f"{name} walk").standard_normal((n, 3)), figures.walk_sqrt_s, dt_s)
    of_bias, of_noise = figures.columns
    noise[of_bias], noise[of_noise] = bias * figures.si, 0.0
    if figures.density_sqrt_hz:
        sigma = sample_sigma(figures.density_sqrt_hz, rates.imu_hz) * figures.si
        noise[of_noise] = sigma * source(f"{name} noise").standard_normal((n, 3))


@kernel
def read_axis(signal, i, bias, noise, unit, state):  # type: ignore[no-untyped-def]
    """Reading of axis i, and the bias in it, when its turned signal is `signal`: curve, supply and converter."""
    if unit.distorts:
        sensed = distort(signal, i, unit, state) + bias + noise
        return quantise(on_supply(sensed, unit, state), unit), on_supply(bias, unit, state)
    return quantise(signal + bias + noise, unit), bias


@kernel
def step_filter(weights, before, mean, rise, bulge):  # type: ignore[no-untyped-def]
    """Output of the low-pass filter at the end of a tick, from its output `before` and the signal in the tick."""
    return weights[0] * before + weights[1] * mean + weights[2] * 0.5 * rise + weights[3] * bulge


@kernel
def filter_noise(fresh, before, k, unit, found):  # type: ignore[no-untyped-def]
    """Noise of tick k at the converter, into `found`, from the noise drawn for this tick and the one `before`.

    See `noise_filter`; at power-up the filter is already stationary.
    """
    phi, b0, b1 = unit.noise_filter[0], unit.noise_filter[1], unit.noise_filter[2]
    for i in range(3):
        found[i] = phi * found[i] + b0 * fresh[i] + b1 * before[i] if k > 0 else unit.noise_gain * fresh[i]


@kernel
def rate_shape(truth, k, i):  # type: ignore[no-untyped-def]
    """Rise and bulge over tick k of the rate about axis i, from its mean and its values at both ends.

    In tick 0, which has no row before it, the rate is taken as a straight line.
    """
    mean, end = truth[k].imu_omega_b_rad_s[i], truth[k].omega_b_rad_s[i]
    start = truth[k - 1].omega_b_rad_s[i] if k > 0 else 2.0 * mean - end
    return end - start, 0.5 * (start + end) - mean


@kernel
def carry(truth, k, board, force):  # type: ignore[no-untyped-def]
    """Add the lever-arm term of r to `force`, shape (3,): the mean of omega x (omega x r) + d(omega)/dt x r.

    omega x (omega x r) = omega (omega . r) - r omega^2.  The rate is the parabola m + d/2 P1 + q P2 of
    `rate_shape`, so that the mean of omega_i omega_j is m_i m_j + d_i d_j / 12 + q_i q_j / 5 exactly.
    """
    r, m = board.lever_arm_b_m, truth[k].imu_omega_b_rad_s
    dx, qx = rate_shape(truth, k, 0)
    dy, qy = rate_shape(truth, k, 1)
    dz, qz = rate_shape(truth, k, 2)
    xx = m[0] * m[0] + dx * dx / 12.0 + qx * qx / 5.0
    yy = m[1] * m[1] + dy * dy / 12.0 + qy * qy / 5.0
    zz = m[2] * m[2] + dz * dz / 12.0 + qz * qz / 5.0
    xy = m[0] * m[1] + dx * dy / 12.0 + qx * qy / 5.0
    xz = m[0] * m[2] + dx * dz / 12.0 + qx * qz / 5.0
    yz = m[1] * m[2] + dy * dz / 12.0 + qy * qz / 5.0
    force[0] += xy * r[1] + xz * r[2] - (yy + zz) * r[0] + (dy * r[2] - dz * r[1]) / board.dt_s
    force[1] += xy * r[0] + yz * r[2] - (xx + zz) * r[1] + (dz * r[0] - dx * r[2]) / board.dt_s
    force[2] += xz * r[0] + yz * r[1] - (xx + yy) * r[2] + (dx * r[1] - dy * r[0]) / board.dt_s


@kernel
def mean_gain(turns, conversions):  # type: ignore[no-untyped-def]
    """Mean of a sine over a tick of `turns` periods, relative to its value at mid-tick.

    For conversions at the middles of equal parts: sin(n x) / (n sin x), x = pi turns / n (Dirichlet kernel);
    1 for a single conversion, whatever the frequency: it aliases.  0 conversions: the limit sin(x) / x.
    """
    if conversions == 0:
        x = np.pi * turns
        return np.sin(x) / x if x != 0.0 else 1.0
    n = conversions
    whole = np.rint(turns / n)
    x = np.pi * (turns / n - whole)  # reduced first: exact if all conversions fall on the same phase
    sign = 1.0 if (whole * (n - 1)) % 2.0 == 0.0 else -1.0
    return sign * np.sin(n * x) / (n * np.sin(x)) if x != 0.0 else sign


@kernel
def shake(unit, board, state, signal):  # type: ignore[no-untyped-def]
    """Add to `signal`, shape (3,), the mean of the motor's vibration; `board`, `state` are its UNIT and MEMORY.

    The amplitude of an unbalanced rotor grows with the square of its speed; the filter is in steady state.
    """
    ratio = state.rotor_hz / unit.bandwidth_hz
    amplitude = unit.shake * (state.rotor_hz / board.shaken_at_hz) ** 2 / np.sqrt(1.0 + ratio * ratio)
    amplitude *= mean_gain(state.rotor_hz * board.dt_s, unit.conversions)
    for i in range(3):
        signal[i] += amplitude * np.sin(state.rotor_rad + unit.shake_rad[i] - np.arctan(ratio))


@kernel
def distort(x, i, unit, state):  # type: ignore[no-untyped-def]
    """Apply the temperature dependence of the gain and the non-linearity of axis i to its signal `x`.

    The curve is the third Chebyshev polynomial T3 over the full scale: the cubic whose best straight line is zero
    and whose deviation reaches its maximum four times, with alternating sign.
    """
    x *= 1.0 + unit.gain_per_k[i] * state.warmer_k
    if unit.bend[i] != 0.0:
        z = min(max(x / unit.range, -1.0), 1.0)
        x += unit.bend[i] * (4.0 * z * z - 3.0) * z
    return x


@kernel
def on_supply(x, unit, state):  # type: ignore[no-untyped-def]
    """`x` at the converter, with the supply error applied."""
    if unit.supply_power == 0:
        return x
    ratio = state.supply if unit.supply_power > 0 else 1.0 / state.supply
    return (x + unit.null) * ratio - unit.null


@kernel
def quantise(x, unit):  # type: ignore[no-untyped-def]
    """Converter level nearest to `x`, within the range and the codes."""
    x = min(max(x, -unit.range), unit.range)
    if unit.step == 0.0:
        return x
    return unit.step * min(max(np.floor(x / unit.step + 0.5), unit.lowest), unit.highest)
