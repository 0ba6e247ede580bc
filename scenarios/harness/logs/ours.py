"""Our own recordings: what was measured aboard, and the truth beside it."""

from pathlib import Path

import numpy as np

from estimator.instruments import Known
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from sim import recording
from sim.place import LATITUDE_DEG, LONGITUDE_DEG
from sim.story import setting


def read(path: Path) -> RecordedLog:
    """The measured rows of the recording at `path`, its folder or its Parquet; the truth is the reference.

    Raises
    ------
    LogError      no recording, or one that cannot be read
    """
    try:
        flight = recording.load(path)
    except recording.RecordingError as error:
        raise LogError(str(error)) from error
    if not len(flight.log):
        raise LogError(f"{path}: a flight without a tick")
    rows = flight.log.measured
    has = {"gps": "gps_new", "magnetometer": "mag_new", "airspeed": "air_new"}
    instruments = ("gyro", "accelerometer", *(name for name, new in has.items() if np.any(rows[new])))
    reference = Reference(flight.log.truth["R_eb"], "truth", "the true attitude")
    place = (
        float(setting(flight.manifest, "launch_latitude_deg", LATITUDE_DEG)),
        float(setting(flight.manifest, "launch_longitude_deg", LONGITUDE_DEG)),
    )
    name = path.name if path.is_dir() else path.parent.name
    known = {n: Known(k["value"], k["source"]) for n, k in flight.manifest.get("known", {}).items()}
    return RecordedLog(rows, name or path.name, instruments, reference, (), place, known)
