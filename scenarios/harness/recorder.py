"""A flight that was flown, put on disk: its folder appears complete, or not at all."""

from pathlib import Path

from scenarios.harness.cli import reports as cli_reports
from scenarios.harness.commands import view as viewing
from sim import recording
from sim.log import Flight


def record(flight: Flight, into: Path, name: str, *, rerun: bool) -> Path | None:
    """Record `flight` in a new folder below `into`, named `name` or, where that is taken, ``name-2``.

    What was flown is judged and reported whether or not it can be written: what cannot is told on one line, and
    makes the command fail when all is done (`cli_reports.losses`).

    Returns
    -------
    The folder; None where it could not be written.  Without the Rerun recording, where that alone could not be.
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
