"""What every suite of sensors obeys, over the registry: repeatable, causal, read-only, and nothing dead."""

import copy

import numpy as np
import pytest

from autopilot.interface import NEUTRAL
from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import PrescribedPlant, SteadyTurn
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import SUITES as SHIPPED
from sim.sensors.suite import Suite, SuiteParams

DEVICE = {
    "gain": 0.02, "gain_per_k": 1e-3, "nonlinearity": 0.002, "cross_axis": 0.01, "bandwidth_hz": 42.0,
    "conversions": 4, "output": "absolute",
}  # fmt: skip
EVERYTHING = SuiteParams(
    GyroParams(**DEVICE, g_sensitivity_deg_s_g=0.1, null_deg_s=300.0),
    AccelerometerParams(**DEVICE, null_g=3.0),
    board=BoardParams((0.1, 0.02, -0.05), (2.0, -1.0, 3.0), 0.02, 0.05, True, 10.0, 60.0, 0.3, 4.0),
)  # every term of gyro, accelerometer and board that no shipped suite needs
SUITES = {**SHIPPED, "everything": EVERYTHING}
every_suite = pytest.mark.parametrize("name", SUITES)
N = 150
SENSED_TRUTH = ("gyro_bias_b_rad_s", "force_bias_b_m_s2", "gps_p_e_m", "gps_v_e_m_s")


def truth_log(n_ticks=2 * N, rates=None):
    """A log with the truth of a turn in wind, no row measured yet."""
    log = Log.empty(n_ticks)
    plant = PrescribedPlant(SteadyTurn(0.6, wind_e_m_s=(3.0, 1.0, 0.0)), rates or Rates())
    plant.reset(log)
    for k in range(n_ticks):
        plant.advance(k, NEUTRAL)
    log.truth["rotor_rpm"], log.truth["throttle"] = np.linspace(6000.0, 8000.0, n_ticks), np.linspace(0.3, 0.9, n_ticks)
    return log


def flown(name, log, seed=0, flight=0, ticks=None, suite=None):
    """Measure `ticks` of `log` (all of it) with the suite `name`, new unless given."""
    if suite is None:
        suite = Suite(SUITES[name], Rates(), seed, flight)
        suite.reset(log)
    for k in ticks or range(len(log)):
        suite.measure(k)
    return log


def assert_bit_equal(a, b):
    """Measured rows and the truth columns the sensors write are the same, bit for bit."""
    assert a.measured.tobytes() == b.measured.tobytes()
    for column in SENSED_TRUTH:
        assert a.truth[column].tobytes() == b.truth[column].tobytes()


@every_suite
def test_suite_same_seed_gives_equal_bits(name):
    """The same seed and flight twice: every bit the same."""
    assert_bit_equal(flown(name, truth_log(), 3, 7), flown(name, truth_log(), 3, 7))


@pytest.mark.parametrize("name", [n for n in SUITES if n != "ideal"])
@pytest.mark.parametrize(("seed", "flight"), [(4, 7), (3, 8)])
def test_suite_other_seed_or_flight_gives_other_readings(name, seed, flight):
    """Another seed, or another flight of the campaign, has other errors."""
    a, b = flown(name, truth_log(), 3, 7).measured, flown(name, truth_log(), seed, flight).measured
    for column in ("gyro_b_rad_s", "force_b_m_s2", "gps_v_e_m_s"):
        assert np.mean(a[column] != b[column]) > 0.3


@every_suite
def test_suite_reset_equals_new(name):
    """A suite that has flown and is reset measures as a new one, also over a log that was used before."""
    log = truth_log()
    suite = Suite(SUITES[name], Rates(), 3)
    for _ in range(2):
        suite.reset(log)
        flown(name, log, suite=suite)
    assert_bit_equal(log, flown(name, truth_log(), 3))


@every_suite
def test_suite_restored_in_mid_flight_goes_on_as_if_never_stopped(name):
    """2N ticks equal N ticks, snapshot, restore into a suite of another seed over a copy of the log, N more."""
    log = truth_log()
    first = Suite(SUITES[name], Rates(), 3)
    first.reset(log)
    flown(name, log, ticks=range(N), suite=first)
    snapshot, later = first.snapshot(), copy.deepcopy(log)
    second = Suite(SUITES[name], Rates(), 99)
    second.reset(later)
    second.restore(snapshot)
    flown(name, later, ticks=range(N, 2 * N), suite=second)
    assert_bit_equal(later, flown(name, truth_log(), 3))


def test_suite_snapshot_of_a_shorter_flight_is_refused():
    """A snapshot cannot serve a log that is longer than its errors; the message says both lengths."""
    short, long = Suite(SUITES["generic"], Rates(), 0), Suite(SUITES["generic"], Rates(), 0)
    short.reset(Log.empty(5))
    long.reset(Log.empty(6))
    with pytest.raises(ValueError, match="snapshot of 5 ticks: the log has 6 ticks"):
        long.restore(short.snapshot())


@every_suite
def test_suite_takes_nothing_from_the_future_and_writes_its_row_alone(name):
    """Later rows of the truth may hold anything; rows but k are untouched, and so is the motion."""
    clean, blind = flown(name, truth_log()), truth_log()
    for column in blind.truth.dtype.names:
        if blind.truth[column].dtype.kind == "f":
            blind.truth[column][N:] = np.nan
    motion = blind.truth.copy()
    flown(name, blind, ticks=range(N))
    assert blind.measured[:N].tobytes() == clean.measured[:N].tobytes()
    assert not np.any(blind.measured[N:].view(np.float64))
    for column in set(motion.dtype.names) - set(SENSED_TRUTH):
        np.testing.assert_array_equal(blind.truth[column], motion[column])


@every_suite
def test_suite_measurements_are_a_read_only_copy_of_their_row(name):
    """What is handed out is row k, cannot be written, shares nothing with the log, and does not change later."""
    log = truth_log()
    suite = Suite(SUITES[name], Rates(), 0)
    suite.reset(log)
    m = suite.measure(0)
    assert m.k == 0
    assert m.rows[0].tobytes() == log.measured[0].tobytes()
    assert not np.shares_memory(m.rows, log.measured)
    before = m.imu.gyro_b_rad_s.copy()
    with pytest.raises(ValueError, match="read-only"):
        m.imu.gyro_b_rad_s[0] = 1.0
    suite.measure(1)
    np.testing.assert_array_equal(m.imu.gyro_b_rad_s, before)


@every_suite
@pytest.mark.parametrize("k", [-1, 2 * N])
def test_suite_row_outside_the_log_is_refused(name, k):
    """No tick before the first or after the last, and none at all before `reset`."""
    suite = Suite(SUITES[name], Rates(), 0)
    with pytest.raises(IndexError, match="reset"):
        suite.measure(0)
    suite.reset(truth_log())
    with pytest.raises(IndexError, match="no such row"):
        suite.measure(k)


@every_suite
@pytest.mark.parametrize(("physics_hz", "imu_hz"), [(200, 40), (200, 50), (400, 100), (1000, 200)])
def test_suite_at_every_rate_reports_all_channels_alive_and_finite(name, physics_hz, imu_hz):
    """In a turn every channel that is fitted moves, is finite, and times run on evenly; the others stay silent.

    Every fix arrives that is true after the first one could be and is a latency old before the end.
    """
    fitted, seconds = SUITES[name], 4
    rates = Rates(physics_hz, imu_hz, fitted.gps.rate_hz)
    log = truth_log(seconds * imu_hz, rates)
    suite = Suite(fitted, rates, 0)
    suite.reset(log)
    flown(name, log, suite=suite)
    rows = log.measured
    for column in ("gyro_b_rad_s", "force_b_m_s2", "gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s"):
        assert np.all(np.isfinite(rows[column]))
        assert np.any(rows[column] != 0.0)
    np.testing.assert_allclose(np.diff(rows["t_s"]), 1.0 / imu_hz, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(rows["dt_s"], 1.0 / imu_hz)
    true_at = np.arange(1, 1000) / rates.gps_hz
    first, last = fitted.gps.first_fix_s, seconds - fitted.gps.latency_s
    assert rows["gps_new"].sum() == np.sum((true_at >= first - 1e-9) & (true_at <= last + 1e-9)) > 0
    assert_alive(rows, "mag_new", "mag_b_ut", fitted.magnetometer, seconds)
    assert_alive(rows, "air_new", "equivalent_airspeed_m_s", fitted.airspeed, seconds)
    assert_alive(rows, "air_new", "baro_height_m", fitted.barometer, seconds)
    if fitted.magnetometer is None:
        np.testing.assert_array_equal(rows["mag_new"], 0)
    if fitted.airspeed is None and fitted.barometer is None:
        np.testing.assert_array_equal(rows["air_new"], 0)


def assert_alive(rows, new, column, part, seconds):
    """A part that is fitted reports at least four fifths of the samples of its rate; one that is not, no number."""
    if part is None:
        assert not np.any(np.nan_to_num(rows[column]))
        return
    fresh = rows[column][rows[new] == 1].reshape(np.sum(rows[new]), -1)
    known = fresh[np.isfinite(fresh).all(axis=1)]
    assert len(known) >= 0.8 * part.rate_hz * seconds
    assert np.all(known != 0.0)
