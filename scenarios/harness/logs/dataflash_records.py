"""The records of an ArduPilot DataFlash log, by message name.

A log is a sequence of packed records: two header bytes, a type, and fields as defined by the FMT record of that type.
Units come from UNIT, MULT and FMTU, or from `FIELDS`.  Records are located here and not by pymavlink, whose reader
drops the rest of a log if damaged bytes look like an unknown type; a record is accepted if the next header follows it.
The meaning of the format characters comes from pymavlink.
"""

import struct
from collections import defaultdict
from collections.abc import Callable, Container
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs import foreign
from scenarios.harness.logs.recorded import LogError
from sim.outside import files

HEADER, FMT, FMT_LENGTH = b"\xa3\x95", 128, 89
_DEG = np.pi / 180.0
LABELS = {  # label in UNIT -> factor to ours: angles stay in degrees, rates are in radians
    "rad/s": 1.0, "deg/s": _DEG, "m/s/s": 1.0, "m/s": 1.0, "m": 1.0, "Gauss": 100.0,
    "deg": 1.0, "degheading": 1.0, "deglatitude": 1.0, "deglongitude": 1.0, "rad": 1.0 / _DEG,
}  # fmt: skip
FIELDS = dict.fromkeys(("MagX", "MagY", "MagZ"), 0.1)  # milligauss, without logged units; others are in ours
FEWEST = 0.01  # an instance with a smaller share of the messages is damage
SET_S = 10.0  # messages further than this from the inertial samples next to them use another clock


@dataclass(frozen=True, slots=True)
class _Format:
    """The format of a message type, from its FMT record."""

    name: str
    length: int
    codes: str
    columns: tuple[str, ...]
    dtype: np.dtype[Any]


@dataclass(frozen=True, slots=True)
class Records:
    """Records of one kind, of one instance.

    name : of the message, with its number if it has one      instance : from 0
    fields : shape (n,), as packed                            offsets : shape (n,), start of each in the file
    """

    name: str
    instance: int
    fields: NDArray[Any]
    offsets: NDArray[np.intp]

    @classmethod
    def none(cls, name: str) -> "Records":
        """No record of a message."""
        return cls(name, 0, np.zeros(0, np.dtype([])), np.zeros(0, np.intp))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the fields."""
        return tuple(self.fields.dtype.names or ())

    def where(self, mask: NDArray[np.bool_]) -> "Records":
        """The records selected by `mask`."""
        return replace(self, fields=self.fields[mask], offsets=self.offsets[mask])


class DataFlash:
    """The records of a log.  Attribute `repairs` lists bytes that were left out.

    Raises
    ------
    LogError      one line: a file that cannot be read, or is not a DataFlash log
    """

    def __init__(self, path: Path) -> None:
        try:
            from pymavlink.DFReader import FORMAT_TO_STRUCT  # type: ignore[import-untyped]
        except ImportError as error:
            raise LogError(f'{path}: logs of ArduPilot need pymavlink: pip install "wingslevel[logs]"') from error
        self.path, self.repairs = path, list[str]()
        self._codes: dict[str, tuple[str, float | None, Any]] = FORMAT_TO_STRUCT
        self._raw = files.read(path, "DataFlash log")
        foreign.refuse(path, self._raw, "an ArduPilot DataFlash log (.bin)")
        self._formats: dict[int, _Format] = {}
        self._offsets = self._walk()
        if not self._formats:
            raise LogError(f"{path}: not a DataFlash log: no message is defined in its {len(self._raw)} bytes")
        self._types = {f.name: kind for kind, f in self._formats.items() if self._offsets[kind]}
        foreign.refuse_sdlog2(path, {f.name: f.columns for f in self._formats.values()})
        self._units = self._logged_units()

    def _walk(self) -> dict[int, list[int]]:
        """Offsets of the records of each type; also collects the formats and counts bytes outside records."""
        raw, end = self._raw, len(self._raw)
        lengths, found = {FMT: FMT_LENGTH}, defaultdict[int, list[int]](list)
        at, bad, first = 0, 0, -1
        while at < end:
            length = lengths.get(raw[at + 2], 0) if raw.startswith(HEADER, at) and at + 2 < end else 0
            after = at + length
            kind, body = raw[at + 2] if length else 0, raw[at + 3 : after]
            follows = length and after <= end and HEADER.startswith(raw[after : after + 2])
            if follows or (kind == FMT and after <= end and HEADER not in body):  # a lost FMT would lose its type
                if kind == FMT:
                    self._define(body, lengths)
                found[kind].append(at)
                at = after
                continue
            next_at = raw.find(HEADER, at + 1)
            if next_at < 0:
                self.repairs.append(f"{end - at} bytes at the end are not a complete record: left out")
                break
            bad, first = bad + next_at - at, at if first < 0 else first
            at = next_at
        if bad:
            self.repairs.insert(0, f"{bad} bytes outside complete records left out, first at byte {first}")
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

    def _logged_units(self) -> dict[tuple[str, str], float]:
        """Factor to ours for each (message, column) with a known logged unit."""
        needed = {"UNIT": ("Id", "Label"), "MULT": ("Id", "Mult"), "FMTU": ("FmtType", "UnitIds", "MultIds")}
        found = {name: self.records(name) for name in needed}
        if not all(set(columns) <= set(found[name].columns) for name, columns in needed.items()):
            return {}
        unit, mult, formats = (found[name].fields for name in needed)
        letters = [chr(int(i) & 0xFF) for i in unit["Id"]]
        labels = {i: label.decode("ascii", "replace") for i, label in zip(letters, unit["Label"], strict=True)}
        multipliers = {chr(int(i) & 0xFF): float(m) for i, m in zip(mult["Id"], mult["Mult"], strict=True)}
        factors = {}
        for kind, units, by in zip(formats["FmtType"], formats["UnitIds"], formats["MultIds"], strict=True):
            if int(kind) not in self._formats:
                continue
            of = self._formats[int(kind)]
            for name, code, u, m in zip(
                of.columns, of.codes, units.decode("latin1"), by.decode("latin1"), strict=False
            ):
                if (factor := LABELS.get(labels.get(u, ""))) is not None:
                    scaled = self._codes[code][1] is not None  # already by the format character
                    factors[of.name, name] = factor * (1.0 if scaled else multipliers.get(m, 1.0) or 1.0)
        return factors

    def records(self, name: str) -> Records:
        """All records of that name."""
        kind = self._types.get(name)
        if kind is None:
            return Records.none(name)
        size, offsets = self._formats[kind].length - 3, np.array(self._offsets[kind], np.intp)
        block = np.frombuffer(self._raw, np.uint8)[offsets[:, None] + np.arange(3, 3 + size)]
        return Records(name, 0, np.ascontiguousarray(block).view(self._formats[kind].dtype)[:, 0], offsets)

    def instances(self, name: str) -> list[Records]:
        """The instances of a message; see the function of that name."""
        return instances(name, self.records, self._types)

    def column(self, records: Records, column: str) -> Array:
        """One column in our units (angles in degrees), shape (n,)."""
        of = self._formats[self._types[records.name]]
        own = self._codes[of.codes[of.columns.index(column)]][1] or 1.0
        # Divide by an integer, as the writer multiplied: 0.01 is not exact.
        with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
            values = records.fields[column].astype(np.float64) / round(1.0 / own)
        return np.asarray(values * self._units.get((records.name, column), FIELDS.get(column, 1.0)))

    @property
    def names(self) -> list[str]:
        """Names of the messages in the log."""
        return sorted(self._types)


def instances(name: str, records: Callable[[str], Records], there: Container[str]) -> list[Records]:
    """The instances of a message, distinguished by its column I, or by a number behind its name; the lowest first.

    records : all records of a name      there : names of messages that are in the log
    """
    every = records(name)
    if "I" in every.columns:
        which, counts = np.unique(every.fields["I"], return_counts=True)
        which = which[counts >= FEWEST * counts.max()]
        return [replace(every.where(every.fields["I"] == i), instance=int(i)) for i in which]
    names = [(0, name), (0, f"{name}1"), (0, f"{name}_0"), *((i - 1, f"{name}{i}") for i in range(2, 10))]
    names += [(i, f"{name}_{i}") for i in range(1, 9)]  # as in files converted from a log
    found = [replace(records(own), instance=i) for i, own in names if own in there]
    return [r for k, r in enumerate(found) if r.instance not in [other.instance for other in found[:k]]]


def own_time_s(records: Records) -> Array | None:
    """Time of the sample if logged, otherwise of logging; None without a time on the clock of the log.

    With ``Week``, ``TimeMS`` is the receiver's time of week, and ``T`` the time aboard.
    """
    of_week = "Week" in records.columns or ("Time" in records.columns and "NSats" in records.columns)
    clocks = (("SampleUS", 1e6), ("TimeUS", 1e6), (("T", 1e3) if of_week else ("TimeMS", 1e3)))
    for column, per_s in clocks:
        if column in records.columns and records.fields[column].any():  # some drivers leave SampleUS empty
            return np.asarray(records.fields[column].astype(np.float64) / per_s)
    return None


@dataclass(frozen=True, slots=True)
class Clock:
    """The clock of the log: times of the inertial samples, and their places in the file.

    t_s : shape (n,)      offsets : shape (n,), increasing
    """

    t_s: Array
    offsets: NDArray[np.intp]

    def agrees(self, records: Records, t_s: Array) -> bool:
        """Whether the times of `records` match those of the inertial samples written just before them."""
        before = np.searchsorted(self.offsets, records.offsets) - 1
        if not np.any(before >= 0):
            return True
        return bool(np.median(np.abs(t_s - self.t_s[before])[before >= 0]) < SET_S)

    def by_order(self, records: Records) -> tuple[Array, NDArray[np.bool_]]:
        """Times of the inertial samples written next, NaN after the last; and which of them follow a gap.

        A message was written between two inertial samples, so it had arrived by the second.
        """
        after = np.searchsorted(self.offsets, records.offsets)
        t_s = np.append(self.t_s, np.nan)[after]
        usual_s = float(np.median(np.diff(self.t_s))) if len(self.t_s) > 1 else 0.0
        before_s = np.where(after > 0, self.t_s[np.maximum(after - 1, 0)], t_s - usual_s)
        return t_s, np.asarray(t_s - before_s > 2.0 * usual_s)
