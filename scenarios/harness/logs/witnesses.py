"""Witnesses of rotation in a log besides the gyro: pairs of angles that are equal if the gyro is right.

Each witness gives, over successive windows, the angle it shows and the angle that follows from the gyro.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

from estimator.blocks.kernels import wrap
from estimator.interface import Array
from scenarios.harness.logs.recorded import Reference

WINDOW_S = 0.2  # long enough to rise above the noise, short enough for a small angle
FLYING_M_S = 5.0  # below this speed the course does not show turns
Pair = tuple[Array, Array]  # angles shown, and angles from the gyro, of one shape


def witnesses(rows: NDArray[Any], reference: Reference | None) -> Iterator[Pair]:
    """The witnesses in the log, the best first."""
    n = max(1, round(WINDOW_S / float(np.median(rows["dt_s"]))))
    turned = np.cumsum(rows["gyro_b_rad_s"] * rows["dt_s"][:, None], axis=0)  # small-angle approximation
    if reference is not None:
        yield _of_reference(reference.R_eb, turned, n)
    measured = np.flatnonzero(rows["mag_new"])
    if len(measured) > 2:
        step = max(1, round(n * len(measured) / len(rows)))
        yield _of_direction(rows["mag_b_ut"], turned, measured[::step])
    fixes = np.flatnonzero(rows["gps_new"])
    if len(fixes) > 2:
        yield _of_course(rows, fixes)
    yield _of_direction(_smooth(rows["force_b_m_s2"], n), turned, np.arange(0, len(rows), n))


def _of_reference(R_eb: Array, turned: Array, n: int) -> Pair:
    """Rotation from window to window, as a vector in the body."""
    at = np.arange(0, len(R_eb), n)
    at = at[np.isfinite(R_eb[at]).all(axis=(1, 2))]
    if len(at) < 2:
        return np.zeros((0, 3)), np.zeros((0, 3))
    seen = Rotation.from_matrix(R_eb[at[:-1]].transpose(0, 2, 1) @ R_eb[at[1:]]).as_rotvec()
    together = np.diff(at) == n  # no window across a hole in the reference
    return seen[together], np.diff(turned[at], axis=0)[together]


def _of_direction(vector_b: Array, turned: Array, at: NDArray[np.intp]) -> Pair:
    """Rotation of a vector fixed to the earth, in body axes: dv = v x dtheta."""
    length = np.linalg.norm(vector_b[at], axis=1, keepdims=True)
    v = np.divide(vector_b[at], length, out=np.zeros((len(at), 3)), where=length > 0.0)
    middle = 0.5 * (v[1:] + v[:-1])
    return np.diff(v, axis=0), np.cross(middle, np.diff(turned[at], axis=0))


def _of_course(rows: NDArray[Any], fixes: NDArray[np.intp]) -> Pair:
    """Change of course from fix to fix, and the gyro's rotation about the apparent vertical."""
    force = rows["force_b_m_s2"]
    length = np.maximum(np.linalg.norm(force, axis=1), 1e-3)
    about_down = -np.sum(rows["gyro_b_rad_s"] * force, axis=1) / length
    said = np.diff(np.cumsum(about_down * rows["dt_s"])[fixes])
    seen = np.asarray(wrap(np.diff(rows["gps_course_rad"][fixes])))
    flying = rows["gps_speed_m_s"][fixes] > FLYING_M_S
    both = flying[1:] & flying[:-1] & np.isfinite(seen)
    return seen[both], said[both]


def _smooth(values: Array, n: int) -> Array:
    """Mean over `n` rows about each, shape of `values`."""
    total = np.cumsum(np.concatenate((np.zeros((n, 3)), values, np.zeros((n, 3)))), axis=0)
    half = n // 2
    return (total[n + half : n + half + len(values)] - total[half : half + len(values)]) / n
