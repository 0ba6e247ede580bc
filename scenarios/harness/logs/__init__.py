"""Recorded logs from anywhere, read into the rows that estimators take.

One module per format; each has ``read(path, ...) -> RecordedLog``.  `read` picks the module by the file.  It is also
the border to files of strangers: whatever a reader raises becomes a `LogError` of one line here, see
`sim.outside.files`.
"""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from scenarios.harness.logs import checks, column_map, foreign
from scenarios.harness.logs import reference as vectors
from scenarios.harness.logs.recorded import LogError, NothingToScore, RecordedLog
from sim.outside import files
from sim.outside.wording import printable

_BY_MAP = {  # columns of numbers, which a column map explains
    **dict.fromkeys((".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz"), "text"),
    ".mat": "matlab",
}
_OF_AUTOPILOTS = {".bin": "dataflash", ".ulg": "ulog"}  # messages that say what they hold, of several inertial units
KINDS = (
    "a folder or .parquet is a recording of ours, *_in.csv.gz reference vectors, .csv .txt .tsv (.gz) and .mat hold "
    "columns, .bin is ArduPilot's, .ulg PX4's"
)


def read(
    path: Path, *, reference: Path | None = None, columns: str | None = None, imu: int | None = None
) -> RecordedLog:
    """The log at `path`, put in order and checked, by the reader that its name asks for.

    Parameters
    ----------
    reference : attitudes to score against, in a file of their own; for reference vectors one of the same set, for
                others any log with an attitude, or a table of times on the same clock and attitudes
    columns : column map of a text or MATLAB file, see `column_map`
    imu : which inertial unit of an autopilot's log, from 0; by default the first one

    Raises
    ------
    LogError      one line: a file that is not there, of an unknown kind, or that cannot be believed
    """
    with files.reading(path, LogError):
        _check(path, "log")
        if reference is not None:
            with files.reading(reference, LogError):
                _check(reference, "reference")
        if columns is None and vectors.is_reference(path):
            return _printable(checks.mended(vectors.read(path, reference), path))
        log = _read(path, None if columns is None else column_map.load(columns), imu)
        if reference is not None:
            with files.reading(reference, LogError):
                log = _against(log, reference)
    return _printable(log)


def _check(path: Path, what: str) -> None:
    """Refuse what is neither a file nor a folder; LogError."""
    if not path.is_dir():
        files.check(path, what)


def _printable(log: RecordedLog) -> RecordedLog:
    """`log` with what it says in words of the file, its name and those of its columns, fit for a terminal."""
    reference = log.reference and replace(log.reference, name=printable(log.reference.name))
    repairs, notes = (
        tuple(printable(line, files.LONGEST_LINE) for line in lines) for lines in (log.repairs, log.notes)
    )
    return replace(log, name=printable(log.name), repairs=repairs, notes=notes, reference=reference)


def _against(log: RecordedLog, path: Path) -> RecordedLog:
    """`log` with the attitudes of the file at `path` at the times of its rows."""
    from scenarios.harness.logs import reference_file

    rows_s, ledger, repairs = log.rows["t_s"], log.ledger.without("reference"), list(log.repairs)
    reader = _module(path.name.lower(), _BY_MAP)
    kind: reference_file.Kind = "filter"
    try:
        if reader and not vectors.is_reference(path):
            groups, source, notes = import_module(f"{__name__}.{reader}").groups(path)
            repairs += [f"{path.name}: {line}" for line in notes]
            R_eb = reference_file.of_table(path, groups, source, rows_s, ledger, repairs)
        else:
            other = read(path)
            repairs += [f"{path.name}: {line}" for line in other.repairs]
            R_eb, kind = reference_file.of_log(path, other, rows_s, ledger)
        found = reference_file.reference(R_eb, kind, path)
    except NothingToScore as nothing:
        ledger = log.ledger.without("reference")
        ledger.read("reference", nothing.read)
        ledger.leave_out("reference", nothing.read, nothing.reason)
        unknown = np.full((len(rows_s), 3, 3), np.nan)
        found = replace(reference_file.reference(unknown, kind, path), why_none=str(nothing))
    return replace(log, reference=found, ledger=ledger, repairs=tuple(repairs))


def _read(path: Path, meanings: column_map.ColumnMap | None, imu: int | None) -> RecordedLog:
    name = path.name.lower()
    by_map, autopilot = (_module(name, endings) for endings in (_BY_MAP, _OF_AUTOPILOTS))
    if meanings is not None and not by_map:
        raise LogError(f"{path}: a column map is for text and MATLAB files")
    if imu is not None and not autopilot and by_map != "matlab":
        raise LogError(f"{path}: an inertial unit is chosen in logs of autopilots (.bin, .ulg, their .mat)")
    if by_map == "matlab":
        return import_module(f"{__name__}.{by_map}").read(path, meanings, imu)
    if by_map:
        return import_module(f"{__name__}.{by_map}").read(path, meanings)
    if autopilot:
        return import_module(f"{__name__}.{autopilot}").read(path, imu)
    if path.is_dir() or name.endswith(".parquet"):
        return checks.mended(import_module(f"{__name__}.ours").read(path), path)
    found = foreign.hint(files.head(path, foreign.ENOUGH))
    raise LogError(f"{path}: this is {found}" if found else f"{path}: unknown kind of log; {KINDS}")


def _module(name: str, endings: dict[str, str]) -> str:
    """The reader of a file of that name, empty where none of the endings is its."""
    return next((module for ending, module in endings.items() if name.endswith(ending)), "")
