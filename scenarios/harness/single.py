"""One flight, as the command line flies it: refused early or flown, recorded, judged and told."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from estimator.instruments import to_json
from scenarios.harness import console, viewing
from scenarios.harness.config import FlightConfig
from scenarios.harness.flight import fly_config
from scenarios.harness.preflight import prepared
from scenarios.harness.scenario import Scenario
from scenarios.harness.verdict import FlightVerdict, Verdict, judge
from sim import recording
from sim.log import Flight, Log, Outcome
from sim.wording import file_name


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that was flown, recorded and judged; `shown` live, or not."""

    scenario: Scenario
    flight: Flight
    judged: FlightVerdict
    folder: Path
    shown: viewing.RealTime | None = None

    @property
    def exit_code(self) -> int:
        """As of the command line."""
        if self.flight.outcome == Outcome.INTERRUPTED:
            return console.INTERRUPTED
        return self._verdict.exit_code

    @property
    def _verdict(self) -> Verdict:
        return Verdict.of([(self.scenario, self.judged)])

    def to_json(self) -> dict[str, Any]:
        """The verdict, what the estimator was given of the instruments, and where the recording lies."""
        return self._verdict.to_json() | {"known": to_json(self.judged.known), "recording": str(self.folder)}


def fly(scenario_name: str, changes: Mapping[str, Any], into: Path, *, rerun: bool, live: bool, web: bool) -> Flown:
    """Fly, record below the folder `into`, judge.

    rerun : write a Rerun recording too             live : show it in the viewer while it is flown, in real time
    web : the viewer in a browser

    Raises
    ------
    ValueError      one line: scenario, configuration or folder; nothing has been flown or written then
    """
    scenario, config = prepared(scenario_name, changes)
    recording.check_writable(into)
    console.warn_of_faults(scenario.name, config)
    console.warn_if_cold()
    live_view = viewing.live(scenario.name, config, web=web) if live else None
    with console.progress(f"flying {scenario.name}", "s") as advance:

        def watch(log: Log, n_rows: int) -> None:
            advance(n_rows / config.rates.imu_hz, len(log) / config.rates.imu_hz)
            if live_view is not None:
                live_view(log, n_rows)

        flight = fly_config(scenario, config, watch=watch)
    judged = judge(scenario, flight)
    flight = replace(flight, manifest={**flight.manifest, "verdict": recording.plain(judged.rows)})  # for its story
    if live_view is not None:
        live_view.close(flight)
    folder = recording.save(flight, _free_folder(into, scenario.name, config))
    if rerun:
        viewing.write_rerun(flight, folder)
    return Flown(scenario, flight, judged, folder, live_view)


def tell(flown: Flown) -> None:
    """The verdict, how the flight ended, and where to see it."""
    out, flight, judged = console.out(), flown.flight, flown.judged
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
    console.line(f"recording   {flown.folder}")
    console.line(f"to see it   wingslevel view {flown.folder}")
    console.outcome(f"passed: {sum(row.passed for row in judged.rows)} of {len(judged.rows)} checks")


def _free_folder(into: Path, scenario: str, config: FlightConfig) -> Path:
    """A new folder, made here: no flight is ever written over another, whoever else is flying."""
    estimator = file_name(config.estimator.rpartition(":")[2])
    name = f"{file_name(scenario)}-{estimator}-seed{config.seed}"
    i = 1
    while True:
        path = into / (name if i == 1 else f"{name}-{i}")
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            i += 1
        else:
            return path
