"""The matrix itself: renormalisation, and that it knows no singular attitude."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import integrate, propagate, renormalise, rotation_error_rad
from scenarios.claims._open_loop import STEP_S
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.metrics import rms

RATE_DEG_S = 60.0  # the paper's example
SECOND_ORDER = 0.5 * math.radians(RATE_DEG_S * STEP_S) ** 2  # what one step of it neglects, 0.02 %


def _wobble_rad_s(t_s: Array) -> Array:
    """A rate of 60 deg/s about an axis that wanders, shape (n, 3)."""
    axis = np.stack([np.sin(0.7 * t_s), np.cos(1.1 * t_s), np.sin(1.3 * t_s + 1.0)], axis=-1)
    return np.radians(RATE_DEG_S) * axis / np.linalg.norm(axis, axis=1, keepdims=True)


def _crooked(R: Array) -> float:
    """Largest element of ``R R^T - 1``: by how much the rows miss unit length and right angles."""
    return float(np.abs(R @ R.T - np.eye(3)).max())


def _renormalisation(_seeds: Sequence[int]) -> Finding:
    t_s: Array = np.arange(30_000) * np.float64(STEP_S)
    left, kept = np.eye(3), np.eye(3)
    crooked = np.empty((len(t_s), 2))
    for k, omega in enumerate(_wobble_rad_s(t_s)):
        propagate(left, omega, STEP_S)
        propagate(kept, omega, STEP_S)
        renormalise(kept)
        crooked[k] = _crooked(left), _crooked(kept)
    skewed = np.eye(3) + 0.01 * np.array([[0.5, 1.0, -0.3], [0.8, -0.7, 0.2], [-0.4, 0.6, 0.9]])
    before = _crooked(skewed)
    renormalise(skewed)
    minute = round(60.0 / STEP_S) - 1

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "By how much the rows miss unit length and right angles, at 60 deg/s")
        for i, (name, colour) in enumerate((("Eqn 17 alone", FAINT), ("with renormalisation", BLUE))):
            ax.loglog(t_s + STEP_S, crooked[:, i], color=colour, label=name)
        ax.axhline(SECOND_ORDER, color=RED, ls="--", lw=1, label="neglected by one step")
        ax.legend(loc="center right")
        label(ax, "time, s", "largest element of R Rᵀ - 1")

    return Finding(
        stands=(
            line("ten minutes with it", "", crooked[:, 1].max(), "<=", SECOND_ORDER),
            line("one minute without it", "", crooked[minute, 0], ">=", 0.1),
            line("part of 1 % left by one pass", "", _crooked(skewed) / before, "<=", 0.1),
        ),
        told=f"Turning at 60 deg/s about a wandering axis for ten minutes, the rows stay right to "
        f"{crooked[:, 1].max():.1e}, less than what one step neglects; without it they are off by "
        f"{crooked[minute, 0]:.1f} after one minute.",
        seeds=0,
        draw=draw,
    )


def _apportioned(x: Array, y: Array, share: float) -> tuple[Array, Array]:
    """Eqn 19 with `share` of the error given to X and the rest to Y, both then to unit length."""
    error = x @ y
    x, y = x - share * error * y, y - (1.0 - share) * error * x
    return x / np.linalg.norm(x), y / np.linalg.norm(y)


def _half_each(_seeds: Sequence[int]) -> Finding:
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
        for i, share in enumerate((0.5, 1.0)):
            error = R[0] @ R[1]
            one, other = R[0] - share * error * R[1], R[1] - (1.0 - share) * error * R[0]
            residual[k, i] = one @ other
            x, y = _apportioned(R[0], R[1], share)
            z = np.cross(x, y)
            moved[k, i] = math.degrees(rotation_error_rad(np.stack([x, y, z / np.linalg.norm(z)]), true))
    half, whole = (rms(residual[:, i]) for i in (0, 1))
    strayed = [rms(moved[:, i]) / STEP_S for i in (0, 1)]

    def draw(figure: Figure) -> None:
        angles, attitude = axes(figure, "What is left of X · Y", "What it costs in attitude")
        names, colours = ["half each", "all to X"], [BLUE, ORANGE]
        for ax, values, form in ((angles, (half, whole), "{:.1e}"), (attitude, strayed, "{:.3f}")):
            bars = ax.bar(names, values, 0.5, color=colours)
            ax.bar_label(bars, [form.format(value) for value in values], padding=2)
            ax.set_ylim(0.0, 1.2 * max(values))
            ax.set_yticks([])
            ax.grid(visible=False, axis="x")
        label(angles, "", "residual of one step, RMS")
        label(attitude, "", "strayed in a second, deg RMS")

    return Finding(
        stands=(line("residual, half each against all to one", "", half / whole, "<=", 1.0),),
        told=f"After a step of Eqn 17 at 60 deg/s about axes of every direction the residual X · Y is "
        f"{half / whole:.2f} times what it is with all of the error given to one row. The attitude strays by "
        f"{strayed[0]:.3f} deg/s instead of {strayed[1]:.3f}.",
        seeds=0,
        draw=draw,
    )


def _any_orientation(_seeds: Sequence[int]) -> Finding:
    pieces = ((1.0, (0, 0, 0)), (2.0, (0, 45, 0)), (10.0, (36, 0, 0)), (30.0, (1, 90, 2)))
    omega = np.radians(np.concatenate([np.tile(rate, (round(s / STEP_S), 1)) for s, rate in pieces]).astype(float))
    rolling = slice(round(3.0 / STEP_S), round(13.0 / STEP_S))
    swaying = 1.5 * (np.arange(rolling.stop - rolling.start) + 0.5) * STEP_S
    omega[rolling, 1], omega[rolling, 2] = 0.15 * np.sin(swaying), 0.15 * np.cos(1.3 * swaying)
    t_s = (np.arange(len(omega)) + 1) * STEP_S
    R, true = np.eye(3), Rotation.identity()
    roll = pitch = yaw = 0.0
    error, euler_error, steep = (np.empty(len(omega)) for _ in range(3))
    for k, (p, q, r) in enumerate(omega):
        integrate(R, omega[k], STEP_S)
        true = true * Rotation.from_rotvec(omega[k] * STEP_S)
        # Rates of the Euler angles: the tangent and the secant of the pitch are what fails.
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

    def draw(figure: Figure) -> None:
        way, errors = axes(figure, "Up, rolling on the tail, then loops", "Attitude error")
        way.plot(t_s, steep, color=FAINT)
        way.set_yticks([-90, -45, 0, 45, 90])
        label(way, "time, s", "pitch, deg")
        errors.semilogy(t_s, np.maximum(euler_error, 1e-3), color=ORANGE, label="Euler angles, integrated")
        errors.semilogy(t_s, np.maximum(error, 1e-3), color=BLUE, label="matrix")
        errors.legend()
        label(errors, "time, s", "angle, deg")

    vertical, added = np.abs(steep[1:]) > 85.0, np.abs(np.diff(error))
    neglected = math.degrees(0.5 * (math.radians(90.0) * STEP_S) ** 2)
    return Finding(
        stands=(
            line("added by one step within 5 deg of the vertical", "deg", added[vertical].max(), "<=", neglected),
            line("added by one step elsewhere", "deg", added[~vertical].max(), "<=", neglected),
        ),
        told=f"Pulled up to the vertical, rolling and swaying there for ten seconds, then looping: no step adds more "
        f"than what is of second order in its angle, near the vertical {added[vertical].max():.3f} degrees. The matrix "
        f"ends {error[-1]:.1f} degrees off; Euler angles integrated from the same rates were off by up to "
        f"{euler_error.max():.0f}.",
        seeds=0,
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="renormalisation",
        title="Renormalisation keeps the rows at right angles",
        paper=Paper.THEORY,
        place="Renormalization, Eqns 18-21",
        says="Numerical errors slowly spoil lengths and right angles of the rows; one pass of the simplest correction, "
        "every step, stays ahead of them.",
        expected=Verdict.CONFIRMED,
        measure=_renormalisation,
        seeds=0,
    ),
    Claim(
        name="half_each",
        title="Half of the error to each row leaves less",
        paper=Paper.THEORY,
        place="Renormalization, below Eqn 19",
        says="Giving half of the orthogonality error to each of two rows leaves a lower residual than giving all of it "
        "to one of them.",
        expected=Verdict.CONFIRMED,
        measure=_half_each,
        seeds=0,
    ),
    Claim(
        name="any_orientation",
        title="Every attitude is as good as any other",
        paper=Paper.THEORY,
        place="Accelerometers, on direction cosines",
        says="Direction cosines work in any orientation, pointing vertically too, without singularities or special "
        "logic.",
        expected=Verdict.CONFIRMED,
        measure=_any_orientation,
        seeds=0,
    ),
)
