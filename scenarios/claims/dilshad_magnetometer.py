"""Dilshad and Jahan's magnetometer: hard iron by the extremes of a turn about each axis, and tilt compensation."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.blocks.calibration import Calibration, hard_iron_from_extremes
from estimator.dilshad import heading_of_field
from estimator.interface import Array
from estimator.rotation import from_euler, heading_rad
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.motions import DECLINATION_RAD, FIELD_E_UT, seen
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import highest, rms
from sim.motion.hover import Hover
from sim.motion.turn_table import TurnTable

BOARD = "dilshad_9dof"
MAGNET_UT = (10.0, -6.0, 15.0)
TILT_DEG = 20.0


def _wrapped_deg(angle_rad: Array) -> Array:
    return np.degrees((angle_rad + math.pi) % (2.0 * math.pi) - math.pi)


@cache
def _level_circle(seed: int) -> tuple[Array, Array]:
    """Headings and readings of the magnetometer of a board that is turned level, to and fro, all the way round."""
    still = ((0.0, 1.0, 0.0),)
    log = seen(Hover(0.0, still, still, ((math.pi, 0.025, 0.0),), rotor_rpm=0.0), 40.0, BOARD, seed=seed)
    came = log.measured["mag_new"] == 1
    return heading_rad(log.truth["R_eb"][came]), log.measured["mag_b_ut"][came]


def _read_deg(field_b_ut: Array, true_rad: Array) -> Array:
    """Error of the heading of a level magnetometer."""
    return _wrapped_deg(np.arctan2(-field_b_ut[:, 1], field_b_ut[:, 0]) + DECLINATION_RAD - true_rad)


def _on_the_table(seed: int, changes: Mapping[str, Any]) -> Array:
    """Readings of the magnetometer of a board, turned about each of its axes."""
    table = TurnTable(heading_rad=DECLINATION_RAD)
    rows = seen(table, table.duration_s, BOARD, changes, seed=seed).measured
    return np.asarray(rows["mag_b_ut"][rows["mag_new"] == 1])


def _hard_iron(seeds: Sequence[int]) -> Finding:
    raw, by_extremes, by_both, flat, missed = [], [], [], [], []
    for seed in seeds:
        turned = _on_the_table(seed, {})
        both, iron = Calibration.from_turns(turned), hard_iron_from_extremes(turned)
        heading, field = _level_circle(seed)
        flat.append(abs(hard_iron_from_extremes(field)[2] - iron[2]))
        raw.append(_read_deg(field, heading))
        by_extremes.append(_read_deg(field - iron, heading))
        straightened = (field - np.array(both.hard_iron_b_ut)) @ np.array(both.soft_iron).T
        by_both.append(_read_deg(straightened, heading))
        magnetised, bare = (
            _on_the_table(seed, {"magnetometer.hard_iron_ut": 0.0, "magnetometer.hard_iron_b_ut": magnet})
            for magnet in (MAGNET_UT, (0.0, 0.0, 0.0))
        )
        true = np.mean(magnetised - bare, axis=0)  # the magnet as the part reads it
        missed.append(highest(np.abs(hard_iron_from_extremes(magnetised) - true)))
    offset = rms(np.array(missed))
    worst = [rms(np.array([highest(np.abs(error)) for error in of])) for of in (raw, by_extremes, by_both)]
    heading, _ = _level_circle(seeds[0])

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A level magnetometer, all the way round")
        order = np.argsort(heading % (2.0 * math.pi))
        of_first = (("as it comes", raw, RED), ("hard iron off", by_extremes, ORANGE), ("soft iron too", by_both, BLUE))
        for name, errors, colour in of_first:
            ax.plot(np.degrees(heading % (2.0 * math.pi))[order], errors[0][order], color=colour, lw=1.5, label=name)
        label(ax, "heading, deg", "heading error, deg")
        ax.set_xticks((0, 90, 180, 270, 360))
        ax.legend(frameon=False)

    return Finding(
        stands=(
            line("offset missed, largest of the three axes", "uT", offset, "<=", 1.0),
            line("largest heading error, soft iron taken off after it", "deg", worst[2], "<=", 5.0),
        ),
        told=f"Of a magnet of 10, -6 and 15 uT the mean of the extremes misses {offset:.1f} uT. All the way round, "
        f"level, the largest heading error falls from {worst[0]:.0f} degrees to {worst[1]:.0f}, with soft iron taken "
        f"off after it to {worst[2]:.1f}. Turned level alone, the offset of the third axis is missed by "
        f"{rms(np.array(flat)):.0f} uT: it takes all three circles.",
        seeds=len(seeds),
        draw=draw,
    )


def printed_heading_rad(m_b: Array, roll_rad: Array, pitch_rad: Array) -> Array:
    """Eqns 5 to 7 as printed, axes forward, left and up, of the roll and the pitch (nose up) of Eqns 10 and 11."""
    x_mag, y_mag, z_mag = m_b[:, 0], -m_b[:, 1], -m_b[:, 2]
    x = x_mag * np.cos(pitch_rad) + z_mag * np.sin(pitch_rad)
    y = (
        x_mag * np.sin(roll_rad) * np.sin(pitch_rad)
        + y_mag * np.cos(roll_rad)
        - z_mag * np.sin(roll_rad) * np.cos(pitch_rad)
    )
    return np.arctan2(y, x)


def tilted(roll_deg: float, pitch_deg: float) -> tuple[Array, Array]:
    """Attitudes all the way round with that tilt, and the field that they see."""
    yaw = np.radians(np.arange(0.0, 360.0, 2.0)) + 1e-3
    R_eb = from_euler(math.radians(roll_deg), math.radians(pitch_deg), yaw)
    return R_eb, np.einsum("nij,i->nj", R_eb, FIELD_E_UT)


def _tilt_compensation(_seeds: Sequence[int]) -> Finding:
    cases = {"rolled": (TILT_DEG, 0.0), "pitched": (0.0, TILT_DEG), "both": (TILT_DEG, TILT_DEG)}

    def errors(roll_deg: float, pitch_deg: float) -> dict[str, Array]:
        R_eb, m_b = tilted(roll_deg, pitch_deg)
        nose, square = np.arctan2(R_eb[:, 1, 0], R_eb[:, 0, 0]), np.arctan2(-R_eb[:, 0, 1], R_eb[:, 1, 1])
        roll, pitch = np.full(len(m_b), math.radians(roll_deg)), np.full(len(m_b), math.radians(pitch_deg))
        f_b = np.einsum("nij,i->nj", R_eb, np.array([0.0, 0.0, -1.0]))
        mended = np.array([heading_of_field(m, f) for m, f in zip(m_b, f_b, strict=True)])
        read = {
            "not compensated": (np.arctan2(-m_b[:, 1], m_b[:, 0]), nose),
            "as printed": (printed_heading_rad(m_b, roll, pitch), nose),
            "mended": (mended, square),
        }
        return {name: _wrapped_deg(told + DECLINATION_RAD - true) for name, (told, true) in read.items()}

    found = {case: errors(*angles) for case, angles in cases.items()}
    worst = {(case, way): highest(np.abs(error)) for case, of in found.items() for way, error in of.items()}
    nose_off = math.degrees(math.asin(math.sin(math.radians(TILT_DEG)) ** 2))

    def draw(figure: Figure) -> None:
        panels = axes(figure, *(f"{case.capitalize()}, {TILT_DEG:.0f}°" for case in cases))
        for ax, of in zip(panels, found.values(), strict=True):
            for (way, error), colour in zip(of.items(), (FAINT, RED, GREEN), strict=True):
                ax.plot(np.arange(0.0, 360.0, 2.0), error, ".", color=colour, ms=3, label=way)
            ax.set_ylim(-180.0, 180.0)
            ax.set_xticks((0, 90, 180, 270, 360))
            label(ax, "heading, deg", "heading error, deg")
        panels[0].legend(frameon=False, markerscale=3)

    return Finding(
        stands=tuple(
            line(f"largest heading error, {case} by 20 deg", "deg", worst[case, "as printed"], "<=", 5.0)
            for case in cases
        ),
        told=f"Tilted by {TILT_DEG:.0f} degrees, where a magnetometer is {worst['rolled', 'not compensated']:.0f} "
        f"degrees off uncompensated, the printed equations are right when rolled ({worst['rolled', 'as printed']:.1f}) "
        f"and {worst['pitched', 'as printed']:.0f} off when pitched. With pitch counted nose down and roll taken first "
        f"they are exact, of the heading square to the wings: the nose's is up to {nose_off:.0f} degrees from it.",
        seeds=0,
        draw=draw,
        condition="with pitch counted nose down, roll taken first, and the heading taken square to the wings",
        under=tuple(
            line(f"largest heading error, {case} by 20 deg, mended", "deg", worst[case, "mended"], "<=", 5.0)
            for case in cases
        ),
    )


CLAIMS = (
    Claim(
        name="dilshad_hard_iron",
        title="Hard iron is the mean of the extremes",
        paper=Paper.DILSHAD,
        place="Section IV, Iron distortion compensation, Eqn 8",
        says="Turned in a circle about each of its three axes, a magnetometer's offset is half the sum of the largest "
        "and the smallest reading; soft iron is taken out after it.",
        expected=Verdict.CONFIRMED,
        measure=_hard_iron,
    ),
    Claim(
        name="dilshad_tilt_compensation",
        title="Tilt is taken out of the magnetometer's heading",
        paper=Paper.DILSHAD,
        place="Section IV, Tilt compensation, Eqns 5 to 7",
        says="With roll and pitch from the accelerometer the third axis makes up for what the other two lose, so that "
        "the heading of a tilted magnetometer is right.",
        expected=Verdict.WITH_CONDITION,
        measure=_tilt_compensation,
        seeds=0,
    ),
)
