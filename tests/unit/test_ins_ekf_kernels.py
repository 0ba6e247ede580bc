"""The filter's mathematics against numerical differentiation and a plain Kalman filter in NumPy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.compiler.jit import kernel
from estimator.ins_ekf import STATE_DTYPE, InsEkf, InsEkfParams
from estimator.ins_ekf.flight import doubt_heading, turn_heading
from estimator.ins_ekf.kernels import (
    BIAS,
    FORCE,
    GAIN,
    LAG,
    LATENCY,
    TILT,
    VEL,
    WIND_NE,
    N,
    advance_state,
    airspeed,
    apply_transition,
    fuse,
    magnetic_course,
    predict,
    rodrigues,
    through_air,
    turn_in_body,
    turn_in_earth,
)

PARAMS = InsEkfParams(gps_filter_s=1.0, gps_latency_s=0.3, gps_latency_sigma_s=0.0)  # a receiver that filters
GYRO, FORCE_B = np.array([0.6, -0.9, 1.3]), np.array([1.5, -2.0, -13.0])
VECTORS = (
    ("v_e_m_s", VEL, 3),
    ("gyro_bias_b_rad_s", BIAS, 3),
    ("gyro_gain", GAIN, 3),
    ("force_bias_b_m_s2", FORCE, 3),
    ("lagged_v_e_m_s", LAG, 3),
    ("wind_e_m_s", WIND_NE, 2),
    ("latency_s", LATENCY, 1),
)


def some_state(seed=3):
    """A state record in the middle of a flight, with a covariance that correlates everything."""
    rng = np.random.default_rng(seed)
    state = InsEkf(PARAMS).snapshot()
    s = state[0]
    s["R_filter_eb"] = Rotation.from_rotvec(rng.normal(0.0, 1.0, 3)).as_matrix()
    s["v_e_m_s"], s["lagged_v_e_m_s"] = [9.0, -8.0, 1.0], [10.0, -5.0, 0.5]
    s["gyro_bias_b_rad_s"], s["force_bias_b_m_s2"] = rng.normal(0.0, 0.01, 3), rng.normal(0.0, 0.1, 3)
    s["gyro_gain"], s["wind_e_m_s"][:2] = rng.normal(0.0, 0.01, 3), [2.0, -3.0]
    s["latency_s"] = 0.5
    A = rng.normal(0.0, 0.1, (N, N))
    s["P"] = A @ A.T
    return state


def moved(state, error):
    """The state that is true where `state` is the estimate and `error`, shape (N,), its error: a new record."""
    out = state.copy()
    s = out[0]
    s["R_filter_eb"] = Rotation.from_rotvec(error[:3]).as_matrix() @ s["R_filter_eb"]
    for name, first, count in VECTORS:
        value = np.array(s[name])
        value.reshape(-1)[:count] += error[first : first + count]
        s[name] = value
    return out


def difference(true, estimate):
    """The error of `estimate` against `true`, shape (N,): the inverse of `moved`."""
    t, e, error = true[0], estimate[0], np.zeros(N)
    error[:3] = Rotation.from_matrix(t["R_filter_eb"] @ e["R_filter_eb"].T).as_rotvec()
    for name, first, count in VECTORS:
        error[first : first + count] = np.atleast_1d(t[name])[:count] - np.atleast_1d(e[name])[:count]
    return error


def numerical_transition(state, dt_s, h=1e-5):
    """Central differences of the nonlinear step, (N, N); good to h^2."""
    columns = []
    middle = state.copy()
    advance_state(middle[0], GYRO, FORCE_B, dt_s)
    for i in range(N):
        ends = []
        for sign in (1.0, -1.0):
            end = moved(state, sign * h * np.eye(N)[i])
            advance_state(end[0], GYRO, FORCE_B, dt_s)
            ends.append(difference(end, middle))
        columns.append((ends[0] - ends[1]) / (2.0 * h))
    return np.array(columns).T


def transition(state, dt_s):
    """F of the kernel, (N, N), and the state after the step."""
    after = state.copy()
    advance_state(after[0], GYRO, FORCE_B, dt_s)
    F = np.eye(N)
    apply_transition(F, after[0], dt_s)
    return F, after


@pytest.mark.parametrize("gps_filter_s", [0.0, 1.0])
def test_transition_matches_numerical_differentiation_to_second_order(gps_filter_s):
    """What F leaves out is of second order in the step: it turns the specific force by the bias within the sample."""
    worst = []
    for dt_s in (0.02, 0.01):
        state = some_state()
        state["gps_filter_s"] = gps_filter_s
        F, _ = transition(state, dt_s)
        numerical = numerical_transition(state, dt_s)
        worst.append(np.abs(F - numerical).max())
        # Left out: half the turn of a sample by bias or gain, dt / 2 * rate, times the velocity gained, dt * |f|.
        assert worst[-1] <= 0.5 * dt_s**2 * np.linalg.norm(FORCE_B) * max(1.0, np.abs(GYRO).max()) + 1e-8
    assert worst[1] <= worst[0] / 3.0


def test_advance_state_equals_scipy_and_the_filter_of_the_receiver():
    """One nonlinear step against Rotation, the midpoint rule and an integration of dy/dt = (v - y) / T."""
    state, dt_s = some_state(), 0.02
    s = state[0].copy()
    after = state.copy()
    advance_state(after[0], GYRO, FORCE_B, dt_s)
    a = after[0]
    rate = (GYRO - s["gyro_bias_b_rad_s"]) / (1.0 + s["gyro_gain"])
    R0, turn = Rotation.from_matrix(s["R_filter_eb"]), Rotation.from_rotvec
    np.testing.assert_allclose(a["R_filter_eb"], (R0 * turn(rate * dt_s)).as_matrix(), rtol=0, atol=1e-12)
    force_e = (R0 * turn(0.5 * rate * dt_s)).apply(FORCE_B - s["force_bias_b_m_s2"])
    v1 = s["v_e_m_s"] + dt_s * (force_e + np.array([0.0, 0.0, 9.80665]))
    np.testing.assert_allclose(a["v_e_m_s"], v1, rtol=0, atol=1e-12)
    y, n = s["lagged_v_e_m_s"].copy(), 20000
    for k in range(n):  # trapezium rule, error (dt / n)^2
        v = s["v_e_m_s"] + (k + 0.5) / n * (v1 - s["v_e_m_s"])
        y += (v - y) * (1.0 - math.exp(-dt_s / n / s["gps_filter_s"]))
    np.testing.assert_allclose(a["lagged_v_e_m_s"], y, rtol=0, atol=1e-9)


def test_predict_equals_a_plain_kalman_filter():
    """P <- F P F^T + Q, with Q written out anew; round-off."""
    state, dt_s = some_state(), 0.02
    F, after = transition(state, dt_s)
    rate = after["rate_b"][0]
    Q = np.zeros(N)
    Q[TILT : TILT + 3] = PARAMS.gyro_noise_rad_s_sqrt_hz**2 / 2.0 + 4.0 * PARAMS.gyro_cross_axis**2 * rate @ rate
    # An accelerometer that pulls beyond 1 g errs by half its bias sigma for each g, for 2 s in one direction.
    pull_g = np.linalg.norm(FORCE_B - state["force_bias_b_m_s2"][0]) / 9.80665 - 1.0
    Q[VEL : VEL + 3] = (
        PARAMS.force_noise_m_s2_sqrt_hz**2 / 2.0 + 4.0 * (0.5 * PARAMS.force_bias_sigma_m_s2 * pull_g) ** 2
    )
    Q[WIND_NE : WIND_NE + 2] = PARAMS.wind_walk_m_s_sqrt_s**2
    expected = (
        F @ state["P"][0] @ F.T + np.diag(Q) * dt_s
    )  # the biases and the latency are at their limit: no more noise
    predict(state[0], GYRO, FORCE_B, dt_s, 0, 0)
    np.testing.assert_allclose(state["P"][0], expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(state["P"][0], state["P"][0].T)


def test_fuse_equals_a_plain_kalman_filter():
    """Gain, covariance and correction of a scalar measurement by the textbook; round-off."""
    state, rng = some_state(), np.random.default_rng(8)
    h = rng.normal(0.0, 1.0, N)
    h[5:12] = 0.0
    state["h"][0] = h
    P, innovation, variance = state["P"][0].copy(), 0.02, 0.3
    K = P @ h / (h @ P @ h + variance)
    expected = moved(state, K * innovation)
    assert fuse(state[0], innovation, variance, 5.0)
    np.testing.assert_allclose(state["P"][0], (np.eye(N) - np.outer(K, h)) @ P, rtol=0, atol=1e-14)
    np.testing.assert_allclose(difference(expected, state), np.zeros(N), rtol=0, atol=1e-14)


def test_fuse_beyond_the_gate_changes_nothing():
    """An innovation of six sigmas, or NaN, is refused at a gate of five, and the record stays as it was."""
    for factor in (6.0, math.nan):
        state = some_state()
        state["h"][0, LAG] = 1.0
        before = {name: state[name].copy() for name in ("P", "R_filter_eb", "v_e_m_s", "lagged_v_e_m_s")}
        assert not fuse(state[0], factor * math.sqrt(state["P"][0, LAG, LAG] + 0.01), 0.01, 5.0)
        for name, value in before.items():
            np.testing.assert_array_equal(state[name], value)


def test_fuse_of_nearly_exact_measurements_keeps_the_covariance_positive():
    """A thousand measurements with next to no noise: no eigenvalue falls below round-off (Joseph's form)."""
    state, rng = some_state(), np.random.default_rng(2)
    scale = np.trace(state["P"][0])
    for _ in range(1000):
        state["h"][0] = rng.normal(0.0, 1.0, N)
        fuse(state[0], 0.0, 1e-14, math.inf)
    assert np.linalg.eigvalsh(state["P"][0]).min() >= -1e-15 * scale


@pytest.mark.parametrize(
    "measure",
    [
        lambda s: through_air(s, 0),
        lambda s: through_air(s, 1),
        lambda s: through_air(s, 2),
        airspeed,
        lambda s: magnetic_course(s, np.array([18.0, -4.0, 44.0])),
    ],
    ids=["along", "across", "down", "airspeed", "magnetic"],
)
def test_gradient_of_each_measurement_matches_numerical_differentiation(measure):
    """Central differences over the error state, good to h^2 = 1e-10 of second derivatives below 100."""
    state, h = some_state(), 1e-5
    measure(state[0])
    gradient = state["h"][0].copy()
    numerical = [(measure(moved(state, h * e)[0]) - measure(moved(state, -h * e)[0])) / (2.0 * h) for e in np.eye(N)]
    np.testing.assert_allclose(gradient, numerical, rtol=0, atol=1e-8)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.05, 0.0999, 0.1001, 1.0, 3.1, 40.0])
def test_turns_equal_scipy(angle):
    """In body axes from the right, in earth axes from the left, at the border of the series and far beyond."""
    vector = angle * np.array([2.0, -3.0, 6.0]) / 7.0
    R0 = Rotation.from_rotvec([0.3, 1.0, -2.0])
    right, left = R0.as_matrix().copy(), R0.as_matrix().copy()
    turn_in_body(right, *vector)
    turn_in_earth(left, *vector)
    np.testing.assert_allclose(right, (R0 * Rotation.from_rotvec(vector)).as_matrix(), rtol=0, atol=1e-13)
    np.testing.assert_allclose(left, (Rotation.from_rotvec(vector) * R0).as_matrix(), rtol=0, atol=1e-13)
    a, b = rodrigues(angle**2)
    if angle > 1e-3:
        assert a == pytest.approx(math.sin(angle) / angle, rel=0, abs=1e-13)
        assert b == pytest.approx((1.0 - math.cos(angle)) / angle**2, rel=0, abs=1e-12)


def test_state_record_has_every_part_of_the_error():
    """The parts fill the states without gap or overlap."""
    order = sorted([(TILT, 3), *((first, count) for _, first, count in VECTORS)])
    assert [first for first, _ in order] == [sum(c for _, c in order[:i]) for i in range(len(order))]
    assert sum(count for _, count in order) == N == STATE_DTYPE["P"].shape[0]


@kernel
def call_doubt_heading(state, sigma_rad):
    doubt_heading(state[0], sigma_rad)


@kernel
def call_turn_heading(state, angle_rad):
    turn_heading(state[0], angle_rad)


def test_doubted_heading_turns_both_velocities_with_it():
    """Of a heading unknown by 0.2 rad the velocities are as unknown, square to themselves, and wholly correlated."""
    state = some_state()
    before = state["P"][0].copy()
    call_doubt_heading(state, 0.2)
    tiny_rad, turned = 1e-6, np.zeros(N)
    turn = Rotation.from_rotvec([0.0, 0.0, tiny_rad])
    turned[TILT + 2] = 1.0
    for name, first in (("v_e_m_s", VEL), ("lagged_v_e_m_s", LAG)):
        turned[first : first + 3] = (turn.apply(state[name][0]) - state[name][0]) / tiny_rad
    np.testing.assert_allclose(state["P"][0] - before, 0.04 * np.outer(turned, turned), rtol=0, atol=1e-4)


def test_turned_heading_turns_all_that_is_in_earth_axes_and_its_covariance():
    """Attitude, velocities, wind and the nose at the start by one rotation about down, P by it on both sides."""
    state, angle_rad = some_state(), 2.2
    for name, numbers in (("lagged_rate_m_s2", [0.4, -0.7, 0.2]), ("nose_at_start", [0.6, 0.7, 0.1])):
        state[name] = numbers[: state[name].shape[1]]
    before = state.copy()
    call_turn_heading(state, angle_rad)
    about = Rotation.from_rotvec([0.0, 0.0, angle_rad]).as_matrix()
    np.testing.assert_allclose(state["R_filter_eb"][0], about @ before["R_filter_eb"][0], rtol=0, atol=1e-12)
    for name in ("v_e_m_s", "lagged_v_e_m_s", "lagged_rate_m_s2", "wind_e_m_s", "nose_at_start"):
        expected = np.array(before[name][0])
        expected[:2] = about[:2, :2] @ expected[:2]
        np.testing.assert_allclose(state[name][0], expected, rtol=0, atol=1e-12, err_msg=name)
    T = np.eye(N)
    for first in (TILT, VEL, LAG, WIND_NE):
        T[first : first + 2, first : first + 2] = about[:2, :2]
    np.testing.assert_allclose(state["P"][0], T @ before["P"][0] @ T.T, rtol=0, atol=1e-12)
