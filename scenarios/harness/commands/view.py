"""Recordings in the Rerun viewer: one on disk, or a flight while it is flown."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from scenarios.harness.cli import console
from scenarios.harness.cli.reports import usage
from sim import recording
from sim.log import Flight, Log

if TYPE_CHECKING:
    from scenarios.harness.flight import Prepared
    from sim.view.rerun_view import LiveView, Viewer

RERUN = "flight.rrd"


def write_rerun(flight: Flight, folder: Path) -> Path:
    """Write the Rerun recording of `flight` beside its Parquet."""
    from sim.view import rerun_view

    return rerun_view.write(flight, folder / RERUN)


def newest(below: Path) -> Path:
    """The newest recording in the folder `below`; ValueError if it holds none."""
    found = below.glob(f"*/{recording.PARQUET}")
    latest = max(found, key=lambda path: path.stat().st_mtime, default=None)
    if latest is None:
        raise ValueError(f"no recording below {below}: fly first, for instance wingslevel fly hand_launch")
    return latest.parent


def open_flight(path: Path, *, web: bool) -> "Viewer":
    """Open the recording at `path`; written from its Parquet if there is no Rerun recording yet.

    Raises
    ------
    ValueError      no recording there, one that cannot be read, or no viewer that could be started
    """
    from sim.view import rerun_view

    if path.suffix != ".rrd":
        folder = path if path.is_dir() else path.parent
        if path.is_dir() and (path / RERUN).is_file():
            path = path / RERUN
        else:
            path = rerun_view.write(recording.load(path), folder / RERUN)
    return rerun_view.open_viewer(path, web=web)


def stay(viewer: "Viewer") -> None:
    """Print the address; serve a browser until Ctrl-C, or leave the window open."""
    if viewer.address is None:
        return
    console.out().print(f"open {viewer.address}   (Ctrl-C ends it)", soft_wrap=True)
    try:
        viewer.process.wait()
    except KeyboardInterrupt:
        viewer.process.terminate()


class RealTime:
    """Shows a flight in a viewer as it is flown, no faster than time passes."""

    def __init__(self, viewer: "Viewer", view: "LiveView", rate_hz: int) -> None:
        self.viewer = viewer
        self._view = view
        self._rate_hz = rate_hz
        self._began_s = time.monotonic()

    def __call__(self, log: Log, n_rows: int) -> None:
        self._view(log, n_rows)
        time.sleep(max(0.0, self._began_s + n_rows / self._rate_hz - time.monotonic()))

    def close(self, flight: Flight) -> None:
        """Send the rest."""
        self._view.close(flight)


def live(prepared: "Prepared", *, web: bool) -> RealTime:
    """Start the viewer for a flight to be flown; ValueError if it does not start."""
    from sim.view import rerun_view

    config = prepared.config
    viewer = rerun_view.open_viewer(web=web)
    if viewer.address is not None:
        console.err().print(f"open {viewer.address}", soft_wrap=True)
    view = rerun_view.LiveView(viewer.url, prepared.manifest, config.held_s, prepared.heading_reference)
    return RealTime(viewer, view, config.rates.imu_hz)


def run(flight: Path | None, below: Path, *, web: bool) -> None:
    """Do what the command line asks for: open `flight`, or the newest `below` that folder."""
    with usage():
        shown = open_flight(flight or newest(below), web=web)
    stay(shown)
