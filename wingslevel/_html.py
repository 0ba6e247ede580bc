"""Results as a line of text, and as a small table for notebooks.  Any text that is shown may be anyone's: escaped."""

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from sim.outside.wording import printable

if TYPE_CHECKING:
    from scenarios.harness.checks import Row
    from wingslevel._flight import Flight

_GOOD, _BAD, _FAINT = "#2e8b57", "#c0392b", "#7b8794"
_CELL = "padding:2px 12px 2px 0;border:none;"
_RULE = "border-bottom:1px solid rgba(128,128,128,.35);"


def number(value: float | None, digits: int = 3) -> str:
    """A number as people read it; a dash where nothing could be measured."""
    if value is None or not math.isfinite(value):
        return "–"  # noqa: RUF001 - a dash
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value)))) if value else 0}f}"


def text(anything: object) -> str:
    """Any text as HTML."""
    return escape(printable(str(anything)))


def mark(passed: bool, words: tuple[str, str] = ("passed", "FAILED")) -> str:
    """A coloured word."""
    colour, word = (_GOOD, words[0]) if passed else (_BAD, words[1])
    return f'<span style="color:{colour};font-weight:600">{word}</span>'


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = ()) -> str:
    """A table of cells that are HTML already; columns of `right` are aligned to the right."""
    sides = ["right" if i in right else "left" for i in range(len(headings))]
    head = "".join(
        f'<th style="{_CELL}{_RULE}text-align:{side};color:{_FAINT};font-weight:500">{h}</th>'
        for h, side in zip(headings, sides, strict=True)
    )
    body = "".join(
        "<tr>"
        + "".join(
            f'<td style="{_CELL}text-align:{side};font-variant-numeric:tabular-nums">{cell}</td>'
            for cell, side in zip(row, sides, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    style = "border-collapse:collapse;border:none"
    return f'<table style="{style}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def page(title: str, below: str, *parts: str) -> str:
    """A heading (HTML), a faint line below it, and the parts."""
    line = f'<div style="color:{_FAINT};margin-bottom:6px">{below}</div>' if below else ""
    return f'<div style="line-height:1.5"><div style="font-size:110%">{title}</div>{line}{"".join(parts)}</div>'


def check_rows(rows: "Iterable[Row]") -> list[tuple[str, ...]]:
    """The lines of a verdict as cells."""
    from sim.rows import limit_figures

    return [
        (
            text(f"{row.name} ({row.note})" if row.note else row.name),
            row.figure,
            f"{'≤' if row.sense == '<=' else '≥'} {limit_figures(row.limit)}",
            text(row.unit),
            mark(row.passed, ("pass", "FAIL")),
        )
        for row in rows
    ]


CHECK_HEADINGS = ("check", "measured", "limit", "unit", "")


def metric_table(metrics: Mapping[str, Any]) -> str:
    """Numbers by name."""
    rows = [(text(name), number(value)) for name, value in metrics.items() if isinstance(value, float | int | None)]
    return table(("metric", "value"), rows, right=(1,))


def flight_line(flight: "Flight") -> str:
    """A flight in one line."""
    seed = "" if flight.seed is None else f", seed {flight.seed}"
    what = f"Flight {flight.scenario}, {flight.estimator}{seed}"
    return printable(f"{what}: {how_it_went(flight)}")


def how_it_went(flight: "Flight") -> str:
    """The outcome and the verdict, in words."""
    ended = flight.outcome.replace("_", " ")
    said = f" ({flight.message})" if flight.message else ""
    if not flight.judged:
        worst = number(flight.metrics.get("inclination_rms_deg"))
        return f"{ended}{said}, inclination RMS {worst} deg"
    rows = flight.verdict.rows
    word = "passed" if flight.passed else "FAILED"
    return f"{word}, {sum(row.passed for row in rows)} of {len(rows)} checks, {ended}{said}"


def flight_html(flight: "Flight") -> str:
    """A flight as a table for notebooks."""
    title = f"<b>{text(flight.scenario)}</b> &middot; {text(flight.estimator)}"
    title += "" if flight.seed is None else f" &middot; seed {flight.seed}"
    length_s = len(flight) * flight.dt_s - flight.release_s
    ended = f"{text(flight.outcome.replace('_', ' '))} after {length_s:.1f} s"
    below = f"{ended}: {text(flight.message)}" if flight.message else ended
    if not flight.judged:
        return page(title, below, metric_table(flight.metrics))
    title += f" &middot; {mark(flight.passed)}"
    return page(title, below, table(CHECK_HEADINGS, check_rows(flight.verdict.rows), right=(1, 2)))
