"""Attitudes in a file, as angles, quaternions or matrices, and their interpolation to other times."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp  # type: ignore[import-untyped]

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.interface import Array
from estimator.rotation import from_euler
from scenarios.harness.logs import accounts, checks
from scenarios.harness.logs.quantities import EULER, MATRIX, QUATERNION
from scenarios.harness.logs.recorded import LogError
from sim.view.drawable import is_rotation

NOT_STARTED = "before the filter had started"
NO_ROTATION = "not a rotation"
MOST_DEG = 360.0  # larger rolls or pitches are not degrees
_SAY_UNIT = 'write the unit into the header or a column map: "roll_deg", "yaw_rad"'
Table = dict[str, Array]


def form_of(table: Mapping[str, Array]) -> tuple[str, ...]:
    """The columns that hold an attitude, as a matrix, a quaternion or three angles; empty if there are none."""
    return next((names for names in (MATRIX, QUATERNION, EULER) if all(name in table for name in names)), ())


def attitude(table: Mapping[str, Array]) -> Array | None:
    """The attitude in the columns, shape (N, 3, 3), NaN if unknown; None if there are no such columns.

    Three angles of exactly zero at the beginning mean that the filter had not started.
    """
    names = form_of(table)
    if not names:
        return None
    values = np.column_stack([table[name] for name in names])
    values = np.where(np.isinf(values), np.nan, values)
    if names == MATRIX:
        return rotations(values.reshape(-1, 3, 3))
    if names == QUATERNION:
        known = np.asarray(np.abs(np.linalg.norm(values, axis=1) - 1.0) < 0.1)
        R_eb = np.full((len(known), 3, 3), np.nan)
        if known.any():
            R_eb[known] = Rotation.from_quat(values[known]).as_matrix()
    else:
        known = np.isfinite(values).all(axis=1) & np.maximum.accumulate(np.any(np.nan_to_num(values) != 0.0, axis=1))
        R_eb = from_euler(*values.T)
    return np.where(known[:, None, None], R_eb, np.nan)


def rotations(R_eb: Array) -> Array:
    """Matrices of shape (N, 3, 3), with NaN for those that are not rotations."""
    known = is_rotation(R_eb)
    return np.where(known[:, None, None], R_eb, np.nan)


def reasons(table: Mapping[str, Array], R_eb: Array) -> tuple[NDArray[np.bool_], list[tuple[NDArray[np.bool_], str]]]:
    """Rows with at least part of an attitude, and why some are not used; see `accounts.samples`."""
    values = np.column_stack([table[name] for name in form_of(table)])
    complete = np.asarray(np.isfinite(values).all(axis=1))
    unknown = np.asarray(~np.isfinite(R_eb).all(axis=(1, 2)))
    zeros = np.asarray(complete & (values == 0.0).all(axis=1))
    why: list[tuple[NDArray[np.bool_], str]] = [
        (~complete, accounts.NO_NUMBER), (unknown & zeros, NOT_STARTED), (unknown, NO_ROTATION),
    ]  # fmt: skip
    return np.asarray(np.isfinite(values).any(axis=1)), why


def mend_angles(table: Table, source: checks.Source) -> bool:
    """Convert angles without a unit from degrees if they exceed the range of radians; returns whether they did.

    Raises
    ------
    LogError      angles that are neither, or a yaw that may be degrees or unwrapped radians
    """
    if not all(name in table for name in EULER):
        return False
    largest = {name: float(np.nanmax(np.abs(table[name]), initial=0.0)) for name in EULER}
    steep = largest["roll"] > 3.2 or largest["pitch"] > 1.6
    if not steep and largest["yaw"] <= 6.4:
        return False
    for name in ("roll", "pitch"):
        if largest[name] > MOST_DEG:
            raise LogError(f"{source.path}: {name} up to {largest[name]:g} is neither radians nor degrees; {_SAY_UNIT}")
    if not steep and _may_be_turns(table["yaw"]):
        raise LogError(f"{source.path}: yaw up to {largest['yaw']:g} may be degrees or unwrapped radians; {_SAY_UNIT}")
    for name in EULER:
        table[name] = np.radians(table[name])
    return True


def _may_be_turns(yaw: Array) -> bool:
    """Whether a yaw may be unwrapped radians: it starts within one turn and never jumps by half a turn."""
    yaw = yaw[np.isfinite(yaw)]
    return bool(abs(yaw[0]) <= 6.4 and np.all(np.abs(np.diff(yaw)) < np.pi))


def at_times(t_s: Array, R_eb: Array, times_s: Array) -> Array:
    """Attitude `R_eb` at the times `t_s`, interpolated along the shortest rotation; NaN in gaps and outside."""
    known = np.isfinite(R_eb).all(axis=(1, 2)) & np.isfinite(t_s)
    found = np.full((len(times_s), 3, 3), np.nan)
    t_s, first = np.unique(t_s[known], return_index=True)
    if len(t_s) < 2:
        return found
    after = np.clip(np.searchsorted(t_s, times_s), 1, len(t_s) - 1)
    inside = (times_s >= t_s[0]) & (times_s <= t_s[-1]) & (t_s[after] - t_s[after - 1] <= LONGEST_GAP_S)
    if inside.any():
        found[inside] = Slerp(t_s, Rotation.from_matrix(R_eb[known][first]))(times_s[inside]).as_matrix()
    return found
