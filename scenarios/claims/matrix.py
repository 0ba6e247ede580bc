"""The matrix itself: integration, renormalisation, time step.  Computed open loop, nothing left to chance."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from estimator.rotation import propagate
from scenarios.harness.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claim_picture import BLUE, FAINT, axes, label

STEP_S = 0.02
RATE_DEG_S = 60.0


def _one_step_error(rate_rad_s: float, step_s: float) -> float:
    """Largest element by which one step of Eqn 17 about one axis misses the true rotation."""
    rotation_vector = np.array([0.0, 0.0, rate_rad_s * step_s])
    stepped = np.eye(3)
    propagate(stepped, rotation_vector / step_s, step_s)
    return float(np.abs(stepped - Rotation.from_rotvec(rotation_vector).as_matrix()).max())


def _second_order(_seeds: Sequence[int]) -> Finding:
    measured = _one_step_error(np.radians(RATE_DEG_S), STEP_S)
    rates = np.geomspace(10.0, 400.0, 60)
    errors = [_one_step_error(np.radians(rate), STEP_S) for rate in rates]
    order = float(np.polyfit(np.log(rates), np.log(errors), 1)[0])

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "What one step of 20 ms misses, by rate of turn")
        ax.loglog(rates, np.array(errors) * 100.0, color=BLUE, lw=2)
        ax.axhline(0.02, color=FAINT, ls="--", lw=1)
        ax.annotate("0.02 % as claimed", (11.0, 0.022), color=FAINT)
        ax.plot(RATE_DEG_S, measured * 100.0, "o", color=BLUE)
        label(ax, "rate of turn, deg/s", "largest element missed, %")

    return Finding(
        stands=(
            line("missed by one step at 60 deg/s", "%", measured * 100.0, "<=", 0.025),
            line("order of the error", "", order, ">=", 1.9),
        ),
        told=f"One step of 20 ms at 60 deg/s misses {measured * 100.0:.3f} % of the matrix; it grows with the "
        f"{order:.2f}th power of the angle.",
        seeds=0,
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="second_order",
        title="Eqn 17 is right to the second order",
        paper=Paper.THEORY,
        place="Computing direction cosines from gyro signals, below Eqn 17",
        says="The update of a step neglects what is of second order in the angle: at 60 deg/s and 50 steps a second "
        "that is about 0.02 % of an element.",
        expected=Verdict.CONFIRMED,
        measure=_second_order,
        seeds=0,
    ),
)
