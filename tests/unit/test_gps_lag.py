"""The late, filtered nose: against SciPy's filter, and the frame that turns with the corrections against angles."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from estimator.blocks import gps_lag
from estimator.blocks.compiled import BELIEF
from estimator.compiler.jit import kernel
from estimator.interface import Column, dtype_of

PARAMS = (
    Column("gps_lag_filter", (), "", integer=True),
    Column("gps_filter_s", (), ""),
    Column("gps_latency_s", (), ""),
    Column("dt_s", (), ""),
    Column("clock_s", (), ""),
)
DT = 0.02


def state_of(filter_s=1.0, latency_s=0.3, on=1):
    """A record that heads north."""
    state = np.zeros(1, dtype_of((*BELIEF, *gps_lag.LAG, *PARAMS)))
    s = state[0]
    s["R_eb"] = np.eye(3)
    s["gps_lag_filter"], s["gps_filter_s"], s["gps_latency_s"], s["dt_s"] = on, filter_s, latency_s, DT
    gps_lag.start_history(s)
    return state


@kernel
def pass_noses(state, angles_rad, noses, recalled):
    s = state[0]
    for k in range(len(angles_rad)):
        s.R_eb[0, 0], s.R_eb[1, 0] = np.cos(angles_rad[k]), np.sin(angles_rad[k])
        s.clock_s += s.dt_s
        gps_lag.filter_nose(s)
        gps_lag.recall_nose(s)
        noses[k, 0], noses[k, 1] = s.nose[0], s.nose[1]
        recalled[k, 0], recalled[k, 1] = s.nose_at_fix[0], s.nose_at_fix[1]


@kernel
def turn(state, angles_rad):
    for angle_rad in angles_rad:
        gps_lag.turn_frame(state[0], angle_rad)


@kernel
def corrected(state):
    return gps_lag.corrected_nose(state[0])


def passed(state, angles_rad):
    """Filtered and recalled noses of a row of headings."""
    noses, recalled = np.empty((len(angles_rad), 2)), np.empty((len(angles_rad), 2))
    pass_noses(state, angles_rad, noses, recalled)
    return noses, recalled


@pytest.mark.parametrize("filter_s", [0.0, 0.5, 1.0])
def test_filter_nose_is_the_exponential_filter(filter_s):
    """Sample for sample what SciPy's recursive filter gives; without a time constant the nose itself."""
    angles = np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, 2000))
    noses, _ = passed(state_of(filter_s), angles)
    gain = 1.0 - math.exp(-DT / filter_s) if filter_s else 1.0
    v = np.exp(1j * angles)
    oracle = lfilter([gain], [1.0, gain - 1.0], v - 1.0) + 1.0
    np.testing.assert_allclose(noses, np.stack([oracle.real, oracle.imag], axis=-1), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("latency_s", "samples"), [(0.0, 0), (0.02, 1), (0.3, 15), (12.5, 625)])
def test_recall_nose_is_the_one_of_so_many_samples_ago(latency_s, samples):
    """Whole samples of latency; before there was so much history, the nose at power-up."""
    angles = np.cumsum(np.random.default_rng(2).normal(0.0, 0.05, 2000))
    noses, recalled = passed(state_of(latency_s=latency_s), angles)
    oracle = np.concatenate([np.tile([1.0, 0.0], (samples, 1)), noses[: len(noses) - samples]])
    # A clock that adds up 2000 times 20 ms is off by 1e-12 s, at 3 rad/s per sample of noise.
    np.testing.assert_allclose(recalled, oracle, rtol=0, atol=1e-9)


def test_recall_nose_without_the_lag_filter_is_the_nose_of_now():
    """Neither filter nor latency."""
    angles = np.linspace(0.0, 6.0, 200)
    _, recalled = passed(state_of(on=0), angles)
    np.testing.assert_allclose(recalled, np.stack([np.cos(angles), np.sin(angles)], axis=-1), rtol=0, atol=1e-15)


@pytest.mark.parametrize("angle_rad", [1e-3, -0.02, 0.049, 0.3, -2.0, 3.1])
def test_turn_frame_adds_up_the_corrections_and_keeps_its_length(angle_rad):
    """A thousand corrections, small (first order) or large (exact): their sum, and a rotation for ever."""
    state = state_of()
    turn(state, np.full(1000, angle_rad))
    c, z = state["frame"][0]
    assert math.hypot(c, z) == pytest.approx(1.0, rel=0, abs=1e-5)  # 3/8 a^4 a step, and it does not add up
    off = math.remainder(math.atan2(z, c) - 1000.0 * angle_rad, 2.0 * math.pi)
    assert abs(off) <= 1e-9 + (1000.0 * abs(angle_rad) ** 3 / 3.0 if abs(angle_rad) <= gps_lag.LARGE_RAD else 0.0)


def test_corrected_nose_follows_a_correction_of_the_estimate_at_once():
    """Turn the estimate and take note of it: the late nose turns as much, and the filter feels nothing."""
    state = state_of()
    passed(state, np.full(200, 0.7))
    before = math.atan2(*reversed(corrected(state)))
    turn(state, np.array([0.4]))
    noses, _ = passed(state, np.full(200, 1.1))
    assert math.atan2(*reversed(corrected(state))) == pytest.approx(
        before + 0.4, rel=0, abs=0.02
    )  # e^-4 of 0.7 is left
    steps = np.diff(np.arctan2(noses[:, 1], noses[:, 0]))
    assert np.abs(steps).max() < 1e-3  # a jump of 0.4 would pass at 0.008 a sample
