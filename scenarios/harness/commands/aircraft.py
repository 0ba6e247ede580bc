"""The performance page of an aeroplane, computed from its model: what it can do and how it moves.

Performance comes from trims (`sim.aeroplane.performance`), the modes from the model linearised at the cruise
(`sim.aeroplane.linear`), beside the textbook's formulas for them from the same derivatives
(`sim.aeroplane.derivatives`).
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from estimator.interface import G_M_S2
from scenarios.harness.cli import console
from scenarios.harness.cli.options import changes_of
from scenarios.harness.cli.reports import attempt, check_picture, reporting, usage
from scenarios.harness.config.tolerances import set_airframe
from sim.aeroplane import performance
from sim.aeroplane.built import AS_DRAWN, differences_of, require_flyable
from sim.aeroplane.derivatives import Airframe, coefficients, lanchester, textbook
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.linear import Mode, linearise, modes
from sim.aeroplane.performance import Performance, radius_m
from sim.aeroplane.trim import Trim

PHYSICS_HZ = 200
HEIGHT_M = 60.0
TITLES = {
    "short_period": "short period",
    "phugoid": "phugoid",
    "roll": "roll subsidence",
    "dutch_roll": "Dutch roll",
    "spiral": "spiral",
    "roll_spiral": "roll and spiral, joined",
}


@dataclass(frozen=True, slots=True)
class Handbook:
    """Everything on the page.

    textbook : the formulas' modes, by name     lanchester : the phugoid at a constant angle of attack
    coefficients : dimensionless derivatives at the cruise
    """

    name: str
    model: Model
    frame: Airframe
    performance: Performance
    modes: tuple[Mode, ...]
    textbook: dict[str, Mode]
    lanchester: Mode
    coefficients: dict[str, float]

    @property
    def static_margin(self) -> float:
        """Distance from the centre of gravity back to the neutral point, stick fixed, in mean chords."""
        return -self.coefficients["Cm_alpha"] / self.coefficients["CL_alpha"]

    @property
    def wing_loading_n_m2(self) -> float:
        return self.frame.mass_kg * G_M_S2 / self.frame.area_m2

    def to_json(self) -> dict[str, Any]:
        """The page as numbers named with their units; None for what does not exist."""
        p, frame = self.performance, self.frame
        theory = {name: mode_json(m) for name, m in self.textbook.items()}
        return {
            "aircraft": self.name,
            "airframe": asdict(self.model.built),
            "height_m": p.height_m,
            "mass_kg": frame.mass_kg,
            "wing_area_m2": frame.area_m2,
            "span_m": frame.span_m,
            "wing_loading_n_m2": self.wing_loading_n_m2,
            "cruise_m_s": p.cruise.airspeed_m_s,
            "stall_speed_m_s": p.stall.airspeed_m_s,
            "stall_alpha_deg": math.degrees(p.stall.alpha_rad),
            "stall_limited_by": p.stall_by,
            "glide_ratio": glide_ratio(p.best_glide),
            "best_glide_speed_m_s": p.best_glide.airspeed_m_s,
            "min_sink_m_s": -p.min_sink.climb_m_s,
            "min_sink_speed_m_s": p.min_sink.airspeed_m_s,
            "top_speed_m_s": p.top_speed.airspeed_m_s if p.top_speed else None,
            "climb_m_s": p.best_climb.climb_m_s if p.best_climb else None,
            "climb_speed_m_s": p.best_climb.airspeed_m_s if p.best_climb else None,
            "climb_angle_deg": math.degrees(p.steepest.climb_rad) if p.steepest else None,
            "static_margin": self.static_margin,
            "roll_surface": p.roll.surface,
            "roll_rate_deg_s": math.degrees(p.roll.rate_rad_s),
            "time_to_45_deg_bank_s": _finite(p.roll.to_45_deg_s),
            "modes": {m.name: mode_json(m) | {"textbook": theory.get(m.name)} for m in self.modes},
            "phugoid_lanchester": mode_json(self.lanchester),
            "derivatives": self.coefficients,
            "turns": [_turn_json(t) for t in p.turns],
            "turns_end": p.turns_end,
            "polar": [_glide_json(t) for t in p.polar],
        }


def make(name: str, differences: Mapping[str, Any] = MappingProxyType({}), height_m: float = HEIGHT_M) -> Handbook:
    """Compute the page of the aircraft `name`; ValueError if there is no such aircraft.

    differences : from the drawing, ``airframe.mass_factor``, see `scenarios.harness.config.tolerances`
    """
    model = Model(name, PHYSICS_HZ, set_airframe(differences))
    if model.built != AS_DRAWN:
        require_flyable(model, height_m)
    p = performance.measure(model, height_m)
    linear = linearise(model, p.cruise, height_m)
    frame = Airframe.of(model, linear)
    simple = lanchester(p.cruise.airspeed_m_s, frame.lift_n / frame.drag_n)
    derivatives = coefficients(linear, frame)
    return Handbook(name, model, frame, p, modes(linear), textbook(linear), simple, derivatives)


def glide_ratio(t: Trim) -> float:
    return -1.0 / math.tan(t.climb_rad)


def mode_json(m: Mode) -> dict[str, Any]:
    names = ("omega_rad_s", "damping", "period_s", "time_to_half_s", "time_to_double_s")
    figures = {name: _finite(getattr(m, name)) for name in names}
    return figures | {"eigenvalues_per_s": [[e.real, e.imag] for e in m.eigenvalues]}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _glide_json(t: Trim) -> dict[str, float]:
    return {
        "airspeed_m_s": t.airspeed_m_s,
        "sink_m_s": -t.climb_m_s,
        "glide_ratio": glide_ratio(t),
        "alpha_deg": math.degrees(t.alpha_rad),
        "elevator": t.elevator,
    }


def _turn_json(t: Trim) -> dict[str, float]:
    return {
        "bank_deg": math.degrees(t.roll_rad),
        "airspeed_m_s": t.airspeed_m_s,
        "radius_m": radius_m(t),
        "circle_s": 2.0 * math.pi / abs(t.turn_rate_rad_s),
        "turn_rate_deg_s": math.degrees(t.turn_rate_rad_s),
        "throttle": t.throttle,
        "climb_m_s": t.climb_m_s,
        "elevator": t.elevator,
    }


def print_report(book: Handbook) -> None:
    """Print the page."""
    out, f = console.out(), book.frame
    loading = f"{10.0 * f.mass_kg / f.area_m2:.1f} g/dm2"
    frame = f"  {f.mass_kg:.3f} kg, {f.area_m2:.3f} m2, span {f.span_m:.2f} m, {loading}"
    out.print(console.titled(book.name, frame))
    out.print(f"Still air, {book.performance.height_m:g} m; modes at the cruise.", style="dim")
    if differences := differences_of(book.model.built):
        out.print(f"Not as drawn: {differences}.")
    out.print(console.table("Performance", ("", "", ""), figures(book), text=(0, 2)))
    out.print(_polar(book))
    out.print(_turns(book))
    cruise = f"{book.performance.cruise.airspeed_m_s:g} m/s"
    out.print(console.table(f"Modes at {cruise}", MODE_HEADINGS, mode_rows(book)))
    out.print(_derivatives(book))
    simple = f"{_number(book.lanchester.omega_rad_s)} rad/s, damping {_number(book.lanchester.damping)}"
    out.print(f"A phugoid at a constant angle of attack (Lanchester) would have {simple}.", style="dim")
    if book.performance.turns_end:
        out.print(f"No turn with {book.performance.turns_end}.")


def figures(book: Handbook) -> list[tuple[str, str, str]]:
    """The page's first table: what, how much, and at which speed or how."""
    p = book.performance
    rows = [
        ("stall speed", f"{p.stall.airspeed_m_s:.2f} m/s", f"alpha {_deg(p.stall.alpha_rad)}, {_stall_by(p)}"),
        ("best glide", f"{glide_ratio(p.best_glide):.1f} : 1", _at(p.best_glide)),
        ("least sink", f"{-p.min_sink.climb_m_s:.2f} m/s", _at(p.min_sink)),
    ]
    if p.best_climb and p.steepest and p.top_speed:
        rows += [
            ("best climb", f"{p.best_climb.climb_m_s:.2f} m/s", _at(p.best_climb)),
            ("steepest climb", _deg(p.steepest.climb_rad), _at(p.steepest)),
            ("top speed", f"{p.top_speed.airspeed_m_s:.1f} m/s", f"alpha {_deg(p.top_speed.alpha_rad)}"),
        ]
    power = f"throttle {p.cruise.throttle:.2f}, " if p.cruise.throttle else ""
    to_45 = f"45 deg after {p.roll.to_45_deg_s:.2f} s" if math.isfinite(p.roll.to_45_deg_s) else "45 deg not reached"
    rows += [
        ("cruise", f"{p.cruise.airspeed_m_s:.1f} m/s", f"{power}alpha {_deg(p.cruise.alpha_rad)}"),
        ("static margin", f"{100.0 * book.static_margin:.1f} %", "of the mean chord, stick fixed"),
        ("roll rate", f"{math.degrees(p.roll.rate_rad_s):.0f} deg/s", f"full {p.roll.surface}, {to_45}"),
    ]
    return rows


def _stall_by(p: Performance) -> str:
    return f"elevator {p.stall.elevator:+.2f}" if p.stall_by == "lift" else "elevator at its stop"


def _at(t: Trim) -> str:
    return f"at {t.airspeed_m_s:.1f} m/s"


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.1f} deg"


def _polar(book: Handbook) -> Any:
    """Every few glides of the polar, at round angles of attack."""
    p = book.performance
    row = "{airspeed_m_s:.1f} {sink_m_s:.2f} {glide_ratio:.1f} {alpha_deg:.1f} {elevator:+.2f}"
    rows = [row.format(**_glide_json(t)).split() for t in p.polar[:: -max(1, len(p.polar) // 10)]]
    motor = ", motor off" if p.top_speed else ""
    return console.table(f"Glide polar{motor}", ("m/s", "sink m/s", "ratio", "alpha deg", "elevator"), rows, text=())


def _turns(book: Handbook) -> Any:
    powered = book.performance.top_speed is not None
    row = "{bank_deg:.0f} deg|{airspeed_m_s:.1f}|{radius_m:.1f}|{circle_s:.1f}|{load:.2f}|{last:.2f}"
    rows = [
        row.format(**_turn_json(t), load=1.0 / math.cos(t.roll_rad), last=t.throttle if powered else -t.climb_m_s)
        for t in book.performance.turns
    ]
    title, last = ("Level turns", "throttle") if powered else ("Gliding turns", "sink m/s")
    headings = ("bank", "m/s", "radius m", "circle s", "load g", last)
    return console.table(title, headings, [row.split("|") for row in rows])


def mode_rows(book: Handbook) -> list[list[str]]:
    """Mode, natural frequency, damping, period, time to half or double; frequency and damping of the textbook."""
    rows = []
    for m in book.modes:
        book_mode = book.textbook.get(m.name)
        lasting = f"{m.time_to_double_s:.2f} x2" if math.isinf(m.time_to_half_s) else f"{m.time_to_half_s:.2f}"
        theory = [_number(book_mode.omega_rad_s), _number(book_mode.damping)] if book_mode else ["", ""]
        period = f"{m.period_s:.2f}" if math.isfinite(m.period_s) else "-"
        rows.append([TITLES[m.name], _number(m.omega_rad_s), _number(m.damping), period, lasting, *theory])
    return rows


MODE_HEADINGS = ("", "rad/s", "damping", "period s", "half s", "formula", "damping")


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "none"


def _derivatives(book: Handbook) -> Any:
    """Three name-and-value pairs a row."""
    cells = [(name, f"{round(value, 3) + 0.0:+.3f}") for name, value in book.coefficients.items()]
    third = -(-len(cells) // 3)
    cells += [("", "")] * (3 * third - len(cells))
    rows = [[*cells[i], *cells[i + third], *cells[i + 2 * third]] for i in range(third)]
    return console.table("Derivatives, per rad and per full deflection", [""] * 6, rows, text=(0, 2, 4))


def run(name: str, set_: list[str] | None, picture: Path | None, json_: str | None) -> None:
    """Do what the command line asks for."""
    with reporting(json_) as report:
        with usage():
            check_picture(picture)
            book = make(name, changes_of(set_))
        if picture is not None:
            from scenarios.harness.commands import aircraft_picture

            with attempt():
                aircraft_picture.draw(book, picture)
        report(book.to_json())
        print_report(book)  # last: a reader who closes the pipe loses no file
