"""What a person reads: tables, progress, one-line errors.  Rich is imported on first use, not on import.

Everything goes to standard output, or to standard error while standard output carries JSON.  Colour appears on a
terminal, or where FORCE_COLOR is set, and never where NO_COLOR is.  Tables fit 80 columns.
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from scenarios.harness.checks import Row

WIDTH = 80


@cache
def err() -> "Console":
    """Standard error."""
    return _console(stderr=True)


@cache
def out() -> "Console":
    """Standard output."""
    return _console(stderr=False)


def _console(stderr: bool) -> "Console":
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False, emoji=False, soft_wrap=False)
    if not console.is_terminal and console.width < WIDTH:
        console.width = WIDTH
    return console


def error(message: str) -> None:
    """One line on standard error: ``wingslevel: message``."""
    print(f"wingslevel: {' '.join(message.split())}", file=sys.stderr)  # noqa: T201 - the one line must never be wrapped


def number(value: float) -> str:
    """`value` for a column of numbers: two decimals, so that the points line up; tiny ones as powers of ten."""
    if not math.isfinite(value):
        return "none"
    return f"{value:.1e}" if 0.0 < abs(value) < 0.005 else f"{value:.2f}"


def verdict_table(title: str, rows: Sequence["Row"]) -> "Table":
    """The verdict on one flight, or on several pooled: check, measured, limit, unit, pass."""
    from rich.text import Text

    grid = _table(title, ("check", "left"), ("measured", "right"), ("limit", "right"), ("unit", "left"), ("", "left"))
    for row in rows:
        word = Text("pass", "green") if row.passed else Text("FAIL", "bold red")
        name = Text(f"{row.name} ({row.note})" if row.note else row.name)
        grid.add_row(name, number(row.measured), f"{row.sense} {number(row.limit)}", row.unit, word)
    return grid


def name_table(title: str, lines: Mapping[str, str]) -> "Table":
    """Names with a line about each."""
    from rich.text import Text

    grid = _table(title, ("name", "left"), ("", "left"))
    grid.show_header = False
    for name, about in lines.items():
        grid.add_row(name, Text(about, "dim"))
    return grid


def _table(title: str, *columns: tuple[str, str]) -> "Table":
    """A plain table whose numbers never wrap: where it is narrow, the text of the first column does."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=box.SIMPLE_HEAD, title=Text(title), title_justify="left", title_style="bold", pad_edge=False)
    for i, (heading, justify) in enumerate(columns):
        wraps = i == len(columns) - 1 if not heading and justify == "left" and len(columns) == 2 else i == 0
        grid.add_column(heading, justify=justify, no_wrap=not wraps)  # type: ignore[arg-type]
    return grid


class Advance(Protocol):
    """Moves a bar to `done` of `total`."""

    def __call__(self, done: float, total: float) -> None: ...


@contextmanager
def progress(what: str, unit: str) -> Iterator[Advance]:
    """A bar on standard error while the block runs; nothing where that is no terminal."""
    if not err().is_terminal:
        yield lambda done, total: None  # noqa: ARG005
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns: list[Any] = [
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}"),
        TimeElapsedColumn(),
    ]
    with Progress(*columns, console=err(), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda done, total: bar.update(task, completed=done, total=total)
