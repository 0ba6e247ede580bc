"""The estimator on closed-form motion: rest, steady turns, straight flight; each result against its closed form."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import premerlani
from estimator.blocks.pi import feed_back
from estimator.interface import MEASURED_DTYPE, Health, ImuSample
from estimator.premerlani import Premerlani, PremerlaniParams
from estimator.rotation import heading_rad, inclination_error_rad

G, SPEED, DT = premerlani.G_M_S2, 12.6, 0.02
RECEIVER = {"gps_filter_s": 1.0, "gps_latency_s": 0.3}  # with which every turn here is seen


def at_rest(duration_s, R=None, offset=(0.0, 0.0, 0.0), dt=DT):
    """Rows of something that stands still, with a gyro offset."""
    R = np.eye(3) if R is None else R
    rows = np.zeros(round(duration_s / dt), MEASURED_DTYPE)
    rows["t_s"] = (np.arange(len(rows)) + 1) * dt
    rows["dt_s"] = dt
    rows["gyro_b_rad_s"] = offset
    rows["force_b_m_s2"] = R.T @ [0.0, 0.0, -G]
    return rows


def turning(duration_s, bank_deg, heading_0=0.4, gps_hz=5):
    """Rows and true attitudes (N, 3, 3) of a coordinated level turn (bank 0: straight), seen by ideal sensors.

    The fix is the closed form of the receiver's filter in the steady state: v / (1 + i omega T), a latency ago.
    """
    filter_s, latency_s = RECEIVER["gps_filter_s"], RECEIVER["gps_latency_s"]
    bank = math.radians(bank_deg)
    rate = G * math.tan(bank) / SPEED
    rows = at_rest(duration_s)
    psi = heading_0 + rate * rows["t_s"]
    R = Rotation.from_euler("ZYX", np.stack([psi, 0 * psi, 0 * psi + bank], axis=-1)).as_matrix()
    rows["gyro_b_rad_s"] = R[0].T @ [0.0, 0.0, rate]
    rows["force_b_m_s2"] = [0.0, 0.0, -G / math.cos(bank)]
    rows["gps_new"][:: round(1 / gps_hz / DT)] = 1
    rows["gps_course_rad"] = np.mod(psi - rate * latency_s - math.atan(rate * filter_s), 2 * np.pi)
    rows["gps_speed_m_s"] = SPEED / math.hypot(1.0, rate * filter_s)
    return rows, R


def aboard(**params):
    """An estimator that knows the receiver."""
    return Premerlani(PremerlaniParams(**RECEIVER, **params))


def power_up(R, **params):
    """The same, started from rest at `R` (its heading is then unknown)."""
    estimator = aboard(**params)
    estimator.reset(ImuSample(0.0, DT, np.zeros(3), R.T @ [0.0, 0.0, -G]))
    return estimator


@premerlani.kernel
def fly_eqn_27(rows, state, sign):
    """Eqns 16-21 and 25-29 alone, the roll-pitch correction multiplied by `sign`."""
    s = state[0]
    for k in range(rows.shape[0]):
        s.dt_s = rows[k].dt_s
        premerlani.corrected_rate(rows[k], s, 7)
        premerlani.integrate(s.R_eb, s.omega_total_b, s.dt_s)
        premerlani.roll_pitch_correction(rows[k], s)
        for i in range(3):
            s.total_b[i] = sign * s.w_rp * s.roll_pitch_b[i]
        feed_back(s.total_b, s.k_p, s.k_i, s.offset_limit_rad_s, s.dt_s, s.omega_p_b, s.omega_i_b)


@pytest.mark.parametrize(("sign", "least_deg", "most_deg"), [(1.0, 0.0, 1.0), (-1.0, 170.0, 180.0)])
def test_eqn_27_as_printed_turns_a_tilt_of_9_degrees_over_and_corrected_removes_it(sign, least_deg, most_deg):
    """The erratum, flown: the printed order of the factors ends upside down within half a minute."""
    tilted = Rotation.from_euler("x", 9.0, degrees=True).as_matrix()
    state = Premerlani().snapshot()
    state[0]["R_eb"] = tilted
    fly_eqn_27(at_rest(30.0), state, sign)
    assert least_deg <= math.degrees(inclination_error_rad(state[0]["R_eb"], np.eye(3))) <= most_deg


@pytest.mark.parametrize(("w_rp", "k_i"), [(0.3, 0.03), (0.5, 0.02)])
def test_gyro_offset_at_rest_is_learnt_along_the_closed_form(w_rp, k_i):
    """Tilt and learnt offset follow s^2 + K_P W s + K_I W = 0 and end at zero error and the whole offset."""
    b, dt = math.radians(0.5), 0.005
    rows = at_rest(200.0, offset=(b, 0.0, 0.0), dt=dt)
    estimates = Premerlani(PremerlaniParams(w_rp=w_rp, k_i=k_i)).replay(rows)
    s1, s2 = np.roots([1.0, w_rp, k_i * w_rp]).astype(complex)
    t = rows["t_s"]
    tilt = np.real(b * (np.exp(s1 * t) - np.exp(s2 * t)) / (s1 - s2))
    # w_I = b + (s1 e^(s2 t) - s2 e^(s1 t)) b / (s2 - s1): from zero, at rest, to b.
    learnt = np.real(b + b * (s1 * np.exp(s2 * t) - s2 * np.exp(s1 * t)) / (s2 - s1))
    # Explicit steps: |s| dt = 0.0025 of the peak, b / W; the sine of the error falls short by its cube.
    peak = b / w_rp
    measured = np.arctan2(estimates["R_eb"][:, 2, 1], estimates["R_eb"][:, 2, 2])
    np.testing.assert_allclose(measured, tilt, rtol=0, atol=w_rp * dt * peak + peak**3)
    atol = w_rp * dt * b + k_i * peak**3 * 30
    np.testing.assert_allclose(estimates["gyro_bias_b_rad_s"][:, 0], learnt, rtol=0, atol=atol)
    assert estimates["gyro_bias_b_rad_s"][-1, 0] == pytest.approx(b, rel=0, abs=0.05 * b)


def test_power_up_offset_and_tilt_are_taken_from_the_mean_sample():
    """Level or not, the first attitude is the one felt, heading north, and the offset is what the gyro read."""
    R = Rotation.from_euler("ZYX", [0.0, 0.2, -0.4]).as_matrix()
    offset = np.radians([2.0, -3.0, 1.0])
    estimator = Premerlani()
    estimator.reset(ImuSample(2.0, DT, offset, R.T @ [0.0, 0.0, -G]))
    estimates = estimator.replay(at_rest(10.0, R, offset))
    np.testing.assert_allclose(estimates["R_eb"], np.broadcast_to(R, (500, 3, 3)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(estimates["gyro_bias_b_rad_s"][-1], offset, rtol=0, atol=1e-12)


@pytest.mark.parametrize("on_ground", [None, ImuSample(0.0, DT, np.full(3, np.nan), np.zeros(3))])
def test_power_up_without_a_usable_sample_is_level_north_and_without_offset(on_ground):
    """A start in the air, or a calibration of something that was not at rest."""
    estimator = Premerlani()
    estimator.reset(on_ground)
    estimate = estimator.replay(at_rest(DT))[0]
    np.testing.assert_allclose(estimate["R_eb"], np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(estimate["gyro_bias_b_rad_s"], 0.0)


def test_coordinated_turn_at_35_degrees_of_bank_keeps_the_attitude():
    """Two minutes of turning: centrifugal term, restored speed and lag filter together leave next to no tilt."""
    rows, R = turning(120.0, 35.0)
    estimator = power_up(R[0], k_i=0.0)  # else the memory of the lock takes K_P / K_I = 33 s to fade
    estimates = estimator.replay(rows)
    tilt = np.degrees(inclination_error_rad(estimates["R_eb"], R))
    # Eqn 17 leaves theta^3 / 3 a step, 0.0013 deg/s; held by W_RP = 0.3 / s that is 0.004 degrees at most.
    assert tilt[-500:].max() < 0.005
    assert tilt.max() < 2.0


def test_steady_turn_without_the_lag_filter_is_late_by_filter_and_latency_and_with_it_is_not():
    """The course lags a turn by atan(omega T) + omega latency = 38 degrees; the filtered nose lags alike."""
    rows, R = turning(150.0, 35.0)
    rate = G * math.tan(math.radians(35.0)) / SPEED
    lag = math.degrees(math.atan(rate) + 0.3 * rate)
    lateness = {}
    for on in (True, False):
        estimator = power_up(R[0], gps_lag_filter=on)
        late = heading_rad(R) - heading_rad(estimator.replay(rows)["R_eb"])
        lateness[on] = math.degrees(math.remainder(float(late[-1]), 2 * math.pi))
    # Filtering the nose at the ends of 20 ms steps leads by half a step, 0.3 degrees.
    assert lateness[True] == pytest.approx(0.0, rel=0, abs=0.5)
    # Fixes are held for up to 0.2 s while the aeroplane turns on by 6 degrees: the mean lag is 3 degrees more.
    assert lateness[False] == pytest.approx(lag + math.degrees(rate * 0.1), rel=0, abs=4.0)


@pytest.mark.parametrize("rotate_history", [True, False])
def test_speed_in_a_steady_turn_is_restored(rotate_history):
    """The receiver says 12 % too little at 35 degrees of bank; the quotient with the filtered nose is the speed."""
    rows, R = turning(40.0, 35.0)
    estimator = power_up(R[0], rotate_history=rotate_history)
    estimator.replay(rows)
    assert rows["gps_speed_m_s"][0] < 0.89 * SPEED
    assert estimator.snapshot()["speed_m_s"][0] == pytest.approx(SPEED, rel=0, abs=0.02)


@pytest.mark.parametrize("wind", [-5.0, 5.0])
def test_turn_speed_in_wind_is_the_speed_through_the_air(wind):
    """Where the receiver reports 5 m/s too much or too little, a level turn tells the speed by itself."""
    rows, R = turning(60.0, 35.0)
    rows["gps_speed_m_s"] += wind
    tilt, speed = {}, {}
    for learn in (False, True):
        estimator = power_up(R[0], turn_speed=learn, k_i=0.0)
        tilt[learn] = math.degrees(inclination_error_rad(estimator.replay(rows)["R_eb"][-1], R[-1]))
        speed[learn] = estimator.snapshot()["turn_speed_m_s"][0]
    assert speed[True] == pytest.approx(SPEED, rel=0, abs=0.01)  # learnt with a time constant of 3 s, for 60 s
    assert tilt[True] < 0.1
    assert tilt[False] > 5.0


@pytest.mark.parametrize("rotate_history", [True, False])
@pytest.mark.parametrize("off_deg", [*range(0, 360, 20), 179.99, 180.01])
def test_yaw_lock_from_any_heading_takes_less_than_20_s(off_deg, rotate_history):
    """After a launch the nose may be anywhere: within 15 degrees of the course for good, and said so, within 20 s."""
    rows, R = turning(20.0, 0.0, heading_0=math.radians(off_deg))
    estimates = aboard(rotate_history=rotate_history).replay(rows)
    off = np.abs(np.angle(np.exp(1j * (heading_rad(estimates["R_eb"]) - heading_rad(R)))))
    assert np.degrees(off[-250:]).max() < 15.0
    assert estimates["health"][-1] == Health.GOOD
    wrong = np.degrees(off) > 30.0
    assert not np.any(estimates["health"][wrong] == Health.GOOD)


def test_yaw_lock_does_not_wind_the_integral_up():
    """Seconds at full strength are no gyro offset: the integral sees no more than the largest believable one."""
    rows, _ = turning(5.0, 0.0, heading_0=math.pi)
    estimator = aboard()
    bias, params = estimator.replay(rows)["gyro_bias_b_rad_s"], estimator.params
    assert np.abs(bias).max() < params.k_i / params.k_p * params.offset_limit_rad_s * 5.0


@pytest.mark.parametrize(("bank_deg", "learns"), [(20.0, True), (35.0, False)])
def test_turn_faster_than_20_deg_s_teaches_no_offset(bank_deg, learns):
    """A wrong course in a turn, 30 degrees ahead: learnt as an offset at 16 deg/s, not at 31."""
    rows, R = turning(30.0, bank_deg)
    estimator = power_up(R[0])
    estimator.replay(rows[:750])
    before = estimator.snapshot()["omega_i_b"][0]
    rows["gps_course_rad"] += math.radians(30.0)
    estimator.replay(rows[750:])
    assert np.any(estimator.snapshot()["omega_i_b"][0] != before) == learns


def test_gps_lost_in_flight_coasts_on_gyros_and_says_so():
    """Two seconds after the last fix the health is poor, and the yaw correction is gone."""
    rows, R = turning(60.0, 0.0)
    rows["gps_new"][1000:] = 0
    estimator = power_up(R[0])
    health = estimator.replay(rows)["health"]
    assert health[999] == Health.GOOD
    assert np.all(health[1000 + round((premerlani.FIX_LIFE_S + 0.3) / DT) :] == Health.POOR)
    np.testing.assert_array_equal(estimator.snapshot()["yaw_b"][0], 0.0)


@pytest.mark.parametrize("rate_hz", [50, 200])
@pytest.mark.parametrize("latency_s", [0.0, 0.31, 2.5, 12.0])
def test_recalled_nose_is_the_one_of_a_latency_ago(rate_hz, latency_s):
    """The memory reaches back 12 s at any sample rate; in between it is interpolated."""
    dt, rate = 1.0 / rate_hz, math.radians(10.0)
    rows = at_rest(30.0, dt=dt)
    rows["gyro_b_rad_s"] = [0.0, 0.0, rate]
    rows["gps_new"][-1] = 1
    params = PremerlaniParams(gps_filter_s=0.0, gps_latency_s=latency_s, w_rp=0.0)
    estimator = Premerlani(params)
    R = estimator.replay(rows)["R_eb"]
    x, y = estimator.snapshot()["nose_at_fix"][0]
    turned = math.remainder(float(heading_rad(R[-1])) - math.atan2(y, x), 2 * math.pi)
    # A chord of a 20 ms step stands for its arc: (rate 0.02)^2 / 8 in length, less in angle.
    assert turned == pytest.approx(math.remainder(rate * latency_s, 2 * math.pi), rel=0, abs=1e-5)
