"""From the messages of an autopilot's log, each kind with times of its own, to rows at the times of the inertial unit.

Whatever else was logged is put into the tick in which it arrived, the first whose end is not before its time, and
held from there on; of several that arrived in one tick the last one counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pymap3d  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.ndimage import median_filter  # type: ignore[import-untyped]

from estimator.interface import MEASURED_DTYPE, Array
from scenarios.harness.logs import checks, tabular
from scenarios.harness.logs.recorded import RecordedLog, Reference

MISSED = 1.5  # a row so many intervals after the one before does not follow it: samples between were not logged
Kind = Literal["truth", "filter"]  # of an attitude, see `Reference`
_BY_NAME = ("gyro.x", "gyro.y", "gyro.z", "force.x", "force.y", "force.z")


@dataclass(frozen=True, slots=True)
class Stream:
    """Messages of one kind.

    name : in the log      t_s : shape (n,), by the clock aboard      values : shape (n, m)
    """

    name: str
    t_s: Array
    values: Array


@dataclass(frozen=True, slots=True)
class Messages:
    """What an autopilot logged, in our units; None where it did not.

    inertial : gyro x y z, specific force x y z      dt_s : shape (n,), its intervals, NaN where the log does not tell
    names : our names of the columns of `inertial` -> those of the log
    fixes : latitude, longitude (degrees), altitude, velocity north east down, time at which it was true
    field : magnetic, x y z, microtesla              airspeed, height : one column each
    attitude : R_eb row by row, nine columns         kind : of the attitude
    """

    inertial: Stream
    dt_s: Array
    names: Mapping[str, str]
    fixes: Stream | None = None
    field: Stream | None = None
    airspeed: Stream | None = None
    height: Stream | None = None
    attitude: Stream | None = None
    kind: Kind = "filter"


def recorded(path: Path, messages: Messages, repairs: list[str]) -> RecordedLog:
    """The log that the messages make, put in order and judged.

    Raises
    ------
    LogError      one line with the file, the message and the column
    """
    stream, dt_s = messages.inertial, messages.dt_s
    sane = _sane(stream, repairs)
    stream, dt_s = replace(stream, t_s=stream.t_s[sane], values=stream.values[sane]), dt_s[sane]
    number = np.flatnonzero(sane) + 1
    source = checks.Source(path, messages.names, lambda k: f"{stream.name} {number[k]}")
    keep = checks.kept(stream.t_s, dict(zip(_BY_NAME, stream.values.T, strict=True)), source, repairs)
    rows = np.zeros(len(keep), MEASURED_DTYPE)
    rows["t_s"] = stream.t_s[keep]
    rows["dt_s"] = _intervals(rows["t_s"], dt_s[keep], stream.name, repairs)
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = np.hsplit(stream.values[keep], 2)
    place = _put_fixes(rows, messages.fixes, repairs)
    if (field := _put(rows, messages.field, "mag_new", repairs)) is not None:
        rows["mag_b_ut"] = np.nan_to_num(field)
    if (airspeed := _put(rows, messages.airspeed, "air_new", repairs)) is not None:
        rows["airspeed_m_s"] = np.nan_to_num(airspeed[:, 0])
    height = _put(rows, messages.height, None, repairs)
    rows["baro_height_m"] = np.nan if height is None else height[:, 0]
    has = {"gps": "gps_new", "magnetometer": "mag_new", "airspeed": "air_new"}
    instruments = ("gyro", "accelerometer", *(name for name, new in has.items() if rows[new].any()))
    reference = _reference(path, messages, rows["t_s"], repairs)
    log = RecordedLog(rows, path.name, instruments, reference, tuple(repairs), place)
    return checks.judged(log, source)


def _sane(stream: Stream, repairs: list[str]) -> NDArray[np.bool_]:
    """All but messages whose time is far from the median of the five about them: damaged ones, two at most in five.

    Times that increase are their own median, next to a gap too; a clock that was set stays, and is refused later.
    """
    t_s = stream.t_s
    if len(t_s) < 3:
        return np.ones(len(t_s), np.bool_)
    far = max(checks.LATEST_S, 3.0 * float(np.median(np.abs(np.diff(t_s)))))
    wild = np.abs(t_s - median_filter(t_s, 5, mode="reflect")) > far
    if wild.any():
        first = int(np.argmax(wild))
        repairs.append(f"{stream.name}: {wild.sum()} at a time far from its neighbours left out, first {first + 1}")
    return ~wild


def _intervals(t_s: Array, dt_s: Array, name: str, repairs: list[str]) -> Array:
    """Intervals that the log tells, NaN where the one before was not logged: then the row stands for the time since."""
    steps = np.diff(t_s, prepend=t_s[0] - dt_s[0])
    missed = steps > MISSED * dt_s
    if 2 * missed.sum() > len(t_s):
        repairs.append(
            f"{name}: means over {1e3 * np.median(dt_s[missed]):g} ms logged every {1e3 * np.median(steps):g} ms; "
            "each stands for the time since the one before"
        )
        return np.full(len(t_s), np.nan)
    return np.where(missed, np.nan, dt_s)


def _arrived(rows: NDArray[Any], stream: Stream, repairs: list[str]) -> tuple[Array, NDArray[np.intp]]:
    """The messages that have a place in the rows, in order of time, shape (n, m), and the row of each."""
    known = np.isfinite(stream.t_s) & np.isfinite(stream.values).all(axis=1)
    if not known.all():
        repairs.append(f"{stream.name}: {(~known).sum()} without a number left out")
    stream = replace(stream, t_s=stream.t_s[known], values=stream.values[known])
    sane = _sane(stream, repairs)
    t_s, values = stream.t_s[sane], stream.values[sane]
    late = np.count_nonzero(np.diff(t_s) < 0.0)
    if late:
        repairs.append(f"{stream.name}: {late} out of order, sorted")
    order = np.argsort(t_s, kind="stable")
    order = order[t_s[order] > rows["t_s"][0] - checks.LATEST_S]  # older ones were no news any more
    at = np.searchsorted(rows["t_s"], t_s[order])
    inside = at < len(rows)
    return values[order][inside], at[inside]


def _put(rows: NDArray[Any], stream: Stream | None, new: str | None, repairs: list[str]) -> Array | None:
    """Mark where messages arrive in the column `new`; their values held, shape (N, m), NaN before the first."""
    if stream is None:
        return None
    values, at = _arrived(rows, stream, repairs)
    last = np.full(len(rows), -1)
    last[at] = np.arange(len(at))
    if new is not None:
        rows[new] = last >= 0
    last = np.maximum.accumulate(last)
    return np.vstack((values, np.full(values.shape[1], np.nan)))[last]  # of -1 the NaN at the end


def _put_fixes(rows: NDArray[Any], fixes: Stream | None, repairs: list[str]) -> tuple[float, float] | None:
    """Fill the GPS columns; returns latitude and longitude of the first fix, the origin of positions."""
    held = _put(rows, fixes, "gps_new", repairs)
    if held is None or not rows["gps_new"].any():
        return None
    known = np.isfinite(held[:, 0])
    latitude, longitude, altitude, n, e, d, true_s = held[known].T
    origin = latitude[0], longitude[0], altitude[0]
    rows["gps_valid"] = known
    rows["gps_t_s"][known] = true_s
    rows["gps_p_e_m"][known] = np.column_stack(pymap3d.geodetic2ned(latitude, longitude, altitude, *origin))
    rows["gps_v_e_m_s"][known] = np.column_stack((n, e, d))
    rows["gps_speed_m_s"][known] = np.hypot(n, e)
    rows["gps_course_rad"][known] = np.arctan2(e, n) % (2.0 * np.pi)
    return float(origin[0]), float(origin[1])


def _reference(path: Path, messages: Messages, t_s: Array, repairs: list[str]) -> Reference | None:
    """The attitude at the times of the rows, interpolated; None where there is none at any of them."""
    stream = messages.attitude
    if stream is None:
        return None
    sane = _sane(stream, repairs)
    R_eb = tabular.at_times(stream.t_s[sane], stream.values[sane].reshape(-1, 3, 3), t_s)
    if not np.isfinite(R_eb).any():
        return None
    return Reference(R_eb, messages.kind, f"{stream.name} in {path.name}")
