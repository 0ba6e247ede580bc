"""The GPS columns of a table: when a report arrived, what it says, and whether it can be used."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs import accounts
from sim.place import local

LEAST_FIX = 3.0  # a fix of three dimensions
LATEST_S, EARLIEST_S = 10.0, 0.1  # stamps later or earlier than this are from another clock
_DEGREES = 180.0 / np.pi
_FLAGS = ("gps.new", "gps.fix", "gps.valid")


@dataclass(frozen=True, slots=True)
class Reports:
    """The reports of a receiver, row by row.

    read : shape (n,), rows with a report       reasons : rows that are not used, and why
    values : shape (n, 9), position and velocity north east down, speed, course, stamp; NaN if unknown
    lost : shape (n,), rows in which the receiver reports that it has no fix
    """

    read: NDArray[np.bool_]
    reasons: list[tuple[NDArray[np.bool_], str]]
    values: Array
    lost: NDArray[np.bool_]
    place: tuple[float, float] | None
    altitude_m: float | None


def reports(
    table: Mapping[str, Array], units_given: frozenset[str], repairs: list[str], *, each: bool = False
) -> Reports | None:
    """The reports in the rows of `table`, which are in order of time; None if it has no GPS columns.

    units_given : quantities with a stated unit; the units of others are inferred from their values
    each : every row is a report, because the receiver has separate times
    """
    names = [name for name in table if name.startswith("gps.") and name not in _FLAGS]
    if not names:
        return None
    columns = np.column_stack([table[name] for name in names])
    n = len(columns)
    read = np.isfinite(columns).any(axis=1) if each and "gps.new" not in table else _read(table, columns)
    lost = table["gps.fix"] < LEAST_FIX if "gps.fix" in table else np.zeros(n, np.bool_)
    velocity = _velocity(table, units_given)
    why: list[tuple[NDArray[np.bool_], str]] = [(np.asarray(lost), accounts.NO_FIX)]
    if velocity is None:
        repairs.append("GPS without a velocity (gps.vn and gps.ve, or gps.speed and gps.course): not used")
        why.append((np.ones(n, np.bool_), accounts.NO_VELOCITY))
        velocity = np.full((n, 5), np.nan)
    if "gps.latitude" in table:
        why.append((np.asarray(table["gps.latitude"] == 0.0), accounts.NO_FIX))
    why.append((np.asarray(~np.isfinite(velocity).all(axis=1)), accounts.NO_NUMBER))
    if "gps.fix" in table and read.any() and lost[read].all():
        repairs.append(
            f"gps.fix is never {LEAST_FIX:g} or more: no fix is used; for a column that is only 0 or 1 use gps.valid"
        )
    good = read & ~np.any([where for where, _ in why], axis=0)
    position, place, altitude_m = _position(table, units_given, good, repairs)
    stamps = table.get("gps.time", np.full(n, np.nan))
    return Reports(
        np.asarray(read), why, np.column_stack((position, velocity, stamps)), np.asarray(lost), place, altitude_m
    )


def _read(table: Mapping[str, Array], columns: Array) -> NDArray[np.bool_]:
    """Rows in which a report arrived: as a column says, otherwise where a value differs from the row before.

    The first row counts only if cells between the reports are empty; otherwise it may be a filler.
    """
    if "gps.new" in table:
        return np.asarray(table["gps.new"] > 0.0)
    columns = columns[:, np.isfinite(columns).any(axis=0)]
    there = np.isfinite(columns)
    changed = np.any(there[1:] & (columns[1:] != columns[:-1]), axis=1)  # also from NaN to a number
    return np.concatenate((there[:1].any(axis=1) & (not there.all()), changed))


def _velocity(table: Mapping[str, Array], units_given: frozenset[str]) -> Array | None:
    """North, east, down, ground speed and course, shape (n, 5); an unknown vertical velocity is 0."""
    speed, course = table.get("gps.speed"), table.get("gps.course")
    if (
        course is not None
        and "gps.course" not in units_given
        and np.nanmax(np.abs(course), initial=0.0) > 2.0 * np.pi + 0.01
    ):
        course = course / _DEGREES
    if "gps.vn" in table and "gps.ve" in table:
        n, e = table["gps.vn"], table["gps.ve"]
    elif speed is not None and course is not None:
        n, e = speed * np.cos(course), speed * np.sin(course)
    else:
        return None
    level, track = np.hypot(n, e), np.arctan2(e, n)
    if speed is not None and course is not None:  # as reported, if they are
        both = np.isfinite(speed) & np.isfinite(course)
        level, track = np.where(both, speed, level), np.where(both, course, track)
    down = table.get("gps.vd", np.zeros(len(n)))
    return np.column_stack((n, e, down, level, track % (2.0 * np.pi)))


def _position(
    table: Mapping[str, Array], units_given: frozenset[str], good: NDArray[np.bool_], repairs: list[str]
) -> tuple[Array, tuple[float, float] | None, float | None]:
    """Position relative to the first of the `good` reports, shape (n, 3), NaN if unknown; that origin, its altitude."""
    n = len(good)
    if not ("gps.latitude" in table and "gps.longitude" in table):
        return np.column_stack([table.get(f"gps.{a}", np.zeros(n)) for a in "ned"]), None, None
    latitude, longitude = table["gps.latitude"], table["gps.longitude"]
    altitude = table.get("gps.altitude", np.zeros(n))
    if not {"gps.latitude", "gps.longitude"} & units_given:
        # Beyond the range of radians they are degrees, beyond that of degrees integers of 1e-7 degrees.
        largest = max(np.nanmax(np.abs(v), initial=0.0) for v in (latitude, longitude))
        scale = 1.0 if 3.2 < largest <= 360.0 else 1e-7 if largest > 360.0 else _DEGREES
        if largest > 360.0:
            repairs.append("latitude and longitude in 1e-7 degrees: converted")
            if "gps.altitude" not in units_given and np.nanmedian(np.abs(altitude)) > 1e4:
                repairs.append("altitude in millimetres: converted")
                altitude = 1e-3 * altitude
    else:
        scale = _DEGREES
    latitude, longitude = scale * latitude, scale * longitude
    there = np.isfinite(latitude + longitude + altitude) & (np.abs(latitude) <= 90.0) & (latitude != 0.0)
    first = np.flatnonzero(there & good)
    if not len(first):
        return np.zeros((n, 3)), None, None
    origin = latitude[first[0]], longitude[first[0]], altitude[first[0]]
    ned = np.full((n, 3), np.nan)
    ned[there] = local(latitude[there], longitude[there], altitude[there], *map(float, origin))
    return ned, (float(origin[0]), float(origin[1])), float(origin[2]) if "gps.altitude" in table else None


def on_this_clock(stamps: Array, arrived_s: Array, repairs: list[str]) -> bool:
    """Whether the stamps of fixes are on the clock of the log; reported if they are not."""
    late_s = arrived_s - stamps
    if not np.isfinite(late_s).any():
        return False
    usual = float(np.nanmedian(late_s))
    if -EARLIEST_S <= usual <= LATEST_S:
        return True
    repairs.append(f"gps.time is {usual:g} s before the arrival of the fixes, so on another clock: not used")
    return False
