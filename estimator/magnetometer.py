"""What flight code makes of a magnetometer: its calibration.

References
----------
N. A. Dilshad and M. K. Jahan, "An Improvement Strategy on Direction Cosine Matrix based Attitude Estimation for
Multi-Rotor Autopilot", Global Journal of Researches in Engineering F 14(8), 2014.
"""

import numpy as np

from estimator.interface import Array


def hard_iron_from_extremes(field_b_ut: Array) -> Array:
    """Offset of every axis, half-way between its largest and its smallest reading (Dilshad & Jahan, Eqn 8).

    Right where in the sweep every axis has pointed along the field and against it, or as near to the one as to the
    other.  Where an axis has missed the two by the angles a and b, the answer is wrong by
    |B| (cos a - cos b) / 2; noise of sigma s adds about half of s.

    Parameters
    ----------
    field_b_ut : shape (n, 3)   readings while the magnetometer was turned, microtesla

    Returns
    -------
    shape (3,)      what the magnetometer reads too much, to be taken off every reading

    Raises
    ------
    ValueError      not rows of three finite numbers, or fewer than two
    """
    readings = np.asarray(field_b_ut, np.float64)
    if readings.ndim != 2 or readings.shape[1] != 3 or len(readings) < 2:
        raise ValueError(f"field_b_ut has shape {readings.shape}: give at least 2 rows of 3 axes, microtesla")
    if not np.all(np.isfinite(readings)):
        raise ValueError("field_b_ut holds values that are not finite microtesla: leave those rows out")
    return 0.5 * (readings.max(axis=0) + readings.min(axis=0))
