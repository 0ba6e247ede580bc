"""Recorded logs of several formats, read into the rows that estimators take.

One module per format; each has ``read(path, ...) -> RecordedLog``.  `read` chooses the module by the file name.  Files
are not trusted: whatever a reader raises becomes a `LogError` of one line here, see `sim.outside.files`.
"""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from scenarios.harness.logs import checks, column_map, foreign
from scenarios.harness.logs import reference as vectors
from scenarios.harness.logs.recorded import Kind, LogError, NothingToScore, RecordedLog
from sim.outside import files
from sim.outside.wording import printable

_BY_MAP = {  # columns of numbers, described by a column map
    **dict.fromkeys((".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz"), "text"),
    ".mat": "matlab",
}
_OF_AUTOPILOTS = {".bin": "dataflash", ".ulg": "ulog"}  # self-describing messages, possibly of several inertial units
KINDS = (
    "recordings are folders or .parquet, reference vectors *_in.csv.gz, columns .csv .txt .tsv (.gz) or .mat, logs of "
    "ArduPilot .bin, logs of PX4 .ulg"
)


def read(
    path: Path, *, reference: Path | None = None, columns: str | None = None, imu: int | None = None
) -> RecordedLog:
    """The log at `path`, put in order and checked; its name selects the reader.

    Parameters
    ----------
    reference : a separate file with the attitudes to score against: for reference vectors one of the same set, for
                others any log with an attitude, or a table of attitudes with times on the same clock
    columns : column map of a text or MATLAB file, see `column_map`
    imu : which inertial unit of an autopilot's log, from 0; by default the first one

    Raises
    ------
    LogError      one line: a file that is missing, of an unknown kind, or implausible
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
    """LogError if `path` is neither a file nor a folder."""
    if not path.is_dir():
        files.check(path, what)


def _printable(log: RecordedLog) -> RecordedLog:
    """`log` with all text from the file made safe for a terminal."""
    reference = log.reference and replace(log.reference, name=printable(log.reference.name))
    repairs, notes = (
        tuple(printable(line, files.LONGEST_LINE) for line in lines) for lines in (log.repairs, log.notes)
    )
    return replace(log, name=printable(log.name), repairs=repairs, notes=notes, reference=reference)


def _against(log: RecordedLog, path: Path) -> RecordedLog:
    """`log` with the attitudes from the file at `path`, at the times of its rows."""
    from scenarios.harness.logs import reference_file

    rows_s, ledger, repairs = log.rows["t_s"], log.ledger.without("reference"), list(log.repairs)
    reader = _module(path.name.lower(), _BY_MAP)
    kind: Kind = "filter"
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
        raise LogError(f"{path}: --imu is for logs of autopilots (.bin, .ulg, and .mat made from them)")
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
    """The reader for a file name, empty if it has none of the `endings`."""
    return next((module for ending, module in endings.items() if name.endswith(ending)), "")
