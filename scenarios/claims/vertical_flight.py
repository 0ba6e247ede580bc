"""Pointing straight up: what is left of the yaw correction meanwhile, and how soon it makes up for it afterwards."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from estimator.interface import Array
from estimator.premerlani import Premerlani
from estimator.rotation import from_euler
from scenarios.claims._flown import slowest
from scenarios.claims._open_loop import attitude_deg, begin, misread, printed, sensed
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.metrics import Series, settled_after_s
from sim.log import Phase
from sim.motion.prescribed_plant import CALM, Kinematics


@dataclass(frozen=True, slots=True)
class UpAndOn:
    """North, straight up for a while, and north again; each change of the pitch is a quarter of a circle."""

    up_s: float = 60.0
    on_s: float = 90.0
    change_s: float = 10.0
    speed_m_s: float = 12.6
    phase: ClassVar[Phase] = Phase.FLYING
    wind_e_m_s: ClassVar[tuple[float, float, float]] = CALM

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`: the nose points along the velocity."""
        V, w = self.speed_m_s, 0.5 * math.pi / self.change_s
        pulled = w * np.clip(t_s - self.up_s, 0.0, self.change_s)
        pushed = w * np.clip(t_s - self.on_s, 0.0, self.change_s)
        pitch = pulled - pushed
        pulls = (t_s > self.up_s) & (t_s < self.up_s + self.change_s)
        pushes = (t_s > self.on_s) & (t_s < self.on_s + self.change_s)
        rate = w * (pulls.astype(float) - pushes)
        level_s = np.minimum(t_s, self.up_s) + np.maximum(t_s - self.on_s - self.change_s, 0.0)
        steep_s = np.clip(t_s - self.up_s - self.change_s, 0.0, self.on_s - self.up_s - self.change_s)
        north = V * (level_s + (np.sin(pulled) + 1.0 - np.cos(pushed)) / w)
        height = 60.0 + V * (steep_s + (1.0 - np.cos(pulled) + np.sin(pushed)) / w)
        nothing = 0.0 * t_s
        along = np.stack([np.cos(pitch), nothing, -np.sin(pitch)], axis=-1)
        across = np.stack([-np.sin(pitch), nothing, -np.cos(pitch)], axis=-1)
        return Kinematics(
            from_euler(0.0, pitch, nothing),
            np.stack([nothing, rate, nothing], axis=-1),
            np.stack([north, nothing, -height], axis=-1),
            V * along,
            (V * rate)[:, None] * across,
        )


CLIMB, END_S = UpAndOn(), 140.0
OFFSET_DEG_S = 1.0  # of the roll gyro, not learnt: straight up it turns the matrix about the vertical
LARGE, SMALL = 1.2, 0.1
BACK_DEG, BACK_S = 5.0, 10.0  # "a rapid response": the paper's own time of recovery


def _vertical(_seeds: Sequence[int]) -> Finding:
    log = sensed(CLIMB, END_S)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = misread(log, offset_rad_s=np.radians([OFFSET_DEG_S, 0.0, 0.0]))
    R_eb = {w: begin(Premerlani(printed(w_y=w, k_i=0.0)), start).replay(rows)["R_eb"] for w in (LARGE, SMALL)}
    error = {w: attitude_deg(R, log) for w, R in R_eb.items()}
    nose = {w: np.hypot(R[:, 0, 0], R[:, 1, 0]) for w, R in R_eb.items()}  # Eqn 23 of a course square to it
    steep = (t_s > CLIMB.up_s + CLIMB.change_s) & (t_s <= CLIMB.on_s)
    first, last = np.flatnonzero(steep)[[0, -1]]
    drift_deg = OFFSET_DEG_S * float(t_s[last] - t_s[first])
    back = {
        w: settled_after_s(Series(t_s, e, np.ones(len(t_s), bool)).within(CLIMB.on_s, END_S), BACK_DEG)
        for w, e in error.items()
    }
    gained = {w: float(e[last] - e[first]) for w, e in error.items()}

    def draw(figure: Figure) -> None:
        strength, angle = axes(figure, "Eqn 23 of a course square to the nose", "Attitude error")
        for ax in (strength, angle):
            ax.axvspan(CLIMB.up_s + CLIMB.change_s, CLIMB.on_s, color=FAINT, alpha=0.15, lw=0)
            ax.set_xlim(40.0, END_S)
            ax.annotate("vertical", (80.0, 0.93), xycoords=("data", "axes fraction"), ha="center", color=FAINT)
        strength.plot(t_s, nose[LARGE], color=BLUE)
        strength.set_ylim(0.0, 1.15)
        label(strength, "time, s", "part of its strength in level flight")
        for w, colour in ((SMALL, ORANGE), (LARGE, BLUE)):
            angle.plot(t_s, error[w], color=colour, label=f"W_Y = {w:g}")
        angle.axhline(BACK_DEG, color=RED, ls="--", lw=1)
        angle.set_ylim(0.0)
        angle.legend(loc="upper left")
        label(angle, "time, s", "deg")

    return Finding(
        stands=(
            line("vertical: the correction, as part of that in level flight", "", nose[LARGE][steep].max(), "<=", 0.1),
            line("vertical: drift over that of the roll gyro", "", gained[LARGE] / drift_deg, ">=", 0.9),
            line(f"from the end of it: below 5 deg, W_Y = {LARGE:g}", "s", back[LARGE], "<=", BACK_S),
            line(f"the same, as part of that of W_Y = {SMALL:g}", "", back[LARGE] / slowest([back[SMALL]]), "<=", 0.5),
        ),
        told=f"Straight up for {t_s[last] - t_s[first]:.0f} s with a roll gyro that is {OFFSET_DEG_S:g} deg/s off, at "
        f"most {nose[LARGE][steep].max():.2f} of the yaw correction is left, and the heading drifts by "
        f"{gained[LARGE]:.0f} degrees, as the gyro does. From the end of the climb, nose down within "
        f"{CLIMB.change_s:.0f} s, it takes {back[LARGE]:.1f} s until the error is below 5 degrees with a yaw weight of "
        f"{LARGE:g}, and {back[SMALL]:.0f} s with {SMALL:g}.",
        seeds=0,
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="vertical_flight",
        title="Pointing straight up nothing corrects yaw",
        paper=Paper.THEORY,
        place="GPS, third reason for a large weight",
        says="While the aeroplane travels vertically its nose has no horizontal part and Eqn 23 yields nothing; a "
        "large weight makes up for it rapidly afterwards.",
        expected=Verdict.CONFIRMED,
        measure=_vertical,
        seeds=0,
    ),
)
