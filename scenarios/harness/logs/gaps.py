"""Missing samples, as opposed to jitter of the time stamps.

A late time stamp is followed by a short step; after a lost sample all times stay behind the grid of the usual interval.
So a long step counts as a gap if the times after it are on average later, relative to that grid, than those before it.
"""

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.interface import Array

LONG = 1.5  # in usual intervals: a step up to this long is never a gap
BEHIND = 0.6  # in usual intervals: how much later the times after a gap are on average
SIDE = 15  # rows on either side over which the lateness is averaged


def missing(t_s: Array, interval_s: Array) -> NDArray[np.bool_]:
    """Rows before which samples are missing.

    Parameters
    ----------
    t_s : shape (N,), increasing
    interval_s : shape (N,), the usual interval of each row, s

    Returns
    -------
    shape (N,)      true at the first row after a gap; never at row 0
    """
    steps = np.diff(t_s, prepend=t_s[0] - interval_s[0])
    gaps = np.asarray(steps > LONGEST_GAP_S)
    gaps[0] = False
    late_s = np.where(gaps, 0.0, steps - interval_s)  # lateness of each row relative to the grid of the row before
    long = np.flatnonzero((steps > LONG * interval_s) & ~gaps)
    for k in long[np.argsort(-steps[long], kind="stable")]:
        if k == 0:
            continue
        first, end = max(k - SIDE, 0), min(k + SIDE, len(t_s))
        behind_s = np.cumsum(late_s[first:end])
        jump_s = behind_s[k - first :].mean() - behind_s[: k - first].mean()
        if jump_s > BEHIND * interval_s[k]:
            gaps[k] = True
            late_s[k] -= max(round(steps[k] / interval_s[k]) - 1, 1) * interval_s[k]  # no longer late
    return gaps
