"""ArduPilot's logs: what is read equals what was written, in its formats of 2013 and of today; damage is told."""

import json
import struct
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.cli.app import run
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.replay import Window, replay, why_none

HEADER = b"\xa3\x95"
PACKED = {  # character of a format -> as struct packs it, and what a value is multiplied by
    "b": ("b", 1), "B": ("B", 1), "h": ("h", 1), "H": ("H", 1), "i": ("i", 1), "I": ("I", 1), "Q": ("Q", 1),
    "f": ("f", 1), "d": ("d", 1), "n": ("4s", 1), "N": ("16s", 1), "Z": ("64s", 1),
    "c": ("h", 100), "C": ("H", 100), "e": ("i", 100), "L": ("i", 1e7),
}  # fmt: skip
TODAY = {  # name -> format, columns, units, multipliers
    "IMU": ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "s#EEEooo", "F-000000"),
    "GPS": ("QBBIHBcLLeffff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw",
            "s#-s-S-DUmnhnh", "F--C-0BGGB0000"),
    "MAG": ("QBhhhB", "TimeUS,I,MagX,MagY,MagZ,Health", "s#GGG-", "F-CCC-"),
    "ARSP": ("QBfffBB", "TimeUS,I,Airspeed,DiffPress,Temp,U,H", "s#nPO--", "F-00B--"),
    "BARO": ("QBfff", "TimeUS,I,Alt,Press,Temp", "s#mPO", "F-000"),
    "SIM": ("QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4", "sddhmDU----", "FBBB0GG----"),
    "ATT": ("QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", "sddddhh", "FBBBBBB"),
}  # fmt: skip
UNITS = {"-": "", "s": "s", "#": "instance", "E": "rad/s", "k": "deg/s", "o": "m/s/s", "n": "m/s", "m": "m",
         "G": "Gauss", "d": "deg", "h": "degheading", "D": "deglatitude", "U": "deglongitude", "P": "Pa"}  # fmt: skip
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "A": 1e-1, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}
# Floats of 24 bits: 1e-7 of 20 m/s^2, and of a course of 360 degrees; whole milligauss, centimetres, and 1e-7 degrees.
RESOLUTION = {
    "gyro_b_rad_s": 1e-7, "force_b_m_s2": 2e-6, "mag_b_ut": 0.051, "gps_speed_m_s": 4e-6, "gps_course_rad": 5e-7,
    "gps_v_e_m_s": 2e-5, "gps_p_e_m": 0.025, "equivalent_airspeed_m_s": 4e-6, "baro_height_m": 1e-5,
}  # fmt: skip
Message = tuple[int, str, tuple[Any, ...]]  # time, name, fields
ONE_READ = "only one of several instances is read: IMU 0 (of 0, 1); GPS 0 (of 0, 1)"


class Writer:
    """A minimal DataFlash logger; `told` writes UNIT, MULT and FMTU."""

    def __init__(self, formats: dict[str, tuple[str, str, str, str]], told: bool = True) -> None:
        own = {
            "FMT": ("BBnNZ", "Type,Length,Name,Format,Columns"), "UNIT": ("QbZ", "TimeUS,Id,Label"),
            "MULT": ("Qbd", "TimeUS,Id,Mult"), "FMTU": ("QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        }  # fmt: skip
        self.codes = {name: entry[0] for name, entry in (own | formats).items()}
        self.types = {name: 128 + i for i, name in enumerate(self.codes)}
        self.raw = b""
        for name, (codes, columns, *_) in (own | formats).items():
            size = 3 + sum(struct.calcsize("<" + PACKED[c][0]) for c in codes)
            self.write("FMT", self.types[name], size, name.encode(), codes.encode(), columns.encode())
        for unit, label in UNITS.items() if told else ():
            self.write("UNIT", 0, ord(unit), label.encode())
        for mult, factor in MULTIPLIERS.items() if told else ():
            self.write("MULT", 0, ord(mult), factor)
        for name, (_, _, units, mults) in formats.items() if told else ():
            self.write("FMTU", 0, self.types[name], units.encode(), mults.encode())

    def packed(self, name: str, *values: Any) -> bytes:
        """One record."""
        body = b""
        for code, value in zip(self.codes[name], values, strict=True):
            kind, factor = PACKED[code]
            scaled = value * factor if factor != 1 else value
            body += struct.pack("<" + kind, round(scaled) if kind in "bBhHiIQ" else scaled)
        return HEADER + bytes([self.types[name]]) + body

    def write(self, name: str, *values: Any) -> None:
        self.raw += self.packed(name, *values)

    def log(self, messages: Iterable[Message]) -> list[bytes]:
        """The definitions, then the records in order of time."""
        return [self.raw, *(self.packed(name, *values) for _, name, values in sorted(messages, key=lambda m: m[0]))]


def messages(flight: Any, without: str = "") -> list[Message]:
    """The flight as ArduPilot logs it today."""
    quaternion = Rotation.from_matrix(flight.R_eb).as_quat()[:, [3, 0, 1, 2]]
    angles = np.degrees(Rotation.from_matrix(flight.R_eb).as_euler("ZYX"))
    told: list[Message] = []
    for k, t in enumerate(flight.t_us):
        told.append((t, "IMU", (t, 0, *flight.rate[k], *flight.force[k])))
        told.append((t, "IMU", (t, 1, *(2.0 * flight.rate[k]), *flight.force[k])))
        yaw, pitch, roll = angles[k]
        told.append((t, "SIM", (t, roll, pitch, yaw % 360.0, 0.0, 47.0, 8.0, *quaternion[k])))
        told.append((t, "ATT", (t, 0.0, roll + 1.0, 0.0, pitch, 0.0, yaw % 360.0)))
    for i, t in enumerate(flight.fix_us):
        n, e, d = flight.v_e[i]
        course = np.degrees(np.arctan2(e, n)) % 360.0
        fix = (t, 0, 3, 0, 2200, 12, 0.8, *flight.geodetic[i], np.hypot(n, e), course, d, 0.0)
        told.append((t, "GPS", fix))
        told.append((t + 1, "GPS", (t + 1, 1, *fix[2:10], 0.0, 0.0, 0.0, 0.0)))  # a second receiver
    told += [(t, "MAG", (t, 0, *(10.0 * b), 1)) for t, b in zip(flight.field_us, flight.field, strict=True)]
    for t, v, h in zip(flight.air_us, flight.airspeed, flight.height, strict=True):
        told += [(t, "ARSP", (t, 0, v, 0.0, 0.0, 1, 1)), (t, "BARO", (t, 0, h, 0.0, 0.0))]
    return [message for message in told if message[1] not in without.split()]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., logs.RecordedLog]:
    """Writes records to a log and reads it."""

    def _write(records: list[bytes], name: str = "flight.BIN", **options: Any) -> logs.RecordedLog:
        path = tmp_path / name
        path.write_bytes(b"".join(records))
        return logs.read(path, **options)

    return _write


def test_log_is_read_as_it_was_written(logged, demand_same_rows, write):
    """Every column to the resolution of its format, every arrival in its tick, the simulator's attitude as truth."""
    log = write(Writer(TODAY).log(messages(logged)))
    demand_same_rows(log.rows, logged.expected(stamped=False), RESOLUTION)
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    assert (log.repairs, log.notes) == ((), (ONE_READ,))
    assert log.place == pytest.approx((47.4, 8.5), rel=0, abs=1e-7)
    assert log.reference is not None
    assert (log.reference.kind, log.reference.name) == ("truth", "SIM in flight.BIN")
    np.testing.assert_allclose(log.reference.R_eb, logged.R_eb, rtol=0, atol=3e-7)  # a quaternion of floats


def test_log_written_here_is_one_to_pymavlink(logged, tmp_path):
    """The reader that everybody uses finds the same numbers and units in what the tests write."""
    from pymavlink.DFReader import DFReader_binary

    (tmp_path / "log.bin").write_bytes(b"".join(Writer(TODAY).log(messages(logged))))
    with DFReader_binary(str(tmp_path / "log.bin"), zero_time_base=True) as reader:
        fixes = [m for m in iter(lambda: reader.recv_match(type="GPS"), None) if m.I == 0]
        assert [m.TimeUS for m in fixes] == logged.fix_us.tolist()
        found = np.array([(m.Lat, m.Lng, m.Alt) for m in fixes])
        np.testing.assert_allclose(found[:, :2], logged.geodetic[:, :2], rtol=0, atol=5.1e-8)
        np.testing.assert_allclose(found[:, 2], logged.geodetic[:, 2], rtol=0, atol=5.1e-3)
        assert [fixes[0].fmt.get_unit(c) for c in ("Lat", "GCrs", "Spd")] == ["deglatitude", "degheading", "m/s"]


def test_log_of_2013_is_read_as_it_was_written(logged, demand_same_rows, write):
    """Milliseconds, no units, no instances, GPS time beside the time aboard, angles in hundredths of a degree."""
    formats = {
        "IMU": ("Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "", ""),
        "IMU2": ("Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "", ""),
        "GPS": (
            "BIHBcLLeeCCfI",
            "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T",
            "",
            "",
        ),
        "MAG": ("Ihhh", "TimeMS,MagX,MagY,MagZ", "", ""),
        "ATT": ("IccccCC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", "", ""),
    }
    told: list[Message] = []
    for t, name, v in messages(logged, without="SIM ARSP BARO"):
        if name == "IMU":
            told.append((t, "IMU2" if v[1] else "IMU", (t / 1e3, *v[2:])))
        elif name == "GPS" and v[1] == 0:
            told.append((t, "GPS", (3, 345_000_000, 1750, 9, 1.2, *v[7:9], 0.0, v[9], *v[10:13], t / 1e3)))
        elif name == "MAG":
            told.append((t, "MAG", (t / 1e3, *v[2:5])))
        elif name == "ATT":
            told.append((t, "ATT", (t / 1e3, v[1], v[2] - 1.0, *v[3:])))
    log = write(Writer(formats, told=False).log(told))
    expected = logged.expected(stamped=False)
    for missing, nothing in (("air_new", 0), ("equivalent_airspeed_m_s", 0.0), ("baro_height_m", np.nan)):
        expected[missing] = nothing
    # Speed in whole cm/s, course in hundredths of a degree of 30 m/s.
    coarse = {"gps_speed_m_s": 0.0051, "gps_course_rad": 1e-4, "gps_v_e_m_s": 0.008}
    demand_same_rows(log.rows, expected, RESOLUTION | coarse)
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer")
    assert log.reference is not None
    assert (log.reference.kind, log.reference.name) == ("filter", "ATT in flight.BIN")
    np.testing.assert_allclose(log.reference.R_eb, logged.R_eb, rtol=0, atol=1.6e-4)  # 0.005 degrees of each angle


def test_units_are_those_that_the_log_tells(logged, demand_same_rows, write):
    """A gyro in degrees, a field in gauss and a speed in decimetres a second, by UNIT, MULT and FMTU."""
    formats = TODAY | {
        "IMU": (*TODAY["IMU"][:2], "s#kkkooo", "F-000000"),
        "MAG": ("QBfffB", TODAY["MAG"][1], "s#GGG-", "F-000-"),
        "ARSP": (*TODAY["ARSP"][:2], "s#nPO--", "F-A0B--"),
    }
    told: list[Message] = []
    for t, name, v in messages(logged):
        scale = {"IMU": np.repeat([1.0, np.degrees(1.0), 1.0], [2, 3, 3]), "ARSP": [1, 1, 10, 1, 1, 1, 1]}.get(name)
        scale = [1.0, 1.0, 1e-3, 1e-3, 1e-3, 1.0] if name == "MAG" else scale
        scaled = v if scale is None else (*v[:2], *(a * b for a, b in zip(v[2:], scale[2:], strict=True)))
        told.append((t, name, scaled))
    log = write(Writer(formats).log(told))
    demand_same_rows(log.rows, logged.expected(stamped=False), RESOLUTION | {"mag_b_ut": 5e-6})
    assert (log.repairs, log.notes) == ((), (ONE_READ,))


def test_inertial_unit_is_chosen_by_its_number(logged, write):
    """The second one turns twice as fast here; a third there is not."""
    records = Writer(TODAY).log(messages(logged, without="SIM ATT"))
    rows = write(records, imu=1).rows
    np.testing.assert_allclose(rows["gyro_b_rad_s"], 2.0 * logged.rate, rtol=0, atol=2e-7)
    with pytest.raises(LogError, match=r"flight\.BIN: no inertial unit 2; IMU has 0 and 1$"):
        write(records, imu=2)


def test_gyro_and_accelerometer_of_their_own_meet_at_the_times_of_the_gyro(logged, write):
    """Logs of raw samples: the force between two samples 3 ms off lies on the line between them."""
    columns = "TimeUS,I,SampleUS,{0}X,{0}Y,{0}Z"
    formats = {
        "GYR": ("QBQfff", columns.format("Gyr"), "s#sEEE", "F-F000"),
        "ACC": ("QBQfff", columns.format("Acc"), "s#sooo", "F-F000"),
    }
    ramp = np.array([0.3, -0.2, -9.8]) + np.outer(logged.t_us - logged.t_us[0], [1e-8, 2e-8, 3e-8])
    told: list[Message] = []
    for t, w, f in zip(logged.t_us, logged.rate, ramp, strict=True):
        told += [(t, "GYR", (t + 900, 0, t, *w)), (t, "ACC", (t + 900, 0, t - 3000, *f))]
    log = write(Writer(formats).log(told))
    ahead = 3000 * np.array([1e-8, 2e-8, 3e-8])
    np.testing.assert_allclose(log.rows["t_s"], logged.t_us[:-1] / 1e6, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate[:-1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(log.rows["force_b_m_s2"], ramp[:-1] + ahead, rtol=0, atol=2e-6)
    assert log.repairs == ("column AccX (force.x): 1 without a number left out, first GYR 1000",
                           "column AccY (force.y): 1 without a number left out, first GYR 1000",
                           "column AccZ (force.z): 1 without a number left out, first GYR 1000")  # fmt: skip
    assert log.sensors == ("gyro", "accelerometer")


def test_fix_of_less_than_three_dimensions_and_sick_sensors_are_not_used(logged, write):
    """GPS.Status below 3, MAG.Health and ARSP.H of 0."""
    sick = {"GPS": 2, "MAG": 5, "ARSP": 6}
    told = []
    for t, name, v in messages(logged):
        if name in sick and t < logged.t_us[500]:
            v = (*v[: sick[name]], 2 if name == "GPS" else 0, *v[sick[name] + 1 :])
        told.append((t, name, v))
    rows = write(Writer(TODAY).log(told)).rows
    expected = logged.expected(stamped=False)
    for new in ("gps_new", "mag_new", "air_new"):
        assert np.flatnonzero(rows[new]).tolist() == [k for k in np.flatnonzero(expected[new]) if k > 500]
    assert not rows["gps_valid"][:500].any()


def test_attitude_that_had_not_started_is_no_reference(logged, write):
    """ATT where there is no SIM; all three angles zero until the filter runs."""
    told = [
        (t, name, (v[0], *(0.0,) * 6) if name == "ATT" and t < logged.t_us[100] else v)
        for t, name, v in messages(logged, without="SIM")
    ]
    reference = write(Writer(TODAY).log(told)).reference
    assert reference is not None
    assert reference.name == "ATT in flight.BIN"
    assert np.flatnonzero(reference.known).tolist() == list(range(100, 1000))


def test_bytes_that_are_no_record_are_left_out_and_counted(logged, demand_same_rows, write):
    """Garbage between records, one of a type that nobody defined, and a last record that was cut off.

    The record before the garbage may have lost its end, and goes too; a reader that gives up at an unknown type would
    lose everything behind it.
    """
    records = Writer(TODAY).log(messages(logged))
    last = max(k for k, record in enumerate(records) if len(record) == 36)  # an IMU record
    lost = [len(records[300]), 57, 3]
    damaged = [
        *records[:301],
        b"\x00" * 57,
        *records[301:601],
        HEADER + b"\xf0",
        *records[601:last],
        records[last][:20],
    ]
    log = write(damaged)
    first = sum(map(len, records[:300]))
    assert log.repairs[0] == f"{sum(lost)} bytes outside complete records left out, first at byte {first}"
    assert log.repairs[1] == "20 bytes at the end are not a complete record: left out"
    assert len(log.rows) >= 998
    known = np.isin(logged.t_us / 1e6, log.rows["t_s"])
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate[known], rtol=0, atol=1e-7)


def test_damaged_times_are_left_out_and_late_ones_sorted(logged, demand_same_rows, write):
    """One clock reading with a flipped bit, two records exchanged, one written twice, one without a number."""
    told = messages(logged)
    index = [k for k, m in enumerate(told) if m[1] == "IMU" and m[2][1] == 0]
    flipped = index[200]
    t, name, v = told[flipped]
    told[flipped] = (t, name, (v[0] ^ (1 << 40), *v[1:]))
    told[index[300]], told[index[301]] = (
        (told[index[300]][0], "IMU", told[index[301]][2]), (told[index[301]][0], "IMU", told[index[300]][2])
    )  # fmt: skip
    told.append(told[index[400]])
    told[index[500]] = (told[index[500]][0], "IMU", (*told[index[500]][2][:4], np.nan, *told[index[500]][2][5:]))
    log = write(Writer(TODAY).log(told))
    assert log.repairs[:4] == (
        "IMU: 1 at a time far from its neighbours left out, first 201",
        "column GyrZ (gyro.z): 1 without a number left out, first IMU 502",
        "column IMU time (time): 1 out of order, sorted; first IMU 302",
        "column IMU time (time): 1 repeated, left out; first IMU 402",
    )
    assert len(log.rows) == 998
    remaining = np.delete(np.arange(1000), [200, 500])
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate[remaining], rtol=0, atol=1e-7)


def test_messages_that_were_logged_late_arrive_in_order(logged, demand_same_rows, write):
    """Fixes written in another order than they came in are sorted, and counted."""
    told = messages(logged)
    fixes = [k for k, m in enumerate(told) if m[1] == "GPS" and m[2][1] == 0]
    a, b = fixes[10], fixes[11]
    told[a], told[b] = (told[a][0], "GPS", told[b][2]), (told[b][0], "GPS", told[a][2])
    log = write(Writer(TODAY).log(told))
    demand_same_rows(log.rows, logged.expected(stamped=False), RESOLUTION)
    assert log.repairs == ("GPS: 1 out of order, sorted",)


def test_definition_before_damaged_bytes_is_kept(logged, demand_same_rows, write):
    """Garbage behind an FMT record costs the garbage alone, and not all the messages of that type."""
    records = Writer(TODAY, told=False).log(messages(logged))
    log = write([records[0], bytes(9), *records[1:]])
    demand_same_rows(log.rows, logged.expected(stamped=False), RESOLUTION)
    assert log.repairs == (f"9 bytes outside complete records left out, first at byte {len(records[0])}",)


@pytest.mark.parametrize("seed", range(12))
def test_log_damaged_anywhere_is_read_or_refused_in_one_line(logged, write, seed, capfd):
    """Bytes overwritten, lost and doubled at random places: never another error, never a word on the terminal."""
    rng = np.random.default_rng(seed)
    raw = bytearray(b"".join(Writer(TODAY).log(messages(logged, "ATT"))))
    for _ in range(rng.integers(1, 12)):
        at, n = int(rng.integers(len(raw))), int(rng.integers(1, 300))
        raw[at : at + n] = (rng.bytes(n), b"", raw[at : at + n] * 2, bytes(n))[rng.integers(4)]
    refusal = ""
    try:
        log = write([bytes(raw)])
    except LogError as error:
        refusal = str(error)
    else:
        assert log.repairs
        assert np.all(np.diff(log.rows["t_s"]) > 0.0)
    assert "\n" not in refusal
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"", r"the file is empty, not an ArduPilot DataFlash log \(\.bin\)"),
        (bytes(range(256)) * 4, "not a DataFlash log: no message is defined in its 1024 bytes"),
        (
            Writer(TODAY).raw,
            r"no inertial unit \(IMU, or GYR and ACC\): set bit 7 \(IMU\) or bit 19 \(raw IMU\) of LOG_BITMASK; "
            "it has FMT, FMTU, MULT, UNIT",
        ),
        (Writer(TODAY).raw[:50], "not a DataFlash log"),
    ],
)
def test_file_without_an_inertial_unit_is_refused(write, raw, said):
    """Empty, foreign, or of definitions alone: one line."""
    with pytest.raises(LogError, match=said) as error:
        write([raw])
    assert "\n" not in str(error.value)


def test_clock_that_was_set_back_is_refused(logged, write):
    """Two flights in one file: one line with the record."""
    records = Writer(TODAY).log(messages(logged, without="SIM ATT GPS MAG ARSP BARO"))
    with pytest.raises(LogError, match=r"IMU 1001, column IMU time \(time\): runs back from 50 to 30\.02 s"):
        write([*records, *records[1:]])


def test_missing_package_is_told_with_what_installs_it(logged, write, monkeypatch):
    """One line that can be pasted."""
    monkeypatch.setitem(sys.modules, "pymavlink.DFReader", None)
    with pytest.raises(LogError, match=r'logs of ArduPilot need pymavlink: pip install "wingslevel\[logs\]"'):
        write(Writer(TODAY).log(messages(logged)))


def test_replay_of_the_file_scores_as_the_flight_itself(logged, write, tmp_path, monkeypatch, capfd):
    """Through the command line: the scores are those of the rows that were written, to the resolution of the log."""
    monkeypatch.chdir(tmp_path)
    write(Writer(TODAY).log(messages(logged)))
    capfd.readouterr()
    assert run(["replay", "flight.BIN", "--estimator", "premerlani", "--no-rerun", "--json", "-"]) == 0
    data = json.loads(capfd.readouterr().out)
    expected = replay(logged.log(), "premerlani", {"elevation_m": 488.0}).scores
    assert expected["inclination_rms_deg"] < 10.0  # it did follow
    for name in ("inclination_rms_deg", "heading_rms_deg", "rotation_max_deg"):
        assert data[name] == pytest.approx(expected[name], rel=0, abs=1e-3)
    assert (data["rows"], data["reference"], data["reference_kind"]) == (1000, "SIM in flight.BIN", "truth")
    assert run(["replay", "flight.BIN", "--imu", "1", "--no-rerun", "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["rotation_rms_deg"] > 2.0 * data["rotation_rms_deg"]
    assert run(["replay", "flight.BIN", "--imu", "2", "--no-rerun"]) == 2


def test_attitude_without_a_number_is_one_that_cannot_be_judged(logged, write):
    """The log has one: all of it is in the ledger, and the reason is said; it is not as if there had been none."""
    told = [(t, n, (*v[:7], *4 * [np.nan]) if n == "SIM" else v) for t, n, v in messages(logged, without="ATT")]
    log = write(Writer(TODAY).log(told))
    entry = log.ledger["reference"]
    assert (entry.read, entry.used, entry.left_out) == (len(logged.t_us), 0, {"no attitude": len(logged.t_us)})
    said = f"SIM in flight.BIN: no attitude can be used: {len(logged.t_us)} no attitude"
    assert why_none(log, Window()) == said
