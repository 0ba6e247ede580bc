"""From the columns of a text or MATLAB file to the rows that estimators take.

A row of the file is an inertial sample and may also hold reports of other instruments.  If a MATLAB file holds these in
separate matrices, each has its own times.  A report goes into the first row whose time is not before its own; of
several in one row the last one counts.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.instruments import Known
from estimator.interface import MEASURED_DTYPE, Array
from scenarios.harness.logs import accounts, airspeeds, attitudes, checks, fixes, properties
from scenarios.harness.logs.column_groups import Group, alone, take
from scenarios.harness.logs.column_map import ColumnMap
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.properties import CLIMB_M
from scenarios.harness.logs.quantities import FIELD, INERTIAL
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from scenarios.harness.logs.units import COUNTS
from scenarios.harness.logs.validity import latest, usable

FEWEST_FORCES = 5  # at most this many gyro samples for each accelerometer sample


@dataclass(slots=True)
class _Making:
    """A log under construction: its rows, what is known, the ledger and the repairs."""

    rows: NDArray[Any]
    ledger: Ledger
    repairs: list[str]
    known: dict[str, Known] = field(default_factory=dict)
    place: tuple[float, float] | None = None


def recorded(
    columns: Mapping[str, Array], meanings: ColumnMap, source: checks.Source, of: Callable[[str], str] = alone
) -> RecordedLog:
    """The log in the columns, checked.

    Raises
    ------
    LogError      one line with the file, the row and the column
    """
    groups, source = take(columns, meanings, source, of)
    main = _main(groups, replace(source, offered=source.offered or tuple(columns)))
    repairs: list[str] = []
    others = _meet(main, repairs) | _of_others(main)
    factor = checks.clock_factor(main.table["time"], source, repairs)
    for group in groups:
        for name in ("time", "interval", "gps.time"):
            if name in group.table and (group is main or name not in group.units_given):
                group.table[name] = factor * group.table[name]
    t_s, numbers = main.table["time"], np.column_stack([main.table[name] for name in INERTIAL])
    inertial = np.flatnonzero(~others)
    named = {name: numbers[inertial, i] for i, name in enumerate(INERTIAL)}
    of_file = replace(source, row=lambda k: source.row(int(inertial[k])))
    keep = inertial[checks.kept(t_s[inertial], named, of_file, repairs)]
    made = _Making(np.zeros(len(keep), MEASURED_DTYPE), Ledger(), repairs)
    accounts.inertial(made.ledger, t_s, numbers, keep, inertial)
    rows = made.rows
    rows["t_s"], rows["dt_s"] = t_s[keep], _intervals(main, keep, repairs)
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = np.hsplit(numbers[keep], 2)
    rows["baro_height_m"] = np.nan
    if "elevation_m" in meanings.known:
        made.known["elevation_m"] = meanings.known["elevation_m"]
    for group in groups:
        order = np.argsort(group.table["time"], kind="stable")  # samples without a time come last
        in_order = {name: values[order] for name, values in group.table.items()}
        group = Group(in_order, group.units_given, group is not main)
        _take_fixes(made, group)
        _take_field(made, group)
        _take_air(made, group)
    reference = _take_attitude(made, groups, main, keep, source, meanings)
    known = {**properties.measured(rows), **made.known, **meanings.known}
    log = RecordedLog(
        rows, source.path.name, properties.sensors(rows), reference, tuple(repairs), meanings.origin_deg or made.place,
        known, made.ledger, _stamps_first(meanings, known, rows), meanings.on_ground,
    )  # fmt: skip
    return checks.judged(log, source)


def _stamps_first(meanings: ColumnMap, known: Mapping[str, Known], rows: NDArray[Any]) -> tuple[str, ...]:
    """A line if the map gives a latency of the receiver but the fixes have stamps, which take precedence."""
    latency, stamped = meanings.known.get("gps_latency_s"), known.get("gps_stamped")
    if latency is None or latency.source == "withheld" or "gps_stamped" in meanings.known:
        return ()
    if stamped is None or not stamped.value:
        return ()
    fixes = rows[rows["gps_new"] > 0]
    late_s = float(np.nanmedian(fixes["t_s"] - fixes["gps_t_s"]))
    return (
        f"gps_latency_s = {latency.value:g} s in the map applies to fixes without a time stamp; by gps.time "
        f"these are {late_s:.3g} s late. To apply it anyway: gps_stamped = false in the map, or --set gps_latency_s",
    )


def _main(groups: list[Group], source: checks.Source) -> Group:
    """The group with the gyro, with the accelerometer at its times; LogError if something is missing."""
    main = next((g for g in groups if g.has(*INERTIAL[:3])), None)
    force = next((g for g in groups if g.has(*INERTIAL[3:])), None)
    if main is not None and force is not None and main is not force and main.has("time"):
        order = np.argsort(force.table["time"], kind="stable")
        times = force.table["time"][order]
        for name in INERTIAL[3:]:
            main.table[name] = interpolated(main.table["time"], times, force.table[name][order])
    found = {name for group in groups for name in group.table}
    missing = [name for name in ("time", *INERTIAL) if name not in (main.table if main else found)]
    if main is None or missing:
        raise LogError(
            f"{source.path}: no column for {', '.join(missing)}; it has {', '.join(source.offered)}: "
            f"name them in a column map (--columns MAP.toml){_counts(source.offered, missing[0] if missing else '')}"
        )
    return main


def _counts(offered: tuple[str, ...], missing: str) -> str:
    """What to write for a column in counts, whose unit the file does not give."""
    for name in offered:
        inside = re.search(r"[(\[]\s*([^)\]]+?)\s*[)\]]", name)
        if inside and inside[1].lower() in COUNTS:
            return f', one in {inside[1]} as "{name}" = {{ is = "{missing}", unit = "deg/s", factor = 0.07 }}'
    return ""


def _meet(main: Group, repairs: list[str]) -> NDArray[np.bool_]:
    """Interpolate an accelerometer in rows of its own to the times of the gyro; returns these rows."""
    gyro, force = (np.isfinite([main.table[n] for n in names]).all(axis=0) for names in (INERTIAL[:3], INERTIAL[3:]))
    if 2 * np.sum(gyro & force) >= np.sum(gyro) or np.sum(force) * FEWEST_FORCES < np.sum(gyro):
        return np.zeros(main.n, np.bool_)
    order = np.argsort(main.table["time"], kind="stable")
    for name in INERTIAL[3:]:
        found = interpolated(main.table["time"], main.table["time"][order], main.table[name][order])
        main.table[name] = np.where(gyro, found, np.nan)
    repairs.append(f"accelerometer in {np.sum(force & ~gyro)} rows of its own: interpolated to the rows of the gyro")
    return np.asarray(force & ~gyro)


def _of_others(main: Group) -> NDArray[np.bool_]:
    """Rows of other instruments: no inertial reading, but one that most inertial rows do not have."""
    none = ~np.isfinite([main.table[name] for name in INERTIAL]).any(axis=0)
    others = np.zeros(main.n, np.bool_)
    if none.any() and not none.all():
        for name, values in main.table.items():
            there = np.isfinite(values)
            if name not in ("time", "interval", *INERTIAL) and 2 * np.sum(there & ~none) < np.sum(~none):
                others |= none & there
    return others


def interpolated(t_s: Array, times: Array, values: Array) -> Array:
    """Values at other times, NaN outside them and in gaps."""
    known = np.isfinite(times) & np.isfinite(values)
    times, values = times[known], values[known]
    if not len(times):
        return np.full(len(t_s), np.nan)
    after = np.clip(np.searchsorted(times, t_s), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    inside = (times[after] >= t_s) & ((times[before] <= t_s) | (times[after] == t_s))
    usual = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    inside &= times[after] - times[before] <= max(5.0 * usual, 0.0) + 1e-12
    return np.where(inside, np.interp(t_s, times, values), np.nan)


def _intervals(main: Group, keep: NDArray[np.intp], repairs: list[str]) -> Array:
    """Intervals in the file; NaN if there are none, or if they do not fit the times of the rows."""
    if not main.has("interval"):
        return np.full(len(keep), np.nan)
    said = main.table["interval"][keep]
    steps = np.diff(main.table["time"][keep])
    usual, between = np.nanmedian(said) if np.isfinite(said).any() else 0.0, np.median(steps) if len(steps) else 0.0
    if not 0.8 * between <= usual <= 1.25 * between:
        repairs.append(f"intervals of {usual:g} s do not fit the rows, which are {between:g} s apart: not used")
        return np.full(len(keep), np.nan)
    return np.where(said > 0.0, said, np.nan)


def _put(
    made: _Making, stream: str, t_s: Array, read: NDArray[np.bool_], why: list[tuple[NDArray[np.bool_], str]]
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Rows in which a sample of the `stream` arrives, and the last sample up to each row, -1 before the first."""
    rows_s = made.rows["t_s"]
    at = np.searchsorted(rows_s, t_s)
    why = [
        *why, (~np.isfinite(t_s), accounts.NO_TIME), (at >= len(rows_s), accounts.AFTER),
        (t_s < rows_s[0] - checks.LATEST_S, accounts.BEFORE),
    ]  # fmt: skip
    good = accounts.samples(made.ledger, stream, read, why)
    index = np.flatnonzero(good)
    last = np.full(len(rows_s), -1)
    last[at[index]] = index  # the last one of several
    new = last >= 0
    made.ledger.leave_out(stream, len(index) - int(new.sum()), accounts.IN_ONE_ROW)
    made.ledger.use(stream, int(new.sum()))
    return new, np.maximum.accumulate(last)


def _held(values: Array, last: NDArray[np.intp], before: float = 0.0) -> Array:
    """`values` of the samples `last`, `before` the first one."""
    shape = (len(last),) + (1,) * (values.ndim - 1)
    return np.where((last >= 0).reshape(shape), values[last], before)


def _take_fixes(made: _Making, group: Group) -> None:
    """Fill the GPS columns."""
    rows, table, t_s = made.rows, group.table, group.table["time"]
    found = fixes.reports(table, group.units_given, made.repairs, each=group.own)
    if found is None:
        return
    new, last = _put(made, "gps", t_s, found.read, found.reasons)
    if not new.any():
        return
    made.place = made.place or found.place
    made.known = {**airspeeds.elevation(found.altitude_m, "altitude of the first fix"), **made.known}
    rows["gps_new"] = new
    position = found.values[:, :3]
    known = np.isfinite(position).all(axis=1) & ~found.lost  # without a position the last one holds
    rows["gps_p_e_m"] = _held(_held(position, latest(known)), last)
    velocity = _held(found.values[:, 3:8], last)
    rows["gps_v_e_m_s"], rows["gps_speed_m_s"], rows["gps_course_rad"] = velocity[:, :3], velocity[:, 3], velocity[:, 4]
    stamps = _held(found.values[:, 8], last, np.nan)
    stamped = fixes.on_this_clock(stamps[new], rows["t_s"][new], made.repairs)
    rows["gps_t_s"] = np.where(last >= 0, stamps, 0.0) if stamped else np.nan
    made.known["gps_vertical_velocity"] = _reports_vertical(table, rows)
    rows["gps_valid"] = _valid(table, t_s, found.lost, new, rows["t_s"])
    made.known["gps_stamped"] = Known(stamped, "log", "stamps of the fixes" if stamped else "no stamps of fixes")


def _reports_vertical(table: Mapping[str, Array], rows: NDArray[Any]) -> Known:
    """Whether the receiver reports a vertical velocity: not if it is 0 while the height changes."""
    if "gps.vd" not in table:
        return Known(False, "log", "no column of it")
    fixes = rows[rows["gps_new"] > 0]
    climbs = np.ptp(fixes["gps_p_e_m"][:, 2]) > CLIMB_M
    reports = bool(np.any(fixes["gps_v_e_m_s"][:, 2] != 0.0) or not climbs)
    return Known(reports, "log", "its column" if reports else "its column is 0 while the height changes")


def _valid(
    table: Mapping[str, Array], t_s: Array, lost: NDArray[np.bool_], new: NDArray[np.bool_], rows_s: Array
) -> NDArray[np.bool_]:
    """Rows in which the last fix is usable: as the file says, otherwise see `usable`."""
    if "gps.valid" in table:
        said = np.flatnonzero(np.isfinite(table["gps.valid"]) & np.isfinite(t_s))
        before = np.searchsorted(t_s[said], rows_s, side="right") - 1
        return np.asarray((before >= 0) & (table["gps.valid"][said[before]] > 0.0)) if len(said) else new & False
    at = np.searchsorted(rows_s, t_s[lost])
    lost_rows = np.zeros(len(rows_s), np.bool_)
    lost_rows[at[at < len(rows_s)]] = True
    return usable(new, rows_s, lost_rows)


def _take_field(made: _Making, group: Group) -> None:
    """Fill the magnetometer's columns; without ``mag.new`` a change of its values is a sample."""
    if not group.has(*FIELD):
        return
    field_ut = np.column_stack([group.table[name] for name in FIELD])
    if group.has("mag.new"):
        read: NDArray[np.bool_] = np.asarray(group.table["mag.new"] > 0.0)
    else:
        there = np.isfinite(field_ut)
        changed = np.any(there[1:] & (field_ut[1:] != field_ut[:-1]), axis=1)
        first = there[:1].any(axis=1)
        read = np.asarray(there.any(axis=1)) if group.own else np.concatenate((first, changed))
    broken = np.asarray(~np.isfinite(field_ut).all(axis=1))
    new, last = _put(made, "magnetometer", group.table["time"], read, [(broken, accounts.NO_NUMBER)])
    made.rows["mag_new"] |= new
    made.rows["mag_b_ut"] = _held(np.where(broken[:, None], 0.0, field_ut), last)


def _take_air(made: _Making, group: Group) -> None:
    """Fill airspeed and height; without ``air.new`` and ``height.new`` each number is a sample."""
    rows, table = made.rows, group.table
    if "true_airspeed" in table and "airspeed" not in table:
        table["airspeed"] = _equivalent(made, table)
    for stream, quantity, column, flags in (
        ("airspeed", "airspeed", "equivalent_airspeed_m_s", ("air.new",)),
        ("barometer", "height", "baro_height_m", ("height.new", "air.new")),
    ):
        if quantity not in table:
            continue
        flag = next((name for name in flags if name in table), None)
        there = np.isfinite(table[quantity])
        read = there if flag is None else table[flag] > 0.0
        if flag == "air.new":  # for the other one, if this one has no number
            other = table.get("height" if quantity == "airspeed" else "airspeed", np.full(group.n, np.nan))
            read = read & (there | ~np.isfinite(other))
        new, last = _put(made, stream, table["time"], np.asarray(read), [(~there, accounts.NO_NUMBER)])
        if new.any():
            rows[column] = _held(table[quantity], last, np.nan)
            if quantity == "airspeed" or "air.new" in table:
                rows["air_new"] |= new
    if "height" in table and "airspeed" not in made.ledger and rows["air_new"].any():
        rows["equivalent_airspeed_m_s"] = np.nan  # air data without a pitot tube


def _equivalent(made: _Making, table: Mapping[str, Array]) -> Array:
    """The true airspeed of the file as equivalent airspeed, by the height above the sea where that is known."""
    if "elevation_m" not in made.known:
        made.repairs.append(airspeeds.AT_SEA_LEVEL)
        return table["true_airspeed"]
    made.repairs.append(airspeeds.BY_HEIGHT)
    height_m = np.nan_to_num(table["height"]) if "height" in table else 0.0
    return airspeeds.equivalent_m_s(table["true_airspeed"], made.known["elevation_m"].value + height_m)


def _take_attitude(
    made: _Making, groups: list[Group], main: Group, keep: NDArray[np.intp], source: checks.Source, meanings: ColumnMap
) -> Reference | None:
    """The attitude in the file at the times of the rows, interpolated between its samples."""
    group = next((g for g in groups if attitudes.form_of(g.table)), None)
    if group is None:
        return None
    R_all = attitudes.attitude(group.table)
    if R_all is None:
        return None
    read, why = attitudes.reasons(group.table, R_all)
    t_s, rows_s = group.table["time"], made.rows["t_s"]
    R_eb = np.full((len(rows_s), 3, 3), np.nan)
    if group is main:
        R_eb = R_all[keep]
        elsewhere = np.ones(len(t_s), np.bool_)
        elsewhere[keep] = False
        why.append((elsewhere & np.isin(t_s, rows_s), accounts.REPEATED))
    between = ~np.isfinite(R_eb).all(axis=(1, 2))
    if between.any():
        R_eb[between] = attitudes.at_times(t_s, R_all, rows_s[between])
    beyond = ~((t_s >= rows_s[0] - LONGEST_GAP_S) & (t_s <= rows_s[-1] + LONGEST_GAP_S))
    good = accounts.samples(made.ledger, "reference", read, [*why, (beyond, accounts.OUTSIDE)])
    made.ledger.use("reference", int(good.sum()))
    if not read.any():
        return None
    return Reference(R_eb, meanings.reference, f"attitude in {source.path.name}")
