"""`wingslevel fly`: one flight, flown, recorded, judged and reported."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from estimator.instruments import to_json
from scenarios.harness.cli import console
from scenarios.harness.cli.options import Changes
from scenarios.harness.cli.reports import reporting, usage
from scenarios.harness.commands import view as viewing
from scenarios.harness.commands.listing import note_ignored
from scenarios.harness.config import FlightConfig
from scenarios.harness.flight import prepare
from scenarios.harness.gate import guard
from scenarios.harness.gate.preparing import in_time
from scenarios.harness.plugins import short_name
from scenarios.harness.recorder import record
from scenarios.harness.scenario import Scenario
from scenarios.harness.verdict import FlightVerdict, Verdict, judge
from sim import recording
from sim.log import Flight, Log, Outcome
from sim.outside.signals import TimedOut, limited
from sim.outside.wording import file_name

_FLIGHT = "the flight"
LATE_SHARE = 0.05  # of the updates; a few are late on any machine that has other things to do


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that was flown, recorded and judged; `shown` live, or not.

    flight, folder : None if the process that flew it is gone, and nothing of it is left;
    `folder` too if it could not be written
    """

    scenario: Scenario
    flight: Flight | None
    judged: FlightVerdict
    folder: Path | None
    shown: viewing.RealTime | None = None

    @property
    def exit_code(self) -> int:
        """As of the command line."""
        if self.judged.outcome == Outcome.INTERRUPTED:
            return console.INTERRUPTED
        return self._verdict.exit_code

    @property
    def _verdict(self) -> Verdict:
        return Verdict.of([(self.scenario, self.judged)])

    def to_json(self) -> dict[str, Any]:
        """The verdict, what the estimator was given of the instruments, and where the recording lies."""
        return self._verdict.to_json() | {
            "known": to_json(self.judged.known),
            "recording": None if self.folder is None else str(self.folder),
        }


def fly(
    scenario_name: str,
    changes: Mapping[str, Any],
    into: Path,
    *,
    rerun: bool,
    live: bool,
    web: bool,
    limit_s: float | None = None,
) -> Flown:
    """Fly, record below the folder `into`, judge.

    rerun : write a Rerun recording too             live : show it in the viewer while it is flown, in real time
    web : the viewer in a browser                   limit_s : wall-clock limit

    Raises
    ------
    ValueError      one line: scenario, configuration or folder; nothing has been flown or written then
    """
    with in_time(limit_s):
        prepared = prepare(scenario_name, changes)
    scenario, config = prepared.scenario, prepared.config
    recording.check_writable(into)
    console.warn_of_faults(scenario.name, config)
    note_ignored(scenario.name, config)
    if _FLIGHT in guard.lost:
        timed_out, message = guard.lost[_FLIGHT]
        outcome = Outcome.TIMED_OUT if timed_out else Outcome.WORKER_DIED
        return _nothing_of(scenario, config, outcome, f"the process {message}")
    live_view = viewing.live(prepared, web=web) if live else None
    with console.progress(f"flying {scenario.name}", "s") as advance:

        def watch(log: Log, n_rows: int) -> None:
            advance(n_rows / config.rates.imu_hz, len(log) / config.rates.imu_hz)
            if live_view is not None:
                live_view(log, n_rows)

        try:
            with guard.watched(_FLIGHT, None if limit_s is None else limit_s + guard.GRACE_S), limited(limit_s):
                flight = prepared.fly(watch)
        except TimedOut:  # before the first tick, or after the last
            return _nothing_of(scenario, config, Outcome.TIMED_OUT, f"took longer than {limit_s:g} s")
    if flight.outcome == Outcome.INTERRUPTED and not len(flight.log):
        raise KeyboardInterrupt  # while the kernels were compiled: there is nothing to judge or to keep
    guard.stage("after the flight", guard.BROKEN)
    _warn_if_late(flight)
    judged = judge(scenario, flight)
    flight = replace(flight, manifest={**flight.manifest, "verdict": recording.plain(judged.rows)})  # for its story
    if live_view is not None:
        live_view.close(flight)
    folder = record(flight, into, _name(scenario.name, config), rerun=rerun)
    return Flown(scenario, flight, judged, folder, live_view)


def _nothing_of(scenario: Scenario, config: FlightConfig, outcome: Outcome, message: str) -> Flown:
    """A flight that was lost: only how it ended is known."""
    return Flown(
        scenario, None, FlightVerdict(scenario.name, config.estimator, config.seed, outcome, (), {}, message), None
    )


def _warn_if_late(flight: Flight) -> None:
    """Warn if the estimator was often slower than its tick."""
    ticks = len(flight.log)
    if flight.late > LATE_SHARE * ticks:
        console.error(
            f"warning: {flight.late} of {ticks} updates of the estimator took longer than the tick of "
            f"{1000.0 * flight.dt_s:g} ms: aboard it would fall behind"
        )


def print_report(flown: Flown) -> None:
    """Print the verdict, how the flight ended, and where to see it."""
    out, flight, judged = console.out(), flown.flight, flown.judged
    if flight is None:
        console.line(f"{judged.scenario}, {judged.estimator}, seed {judged.seed}: {judged.ending}", "bold red")
        return
    out.print(console.verdict_table(f"{judged.scenario}, {judged.estimator}, seed {judged.seed}", judged.rows))
    ended = (
        f"{flight.outcome.replace('_', ' ')} {len(flight.log) * flight.dt_s - flight.release_s:.1f} s after the release"
    )
    planned = flight.outcome == Outcome.COMPLETED
    console.line(f"{ended}: {flight.message}" if flight.message else ended, "" if planned else "bold red")
    for event in flight.events:
        if event.level == "warn":
            console.line(f"{event.t_s - flight.release_s:8.1f} s  {event.text}", "yellow")
    console.print_known({judged.estimator: judged.known})
    if flown.folder is not None:
        console.line(f"recording   {flown.folder}")
        console.line(f"to see it   wingslevel view {flown.folder}")
    passed = sum(row.passed for row in judged.rows)
    if judged.passed:
        console.outcome(f"passed: {passed} of {len(judged.rows)} checks")
    else:
        console.outcome(f"FAILED: {passed} of {len(judged.rows)} checks passed")


def _name(scenario: str, config: FlightConfig) -> str:
    """Name of the folder of a recording."""
    return f"{file_name(scenario)}-{file_name(short_name(config.estimator))}-seed{config.seed}"


def run(
    scenario: str,
    changes: Changes,
    into: Path,
    *,
    rerun: bool,
    live: bool,
    web: bool,
    limit_s: float | None,
    json_: str | None,
) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            flown = fly(scenario, changes(), into, rerun=rerun, live=live, web=web, limit_s=limit_s)
        report(flown.to_json())
        print_report(flown)  # last: a reader who closes the pipe loses no report
    if flown.shown is not None:
        viewing.stay(flown.shown.viewer)
    return flown.exit_code
