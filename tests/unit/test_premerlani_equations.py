"""Eqns 16 and 22 to 27 one by one: each kernel of the estimator against the paper's formula in NumPy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import premerlani
from estimator.interface import MEASURED_DTYPE
from estimator.premerlani import Premerlani, PremerlaniParams

G = premerlani.G_M_S2
ROUND_OFF = 1e-13


def state_at(R, **params):
    """The state record of an estimator that believes `R`, with the lag filter off unless asked for."""
    options = {"gps_lag_filter": False, "rotate_history": False, **params}
    state = Premerlani(PremerlaniParams(**options)).snapshot()
    s = state[0]
    s["R_eb"], s["nose"], s["nose_at_fix"], s["dt_s"] = R, R[:2, 0], R[:2, 0], 0.02
    return state, s


def row_of(**columns):
    """One row of measurements."""
    row = np.zeros(1, MEASURED_DTYPE)
    row["dt_s"] = 0.02
    for name, value in columns.items():
        row[name] = value
    return row


# Kernels take records; these enter them the way `step` does.
@premerlani.kernel
def call_corrected_rate(rows, state):
    premerlani.corrected_rate(rows[0], state[0], 7)


@premerlani.kernel
def call_take_fix(rows, state):
    premerlani.take_fix(rows[0], state[0])


@premerlani.kernel
def call_yaw(state):
    premerlani.yaw_correction(state[0])


@premerlani.kernel
def call_roll_pitch(rows, state):
    premerlani.roll_pitch_correction(rows[0], state[0])


@pytest.fixture(params=range(5))
def R(request):
    """Attitudes of all kinds, some upside down."""
    return Rotation.random(rng=np.random.default_rng(request.param)).as_matrix()


def test_corrected_rate_is_eqn_16_and_the_output_is_free_of_p(R):
    """Gyro, less the calibrated offset, plus I and P; what damping and Eqn 25 use leaves P out."""
    state, s = state_at(R)
    s["calibrated_offset_b_rad_s"], s["omega_i_b"] = [0.1, 0.2, 0.3], [0.01, 0.02, 0.03]
    s["omega_p_b"] = [1.0, 2.0, 3.0]
    call_corrected_rate(row_of(gyro_b_rad_s=[0.5, 0.6, 0.7]), state)
    np.testing.assert_allclose(s["omega_b_rad_s"], [0.41, 0.42, 0.43], rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(s["omega_total_b"], [1.41, 2.42, 3.43], rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(s["gyro_bias_b_rad_s"], [0.09, 0.18, 0.27], rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("course", [0.3, 1.9, 3.6, 6.0])
def test_yaw_correction_within_a_right_angle_is_eqns_22_to_24(R, course):
    """(r_xx sin cog - r_yx cos cog) times the Z row; beyond a right angle the sign at full strength."""
    state, s = state_at(R)
    call_take_fix(row_of(gps_new=1, gps_course_rad=course, gps_speed_m_s=12.0), state)
    call_yaw(state)
    sine = R[0, 0] * math.sin(course) - R[1, 0] * math.cos(course)
    cosine = R[0, 0] * math.cos(course) + R[1, 0] * math.sin(course)
    ground = sine if cosine >= 0.0 else math.copysign(math.hypot(R[0, 0], R[1, 0]), sine)
    np.testing.assert_allclose(s["yaw_b"], ground * R[2], rtol=0, atol=ROUND_OFF)


def test_yaw_correction_turns_the_nose_towards_the_course():
    """Nose north, course north-east: the correction is a rotation to the right, seen in the earth frame."""
    R = Rotation.from_euler("ZYX", [0.0, 0.3, 2.5]).as_matrix()
    state, s = state_at(R)
    call_take_fix(row_of(gps_new=1, gps_course_rad=math.pi / 4, gps_speed_m_s=12.0), state)
    call_yaw(state)
    np.testing.assert_allclose((R @ s["yaw_b"])[:2], 0.0, rtol=0, atol=ROUND_OFF)
    assert (R @ s["yaw_b"])[2] > 0.0


def test_yaw_correction_exactly_reversed_is_not_stuck():
    """At 180 degrees the cross product is zero, the correction is not."""
    state, s = state_at(np.eye(3))
    s["course"], s["fix_age_s"] = [-1.0, 0.0], 0.0
    call_yaw(state)
    assert abs(s["yaw_b"][2]) == 1.0


@pytest.mark.parametrize(("speed", "wait_s"), [(2.9, 0.0), (12.0, 2.1)])
def test_yaw_correction_slow_or_stale_fix_is_zero(speed, wait_s):
    """A course without motion is noise, and an old one no reference."""
    state, s = state_at(np.eye(3))
    call_take_fix(row_of(gps_new=1, gps_course_rad=1.0, gps_speed_m_s=speed), state)
    s["fix_age_s"] += wait_s
    call_yaw(state)
    np.testing.assert_array_equal(s["yaw_b"], 0.0)


def test_roll_pitch_correction_is_eqns_25_to_27_with_the_sign_put_right(R):
    """(accelerometer + omega x V) normalised, crossed with the Z row: reference first."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        omega, force = rng.normal(0.0, 0.3, 3), rng.normal([0.0, 0.0, -G], 0.5)
        state, s = state_at(R, launch_gate=math.inf)
        s["omega_b_rad_s"], s["omega_p_b"], s["speed_m_s"] = omega, [9.0, 9.0, 9.0], 12.0
        call_roll_pitch(row_of(force_b_m_s2=force), state)
        accelerometer = -force  # the paper's is gravity minus acceleration
        g_reference = accelerometer + np.cross(omega, [12.0, 0.0, 0.0])
        np.testing.assert_allclose(s["g_ref_b_m_s2"], g_reference, rtol=0, atol=ROUND_OFF * G)
        oracle = np.cross(g_reference / np.linalg.norm(g_reference), R[2])
        np.testing.assert_allclose(s["roll_pitch_b"], oracle, rtol=0, atol=ROUND_OFF)


def test_roll_pitch_correction_is_the_small_rotation_that_is_wanted():
    """Applied in full, the correction undoes a tilt of one degree to second order."""
    true = Rotation.from_euler("ZYX", [0.7, -0.2, 0.5])
    tilt = Rotation.from_rotvec(np.radians([0.6, 0.8, 0.0]))  # about a horizontal axis: true = tilt^-1 estimate
    state, s = state_at((tilt * true).as_matrix())
    call_roll_pitch(row_of(force_b_m_s2=true.inv().apply([0.0, 0.0, -G])), state)
    corrected = tilt * true * Rotation.from_rotvec(s["roll_pitch_b"])
    assert (corrected * true.inv()).magnitude() < math.radians(1.0) ** 2


@pytest.mark.parametrize("bank_deg", [10.0, 35.0, 60.0])
def test_roll_pitch_correction_in_a_coordinated_turn_is_zero(bank_deg):
    """The centrifugal term is exact where there is no sideslip: twice the load, and not a trace of error."""
    bank, speed = math.radians(bank_deg), 12.6
    turn = G * math.tan(bank) / speed
    R = Rotation.from_euler("ZYX", [1.0, 0.0, bank]).as_matrix()
    state, s = state_at(R)
    s["omega_b_rad_s"], s["speed_m_s"] = R.T @ [0.0, 0.0, turn], speed
    call_roll_pitch(row_of(force_b_m_s2=[0.0, 0.0, -G / math.cos(bank)]), state)
    np.testing.assert_allclose(s["roll_pitch_b"], 0.0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize(("load", "open_"), [(1.29, True), (1.31, False), (0.71, True), (0.69, False), (0.0, False)])
def test_roll_pitch_correction_reference_not_of_the_length_of_gravity_is_dropped(load, open_):
    """The launch gate: thrown, or falling, the accelerometer says nothing of down."""
    state, s = state_at(Rotation.from_euler("x", 0.1).as_matrix(), launch_gate=0.3)
    call_roll_pitch(row_of(force_b_m_s2=[0.0, 0.0, -load * G]), state)
    assert (np.linalg.norm(s["roll_pitch_b"]) > 0.05) == open_


def test_take_fix_speed_of_a_filtered_velocity_is_restored():
    """The receiver's filter shortens a turning velocity as it shortens the nose: their quotient is the speed."""
    state, s = state_at(np.eye(3), gps_lag_filter=True, gps_latency_s=0.0)
    s["nose"] = [0.0, 0.8]
    call_take_fix(row_of(gps_new=1, gps_course_rad=math.pi / 2, gps_speed_m_s=0.8 * 12.6), state)
    assert s["speed_m_s"] == pytest.approx(12.6, rel=0, abs=1e-12)


@pytest.mark.parametrize(
    "columns",
    [{"gps_course_rad": math.nan}, {"gps_speed_m_s": math.nan}, {"gps_speed_m_s": -1.0}, {"gps_course_rad": math.inf}],
)
def test_take_fix_impossible_fix_is_counted_and_changes_nothing(columns):
    """A receiver that reports nonsense is not believed."""
    state, s = state_at(np.eye(3))
    call_take_fix(row_of(gps_new=1, **{"gps_course_rad": 1.0, "gps_speed_m_s": 10.0, **columns}), state)
    assert s["rejected"] == 1
    assert s["speed_m_s"] == 0.0
    assert s["fix_age_s"] == math.inf


@pytest.mark.parametrize(
    ("name", "value"),
    [("w_rp", -0.1), ("w_y", math.nan), ("k_i", math.inf), ("gps_latency_s", 13.0), ("launch_gate", 0.0),
     ("gyro_range_rad_s", math.inf)],
)  # fmt: skip
def test_params_impossible_value_is_refused_by_name(name, value):
    """The message says which parameter and what it was."""
    with pytest.raises(ValueError, match=rf"{name} is {value}"):
        PremerlaniParams(**{name: value})
