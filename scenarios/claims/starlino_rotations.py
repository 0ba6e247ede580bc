"""Small rotations in Starlino's tutorial: their weighted mean, half of the error to each, and the sign of the gyro.

Computed on prescribed motions with perfect sensors, exactly as in the tutorial.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import heading_rad
from estimator.starlino import NED_FROM_NWU, Starlino, StarlinoParams, orthonormalise
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.motions import RATES, seen
from scenarios.harness.claims.picture import BLUE, FAINT, RED, Panel
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.hover import Hover

WEIGHT_G, WEIGHT_A = 20.0, 1.0  # comment 49
STILL = ((0.0, 1.0, 0.0),)


def _turned(north: Array, west: Array, d: Array, share: float = 0.5) -> tuple[Array, Array]:
    """I and J (north and west, seen from the body) rotated by `d`; `share` of their error is applied to I."""
    north, west = north + np.cross(d, north), west + np.cross(d, west)
    error = float(north @ west)
    north, west = north - share * error * west, west - (1.0 - share) * error * north
    return north / np.linalg.norm(north), west / np.linalg.norm(west)


def _weighted_heading(log: Log) -> Array:
    """Heading by the tutorial's weighted mean of a level body that turns about the vertical, rad.

    The accelerometer sees no change of K: its d theta_a is zero, but has its weight.
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


@claim(Paper.STARLINO, "Part 4, weighted mean, and comment 116", expected=Verdict.WITH_CONDITION)
def starlino_blind_axis() -> Finding:
    """What the accelerometer cannot see averages out.

    In the weighted mean the accelerometer is blind to rotation about the vertical, but rotation about that axis alone
    is rare, and the error averages out.
    """
    log = seen(Hover(north=STILL, east=STILL, yaw=((2.0 * math.pi, 0.0125, 0.0),)), 40.0)  # once round and back
    true = np.unwrap(heading_rad(log.truth["R_eb"]))
    printed = _weighted_heading(log)
    by_axis = np.unwrap(heading_rad(Starlino(StarlinoParams(use_magnetometer=False)).replay(log.measured)["R_eb"]))
    once, back, by_axis_once = (
        abs(math.degrees(heading[k] - true[k])) for heading, k in ((printed, 999), (printed, -1), (by_axis, 999))
    )

    panel = Panel("Once round to the right, and back again", "heading, deg", yticks=(0, 90, 180, 270, 360))
    panel.curve(log.truth["t_s"], np.degrees(true), FAINT, "true", lw=4)
    shown = {"averaged about each axis": np.degrees(by_axis), "weighted mean as printed": np.degrees(printed)}
    panel.curves(log.truth["t_s"], shown, (BLUE, RED))
    return Finding(
        lines=[line("heading error after a full turn", "deg", once, "<=", 5.0)],
        condition="with as many turns to the left as to the right",
        conditional_lines=[line("heading error after a turn there and back", "deg", back, "<=", 5.0)],
        summary=f"The accelerometer does not see rotation about the vertical, but has its weight: of 360 degrees "
        f"{once:.0f} are lost, 1 in 21. The way back loses as many, so {back:.1f} are left. With a mean about each "
        f"axis separately, as in the tutorial's note for advanced readers, {by_axis_once:.1f} are lost.",
        panels=[panel],
    )


def left_of(cosine: float) -> float:
    """Cosine between two unit vectors after one correction."""
    north, west = orthonormalise((1.0, 0.0, 0.0), (cosine, math.sqrt(1.0 - cosine * cosine), 0.0))
    return float(np.dot(north, west))


def _off_after_10_s(share: float) -> float:
    """Attitude error after 10 s at 60 deg/s about (1, 1, 1), degrees."""
    rotation_vector = math.radians(60.0) * RATES.dt_s * np.ones(3) / math.sqrt(3.0)
    north, west = np.eye(3)[:2]
    for _ in range(500):
        north, west = _turned(north, west, -rotation_vector, share)
    seen_from_body = Rotation.from_matrix(np.stack([north, west, np.cross(north, west)]))
    true = Rotation.from_rotvec(500 * rotation_vector)
    return math.degrees((seen_from_body * true.inv()).magnitude())


@claim(Paper.STARLINO, "Part 4, Scenario 3")
def starlino_half_each() -> Finding:
    """Each vector should be corrected by half of the error.

    Two vectors are assumed to be equally wrong; moving each by half of the error brings them closer to a right angle,
    although no proof is given.
    """
    cosines = np.geomspace(1e-3, 0.99, 60)
    left = np.array([left_of(float(cosine)) for cosine in cosines])
    near = cosines <= math.cos(math.radians(45.0))
    shares = np.linspace(0.0, 1.0, 11)
    off = np.array([_off_after_10_s(float(share)) for share in shares])

    of_cosine = Panel("Half of e to I, half to J", "cosine after one correction", "cosine e between I and J", log="xy")
    of_cosine.curve(cosines, left, BLUE, "measured")
    of_cosine.curve(cosines, cosines**3 / 4.0, FAINT, "e³/4", "--")
    of_cosine.curve(cosines, cosines, FAINT, "e", ":")
    of_share = Panel("After 10 s at 60 deg/s", "attitude error, deg", "share applied to I", ylim=(0.0, 4.0))
    of_share.curve(shares, off, BLUE, style="o-")
    return Finding(
        lines=[
            line(
                "angles of 45 to 90 deg: largest part of the error left", "", np.max((left / cosines)[near]), "<=", 0.5
            ),
            line("half each: attitude error over the smallest of all shares", "", off[5] / off.min(), "<=", 1.0),
        ],
        summary=f"A cosine of e between two unit vectors becomes e³/4: from 0.1 it falls to 0.00025. Half each is the "
        f"best share: after 10 s at 60 deg/s about a tilted axis the attitude error is {off[5]:.1f} degrees, "
        f"{off[0]:.1f} if one vector takes all. Most of it comes from the third vector, computed from the two.",
        panels=[of_cosine, of_share],
    )


def _gyro_heading(log: Log, sign: float) -> Array:
    """Heading from the gyro alone with that sign, rad."""
    north, west, _ = NED_FROM_NWU
    heading = np.empty(len(log))
    for k, row in enumerate(log.measured):
        north, west = _turned(north, west, sign * row["gyro_b_rad_s"] * row["dt_s"])
        heading[k] = math.atan2(-west[0], north[0])
    return heading


@claim(Paper.STARLINO, "Part 3, last sentence, and Part 4", expected=Verdict.REFUTED)
def starlino_gyro_sign() -> Finding:
    """A gyro measures the rotation of the world about the device.

    A three-axis gyro measures the angular velocity of the world about the device; the zenith turns by its cross product
    with it.
    """
    log = seen(Hover(north=STILL, east=STILL, yaw=((math.radians(60.0), 0.05, 0.0),)), 40.0)
    true = heading_rad(log.truth["R_eb"])
    printed, reversed_ = _gyro_heading(log, 1.0), _gyro_heading(log, -1.0)
    off, right = (rms(np.degrees(heading - true)) for heading in (printed, reversed_))

    panel = Panel("A body that turns by 60° to and fro", "heading, deg", columns=3, ylim=(-75.0, 110.0))
    panel.curve(log.truth["t_s"], np.degrees(true), FAINT, "true", lw=4)
    shown = {"sign of the gyro reversed": np.degrees(reversed_), "as printed": np.degrees(printed)}
    panel.curves(log.truth["t_s"], shown, (BLUE, RED))
    return Finding(
        lines=[line("as printed: heading error", "deg RMS", off, "<=", 1.0)],
        summary=f"As printed the matrix turns backwards: the heading error is {off:.0f} degrees RMS for a body that "
        f"turns by 60 degrees to and fro. A gyro measures the rotation of the device; the world turns the other way. "
        f"With the sign reversed, as in the code of comment 37, the error is {right:.2f} degrees.",
        panels=[panel],
    )
