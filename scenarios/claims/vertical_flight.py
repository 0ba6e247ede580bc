"""Vertical flight: what is left of the yaw correction, and how soon the heading recovers afterwards."""

import math
from dataclasses import dataclass

import numpy as np

from estimator.interface import Array
from estimator.premerlani import Premerlani
from estimator.rotation import from_euler
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.flights import slowest
from scenarios.harness.claims.motions import attitude_deg, begin, misread, printed, sensed
from scenarios.harness.claims.picture import BLUE, ORANGE, RED, Panel
from scenarios.harness.metrics import Series, settled_after_s
from sim.motion.prescribed_plant import Kinematics


@dataclass(frozen=True, slots=True)
class UpAndOn:
    """North, straight up for a while, and north again; each change of pitch is a quarter of a circle."""

    up_s: float = 60.0
    on_s: float = 90.0
    change_s: float = 10.0
    speed_m_s: float = 12.6

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
        zero = 0.0 * t_s
        along = np.stack([np.cos(pitch), zero, -np.sin(pitch)], axis=-1)
        across = np.stack([-np.sin(pitch), zero, -np.cos(pitch)], axis=-1)
        return Kinematics(
            from_euler(0.0, pitch, zero),
            np.stack([zero, rate, zero], axis=-1),
            np.stack([north, zero, -height], axis=-1),
            V * along,
            (V * rate)[:, None] * across,
        )


CLIMB, END_S = UpAndOn(), 140.0
VERTICAL_S = (CLIMB.up_s + CLIMB.change_s, CLIMB.on_s)
OFFSET_DEG_S = 1.0  # of the roll gyro, not learnt: in vertical flight it turns the matrix about the vertical
LARGE, SMALL = 1.2, 0.1
BACK_DEG, BACK_S = 5.0, 10.0  # "a rapid response": the paper's own time to recover


@claim(Paper.THEORY, "GPS, third reason for a large weight")
def vertical_flight() -> Finding:
    """In vertical flight yaw is not corrected.

    While the aeroplane flies vertically its nose has no horizontal component, and Eqn 23 is zero; a large weight
    restores the heading rapidly afterwards.
    """
    log = sensed(CLIMB, END_S)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = misread(log, offset_rad_s=np.radians([OFFSET_DEG_S, 0.0, 0.0]))
    R_eb = {w: begin(Premerlani(printed(w_y=w, k_i=0.0)), start).replay(rows)["R_eb"] for w in (SMALL, LARGE)}
    error = {w: attitude_deg(R, log) for w, R in R_eb.items()}
    nose = np.hypot(R_eb[LARGE][:, 0, 0], R_eb[LARGE][:, 1, 0])  # Eqn 23 for a course at right angles to the nose
    steep = (t_s > VERTICAL_S[0]) & (t_s <= VERTICAL_S[1])
    first, last = np.flatnonzero(steep)[[0, -1]]
    lasts_s, gained = float(t_s[last] - t_s[first]), float(error[LARGE][last] - error[LARGE][first])
    everywhere = np.ones(len(t_s), bool)
    back = {
        w: settled_after_s(Series(t_s, e, everywhere).within(CLIMB.on_s, END_S), BACK_DEG) for w, e in error.items()
    }

    strength = Panel("Eqn 23, course across the nose", "relative to level flight", xlim=(40.0, END_S), ylim=(0.0, 1.15))
    strength.curve(t_s, nose, BLUE)
    angle = Panel("Attitude error", "deg", legend="upper left", xlim=(40.0, END_S), ylim=(0.0, None))
    angle.curves(t_s, {f"W_Y = {w:g}": e for w, e in error.items()}, (ORANGE, BLUE))
    angle.level(BACK_DEG, RED)
    for panel in (strength, angle):
        panel.shade(*VERTICAL_S, "vertical")
    return Finding(
        lines=[
            line("vertical: correction relative to level flight", "", nose[steep].max(), "<=", 0.1),
            line(
                "vertical: heading drift over that of the roll gyro", "", gained / (OFFSET_DEG_S * lasts_s), ">=", 0.9
            ),
            line(f"W_Y = {LARGE:g}: time to return below 5 deg", "s", back[LARGE], "<=", BACK_S),
            line(f"that time over that with W_Y = {SMALL:g}", "", back[LARGE] / slowest([back[SMALL]]), "<=", 0.5),
        ],
        summary=f"In {lasts_s:.0f} s of vertical flight with a roll gyro offset of {OFFSET_DEG_S:g} deg/s, at most "
        f"{nose[steep].max():.2f} of the yaw correction is left, and the heading drifts by {gained:.0f} degrees, like "
        f"the gyro. From the end of the climb, and with {CLIMB.change_s:.0f} s to level off, the error takes "
        f"{back[LARGE]:.1f} s to fall below 5 degrees with a yaw weight of {LARGE:g}, and {back[SMALL]:.0f} s with "
        f"{SMALL:g}.",
        panels=[strength, angle],
    )
