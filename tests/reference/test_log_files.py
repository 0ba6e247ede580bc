"""Logs of ArduPilot and PX4 as others wrote them, against a reading of our own by pymavlink and pyulog.

The logs are not part of the project: they are looked for in the folder that WINGSLEVEL_DATA names, else in
``../shared/data`` beside the project.
"""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.replay import Window, replay

DATA = Path(os.environ.get("WINGSLEVEL_DATA") or Path(__file__).parents[3] / "shared" / "data")
DATAFLASH = [
    "arduplane_4_7/hand_launch_bias.bin", "arduplane_4_7/hand_launch_dcm.bin", "arduplane_4_7/hand_launch_ekf.bin",
    "arduplane_4_7/mission_apm2_airspeed.bin", "arduplane_4_7/mission_apm2_no_airspeed.bin", "logs/TestLog2.bin",
    "logs/backend_log_80k.bin",
]  # fmt: skip
ULOGS = ["logs/sample_log_small.ulg", "logs/sample_appended_multiple.ulg"]
EQUATOR_M, POLE_M = 6_378_137.0, 6_356_752.3142


def path_of(name):
    """Where the log is, or a reason to skip."""
    if not (DATA / name).is_file():
        pytest.skip(f"no {name} in {DATA}")
    return DATA / name


def messages(path, name):
    """All messages of that name by pymavlink, of the first instance: dictionaries with a time in seconds."""
    from pymavlink.DFReader import DFReader_binary

    with DFReader_binary(str(path), zero_time_base=True) as reader:
        found = [m.to_dict() for m in iter(lambda: reader.recv_match(type=name), None)]
    found = [m for m in found if m.get("I", 0) == 0]
    for m in found:
        m["t"] = m["TimeUS"] / 1e6 if "TimeUS" in m else m.get("T", m["TimeMS"]) / 1e3
    return found


def columns(found, *names):
    """Columns of messages, shape (n, m)."""
    return np.array([[m[name] for name in names] for m in found], float).reshape(len(found), len(names))


def rows_of(t_s, rows):
    """The row into which a message of each time belongs; its end is not before it."""
    return np.array([next((k for k in range(max(int(g) - 2, 0), len(rows)) if rows["t_s"][k] >= t), len(rows))
                     for t, g in zip(t_s, np.searchsorted(rows["t_s"], t_s), strict=True)], int)  # fmt: skip


def metres(latitude_deg, longitude_deg, of):
    """North and east of the place `of`, by the radii of curvature of the ellipsoid there."""
    s, c = math.sin(math.radians(of[0])), math.cos(math.radians(of[0]))
    w = math.hypot(EQUATOR_M * c, POLE_M * s)
    north_m, east_m = (EQUATOR_M * POLE_M) ** 2 / w**3, EQUATOR_M**2 / w
    return north_m * np.radians(latitude_deg - of[0]), east_m * c * np.radians(longitude_deg - of[1])


@pytest.mark.parametrize("name", DATAFLASH)
def test_dataflash_log_is_read_as_by_pymavlink(name):
    """Times, units, signs and counts of every stream."""
    path = path_of(name)
    log = logs.read(path)
    rows = log.rows
    imu = messages(path, "IMU")
    t_s = columns(imu, "t")[:, 0]
    np.testing.assert_allclose(rows["t_s"], t_s, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rows["gyro_b_rad_s"], columns(imu, "GyrX", "GyrY", "GyrZ"), rtol=0, atol=1e-9)
    np.testing.assert_allclose(rows["force_b_m_s2"], columns(imu, "AccX", "AccY", "AccZ"), rtol=0, atol=1e-9)
    for entry in log.ledger.values():
        assert entry.agrees
    check_fixes(log, messages(path, "GPS"))
    check_others(log, path)
    check_attitude(log, path)


def check_fixes(log, gps):
    """Position, velocity and arrival of each fix."""
    rows = log.rows
    fixes = [m for m in gps if m["Status"] >= 3]
    assert (log.ledger["gps"].read, log.ledger["gps"].used) == (len(gps), len(fixes))
    at = rows_of(columns(fixes, "t")[:, 0], rows)
    assert np.flatnonzero(rows["gps_new"]).tolist() == at.tolist()
    speed, course_deg, down = columns(fixes, "Spd", "GCrs", "VZ").T
    course = np.radians(course_deg)
    velocity = np.column_stack((speed * np.cos(course), speed * np.sin(course), down))
    np.testing.assert_allclose(rows["gps_v_e_m_s"][at], velocity, rtol=0, atol=1e-6)
    latitude, longitude, altitude = columns(fixes, "Lat", "Lng", "Alt").T
    north, east = metres(latitude, longitude, (latitude[0], longitude[0]))
    far = np.hypot(north, east)
    flat = 0.01 + far**2 / EQUATOR_M  # how far the tangent plane leaves the ellipsoid
    assert np.all(np.abs(rows["gps_p_e_m"][at, 0] - north) < flat)
    assert np.all(np.abs(rows["gps_p_e_m"][at, 1] - east) < flat)
    assert np.all(np.abs(rows["gps_p_e_m"][at, 2] + altitude - altitude[0]) < flat)
    assert np.isnan(rows["gps_t_s"][at]).all()


def check_others(log, path):
    """Magnetometer in microtesla from milligauss, airspeed and height."""
    rows = log.rows
    mag = messages(path, "MAG")
    inside = [m for m in mag if rows["t_s"][0] - rows["dt_s"][0] < m["t"] <= rows["t_s"][-1]]
    at = rows_of(columns(inside, "t")[:, 0], rows)
    assert np.flatnonzero(rows["mag_new"]).tolist() == at.tolist()
    field = 0.1 * columns(inside, "MagX", "MagY", "MagZ")
    np.testing.assert_allclose(rows["mag_b_ut"][at], field, rtol=0, atol=1e-5)  # its multiplier is a float of 24 bits
    arsp = messages(path, "ARSP")
    if arsp and "airspeed" in log.sensors:
        good = [m for m in arsp if m["H"] and m["U"]]
        at = rows_of(columns(good, "t")[:, 0], rows)
        assert np.flatnonzero(rows["air_new"]).tolist() == at.tolist()
        np.testing.assert_allclose(
            rows["equivalent_airspeed_m_s"][at], columns(good, "Airspeed")[:, 0], rtol=0, atol=1e-9
        )
    elif arsp:
        assert log.ledger["airspeed"].left_out == {"ARSPD_USE is 0": len(arsp)}
    baro = [m for m in messages(path, "BARO") if rows["t_s"][0] - rows["dt_s"][0] < m["t"] <= rows["t_s"][-1]]
    if baro:
        at = rows_of(columns(baro, "t")[:, 0], rows)
        np.testing.assert_allclose(rows["baro_height_m"][at], columns(baro, "Alt")[:, 0], rtol=0, atol=1e-9)


def check_attitude(log, path):
    """The simulator's quaternion, or the angles of ATT, where they are of the time of a row."""
    kind = "SIM" if messages(path, "SIM") else "ATT"
    found = messages(path, kind)
    R_eb = (
        Rotation.from_quat(columns(found, "Q2", "Q3", "Q4", "Q1"))
        if kind == "SIM"
        else Rotation.from_euler("ZYX", columns(found, "Yaw", "Pitch", "Roll"), degrees=True)
    ).as_matrix()
    same, of_row, of_message = np.intersect1d(log.rows["t_s"], columns(found, "t")[:, 0], return_indices=True)
    theirs = log.reference.R_eb[of_row]
    known = np.isfinite(theirs).all(axis=(1, 2))
    assert known.sum() > 0.9 * len(same) - 1
    np.testing.assert_allclose(theirs[known], R_eb[of_message][known], rtol=0, atol=1e-9)
    assert log.reference.kind == ("truth" if kind == "SIM" else "filter")


@pytest.mark.parametrize("name", ULOGS)
def test_ulog_is_read_as_by_pyulog(name):
    """Inertial samples, magnetic field and fixes by their own times."""
    from pyulog import ULog

    path = path_of(name)
    log, theirs = logs.read(path), {(d.name, d.multi_id): d.data for d in ULog(str(path)).data_list}
    rows, imu = log.rows, theirs["sensor_combined", 0]
    np.testing.assert_allclose(rows["t_s"], imu["timestamp"] / 1e6, rtol=0, atol=1e-9)
    for i in range(3):
        np.testing.assert_array_equal(rows["gyro_b_rad_s"][:, i], imu[f"gyro_rad[{i}]"])
        np.testing.assert_array_equal(rows["force_b_m_s2"][:, i], imu[f"accelerometer_m_s2[{i}]"])
    mag = theirs.get(("vehicle_magnetometer", 0), imu)
    t_us = mag["timestamp"].astype(int) + mag.get("magnetometer_timestamp_relative", 0)
    fresh = np.concatenate(([True], np.diff(t_us) != 0))
    last = np.searchsorted(t_us[fresh], np.round(1e6 * rows["t_s"]), side="right") - 1
    field = 100.0 * np.column_stack([mag[f"magnetometer_ga[{i}]"] for i in range(3)])[fresh]
    used = log.ledger["magnetometer"]
    assert used.read == fresh.sum()
    assert used.used >= 0.98 * fresh.sum()
    held = np.cumsum(rows["mag_new"]) > 0
    agree = np.all(np.abs(rows["mag_b_ut"][held] - field[last[held]]) < 1e-5, axis=1)
    assert agree.mean() > 0.98  # but in the gap, whose samples are left out
    for entry in log.ledger.values():
        assert entry.agrees
    gps = theirs.get(("vehicle_gps_position", 0))
    assert (gps is not None) == ("gps" in log.sensors)
    if gps is not None:
        new = np.flatnonzero(rows["gps_new"])
        north = np.array([gps["vel_n_m_s"][gps["timestamp"] <= round(1e6 * rows["t_s"][k])][-1] for k in new])
        np.testing.assert_array_equal(rows["gps_v_e_m_s"][new, 0], north)
        assert log.known["gps_stamped"].value is False  # its timestamp_sample does not exist


@pytest.mark.parametrize(
    ("name", "inclination_deg", "heading_deg"),
    [("mission_apm2_airspeed.bin", 1.8, 2.4), ("mission_apm2_no_airspeed.bin", 1.5, 2.2)],
)
def test_firmwares_own_filter_does_as_well_with_what_the_log_says(name, inclination_deg, heading_deg):
    """ap_dcm with the declination of the log: 1.72 / 2.25 and 1.37 / 2.00 degrees RMS; without it 14 of heading."""
    scores = replay(logs.read(path_of(f"arduplane_4_7/{name}")), "ap_dcm").scores
    assert scores["inclination_rms_deg"] <= inclination_deg
    assert scores["heading_rms_deg"] <= heading_deg


def test_magnetometer_of_2017_gives_the_heading():
    """peer_vqf from 2 s on: 0.03 degrees RMS; without the field in sensor_combined there is no heading at all."""
    pytest.importorskip("vqf")
    scores = replay(logs.read(path_of(ULOGS[1])), "peer_vqf", window=Window(settle_s=2.0)).scores
    assert scores["heading_rms_deg"] <= 0.33
