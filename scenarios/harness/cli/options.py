"""Options shared by several commands, and the configuration entries that they change."""

import inspect
import os
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.harness.cli import values as complete
from scenarios.harness.cli.reports import refusal
from scenarios.harness.cli.values import number_in, whole_in
from sim.outside.wording import brief

# Each takes a few hundred megabytes, and more of them than processors bring no speed.
MOST_WORKERS = max(64, 4 * (os.cpu_count() or 1))

ScenarioArgument = Annotated[
    str,
    typer.Argument(help="Name of a scenario, or the path of your own file.py.", autocompletion=complete.scenarios),
]
KindArgument = Annotated[
    str | None,
    typer.Argument(help="scenarios, estimators, autopilots, aircraft, suites or parts.", autocompletion=complete.kinds),
]
NamesArgument = Annotated[list[str] | None, typer.Argument(help="Only these names. \\[default: all of that kind]")]
ParamsOption = Annotated[bool, typer.Option("--params", help="List the parameters of estimators, for --set.")]
EstimatorOption = Annotated[
    str | None,
    typer.Option(
        "--estimator", metavar="NAME", help="Registered name, module:Class, file.py:Class or library.so.",
        autocompletion=complete.estimators,
    ),
]  # fmt: skip
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Any other parameter, for example gps.latency_s=0.5 or my_filter.k_p=1."
    ),
]
SetAirframeOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="A difference from the drawing, for example airframe.mass_factor=1.1."
    ),
]
WindOption = Annotated[
    str | None,
    typer.Option(
        "--wind", metavar="M/S@DEG", help="Wind speed and the direction it blows from: 5@270, 5@cross, 5@head, calm."
    ),
]
ShearOption = Annotated[
    str | None,
    typer.Option("--shear", metavar="EXP", help="Exponent of the wind profile with height: 0 none, 0.14 open country."),
]
GustOption = Annotated[
    list[str] | None,
    typer.Option(
        "--gust", metavar="M/S@S", help="4@12s, 4@12s/3s (3 s long), 4@12s:up, :down, :across or :90; may be repeated."
    ),
]
TurbulenceOption = Annotated[
    str | None,
    typer.Option("--turbulence", metavar="W20", help="calm, light, moderate, severe, or the wind at 20 ft, m/s."),
]
ThermalsOption = Annotated[
    str | None, typer.Option("--thermals", metavar="N", help="Thermals around the launch point.")
]
AircraftOption = Annotated[
    str | None, typer.Option("--aircraft", help="Name of an aircraft.", autocompletion=complete.aircraft)
]
AutopilotOption = Annotated[
    str | None,
    typer.Option(
        "--autopilot", help="Registered name, module:Class or file.py:Class.", autocompletion=complete.autopilots
    ),
]
GpsRateOption = Annotated[
    float | None,
    typer.Option(
        "--gps-rate", metavar="HZ", help="Rate of the GPS, instead of the receiver's own.",
        parser=number_in(-1e6, 1e6, "Hz"),
    ),
]  # fmt: skip
ImuRateOption = Annotated[
    int | None,
    typer.Option(
        "--imu-rate",
        metavar="HZ",
        help="Rate of gyro, accelerometer and the loop.",
        parser=whole_in(-1000000, 1000000, "Hz"),
    ),
]
SensorsOption = Annotated[
    str | None,
    typer.Option(
        "--sensors",
        metavar="NAME",
        help="Name of a sensor suite, or the path of your own suite.toml.",
        autocompletion=complete.suites,
    ),
]
FaultOption = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar="FAULT",
        help="gyro.x:stuck@20-25 (s after the release), gps:outage@10 (to the end), gps:jump=50,-30@10-20 (m north, "
        "east); may be repeated. gyro, accelerometer, magnetometer (or an axis), airspeed, barometer: stuck, dropout, "
        "nan, spikes, bias, gain, saturated. gps: outage, stuck, frozen_position, frozen_velocity, "
        "frozen_course, jump, drift, rate, whole_degrees, nan, spikes. imu: dropped. aileron, elevator, rudder: stuck "
        "(or stuck=0.3), slow, slack, reversed, lost. motor: dead, weak, stuck. Default values: "
        "bias=5 deg/s, 0.2 g, 10 uT, 3 m/s, 10 m; spikes=200,0.02 for 200 deg/s in 2% of the readings, 2 g in 2%, "
        "50 uT, 10 m/s, 50 m in 10%; gain=0.5; saturated=1 (or -1); jump=50,0; drift=1,0 (m/s); rate=1 (Hz); "
        "dropped=0.05 (of the samples); slow=0.5 (full deflections per second); slack=0.1 (of full deflection); "
        "weak=0.6 (of the voltage).",
    ),
]
JsonOption = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the results as JSON; - writes to standard output.")
]
WebOption = Annotated[bool, typer.Option("--web", help="Use the viewer in a browser.")]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        metavar="N", help="Number of processes. \\[default: as many as processors]", parser=whole_in(1, MOST_WORKERS)
    ),
]
FlightTimeoutOption = Annotated[
    float | None,
    typer.Option(
        "--flight-timeout",
        metavar="S",
        help="Wall-clock limit per flight. \\[default: 600]",
        parser=number_in(0.001, 1e6, "s"),
    ),
]
PictureOption = Annotated[
    Path | None, typer.Option("--picture", metavar="FILE", help="Draw a picture: PNG, SVG or PDF.")
]
NoRerunOption = Annotated[bool, typer.Option("--no-rerun", help="Record Parquet only, no .rrd.")]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for the recordings.")]
SeedsOption = Annotated[str, typer.Option("--seeds", metavar="LIST", help="Seeds to fly: 0-9 or 0,2,5-7.")]
LedgerOption = Annotated[
    Path | None,
    typer.Option(
        "--ledger", metavar="FOLDER", help="Keep finished flights in this folder, and fly only what is missing."
    ),
]
FLIGHT_TIMEOUT_S = 600.0
PageOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="With scenarios: write the catalogue, with stories, limits, values and margins."),
]
VerdictOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="With --markdown: take the measured values from what check --json wrote."),
]
MarkdownOption = Annotated[Path | None, typer.Option(metavar="FILE", help="Write Markdown.")]
CalibrationOption = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        help="Average the first S seconds as the power-up sample, if at rest; 0 disables it. \\[default: 2]",
        parser=number_in(-1e6, 1e6, "s"),
    ),
]
ColumnsOption = Annotated[str | None, typer.Option(metavar="MAP", help="Column map: a .toml file, or umn_ultrastick.")]
ReferenceOption = Annotated[Path | None, typer.Option(metavar="FILE", help="File with the attitudes to score against.")]
UnitOption = Annotated[
    int | None,
    typer.Option(
        "--imu", metavar="N", help="Inertial unit to read from a .bin or .ulg, from 0.", parser=whole_in(0, 99)
    ),
]
SeveralOption = Annotated[
    str | None,
    typer.Option(
        "--estimators", metavar="A,B,C", help="Estimators to compare. \\[default: all]",
        autocompletion=complete.estimators,
    ),
]  # fmt: skip
ParameterOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter: k_p=1, or my_filter.k_p=1."),
]
LogEstimatorsOption = Annotated[
    str,
    typer.Option(
        "--estimator", metavar="NAME,...", help="Registered names, module:Class, file.py:Class or library.so.",
        autocompletion=complete.estimators,
    ),
]  # fmt: skip


WithholdOption = Annotated[
    str | None,
    typer.Option(
        "--withhold",
        metavar="NAME,...",
        help="Properties of the instruments to hide from estimators and autopilots; all hides all.",
    ),
]

Changes = Callable[[], dict[str, Any]]  # what the options change in the configuration; ValueError if they cannot


def flight_options(
    wind: WindOption = None,
    shear: ShearOption = None,
    gust: GustOption = None,
    turbulence: TurbulenceOption = None,
    thermals: ThermalsOption = None,
    aircraft: AircraftOption = None,
    autopilot: AutopilotOption = None,
    gps_rate: GpsRateOption = None,
    imu_rate: ImuRateOption = None,
    sensors: SensorsOption = None,
    fault: FaultOption = None,
    set_: SetOption = None,
    withhold: WithholdOption = None,
) -> dict[str, Any]:
    """The options of every command that flies, as configuration changes by dotted name."""
    named = {
        "aircraft": aircraft,
        "autopilot": autopilot,
        "rates.gps_hz": gps_rate,
        "rates.imu_hz": imu_rate,
        "suite": sensors,
        "faults": fault or None,
        "withheld": withhold,
        "wind": wind,
        "air.shear": shear,
        "air.gusts": gust or None,
        "air.turbulence_w20_m_s": turbulence,
        "air.thermals": thermals,
    }
    return changes_of(set_) | given(named)


def flies(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the `flight_options` in place of its parameter ``changes``, which receives a `Changes`."""
    own, shared = inspect.signature(command), inspect.signature(flight_options)
    parameters = [
        each
        for parameter in own.parameters.values()
        for each in (shared.parameters.values() if parameter.name == "changes" else (parameter,))
    ]

    @wraps(command)
    def with_options(**options: Any) -> Any:
        mine = {name: options.pop(name) for name in shared.parameters}
        return command(**options, changes=partial(flight_options, **mine))

    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters} | {"return": own.return_annotation}
    return with_options


def time_limit(flight_timeout: float | None, *, live: bool = False) -> float | None:
    """The value of ``--flight-timeout``; by default there is none with ``--live``."""
    return flight_timeout if flight_timeout is not None or live else FLIGHT_TIMEOUT_S


def changes_of(assignments: list[str] | None) -> dict[str, Any]:
    """Changes from ``--set name=value``."""
    changes = {}
    for text in assignments or []:
        name, equals, value = text.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise refusal(f"--set {brief(text)}: write name=value, for instance gps.latency_s=0.5")
        changes[name.strip()] = value.strip()
    return changes


def given(named: dict[str, Any]) -> dict[str, Any]:
    """The entries of `named` that were given on the command line."""
    return {name: value for name, value in named.items() if value is not None}


def names_of(text: str | None, option: str) -> list[str]:
    """The names in a comma-separated list, none if the option was not given; an empty name is an error."""
    names = [name.strip() for name in text.split(",")] if text is not None else []
    if not all(names):
        raise refusal(f"{option} {brief(text)}: an empty name; write names with commas between them")
    return names
