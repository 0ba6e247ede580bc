"""The note's estimator on closed-form motion seen by ideal sensors and a late, filtering receiver."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import gps_velocity
from estimator.gps_velocity import GpsVelocity, GpsVelocityMagnetometer, GpsVelocityParams
from estimator.interface import MEASURED_DTYPE, Health, ImuSample
from estimator.rotation import heading_error_rad, heading_rad, inclination_error_rad

G, SPEED, DT = gps_velocity.G_M_S2, 12.6, 0.02
FILTER_S, LATENCY_S = 1.0, 0.3
RECEIVER = {"gps_filter_s": FILTER_S, "gps_latency_s": LATENCY_S}  # with which every motion here is seen


def rows_of(duration_s, gps_hz=4):
    """Rows at rest, with empty reports at `gps_hz`."""
    rows = np.zeros(round(duration_s / DT), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(len(rows)) + 1) * DT, DT
    rows["force_b_m_s2"] = [0.0, 0.0, -G]
    rows["gps_new"][:: round(1 / gps_hz / DT)] = 1
    return rows


def report(rows, v):
    """Fill the reports with the complex velocity `v`, north + i east, as it is reported."""
    rows["gps_v_e_m_s"][:, 0], rows["gps_v_e_m_s"][:, 1] = v.real, v.imag
    rows["gps_course_rad"], rows["gps_speed_m_s"] = np.mod(np.angle(v), 2 * np.pi), np.abs(v)


def turning(duration_s, bank_deg=35.0, heading_0=0.4, wind=0.0, gps_hz=4):
    """Rows and true attitudes of a coordinated level turn in a wind (bank 0: straight ahead).

    The report is the closed form of the receiver in the steady state: v / (1 + i omega T), a latency ago.
    """
    bank = math.radians(bank_deg)
    rate = G * math.tan(bank) / SPEED
    rows = rows_of(duration_s, gps_hz)
    psi = heading_0 + rate * rows["t_s"]
    R = Rotation.from_euler("ZYX", np.stack([psi, 0 * psi, 0 * psi + bank], axis=-1)).as_matrix()
    rows["gyro_b_rad_s"] = R[0].T @ [0.0, 0.0, rate]
    rows["force_b_m_s2"] = [0.0, 0.0, -G / math.cos(bank)]
    report(rows, wind + SPEED * np.exp(1j * (psi - rate * LATENCY_S)) / (1.0 + 1j * rate * FILTER_S))
    return rows, R


def surging(duration_s, heading=0.7, swing_m_s=4.0, hz=0.1):
    """Rows of level flight whose speed swings: 2.5 m/s^2 along the nose, 14 degrees to an accelerometer."""
    rows = rows_of(duration_s)
    w, nose = 2.0 * math.pi * hz, np.exp(1j * heading)
    # Mean acceleration of a tick; report: gain 1 / |1 + i w T|, phase atan(w T), a latency ago.
    t = rows["t_s"]
    rows["force_b_m_s2"][:, 0] = swing_m_s * (np.sin(w * t) - np.sin(w * (t - DT))) / DT
    swing = swing_m_s * np.imag(np.exp(1j * w * (t - LATENCY_S)) / (1.0 + 1j * w * FILTER_S))
    report(rows, (SPEED + swing) * nose)
    return rows, Rotation.from_euler("z", heading).as_matrix()


def power_up(R, **params):
    """An estimator that starts from rest at `R` (its heading is then unknown)."""
    estimator = GpsVelocity(GpsVelocityParams(**{**RECEIVER, **params}))
    estimator.reset(ImuSample(0.0, DT, np.zeros(3), R.T @ [0.0, 0.0, -G]))
    return estimator


@pytest.mark.parametrize("gps_hz", [1, 4, 10])
def test_coordinated_turn_keeps_the_attitude(gps_hz):
    """Two minutes at 35 degrees of bank: matched to the lag, both sides of Eqn 3 agree, at any report rate."""
    rows, R = turning(120.0, gps_hz=gps_hz)
    estimates = power_up(R[0], k_i=0.0).replay(rows)
    tilt = np.degrees(inclination_error_rad(estimates["R_eb"], R))
    # Eqn 17 leaves theta^3 / 3 a step, 0.0013 deg/s; held by W_RP = 0.5 / s that is 0.003 degrees.
    assert tilt[-500:].max() < 0.01
    assert np.degrees(np.abs(heading_error_rad(estimates["R_eb"], R)))[-500:].max() < 0.5


def test_coordinated_turn_with_an_unmatched_lag_tilts():
    """A second of filter and 0.3 s of latency that nobody knows of: degrees of tilt; the test above is no accident."""
    rows, R = turning(120.0)
    estimates = power_up(R[0], k_i=0.0, gps_filter_s=0.0, gps_latency_s=0.0).replay(rows)
    assert np.degrees(inclination_error_rad(estimates["R_eb"], R))[-500:].max() > 2.0


@pytest.mark.parametrize("wind", [5.0, -3.0 + 4.0j])
@pytest.mark.parametrize("reference", ["course", "nose"])
def test_turn_in_wind_tells_wind_nose_and_course(wind, reference):
    """Two circles: wind within 0.5 m/s, no tilt from the crab, and the heading that was asked for."""
    rows, R = turning(30.0, wind=wind)
    estimates = power_up(R[0], yaw_reference=reference).replay(rows)
    last = estimates[-250:]
    assert np.abs(last["wind_e_m_s"][:, 0] + 1j * last["wind_e_m_s"][:, 1] - wind).max() < 0.5
    assert np.degrees(inclination_error_rad(last["R_eb"], R[-250:])).max() < 1.5
    psi = heading_rad(R[-250:])
    told = np.exp(1j * psi) if reference == "nose" else SPEED * np.exp(1j * psi) + wind
    off = np.degrees(np.angle(np.exp(1j * heading_rad(last["R_eb"])) / told))
    # The crab angle is worked out at reports: held for 0.25 s in a turn of 31 deg/s it is up to 4 degrees late.
    assert np.sqrt(np.mean(off**2)) < 4.0


def test_surge_along_the_nose_is_no_tilt():
    """Accelerometer alone: 14 degrees; with the change of the reported velocity none, once yaw is locked."""
    rows, R = surging(60.0)
    estimates = power_up(R, k_i=0.0).replay(rows)
    felt = np.degrees(np.arctan2(np.abs(rows["force_b_m_s2"][:, 0]), G))
    assert felt.max() > 14.0
    # Swings of the report are 1 % of a second apart from those of the sum: interpolation over 0.25 s of a 10 s swing.
    assert np.degrees(inclination_error_rad(estimates["R_eb"], R))[1500:].max() < 0.3


def test_surge_before_yaw_is_locked_the_stand_in_is_gated():
    """A push along an unknown heading: 3 g for 0.3 s, then level flight, tips the matrix by less than 3 degrees."""
    rows = rows_of(6.0)
    t, push, throw_s = rows["t_s"], 27.0, 0.3
    thrown = (t > 2.0 + 1e-9) & (t <= 2.0 + throw_s + 1e-9)
    rows["force_b_m_s2"][thrown, 0] = push
    late = t - LATENCY_S - 2.0
    v = np.where(late > 0.0, push * np.minimum(late, throw_s), 0.0)
    filtered = np.zeros(len(t))
    for k in range(1, len(t)):  # 1 / (1 + s T), by small steps
        filtered[k] = filtered[k - 1] + DT / FILTER_S * (v[k - 1] - filtered[k - 1])
    report(rows, filtered * np.exp(2.0j))
    R = Rotation.from_euler("z", 2.0).as_matrix()
    tilt = np.degrees(inclination_error_rad(power_up(R).replay(rows)["R_eb"], R))
    assert tilt[t < 3.5].max() < 3.0
    estimator = power_up(R)  # the same, believing its heading
    state = estimator.snapshot()
    state["locked"] = 1
    estimator.restore(state)
    assert np.degrees(inclination_error_rad(estimator.replay(rows)["R_eb"], R))[t < 3.5].max() > 5.0


@pytest.mark.parametrize("off_deg", [*range(0, 360, 40), 179.99, 180.01])
def test_yaw_lock_from_any_heading_takes_less_than_10_s(off_deg):
    """Within 15 degrees for good, and said so; while far off, never called good."""
    rows, R = turning(15.0, 0.0, heading_0=math.radians(off_deg))
    estimates = GpsVelocity(GpsVelocityParams(**RECEIVER)).replay(rows)
    off = np.degrees(np.abs(heading_error_rad(estimates["R_eb"], R)))
    assert off[-250:].max() < 15.0
    assert estimates["health"][-1] == Health.GOOD
    assert not np.any(estimates["health"][off > 30.0] == Health.GOOD)


@pytest.mark.parametrize("latency_s", [0.3, 2.0])
def test_high_gains_do_not_swing_however_late_the_receiver_is(latency_s):
    """Corrections turn the memory with them: at 3 / s and 2 s of latency the tilt still dies away without a swing."""
    rows, R = turning(40.0, 0.0)
    estimator = power_up(Rotation.from_euler("x", 0.0).as_matrix(), w_rp=3.0, w_y=3.0, k_i=0.0, gps_latency_s=latency_s)
    estimator.replay(rows[:1000])
    state = estimator.snapshot()
    tilt = Rotation.from_euler("x", 10.0, degrees=True).as_matrix()
    state["R_eg"][0] = state["R_og"][0] = tilt @ state["R_eg"][0]
    estimator.restore(state)
    R_eb = estimator.replay(rows[1000:])["R_eb"]
    bank = np.degrees(np.arctan2(R_eb[:, 2, 1], R_eb[:, 2, 2])) * np.sign(R_eb[:, 2, 2])
    error = np.degrees(inclination_error_rad(R_eb, R[1000:]))
    assert error[50:].max() < 1.0  # 10 e^-3 after a second
    assert np.abs(bank[100:]).max() < 0.3


def test_gyro_offset_in_straight_flight_is_learnt():
    """All three axes, with the heading locked: within a tenth of a degree a second after two minutes."""
    offset = np.radians([1.0, -0.7, 0.5])
    rows, R = turning(150.0, 0.0)
    rows["gyro_b_rad_s"] += offset
    estimates = power_up(R[0]).replay(rows)
    assert np.degrees(np.abs(estimates["gyro_bias_b_rad_s"][-1] - offset)).max() < 0.1
    assert np.degrees(inclination_error_rad(estimates["R_eb"][-1], R[-1])) < 0.3


@pytest.mark.parametrize("declination_deg", [-10.0, 0.0, 15.0])
def test_magnetometer_turns_the_nose_to_true_north(declination_deg):
    """Field of 20 uT towards magnetic north and 40 down, at 10 Hz, in a 35 degree turn without a GPS course."""
    rows, R = turning(30.0, heading_0=2.0)
    declination = math.radians(declination_deg)
    field_e = [20.0 * math.cos(declination), 20.0 * math.sin(declination), 40.0]
    rows["mag_b_ut"] = np.einsum("nji,j->ni", R, field_e)
    rows["mag_new"][::5] = 1
    estimator = power_up(R[0], yaw_reference="magnetometer", declination_rad=declination, k_i=0.0)
    assert estimator.heading_reference == "nose"
    estimates = estimator.replay(rows)
    assert np.degrees(np.abs(heading_error_rad(estimates["R_eb"], R)))[-250:].max() < 0.5
    assert np.degrees(inclination_error_rad(estimates["R_eb"], R))[-250:].max() < 0.1


def test_magnetometer_the_first_field_is_the_heading_at_once():
    """Powered up facing south, the heading is right a tick after the first field, though north was assumed."""
    rows, R = turning(5.0, bank_deg=0.0, heading_0=3.0)
    rows["mag_b_ut"] = np.einsum("nji,j->ni", R, [20.0, 0.0, 40.0])
    rows["mag_new"][10::5] = 1
    estimates = power_up(R[0], yaw_reference="magnetometer").replay(rows)
    error_deg = np.degrees(np.abs(heading_error_rad(estimates["R_eb"], R)))
    assert error_deg[10] > 170.0
    assert error_deg[11:].max() < 0.1


def test_gps_lost_the_paper_stands_in_and_health_is_poor():
    """In a turn, with the reports gone, the centrifugal term of the last airspeed keeps the tilt."""
    rows, R = turning(40.0)
    rows["gps_new"][1000:] = 0
    estimates = power_up(R[0], k_i=0.0).replay(rows)
    assert np.all(estimates["health"][1000 + round((gps_velocity.FIX_LIFE_S + 0.3) / DT) :] == Health.POOR)
    assert np.degrees(inclination_error_rad(estimates["R_eb"], R))[-1] < 1.0


def test_without_gps_for_ever_the_tilt_is_that_of_the_accelerometer():
    """10 degrees of tilt at rest go away at W = 0.3 / s, and the heading is said to be unknown."""
    rows = rows_of(30.0)
    rows["gps_new"] = 0
    estimator = power_up(Rotation.from_euler("y", 10.0, degrees=True).as_matrix())
    estimates = estimator.replay(rows)
    tilt = np.degrees(inclination_error_rad(estimates["R_eb"], np.eye(3)))
    # The integral remembers the error it saw: 0.03 / 0.3 of it comes back, slowly.
    assert tilt[-1] < 1.0
    assert np.all(estimates["health"] == Health.STARTING)


def test_accelerometer_lost_in_flight_corrects_no_tilt_by_half_a_sum():
    """The sums have a hole: gyros alone then, exact for ideal ones, and GPS yaw goes on."""
    rows, R = turning(40.0)
    rows["force_b_m_s2"][1000:] = np.nan
    estimates = power_up(R[0], k_i=0.0).replay(rows)
    assert np.degrees(inclination_error_rad(estimates["R_eb"], R))[-1] < 1.0
    assert np.all(estimates["health"][1000:] == Health.POOR)


def test_heading_reference_follows_from_the_yaw_reference():
    """What the autopilot steers by is what the matrix tells."""
    references = {y: GpsVelocity(GpsVelocityParams(yaw_reference=y)).heading_reference for y in ("course", "nose")}
    assert references == {"course": "course", "nose": "nose"}
    assert GpsVelocityMagnetometer().heading_reference == "nose"
    assert "magnetometer" in GpsVelocityMagnetometer.uses


@pytest.mark.parametrize("reference", gps_velocity.YAW_REFERENCES)
def test_rubbish_of_all_kinds_never_leaves_the_rotations(reference):
    """Spikes, NaN, gaps, clocks set back and absurd reports, for 100 s: still a rotation within 1e-3, still finite."""
    rng = np.random.default_rng(11)
    rows = rows_of(100.0)
    rows["dt_s"] = rng.choice([0.0, 1e-6, 0.02, 0.5, 3.0, np.nan], len(rows))
    rows["t_s"] += rng.choice([0.0, -5.0, 0.4, np.inf], len(rows), p=[0.97, 0.01, 0.01, 0.01])
    for name in ("gyro_b_rad_s", "force_b_m_s2", "gps_v_e_m_s", "mag_b_ut"):
        scale = rng.choice([0.0, 1.0, 30.0, 900.0, 1e30, np.nan], (len(rows), 1))
        rows[name] = scale * rng.standard_normal((len(rows), 3))
    rows["gps_new"], rows["mag_new"] = rng.integers(0, 2, (2, len(rows)))
    estimates = GpsVelocity(GpsVelocityParams(**RECEIVER, yaw_reference=reference, w_y=20.0, w_rp=20.0)).replay(rows)
    R = estimates["R_eb"]
    assert np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max() < 1e-3
    assert np.linalg.det(R).min() > 0.0
    assert np.all(np.isfinite(estimates["omega_b_rad_s"]))
    assert np.all(np.isfinite(estimates["gyro_bias_b_rad_s"]))
