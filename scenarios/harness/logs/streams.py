"""From the messages of an autopilot's log to rows at the times of the inertial unit.

Each kind of message has its own times.  A message goes into the row in which it arrived, the first whose time is not
before its own, and is held from there on; of several in one row the last one counts.  Messages that arrived in a gap
of the inertial samples are left out, because the next row would take them for new.  The ledger counts every message.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter  # type: ignore[import-untyped]

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.instruments import Known
from estimator.interface import MEASURED_DTYPE, Array
from scenarios.harness.logs import attitudes, checks, gaps, properties
from scenarios.harness.logs.accounts import NO_FIX as NO_FIX
from scenarios.harness.logs.accounts import NO_NUMBER, REPEATED
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.properties import CLIMB_M
from scenarios.harness.logs.quantities import INERTIAL
from scenarios.harness.logs.recorded import Kind, LogError, RecordedLog, Reference
from scenarios.harness.logs.validity import usable
from sim.outside import files
from sim.place import local

SLOWEST_S = 0.1  # samples further apart cannot be integrated
FEW = 0.01  # a smaller share of the fixes is damage
FAR = "at a time far from its neighbours"
OUTSIDE, IN_GAP = "outside the inertial record", "in a gap of the inertial record"
REPLACED = "replaced by a later one in the same row"
UNHEALTHY = "unhealthy"
NO_ATTITUDE, NO_ROW, ALONE = "no attitude", "no inertial sample beside it", "no other attitude within 0.5 s"
_HAS = {"gps": "gps_new", "magnetometer": "mag_new", "airspeed": "air_new"}


@dataclass(frozen=True, slots=True)
class Stream:
    """Messages of one kind.

    name : in the log      t_s : shape (n,), by the clock aboard      values : shape (n, m)
    why : shape (n,), the reason in the log for not using a message, empty if there is none
    optional : how many of the last columns may be NaN
    lost : shape (n,), messages which say that the fix is lost, or None
    """

    name: str
    t_s: Array
    values: Array
    why: NDArray[np.object_]
    optional: int = 0
    lost: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, name: str, t_s: Array, values: Array) -> "Stream":
        """Messages all of which may be used; impossible numbers become NaN, see `files.measured`."""
        return cls(name, files.measured(t_s), files.measured(values), np.full(len(t_s), "", object))

    def without(self, where: NDArray[np.bool_], reason: str) -> "Stream":
        """The same stream with a `reason` not to use the messages `where`; earlier reasons stay."""
        why = self.why.copy()
        why[np.asarray(where) & (why == "")] = reason
        return replace(self, why=why)


@dataclass(frozen=True, slots=True)
class Messages:
    """What an autopilot logged, in our units; None for what it did not log.

    inertial : gyro x y z, specific force x y z      dt_s : shape (n,), its intervals, NaN if not logged
    names : our names of the columns of `inertial` -> those of the log
    fixes : latitude, longitude (degrees), altitude, velocity north east down, time of validity (or NaN)
    magnetic : field, x y z, microtesla              airspeed, height : one column each
    attitude : R_eb row by row, nine columns         kind : of the attitude
    known : what the log says about the instruments  remedy : how to log the inertial unit fast enough
    """

    inertial: Stream
    dt_s: Array
    names: Mapping[str, str]
    fixes: Stream | None = None
    magnetic: Stream | None = None
    airspeed: Stream | None = None
    height: Stream | None = None
    attitude: Stream | None = None
    kind: Kind = "filter"
    known: Mapping[str, Known | None] = field(default_factory=dict)
    remedy: str = ""


def switched_off(stream: Stream, sensor: str, why: str) -> tuple[Stream, dict[str, Known | None]]:
    """A stream of a `sensor` that a parameter switches off: all of it left out, and ``use_...`` known to be false."""
    off = stream.without(np.ones(len(stream.t_s), np.bool_), why)
    return off, {f"use_{sensor}": Known(False, "log", why.partition(" ")[0])}


def first_known(logged: Iterable[tuple[Stream, Kind]]) -> tuple[Stream | None, Kind]:
    """The first attitude in `logged` with a number, else the first; None if `logged` is empty."""
    first: tuple[Stream | None, Kind] = None, "filter"
    for stream, kind in logged:
        if np.isfinite(stream.values).all(axis=1).any():
            return stream, kind
        first = first if first[0] else (stream, kind)
    return first


def recorded(path: Path, messages: Messages, repairs: list[str]) -> RecordedLog:
    """The log made of the messages, in order and checked.

    Raises
    ------
    LogError      one line with the file, the message and the column
    """
    account = _Account(Ledger(), repairs)
    rows, source, after_gap = _inertial(path, messages, account)
    known = {"imu_rate_hz": Known(1.0 / float(np.median(np.diff(rows["t_s"]))), "log", messages.inertial.name)}
    ticks = _Ticks(rows, after_gap, account)
    place = _put_fixes(ticks, messages.fixes, known)
    if (field := ticks.put("magnetometer", messages.magnetic, "mag_new")) is not None:
        rows["mag_b_ut"] = np.nan_to_num(field)
    if (airspeed := ticks.put("airspeed", messages.airspeed, "air_new")) is not None:
        rows["equivalent_airspeed_m_s"] = np.nan_to_num(airspeed[:, 0])
    height = ticks.put("barometer", messages.height, None)
    rows["baro_height_m"] = np.nan if height is None else height[:, 0]
    reference = _reference(path, messages, rows["t_s"], after_gap, account)
    known |= {name: entry for name, entry in messages.known.items() if entry is not None}
    sensors = properties.sensors(rows)
    log = RecordedLog(rows, path.name, sensors, reference, tuple(repairs), place, known, account.ledger)
    log = checks.judged(log, source, account.ledger)
    for stream, new in _HAS.items():
        if stream in log.ledger:
            log.ledger.use(stream, int(np.sum(log.rows[new] > 0)))
    log.ledger.use("imu", len(log.rows))
    return log


@dataclass(frozen=True, slots=True)
class _Account:
    """The records of what was left out and what was repaired."""

    ledger: Ledger
    repairs: list[str]

    def open(self, name: str, stream: Stream) -> NDArray[np.bool_]:
        """Enter a stream: messages read, and those left out for a reason in the log; returns the others."""
        self.ledger.read(name, len(stream.t_s))
        for reason, n in zip(*np.unique(stream.why.astype(str), return_counts=True), strict=True):
            if reason:
                self.ledger.leave_out(name, int(n), str(reason))
        return np.asarray(stream.why == "")

    def leave_out(self, name: str, good: NDArray[np.bool_], where: NDArray[np.bool_], reason: str) -> int:
        """Remove those `where` from the `good` ones of a stream, in place; returns how many."""
        n = int(np.sum(good & where))
        self.ledger.leave_out(name, n, reason)
        good &= ~where
        return n

    def leave_out_far(self, name: str, good: NDArray[np.bool_], stream: Stream) -> None:
        """Leave out messages whose time is far from those around them."""
        at = np.flatnonzero(np.isfinite(stream.t_s))
        wild = np.zeros(len(stream.t_s), np.bool_)
        wild[at] = _wild(stream.t_s[at])
        first = int(np.argmax(wild & good)) + 1
        if n := self.leave_out(name, good, wild, FAR):
            self.repairs.append(f"{stream.name}: {n} {FAR} left out, first {first}")


def _wild(t_s: Array) -> NDArray[np.bool_]:
    """Damaged messages, at most two in five: their time is far from the median of the five around them.

    Increasing times equal their median, even next to a gap.  A clock that was set is not removed here: it is rejected
    later.
    """
    if len(t_s) < 3:
        return np.zeros(len(t_s), np.bool_)
    far = max(checks.LATEST_S, 3.0 * float(np.median(np.abs(np.diff(t_s)))))
    return np.asarray(np.abs(t_s - median_filter(t_s, 5, mode="reflect")) > far)


def _inertial(
    path: Path, messages: Messages, account: _Account
) -> tuple[NDArray[Any], checks.Source, NDArray[np.bool_]]:
    """Rows with the inertial samples, how the log names a place in it, and the rows after a gap."""
    stream = messages.inertial
    good = account.open("imu", stream)
    account.leave_out_far("imu", good, stream)
    number = np.flatnonzero(good) + 1
    source = checks.Source(path, messages.names, lambda k: f"{stream.name} {number[k]}")
    stream = replace(stream, t_s=stream.t_s[good], values=stream.values[good])
    by_name = dict(zip(INERTIAL, stream.values.T, strict=True))
    keep = checks.kept(stream.t_s, by_name, source, account.repairs, account.ledger)
    rows = np.zeros(len(keep), MEASURED_DTYPE)
    rows["t_s"] = stream.t_s[keep]
    usual_s = float(np.median(np.diff(rows["t_s"]))) if len(rows) > 1 else 0.0
    if usual_s > 1.05 * SLOWEST_S:  # by more than jitter
        why = f"{stream.name} was logged every {usual_s:g} s; {SLOWEST_S} s or less can be replayed"
        raise LogError(f"{path}: {why}{messages.remedy and f': {messages.remedy}'}")
    if len(rows) < 2:
        raise source.refusal(None, "time", "a log of one row")
    rows["dt_s"] = _intervals(rows["t_s"], messages.dt_s[good][keep], stream.name, account.repairs)
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = np.hsplit(stream.values[keep], 2)
    return rows, source, gaps.missing(rows["t_s"], np.full(len(rows), usual_s))


def _intervals(t_s: Array, dt_s: Array, name: str, repairs: list[str]) -> Array:
    """Intervals as logged; NaN after a sample that was not logged: then the row covers the time since the last one."""
    logged = (dt_s >= checks.SHORTEST_S) & (dt_s <= LONGEST_GAP_S)
    if not logged.any():
        return np.full(len(t_s), np.nan)
    usual_s, steps = float(np.median(dt_s[logged])), np.diff(t_s)
    if np.median(steps) > gaps.LONG * usual_s:
        repairs.append(
            f"{name}: means over {1e3 * usual_s:g} ms logged every {1e3 * np.median(steps):g} ms; "
            "each is taken for the time since the one before"
        )
        return np.full(len(t_s), np.nan)
    missing = gaps.missing(t_s, np.where(logged, dt_s, usual_s))
    return np.where(logged & ~missing, dt_s, np.nan)


class _Ticks:
    """The rows, and messages put into them as they arrived."""

    def __init__(self, rows: NDArray[Any], after_gap: NDArray[np.bool_], account: _Account) -> None:
        self.rows, self.after_gap, self.account = rows, after_gap, account
        self.most_s = gaps.LONG * float(np.median(np.diff(rows["t_s"])))  # from arrival to the end of the tick

    def placed(self, name: str, stream: Stream) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Messages that are used, by their number in the stream, and the row of each; in order of time."""
        account, t_s, rows_s = self.account, stream.t_s, self.rows["t_s"]
        good = account.open(name, stream)
        needed = stream.values[:, : stream.values.shape[1] - stream.optional]
        broken = ~(np.isfinite(t_s) & np.isfinite(needed).all(axis=1))
        if n := account.leave_out(name, good, broken, NO_NUMBER):
            account.repairs.append(f"{stream.name}: {n} without a number left out")
        account.leave_out_far(name, good, stream)
        kept = np.flatnonzero(good)
        if late := np.count_nonzero(np.diff(t_s[kept]) < 0.0):
            account.repairs.append(f"{stream.name}: {late} out of order, sorted")
        at = np.searchsorted(rows_s, np.where(good, t_s, 0.0))
        row = np.minimum(at, len(rows_s) - 1)
        early = t_s < rows_s[row] - self.most_s
        account.leave_out(name, good, (at == len(rows_s)) | ((at == 0) & early), OUTSIDE)
        account.leave_out(name, good, self.after_gap[row] & early, IN_GAP)
        kept = np.flatnonzero(good)
        kept = kept[np.argsort(t_s[kept], kind="stable")]
        last = np.append(np.diff(at[kept]) > 0, True)[: len(kept)]
        account.ledger.leave_out(name, int(np.sum(~last)), REPLACED)
        return kept[last], at[kept[last]]

    def put(self, name: str, stream: Stream | None, new: str | None) -> Array | None:
        """Mark arrivals in the column `new`; returns the values, held, shape (N, m), NaN before the first."""
        if stream is None:
            return None
        message, at = self.placed(name, stream)
        arrived = np.zeros(len(self.rows), np.bool_)
        arrived[at] = True
        if new is not None:
            self.rows[new] = arrived
        else:
            self.account.ledger.use(name, int(arrived.sum()))
        last = np.cumsum(arrived)  # how many so far
        return np.vstack((np.full(stream.values.shape[1], np.nan), stream.values[message]))[last]


def _put_fixes(ticks: _Ticks, fixes: Stream | None, known: dict[str, Known]) -> tuple[float, float] | None:
    """Fill the GPS columns and `known` of the receiver; returns the first fix, the origin of positions."""
    rows = ticks.rows
    held = ticks.put("gps", fixes, "gps_new")
    new = rows["gps_new"] > 0
    if fixes is None or held is None or not new.any():
        return None
    ever = np.isfinite(held[:, 0])
    latitude, longitude, altitude, n, e, d, true_s = held[ever].T
    origin = latitude[0], longitude[0], altitude[0]
    rows["gps_valid"] = _holds(rows, fixes)
    rows["gps_t_s"][ever] = true_s
    rows["gps_p_e_m"][ever] = local(latitude, longitude, altitude, *map(float, origin))
    rows["gps_v_e_m_s"][ever] = np.column_stack((n, e, d))
    rows["gps_speed_m_s"][ever] = np.hypot(n, e)
    rows["gps_course_rad"][ever] = np.arctan2(e, n) % (2.0 * np.pi)
    at_s = rows["t_s"][new]
    if len(at_s) > 2:
        known["gps_rate_hz"] = Known(1.0 / float(np.median(np.diff(at_s))), "log", fixes.name)
    known["gps_stamped"] = Known(bool(np.isfinite(rows["gps_t_s"][new]).mean() > 0.5), "log", fixes.name)
    if np.mean(rows["gps_v_e_m_s"][new, 2] != 0.0) > FEW:
        known["gps_vertical_velocity"] = Known(True, "log", fixes.name)
    elif np.ptp(rows["gps_p_e_m"][new, 2]) > CLIMB_M:
        known["gps_vertical_velocity"] = Known(False, "log", fixes.name)
        rows["gps_v_e_m_s"][:, 2] = 0.0
    return float(origin[0]), float(origin[1])


def _holds(rows: NDArray[Any], fixes: Stream) -> NDArray[np.bool_]:
    """Rows in which the last fix is usable; see `validity.usable`."""
    lost = np.zeros(len(rows), np.bool_)
    if fixes.lost is not None:
        at = np.searchsorted(rows["t_s"], fixes.t_s[fixes.lost & np.isfinite(fixes.t_s)])
        lost[at[at < len(rows)]] = True
    return usable(rows["gps_new"] > 0, rows["t_s"], lost)


def _reference(
    path: Path, messages: Messages, t_s: Array, after_gap: NDArray[np.bool_], account: _Account
) -> Reference | None:
    """The attitude at the times of the rows, interpolated; None if none was logged."""
    stream = messages.attitude
    if stream is None or not len(stream.t_s):
        return None
    good = account.open("reference", stream)
    account.leave_out(
        "reference", good, ~(np.isfinite(stream.t_s) & np.isfinite(stream.values).all(axis=1)), NO_ATTITUDE
    )
    account.leave_out_far("reference", good, stream)
    times, first = np.unique(stream.t_s[good], return_index=True)
    account.ledger.leave_out("reference", int(good.sum()) - len(times), REPEATED)
    R_eb = attitudes.at_times(times, stream.values[good][first].reshape(-1, 3, 3), t_s)
    known = np.isfinite(R_eb).all(axis=(1, 2))
    used = np.zeros(len(times), np.bool_)
    if known.any():
        after = np.clip(np.searchsorted(times, t_s[known]), 1, len(times) - 1)
        used[after] = used[after - 1] = True  # used to interpolate between
    account.ledger.use("reference", int(used.sum()))
    unused = ~used
    near = np.diff(times) <= LONGEST_GAP_S
    alone = ~(np.append(near, False) | np.insert(near, 0, False))[: len(times)]
    row = np.searchsorted(t_s, times)
    gap = np.append(after_gap, False)[row]
    account.leave_out("reference", unused, (times < t_s[0]) | (times > t_s[-1]), OUTSIDE)
    account.leave_out("reference", unused, gap, IN_GAP)
    account.leave_out("reference", unused, alone, ALONE)
    account.leave_out("reference", unused, np.ones(len(times), np.bool_), NO_ROW)
    return Reference(R_eb, messages.kind, f"{stream.name} in {path.name}")
