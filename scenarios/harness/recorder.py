"""Write a flight to disk: its folder appears complete, or not at all."""

from pathlib import Path

from scenarios.harness.cli import reports as cli_reports
from scenarios.harness.commands import view as viewing
from sim import recording
from sim.log import Flight


def record(flight: Flight, into: Path, name: str, *, rerun: bool) -> Path | None:
    """Record `flight` in a new folder below `into`, named `name` or, if that is taken, ``name-2``.

    The verdict is reported even if the recording cannot be written: that prints one line, and the command fails at the
    end (`cli_reports.losses`).

    Returns
    -------
    The folder; None if it could not be written.  Without the Rerun recording, if that alone could not be.
    """
    cli_reports.come_home()
    with cli_reports.attempt():
        with recording.new_folder(into, name) as draft:
            recording.save(flight, draft.path)
            if rerun:
                try:
                    viewing.write_rerun(flight, draft.path)
                except recording.RecordingError as problem:
                    cli_reports.lose(draft.named(str(problem)), problem)
        return draft.place
    return None
