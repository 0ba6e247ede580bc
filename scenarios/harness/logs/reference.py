"""Reference vectors: synthetic sensor input (``*_in.csv.gz``) with a reference attitude for each row.

The input has a row per inertial sample in SI units, earth north-east-down, body forward-right-down: time of the end
of the interval, its length, mean rate and specific force, GPS velocity and position where a fix arrived, magnetic
field in counts where a sample arrived, airspeed.  The attitudes (``*_truth``, or what the original firmware printed)
are the nine elements of the body-to-earth rotation, row by row.

How the input was made, and how the original firmware was configured, is known from the file names and goes to the
estimators that have such a parameter (`RecordedLog.known`).
"""

import csv
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import MEASURED_DTYPE, Array
from scenarios.harness.logs import accounts, properties
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from scenarios.harness.logs.text_table import unpacked
from scenarios.harness.logs.validity import latest, usable
from sim.outside import files

COUNT_UT = 0.1  # one count of the magnetometer: a field of 500 counts is about the earth's 50 uT
LEAST_FIX = 3  # a fix of three dimensions
INPUT = ("t", "dt", "gx", "gy", "gz", "ax", "ay", "az", "gps_new", "gps_vn", "gps_ve", "gps_vd", "gps_fix",
         "mag_new", "mx", "my", "mz", "airspeed", "gps_n", "gps_e", "gps_d")  # fmt: skip
KNOWN = {  # by the name of the set: receivers without a filter, some with latency; E100 has no receiver
    "A50": {"declination_rad": math.radians(10.0), "gps_filter_s": 0.0, "gps_latency_s": 0.0},
    "C50": {"declination_rad": math.radians(10.0), "gps_filter_s": 0.0, "gps_latency_s": 0.4},
    "C40": {"declination_rad": math.radians(10.0), "gps_filter_s": 0.0, "gps_latency_s": 0.25},
}
SETTINGS: dict[str, dict[str, Any]] = {  # of the original firmware, by the end of the name of its output
    "_ap2013_gps": {"quirks": "JULY_2013", "use_magnetometer": False},
    "_ap2013_mag": {"quirks": "JULY_2013"},
    "_ap2013_mag_nogps_copter": {"quirks": "JULY_2013", "fly_forward": 0.0},
    "_mp_gpscent": {"centrifugal_from_gps": 1.0, "keep_tilt": 0.0},
}
AP2013_STEPS = {  # resolution of the inputs of that firmware
    "gps_v_e_m_s": 0.01,
    "gps_speed_m_s": 0.01,
    "gps_course_rad": math.radians(0.01),
    "mag_b_ut": COUNT_UT,
}
ATTITUDE = ("t", *(f"r{i}{j}" for i in range(3) for j in range(3)))


def is_reference(path: Path) -> bool:
    """Whether the file at `path` has the name of an input of reference vectors."""
    return path.name.endswith(("_in.csv.gz", "_in.csv"))


def read(path: Path, reference: Path | None = None) -> RecordedLog:
    """The input at `path` with the attitudes in `reference`, by default in the ``*_truth`` file beside it, if any.

    Raises
    ------
    LogError      a file that cannot be read, lacks a column, or belongs to another input
    """
    table = _table(path, INPUT)
    n = len(table["t"])
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = table["t"], table["dt"]
    rows["gyro_b_rad_s"] = _vector(table, "gx", "gy", "gz")
    rows["force_b_m_s2"] = _vector(table, "ax", "ay", "az")
    reported, lost = table["gps_new"] > 0.0, table["gps_fix"] < LEAST_FIX
    ledger = Ledger()
    fixes = reported & ~lost
    if reported.any():
        fixes = accounts.samples(ledger, "gps", reported, [(lost, accounts.NO_FIX)])
    velocity = _held(_vector(table, "gps_vn", "gps_ve", "gps_vd"), fixes)
    rows["gps_new"], rows["gps_valid"] = fixes, usable(fixes, table["t"], reported & lost)
    rows["gps_v_e_m_s"] = velocity
    rows["gps_p_e_m"] = _held(_vector(table, "gps_n", "gps_e", "gps_d"), fixes)
    rows["gps_t_s"] = np.nan  # the time of validity is not in the file
    rows["gps_speed_m_s"] = np.hypot(velocity[:, 0], velocity[:, 1])
    rows["gps_course_rad"] = np.arctan2(velocity[:, 1], velocity[:, 0]) % (2.0 * np.pi)
    rows["mag_new"] = table["mag_new"] > 0.0
    rows["mag_b_ut"] = _held(COUNT_UT * _vector(table, "mx", "my", "mz"), rows["mag_new"] > 0)
    rows["air_new"], rows["equivalent_airspeed_m_s"] = bool(np.any(table["airspeed"] != 0.0)), table["airspeed"]
    rows["baro_height_m"] = np.nan
    attitudes = _reference(path, reference, table["t"])
    if attitudes is not None and "_ap2013_" in attitudes.name:
        for column, step in AP2013_STEPS.items():
            rows[column] = step * np.rint(rows[column] / step)
    known = {**properties.measured(rows), **_known(path, attitudes)}
    if fixes.any():
        known["gps_stamped"] = Known(False, "log", "no stamps of fixes")
    return RecordedLog(rows, path.name, properties.sensors(rows), attitudes, known=known, ledger=ledger)


def _known(path: Path, attitudes: Reference | None) -> dict[str, Known]:
    """What is known of the set of `path` and of the firmware that printed the `attitudes`."""
    known: dict[str, Any] = dict(KNOWN.get(path.name.partition("_")[0], {}))
    for end, settings in SETTINGS.items():
        if attitudes is not None and attitudes.name.endswith(end):
            known |= settings
    return {name: Known(value, "log", "name of the file") for name, value in known.items()}


def _reference(path: Path, reference: Path | None, t_s: Array) -> Reference | None:
    if reference is None:
        reference = path.with_name(path.name.replace("_in.csv", "_truth.csv"))
        if not reference.is_file():
            return None
    table = _table(reference, ATTITUDE)
    if len(table["t"]) != len(t_s) or np.abs(table["t"] - t_s).max() > 5e-4:  # times are printed to the millisecond
        raise LogError(f"{reference}: {len(table['t'])} rows at other times than the {len(t_s)} of {path.name}")
    R_eb = np.stack([table[name] for name in ATTITUDE[1:]], axis=-1).reshape(-1, 3, 3)
    kind: Literal["truth", "firmware"] = "truth" if "_truth." in reference.name else "firmware"
    return Reference(R_eb, kind, reference.name.partition(".csv")[0])


def _table(path: Path, wanted: tuple[str, ...]) -> dict[str, Array]:
    """Columns of a file of comma-separated numbers, packed or not."""
    lines = csv.reader(unpacked(path, "table of reference vectors").decode().splitlines())
    header = next(lines, [])
    missing = [name for name in wanted if name not in header]
    if missing:
        raise LogError(f"{path}: no column {', '.join(missing)}; it has {', '.join(header) or 'none'}")
    rows = []
    for line in lines:
        if len(line) != len(header):
            raise LogError(f"{path}: line {lines.line_num}: {len(line)} cells; the header has {len(header)}")
        where = f"{path}: line {lines.line_num}, column"
        rows.append([_number(cell, where, name) for name, cell in zip(header, line, strict=True)])
    if not rows:
        raise LogError(f"{path}: no row of numbers")
    values = files.measured(np.array(rows))
    return {name: values[:, header.index(name)] for name in wanted}


def _number(cell: str, where: str, name: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise LogError(f"{where} {name}: {cell!r} is not a number") from None


def _vector(table: dict[str, Array], *names: str) -> Array:
    return np.stack([table[name] for name in names], axis=-1)


def _held(values: Array, new: NDArray[np.bool_]) -> Array:
    """`values` where `new`, held until the next, zero before the first."""
    last = latest(new)
    return np.where(last[:, None] >= 0, values[last], 0.0)
