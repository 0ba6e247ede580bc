"""ArduPilot's logs as MATLAB files: IMU, GPS, MAG, ARSP, BARO and the attitude.

A message is a matrix ``IMU`` with its ``IMU_label``, as Mission Planner writes it, or a structure ``IMU`` of vectors,
as pymavlink's mavlogdump does.

Each message has its own times; see `streams` for how they become rows.  Units are those that ArduPilot's messages have
of old: degrees, milligauss, rad/s.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import Array
from scenarios.harness.logs import accounts, properties, streams, tabular
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.recorded import LogError, RecordedLog
from scenarios.harness.logs.streams import Kind, Stream
from scenarios.harness.logs.validity import usable

GYRO, FORCE, FIELD = (tuple(f"{name}{axis}" for axis in "XYZ") for name in ("Gyr", "Acc", "Mag"))
FIX_3D = 3.0  # GPS.Status
FIELD_UT = 0.1  # a milligauss
_CLOCKS = (("SampleUS", 1e-6), ("TimeUS", 1e-6), ("T", 1e-3), ("TimeMS", 1e-3))
_ATTITUDES: tuple[tuple[str, Kind], ...] = (("SIM", "truth"), ("ATT", "filter"), ("AHR2", "filter"))
Table = dict[str, Array]


def messages(tables: Mapping[str, Table]) -> dict[str, Table]:
    """`tables` where they are the messages of an ArduPilot log; empty where they are not."""
    imu = _chosen(tables, "IMU") or _chosen(tables, "GYR")
    return dict(tables) if imu is not None and set(GYRO) <= set(imu[1]) and _clock(imu[1]) else {}


def read(path: Path, tables: Mapping[str, Table], content: Mapping[str, Any]) -> RecordedLog:
    """The log that the messages make; `content` holds all variables of the file, the parameters among them.

    Raises
    ------
    LogError      one line: no inertial unit in it, or one that cannot be believed
    """
    repairs: list[str] = []
    inertial = _inertial(path, tables)
    fixes, n_fixes, lost_s = _fixes(tables)
    field = _stream(tables, "MAG", FIELD, healthy="Health")
    attitude, kind = _attitude(tables)
    found = streams.Messages(
        inertial,
        np.full(len(inertial.t_s), np.nan),
        {"time": f"{inertial.name} time", "gyro": "GyrX GyrY GyrZ", "force": "AccX AccY AccZ"}
        | {f"{ours}.{a.lower()}": f"{own}{a}" for ours, own in (("gyro", "Gyr"), ("force", "Acc")) for a in "XYZ"},
        fixes=fixes,
        field=replace(field, values=FIELD_UT * field.values) if field else None,
        airspeed=_stream(tables, "ARSP", ("Airspeed",), healthy="H"),
        height=_stream(tables, "BARO", ("Alt",), healthy="H"),
        attitude=attitude,
        kind=kind,
    )
    log = streams.recorded(path, found, repairs)
    rows = log.rows.copy()
    rows["gps_t_s"] = np.nan  # when a fix was true is not in these messages
    rows["gps_valid"] = usable(rows["gps_new"] > 0, rows["t_s"], _rows_at(lost_s, rows["t_s"]))
    rows.flags.writeable = False
    known = {**properties.measured(rows), **log.known, **_parameters(content)}
    if rows["gps_new"].any():
        known.setdefault("gps_stamped", Known(False, "log", "no stamps of fixes"))
    log = replace(log, rows=rows, known=known)
    _account(log.ledger, log, found, n_fixes)
    return log


def _chosen(tables: Mapping[str, Table], name: str) -> tuple[str, Table] | None:
    """The first instance of a message: of a column I, else of a number behind the name."""
    own = next((n for n in (name, f"{name}_0", f"{name}0", f"{name}1", f"{name}_1") if n in tables), None)
    if own is None:
        return None
    table = tables[own]
    if "I" in table and len(table["I"]):
        first = table["I"] == table["I"].min()
        table = {label: values[first] for label, values in table.items() if len(values) == len(first)}
    return own, table


def _clock(table: Table) -> tuple[str, float] | None:
    """The column with the time, and its factor to seconds: ``T`` where the others are weeks and their milliseconds."""
    for column, factor in _CLOCKS:
        if column in table and np.any(table[column] != 0.0) and (column != "T" or "Week" in table):
            return column, factor
    return None


def _stream(tables: Mapping[str, Table], name: str, columns: tuple[str, ...], healthy: str = "") -> Stream | None:
    """The messages of a name; None where there are none with these columns.

    healthy : a column that is zero where the sensor says that the sample is not to be trusted
    """
    found = _chosen(tables, name)
    if found is None or not set(columns) <= set(found[1]) or (clock := _clock(found[1])) is None:
        return None
    own, table = found
    good = table[healthy] != 0.0 if healthy in table else np.ones(len(table[clock[0]]), np.bool_)
    if not good.any():
        return None
    return Stream(own, clock[1] * table[clock[0]][good], np.column_stack([table[c][good] for c in columns]))


def _inertial(path: Path, tables: Mapping[str, Table]) -> Stream:
    """Gyro and accelerometer: of IMU, else of GYR with ACC at its times."""
    both = _stream(tables, "IMU", GYRO + FORCE)
    if both is not None:
        return both
    gyro, force = _stream(tables, "GYR", GYRO), _stream(tables, "ACC", FORCE)
    if gyro is None or force is None:
        raise LogError(f"{path}: no inertial unit (IMU, or GYR and ACC); it has {', '.join(tables)}")
    there = [tabular.interpolated(gyro.t_s, force.t_s, column) for column in force.values.T]
    return Stream(gyro.name, gyro.t_s, np.column_stack((gyro.values, *there)))


def _rows_at(times_s: Array, rows_s: Array) -> NDArray[np.bool_]:
    """The rows into which messages of these times fall."""
    at = np.searchsorted(rows_s, times_s)
    there = np.zeros(len(rows_s), np.bool_)
    there[at[at < len(rows_s)]] = True
    return there


def _fixes(tables: Mapping[str, Table]) -> tuple[Stream | None, int, Array]:
    """Fixes of three dimensions, with speed, course over ground and the vertical speed, which counts down; how many
    reports there were; and the times of those without a fix."""
    columns = ("Status", "Lat", "Lng", "Alt", "Spd", "GCrs")
    found = _chosen(tables, "GPS")
    vertical = ("VZ",) if found is not None and "VZ" in found[1] else ()
    gps = _stream(tables, "GPS", columns + vertical)
    if gps is None:
        return None, 0, np.zeros(0)
    fixed = gps.values[:, 0] >= FIX_3D
    t_s, values = gps.t_s[fixed], gps.values[fixed]
    speed, course = values[:, 4], np.radians(values[:, 5])
    down = values[:, 6] if vertical else np.zeros(len(t_s))
    velocity = (speed * np.cos(course), speed * np.sin(course), down)
    stream = Stream(gps.name, t_s, np.column_stack((values[:, 1:4], *velocity, t_s)))
    return stream, len(fixed), gps.t_s[~fixed]


def _attitude(tables: Mapping[str, Table]) -> tuple[Stream | None, Kind]:
    """The attitude: the simulator's where there is one, else what was flown on, else that of the other estimator."""
    for name, kind in _ATTITUDES:
        quaternion = _stream(tables, name, ("Q1", "Q2", "Q3", "Q4"))
        stream = quaternion or _stream(tables, name, ("Roll", "Pitch", "Yaw"))
        if stream is None:
            continue
        names = ("qw", "qx", "qy", "qz") if quaternion else ("roll", "pitch", "yaw")
        values = stream.values if quaternion else np.radians(stream.values)
        R_eb = tabular.attitude(dict(zip(names, values.T, strict=True)))
        if R_eb is not None and np.isfinite(R_eb).any():
            return Stream(stream.name, stream.t_s, R_eb.reshape(-1, 9)), kind
    return None, "filter"


def _parameters(content: Mapping[str, Any]) -> dict[str, Known]:
    """What the parameters of the autopilot say, of the cell array or structure ``PARM``."""
    value = content.get("PARM")
    found: dict[str, float] = {}
    if isinstance(value, np.ndarray) and value.dtype.names and {"Name", "Value"} <= set(value.dtype.names):
        names, numbers = np.atleast_1d(value["Name"].item()), np.atleast_1d(value["Value"].item())
        found = {str(n).strip(): float(v) for n, v in zip(names, numbers, strict=False)}
    elif isinstance(value, np.ndarray) and value.dtype == object and value.ndim == 2 and value.shape[1] == 2:
        found = {str(n).strip(): float(v) for n, v in value}
    declination = found.get("COMPASS_DEC", 0.0)
    return {"declination_rad": Known(declination, "log", "COMPASS_DEC")} if declination else {}


def _account(ledger: Ledger, log: RecordedLog, found: streams.Messages, n_fixes: int) -> None:
    """Enter every stream of which the books do not know yet."""
    rows = log.rows
    reference = 0 if log.reference is None or found.attitude is None else len(found.attitude.t_s)
    for stream, messages_, used in (
        ("imu", len(found.inertial.t_s), len(rows)),
        ("gps", n_fixes, int(np.sum(rows["gps_new"] > 0))),
        ("magnetometer", len(found.field.t_s) if found.field else 0, int(np.sum(rows["mag_new"] > 0))),
        ("airspeed", len(found.airspeed.t_s) if found.airspeed else 0, int(np.sum(rows["air_new"] > 0))),
        ("barometer", len(found.height.t_s) if found.height else 0, len(found.height.t_s) if found.height else 0),
        ("reference", reference, reference),
    ):
        if stream in ledger or not messages_:
            continue
        ledger.read(stream, messages_)
        left = messages_ - used
        if stream == "gps":
            no_fix = n_fixes - (len(found.fixes.t_s) if found.fixes else 0)
            ledger.leave_out(stream, no_fix, accounts.NO_FIX)
            left -= no_fix
        ledger.leave_out(stream, left, "no number, a time that does not fit, or another in the same row")
        ledger.use(stream, used)
