"""A flight as one figure of Matplotlib: attitude, errors, events, the way over the ground, and the verdict."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from estimator.rotation import to_euler
from scenarios.harness.picture_style import BLUE, DPI, FAINT, GREEN, INK, ORANGE, RED, STYLE, VIOLET
from sim.outside.wording import plotted
from sim.rows import limit_figures
from wingslevel._errors import WingslevelError
from wingslevel._html import number
from wingslevel._picture import Picture

if TYPE_CHECKING:
    from wingslevel._flight import Flight

Array = NDArray[np.float64]
SIZE = (13.0, 8.6)  # inches
MOST_EVENTS, MOST_ROWS = 24, 18  # shown
LEVELS = {"info": FAINT, "warn": ORANGE, "error": RED}


def plot(flight: "Flight") -> Picture:
    """Draw `flight`.

    Raises
    ------
    WingslevelError     it has no row
    """
    if not len(flight):
        raise WingslevelError("nothing was flown: there is nothing to plot")
    with matplotlib.rc_context(STYLE):
        figure = Picture(figsize=SIZE, facecolor="white", dpi=DPI)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(
            5, 2, width_ratios=(2.3, 1.0), height_ratios=(1, 1, 1, 0.9, 0.9),
            left=0.06, right=0.975, top=0.845, bottom=0.06, wspace=0.14, hspace=0.28,
        )  # fmt: skip
        _heading(figure, flight)
        _time(figure, grid, flight)
        right = grid[:, 1].subgridspec(2, 1, height_ratios=(1.45, 1.0), hspace=0.3)
        _way(figure.add_subplot(right[0]), flight)
        _verdict(figure.add_subplot(right[1]), flight)
    return figure


def _heading(figure: Figure, flight: "Flight") -> None:
    figure.text(0.06, 0.945, plotted(flight.scenario.replace("_", " ")), fontsize=21, fontweight="bold")
    facts = [flight.estimator, *([] if flight.seed is None else [f"seed {flight.seed}"])]
    air = flight.config.get("air")
    if air:
        facts.append(f"wind {air['wind_m_s']:g} m/s, turbulence W20 {air['turbulence_w20_m_s']:g} m/s")
    facts.append(flight.outcome.replace("_", " ") + (f": {flight.message}" if flight.message else ""))
    figure.text(0.06, 0.915, "     ".join(plotted(fact, 110) for fact in facts), fontsize=10, color=FAINT)
    if flight.judged:
        word, colour = ("passed", GREEN) if flight.passed else ("FAILED", RED)
        figure.text(0.975, 0.945, word, fontsize=15, fontweight="bold", color=colour, ha="right")


def _time(figure: Figure, grid: Any, flight: "Flight") -> None:
    """The panels over time: attitude, errors, and the events through all of them."""
    t_s = flight.t_s - flight.release_s
    axes = [figure.add_subplot(grid[0, 0])]
    axes += [figure.add_subplot(grid[i, 0], sharex=axes[0]) for i in range(1, 5)]
    for values, colour, label, width in _attitudes(flight):
        for axis, angle in zip(axes, values, strict=False):
            if angle is not None:
                axis.plot(t_s, angle, color=colour, label=label, linewidth=width)
    for axis, name in zip(axes, ("roll", "pitch", "heading"), strict=False):
        axis.set_ylabel(f"{name}, deg")
    axes[2].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value % 360.0:g}"))
    axes[2].legend(loc="best", ncols=3)
    errors = (
        (axes[3], flight.inclination_error_deg, "inclination\nerror, deg", "inclination_rms_deg"),
        (axes[4], flight.heading_error_deg, "heading\nerror, deg", "heading_rms_deg"),
    )
    for axis, error_deg, label, metric in errors:
        axis.axhline(0.0, color=FAINT, linewidth=0.8)
        axis.plot(t_s, error_deg, color=VIOLET, linewidth=1.2)
        axis.set_ylabel(label)
        axis.text(
            0.995, 0.92, _rms(flight, metric), transform=axis.transAxes, ha="right", va="top", color=VIOLET, fontsize=9
        )
    for axis in axes[:-1]:
        axis.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time since the release, s")
    axes[0].set_xlim(float(t_s[0]), max(float(t_s[-1]), float(t_s[0]) + flight.dt_s))
    _events(axes, flight)


def _rms(flight: "Flight", metric: str) -> str:
    """The RMS of all errors after the release, and the one that a check of the scenario judges."""
    rms, checked = (flight.metrics.get(name) for name in (metric, metric.replace("_rms_", "_error_rms_")))
    if rms is None:
        return "not judged"
    if not flight.judged:
        return f"RMS {number(rms)} deg"
    note = f"RMS from the release {number(rms)} deg"
    return note if checked is None else f"{note}, in the check {number(checked)} deg"


def _events(axes: list[Any], flight: "Flight") -> None:
    """A line through all panels for each event, its text above the first; texts keep clear of one another."""
    low_s, high_s = axes[0].get_xlim()
    gap_s, last_s = (high_s - low_s) / 26.0, -np.inf
    for event in flight.events[:MOST_EVENTS]:
        t_s, colour = event.t_s - flight.release_s, LEVELS[event.level]
        for axis in axes:
            axis.axvline(t_s, color=colour, linewidth=0.8, linestyle=(0, (2, 3)), zorder=0)
        if low_s <= t_s <= high_s and t_s - last_s >= gap_s:
            last_s = t_s
            axes[0].annotate(
                plotted(event.text, 22), (t_s, 1.02), xycoords=("data", "axes fraction"), rotation=18.0, fontsize=7,
                color=colour, ha="left", va="bottom", annotation_clip=False,
            )  # fmt: skip


def _attitudes(flight: "Flight") -> Iterator[tuple[tuple[Array | None, ...], str, str, float]]:
    """Roll, pitch and heading over time, degrees, each with colour, label and width of its line.

    Where the heading of the estimator converges to the course, the true course too.
    """
    true, estimated = (to_euler(np.asarray(table["R_eb"])) for table in (flight.truth, flight.flown))
    heading_rad = np.unwrap(true[2])
    yield (_unbroken(np.degrees(true[0])), np.degrees(true[1]), np.degrees(heading_rad)), ORANGE, "truth", 2.4
    if flight.heading_reference == "course":
        course_rad = np.arctan2(flight.truth["v_e_m_s"][:, 1], flight.truth["v_e_m_s"][:, 0])
        yield (None, None, _beside(course_rad, heading_rad)), GREEN, "true course", 1.1
    heading = _beside(estimated[2], heading_rad)
    yield (_unbroken(np.degrees(estimated[0])), np.degrees(estimated[1]), heading), BLUE, "estimate", 1.1


def _beside(angle_rad: Array, other_rad: Array) -> Array:
    """Degrees of angles, each within half a turn of the other, without lines across the panel."""
    return _unbroken(np.degrees(other_rad + np.angle(np.exp(1j * (angle_rad - other_rad)))))


def _unbroken(degrees: Array) -> Array:
    """Angles with a gap where they go round, so that no line is drawn across the panel."""
    shown = np.array(degrees)
    shown[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return shown


def _way(axis: Any, flight: "Flight") -> None:
    """The way over the ground, seen from above, coloured by the error of the inclination."""
    way, error = np.asarray(flight.truth["p_e_m"]), flight.inclination_error_deg
    north_m, east_m = way[:, 0], way[:, 1]
    axis.plot(east_m, north_m, color=FAINT, linewidth=1.0, alpha=0.6)
    judged = np.isfinite(error)
    if judged.any():
        every = max(1, int(judged.sum()) // 3000)
        dots = axis.scatter(
            east_m[judged][::every], north_m[judged][::every], c=error[judged][::every], s=6, cmap="viridis_r",
            vmin=0.0, zorder=3,
        )  # fmt: skip
        axis.figure.colorbar(dots, ax=axis, shrink=0.7, pad=0.02, label="inclination error, deg").outline.set_visible(
            False
        )
    axis.plot(east_m[0], north_m[0], "o", color=INK, markersize=5, zorder=4)
    westward = east_m[0] > 0.5 * (east_m.min() + east_m.max())  # the label stays clear of the colour bar
    x, side = (-6, "right") if westward else (6, "left")
    axis.annotate("start", (east_m[0], north_m[0]), textcoords="offset points", xytext=(x, 5), ha=side, fontsize=8)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_title("over the ground")
    axis.set_xlabel("east, m")
    axis.set_ylabel("north, m")


def _verdict(axis: Any, flight: "Flight") -> None:
    """The checks, a line each; of a replay its scores."""
    axis.set_axis_off()
    axis.set_title("checks" if flight.judged else "scores")
    if flight.judged:
        lines = [
            (row.name, row.with_unit, f"{row.sense} {limit_figures(row.limit)}", row.passed)
            for row in flight.verdict.rows
        ]
    else:
        lines = [(name, number(value), "", True) for name, value in flight.metrics.items()]
    step = min(0.125, 0.95 / max(len(lines[:MOST_ROWS]), 1))
    for i, (name, value, limit, passed) in enumerate(lines[:MOST_ROWS]):
        y, colour = 0.95 - i * step, INK if passed else RED
        for x, words, side in ((0.0, name, "left"), (0.74, value, "right"), (1.0, limit, "right")):
            axis.text(x, y, plotted(words, 34), ha=side, va="top", color=colour, fontsize=8.5, transform=axis.transAxes)
