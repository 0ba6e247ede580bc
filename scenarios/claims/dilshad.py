"""Dilshad and Jahan's multi-rotor: the tests on the ground and in hover, and what causes the waves in yaw.

With the sensors that they used and all their errors, for ten minutes each as in section V.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from estimator.baselines import GyroOnly
from estimator.dilshad import Dilshad, DilshadParams, paper_angles
from estimator.interface import Array
from estimator.rotation import heading_error_rad
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.motions import (
    DECLINATION_RAD,
    FIELD_E_UT,
    RATES,
    calibration,
    mean_at_rest,
    seen,
    tilt_deg,
)
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.hover import Hover
from sim.motion.prescribed_plant import Rest

BOARD = "dilshad_9dof"
TEN_MINUTES_S = 600.0
SETTLED = RATES.ticks(60.0)
UNDELAYED = {"gps.latency_s": 0.0, "gps.filter_s": 0.0}
NEVER_M_S, ALWAYS_M_S = 1000.0, 0.0  # ground speed from which the GPS course is used
ANGLES = ("roll", "pitch", "yaw")


@lru_cache(maxsize=10)
def hovering(seed: int) -> Log:
    """Ten minutes of hover, seen by the board of `seed`."""
    return seen(Hover(), TEN_MINUTES_S, BOARD, seed=seed)


def estimated(log: Log, seed: int, **params: float) -> Array:
    """Attitudes of the calibrated estimator, with the gyro offset measured at power-up."""
    of_board = DilshadParams(calibration=calibration(BOARD, seed), declination_rad=DECLINATION_RAD, **params)  # type: ignore[arg-type]
    estimator = Dilshad(of_board)
    estimator.reset(mean_at_rest(BOARD, seed))
    return np.asarray(estimator.replay(log.measured)["R_eb"])


def uncalibrated(log: Log) -> Array:
    """Attitudes without any calibration; the integral may learn the whole gyro offset."""
    return np.asarray(Dilshad(DilshadParams(offset_limit_rad_s=math.radians(45.0))).replay(log.measured)["R_eb"])


def heading_off_deg(R_eb: Array, log: Log) -> Array:
    """Heading errors after settling, without jumps at 180 degrees."""
    return np.degrees(np.unwrap(heading_error_rad(R_eb, log.truth["R_eb"])))[SETTLED:]


def angles_off_deg(R_eb: Array, log: Log) -> Array:
    """Errors of the paper's roll, pitch and yaw after settling, shape (3, n)."""
    return np.degrees(np.array(paper_angles(R_eb)) - np.array(paper_angles(log.truth["R_eb"])))[:, SETTLED:]


def _wrapped_deg(angle_deg: Array) -> Array:
    return (angle_deg + 180.0) % 360.0 - 180.0


@claim(Paper.DILSHAD, "Section V, Figs. 9 and 10", seeds=10)
def dilshad_ground(seeds: Sequence[int]) -> Finding:
    """With calibration, the angles are constant on the ground.

    On the ground with proper calibration, roll and pitch stay at zero and yaw is constant with a very small value for
    ten minutes: gyro drift is handled.
    """
    spreads, off, leaning, raw, gyros = [], [], [], [], []
    for seed in seeds:
        log = seen(Rest(), TEN_MINUTES_S, BOARD, seed=seed)
        R, R_raw = estimated(log, seed), uncalibrated(log)
        spreads.append(np.std(angles_off_deg(R, log), axis=1))
        off.append(rms(heading_off_deg(R, log)))
        leaning.append(tilt_deg(R, log)[SETTLED:])
        raw.append(rms(_wrapped_deg(heading_off_deg(R_raw, log))))
        alone = GyroOnly()
        alone.reset(mean_at_rest(BOARD, seed))
        gyros.append(abs(heading_off_deg(np.asarray(alone.replay(log.measured)["R_eb"]), log)[-1]))
        if seed == seeds[0]:
            minutes, R_first, R_raw_first = log.truth["t_s"][::25] / 60.0, R, R_raw
    roll, pitch, yaw = np.sqrt(np.mean(np.square(spreads), axis=0))
    pooled, pooled_raw, pooled_gyros = (rms(np.array(values)) for values in (off, raw, gyros))
    tilt = rms(np.concatenate(leaning))

    panels = [
        Panel("Not calibrated", "angle, deg", "time, minutes", columns=3),
        Panel("Calibrated", "angle, deg", "time, minutes", columns=3, ylim=(-10.0, 10.0)),
    ]
    for panel, of in zip(panels, (R_raw_first, R_first), strict=True):
        shown = {name: np.degrees(angle)[::25] for name, angle in zip(ANGLES, paper_angles(of), strict=True)}
        panel.curves(minutes, shown, (GREEN, ORANGE, BLUE), lw=1.5)
    return Finding(
        lines=[
            line("roll, standard deviation", "deg", roll, "<=", 0.5),
            line("pitch, standard deviation", "deg", pitch, "<=", 0.5),
            line("yaw, standard deviation", "deg", yaw, "<=", 0.5),
            line("inclination error, RMS", "deg", tilt, "<=", 2.0),
            line("yaw error, RMS", "deg", pooled, "<=", 5.0),
            line("gyros alone: yaw error after 10 minutes", "deg", pooled_gyros, ">=", 10.0),
        ],
        summary=f"In 10 minutes on the ground, the standard deviations of roll, pitch and yaw are {roll:.2f}, "
        f"{pitch:.2f} and {yaw:.2f} degrees; the inclination error is {tilt:.1f} and the yaw error {pooled:.1f}. With "
        f"gyros alone the yaw error is {pooled_gyros:.0f} degrees, and without any calibration of gyros and "
        f"magnetometer {pooled_raw:.0f}.",
        panels=panels,
    )


@claim(Paper.DILSHAD, "Section V, Fig. 11", seeds=10)
def dilshad_hover(seeds: Sequence[int]) -> Finding:
    """In hover, roll and pitch are more stable than yaw.

    In ten minutes of hover roll and pitch have very little noise and are much more stable than yaw, which looks like a
    wave.
    """
    logs = [hovering(seed) for seed in seeds]
    errors = [angles_off_deg(estimated(log, seed), log) for log, seed in zip(logs, seeds, strict=True)]
    roll, pitch, yaw = np.sqrt(np.mean([np.var(error, axis=1) for error in errors], axis=0))

    panel = Panel("Errors of the three angles in hover", "error, deg", columns=3)
    t_s = logs[0].truth["t_s"][SETTLED:]
    shown = {name: error[t_s < 180.0] for name, error in zip(ANGLES, errors[0], strict=True)}
    panel.curves(t_s[t_s < 180.0], shown, (GREEN, ORANGE, BLUE), lw=1.5)
    return Finding(
        lines=[
            line("roll, standard deviation", "deg", roll, "<=", 1.0),
            line("pitch, standard deviation", "deg", pitch, "<=", 1.0),
            line("yaw, standard deviation over the larger of these", "", yaw / max(roll, pitch), ">=", 1.5),
        ],
        summary=f"In hover the standard deviations of roll and pitch are {roll:.2f} and {pitch:.2f} degrees; yaw "
        f"varies in waves with {yaw:.1f}, {yaw / max(roll, pitch):.1f} times as much.",
        panels=[panel],
    )


def without_dip(log: Log) -> Log:
    """The same motion in a horizontal magnetic field, as near the equator, read without error."""
    level = np.array([*FIELD_E_UT[:2], 0.0])
    rows = log.measured.copy()
    rows["mag_b_ut"] = np.where(rows["mag_new"][:, None] == 1, np.einsum("nij,i->nj", log.truth["R_eb"], level), 0.0)
    return Log(log.truth, rows, log.flown)


def _perfect_sd_deg(log: Log) -> float:
    """Standard deviation of yaw with sensors that need no calibration, and without GPS."""
    estimator = Dilshad(DilshadParams(declination_rad=DECLINATION_RAD, min_speed_m_s=NEVER_M_S))
    return float(np.std(heading_off_deg(np.asarray(estimator.replay(log.measured)["R_eb"]), log)))


@claim(Paper.DILSHAD, "Section V, below Fig. 11", expected=Verdict.REFUTED, seeds=10)
def dilshad_yaw_wave(seeds: Sequence[int]) -> Finding:
    """The GPS delay causes the waves in yaw.

    One of the reasons for the waves is the slight delay between the readings of the inertial sensors and the GPS
    reference, which comes every 200 ms.
    """
    waves: dict[str, list[Array]] = {"delayed": [], "undelayed": [], "no GPS": []}
    for seed in seeds:
        late, prompt = hovering(seed), seen(Hover(), TEN_MINUTES_S, BOARD, UNDELAYED, seed=seed)
        logs = (late, ALWAYS_M_S), (prompt, ALWAYS_M_S), (late, NEVER_M_S)
        for name, (log, used_from) in zip(waves, logs, strict=True):
            waves[name].append(heading_off_deg(estimated(log, seed, min_speed_m_s=used_from), log))
    delayed, undelayed, none = (rms(np.array([np.std(wave) for wave in of])) for of in waves.values())
    perfect = seen(Hover(), TEN_MINUTES_S)
    dipping, level = _perfect_sd_deg(perfect), _perfect_sd_deg(without_dip(perfect))

    minutes = hovering(seeds[0]).truth["t_s"][SETTLED:] / 60.0
    used = Panel("Hover, GPS course used", "yaw error, deg", "time, minutes")
    shown = {"filtered, 0.2 s late": waves["delayed"][0], "without any delay": waves["undelayed"][0]}
    used.curves(minutes, shown, (ORANGE, BLUE), lw=1.5)
    unused = Panel("Two minutes without GPS", "yaw error, deg", "time, minutes")
    unused.curve(minutes[:6000], waves["no GPS"][0][:6000], FAINT, lw=1.5)
    return Finding(
        lines=[line("waves without the delay, over those with it", "", undelayed / delayed, "<=", 0.8)],
        summary=f"If a hovering craft uses its GPS course, the standard deviation of yaw is {delayed:.0f} degrees with "
        f"the delay of the receiver and {undelayed:.0f} without: at rest there is no course. Without GPS it is "
        f"{none:.1f}: in hover the accelerometer does not show the tilt, which the magnetic dip turns into "
        f"a heading error (perfect sensors: {dipping:.1f}, in a horizontal field {level:.2f}).",
        panels=[used, unused],
    )


@claim(Paper.DILSHAD, "Abstract", expected=Verdict.WITH_CONDITION, seeds=10)
def dilshad_gps_lost(seeds: Sequence[int]) -> Finding:
    """Noise and loss of GPS have no effect.

    The design is insensitive to noise or loss of GPS signals, because its yaw comes from the magnetometer.
    """
    logs = [hovering(seed) for seed in seeds]

    def off(used_from_m_s: float) -> tuple[float, Array]:
        errors = [
            heading_off_deg(estimated(log, seed, min_speed_m_s=used_from_m_s), log)
            for log, seed in zip(logs, seeds, strict=True)
        ]
        return rms(_wrapped_deg(np.concatenate(errors))), errors[0]

    (used, used_first), (gated, gated_first), (lost, _) = off(ALWAYS_M_S), off(3.0), off(NEVER_M_S)
    without = line("without GPS: yaw error, RMS", "deg", lost, "<=", 5.0)

    panel = Panel("Hover for 10 minutes with a GPS of 5 Hz", "yaw error, deg", "time, minutes")
    shown = {"course used at any speed": used_first, "course used above 3 m/s": gated_first}
    panel.curves(logs[0].truth["t_s"][SETTLED:] / 60.0, shown, (RED, BLUE), lw=1.5)
    return Finding(
        lines=[without, line("course used at any speed: yaw error, RMS", "deg", used, "<=", 5.0)],
        condition="if the GPS course is used only above 3 m/s",
        conditional_lines=[without, line("course used above 3 m/s: yaw error, RMS", "deg", gated, "<=", 5.0)],
        summary=f"Without GPS the yaw error of the hovering craft is {lost:.1f} degrees. With a GPS course used "
        f"at any speed it is {used:.0f}, because at rest the course is noise; if it is used only above 3 m/s, "
        f"{gated:.1f}.",
        panels=[panel],
    )
