"""Inertial samples over uneven intervals, and samples that never arrive: the times, the means, what waits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarios.harness.config.faults import parse_fault
from sim.clock import Rates
from sim.log import Log
from sim.sensors.board import BoardParams
from sim.sensors.fitting import SUITES
from sim.sensors.suite import Suite

RATES = Rates()
IDEAL = SUITES["ideal"]


def motion(n, rates=RATES, seed=5):
    """A log of `n` ticks with random means of rate and force, and a constant velocity."""
    log, rng = Log.empty(n), np.random.default_rng(seed)
    log.truth["t_s"] = np.arange(1, n + 1) * rates.dt_s
    log.truth["imu_omega_b_rad_s"], log.truth["imu_force_b_m_s2"] = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    log.truth["v_e_m_s"][:, 0] = 15.0
    return log


def measured(n=2000, jitter=0.0, faults=(), rates=RATES, params=IDEAL, release_s=0.0):
    """Truth and measured rows of a flight, and the suite."""
    suite = Suite(
        replace(params, board=BoardParams(dt_jitter=jitter)), rates, 1, 0, [parse_fault(f) for f in faults], release_s
    )
    log = motion(n, rates)
    suite.reset(log)
    for k in range(n):
        suite.measure(k)
    return log.truth, log.measured, suite


def test_intervals_jitter_with_their_sigma_and_cover_all_time():
    """20 % of 20 ms: the lengths scatter by that, follow each other without a gap, and end before their tick."""
    truth, rows, _ = measured(20000, 0.2)
    assert np.std(rows["dt_s"]) == pytest.approx(0.2 * RATES.dt_s, rel=0.03)
    assert np.mean(rows["dt_s"]) == pytest.approx(RATES.dt_s, rel=1e-3)
    np.testing.assert_allclose(np.diff(rows["t_s"]), rows["dt_s"][1:], rtol=0, atol=1e-11)
    early = (truth["t_s"] - rows["t_s"]) / RATES.dt_s
    assert early.min() >= 0.0
    assert early.max() < 1.0
    assert early.mean() == pytest.approx(0.2 * math.sqrt(2.0 / math.pi) / math.sqrt(2.0 - 4.0 / math.pi), rel=0.03)
    assert rows["dt_s"].min() > 0.0


@pytest.mark.parametrize("rates", [RATES, Rates(400, 400)])
def test_readings_of_uneven_intervals_add_up_to_the_motion(rates):
    """Angle and velocity up to the end of each sample, with the rate constant in each tick, whatever the intervals."""
    truth, rows, _ = measured(1000, 0.3, rates=rates)
    ends = np.concatenate([[0.0], truth["t_s"]])
    for mean, reading in (("imu_omega_b_rad_s", "gyro_b_rad_s"), ("imu_force_b_m_s2", "force_b_m_s2")):
        true = np.vstack([np.zeros(3), np.cumsum(truth[mean] * rates.dt_s, axis=0)])
        sensed = np.cumsum(rows[reading] * rows["dt_s"][:, None], axis=0)
        for i in range(3):
            np.testing.assert_allclose(sensed[:, i], np.interp(rows["t_s"], ends, true[:, i]), rtol=0, atol=1e-10)


def test_share_of_the_samples_is_lost_in_the_window_only():
    """5 % of those from 10 to 30 s, in rows that repeat the one before; and none outside."""
    truth, rows, suite = measured(3000, faults=["imu:dropped=0.05@9-29"], release_s=1.0)
    lost = np.array([suite.lost(k) for k in range(3000)])
    assert suite.loses_samples
    assert not lost[:499].any()
    assert not lost[1499:].any()
    assert lost.sum() == pytest.approx(50.0, abs=4.5 * math.sqrt(50.0 * 0.95))
    for name in ("t_s", "dt_s", "gyro_b_rad_s", "force_b_m_s2"):
        np.testing.assert_array_equal(rows[name][lost], rows[name][np.flatnonzero(lost) - 1])
    arrived = rows[~lost]
    np.testing.assert_allclose(np.diff(arrived["t_s"]), arrived["dt_s"][1:], rtol=0, atol=1e-11)
    np.testing.assert_array_equal(arrived["t_s"], truth["t_s"][~lost])
    np.testing.assert_array_equal(arrived["gyro_b_rad_s"], truth["imu_omega_b_rad_s"][~lost])


def test_fix_and_other_samples_that_come_with_a_lost_one_are_handed_over_later():
    """None of them is lost, none comes twice, none is new in a row without an inertial sample."""
    full = SUITES["apm2"]
    plain = measured(1000, params=full)[1]
    _, rows, suite = measured(1000, params=full, faults=["imu:dropped=0.3@0-19"])
    lost = np.array([suite.lost(k) for k in range(1000)])
    for new, value in (("gps_new", "gps_t_s"), ("mag_new", "mag_b_ut"), ("air_new", "baro_height_m")):
        assert not rows[new][lost].any()
        late = 0
        for k in np.flatnonzero(plain[new]):
            handed = k + int(np.argmax(~lost[k:]))
            assert rows[new][handed] == 1
            late += handed > k
        assert late > 5
        np.testing.assert_array_equal(rows[value], plain[value])


def test_all_even_when_neither_is_asked_for():
    """The same bits as without the window, before it; and no sample table at all without jitter and faults."""
    plain, faulty = measured(500)[1], measured(500, faults=["imu:dropped=1@5-6"])
    assert plain[:249].tobytes() == faulty[1][:249].tobytes()
    assert faulty[2].lost(249)
    assert plain[301:].tobytes() == faulty[1][301:].tobytes()
    assert len(measured(10)[2].snapshot().samples) == 0


def test_snapshot_continues_with_the_same_samples():
    """Bit for bit, in the middle of lost samples."""
    _, rows, suite = measured(400, 0.2, ["imu:dropped=0.5@0-"])
    again = Suite(suite.params, RATES, 1, 0, suite.faults)
    log = motion(400)
    again.reset(log)
    for k in range(200):
        again.measure(k)
    kept, other = again.snapshot(), Suite(suite.params, RATES, 1)
    other.reset(log)
    other.restore(kept)
    for k in range(200, 400):
        other.measure(k)
    assert log.measured.tobytes() == rows.tobytes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("imu:dropped=0@5-", "above 0 and at most 1"), ("imu:dropped=1.5@5-", "above 0 and at most 1"),
        ("imu:dropped=0.1,2@5-", "takes at most 1 value"), ("imu:stuck@5-", "imu has no fault 'stuck'"),
        ("imu.x:dropped@5-", "no channel 'imu.x'"),
    ],
)  # fmt: skip
def test_impossible_fault_is_refused_in_one_line(text, words):
    with pytest.raises(ValueError, match=words) as refused:
        parse_fault(text)
    assert "\n" not in str(refused.value)


def test_share_is_5_percent_by_default():
    assert str(parse_fault("imu:dropped@20")) == "imu:dropped=0.05@20"


@pytest.mark.parametrize("jitter", [-0.1, 0.5, math.nan])
def test_impossible_jitter_is_refused(jitter):
    with pytest.raises(ValueError, match=r"BoardParams\.dt_jitter"):
        BoardParams(dt_jitter=jitter)
