"""The direction cosine matrix: renormalisation, and that it has no singular attitude."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import integrate, propagate, renormalise, rotation_error_rad
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.motions import STEP_S
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, Panel
from scenarios.harness.metrics import rms

RATE_DEG_S = 60.0  # the paper's example
SECOND_ORDER = 0.5 * math.radians(RATE_DEG_S * STEP_S) ** 2  # neglected by one step at that rate, 0.02 %


def _wobble_rad_s(t_s: Array) -> Array:
    """A rate of 60 deg/s about a varying axis, shape (n, 3)."""
    axis = np.stack([np.sin(0.7 * t_s), np.cos(1.1 * t_s), np.sin(1.3 * t_s + 1.0)], axis=-1)
    return np.radians(RATE_DEG_S) * axis / np.linalg.norm(axis, axis=1, keepdims=True)


def _orthogonality_error(R: Array) -> float:
    """Largest element of ``R R^T - 1``: the deviation of the rows from unit length and right angles."""
    return float(np.abs(R @ R.T - np.eye(3)).max())


@claim(Paper.THEORY, "Renormalization, Eqns 18-21")
def renormalisation() -> Finding:
    """Renormalisation keeps the rows orthogonal.

    Numerical errors slowly destroy the unit length and the right angles of the rows; one pass of the simplest
    correction in every step is enough to keep them.
    """
    t_s: Array = np.arange(30_000) * np.float64(STEP_S)
    left, kept = np.eye(3), np.eye(3)
    errors = np.empty((len(t_s), 2))
    for k, omega in enumerate(_wobble_rad_s(t_s)):
        propagate(left, omega, STEP_S)
        propagate(kept, omega, STEP_S)
        renormalise(kept)
        errors[k] = _orthogonality_error(left), _orthogonality_error(kept)
    skewed = np.eye(3) + 0.01 * np.array([[0.5, 1.0, -0.3], [0.8, -0.7, 0.2], [-0.4, 0.6, 0.9]])
    before = _orthogonality_error(skewed)
    renormalise(skewed)
    without, largest = errors[round(60.0 / STEP_S) - 1, 0], errors[:, 1].max()

    panel = Panel("Orthogonality error of the rows, turning at 60 deg/s", "largest element of R Rᵀ - 1", log="xy")
    panel.curves(t_s + STEP_S, {"Eqn 17 alone": errors[:, 0], "with renormalisation": errors[:, 1]}, (FAINT, BLUE))
    panel.level(SECOND_ORDER, RED, label="neglected by one step")
    return Finding(
        lines=[
            line("with renormalisation, ten minutes", "", largest, "<=", SECOND_ORDER),
            line("without, one minute", "", without, ">=", 0.1),
            line("one pass: part of an error of 1 % left", "", _orthogonality_error(skewed) / before, "<=", 0.1),
        ],
        summary=f"In ten minutes of turning at 60 deg/s about a varying axis, the orthogonality error stays below "
        f"{largest:.1e}, less than what one step neglects; without renormalisation it is {without:.1f} after one "
        "minute.",
        panels=[panel],
    )


@claim(Paper.THEORY, "Renormalization, below Eqn 19")
def half_each() -> Finding:
    """Correcting both rows by half of the error leaves less error.

    Applying half of the orthogonality error to each of two rows leaves a smaller residual than applying all of it to
    one of them.
    """
    angle = math.radians(RATE_DEG_S * STEP_S)
    n = 400
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n  # axes spread evenly over the sphere, on a spiral
    turn = np.pi * (3.0 - math.sqrt(5.0)) * np.arange(n)
    flat = np.sqrt(1.0 - height**2)
    residual, moved = np.empty((n, 2)), np.empty((n, 2))
    for k, axis in enumerate(np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=-1)):
        R = np.eye(3)
        propagate(R, axis * angle / STEP_S, STEP_S)
        true = Rotation.from_rotvec(axis * angle).as_matrix()
        for i, share in enumerate((0.5, 1.0)):  # of the error, given to X in Eqn 19
            error = R[0] @ R[1]
            x, y = R[0] - share * error * R[1], R[1] - (1.0 - share) * error * R[0]
            residual[k, i] = x @ y
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
            z = np.cross(x, y)
            moved[k, i] = math.degrees(rotation_error_rad(np.stack([x, y, z / np.linalg.norm(z)]), true))
    half, whole = (rms(residual[:, i]) for i in (0, 1))
    drift = [rms(moved[:, i]) / STEP_S for i in (0, 1)]

    angles = Panel("Residual X · Y", "residual of one step, RMS", yticks=(), ylim=(0.0, 1.2 * max(half, whole)))
    attitude = Panel("Attitude drift", "drift in a second, deg RMS", yticks=(), ylim=(0.0, 1.2 * max(drift)))
    for panel, values, form in ((angles, (half, whole), "{:.1e}"), (attitude, drift, "{:.3f}")):
        panel.bars(["half each", "all to X"], {"": (values, [BLUE, ORANGE])}, form)
    return Finding(
        lines=[line("residual with half each, over residual with all to one", "", half / whole, "<=", 1.0)],
        summary=f"After a step of Eqn 17 at 60 deg/s about axes in all directions, the residual X · Y is "
        f"{half / whole:.2f} times that of applying the whole error to one row. The attitude drifts by "
        f"{drift[0]:.3f} deg/s instead of {drift[1]:.3f}.",
        panels=[angles, attitude],
    )


def _up_and_loops_rad_s() -> Array:
    """Rates of pulling up to the vertical, rolling and swaying there for 10 s, then looping, shape (n, 3)."""
    pieces = ((1.0, (0, 0, 0)), (2.0, (0, 45, 0)), (10.0, (36, 0, 0)), (30.0, (1, 90, 2)))
    omega = np.radians(np.concatenate([np.tile(rate, (round(s / STEP_S), 1)) for s, rate in pieces]).astype(float))
    rolling = slice(round(3.0 / STEP_S), round(13.0 / STEP_S))
    swaying = 1.5 * (np.arange(rolling.stop - rolling.start) + 0.5) * STEP_S
    omega[rolling, 1], omega[rolling, 2] = 0.15 * np.sin(swaying), 0.15 * np.cos(1.3 * swaying)
    return np.asarray(omega)


@claim(Paper.THEORY, "Accelerometers, on direction cosines")
def any_orientation() -> Finding:
    """No attitude is singular.

    Direction cosines work in any orientation, also pointing vertically, without singularities or special logic.
    """
    omega = _up_and_loops_rad_s()
    R, true = np.eye(3), Rotation.identity()
    roll = pitch = yaw = 0.0
    error, euler_error, steep = (np.empty(len(omega)) for _ in range(3))
    for k, (p, q, r) in enumerate(omega):
        integrate(R, omega[k], STEP_S)
        true = true * Rotation.from_rotvec(omega[k] * STEP_S)
        # Rates of the Euler angles; tangent and secant of the pitch are singular.
        leaning = q * math.sin(roll) + r * math.cos(roll)
        roll_rate = p + leaning * math.tan(pitch)
        pitch_rate = q * math.cos(roll) - r * math.sin(roll)
        yaw_rate = leaning / math.cos(pitch)
        roll, pitch, yaw = roll + roll_rate * STEP_S, pitch + pitch_rate * STEP_S, yaw + yaw_rate * STEP_S
        truth = true.as_matrix()
        error[k] = math.degrees(rotation_error_rad(R, truth))
        angles = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        euler_error[k] = math.degrees(rotation_error_rad(angles, truth))
        steep[k] = math.degrees(math.asin(np.clip(-truth[2, 0], -1.0, 1.0)))
    vertical, added = np.abs(steep[1:]) > 85.0, np.abs(np.diff(error))
    neglected = math.degrees(0.5 * (math.radians(90.0) * STEP_S) ** 2)

    t_s = (np.arange(len(omega)) + 1) * STEP_S
    way = Panel("Up, rolling on the tail, then loops", "pitch, deg", yticks=(-90, -45, 0, 45, 90))
    way.curve(t_s, steep, FAINT)
    errors = Panel("Attitude error", "angle, deg", log="y")
    shown = {"Euler angles, integrated": np.maximum(euler_error, 1e-3), "matrix": np.maximum(error, 1e-3)}
    errors.curves(t_s, shown, (ORANGE, BLUE))
    return Finding(
        lines=[
            line("error added by one step within 5 deg of the vertical", "deg", added[vertical].max(), "<=", neglected),
            line("error added by one step elsewhere", "deg", added[~vertical].max(), "<=", neglected),
        ],
        summary=f"Pulling up to the vertical, rolling and swaying there for 10 s, then looping: no step adds more "
        f"than its second-order term, near the vertical {added[vertical].max():.3f} degrees. The matrix ends with an "
        f"error of {error[-1]:.1f} degrees; Euler angles integrated from the same rates are wrong by up to "
        f"{euler_error.max():.0f}.",
        panels=[way, errors],
    )
