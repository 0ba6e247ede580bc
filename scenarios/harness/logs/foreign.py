"""Recognises files with a wrong name by their first bytes: one line says what the file is and what to do."""

from collections.abc import Mapping
from pathlib import Path

from scenarios.harness.logs.recorded import LogError

ENOUGH = 1 << 16  # bytes to tell a kind by
ULOG = b"ULog\x01\x12\x35"
DATAFLASH = b"\xa3\x95"
_ULOG, _DATAFLASH = "a ULog file of PX4: name it .ulg", "an ArduPilot DataFlash log: name it .bin"
_SDLOG2 = (
    "a log of PX4's old sdlog2, not ArduPilot's: it cannot be read; since version 1.6 PX4 writes ULog (.ulg), which can"
)
_BEGINNINGS = (
    (ULOG, _ULOG),
    (b"FMT, ", "an ArduPilot log as text (.log): replay the .bin that it was converted from"),
    (b"PK\x03\x04", "a zip archive: unpack it first"),
    (b"\x1f\x8b", "packed with gzip: unpack it first"),
    (b"BZh", "packed with bzip2: unpack it first"),
    (b"\xfd7zXZ\x00", "packed with xz: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd: unpack it first"),
    (b"\x89HDF\r\n", "an HDF5 file: export it as text in columns (.csv)"),
    (b"7z\xbc\xaf", "a 7z archive: unpack it first"),
    (b"PAR1", "a Parquet file: name it .parquet"),
    (b"MATLAB 5.0", "a MATLAB file: name it .mat"),
)
_PAGE, _PAGES = "a web page, not a log: the download went wrong", (b"<!doctype", b"<html")
_TELEMETRY = (
    "a MAVLink telemetry log (.tlog), which holds only a few messages a second: download the log from the autopilot "
    "(.bin or .ulg)"
)
_MAVLINK = b"\xfe\xfd"  # how messages of its versions 1 and 2 begin
_YEAR_US = 365.25 * 86400e6
_OF_SDLOG2 = {"TIME": ("StartTime",), "SENS": ("BaroPres",), "ATSP": ("RollSP",), "GPOS": ("Lat",), "LPOS": ("X",)}


def hint(raw: bytes) -> str:
    """What the file that begins with `raw` is, and what to do with it; empty if it is not recognised."""
    if raw.startswith(DATAFLASH):
        return _SDLOG2 if b"StartTime" in raw[:ENOUGH] else _DATAFLASH
    if raw[:ENOUGH].lstrip().lower().startswith(_PAGES):
        return _PAGE
    for beginning, what in _BEGINNINGS:
        if raw.startswith(beginning):
            return what
    microseconds = int.from_bytes(raw[:8], "big")  # since 1970
    if len(raw) > 8 and raw[8] in _MAVLINK and 30 * _YEAR_US < microseconds < 130 * _YEAR_US:
        return _TELEMETRY
    return ""


def refuse(path: Path, raw: bytes, expected: str) -> None:
    """LogError if the file at `path` is empty, or of a known kind other than the one `expected`."""
    if not raw:
        raise LogError(f"{path}: the file is empty, not {expected}")
    found = hint(raw)
    if found and found not in (_DATAFLASH if "DataFlash" in expected else "", _ULOG if "ULog" in expected else ""):
        raise LogError(f"{path}: not {expected}; this is {found}")


def refuse_sdlog2(path: Path, formats: Mapping[str, tuple[str, ...]]) -> None:
    """LogError if the messages defined, name -> columns, are those of PX4's sdlog2.

    It packs records as ArduPilot does, but its fields have other names and meanings.
    """
    if any(formats.get(name, ("",))[0].startswith(first) for name, (first,) in _OF_SDLOG2.items()):
        raise LogError(f"{path}: {_SDLOG2}")
