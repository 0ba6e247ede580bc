"""Logs as text in columns, packed (.gz) or not; the columns are identified by a column map or by their names."""

from dataclasses import replace
from pathlib import Path

from scenarios.harness.logs import column_groups, tabular, text_table
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import ColumnMap
from scenarios.harness.logs.recorded import LogError, RecordedLog


def read(path: Path, columns: ColumnMap | None = None) -> RecordedLog:
    """The log at `path`.

    Raises
    ------
    LogError      one line with the file, the line and the column
    """
    table = text_table.read(path, columns or ColumnMap())
    groups = _found(table, path)
    log = tabular.recorded(table.columns, table.meanings, groups)
    if table.cut:
        log.ledger.read("imu", table.cut)
        log.ledger.leave_out("imu", table.cut, "a last line that was cut off")
    return replace(log, repairs=(*table.notes, *log.repairs))


def groups(path: Path, columns: ColumnMap | None = None) -> tuple[list[column_groups.Group], Source, tuple[str, ...]]:
    """Columns of the file by our names, the source, and notes on the file; LogError as `read`."""
    table = text_table.read(path, columns or ColumnMap())
    found, source = column_groups.take(table.columns, table.meanings, _found(table, path))
    return found, source, table.notes


def _found(table: text_table.TextTable, path: Path) -> Source:
    if not table.meanings.columns:
        names = ", ".join(table.header)
        raise LogError(
            f"{path}: no column name is recognised; it has {names}: name them in a column map (--columns MAP.toml)"
        )
    return Source(path, row=lambda k: f"line {table.lines[k]}", offered=table.header)
