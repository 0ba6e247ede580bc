"""For how long the last fix of a receiver is of use."""

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array

LONGEST_S, INTERVALS = 2.0, 3.0  # without a fix: the longer of these, in seconds and in usual intervals


def latest(where: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index of the last true element up to each, -1 before the first; shape of `where`, (N,)."""
    return np.asarray(np.maximum.accumulate(np.where(where, np.arange(len(where)), -1)))


def usable(new: NDArray[np.bool_], t_s: Array, lost: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows in which the last fix is usable, shape (N,).

    A fix is usable from its arrival until the receiver says that it has lost it, and until no other has come for 2 s
    and three of its usual (median) intervals.

    Parameters
    ----------
    new : shape (N,)      rows in which a fix arrived
    t_s : shape (N,)      times of the rows, increasing
    lost : shape (N,)     rows in which the receiver said that it has no fix; one that arrived in the same row counts
    """
    arrived = np.flatnonzero(new)
    if not len(arrived):
        return np.zeros(len(t_s), np.bool_)
    intervals = np.diff(t_s[arrived])
    longest_s = max(LONGEST_S, INTERVALS * float(np.median(intervals)) if len(intervals) else 0.0)
    last, last_lost = latest(new), latest(lost & ~new)
    recent = t_s - t_s[np.maximum(last, 0)] <= longest_s + 1e-9
    return np.asarray((last >= 0) & (last > last_lost) & recent)
