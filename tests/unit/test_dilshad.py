"""Dilshad and Jahan's estimator: Eqns 1-12 against SciPy, each erratum as it is printed, and the GPS's correction."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import dilshad
from estimator.blocks.calibration import Calibration
from estimator.blocks.kernels import wrap
from estimator.dilshad import Dilshad, DilshadParams, heading_of_field, paper_angles
from estimator.interface import G_M_S2 as G
from estimator.interface import MEASURED_DTYPE, Health, ImuSample
from estimator.rotation import heading_rad, inclination_error_rad, rotation_error_rad

DT = 0.02
FLU = np.diag([1.0, -1.0, -1.0])  # the paper's axes from ours, body and earth alike
FIELD = np.array([19.6, 0.0, 47.8])  # to magnetic north, dip 68 degrees
ROUND_OFF = 1e-13


def still(R, n, every=5):
    """Perfect measurements of something that stands still, a field every so many samples."""
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT, DT
    rows["force_b_m_s2"] = -G * R[2]
    rows["mag_b_ut"] = R.T @ FIELD
    if every:
        rows["mag_new"][::every] = 1
    return rows


def fly_to(rows, course_rad, speed_m_s=12.0, gps_hz=5, lag_s=0.0, noise_m=0.0):
    """Add GPS reports of straight flight to the rows."""
    new = np.zeros(len(rows), bool)
    new[:: round(1.0 / gps_hz / DT)] = True
    way = speed_m_s * (rows["t_s"] - lag_s)
    rows["gps_new"], rows["gps_valid"] = new, 1
    rows["gps_p_e_m"][:, 0], rows["gps_p_e_m"][:, 1] = way * np.cos(course_rad), way * np.sin(course_rad)
    rows["gps_p_e_m"][new] += np.random.default_rng(1).normal(0.0, noise_m, (new.sum(), 3))
    rows["gps_speed_m_s"] = speed_m_s
    return rows


def paper_matrix(phi, theta, psi):
    """R of Eqns 1 to 3 by SciPy: about x by phi, then z by -psi, then y by -theta; the paper's axes."""
    return Rotation.from_euler("XZY", [phi, -psi, -theta]).as_matrix()


def printed_eqn_4(phi, theta, psi):
    """Eqn 4 as it is printed."""
    sf, cf, st, ct, sp, cp = (f(a) for a in (phi, theta, psi) for f in (math.sin, math.cos))
    return np.array(
        [
            [ct * cp, sp, -st * cp],
            [-ct * cf * sp + st * sf, cf * cp, st * cf * sp - ct * sf],
            [ct * sf * sp + st * cf, cp * sf, st * sf * sp - st * cf],
        ]
    )


def printed_heading(field_flu, roll, pitch):
    """Eqns 5 to 7 as they are printed."""
    x, y, z = field_flu
    x_comp = x * math.cos(pitch) + z * math.sin(pitch)
    y_comp = x * math.sin(roll) * math.sin(pitch) + y * math.cos(roll) - z * math.sin(roll) * math.cos(pitch)
    return math.atan(y_comp / x_comp)


@pytest.mark.parametrize("seed", range(5))
def test_eqn_4_as_printed_has_three_wrong_signs(seed):
    """Against the product of Eqns 1 to 3: R_yx, R_zx and R_zz are off, the other six agree."""
    phi, theta, psi = np.random.default_rng(seed).uniform(0.2, 1.2, 3)
    printed, product = printed_eqn_4(phi, theta, psi), paper_matrix(phi, theta, psi)
    wrong = np.abs(printed - product) > 1e-6
    np.testing.assert_array_equal(np.argwhere(wrong), [[1, 0], [2, 0], [2, 2]])
    np.testing.assert_allclose(printed[~wrong], product[~wrong], rtol=0, atol=ROUND_OFF)


def test_eqn_4_as_printed_is_no_rotation_at_zero_angles():
    """Its lower right element is zero where it should be one."""
    assert np.linalg.det(printed_eqn_4(0.0, 0.0, 0.0)) == 0.0
    np.testing.assert_array_equal(paper_matrix(0.0, 0.0, 0.0), np.eye(3))


@pytest.mark.parametrize("seed", range(5))
def test_paper_angles_are_those_of_its_rotations(seed):
    """Eqns 10 to 12 take the angles out of R_x(phi) R_z(-psi) R_y(-theta), turned back into our axes."""
    phi, theta = np.random.default_rng(seed).uniform(-3.0, 3.0, 2)
    psi = np.random.default_rng(seed + 9).uniform(-1.5, 1.5)
    got = paper_angles(FLU @ paper_matrix(phi, theta, psi) @ FLU)
    np.testing.assert_allclose(got, [phi, theta, psi], rtol=0, atol=1e-12)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_paper_angles_of_one_rotation_are_the_usual_ones(axis):
    """Roll to the right, nose up, nose right: all positive, as everywhere in this project."""
    R = Rotation.from_euler(axis, 0.4).as_matrix()
    np.testing.assert_allclose(paper_angles(R), 0.4 * np.array([axis == "X", axis == "Y", axis == "Z"]), atol=1e-15)


def test_paper_angles_cannot_tell_southward_and_lose_roll_at_east():
    """Yaw is the middle angle: 170 degrees read as 10 with roll and pitch turned over."""
    roll, pitch, yaw = np.degrees(paper_angles(Rotation.from_euler("z", 170.0, degrees=True).as_matrix()))
    assert yaw == pytest.approx(10.0, rel=0, abs=1e-9)
    assert abs(roll) == pytest.approx(180.0, rel=0, abs=1e-9)
    assert abs(pitch) == pytest.approx(180.0, rel=0, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_heading_of_field_is_the_nose_of_the_horizontal_field(seed):
    """Eqns 5 to 7 as they work, at any tilt: atan2 of the field turned level by the paper's roll and pitch (SciPy)."""
    rng = np.random.default_rng(seed)
    roll, p, heading = rng.uniform(-1.4, 1.4), rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0)
    # In the paper's axes: heading to the right is negative about up, then roll, then the right-handed p about y.
    R_flu = Rotation.from_euler("ZXY", [-heading, roll, p]).as_matrix()
    R = FLU @ R_flu @ FLU
    got = heading_of_field(R.T @ FIELD, -G * R[2])
    assert wrap(got - heading) == pytest.approx(0.0, rel=0, abs=1e-12)


def test_heading_of_field_level_and_nose_up_is_that_of_the_matrix():
    """Without roll the paper's heading is the direction of the nose, the usual one."""
    for heading in np.radians([10.0, 100.0, 190.0, 280.0]):
        R = Rotation.from_euler("ZYX", [heading, 0.4, 0.0]).as_matrix()
        got = heading_of_field(R.T @ FIELD, -G * R[2])
        assert wrap(got - heading_rad(R)) == pytest.approx(0.0, rel=0, abs=1e-12)


@pytest.mark.parametrize(("roll", "pitch"), [(0.2, 0.0), (0.3, 0.2), (-0.3, 0.4)])
def test_heading_of_field_is_square_to_the_wings_and_not_along_the_nose(roll, pitch):
    """Roll comes first in Eqns 5 and 6: the right wing's horizontal direction less 90 degrees, off the nose's."""
    R = Rotation.from_euler("ZYX", [1.0, pitch, roll]).as_matrix()
    got = heading_of_field(R.T @ FIELD, -G * R[2])
    assert wrap(got - math.atan2(-R[0, 1], R[1, 1])) == pytest.approx(0.0, rel=0, abs=1e-12)
    # tan of the difference is sin(pitch) tan(roll), from the Y column of Euler's matrix.
    assert wrap(got - 1.0) == pytest.approx(-math.atan(math.sin(pitch) * math.tan(roll)), rel=0, abs=1e-12)


def test_eqn_5_as_printed_with_the_pitch_of_eqn_11_is_wrong():
    """Nose up by 20 degrees, heading 30: with the paper's pitch 59 degrees off, with its negative right."""
    theta, heading = math.radians(20.0), math.radians(30.0)
    R = Rotation.from_euler("ZYX", [heading, theta, 0.0]).as_matrix()
    field_flu = FLU @ R.T @ FIELD
    assert printed_heading(field_flu, 0.0, -theta) == pytest.approx(heading, rel=0, abs=ROUND_OFF)
    assert math.degrees(abs(printed_heading(field_flu, 0.0, theta) - heading)) > 30.0
    assert heading_of_field(R.T @ FIELD, -G * R[2]) == pytest.approx(heading, rel=0, abs=ROUND_OFF)


def test_eqns_5_and_6_with_angles_of_the_usual_order_are_wrong_when_rolled_and_pitched():
    """25 degrees of each: with ``roll = arctan(y / z)`` the heading is 9 degrees off, with the paper's order exact."""
    roll, p, heading = math.radians(25.0), math.radians(-25.0), math.radians(40.0)
    field_flu = Rotation.from_euler("ZXY", [-heading, roll, p]).inv().apply(FLU @ FIELD)
    up = Rotation.from_euler("ZXY", [-heading, roll, p]).inv().apply([0.0, 0.0, 1.0])
    usual_roll = math.atan2(up[1], up[2])
    usual_p = math.atan2(-up[0], math.hypot(up[1], up[2]))
    assert printed_heading(field_flu, roll, p) == pytest.approx(heading, rel=0, abs=ROUND_OFF)
    assert math.degrees(abs(printed_heading(field_flu, usual_roll, usual_p) - heading)) > 3.0
    assert heading_of_field(FLU @ field_flu, FLU @ up * G) == pytest.approx(heading, rel=0, abs=ROUND_OFF)


@pytest.mark.parametrize("heading_deg", [120.0, 180.0, 250.0])
def test_eqn_7_as_printed_takes_south_for_north(heading_deg):
    """arctan(Y / X) knows half of the headings; the error is 180 degrees in the other half."""
    heading = math.radians(heading_deg)
    R = Rotation.from_euler("z", heading).as_matrix()
    assert abs(wrap(printed_heading(FLU @ R.T @ FIELD, 0.0, 0.0) - heading)) == pytest.approx(math.pi, rel=0, abs=1e-12)
    assert wrap(heading_of_field(R.T @ FIELD, -G * R[2]) - heading) == pytest.approx(0.0, rel=0, abs=1e-12)


def test_normalised_gyro_readings_as_printed_turn_a_radian_a_second_whatever_they_are():
    """Section f: one second at 0.1 rad/s is 0.1 rad; with the readings normalised it is 1 rad."""
    rate, turned = np.array([0.0, 0.0, 0.1]), Rotation.identity()
    for _ in range(50):
        turned = turned * Rotation.from_rotvec(DT * rate / np.linalg.norm(rate))
    assert turned.magnitude() == pytest.approx(1.0, rel=0, abs=1e-12)
    rows = still(np.eye(3), 50, every=0)
    rows["gyro_b_rad_s"] = rate
    got = Dilshad(DilshadParams(w_rp=0.0)).replay(rows)["R_eb"][-1]
    assert float(heading_rad(got)) == pytest.approx(0.1, rel=0, abs=1e-6)


@pytest.mark.parametrize("bank_deg", [10.0, 30.0])
def test_tilt_compensation_in_a_coordinated_turn_is_off_by_the_closed_form(bank_deg):
    """The accelerometer feels no bank, so the field is read as if level: north at bank b reads atan2(-Z sin b, X).

    At 30 degrees of bank and 68 degrees of dip that is 51 degrees of heading.
    """
    bank = math.radians(bank_deg)
    R = Rotation.from_euler("x", bank).as_matrix()
    force = np.array([0.0, 0.0, -G / math.cos(bank)])
    expected = math.atan2(-FIELD[2] * math.sin(bank), FIELD[0])
    assert heading_of_field(R.T @ FIELD, force) == pytest.approx(expected, rel=0, abs=ROUND_OFF)
    assert abs(expected) > bank


def test_first_field_sets_the_heading_and_drift_is_taken_out():
    """At once right; then a gyro offset about the vertical is learnt and the heading holds."""
    R = Rotation.from_euler("ZYX", [2.5, 0.1, -0.1]).as_matrix()
    estimator = Dilshad()
    estimator.reset(ImuSample(2.0, DT, np.zeros(3), -G * R[2]))
    rows = still(R, 15000)
    offset = math.radians(1.0) * R[2]
    rows["gyro_b_rad_s"] = offset
    got = estimator.replay(rows)
    assert math.degrees(rotation_error_rad(got["R_eb"][0], R)) < 0.1
    assert math.degrees(rotation_error_rad(got["R_eb"][-1], R)) < 0.02
    # 300 s are ten times k_p / k_i and the offset is 1 deg/s.
    np.testing.assert_allclose(np.degrees(got["gyro_bias_b_rad_s"][-1] - offset), 0.0, rtol=0, atol=0.02)


@pytest.mark.parametrize(("every", "hz"), [(1, 8.0), (5, 8.0), (10, 5.0)])
def test_magnetometer_is_heard_every_125_ms(every, hz):
    """8 a second in the mean from samples at 50 and at 10 Hz; all of them from slower ones."""
    rows, estimator = still(np.eye(3), 500, every), Dilshad()
    heard = 0
    for k in range(len(rows)):
        estimator.replay(rows[k : k + 1])
        heard += estimator.snapshot()["heading_age_s"][0] == 0.0
    assert abs(heard - 10.0 * hz) <= 2


def test_drift_expires_with_a_silent_magnetometer():
    """One second after the last sample nothing pulls at the yaw, and the estimator says that it is poor."""
    rows = still(np.eye(3), 200, every=0)
    rows["mag_new"][0] = 1
    estimator = Dilshad()
    state = estimator.snapshot()
    state["aligned"], state["R_eb"] = 1, Rotation.from_euler("z", 0.5).as_matrix()
    estimator.restore(state)
    got = estimator.replay(rows)
    heading = heading_rad(got["R_eb"])
    assert heading[45] < heading[5]
    np.testing.assert_allclose(np.diff(heading[60:], 2), 0.0, rtol=0, atol=1e-12)  # the learnt offset alone is left
    assert got["health"][45] == Health.GOOD
    assert got["health"][60] == Health.POOR


@pytest.mark.parametrize("course_deg", [20.0, 200.0])
def test_course_corrects_what_the_magnetometer_lacks(course_deg):
    """A field that points 13 degrees off is corrected to the course; arctan(Y / X) of Eqn 9 would take 200 for 20."""
    course = math.radians(course_deg)
    R = Rotation.from_euler("z", course).as_matrix()
    rows = fly_to(still(R, 15000), course)
    rows["mag_b_ut"] = R.T @ Rotation.from_euler("z", -13.0, degrees=True).apply(FIELD)
    estimator = Dilshad()
    got = estimator.replay(rows)
    assert math.degrees(abs(wrap(heading_rad(got["R_eb"][-1]) - course))) < 0.01
    assert math.degrees(estimator.snapshot()["correction_rad"][0]) == pytest.approx(-13.0, rel=0, abs=0.01)
    printed = math.atan(math.sin(course) / math.cos(course))
    assert math.degrees(abs(wrap(printed - course))) == pytest.approx(180.0 * (course_deg > 90.0), rel=0, abs=1e-9)


def test_course_of_noisy_positions_is_averaged():
    """Positions 0.3 m wrong at 5 Hz make each course 5 degrees wrong; over 20 s the correction is good to one."""
    rows = fly_to(still(np.eye(3), 6000), 0.0, noise_m=0.3)
    got = Dilshad().replay(rows)
    error = np.degrees(heading_rad(got["R_eb"][1000:]))
    # sigma of a course 0.3 sqrt(2) / (0.4 s 12 m/s) = 5 deg; neighbours share positions and the sum of the
    # differences telescopes: 100 of them leave at most 0.5 deg.
    assert np.std(error) < 0.5
    assert abs(np.mean(error)) < 0.3


@pytest.mark.parametrize("why", ["slow", "turning", "no_weight", "nan_position"])
def test_course_that_says_nothing_corrects_nothing(why):
    """Below the least speed, in a turn, with infinite averaging, and where positions are not numbers."""
    rows = fly_to(still(np.eye(3), 500), 1.0, speed_m_s=2.0 if why == "slow" else 12.0)
    if why == "turning":
        rows["gyro_b_rad_s"][:, 2] = 0.5
    if why == "nan_position":
        rows["gps_p_e_m"] = np.nan
    estimator = Dilshad(DilshadParams(gps_weight_s=math.inf if why == "no_weight" else 20.0))
    if why == "turning":  # the turn is on before the first course
        state = estimator.snapshot()
        state["turned_rad"] = 0.7
        estimator.restore(state)
    estimator.replay(rows)
    assert estimator.snapshot()["correction_rad"][0] == 0.0
    assert (estimator.rejected > 0) == (why == "nan_position")


def test_course_is_carried_on_by_what_was_turned_since():
    """A slow turn seen 1.4 s late through one lag: the correction stays within a tenth of the 8.4 degrees of lag."""
    rate, lag_s, n = math.radians(6.0), 1.4, 3000
    rows = still(np.eye(3), n)
    psi = rate * rows["t_s"]
    rows["gyro_b_rad_s"][:, 2] = rate
    R = Rotation.from_euler("z", psi[:, None]).as_matrix()
    rows["mag_b_ut"] = np.einsum("nij,i->nj", R, FIELD)
    rows["gps_new"][::10], rows["gps_speed_m_s"] = 1, 12.0
    late = psi - rate * lag_s + rate * 0.2  # positions that late have courses another interval older
    rows["gps_p_e_m"][:, 0], rows["gps_p_e_m"][:, 1] = 12.0 / rate * np.sin(late), -12.0 / rate * np.cos(late)
    estimator = Dilshad()
    estimator.replay(rows)
    assert abs(math.degrees(estimator.snapshot()["correction_rad"][0])) < 0.84


def test_calibration_and_declination_bring_true_heading():
    """Iron off, declination on, no GPS."""
    R, declination = Rotation.from_euler("ZYX", [-2.0, 0.3, 0.0]).as_matrix(), math.radians(-13.0)
    iron, hard = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.0], [0.0, 0.0, 1.0]]), np.array([12.0, -7.0, 20.0])
    rows = still(R, 500)
    rows["mag_b_ut"] = iron @ (R.T @ Rotation.from_euler("z", declination).apply(FIELD)) + hard
    calibration = Calibration(tuple(hard), tuple(map(tuple, np.linalg.inv(iron))))
    estimator = Dilshad(DilshadParams(calibration=calibration, declination_rad=declination))
    estimator.reset(ImuSample(2.0, DT, np.zeros(3), -G * R[2]))
    assert math.degrees(rotation_error_rad(estimator.replay(rows)["R_eb"][-1], R)) < 0.01


def test_accelerometer_pulls_the_tilt_the_right_way_and_into_the_bank_of_a_turn():
    """At rest a tilt goes; in a coordinated turn, level is what is felt: 30 degrees of bank are lost within 15 s."""
    tilted = Rotation.from_euler("x", 9.0, degrees=True).as_matrix()
    for rows, R_true, lost in ((still(np.eye(3), 1500), np.eye(3), False), (None, None, True)):
        estimator = Dilshad()
        state = estimator.snapshot()
        if lost:
            bank, speed = math.radians(30.0), 12.6
            rate = G * math.tan(bank) / speed
            rows = still(np.eye(3), 750, every=0)
            R_true = Rotation.from_euler("x", bank).as_matrix()
            rows["gyro_b_rad_s"] = R_true.T @ [0.0, 0.0, rate]
            rows["force_b_m_s2"] = [0.0, 0.0, -G / math.cos(bank)]
        state["R_eb"] = R_true if lost else tilted
        estimator.restore(state)
        error = math.degrees(inclination_error_rad(estimator.replay(rows)["R_eb"][-1], R_true))
        assert error > 15.0 if lost else error < 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("w_rp", -1.0), ("k_i", math.nan), ("gps_lag_s", 0.0), ("gps_weight_s", 0.0), ("declination_rad", -4.0)],
)
def test_impossible_parameter_is_refused(name, value):
    """One line with the field and its value."""
    with pytest.raises(ValueError, match=f"{name} is {value}.*must be"):
        DilshadParams(**{name: value})


def test_heading_of_field_falling_freely_is_none():
    """No specific force, no tilt, no heading; the estimator goes on with its gyros."""
    assert math.isnan(heading_of_field(FIELD, np.zeros(3)))
    rows = still(np.eye(3), 50)
    rows["force_b_m_s2"] = 0.0
    got = Dilshad().replay(rows)
    np.testing.assert_array_equal(got["R_eb"][-1], np.eye(3))
    assert dilshad.STATE_DTYPE["R_eb"].shape == (3, 3)
