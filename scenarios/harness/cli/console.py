"""What the user reads: tables, progress, one-line errors.  Rich is imported on first use, not on import.

Everything goes to standard output, or to standard error while standard output carries JSON.  Colour appears on a
terminal, or where FORCE_COLOR is set, and never where NO_COLOR is.  Tables fit 80 columns.
"""

import io
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Protocol

from estimator.compiler import compiling
from sim.outside.wording import escaped, printable

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.text import Text

    from estimator.instruments import Known
    from scenarios.harness.checks import Row
    from scenarios.harness.cli.terminal import Grid, Terminal
    from scenarios.harness.config import FlightConfig

USAGE, INTERRUPTED = 2, 130  # exit codes, beside those of a verdict
WIDTH = 80
COMPILING = "compiling kernels that are not cached yet: up to half a minute"
_bars: list["Progress"] = []  # on the screen now: what is written while one is there goes through its console
_LONGEST = 2000  # characters of a line on standard error


class _Wishes:
    """What the user wants printed."""

    quiet = False
    lines: list[str] | None = None  # where lines for standard error go instead


@contextmanager
def collected() -> Iterator[list[str]]:
    """Inside the block nothing is printed: gives the list of what would be written to standard error."""
    before, _Wishes.lines = _Wishes.lines, []
    try:
        yield _Wishes.lines
    finally:
        _Wishes.lines = before


def collecting() -> bool:
    """Whether lines are collected, not printed."""
    return _Wishes.lines is not None


def be_quiet(quiet: bool = True) -> None:
    """Print nothing from now on but errors, and what `last` prints."""
    _Wishes.quiet = quiet


def be_tolerant() -> None:
    """Write characters that the encoding of the standard streams lacks as escapes, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def err() -> "Terminal":
    """Standard error."""
    return _console(stderr=True)


def out() -> "Terminal":
    """Standard output."""
    return _console(stderr=False)


def _console(stderr: bool, quiet: bool | None = None) -> "Terminal":
    from scenarios.harness.cli.terminal import LEAST, Terminal

    console = Terminal(stderr=stderr, quiet=_Wishes.quiet if quiet is None else quiet)
    # A file or a pipe of unknown width takes what a table needs.
    unknown = not console.is_terminal and not os.environ.get("COLUMNS", "").isdigit()
    console.width = max(console.width, WIDTH if unknown else LEAST)
    return console


def line(text: str, style: str = "") -> None:
    """One line on standard output, whatever the text holds; the terminal wraps it."""
    from rich.text import Text

    out().print(Text(escaped(text), style), soft_wrap=True)


def titled(name: str, about: str) -> "Text":
    """The first line of a page: a name, and what follows it."""
    from rich.text import Text

    return Text(printable(name), "bold").append(escaped(about), "not bold")


def last(text: str) -> None:
    """The result in one line: printed even with ``--quiet``."""
    _console(stderr=False, quiet=False).print(escaped(text), soft_wrap=True)


def outcome(text: str) -> None:
    """The one line that replaces a page that is not printed (``--quiet``)."""
    if _Wishes.quiet:
        last(text)


def error(message: str) -> None:
    """One line on standard error, never wrapped: ``wingslevel: message``."""
    if _Wishes.lines is not None:
        _Wishes.lines.append(message)
    elif sys.stderr is not None:  # None if it was closed before we started
        sys.stderr.write(f"wingslevel: {printable(message, _LONGEST)}\n")


def note(line: str) -> None:
    """One dim line on standard error."""
    if _Wishes.lines is not None:
        _Wishes.lines.append(line)
        return
    err().print(line, style="dim", soft_wrap=True)


@contextmanager
def compiling_told() -> Iterator[compiling.Watch]:
    """Print one line when kernels start compiling inside the block; on a terminal, count them.

    Yields the function to call for each compiled kernel, those of worker processes included.
    """
    shown = _Compiling()
    before = compiling.on_compile(shown)
    compiling.on_trouble(lambda line: error(f"kernel cache: {printable(line)}"))
    try:
        yield shown
    finally:
        shown.clear()
        compiling.on_compile(before)
        compiling.on_trouble(None)


class _Compiling:
    """Called for each kernel that is compiled."""

    def __init__(self) -> None:
        self._began_s: float | None = None
        self._first = 0
        self._drawn = False

    def __call__(self, progress: compiling.Progress) -> None:
        with suppress(OSError, ValueError):  # standard error may be closed: compile all the same
            if self._began_s is None:
                self._began_s, self._first = time.monotonic(), progress.compiled
                console = _bars[-1].console if _bars else err()
                console.print(COMPILING, style="dim", soft_wrap=True)
            self._count(progress, time.monotonic() - self._began_s)

    def clear(self) -> None:
        """Wipe the count away."""
        if self._drawn:
            self._drawn = False
            with suppress(OSError, ValueError):
                sys.stderr.write("\r\x1b[K")
                sys.stderr.flush()

    def _count(self, progress: compiling.Progress, seconds: float) -> None:
        count = f"kernels compiled: {progress.compiled - self._first}, {seconds:.0f} s"
        if _bars:
            bar = _bars[-1]
            for task in bar.tasks:
                what = task.fields["what"]
                bar.update(task.id, description=f"{what} ({count})" if progress.active else what)
        elif err().is_terminal and progress.active:
            self._drawn = True
            sys.stderr.write(f"\r\x1b[K{count}")
            sys.stderr.flush()
        else:
            self.clear()


def note_left_out(scenarios: Sequence[str]) -> None:
    """List the scenarios that are not flown with the user's estimator, on one line of standard error."""
    if scenarios:
        names = ", ".join(scenarios)
        note(f"left out (they pass only if an estimator fails): {names}")


def warn_of_faults(scenario: str, config: "FlightConfig") -> None:
    """Warn of faults that begin after the end of the flight, each on a line of standard error."""
    from scenarios.harness.config.faults import never_met

    for fault in never_met(config.faults, config.held_s, config.duration_s):
        error(
            f"warning: fault {fault} never happens: {scenario} lasts from {-config.held_s:g} s to "
            f"{config.duration_s:g} s after the release"
        )


def number(value: float) -> str:
    """`value` for a column of numbers: two decimals, so that the points line up; else powers of ten."""
    if not math.isfinite(value):
        return "none"
    return f"{value:.2f}" if value == 0.0 or 0.005 <= abs(value) < 1e7 else f"{value:.1e}"


def verdict_table(title: str, rows: Sequence["Row"]) -> "Grid":
    """The results of checks: name, measured value, limit, unit, pass or FAIL."""
    from rich.text import Text

    from sim.rows import limit_figures

    grid = _grid(title)
    grid.column("check", wraps=True)
    for heading, right in (("measured", True), ("limit", True), ("unit", False), ("", False)):
        grid.column(heading, right=right)
    measured = _at_the_point([row.figure for row in rows])
    limits = _at_the_point([f"{row.sense} {limit_figures(row.limit)}" for row in rows])
    for row, value, limit in zip(rows, measured, limits, strict=True):
        word = Text("pass", "green") if row.passed else Text("FAIL", "bold red")
        name = printable(f"{row.name} ({row.note})" if row.note else row.name)
        grid.row([name, value, limit, printable(row.unit), word])
    return grid


def _at_the_point(numbers: Sequence[str]) -> list[str]:
    """`numbers`, padded on the right so that their decimal points line up in a right-aligned column."""
    behind = [len(text) - text.find(".") if "." in text else 0 for text in numbers]
    return [text + " " * (max(behind, default=0) - n) for text, n in zip(numbers, behind, strict=True)]


def claim_table(title: str, lines: Sequence[tuple[str, "Text", str]]) -> "Grid":
    """Claims of a paper: name, verdict, and the line that decides it."""
    grid = _grid(title)
    grid.show_header = False
    for wraps in (False, False, True):
        grid.column("", wraps=wraps)
    for cells in lines:
        grid.row(cells)
    return grid


def name_table(title: str, lines: Mapping[str, str]) -> "Grid":
    """Names, each with a one-line description."""
    from rich.text import Text

    grid = _grid(title)
    grid.show_header = False
    grid.column("")
    grid.column("", wraps=True)
    for name, about in lines.items():
        grid.row([printable(name), Text(printable(about), "dim")])
    return grid


def print_known(known: Mapping[str, Mapping[str, "Known"]]) -> None:
    """Print what each estimator was given of the instruments, or learnt: `known` by estimator.

    One estimator: a line for each source.  Several: a line for each property, value and source.
    """
    import textwrap

    lines: dict[str, list[str]] = {}
    for estimator, entries in known.items():
        for name, entry in entries.items():
            if entry.value is None:
                lines.setdefault(entry.source, []).append(name)
            elif len(known) == 1:
                lines.setdefault(entry.source, []).append(f"{name} {_value(entry)}")
            else:
                lines.setdefault(f"{name} {_value(entry)} ({entry.source})", []).append(estimator)
    lines = {f"{what}:": list(dict.fromkeys(lines[what])) for what in sorted(lines)}
    indent, width = 12 * " ", max(min(out().width, WIDTH) - 12, 20)
    for i, (what, texts) in enumerate(lines.items()):
        wrapped = textwrap.wrap(
            printable(f"{what} {', '.join(texts)}", _LONGEST), width, subsequent_indent="  ",
            break_on_hyphens=False, break_long_words=False,
        )  # fmt: skip
        for j, text in enumerate(wrapped):
            out().print(("known       " if i == j == 0 else indent) + text, style="dim", soft_wrap=True)


def _value(entry: "Known") -> str:
    """A property's value in a few letters."""
    if isinstance(entry.value, bool):
        return "yes" if entry.value else "no"
    return f"{entry.value:.4g}" if isinstance(entry.value, int | float) else str(entry.value)


def figure_table(title: str, figures: Mapping[str, float], unit: str) -> "Grid":
    """Names with a number each, all in one unit."""
    grid = _grid(title)
    grid.column("", wraps=True)
    grid.column(unit, right=True)
    for name, value in figures.items():
        grid.row([name, number(value)])
    return grid


def table(
    title: str,
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    text: Sequence[int] = (0,),
    wrapping: Sequence[int] = (),
) -> "Grid":
    """Any table; columns of `text` are left-aligned, the others right; no headings if all are empty.

    Columns of `wrapping` shrink if the table is too wide.
    """
    grid = _grid(title)
    grid.show_header = any(headings)
    for i, heading in enumerate(headings):
        grid.column(heading, right=i not in text, wraps=i in wrapping)
    for row in rows:
        grid.row(row)
    return grid


def _grid(title: str) -> "Grid":
    from scenarios.harness.cli.terminal import Grid

    return Grid(title)


class Advance(Protocol):
    """Moves a bar to `done` of `total`."""

    def __call__(self, done: float, total: float) -> None: ...


@contextmanager
def progress(what: str, unit: str) -> Iterator[Advance]:
    """A progress bar on standard error while the block runs; nothing if that is not a terminal."""
    console = err()
    if _Wishes.quiet or collecting() or not console.is_terminal:
        yield lambda done, total: None  # noqa: ARG005 - the signature of Advance
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns: list[Any] = [
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}"),
        TimeElapsedColumn(),
    ]
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=1.0, what=what)
        _bars.append(bar)
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        finally:
            _bars.remove(bar)
