"""MATLAB files: messages in labelled matrices, matrices without labels, structures, and what cannot be read."""

import numpy as np
import pytest
from scipy.io import savemat

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError

LABELS = {
    "IMU": ["LineNo", "TimeUS", "I", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"],
    "GPS": ["LineNo", "TimeUS", "Status", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ"],
    "MAG": ["LineNo", "TimeUS", "MagX", "MagY", "MagZ", "Health"],
    "ARSP": ["LineNo", "TimeUS", "Airspeed"],
    "BARO": ["LineNo", "TimeUS", "Alt"],
    "ATT": ["LineNo", "TimeUS", "Roll", "Pitch", "Yaw"],
}


def cells(labels):
    """A cell array of names, a column, as Mission Planner writes it."""
    return np.array([[label] for label in labels], dtype=object)


@pytest.fixture
def matrices(logged):
    """The flight `logged` as ArduPilot's messages: a second inertial unit that is off, a bad sample of the field."""
    from scipy.spatial.transform import Rotation

    n = len(logged.t_us)
    imu = np.column_stack((3.0 * np.arange(n), logged.t_us, np.zeros(n), logged.rate, logged.force))
    other = imu + np.array([1.0, 0.0, 1.0, *[0.3] * 6])
    north, east, down = logged.v_e.T
    course = np.degrees(np.arctan2(east, north)) % 360.0
    fix = (logged.fix_us, 3 + 0 * down, *logged.geodetic.T, np.hypot(north, east), course, down)
    lost = [0.0, logged.fix_us[-1] + 5e4, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    zeros = np.zeros(len(logged.field_us))
    return {
        "IMU": np.ravel(np.stack((imu, other), axis=1)).reshape(-1, 9),
        "GPS": np.vstack((np.column_stack((np.zeros(len(fix[0])), *fix)), lost)),
        "MAG": np.vstack(
            (
                np.column_stack((zeros, logged.field_us, 10.0 * logged.field, zeros + 1)),
                [0, logged.t_us[-1], 9, 9, 9, 0],
            )
        ),
        "ARSP": np.column_stack((np.zeros(len(logged.air_us)), logged.air_us, logged.airspeed)),
        "BARO": np.column_stack((np.zeros(len(logged.air_us)), logged.air_us, logged.height)),
        "ATT": np.column_stack(
            (np.arange(n), logged.t_us, Rotation.from_matrix(logged.R_eb).as_euler("ZYX", degrees=True)[:, ::-1])
        ),
    }


def as_cells(matrices):
    """As Mission Planner writes them."""
    labels = {f"{name}_label": cells(LABELS[name]) for name in matrices}
    parameters = np.array([["COMPASS_AUTODEC", 0.0], ["COMPASS_DEC", 0.2]], dtype=object)
    return matrices | labels | {"PARM": parameters, "Seen": cells(matrices), "MSG1": cells(["hello"])}


def as_characters(matrices):
    """Labels as rows of characters, with the line end that older versions leave behind the last."""
    return matrices | {f"{name}_label": np.array([*LABELS[name][:-1], f"{LABELS[name][-1]}\r\n"]) for name in matrices}


def as_structures(matrices):
    """As pymavlink's mavlogdump writes them."""
    return {name: dict(zip(LABELS[name], m.T, strict=True)) for name, m in matrices.items()} | {
        "PARM": {"Name": ["COMPASS_AUTODEC", "COMPASS_DEC"], "Value": [0.0, 0.2]}
    }


@pytest.mark.parametrize("form", [as_cells, as_characters, as_structures])
def test_messages_of_ardupilot_become_the_rows_of_the_flight(tmp_path, matrices, logged, demand_same_rows, form):
    """Each message at its own time, of the first of two units; milligauss, degrees; a lost fix ends the one before."""
    savemat(tmp_path / "log.mat", form(matrices))
    log = logs.read(tmp_path / "log.mat")
    expected = logged.expected()
    expected["gps_t_s"][expected["gps_valid"] > 0] = np.nan
    expected["gps_valid"][logged.t_us >= matrices["GPS"][-1, 1]] = 0
    demand_same_rows(log.rows, expected, {"gps_p_e_m": 1e-5})
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.R_eb, logged.R_eb, rtol=0, atol=1e-9)
    assert log.known["gps_stamped"].value is False
    if form is not as_characters:
        assert (log.known["declination_rad"].value, log.known["declination_rad"].origin) == (0.2, "COMPASS_DEC")
    assert all(entry.agrees for entry in log.ledger.values())
    assert log.ledger["gps"].left_out == {"no fix of three dimensions": 1}


def test_messages_of_the_clock_of_old_are_timed_by_it(tmp_path, logged):
    """Before 2014 GPS had the time of the week in TimeMS and the clock aboard in T; IMU the clock in TimeMS."""
    n = len(logged.t_us)
    t_ms = logged.t_us / 1e3
    imu = np.column_stack((t_ms, logged.rate, logged.force))
    north, east, _ = logged.v_e.T
    course = np.degrees(np.arctan2(east, north)) % 360.0
    k = len(north)
    gps = np.column_stack(
        (np.full(k, 3), 5e8 + logged.fix_us / 1e3, np.full(k, 1768), *logged.geodetic.T, np.hypot(north, east), course,
         logged.fix_us / 1e3)
    )  # fmt: skip
    content = {
        "IMU": imu, "IMU_label": cells(["TimeMS", *LABELS["IMU"][3:]]), "GPS": gps,
        "GPS_label": cells(["Status", "TimeMS", "Week", "Lat", "Lng", "Alt", "Spd", "GCrs", "T"]),
    }  # fmt: skip
    savemat(tmp_path / "log.mat", content)
    log = logs.read(tmp_path / "log.mat")
    assert len(log.rows) == n
    np.testing.assert_array_equal(log.rows["gps_new"], logged.expected()["gps_new"])


def columns_of(map_of):
    """The text of a map."""
    return "[columns]\n" + "\n".join(f'"{name}" = "{meaning}"' for name, meaning in map_of.items())


INERTIAL = ("gyro.x", "gyro.y", "gyro.z", "force.x", "force.y", "force.z")


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (lambda h: {"t": h.t_s, "gyro": h.rate, "acc": h.force}, None),
        (lambda h: {"t": h.t_s, "gyro": h.rate.T, "acc": h.force.T}, None),
        (lambda h: {"log": {"imu": {"time": h.t_s, "gyro": h.rate, "accel": h.force}}}, None),
        (lambda h: {"log": {"imu": {"time": h.t_s, "gyro": h.rate, "accel": h.force}}}, 'struct = "log.imu"'),
        (lambda h: {"a": {"t": h.t_s, **{n: h.rate[:, i] for i, n in enumerate("pqr")}, "acc": h.force}}, None),
        (lambda h: {"time": h.t_s, "w": np.degrees(h.rate), "f": h.force / 9.80665}, columns_of(
            {"time": "time", **{f"w[{i}]": f"gyro.{a} deg/s" for i, a in enumerate("xyz")},
             **{f"f[{i}]": f"force.{a} g" for i, a in enumerate("xyz")}})),
        (lambda h: {"data": np.column_stack((h.t_s, h.rate, h.force))}, columns_of(
            {f"data[{i}]": q for i, q in enumerate(("time", *INERTIAL))})),
        (lambda h: {"D": np.column_stack((1e3 * h.t_s, h.rate, h.force)),
                    "D_label": cells(["ms", *"abcdef"])}, columns_of(
            {"D.ms": "time ms", "D[1]": "gyro.x",
             **{f"D.{n}": q for n, q in zip("bcdef", INERTIAL[1:], strict=True)}})),
        (lambda h: {"t": np.round(1e6 * h.t_s).astype("i8"), "gyro": h.rate, "acc": h.force}, None),
    ],
)  # fmt: skip
def test_matrices_and_structures_are_read_by_names_or_a_map(tmp_path, held, content, text):
    """N x 3 or 3 x N, nested or at the top, labelled or by index, in any type of number."""
    savemat(tmp_path / "log.mat", content(held))
    if text is not None:
        (tmp_path / "own.toml").write_text(text)
    log = logs.read(tmp_path / "log.mat", columns=None if text is None else str(tmp_path / "own.toml"))
    np.testing.assert_allclose(log.rows["t_s"], held.t_s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], held.rate, rtol=0, atol=1e-14)
    np.testing.assert_allclose(log.rows["force_b_m_s2"], held.force, rtol=0, atol=1e-13)


@pytest.mark.parametrize("nested", [True, False])
def test_columns_of_another_length_have_a_clock_of_their_own(tmp_path, held, nested):
    """5 Hz fixes and a 2 Hz field between the inertial samples: each arrives in the first row that ends after it."""
    fix_s, field_s = np.arange(0.513, 10.0, 0.2), np.arange(0.257, 10.0, 0.5)
    field = np.tile([20.0, 0.0, 40.0], (len(field_s), 1))
    if nested:
        content = {
            "imu": {"time": held.t_s, "gyro": held.rate, "acc": held.force},
            "gps": {"time": fix_s, "vn": fix_s, "ve": -fix_s},
            "mag": {"time": field_s, "mag": field},
        }
    else:
        content = {"t": held.t_s, "gyro": held.rate, "acc": held.force, "gps_time": fix_s, "vn": fix_s, "ve": -fix_s}
    savemat(tmp_path / "log.mat", content)
    rows = logs.read(tmp_path / "log.mat").rows
    expected = np.ceil(fix_s / 0.02 - 1e-9).astype(int) - 1
    np.testing.assert_array_equal(np.flatnonzero(rows["gps_new"]), expected)
    np.testing.assert_allclose(rows["gps_v_e_m_s"][expected, 0], fix_s, rtol=0, atol=1e-12)
    if nested:
        np.testing.assert_array_equal(np.flatnonzero(rows["mag_new"]), np.ceil(field_s / 0.02 - 1e-9).astype(int) - 1)


def test_accelerometer_with_times_of_its_own_is_interpolated(tmp_path, held):
    """Samples 5 ms off: linear interpolation of a force that turns by less than 1.3 rad/s, 0.02 s apart, is within
    its curvature, g (1.3 rad/s)^2 (0.02 s)^2 / 8 < 1e-3 m/s^2, and what the turn is not uniform."""
    content = {
        "gyr": {"time": held.t_s, "gyr": held.rate},
        "acc": {"time": held.t_s[:-1] + 0.005, "acc": 0.75 * held.force[:-1] + 0.25 * held.force[1:]},
    }
    savemat(tmp_path / "log.mat", content)
    rows = logs.read(tmp_path / "log.mat").rows
    np.testing.assert_allclose(rows["t_s"], held.t_s[1:-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows["force_b_m_s2"], held.force[1:-1], rtol=0, atol=2e-3)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 80, r"version 7\.3 \(HDF5\): save it again.*'-v7'"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), r"version 7\.3 \(HDF5\): save it again.*'-v7'"),
        ({"a": "words"}, r"no column of numbers; it has a \(str\)"),
        ({"data": np.ones((9, 7))}, r'no column name is recognised; it has data\[0\] to \[6\].*as "name\[0\]"'),
        ({"t": np.arange(9.0), "gyro": np.ones((9, 3))},
         r"no column for force\.x, .*; it has t, gyro\[0\] to \[2\]: name"),
        ({"t": np.arange(9.0), "g1": {"gyro": np.ones((9, 3))}, "g2": {"gyro": np.ones((9, 3))}},
         r"gyro\.x may be g1\.gyro\[0\] or g2\.gyro\[0\]"),
    ],
)  # fmt: skip
def test_file_that_cannot_be_read_names_a_remedy(tmp_path, content, said):
    """One line; what has no column that is understood lists them as a map would name them."""
    path = tmp_path / "log.mat"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        savemat(path, content)
    with pytest.raises(LogError, match=said) as error:
        logs.read(path)
    assert "\n" not in str(error.value)


def test_object_of_matlab_is_refused_with_what_to_save(tmp_path, monkeypatch):
    """A table is an object that SciPy hands over unread."""
    from scipy.io.matlab import MatlabOpaque

    from scenarios.harness.logs import matlab

    opaque = MatlabOpaque(np.zeros(1, dtype=[("s0", "O"), ("arr", "O")]))
    monkeypatch.setattr(matlab.sandbox, "call", lambda *_args, **_options: {"T": opaque})
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0")
    with pytest.raises(LogError, match=r"T holds MATLAB objects.*table2struct\(T, 'ToScalar', true\)"):
        logs.read(tmp_path / "log.mat")


def test_columns_without_a_clock_are_refused(tmp_path, held):
    """Twelve numbers cannot be placed among five hundred rows."""
    content = {"t": held.t_s, "gyro": held.rate, "acc": held.force, "gps": {"vn": np.ones(12), "ve": np.ones(12)}}
    savemat(tmp_path / "log.mat", content)
    with pytest.raises(LogError, match=r"gps \(12 rows: gps\.vn, gps\.ve\) has no time: name a column"):
        logs.read(tmp_path / "log.mat")


def test_second_unit_of_the_messages_is_chosen(tmp_path, matrices, logged):
    """As of the autopilot's own logs; columns that are no messages have no second unit."""
    savemat(tmp_path / "log.mat", as_cells(matrices))
    rows = logs.read(tmp_path / "log.mat", imu=1).rows
    np.testing.assert_allclose(rows["gyro_b_rad_s"], logged.rate + 0.3, rtol=0, atol=1e-12)
    savemat(tmp_path / "plain.mat", {"t": logged.t_us / 1e6, "gyro": logged.rate, "acc": logged.force})
    with pytest.raises(LogError, match="chooses an inertial unit of an autopilot"):
        logs.read(tmp_path / "plain.mat", imu=1)
