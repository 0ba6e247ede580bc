"""What Starlino's tutorial does with small rotations: their weighted mean, half the error to each, the gyro's sign.

Computed open loop with perfect sensors, to the letter of the tutorial; nothing is left to chance.
"""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import heading_rad
from estimator.starlino import NED_FROM_NWU, Starlino, StarlinoParams, orthonormalise
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.motions import (
    RATES,
    seen,
)
from scenarios.harness.claims.picture import BLUE, FAINT, RED, axes, label
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.hover import Hover

WEIGHT_G, WEIGHT_A = 20.0, 1.0  # comment 49
STILL = ((0.0, 1.0, 0.0),)


def _turned(north: Array, west: Array, d: Array, share: float = 0.5) -> tuple[Array, Array]:
    """I and J (north and west, seen from the body) turned by `d`; `share` of their error is borne by I."""
    north, west = north + np.cross(d, north), west + np.cross(d, west)
    error = float(north @ west)
    north, west = north - share * error * west, west - (1.0 - share) * error * north
    return north / np.linalg.norm(north), west / np.linalg.norm(west)


def _weighted_heading(log: Log) -> Array:
    """Heading by the tutorial's weighted mean to the letter over a level body that turns about the vertical, rad.

    The accelerometer sees K stay where it is: its d theta_a is nothing, and weighs all the same.
    """
    north, west, _ = NED_FROM_NWU
    headings = np.empty(len(log))
    for k, row in enumerate(log.measured):
        up = np.cross(north, west)
        f_b = row["force_b_m_s2"]
        of_force = np.cross(up, f_b / np.linalg.norm(f_b) - up)
        of_gyro = -row["gyro_b_rad_s"] * row["dt_s"]
        north, west = _turned(north, west, (WEIGHT_A * of_force + WEIGHT_G * of_gyro) / (WEIGHT_A + WEIGHT_G))
        headings[k] = math.atan2(-west[0], north[0])
    return np.unwrap(headings)


def _blind_axis(_seeds: Sequence[int]) -> Finding:
    there_and_back = Hover(north=STILL, east=STILL, yaw=((2.0 * math.pi, 0.0125, 0.0),))
    log = seen(there_and_back, 40.0)
    true = np.unwrap(heading_rad(log.truth["R_eb"]))
    printed = _weighted_heading(log)
    mended = np.unwrap(heading_rad(Starlino(StarlinoParams(use_magnetometer=False)).replay(log.measured)["R_eb"]))
    once, back, mended_once = (
        abs(math.degrees(told[k] - true[k])) for told, k in ((printed, 999), (printed, -1), (mended, 999))
    )

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Once round to the right, and back again")
        t_s = log.truth["t_s"]
        ax.plot(t_s, np.degrees(true), color=FAINT, lw=4, label="true")
        ax.plot(t_s, np.degrees(mended), color=BLUE, lw=1.5, label="averaged about each axis apart")
        ax.plot(t_s, np.degrees(printed), color=RED, lw=2, label="weighted mean as printed")
        label(ax, "time, s", "turned, deg")
        ax.set_yticks((0, 90, 180, 270, 360))
        ax.legend(frameon=False, loc="lower center")

    return Finding(
        stands=(line("heading missed after a full turn", "deg", once, "<=", 5.0),),
        told=f"The accelerometer sees nothing of a turn about the vertical and weighs all the same: of 360 degrees "
        f"{once:.0f} are lost, 1 in 21. The way back loses as many, and {back:.1f} are left. Averaged about each axis "
        f"apart, as the tutorial's note for advanced readers says, {mended_once:.1f} are lost.",
        seeds=0,
        draw=draw,
        condition="with as many turns to the left as to the right",
        under=(line("heading missed after a turn there and back", "deg", back, "<=", 5.0),),
    )


def _half_each(_seeds: Sequence[int]) -> Finding:
    cosines = np.geomspace(1e-3, 0.99, 60)
    left = np.array([left_of(float(cosine)) for cosine in cosines])
    shares = np.linspace(0.0, 1.0, 11)
    off = np.array([_off_after_10_s(float(share)) for share in shares])

    def draw(figure: Figure) -> None:
        of_cosine, of_share = axes(figure, "Half of e to I, half to J", "After 10 s at 60 deg/s")
        of_cosine.loglog(cosines, left, color=BLUE, lw=2, label="left of it")
        of_cosine.loglog(cosines, cosines**3 / 4.0, "--", color=FAINT, label="e³/4")
        of_cosine.loglog(cosines, cosines, ":", color=FAINT, label="e")
        label(of_cosine, "cosine of the angle between I and J, e", "cosine after one correction")
        of_cosine.legend(frameon=False)
        of_share.plot(shares, off, "o-", color=BLUE, lw=2)
        of_share.set_ylim(0.0, 4.0)
        label(of_share, "share of the error that I bears", "attitude error, deg")

    return Finding(
        stands=(
            line("error left, largest part of it, angles of 45 to 90 deg", "", _worst_part(cosines, left), "<=", 0.5),
            line("attitude error, of the least of all shares", "", off[5] / off.min(), "<=", 1.0),
        ),
        told=f"A cosine of e between two unit vectors becomes e³/4: of 0.1, 0.00025 are left. And half each is the "
        f"best share: over 10 s at 60 deg/s about a slanting axis the attitude is {off[5]:.1f} degrees off, "
        f"{off[0]:.1f} where one vector bears all. Most of it comes from the third, which the other two make.",
        seeds=0,
        draw=draw,
    )


def left_of(cosine: float) -> float:
    """Cosine between two unit vectors after one correction."""
    north, west = orthonormalise((1.0, 0.0, 0.0), (cosine, math.sqrt(1.0 - cosine * cosine), 0.0))
    return float(np.dot(north, west))


def _worst_part(cosines: Array, left: Array) -> float:
    near = cosines <= math.cos(math.radians(45.0))
    return float(np.max(left[near] / cosines[near]))


def _off_after_10_s(share: float) -> float:
    """Attitude error after 10 s at 60 deg/s about (1, 1, 1), degrees."""
    rotation_vector = math.radians(60.0) * RATES.dt_s * np.ones(3) / math.sqrt(3.0)
    north, west = np.eye(3)[:2]
    for _ in range(500):
        north, west = _turned(north, west, -rotation_vector, share)
    seen_from_body = Rotation.from_matrix(np.stack([north, west, np.cross(north, west)]))
    true = Rotation.from_rotvec(500 * rotation_vector)
    return math.degrees((seen_from_body * true.inv()).magnitude())


def _gyro_sign(_seeds: Sequence[int]) -> Finding:
    log = seen(Hover(north=STILL, east=STILL, yaw=((math.radians(60.0), 0.05, 0.0),)), 40.0)
    true = heading_rad(log.truth["R_eb"])

    def heading(sign: float) -> Array:
        north, west, _ = NED_FROM_NWU
        told = np.empty(len(log))
        for k, row in enumerate(log.measured):
            north, west = _turned(north, west, sign * row["gyro_b_rad_s"] * row["dt_s"])
            told[k] = math.atan2(-west[0], north[0])
        return told

    printed, turned_round = heading(1.0), heading(-1.0)
    off, right = (rms(np.degrees(told - true)) for told in (printed, turned_round))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A body that turns by 60° to and fro")
        t_s = log.truth["t_s"]
        ax.plot(t_s, np.degrees(true), color=FAINT, lw=4, label="true")
        ax.plot(t_s, np.degrees(turned_round), color=BLUE, lw=1.5, label="sign of the gyro turned round")
        ax.plot(t_s, np.degrees(printed), color=RED, lw=2, label="as printed")
        label(ax, "time, s", "heading, deg")
        ax.set_ylim(-75.0, 110.0)
        ax.legend(frameon=False, ncols=3, loc="upper center")

    return Finding(
        stands=(line("heading error RMS as printed", "deg", off, "<=", 1.0),),
        told=f"As printed the matrix turns backwards: {off:.0f} degrees off (RMS) where the body turns by 60 to and "
        f"fro. A gyro measures the rate of the device, the world turns the other way; so read, as the code of "
        f"his comment 37 does, {right:.2f} degrees are left.",
        seeds=0,
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="starlino_blind_axis",
        title="What the accelerometer cannot see averages out",
        paper=Paper.STARLINO,
        place="Part 4, weighted mean, and comment 116",
        says="In the weighted mean the accelerometer is blind to a turn about the vertical, but things seldom turn "
        "about that axis alone, and it averages out.",
        expected=Verdict.WITH_CONDITION,
        measure=_blind_axis,
        seeds=0,
    ),
    Claim(
        name="starlino_half_each",
        title="Half of the error to each vector",
        paper=Paper.STARLINO,
        place="Part 4, Scenario 3",
        says="Taking two vectors for equally wrong and moving each by half of the error brings them nearer to a right "
        "angle, though no proof is given.",
        expected=Verdict.CONFIRMED,
        measure=_half_each,
        seeds=0,
    ),
    Claim(
        name="starlino_gyro_sign",
        title="A gyro measures how the world turns about it",
        paper=Paper.STARLINO,
        place="Part 3, last sentence, and Part 4",
        says="A gyro of three axes measures the angular velocity of the world about the device; the zenith turns by "
        "its cross product with it.",
        expected=Verdict.REFUTED,
        measure=_gyro_sign,
        seeds=0,
    ),
)
