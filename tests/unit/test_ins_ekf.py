"""The navigation filter in flight: start, heading, delay, refusals, silence, options, and its books."""

import math

import numpy as np
import pytest

from estimator.ins_ekf import InsEkf, InsEkfParams
from estimator.interface import MEASURED_DTYPE, Health, ImuSample, Measurements
from estimator.rotation import from_euler, heading_error_rad, inclination_error_rad

G = 9.80665
DT_S = 0.02


def coordinated(
    duration_s=60.0, rate_rad_s=0.3, speed_m_s=13.0, wind=(0.0, 0.0), filter_s=1.0, latency_s=0.3, heading_rad=2.0,
    stamped=True,
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


def replayed(rows, params=None, on_ground=None):
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
    estimates, _ = replayed(rows, InsEkfParams(gps_latency_s=0.8))
    assert errors_deg(estimates[1500:], R_true[1500:])[0].max() <= 1.0


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
    estimator = InsEkf()
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
    with_mag, _ = replayed(rows, InsEkfParams(use_magnetometer=True, declination_rad=declination), held)
    without, _ = replayed(rows, None, held)
    assert abs(heading_error_rad(with_mag["R_eb"][-1], R_true)) <= math.radians(0.1)
    assert abs(heading_error_rad(without["R_eb"][-1], R_true)) > 1.0


def test_airspeed_tells_the_wind_along_a_straight_flight():
    """Straight on, the wind ahead is unknown without a pitot tube and known with it."""
    rows, _ = coordinated(rate_rad_s=0.0, wind=(3.0, 1.0), heading_rad=0.0)
    rows["airspeed_m_s"] = 13.0
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
        estimator = InsEkf()
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
    streaming, resumed = InsEkf(), InsEkf()
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
    rows["airspeed_m_s"] = rng.choice([13.0, np.nan, -5.0, 1e6, 900.0], n)
    for name in ("gps_new", "mag_new", "air_new"):
        rows[name] = rng.random(n) < 0.3
    estimates, estimator = replayed(rows, InsEkfParams(use_magnetometer=True))
    R = estimates["R_eb"]
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-6
    assert np.linalg.det(R).min() > 0.0
    assert np.all(np.isfinite(estimates["gyro_bias_b_rad_s"]))
    assert np.all(np.isfinite(estimates["omega_b_rad_s"]))
    assert np.all(np.isfinite(estimator.snapshot()["P"]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gyro_noise_rad_s_sqrt_hz", 0.0),
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
