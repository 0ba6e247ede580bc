"""MatrixPilot's equations one by one against closed forms: turns without GPS, forward acceleration, wind, gains."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import matrixpilot
from estimator.interface import MEASURED_DTYPE, Health
from estimator.matrixpilot import UDB4, MatrixPilot, MatrixPilotParams
from estimator.rotation import from_euler, heading_rad, inclination_error_rad

G = matrixpilot.G_M_S2
DT_S, GPS_TICKS = 0.025, 10


def motion(seconds, gyro=(0.0, 0.0, 0.0), force=(0.0, 0.0, -G)):
    """Rows at 40 Hz of constant readings, no GPS."""
    n = round(seconds / DT_S)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = DT_S * (np.arange(n) + 1), DT_S
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = gyro, force
    return rows


def with_gps(rows, v_e_m_s):
    """The rows with reports at 4 Hz of the velocities, shape (N, 3) or (3,)."""
    v = np.broadcast_to(v_e_m_s, (len(rows), 3))
    rows["gps_new"][GPS_TICKS - 1 :: GPS_TICKS] = 1
    rows["gps_v_e_m_s"] = v
    rows["gps_course_rad"] = np.arctan2(v[:, 1], v[:, 0]) % (2.0 * np.pi)
    rows["gps_speed_m_s"] = np.hypot(v[:, 0], v[:, 1])
    return rows


def started(params=None, **columns):
    """An estimator whose state has these columns."""
    estimator = MatrixPilot(params)
    state = estimator.snapshot()
    for name, value in columns.items():
        state[name] = value
    estimator.restore(state)
    return estimator


# A kernel that takes a record is entered the way `step` does.
@matrixpilot.kernel
def call_learn_wind(state):
    matrixpilot.learn_wind(state[0])


@pytest.mark.parametrize("bank_deg", [-60, -30, -5, 10, 45, 70])
@pytest.mark.parametrize("speed_m_s", [8.0, 20.0])
def test_centrifugal_in_a_steady_turn_is_speed_times_rate(bank_deg, speed_m_s):
    """Coordinated level turn: rate g tan(bank) / V about the vertical, force along the body's z axis."""
    bank = math.radians(bank_deg)
    turn_rad_s = G * math.tan(bank) / speed_m_s
    tilt = np.array([0.0, math.sin(bank), math.cos(bank)])
    w = turn_rad_s * tilt
    a = np.array([0.0, 0.0, 1.0 / math.cos(bank)])
    n_q, n_r, size = matrixpilot.centrifugal(a, w[1], w[2], tilt)
    found = size * np.array([0.0, n_r, -n_q])
    expected = np.cross(w, [speed_m_s, 0.0, 0.0]) / G
    # The double root: a rounding of 1e-16 under the square root is 1e-8 beside it.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    np.testing.assert_allclose(a + found, tilt, rtol=0, atol=1e-7)


@pytest.mark.parametrize("pitch_deg", range(-175, 180, 10))
@pytest.mark.parametrize("load", [0.3, 1.5, 3.0])
def test_centrifugal_in_a_loop_takes_the_right_root_all_round(pitch_deg, load):
    """Pulling `load` g anywhere in a loop, upright or inverted, with any thrust along the nose."""
    pitch = math.radians(pitch_deg)
    tilt = np.array([-math.sin(pitch), 0.0, math.cos(pitch)])
    a = tilt + np.array([0.7, 0.0, load])  # 0.7 g of thrust
    n_q, n_r, size = matrixpilot.centrifugal(a, 1.1, 0.0, tilt)
    assert (n_q, n_r) == (1.0, 0.0)
    assert size == pytest.approx(load, rel=0, abs=1e-12)


@pytest.mark.parametrize("roll_deg", [-80, -20, 0, 50])
def test_free_fall_upright_finds_no_turn_and_corrects_nothing(roll_deg):
    """Thrown, the accelerometer feels nothing: pitching up, whatever the bank, the gyros alone lead."""
    roll = math.radians(roll_deg)
    estimator = started(R_eb=from_euler(roll, 0.2, 1.0))
    rows = motion(2.0, gyro=(0.0, 0.3, 0.0), force=(0.0, 0.0, 0.0))
    R = estimator.replay(rows)["R_eb"][-1]
    turned = from_euler(roll, 0.2, 1.0) @ Rotation.from_rotvec([0.0, 0.6, 0.0]).as_matrix()
    assert np.linalg.norm(estimator.snapshot()["omega_p_b"]) == 0.0
    # Eqn 17 tilts by w_v w_h dt / 2 a second, at most half of w^2 dt / 2; the heading may bear as much.
    np.testing.assert_allclose(R, turned, rtol=0, atol=2.0 * 2.0 * 0.3**2 * DT_S / 4.0)


@pytest.mark.parametrize("fixed_point", [False, True])
def test_a_minute_of_turning_without_gps_does_not_tip_the_attitude(fixed_point):
    """45 degrees of bank at 15 m/s: the firmware's tilt stays where an uncompensated accelerometer loses it."""
    bank, speed = math.radians(45.0), 15.0
    w = G * math.tan(bank) / speed * np.array([0.0, math.sin(bank), math.cos(bank)])
    start = from_euler(bank, 0.0, 0.0)
    estimator = started(MatrixPilotParams(fixed_point=fixed_point), R_eb=start)
    R = estimator.replay(motion(60.0, gyro=w, force=(0.0, 0.0, -G / math.cos(bank))))["R_eb"]
    tilt_deg = np.degrees(inclination_error_rad(R, start))
    # A count of rate (0.03 deg/s) against a gain of 0.071 1/s is 0.5 degrees; floating point has none.
    assert tilt_deg.max() < (1.0 if fixed_point else 0.01)


@pytest.mark.parametrize("late", [False, True])
def test_forward_acceleration_comes_from_the_difference_of_reports(late):
    """Level, speeding up by 2 m/s^2: felt as a climb of 11 degrees, and taken out from the third report on."""
    rows = motion(6.0, force=(2.0, 0.0, -G))
    rows = with_gps(rows, np.outer(5.0 + 2.0 * rows["t_s"], [1.0, 0.0, 0.0]))
    level_deg = {}
    for on in (True, False):
        estimator = MatrixPilot(MatrixPilotParams(forward_acceleration=on, late_by_one_report=late))
        R = estimator.replay(rows)["R_eb"][-1]
        level_deg[on] = np.degrees(inclination_error_rad(R, np.eye(3)))
        assert estimator.snapshot()["forward_m_s2"][0] == pytest.approx(2.0 if on else 0.0, rel=0, abs=1e-9)
    assert level_deg[False] > 3.0  # 11.5 degrees (1 - exp(-0.071 * 6)) = 4.0
    assert level_deg[True] < 0.6  # what 0.75 s without it make: 11.5 degrees * 0.071 * 0.75


def test_late_report_is_carried_on_by_its_last_change():
    """A velocity that turns evenly through north, late by one report, comes out as that of the present."""
    rows = motion(5.0)
    late_s = GPS_TICKS * DT_S
    course = np.radians(-30.0) + 0.3 * (rows["t_s"] - late_s)  # across north: the wrap is in the way
    rows = with_gps(rows, np.stack([12.0 * np.cos(course), 12.0 * np.sin(course), 0.4 * rows["t_s"]], axis=-1))
    estimator = MatrixPilot(MatrixPilotParams(estimate_wind=False))
    estimator.replay(rows)
    now = course[-1] + 0.3 * late_s
    expected = [12.0 * np.cos(now), 12.0 * np.sin(now), 0.4 * (rows["t_s"][-1] + late_s)]
    np.testing.assert_allclose(estimator.snapshot()["v_e_m_s"][0], expected, rtol=0, atol=1e-9)


def test_wind_is_found_from_pairs_of_reports_and_noses():
    """Known nose, speed and wind: each pair 60 degrees apart measures the wind exactly, and takes a sixteenth of it."""
    wind = np.array([3.0, -2.0, 0.5])
    state = MatrixPilot().snapshot()
    for pair in range(41):
        R = from_euler(0.5, 0.1, math.radians(60.0 * pair))
        state["R_eb"], state["v_e_m_s"] = R, 14.0 * R[:, 0] + wind
        call_learn_wind(state)
        expected = wind * (1.0 - (15.0 / 16.0) ** pair)
        np.testing.assert_allclose(state["wind_e_m_s"][0], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("from_deg", range(0, 360, 45))
@pytest.mark.parametrize("yaw_error_deg", [-50.0, 0.0, 20.0])
def test_wind_from_any_direction_is_found_whatever_the_error_of_yaw(from_deg, yaw_error_deg):
    """The turn about down between the nose believed and the air is unknown and found with the wind: as exactly."""
    wind = np.array([-6.0 * math.cos(math.radians(from_deg)), -6.0 * math.sin(math.radians(from_deg)), 0.3])
    state = MatrixPilot().snapshot()
    for pair in range(61):
        R = from_euler(-0.4, 0.05, math.radians(-70.0 * pair))
        state["R_eb"] = Rotation.from_euler("z", yaw_error_deg, degrees=True).as_matrix() @ R
        state["v_e_m_s"] = 13.0 * R[:, 0] + wind
        call_learn_wind(state)
    np.testing.assert_allclose(state["wind_e_m_s"][0], wind * (1.0 - (15.0 / 16.0) ** 60), rtol=0, atol=1e-12)


@pytest.mark.parametrize("from_deg", range(0, 360, 45))
def test_wind_from_any_direction_is_found_in_circles(from_deg):
    """Two minutes of circling at 20 degrees of bank, yaw 30 degrees off at first: the wind within a tenth of it."""
    bank, speed_m_s = math.radians(20.0), 13.0
    wind = 5.0 * np.array([-math.cos(math.radians(from_deg)), -math.sin(math.radians(from_deg)), 0.0])
    turn_rad_s = G * math.tan(bank) / speed_m_s
    R_be = from_euler(bank, 0.0, 0.0).T
    rows = motion(120.0, R_be @ [0.0, 0.0, turn_rad_s], R_be @ [0.0, turn_rad_s * speed_m_s, -G])
    heading = turn_rad_s * rows["t_s"]
    nose = np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=-1)
    rows = with_gps(rows, speed_m_s * nose + wind)
    estimator = started(MatrixPilotParams(late_by_one_report=False), R_eb=from_euler(bank, 0.0, math.radians(30.0)))
    found = estimator.replay(rows)["wind_e_m_s"][-1]
    np.testing.assert_allclose(found, wind, rtol=0, atol=0.5)


def test_wind_is_not_measured_before_the_nose_has_turned():
    """Noses 20 degrees apart (a change of 0.35) tell nothing; the pair waits for its second half."""
    state = MatrixPilot().snapshot()
    for heading_deg, measured in ((0.0, False), (20.0, False), (25.0, True)):
        state["R_eb"] = from_euler(0.0, 0.0, math.radians(heading_deg))
        state["v_e_m_s"] = 10.0 * state["R_eb"][0][:, 0] + [0.0, 2.0, 0.0]
        call_learn_wind(state)
        assert (state["wind_e_m_s"][0, 1] != 0.0) == measured


def test_wind_of_a_heading_found_late_in_straight_flight_is_not_reported():
    """Ahead into 6 m/s, yaw 120 degrees off at first: the turn of the matrix looks like a wind."""
    rows = with_gps(motion(60.0), np.array([12.6 - 6.0, 0.0, 0.0]))
    estimator = started(MatrixPilotParams(), R_eb=from_euler(0.0, 0.0, math.radians(120.0)))
    assert np.all(np.isnan(estimator.replay(rows)["wind_e_m_s"]))
    assert np.hypot(*estimator.snapshot()["wind_e_m_s"][0, :2]) > 0.5


def test_yaw_meets_the_velocity_through_the_air_once_the_wind_is_known():
    """Crabbing at 17 degrees in a known crosswind the nose stays; without a wind estimate it goes to the course."""
    nose, wind = np.array([15.0, 0.0, 0.0]), np.array([0.0, 4.6, 0.0])
    rows = with_gps(motion(60.0), nose + wind)
    knowing = started(MatrixPilotParams(), wind_e_m_s=wind, wind_known=1)
    assert heading_rad(knowing.replay(rows)["R_eb"][-1]) == pytest.approx(0.0, rel=0, abs=1e-9)
    without = MatrixPilot(MatrixPilotParams(estimate_wind=False))
    course = math.atan2(4.6, 15.0)
    # The integral overshoots by a little: its slow mode has k_p / k_i = 100 s.
    assert heading_rad(without.replay(rows)["R_eb"][-1]) == pytest.approx(course, rel=0, abs=math.radians(1.0))


@pytest.mark.parametrize(
    ("yaw_deg", "found"),
    [(0.0, True), (14.0, True), (-14.0, True), (16.0, False), (-50.0, False), (80.0, False), (-85.0, False)],
)
def test_yaw_is_found_where_the_nose_is_near_the_velocity_alone(yaw_deg, found):
    """Nothing is corrected: within 15 degrees it counts as found after a second; further off, or square, never."""
    still = MatrixPilotParams(k_p_rp=0.0, k_i_rp=0.0, k_p_yaw=0.0, k_i_yaw=0.0, estimate_wind=False)
    estimator = started(still, R_eb=from_euler(0.0, 0.0, math.radians(yaw_deg)))
    health = estimator.replay(with_gps(motion(10.0), [12.0, 0.0, 0.0]))["health"]
    assert health[0] == Health.STARTING
    assert (health[-1] == Health.GOOD) == found


def test_climb_from_height_is_the_change_between_two_reports():
    """Heights 0.5 m lower at every report, 4 Hz: 2 m/s of sink; the first report has no earlier height, and none."""
    rows = with_gps(motion(2.0), [12.0, 0.0, 0.0])
    rows["gps_p_e_m"][:, 2] = -80.0 + 2.0 * rows["t_s"]
    estimator = MatrixPilot(MatrixPilotParams(climb_from_height=True, late_by_one_report=False))
    estimator.replay(rows[:GPS_TICKS])
    assert estimator.snapshot()["v_e_m_s"][0, 2] == 0.0
    estimator.replay(rows[GPS_TICKS : 2 * GPS_TICKS])
    np.testing.assert_allclose(estimator.snapshot()["v_e_m_s"][0], [12.0, 0.0, 2.0], rtol=0, atol=1e-9)


def test_climb_from_height_refuses_a_fix_without_one():
    """A height of NaN makes a fix none where the sink rate comes from it; else it is not looked at."""
    rows = with_gps(motion(2.0), [12.0, 0.0, 0.0])
    rows["gps_p_e_m"][:, 2] = np.nan
    counted = {}
    for from_height in (True, False):
        estimator = MatrixPilot(MatrixPilotParams(climb_from_height=from_height))
        estimator.replay(rows)
        counted[from_height] = estimator.refused
    assert counted == {True: {"gps": 8}, False: {}}


def test_yaw_error_decays_as_the_linear_loop():
    """A nose 5 degrees off: e'' + k_p e' + k_i e = 0, less the hold of a quarter second."""
    rows = with_gps(motion(20.0), [15.0, 0.0, 0.0])
    params = MatrixPilotParams(estimate_wind=False)
    estimator = started(params, R_eb=from_euler(0.0, 0.0, math.radians(5.0)))
    error = heading_rad(estimator.replay(rows)["R_eb"])
    fast, slow = np.roots([1.0, params.k_p_yaw, params.k_i_yaw])
    t = rows["t_s"] - 0.25  # the first report
    expected = math.radians(5.0) * (fast * np.exp(fast * t) - slow * np.exp(slow * t)) / (fast - slow)
    after = t > 0.5
    # Sampled and held for T, the error lags by T / 2: k_p T / 2 of 5 degrees, 0.15 degrees.
    np.testing.assert_allclose(error[after], expected[after], rtol=0, atol=math.radians(0.15))


def test_pitch_error_is_limited_roll_error_is_not():
    """Held nose up 60 degrees by the accelerometer alone, pitch is corrected no quicker than by a quarter g."""
    for axis, most in ((1, 0.25 * UDB4.k_p_rp), (0, math.sin(1.0) * UDB4.k_p_rp)):
        true = from_euler(*(1.0 if i == axis else 0.0 for i in range(3)))
        estimator = MatrixPilot()
        estimator.replay(motion(DT_S, force=-G * true[2]))
        assert abs(estimator.snapshot()["omega_p_b"][0][axis]) == pytest.approx(most, rel=1e-3, abs=0)


def test_rotation_lengthened_to_the_tangent_keeps_the_angle():
    """Yawing at 120 deg/s for three turns: Eqn 17 alone would lose 0.8 degrees, the tangent loses none."""
    w = math.radians(120.0)
    R = MatrixPilot(MatrixPilotParams(calibrate_gain=False)).replay(motion(9.0, gyro=(0.0, 0.0, w)))["R_eb"][-1]
    angle = w * DT_S
    # tan x = x + x^3/3 + 2 x^5/15: what is left out, over 360 samples.
    assert abs(heading_rad(R)) < 360 * (2.0 / 15.0) * angle**5 + 1e-12
    assert 360 * angle**3 / 3.0 > math.radians(0.8)


@pytest.mark.parametrize("seed", range(5))
def test_renormalisation_keeps_the_tilt(seed):
    """From rows a per cent off: a rotation within the square of that, and the Z row's direction to the last digit."""
    rng = np.random.default_rng(seed)
    off = Rotation.random(rng=rng).as_matrix() + rng.uniform(-0.01, 0.01, (3, 3))
    R = off.copy()
    assert matrixpilot.renormalise_keeping_tilt(R, False)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=5 * 0.02**2)
    np.testing.assert_allclose(np.cross(R[2], off[2]), 0.0, rtol=0, atol=1e-15)
    assert np.linalg.det(R) > 0.0


@pytest.mark.parametrize(("keep_tilt", "side"), [(True, 1.0), (False, -1.0)])
def test_both_renormalisations_tilt_alike_to_opposite_sides(keep_tilt, side):
    """Turning about an axis between down and north: the tilt drifts about east by w_v w_h dt / 2 a second."""
    w_e = np.array([0.8, 0.0, 0.6])
    estimator = MatrixPilot(MatrixPilotParams(k_p_rp=0.0, k_i_rp=0.0, keep_tilt=keep_tilt))
    true = Rotation.identity()
    rows = motion(2.0)
    for row in rows:
        row["gyro_b_rad_s"] = true.inv().apply(w_e)
        true = Rotation.from_rotvec(w_e * DT_S) * true
    error = Rotation.from_matrix(estimator.replay(rows)["R_eb"][-1]) * true.inv()
    drift = side * 0.8 * 0.6 * DT_S / 2.0 * 2.0
    assert error.as_rotvec()[1] == pytest.approx(drift, rel=0.02, abs=0)  # next order: (w dt)^2


def test_gyro_gain_is_learnt_in_a_long_roll():
    """Rolling at 100 deg/s with a gyro that reads 3 % too little: the gain becomes 1.03, within its range of 10 %."""
    w = math.radians(100.0)
    rows = motion(120.0, gyro=(w / 1.03, 0.0, 0.0))
    roll = w * rows["t_s"]
    rows["force_b_m_s2"] = -G * np.stack([0.0 * roll, np.sin(roll), np.cos(roll)], axis=-1)
    for on, expected in ((True, 1.03), (False, 1.0)):
        estimator = MatrixPilot(MatrixPilotParams(calibrate_gain=on))
        estimator.replay(rows)
        gain = estimator.snapshot()["gyro_gain"][0]
        np.testing.assert_allclose(gain, [expected, 1.0, 1.0], rtol=0, atol=0.003)
        assert np.all(estimator.snapshot()["omega_i_b"] == 0.0)  # nothing is learnt as an offset while spinning


def test_gyro_offset_is_learnt_at_rest():
    """Half a degree per second too much about x and y: known to 0.05 deg/s after five minutes, tilt back."""
    offset = np.radians([0.5, -0.4, 0.0])
    estimator = MatrixPilot()
    R = estimator.replay(motion(300.0, gyro=offset))["R_eb"][-1]
    np.testing.assert_allclose(estimator.snapshot()["gyro_bias_b_rad_s"][0], offset, rtol=0, atol=math.radians(0.05))
    assert inclination_error_rad(R, np.eye(3)) < math.radians(0.5)


def test_gps_lost_lets_go_of_the_yaw_error():
    """After 4.5 s without a report nothing of the last one is left, and the health says so."""
    rows = with_gps(motion(30.0), [10.0, 3.0, 0.0])
    rows["gps_new"][1000:] = 0
    estimator = MatrixPilot(MatrixPilotParams(estimate_wind=False))
    estimates = estimator.replay(rows)
    assert estimates["health"][999] == Health.GOOD
    assert estimates["health"][-1] == Health.POOR
    assert np.all(estimator.snapshot()["yaw_b"] == 0.0)
    assert estimator.snapshot()["forward_m_s2"][0] == 0.0


@pytest.mark.parametrize(
    ("x", "held"), [(0.5, 0.0), (1.5, 2.0), (2.5, 2.0), (-0.5, 0.0), (0.51, 1.0), (4e4, 32767.0), (-4e4, -32768.0)]
)
def test_stored_rounds_to_even_and_saturates(x, held):
    """Convergent rounding and the range of 16 bits, in counts of 1/16384."""
    assert matrixpilot.stored(x / 16384.0, 1.0 / 16384.0) == held / 16384.0


def test_fixed_point_holds_whole_counts_and_does_not_see_slow_rates():
    """Elements are multiples of 1/8192; a rate of less than half of that in a sample turns nothing."""
    rng = np.random.default_rng(3)
    rows = motion(20.0)
    rows["gyro_b_rad_s"] = rng.normal(0.0, 1.0, (len(rows), 3))
    R = MatrixPilot(MatrixPilotParams(fixed_point=True)).replay(rows)["R_eb"]
    np.testing.assert_array_equal(R * 8192.0, np.rint(R * 8192.0))
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-3
    slow = (0.0, 0.0, 0.9 / 16384.0 / DT_S)
    R = MatrixPilot(MatrixPilotParams(fixed_point=True)).replay(motion(20.0, gyro=slow))["R_eb"]
    np.testing.assert_array_equal(R[-1], np.eye(3))


@pytest.mark.parametrize("broken", ["gyro_b_rad_s", "force_b_m_s2", "gps_course_rad"])
@pytest.mark.parametrize("fixed_point", [False, True])
def test_an_instrument_broken_for_ever_leaves_a_rotation(broken, fixed_point):
    """NaN from the tenth second on: still a rotation at every tick, and every such tick is counted."""
    rng = np.random.default_rng(4)
    rows = with_gps(motion(40.0), [10.0, 3.0, 0.0])
    rows["gyro_b_rad_s"] += rng.normal(0.0, 2.0, (len(rows), 3))
    rows["force_b_m_s2"] += rng.normal(0.0, 20.0, (len(rows), 3))
    rows[broken][400:] = np.nan
    estimator = MatrixPilot(MatrixPilotParams(fixed_point=fixed_point))
    R = estimator.replay(rows)["R_eb"]
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-3
    assert np.all(np.linalg.det(R) > 0.0)
    assert estimator.rejected >= (120 if broken == "gps_course_rad" else 1200)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"k_p_rp": -0.1}, "k_p_rp is -0.1; it must be a finite number, zero or more"),
        ({"k_i_yaw": math.nan}, "k_i_yaw is nan; it must be"),
        ({"pitch_error_limit": 0.0}, "pitch_error_limit is 0.0; it must be more than zero"),
        ({"gyro_range_rad_s": 1e6}, "gyro_range_rad_s is 1000000.0; it must be more than zero and at most 10000"),
    ],
)
def test_nonsense_is_refused_in_one_line(params, said):
    """The field, its value, and what would be right."""
    with pytest.raises(ValueError, match=said):
        MatrixPilotParams(**params)
