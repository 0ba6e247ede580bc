"""Our own recordings: the measurements, with the truth as the reference."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import Array, ImuSample
from scenarios.harness.logs import attitudes, properties
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from sim import recording
from sim.log import Flight
from sim.outside import files
from sim.view.story import launch_place


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
    rows, came = _measured_of(flight), arrived(flight.log.measured)
    rows = rows[came]
    ledger = Ledger()
    reference = Reference(_true(flight.log.truth["R_eb"][came], ledger), "truth", "the true attitude")
    name = path.name if path.is_dir() else path.parent.name
    known = known_of(flight) if "known" in flight.manifest else _measured(rows)  # replay uses what was known in flight
    known |= calibration_of(flight)
    return RecordedLog(
        rows, name or path.name, properties.sensors(rows), reference, (), place_of(flight), known, ledger,
        on_ground=on_ground_of(flight),
    )  # fmt: skip


def arrived(rows: NDArray[Any]) -> NDArray[np.bool_]:
    """Rows whose inertial sample arrived: a lost one repeats the time stamp of the one before."""
    return np.concatenate([[True], np.diff(rows["t_s"]) > 0.0]) if len(rows) else np.zeros(0, np.bool_)


def _measured_of(flight: Flight) -> NDArray[Any]:
    """The measured rows, with impossible numbers as NaN."""
    rows = flight.log.measured.copy()
    for name in rows.dtype.names or ():
        if rows.dtype[name].base.kind == "f":
            rows[name] = files.measured(rows[name])
    return rows


def _true(R_eb: Array, ledger: Ledger) -> Array:
    """The attitude, NaN where it is not a rotation; these are counted in the ledger."""
    found = attitudes.rotations(R_eb)
    lost = int(np.sum(~np.isfinite(found).all(axis=(1, 2))))
    if lost:
        ledger.read("reference", len(R_eb))
        ledger.leave_out("reference", lost, attitudes.NO_ROTATION)
    return found


def known_of(flight: Flight) -> dict[str, Known]:
    """What the manifest of a flight says about the instruments."""
    known = flight.manifest.get("known") or {}
    return {name: Known.from_json(entry) for name, entry in known.items()}


def calibration_of(flight: Flight) -> dict[str, Known]:
    """The magnetometer calibration that the estimator was given in flight, by parameter name."""
    given = (flight.manifest.get("config") or {}).get("estimator_params") or {}
    return {n: Known(v, "log", "calibration in flight") for n, v in given.items() if n.startswith("calibration.")}


def on_ground_of(flight: Flight) -> ImuSample | None:
    """The mean inertial sample at rest before a flight that starts in the air, if there is one."""
    sample = flight.manifest.get("on_ground")
    if sample is None:
        return None
    gyro, force = (np.array(sample[name], np.float64) for name in ("gyro_b_rad_s", "force_b_m_s2"))
    return ImuSample(sample["t_s"], sample["dt_s"], gyro, force)


def place_of(flight: Flight) -> tuple[float, float]:
    """Latitude and longitude of the launch point, degrees."""
    place = launch_place(flight.manifest)
    return place.latitude_deg, place.longitude_deg


def _measured(rows: NDArray[Any]) -> dict[str, Known]:
    """What the rows show, for a recording without a record of its instruments."""
    known = properties.measured(rows)
    fixes = rows[rows["gps_new"] > 0]
    if len(fixes):
        known["gps_stamped"] = Known(bool(np.isfinite(fixes["gps_t_s"]).any()), "log", "stamps of the fixes")
    return known
