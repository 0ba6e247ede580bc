"""How long the last fix of a receiver can be used."""

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array

LONGEST_S, INTERVALS = 2.0, 3.0  # the longer of these: seconds, and usual intervals between fixes


def latest(where: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Index of the last true element up to each, -1 before the first; shape of `where`, (N,)."""
    return np.asarray(np.maximum.accumulate(np.where(where, np.arange(len(where)), -1)))


def usable(new: NDArray[np.bool_], t_s: Array, lost: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows in which the last fix is usable, shape (N,).

    A fix is usable from its arrival until the receiver reports that it is lost, or until no other has arrived for 2 s
    or three median intervals, whichever is longer.

    Parameters
    ----------
    new : shape (N,)      rows in which a fix arrived
    t_s : shape (N,)      times of the rows, increasing
    lost : shape (N,)     rows in which the receiver reported no fix; a fix in the same row takes precedence
    """
    arrived = np.flatnonzero(new)
    if not len(arrived):
        return np.zeros(len(t_s), np.bool_)
    intervals = np.diff(t_s[arrived])
    longest_s = max(LONGEST_S, INTERVALS * float(np.median(intervals)) if len(intervals) else 0.0)
    last, last_lost = latest(new), latest(lost & ~new)
    recent = t_s - t_s[np.maximum(last, 0)] <= longest_s + 1e-9
    return np.asarray((last >= 0) & (last > last_lost) & recent)
