"""Dilshad and Jahan's magnetometer: hard iron from the extremes of turns about each axis, and tilt compensation."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from estimator.blocks.calibration import Calibration, hard_iron_from_extremes
from estimator.dilshad import heading_of_field
from estimator.interface import Array
from estimator.rotation import from_euler, heading_rad
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.motions import DECLINATION_RAD, FIELD_E_UT, seen
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import highest, rms
from sim.motion.hover import Hover
from sim.motion.turn_table import TurnTable
from sim.rows import Row

BOARD = "dilshad_9dof"
MAGNET_UT = (10.0, -6.0, 15.0)
TILT_DEG = 20.0
ALL_ROUND = (0, 90, 180, 270, 360)


def _wrapped_deg(angle_rad: Array) -> Array:
    return np.degrees((angle_rad + math.pi) % (2.0 * math.pi) - math.pi)


@cache
def _level_circle(seed: int) -> tuple[Array, Array]:
    """Headings and magnetometer readings of a level board that is turned to and fro through all headings."""
    still = ((0.0, 1.0, 0.0),)
    log = seen(Hover(0.0, still, still, ((math.pi, 0.025, 0.0),), rotor_rpm=0.0), 40.0, BOARD, seed=seed)
    new = log.measured["mag_new"] == 1
    return heading_rad(log.truth["R_eb"][new]), log.measured["mag_b_ut"][new]


def _read_deg(field_b_ut: Array, true_rad: Array) -> Array:
    """Heading error of a level magnetometer."""
    return _wrapped_deg(np.arctan2(-field_b_ut[:, 1], field_b_ut[:, 0]) + DECLINATION_RAD - true_rad)


def _on_the_table(seed: int, changes: Mapping[str, Any]) -> Array:
    """Magnetometer readings of a board that is turned about each of its axes."""
    table = TurnTable(heading_rad=DECLINATION_RAD)
    rows = seen(table, table.duration_s, BOARD, changes, seed=seed).measured
    return np.asarray(rows["mag_b_ut"][rows["mag_new"] == 1])


def _missed_ut(seed: int) -> float:
    """Largest error of a component of the offset of a magnet, as the part reads it."""
    magnetised, bare = (
        _on_the_table(seed, {"magnetometer.hard_iron_ut": 0.0, "magnetometer.hard_iron_b_ut": magnet})
        for magnet in (MAGNET_UT, (0.0, 0.0, 0.0))
    )
    return highest(np.abs(hard_iron_from_extremes(magnetised) - np.mean(magnetised - bare, axis=0)))


@claim(Paper.DILSHAD, "Section IV, Iron distortion compensation, Eqn 8", seeds=10)
def dilshad_hard_iron(seeds: Sequence[int]) -> Finding:
    """Hard iron is the mean of the extremes.

    After turning in a circle about each of its three axes, a magnetometer's offset is half the sum of the largest and
    the smallest reading; soft iron is removed afterwards.
    """
    errors: dict[str, list[Array]] = {"not calibrated": [], "hard iron removed": [], "soft iron removed too": []}
    flat = []
    for seed in seeds:
        turned = _on_the_table(seed, {})
        both, iron = Calibration.from_turns(turned), hard_iron_from_extremes(turned)
        heading, field = _level_circle(seed)
        flat.append(abs(hard_iron_from_extremes(field)[2] - iron[2]))
        straightened = (field - np.array(both.hard_iron_b_ut)) @ np.array(both.soft_iron).T
        for of, readings in zip(errors.values(), (field, field - iron, straightened), strict=True):
            of.append(_read_deg(readings, heading))
    offset = rms(np.array([_missed_ut(seed) for seed in seeds]))
    raw, hard, soft = (rms(np.array([highest(np.abs(error)) for error in of])) for of in errors.values())

    panel = Panel("A level magnetometer at all headings", "heading error, deg", "heading, deg", xticks=ALL_ROUND)
    heading = _level_circle(seeds[0])[0] % (2.0 * math.pi)
    order = np.argsort(heading)
    shown = {name: of[0][order] for name, of in errors.items()}
    panel.curves(np.degrees(heading)[order], shown, (RED, ORANGE, BLUE), lw=1.5)
    return Finding(
        lines=[
            line("offset error, largest of the three axes", "uT", offset, "<=", 1.0),
            line("largest heading error, soft iron removed too", "deg", soft, "<=", 5.0),
        ],
        summary=f"For a magnet of 10, -6 and 15 uT, the mean of the extremes has an error of {offset:.1f} uT. Over all "
        f"headings, level, the largest heading error falls from {raw:.0f} degrees to {hard:.0f}, and with soft iron "
        f"removed to {soft:.1f}. With level turns only, the offset of the third axis has an error of "
        f"{rms(np.array(flat)):.0f} uT: all three circles are needed.",
        panels=[panel],
    )


def printed_heading_rad(m_b: Array, roll_rad: Array, pitch_rad: Array) -> Array:
    """Eqns 5 to 7 as printed, axes forward, left and up, with the roll and pitch (nose up) of Eqns 10 and 11."""
    x_mag, y_mag, z_mag = m_b[:, 0], -m_b[:, 1], -m_b[:, 2]
    x = x_mag * np.cos(pitch_rad) + z_mag * np.sin(pitch_rad)
    y = (
        x_mag * np.sin(roll_rad) * np.sin(pitch_rad)
        + y_mag * np.cos(roll_rad)
        - z_mag * np.sin(roll_rad) * np.cos(pitch_rad)
    )
    return np.arctan2(y, x)


def tilted(roll_deg: float, pitch_deg: float) -> tuple[Array, Array]:
    """Attitudes with that roll and pitch at all headings, and the magnetic field in body axes."""
    yaw = np.radians(np.arange(0.0, 360.0, 2.0)) + 1e-3
    R_eb = from_euler(math.radians(roll_deg), math.radians(pitch_deg), yaw)
    return R_eb, np.einsum("nij,i->nj", R_eb, FIELD_E_UT)


def _errors_deg(roll_deg: float, pitch_deg: float) -> dict[str, Array]:
    """Heading errors at all headings, by the way of compensation."""
    R_eb, m_b = tilted(roll_deg, pitch_deg)
    nose, square = np.arctan2(R_eb[:, 1, 0], R_eb[:, 0, 0]), np.arctan2(-R_eb[:, 0, 1], R_eb[:, 1, 1])
    roll, pitch = np.full(len(m_b), math.radians(roll_deg)), np.full(len(m_b), math.radians(pitch_deg))
    f_b = np.einsum("nij,i->nj", R_eb, np.array([0.0, 0.0, -1.0]))
    corrected = np.array([heading_of_field(m, f) for m, f in zip(m_b, f_b, strict=True)])
    read = {
        "not compensated": (np.arctan2(-m_b[:, 1], m_b[:, 0]), nose),
        "as printed": (printed_heading_rad(m_b, roll, pitch), nose),
        "corrected": (corrected, square),
    }
    return {way: _wrapped_deg(heading + DECLINATION_RAD - true) for way, (heading, true) in read.items()}


@claim(Paper.DILSHAD, "Section IV, Tilt compensation, Eqns 5 to 7", expected=Verdict.WITH_CONDITION)
def dilshad_tilt_compensation() -> Finding:
    """Tilt can be removed from the magnetometer's heading.

    With roll and pitch from the accelerometer, the third axis compensates for what the other two lose, so that the
    heading of a tilted magnetometer is right.
    """
    cases = {"rolled": (TILT_DEG, 0.0), "pitched": (0.0, TILT_DEG), "both": (TILT_DEG, TILT_DEG)}
    errors = {case: _errors_deg(*angles) for case, angles in cases.items()}
    worst = {(case, way): highest(np.abs(error)) for case, of in errors.items() for way, error in of.items()}
    nose_off = math.degrees(math.asin(math.sin(math.radians(TILT_DEG)) ** 2))

    def lines(way: str) -> list[Row]:
        return [line(f"{c} by 20 deg, {way}: largest heading error", "deg", worst[c, way], "<=", 5.0) for c in cases]

    panels = []
    for case, of in errors.items():
        title = f"{case.capitalize()}, {TILT_DEG:.0f}°"
        panels.append(Panel(title, "heading error, deg", "heading, deg", xticks=ALL_ROUND, ylim=(-180.0, 180.0)))
        panels[-1].curves(np.arange(0.0, 360.0, 2.0), of, (FAINT, RED, GREEN), ".", ms=3)
    return Finding(
        lines=lines("as printed"),
        condition="with pitch positive nose down, roll applied first, and the heading at right angles to the wings",
        conditional_lines=lines("corrected"),
        summary=f"At a tilt of {TILT_DEG:.0f} degrees an uncompensated magnetometer has a heading error of up to "
        f"{worst['rolled', 'not compensated']:.0f} degrees. The printed equations are right when rolled "
        f"({worst['rolled', 'as printed']:.1f}), but wrong by up to {worst['pitched', 'as printed']:.0f} when pitched. "
        "With pitch positive nose down and roll applied first they give exactly the heading at right angles to the "
        f"wings, which differs from that of the nose by up to {nose_off:.0f} degrees.",
        panels=panels,
    )
