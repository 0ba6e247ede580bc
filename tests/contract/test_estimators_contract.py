"""Every estimator of the registry obeys the protocol, keeps nothing that it was lent, and lends nothing it keeps."""

import importlib
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import estimator as package
from estimator.interface import (
    MEASURED_DTYPE,
    AttitudeEstimate,
    AttitudeEstimator,
    GpsFix,
    Health,
    ImuSample,
    Measurements,
)
from scenarios.harness.commands import bench

N = 400
NO_SNAPSHOT = {"peer_imufusion", "peer_imufusion_9d"}  # the package shows its state to nobody
NO_REPLAY = {name for name in package.ESTIMATORS if name.startswith("peer_")}  # no kernel of ours
NUMBERS = tuple(n for n in MEASURED_DTYPE.names if MEASURED_DTYPE[n].base.kind == "f")


def class_of(name):
    """The class of a registered estimator; a test of one whose package is not installed is skipped."""
    module, _, attribute = package.ESTIMATORS[name].partition(":")
    found = getattr(importlib.import_module(module), attribute)
    try:
        found()
    except ImportError as problem:
        pytest.skip(str(problem))
    return found


@pytest.fixture(params=sorted(package.ESTIMATORS))
def make(request):
    """The class of each registered estimator."""
    return class_of(request.param)


def everything_fitted(n=N):
    """Rows of a plausible flight with GPS, magnetometer and air data, that may be written on."""
    rng = np.random.default_rng(7)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * 0.02, 0.02
    rows["gyro_b_rad_s"] = rng.normal([0.0, 0.1, 0.3], 0.1, (n, 3))
    rows["force_b_m_s2"] = rng.normal([0.0, 0.5, -10.5], 0.5, (n, 3))
    rows["mag_b_ut"], rows["mag_new"][::5] = rng.normal([18.0, 4.0, 42.0], 0.5, (n, 3)), 1
    course = 0.3 * rows["t_s"]
    rows["gps_new"][10::10], rows["gps_valid"][10:], rows["gps_t_s"] = 1, 1, rows["t_s"] - 0.3
    rows["gps_course_rad"], rows["gps_speed_m_s"] = course, 12.0
    rows["gps_v_e_m_s"] = np.stack([12.0 * np.cos(course), 12.0 * np.sin(course), 0.0 * course], axis=1)
    rows["gps_p_e_m"] = np.cumsum(0.02 * rows["gps_v_e_m_s"], axis=0)
    rows["air_new"][::5], rows["equivalent_airspeed_m_s"], rows["baro_height_m"] = 1, 13.0, 40.0
    return rows


def assert_attitude(estimate):
    """A finite rotation, and finite rates, whatever came before."""
    assert np.all(np.isfinite(columns([estimate])))
    assert np.abs(estimate.R_eb @ estimate.R_eb.T - np.eye(3)).max() < 1e-3
    assert np.linalg.det(estimate.R_eb) > 0.0
    assert estimate.wind_e_m_s is None or np.all(np.isfinite(estimate.wind_e_m_s))


@pytest.fixture
def rows():
    """A plausible flight with 5 Hz of GPS, a broken sample and a repeated time; read-only, as in the loop."""
    rng = np.random.default_rng(5)
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(N) + 1) * 0.02, 0.02
    rows["gyro_b_rad_s"] = rng.normal(0.0, 0.4, (N, 3))
    rows["force_b_m_s2"] = rng.normal([0.0, 0.0, -9.8], 1.0, (N, 3))
    rows["gps_new"][10::10] = 1
    rows["gps_valid"][10:] = 1
    rows["gps_course_rad"], rows["gps_speed_m_s"] = 1.0, 12.0
    rows["gps_v_e_m_s"] = [12.0 * np.cos(1.0), 12.0 * np.sin(1.0), 0.0]
    rows["gyro_b_rad_s"][200] = np.nan
    rows["t_s"][300] = rows["t_s"][299]
    rows.flags.writeable = False
    return rows


def fly(estimator, rows):
    """Every estimate of a flight."""
    return [estimator.update(Measurements(rows, k)) for k in range(len(rows))]


def columns(estimates):
    """The numbers of a flight's estimates, as copies."""
    return np.array([[*e.R_eb.ravel(), *e.omega_b_rad_s, *e.gyro_bias_b_rad_s, e.health] for e in estimates])


def test_update_over_a_flight_returns_attitudes(make, rows):
    """Protocol, types, shapes; a finite rotation at every tick, bad samples included."""
    estimator = make()
    assert isinstance(estimator, AttitudeEstimator)
    assert estimator.heading_reference in ("course", "nose")
    for estimate in fly(estimator, rows):
        assert isinstance(estimate, AttitudeEstimate)
        assert estimate.R_eb.shape == (3, 3)
        assert estimate.omega_b_rad_s.shape == estimate.gyro_bias_b_rad_s.shape == (3,)
        assert_attitude(estimate)
        assert isinstance(estimate.health, Health)


def test_update_returned_arrays_are_the_callers_to_keep(make, rows):
    """An estimate of an earlier tick does not change later, and writing on it changes no later one."""
    estimator, spoilt = make(), make()
    first = estimator.update(Measurements(rows, 0))
    kept = columns([first])
    rest = columns([estimator.update(Measurements(rows, k)) for k in range(1, N)])
    np.testing.assert_array_equal(columns([first]), kept)
    after_spoiling = []
    for k in range(N):
        estimate = spoilt.update(Measurements(rows, k))
        after_spoiling.append(columns([estimate])[0])
        estimate.R_eb[:] = estimate.omega_b_rad_s[:] = estimate.gyro_bias_b_rad_s[:] = np.nan
    np.testing.assert_array_equal(after_spoiling[1:], rest)


def test_update_writes_nothing_on_the_rows(make, rows):
    """Measurements are lent: even rows that could be written stay as they were."""
    writable = rows.copy()
    fly(make(), writable)
    assert writable.tobytes() == rows.tobytes()


def test_update_looks_at_its_own_tick_and_earlier_ones_alone(make, rows):
    """What later rows hold makes no difference: no estimator sees the future."""
    changed = rows.copy()
    changed[N // 2 :] = np.zeros(1, MEASURED_DTYPE)
    np.testing.assert_array_equal(columns(fly(make(), rows[: N // 2])), columns(fly(make(), changed)[: N // 2]))


def test_update_single_measurements_equal_rows_of_a_log(make, rows):
    """`Measurements.of` and a row of the log are the same to an estimator."""
    one, other = make(), make()
    for k in range(100):
        row = rows[k]
        imu = ImuSample(row["t_s"], row["dt_s"], row["gyro_b_rad_s"], row["force_b_m_s2"])
        fix = GpsFix(0.0, np.zeros(3), row["gps_v_e_m_s"], row["gps_course_rad"], row["gps_speed_m_s"])
        single = Measurements.of(imu, gps=fix if row["gps_new"] else None)
        np.testing.assert_array_equal(columns([one.update(single)]), columns([other.update(Measurements(rows, k))]))


@pytest.mark.parametrize("on_ground", [None, ImuSample(2.0, 0.02, np.full(3, 0.02), np.array([1.0, -2.0, -9.5]))])
def test_reset_equals_new_and_two_instances_share_nothing(make, rows, on_ground):
    """The same flight thrice: new, reset after use, and beside another one in flight."""
    new, used, beside = make(), make(), make()
    fly(used, rows)
    for estimator in (new, used):
        estimator.reset(on_ground)
    fly(beside, rows)
    np.testing.assert_array_equal(columns(fly(used, rows)), columns(fly(new, rows)))


def test_power_up_takes_the_tilt_from_the_sample(make):
    """Held at 10 degrees of bank and 20 of pitch, the first attitude says so."""
    roll, pitch = np.radians([10.0, 20.0])
    force = -9.8 * np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    estimator = make()
    estimator.reset(ImuSample(2.0, 0.02, np.zeros(3), force))
    estimate = estimator.update(Measurements.of(ImuSample(2.02, 0.02, np.zeros(3), force)))
    single = make.__module__ == "estimator.peers.peers"  # a package may compute in single precision
    np.testing.assert_allclose(estimate.R_eb[2] * -9.8, force, rtol=0, atol=1e-6 if single else 1e-9)


HARD = st.sampled_from(
    [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e30, -1e9, 1e6, -5e3, 300.0, 36.6, -7.0, 1e-3, 5e-324, 0.0]
)
TICK = st.integers(0, 119)
SPOILT = st.lists(st.tuples(TICK, st.integers(1, 40), st.sampled_from(NUMBERS), HARD), max_size=12)
CLOCK = st.lists(st.tuples(TICK, st.sampled_from([-1e9, -5.0, -0.9, -0.02, 0.1, 0.45, 3.0, 1e9, np.nan])), max_size=6)
FLAGS = st.lists(
    st.tuples(TICK, st.sampled_from(["gps_new", "gps_valid", "mag_new", "air_new"]), st.integers(0, 1)), max_size=8
)


@pytest.mark.parametrize("name", sorted(package.ESTIMATORS))
@settings(max_examples=settings.default.max_examples * 2 // 5)
@given(spoilt=SPOILT, clock=CLOCK, flags=FLAGS, on_ground=st.sampled_from([None, np.nan, 1e9, 0.01]))
def test_garbage_never_drives_the_attitude_off_the_rotations(name, spoilt, clock, flags, on_ground):
    """Any number in any column for a while, NaN and infinities too; times that repeat, run back, leap; any power-up."""
    rows = everything_fitted(120)
    for k, n, column, value in spoilt:
        rows[column][k : k + n] = value
    for k, shift in clock:
        rows["t_s"][k:] += shift
    for k, flag, value in flags:
        rows[flag][k:] = value
    rows.flags.writeable = False
    estimator = class_of(name)()
    if on_ground is not None:
        estimator.reset(ImuSample(2.0, 0.02, np.full(3, on_ground), np.array([on_ground, 0.0, -9.8])))
    with np.errstate(all="raise", under="ignore"):
        for estimate in fly(estimator, rows):
            assert_attitude(estimate)


@pytest.mark.parametrize("missing", ["gyro", "accelerometer", "gps", "magnetometer", "airspeed", "all", "none"])
@pytest.mark.parametrize("from_tick", [0, N // 2])
def test_instrument_missing_for_ever_is_survived(make, missing, from_tick):
    """From power-up on, or from the middle of the flight: an attitude at every tick; NaN is counted if used."""
    rows = everything_fitted()
    gone = rows[from_tick:]
    for instrument, column in (("gyro", "gyro_b_rad_s"), ("accelerometer", "force_b_m_s2")):
        if missing in (instrument, "all"):
            gone[column] = np.nan
    for instrument, flag in (("gps", "gps_new"), ("magnetometer", "mag_new"), ("airspeed", "air_new")):
        if missing in (instrument, "all"):
            gone[flag] = 0
    estimator = make()
    for estimate in fly(estimator, rows):
        assert_attitude(estimate)
    if missing in {"gyro", "accelerometer"} & {*estimator.uses} or missing == "all":
        assert estimator.rejected >= N - from_tick


def test_instruments_that_are_not_named_make_no_difference(make):
    """`uses` is the truth: what is not in it may say what it likes."""
    rows, spoilt = everything_fitted(), everything_fitted()
    uses = make().uses
    for instrument, column in (("gps", "gps"), ("magnetometer", "mag"), ("airspeed", "air")):
        if instrument not in uses:
            for name in (n for n in MEASURED_DTYPE.names if n.startswith(column)):
                spoilt[name] = 1 if spoilt[name].dtype.kind == "i" else 17.0
    np.testing.assert_array_equal(columns(fly(make(), spoilt)), columns(fly(make(), rows)))


def test_snapshot_and_restore_are_exact(make, request):
    """2 N steps equal N, snapshot, N others, restore, N more, in the same object and in a new one."""
    if request.node.callspec.params["make"] in NO_SNAPSHOT:
        assert not hasattr(make(), "snapshot")
        return
    rows, half = everything_fitted(), N // 2
    whole = columns(fly(make(), rows))
    one, other = make(), make()
    fly(one, rows[:half])
    snapshot = one.snapshot()
    fly(one, rows[: half // 2])
    for estimator in (one, other):
        estimator.restore(snapshot)
        np.testing.assert_array_equal(
            columns([estimator.update(Measurements(rows, k)) for k in range(half, N)]), whole[half:]
        )


def test_replay_equals_streaming_bit_for_bit(make, request):
    """A whole log in one call, in two calls, and row by row: wind and health too."""
    if request.node.callspec.params["make"] in NO_REPLAY:
        assert not hasattr(make(), "replay")
        return
    rows = everything_fitted()
    rows["gyro_b_rad_s"][100], rows["t_s"][200] = np.nan, rows["t_s"][199]
    streamed, at_once, in_parts = make(), make(), make()
    estimates = fly(streamed, rows)
    wind = [np.full(3, np.nan) if e.wind_e_m_s is None else e.wind_e_m_s for e in estimates]
    parts = np.concatenate([in_parts.replay(rows[:150]), in_parts.replay(rows[150:])])
    for replayed in (at_once.replay(rows), parts):
        for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "health"):
            np.testing.assert_array_equal(replayed[name], [getattr(e, name) for e in estimates])
        np.testing.assert_array_equal(replayed["wind_e_m_s"], wind)


def test_no_state_begins_with_the_whole_of_another():
    """Numba would take the longer record for a subtype of the shorter one, and warn, once both have flown."""
    dtypes = {estimator()._state.dtype for estimator in map(class_of, package.ESTIMATORS)}
    for shorter, longer in itertools.permutations(dtypes, 2):
        n = len(shorter.names)
        assert [shorter.fields[f][:2] for f in shorter.names] != [longer.fields[f][:2] for f in longer.names[:n]]


@pytest.mark.parametrize("name", sorted(package.ESTIMATORS))
def test_bench_times_every_estimator(name):
    """Two seconds of cruise with each: figures for `update`, and for the kernel where there is one."""
    class_of(name)
    speed = bench.measure(name, 2.0, 1, lambda _done, _total: None)
    assert speed.estimator_update_ns > 0.0
    assert (speed.estimator_ns_per_call is None) == (name in NO_REPLAY)


def test_register_own_class_enters_it_and_refuses_a_taken_name():
    """One decorator makes an estimator nameable; a name means one class."""

    class Own:
        def update(self, _measurements):
            """Level, always."""
            return AttitudeEstimate(np.eye(3))

    try:
        assert package.register("own")(Own) is Own
        assert package.ESTIMATORS["own"].endswith("Own")
        package.register("own")(Own)  # a module imported again
        with pytest.raises(ValueError, match="'premerlani' is already"):
            package.register("premerlani")(Own)
    finally:
        package.ESTIMATORS.pop("own", None)
