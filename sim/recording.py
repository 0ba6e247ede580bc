"""A flight on disk: every tick of every column in Parquet, and the data needed to fly it again.

``flight.parquet``   one row per tick.  Columns are named by table, quantity and element: ``truth.R_eb.zx``,
                     ``measured.gyro_b_rad_s.x``, ``flown.wind_e_m_s.n``; the Arrow field holds the meaning.
                     The schema includes the record of the manifest, so that the file is self-contained.
``manifest.json``    seed, resolved configuration, versions, outcome and events, for people and scripts, and the
                     SHA-256 of the Parquet file.

Files appear complete or not at all: they are written under a temporary name and renamed.
"""

import hashlib
import json
import math
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, is_dataclass
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
from numpy.typing import NDArray

from estimator.interface import Column
from sim import recording_checks
from sim.log import TABLES, Event, Flight, Log, Outcome
from sim.outside import drafts, files

PARQUET = "flight.parquet"
MANIFEST = "manifest.json"
FORMAT = 1  # increased when an older reader would misread the columns or the record
LARGEST_MANIFEST = 64 << 20  # bytes
RENAMED = {"measured.airspeed_m_s": "measured.equivalent_airspeed_m_s"}  # columns of older recordings
_KEY = b"wingslevel"
_OWN = ("format", "outcome", "message", "heading_reference", "dt_s", "release_s", "n_ticks", "events", "sha256")


class RecordingError(ValueError):
    """A recording cannot be written or read; the message names the path and the reason."""


class Element(NamedTuple):
    """One Parquet column: the element `at` of `column` in `table`, under the name it has in the file."""

    name: str
    table: str
    column: Column
    at: tuple[int, ...]


def elements() -> tuple[Element, ...]:
    """Every Parquet column in file order, from the column tables of the log.

    A matrix is named by the paper's row and column letters, a vector in the earth frame by n, e, d, one in the
    body frame by x, y, z.
    """
    found = []
    for table, columns in TABLES.items():
        for column in columns:
            axes = "ned" if "_e_" in column.name and len(column.shape) == 1 else "xyz"
            for index in np.ndindex(column.shape):
                suffix = "." + "".join(axes[i] for i in index) if index else ""
                found.append(Element(f"{table}.{column.name}{suffix}", table, column, index))
    return tuple(found)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that determine a flight, for the manifest."""
    found = {"python": platform.python_version()}
    for package in ("jsbsim", "numpy", "numba", "wingslevel"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def digest(flight: Flight) -> str:
    """SHA-256 over name and bytes of every column, hexadecimal: equal only for bit-equal logs."""
    sha = hashlib.sha256()
    for name, values in _columns(flight.log):
        sha.update(f"{name}:{values.dtype.str}:{len(values)};".encode())
        sha.update(values.tobytes())
    return sha.hexdigest()


def check_writable(directory: str | Path) -> None:
    """Check before flying that a recording can be written to a directory; leaves no trace.

    Raises
    ------
    RecordingError    naming the directory and the reason
    """
    with _writing(Path(directory)):
        drafts.probe(Path(directory))


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to; rename it to `path` at the end, remove it on any exception.

    First removes incomplete files that killed processes left beside `path`.

    Raises
    ------
    RecordingError    the file cannot be written
    """
    temporary = drafts.hidden(path)
    try:
        with _writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            drafts.sweep(path.parent)
            yield temporary
            os.replace(temporary, path)
    finally:
        # Also on Ctrl-C; nothing to remove after the rename.
        with suppress(OSError):
            temporary.unlink()


@contextmanager
def new_folder(into: Path, name: str) -> Iterator[drafts.Draft]:
    """Give a new folder for a recording, which appears in `into` when the block ends: see `drafts.new_folder`.

    Raises
    ------
    RecordingError    the folder cannot be written
    """
    with _writing(into / name), drafts.new_folder(into, name) as draft:
        try:
            yield draft
        except RecordingError as error:
            raise RecordingError(draft.named(str(error))) from error


def save(flight: Flight, directory: str | Path) -> Path:
    """Write `flight` into `directory`, created if missing, and return that directory.

    Raises
    ------
    RecordingError    the files cannot be written, or the manifest uses a reserved name
    """
    directory = Path(directory)
    record = _record(flight)
    manifest = directory / MANIFEST
    with replacing(directory / PARQUET) as path:
        _write_parquet(_table(flight.log, record), path)
        record["sha256"] = _sha256(path)
        manifest.unlink(missing_ok=True)  # no old manifest beside a new flight, even if interrupted
    with replacing(manifest) as path:
        path.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return directory


def _write_parquet(table: pa.Table, path: Path) -> None:
    try:
        pq.write_table(
            table,
            path,
            compression="zstd",
            use_dictionary=[e.name for e in elements() if e.column.integer],
            use_byte_stream_split=[e.name for e in elements() if not e.column.integer],  # halves noisy floats
        )
    except pa.ArrowException as error:  # system errors are already OSError
        raise RecordingError(f"cannot write to {path}: {_first_line(error)}") from error


def load(source: str | Path) -> Flight:
    """The flight written by `save`, bit for bit, from its directory or its Parquet file.

    Raises
    ------
    RecordingError    no recording there, a truncated or foreign file, columns of another version, or a checksum
                      that differs from the manifest
    """
    path = Path(source)
    if path.is_dir():
        path = path / PARQUET
    with files.reading(path, RecordingError):
        files.check(path, "recording")
        return _load(path)


def _load(path: Path) -> Flight:
    try:
        file = pq.ParquetFile(path, memory_map=False)
    except (OSError, pa.ArrowException) as error:
        raise RecordingError(f"cannot read {path}: truncated, or not a Parquet file ({_first_line(error)})") from error
    with file:
        record = _record_of(file.schema_arrow, path)
        _check_sha256(path)
        log = _log_of(file, path)
    if record["n_ticks"] != len(log):
        raise RecordingError(f"{path}: {len(log)} rows, but {record['n_ticks']} ticks according to its record")
    return Flight(
        log=log,
        dt_s=record["dt_s"],
        release_s=record["release_s"],
        outcome=Outcome(record["outcome"]),
        heading_reference=record["heading_reference"],
        message=record["message"],
        events=tuple(Event(**event) for event in record["events"]),
        manifest={name: value for name, value in record.items() if name not in _OWN},
    )


def plain(value: Any) -> Any:
    """`value` as JSON types: dataclasses and mappings as dicts, NumPy as numbers, NaN and infinity as None."""
    if isinstance(value, Enum):  # first: an enumeration may also be a number or string
        return value.value if isinstance(value, str) else value.name.lower()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    return str(value)


def _columns(log: Log) -> Iterator[tuple[str, NDArray[Any]]]:
    for e in elements():
        yield e.name, np.ascontiguousarray(getattr(log, e.table)[e.column.name][(slice(None), *e.at)])


def _table(log: Log, record: dict[str, Any]) -> pa.Table:
    fields, arrays = [], []
    for e, (name, values) in zip(elements(), _columns(log), strict=True):
        about = {"meaning": e.column.meaning, "shape": json.dumps(e.column.shape), "index": json.dumps(e.at)}
        arrays.append(pa.array(values))
        fields.append(pa.field(name, arrays[-1].type, nullable=False, metadata=about))
    return pa.table(arrays, schema=pa.schema(fields, metadata={_KEY: json.dumps(record, allow_nan=False)}))


def _record(flight: Flight) -> dict[str, Any]:
    taken = sorted(set(_OWN) & set(flight.manifest))
    if taken:
        raise RecordingError(f"the manifest uses the reserved name {', '.join(taken)}: choose another")
    own = {
        "format": FORMAT, "outcome": flight.outcome, "message": flight.message,
        "heading_reference": flight.heading_reference, "dt_s": flight.dt_s, "release_s": flight.release_s,
        "n_ticks": len(flight.log), "events": flight.events,
    }  # fmt: skip
    return plain({"versions": versions(), **flight.manifest, **own})


def _record_of(schema: pa.Schema, path: Path) -> dict[str, Any]:
    stored = (schema.metadata or {}).get(_KEY)
    if stored is None:
        raise RecordingError(f"{path} is a Parquet file, but not a flight: it has no wingslevel record")
    return recording_checks.record(json.loads(stored), (FORMAT,))


def _log_of(file: pq.ParquetFile, path: Path) -> Log:
    """The columns of the file, each checked; times first, so that their errors are reported first."""
    schema = file.schema_arrow
    names = [RENAMED.get(name, name) for name in schema.names]
    expected, found, rows = [e.name for e in elements()], names, file.metadata.num_rows
    if odd := sorted(set(expected) ^ set(found)):
        kind = "lacks" if odd[0] in expected else "has the unknown"
        raise RecordingError(f"{path} was recorded by another version: it {kind} column {files.some(odd[:1])}")
    if len(found) > len(expected):
        raise RecordingError(f"{path}: it has a column twice")
    schema = pa.schema([field.with_name(name) for field, name in zip(schema, names, strict=True)])
    recording_checks.schema(schema, {e.name: e.column.integer for e in elements()}, rows)
    recording_checks.column("truth.t_s", file.read(columns=["truth.t_s"])["truth.t_s"], rows)
    table, log = file.read().rename_columns(names), Log.empty(rows)
    for e in elements():
        getattr(log, e.table)[e.column.name][(slice(None), *e.at)] = recording_checks.column(
            e.name, table[e.name], rows
        )
    return log


def _check_sha256(path: Path) -> None:
    manifest = path.with_name(MANIFEST)
    if path.name != PARQUET or not manifest.exists():
        return
    try:
        promised = json.loads(files.read(manifest, "manifest", LARGEST_MANIFEST).decode("utf-8"))["sha256"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(f"cannot read {manifest}: not a manifest of a flight ({_first_line(error)})") from error
    if promised != _sha256(path):
        raise RecordingError(f"{path} does not match the {MANIFEST} beside it: its SHA-256 differs")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn an OSError inside the block into a RecordingError about `path`."""
    try:
        yield
    except OSError as error:
        said = error.strerror or _first_line(error)
        if error.errno and "[errno" in said:  # shorten Arrow's message
            said = os.strerror(error.errno)
        raise RecordingError(f"cannot write to {path}: {said}") from error


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
