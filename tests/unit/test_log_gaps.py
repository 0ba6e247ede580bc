"""Samples that are missing against time stamps that jitter: one is a gap, the other is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.interface import MEASURED_DTYPE
from scenarios.harness.logs.checks import mended
from scenarios.harness.logs.gaps import missing
from scenarios.harness.logs.recorded import RecordedLog

DT_S = 0.02


def jittered(n, jitter_s, seed=0):
    """Times of a grid, each off by up to `jitter_s`."""
    return DT_S * np.arange(n) + np.random.default_rng(seed).uniform(-jitter_s, jitter_s, n)


def log_of(t_s):
    """A log at rest with these times, whose intervals nobody knows."""
    rows = np.zeros(len(t_s), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t_s, np.nan
    rows["force_b_m_s2"], rows["gyro_b_rad_s"] = [0.0, 0.0, -9.81], 1e-3
    return RecordedLog(rows, "log", ("gyro", "accelerometer"))


@pytest.mark.parametrize("seed", range(5))
def test_stamps_that_jitter_by_8_ms_at_50_hz_are_no_gaps(seed):
    """Every twelfth step is longer than 30 ms here, and each is made good by the steps around it."""
    t_s = jittered(4000, 0.008, seed)
    assert np.count_nonzero(np.diff(t_s) > 0.03) > 200
    assert not missing(t_s, np.full(4000, DT_S)).any()
    assert mended(log_of(t_s), Path("log.csv")).repairs == ()


def test_stamps_that_come_in_bunches_are_no_gaps():
    """A logger that writes every fourth tick: three samples 1 ms apart, then 57 ms."""
    t_s = np.repeat(0.08 * np.arange(500), 4) + np.tile(0.001 * np.arange(4), 500)
    assert not missing(t_s, np.full(2000, DT_S)).any()


@pytest.mark.parametrize("jitter_s", [0.0, 0.003])
def test_samples_lost_are_found_where_they_are(jitter_s):
    """Single ones, several together, and some near each other."""
    lost = np.array([200, 207, 500, 501, 502, 1200])
    t_s = np.delete(jittered(2000, jitter_s), lost)
    first_after = np.array([200, 206, 498, 1195])
    assert np.flatnonzero(missing(t_s, np.full(len(t_s), DT_S))).tolist() == first_after.tolist()


def test_samples_lost_are_counted_through_the_jitter():
    """As many as were taken out; after each the next step is 32 to 48 ms, and others are up to 28 ms."""
    lost = np.arange(100, 3900, 190)
    (line,) = mended(log_of(np.delete(jittered(4000, 0.004), lost)), Path("log.csv")).repairs
    assert line.startswith(f"{len(lost)} samples lost, covered by the next one; first at ")


def test_late_stamp_near_a_gap_is_no_second_one():
    """Three samples lost, and seven samples on one that is stamped 12 ms late and made good by the next."""
    t_s = DT_S * np.arange(403.0)
    t_s[210] += 0.012
    t_s = np.delete(t_s, [200, 201, 202])
    assert np.flatnonzero(missing(t_s, np.full(400, DT_S))).tolist() == [200]


def test_gap_longer_than_half_a_second_is_one_whatever_follows():
    """A stamp that is 0.6 s late and made good by the next ones is not believed."""
    t_s = DT_S * np.arange(400.0)
    t_s[200:] += 0.6
    assert np.flatnonzero(missing(t_s, np.full(400, DT_S))).tolist() == [200]
    found = mended(replace(log_of(t_s)), Path("log.csv"))
    assert found.repairs == ("1 gaps longer than 0.5 s, the longest 0.6 s until 4.60 s",)


def test_first_and_last_sample_are_no_gaps_without_a_long_step():
    """There is nothing before the first; a last one that is late counts, since nothing makes it good."""
    t_s = DT_S * np.arange(10.0)
    assert not missing(t_s, np.full(10, DT_S)).any()
    t_s[-1] += DT_S
    assert np.flatnonzero(missing(t_s, np.full(10, DT_S))).tolist() == [9]
