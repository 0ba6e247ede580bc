"""Text files of numbers in columns, as loggers and spreadsheets write them; the format is detected.

Recognised: packed files (.gz), UTF-8 with and without a byte-order mark, UTF-16, Latin-1; line ends of any system;
commas, semicolons, tabs, bars or blanks between the cells; decimal commas; comments (# % //), one of which may be the
header; a row of units below the header; quotation marks; a delimiter at the end of each line; empty cells (also nan,
null, -).  Times of day and dates become seconds.

An ambiguous file is rejected, and the message names the entry of a column map that decides.
"""

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from estimator.interface import Array
from scenarios.harness.logs import foreign, units
from scenarios.harness.logs.column_map import ColumnMap
from scenarios.harness.logs.recorded import LogError
from sim.outside import files

DELIMITERS = (";", "\t", ",", "|")
REMARKS = ("#", "%", "//")
NOTHING = frozenset(
    ("", "nan", "null", "-", "--", "na", "n/a", "none", "#n/a", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan")
)
LARGEST = 512 << 20  # bytes of text
MOST_LINES, MOST_CELLS, MOST_COLUMNS = 10_000_000, 40_000_000, 10_000
csv.field_size_limit(LARGEST)  # a long cell gets an error about its content, not its length
_SAMPLE = 50  # lines examined to detect the format
_DAY_S = 86400.0
_NO_TIME = "is not a number, a time of day (12:34:56.78) or a date (2026-07-02T12:34:56.78)"
_CLOCK = re.compile(r"(\d{1,2}):([0-5]\d)(?::([0-5]?\d(?:[.,]\d*)?))?")


@dataclass(frozen=True, slots=True)
class TextTable:
    """The columns of a file that have a meaning, by their names.

    header : names of all columns      lines : line number of each row
    meanings : the map given, or made from the names      notes : what was detected, for the user to check
    cut : rows cut off at the end, 0 or 1
    """

    columns: dict[str, Array]
    header: tuple[str, ...]
    lines: list[int]
    meanings: ColumnMap
    notes: tuple[str, ...] = ()
    cut: int = 0


def read(path: Path, how: ColumnMap) -> TextTable:
    """The table in the file at `path`.

    Raises
    ------
    LogError      one line with the file, the line and the column
    """
    text = _text(path)
    if max(text.count("\n"), text.count("\r")) > MOST_LINES:
        raise LogError(f"{path}: more than {MOST_LINES} lines, the most that can be read: split the log")
    lines = re.split(r"\r\n|\n|\r", text)
    at = [i for i in range(how.skip_lines, len(lines)) if lines[i].strip()]
    remarks = [i for i in at if lines[i].lstrip().startswith(REMARKS)]
    remark = set(remarks)
    at = [i for i in at if i not in remark]
    delimiter = how.delimiter or _delimiter(path, [lines[i] for i in at])
    cells = _cells(path, [lines[i] for i in at], delimiter)
    above = 0 if how.names else _above_header(cells)
    cells, at = cells[above:], at[above:]
    header, at, cells = _header(path, how, lines, remarks, at, cells, delimiter)
    header, cells = _trimmed(header, cells)
    of_units = dict[str, str]()
    if len(cells) > 1 and _is_row_of_units(cells[0]):
        of_units = {name: unit.strip("()[] ") for name, unit in zip(header, cells[0], strict=False)}
        cells, at = cells[1:], at[1:]
    if not cells:
        raise _no_numbers(path)
    meanings = how.of(header, of_units)
    _check_names(path, header, meanings, at[0])
    decimal = how.decimal or _decimal(path, cells)
    notes, cut = [f"{above} lines above the header skipped"] if above else [], 0
    if len(cells[-1]) < len(header) or (len(cells) > 1 and _cut_cell(cells[-1], cells[-2])):
        notes.append(f"line {at[-1] + 1}, the last, was cut off: left out")
        cells, at, cut = cells[:-1], at[:-1], 1
    if not cells:
        raise _no_numbers(path)
    _check_width(path, header, cells, at, delimiter)
    of_time = [column for column, meaning in meanings.columns.items() if meaning.quantity == "time"]
    columns = {}
    for j, name in enumerate(header):
        if name not in meanings.columns:
            continue
        column = [row[j] for row in cells]
        if name in of_time and _is_clock(column):
            columns[name], note = _clock(path, column, name, lambda k: f"line {at[k] + 1}")
            notes.append(note)
        else:
            what = _NO_TIME if name in of_time else "is not a number"
            columns[name] = _numbers(path, column, (name, what), decimal, lambda k: f"line {at[k] + 1}")
    return TextTable(columns, tuple(header), [i + 1 for i in at], meanings, tuple(notes), cut)


def _no_numbers(path: Path) -> LogError:
    return LogError(f"{path}: no row of numbers: a header and rows of numbers are needed")


def unpacked(path: Path, what: str) -> bytes:
    """The content of a file, unpacked if it is packed; LogError if it is too large.  `what` says what it should be."""
    raw = files.unpacked(path, files.read(path, what, LARGEST))
    if len(raw) > LARGEST:
        raise LogError(f"{path}: {files.size(len(raw))} of text; at most {files.size(LARGEST)} can be read")
    return raw


def _text(path: Path) -> str:
    """The text of a file, packed or not."""
    raw = unpacked(path, "text log")
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16")
    if found := foreign.hint(raw):
        raise LogError(f"{path}: not text in columns; this is {found}")
    if b"\0" in raw[:1000]:
        raise LogError(f"{path}: cannot be read as text: there are zero bytes in it")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _delimiter(path: Path, lines: Sequence[str]) -> str:
    """The delimiter: the first that gives most rows the same number of cells."""
    if not lines:
        raise _no_numbers(path)
    rows = lines[1:][-_SAMPLE:] or lines  # the last ones: the first may describe the logger
    for delimiter in DELIMITERS:
        widths = [len(row) for row in csv.reader(rows, delimiter=delimiter)]
        usual = max(set(widths), key=widths.count) if widths else 0
        if usual >= 2 and 2 * widths.count(usual) > len(widths):
            return delimiter
    if all(len(line.split()) > 1 for line in rows):
        return " "
    shown = lines[0].strip()[:60]
    raise LogError(f"{path}: no columns found, the first line is {shown!r}: give the delimiter in a column map")


def _cells(path: Path, lines: Sequence[str], delimiter: str) -> list[list[str]]:
    if delimiter == " ":
        lines = [re.sub(r"[ \t]+", " ", line.strip()) for line in lines]
    if (most := sum(line.count(delimiter) + 1 for line in lines)) > MOST_CELLS:
        raise LogError(f"{path}: {most} cells; at most {MOST_CELLS} can be read: split the log")
    if (widest := max((line.count(delimiter) + 1 for line in lines), default=0)) > MOST_COLUMNS:
        raise LogError(f"{path}: {widest} cells in a line; at most {MOST_COLUMNS} columns can be read")
    cells = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    if len(cells) != len(lines):
        raise LogError(f"{path}: a quotation mark is not closed")
    return cells


def _above_header(cells: list[list[str]]) -> int:
    """How many lines are above a header of names: those whose number of cells differs from that of the rows."""
    widths = [len(row) for row in cells[1:][-_SAMPLE:]]
    usual = max(set(widths), key=widths.count) if widths else 0
    for i, row in enumerate(cells[:-1]):
        if len(row) == usual:
            return i if i and not _is_numeric(row) else 0
    return 0


def _header(
    path: Path, how: ColumnMap, lines: Sequence[str], remarks: list[int], at: list[int], cells: list[list[str]],
    delimiter: str,
) -> tuple[list[str], list[int], list[list[str]]]:  # fmt: skip
    """Column names, from the map, the first line or a comment above the numbers; and the lines and cells below."""
    if how.names:
        return list(how.names), at, cells
    if cells and not _is_numeric(cells[0]):
        if delimiter == " " and len(cells) > 1 and len(cells[0]) != len(cells[1]):  # names of several words
            apart = re.split(r"\s{2,}|\t+", lines[at[0]].strip())
            if len(apart) == len(cells[1]):
                return apart, at[1:], cells[1:]
        return cells[0], at[1:], cells[1:]
    above = [i for i in remarks if not at or i < at[0]]
    for i in reversed(above):
        bare = lines[i].lstrip().lstrip("#%/ \t")
        found = _cells(path, [bare], delimiter)[0] if bare else []
        if cells and len(found) == len(cells[0]) and not _is_numeric(found):
            return found, at, cells
    if not cells:
        raise _no_numbers(path)
    raise LogError(
        f"{path}: line {at[0] + 1} holds numbers and there is no header: write the names of its {len(cells[0])} "
        'columns in a line above it, or in a column map as names = ["t", "gx", ...]'
    )


def _trimmed(header: list[str], cells: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Header and rows without the empty cell after a delimiter at the end of the line."""
    header = list(header)
    while header and not header[-1] and all(len(row) < len(header) or not row[-1] for row in cells):
        header.pop()
    n = len(header)
    cells = [row[:n] if len(row) > n and not any(row[n:]) else row for row in cells]
    return [name or f"column {j + 1}" for j, name in enumerate(header)], cells


def _is_row_of_units(row: Sequence[str]) -> bool:
    """Whether no cell is a number and most are units."""
    bare = [cell.strip("()[] ") for cell in row]
    said = [cell for cell in bare if cell not in ("", "-")]
    known = sum(units.is_unit(cell) for cell in said)
    return bool(said) and not any(_is_number(cell) for cell in said) and 2 * known >= len(said)


def _check_names(path: Path, header: Sequence[str], meanings: ColumnMap, first: int) -> None:
    """Refuse two columns with the name of one that has a meaning."""
    for name in meanings.columns:
        if list(header).count(name) > 1:
            raise LogError(f"{path}: line {first}: two columns are named {name!r}")


def _check_width(path: Path, header: Sequence[str], cells: list[list[str]], at: list[int], delimiter: str) -> None:
    for i, row in zip(at, cells, strict=True):
        if len(row) == len(header):
            continue
        hint = ""
        if delimiter == "," and len(row) > len(header) and all(re.fullmatch(r"[-+]?\d+", cell) for cell in row if cell):
            hint = ": commas between cells may be decimal commas; export with semicolons or decimal points"
        raise LogError(f"{path}: line {i + 1}: {len(row)} cells; the header has {len(header)}{hint}")


def _decimal(path: Path, cells: list[list[str]]) -> str:
    """The decimal sign of the first lines; LogError if both occur."""
    seen = [cell for row in cells[:_SAMPLE] for cell in row]
    commas = [cell for cell in seen if re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell)]
    points = [cell for cell in seen if re.fullmatch(r"[-+]?\d*\.\d+([eE][-+]?\d+)?", cell)]
    if commas and points:
        raise LogError(
            f"{path}: both {commas[0]!r} and {points[0]!r} occur: give the decimal sign in a column map, "
            'decimal = "," or decimal = "."'
        )
    return "," if commas else "."


def _numbers(path: Path, column: list[str], name: tuple[str, str], decimal: str, where: Callable[[int], str]) -> Array:
    """The numbers of a column, NaN for empty cells; LogError, with line and column, for any other text.

    name : of the column, and what is wrong with a cell that holds other text
    """
    if decimal == ",":
        column = [cell.replace(".", "").replace(",", ".") for cell in column]
    try:
        return np.array([float(cell) if cell else np.nan for cell in column])
    except ValueError:
        pass
    values = np.full(len(column), np.nan)
    for k, cell in enumerate(column):
        if cell.lower() in NOTHING:
            continue
        try:
            values[k] = float(re.sub(r"(?<=\d)[dD](?=[-+]?\d)", "e", cell))  # Fortran's 1.0D-03
        except ValueError:
            raise LogError(f"{path}: {where(k)}, column {name[0]}: {cell!r} {name[1]}") from None
    return values


def _is_clock(column: Sequence[str]) -> bool:
    """Whether the first non-empty cell is a date or a time of day."""
    first = next((cell for cell in column if cell.lower() not in NOTHING), "")
    return not _is_number(first) and (_CLOCK.fullmatch(first) is not None or _date(first) is not None)


def _date(cell: str) -> datetime | None:
    """A date and time, UTC if no zone is given."""
    cell = re.sub(r"(\.\d{6})\d+", r"\1", cell.replace(",", "."))  # nanoseconds
    for old in ("", "/"):
        try:
            found = datetime.fromisoformat(cell.replace(old, "-") if old else cell)
        except ValueError:
            continue
        return found if found.tzinfo else found.replace(tzinfo=UTC)
    return None


def _clock(path: Path, column: Sequence[str], name: str, where: Callable[[int], str]) -> tuple[Array, str]:
    """Dates as seconds since 1970, or times of day as seconds since the first midnight; and a note about it."""
    t_s, day = np.full(len(column), np.nan), 0.0
    of_day = next((_CLOCK.fullmatch(cell) is not None for cell in column if cell.lower() not in NOTHING), False)
    latest = -np.inf
    for k, cell in enumerate(column):
        if cell.lower() in NOTHING:
            continue
        match, date = _CLOCK.fullmatch(cell), None if of_day else _date(cell)
        if of_day and match:
            second = float((match[3] or "0").replace(",", "."))
            now = 3600.0 * int(match[1]) + 60.0 * int(match[2]) + second + day
            if now < latest - 0.5 * _DAY_S:  # past midnight
                day += _DAY_S
                now += _DAY_S
            t_s[k] = latest = now
        elif date is not None:
            t_s[k] = date.timestamp()
        else:
            what = "time of day" if of_day else "date and time"
            raise LogError(f"{path}: {where(k)}, column {name}: {cell!r} is not a {what} like those above it")
    since = "midnight" if of_day else "1970"
    return t_s, f"column {name} holds {'times of day' if of_day else 'dates'}: seconds since {since}"


def _is_number(cell: str) -> bool:
    """Whether a cell holds a number or is empty."""
    if cell.lower() in NOTHING:
        return True
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _is_numeric(row: Sequence[str]) -> bool:
    """Whether a row holds numbers and no names."""
    return all(_is_number(cell) for cell in row) and any(cell.lower() not in NOTHING for cell in row)


def _cut_cell(row: list[str], before: list[str]) -> bool:
    """Whether the last cell of `row` is the start of a number, such as "-" or "1e", and the cell above is complete."""
    beginning = row[-1] == "-" or not _is_number(row[-1])
    return beginning and before[-1].lower() not in NOTHING and _is_number(before[-1])
