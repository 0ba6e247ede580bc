"""White noise behind a part's low-pass filter, as its converter samples it: against a simulation and closed forms."""

import hashlib
import math

import numpy as np
import pytest
from scipy import signal, stats

from sim.clock import Rates
from sim.log import Log
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.datasheet import load_part
from sim.sensors.device import noise_filter
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

DENSITY = 0.06  # deg/s per root Hz, and mg
TICKS, BLOCK = 30_000, 20  # after a block the noise of the slowest filter here has forgotten all but 0.2 %
SUBSTEPS = 200  # of a tick, in the simulation: its filter errs by 0.03 % in power
DOUBTED_ONCE_IN = 1e-5


def readings(bandwidth_hz, conversions, imu_hz):
    """Gyro in deg/s and accelerometer in mg of a part at rest without any other error, each (TICKS, 3)."""
    common = {"bits": 0, "bandwidth_hz": bandwidth_hz, "conversions": conversions}
    gyro = GyroParams(
        bias_deg_s=0.0, drift_deg_s_min=0.0, walk_deg_s_sqrt_s=0.0, gain=0.0, cross_axis=0.0, range_deg_s=math.inf,
        noise_density_deg_s_sqrt_hz=DENSITY, **common,
    )  # fmt: skip
    force = AccelerometerParams(
        bias_g=0.0, noise_density_ug_sqrt_hz=1000.0 * DENSITY, range_g=math.inf, **common
    )  # fmt: skip
    suite, log = Suite(SuiteParams(gyro, force), Rates(imu_hz=imu_hz), 4), Log.empty(TICKS)
    suite.reset(log)
    for k in range(TICKS):
        suite.measure(k)
    return np.degrees(log.measured["gyro_b_rad_s"]), 1000.0 * log.measured["force_b_m_s2"] / 9.80665


def simulated(bandwidth_hz, conversions, imu_hz):
    """The same from white noise in small steps through a one-pole filter, (TICKS, 3)."""
    step_hz = imu_hz * SUBSTEPS
    pole = math.exp(-2.0 * math.pi * bandwidth_hz / step_hz)
    middles = np.round((np.arange(conversions) + 0.5) * SUBSTEPS / conversions).astype(int)
    rng = np.random.default_rng(11)
    axes = []
    for _ in range(3):
        white = DENSITY * math.sqrt(step_hz / 2.0) * rng.standard_normal((TICKS + BLOCK) * SUBSTEPS)
        behind = signal.lfilter([1.0 - pole], [1.0, -pole], white).reshape(-1, SUBSTEPS)
        axes.append(behind[BLOCK:, middles].mean(axis=1))
    return np.stack(axes, axis=1)


@pytest.mark.parametrize(
    ("bandwidth_hz", "conversions", "imu_hz"), [(42.0, 1, 50), (42.0, 4, 50), (10.0, 1, 200), (15.0, 10, 100)]
)
def test_noise_of_a_sample_is_that_of_a_simulated_filter(bandwidth_hz, conversions, imu_hz):
    """Power of one sample, of the sum and difference of two neighbours, of the mean of eight: equal by the F-test.

    Numbers of independent blocks are the degrees of freedom; 4500 bound the ratio of powers to 0.88 .. 1.14.
    """
    truth = simulated(bandwidth_hz, conversions, imu_hz)

    def powers(x):
        blocks = x.reshape(-1, BLOCK, 3)
        two = blocks[:, 10], blocks[:, 11]
        return [np.mean(v**2) for v in (two[0], two[0] + two[1], two[0] - two[1], blocks[:, :8].mean(axis=1))]

    n = TICKS // BLOCK * 3
    low, high = stats.f.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], n, n)
    for reading in readings(bandwidth_hz, conversions, imu_hz):
        ratios = np.divide(powers(reading), powers(truth))
        assert np.all((ratios >= low) & (ratios <= high)), ratios


def test_noise_of_a_digital_part_read_once_a_tick_folds_down():
    """ITG-3200: 0.03 deg/s per root Hz behind 42 Hz is 0.03 sqrt(pi/2 42) deg/s in every reading, at 50 Hz and 200 Hz.

    A chi-square bound on every 10th sample, where the filter has forgotten the last.
    """
    part = load_part("itg3200").devices["gyro"]
    assert part.conversions == 1
    sigma = DENSITY * math.sqrt(math.pi / 2.0 * part.bandwidth_hz)
    for imu_hz in (50, 200):
        for reading in readings(part.bandwidth_hz, 1, imu_hz):
            apart = reading[::10]
            low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], apart.size)
            assert low <= np.sum(apart**2) / sigma**2 <= high


@pytest.mark.parametrize(("bandwidth_hz", "imu_hz"), [(3.0, 200), (42.0, 50), (94.0, 50), (1000.0, 50)])
def test_density_at_zero_frequency_is_kept_but_for_what_folds_down(bandwidth_hz, imu_hz):
    """Once a tick: every multiple of the rate folds to zero, 1 + 2 sum 1 / (1 + (m rate / bandwidth)^2) = x coth x.

    Of a thousand conversions a tick nothing does while a tick has many of them to a time constant.  Round-off, and
    for the latter x coth x of a thousandth of a tick.
    """
    x = math.pi * bandwidth_hz / imu_hz
    for n in (1, 1000):
        (phi, b0, b1), _ = noise_filter(bandwidth_hz, n, imu_hz)
        np.testing.assert_allclose(((b0 + b1) / (1.0 - phi)) ** 2, x / n / math.tanh(x / n), rtol=1e-9)


@pytest.mark.parametrize("conversions", [1, 3, 10, 1000])
@pytest.mark.parametrize("bandwidth_hz", [0.5, 42.0, 1e5])
def test_sigma_of_the_process_is_the_gain(bandwidth_hz, conversions):
    """Stationary variance of an ARMA(1, 1), (b0^2 + b1^2 + 2 phi b0 b1) / (1 - phi^2)."""
    (phi, b0, b1), gain = noise_filter(bandwidth_hz, conversions, 50.0)
    assert (b0**2 + b1**2 + 2.0 * phi * b0 * b1) / (1.0 - phi**2) == pytest.approx(gain**2, rel=1e-9)


@pytest.mark.parametrize(("bandwidth_hz", "conversions"), [(math.inf, 0), (math.inf, 8), (42.0, 0)])
def test_noise_without_filter_or_without_conversions_is_as_drawn(bandwidth_hz, conversions):
    """Bit for bit the noise of the mean over the tick."""
    for reading, drawn in zip(readings(bandwidth_hz, conversions, 50), readings(math.inf, 0, 50), strict=True):
        np.testing.assert_array_equal(reading, drawn)


def test_readings_of_the_generic_suite_are_what_they_were():
    """The first digits of a hash of gyro and accelerometer at rest: every limit of a scenario rests on them."""
    suite, log = Suite(SUITES["generic"], Rates(), 3), Log.empty(400)
    suite.reset(log)
    for k in range(400):
        suite.measure(k)
    data = log.measured["gyro_b_rad_s"].tobytes() + log.measured["force_b_m_s2"].tobytes()
    assert hashlib.sha256(data).hexdigest()[:16] == "762db1614bc2152b"
