"""The navigation filter in flight: start, heading, delay, refusals, silence, options, and its books."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.ins_ekf import InsEkf, InsEkfParams
from estimator.interface import MEASURED_DTYPE, Health, ImuSample, Measurements
from estimator.rotation import from_euler, heading_error_rad, inclination_error_rad

G = 9.80665
DT_S = 0.02
FILTER_S, LATENCY_S = 1.0, 0.3
GENERIC = InsEkfParams(
    gps_filter_s=FILTER_S, gps_latency_s=LATENCY_S, gps_latency_sigma_s=0.0,
    gyro_full_scale_rad_s=math.radians(300.0), force_full_scale_m_s2=3.0 * G,
)  # fmt: skip
"""The receiver of the motions here, its latency known, and the inertial unit of the generic suite."""


def coordinated(
    duration_s=60.0, rate_rad_s=0.3, speed_m_s=13.0, wind=(0.0, 0.0), filter_s=FILTER_S, latency_s=LATENCY_S,
    heading_rad=2.0, stamped=True,
):  # fmt: skip
    """Straight and in turns by the square of a sine, without noise: rows and true attitudes."""
    n = round(duration_s / DT_S)
    t = np.arange(n) * DT_S
    rate = rate_rad_s * np.sign(np.sin(0.2 * t)) * np.sin(0.2 * t) ** 2
    end = heading_rad + np.cumsum(rate) * DT_S
    roll = np.arctan(speed_m_s * rate / G)
    rolling = np.gradient(roll, DT_S)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t + DT_S, DT_S
    rows["gyro_b_rad_s"] = np.stack([rolling, rate * np.sin(roll), rate * np.cos(roll)], axis=-1)
    rows["force_b_m_s2"][:, 2] = -G / np.cos(roll)
    v = speed_m_s * np.stack([np.cos(end), np.sin(end), 0.0 * end], axis=-1) + np.array([*wind, 0.0])
    inside = v.copy()
    gain = 1.0 - math.exp(-DT_S / filter_s) if filter_s else 1.0
    for k in range(1, n):
        inside[k] = inside[k - 1] + gain * (
            0.5 * (v[k] + v[k - 1]) - inside[k - 1] if filter_s else v[k] - inside[k - 1]
        )
    late = round(latency_s / DT_S)
    for k in range(50 + late, n, 12):
        rows["gps_new"][k] = 1
        rows["gps_t_s"][k] = rows["t_s"][k - late] if stamped else -100.0
        rows["gps_v_e_m_s"][k] = inside[k - late]
    return rows, from_euler(roll, np.zeros(n), end)


def replayed(rows, params=GENERIC, on_ground=None):
    """Estimates of a fresh filter over the rows, and the filter."""
    estimator = InsEkf(params)
    estimator.reset(on_ground)
    return estimator.replay(rows), estimator


def errors_deg(estimates, R_true):
    """Inclination and heading error, each (n,), degrees."""
    R = estimates["R_eb"]
    return np.degrees(inclination_error_rad(R, R_true)), np.degrees(np.abs(heading_error_rad(R, R_true)))


def test_flight_in_wind_finds_attitude_heading_and_wind():
    """From an unknown heading in a strong crosswind, perfect sensors lead to small errors of everything."""
    rows, R_true = coordinated(wind=(3.0, -4.0))
    estimates, estimator = replayed(rows)
    inclination, heading = errors_deg(estimates[1500:], R_true[1500:])
    # The rows are rates and forces at the ends of the ticks, not means over them: half a tick of roll is 0.2 deg.
    assert inclination.max() <= 1.0
    assert heading.max() <= 2.0
    np.testing.assert_allclose(estimates["wind_e_m_s"][-1], [3.0, -4.0, 0.0], rtol=0, atol=0.4)
    assert estimator.rejected == 0
    assert estimates["health"][-1] == Health.GOOD


def test_fix_shows_in_the_estimate_of_the_tick_in_which_it_arrives():
    """The filter works in the past, the estimate is of the present: what a fix has corrected reaches it at once."""
    rows, _ = coordinated(20.0, wind=(3.0, -4.0))
    whole = replayed(rows)[0]["R_eb"]
    for k in np.flatnonzero(rows["gps_new"])[-12:]:
        other = rows.copy()
        other["gps_v_e_m_s"][k] += [0.4, -0.3, 0.0]
        changed = np.abs(replayed(other)[0]["R_eb"] - whole).max(axis=(1, 2)) > 0.0
        assert np.flatnonzero(changed)[0] == k


@pytest.mark.parametrize("throw_deg", [-170.0, -60.0, 0.0, 100.0, 180.0])
def test_throw_with_unknown_heading_aligns_whatever_the_heading(throw_deg):
    """At rest, then thrown: the velocity inside the receiver tells the heading, turned about to any direction."""
    heading = math.radians(throw_deg)
    n = 500
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT_S, DT_S
    rows["force_b_m_s2"] = [0.0, 0.0, -G]
    rows["force_b_m_s2"][300:325, 0] = 24.0
    speed = np.cumsum(rows["force_b_m_s2"][:, 0]) * DT_S
    inside = np.zeros(n)
    for k in range(1, n):
        inside[k] = inside[k - 1] + (1.0 - math.exp(-DT_S)) * (0.5 * (speed[k] + speed[k - 1]) - inside[k - 1])
    for k in range(60, n, 12):
        rows["gps_new"][k], rows["gps_t_s"][k] = 1, rows["t_s"][k - 15]
        rows["gps_v_e_m_s"][k] = inside[k - 15] * np.array([math.cos(heading), math.sin(heading), 0.0])
    held = ImuSample(0.0, DT_S, np.zeros(3), np.array([0.0, 0.0, -G]))
    estimates, _ = replayed(rows, on_ground=held)
    inclination, off = errors_deg(estimates, from_euler(np.zeros(n), np.zeros(n), np.full(n, heading)))
    assert set(estimates["health"][:300]) == {Health.STARTING}
    assert off[-75:].max() <= 1.0  # within 3 s of the throw, without noise
    assert inclination.max() <= 2.0


def test_delay_is_that_of_the_stamps_even_where_the_parameter_is_wrong():
    """A latency of 0.8 s against 0.3 s assumed costs nothing where fixes are stamped, and much where they are not."""
    by_stamp, by_parameter = [], []
    for stamped, worst in ((True, by_stamp), (False, by_parameter)):
        rows, R_true = coordinated(latency_s=0.8, rate_rad_s=0.5, stamped=stamped)
        estimates, _ = replayed(rows)
        worst.append(errors_deg(estimates[1500:], R_true[1500:])[0].max())
    assert by_stamp[0] <= 1.0
    assert by_parameter[0] > 3.0 * by_stamp[0]
    rows, R_true = coordinated(latency_s=0.8, rate_rad_s=0.5, stamped=False)
    estimates, _ = replayed(rows, replace(GENERIC, gps_latency_s=0.8))
    assert errors_deg(estimates[1500:], R_true[1500:])[0].max() <= 1.0


@pytest.mark.parametrize("true_s", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("filter_s", [0.0, 1.0])
def test_latency_of_unstamped_fixes_is_learnt_in_turns(true_s, filter_s):
    """Assumed 0.3 +- 0.2 s, the latency of the receiver that made the rows is found to a sample, and reported."""
    rows, R_true = coordinated(120.0, latency_s=true_s, filter_s=filter_s, stamped=False, rate_rad_s=0.5)
    estimates, estimator = replayed(rows, replace(GENERIC, gps_latency_sigma_s=0.2, gps_filter_s=filter_s))
    assert estimator.learnt.keys() == {"gps_latency_s"}
    # The rows hold rates at the ends of ticks, not means over them: half a tick of 0.02 s.
    assert estimator.learnt["gps_latency_s"] == pytest.approx(true_s, rel=0, abs=0.02)
    assert estimator.sigma()["gps_latency_s"][0] < 0.02
    assert errors_deg(estimates[4500:], R_true[4500:])[0].max() <= 1.0


def test_latency_unstamped_by_nan_is_learnt_as_well():
    """A stamp of NaN is none: the same latency is learnt as with stamps of another clock."""
    rows, _ = coordinated(120.0, latency_s=0.5, stamped=False)
    _, other_clock = replayed(rows, replace(GENERIC, gps_latency_sigma_s=0.2))
    rows["gps_t_s"] = np.nan
    _, unknown = replayed(rows, replace(GENERIC, gps_latency_sigma_s=0.2))
    assert unknown.learnt == other_clock.learnt != {}


@pytest.mark.parametrize(("stamped", "sigma_s"), [(True, 0.2), (False, 0.0)])
def test_latency_that_is_known_is_not_learnt(stamped, sigma_s):
    """With stamps, or with a sigma of zero, nothing is learnt, and the latency stays what it was."""
    rows, _ = coordinated(latency_s=0.5, stamped=stamped)
    _, estimator = replayed(rows, replace(GENERIC, gps_latency_sigma_s=sigma_s))
    assert estimator.learnt == {}
    assert estimator.snapshot()["latency_s"][0] == 0.3
    assert estimator.sigma()["gps_latency_s"][0] == pytest.approx(sigma_s, rel=0, abs=1e-12)


def test_latency_in_straight_flight_is_not_learnt():
    """Without acceleration a delay shows nowhere: the sigma stays, and nothing is reported."""
    rows, _ = coordinated(latency_s=0.5, stamped=False, rate_rad_s=0.0)
    _, estimator = replayed(rows, replace(GENERIC, gps_latency_sigma_s=0.15))
    assert estimator.learnt == {}
    assert estimator.sigma()["gps_latency_s"][0] > 0.1


def test_vertical_velocity_that_is_not_reported_is_not_fused():
    """Descending at 3 m/s with a receiver that reports zero for it: withheld, the tilt stays right; fused, it does not.

    A descent that begins and ends: its vertical acceleration and the missing velocity contradict each other.
    """
    rows, R_true = coordinated(80.0, rate_rad_s=0.5)
    t = rows["t_s"]
    sinking = 0.5 * 2.0 * np.pi / 8.0 * 6.0 * np.cos(2.0 * np.pi * t / 8.0)  # of v_z = 3 sin: amplitude 3 m/s
    rows["force_b_m_s2"] += R_true[:, 2, :] * sinking[:, None]
    withheld, _ = replayed(rows, replace(GENERIC, gps_vertical_velocity=False))
    fused, _ = replayed(rows)
    tilt_withheld, tilt_fused = (errors_deg(e[2000:], R_true[2000:])[0].max() for e in (withheld, fused))
    assert tilt_withheld <= 2.0
    assert tilt_fused > 2.0 * tilt_withheld
    rows["gps_v_e_m_s"][:, 2] = np.nan  # no receiver should: nobody looks at it
    unread, _ = replayed(rows, replace(GENERIC, gps_vertical_velocity=False))
    np.testing.assert_array_equal(unread["R_eb"], withheld["R_eb"])


def test_perfect_sensors_are_accepted_and_the_filter_stays_able_to_learn():
    """Noise, biases and gains of zero, no full scale: P stays positive, and a tilt of 10 degrees still goes."""
    perfect = replace(
        GENERIC, gyro_noise_rad_s_sqrt_hz=0.0, gyro_bias_sigma_rad_s=0.0, gyro_walk_rad_s_sqrt_s=0.0,
        gyro_gain_sigma=0.0, gyro_cross_axis=0.0, gyro_full_scale_rad_s=math.inf, force_noise_m_s2_sqrt_hz=0.0,
        force_bias_sigma_m_s2=0.0, force_full_scale_m_s2=math.inf, gps_noise_m_s=0.0, gps_filter_s=0.0,
        gps_latency_s=0.0,
    )  # fmt: skip
    rows, R_true = coordinated(filter_s=0.0, latency_s=0.0)
    estimator = InsEkf(perfect)
    estimator.reset()
    estimator.replay(rows[:1500])
    state = estimator.snapshot()
    state["R_filter_eb"][0] = from_euler(math.radians(10.0), 0.0, 0.0) @ state["R_filter_eb"][0]
    estimator.restore(state)
    estimates = estimator.replay(rows[1500:])
    P = estimator.snapshot()["P"][0, :20, :20]  # without the latency, which is exactly known
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert errors_deg(estimates[1000:], R_true[2500:])[0].max() <= 1.0


def test_gyro_bias_of_any_size_that_the_calibration_found_is_kept():
    """A gyro that reads 20 deg/s too much, calibrated, and specified for 0.05 deg/s after that: it stays so."""
    rows, R_true = coordinated()
    bias = np.radians([20.0, -15.0, 10.0])
    rows["gyro_b_rad_s"] += bias
    held = ImuSample(0.0, DT_S, bias, np.array([0.0, 0.0, -G]))
    estimates, estimator = replayed(rows, replace(GENERIC, gyro_bias_sigma_rad_s=math.radians(0.05)), held)
    np.testing.assert_allclose(estimates["gyro_bias_b_rad_s"][-1], bias, rtol=0, atol=math.radians(0.1))
    assert errors_deg(estimates[1500:], R_true[1500:])[0].max() <= 1.0
    assert estimator.refused == {}


def test_flight_that_begins_in_the_air_after_a_calibration_on_the_ground_finds_its_heading():
    """Calibrated at rest, then at once at 13 m/s in a crosswind: the heading is the course to begin with."""
    rows, R_true = coordinated(wind=(-2.0, 1.0))
    held = ImuSample(0.0, DT_S, np.zeros(3), np.array([0.0, 0.0, -G]))
    estimates, estimator = replayed(rows, on_ground=held)
    assert errors_deg(estimates[200:], R_true[200:])[1].max() <= 20.0  # the crab angle is 12 deg
    assert errors_deg(estimates[1500:], R_true[1500:])[1].max() <= 2.0
    assert estimator.refused == {}


def test_receiver_noisier_than_assumed_is_given_less_weight():
    """Five times the noise assumed: the tilt is at most twice that with the true figure, and fixes are accepted."""
    rows, R_true = coordinated(120.0, rate_rad_s=0.5)
    fixes = np.flatnonzero(rows["gps_new"])
    rows["gps_v_e_m_s"][fixes] += 0.5 * np.random.default_rng(3).standard_normal((len(fixes), 3))
    rms = []
    for noise_m_s in (0.5, 0.1):
        estimator = InsEkf(replace(GENERIC, gps_noise_m_s=noise_m_s))
        estimator.reset()
        estimator.replay(rows[:2000])
        rejected_at_first = estimator.rejected
        estimates = estimator.replay(rows[2000:])
        rms.append(float(np.sqrt(np.mean(errors_deg(estimates, R_true[2000:])[0] ** 2))))
        assert estimator.rejected - rejected_at_first <= 0.02 * len(fixes)
    assert rms[1] <= 2.0 * rms[0]  # 0.47 and 0.32 deg


def test_outlier_is_refused_counted_and_harmless():
    """One fix that is 30 m/s off makes no difference but in the count and the health of its tick."""
    rows, _ = coordinated()
    spoilt = rows.copy()
    k = np.flatnonzero(rows["gps_new"])[-40]
    spoilt["gps_v_e_m_s"][k, :2] += 30.0
    clean, _ = replayed(rows)
    estimates, estimator = replayed(spoilt)
    assert estimator.rejected == 1
    assert Health.POOR in estimates["health"][k : k + 30]
    R, R_clean = estimates["R_eb"][k:], clean["R_eb"][k:]
    assert np.degrees(inclination_error_rad(R, R_clean)).max() <= 0.3


def test_everything_refused_too_long_starts_again():
    """The attitude overturned in flight, as after a saturated gyro: fixes are refused, and 20 s later all is well."""
    rows, R_true = coordinated(80.0)
    estimator = InsEkf(GENERIC)
    estimator.replay(rows[:1500])
    snapshot = estimator.snapshot()
    for name in ("R_eb", "R_filter_eb"):
        snapshot[name][0] = snapshot[name][0] @ from_euler(2.6, 0.4, 1.0)
    estimator.restore(snapshot)
    estimates = estimator.replay(rows[1500:])
    assert estimator.rejected > 0
    inclination, _ = errors_deg(estimates[1000:], R_true[2500:])
    assert inclination.max() <= 5.0


def test_gps_lost_for_ever_stays_upright():
    """After 30 s of good flight the GPS falls silent: ten minutes of noisy circuits later the tilt is still bounded."""
    rows, R_true = coordinated(630.0, rate_rad_s=0.3)
    rng = np.random.default_rng(1)
    rows["gyro_b_rad_s"] += math.radians(0.3) * rng.standard_normal((len(rows), 3)) + math.radians(0.5)
    rows["force_b_m_s2"] += 0.2 * rng.standard_normal((len(rows), 3))
    rows["gps_new"][1500:] = 0
    estimates, _ = replayed(rows)
    inclination, _ = errors_deg(estimates, R_true)
    assert inclination[1500:].max() <= 20.0  # banks reach 22 deg; gyros alone would drift by 0.5 deg/s
    assert estimates["health"][-1] == Health.POOR


def test_gps_never_there_levels_by_gravity():
    """Without any fix the filter leans on gravity, weakly: a tilt of 20 degrees goes within two minutes."""
    n = 9000
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT_S, DT_S
    rows["force_b_m_s2"] = from_euler(0.35, 0.0, 0.0)[2] * -G
    estimates, _ = replayed(rows)
    inclination, _ = errors_deg(estimates, from_euler(np.full(n, 0.35), 0.0, 0.0))
    assert inclination[0] > 19.0
    assert inclination[6000:].max() <= 3.0
    assert set(estimates["health"]) == {Health.STARTING}


def test_magnetometer_finds_the_heading_at_rest_with_declination():
    """Standing, the field turned by the declination tells the heading; unused it does not."""
    heading, declination = 2.0, -0.25
    R_true = from_euler(0.1, -0.2, heading)
    n = 400
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT_S, DT_S
    rows["force_b_m_s2"] = R_true[2] * -G
    field_e = 20.0 * np.array([math.cos(declination), math.sin(declination), 2.4])
    rows["mag_new"][::5], rows["mag_b_ut"] = 1, R_true.T @ field_e
    held = ImuSample(0.0, DT_S, np.zeros(3), R_true[2] * -G)
    with_mag, _ = replayed(rows, replace(GENERIC, magnetometer_calibrated=True, declination_rad=declination), held)
    rows["mag_new"] = 0
    without, _ = replayed(rows, on_ground=held)
    assert abs(heading_error_rad(with_mag["R_eb"][-1], R_true)) <= math.radians(0.1)
    assert abs(heading_error_rad(without["R_eb"][-1], R_true)) > 1.0


def test_uncalibrated_magnetometer_gives_the_first_heading_and_no_more():
    """At rest the heading is the magnetometer's, and STARTING; in flight one turned by 60 degrees changes nothing."""
    heading = 2.0
    R_rest = from_euler(0.1, -0.2, heading)
    rest = np.zeros(200, MEASURED_DTYPE)
    rest["t_s"], rest["dt_s"] = (np.arange(200) + 1) * DT_S, DT_S
    rest["force_b_m_s2"] = R_rest[2] * -G
    rest["mag_new"][::5], rest["mag_b_ut"] = 1, R_rest.T @ np.array([20.0, 0.0, 48.0])
    held = ImuSample(0.0, DT_S, np.zeros(3), R_rest[2] * -G)
    standing, _ = replayed(rest, on_ground=held)
    assert abs(heading_error_rad(standing["R_eb"][-1], R_rest)) <= math.radians(0.1)
    assert set(standing["health"]) == {Health.STARTING}
    rows, R_true = coordinated()
    plain, _ = replayed(rows)
    rows["mag_new"][::5], rows["mag_b_ut"] = 1, from_euler(0.0, 0.0, math.radians(60.0)) @ np.array([20.0, 0.0, 48.0])
    turned, _ = replayed(rows)
    with_mag, without = errors_deg(turned[500:], R_true[500:]), errors_deg(plain[500:], R_true[500:])
    np.testing.assert_allclose(with_mag, without, rtol=0, atol=0.5)


def test_airspeed_tells_the_wind_along_a_straight_flight():
    """Straight on, the wind ahead is unknown without a pitot tube and known with it."""
    rows, _ = coordinated(rate_rad_s=0.0, wind=(3.0, 1.0), heading_rad=0.0)
    rows["equivalent_airspeed_m_s"] = 13.0
    _, without = replayed(rows)
    rows["air_new"][::5] = 1
    _, fitted = replayed(rows)
    assert without.sigma()["wind_e_m_s"][0] > 3.0
    assert fitted.sigma()["wind_e_m_s"][0] < 0.6
    assert abs(fitted.snapshot()["wind_e_m_s"][0, 0] - 3.0) <= 1.0


def test_a_cut_off_reading_makes_the_filter_unsure():
    """A throw at full scale leaves a velocity less certain than one just below it."""
    sigmas = []
    for force in (0.90, 0.98):
        estimator = InsEkf(GENERIC)
        estimator.reset(ImuSample(0.0, DT_S, np.zeros(3), np.array([0.0, 0.0, -G])))
        rows = np.zeros(60, MEASURED_DTYPE)
        rows["t_s"], rows["dt_s"] = (np.arange(60) + 1) * DT_S, DT_S
        rows["force_b_m_s2"] = [0.0, 0.0, -G]
        rows["force_b_m_s2"][15:35, 0] = force * 3.0 * G
        estimator.replay(rows)
        sigmas.append(estimator.sigma()["v_e_m_s"].max())
    assert sigmas[1] > 1.5 * sigmas[0]


def test_replay_equals_streaming_and_snapshots_go_on_exactly():
    """A noisy flight: one call, row by row, and a flight resumed from a snapshot at any tick agree bit for bit."""
    rows, _ = coordinated(40.0, wind=(2.0, 1.0))
    rng = np.random.default_rng(4)
    rows["gyro_b_rad_s"] += 0.01 * rng.standard_normal((len(rows), 3))
    rows["gyro_b_rad_s"][700:705] = np.nan
    rows["force_b_m_s2"][900, 1] = np.inf
    rows["gps_v_e_m_s"][rows["gps_new"] == 1] += 0.1 * rng.standard_normal((int(rows["gps_new"].sum()), 3))
    whole, one = replayed(rows)
    streaming, resumed = InsEkf(GENERIC), InsEkf(GENERIC)
    for k in range(len(rows)):
        estimate = streaming.update(Measurements(rows, k))
        np.testing.assert_array_equal(estimate.R_eb, whole["R_eb"][k])
        np.testing.assert_array_equal(estimate.gyro_bias_b_rad_s, whole["gyro_bias_b_rad_s"][k])
        wind = np.full(3, np.nan) if estimate.wind_e_m_s is None else estimate.wind_e_m_s
        np.testing.assert_array_equal(wind, whole["wind_e_m_s"][k])
        if k == 1003:
            resumed.restore(streaming.snapshot())
    tail = resumed.replay(rows[1004:])
    assert tail.tobytes() == whole[1004:].tobytes()
    assert one.snapshot().tobytes() == streaming.snapshot().tobytes() == resumed.snapshot().tobytes()


@pytest.mark.parametrize("seed", range(4))
def test_garbage_never_leaves_the_rotations(seed):
    """Readings of any size, NaN, broken times and fixes: a rotation at every tick, and a finite covariance."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(4000, MEASURED_DTYPE)
    n = len(rows)
    rows["t_s"] = np.cumsum(rng.choice([0.02, 0.02, 0.02, 0.0, 0.3, -0.5, 2.0], n))
    rows["dt_s"] = rng.choice([0.02, 0.5, np.nan, 0.0], n, p=[0.9, 0.05, 0.03, 0.02])
    for name, scale in (("gyro_b_rad_s", 30.0), ("force_b_m_s2", 150.0), ("gps_v_e_m_s", 300.0), ("mag_b_ut", 1e4)):
        rows[name] = scale * rng.standard_normal((n, 3))
        rows[name][rng.random(n) < 0.05] = rng.choice([np.nan, np.inf, -1e300])
    rows["gps_t_s"] = rows["t_s"] - rng.choice([0.3, 5.0, -1.0, np.nan], n)
    rows["equivalent_airspeed_m_s"] = rng.choice([13.0, np.nan, -5.0, 1e6, 900.0], n)
    for name in ("gps_new", "mag_new", "air_new"):
        rows[name] = rng.random(n) < 0.3
    estimates, estimator = replayed(rows, replace(GENERIC, magnetometer_calibrated=True))
    R = estimates["R_eb"]
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-6
    assert np.linalg.det(R).min() > 0.0
    assert np.all(np.isfinite(estimates["gyro_bias_b_rad_s"]))
    assert np.all(np.isfinite(estimates["omega_b_rad_s"]))
    assert np.all(np.isfinite(estimator.snapshot()["P"]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gyro_noise_rad_s_sqrt_hz", -1e-3),
        ("gyro_full_scale_rad_s", 0.0),
        ("gps_latency_sigma_s", math.inf),
        ("sideslip_sigma_m_s", 0.0),
        ("gps_noise_m_s", -1.0),
        ("wind_sigma_m_s", math.nan),
        ("gps_latency_s", 13.0),
        ("declination_rad", 4.0),
        ("gate", math.inf),
        ("force_range_m_s2", 1e5),
    ],
)
def test_params_nonsense_is_refused_by_name(name, value):
    """One line that names the field and its value."""
    with pytest.raises(ValueError, match=f"^{name} is {value}") as caught:
        InsEkfParams(**{name: value})
    assert "\n" not in str(caught.value)
