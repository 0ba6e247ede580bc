"""ArduPilot's DataFlash logs (.bin): IMU, GPS, MAG, ARSP, BARO, and the attitude in SIM, ATT or AHR2.

A log is a row of packed records: two bytes of header, a type, and the fields as the FMT record of that type says;
UNIT, MULT and FMTU tell units, else they are those of `FIELDS`.  Records are found here, since pymavlink's reader
gives up the rest of a log where damaged bytes look like a type that it does not know; a record counts where the next
header follows it.  What the characters of a format mean comes from pymavlink.

Rates logged in RATE are those of the controller, filtered and corrected, and not what the gyro measured: not used.
"""

import struct
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from estimator.screening import LONGEST_GAP_S
from scenarios.harness.logs import streams, tabular
from scenarios.harness.logs.recorded import LogError, RecordedLog
from scenarios.harness.logs.streams import Kind, Stream

HEADER, FMT, FMT_LENGTH = b"\xa3\x95", 128, 89
FIX_3D = 3.0  # GPS.Status
_DEG = np.pi / 180.0
LABELS = {  # of UNIT -> factor to ours: angles stay in degrees, rates are in radians
    "rad/s": 1.0, "deg/s": _DEG, "m/s/s": 1.0, "m/s": 1.0, "m": 1.0, "Gauss": 100.0,
    "deg": 1.0, "degheading": 1.0, "deglatitude": 1.0, "deglongitude": 1.0, "rad": 1.0 / _DEG,
}  # fmt: skip
GYRO, FORCE, FIELD = (tuple(f"{name}{axis}" for axis in "XYZ") for name in ("Gyr", "Acc", "Mag"))
FIELDS = dict.fromkeys(FIELD, 0.1)  # factor to ours where the log tells no unit: milligauss; the others are in ours
ATTITUDES: tuple[tuple[str, Kind], ...] = (
    ("SIM", "truth"),
    ("ATT", "filter"),
    ("AHR2", "filter"),
)


def read(path: Path, imu: int | None = None) -> RecordedLog:
    """The log at `path`.

    imu : which inertial unit, from 0; the first one unless told

    Raises
    ------
    LogError      one line: no such log, no inertial unit in it, or one that cannot be believed
    """
    log = _Log(path)
    inertial = _inertial(log, imu)
    messages = streams.Messages(
        inertial,
        np.full(len(inertial.t_s), np.nan),
        {"time": f"{inertial.name} time", "gyro": "GyrX GyrY GyrZ", "force": "AccX AccY AccZ"}
        | {f"{ours}.{a.lower()}": f"{own}{a}" for ours, own in (("gyro", "Gyr"), ("force", "Acc")) for a in "XYZ"},
        _fixes(log),
        log.stream("MAG", FIELD, healthy="Health"),
        log.stream("ARSP", ("Airspeed",), healthy="H"),
        log.stream("BARO", ("Alt",), healthy="H"),
        *_attitude(log),
    )
    return streams.recorded(path, messages, log.repairs)


@dataclass(frozen=True, slots=True)
class _Format:
    """What an FMT record says of a type of message."""

    name: str
    length: int
    codes: str
    columns: tuple[str, ...]
    dtype: np.dtype[Any]


class _Log:
    """The messages of a log by name.  Attribute `repairs` tells of bytes that were left out."""

    def __init__(self, path: Path) -> None:
        try:
            from pymavlink.DFReader import FORMAT_TO_STRUCT  # type: ignore[import-untyped]
        except ImportError as error:
            raise LogError(f'{path}: logs of ArduPilot need pymavlink: pip install "wingslevel[logs]"') from error
        self.path, self.repairs = path, list[str]()
        self._codes: dict[str, tuple[str, float | None, Any]] = FORMAT_TO_STRUCT
        try:
            self._raw = path.read_bytes()
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error
        self._formats: dict[int, _Format] = {}
        self._offsets = self._walk()
        if not self._formats:
            raise LogError(f"{path}: no DataFlash log: no message is defined in its {len(self._raw)} bytes")
        self._types = {f.name: kind for kind, f in self._formats.items() if self._offsets[kind]}
        self._units = self._told_units()

    def _walk(self) -> dict[int, list[int]]:
        """Offsets of the records of each type; formats are learnt on the way, what is no record is counted."""
        raw, end = self._raw, len(self._raw)
        lengths, found = {FMT: FMT_LENGTH}, defaultdict[int, list[int]](list)
        at, bad, first = 0, 0, -1
        while at < end:
            length = lengths.get(raw[at + 2], 0) if raw.startswith(HEADER, at) and at + 2 < end else 0
            after = at + length
            kind, body = raw[at + 2] if length else 0, raw[at + 3 : after]
            follows = length and after <= end and HEADER.startswith(raw[after : after + 2])
            if follows or (kind == FMT and after <= end and HEADER not in body):  # without it a type would be lost
                if kind == FMT:
                    self._define(body, lengths)
                found[kind].append(at)
                at = after
                continue
            next_at = raw.find(HEADER, at + 1)
            if next_at < 0:
                self.repairs.append(f"{end - at} bytes at the end are no whole record: left out")
                break
            bad, first = bad + next_at - at, at if first < 0 else first
            at = next_at
        if bad:
            self.repairs.insert(0, f"{bad} bytes that are no whole record left out, first at byte {first}")
        return found

    def _define(self, body: bytes, lengths: dict[int, int]) -> None:
        kind, length, *words = struct.unpack("<BB4s16s64s", body)
        name, codes, columns = (word.partition(b"\0")[0].decode("ascii", "replace") for word in words)
        if length <= 3:
            return
        lengths.setdefault(kind, length)
        names = tuple(columns.split(","))
        if len(names) != len(codes) or len(set(names)) < len(names) or not all(c in self._codes for c in codes):
            return
        types = (self._codes[c][0] for c in codes)
        dtype = np.dtype([(n, f"S{t[:-1]}" if t.endswith("s") else f"<{t}") for n, t in zip(names, types, strict=True)])
        if dtype.itemsize == length - 3:
            self._formats.setdefault(kind, _Format(name, length, codes, names, dtype))

    def records(self, name: str) -> NDArray[Any]:
        """All records of that name, with the fields as they were packed."""
        kind = self._types[name]
        size, offsets = self._formats[kind].length - 3, np.array(self._offsets[kind])
        block = np.frombuffer(self._raw, np.uint8)[offsets[:, None] + np.arange(3, 3 + size)]
        return np.ascontiguousarray(block).view(self._formats[kind].dtype)[:, 0]

    def _told_units(self) -> dict[tuple[str, str], float]:
        """Factor to ours of each (message, column) of which the log tells a unit that we know."""
        if not {"UNIT", "MULT", "FMTU"} <= self._types.keys():
            return {}
        unit, mult, told = self.records("UNIT"), self.records("MULT"), self.records("FMTU")
        labels = {chr(i): label.decode("ascii", "replace") for i, label in zip(unit["Id"], unit["Label"], strict=True)}
        multipliers = {chr(i): float(m) for i, m in zip(mult["Id"], mult["Mult"], strict=True)}
        factors = {}
        for kind, units, by in zip(told["FmtType"], told["UnitIds"], told["MultIds"], strict=True):
            if int(kind) not in self._formats:
                continue
            of = self._formats[int(kind)]
            for name, code, u, m in zip(
                of.columns, of.codes, units.decode("latin1"), by.decode("latin1"), strict=False
            ):
                if (factor := LABELS.get(labels.get(u, ""))) is not None:
                    scaled = self._codes[code][1] is not None  # by the character of the format already
                    factors[of.name, name] = factor * (1.0 if scaled else multipliers.get(m, 1.0) or 1.0)
        return factors

    def column(self, name: str, records: NDArray[Any], column: str) -> Array:
        """One column in our units (angles in degrees), shape (n,)."""
        of = self._formats[self._types[name]]
        own = self._codes[of.codes[of.columns.index(column)]][1] or 1.0
        # Divided, as the writer multiplied: 1/0.01 is a whole number, 0.01 is not.
        with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
            values = records[column].astype(np.float64) / round(1.0 / own)
        return np.asarray(values * self._units.get((name, column), FIELDS.get(column, 1.0)))

    def time_s(self, name: str, records: NDArray[Any]) -> Array:
        """When the messages were logged, or the sample was taken where they tell."""
        columns = self._formats[self._types[name]].columns
        clocks = (("SampleUS", 1e6), ("TimeUS", 1e6), *((("T", 1e3),) if "Week" in columns else ()), ("TimeMS", 1e3))
        for column, per_s in clocks:
            if column in columns and records[column].any():  # some drivers leave SampleUS empty
                return np.asarray(records[column].astype(np.float64) / per_s)
        raise LogError(f"{self.path}: {name} has no time; it has {', '.join(columns)}")

    def chosen(self, name: str, instance: int | None = None) -> tuple[str, NDArray[Any]] | None:
        """Records of an instance of a message, the first unless told: of a column I, or a number behind the name."""
        if name in self._types and "I" in self._formats[self._types[name]].columns:
            records = self.records(name)
            which = records["I"].min() if instance is None else instance
            return (name, records[records["I"] == which]) if np.any(records["I"] == which) else None
        number = (instance or 0) + 1
        for own in (name, f"{name}1") if number == 1 else (f"{name}{number}",):
            if own in self._types:
                return own, self.records(own)
        return None

    def stream(
        self, name: str, columns: tuple[str, ...], instance: int | None = None, healthy: str = ""
    ) -> Stream | None:
        """The messages in our units; None where there are none with these columns.

        healthy : a column that is zero where the sensor says that the sample is not to be trusted
        """
        found = self.chosen(name, instance)
        if found is None or not set(columns) <= set(found[1].dtype.names or ()):
            return None
        own, records = found
        if healthy in (records.dtype.names or ()):
            records = records[records[healthy] != 0]
        if not len(records):
            return None
        return Stream(own, self.time_s(own, records), np.column_stack([self.column(own, records, c) for c in columns]))

    @property
    def names(self) -> list[str]:
        """Of the messages that are there."""
        return sorted(self._types)


def _inertial(log: _Log, imu: int | None) -> Stream:
    """Gyro and accelerometer: of IMU, else of GYR with ACC at its times."""
    both = log.stream("IMU", GYRO + FORCE, imu)
    if both is not None:
        return both
    gyro, force = log.stream("GYR", GYRO, imu), log.stream("ACC", FORCE, imu)
    if gyro is None or force is None:
        which = "" if imu is None else f" {imu}"
        raise LogError(f"{log.path}: no inertial unit{which} (IMU, or GYR and ACC); it has {', '.join(log.names)}")
    return Stream(gyro.name, gyro.t_s, np.column_stack((gyro.values, _at(gyro.t_s, force))))


def _at(t_s: Array, stream: Stream) -> Array:
    """The stream at other times, interpolated; NaN outside it and in its gaps."""
    order = np.argsort(stream.t_s, kind="stable")
    times, values = stream.t_s[order], stream.values[order]
    after = np.clip(np.searchsorted(times, t_s), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    inside = (times[after] == t_s) | ((times[before] <= t_s) & (t_s <= times[after]))
    inside &= (times[after] == t_s) | (times[after] - times[before] <= LONGEST_GAP_S)
    there = np.column_stack([np.interp(t_s, times, column) for column in values.T])
    return np.where(inside[:, None], there, np.nan)


def _fixes(log: _Log) -> Stream | None:
    """Fixes of three dimensions: speed and course over ground, and the vertical speed, which counts down."""
    columns = ("Status", "Lat", "Lng", "Alt", "Spd", "GCrs")
    found = log.chosen("GPS")
    vertical = ("VZ",) if found is not None and "VZ" in (found[1].dtype.names or ()) else ()
    gps = log.stream("GPS", columns + vertical)
    if gps is None:
        return None
    fixed = gps.values[:, 0] >= FIX_3D
    t_s, values = gps.t_s[fixed], gps.values[fixed]
    speed, course = values[:, 4], np.radians(values[:, 5])
    down = values[:, 6] if vertical else np.zeros(len(t_s))
    velocity = (speed * np.cos(course), speed * np.sin(course), down)
    return Stream(gps.name, t_s, np.column_stack((values[:, 1:4], *velocity, t_s)))


def _attitude(log: _Log) -> tuple[Stream | None, Kind]:
    """The attitude: the simulator's where there is one, else what was flown on, else that of the other estimator."""
    for name, kind in ATTITUDES:
        quaternion = log.stream(name, ("Q1", "Q2", "Q3", "Q4"))
        angles = log.stream(name, ("Roll", "Pitch", "Yaw"))
        stream = quaternion or angles
        if stream is None:
            continue
        if quaternion is not None:
            table = dict(zip(("qw", "qx", "qy", "qz"), quaternion.values.T, strict=True))
        else:
            table = dict(zip(("roll", "pitch", "yaw"), np.radians(stream.values.T), strict=True))
        R_eb = tabular.attitude(table)
        if R_eb is not None and np.isfinite(R_eb).any():
            return Stream(stream.name, stream.t_s, R_eb.reshape(-1, 9)), kind
    return None, "filter"
