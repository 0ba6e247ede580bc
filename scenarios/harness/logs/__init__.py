"""Recorded logs from anywhere, read into the rows that estimators take.

One module per format; each has ``read(path, ...) -> RecordedLog``.  `read` picks the module by the file.
"""

from dataclasses import replace
from pathlib import Path

from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference

_TEXT = (".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz")
FORMATS = {
    "a folder or .parquet": "a recording of ours",
    "*_in.csv.gz": "reference vectors",
    ".csv .txt .tsv (.gz)": "columns of numbers",
    ".mat": "MATLAB",
    ".bin": "ArduPilot DataFlash",
    ".ulg": "PX4 ULog",
}


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
    from scenarios.harness.logs import checks, column_map, reference as vectors

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


def _read(path: Path, meanings: "column_map.ColumnMap | None") -> RecordedLog:  # noqa: F821 - imported when needed
    from scenarios.harness.logs import checks, matlab, ours, text

    name = path.name.lower()
    if name.endswith(_TEXT):
        return text.read(path, meanings)
    if name.endswith(".mat"):
        return matlab.read(path, meanings)
    if meanings is not None:
        raise LogError(f"{path}: a column map is for text and MATLAB files")
    if path.is_dir() or name.endswith(".parquet"):
        return ours.read(path)
    if name.endswith(".bin"):
        from scenarios.harness.logs import dataflash

        return checks.mended(dataflash.read(path), path)
    if name.endswith(".ulg"):
        from scenarios.harness.logs import ulog

        return checks.mended(ulog.read(path), path)
    kinds = "; ".join(f"{kind}: {what}" for kind, what in FORMATS.items())
    raise LogError(f"{path}: unknown kind of log ({kinds})")
