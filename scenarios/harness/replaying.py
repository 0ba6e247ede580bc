"""`wingslevel replay`: a log read, replayed by one estimator or several, recorded and told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from estimator.instruments import Instruments, to_json
from scenarios.harness import console, logs, viewing
from scenarios.harness.logs.recorded import RecordedLog
from scenarios.harness.replay import Replayed, Window, as_flight, judged_rows, make, replay
from sim import recording

_HEADINGS = ("", "inclination\n   RMS    p95    max", "heading\nRMS", "rotation\n   RMS    max", "ns per\nupdate")
_SHOWN = (
    ("inclination_rms_deg", "inclination_p95_deg", "inclination_max_deg"),
    ("heading_rms_deg",),
    ("rotation_rms_deg", "rotation_max_deg"),
)


@dataclass(frozen=True, slots=True)
class Told:
    """A log and what the estimators made of it; `folders` holds their recordings, by name."""

    log: RecordedLog
    judged_s: float
    replays: tuple[Replayed, ...]
    folders: Mapping[str, Path]

    @property
    def exit_code(self) -> int:
        """1 where an estimator failed."""
        return 1 if any(r.failure for r in self.replays) else 0

    def to_json(self) -> dict[str, Any]:
        """Every number by its estimator; with one estimator at the top too."""
        rows = self.log.rows
        about = {
            "log": self.log.name,
            "rows": len(rows),
            "length_s": float(rows["t_s"][-1] - rows["t_s"][0] + rows["dt_s"][0]),
            "instruments": list(self.log.instruments),
            "reference": self.log.reference.name if self.log.reference else None,
            "reference_kind": self.log.reference.kind if self.log.reference else None,
            "repairs": list(self.log.repairs),
            "known": to_json(Instruments(self.log.known)),
            "ledger": self.log.ledger.to_json(),
            "judged_s": self.judged_s,
        }
        each = {r.estimator: r.to_json() | {"recording": str(self.folders[r.estimator])} for r in self.replays}
        alone = next(iter(each.values())) if len(each) == 1 else {}
        return {**about, "estimators": each, **alone}


def run(
    path: Path,
    names: Sequence[str],
    into: Path,
    *,
    reference: Path | None = None,
    columns: str | None = None,
    imu: int | None = None,
    params: Mapping[str, Any] | None = None,
    window: Window | None = None,
    rerun: bool = True,
) -> Told:
    """Read the log at `path`, replay it with each estimator of `names`, record each below the folder `into`.

    params : of all of them, or, as ``premerlani.gps_latency_s``, of one

    Raises
    ------
    ValueError      one line: log, reference, map, estimator, parameter or folder; nothing has been written then
    """
    window, params = window or Window(), params or {}
    if len({name.rpartition(":")[2] for name in names}) < len(names):
        raise ValueError(f"--estimator {','.join(names)}: name each one once")
    of_each = {name: _params_of(name, names, params) for name in names}
    for name in names:
        make(name, of_each[name])
    recording.check_writable(into)
    log = logs.read(path, reference=reference, columns=columns, imu=imu)
    console.warn_if_cold()
    replays, folders = [], {}
    for name in names:
        with console.progress(f"replaying {name}", "") as advance:
            replays.append(replay(log, name, of_each[name], window, advance))
    stem = log.name.partition(".")[0]
    for replayed in replays:
        flight = as_flight(log, replayed, window)
        folder = recording.save(flight, _free_folder(into, f"replay_{stem}-{replayed.estimator}"))
        folders[replayed.estimator] = folder
        if rerun:
            with console.progress(f"recording {replayed.estimator}", "") as _:
                viewing.write_rerun(flight, folder)
    judged = judged_rows(log, window, replays[0].first)
    return Told(log, float(np.sum(log.rows["dt_s"][judged])), tuple(replays), folders)


def _params_of(name: str, names: Sequence[str], params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters for the estimator `name`: those for all, and those whose names begin with its own."""
    shorts, short = [other.rpartition(":")[2] for other in names], name.rpartition(":")[2]
    found = {}
    for key, value in params.items():
        head, _, rest = key.partition(".")
        if head not in shorts or not rest:
            found[key] = value
        elif head == short:
            found[rest] = value
    return found


def tell(told: Told) -> None:
    """The log, what was repaired in it, the table, and where the recordings are."""
    out, log = console.out(), told.log
    length_s = log.rows["t_s"][-1] - log.rows["t_s"][0]
    out.print(Text(f"{log.name}: {len(log.rows)} rows, {length_s:.1f} s, {', '.join(log.instruments)}"), soft_wrap=True)
    for line in log.repairs:
        out.print(Text(f"repaired    {line}", "yellow"), soft_wrap=True)
    if log.reference is None:
        out.print(Text("no attitude in it to score against: --reference FILE"), soft_wrap=True)
    else:
        out.print(Text(f"against     {log.reference.name}, {told.judged_s:.1f} s of it judged"), soft_wrap=True)
    rows = [_row(replayed) for replayed in told.replays]
    out.print(console.table("differences from the reference, degrees", _HEADINGS, rows))
    console.print_known({replayed.estimator: replayed.known for replayed in told.replays})
    for replayed in told.replays:
        if replayed.refused:
            refused = ", ".join(f"{n} {name}" for name, n in replayed.refused.items())
            out.print(Text(f"not believed by {replayed.estimator}: {refused} samples"), soft_wrap=True)
        if replayed.failure:
            out.print(Text(f"{replayed.estimator} failed: {replayed.failure}", "bold red"), soft_wrap=True)
    for folder in told.folders.values():
        out.print(Text(f"recording   {folder}"), soft_wrap=True)


def _row(replayed: Replayed) -> list[str]:
    """A line of the table: numbers that belong together in one cell, so that it fits 80 columns."""
    cells = [" ".join(f"{console.number(replayed.scores[name]):>6}" for name in names) for names in _SHOWN]
    return [replayed.estimator, *cells, f"{replayed.ns_per_update:.0f}"]


def _free_folder(into: Path, name: str) -> Path:
    """A new folder, made here: no replay is written over another."""
    i = 1
    while True:
        path = into / (name if i == 1 else f"{name}-{i}")
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            i += 1
        else:
            return path


def _short(value: Any) -> str:
    """A parameter in a few letters."""
    return value if isinstance(value, str) else f"{value:g}"
