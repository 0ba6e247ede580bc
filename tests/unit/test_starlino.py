"""Starlino's filter against the tutorial's equations in NumPy and SciPy, and its errata as they are printed."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import starlino
from estimator.blocks.calibration import Calibration
from estimator.interface import MEASURED_DTYPE, Health, ImuSample
from estimator.rotation import heading_rad, inclination_error_rad, rotation_error_rad
from estimator.starlino import Starlino, StarlinoParams

G, DT = starlino.G_M_S2, 0.02
FIELD = np.array([19.6, 0.0, 47.8])  # microtesla, to magnetic north, dip 68 degrees
NWU = np.diag([1.0, -1.0, -1.0])
ROUND_OFF = 1e-13


def rows_of(R, omega_b=(0.0, 0.0, 0.0), every=0, scale=1.0):
    """Perfect measurements of the attitudes `R`, (n, 3, 3): a field every so many samples, `scale` times gravity."""
    rows = np.zeros(len(R), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(len(R)) + 1) * DT, DT
    rows["gyro_b_rad_s"] = omega_b
    rows["force_b_m_s2"] = -G * scale * R[:, 2]
    rows["mag_b_ut"] = np.einsum("nij,i->nj", R, FIELD)
    if every:
        rows["mag_new"][::every] = 1
    return rows


def still(R, n=1, **kw):
    """The same for something that stands still."""
    return rows_of(np.tile(R, (n, 1, 1)), **kw)


def turning(rate_rad_s, n):
    """Attitudes of a level turn from north, and the rate in body axes."""
    angle = np.outer((np.arange(n) + 1) * DT, [rate_rad_s])
    return Rotation.from_euler("z", angle).as_matrix(), (0.0, 0.0, rate_rad_s)


def at(R, params=None):
    """An estimator that believes `R`, its heading too."""
    estimator = Starlino(params)
    state = estimator.snapshot()
    state["R_eb"], state["dcm"], state["aligned"] = R, NWU @ R, 1
    estimator.restore(state)
    return estimator


def printed(R, rows, sign=-1.0, s_g=20.0, s_a=1.0, s_m=0.0, every=True):
    """Part 4 as it is printed, in NumPy: one mean over all weights; `sign` of the gyro (printed: +1)."""
    D = NWU @ R
    for row in rows:
        A = row["force_b_m_s2"] / np.linalg.norm(row["force_b_m_s2"])
        W = np.cross(A, row["mag_b_ut"])
        N = np.cross(W / np.linalg.norm(W), A)
        d = s_g * sign * DT * row["gyro_b_rad_s"] + s_a * np.cross(D[2], A) + s_m * np.cross(D[0], N)
        d = d / (s_g + s_a + s_m)
        first, second = D[0] + np.cross(d, D[0]), D[1] + np.cross(d, D[1])
        err = 0.5 * first @ second
        first, second = first - err * second, second - err * first
        first, second = first / np.linalg.norm(first), second / np.linalg.norm(second)
        D = np.array([first, second, np.cross(first, second)])
    return NWU @ D


def test_gyro_with_the_printed_sign_turns_backwards_and_negated_forwards():
    """The erratum of comments 36 and 37: ninety degrees to the right come out as ninety to the left in print."""
    R, omega = turning(math.radians(45.0), 100)
    rows = rows_of(R, omega)
    as_printed, as_mended = (printed(np.eye(3), rows, sign, s_a=0.0) for sign in (1.0, -1.0))
    ours = Starlino(StarlinoParams(use_magnetometer=False)).replay(rows)["R_eb"][-1]
    # First order in the step of 0.9 degrees: the angle comes out short by a third of its square, 8e-5.
    assert math.degrees(heading_rad(as_printed)) == pytest.approx(-90.0, rel=0, abs=0.01)
    assert math.degrees(heading_rad(as_mended)) == pytest.approx(90.0, rel=0, abs=0.01)
    assert math.degrees(heading_rad(ours)) == pytest.approx(90.0, rel=0, abs=0.01)


def test_one_mean_over_all_weights_as_printed_loses_a_twenty_first_of_a_turn():
    """The accelerometer is blind to a turn about the vertical: divided by its weight too, 90 degrees become 85.7."""
    R, omega = turning(math.radians(45.0), 100)
    rows = rows_of(R, omega)
    ours = Starlino(StarlinoParams(use_magnetometer=False)).replay(rows)["R_eb"][-1]
    assert math.degrees(heading_rad(printed(np.eye(3), rows))) == pytest.approx(90.0 * 20.0 / 21.0, rel=0, abs=0.01)
    assert math.degrees(heading_rad(ours)) == pytest.approx(90.0, rel=0, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_mean_about_each_axis_is_over_those_that_can_tell(seed):
    """One sample, any attitude and error: Part 4 in NumPy with a mean of its own about I, J and K."""
    rng = np.random.default_rng(seed)
    true = Rotation.random(rng=rng)
    R = (Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)) * true).as_matrix()
    rows = still(true.as_matrix(), omega_b=rng.normal(0.0, 0.5, 3), every=1)
    weights = {"s_g": 11.0, "s_a": 2.0, "s_m": 3.0}
    got = at(R, StarlinoParams(**weights)).replay(rows)["R_eb"][0]
    D, T = NWU @ R, NWU @ true.as_matrix()
    # In the earth's axes: what each felt, with zero weight about the axis along the vector that it looks at.
    felt = [D @ (-DT * rows["gyro_b_rad_s"][0]), D @ np.cross(D[2], T[2]), D @ np.cross(D[0], T[0])]
    sees = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1]]) * np.array(list(weights.values()))[:, None]
    d = D.T @ (np.sum(sees * np.array(felt), axis=0) / np.sum(sees, axis=0))
    first, second = D[0] + np.cross(d, D[0]), D[1] + np.cross(d, D[1])
    err = 0.5 * first @ second
    first, second = first - err * second, second - err * first
    first, second = first / np.linalg.norm(first), second / np.linalg.norm(second)
    expected = NWU @ np.array([first, second, np.cross(first, second)])
    np.testing.assert_allclose(got, expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("seed", range(5))
def test_horizontal_north_is_perpendicular_to_the_zenith_and_west_depends_on_the_sign(seed):
    """W = A x M is west with the zenith for A and east with gravity's sign; N = W x A is north with both."""
    R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    M = R.T @ FIELD
    for A, west in ((-R[2], -R[1]), (R[2], R[1])):
        W = np.cross(A, M) / np.linalg.norm(np.cross(A, M))
        np.testing.assert_allclose(W, west, rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(np.cross(W, A), R[0], rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("e", [0.2, 0.05, -0.01, 1e-6])
def test_half_of_the_error_to_each_leaves_its_cube_over_four(e):
    """Scenario 3, which the tutorial does not prove: (a - e b / 2) . (b - e a / 2) = e^3 / 4."""
    a, b = (1.0, 0.0, 0.0), (e, math.sqrt(1.0 - e * e), 0.0)
    got_a, got_b = starlino.orthonormalise(a, b)
    length = 1.0 - 0.75 * e * e  # |a - e b / 2|^2
    assert np.dot(got_a, got_b) == pytest.approx(e**3 / 4.0 / length, rel=0, abs=1e-15)
    assert np.linalg.norm(got_a) == pytest.approx(1.0, rel=0, abs=1e-15)


@pytest.mark.parametrize(
    ("load", "part"), [(1.0, 1.0), (1.1, 0.5), (0.9, 0.5), (0.8, 0.0), (1.2, 0.0), (2.0, 0.0), (0.0, 0.0)]
)
def test_accelerometer_loses_weight_as_its_length_leaves_gravity(load, part):
    """Linear from 0.8 to 1.2 g (comment 28); a tilt of one degree goes by s_a / (s_g + s_a) of itself in a sample."""
    assert starlino.trust(load * G, 0.2) == pytest.approx(part, rel=0, abs=ROUND_OFF)
    tilted = Rotation.from_euler("x", 1.0, degrees=True).as_matrix()
    got = at(tilted).replay(still(np.eye(3), scale=load))["R_eb"][0]
    left = math.degrees(inclination_error_rad(got, np.eye(3)))
    assert left == pytest.approx(1.0 - part / (20.0 + part), rel=0, abs=1e-4)  # sine against angle


def test_tilt_error_decays_by_a_twenty_first_in_every_sample():
    """The closed form: (20 / 21)^n of a small tilt is left after n samples, 0.4 s at 50 Hz to an e-th."""
    tilted = Rotation.from_euler("y", 1.0, degrees=True).as_matrix()
    got = at(tilted).replay(still(np.eye(3), 100))["R_eb"]
    expected = (20.0 / 21.0) ** (np.arange(100) + 1)
    # Sine against angle: at most (1 degree)^2 / 6 of itself.
    np.testing.assert_allclose(np.degrees(inclination_error_rad(got, np.eye(3))), expected, rtol=0, atol=1e-4)


def test_gyro_offset_is_outweighed_and_never_learnt():
    """No integral: an offset b leaves the tilt b dt s_g / s_a for ever, and the heading runs away."""
    b = math.radians(0.5)
    got = Starlino(StarlinoParams(use_magnetometer=False)).replay(still(np.eye(3), 1000, omega_b=(b, 0.0, b)))
    last = got[-1]
    assert float(inclination_error_rad(last["R_eb"], np.eye(3))) == pytest.approx(20.0 * b * DT, rel=0.01)
    assert float(heading_rad(last["R_eb"])) == pytest.approx(1000 * b * DT, rel=0.01)
    np.testing.assert_array_equal(last["gyro_bias_b_rad_s"], 0.0)


def test_unit_matrix_corrects_itself():
    """Comment 112: from north and level to any attitude, nearly upside down and reversed too."""
    for seed in range(5):
        R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        got = Starlino().replay(still(R, 3000, every=5))["R_eb"][-1]
        assert math.degrees(rotation_error_rad(got, R)) < 0.1


@pytest.mark.parametrize("declination_deg", [-13.0, 0.0, 25.0])
def test_magnetometer_brings_true_north_and_calibration_takes_iron_off(declination_deg):
    """Field to magnetic north with hard and soft iron on it, and a declination: the true heading, to a hundredth."""
    declination = math.radians(declination_deg)
    R = Rotation.from_euler("ZYX", [2.0, 0.2, -0.3]).as_matrix()
    iron, hard = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.0], [0.0, 0.0, 1.0]]), np.array([12.0, -7.0, 20.0])
    rows = still(R, 3000, every=5)
    rows["mag_b_ut"] = iron @ (R.T @ Rotation.from_euler("z", declination).apply(FIELD)) + hard
    calibration = Calibration(tuple(hard), tuple(map(tuple, np.linalg.inv(iron))))
    got = Starlino(StarlinoParams(calibration=calibration, declination_rad=declination)).replay(rows)
    assert math.degrees(rotation_error_rad(got["R_eb"][-1], R)) < 0.01
    assert got["health"][-1] == Health.GOOD


def test_without_magnetometer_asked_for_its_samples_change_nothing():
    """6-DOF is bit for bit the same with and without samples."""
    R, omega = turning(0.3, 200)
    form = StarlinoParams(use_magnetometer=False)
    with_samples, without = (Starlino(form).replay(rows_of(R, omega, every=every)) for every in (5, 0))
    assert with_samples.tobytes() == without.tobytes()


@pytest.mark.parametrize("field", [(math.nan, 0.0, 40.0), (-315.0, 0.0, 40.0), (math.inf, 1.0, 1.0)])
def test_field_that_cannot_be_is_rejected_and_counted(field):
    """Not a number, or the overflow count of the part: the sample is dropped, the tick counted, the health poor."""
    rows = still(np.eye(3), 10, every=1)
    clean = Starlino(StarlinoParams(use_magnetometer=False)).replay(rows)["R_eb"]
    rows["mag_b_ut"] = field
    estimator = Starlino()
    got = estimator.replay(rows)
    np.testing.assert_array_equal(got["R_eb"], clean)
    assert estimator.rejected == 10
    assert np.all(got["health"] == Health.POOR)


@pytest.mark.parametrize("field", [(0.0, 0.0, 48.0), (0.0, 0.0, 0.0)])
def test_field_without_a_horizontal_part_is_no_north(field):
    """At the magnetic pole, or in none: the heading stays the gyros'."""
    rows = still(np.eye(3), 10, every=1)
    rows["mag_b_ut"] = field
    R = Rotation.from_euler("z", 1.0).as_matrix()
    assert float(heading_rad(at(R).replay(rows)["R_eb"][-1])) == pytest.approx(1.0, rel=0, abs=ROUND_OFF)


def test_fast_rotation_and_wild_samples_stay_on_the_rotations():
    """Up to 2000 deg/s and lost samples: orthonormal to 1e-3 at every tick, where SO(3) ends for this project."""
    rng = np.random.default_rng(3)
    rows = still(np.eye(3), 2000, every=3)
    rows["gyro_b_rad_s"] = rng.uniform(-35.0, 35.0, (2000, 3))
    rows["force_b_m_s2"] = rng.normal(0.0, 30.0, (2000, 3))
    rows["mag_b_ut"] = rng.normal(0.0, 60.0, (2000, 3))
    rows["t_s"] += np.cumsum(rng.choice([0.0, 0.3], 2000, p=[0.95, 0.05]))
    R = Starlino().replay(rows)["R_eb"]
    assert np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max() < 1e-3
    assert np.linalg.det(R).min() > 0.99


def test_power_up_takes_offset_and_tilt_into_the_tutorials_frame():
    """Its matrix has rows north, west, up; ours north, east, down; from the first tick on they are the same."""
    R = Rotation.from_euler("ZYX", [0.0, 0.2, 0.5]).as_matrix()
    estimator = Starlino()
    estimator.reset(ImuSample(2.0, DT, np.full(3, 0.1), -G * R[2]))
    np.testing.assert_allclose(estimator.snapshot()["dcm"][0], NWU @ R, rtol=0, atol=ROUND_OFF)
    got = estimator.replay(still(R, 50, omega_b=(0.1, 0.1, 0.1)))
    np.testing.assert_allclose(got["R_eb"][-1], R, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value"),
    [("s_g", 0.0), ("s_a", -1.0), ("s_m", math.nan), ("band", 0.0), ("declination_rad", 4.0), ("field_range_ut", 0.0)],
)
def test_impossible_parameter_is_refused(name, value):
    """One line with the field and its value."""
    with pytest.raises(ValueError, match=f"{name} is {value}.*must be"):
        StarlinoParams(**{name: value})
