"""The page of a sensor part or of a suite: its figures with their sources, and what it does to a signal.

Printed and as JSON.  What it does is tried out in `sim.sensors.trial`.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from itertools import count
from typing import Any, Final

from scenarios.harness.cli import console
from sim.log import Log
from sim.params import unit_of, words_of
from sim.sensors import trial as sensor_trial
from sim.sensors.board import BoardParams
from sim.sensors.trial import IMU_HZ, INERTIAL, AtRest, MagneticTrial, Response, air_errors

DRIFT_S: Final = 60.0
NAMES: Final = {
    "noise_density": "noise density",
    "bias_instability": "bias instability",
    "rate_random_walk": "random walk",
}
Row = tuple[str, float, str]  # what, how much, unit


@dataclass(frozen=True, slots=True)
class Subject:
    """What a page is about.

    members : kind -> part, of a suite; empty for a part      devices : kind -> parameters
    sources : ``kind.field`` -> where the figure comes from; empty if there is no data sheet
    settings : of a suite, its board, converter and changed figures, by dotted names
    board : that the parts sit on
    """

    name: str
    about: str
    datasheet: str
    members: Mapping[str, str]
    devices: Mapping[str, Any]
    sources: Mapping[str, str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    board: BoardParams = field(default_factory=BoardParams)


@dataclass(frozen=True, slots=True)
class Page:
    """Everything on the page; None and empty if it has no such sensor."""

    subject: Subject
    at_rest: Mapping[str, AtRest]
    exercise: Log | None
    response: Response | None
    magnetic: MagneticTrial | None
    air: Log | None

    def to_json(self) -> dict[str, Any]:
        """The page as numbers named with their units; None if the data sheet does not specify them."""
        about = self.subject
        data: dict[str, Any] = {"suite" if about.members else "part": about.name, "about": about.about}
        if about.members:
            data["members"] = dict(about.members)
            data["settings"] = {name: _plain(value) for name, value in about.settings.items()}
        else:
            data["datasheet"] = about.datasheet
        for kind, params in about.devices.items():
            figures = {f.name: _plain(getattr(params, f.name)) for f in fields(params)}
            cited = {f.name: about.sources.get(f"{kind}.{f.name}") for f in fields(params)}
            sources = {name: source for name, source in cited.items() if source}
            data[kind] = self._measured(kind) | {"figures": figures, "sources": sources}
        return data

    def _measured(self, kind: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if kind in self.at_rest:
            rest = self.at_rest[kind]
            found = {name: asdict(c) for name, c in rest.coefficients.items()}
            deviation = {f"deviation_{rest.unit.replace('/', '_')}": rest.deviation.tolist()}
            found |= {"axis_hours": rest.axis_hours, "allan": {"tau_s": rest.tau_s.tolist()} | deviation}
        effects = {f"{what} ({unit})" if unit else what: _plain(value) for what, value, unit in self.effects(kind)}
        return found | {"effects": effects}

    def effects(self, kind: str) -> list[Row]:
        """What the sensor does to a signal: what, how much, unit."""
        params = self.subject.devices[kind]
        if kind in self.at_rest:
            supply = _supply_effects(kind, params, self.subject.board)
            return _inertial_effects(kind, params, self.at_rest[kind]) + supply
        if kind == "gps" and self.response is not None:
            return _gps_effects(params, self.response)
        if kind == "magnetometer" and self.magnetic is not None:
            return _magnetic_effects(params, self.magnetic)
        if kind in ("airspeed", "barometer") and self.air is not None:
            return _air_effects(kind, params, self.air)
        return []


def _plain(value: Any) -> Any:
    """`value` for JSON, which has no infinity."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return list(value) if isinstance(value, tuple) else value


def make(
    subject: Subject,
    advance: console.Advance,
    flights: int = sensor_trial.FLIGHTS,
    seconds: float = sensor_trial.HOUR_S,
) -> Page:
    """Try `subject` out: `flights` records of `seconds` at rest for each of its gyro and accelerometer."""
    devices = subject.devices
    inertial = [kind for kind in INERTIAL if kind in devices]
    air = {kind: devices[kind] for kind in ("airspeed", "barometer") if kind in devices}
    hours, done = 3.0 * seconds / 3600.0, count(1)  # of a record's three axes

    def step() -> None:
        advance(next(done) * hours, len(inertial) * flights * hours)

    rest = {kind: sensor_trial.at_rest(kind, devices[kind], flights, seconds, step) for kind in inertial}
    return Page(
        subject,
        rest,
        sensor_trial.exercise({kind: devices[kind] for kind in inertial}) if inertial else None,
        sensor_trial.respond(devices["gps"]) if "gps" in devices else None,
        sensor_trial.turn_around(devices["magnetometer"]) if "magnetometer" in devices else None,
        sensor_trial.swing(air) if air else None,
    )


def _inertial_effects(kind: str, params: Any, rest: AtRest) -> list[Row]:
    """Of a gyro or an accelerometer, in the unit of its full scale."""
    if kind == "gyro":
        return [
            ("sigma of a sample", rest.sample_sigma, "deg/s"),
            ("step of a reading", rest.step, "deg/s"),
            ("full scale", params.range_deg_s, "deg/s"),
            (f"angle after {DRIFT_S:.0f} s, white noise alone", rest.noise.white * math.sqrt(DRIFT_S), "deg"),
            (f"angle after {DRIFT_S:.0f} s, turn-on bias", params.bias_deg_s * DRIFT_S, "deg"),
        ]
    return [
        ("sigma of a sample", 1e-3 * rest.sample_sigma, "mg"),
        ("step of a reading", 1e-3 * rest.step, "mg"),
        ("full scale", params.range_g, "g"),
        ("tilt read from a sample, sigma", math.degrees(math.atan(1e-6 * rest.sample_sigma)), "deg"),
        ("tilt read from 1 s, sigma", math.degrees(math.atan(1e-6 * rest.noise.white)), "deg"),
        ("tilt by the bias, sigma", math.degrees(math.atan(params.bias_g)), "deg"),
    ]


def _supply_effects(kind: str, params: Any, board: BoardParams) -> list[Row]:
    """What an analogue part reads at rest where its voltage and the converter's do not go together with the supply."""
    power = board.supply_power(params.output)
    if power == 0:
        return []
    null, unit = (params.null_deg_s, "deg/s") if kind == "gyro" else (params.null_g, "g")
    wrong = (("high, its sigma", board.supply_tolerance), ("low, full throttle", -board.supply_sag))
    return [
        (f"at rest, supply {100.0 * abs(e):.2g} % {why}", null * ((1.0 + e) ** power - 1.0), unit)
        for why, e in wrong
        if e
    ]


def _gps_effects(params: Any, response: Response) -> list[Row]:
    decimals = params.minute_decimals
    nmea = {"none": 0.0, "binary": 1e-7 * 60.0 * 1852.0, "nmea": 10.0**-decimals * 1852.0}
    return [
        ("report rate", params.rate_hz, "Hz"),
        ("63 % of a step of speed after", response.speed_delay_s, "s"),
        ("63 % of a 90 deg turn later by", response.course_delay_s, "s"),
        ("least speed reported in it, of 12", response.least_speed_m_s, "m/s"),
        ("smallest step of position", nmea[params.resolution], "m"),
        ("first fix after", params.first_fix_s, "s"),
    ]


def _magnetic_effects(params: Any, trial: MagneticTrial) -> list[Row]:
    horizontal = trial.horizontal_ut
    return [
        ("sample rate", params.rate_hz, "Hz"),
        ("sigma of a sample", params.noise_ut, "uT"),
        ("step of a reading", params.step_ut, "uT"),
        ("horizontal field at the launch point", horizontal, "uT"),
        ("heading by the noise of a sample, sigma", math.degrees(math.atan(params.noise_ut / horizontal)), "deg"),
        ("heading by one step", math.degrees(math.atan(params.step_ut / horizontal)), "deg"),
        ("heading in a level turn, RMS", trial.heading_rms_deg, "deg"),
    ]


def _air_effects(kind: str, params: Any, trial: Log) -> list[Row]:
    errors = air_errors(trial, kind)
    what, unit = ("airspeed", "m/s") if kind == "airspeed" else ("height", "m")
    return [
        ("sample rate", params.rate_hz, "Hz"),
        ("sigma of a sample", params.noise_pa, "Pa"),
        ("step of a reading", params.step_pa, "Pa"),
        (f"{what} read too much, mean", float(errors.mean()), unit),
        (f"{what}, scatter about that", float(errors.std()), unit),
    ]


def print_report(page: Page) -> None:
    """Print the page."""
    out, about = console.out(), page.subject
    out.print(console.titled(about.name, f"  {about.about}"))
    if about.datasheet:
        console.line(about.datasheet, "dim")
    if about.members:
        rows = [[_title(kind), part] for kind, part in about.members.items()]
        out.print(console.table("Members", ("", ""), rows, text=(0, 1)))
    if about.settings:
        rows = [[_setting(name), _number(value), unit_of(name)] for name, value in about.settings.items()]
        out.print(console.table("Board and changes", ("", "", ""), rows, text=(0, 2)))
    for kind in about.devices:
        if not about.members:
            out.print(_figures(about, kind))
        if kind in page.at_rest:
            out.print(_coefficients(page.at_rest[kind]))
        rows = [[what, _number(value), unit] for what, value, unit in page.effects(kind)]
        out.print(console.table(f"{_title(kind)}: what it does to a signal", ("", "", ""), rows, text=(0, 2)))


def _title(kind: str) -> str:
    return "GPS" if kind == "gps" else kind.capitalize()


def _setting(name: str) -> str:
    """A dotted name in words, its part first."""
    part, _, figure = name.rpartition(".")
    return f"{part.replace('.', ' ')}: {words_of(figure)}"


def _figures(about: Subject, kind: str) -> Any:
    """Figures of the data sheet; without a data sheet, all figures."""
    params = about.devices[kind]
    rows = []
    for f in fields(params):
        source = about.sources.get(f"{kind}.{f.name}", "")
        if source or not about.sources:
            rows.append([words_of(f.name), _number(getattr(params, f.name)), unit_of(f.name), source])
    headings = ("", "", "", "source" if about.sources else "")
    return console.table(_title(kind), headings, rows, text=(0, 2, 3), wrapping=(3,))


def _coefficients(rest: AtRest) -> Any:
    rows = []
    for name, c in rest.coefficients.items():
        stated = _number(c.datasheet) if c.datasheet else "-"
        hidden = name == "rate_random_walk" and rest.walk_is_hidden
        percent = "" if c.difference is None else f"{100.0 * c.difference:+.1f} %"
        difference = "too small to see" if hidden else percent
        rows.append([NAMES[name], _number(c.measured), stated, difference, c.unit])
    headings = ("", "simulated", "stated", "difference", "")
    title = f"{_title(rest.kind)}: {rest.axis_hours:.0f} axis-hours at rest, {IMU_HZ} Hz, before the converter"
    return console.table(title, headings, rows, text=(0, 4))


def _number(value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return ", ".join(_number(v) for v in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    return f"{value:.4g}" if math.isfinite(value) else "none"
