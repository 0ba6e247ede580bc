"""From named columns of numbers, as a text or MATLAB file holds them, to rows that estimators take."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pymap3d  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp  # type: ignore[import-untyped]

from estimator.interface import MEASURED_DTYPE, Array
from estimator.rotation import from_euler
from estimator.screening import LONGEST_GAP_S
from scenarios.harness.logs import checks
from scenarios.harness.logs.column_map import EULER, INERTIAL, MATRIX, QUATERNION, ColumnMap
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference

LEAST_FIX = 3.0  # a fix of three dimensions
_DEGREES = 180.0 / np.pi
Table = dict[str, Array]


def take(columns: Mapping[str, Array], meanings: ColumnMap, source: checks.Source) -> tuple[Table, checks.Source]:
    """The columns that the map knows, by our names and in our units; and the source, which learns their names.

    Raises
    ------
    LogError      a column of the map that is not there, or one of another length
    """
    missing = [name for name in meanings.columns if name not in columns]
    if missing:
        raise LogError(
            f"{source.path}: no column {', '.join(missing)}, which the map {meanings.name} names; "
            f"it has {', '.join(columns) or 'none'}"
        )
    table = {m.quantity: m.factor * columns[name] for name, m in meanings.columns.items()}
    sizes = {len(values) for values in table.values()}
    if len(sizes) > 1:
        raise LogError(f"{source.path}: columns of different lengths: {', '.join(str(n) for n in sorted(sizes))}")
    own = {m.quantity: name for name, m in meanings.columns.items()}
    for vector in ("gyro", "force", "mag"):
        own[vector] = " ".join(own[name] for name in (f"{vector}.{a}" for a in "xyz") if name in own) or vector
    source = replace(source, columns=own)
    if not any(m.told for m in meanings.columns.values() if m.quantity in EULER):
        _mend_angles(table)
    return table, source


def recorded(columns: Mapping[str, Array], meanings: ColumnMap, source: checks.Source) -> RecordedLog:
    """The log that the columns hold, checked.

    Raises
    ------
    LogError      one line with the file, the row and the column
    """
    table, source = take(columns, meanings, source)
    missing = [name for name in ("time", *INERTIAL) if name not in table]
    if missing:
        raise LogError(
            f"{source.path}: no column for {', '.join(missing)}; it has {', '.join(columns)}: "
            "name them in a column map (--columns MAP.toml)"
        )
    repairs: list[str] = []
    table["time"] = table["time"] * checks.clock_factor(table["time"], source, repairs)
    keep = checks.kept(table["time"], {name: table[name] for name in INERTIAL}, source, repairs)
    table = {name: values[keep] for name, values in table.items()}
    rows = np.zeros(len(keep), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = table["time"], np.nan
    rows["gyro_b_rad_s"] = _stack(table, INERTIAL[:3])
    rows["force_b_m_s2"] = _stack(table, INERTIAL[3:])
    place = _take_gps(rows, table, repairs)
    _take_rest(rows, table)
    R_eb = attitude(table)
    reference = None if R_eb is None else Reference(R_eb, "filter", f"attitude in {source.path.name}")
    has = {"gps": "gps_new", "magnetometer": "mag_new", "airspeed": "air_new"}
    instruments = ("gyro", "accelerometer", *(name for name, new in has.items() if rows[new].any()))
    log = RecordedLog(rows, source.path.name, instruments, reference, tuple(repairs), place, meanings.known)
    return checks.judged(log, source)


def attitude(table: Table) -> Array | None:
    """The attitude that the columns hold, shape (N, 3, 3), NaN where there is none; None without such columns.

    A filter that has not started reports zeros: level and to the north, all three exactly, is no attitude then.
    """
    if all(name in table for name in MATRIX):
        R_eb = _stack(table, MATRIX).reshape(-1, 3, 3)
        known = np.abs(R_eb @ R_eb.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) < 0.1
    elif all(name in table for name in QUATERNION):
        quaternion = _stack(table, QUATERNION)
        known = np.asarray(np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) < 0.1)
        R_eb = np.full((len(known), 3, 3), np.nan)
        if known.any():
            R_eb[known] = Rotation.from_quat(quaternion[known]).as_matrix()
    elif all(name in table for name in EULER):
        angles = _stack(table, EULER)
        known = np.isfinite(angles).all(axis=1) & np.maximum.accumulate(np.any(angles != 0.0, axis=1))
        R_eb = from_euler(*angles.T)
    else:
        return None
    return np.where(known[:, None, None], R_eb, np.nan)


def at_times(t_s: Array, R_eb: Array, times_s: Array) -> Array:
    """Attitude `R_eb` of the times `t_s` at other times, on the shortest way, NaN where it is too far off."""
    known = np.isfinite(R_eb).all(axis=(1, 2)) & np.isfinite(t_s)
    found = np.full((len(times_s), 3, 3), np.nan)
    t_s, first = np.unique(t_s[known], return_index=True)
    if len(t_s) < 2:
        return found
    after = np.clip(np.searchsorted(t_s, times_s), 1, len(t_s) - 1)
    inside = (times_s >= t_s[0]) & (times_s <= t_s[-1]) & (t_s[after] - t_s[after - 1] <= LONGEST_GAP_S)
    if inside.any():
        found[inside] = Slerp(t_s, Rotation.from_matrix(R_eb[known][first]))(times_s[inside]).as_matrix()
    return found


def _mend_angles(table: Table) -> None:
    """Angles whose unit nobody said are degrees where they exceed what radians can be."""
    if all(name in table for name in EULER):
        roll, pitch = (np.nanmax(np.abs(table[name]), initial=0.0) for name in ("roll", "pitch"))
        if roll > 3.2 or pitch > 1.6:
            for name in EULER:
                table[name] = table[name] / _DEGREES


def _take_gps(rows: NDArray[np.void], table: Table, repairs: list[str]) -> tuple[float, float] | None:
    """Fill the GPS columns of `rows`; returns latitude and longitude of the first fix, degrees, where known."""
    position, place = _position(table)
    velocity = _velocity(table)
    if velocity is None:
        if any(name.startswith("gps.") for name in table):
            repairs.append("GPS without a velocity (gps.vn and gps.ve, or gps.speed and gps.course): not used")
        return None
    new = _arrivals(table, velocity)
    held, last = _held(np.column_stack((position, velocity)), new)
    rows["gps_new"], rows["gps_valid"] = new, last >= 0
    rows["gps_t_s"] = np.where(last >= 0, rows["t_s"][last], 0.0)
    rows["gps_p_e_m"], rows["gps_v_e_m_s"] = held[:, :3], held[:, 3:]
    rows["gps_speed_m_s"] = np.hypot(held[:, 3], held[:, 4])
    rows["gps_course_rad"] = np.arctan2(held[:, 4], held[:, 3]) % (2.0 * np.pi)
    return place


def _arrivals(table: Table, velocity: Array) -> NDArray[np.bool_]:
    """Rows in which a fix arrived: as a column says, else where the values are others than in the row before."""
    good = np.asarray(np.isfinite(velocity).all(axis=1))
    if "gps.fix" in table:
        good &= table["gps.fix"] >= LEAST_FIX
    if "gps.new" in table:
        return good & (table["gps.new"] > 0.0)
    told = [v for name, v in table.items() if name.startswith("gps.") and name != "gps.fix"]
    sparse = ~good.all()  # empty between the fixes: then the first one counts, which may else be a filler
    before = np.column_stack(told)
    changed = np.zeros(len(good), np.bool_)
    changed[1:] = np.any(before[1:] != before[:-1], axis=1)
    changed[0] = sparse
    return good & changed


def _velocity(table: Table) -> Array | None:
    if "gps.vn" in table and "gps.ve" in table:
        n, e = table["gps.vn"], table["gps.ve"]
    elif "gps.speed" in table and "gps.course" in table:
        speed, course = table["gps.speed"], table["gps.course"]
        if np.nanmax(np.abs(course), initial=0.0) > 2.0 * np.pi + 0.01:
            course = course / _DEGREES
        n, e = speed * np.cos(course), speed * np.sin(course)
    else:
        return None
    return np.column_stack((n, e, table.get("gps.vd", np.zeros(len(n)))))


def _position(table: Table) -> tuple[Array, tuple[float, float] | None]:
    """Position from the first fix on, shape (N, 3), zero where there is none; and where that first fix was."""
    n = len(table["time"])
    if not ("gps.latitude" in table and "gps.longitude" in table):
        return np.column_stack([np.nan_to_num(table.get(f"gps.{a}", np.zeros(n))) for a in "ned"]), None
    # Degrees without a unit exceed what radians can be anywhere but next to the equator and Greenwich.
    largest = max(np.nanmax(np.abs(table[name]), initial=0.0) for name in ("gps.latitude", "gps.longitude"))
    scale = 1.0 if largest > 3.2 else _DEGREES
    latitude, longitude = scale * table["gps.latitude"], scale * table["gps.longitude"]
    altitude = table.get("gps.altitude", np.zeros(n))
    there = np.isfinite(latitude + longitude + altitude) & (np.abs(latitude) <= 90.0) & (latitude != 0.0)
    # Placeholders before the first fix are held and round; a fix is where the values first change.
    moved = np.flatnonzero(there[1:] & (np.diff(latitude) != 0.0)) + 1
    if not there.any():
        return np.zeros((n, 3)), None
    first = int(moved[0]) if len(moved) else int(np.flatnonzero(there)[0])
    origin = latitude[first], longitude[first], altitude[first]
    ned = np.zeros((n, 3))
    ned[there] = np.column_stack(pymap3d.geodetic2ned(latitude[there], longitude[there], altitude[there], *origin))
    return ned, (float(origin[0]), float(origin[1]))


def _take_rest(rows: NDArray[np.void], table: Table) -> None:
    """Fill magnetometer and air data; a sample of the former arrives where its values change."""
    if all(f"mag.{a}" in table for a in "xyz"):
        field = _stack(table, tuple(f"mag.{a}" for a in "xyz"))
        changed = np.concatenate(([True], np.any(field[1:] != field[:-1], axis=1)))
        rows["mag_new"] = changed & np.isfinite(field).all(axis=1)
        rows["mag_b_ut"], _ = _held(field, rows["mag_new"] > 0)
    rows["baro_height_m"] = table.get("height", np.full(len(rows), np.nan))
    if "airspeed" in table:
        rows["air_new"] = np.isfinite(table["airspeed"])
        rows["airspeed_m_s"] = np.nan_to_num(table["airspeed"])


def _stack(table: Table, names: tuple[str, ...]) -> Array:
    return np.column_stack([table[name] for name in names])


def _held(values: Array, new: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """`values` where `new`, held until the next, zero before the first; and the row each comes from, -1 for none."""
    last = np.maximum.accumulate(np.where(new, np.arange(len(values)), -1))
    return np.where(last[:, None] >= 0, values[last], 0.0), last
