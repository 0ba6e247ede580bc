"""Ledger entries of the readers of tables: why a row or a sample did not reach the estimators."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs.ledger import Ledger

NO_NUMBER = "without a number"
ZEROS = "zeros before the first reading"
REPEATED = "repeated time"
NO_TIME = "without a time"
IN_ONE_ROW = "another arrived in the same row"
AFTER = "after the last inertial sample"
BEFORE = "before the first inertial sample"
OUTSIDE = "outside the times of the log"
IN_ROW_LEFT_OUT = "of an inertial row that was left out"
NO_FIX = "no fix of three dimensions"
NO_VELOCITY = "without a velocity"


def inertial(
    ledger: Ledger, t_s: Array, numbers: Array, keep: NDArray[np.intp], read: NDArray[np.intp] | None = None
) -> None:
    """Count the rows of an inertial unit; those with the indices `keep` are used.

    t_s : shape (N,), as read        numbers : shape (N, 6), gyro and accelerometer
    read : indices of its rows, all of them by default
    """
    n = len(t_s)
    left = np.zeros(n, np.bool_)
    left[np.arange(n) if read is None else read] = True
    ledger.read("imu", int(left.sum()))
    left[keep] = False
    ledger.use("imu", len(keep))
    for reason, why in (
        (NO_TIME, ~np.isfinite(t_s)),
        (NO_NUMBER, ~np.isfinite(numbers).all(axis=1)),
        (ZEROS, (numbers == 0.0).all(axis=1)),
        (REPEATED, np.ones(n, np.bool_)),
    ):
        ledger.leave_out("imu", int(np.sum(left & why)), reason)
        left &= ~why


def samples(ledger: Ledger, stream: str, read: NDArray[np.bool_], reasons: Iterable[tuple[NDArray[np.bool_], str]]) -> (
    NDArray[np.bool_]
):  # fmt: skip
    """Count samples of a `stream` that are left out, each under the first of the `reasons` that applies.

    read : shape (N,), where samples are        reasons : where not to use them, and why

    Returns
    -------
    shape (N,), the samples that remain, not yet counted as used
    """
    good = read.copy()
    ledger.read(stream, int(read.sum()))
    for where, reason in reasons:
        ledger.leave_out(stream, int(np.sum(good & where)), reason)
        good &= ~where
    return good


def arrivals(ledger: Ledger, read: NDArray[Any], used: NDArray[Any]) -> None:
    """Count the samples in measured rows, as they were `read` and as they are `used`, in order of time.

    A sample in a row that was left out arrives with the next row.  For streams in the `ledger`, it holds what was read
    and what the reader left out.
    """
    at = np.searchsorted(used["t_s"], read["t_s"])  # rows without a time come last
    final = _arrived(used)
    for stream, there in _arrived(read).items():
        if stream not in ledger:
            if not there.any():
                continue
            ledger.read(stream, int(there.sum()))
        timed = there & np.isfinite(read["t_s"])
        ledger.leave_out(stream, int(np.sum(there & ~timed)), NO_TIME)
        ledger.leave_out(stream, int(np.sum(timed & (at >= len(used)))), AFTER)
        rows = at[timed & (at < len(used))]
        placed = np.unique(rows)
        good = int(np.sum(final[stream][placed]))
        ledger.leave_out(stream, len(rows) - len(placed), IN_ONE_ROW)
        ledger.leave_out(stream, len(placed) - good, NO_NUMBER)
        ledger.use(stream, good)


def _arrived(rows: NDArray[Any]) -> dict[str, NDArray[np.bool_]]:
    """Rows in which a sample arrived, by stream; for air data, rows that hold the number."""
    air = rows["air_new"] > 0
    height = np.isfinite(rows["baro_height_m"])
    return {
        "gps": np.asarray(rows["gps_new"] > 0),
        "magnetometer": np.asarray(rows["mag_new"] > 0),
        "airspeed": np.asarray(air & (np.isfinite(rows["equivalent_airspeed_m_s"]) | ~height)),
        "barometer": np.asarray(air & height),
    }


def reference(ledger: Ledger, known: NDArray[np.bool_], used: int) -> None:
    """Count reference attitudes row by row; `used` of them are in rows that are used."""
    if "reference" not in ledger:
        ledger.read("reference", int(known.sum()))
    ledger.leave_out("reference", int(known.sum()) - used, IN_ROW_LEFT_OUT)
    ledger.use("reference", used)
