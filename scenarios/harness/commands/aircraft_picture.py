"""The performance page as one picture: polar, power, trim, turns, and where the modes go with speed.

Imported only to draw a picture, since it loads matplotlib.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from estimator.interface import G_M_S2
from scenarios.harness import picture_style as style
from scenarios.harness.cli.reports import write_figure
from scenarios.harness.commands.aircraft import MODE_HEADINGS, TITLES, Handbook, figures, glide_ratio, mode_rows
from scenarios.harness.picture_style import BLUE, DPI, FAINT, GREEN, GRID, INK, ORANGE, RED, STYLE, TEAL, VIOLET
from sim.aeroplane.linear import Mode, linearise, modes
from sim.aeroplane.performance import radius_m
from sim.aeroplane.trim import Trim, trim

COLOURS = {
    "short_period": BLUE,
    "phugoid": TEAL,
    "dutch_roll": ORANGE,
    "roll": RED,
    "spiral": VIOLET,
    "roll_spiral": VIOLET,
}
LOCUS_SPEEDS = 13


def draw(book: Handbook, path: Path) -> None:
    """Draw the page into `path`; its ending says the format."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(14.0, 11.4), facecolor="white")
        margins = {"left": 0.05, "right": 0.94, "top": 0.875, "bottom": 0.03}
        grid = figure.add_gridspec(3, 3, height_ratios=(1.0, 1.0, 0.66), hspace=0.32, wspace=0.24, **margins)
        style.heading(figure, 0.05, 0.94, book.name.replace("_", " "), _facts(book), "wingslevel aircraft")
        _polar(figure.add_subplot(grid[0, 0]), book)
        _power(figure.add_subplot(grid[0, 1]), book)
        _trims(figure.add_subplot(grid[0, 2]), book)
        locus = _locus(book)
        _poles(figure.add_subplot(grid[1, 0]), book, locus, near=False)
        _poles(figure.add_subplot(grid[1, 1]), book, locus, near=True)
        _turns(figure.add_subplot(grid[1, 2]), book)
        _table(figure.add_subplot(grid[2, 0]), figures(book), (0.0, 0.43, -0.46))
        _mode_table(figure.add_subplot(grid[2, 1:]), book)
        write_figure(path, figure, DPI)


def _facts(book: Handbook) -> str:
    frame = book.frame
    return (
        f"{frame.mass_kg:.2f} kg     span {frame.span_m:.2f} m     wing {frame.area_m2:.3f} m²     "
        f"{10.0 * frame.mass_kg / frame.area_m2:.1f} g/dm²     aspect ratio {frame.span_m**2 / frame.area_m2:.1f}     "
        f"still air, {book.performance.height_m:g} m"
    )


def _speeds(trims: Sequence[Trim]) -> np.ndarray:
    return np.array([t.airspeed_m_s for t in trims])


def _mark(ax: Any, x: float, y: float, text: str, colour: str, offset: tuple[float, float]) -> None:
    """A dot with a word beside it; a thin line leads to one far off."""
    ax.plot(x, y, "o", color=colour, ms=6.5, mec="white", mew=1.2, zorder=5)
    lead = {"arrowstyle": "-", "color": colour, "lw": 0.7, "shrinkB": 4} if math.hypot(*offset) > 25.0 else None
    side = {"ha": "left" if offset[0] > 0 else "right" if offset[0] < 0 else "center", "va": "center"}
    ax.annotate(
        text, (x, y), offset, textcoords="offset points", fontsize=8.3, color=colour, zorder=6, arrowprops=lead,
        bbox=style.BOX, **side,
    )  # fmt: skip


def _speed_line(ax: Any, speed_m_s: float, y: float, text: str, colour: str, side: str) -> None:
    """A dashed line at a speed, with its name beside it."""
    ax.axvline(speed_m_s, color=colour, lw=1.0, ls=style.DASHED)
    ax.text(speed_m_s, y, text, fontsize=8.3, color=colour, ha=side, transform=ax.get_xaxis_transform())


def _polar(ax: Any, book: Handbook) -> None:
    """Sink against speed, with the tangent from the origin that touches at the best glide."""
    p = book.performance
    ax.plot(_speeds(p.polar), [-t.climb_m_s for t in p.polar], color=BLUE)
    reach = np.array([0.0, 1.6 * p.best_glide.airspeed_m_s])
    ax.plot(reach, reach * math.sin(-p.best_glide.climb_rad), color=GREEN, lw=1.0, ls=style.DASHED)
    for t, what, colour, offset in (
        (p.best_glide, f"best glide {glide_ratio(p.best_glide):.1f} : 1\nat", GREEN, (16, 18)),
        (p.min_sink, f"least sink {-p.min_sink.climb_m_s:.2f} m/s\nat", ORANGE, (-34, -34)),
        (p.stall, "stall", RED, (-4, -66)),
    ):
        _mark(ax, t.airspeed_m_s, -t.climb_m_s, f"{what} {t.airspeed_m_s:.1f} m/s", colour, offset)
    ax.set(xlim=(0.0, 2.2 * p.stall.airspeed_m_s), ylim=(3.4 * -p.min_sink.climb_m_s, 0.0))
    ax.set(xlabel="airspeed, m/s", ylabel="sink, m/s", title="Glide polar" + (", motor off" if p.top_speed else ""))


def _power(ax: Any, book: Handbook) -> None:
    """Power to stay level, of the drag with the motor off, and at full throttle; the gap is what climbs."""
    p = book.performance
    weight_n = book.frame.mass_kg * G_M_S2
    held = [t for t in p.polar if t.alpha_rad <= p.stall.alpha_rad]
    if not p.climbs or p.best_climb is None or p.steepest is None or p.top_speed is None:
        _glide_ratios(ax, book, held)
        return
    speeds = _speeds(p.climbs)
    needed = np.interp(speeds, _speeds(held)[::-1], [-weight_n * t.climb_m_s for t in held[::-1]], right=math.nan)
    spare = np.array([weight_n * t.climb_m_s for t in p.climbs])
    ax.fill_between(speeds, needed, needed + spare, color=GREEN, alpha=0.10, lw=0)
    ax.plot(speeds, needed, color=BLUE, label="needed, weight times sink")
    ax.plot(speeds, needed + spare, color=GREEN, label="at full throttle")
    ax.set_ylim(0.0, 1.22 * float(np.nanmax(needed + spare)))
    ax.legend(loc="upper left")
    best = p.best_climb
    low = float(np.interp(best.airspeed_m_s, speeds, needed))
    high = low + weight_n * best.climb_m_s
    arrow = {"arrowstyle": "<->", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (best.airspeed_m_s, low), (best.airspeed_m_s, high), arrowprops=arrow)
    text = f"best climb\n{best.climb_m_s:.1f} m/s\nat {best.airspeed_m_s:.1f} m/s"
    ax.text(best.airspeed_m_s * 1.02, 0.5 * (low + high), text, fontsize=8.3, va="center")
    top = p.top_speed.airspeed_m_s
    _speed_line(ax, top, 0.02, f"top speed {top:.1f} m/s ", RED, "right")
    ax.set(xlabel="airspeed, m/s", ylabel="power, W", title="Power and climb")


def _glide_ratios(ax: Any, book: Handbook, held: Sequence[Trim]) -> None:
    """Without a motor: glide ratio against speed."""
    p = book.performance
    ax.plot(_speeds(held), [glide_ratio(t) for t in held], color=BLUE)
    best = p.best_glide
    text = f"{glide_ratio(best):.1f} at {best.airspeed_m_s:.1f} m/s"
    _mark(ax, best.airspeed_m_s, glide_ratio(best), text, GREEN, (0, 11))
    _mark(ax, p.min_sink.airspeed_m_s, glide_ratio(p.min_sink), "least sink", ORANGE, (9, -6))
    ax.set_ylim(0.0, 1.18 * glide_ratio(best))
    ax.set(xlabel="airspeed, m/s", ylabel="glide ratio", title="Glide ratio")


def _trims(ax: Any, book: Handbook) -> None:
    """Angle of attack and commands of straight flight."""
    p = book.performance
    flown = sorted(p.levels, key=lambda t: t.airspeed_m_s)
    speeds = _speeds(flown)
    ax.plot(speeds, [math.degrees(t.alpha_rad) for t in flown], color=INK)
    ax.set(xlabel="airspeed, m/s", ylabel="angle of attack, deg")
    commands = ax.twinx()
    commands.grid(False)
    commands.spines["right"].set_visible(True)
    commands.plot(speeds, [t.elevator for t in flown], color=ORANGE)
    commands.set(ylim=(-1.05, 1.05), ylabel="command, -1..1")
    handles = [("angle of attack", INK), ("elevator", ORANGE)]
    if p.top_speed:
        commands.plot(speeds, [t.throttle for t in flown], color=GREEN)
        handles.append(("throttle", GREEN))
    lines = [matplotlib.lines.Line2D([], [], color=colour, label=label) for label, colour in handles]
    ax.legend(handles=lines, loc="lower left")
    _speed_line(ax, p.cruise.airspeed_m_s, 0.96, " cruise", FAINT, "left")
    ax.set_title("Trim, level" if p.top_speed else "Trim, gliding")


def _locus(book: Handbook) -> list[tuple[float, tuple[Mode, ...]]]:
    """The modes at several speeds between stall and the fastest."""
    p = book.performance
    slow = 1.08 * p.stall.airspeed_m_s
    fast = 0.97 * p.top_speed.airspeed_m_s if p.top_speed else p.polar[0].airspeed_m_s
    found = []
    for speed in np.geomspace(slow, fast, LOCUS_SPEEDS):
        t = trim(book.model, float(speed), p.height_m)
        found.append((float(speed), modes(linearise(book.model, t, p.height_m))))
    return found


def _poles(ax: Any, book: Handbook, locus: list[tuple[float, tuple[Mode, ...]]], near: bool) -> None:
    """Roots in the complex plane, upper half: small dots for other speeds, large for the cruise, rings the formulas."""
    inside = _near(book)
    for speed, several in locus:
        size = 1.5 + 3.5 * (speed - locus[0][0]) / (locus[-1][0] - locus[0][0])
        for mode in several:
            _roots(ax, mode, color=COLOURS[mode.name], ms=size, alpha=0.45, mew=0)
    for mode in book.modes:
        colour = COLOURS[mode.name]
        _roots(ax, mode, color=colour, ms=8, mec="white", label=TITLES[mode.name], zorder=5)
        if mode.name in book.textbook:
            _roots(ax, book.textbook[mode.name], mfc="none", mec=colour, ms=12, zorder=4)
    roots = [e for _, several in locus for mode in several for e in mode.eigenvalues]
    roots = [e for e in roots if abs(e) < inside] if near else roots
    left, right = min(e.real for e in roots), max(max(e.real for e in roots), 0.0)
    high = (1.15 if near else 1.4) * max(max(e.imag for e in roots), 0.2 * inside)
    ax.set(xlim=(left - 0.08 * (right - left), right + 0.09 * (right - left)), ylim=(-0.04 * high, high))
    _damping_rays(ax, (0.1, 0.2, 0.4, 0.7) if near else (0.4, 0.7))
    ax.axvline(0.0, color=INK, lw=1.0)
    ax.axhline(0.0, color=FAINT, lw=0.8)
    title = "Slow modes, the corner by the origin" if near else "Natural modes with speed"
    ax.set(xlabel="real part, 1/s", ylabel="imaginary part, rad/s", title=title)
    if not near:
        ax.legend(loc="upper left", ncols=2, handletextpad=0.2, columnspacing=0.8)
        cruise = book.performance.cruise.airspeed_m_s
        dots = f"dots: {locus[0][0]:.1f} to {locus[-1][0]:.1f} m/s"
        style.note(ax, f"disc: cruise, {cruise:g} m/s     ring: formula     {dots}")
        ax.set_title(title, pad=15)


def _roots(ax: Any, mode: Mode, **look: Any) -> None:
    """A disc for each root in the upper half of the plane."""
    upper = [e for e in mode.eigenvalues if e.imag >= 0.0]
    ax.plot([e.real for e in upper], [e.imag for e in upper], "o", **look)


def _near(book: Handbook) -> float:
    """Radius around the origin that holds phugoid and spiral."""
    slow = [m for m in book.modes if m.name in ("phugoid", "spiral", "roll_spiral")]
    return 2.2 * max(abs(e) for m in slow for e in m.eigenvalues)


def _damping_rays(ax: Any, dampings: Sequence[float]) -> None:
    """Lines of equal damping."""
    high, left = ax.get_ylim()[1], ax.get_xlim()[0]
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    for damping in dampings:
        sine = math.sqrt(1.0 - damping**2)
        along = min(high / sine, -left / damping)
        ax.plot([0.0, -along * damping], [0.0, along * sine], color=GRID, lw=0.9, zorder=0, scalex=False, scaley=False)
        x, y = -0.93 * along * damping, 0.93 * along * sine
        ax.text(x, y, f"{damping:g}", fontsize=7, color=FAINT, ha="center", va="center", zorder=1, bbox=box)


def _turns(ax: Any, book: Handbook) -> None:
    """Rate of turn against speed: banks, where the wing stalls, and the turns of the page."""
    p = book.performance
    stall, g = p.stall.airspeed_m_s, G_M_S2
    fast = p.top_speed.airspeed_m_s if p.top_speed else 2.4 * stall
    speeds = np.linspace(stall, 1.02 * fast, 200)
    highest = 0.0
    for bank_deg in (15.0, 30.0, 45.0, 60.0, 70.0):
        slowest = stall / math.sqrt(math.cos(math.radians(bank_deg)))
        v = np.linspace(slowest, 1.02 * fast, 100)
        rate = np.degrees(g * math.tan(math.radians(bank_deg)) / v)
        ax.plot(v, rate, color=FAINT, lw=0.9, ls=(0, (4, 3)))
        ax.text(v[-1], rate[-1], f" {bank_deg:.0f}°", fontsize=8, color=FAINT, va="center")
        highest = max(highest, float(rate[0])) if bank_deg <= 60.0 else highest
    load = (speeds / stall) ** 2
    limit = np.degrees(g * np.sqrt(load**2 - 1.0) / speeds)
    top = 1.25 * highest
    ax.fill_between(speeds, limit, top, where=limit <= top, color=RED, alpha=0.06, lw=0)
    ax.plot(speeds, limit, color=RED)
    at = float(np.interp(0.72 * top, limit, speeds))
    ax.text(at - 0.02 * fast, 0.74 * top, "stalled", fontsize=8.3, color=RED, ha="right")
    for t in p.turns:
        use = f"throttle {t.throttle:.2f}" if p.top_speed else f"sink {-t.climb_m_s:.2f} m/s"
        _mark(ax, t.airspeed_m_s, math.degrees(t.turn_rate_rad_s), f"r = {radius_m(t):.1f} m, {use}", BLUE, (8, 5))
    ax.set(xlim=(0.94 * stall, 1.02 * fast), ylim=(0.0, top))
    ax.set(xlabel="airspeed, m/s", ylabel="rate of turn, deg/s", title="Steady turns, by bank angle")


def _table(ax: Any, rows: Sequence[Sequence[str]], edges: Sequence[float], headed: bool = False) -> None:
    """Text in columns that end at `edges`; the first, and those of a negative edge, begin there."""
    ax.axis("off")
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    for i, row in enumerate(rows):
        y = 0.93 - i * 0.102
        for j, (text, edge) in enumerate(zip(row, edges, strict=True)):
            colour = FAINT if headed and i == 0 else INK
            ax.text(abs(edge), y, text, ha="left" if edge <= 0.0 or j == 0 else "right", va="center", color=colour)
        ax.plot([0.0, 1.0], [y - 0.051] * 2, color=GRID, lw=0.8, clip_on=False)


def _mode_table(ax: Any, book: Handbook) -> None:
    simple = book.lanchester
    heads = ["modes at the cruise", *MODE_HEADINGS[1:]]
    last = ["phugoid after Lanchester", "", "", "", "", f"{simple.omega_rad_s:.3g}", f"{simple.damping:.3g}"]
    c = book.coefficients
    groups = (("CL_alpha", "Cm_alpha", "Cm_q"), ("Cl_beta", "Cl_p", "Cl_r"), ("Cn_beta", "Cn_p", "Cn_r"))
    _table(ax, [heads, *mode_rows(book), last], (0.0, 0.36, 0.48, 0.60, 0.72, 0.86, 0.985), headed=True)
    text = "     ".join("   ".join(f"{name} {c[name]:+.3f}" for name in group) for group in groups)
    ax.text(0.0, 0.93 - 0.102 * (len(book.modes) + 2) - 0.02, text, fontsize=8.3, color=FAINT, va="center")
