"""Calibration of a magnetometer from readings taken while it was turned about all its axes.

The readings lie on an ellipsoid: hard iron moves its centre, soft iron and unequal gains stretch a sphere.
`Calibration.from_turns` finds both from the readings alone, in the order of Dilshad and Jahan: hard iron first.
It cannot find a common rotation of the three axes, because a rotated sphere is the same sphere.

References
----------
N. A. Dilshad and M. K. Jahan, "An Improvement Strategy on Direction Cosine Matrix based Attitude Estimation for
Multi-Rotor Autopilot", Global Journal of Researches in Engineering F 14(8), 2014.
"""

import math
from dataclasses import dataclass

import numpy as np

from estimator.interface import Array

_LEAST_READINGS = 9  # an ellipsoid about a known centre has six unknowns
_FLATTEST = 0.1  # smallest ratio of two axes that is iron rather than a sweep in one plane

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Calibration:
    """Correction from a reading to the earth's field: ``soft_iron @ (reading - hard_iron_b_ut)``.

    hard_iron_b_ut : uT  offset of each axis, shape (3,); an error turns the heading by up to error / horizontal field
        higher: the corrected axis reads less; lower: it reads more
    soft_iron : -  matrix, shape (3, 3), that takes the ellipsoid of readings to a sphere
        higher: an axis counts for more, and the heading is drawn to it; lower: an axis counts for less
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

        Raises ValueError as the two functions below do.
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

    Correct if in the sweep every axis has pointed along the field and against it, or equally near to both.  If an axis
    has missed the two by the angles a and b, the result is wrong by |B| (cos a - cos b) / 2; noise of sigma s adds
    about half of s.

    Parameters
    ----------
    field_b_ut : shape (n, 3)   readings while the magnetometer was turned, microtesla

    Returns
    -------
    shape (3,)      to be subtracted from every reading

    Raises
    ------
    ValueError      not rows of three finite numbers, or fewer than two
    """
    readings = _readings(field_b_ut, 2)
    return 0.5 * (readings.max(axis=0) + readings.min(axis=0))


def soft_iron_from_ellipsoid(field_b_ut: Array, hard_iron_b_ut: Array) -> Array:
    """The symmetric matrix that takes the ellipsoid of the readings to a sphere of the same volume.

    Least squares for Q in ``(x - h)^T Q (x - h) = 1``, linear in the six elements of the symmetric Q; the matrix is
    then the square root of Q, scaled to determinant 1.  Great circles about three axes are a sufficient sweep.

    Parameters
    ----------
    field_b_ut : shape (n, 3)       readings while the magnetometer was turned, microtesla
    hard_iron_b_ut : shape (3,)     the centre h, from `hard_iron_from_extremes`

    Returns
    -------
    shape (3, 3)    multiplies every reading less hard iron

    Raises
    ------
    ValueError      too few rows, or rows that lie on no ellipsoid, as when turned about one axis only
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
