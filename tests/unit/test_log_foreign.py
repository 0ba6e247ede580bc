"""Files that are not what their names say: one line each, that says what they are and what to do."""

import struct

import pytest

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError

HEADER = b"\xa3\x95"
ULOG = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)
TEXT_LOG = b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nIMU, 13178, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8\n"
TLOG = struct.pack(">Q", 1_700_000_000_000_000) + b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00" + bytes(40)


def defined(kind, name, codes, columns, size):
    """An FMT record."""
    return HEADER + struct.pack("<BBB4s16s64s", 128, kind, size, name, codes, columns)


ARDUPILOT = defined(128, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns", 89)
SDLOG2 = b"".join(
    (
        defined(128, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns", 89),
        defined(129, b"TIME", b"Q", b"StartTime", 11),
        defined(4, b"IMU", b"ffffff", b"AccX,AccY,AccZ,GyroX,GyroY,GyroZ", 27),
        HEADER + b"\x81" + struct.pack("<Q", 5_000_000),
        HEADER + b"\x04" + struct.pack("<6f", 0.0, 0.0, -9.8, 0.0, 0.0, 0.0),
    )
)
WITHOUT_TIME = (
    ARDUPILOT
    + defined(2, b"SENS", b"ff", b"BaroPres,BaroAlt", 11)
    + HEADER
    + b"\x02"
    + struct.pack("<2f", 950.0, 500.0)
)


@pytest.mark.parametrize(
    ("name", "raw", "said"),
    [
        ("a.csv", b"<!DOCTYPE html><html></html>", r"not text in columns; this is a web page, not a log"),
        ("a.txt", TEXT_LOG, r"not text in columns; this is an ArduPilot log as text \(\.log\): replay the \.bin"),
        ("a.csv", ULOG, r"not text in columns; this is a ULog file of PX4: name it \.ulg$"),
        ("a.mat", b"PK\x03\x04" + bytes(600), r"not a MATLAB file; this is a zip archive: unpack it first$"),
        ("a.mat", b"", r"not a MATLAB file; this is an empty file$"),
        ("a.bin", b"", r"the file is empty, not an ArduPilot DataFlash log \(\.bin\)$"),
        ("a.ulg", b"", r"the file is empty, not a ULog file of PX4 \(\.ulg\)$"),
        ("a.bin", ULOG, r"not an ArduPilot DataFlash log \(\.bin\); this is a ULog file of PX4: name it \.ulg$"),
        ("a.ulg", ARDUPILOT, r"not a ULog file of PX4 \(\.ulg\); this is an ArduPilot DataFlash log: name it \.bin$"),
        ("a.bin", TEXT_LOG, r"an ArduPilot log as text \(\.log\): replay the \.bin that it was converted from$"),
        ("a.log", TEXT_LOG, r"this is an ArduPilot log as text \(\.log\)"),
        ("a.bin", TLOG, r"this is a MAVLink telemetry log \(\.tlog\), .*: download the log from the autopilot"),
        ("a.tlog", TLOG, r"this is a MAVLink telemetry log"),
        ("a.ulg", TLOG, r"this is a MAVLink telemetry log"),
        ("a.bin", SDLOG2, r"a log of PX4's old sdlog2, not ArduPilot's: it cannot be read; .* \(\.ulg\)"),
        ("a.px4log", SDLOG2, r"this is a log of PX4's old sdlog2, not ArduPilot's: it cannot be read"),
        ("a.bin", WITHOUT_TIME, r"a log of PX4's old sdlog2, not ArduPilot's"),
        ("a.px4log", ULOG, r"this is a ULog file of PX4: name it \.ulg$"),
        ("a.ulg", b"PK\x03\x04" + bytes(60), r"this is a zip archive: unpack it first$"),
        ("a.bin", b"\x1f\x8b" + bytes(60), r"this is packed with gzip: unpack it first$"),
        ("a.ulg", b"<!DOCTYPE html><html>", r"this is a web page, not a log: the download went wrong$"),
        ("a.log", b"something else", r"unknown kind of log; recordings are folders or"),
        ("a.log", b"", r"unknown kind of log"),
    ],
)  # fmt: skip
def test_file_of_another_kind_is_refused_in_one_helpful_line(tmp_path, name, raw, said):
    """By what its first bytes are."""
    (tmp_path / name).write_bytes(raw)
    with pytest.raises(LogError, match=said) as error:
        logs.read(tmp_path / name)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / name}: ")
