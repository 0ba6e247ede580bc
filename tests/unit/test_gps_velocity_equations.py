"""Eqns 1 to 5 of the note one by one, the memory they need, and the signs, against closed forms and SciPy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import gps_velocity
from estimator.blocks import gyro_frame
from estimator.gps_velocity import GpsVelocity, GpsVelocityParams
from estimator.interface import MEASURED_DTYPE

G = gps_velocity.G_M_S2
ROUND_OFF = 1e-12


# Kernels take records; these enter them the way `step` does.
@gps_velocity.kernel
def call_roll_pitch(state, dv_e_m_s):
    gps_velocity.roll_pitch_at_fix(state[0], dv_e_m_s)


@gps_velocity.kernel
def call_correct(state, error_e, weight, k_i, interval_s):
    gps_velocity.correct(state[0], error_e, weight, k_i, interval_s, state[0].tilt_rate_e)


@gps_velocity.kernel
def call_recall(state, t_s):
    gyro_frame.recall(state[0], t_s)


def lagless(**params):
    """Parameters of an estimator that believes in a receiver without lag."""
    return GpsVelocityParams(**{"gps_filter_s": 0.0, "gps_latency_s": 0.0, **params})


def at_fix(R_estimated, felt_e, interval_s=0.25):
    """State at a fix of an estimator that believes `R_estimated` and summed up `felt_e` along it."""
    state = GpsVelocity(lagless()).snapshot()
    state["R_eg"][0] = R_estimated
    state["since_fix_g_m_s"][0], state["interval_s"] = felt_e, interval_s
    return state


def tumbling(duration_s, dt_s, rate=(0.5, -0.8, 0.6)):
    """Rows of a constant body rate and a constant body specific force."""
    rows = np.zeros(round(duration_s / dt_s), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(len(rows)) + 1) * dt_s, dt_s
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = rate, (1.0, -2.0, -9.0)
    return rows


@pytest.mark.parametrize("seed", range(5))
def test_error_of_eqn_4_undoes_a_small_error_whatever_the_acceleration(seed):
    """Sign and size: exp(error) times the estimate is the truth, along what the two sides can see, to second order."""
    rng = np.random.default_rng(seed)
    true = Rotation.random(rng=rng)
    dv = rng.normal(0.0, 0.5, 3)
    right = np.array([0.0, 0.0, 0.25 * G]) - dv  # Eqn 3, which the true attitude fulfils
    felt_b = true.inv().apply(right)
    axis = np.cross(right, rng.standard_normal(3))  # a rotation about `right` itself is not to be seen
    wrong = Rotation.from_rotvec(math.radians(1.0) * axis / np.linalg.norm(axis))
    state = at_fix((wrong * true).as_matrix(), felt_b)
    call_roll_pitch(state, dv)
    corrected = Rotation.from_rotvec(state["error_e"][0]) * wrong * true
    assert (corrected * true.inv()).magnitude() < math.radians(1.0) ** 2
    assert np.linalg.norm(state["error_e"][0]) == pytest.approx(math.sin(math.radians(1.0)), rel=0, abs=1e-12)


def test_error_of_eqn_4_is_the_cross_product_of_both_sides():
    """Left side times right side, divided by their lengths."""
    rng = np.random.default_rng(1)
    felt, dv, R = rng.normal([0.0, 0.0, 2.5], 0.5), rng.normal(0.0, 0.3, 3), Rotation.random(rng=rng).as_matrix()
    state = at_fix(R, R.T @ felt)
    call_roll_pitch(state, dv)
    right = np.array([0.0, 0.0, 0.25 * G]) - dv
    oracle = np.cross(felt, right) / np.linalg.norm(felt) / np.linalg.norm(right)
    np.testing.assert_allclose(state["error_e"][0], oracle, rtol=0, atol=ROUND_OFF)


def test_error_without_vertical_velocity_compares_the_horizontal_components_alone():
    """Where it is not reported, the third component of a fix has no influence; the vertical is as felt."""
    felt, dv = np.array([0.3, -0.2, 2.0]), np.array([0.1, 0.4, 0.0])
    errors = []
    for vertical in (0.0, 5.0, math.nan):
        state = at_fix(np.eye(3), felt)
        state["gps_vertical_velocity"] = 0
        call_roll_pitch(state, dv + np.array([0.0, 0.0, vertical]))
        errors.append(state["error_e"][0].copy())
    right = np.array([-dv[0], -dv[1], felt[2]])
    # Longer than half of gravity's over the interval, so that the lengths of both sides divide it.
    oracle = np.cross(felt, right) / np.linalg.norm(felt) / np.linalg.norm(right)
    for error in errors:
        np.testing.assert_allclose(error, oracle, rtol=0, atol=ROUND_OFF)


def test_error_in_free_fall_between_two_reports_is_zero():
    """Nothing is felt, and the velocity grows by gravity: both sides of Eqn 3 vanish, and divide nothing."""
    state = at_fix(Rotation.from_euler("x", 0.4).as_matrix(), np.zeros(3))
    call_roll_pitch(state, np.array([0.0, 0.0, 0.25 * G]))
    np.testing.assert_allclose(state["error_e"][0], 0.0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("seed", range(3))
def test_correct_is_eqns_5_28_and_29(seed):
    """Error seen from the body, weighted; the integral by K_I, the rate so that exp(-K_P W T) of the error is left."""
    rng = np.random.default_rng(seed)
    R_eg, R_gb = Rotation.random(2, rng=rng).as_matrix()
    state = GpsVelocity(GpsVelocityParams(k_p=0.8)).snapshot()
    state["R_eg"][0], state["R_gb"][0] = R_eg, R_gb
    error_e, interval_s, weight = rng.normal(0.0, 0.02, 3), 0.5, 0.6
    call_correct(state, error_e, weight, 0.05, interval_s)
    error_b = (R_eg @ R_gb).T @ error_e  # Eqn 5
    oracle = 0.05 * interval_s * weight * error_b
    np.testing.assert_allclose(state["omega_i_b"][0], oracle, rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(state["gyro_bias_b_rad_s"][0], -oracle, rtol=0, atol=ROUND_OFF)
    left = error_e - interval_s * state["tilt_rate_e"][0]
    np.testing.assert_allclose(left, math.exp(-0.8 * weight * interval_s) * error_e, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("rate", [(0.0, 0.0, 1.1), (1.1, 0.0, 0.0), (0.0, -1.1, 0.0)])
def test_sum_of_eqn_3_is_the_integral_of_the_turned_accelerometer(rate):
    """A constant force in a body that turns about one axis: the closed form of the integral, half a degree a tick."""
    dt_s, duration_s = 0.01, 2.0
    estimator = GpsVelocity(lagless())
    estimator.replay(tumbling(duration_s, dt_s, rate))
    accelerometer = np.array([-1.0, 2.0, 9.0])  # Eqn 1: gravity minus acceleration
    times = (np.arange(20000) + 0.5) * 1e-4
    oracle = 1e-4 * Rotation.from_rotvec(times[:, None] * rate).apply(accelerometer).sum(axis=0)
    felt = estimator.snapshot()["felt_g_m_s"][0]
    # Half a tick by a straight line: (theta / 2)^2 / 2 of the force; Eqn 17: an angle of theta^3 / 3 a tick.
    # (Leaving that half tick out would leave theta / 2 = 0.0055 of the force, 0.1 m/s.)
    theta = 1.1 * dt_s
    atol = 9.3 * duration_s * (theta**2 / 8 + 0.5 * duration_s / dt_s * theta**3 / 3)
    np.testing.assert_allclose(felt, oracle, rtol=0, atol=atol)


def test_memory_is_filtered_as_the_receiver_filters_and_recalled_a_latency_ago():
    """Turning at a constant rate, the nose passed through 1 / (1 + s T) and 0.3 s is the closed form."""
    rate, filter_s, latency_s, dt_s = 0.5, 1.0, 0.3, 0.02
    rows = tumbling(20.0, dt_s, rate=(0.0, 0.0, rate))
    estimator = GpsVelocity(GpsVelocityParams(gps_filter_s=filter_s, gps_latency_s=latency_s, w_start=0.0))
    estimator.replay(rows)
    state = estimator.snapshot()
    call_recall(state, state["clock_s"][0] - latency_s)
    gone = 20.0 - latency_s
    # From a nose north at rest: forced answer plus what is left of the start.
    forced = np.exp(1j * rate * gone) / (1.0 + 1j * rate * filter_s)
    oracle = forced + (1.0 - 1.0 / (1.0 + 1j * rate * filter_s)) * math.exp(-gone / filter_s)
    north, east, down = state["at_fix_g"][0, 3:]
    # Linear within a tick: (rate dt)^2 / 12; Eqn 17's angle: theta^3 / 3 a tick.
    assert abs(complex(north, east) - oracle) < 0.01**2 / 12 + 1000 * 0.01**3 / 3
    assert abs(down) < 1e-12


@pytest.mark.parametrize("latency_s", [0.0, 0.017, 2.5, 12.0])
@pytest.mark.parametrize("dt_s", [0.02, 0.005])
def test_recall_reaches_back_12_s_at_any_sample_rate(latency_s, dt_s):
    """Without a filter the remembered sum of a constant force is a ramp, met exactly in between."""
    rows = tumbling(30.0, dt_s, rate=(0.0, 0.0, 0.0))
    estimator = GpsVelocity(lagless(w_start=0.0))
    estimator.replay(rows)
    state = estimator.snapshot()
    call_recall(state, state["clock_s"][0] - latency_s)
    np.testing.assert_allclose(state["at_fix_g"][0, 2], 9.0 * (30.0 - latency_s), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "value"),
    [("w_rp", -0.1), ("w_y", math.nan), ("k_i", math.inf), ("gps_latency_s", 13.0), ("launch_gate", 0.0),
     ("gyro_range_rad_s", math.inf), ("declination_rad", 4.0), ("yaw_reference", "sun")],
)  # fmt: skip
def test_params_impossible_value_is_refused_by_name(name, value):
    """The message says which parameter and what it was."""
    with pytest.raises(ValueError, match=rf"{name} is '?{value}"):
        GpsVelocityParams(**{name: value})
