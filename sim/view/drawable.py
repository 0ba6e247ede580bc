"""A log made safe for drawing: values that no viewer can show are left out or held.

A recording may contain any value that an estimator returned, or that was edited into it later.
"""

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from sim.log import Log

LARGEST = 1e30  # the viewer draws in single precision, up to 3e38
FARTHEST_M = 1e8
_CONTROLS = ("aileron", "elevator", "rudder", "throttle")


def drawable(log: Log) -> Log:
    """A copy of `log` that a viewer can show.

    Huge numbers become NaN, matrices that are not rotations level and north, invalid positions the last valid one,
    and unknown velocities and controls 0.
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
    """Which of the matrices, shape (n, 3, 3), are rotations, within 0.1."""
    small = np.where(np.abs(R_eb) < 2.0, R_eb, np.nan)  # larger squares may overflow
    known = np.abs(small @ small.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0) < 0.1
    known &= np.linalg.det(np.where(known[:, None, None], small, np.eye(3))) > 0.0
    return np.asarray(known)
