"""Logs that come as rows, our own recordings among them: put in order without losing what arrived, and judged."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.interface import MEASURED_DTYPE
from scenarios.harness import logs
from scenarios.harness.logs.checks import mended, rate_factor
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from sim import recording
from sim.log import Flight, Log, Outcome

HERE = Path("log.bin")
DATA = Path(__file__).parents[1] / "reference" / "data"
N = 400


@pytest.fixture
def log():
    """Eight seconds level at rest at 50 Hz with a fix every half second, and a reference."""
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, N + 1), 0.02
    rows["gyro_b_rad_s"] = 0.001
    rows["force_b_m_s2"] = [0.0, 0.0, -9.81]
    rows["gps_new"][24::25] = 1
    rows["gps_valid"][24:] = 1
    rows["gps_v_e_m_s"][:, 0] = np.arange(N) // 25
    return RecordedLog(
        rows, "log", ("gyro", "accelerometer", "gps"), Reference(np.tile(np.eye(3), (N, 1, 1)), "truth", "t")
    )


def test_good_log_is_left_as_it_is(log):
    """Nothing is repaired where nothing is wrong; the rows become read-only, as in the loop."""
    found = mended(log, HERE)
    assert found.rows.tobytes() == log.rows.tobytes()
    assert found.repairs == ()
    assert not found.rows.flags.writeable


def test_fix_of_a_row_left_out_arrives_with_the_next(log):
    """A broken inertial sample does not cost the GPS report that came with it; the reference stays in step."""
    log.rows["gyro_b_rad_s"][49, 1] = np.nan
    log.rows["force_b_m_s2"][50, 2] = np.inf
    log.reference.R_eb[51] = np.diag([1.0, -1.0, -1.0])
    found = mended(log, HERE)
    assert len(found.rows) == N - 2
    assert np.flatnonzero(found.rows["gps_new"])[:3].tolist() == [24, 49, 72]
    assert found.rows["gps_new"].sum() == log.rows["gps_new"].sum()
    np.testing.assert_array_equal(found.reference.R_eb[49], np.diag([1.0, -1.0, -1.0]))
    assert found.repairs[:2] == (
        "column gyro.y: 1 without a number left out, first row 50",
        "column force.z: 1 without a number left out, first row 51",
    )


def test_fix_without_a_number_did_not_arrive(log):
    """It is counted, with the time of the first."""
    log.rows["gps_v_e_m_s"][74, 2] = np.nan
    found = mended(log, HERE)
    assert not found.rows["gps_new"][74]
    assert found.repairs == ("1 GPS fixes without a number left out, first at 1.50 s",)


def test_rows_of_zeros_before_the_first_reading_are_left_out(log):
    """A logger that starts before its sensors records nothing, and that is no free fall."""
    log.rows["gyro_b_rad_s"][:3] = log.rows["force_b_m_s2"][:3] = 0.0
    found = mended(log, HERE)
    assert len(found.rows) == N - 3
    assert found.repairs == ("3 rows of zeros before the first reading left out, first row 1",)


def test_times_in_disorder_are_sorted_with_what_they_carry(log):
    """Rows in the order of their times, each with its own reference."""
    order = np.arange(N)
    order[100:103] = [102, 100, 101]
    shuffled = replace(log, rows=log.rows[order], reference=replace(log.reference, R_eb=np.tile(np.eye(3), (N, 1, 1))))
    shuffled.reference.R_eb[100] = np.diag([1.0, -1.0, -1.0])
    found = mended(shuffled, HERE)
    assert found.rows.tobytes() == log.rows.tobytes()
    assert found.reference.R_eb[102, 1, 1] == -1.0
    assert found.repairs == ("column time: 1 out of order, sorted; first row 102",)


def test_log_that_runs_back_step_by_step_is_refused(log):
    """Late is what is behind the latest row so far by more than a second, however small the steps back."""
    with pytest.raises(LogError, match=r"row 52, column time: runs back from 8 to 6\.98 s"):
        mended(replace(log, rows=log.rows[::-1], reference=None), HERE)


def test_field_that_is_not_the_earths_is_told_and_kept(log):
    """Its direction is what counts; the unit may be wrong."""
    log.rows["mag_new"], log.rows["mag_b_ut"] = 1, [0.2, 0.0, 0.4]
    found = mended(log, HERE)
    np.testing.assert_array_equal(found.rows["mag_b_ut"], log.rows["mag_b_ut"])
    assert found.repairs == ("column mag: 0.447 uT is not the earth's field; kept",)


def test_log_of_one_row_is_refused(log):
    """One sample has no interval."""
    with pytest.raises(LogError, match="a log of one row"):
        mended(replace(log, rows=log.rows[:1], reference=None), HERE)


@pytest.mark.parametrize("path", sorted(DATA.glob("*/*_in.csv.gz")), ids=lambda path: path.name)
@pytest.mark.parametrize("witness", ["reference", "magnetometer", "gyro alone"])
def test_unit_of_the_gyro_is_told_on_every_reference_flight(path, witness):
    """In rad/s it is left alone, whoever witnesses; in degrees it is found out; at a tenth or ten times neither."""
    log = logs.read(path)
    rows, reference = log.rows.copy(), log.reference if witness == "reference" else None
    if witness == "gyro alone":
        rows["mag_new"] = rows["gps_new"] = 0
    rate = rows["gyro_b_rad_s"].copy()
    for factor, expected in ((1.0, 1.0), (180.0 / np.pi, np.pi / 180.0), (0.1, 1.0)):
        rows["gyro_b_rad_s"] = factor * rate
        assert rate_factor(rows, reference) == pytest.approx(expected, rel=1e-15)


def test_gyro_at_rest_is_never_taken_for_degrees(log):
    """Noise and an offset of degrees a second turn nothing: there is no evidence, and nothing is done."""
    rng = np.random.default_rng(3)
    log.rows["gyro_b_rad_s"] = rng.normal(0.3, 0.8, (N, 3))
    log.rows["force_b_m_s2"] += rng.normal(0.0, 0.3, (N, 3))
    assert mended(log, HERE).repairs == ()


def test_recording_of_ours_comes_back_bit_for_bit(log, tmp_path):
    """Measured rows and the truth, from the folder or the Parquet file; anything else is refused in one line."""
    flown = Log.empty(N)
    flown.measured[:] = log.rows
    flown.truth["t_s"], flown.truth["R_eb"] = log.rows["t_s"], np.eye(3)
    flown.truth["R_eb"][7] = np.diag([-1.0, -1.0, 1.0])
    folder = recording.save(Flight(flown, 0.02, 0.0, Outcome.COMPLETED, "nose"), tmp_path / "flight")
    for path in (folder, folder / recording.PARQUET):
        found = logs.read(path)
        assert found.rows.tobytes() == log.rows.tobytes()
        assert (found.name, found.reference.kind, found.sensors) == ("flight", "truth", log.sensors)
        np.testing.assert_array_equal(found.reference.R_eb, flown.truth["R_eb"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="no recording at"):
        logs.read(tmp_path / "empty")
