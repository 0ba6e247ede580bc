"""Logs of comma-separated numbers, packed (.gz) or not, with a header of names: by a column map or by their names.

Cells may be empty where nothing was measured.  Lines that begin with # are remarks.
"""

import csv
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.interface import Array
from scenarios.harness.logs import tabular
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import ColumnMap, automatic
from scenarios.harness.logs.recorded import LogError, RecordedLog


def read(path: Path, columns: ColumnMap | None = None) -> RecordedLog:
    """The log at `path`.

    Raises
    ------
    LogError      one line with the file, the line and the column
    """
    table, lines, cut = _table(path, columns or ColumnMap())
    source = Source(path, row=lambda k: f"line {lines[k]}")
    log = tabular.recorded(table, columns or automatic(table), source)
    return replace(log, repairs=(cut, *log.repairs)) if cut else log


def attitudes(path: Path, columns: ColumnMap | None = None) -> tuple[Array, Array]:
    """Times, s, and attitudes, shape (N, 3, 3), of a file that holds these; LogError where it does not."""
    table, lines, _ = _table(path, columns or ColumnMap())
    source = Source(path, row=lambda k: f"line {lines[k]}")
    taken, source = tabular.take(table, columns or automatic(table), source)
    R_eb = tabular.attitude(taken)
    if R_eb is None or "time" not in taken:
        raise LogError(f"{path}: no time and attitude in it (roll pitch yaw, qw qx qy qz, or r00 to r22)")
    return taken["time"], R_eb


def _table(path: Path, how: ColumnMap) -> tuple[dict[str, Array], list[int], str]:
    """Columns of the file by their names, the line of each row, and what to say of a last line that was cut off."""
    lines = _text(path).splitlines()
    at = [i for i in range(how.skip_lines, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    cells = [[cell.strip() for cell in row] for row in csv.reader((lines[i] for i in at), delimiter=how.delimiter)]
    if len(cells) != len(at):
        raise LogError(f"{path}: a quotation mark that opens and does not close")
    if len(cells) < 2:
        raise LogError(f"{path}: {len(cells)} lines; a header and rows of numbers are needed")
    header, rows, at = cells[0], cells[1:], at[1:]
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        raise LogError(f"{path}: line {at[0]}: two columns are named {twice[0]!r}")
    cut = ""
    if len(rows[-1]) < len(header) or (len(rows) > 1 and _cut_cell(rows[-1], rows[-2])):
        cut = f"line {at[-1] + 1}, the last, was cut off: left out"
        rows, at = rows[:-1], at[:-1]
    for i, row in zip(at, rows, strict=True):
        if len(row) != len(header):
            raise LogError(f"{path}: line {i + 1}: {len(row)} cells; the header has {len(header)}")
    try:
        values = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows], dtype=float)
    except ValueError:
        return _numeric(path, how, header, rows, at), [i + 1 for i in at], cut
    if not rows:
        raise LogError(f"{path}: no row of numbers")
    return dict(zip(header, values.T, strict=True)), [i + 1 for i in at], cut


def _numeric(path: Path, how: ColumnMap, header: list[str], rows: list[list[str]], at: list[int]) -> dict[str, Array]:
    """Columns one by one, without those of words that nobody asked for; LogError with line and column elsewhere."""
    wanted = set(how.columns or automatic(header).columns)
    columns = {}
    for j, name in enumerate(header):
        try:
            columns[name] = np.array([float(row[j]) if row[j] else np.nan for row in rows])
        except ValueError as error:
            if name in wanted:
                i, cell = next((i, row[j]) for i, row in zip(at, rows, strict=True) if not _is_number(row[j]))
                raise LogError(f"{path}: line {i + 1}, column {name}: {cell!r} is no number") from error
    return columns


def _is_number(cell: str) -> bool:
    """Whether the cell holds a number, or nothing."""
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _cut_cell(row: list[str], before: list[str]) -> bool:
    """Whether the last cell of `row` is the beginning of a number, as in "-" or "1e", below a whole one."""
    return not _is_number(row[-1]) and _is_number(before[-1])


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
        return (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode("utf-8-sig")
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read: {error}") from error
