"""Dilshad and Jahan's multi-rotor: its tests on the ground and in hover, and what makes the wave in yaw.

With the sensors that they fitted, all their errors included, ten minutes each time as in section V.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from matplotlib.figure import Figure

from estimator.baselines import GyroOnly
from estimator.dilshad import Dilshad, DilshadParams, paper_angles
from estimator.interface import Array
from estimator.rotation import heading_error_rad
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.motions import (
    DECLINATION_RAD,
    FIELD_E_UT,
    RATES,
    calibration,
    mean_at_rest,
    seen,
    tilt_deg,
)
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.hover import Hover
from sim.motion.prescribed_plant import Rest

BOARD = "dilshad_9dof"
TEN_MINUTES_S = 600.0
SETTLED = RATES.ticks(60.0)
UNDELAYED = {"gps.latency_s": 0.0, "gps.filter_s": 0.0}
NEVER_M_S, ALWAYS_M_S = 1000.0, 0.0  # ground speed from which a course is believed


@lru_cache(maxsize=10)
def hovering(seed: int) -> Log:
    """What the board of `seed` saw of ten minutes of hover."""
    return seen(Hover(), TEN_MINUTES_S, BOARD, seed=seed)


def on_the_ground(seed: int) -> Log:
    """The same at rest."""
    return seen(Rest(), TEN_MINUTES_S, BOARD, seed=seed)


def estimated(log: Log, seed: int, **params: float) -> Array:
    """Attitudes of the calibrated estimator, the gyro offset taken at power-up."""
    of_board = DilshadParams(calibration=calibration(BOARD, seed), declination_rad=DECLINATION_RAD, **params)  # type: ignore[arg-type]
    estimator = Dilshad(of_board)
    estimator.reset(mean_at_rest(BOARD, seed))
    return np.asarray(estimator.replay(log.measured)["R_eb"])


def as_it_comes(log: Log) -> Array:
    """Attitudes where nothing was calibrated; the integral may learn the gyros' whole offset."""
    return np.asarray(Dilshad(DilshadParams(offset_limit_rad_s=math.radians(45.0))).replay(log.measured)["R_eb"])


def heading_off_deg(R_eb: Array, log: Log) -> Array:
    """Heading errors once settled, without jumps at half a turn."""
    return np.degrees(np.unwrap(heading_error_rad(R_eb, log.truth["R_eb"])))[SETTLED:]


def angles_off_deg(R_eb: Array, log: Log) -> Array:
    """Errors of the paper's roll, pitch and yaw once settled, shape (3, n)."""
    return np.degrees(np.array(paper_angles(R_eb)) - np.array(paper_angles(log.truth["R_eb"])))[:, SETTLED:]


def _ground(seeds: Sequence[int]) -> Finding:
    wavering, off, leaning, raw, gyros = [], [], [], [], []
    for seed in seeds:
        log = on_the_ground(seed)
        calibrated, uncalibrated = estimated(log, seed), as_it_comes(log)
        wavering.append(np.std(angles_off_deg(calibrated, log), axis=1))
        off.append(rms(heading_off_deg(calibrated, log)))
        leaning.append(tilt_deg(calibrated, log)[SETTLED:])
        raw.append(rms(_wrapped_deg(heading_off_deg(uncalibrated, log))))
        alone = GyroOnly()
        alone.reset(mean_at_rest(BOARD, seed))
        gyros.append(abs(heading_off_deg(np.asarray(alone.replay(log.measured)["R_eb"]), log)[-1]))
    roll, pitch, yaw = np.sqrt(np.mean(np.square(wavering), axis=0))
    pooled, pooled_raw, pooled_gyros = (rms(np.array(values)) for values in (off, raw, gyros))
    tilt = rms(np.concatenate(leaning))
    first = on_the_ground(seeds[0])

    def draw(figure: Figure) -> None:
        panels = axes(figure, "As it comes", "Calibrated")
        for ax, R in zip(panels, (as_it_comes(first), estimated(first, seeds[0])), strict=True):
            minutes = first.truth["t_s"][::25] / 60.0
            for name, angle, colour in zip(
                ("roll", "pitch", "yaw"), paper_angles(R), (GREEN, ORANGE, BLUE), strict=True
            ):
                ax.plot(minutes, np.degrees(angle)[::25], color=colour, lw=1.5, label=name)
            label(ax, "time, minutes", "angle, deg")
        panels[1].set_ylim(-10.0, 10.0)
        panels[0].legend(frameon=False, ncols=3)

    return Finding(
        stands=(
            line("roll wavers, sd", "deg", roll, "<=", 0.5),
            line("pitch wavers, sd", "deg", pitch, "<=", 0.5),
            line("yaw wavers, sd", "deg", yaw, "<=", 0.5),
            line("roll and pitch together off zero, RMS", "deg", tilt, "<=", 2.0),
            line("yaw off, RMS", "deg", pooled, "<=", 5.0),
            line("yaw off after 10 minutes, gyros alone", "deg", pooled_gyros, ">=", 10.0),
        ),
        told=f"On the ground for 10 minutes roll, pitch and yaw waver by {roll:.2f}, {pitch:.2f} and {yaw:.2f} degrees "
        f"and are off by {tilt:.1f} (roll and pitch together) and {pooled:.1f}; gyros alone would be "
        f"{pooled_gyros:.0f} off. As it comes, neither gyros nor magnetometer calibrated, the yaw is "
        f"{pooled_raw:.0f} degrees off.",
        seeds=len(seeds),
        draw=draw,
    )


def _wrapped_deg(angle_deg: Array) -> Array:
    return (angle_deg + 180.0) % 360.0 - 180.0


def _hover(seeds: Sequence[int]) -> Finding:
    logs = [hovering(seed) for seed in seeds]
    errors = [angles_off_deg(estimated(log, seed), log) for log, seed in zip(logs, seeds, strict=True)]
    roll, pitch, yaw = np.sqrt(np.mean([np.var(error, axis=1) for error in errors], axis=0))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Hovering, errors of the three angles")
        t_s = logs[0].truth["t_s"][SETTLED:]
        shown = t_s < 180.0
        for name, error, colour in zip(("roll", "pitch", "yaw"), errors[0], (GREEN, ORANGE, BLUE), strict=True):
            ax.plot(t_s[shown], error[shown], color=colour, lw=1.5, label=name)
        label(ax, "time, s", "error, deg")
        ax.legend(frameon=False, ncols=3)

    return Finding(
        stands=(
            line("roll wavers, sd", "deg", roll, "<=", 1.0),
            line("pitch wavers, sd", "deg", pitch, "<=", 1.0),
            line("yaw wavers, of the larger of these", "", yaw / max(roll, pitch), ">=", 1.5),
        ),
        told=f"Hovering, roll and pitch waver by {roll:.2f} and {pitch:.2f} degrees, yaw by {yaw:.1f}: "
        f"{yaw / max(roll, pitch):.1f} times as much, in waves.",
        seeds=len(seeds),
        draw=draw,
    )


def without_dip(log: Log) -> Log:
    """The same motion in a field that is horizontal, as near the equator, and without any other error of it."""
    level = np.array([*FIELD_E_UT[:2], 0.0])
    rows = log.measured.copy()
    rows["mag_b_ut"] = np.where(rows["mag_new"][:, None] == 1, np.einsum("nij,i->nj", log.truth["R_eb"], level), 0.0)
    return Log(log.truth, rows, log.flown)


def _perfectly(log: Log) -> Array:
    """Attitudes with sensors that need no calibration, GPS not heard."""
    estimator = Dilshad(DilshadParams(declination_rad=DECLINATION_RAD, min_speed_m_s=NEVER_M_S))
    return np.asarray(estimator.replay(log.measured)["R_eb"])


def _wave(seeds: Sequence[int]) -> Finding:
    waves: Mapping[str, list[Array]] = {"delayed": [], "undelayed": [], "no GPS": []}
    for seed in seeds:
        late, prompt = hovering(seed), seen(Hover(), TEN_MINUTES_S, BOARD, UNDELAYED, seed=seed)
        for name, log, heard in (
            ("delayed", late, ALWAYS_M_S), ("undelayed", prompt, ALWAYS_M_S), ("no GPS", late, NEVER_M_S),
        ):  # fmt: skip
            waves[name].append(heading_off_deg(estimated(log, seed, min_speed_m_s=heard), log))
    delayed, undelayed, none = (rms(np.array([np.std(wave) for wave in of])) for of in waves.values())
    perfect = seen(Hover(), TEN_MINUTES_S)
    dipping = float(np.std(heading_off_deg(_perfectly(perfect), perfect)))
    level = float(np.std(heading_off_deg(_perfectly(without_dip(perfect)), perfect)))

    def draw(figure: Figure) -> None:
        heard, deaf = axes(figure, "Hovering, courses of the GPS believed", "No GPS, two minutes of it")
        minutes = hovering(seeds[0]).truth["t_s"][SETTLED:] / 60.0
        heard.plot(minutes, waves["delayed"][0], color=ORANGE, lw=1.5, label="filtered, 0.2 s late")
        heard.plot(minutes, waves["undelayed"][0], color=BLUE, lw=1.5, label="without any delay")
        heard.legend(frameon=False)
        deaf.plot(minutes[:6000], waves["no GPS"][0][:6000], color=FAINT, lw=1.5)
        label(heard, "time, minutes", "yaw error, deg")
        label(deaf, "time, minutes", "yaw error, deg")

    return Finding(
        stands=(line("wave without the delay, of that with it", "", undelayed / delayed, "<=", 0.8),),
        told=f"Where a hovering craft believes its course, the yaw waves by {delayed:.0f} degrees (sd) with the "
        f"receiver's delay and by {undelayed:.0f} without: what does not travel has no course. Without any GPS it "
        f"waves by {none:.1f}: the accelerometer does not feel the craft lean, which the dip of the field makes a "
        f"heading (perfect sensors: {dipping:.1f}, {level:.2f} in a horizontal field).",
        seeds=len(seeds),
        draw=draw,
    )


def _gps_lost(seeds: Sequence[int]) -> Finding:
    logs = [hovering(seed) for seed in seeds]

    def off(believed_from_m_s: float) -> tuple[float, Array]:
        errors = [
            heading_off_deg(estimated(log, seed, min_speed_m_s=believed_from_m_s), log)
            for log, seed in zip(logs, seeds, strict=True)
        ]
        return rms(_wrapped_deg(np.concatenate(errors))), errors[0]

    believed, gated, lost = off(ALWAYS_M_S), off(3.0), off(NEVER_M_S)
    without = line("yaw off without GPS, RMS", "deg", lost[0], "<=", 5.0)

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Hovering for 10 minutes with a GPS of 5 Hz")
        minutes = logs[0].truth["t_s"][SETTLED:] / 60.0
        ax.plot(minutes, believed[1], color=RED, lw=1.5, label="courses believed at any speed")
        ax.plot(minutes, gated[1], color=BLUE, lw=1.5, label="courses believed from 3 m/s on")
        label(ax, "time, minutes", "yaw error, deg")
        ax.legend(frameon=False)

    return Finding(
        stands=(without, line("yaw off, courses believed at any speed, RMS", "deg", believed[0], "<=", 5.0)),
        told=f"Without GPS the yaw of the hovering craft is {lost[0]:.1f} degrees off. With one whose courses are "
        f"believed at any speed it is {believed[0]:.0f} off, for the noise of a receiver that stands has a course; "
        f"believed from 3 m/s on, {gated[0]:.1f}.",
        seeds=len(seeds),
        draw=draw,
        condition="if courses are believed only from 3 m/s on",
        under=(without, line("yaw off, courses believed from 3 m/s on, RMS", "deg", gated[0], "<=", 5.0)),
    )


CLAIMS = (
    Claim(
        name="dilshad_ground",
        title="Calibrated, the angles stand still on the ground",
        paper=Paper.DILSHAD,
        place="Section V, Figs. 9 and 10",
        says="On the ground, with proper calibration, roll and pitch stay at zero and yaw is static with a very small "
        "value for ten minutes: the drift of the gyros is dealt with.",
        expected=Verdict.CONFIRMED,
        measure=_ground,
    ),
    Claim(
        name="dilshad_hover",
        title="In hover roll and pitch are steadier than yaw",
        paper=Paper.DILSHAD,
        place="Section V, Fig. 11",
        says="In ten minutes of hover roll and pitch hold very little noise and are much more stable than yaw, which "
        "behaves like a wave.",
        expected=Verdict.CONFIRMED,
        measure=_hover,
    ),
    Claim(
        name="dilshad_yaw_wave",
        title="The delay of the GPS makes the wave in yaw",
        paper=Paper.DILSHAD,
        place="Section V, below Fig. 11",
        says="One of the reasons of the wave is the slight delay between the readings of the inertial sensors and the "
        "reference from GPS, which comes every 200 ms.",
        expected=Verdict.REFUTED,
        measure=_wave,
    ),
    Claim(
        name="dilshad_gps_lost",
        title="Noise and loss of GPS do no harm",
        paper=Paper.DILSHAD,
        place="Abstract",
        says="The design is insensitive to noise or loss of GPS signals, its yaw being the magnetometer's.",
        expected=Verdict.WITH_CONDITION,
        measure=_gps_lost,
    ),
)
