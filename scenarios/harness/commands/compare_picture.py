"""The comparison as one picture: how the errors go with time, how they are spread, and a line for each estimator.

Imported only to draw a picture, since it loads matplotlib.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from estimator.interface import Array
from scenarios.harness import picture_style as style
from scenarios.harness.cli.reports import write_figure
from scenarios.harness.commands.comparison import LETTERS, Comparison, Entrant, checks_text
from scenarios.harness.metrics import Series, p95, rms
from scenarios.harness.picture_style import BLUE, DPI, FAINT, GREEN, GRID, INK, ORANGE, RED, STYLE, TEAL, VIOLET
from scenarios.harness.plugins import short_name
from sim.outside.wording import plotted

COLOURS = (
    BLUE, ORANGE, GREEN, VIOLET, RED, TEAL, "#8c6d31", "#d6479a", "#5b6f8f", "#9aa61f", "#17a0c4", "#a0522d",
    "#6a51a3", "#e39802", "#2f6b4f", "#b83b5e", "#444e57", "#00a676",
)  # fmt: skip
WIDTH = 14.0
LEAST_DEG = 0.03  # what is less is drawn here
TICKS_DEG = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0, 180.0)
BIN_S = 1.0
MANY = 8  # more lines than these are drawn thin, smoother and without shades


def draw(comparison: Comparison, path: Path) -> None:
    """Draw `comparison` into `path`; its ending says the format.  ValueError if nothing was flown."""
    figure = figure_of(comparison)
    with matplotlib.rc_context(STYLE):  # some parts of a figure are made as it is written
        write_figure(path, figure, DPI)


def figure_of(comparison: Comparison, kind: type[Figure] = Figure) -> Figure:
    """`comparison` as a figure of the class `kind`; ValueError if nothing was flown."""
    flown = [e for e in comparison.entrants if e.flights]
    if not flown:
        raise ValueError("nothing was flown: there is nothing to draw")
    colours = {e.name: COLOURS[i % len(COLOURS)] for i, e in enumerate(comparison.entrants)}
    table = 0.36 * len(flown) + 0.3  # inches
    height = 1.35 + 4.3 + 1.1 + table + 0.7
    with matplotlib.rc_context(STYLE):
        figure = kind(figsize=(WIDTH, height), facecolor="white")
        FigureCanvasAgg(figure)
        edges = {"left": 0.055, "right": 0.975, "top": 1.0 - 1.35 / height, "bottom": 0.62 / height}
        rows = figure.add_gridspec(2, 1, height_ratios=(4.3, table), hspace=2 * 1.1 / (4.3 + table), **edges)
        upper = rows[0].subgridspec(1, 2, width_ratios=(2.1, 1.0), wspace=0.14)
        name = plotted(comparison.scenario.name.replace("_", " "))
        style.heading(figure, 0.055, 0.975, name, _facts(comparison), "wingslevel compare")
        _over_time(figure.add_subplot(upper[0]), flown, colours)
        _spread(figure.add_subplot(upper[1]), flown, colours)
        lower = rows[1].subgridspec(1, 4, width_ratios=(1.85, 2.2, 2.2, 1.5), wspace=0.06)
        _names(figure.add_subplot(lower[0]), flown, colours)
        _strips(figure.add_subplot(lower[1]), flown, colours, "inclination")
        _strips(figure.add_subplot(lower[2]), flown, colours, "heading")
        _costs(figure.add_subplot(lower[3]), flown, colours)
    return figure


def _facts(comparison: Comparison) -> str:
    config, n = comparison.config, len(comparison.seeds)
    facts = (
        plotted(comparison.scenario.summary, 120),
        f"{n} {'seed' if n == 1 else 'seeds'}, the same for each",
        plotted(config.aircraft.replace("_", " ")),
        f"sensors {plotted(Path(config.suite).stem)}",
        f"wind {config.air.wind_m_s:g} m/s, turbulence W20 {config.air.turbulence_w20_m_s:g} m/s",
    )
    return "     ".join(facts)


def _log_degrees(axis: Any, low: float, high: float) -> None:
    """Marks at round angles on a logarithmic axis."""
    axis.set_major_locator(FixedLocator([t for t in TICKS_DEG if low <= t <= 1.05 * high]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _binned(series: Sequence[Series], bin_s: float) -> tuple[Array, Array]:
    """Times, and the RMS of each interval of each flight, shape (flights, intervals); NaN after a flight's end."""
    last_s = max((float(s.t_s[-1]) for s in series if len(s.t_s)), default=0.0)
    edges = np.arange(0.0, last_s + bin_s, bin_s)
    values = np.full((len(series), max(len(edges) - 1, 1)), np.nan)
    for i, one in enumerate(series):
        intervals = np.floor(one.t_s / bin_s).astype(int)
        for k in range(values.shape[1]):
            inside = one.judged & (intervals == k)
            if inside.any():
                values[i, k] = rms(one.value[inside])
    return edges[:-1] + 0.5 * bin_s if len(edges) > 1 else np.array([0.5 * bin_s]), values


def _over_time(ax: Any, entrants: Sequence[Entrant], colours: dict[str, str]) -> None:
    """Median of the seeds, the middle half of them shaded, a cross if a flight ended early."""
    top, many = 1.0, len(entrants) > MANY
    bin_s = 3.0 * BIN_S if many else BIN_S
    for e in entrants:
        t, values = _binned([f.inclination for f in e.flights], bin_s)
        seen = np.isfinite(values).any(axis=0)
        t, values = t[seen], np.maximum(values[:, seen], LEAST_DEG)
        if not len(t):
            continue
        low, median, high = np.nanpercentile(values, (25.0, 50.0, 75.0), axis=0)
        if len(e.flights) > 2 and not many:
            ax.fill_between(t, low, high, color=colours[e.name], alpha=0.13, lw=0)
        ax.plot(t, median, color=colours[e.name], lw=1.3 if many else 1.6)
        for flight in values:
            last = int(np.flatnonzero(np.isfinite(flight))[-1]) if np.isfinite(flight).any() else -1
            if 0 <= last < len(t) - 1 or (last >= 0 and e.survived < len(e.flights) and len(e.flights) == 1):
                ax.plot(t[last], flight[last], "x", color=colours[e.name], ms=6, mew=1.8, zorder=5)
        top = max(top, float(np.nanmax(high)))
    floor = max(LEAST_DEG, 0.7 * min(float(line.get_ydata().min()) for line in ax.lines))
    ax.set(yscale="log", ylim=(floor, 1.6 * top), xlabel="time since the release, s", ylabel="inclination error, deg")
    ax.set_title("Inclination error over time", pad=15)
    shaded = not many and any(len(e.flights) > 2 for e in entrants)
    shade = "shade: the middle half     " if shaded else ""
    style.note(ax, f"line: median of the seeds, RMS of every {bin_s:g} s     {shade}cross: a flight that ended early")
    ax.margins(x=0.01)
    _log_degrees(ax.yaxis, floor, 1.6 * top)


def _spread(ax: Any, entrants: Sequence[Entrant], colours: dict[str, str]) -> None:
    """Share of all samples below an error."""
    share = np.linspace(0.0, 1.0, 401)
    low, high = math.inf, 1.0
    for e in entrants:
        joined = np.concatenate([f.inclination.judged_values for f in e.flights])
        if not len(joined):
            continue
        error = np.maximum(np.quantile(joined, share), LEAST_DEG)
        ax.plot(error, 100.0 * share, color=colours[e.name])
        ax.plot(error[380], 95.0, "o", color=colours[e.name], ms=5.5, mec="white", mew=1.0, zorder=5)
        low, high = min(low, float(error[8])), max(high, float(error[-1]))
    ax.axhline(95.0, color=FAINT, lw=0.8, ls=(0, (4, 3)), zorder=1)
    ax.set(xscale="log", xlim=(0.8 * low, 1.15 * high), ylim=(0.0, 101.0))
    ax.set(xlabel="inclination error, deg", ylabel="time spent below it, %")
    ax.set_title("Distribution of the error", pad=15)
    style.note(ax, "all seeds together     disc: 95 %")
    _log_degrees(ax.xaxis, 0.8 * low, 1.15 * high)


def _lines(ax: Any, entrants: Sequence[Entrant]) -> None:
    """A line for each estimator, the first on top."""
    ax.set(ylim=(len(entrants) - 0.45, -0.55), yticks=range(len(entrants)))
    ax.set_yticklabels([])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    ax.grid(axis="y", visible=False)
    for i in range(0, len(entrants), 2):
        ax.axhspan(i - 0.5, i + 0.5, color=GRID, alpha=0.35, lw=0, zorder=0)


def _names(ax: Any, entrants: Sequence[Entrant], colours: dict[str, str]) -> None:
    """Name, and a chip for each instrument that it was given."""
    _lines(ax, entrants)
    ax.set(xlim=(0.0, 1.0), xticks=[])
    ax.spines["bottom"].set_visible(False)
    for i, e in enumerate(entrants):
        ax.plot([0.005, 0.04], [i, i], color=colours[e.name], lw=4, solid_capstyle="butt")
        name = plotted(short_name(e.name), 40)
        ax.text(0.055, i, name, va="center", fontweight="bold", fontsize=9.0 if len(name) < 22 else 7.6)
        for j, (instrument, letter) in enumerate(LETTERS.items()):
            has = instrument in e.given
            box = {"boxstyle": "round,pad=0.18", "facecolor": INK if has else "none", "edgecolor": "none"}
            ax.text(
                0.79 + 0.048 * j, i, letter, ha="center", va="center", fontsize=7, family="monospace",
                color="white" if has else "#c5ccd3", bbox=box if has else None,
            )  # fmt: skip
    ax.set_title("Estimator", pad=15)
    ax.text(0.995, 1.0, "inputs used", transform=ax.transAxes, fontsize=7.8, color=FAINT, ha="right", va="bottom")
    meaning = "   ".join(f"{letter} {name}" + "\n" * (letter == "P") for name, letter in LETTERS.items())
    meaning = meaning.replace("\n   ", "\n")
    ax.text(0.0, -0.06, meaning, transform=ax.transAxes, fontsize=7.0, color=FAINT, va="top")


def _strips(ax: Any, entrants: Sequence[Entrant], colours: dict[str, str], which: str) -> None:
    """RMS of each seed as a dot, of all of them as a bar's end, the 95th percentile of all samples as a tick."""
    _lines(ax, entrants)
    low, high = math.inf, 1.0
    for i, e in enumerate(entrants):
        series = [getattr(f, which).judged_values for f in e.flights]
        each = np.maximum([rms(v) for v in series if len(v)], LEAST_DEG)
        if not len(each):
            continue
        pooled, most = e.numbers[f"{which}_rms_deg"], p95(np.concatenate(series))
        ax.plot([pooled, max(most, pooled)], [i, i], color=colours[e.name], lw=1.4, alpha=0.6, zorder=2)
        ax.plot(most, i, "|", color=colours[e.name], ms=9, mew=1.8, zorder=3)
        ax.plot(each, np.full(len(each), float(i)), "o", color=colours[e.name], ms=4.5, alpha=0.35, mew=0, zorder=3)
        ax.plot(pooled, i, "D", color=colours[e.name], ms=6.5, mec="white", mew=1.0, zorder=5)
        unit = f"{pooled:.2f}°" if pooled < 9.995 else f"{pooled:.1f}°"
        side = f" {e.heading_reference}" if which == "heading" else ""
        ax.text(0.995, i, unit + side, transform=ax.get_yaxis_transform(), ha="right", va="center", fontsize=8.3)
        low, high = min(low, float(each.min())), max(high, most, float(each.max()))
    low, high = (0.8 * low, 1.15 * high) if math.isfinite(low) else (0.1, 1.0)
    ax.set(xscale="log", xlim=(low, high * (high / low) ** (0.3 if which == "heading" else 0.22)))
    ax.set(xlabel="deg")
    ax.set_title(f"{which.capitalize()} error", pad=15)
    style.note(ax, "dot: RMS of a seed    diamond: of all    bar: 95 % of samples", 1.0, va="bottom")
    _log_degrees(ax.xaxis, low, high)


def _costs(ax: Any, entrants: Sequence[Entrant], colours: dict[str, str]) -> None:
    """Cost of an update as a bar; flights that lasted and checks passed as text beside it."""
    _lines(ax, entrants)
    spent = [e.cost.ns for e in entrants if e.cost]
    low, high = (0.5 * min(spent), 1.5 * max(spent)) if spent else (10.0, 1e4)
    for i, e in enumerate(entrants):
        if e.cost:
            ax.plot([low, e.cost.ns], [i, i], color=colours[e.name], lw=7, alpha=0.8, solid_capstyle="butt")
            text = f" {e.cost.ns:.0f} ns" if e.cost.ns < 9999.5 else f" {e.cost.ns / 1000.0:.0f} µs"
            ax.text(e.cost.ns, i, text + ("" if e.cost.replay_ns else "*"), va="center", fontsize=8.3)
        right = ax.get_yaxis_transform()
        whole = e.survived == len(e.flights)
        place = {"transform": right, "ha": "right", "va": "center", "fontsize": 8.3}
        ax.text(0.82, i, f"{e.survived}/{len(e.flights)}", color=INK if whole else RED, **place)
        ax.text(0.99, i, checks_text(e), color=INK, **place)
    ax.set(xscale="log", xlim=(low, high * (high / low) ** 1.9))
    ax.set_xticks([])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.spines["bottom"].set_visible(False)
    ax.set_title("Time per update", pad=15)
    head = {"transform": ax.transAxes, "fontsize": 7.8, "color": FAINT, "va": "bottom"}
    ax.text(0.0, 1.0, "* in Python" if any(e.cost and not e.cost.replay_ns for e in entrants) else "", **head)
    ax.text(0.82, 1.0, "lasted", ha="right", **head)
    ax.text(0.99, 1.0, "checks", ha="right", **head)
