"""What the paper leaves open: clipped axes, airspeed, wind, the weight until yaw is locked."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from estimator.interface import G_M_S2, MEASURED_DTYPE, AirData, GpsFix, Health, ImuSample, Measurements
from estimator.premerlani import AIR_LIFE_S, Premerlani, PremerlaniParams
from estimator.rotation import heading_error_rad, inclination_error_rad

DT, SPEED = 0.02, 12.6
RECEIVER = {"gps_filter_s": 1.0, "gps_latency_s": 0.3}  # with which every estimator here flies
STILL = np.array([0.0, 0.0, -G_M_S2])


def pulled_up(n, load, limit=math.inf):
    """A pull-up at `load` g with wings level, at 12.6 m/s: what gyro and accelerometer read, the latter clipped."""
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT, DT
    rows["gyro_b_rad_s"][:, 1] = rate = (load - 1.0) * G_M_S2 / SPEED
    pitch = rate * (rows["t_s"] - DT / 2)
    rows["force_b_m_s2"][:, 0] = np.sin(pitch) * G_M_S2
    rows["force_b_m_s2"][:, 2] = -np.cos(pitch) * G_M_S2 - rate * SPEED
    rows["gps_new"], rows["gps_speed_m_s"] = 1, SPEED
    np.clip(rows["force_b_m_s2"], -limit, limit, out=rows["force_b_m_s2"])
    R = Rotation.from_euler("Y", (rate * rows["t_s"])[:, None]).as_matrix()
    return rows, R


def circling(duration_s, wind, bank_deg=35.0, heading_0=0.4, straight_s=0.0):
    """Rows and attitudes of level turns in a steady wind (after some straight flight), seen by ideal sensors.

    The receiver filters the velocity (1 s, sampled like the nose) and reports it 0.3 s late, five times a second.
    """
    n, lag = round(duration_s / DT), 15
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT, DT
    bank = np.where(rows["t_s"] > straight_s, math.radians(bank_deg), 0.0)
    rate = G_M_S2 * np.tan(bank) / SPEED
    psi = heading_0 + np.cumsum(rate) * DT
    R = Rotation.from_euler("ZYX", np.stack([psi, 0 * psi, bank], axis=-1)).as_matrix()
    rows["gyro_b_rad_s"] = np.einsum("nji,j->ni", R, [0.0, 0.0, 1.0]) * rate[:, None]
    rows["force_b_m_s2"][:, 2] = -G_M_S2 / np.cos(bank)
    v = SPEED * np.exp(1j * psi) + complex(*wind)
    gain = 1.0 - math.exp(-DT)
    v = lfilter([gain], [1.0, gain - 1.0], v - v[0]) + v[0]
    v = np.concatenate([np.full(lag, v[0]), v[:-lag]])
    rows["gps_new"][::10] = 1
    rows["gps_course_rad"], rows["gps_speed_m_s"] = np.angle(v) % (2 * np.pi), np.abs(v)
    return rows, R


def power_up(R, **params):
    """An estimator that starts from rest at `R`."""
    estimator = Premerlani(PremerlaniParams(**RECEIVER, **params))
    estimator.reset(ImuSample(0.0, DT, np.zeros(3), R.T @ STILL))
    return estimator


def tilt_deg(estimates, R):
    """Inclination error of a flight, degrees."""
    return np.degrees(inclination_error_rad(estimates["R_eb"], R))


@pytest.mark.parametrize("load", [2.5, 3.0])
def test_clipped_axis_of_a_pull_up_does_not_steer_the_pitch(load):
    """Clipped at 2 g, the reference of gravity is that much too short downwards, and level is not where it was."""
    rows, R = pulled_up(50, load, limit=2.0 * G_M_S2)
    options = {
        "known": {"force_full_scale_m_s2": 2.0 * G_M_S2},
        "set": {"clip_m_s2": 1.98 * G_M_S2},
        "found": {"find_clip": True},
        "ignored": {},
    }
    tilt = {
        name: tilt_deg(power_up(np.eye(3), launch_gate=math.inf, w_rp=1.0, **params).replay(rows), R).max()
        for name, params in options.items()
    }
    assert tilt["known"] < 0.5
    assert tilt["set"] == pytest.approx(tilt["known"], rel=0, abs=1e-12)
    assert tilt["found"] < 1.5  # the first clipped reading still steers: 20 ms at W_RP = 1 / s and 0.9 of error
    assert tilt["ignored"] > 5.0


@pytest.mark.parametrize(
    ("params", "limit_m_s2"),
    [
        ({}, math.inf),
        ({"force_full_scale_m_s2": 30.0}, 29.7),
        ({"force_full_scale_m_s2": 30.0, "clip_m_s2": 25.0}, 25.0),
        ({"clip_m_s2": 25.0}, 25.0),
    ],
)
def test_clip_level_follows_from_the_full_scale_unless_it_is_set(params, limit_m_s2):
    """Known of the part, 1 % below its end; set by hand, as set; neither, never."""
    estimator = power_up(np.eye(3), **params)
    assert estimator.snapshot()["clip_m_s2"][0] == pytest.approx(limit_m_s2, rel=0, abs=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_clipped_axis_is_replaced_by_what_the_estimate_expects_and_the_others_steer(axis):
    """Two axes tell of a tilt; a third that reads nonsense at the end of its scale changes nothing of that."""
    tilted = Rotation.from_rotvec(np.radians([3.0, -4.0, 0.0])).as_matrix()
    force = tilted.T @ STILL
    clipped = force.copy()
    clipped[axis] = 3.0 * G_M_S2
    steered = {}
    for name, reading in (("true", force), ("clipped", clipped)):
        estimator = power_up(np.eye(3), clip_m_s2=3.0 * G_M_S2)
        estimator.update(Measurements.of(ImuSample(DT, DT, np.zeros(3), reading)))
        steered[name] = estimator.snapshot()["roll_pitch_b"][0]
        assert estimator.snapshot()["clipped"][0] == (1 << axis if name == "clipped" else 0)
    expected = -force
    expected[axis] = G_M_S2 * np.eye(3)[2, axis]
    oracle = np.cross(expected / np.linalg.norm(expected), [0.0, 0.0, 1.0])
    np.testing.assert_allclose(steered["clipped"], oracle, rtol=0, atol=1e-13)
    assert np.linalg.norm(steered["true"]) > 0.08


def test_find_clip_repeated_readings_at_rest_are_no_end_of_the_scale():
    """A quantised accelerometer at rest reads its largest value again and again."""
    estimator = power_up(np.eye(3), find_clip=True)
    for k in range(5):
        estimator.update(Measurements.of(ImuSample((k + 1) * DT, DT, np.zeros(3), STILL)))
        assert estimator.snapshot()["clipped"][0] == 0


def test_find_clip_largest_reading_counts_from_its_second_time_until_a_larger_one():
    """The first extreme may be anything; the same to the last digit is the end; a larger one was not yet that."""
    estimator = power_up(np.eye(3), find_clip=True)
    seen = []
    for k, load in enumerate([1.0, 2.0, 2.0, 1.9, 2.0, 2.5, 2.0, 2.5]):
        estimator.update(Measurements.of(ImuSample((k + 1) * DT, DT, np.zeros(3), STILL * load)))
        seen.append(int(estimator.snapshot()["clipped"][0]))
    assert seen == [0, 0, 4, 0, 4, 0, 0, 4]


def test_airspeed_takes_the_place_of_ground_speed_in_a_turn_in_wind():
    """Where the receiver reports 5 m/s too much, a pitot tube keeps the turn level; ignored, it does not."""
    rows, R = circling(40.0, (0.0, 0.0))
    rows["gps_speed_m_s"] += 5.0
    rows["air_new"][::5], rows["equivalent_airspeed_m_s"] = 1, SPEED
    on, off = (tilt_deg(power_up(R[0], use_airspeed=use, k_i=0.0).replay(rows), R)[-1] for use in (True, False))
    assert on < 0.1
    assert off > 5.0


@pytest.mark.parametrize("reading", [math.nan, -1.0, 0.0])
def test_airspeed_that_is_none_changes_nothing(reading):
    """A barometer alone, a blocked tube: the GPS goes on giving the speed."""
    rows, R = circling(10.0, (0.0, 0.0))
    without = power_up(R[0]).replay(rows)
    rows["air_new"], rows["equivalent_airspeed_m_s"] = 1, reading
    assert power_up(R[0]).replay(rows).tobytes() == without.tobytes()


def test_airspeed_of_no_size_is_refused_and_changes_no_attitude():
    """An infinite airspeed is counted for every sample, the health is poor, and the GPS goes on giving the speed."""
    rows, R = circling(10.0, (0.0, 0.0))
    without = power_up(R[0]).replay(rows)
    rows["air_new"], rows["equivalent_airspeed_m_s"] = 1, math.inf
    estimator = power_up(R[0])
    got = estimator.replay(rows)
    np.testing.assert_array_equal(got["R_eb"], without["R_eb"])
    assert estimator.refused == {"airspeed": len(rows)}
    assert np.all(got["health"] == Health.POOR)


def test_airspeed_lost_in_flight_gives_way_to_ground_speed():
    """A sensor that falls silent counts for a second more."""
    estimator = Premerlani(PremerlaniParams(**RECEIVER))
    fix = GpsFix(0.0, np.zeros(3), np.zeros(3), 0.0, 10.0)
    turning, w = [], 0.5
    for k in range(100):
        air = AirData(20.0, 0.0) if k == 0 else None
        imu = ImuSample((k + 1) * DT, DT, np.array([0.0, 0.0, w]), STILL)
        estimator.update(Measurements.of(imu, gps=fix if k == 0 else None, air=air))
        turning.append(estimator.snapshot()["g_ref_b_m_s2"][0, 1] / w)
    n = round(AIR_LIFE_S / DT)
    np.testing.assert_allclose(turning[:n], 20.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(turning[n + 1 :], 10.0, rtol=0, atol=0.1)  # GPS speed over the length of a late nose


@pytest.mark.parametrize("wind", [(5.0, 0.0), (-3.0, 4.0)])
def test_learn_wind_in_a_turn_finds_it_and_the_nose(wind):
    """40 % of the airspeed as wind: learnt in two circles, with it the heading of the nose and the level."""
    rows, R = circling(60.0, wind)
    estimator, blind = power_up(R[0], learn_wind=True), power_up(R[0])
    assert (estimator.heading_reference, blind.heading_reference) == ("nose", "course")
    estimates, without = estimator.replay(rows), blind.replay(rows)
    np.testing.assert_allclose(estimates["wind_e_m_s"][-1], [*wind, 0.0], rtol=0, atol=0.3)
    assert np.all(np.isnan(estimates["wind_e_m_s"][0]))
    assert np.all(np.isnan(without["wind_e_m_s"]))
    late = slice(-1000, None)
    off = {
        name: np.degrees(np.abs(heading_error_rad(e["R_eb"][late], R[late]))).max()
        for name, e in (("known", estimates), ("unknown", without))
    }
    # 0.1 m/s of wind is half a degree of 12.6 m/s; the ends of 20 ms steps at 31 deg/s are as much.
    assert off["known"] < 2.0
    assert off["unknown"] > 15.0
    assert tilt_deg(estimates, R)[late].max() < 1.0 < tilt_deg(without, R)[late].max()


def test_learn_wind_streaming_tells_it_once_known():
    """`update` returns None before, the wind after, as the replay does."""
    rows, R = circling(40.0, (0.0, -4.0), straight_s=10.0)
    estimator = power_up(R[0], learn_wind=True)
    told = [estimator.update(Measurements(rows, k)).wind_e_m_s for k in range(len(rows))]
    replayed = power_up(R[0], learn_wind=True).replay(rows)["wind_e_m_s"]
    assert told[0] is None
    assert told[-1] is not None
    unknown = np.full(3, np.nan)
    np.testing.assert_array_equal([unknown if w is None else w for w in told], replayed)


def test_w_y_until_lock_finds_the_heading_sooner_and_is_gone_after():
    """Thrown backwards: three times the weight needs a good deal less time, and in flight nothing is left of it."""
    rows, R = circling(30.0, (0.0, 0.0), bank_deg=0.0, heading_0=math.radians(150.0))
    health = {w: Premerlani(PremerlaniParams(**RECEIVER, w_y_until_lock=w)).replay(rows)["health"] for w in (0.0, 3.6)}
    locked_s = {w: np.argmax(h == Health.GOOD) * DT for w, h in health.items()}
    # 150 to 90 degrees at full strength, then like ln(tan): with 1.2 in 2.5 s, plus the second it must hold.
    assert locked_s[3.6] < 1.0 + 0.5 * (locked_s[0.0] - 1.0)
    after = {}
    for w in (0.0, 3.6):
        estimator = power_up(R[0], w_y_until_lock=w)
        state = estimator.snapshot()
        state["locked"] = 1
        estimator.restore(state)
        after[w] = estimator.replay(rows).tobytes()
    assert after[0.0] == after[3.6]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"clip_m_s2": 9.8}, "clip_m_s2 is 9.8 m/s"),
        ({"force_full_scale_m_s2": 9.8}, "force_full_scale_m_s2 is 9.8 m/s.2; gravity alone"),
        ({"force_full_scale_m_s2": math.nan}, "force_full_scale_m_s2 is nan"),
        ({"clip_m_s2": math.nan}, "clip_m_s2 is nan"),
        ({"w_y_until_lock": -1.0}, "w_y_until_lock is -1.0"),
        ({"learn_wind": True, "rotate_history": False}, "learn_wind needs rotate_history"),
    ],
)
def test_params_of_an_option_that_cannot_be_are_refused(params, message):
    """One line, by name."""
    with pytest.raises(ValueError, match=message):
        PremerlaniParams(**params)
