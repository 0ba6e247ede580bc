"""Magnetometer samples in flight: screened, corrected by the calibration, and used to set the first heading."""

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.calibration import Calibration
from estimator.blocks.kernels import dot
from estimator.blocks.screening import MAG, refuse
from estimator.compiler.jit import inlined, kernel
from estimator.interface import Column

WEAKEST_UT = 1.0  # a weaker reading comes from a sensor that does not work
SHORTEST_HORIZONTAL = 0.02  # sine of the angle between field and vertical below which there is no heading

FIELD = (
    Column("hard_iron_b_ut", (3,), "offset of each axis"),
    Column("soft_iron", (3, 3), "takes the ellipsoid of readings to a sphere"),
    Column("field_range_ut", (), "a reading of an axis beyond this is rejected"),
    Column("field_b_ut", (3,), "the last accepted sample, corrected"),
)
"""Columns of the state of an estimator that calls `take_field`."""


def write_calibration(state: NDArray[Any], calibration: Calibration) -> None:
    """Write a calibration into the columns FIELD of a state record, shape (1,)."""
    for f in fields(calibration):
        state[f.name][0] = getattr(calibration, f.name)


@inlined
def believable(m, limit_ut):  # type: ignore[no-untyped-def]
    """Whether the reading `m`, shape (3,), can be a magnetic field; NaN, infinity, an overflow and zero cannot."""
    within = abs(m[0]) <= limit_ut and abs(m[1]) <= limit_ut and abs(m[2]) <= limit_ut
    return within and m[0] * m[0] + m[1] * m[1] + m[2] * m[2] >= WEAKEST_UT * WEAKEST_UT


@kernel
def take_field(row, s):  # type: ignore[no-untyped-def]
    """Whether a plausible sample arrived in `row`; corrected, it is then in ``s.field_b_ut``."""
    if not row.mag_new:
        return False
    m = row.mag_b_ut
    if not believable(m, s.field_range_ut):
        refuse(s, MAG)
        return False
    x, y, z = m[0] - s.hard_iron_b_ut[0], m[1] - s.hard_iron_b_ut[1], m[2] - s.hard_iron_b_ut[2]
    for i in range(3):
        s.field_b_ut[i] = s.soft_iron[i, 0] * x + s.soft_iron[i, 1] * y + s.soft_iron[i, 2] * z
    return True


@kernel
def turn_to_north(R_eb, m, declination_rad):  # type: ignore[no-untyped-def]
    """Turn the attitude about the vertical until the field `m` points to magnetic north: the initial heading.

    The tilt stays: if it is wrong by the angle a, the heading is wrong by up to about a times the tangent of the dip.

    Parameters
    ----------
    R_eb : shape (3, 3)         written
    m : shape (3,)              field, body axes, any unit
    declination_rad : float     of magnetic from true north, positive east

    Returns
    -------
    bool    False, with nothing changed, if the field is vertical by this attitude and gives no heading
    """
    north, east = dot(R_eb[0], m), dot(R_eb[1], m)
    horizontal = np.hypot(north, east)
    if not horizontal > SHORTEST_HORIZONTAL * np.sqrt(dot(m, m)):
        return False
    by_rad = declination_rad - np.arctan2(east, north)
    c, z = np.cos(by_rad), np.sin(by_rad)
    for j in range(3):
        x, y = R_eb[0, j], R_eb[1, j]
        R_eb[0, j], R_eb[1, j] = c * x - z * y, z * x + c * y
    return True
