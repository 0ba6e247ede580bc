"""The command line: ``wingslevel list | fly | check | agree | compare | claims | replay | bench | aircraft | ...``.

Exit codes: 0 passed, 1 a check failed, 2 usage or configuration, 3 the simulation blew up, 130 interrupted.  A
problem of usage or configuration is one line on standard error, found before anything is flown or written.  Heavy
imports wait until a command needs them.
"""

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated

import typer

from scenarios.harness.cli import console
from scenarios.harness.cli import values as complete
from scenarios.harness.cli.console import INTERRUPTED, USAGE
from scenarios.harness.cli.options import (
    CalibrationOption,
    Changes,
    ColumnsOption,
    EstimatorOption,
    FlightTimeoutOption,
    JsonOption,
    KindArgument,
    LedgerOption,
    LogEstimatorsOption,
    MarkdownOption,
    NamesArgument,
    NoRerunOption,
    OutOption,
    PageOption,
    ParameterOption,
    ParamsOption,
    PictureOption,
    ReferenceOption,
    ScenarioArgument,
    SeedsOption,
    SetAirframeOption,
    SeveralOption,
    UnitOption,
    VerdictOption,
    WebOption,
    WithholdOption,
    WorkersOption,
    changes_of,
    flies,
    given,
    names_of,
    time_limit,
)
from scenarios.harness.cli.reports import abandon, losses
from scenarios.harness.cli.values import Commands, number_in, whole_in
from scenarios.harness.gate.guard import BROKEN
from sim.outside.blame import show_traceback, show_tracebacks
from sim.outside.signals import listening
from sim.outside.wording import described

FLIGHTS = Path("flights")  # where recordings go by default

app = typer.Typer(
    name="wingslevel",
    help="Fly a model aeroplane on an attitude estimate, through wind, and judge both.",
    cls=Commands,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    console.be_tolerant()
    try:
        with listening(), console.compiling_told(), losses() as lost:
            code = int(app(arguments, prog_name="wingslevel", standalone_mode=False) or 0)
        if lost and code in (0, 1):
            code = USAGE
    except typer.TyperException as problem:
        console.error(problem.format_message())
        return USAGE
    except (typer.Abort, KeyboardInterrupt):
        code = INTERRUPTED
    except SystemExit:  # typer's way to end when the reader of a help page has closed the pipe
        abandon(sys.stdout)
        return 0
    except Exception as error:  # a fault of ours: one line, and never a verdict that looks complete
        console.error(f"internal error: {described(error)}; wingslevel --traceback shows where")
        show_traceback(error)
        return BROKEN
    if code == INTERRUPTED:
        console.error("interrupted")
    return code


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and stop.")] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print only errors and the result; may also follow the command.")
    ] = False,
    traceback: Annotated[
        bool, typer.Option("--traceback", help="Show the whole traceback if your own code raises.")
    ] = False,
) -> None:
    console.be_quiet(quiet)
    show_tracebacks(traceback)
    if version:
        typer.echo(f"wingslevel {version_of('wingslevel')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command("list")
def list_(kind: KindArgument = None, names: NamesArgument = None, params: ParamsOption = False,
          markdown: PageOption = None, verdict: VerdictOption = None, json_: JsonOption = None) -> None:  # fmt: skip
    """Scenarios, estimators, autopilots, aircraft, sensor suites and parts, with where each one comes from."""
    from scenarios.harness.commands import listing

    if markdown is not None or verdict is not None:
        from scenarios.harness.commands import scenario_page

        scenario_page.run(kind, names or [], markdown, verdict)
        return
    listing.run(kind, names or [], params=params, json_=json_)


@app.command()
@flies
def fly(
    scenario: ScenarioArgument,
    estimator: EstimatorOption = None,
    *,
    changes: Changes,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Length of the flight after the release.", parser=number_in(-1e9, 1e9, "s")),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Seed of the flight; the same seed gives the same bits. \\[default: 0]",
            parser=whole_in(-(10**18), 10**18),
        ),
    ] = None,
    flight_timeout: FlightTimeoutOption = None,
    out: OutOption = FLIGHTS,
    no_rerun: NoRerunOption = False,
    live: Annotated[bool, typer.Option("--live", help="Watch it in the Rerun viewer, in real time.")] = False,
    web: WebOption = False,
    json_: JsonOption = None,
) -> int:
    """Fly a scenario once, record it, judge it."""
    from scenarios.harness.commands import fly as command

    named = given({"estimator": estimator, "duration_s": duration, "seed": seed})
    limit_s = time_limit(flight_timeout, live=live)
    return command.run(
        scenario, lambda: changes() | named, out, rerun=not no_rerun, live=live, web=web, limit_s=limit_s, json_=json_
    )


@app.command()
@flies
def check(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios; all of them by default.", autocompletion=complete.scenarios),
    ] = None,
    seeds: SeedsOption = "0-9",
    estimator: EstimatorOption = None,
    *,
    changes: Changes,
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    ledger: LedgerOption = None,
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="Write JUnit XML.")] = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """The gate for CI: fly scenarios on many seeds, judge each flight and all flights pooled."""
    from scenarios.harness.commands import check as command

    return command.run(
        names or [], seeds, estimator, changes, workers=workers, limit_s=time_limit(flight_timeout),
        ledger=ledger, junit=junit, markdown=markdown, json_=json_,
    )  # fmt: skip


@app.command()
def agree(
    first: Annotated[Path, typer.Argument(help="A file written by check --json.")],
    second: Annotated[Path, typer.Argument(help="The same from another machine.")],
    tolerance: Annotated[
        float,
        typer.Option(
            metavar="REL",
            help="Relative tolerance; per-unit absolute tolerances scale with it. 0 requires equal values.",
            parser=number_in(0.0, 10.0, ""),
        ),
    ] = 0.05,
    report_only: Annotated[
        str,
        typer.Option(metavar="NAME,...", help="Scenarios or patterns whose values are not judged, or 'none'."),
    ] = "faults,motor_dead*",
    json_: JsonOption = None,
) -> int:
    """Compare the verdicts of two machines: the same flights, the same outcomes, values within a tolerance."""
    from scenarios.harness.commands import agree as command

    reported = [] if report_only == "none" else names_of(report_only, "--report-only")
    return command.run(first, second, tolerance, reported, json_)


@app.command()
@flies
def compare(
    scenario: ScenarioArgument,
    estimators: SeveralOption = None,
    seeds: SeedsOption = "0-9",
    *,
    changes: Changes,
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    picture: PictureOption = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """Compare estimators: each flies the scenario on the same seeds, in the same air and with the same noise."""
    from scenarios.harness.commands import compare as command

    return command.run(
        scenario, names_of(estimators, "--estimators"), seeds, changes, workers=workers,
        limit_s=time_limit(flight_timeout), picture=picture, markdown=markdown, json_=json_,
    )  # fmt: skip


@app.command()
def claims(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Claims, or patterns such as offset*; by default all.", autocompletion=complete.claims),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="LIST", help="Seeds: 0-9 or 0,2,5-7; by default those of each claim.")
    ] = None,
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the claims without testing them.")] = False,
    pictures: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw pictures; by default in images/ beside the Markdown.")
    ] = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """Test the claims of the papers: numbers, verdicts and pictures."""
    from scenarios.harness.commands import claims as command

    return command.run(
        names or [], seeds, workers=workers, limit_s=time_limit(flight_timeout), list_only=list_only,
        pictures=pictures, markdown=markdown, json_=json_,
    )  # fmt: skip


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(help="A recording, .csv, .mat, .bin, .ulg, or reference vectors.")],
    estimator: LogEstimatorsOption = "premerlani",
    reference: ReferenceOption = None,
    columns: ColumnsOption = None,
    imu: UnitOption = None,
    set_: ParameterOption = None,
    withhold: WithholdOption = None,
    calibration: CalibrationOption = None,
    airborne: Annotated[
        float,
        typer.Option(
            metavar="M/S", help="Ground speed above which it is airborne.", parser=number_in(-1e6, 1e6, "m/s")
        ),
    ] = 5.0,
    settle: Annotated[
        float,
        typer.Option(metavar="S", help="Seconds ignored after becoming airborne.", parser=number_in(-1e6, 1e6, "s")),
    ] = 10.0,
    out: OutOption = FLIGHTS,
    no_rerun: NoRerunOption = False,
    json_: JsonOption = None,
) -> int:
    """Run estimators over a recorded log and score them against the attitude in it."""
    from scenarios.harness.commands import replay as command
    from scenarios.harness.replay import Window

    return command.run(
        log, lambda: names_of(estimator, "--estimator"), out, json_,
        lambda: {
            "reference": reference, "columns": columns, "imu": imu, "params": changes_of(set_),
            "withheld": names_of(withhold, "--withhold"), "window": Window(airborne, settle, calibration),
            "rerun": not no_rerun,
        },
    )  # fmt: skip


@app.command()
def bench(
    estimator: EstimatorOption = "premerlani",
    seconds: Annotated[
        float,
        typer.Option(metavar="S", help="Simulated time of each repeat.", parser=number_in(2.0, 3600.0, "s")),
    ] = 30.0,
    repeats: Annotated[
        int, typer.Option(metavar="N", help="Pairs of closed loop and bare JSBSim.", parser=whole_in(3, 1000))
    ] = 20,
    json_: JsonOption = None,
) -> int:
    """Speed: the closed loop against bare JSBSim in the same run, and the estimator alone."""
    from scenarios.harness.commands import bench as command

    return command.run(estimator or "premerlani", seconds, repeats, json_)


@app.command()
def aircraft(
    name: Annotated[str, typer.Argument(help="Name of an aircraft.", autocompletion=complete.aircraft)],
    set_: SetAirframeOption = None,
    picture: PictureOption = None,
    json_: JsonOption = None,
) -> None:
    """Print a performance page of an aeroplane: speeds, glide, climb, turns, stability and natural modes."""
    from scenarios.harness.commands import aircraft as command

    command.run(name, set_, picture, json_)


@app.command()
def sensors(
    part: Annotated[
        str | None,
        typer.Argument(
            help="Name of a part or of a suite, or your own part.toml; all by default.",
            autocompletion=complete.suites_and_parts,
        ),
    ] = None,
    picture: PictureOption = None,
    json_: JsonOption = None,
) -> None:
    """List the sensors, or print the page of one: its data sheet, its Allan deviation, its effect on a signal."""
    from scenarios.harness.commands import sensor_names as command

    command.run(part, picture, json_)


@app.command()
def export(
    flight: Annotated[
        Path | None, typer.Argument(help="Folder of a recording, or its .parquet file; by default the newest.")
    ] = None,
    nmea: Annotated[Path | None, typer.Option(metavar="FILE", help="Write NMEA 0183: GGA, RMC and VTG.")] = None,
    ubx: Annotated[Path | None, typer.Option(metavar="FILE", help="Write UBX NAV-PVT.")] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write all measurements as a text log with a column map.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="UTC", help="Time of power-up. \\[default: 2026-07-02T12:00:00]")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Write a recording for other programs: GPS fixes as receiver messages, all measurements as a text log."""
    from scenarios.harness.commands import export as command

    command.run(flight, FLIGHTS, nmea, ubx, csv, start, json_)


@app.command()
def view(
    flight: Annotated[
        Path | None, typer.Argument(help="Folder of a recording, or a .rrd or .parquet file; by default the newest.")
    ] = None,
    web: WebOption = False,
) -> None:
    """Open a recording in the Rerun viewer."""
    from scenarios.harness.commands import view as command

    command.run(flight, FLIGHTS, web=web)
