"""`wingslevel replay`: reads a log, replays it with one or more estimators, records and prints the result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimator.instruments import Instruments, property_names, to_json
from scenarios.harness import logs
from scenarios.harness.cli import console
from scenarios.harness.cli.reports import reporting, usage
from scenarios.harness.gate import guard
from scenarios.harness.logs.recorded import RecordedLog
from scenarios.harness.plugins import short_name
from scenarios.harness.recorder import record
from scenarios.harness.replay import Replayed, Window, as_flight, gone, judged_rows, known_to, make, replay, why_none
from scenarios.harness.settings import PREFIX, lines_on_others, shared_settings
from sim import recording
from sim.log import Flight
from sim.outside.wording import file_name

_HEADINGS = ("", "inclination\n   RMS    p95    max", "heading\nRMS", "rotation\n   RMS    max", "ns per\nupdate")
_SHOWN = (
    ("inclination_rms_deg", "inclination_p95_deg", "inclination_max_deg"),
    ("heading_rms_deg",),
    ("rotation_rms_deg", "rotation_max_deg"),
)


@dataclass(frozen=True, slots=True)
class Replays:
    """A log and its replays by the estimators.

    folders : recordings by estimator, None for one that was not, or could not be, written
    flights : each replay as a flight, by estimator; none for one that ended its process
    not_judged : why nothing was judged, empty if something was
    notes : parameters that only some of the estimators have, and the like, one line each
    """

    log: RecordedLog
    judged_s: float
    replays: tuple[Replayed, ...]
    folders: Mapping[str, Path | None]
    flights: Mapping[str, Flight]
    not_judged: str = ""
    notes: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """1 if an estimator failed, or if the log has a reference and none of it could be judged."""
        nothing = self.log.reference is not None and self.not_judged
        return 1 if nothing or any(r.failure for r in self.replays) else 0

    def to_json(self) -> dict[str, Any]:
        """All numbers by estimator; with a single estimator also at the top."""
        rows = self.log.rows
        about = {
            "log": self.log.name,
            "rows": len(rows),
            "length_s": float(rows["t_s"][-1] - rows["t_s"][0] + rows["dt_s"][0]),
            "sensors_in_log": list(self.log.sensors),
            "reference": self.log.reference.name if self.log.reference else None,
            "reference_kind": self.log.reference.kind if self.log.reference else None,
            "repairs": list(self.log.repairs),
            "known": to_json(Instruments(self.log.known)),
            "ledger": self.log.ledger.to_json(),
            "judged_s": self.judged_s,
            "not_judged": self.not_judged or None,
            "notes": [*self.log.notes, *self.notes],
        }
        each = {r.estimator: r.to_json() | {"recording": _place(self.folders[r.estimator])} for r in self.replays}
        alone = next(iter(each.values())) if len(each) == 1 else {}
        return {**about, "estimators": each, **alone}


def replay_log(
    path: Path,
    names: Sequence[str],
    into: Path | None,
    *,
    reference: Path | None = None,
    columns: str | None = None,
    imu: int | None = None,
    params: Mapping[str, Any] | None = None,
    withheld: Sequence[str] = (),
    window: Window | None = None,
    rerun: bool = True,
) -> Replays:
    """Read the log at `path`, replay it with each estimator of `names`, record each below the folder `into`.

    into : None records nothing
    params : for all estimators that have them, or, as ``premerlani.gps_latency_s``, for one
    withheld : properties of the instruments to hide from the estimators; ``all`` hides all of them

    Raises
    ------
    ValueError      one line: log, reference, map, estimator, parameter or folder; nothing has been written
    """
    window, params = window or Window(), params or {}
    if not names or len({short_name(name) for name in names}) < len(names):
        raise ValueError(f"--estimator {','.join(names)}: name one or more, each only once")
    settings = {name.removeprefix(PREFIX).removeprefix("instruments."): v for name, v in params.items()}
    of_each, withheld = shared_settings(names, settings), property_names(withheld)
    for name in names:
        make(name, of_each[name])
    if into is not None:
        recording.check_writable(into)
    log = logs.read(path, reference=reference, columns=columns, imu=imu)
    for name in names:  # all are made with the properties of the log before any is run
        make(name, of_each[name], known_to(log, withheld))
    replays: list[Replayed] = []
    for name in names:
        watched = f"estimator {name}"
        if watched in guard.lost:  # it ended the process
            replays.append(gone(name, f"the process {guard.lost[watched].message}"))
            continue
        with console.progress(f"replaying {name}", "") as advance, guard.watched(watched):
            replays.append(replay(log, name, of_each[name], window, withheld, advance))
    flights = {replayed.estimator: as_flight(log, replayed, window) for replayed in replays if len(replayed.log)}
    folders = {r.estimator: _recorded(flights.get(r.estimator), log, r.estimator, into, rerun) for r in replays}
    first = replays[0].first
    judged_s = float(np.sum(log.rows["dt_s"][judged_rows(log, window, first)]))
    notes = (*lines_on_others(of_each, settings), *_ground_too(log))
    return Replays(log, judged_s, tuple(replays), folders, flights, why_none(log, window, first), notes)


def _recorded(flight: Flight | None, log: RecordedLog, name: str, into: Path | None, rerun: bool) -> Path | None:
    """Where `flight`, the replay of `log` by the estimator `name`, was recorded; None if it was not."""
    if flight is None or into is None:
        return None
    with console.progress(f"recording {name}", "") as _:
        return record(flight, into, f"replay_{file_name(log.name.partition('.')[0])}-{file_name(name)}", rerun=rerun)


def _place(folder: Path | None) -> str | None:
    return None if folder is None else str(folder)


def _ground_too(log: RecordedLog) -> list[str]:
    """A line if the log has fixes but none is usable, so that ground and flight cannot be separated."""
    fixes = log.ledger.get("gps")
    if fixes is None or not fixes.read or fixes.used:
        return []
    return ["no fix is usable: all rows are judged, also those on the ground"]


def print_report(replays: Replays) -> None:
    """Print the log, the repairs, the table of scores, and the folders of the recordings."""
    out, log = console.out(), replays.log
    length_s = log.rows["t_s"][-1] - log.rows["t_s"][0]
    console.line(f"{log.name}: {len(log.rows)} rows, {length_s:.1f} s, {', '.join(log.sensors)}")
    for line in log.notes:
        console.line(f"note        {line}")
    for line in log.repairs:
        console.line(f"repaired    {line}", "yellow")
    for line in replays.notes:
        console.line(f"note        {line}")
    if len(log.ledger):
        columns = ("", "read", "used", "left out")
        out.print(console.table("samples in the log", columns, _ledger_rows(log), text=(0, 3), wrapping=(3,)))
    if log.reference is not None:
        console.line(f"against     {log.reference.name}, {replays.judged_s:.1f} s of it judged")
    rows = [_row(replayed) for replayed in replays.replays]
    out.print(console.table("differences from the reference, degrees", _HEADINGS, rows, wrapping=(0,)))
    console.print_known({replayed.estimator: replayed.known for replayed in replays.replays})
    for replayed in replays.replays:
        if replayed.refused:
            refused = ", ".join(f"{n} {name}" for name, n in replayed.refused.items())
            console.line(f"rejected by {replayed.estimator}: {refused} samples")
        if replayed.failure:
            console.line(f"{replayed.estimator} failed: {replayed.failure}", "bold red")
    if replays.not_judged:
        style = "bold red" if log.reference is not None else "yellow"
        console.line(f"nothing judged: {replays.not_judged}", style)
    for folder in filter(None, replays.folders.values()):
        console.line(f"recording   {folder}")


def _ledger_rows(log: RecordedLog) -> list[list[str]]:
    """Rows of the ledger."""
    return [
        [stream, str(entry.read), str(entry.used), ", ".join(f"{n} {reason}" for reason, n in entry.left_out.items())]
        for stream, entry in log.ledger.items()
    ]


def _row(replayed: Replayed) -> list[str]:
    """A row of the table, with related numbers in one cell, so that it fits 80 columns."""
    cells = [" ".join(f"{console.number(replayed.scores[name]):>6}" for name in names) for names in _SHOWN]
    return [replayed.estimator, *cells, f"{replayed.ns_per_update:.0f}"]


def run(
    log: Path,
    names: Callable[[], Sequence[str]],
    into: Path,
    json_: str | None,
    options: Callable[[], Mapping[str, Any]],
) -> int:
    """Do what the command line asks for, with the `options` of `replay_log`; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            replays = replay_log(log, names(), into, **options())
        report(replays.to_json())
        print_report(replays)  # last: a reader who closes the pipe loses no file
    return replays.exit_code
