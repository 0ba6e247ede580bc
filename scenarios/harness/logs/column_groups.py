"""The columns of a file by our names and in our units, in groups that have their times in common."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from estimator.interface import Array
from scenarios.harness.logs import attitudes, checks
from scenarios.harness.logs.column_map import ColumnMap
from scenarios.harness.logs.quantities import EULER, FIELD, INERTIAL
from scenarios.harness.logs.recorded import LogError
from sim.outside import files

REMEDY = (
    "where the axes are forward, left, up: --columns forward-left-up; right, forward, up: --columns right-forward-up; "
    "where the accelerometer reads gravity minus acceleration: --columns force-reversed; in a map of your own "
    'axes = "forward-left-up" or force_reversed = true, or a minus sign before the quantity'
)


@dataclass(slots=True)
class Group:
    """Columns of one length with common times, by our names and in our units.

    units_given : quantities whose unit is stated
    own : the columns have times other than those of the inertial unit: no value is held from row to row
    """

    table: dict[str, Array]
    units_given: frozenset[str] = frozenset()
    own: bool = False

    @property
    def n(self) -> int:
        """Rows."""
        return len(next(iter(self.table.values()), ()))

    def has(self, *names: str) -> bool:
        """Whether the group has all of these quantities."""
        return all(name in self.table for name in names)


def alone(_column: str) -> str:
    """The matrix of a column in a file without matrices: none."""
    return ""


def take(
    columns: Mapping[str, Array], meanings: ColumnMap, source: checks.Source, of: Callable[[str], str] = alone
) -> tuple[list[Group], checks.Source]:
    """The columns of the map, by our names and in our units, and `source` with the names of these columns.

    of : column -> the matrix or structure that it belongs to

    Raises
    ------
    LogError      a column of the map is missing, or two columns hold one quantity
    """
    missing = [name for name in meanings.columns if name not in columns]
    if missing:
        raise LogError(
            f"{source.path}: no column {', '.join(missing)}, as the map {meanings.name} says; "
            f"it has {', '.join(source.offered or columns) or 'none'}"
        )
    if meanings.rivals:
        quantity, names = next(iter(meanings.rivals.items()))
        raise LogError(
            f"{source.path}: {quantity} may be {' or '.join(names)}: choose one in a column map (--columns MAP.toml)"
        )
    parts: dict[tuple[str, int], dict[str, Array]] = {}
    units_given: dict[tuple[str, int], set[str]] = {}
    own: dict[str, str] = {}
    for name, m in meanings.columns.items():
        values = files.measured(columns[name])
        part = (of(name), len(values))
        table = parts.setdefault(part, {})
        if m.quantity in table:
            raise LogError(f"{source.path}: {m.quantity} is assigned to two columns, {own[m.quantity]} and {name}")
        # Without an offset nothing is subtracted, so that a number in our unit stays the same bit for bit.
        if m.quantity == "time":
            values = checks.unwrapped(values)
        table[m.quantity] = m.factor * (values - m.offset) if m.offset else m.factor * values
        units_given.setdefault(part, set()).update({m.quantity} if m.unit_given else ())
        own.setdefault(m.quantity, name)
    for vector in ("gyro", "force", "mag"):
        own[vector] = " ".join(own[name] for name in (f"{vector}.{a}" for a in "xyz") if name in own) or vector
    groups = _with_times({key: Group(table, frozenset(units_given[key])) for key, table in parts.items()}, source)
    for group in groups:
        turn(group, meanings)
        if not group.units_given & set(EULER):
            attitudes.mend_angles(group.table, source)
    return groups, replace(source, columns=own, remedy=REMEDY)


def _with_times(parts: Mapping[tuple[str, int], Group], source: checks.Source) -> list[Group]:
    """One group per clock: columns without a time join those of the same length that have one."""
    lengths = {n for (_, n), part in parts.items() if part.has("time")}
    for (_, n), part in parts.items():
        if n not in lengths and part.has("gps.time"):  # their only clock
            part.table["time"] = part.table.pop("gps.time")
            part.units_given |= {"time"} & {q.replace("gps.time", "time") for q in part.units_given}
        if n not in lengths and part.has("interval", "gyro.x"):  # a log with intervals instead of times
            part.table["time"] = np.cumsum(np.nan_to_num(part.table["interval"]))
            part.units_given |= {"time"}
    groups = {key: part for key, part in parts.items() if part.has("time")}
    for key, part in parts.items():
        if key in groups:
            continue
        same = [group for (_, n), group in groups.items() if n == key[1]]
        if not same:
            what = f"{key[0]} " if key[0] else ""
            if groups:
                raise LogError(
                    f"{source.path}: {what}({key[1]} rows: {', '.join(part.table)}) has no time: name a column of this "
                    'length as "time" in the column map'
                )
            groups[key] = part
            continue
        for quantity, values in part.table.items():
            if quantity in same[0].table:
                raise LogError(f"{source.path}: {quantity} is assigned to two columns")
            same[0].table[quantity] = values
        same[0].units_given |= part.units_given
    return list(groups.values())


def turn(group: Group, meanings: ColumnMap) -> None:
    """Turn the vectors to body axes, and reverse the specific force, as the map says."""
    table, R_bs = group.table, meanings.R_bs
    if meanings.force_reversed:
        for name in INERTIAL[3:]:
            if name in table:
                table[name] = -table[name]
    for names in (INERTIAL[:3], INERTIAL[3:], FIELD):
        if R_bs is not None and group.has(*names):
            table.update(zip(names, R_bs @ np.array([table[name] for name in names]), strict=True))
