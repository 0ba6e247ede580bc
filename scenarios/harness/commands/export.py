"""A recorded flight for other programs: its GPS fixes as NMEA sentences and UBX messages, all of it as a text log."""

import gzip
import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

from scenarios.harness.cli import console
from scenarios.harness.cli.reports import check_file, reporting, usage, write
from scenarios.harness.commands import export_text
from scenarios.harness.commands.view import newest
from sim import gps_messages, recording
from sim.gps_messages import Accuracy, Fixes, Place
from sim.log import Flight
from sim.outside import files as strangers
from sim.sensors.fitting import suite_params
from sim.view.story import launch_place


@dataclass(frozen=True, slots=True)
class Export:
    """The export of the recording `flight`: the bytes for each file, by format.

    rows : of its text log
    """

    flight: Path
    fixes: Fixes
    start: datetime
    files: dict[str, tuple[Path, bytes]]
    rows: int = 0

    def utc(self, t_s: float) -> datetime:
        """UTC at `t_s` since power-up."""
        return self.start + timedelta(seconds=t_s)

    def to_json(self) -> dict[str, Any]:
        """The same for scripts."""
        first_t_s, last_t_s = _span(self.fixes)
        return {
            "flight": str(self.flight),
            "fixes": len(self.fixes),
            "rows": self.rows,
            "start_utc": self.start.isoformat(),
            "first_t_s": first_t_s,
            "last_t_s": last_t_s,
            "files": [{"format": f, "file": str(p), "bytes": len(data)} for f, (p, data) in self.files.items()],
        }


def parse_start(text: str | None) -> datetime:
    """A date and time; without a zone it is UTC, as in every message.  ValueError if it is none."""
    if text is None:
        return gps_messages.START
    try:
        start = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(
            f"--start {text!r}: write a date and a time of UTC, for instance 2026-07-02T12:00:00"
        ) from error
    return start if start.tzinfo is not None else start.replace(tzinfo=gps_messages.START.tzinfo)


def make(
    source: Path, nmea: Path | None = None, ubx: Path | None = None, start: datetime = gps_messages.START,
    csv: Path | None = None,
) -> Export:  # fmt: skip
    """The recording at `source` (as `view` takes it) as messages and a text log, see `make_of`."""
    _require_apart(nmea, ubx, csv)
    return make_of(recording.load(source.parent if source.suffix == ".rrd" else source), source, nmea, ubx, start, csv)


def make_of(
    flight: Flight, source: Path, nmea: Path | None = None, ubx: Path | None = None,
    start: datetime = gps_messages.START, csv: Path | None = None,
) -> Export:  # fmt: skip
    """`flight`, of the recording at `source`, as messages and a text log.

    nmea, ubx, csv : where each will be written      start : UTC at power-up
    The text log is compressed if its name ends with .gz; its column map is written beside it, as .toml.

    Raises
    ------
    ValueError      no output requested, no fix for the messages, or a missing package
    """
    _require_apart(nmea, ubx, csv)
    with strangers.reading(source):
        fixes = Fixes.from_log(flight.log.measured, accuracy_of(flight))
    if len(fixes) == 0 and (nmea is not None or ubx is not None):
        raise ValueError(f"no GPS fix arrived in {source}: nothing to export")
    files: dict[str, tuple[Path, bytes]] = {}
    if nmea is not None:
        files["NMEA"] = nmea, gps_messages.encode_nmea(fixes, origin_of(flight), start)
    if ubx is not None:
        files["UBX"] = ubx, gps_messages.encode_ubx(fixes, origin_of(flight), start)
    if csv is not None:
        columns = export_text.columns(flight)
        text = export_text.to_csv(columns).encode()
        files["CSV"] = csv, gzip.compress(text, mtime=0) if csv.suffix == ".gz" else text
        files["map"] = map_of(csv), export_text.to_map(columns, flight, csv.name).encode()
    return Export(source, fixes, start, files, len(flight.log))


def origin_of(flight: Flight) -> Place:
    """The launch point of `flight`, from which its positions count."""
    place = launch_place(flight.manifest)
    return Place(place.latitude_deg, place.longitude_deg, place.elevation_m)


def _require_apart(nmea: Path | None, ubx: Path | None, csv: Path | None) -> None:
    """ValueError unless there is a file to write, and each is named only once."""
    if nmea is None and ubx is None and csv is None:
        raise ValueError("nothing to write: name --nmea FILE, --ubx FILE, --csv FILE or several of them")
    named: dict[Path, str] = {}
    wanted = {"--nmea": nmea, "--ubx": ubx, "--csv": csv, "the map of --csv": None if csv is None else map_of(csv)}
    for option, path in wanted.items():
        if path is None:
            continue
        if path.resolve() in named:
            raise ValueError(f"{named[path.resolve()]} and {option} both name {path}: use separate files")
        named[path.resolve()] = option


def map_of(csv: Path) -> Path:
    """Where the column map of a text log is written: beside it, as .toml.

    Raises
    ------
    ValueError      a name that `replay` would not read as a text log
    """
    if not csv.name.lower().endswith((".csv", ".csv.gz")):
        raise ValueError(f"--csv {csv}: name a file that ends with .csv or .csv.gz")
    return csv.with_name(csv.name[: csv.name.lower().rindex(".csv")] + ".toml")


def accuracy_of(flight: Flight) -> Accuracy:
    """The accuracies that the receiver of `flight` reports: the sigmas of its errors; unknown without a config."""
    config = flight.manifest.get("config")
    if config is None:
        return Accuracy()
    if not isinstance(config.get("suite"), str):
        raise ValueError("its config names no sensor suite")
    gps = suite_params(config["suite"], config.get("sensors") or {}, config.get("files") or {}).gps
    both_axes_m = math.sqrt(2.0) * math.hypot(gps.wander_horizontal_m, gps.noise_horizontal_m)
    vertical_m = math.hypot(gps.wander_vertical_m, gps.noise_vertical_m)
    return Accuracy(both_axes_m, vertical_m, math.hypot(gps.velocity_noise_m_s, gps.velocity_wander_m_s))


def print_report(export: Export) -> None:
    """Print the table."""
    first_t_s, last_t_s = _span(export.fixes)
    times = ["none" if t is None else f"{export.utc(t):%H:%M:%S.%f}"[:-3] for t in (first_t_s, last_t_s)]
    fixes = str(len(export.fixes)), *times
    held = {"NMEA": fixes, "UBX": fixes, "CSV": (str(export.rows), "", ""), "map": ("", "", "")}
    rows = [(name, *held[name], str(len(data)), str(path)) for name, (path, data) in export.files.items()]
    headings = ("", "fixes, rows", "first, UTC", "last, UTC", "bytes", "file")
    title = f"GPS fixes of {export.utc(first_t_s or 0.0):%Y-%m-%d}" if "CSV" not in export.files else "exported"
    console.out().print(console.table(title, headings, rows, text=(0, 5)))


def _span(fixes: Fixes) -> tuple[float | None, float | None]:
    """The first and the last stamp; None without fixes."""
    stamps = [float(t) for t in fixes.t_s if math.isfinite(t)]
    return (min(stamps), max(stamps)) if stamps else (None, None)


def run(
    flight: Path | None,
    below: Path,
    nmea: Path | None,
    ubx: Path | None,
    csv: Path | None,
    start: str | None,
    json_: str | None,
) -> None:
    """Do what the command line asks for, with `flight` or the newest `below` that folder."""
    with reporting(json_) as report:
        with usage():
            for path in (nmea, ubx, csv, map_of(csv) if csv is not None else None):
                check_file(path)
            done = make(flight or newest(below), nmea, ubx, parse_start(start), csv)
        for path, data in done.files.values():
            write(path, partial(bytes, data))
        report(done.to_json())
        print_report(done)  # last: a reader who closes the pipe loses no file
