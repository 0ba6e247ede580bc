"""What the command also does, as functions: recordings shown and exported, pages, benchmarks, claims, agreement."""

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from wingslevel._errors import WingslevelError, one_line

if TYPE_CHECKING:
    from sim.log import Flight as Recorded

AnyPath = str | os.PathLike[str]


def view(path: AnyPath, *, web: bool = False) -> None:
    """Open the recording at `path` (a folder, or a .rrd or .parquet file) in the Rerun viewer.

    The viewer is a process of its own: the call returns at once.  web : in the browser instead of a window

    Raises
    ------
    WingslevelError     no recording there, or no viewer could be started (without a display, use `web`)
    """
    from scenarios.harness.commands import view as viewing

    with one_line():
        viewing.open_flight(Path(path), web=web)


def view_flight(recorded: "Recorded", *, web: bool) -> None:
    """Show a flight that may not be recorded: it is written to a temporary folder, which the viewer reads."""
    from scenarios.harness.commands import view as viewing

    with one_line():
        viewing.open_flight(viewing.write_rerun(recorded, Path(tempfile.mkdtemp(prefix="wingslevel-"))), web=web)


def export(
    path: AnyPath,
    *,
    nmea: AnyPath | None = None,
    ubx: AnyPath | None = None,
    csv: AnyPath | None = None,
    start: str | None = None,
) -> list[Path]:
    """Write the GPS fixes of the recording at `path` as NMEA sentences or UBX messages, all of it as a text log.

    Parameters
    ----------
    nmea, ubx, csv      files to write, at least one; the text log is packed where its name ends with .gz
    start               UTC at power-up, ``"2026-07-02T12:00:00"``

    Returns
    -------
    The files written: of a text log its column map, too, with which `replay` reads it.

    Raises
    ------
    WingslevelError     no recording, no fix in it, or a file that cannot be written
    """
    from sim import recording

    with one_line():
        return export_flight(recording.load(Path(path)), nmea=nmea, ubx=ubx, csv=csv, start=start, source=Path(path))


def export_flight(
    recorded: "Recorded",
    *,
    nmea: AnyPath | None,
    ubx: AnyPath | None,
    csv: AnyPath | None,
    start: str | None,
    source: Path | None = None,
) -> list[Path]:
    """`export` of a flight that may not be recorded."""
    from scenarios.harness.commands import export as exporting
    from sim.recording import replacing

    given = [None if path is None else Path(path) for path in (nmea, ubx, csv)]
    if not any(given):
        raise WingslevelError("nothing to write: name a file with nmea, ubx or csv")
    with one_line():
        began = exporting.parse_start(start)
        made = exporting.make_of(recorded, source or Path("flight"), given[0], given[1], began, given[2])
        for path, data in made.files.values():
            with replacing(path) as temporary:
                temporary.write_bytes(data)
    return [path for path, _ in made.files.values()]
