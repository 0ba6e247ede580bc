"""Whatever comes: bad samples, bad clocks, no GPS; and what must be exact: replay, snapshot, reset."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.blocks.screening import CLOCK_BACK_S, COAST_S
from estimator.interface import MEASURED_DTYPE, Health, ImuSample, Measurements
from estimator.premerlani import Premerlani, PremerlaniParams

ANY = st.floats(allow_nan=True, allow_infinity=True)
SANE = st.floats(-40.0, 40.0)
NUMBER = st.one_of(SANE, SANE, SANE, ANY)
SWITCHES = ("gps_lag_filter", "rotate_history", "find_clip", "use_airspeed", "turn_speed", "learn_wind")
ROW = st.fixed_dictionaries(
    {
        "step_s": st.one_of(st.just(0.02), st.floats(-2.0, 2.0), ANY),  # of the clock since the row before
        "dt_s": st.one_of(st.just(0.02), st.floats(0.0, 0.6), ANY),
        "gyro_b_rad_s": st.tuples(NUMBER, NUMBER, NUMBER),
        "force_b_m_s2": st.tuples(NUMBER, NUMBER, NUMBER),
        "gps_new": st.integers(0, 1),
        "gps_course_rad": NUMBER,
        "gps_speed_m_s": NUMBER,
        "air_new": st.integers(0, 1),
        "equivalent_airspeed_m_s": NUMBER,
    }
)


def rows_of(drawn):
    """Measured rows from drawn dictionaries."""
    rows = np.zeros(len(drawn), MEASURED_DTYPE)
    t = 0.0
    for row, values in zip(rows, drawn, strict=True):
        t = t + values["step_s"] if math.isfinite(t) else 0.0
        row["t_s"] = t
        for name in values.keys() - {"step_s"}:
            row[name] = values[name]
    return rows


def flight(n, seed=0, gps=True):
    """Rows of lively but plausible readings with 5 Hz of GPS."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"] = (np.arange(n) + 1) * 0.02
    rows["dt_s"] = 0.02
    rows["gyro_b_rad_s"] = rng.normal(0.0, 0.5, (n, 3))
    rows["force_b_m_s2"] = rng.normal([0.0, 0.0, -9.8], 1.0, (n, 3))
    if gps:
        rows["gps_new"][::10] = 1
        rows["gps_course_rad"], rows["gps_speed_m_s"] = rng.uniform(0.0, 6.28, n), rng.uniform(2.0, 15.0, n)
        rows["air_new"][::25], rows["equivalent_airspeed_m_s"] = 1, rng.uniform(8.0, 15.0, n)
    return rows


def assert_rotations(R):
    """|R R^T - I| < 1e-3 and det R > 0, at every row (NaN fails)."""
    assert np.all(np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)) < 1e-3)
    assert np.all(np.linalg.det(R) > 0.0)


@settings(max_examples=settings.default.max_examples * 3)
@given(
    st.lists(ROW, min_size=1, max_size=60),
    st.fixed_dictionaries({name: st.booleans() for name in SWITCHES}),
    st.sampled_from([0.3, math.inf]),
    st.sampled_from([20.0, math.inf]),
    st.sampled_from([0.0, 5.0]),
    st.sampled_from([0.0, 1.0]),
)
def test_replay_whatever_comes_stays_a_finite_rotation(drawn, switches, gate, clip, w_y_until_lock, filter_s):
    """Any numbers, NaN and inf too, any clock, any gaps in the GPS: never raises, never leaves SO(3)."""
    switches["learn_wind"] &= switches["rotate_history"]
    params = PremerlaniParams(
        **switches, launch_gate=gate, clip_m_s2=clip, w_y_until_lock=w_y_until_lock, gps_filter_s=filter_s
    )
    estimates = Premerlani(params).replay(rows_of(drawn))
    assert_rotations(estimates["R_eb"])
    assert np.all(np.isfinite(estimates["omega_b_rad_s"]))
    assert np.all(np.isfinite(estimates["gyro_bias_b_rad_s"]))


@settings(max_examples=settings.default.max_examples // 2)
@given(ANY, ANY, st.tuples(ANY, ANY, ANY), st.tuples(ANY, ANY, ANY))
def test_reset_whatever_sample_comes_starts_from_a_rotation(t, dt, gyro, force):
    """A calibration of nonsense is ignored, the flight goes on."""
    estimator = Premerlani()
    estimator.reset(ImuSample(t, dt, np.array(gyro), np.array(force)))
    estimates = estimator.replay(flight(5))
    assert_rotations(estimates["R_eb"])
    assert np.all(np.isfinite(estimates["gyro_bias_b_rad_s"]))


@settings(max_examples=settings.default.max_examples * 3 // 10)
@given(st.integers(0, 10**6), st.floats(0.0, 0.9))
def test_replay_jittered_intervals_and_lost_samples_stay_a_rotation(seed, lost):
    """Irregular intervals and missing rows are no error, and nothing is rejected."""
    rng = np.random.default_rng(seed)
    rows = flight(400, seed)
    rows["dt_s"] = rng.uniform(0.005, 0.05, 400)
    rows["t_s"] = np.cumsum(rows["dt_s"])
    kept = rows[rng.random(400) > lost]
    estimator = Premerlani()
    assert_rotations(estimator.replay(kept)["R_eb"])
    assert estimator.rejected == 0


def test_gps_missing_for_ever_keeps_the_tilt_and_says_starting():
    """Without a single fix the accelerometer still holds roll and pitch; the heading stays unknown."""
    rows = flight(30_000, gps=False)
    rows["gyro_b_rad_s"] *= 0.05
    estimates = Premerlani().replay(rows)
    assert np.degrees(np.arccos(np.clip(estimates["R_eb"][:, 2, 2], -1, 1))).max() < 3.0
    assert np.all(estimates["health"] == Health.STARTING)


@pytest.mark.parametrize(
    ("columns", "counted"),
    [
        ({"gyro_b_rad_s": np.nan}, 1),
        ({"force_b_m_s2": np.inf}, 1),
        ({"gyro_b_rad_s": 40.0}, 1),  # beyond any gyro's range
        ({"force_b_m_s2": 200.0}, 1),
        ({"t_s": np.nan}, 1),
        ({"t_s": 1.98}, 1),  # the time of the row before
        ({"t_s": 1.5}, 1),
        ({"dt_s": 0.0}, 1),
        ({"dt_s": -0.02}, 1),
        ({"dt_s": 0.6}, 1),
        ({"dt_s": np.nan}, 1),
        ({"gps_new": 1, "gps_speed_m_s": np.nan}, 1),
        ({}, 0),
    ],
)
def test_one_bad_sample_is_counted_reported_and_soon_forgotten(columns, counted):
    """Row 99 of a flight at rest is spoilt: one rejection, health POOR for that tick, no lasting harm."""
    rows = np.zeros(200, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(200) + 1) * 0.02, 0.02
    rows["force_b_m_s2"] = [0.0, 0.0, -9.8]
    for name, value in columns.items():
        rows[name][99] = value
    estimator = Premerlani()
    estimates = estimator.replay(rows)
    assert estimator.rejected == counted
    assert (estimates["health"][99] == Health.POOR) == bool(counted)
    assert estimates["health"][100] == Health.STARTING
    np.testing.assert_allclose(estimates["R_eb"], np.broadcast_to(np.eye(3), (200, 3, 3)), rtol=0, atol=1e-12)


def test_broken_gyro_coasts_on_the_last_rate_and_then_holds():
    """A gyro that fails in a turn is bridged for a quarter of a second, not for ever."""
    rows = flight(200, gps=False)
    rows["gyro_b_rad_s"] = [0.0, 0.0, 1.0]
    rows["gyro_b_rad_s"][100:] = np.nan
    rows["force_b_m_s2"] = [0.0, 0.0, -9.8]
    R = Premerlani().replay(rows)["R_eb"]
    yaw = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    assert yaw[-1] - yaw[99] == pytest.approx(COAST_S, rel=0, abs=0.021)  # to the tick, at 1 rad/s
    assert yaw[-1] == yaw[-2]


def test_lost_samples_are_bridged_by_the_next_one():
    """Ten of fifty samples gone: the rate of the next one stands for the gap, so the turn is whole."""
    rows = flight(100, gps=False)
    rows["gyro_b_rad_s"] = [0.0, 0.0, 0.5]
    rows["force_b_m_s2"] = [0.0, 0.0, -9.8]
    whole = Premerlani().replay(rows)["R_eb"][-1]
    gappy = Premerlani().replay(np.delete(rows, slice(40, 50)))["R_eb"][-1]
    np.testing.assert_allclose(gappy, whole, rtol=0, atol=0.11**3 / 3 + 1e-4)  # Eqn 17 over 0.11 rad at once


def test_clock_set_back_costs_one_sample():
    """A logger that restarts its clock in flight is followed after a single rejection."""
    rows = flight(200)
    rows["t_s"][100:] -= 1.5
    assert rows["t_s"][100] < rows["t_s"][99] - CLOCK_BACK_S
    estimator = Premerlani()
    estimator.replay(rows)
    assert estimator.rejected == 1


UNKNOWN = np.full(3, np.nan)
ALL_KINDS = [
    PremerlaniParams(),
    PremerlaniParams(gps_filter_s=1.0),
    PremerlaniParams(gps_lag_filter=False, turn_speed=True),
    PremerlaniParams(gps_filter_s=1.0, learn_wind=True, find_clip=True, w_y_until_lock=3.0),
    PremerlaniParams(rotate_history=False, use_airspeed=False, clip_m_s2=20.0, launch_gate=math.inf),
]


@pytest.mark.parametrize("params", ALL_KINDS)
def test_replay_equals_streaming_bit_for_bit(params):
    """One call over the log, or `update` row by row: the same bits in every column."""
    rows = flight(2000)
    rows["gyro_b_rad_s"][500], rows["t_s"][900] = np.nan, 0.0
    batch, stream = Premerlani(params), Premerlani(params)
    replayed = batch.replay(rows)
    frozen = rows.view()
    frozen.flags.writeable = False
    for k, e in enumerate(replayed):
        estimate = stream.update(Measurements(frozen, k))
        np.testing.assert_array_equal(estimate.R_eb, e["R_eb"])
        np.testing.assert_array_equal(estimate.omega_b_rad_s, e["omega_b_rad_s"])
        np.testing.assert_array_equal(estimate.gyro_bias_b_rad_s, e["gyro_bias_b_rad_s"])
        assert estimate.health == e["health"]
        np.testing.assert_array_equal(UNKNOWN if estimate.wind_e_m_s is None else estimate.wind_e_m_s, e["wind_e_m_s"])
    assert batch.snapshot().tobytes() == stream.snapshot().tobytes()


@pytest.mark.parametrize("params", ALL_KINDS)
def test_snapshot_and_restore_go_on_bit_for_bit(params):
    """N ticks, a snapshot, N more; restored, the same N more: also in another instance."""
    rows = flight(1000)
    estimator, other = Premerlani(params), Premerlani(params)
    estimator.replay(rows[:500])
    snapshot = estimator.snapshot()
    once = estimator.replay(rows[500:])
    for e in (estimator, other):
        e.restore(snapshot)
        assert e.replay(rows[500:]).tobytes() == once.tobytes()


def test_reset_equals_new():
    """Nothing of an earlier flight survives a reset."""
    used, on_ground = Premerlani(), ImuSample(2.0, 0.02, np.array([0.01, 0.02, 0.03]), np.array([1.0, 0.5, -9.7]))
    used.replay(flight(3000))
    used.reset(on_ground)
    new = Premerlani()
    new.reset(on_ground)
    assert used.snapshot().tobytes() == new.snapshot().tobytes()


def test_step_corrupt_state_restarts_level():
    """A matrix of NaN (a foreign snapshot) becomes level with the heading unknown, and corrections recover it."""
    estimator = Premerlani()
    broken = estimator.snapshot()
    broken["R_eb"], broken["locked"] = np.nan, 1
    estimator.restore(broken)
    estimates = estimator.replay(flight(10))
    assert_rotations(estimates["R_eb"])
    assert estimates["health"][0] == Health.STARTING
