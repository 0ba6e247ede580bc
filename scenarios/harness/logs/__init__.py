"""Recorded logs from anywhere, read into the rows that estimators take.

One module per format; each has ``read(path, ...) -> RecordedLog``.  `read` picks the module by the file.
"""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from scenarios.harness.logs import checks, column_map
from scenarios.harness.logs import reference as vectors
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference

_BY_MAP = {  # columns of numbers, which a column map explains
    **dict.fromkeys((".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz"), "text"),
    ".mat": "matlab",
}
_OF_THEMSELVES = {".parquet": "ours", ".bin": "dataflash", ".ulg": "ulog"}  # formats that say what they hold
KINDS = (
    "a folder or .parquet is a recording of ours, *_in.csv.gz reference vectors, .csv .txt .tsv (.gz) and .mat hold "
    "columns, .bin is ArduPilot's, .ulg PX4's"
)


def read(path: Path, *, reference: Path | None = None, columns: str | None = None) -> RecordedLog:
    """The log at `path`, put in order and checked, by the reader that its name asks for.

    Parameters
    ----------
    reference : attitudes to score against, in a file of their own; for reference vectors one of the same set, for
                others a text file with times on the same clock
    columns : column map of a text or MATLAB file, see `column_map`

    Raises
    ------
    LogError      one line: a file that is not there, of an unknown kind, or that cannot be believed
    """
    if not path.exists():
        raise LogError(f"no log at {path}: there is no such file")
    if columns is None and vectors.is_reference(path):
        return checks.mended(vectors.read(path, reference), path)
    log = _read(path, None if columns is None else column_map.load(columns))
    if reference is not None:
        from scenarios.harness.logs import tabular, text

        if not reference.is_file():
            raise LogError(f"no reference at {reference}: there is no such file")
        R_eb = tabular.at_times(*text.attitudes(reference), log.rows["t_s"])
        log = replace(log, reference=Reference(R_eb, "filter", reference.name))
    return log


def _read(path: Path, meanings: column_map.ColumnMap | None) -> RecordedLog:
    name = path.name.lower()
    for ending, module in _BY_MAP.items():
        if name.endswith(ending):
            return import_module(f"{__name__}.{module}").read(path, meanings)
    if meanings is not None:
        raise LogError(f"{path}: a column map is for text and MATLAB files")
    for ending, module in {**_OF_THEMSELVES, **({name: "ours"} if path.is_dir() else {})}.items():
        if name.endswith(ending):
            return checks.mended(import_module(f"{__name__}.{module}").read(path), path)
    raise LogError(f"{path}: unknown kind of log; {KINDS}")
