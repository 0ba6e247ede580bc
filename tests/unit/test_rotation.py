"""Direction-cosine algebra against SciPy's Rotation and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from estimator import rotation

ANGLE = st.floats(-math.pi, math.pi)
UNIT = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)
ROUND_OFF = 1e-12


def rotations(n, seed=1):
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix()


@given(ANGLE, st.floats(-1.57, 1.57), ANGLE)
def test_from_euler_any_angles_agrees_with_scipy_and_eqn_2(roll, pitch, yaw):
    """Eqn 2 is yaw, then pitch, then roll, and its last row is the paper's."""
    R = rotation.from_euler(roll, pitch, yaw)
    oracle = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(R, oracle, rtol=0, atol=ROUND_OFF)
    last = [-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)]
    np.testing.assert_allclose(R[2], last, rtol=0, atol=ROUND_OFF)


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE)
def test_to_euler_of_from_euler_returns_the_angles(roll, pitch, yaw):
    """Away from the vertical the Euler angles come back, up to whole turns."""
    back = rotation.to_euler(rotation.from_euler(roll, pitch, yaw))
    for angle, again in zip((roll, pitch, yaw), back, strict=True):
        assert abs(math.remainder(angle - float(again), 2 * math.pi)) < 1e-13  # 4 eps / cos(pitch) > 0.07


def test_euler_of_a_stack_equals_each_alone():
    """A whole log is converted as its rows would be."""
    R = rotations(50)
    roll, pitch, yaw = rotation.to_euler(R)
    assert roll.shape == (50,)
    np.testing.assert_allclose(rotation.from_euler(roll, pitch, yaw), R, rtol=0, atol=ROUND_OFF)
    assert [float(rotation.heading_rad(r)) for r in R] == yaw.tolist()


@given(UNIT, st.one_of(st.floats(0.0, math.pi - 1e-9), st.floats(0.0, 1e-6), st.floats(3.1, 3.1415)))
def test_exp_and_log_any_angle_agree_with_scipy(axis, angle):
    """The exponential, and its inverse right up to half a turn."""
    vector = np.array(axis) / np.linalg.norm(axis) * angle
    R = rotation.exp(vector)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), rtol=0, atol=ROUND_OFF)
    # The axis is that of the antisymmetric or of the symmetric part, whichever is not small: right to a few eps of pi.
    np.testing.assert_allclose(rotation.log(R), vector, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation.exp(rotation.log(R)), R, rtol=0, atol=ROUND_OFF)


def test_log_of_exactly_half_a_turn_has_length_pi():
    """Where the antisymmetric part vanishes the axis still comes out."""
    for axis in np.eye(3):
        R = 2.0 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_allclose(np.abs(rotation.log(R)), math.pi * axis, rtol=0, atol=ROUND_OFF)


def test_propagate_one_step_is_eqn_17():
    """R (I + [dtheta x]), written with NumPy."""
    R, w, dt = rotations(1)[0], np.array([0.3, -1.1, 0.7]), 0.02
    x, y, z = w * dt
    oracle = R @ np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
    rotation.propagate(R, w, dt)
    np.testing.assert_allclose(R, oracle, rtol=0, atol=1e-15)


def test_propagate_one_step_errs_by_half_the_angle_squared():
    """The paper's figure: 60 deg/s over 20 ms ignores terms of 0.02 %; half the step, a quarter of the error."""
    w = math.radians(60.0) * np.array([0.6, 0.0, 0.8])
    errors = []
    for dt in (0.02, 0.01):
        R = np.eye(3)
        rotation.propagate(R, w, dt)
        errors.append(np.linalg.norm(R - Rotation.from_rotvec(w * dt).as_matrix(), 2))
        angle = math.radians(60.0) * dt
        assert errors[-1] == pytest.approx(angle**2 / 2, rel=angle)  # the next term is angle^3 / 3
    assert errors[0] == pytest.approx(2.2e-4, rel=0, abs=0.05e-4)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0, abs=0.01)


def drift_rad_s(rate, axis, dt):
    """How far Eqns 17-21 fall behind in a second of steady rotation from level."""
    R = np.eye(3)
    for _ in range(round(1.0 / dt)):
        rotation.propagate(R, rate * axis, dt)
        assert rotation.renormalise(R)
    return float(rotation.rotation_error_rad(R, Rotation.from_rotvec(rate * axis).as_matrix()))


@pytest.mark.parametrize("rate_deg_s", [60.0, 115.0])
@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [0.6, -0.8, 0.0]])
def test_propagate_and_renormalise_about_an_earth_axis_lags_by_a_third_of_the_angle_cubed(rate_deg_s, axis):
    """About the vertical or a horizontal axis a step turns by atan(theta): theta^3 / 3 too little, second order."""
    rate = math.radians(rate_deg_s)
    lag, finer = (drift_rad_s(rate, np.array(axis), dt) for dt in (0.02, 0.01))
    assert lag == pytest.approx((rate * 0.02) ** 3 / 3 / 0.02, rel=2 * (rate * 0.02) ** 2)  # next: theta^5 / 5
    assert lag / finer == pytest.approx(4.0, rel=0, abs=0.02)


def test_propagate_and_renormalise_about_a_slanting_axis_tilts_by_the_product_of_the_parts():
    """Eqn 20 lets the Z row bear all: w_v w_h dt / 2 of tilt a second, first order, so small steps matter."""
    rate, axis = math.radians(60.0), np.array([2.0, -1.0, 2.0]) / 3.0
    drift, finer = (drift_rad_s(rate, axis, dt) for dt in (0.02, 0.01))
    closed = rate**2 * axis[2] * math.hypot(axis[0], axis[1]) * 0.02 / 2
    assert drift == pytest.approx(closed, rel=0.05)  # the rest is of the order of theta = 0.02 more
    assert drift / finer == pytest.approx(2.0, rel=0, abs=0.05)


def test_renormalise_small_error_is_eqns_18_to_21():
    """The paper's four steps, written with NumPy on the rows."""
    R = rotations(1)[0] + np.random.default_rng(0).normal(0.0, 0.002, (3, 3))
    X, Y = R[0], R[1]
    error = X @ Y
    rows = [X - error / 2 * Y, Y - error / 2 * X]
    rows.append(np.cross(rows[0], rows[1]))
    oracle = np.array([0.5 * (3.0 - r @ r) * r for r in rows])
    assert rotation.renormalise(R)
    np.testing.assert_allclose(R, oracle, rtol=0, atol=1e-15)


@settings(max_examples=settings.default.max_examples * 3)
@given(st.integers(0, 10**6), st.floats(-4.0, 2.0))
def test_renormalise_any_distortion_gives_a_rotation(seed, decade):
    """From a ten-thousandth off to a hundred times off: |R R^T - I| < 1e-3 and right-handed, or a clear refusal."""
    rng = np.random.default_rng(seed)
    R = rotations(1, seed)[0] + 10.0**decade * rng.normal(size=(3, 3))
    if rotation.renormalise(R):
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-3
        assert np.linalg.det(R) > 0.0
    else:
        sine = np.linalg.norm(np.cross(R[0], R[1])) / np.linalg.norm(R[0]) / np.linalg.norm(R[1])
        assert sine < 1.1e-3 or not 1e-3 < np.linalg.norm(R[0]) < 1e3 or not 1e-3 < np.linalg.norm(R[1]) < 1e3


def test_renormalise_repeated_converges_to_round_off():
    """The residue of one call is of second order: three calls leave nothing."""
    R = rotations(1)[0] + np.random.default_rng(3).normal(0.0, 0.003, (3, 3))
    for _ in range(3):
        assert rotation.renormalise(R)
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize(
    "R",
    [
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.full((3, 3), np.inf),
        np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 1.0]]),
    ],
)
def test_renormalise_hopeless_matrix_says_so_and_leaves_it(R):
    """Nothing is invented from a matrix that has lost its axes."""
    before = R.copy()
    assert not rotation.renormalise(R)
    np.testing.assert_array_equal(R, before)


def test_integrate_far_in_one_sample_stays_with_the_exponential():
    """A lost half second at 3 rad/s is cut into parts: the error is that of the parts, n theta^3 / 3."""
    w, dt = np.array([0.0, 3.0, 0.0]), 0.5
    R = np.eye(3)
    assert rotation.integrate(R, w, dt)
    parts = 1 + int(1.5 / rotation.LONGEST_STEP_RAD)
    error = float(rotation.rotation_error_rad(R, Rotation.from_rotvec(w * dt).as_matrix()))
    assert 0.0 < error < parts * (1.5 / parts) ** 3 / 3


def test_integrate_broken_matrix_restarts_level():
    """A matrix that cannot be saved becomes level, heading north, and the caller is told."""
    R = np.full((3, 3), np.nan)
    assert not rotation.integrate(R, np.zeros(3), 0.02)
    np.testing.assert_array_equal(R, np.eye(3))


@given(UNIT, st.one_of(st.floats(0.0, math.pi), st.floats(0.0, 1e-7), st.floats(3.1415, math.pi)))
def test_rotation_error_any_angle_is_the_geodesic(axis, angle):
    """Exact from a ten-millionth of a radian to half a turn, where an arc cosine of the trace is blind."""
    A = rotations(1)[0]
    B = Rotation.from_rotvec(np.array(axis) / np.linalg.norm(axis) * angle).as_matrix() @ A
    # With s = sin(angle / 2) the code sums s^2 = |A - B|^2 / 8.  Each element of B is right to e = 4 eps (quaternion to
    # matrix, three products), which moves s^2 by sqrt(2)/2 |3 e| s, and the sum itself by 9/2 eps s^2: 3e-15 s in all.
    # The angle is 2 asin(s) and moves by that over s c, c the cosine; at half a turn, where c is 0, by 2 sqrt(3e-15) at
    # most.  The vector handed to SciPy is right to 4 eps of its length of pi: another 3e-15.
    c = math.cos(0.5 * angle)
    bound = 3e-15 + min(3e-15 / c if c > 0.0 else math.inf, 1.1e-7)
    assert float(rotation.rotation_error_rad(A, B)) == pytest.approx(angle, rel=0, abs=bound)


@given(ANGLE, st.floats(-1.4, 1.4), st.floats(-3.0, 3.0), st.one_of(st.floats(0, 3.1), st.floats(0, 1e-7)))
def test_inclination_error_of_a_tilt_is_its_angle_whatever_the_heading(roll, pitch, yaw, tilt):
    """A rotation about a horizontal axis is all inclination; one about the vertical none."""
    R = rotation.from_euler(roll, pitch, 0.4)
    leaning = Rotation.from_euler("z", yaw) * Rotation.from_rotvec([0.6 * tilt, 0.8 * tilt, 0])
    tilted = leaning.as_matrix() @ R
    assert float(rotation.inclination_error_rad(tilted, R)) == pytest.approx(
        tilt, rel=0, abs=1e-14
    )  # two rows right to 1e-15


def test_heading_error_across_south_wraps():
    """From 179 to -179 degrees is two degrees to the right, not 358 to the left."""
    estimated = rotation.from_euler(0.1, 0.2, math.radians(-179))
    true = rotation.from_euler(0.3, -0.1, math.radians(179))
    assert float(rotation.heading_error_rad(estimated, true)) == pytest.approx(math.radians(2), rel=0, abs=ROUND_OFF)


def test_errors_of_a_stack_equal_each_alone():
    """The vectorised errors, one by one."""
    A, B = rotations(40, 1), rotations(40, 2)
    for f in (rotation.rotation_error_rad, rotation.inclination_error_rad, rotation.heading_error_rad):
        np.testing.assert_array_equal(f(A, B), [f(a, b) for a, b in zip(A, B, strict=True)])
