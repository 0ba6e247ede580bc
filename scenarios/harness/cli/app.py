"""The command line: ``wingslevel list | fly | check | agree | compare | claims | replay | bench | aircraft | ...``.

Exit codes: 0 passed, 1 a check failed, 2 usage or configuration, 3 the simulation blew up, 130 interrupted.  A
problem of usage or configuration is one line on standard error, found before anything is flown or written.  Heavy
imports wait until a command needs them.
"""

from functools import partial
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated

import typer

from scenarios.harness.cli import console
from scenarios.harness.cli import values as complete
from scenarios.harness.cli.console import INTERRUPTED, USAGE
from scenarios.harness.cli.options import (
    AircraftOption,
    AutopilotOption,
    CalibrationOption,
    ColumnsOption,
    EstimatorOption,
    FaultOption,
    FlightTimeoutOption,
    GpsRateOption,
    GustOption,
    ImuRateOption,
    JsonOption,
    LedgerOption,
    LogEstimatorsOption,
    MarkdownOption,
    ParameterOption,
    ReferenceOption,
    ScenarioArgument,
    SensorsOption,
    SetOption,
    SeveralOption,
    ShearOption,
    ThermalsOption,
    TurbulenceOption,
    UnitOption,
    WebOption,
    WindOption,
    WithholdOption,
    WorkersOption,
    air,
    changes_of,
    fitted,
    given,
    names_of,
    time_limit,
)
from scenarios.harness.cli.reports import attempt, check_file, losses, refusal, reporting, usage, write
from scenarios.harness.cli.values import Commands, number_in, whole_in
from scenarios.harness.gate import guard
from scenarios.harness.gate.guard import BROKEN
from sim.outside.blame import show_traceback, show_tracebacks
from sim.outside.signals import listening
from sim.outside.wording import described

FLIGHTS = Path("flights")  # where recordings go unless told otherwise

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
        bool, typer.Option("--quiet", "-q", help="Print errors and how it went, no more; also after the command.")
    ] = False,
    traceback: Annotated[
        bool, typer.Option("--traceback", help="Show the whole traceback where code of your own raises.")
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
def list_(json_: JsonOption = None) -> None:
    """What there is: scenarios, estimators, autopilots, aircraft, sensor suites, parts."""
    from scenarios.harness.commands.catalogue import catalogue

    with reporting(json_) as report:
        found = catalogue()
        for kind, things in found.items():
            console.out().print(console.name_table(kind, things))
        report(found)


@app.command()
def fly(
    scenario: ScenarioArgument,
    estimator: EstimatorOption = None,
    aircraft: AircraftOption = None,
    autopilot: AutopilotOption = None,
    wind: WindOption = None,
    shear: ShearOption = None,
    gust: GustOption = None,
    turbulence: TurbulenceOption = None,
    thermals: ThermalsOption = None,
    gps_rate: GpsRateOption = None,
    imu_rate: ImuRateOption = None,
    sensors: SensorsOption = None,
    fault: FaultOption = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Length of the flight after the release.", parser=number_in(-1e9, 1e9, "s")),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Another seed, another flight; the same seed, the same bits. [default: 0]",
            parser=whole_in(-(10**18), 10**18),
        ),
    ] = None,
    set_: SetOption = None,
    withhold: WithholdOption = None,
    flight_timeout: FlightTimeoutOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the recording.")] = FLIGHTS,
    no_rerun: Annotated[bool, typer.Option("--no-rerun", help="Record Parquet alone.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Watch it in the Rerun viewer, in real time.")] = False,
    web: WebOption = False,
    json_: JsonOption = None,
) -> int:
    """Fly a scenario once, record it, judge it."""
    from scenarios.harness.commands import fly as single
    from scenarios.harness.commands import view as viewing

    named = fitted(aircraft, autopilot, gps_rate, imu_rate, sensors, fault) | given(
        {"estimator": estimator, "duration_s": duration, "seed": seed, "withheld": withhold}
    )
    with reporting(json_) as report:
        with usage():
            changes = changes_of(set_) | named | air(wind, shear, gust, turbulence, thermals)
            limit_s = time_limit(flight_timeout, live=live)
            flown = single.fly(scenario, changes, out, rerun=not no_rerun, live=live, web=web, limit_s=limit_s)
        report(flown.to_json())
        single.tell(flown)  # last: a reader who closes the pipe loses no report
    if flown.shown is not None:
        viewing.stay(flown.shown.viewer)
    return flown.exit_code


@app.command()
def check(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios; all of them where none is named.", autocompletion=complete.scenarios),
    ] = None,
    seeds: Annotated[str, typer.Option(metavar="LIST", help="Seeds to fly: 0-9 or 0,2,5-7.")] = "0-9",
    estimator: EstimatorOption = None,
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
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    ledger: LedgerOption = None,
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="Write JUnit XML.")] = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """The gate for CI: fly scenarios on many seeds, judge each flight and all of them pooled."""
    from scenarios.harness.commands import check as gate
    from scenarios.harness.gate import workers as crew
    from scenarios.harness.gate.ledger import Ledger
    from scenarios.harness.preflight import in_time

    with reporting(json_) as report:
        with usage():
            for path in (junit, markdown):
                check_file(path)
            named = fitted(aircraft, autopilot, gps_rate, imu_rate, sensors, fault)
            changes = changes_of(set_) | named | air(wind, shear, gust, turbulence, thermals)
            changes |= given({"withheld": withhold})
            if "seed" in changes:
                raise ValueError(f"--set seed={changes['seed']}: name the seeds to fly with --seeds")
            with in_time(time_limit(flight_timeout)):
                tasks = gate.tasks(names or [], gate.parse_seeds(seeds), estimator, changes, keyed=ledger is not None)
            kept = None if ledger is None else Ledger(ledger)
            guard.stage("while it judged", guard.BROKEN)
            with console.progress("flying", "flights") as advance:
                run = gate.fly_all(
                    tasks, workers or crew.processors(), advance, limit_s=time_limit(flight_timeout), ledger=kept
                )
        write(junit, run.verdict.to_junit)
        write(markdown, run.verdict.to_markdown)
        report(run.to_json())
        gate.tell(run.verdict)  # last: a reader who closes the pipe loses no report
    return run.exit_code


@app.command()
def agree(
    first: Annotated[Path, typer.Argument(help="What check --json wrote.")],
    second: Annotated[Path, typer.Argument(help="The same of another machine.")],
    tolerance: Annotated[
        float,
        typer.Option(
            metavar="REL",
            help="Relative; those of each unit keep their proportion to it. 0 demands equal values.",
            parser=number_in(0.0, 10.0, ""),
        ),
    ] = 0.05,
    report_only: Annotated[
        str,
        typer.Option(metavar="NAME,...", help="Scenarios, or patterns, whose values are not judged; none for none."),
    ] = "faults",
    json_: JsonOption = None,
) -> int:
    """Compare the verdicts of two machines: the same flights, the same outcomes, values within a tolerance."""
    from scenarios.harness.commands import agree as agreement

    with reporting(json_) as report:
        with usage():
            reported = [] if report_only == "none" else names_of(report_only, "--report-only")
            compared = agreement.compare(agreement.read(first), agreement.read(second), tolerance, reported)
        report(compared.to_json())
        agreement.tell(compared)  # last: a reader who closes the pipe loses no file
    return compared.exit_code


@app.command()
def compare(
    scenario: ScenarioArgument,
    estimators: SeveralOption = None,
    seeds: Annotated[str, typer.Option(metavar="LIST", help="Seeds that each of them flies: 0-9 or 0,2,5-7.")] = "0-9",
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
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw it, as PNG, SVG or PDF.")] = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """Estimators side by side: each flies the scenario on the same seeds, through the same air and noise."""
    from scenarios.harness.commands import aircraft as handbook
    from scenarios.harness.commands import check as gate
    from scenarios.harness.commands import compare as comparing
    from scenarios.harness.gate import workers as crew
    from scenarios.harness.preflight import in_time

    with reporting(json_) as report:
        with usage():
            check_file(picture)
            check_file(markdown)
            handbook.check_picture(picture)
            carried = fitted(aircraft, autopilot, gps_rate, imu_rate, sensors, fault)
            changes = changes_of(set_) | carried | air(wind, shear, gust, turbulence, thermals)
            changes |= given({"withheld": withhold})
            wanted = names_of(estimators, "--estimators")
            with in_time(time_limit(flight_timeout)):
                plan = comparing.prepare(scenario, wanted, gate.parse_seeds(seeds), changes)
            guard.stage("while it compared", guard.BROKEN)
            with console.progress("flying", "flights") as advance:
                compared = comparing.fly(
                    plan, workers or crew.processors(), advance, limit_s=time_limit(flight_timeout)
                )
        if picture is not None:
            from scenarios.harness.commands import compare_picture

            with attempt():
                compare_picture.draw(compared, picture)
        write(markdown, compared.to_markdown)
        report(compared.to_json())
        comparing.tell(compared)  # last: a reader who closes the pipe loses no report
    return compared.exit_code


@app.command()
def claims(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Claims, or patterns such as offset*. [default: all]", autocompletion=complete.claims),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="LIST", help="Seeds: 0-9 or 0,2,5-7. [default: as many as each claim needs]")
    ] = None,
    workers: WorkersOption = None,
    flight_timeout: FlightTimeoutOption = None,
    list_only: Annotated[bool, typer.Option("--list", help="List the claims without testing them.")] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for the pictures. [default: images/ beside the Markdown]"),
    ] = None,
    markdown: MarkdownOption = None,
    json_: JsonOption = None,
) -> int:
    """Test the claims of the papers: numbers, verdicts and pictures."""
    from scenarios.harness.claims import page as claim_page
    from scenarios.harness.claims import run as claim_run
    from scenarios.harness.commands import check as gate
    from scenarios.harness.gate import workers as crew

    with reporting(json_) as report:
        with usage():
            wanted = claim_run.matching(names or [])
            if list_only:
                report(claim_page.titles(wanted))
                claim_page.print_titles(wanted)
                return 0
            check_file(markdown)
            folder = claim_page.picture_folder(markdown, pictures)
            numbers = None if seeds is None else gate.parse_seeds(seeds)
            with console.progress("measuring", "claims") as advance:
                findings = claim_run.measure(
                    wanted,
                    numbers,
                    workers or crew.processors(),
                    advance,
                    drawn=folder is not None,
                    limit_s=time_limit(flight_timeout),
                )
        claim_page.write_files(findings, markdown, folder)
        report(findings.to_json())
        # Last: a reader who closes the pipe loses no file.
        claim_page.print_report(findings, detailed=bool(names) and len(wanted) == 1)
    return findings.exit_code


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(help="Recording of ours, .csv, .mat, .bin, .ulg, or reference vectors.")],
    estimator: LogEstimatorsOption = "premerlani",
    reference: ReferenceOption = None,
    columns: ColumnsOption = None,
    imu: UnitOption = None,
    set_: ParameterOption = None,
    withhold: WithholdOption = None,
    calibration: CalibrationOption = None,
    airborne: Annotated[
        float,
        typer.Option(metavar="M/S", help="Ground speed above which it flies.", parser=number_in(-1e6, 1e6, "m/s")),
    ] = 5.0,
    settle: Annotated[
        float, typer.Option(metavar="S", help="Not judged after it first flew.", parser=number_in(-1e6, 1e6, "s"))
    ] = 10.0,
    out: Annotated[Path, typer.Option(help="Folder for the recordings.")] = FLIGHTS,
    no_rerun: Annotated[bool, typer.Option("--no-rerun", help="Record Parquet alone.")] = False,
    json_: JsonOption = None,
) -> int:
    """Run estimators over a recorded log and score them against the attitude that it holds."""
    from scenarios.harness.commands import replay as replaying
    from scenarios.harness.replay import Window

    with reporting(json_) as report:
        with usage():
            told = replaying.run(
                log,
                names_of(estimator, "--estimator"),
                out,
                reference=reference,
                columns=columns,
                imu=imu,
                params=changes_of(set_),
                withheld=names_of(withhold, "--withhold"),
                window=Window(airborne, settle, calibration),
                rerun=not no_rerun,
            )
        report(told.to_json())
        replaying.tell(told)  # last: a reader who closes the pipe loses no file
    return told.exit_code


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
    with reporting(json_) as report:
        from scenarios.harness.commands import bench as benchmark

        estimator = estimator or "premerlani"
        try:
            with usage(), console.progress("measuring", "pairs") as advance:
                speed = benchmark.measure(estimator, seconds, repeats, advance)
        except benchmark.NotTimed as problem:
            report({"passed": False, "estimator": estimator, "failure": str(problem)})
            console.error(str(problem))
            return problem.exit_code
        benchmark.tell(speed)
        report(speed.to_json())
    return 0 if speed.passed else 1


@app.command()
def aircraft(
    name: Annotated[str, typer.Argument(help="Name of an aircraft.", autocompletion=complete.aircraft)],
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the page, as PNG, SVG or PDF.")] = None,
    json_: JsonOption = None,
) -> None:
    """The handbook page of an aeroplane: speeds, glide, climb, turns, stability and natural modes."""
    from scenarios.harness.commands import aircraft as handbook

    with reporting(json_) as report:
        with usage():
            check_file(picture)
            handbook.check_picture(picture)
            book = handbook.make(name)
        if picture is not None:
            from scenarios.harness.commands import aircraft_picture as handbook_picture

            with attempt():
                handbook_picture.draw(book, picture)
        report(book.to_json())
        handbook.tell(book)  # last: a reader who closes the pipe loses no file


@app.command()
def sensors(
    part: Annotated[
        str | None,
        typer.Argument(
            help="Name of a part or of a suite, or part.toml with one's own; all, where none.",
            autocompletion=complete.suites_and_parts,
        ),
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the page, as PNG, SVG or PDF.")] = None,
    json_: JsonOption = None,
) -> None:
    """What sensors there are, or the page of one: its data sheet, its Allan deviation, what it does to a signal."""
    from scenarios.harness.commands import sensor_names

    with reporting(json_) as report:
        if part is None:
            if picture is not None:
                raise refusal(f"--picture {picture}: name the part or the suite to draw")
            report(sensor_names.to_json())
            sensor_names.tell()
            return
        from scenarios.harness.commands import sensors as sensor_page

        with usage():
            check_file(picture)
            sensor_page.check_picture(picture)
            subject = sensor_names.subject(part)
            sensor_page.check_rates(subject, part)
        with console.progress("lying still", "axis-hours") as advance:
            page = sensor_page.make(subject, advance)
        if picture is not None:
            from scenarios.harness.commands import sensors_picture as sensor_picture

            with attempt():
                sensor_picture.draw(page, picture)
        report(page.to_json())
        sensor_page.tell(page)  # last: a reader who closes the pipe loses no file


@app.command()
def export(
    flight: Annotated[
        Path | None, typer.Argument(help="Folder of a recording, or its .parquet file; by default the newest.")
    ] = None,
    nmea: Annotated[Path | None, typer.Option(metavar="FILE", help="Write NMEA 0183: GGA, RMC and VTG.")] = None,
    ubx: Annotated[Path | None, typer.Option(metavar="FILE", help="Write UBX NAV-PVT.")] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write all of it as a text log, and its column map beside it.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="UTC", help="When the power came up. [default: 2026-07-02T12:00:00]")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """A recording for other programs: its GPS fixes as messages of a receiver, all of it as a text log."""
    with reporting(json_) as report:
        with usage():
            from scenarios.harness.commands import export as exporting
            from scenarios.harness.commands import view as viewing

            for path in (nmea, ubx, csv, exporting.map_of(csv) if csv is not None else None):
                check_file(path)
            done = exporting.make(flight or viewing.newest(FLIGHTS), nmea, ubx, exporting.parse_start(start), csv)
        for path, data in done.files.values():
            write(path, partial(bytes, data))
        report(done.to_json())
        exporting.tell(done)  # last: a reader who closes the pipe loses no file


@app.command()
def view(
    flight: Annotated[
        Path | None, typer.Argument(help="Folder of a recording, or a .rrd or .parquet file; by default the newest.")
    ] = None,
    web: WebOption = False,
) -> None:
    """Open a recording in the Rerun viewer."""
    from scenarios.harness.commands import view as viewing

    with usage():
        shown = viewing.open_flight(flight or viewing.newest(FLIGHTS), web=web)
    viewing.stay(shown)
