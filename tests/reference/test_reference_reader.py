"""Reference vectors are read row for row: units, held columns, and files that do not belong together."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.logs import reference
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.replay import replay

DATA = Path(__file__).parent / "data"
SETS = {"A50": ("ap_ahrs_dcm", 50), "C50": ("ap_ahrs_dcm", 50), "C40": ("matrixpilot", 40)}


@pytest.mark.parametrize("name", SETS)
def test_input_is_read_with_the_truth_beside_it(name):
    """Level at rest north of east at the start, every row timed, GPS at 5 or 4 Hz, a rotation for each row."""
    folder, imu_hz = SETS[name]
    log = reference.read(DATA / folder / f"{name}_in.csv.gz")
    np.testing.assert_allclose(np.diff(log.rows["t_s"]), 1.0 / imu_hz, rtol=0, atol=1e-9)
    assert log.rows["gps_new"].mean() == pytest.approx(0.1, rel=0, abs=1e-3)
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    assert log.reference is not None
    assert log.reference.kind == "truth"
    np.testing.assert_allclose(log.reference.R_eb[0], [[0.8660254, -0.5, 0], [0.5, 0.8660254, 0], [0, 0, 1]], atol=1e-7)
    # 500 counts of field, 63 degrees down: the horizontal part points north by east 10 degrees of declination.
    field_e_ut = log.reference.R_eb[0] @ log.rows["mag_b_ut"][0]
    assert np.hypot(*field_e_ut[:2]) == pytest.approx(50.0 * np.cos(np.radians(63.0)), rel=0.02)


def test_columns_between_two_samples_hold_the_last():
    """GPS and magnetometer columns hold what arrived last, and nothing where nothing has arrived."""
    rows = reference.read(DATA / "ap_ahrs_dcm" / "C50_in.csv.gz").rows
    for new, column in (("gps_new", "gps_v_e_m_s"), ("mag_new", "mag_b_ut")):
        changed = np.flatnonzero(np.any(np.diff(rows[column], axis=0) != 0.0, axis=1)) + 1
        assert np.all(rows[new][changed] == 1)
    bench = reference.read(DATA / "ap_ahrs_dcm" / "E100_in.csv.gz")
    assert bench.sensors == ("gyro", "accelerometer", "magnetometer")
    assert not bench.rows["gps_valid"].any()


def test_output_of_the_firmware_can_be_the_reference():
    """A file of the same set is compared with as the firmware's; one of another set is refused in one line."""
    folder = DATA / "ap_ahrs_dcm"
    log = reference.read(folder / "A50_in.csv.gz", folder / "A50_ap2013_gps.csv.gz")
    assert log.reference is not None
    assert (log.reference.kind, log.reference.name) == ("firmware", "A50_ap2013_gps")
    with pytest.raises(LogError, match=r"E100_truth\.csv\.gz: 5563 rows at other times than the 6500 of A50_in"):
        reference.read(folder / "A50_in.csv.gz", folder / "E100_truth.csv.gz")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,dt\n1,2\n", "no column gx, gy, gz"),
        (",".join(reference.INPUT) + "\n" + "1," * 20 + "x\n", "line 2, column gps_d: 'x' is not a number"),
        (",".join(reference.INPUT) + "\n1,2\n", "line 2: 2 cells; the header has 21"),
        (",".join(reference.INPUT) + "\n", "no row of numbers"),
    ],
)
def test_broken_input_is_refused_with_its_row_and_column(tmp_path, text, said):
    """One line that names the file and what is wrong in it."""
    path = tmp_path / "B_in.csv.gz"
    path.write_bytes(gzip.compress(text.encode()))
    with pytest.raises(LogError, match=said) as error:
        reference.read(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_truncated_file_is_refused(tmp_path):
    """A file cut off in the middle is no shorter log."""
    path = tmp_path / "B_in.csv.gz"
    path.write_bytes((DATA / "ap_ahrs_dcm" / "A50_in.csv.gz").read_bytes()[:5000])
    with pytest.raises(ValueError, match="cannot be read"):
        reference.read(path)


@pytest.mark.parametrize(
    ("estimator", "path", "output", "rms_deg", "max_deg"),
    [
        ("ap_dcm", "ap_ahrs_dcm/E100", "ap2013_mag_nogps_copter", 0.01, 0.05),
        ("ap_dcm", "ap_ahrs_dcm/A50", "ap2013_mag", 0.05, 0.15),
        ("ap_dcm_2013", "ap_ahrs_dcm/C50", "ap2013_gps", 0.2, 0.4),
        ("matrixpilot", "matrixpilot/C40", "mp_gpscent", 2.0, 6.0),
    ],
)
def test_replay_against_firmware_is_set_as_that_firmware(estimator, path, output, rms_deg, max_deg):
    """Named on the command line without any setting, an estimator follows the output of its original."""
    log = reference.read(DATA / f"{path}_in.csv.gz", DATA / f"{path}_{output}.csv.gz")
    score = replay(log, estimator).to_json()
    assert score["rotation_rms_deg"] <= rms_deg
    assert score["rotation_max_deg"] <= max_deg


def test_log_knows_its_receiver_and_how_the_original_was_set():
    """By the names of the files; the input is rounded as the original of 2013 got it, and for that alone."""
    folder = DATA / "ap_ahrs_dcm"
    truth = reference.read(folder / "C50_in.csv.gz")
    of_set = {"declination_rad": np.radians(10.0), "gps_filter_s": 0.0, "gps_latency_s": 0.4}
    measured = {"imu_rate_hz": 50.0, "gps_rate_hz": 5.0, "gps_stamped": False, "gps_vertical_velocity": True}
    assert {name: known.value for name, known in truth.known.items()} == of_set | measured
    original = reference.read(folder / "C50_in.csv.gz", folder / "C50_ap2013_gps.csv.gz")
    as_set = {"quirks": "JULY_2013", "use_magnetometer": False}
    assert {name: known.value for name, known in original.known.items()} == of_set | measured | as_set
    cm_s = 100.0 * original.rows["gps_v_e_m_s"]
    np.testing.assert_allclose(cm_s, np.rint(cm_s), rtol=0, atol=1e-9)
    assert not np.allclose(100.0 * truth.rows["gps_v_e_m_s"], np.rint(cm_s), rtol=0, atol=0.1)
    assert np.abs(original.rows["mag_b_ut"] - truth.rows["mag_b_ut"]).max() <= 0.5 * reference.COUNT_UT + 1e-9
