"""Checks of a log in any format: faults are repaired and counted, or rejected with the row and the column.

Repaired: rows without a number in time, gyro or accelerometer, rows of zeros before the first reading, and GPS fixes,
magnetic and air samples without a number are left out; rows late by up to a second are sorted; repeated times are left
out; times in milli-, micro- or nanoseconds, rates in degrees and forces in g are converted.  Reported: gaps.  Rejected:
a column without a number, a clock that runs back, more bad rows than good, an accelerometer with the opposite sign,
and values that no inertial unit has.

Units are inferred only from impossible values.  See `rate_factor` for the gyro.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.interface import G_M_S2, Array
from estimator.params.shared import GYRO_RANGE_RAD_S
from scenarios.harness.logs import accounts, gaps
from scenarios.harness.logs.accounts import NO_NUMBER, REPEATED, ZEROS
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from scenarios.harness.logs.witnesses import witnesses

LATEST_S = 1.0  # rows later than this are rejected: the clock was set, or two logs are in one file
LONGEST_LOG_S = 5e9  # longer than any clock runs, and the most that a timeline in nanoseconds holds
FASTEST_HZ, SHORTEST_S = 20_000.0, 1e-6  # shorter intervals are invalid
BUSIEST_RAD_S = 3.0  # no aeroplane turns faster than this for half of a log
FEWEST, LEAST_RAD = 20, 0.1  # samples and angle that a witness needs
_CLOCKS = ((1e6, "nanoseconds", 1e-9), (1e3, "microseconds", 1e-6), (1.0, "milliseconds", 1e-3))
_PERIODS = (2.0**16, 86400.0, 604800.0, 86400.0e3, 604800.0e3, 2.0**32)  # of counters, days and weeks in s and ms
_DEGREES = 180.0 / np.pi
_ARRIVALS = (
    ("gps_new", "GPS fixes", ("gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s"), "gps"),
    ("mag_new", "magnetic samples", ("mag_b_ut",), "magnetometer"),
    ("air_new", "air-data samples", ("equivalent_airspeed_m_s", "baro_height_m"), "airspeed"),
)
_EITHER = "air_new"  # one of its numbers is enough: not every aeroplane has a pitot tube


@dataclass(frozen=True, slots=True)
class Source:
    """How to name a place in a log: the file, its names for our quantities, its numbers of rows.

    remedy : what to do if the specific force has the wrong sign      offered : names of all its columns
    """

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    row: Callable[[int], str] = lambda k: f"row {k + 1}"
    offered: tuple[str, ...] = ()
    remedy: str = "its axes point up, or it reads gravity minus acceleration"

    def column(self, quantity: str) -> str:
        """The file's name for `quantity`."""
        own = self.columns.get(quantity, quantity)
        return f"column {own}" if own == quantity else f"column {own} ({quantity})"

    def refusal(self, k: int | None, quantity: str, why: str) -> LogError:
        """The error that names the file, the row `k` and the column."""
        at = "" if k is None else f"{self.row(k)}, "
        return LogError(f"{self.path}: {at}{self.column(quantity)}: {why}")


def clock_factor(t_s: Array, source: Source, repairs: list[str]) -> float:
    """Factor to seconds: if the samples are a second or more apart, the times are in another unit."""
    good = np.sort(t_s[np.isfinite(t_s)])
    steps = np.diff(good)
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    for least, name, factor in _CLOCKS:
        if step >= least:
            repairs.append(f"{source.column('time')} in {name}, not seconds: converted")
            return factor
    return 1.0


def unwrapped(ticks: Array) -> Array:
    """Times from a counter that restarts at a power of two, or at the end of a day or a week, made continuous.

    ticks : shape (N,), in the unit of the file
    """
    good = np.flatnonzero(np.isfinite(ticks))
    if len(good) < 2:
        return ticks
    before, after, largest = ticks[good[:-1]], ticks[good[1:]], float(ticks[good].max())
    for period in _PERIODS:
        back = (before > 0.99 * period) & (after < 0.01 * period)
        if largest <= period and back.any():
            turns = np.zeros(len(ticks))
            turns[good[1:][back]] = period
            return np.asarray(ticks + np.cumsum(turns))
    return ticks


def kept(
    t_s: Array, numbers: Mapping[str, Array], source: Source, repairs: list[str], ledger: Ledger | None = None
) -> NDArray[np.intp]:
    """Rows to keep, in order of time.

    Parameters
    ----------
    t_s : shape (N,)          numbers : our name -> shape (N,), columns in which a row must have a number
    repairs : lines are added to it
    ledger : rows that are left out are counted in it, in the stream ``imu``

    Raises
    ------
    LogError      a column without a number, more bad rows than good ones, or a clock that runs back
    """
    n, ledger = len(t_s), Ledger() if ledger is None else ledger
    good = np.ones(n, np.bool_)
    for name, values in {"time": t_s, **numbers}.items():
        bad = ~np.isfinite(values)
        if n == 0 or bad.all():
            raise source.refusal(None, name, f"no number in {n} rows")
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            repairs.append(f"{source.column(name)}: {bad.sum()} without a number left out, first {source.row(first)}")
            good &= ~bad
    ledger.leave_out("imu", int((~good).sum()), NO_NUMBER)
    empty = np.logical_and.accumulate(np.all([values == 0.0 for values in numbers.values()], axis=0))
    if empty.any():
        repairs.append(f"{empty.sum()} rows of zeros before the first reading left out, first {source.row(0)}")
        ledger.leave_out("imu", int((empty & good).sum()), ZEROS)
        good &= ~empty
    if 2 * good.sum() < n:
        first = int(np.flatnonzero(~good)[0])
        raise LogError(f"{source.path}: {n - good.sum()} of {n} rows lack a number, the first is {source.row(first)}")
    keep = np.flatnonzero(good)
    latest_s = np.maximum.accumulate(t_s[keep])
    behind_s = latest_s - t_s[keep]  # behind the latest so far: a log may run back in small steps
    for k in np.flatnonzero(behind_s > LATEST_S)[:1]:
        why = f"runs back from {latest_s[k]:g} to {t_s[keep[k]]:g} s: a clock that was set, or two logs in one"
        raise source.refusal(int(keep[k]), "time", why)
    for k in np.flatnonzero(latest_s - t_s[keep[0]] > LONGEST_LOG_S)[:1]:
        why = f"{t_s[keep[k]]:g} s, after a log that begins at {t_s[keep[0]]:g} s: a damaged time"
        raise source.refusal(int(keep[k]), "time", why)
    late = np.flatnonzero(np.diff(t_s[keep]) < 0.0)
    if len(late):
        first_row = source.row(int(keep[late[0] + 1]))
        repairs.append(f"{source.column('time')}: {len(late)} out of order, sorted; first {first_row}")
        keep = keep[np.argsort(t_s[keep], kind="stable")]
    again = np.flatnonzero(np.diff(t_s[keep]) == 0.0) + 1
    if 2 * len(again) >= len(keep):
        raise source.refusal(int(keep[again[0]]), "time", f"{len(again)} of {len(keep)} rows repeat the time before")
    if len(again):
        first_row = source.row(int(keep[again[0]]))
        repairs.append(f"{source.column('time')}: {len(again)} repeated, left out; first {first_row}")
        ledger.leave_out("imu", len(again), REPEATED)
        keep = np.delete(keep, again)
    return keep


def mended(log: RecordedLog, path: Path) -> RecordedLog:
    """`log` with its rows in order and checked; see the module.

    The ledger is completed with the rows and the samples in them that are used and left out here.

    Raises
    ------
    LogError      one line with the file, the row and the column
    """
    source, repairs = Source(path), list(log.repairs)
    rows, reference = log.rows, log.reference
    vectors = {"gyro": rows["gyro_b_rad_s"], "force": rows["force_b_m_s2"]}
    numbers = {f"{name}.{axis}": v[:, i] for name, v in vectors.items() for i, axis in enumerate("xyz")}
    keep = kept(rows["t_s"], numbers, source, repairs)
    accounts.inertial(log.ledger, rows["t_s"], np.column_stack(list(numbers.values())), keep)
    if len(keep) < len(rows) or np.any(np.diff(keep) != 1):
        moved = rows[keep]
        for name, *_ in _ARRIVALS:  # what arrived with a row left out arrives with the next
            at = np.searchsorted(moved["t_s"], rows["t_s"][rows[name] > 0])
            moved[name] = 0
            moved[name][at[at < len(moved)]] = 1
        rows = moved
        if reference is not None:
            reference = replace(reference, R_eb=reference.R_eb[keep])
    found = judged(replace(log, rows=rows, reference=reference, repairs=tuple(repairs)), source)
    accounts.arrivals(log.ledger, log.rows, found.rows)
    if log.reference is not None and reference is not None:
        accounts.reference(log.ledger, log.reference.known, int(reference.known.sum()))
    return found


def judged(log: RecordedLog, source: Source, ledger: Ledger | None = None) -> RecordedLog:
    """`log`, whose rows are in order, with missing intervals filled in and units corrected; gaps are reported.

    ledger : counts samples that arrived without a number, if given

    Raises
    ------
    LogError      values that no inertial unit would report
    """
    rows, repairs = log.rows.copy(), list(log.repairs)
    _fill_intervals(rows, source, repairs)
    _check_arrivals(rows, repairs, Ledger() if ledger is None else ledger)
    _check_force(rows, source, repairs)
    factor = rate_factor(rows, log.reference)
    if factor != 1.0:
        says = "degrees per second, not rad/s" if factor < 1.0 else "rad/s, not degrees per second"
        repairs.append(f"{source.column('gyro')} in {says}: converted")
        rows["gyro_b_rad_s"] *= factor
    _note_field(rows, source, repairs)
    rows.flags.writeable = False
    return replace(log, rows=rows, repairs=tuple(repairs))


def _fill_intervals(rows: NDArray[Any], source: Source, repairs: list[str]) -> None:
    """Fill in missing ``dt_s``; report gaps."""
    if len(rows) < 2:
        raise source.refusal(None, "time", "a log of one row")
    steps = np.diff(rows["t_s"])
    usual = float(np.median(steps))
    if not 1.0 / FASTEST_HZ <= usual <= LONGEST_GAP_S:
        why = f"{usual:g} s from row to row; an inertial unit samples every {1.0 / FASTEST_HZ:g} to {LONGEST_GAP_S} s"
        raise source.refusal(None, "time", why)
    steps = np.concatenate(([usual], steps))
    unknown = ~((rows["dt_s"] >= SHORTEST_S) & (rows["dt_s"] <= LONGEST_GAP_S))
    rows["dt_s"][unknown] = np.where(steps > LONGEST_GAP_S, usual, steps)[unknown]
    expected = np.where(unknown, usual, rows["dt_s"])
    short = gaps.missing(rows["t_s"], expected) & (steps <= LONGEST_GAP_S)
    if short.any():
        lost = np.maximum(np.round(steps / expected) - 1.0, 1.0)[short].sum()
        repairs.append(f"{lost:.0f} samples lost, covered by the next one; first {_at(rows, short)}")
    long = np.flatnonzero(steps > LONGEST_GAP_S)
    if len(long):
        k = int(long[np.argmax(steps[long])])
        repairs.append(f"{len(long)} gaps longer than {LONGEST_GAP_S} s, the longest {steps[k]:.1f} s "
                       f"until {rows['t_s'][k]:.2f} s")  # fmt: skip


def _check_arrivals(rows: NDArray[Any], repairs: list[str], ledger: Ledger) -> None:
    """Remove samples that arrived without a number."""
    for new, what, columns, stream in _ARRIVALS:
        broken = rows[new] > 0
        there = [np.isfinite(rows[c]).reshape(len(rows), -1).all(axis=1) for c in columns]
        broken &= ~(np.any if new == _EITHER else np.all)(there, axis=0)
        if broken.any():
            repairs.append(f"{broken.sum()} {what} without a number left out, first {_at(rows, broken)}")
            if stream in ledger:
                ledger.leave_out(stream, int(broken.sum()), NO_NUMBER)
            rows[new][broken] = 0


def _at(rows: NDArray[Any], where: NDArray[np.bool_]) -> str:
    return f"at {rows['t_s'][np.argmax(where)]:.2f} s"


def _check_force(rows: NDArray[Any], source: Source, repairs: list[str]) -> None:
    """Check size and sign of the specific force: its median is about that of level flight."""
    length = float(np.median(np.linalg.norm(rows["force_b_m_s2"], axis=1)))
    if 0.5 < length < 2.5:
        repairs.append(f"{source.column('force')} in g, not m/s^2: converted")
        rows["force_b_m_s2"] *= G_M_S2
    elif not 0.5 * G_M_S2 < length < 2.5 * G_M_S2:
        counts = "; counts need a factor in a column map" if length > 100.0 * G_M_S2 else ""
        why = f"its median is {length:g} m/s^2, that of an aeroplane about {G_M_S2:.1f}{counts}"
        raise source.refusal(None, "force", why)
    z = float(np.median(rows["force_b_m_s2"][:, 2]))
    if z > 0.5 * G_M_S2:
        why = f"the median of z is {z:.1f} m/s^2; level specific force is {-G_M_S2:.1f}: {source.remedy}"
        raise source.refusal(None, "force", why)


def rate_factor(rows: NDArray[Any], reference: Reference | None) -> float:
    """Factor to rad/s: 1, or that between degrees and radians if the gyro is off by about that factor.

    There are two kinds of evidence, and the log of an aeroplane in the right unit gives neither.

    *Witnesses.*  Something else in the log that turns (`witnesses.witnesses`: the reference, the magnetic field, the
    course, the direction of the specific force) is correlated with the gyro above 0.7, and the gyro shows 25 to 130
    times its rate, around the 57.3 between the two units.  Without turning there is no correlation, so a log at rest
    gives no evidence; and a gyro in the right unit would have to overstate every turn 25 times.  The first witness
    with a correlation decides.

    *Range*, if there is no witness.  One reading in a hundred is beyond 2100 deg/s, which no part in use reaches, or
    half of them are beyond 3 rad/s: no aeroplane makes a full turn every two seconds for half of a log.
    """
    for seen, said in witnesses(rows, reference):
        together = float(np.sum(seen * said))
        squared = float(np.sum(seen**2)) * float(np.sum(said**2))
        if seen.size < FEWEST or np.sum(seen**2) < LEAST_RAD**2 or not together > 0.7 * np.sqrt(squared):
            continue
        ratio = together / float(np.sum(seen**2))
        if 25.0 < ratio < 130.0:
            return 1.0 / _DEGREES
        return _DEGREES if 25.0 < 1.0 / ratio < 130.0 else 1.0
    rates = np.linalg.norm(rows["gyro_b_rad_s"], axis=1)
    beyond = np.percentile(rates, 99.0) > GYRO_RANGE_RAD_S or np.median(rates) > BUSIEST_RAD_S
    return 1.0 / _DEGREES if beyond else 1.0


def _note_field(rows: NDArray[Any], source: Source, repairs: list[str]) -> None:
    """Report a field that is not the earth's; it is kept, because only its direction is used."""
    field_ut = np.linalg.norm(rows["mag_b_ut"][rows["mag_new"] > 0], axis=1)
    if len(field_ut) and not 10.0 < np.median(field_ut) < 250.0:
        repairs.append(f"{source.column('mag')}: {np.median(field_ut):.3g} uT is not the earth's field; kept")
