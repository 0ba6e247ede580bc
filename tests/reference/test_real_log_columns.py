"""Real logs in columns, against an independent reading of the same files.

They are not part of the project: TestLog2 (https://github.com/priseborough/InertialNav), an aerobatic flight of 2013
as MATLAB matrices and as DataFlash; sensor_data.csv (https://github.com/xioTechnologies/Fusion); thor75.mat
(University of Minnesota, https://github.com/AuraUAS/navigation).
"""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.replay import replay

FOLDER = os.environ.get("WINGSLEVEL_DATA", "")


def real(name):
    """The path of a log; skips where it is not there."""
    path = Path(FOLDER) / name
    if not FOLDER or not path.is_file():
        pytest.skip(f"no {name} in the folder that WINGSLEVEL_DATA names")
    return path


def labelled(content, name):
    """A matrix of Mission Planner's as a table."""
    return pd.DataFrame(content[name], columns=[str(np.squeeze(cell)) for cell in content[f"{name}_label"].ravel()])


@pytest.fixture(scope="module")
def aerobatic():
    """The path and the matrices of TestLog2.mat."""
    path = real("logs/TestLog2.mat")
    content = loadmat(path)
    return path, {name: labelled(content, name) for name in ("IMU", "GPS", "MAG", "ATT")}


def test_labelled_matrices_are_read_as_they_are(aerobatic):
    """Time, unit, sign and count of every stream; a GPS clock of its own, the time of the week, is passed over."""
    path, tables = aerobatic
    log = logs.read(path)
    imu, gps, mag = tables["IMU"], tables["GPS"], tables["MAG"]
    rows = log.rows
    assert len(rows) == len(imu) == log.ledger["imu"].read
    np.testing.assert_allclose(rows["t_s"], 1e-3 * imu["TimeMS"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(rows["gyro_b_rad_s"], imu[["GyrX", "GyrY", "GyrZ"]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows["force_b_m_s2"], imu[["AccX", "AccY", "AccZ"]], rtol=0, atol=1e-12)
    fixed = gps[gps["Status"] >= 3]
    at = np.searchsorted(imu["TimeMS"], fixed["T"])
    np.testing.assert_array_equal(np.flatnonzero(rows["gps_new"]), np.unique(at[at < len(rows)]))
    last = fixed[np.append(np.diff(at) > 0, True)]
    v = rows["gps_v_e_m_s"][np.unique(at[at < len(rows)])]
    course = np.radians(last["GCrs"])
    np.testing.assert_allclose(v[:, 0], last["Spd"] * np.cos(course), rtol=0, atol=1e-9)
    np.testing.assert_allclose(v[:, 2], last["VZ"], rtol=0, atol=1e-9)
    new = rows["mag_b_ut"][rows["mag_new"] > 0]
    assert len(new) == len(mag)
    np.testing.assert_allclose(new, 0.1 * mag[["MagX", "MagY", "MagZ"]], rtol=0, atol=1e-9)
    assert all(entry.agrees for entry in log.ledger.values())


@pytest.mark.parametrize(("estimator", "limit_deg"), [("ins_ekf", 6.0), ("gps_velocity", 4.0)])
def test_matrices_and_messages_of_one_flight_score_alike(aerobatic, estimator, limit_deg):
    """Against the attitude that the firmware flew on: 4.46 and 3.00 degrees of inclination, by either file."""
    matrices = replay(logs.read(aerobatic[0]), estimator).scores
    messages = replay(logs.read(real("logs/TestLog2.bin")), estimator).scores
    assert matrices["inclination_rms_deg"] <= limit_deg
    assert matrices["inclination_rms_deg"] == pytest.approx(messages["inclination_rms_deg"], rel=0, abs=0.1)


def test_matrices_can_be_addressed_by_a_map(aerobatic, tmp_path):
    """By label and by index, each matrix with its own time: the rows of the reader without a map."""
    text = ["[columns]", '"IMU.TimeMS" = "time ms"', '"GPS.T" = "time ms"', '"GPS.Status" = "gps.fix"']
    text += [f'"IMU.Gyr{a}" = "gyro.{a.lower()} rad/s"' for a in "XYZ"]
    text += [f'"IMU[{5 + i}]" = "force.{a} m/s^2"' for i, a in enumerate("xyz")]
    text += ['"GPS.Spd" = "gps.speed m/s"', '"GPS.GCrs" = "gps.course deg"', '"GPS.VZ" = "gps.vd m/s"']
    (tmp_path / "own.toml").write_text("\n".join(text))
    mapped = logs.read(aerobatic[0], columns=str(tmp_path / "own.toml")).rows
    plain = logs.read(aerobatic[0]).rows
    for name in ("t_s", "gyro_b_rad_s", "force_b_m_s2", "gps_new", "gps_v_e_m_s"):
        np.testing.assert_allclose(mapped[name], plain[name], rtol=0, atol=1e-9, err_msg=name)


def test_headers_with_units_are_read_with_the_axes_of_the_refusal():
    """Forward, left, up: refused, with a remedy; read with it, every number is that of pandas."""
    path = real("logs/sensor_data.csv")
    with pytest.raises(LogError, match="--columns forward-left-up"):
        logs.read(path)
    rows = logs.read(path, columns="forward-left-up").rows
    table = pd.read_csv(path)
    assert len(rows) == len(table)
    np.testing.assert_array_equal(rows["t_s"], table["Time (s)"])
    turn = np.array([1.0, -1.0, -1.0])
    for name, header, unit in (
        ("gyro_b_rad_s", "Gyroscope {} (deg/s)", np.pi / 180.0), ("force_b_m_s2", "Accelerometer {} (g)", 9.80665),
    ):  # fmt: skip
        expected = unit * turn * table[[header.format(a) for a in "XYZ"]].to_numpy()
        np.testing.assert_allclose(rows[name], expected, rtol=0, atol=1e-12, err_msg=name)
    field = table[[f"Magnetometer {a} (uT)" for a in "XYZ"]].to_numpy()
    new = np.append(True, np.any(np.diff(field, axis=0) != 0.0, axis=1))
    np.testing.assert_array_equal(rows["mag_new"] > 0, new)
    np.testing.assert_allclose(rows["mag_b_ut"][new], turn * field[new], rtol=0, atol=1e-12)


def test_structure_with_a_shipped_map_is_read_as_it_is():
    """Held fixes, gauss, and the axes of its magnetometer, against the vectors of the file."""
    path = real("thor75.mat")
    data = loadmat(path, squeeze_me=True, struct_as_record=False)["flight_data"]
    log = logs.read(path)
    at = np.searchsorted(data.time, log.rows["t_s"])
    np.testing.assert_array_equal(data.time[at], log.rows["t_s"])
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"][:, 1], data.q[at], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        log.rows["mag_b_ut"][-1], 100.0 * np.array([data.hx, -data.hy, -data.hz])[:, -1], atol=1e-9
    )
    velocity = np.stack((data.vn, data.ve, data.vd), axis=-1)
    fixes = np.flatnonzero(log.rows["gps_new"])
    np.testing.assert_allclose(log.rows["gps_v_e_m_s"][fixes], velocity[at[fixes]], rtol=0, atol=1e-12)
    reports = np.stack((data.vn, data.ve, data.vd, data.lat, data.lon, data.alt), axis=-1)
    assert len(fixes) == np.any(np.diff(reports, axis=0) != 0.0, axis=1).sum()
    assert all(entry.agrees for entry in log.ledger.values())
