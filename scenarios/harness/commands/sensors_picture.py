"""The page of a sensor as one picture: its Allan deviation, and truth beside reading in a manoeuvre.

Imported only to draw a picture, since it loads matplotlib.
"""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from estimator.interface import G_M_S2, Array
from scenarios.harness import picture_style as style
from scenarios.harness.cli.reports import write_figure
from scenarios.harness.commands.sensors import NAMES, Page
from scenarios.harness.picture_style import BLUE, DPI, FAINT, GREEN, GRID, INK, ORANGE, RED, STYLE, VIOLET
from sim.log import Log
from sim.outside.wording import plotted
from sim.sensors import allan
from sim.sensors.trial import AtRest, MagneticTrial, Response

ROW: Final = 4.3  # inches
WIDTH: Final = 14.0
Panel = Callable[[Any], None]


def draw(page: Page, path: Path) -> None:
    """Draw the page into `path`; its ending says the format.  ValueError if it has nothing to draw."""
    rows = _rows(page)
    if not rows:
        raise ValueError(f"{page.subject.name}: there is nothing to draw of it")
    height = ROW * len(rows) + 1.35
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), facecolor="white")
        edges = {"left": 0.06, "right": 0.965, "top": 1.0 - 1.4 / height, "bottom": 0.62 / height}
        grid = figure.add_gridspec(len(rows), 30, hspace=0.36, wspace=0.0, **edges)
        for i, row in enumerate(rows):
            for (first, last), panel in zip(((0, 12), (14, 22), (24, 30)), row, strict=False):
                panel(figure.add_subplot(grid[i, first:last]))
        about = page.subject
        style.heading(figure, 0.06, 0.965, plotted(about.name), plotted(about.about, 160), "wingslevel sensors")
        write_figure(path, figure, DPI)


def _rows(page: Page) -> list[list[Panel]]:
    """The panels, a row for each sensor, the widest first."""
    rows: list[list[Panel]] = []
    log = page.exercise
    for kind, rest in page.at_rest.items():
        if log is not None and np.any(rest.variances > 0.0):
            moved = [partial(panel, kind=kind, log=log) for panel in (_exercise, _still)]
            rows.append([partial(_allan, rest=rest), *moved])
    if page.response is not None:
        rows.append([partial(panel, r=page.response) for panel in (_course, _speed, _track)])
    if page.magnetic is not None:
        rows.append([partial(panel, trial=page.magnetic) for panel in (_heading_error, _level_field)])
    if page.air is not None:
        fitted = [kind for kind in ("airspeed", "barometer") if kind in page.subject.devices]
        rows.append([partial(_air, kind=kind, log=page.air) for kind in fitted])
    return rows


def _allan(ax: Any, rest: AtRest) -> None:
    """Mean Allan deviation of all axes, the middle nine tenths of them, and the three asymptotes stated."""
    tau, stated = rest.tau_s, rest.stated
    low, high = (np.sqrt(np.quantile(rest.variances, share, axis=1)) for share in (0.05, 0.95))
    ax.fill_between(tau, low, high, color=BLUE, alpha=0.16, lw=0, label="nine axes in ten, an hour each")
    hours = f"{rest.axis_hours:.0f} axis-hours"
    ax.loglog(tau, rest.deviation, "o-", color=BLUE, ms=4.5, mec="white", mew=0.8, label=hours)
    floor, top = 0.45 * float(low.min()), 1.8 * float(high.max())
    if np.any(stated.deviation(tau) > 0.0):
        ax.loglog(tau, stated.deviation(tau), color=INK, lw=1.1, ls=(0, (4, 2)), label="as stated", zorder=4)
    ax.set(xlim=(float(tau[0]) / 1.25, float(tau[-1]) * 1.25), ylim=(floor, top))
    unit = rest.unit.replace("ug", "µg")
    flat, walk = np.full_like(tau, math.sqrt(allan.FLICKER) * stated.flicker), stated.walk * np.sqrt(tau / 3.0)
    _asymptote(ax, tau, stated.white / np.sqrt(tau), ORANGE, f"N = {stated.white:.3g} {unit}·√s", 0.8, (-12.0, -8.0))
    _asymptote(ax, tau, flat, GREEN, f"0.664 B, B = {stated.flicker:.3g} {unit}", 0.0, (0.0, 8.0))
    _asymptote(ax, tau, walk, VIOLET, f"K = {stated.walk:.3g} {unit}/√s", 0.6, (-10.0, 7.0))
    ax.set(xlabel="averaged over τ, s", ylabel=f"Allan deviation, {unit}")
    ax.legend(loc="upper right")
    words = [
        f"{NAMES[name]} {c.measured:.3g}, {100.0 * c.difference:+.1f} %"
        for name, c in rest.coefficients.items()
        if c.difference is not None and not (name == "rate_random_walk" and rest.walk_is_hidden)
    ]
    style.note(ax, "     ".join(words))
    ax.set_title(f"{rest.kind.capitalize()} at rest, before the converter", pad=15)


def _asymptote(
    ax: Any, tau: Array, line: Array, colour: str, text: str, where: float, offset: tuple[float, float]
) -> None:
    """One term alone, with its name beside it at the part `where` of what is visible of it."""
    floor, top = ax.get_ylim()
    seen = (line > 1.15 * floor) & (line < 0.8 * top)
    if not seen.any():
        return
    ax.plot(tau, line, color=colour, lw=1.0)
    x = np.exp(np.interp(where, [0.0, 1.0], np.log(tau[seen][[0, -1]])))
    y = float(np.exp(np.interp(math.log(x), np.log(tau), np.log(line))))
    ax.annotate(
        text, (x, y), offset, textcoords="offset points", fontsize=8.3, color=colour,
        ha="right" if offset[0] else "left", va="center", bbox=style.BOX, zorder=6,
    )  # fmt: skip


def _signal(kind: str, log: Log) -> tuple[Array, Array, Array]:
    """Time, truth and reading of the exercised axis: roll rate in deg/s, or load factor in g."""
    t_s = log.truth["t_s"]
    if kind == "gyro":
        truth, reading = log.truth["imu_omega_b_rad_s"][:, 0], log.measured["gyro_b_rad_s"][:, 0]
        return t_s, np.degrees(truth), np.degrees(reading)
    truth, reading = log.truth["imu_force_b_m_s2"][:, 2], log.measured["force_b_m_s2"][:, 2]
    return t_s, -truth / G_M_S2, -reading / G_M_S2


def _exercise(ax: Any, kind: str, log: Log) -> None:
    t_s, truth, reading = _signal(kind, log)
    first, last, what = (2.8, 5.7, "A roll out and back") if kind == "gyro" else (0.8, 5.7, "A pull-up and a roll")
    shown = (t_s >= first) & (t_s <= last)
    ax.plot(t_s[shown], truth[shown], color=INK, lw=1.1, label="truth")
    ax.step(t_s[shown], reading[shown], color=RED, lw=1.2, where="post", label="reading")
    word = "roll rate, deg/s" if kind == "gyro" else "load along z, upwards, g"
    ax.set(xlabel="time, s", ylabel=word, title=what)
    ax.margins(y=0.16)
    ax.legend(loc="upper right")


def _still(ax: Any, kind: str, log: Log) -> None:
    """A second of level flight, enlarged: the noise, and the steps as grey lines; the bias as a number."""
    t_s, truth, reading = _signal(kind, log)
    shown = t_s < 1.0
    scale, unit = (1.0, "deg/s") if kind == "gyro" else (1e3, "mg")
    told = scale * reading[shown]
    ax.step(t_s[shown], told, color=RED, lw=1.2, where="post")
    ax.plot(t_s[shown], told, "o", color=RED, ms=2.6)
    ax.grid(False)
    levels = np.unique(told)
    step = float(np.diff(levels).min()) if len(levels) > 1 else 0.0
    spread = float(np.ptp(told)) or 1.0
    if step > spread / 60.0:
        first = math.floor(-0.3 * spread / step)
        for i in range(first, math.ceil(1.3 * spread / step) + 1):
            ax.axhline(float(levels[0]) + i * step, color=GRID, lw=0.8, zorder=0)
    ax.set_ylim(told.min() - 0.25 * spread, told.max() + 0.35 * spread)
    error = scale * float((reading - truth)[shown].mean())
    ax.text(0.03, 0.96, f"mean error {error:+.3g} {unit}", transform=ax.transAxes, fontsize=8.3, color=FAINT, va="top")
    ax.set(xlabel="time, s", ylabel=unit, title="Held still, enlarged")
    ax.ticklabel_format(axis="y", useOffset=False)


def _course(ax: Any, r: Response) -> None:
    """Course in the quarter turn, true and reported."""
    t_s = r.turn.truth["t_s"] - r.when_s
    v = r.turn.truth["v_e_m_s"]
    told = (np.degrees(r.turn.measured["gps_course_rad"]) + 180.0) % 360.0 - 180.0
    ax.plot(t_s, np.degrees(np.arctan2(v[:, 1], v[:, 0])), color=INK, lw=1.1, label="truth")
    ax.step(t_s, told, color=RED, where="post", label="reported")
    ax.axhline(63.2 * 0.9, color=FAINT, lw=0.9, ls=(0, (4, 3)))
    ax.text(-0.9, 63.2 * 0.9 + 1.5, f"63 %: {r.course_delay_s:.2f} s late", fontsize=8.3, color=FAINT)
    ax.set(xlim=(-1.0, _shown_s(r)), ylim=(-6.0, 98.0), xlabel="time since the turn began, s", ylabel="course, deg")
    ax.set_title("GPS in a quarter turn, without its noise")
    ax.legend(loc="lower right")


def _shown_s(r: Response) -> float:
    return max(6.0, 2.0 + 4.0 * r.speed_delay_s)


def _speed(ax: Any, r: Response) -> None:
    """Speed in the step, and the speed that shrinks in the turn."""
    t_s = r.step.truth["t_s"] - r.when_s
    ax.plot(t_s, r.step.truth["v_e_m_s"][:, 0], color=INK, lw=1.1, label="a step of speed")
    ax.step(t_s, r.step.measured["gps_speed_m_s"], color=RED, where="post", label="reported")
    ax.step(t_s, r.turn.measured["gps_speed_m_s"], color=ORANGE, where="post", lw=1.3, label="in the turn, 12 m/s")
    ax.axvline(r.speed_delay_s, color=FAINT, lw=0.9, ls=(0, (4, 3)))
    ax.text(r.speed_delay_s, 5.3, f" 63 % after {r.speed_delay_s:.2f} s", fontsize=8.3, color=FAINT)
    ax.set(xlim=(-1.0, _shown_s(r)), xlabel="time since the change, s", ylabel="speed, m/s", title="Speed")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.1))


def _track(ax: Any, r: Response) -> None:
    """The turn from above."""
    shown = (r.turn.truth["t_s"] > r.when_s - 1.5) & (r.turn.truth["t_s"] < r.when_s + 4.5)
    p, q = r.turn.truth["p_e_m"][shown], r.turn.measured[shown]
    told = q["gps_p_e_m"][q["gps_new"] == 1]
    north = float(p[0, 0])
    ax.plot(p[:, 1], p[:, 0] - north, color=INK, lw=1.1)
    ax.plot(told[:, 1], told[:, 0] - north, "o", color=RED, ms=4)
    ax.set(xlabel="east, m", ylabel="north, m", title="Track, fixes as they arrive", aspect="equal")
    ax.set_adjustable("datalim")


def _heading_error(ax: Any, trial: MagneticTrial) -> None:
    """Error of the heading from the level components, round the compass."""
    order = np.argsort(trial.truth_deg)
    ax.plot(trial.truth_deg[order], trial.error_deg[order], ".", color=RED, ms=3.5)
    ax.axhline(0.0, color=INK, lw=1.1)
    ax.set(xlim=(0, 360), xticks=range(0, 361, 45), xlabel="true heading, deg", ylabel="error of the heading, deg")
    ax.set_title(f"Magnetometer in a level turn, RMS {trial.heading_rms_deg:.1f} deg")


def _level_field(ax: Any, trial: MagneticTrial) -> None:
    """The level components: a circle round zero, without iron."""
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    ax.plot(trial.horizontal_ut * np.cos(angle), trial.horizontal_ut * np.sin(angle), color=INK, lw=1.1)
    ax.plot(trial.readings_ut[:, 0], trial.readings_ut[:, 1], ".", color=RED, ms=3)
    ax.axhline(0.0, color=FAINT, lw=0.7)
    ax.axvline(0.0, color=FAINT, lw=0.7)
    ax.set(xlabel="x, uT", ylabel="y, uT", title="The level field in it", aspect="equal")
    ax.set_adjustable("datalim")


def _air(ax: Any, kind: str, log: Log) -> None:
    """Half a minute of swinging airspeed or height."""
    shown = log.truth["t_s"] <= 30.0
    truth, read = log.truth[shown], log.measured[shown]
    new = read["air_new"] == 1
    if kind == "airspeed":
        true, told, word, title = truth["airspeed_m_s"], read["equivalent_airspeed_m_s"], "airspeed, m/s", "Pitot tube"
    else:
        true, told, word, title = -truth["p_e_m"][:, 2], read["baro_height_m"], "height, m", "Barometer"
    ax.plot(truth["t_s"], true, color=INK, lw=1.1, label="truth")
    ax.plot(truth["t_s"][new], told[new], ".", color=RED, ms=4, label="reading")
    ax.set(xlabel="time, s", ylabel=word, title=title)
    ax.legend(loc="upper right")
