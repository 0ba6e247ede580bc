"""Attitudes that a file holds as angles, a quaternion or a matrix, and attitudes at other times."""

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

NOT_STARTED = "of a filter that had not started"
NO_ROTATION = "no rotation"
MOST_DEG = 360.0  # a roll or pitch beyond this is no angle in degrees
_SAY_UNIT = 'write the unit into the header or a column map: "roll_deg", "yaw_rad"'
Table = dict[str, Array]


def form_of(table: Mapping[str, Array]) -> tuple[str, ...]:
    """The columns that hold an attitude: of a matrix, a quaternion or three angles; empty where none do."""
    return next((names for names in (MATRIX, QUATERNION, EULER) if all(name in table for name in names)), ())


def attitude(table: Mapping[str, Array]) -> Array | None:
    """The attitude that the columns hold, shape (N, 3, 3), NaN where unknown; None without such columns.

    A filter that has not started reports zeros: level and to the north, all three exactly, is no attitude then.
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
    """Matrices of shape (N, 3, 3), NaN where one is no rotation."""
    known = is_rotation(R_eb)
    return np.where(known[:, None, None], R_eb, np.nan)


def reasons(table: Mapping[str, Array], R_eb: Array) -> tuple[NDArray[np.bool_], list[tuple[NDArray[np.bool_], str]]]:
    """Rows in which the file holds something of an attitude, and why some of them hold none; see `accounts.samples`."""
    values = np.column_stack([table[name] for name in form_of(table)])
    complete = np.asarray(np.isfinite(values).all(axis=1))
    unknown = np.asarray(~np.isfinite(R_eb).all(axis=(1, 2)))
    zeros = np.asarray(complete & (values == 0.0).all(axis=1))
    why: list[tuple[NDArray[np.bool_], str]] = [
        (~complete, accounts.NO_NUMBER), (unknown & zeros, NOT_STARTED), (unknown, NO_ROTATION),
    ]  # fmt: skip
    return np.asarray(np.isfinite(values).any(axis=1)), why


def mend_angles(table: Table, source: checks.Source) -> bool:
    """Convert angles without a given unit from degrees where they exceed what radians can be; whether they did.

    Raises
    ------
    LogError      angles that are neither, or a yaw that may be degrees or radians counted on over whole turns
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
        raise LogError(
            f"{source.path}: yaw up to {largest['yaw']:g} may be degrees, or radians counted on over whole turns; "
            f"{_SAY_UNIT}"
        )
    for name in EULER:
        table[name] = np.radians(table[name])
    return True


def _may_be_turns(yaw: Array) -> bool:
    """Whether a yaw may be radians that were counted on: from within a turn on, and never back by a whole one."""
    yaw = yaw[np.isfinite(yaw)]
    return bool(abs(yaw[0]) <= 6.4 and np.all(np.abs(np.diff(yaw)) < np.pi))


def at_times(t_s: Array, R_eb: Array, times_s: Array) -> Array:
    """Attitude `R_eb` of the times `t_s` at other times, on the shortest way, NaN where it is too far off."""
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
