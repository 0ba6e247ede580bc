"""A log of which everything can be drawn: what no viewer can show is left out, or held at what was shown before.

A recording may hold anything that an estimator returned, or that somebody wrote into it since.
"""

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from sim.log import Log

LARGEST = 1e30  # single precision, in which the viewer draws, holds no more than 3e38
FARTHEST_M = 1e8
_CONTROLS = ("aileron", "elevator", "rudder", "throttle")


def drawable(log: Log) -> Log:
    """A copy of `log` that a viewer can show.

    Numbers beyond all reason are NaN, a matrix that is no rotation is level to the north, a place that is none is the
    one before it, and unknown velocities and controls are 0.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        truth, measured, flown = (_finite(rows) for rows in (log.truth, log.measured, log.flown))
        for rows in (truth, flown):
            rows["R_eb"] = np.where(is_rotation(rows["R_eb"])[:, None, None], rows["R_eb"], np.eye(3))
            for name in _CONTROLS:
                rows[name] = np.nan_to_num(rows[name])
        there = (np.abs(truth["p_e_m"]) < FARTHEST_M).all(axis=1)
        last = np.maximum.accumulate(np.where(there, np.arange(len(there)), -1))
        truth["p_e_m"] = np.where((last >= 0)[:, None], truth["p_e_m"][last], 0.0) if len(last) else 0.0
        truth["v_e_m_s"] = np.nan_to_num(truth["v_e_m_s"])
        measured["dt_s"] = np.nan_to_num(measured["dt_s"])
        fixes = measured["gps_p_e_m"]
        fixes[~(np.abs(fixes) < FARTHEST_M)] = np.nan
    return Log(truth, measured, flown)


def _finite(rows: NDArray[np.void]) -> NDArray[np.void]:
    made = rows.copy()
    for name in made.dtype.names or ():
        if made.dtype[name].base.kind == "f":
            made[name] = np.where(np.abs(made[name]) < LARGEST, made[name], np.nan)
    return made


def is_rotation(R_eb: Array) -> NDArray[np.bool_]:
    """Which of the matrices, shape (n, 3, 3), are rotations, to a tenth."""
    small = np.where(np.abs(R_eb) < 2.0, R_eb, np.nan)  # the square of what is larger may overflow
    known = np.abs(small @ small.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0) < 0.1
    known &= np.linalg.det(np.where(known[:, None, None], small, np.eye(3))) > 0.0
    return np.asarray(known)
