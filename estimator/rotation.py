"""Direction cosine matrices: Eqns 2 and 17-21 of the paper, conversions, and errors between two attitudes.

The kernels that run every tick work in place on one matrix.  The other functions take one matrix ``(3, 3)`` or any
stack of them ``(..., 3, 3)``.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009.
"""

import numpy as np
from numpy.typing import ArrayLike

from estimator.blocks.kernels import cross, dot, plus, put, wrap
from estimator.compiler.jit import inlined, kernel
from estimator.interface import Array

NEAR = 0.02  # within this of a unit length (squared) or of a right angle (cosine), Eqns 19 and 21 are good to 3e-4
LONGEST_STEP_RAD = 0.2  # Eqn 17 holds for small steps
HOPELESS = 1e-6  # rows this short, or this parallel, no longer define an axis


@inlined
def propagate(R_eb, omega_b_rad_s, dt_s):  # type: ignore[no-untyped-def]
    """Rotate the attitude by one gyro sample, in place (Eqn 17).

    Parameters
    ----------
    R_eb : shape (3, 3)         body-to-earth rotation; not renormalised here, see `renormalise`
    omega_b_rad_s : shape (3,)  drift-corrected rate, Eqn 16
    dt_s : float                sample interval, > 0
    """
    x, y, z = omega_b_rad_s[0] * dt_s, omega_b_rad_s[1] * dt_s, omega_b_rad_s[2] * dt_s
    for i in range(3):  # each row r becomes r + r x dtheta (Eqn 15)
        a, b, c = R_eb[i, 0], R_eb[i, 1], R_eb[i, 2]
        R_eb[i, 0] = a + b * z - c * y
        R_eb[i, 1] = b - a * z + c * x
        R_eb[i, 2] = c + a * y - b * x


@inlined
def _to_unit(row):  # type: ignore[no-untyped-def]
    """Factor that gives a row unit length: Eqn 21 near it, else the reciprocal of the length."""
    squared = dot(row, row)
    return 0.5 * (3.0 - squared) if abs(squared - 1.0) < NEAR else 1.0 / np.sqrt(squared)


@inlined
def renormalise(R_eb):  # type: ignore[no-untyped-def]
    """Bring the matrix back to a rotation, in place (Eqns 18-21).

    Eqns 19 and 21 hold for small errors.  A matrix further off than `NEAR` is orthogonalised exactly
    (Gram-Schmidt on the X and Y rows).

    Renormalisation leaves a small error.  Eqn 20 puts the error of Eqn 17 against X and Y into the Z row alone, which
    tilts the matrix: at a rate with a vertical part w_v and a horizontal part w_h (earth axes) by w_v w_h dt / 2 per
    second, in fast aerobatics at 50 Hz about a degree per second.

    Parameters
    ----------
    R_eb : shape (3, 3)   nearly a rotation

    Returns
    -------
    bool    False if the matrix is lost (not finite, or X and Y rows vanishing or parallel); it is then unchanged,
            and the caller restarts from an attitude it trusts
    """
    x, y = (R_eb[0, 0], R_eb[0, 1], R_eb[0, 2]), (R_eb[1, 0], R_eb[1, 1], R_eb[1, 2])
    xx, yy, error = dot(x, x), dot(y, y), dot(x, y)  # Eqn 18
    if not (abs(xx - 1.0) < NEAR and abs(yy - 1.0) < NEAR and abs(error) < NEAR):
        return _orthogonalise(R_eb, xx, yy, error)
    x, y = plus(x, -0.5 * error, y), plus(y, -0.5 * error, x)  # Eqn 19
    z = cross(x, y)  # Eqn 20
    put(R_eb[0], _to_unit(x), x)  # Eqn 21
    put(R_eb[1], _to_unit(y), y)
    put(R_eb[2], _to_unit(z), z)
    return True


@kernel
def _orthogonalise(R_eb, xx, yy, error):  # type: ignore[no-untyped-def]
    """Gram-Schmidt on the X and Y rows, whose dot products are given; returns as `renormalise` does."""
    # NaN fails too; 1 - cosine^2 is the squared sine between the two rows.
    if not (HOPELESS < xx < 1.0 / HOPELESS and HOPELESS < yy < 1.0 / HOPELESS):
        return False
    if not 1.0 - error * error / (xx * yy) > HOPELESS:
        return False
    put(R_eb[0], 1.0 / np.sqrt(xx), R_eb[0])
    y = plus(R_eb[1], -dot(R_eb[0], R_eb[1]), R_eb[0])
    put(R_eb[1], 1.0 / np.sqrt(dot(y, y)), y)
    put(R_eb[2], 1.0, cross(R_eb[0], R_eb[1]))
    return True


@kernel
def renormalise_exactly(R_eb):  # type: ignore[no-untyped-def]
    """Bring the matrix back to a rotation, in place, each row by its exact length; False if lost.

    J. van Zundert et al., "Direction cosine matrix based IMU implementation in Matlab/Simulink", 2013, Eqns 2.4-2.6.
    """
    error = dot(R_eb[0], R_eb[1])
    x, y = plus(R_eb[0], -0.5 * error, R_eb[1]), plus(R_eb[1], -0.5 * error, R_eb[0])  # Eqn 2.4
    rows = (x, y, cross(x, y))  # Eqn 2.5
    for i in range(3):
        length = np.sqrt(dot(rows[i], rows[i]))
        if not 1e-6 < length < 1e6:
            return False
        put(R_eb[i], 1.0 / length, rows[i])  # Eqn 2.6
    return True


@kernel
def level(R_eb):  # type: ignore[no-untyped-def]
    """Set the matrix to level, heading north, in place."""
    for i in range(3):
        for j in range(3):
            R_eb[i, j] = 1.0 if i == j else 0.0


@inlined
def integrate(R_eb, omega_b_rad_s, dt_s):  # type: ignore[no-untyped-def]
    """Propagate and renormalise, in place, in as many steps as Eqn 17 needs (one, up to 0.2 rad per sample).

    The result is always a rotation: a matrix that is lost becomes level, and the function returns False.
    """
    angle_squared = dt_s * dt_s * dot(omega_b_rad_s, omega_b_rad_s)
    if angle_squared > LONGEST_STEP_RAD**2:
        return _integrate_in_parts(R_eb, omega_b_rad_s, dt_s, np.sqrt(angle_squared))
    propagate(R_eb, omega_b_rad_s, dt_s)
    if renormalise(R_eb):
        return True
    level(R_eb)
    return False


@kernel
def _integrate_in_parts(R_eb, omega_b_rad_s, dt_s, angle_rad):  # type: ignore[no-untyped-def]
    parts = 1 + int(min(angle_rad / LONGEST_STEP_RAD, 1000.0))
    for _ in range(parts):
        propagate(R_eb, omega_b_rad_s, dt_s / parts)
        if not renormalise(R_eb):
            level(R_eb)
            return False
    return True


@kernel
def exp(rotation_vector: Array) -> Array:
    """Rotation by the angle ``|rotation_vector|`` [rad] about its direction (Rodrigues), shape (3, 3)."""
    x, y, z = rotation_vector[0], rotation_vector[1], rotation_vector[2]
    squared = x * x + y * y + z * z
    angle = np.sqrt(squared)
    if angle > 1e-4:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / squared
    else:  # the series, where the quotients lose digits
        a, b = 1.0 - squared / 6.0, 0.5 - squared / 24.0
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    R[1, 0], R[1, 1], R[1, 2] = b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x
    R[2, 0], R[2, 1], R[2, 2] = b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)
    return R


@kernel
def log(R: Array) -> Array:
    """Rotation vector of `R`, shape (3,), length 0..pi: the inverse of `exp`, accurate up to half a turn."""
    v = np.empty(3)
    v[0], v[1], v[2] = 0.5 * (R[2, 1] - R[1, 2]), 0.5 * (R[0, 2] - R[2, 0]), 0.5 * (R[1, 0] - R[0, 1])
    sine = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if cosine > -0.5:
        return v * (angle / sine) if sine > 1e-10 else v
    # Near half a turn the sine vanishes: take the axis from the symmetric part, n n^T (1 - cos), its sign from v.
    i = 0
    for j in range(1, 3):
        if R[j, j] > R[i, i]:
            i = j
    n = np.empty(3)
    for j in range(3):
        n[j] = 0.5 * (R[i, j] + R[j, i])
    n[i] -= cosine
    n *= (-1.0 if v[i] < 0.0 else 1.0) / np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    return n * angle


def from_euler(roll_rad: ArrayLike, pitch_rad: ArrayLike, yaw_rad: ArrayLike) -> Array:
    """Body-to-earth rotation of yaw, then pitch, then roll (Eqn 2); broadcasts to shape (..., 3, 3)."""
    roll, pitch, yaw = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (roll_rad, pitch_rad, yaw_rad)))
    sr, cr, sp, cp, sy, cy = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch), np.sin(yaw), np.cos(yaw)
    x = np.stack([cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy], axis=-1)
    y = np.stack([cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy], axis=-1)
    z = np.stack([-sp, sr * cp, cr * cp], axis=-1)
    return np.stack([x, y, z], axis=-2)


def to_euler(R_eb: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch, yaw [rad] of Eqn 2, each of shape (...); for display, not for computation."""
    pitch = np.arctan2(-R_eb[..., 2, 0], np.hypot(R_eb[..., 0, 0], R_eb[..., 1, 0]))
    roll = np.arctan2(R_eb[..., 2, 1], R_eb[..., 2, 2])
    return roll, pitch, heading_rad(R_eb)


def heading_rad(R_eb: Array) -> Array:
    """Direction of the nose over the ground, from north over east, -pi..pi; meaningless near the vertical."""
    return np.asarray(np.arctan2(R_eb[..., 1, 0], R_eb[..., 0, 0]))


def inclination_error_rad(R_estimated_eb: Array, R_true_eb: Array) -> Array:
    """Angle between the two down axes seen from the body (the ``r_z`` rows), 0..pi, shape (...)."""
    z_estimated, z_true = R_estimated_eb[..., 2, :], R_true_eb[..., 2, :]
    sine = np.linalg.norm(np.cross(z_estimated, z_true), axis=-1)
    return np.asarray(np.arctan2(sine, np.sum(z_estimated * z_true, axis=-1)))


def heading_error_rad(R_estimated_eb: Array, R_true_eb: Array) -> Array:
    """Estimated heading minus true heading, wrapped to -pi..pi, shape (...)."""
    return np.asarray(wrap(heading_rad(R_estimated_eb) - heading_rad(R_true_eb)))


def rotation_error_rad(R_estimated_eb: Array, R_true_eb: Array) -> Array:
    """Angle of the rotation between the two attitudes (geodesic on SO(3)), 0..pi, shape (...)."""
    # ||A - B||_F = 2 sqrt(2) sin(angle / 2), and ||A + B||^2 gives the cosine: accurate at all angles.
    apart = np.sum((R_estimated_eb - R_true_eb) ** 2, axis=(-2, -1)) / 8.0
    return np.asarray(2.0 * np.arctan2(np.sqrt(apart), np.sqrt(np.maximum(1.0 - apart, 0.0))))
