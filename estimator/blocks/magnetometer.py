"""What flight code makes of a magnetometer: its calibration on the turn-table, and its corrected samples in flight.

A turned magnetometer draws an ellipsoid: hard iron moves its centre, soft iron and unequal gains stretch a sphere.
`Calibration.from_turns` finds both from the readings alone, in the order of Dilshad and Jahan: hard iron first.
What it cannot find is a common rotation of the three axes, which leaves a sphere a sphere.

References
----------
N. A. Dilshad and M. K. Jahan, "An Improvement Strategy on Direction Cosine Matrix based Attitude Estimation for
Multi-Rotor Autopilot", Global Journal of Researches in Engineering F 14(8), 2014.
"""

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import MAG, refuse
from estimator.compiler.jit import inlined, kernel
from estimator.interface import Array, Column

FIELD_RANGE_UT = 200.0  # the earth's field is 22 to 67 uT; the rest is room for iron
WEAKEST_UT = 1.0  # a reading of less is that of a sensor that does not work
SHORTEST_HORIZONTAL = 0.02  # sine of the angle between field and vertical below which there is no heading
_LEAST_READINGS = 9  # an ellipsoid about a known centre has six unknowns
_FLATTEST = 0.1  # the least ratio of two axes that is believed to be iron, not a sweep in one plane

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Calibration:
    """What takes a reading to the earth's field: ``soft_iron @ (reading - hard_iron_b_ut)``.

    hard_iron_b_ut : (3,) what every axis reads too much      soft_iron : (3, 3) takes the ellipsoid to a sphere
    """

    hard_iron_b_ut: Triple = (0.0, 0.0, 0.0)
    soft_iron: Matrix = IDENTITY

    def __post_init__(self) -> None:
        for name, shape, unit in (("hard_iron_b_ut", (3,), "uT"), ("soft_iron", (3, 3), "(a fraction)")):
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise ValueError(
                    f"Calibration.{name} = {getattr(self, name)!r} {unit}: choose finite numbers of shape {shape}"
                )

    @classmethod
    def from_turns(cls, field_b_ut: Array) -> "Calibration":
        """Calibration from the readings of a magnetometer that was turned about all its axes, shape (n, 3).

        ValueError where the readings do not tell, see the two functions.
        """
        hard_iron = hard_iron_from_extremes(field_b_ut)
        x, y, z = soft_iron_from_ellipsoid(field_b_ut, hard_iron).tolist()
        return cls(tuple(hard_iron.tolist()), (tuple(x), tuple(y), tuple(z)))


def _readings(field_b_ut: Array, least: int) -> Array:
    readings = np.asarray(field_b_ut, np.float64)
    if readings.ndim != 2 or readings.shape[1] != 3 or len(readings) < least:
        raise ValueError(f"field_b_ut has shape {readings.shape}: give at least {least} rows of 3 axes, microtesla")
    if not np.all(np.isfinite(readings)):
        raise ValueError("field_b_ut holds values that are not finite microtesla: leave those rows out")
    return readings


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
    readings = _readings(field_b_ut, 2)
    return 0.5 * (readings.max(axis=0) + readings.min(axis=0))


def soft_iron_from_ellipsoid(field_b_ut: Array, hard_iron_b_ut: Array) -> Array:
    """The symmetric matrix that takes the ellipsoid of the readings to a sphere of the same volume.

    Least squares for Q in ``(x - h)^T Q (x - h) = 1``, linear in the six elements of the symmetric Q; the matrix is
    then the square root of Q, scaled to determinant 1.  Great circles about three axes are enough of a sweep.

    Parameters
    ----------
    field_b_ut : shape (n, 3)       readings while the magnetometer was turned, microtesla
    hard_iron_b_ut : shape (3,)     the centre h, from `hard_iron_from_extremes`

    Returns
    -------
    shape (3, 3)    multiplies every reading less hard iron

    Raises
    ------
    ValueError      too few rows, or rows that lie on no ellipsoid: turned about one axis only, say
    """
    x, y, z = (_readings(field_b_ut, _LEAST_READINGS) - np.asarray(hard_iron_b_ut, np.float64)).T
    scale = float(np.sqrt(np.mean(x * x + y * y + z * z)))
    if scale > 0.0:  # of unit size, for round-off
        x, y, z = x / scale, y / scale, z / scale
    products = np.stack([x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z], axis=1)
    (xx, yy, zz, xy, xz, yz), _, rank, _ = np.linalg.lstsq(products, np.ones(len(x)), rcond=1e-6)
    squared, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if rank < 6 or not squared[0] > _FLATTEST**2 * squared[2]:
        raise ValueError("field_b_ut lies on no ellipsoid: turn the magnetometer about all three axes")
    stretch = np.sqrt(squared)
    return np.asarray((axes * (stretch / math.prod(stretch) ** (1.0 / 3.0))) @ axes.T)


FIELD = (
    Column("hard_iron_b_ut", (3,), "what every axis reads too much"),
    Column("soft_iron", (3, 3), "takes the ellipsoid of readings to a sphere"),
    Column("field_range_ut", (), "a reading of an axis beyond this is no measurement"),
    Column("field_b_ut", (3,), "the last sample believed, corrected"),
)
"""Columns of the state of an estimator that calls `take_field`."""


def write_calibration(state: NDArray[Any], calibration: Calibration) -> None:
    """Put a calibration into the columns FIELD of a state record, shape (1,)."""
    for f in fields(calibration):
        state[f.name][0] = getattr(calibration, f.name)


@inlined
def believable(m, limit_ut):  # type: ignore[no-untyped-def]
    """Whether the reading `m`, shape (3,), can be a magnetic field; NaN, infinity, an overflow and zero cannot."""
    within = abs(m[0]) <= limit_ut and abs(m[1]) <= limit_ut and abs(m[2]) <= limit_ut
    return within and m[0] * m[0] + m[1] * m[1] + m[2] * m[2] >= WEAKEST_UT * WEAKEST_UT


@kernel
def take_field(row, s):  # type: ignore[no-untyped-def]
    """Whether a sample arrived in `row` that can be believed; corrected, it is then in ``s.field_b_ut``."""
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
    """Turn the attitude about the vertical until the field `m` points to magnetic north: the heading to start with.

    The tilt stays: where it is wrong by the angle a, the heading is wrong by up to about a times the tangent of the
    field's dip.

    Parameters
    ----------
    R_eb : shape (3, 3)         written
    m : shape (3,)              field, body axes, any unit
    declination_rad : float     of magnetic from true north, positive east

    Returns
    -------
    bool    False, with nothing changed, where the field is vertical by this attitude, and tells no heading
    """
    north = R_eb[0, 0] * m[0] + R_eb[0, 1] * m[1] + R_eb[0, 2] * m[2]
    east = R_eb[1, 0] * m[0] + R_eb[1, 1] * m[1] + R_eb[1, 2] * m[2]
    horizontal = np.hypot(north, east)
    if not horizontal > SHORTEST_HORIZONTAL * np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]):
        return False
    by_rad = declination_rad - np.arctan2(east, north)
    c, z = np.cos(by_rad), np.sin(by_rad)
    for j in range(3):
        x, y = R_eb[0, j], R_eb[1, j]
        R_eb[0, j], R_eb[1, j] = c * x - z * y, z * x + c * y
    return True
