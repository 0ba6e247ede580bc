"""Gyros: how fast they drift, what a wrong gain does, whether dear ones are needed; and the offset of the other."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.baselines import GyroOnly
from estimator.interface import G_M_S2, ImuSample
from estimator.premerlani import Premerlani
from scenarios.claims._open_loop import (
    IMU_HZ,
    aboard,
    attitude_deg,
    begin,
    inclination_deg,
    misread,
    printed,
    sensed,
)
from scenarios.harness.checks import Row
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.metrics import inclination_error_deg, rms
from sim.loop import mean_sample
from sim.motion.prescribed_plant import HandHeld, Motion, Rest, SteadyTurn, StraightLevel

FEW_DEG = 5.0  # "a few degrees"
MINUTE_S = 60.0
GYROS = {"generic": "generic", "devboard_green": "ADXRS401", "devboard_red": "LISY300AL"}
AUTHORS = ("devboard_green", "devboard_red")  # what the authors' own boards carry
TURN = SteadyTurn(math.radians(30.0))
SWAYING = HandHeld(math.radians(10.0))
BACKED: dict[str, Any] = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.5}, "zorder": 5}


def _at_power_up(suite: str, seed: int, motion: Motion = Rest()) -> ImuSample:  # noqa: B008 - it is frozen
    """The mean sample of two seconds after power-up, by the sensors of `suite`."""
    return mean_sample(sensed(motion, 2.0, suite, {}, seed).measured)


def _drift_deg(suite: str, motion: Motion, seed: int, calibrated: bool) -> float:
    """Attitude error of the gyros alone, per axis, after a minute from a known attitude on."""
    log = sensed(motion, MINUTE_S, suite, {}, seed)
    start = sensed(motion, 1.0 / IMU_HZ, "ideal", {}).truth["R_eb"][0]
    estimator = begin(GyroOnly(), start, _at_power_up(suite, seed) if calibrated else None)
    return float(attitude_deg(estimator.replay(log.measured)["R_eb"], log)[-1]) / math.sqrt(3.0)


def _drift(seeds: Sequence[int]) -> Finding:
    cases: dict[str, tuple[Motion, bool]] = {
        "as delivered": (StraightLevel(), False),
        "offset measured": (StraightLevel(), True),
        "the same, circling": (TURN, True),
    }
    drift = {
        (suite, case): rms(np.array([_drift_deg(suite, motion, seed, calibrated) for seed in seeds]))
        for suite in GYROS
        for case, (motion, calibrated) in cases.items()
    }

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A minute on gyros alone: attitude error by what was known of the gyros")
        for i, (suite, colour) in enumerate(zip(GYROS, (FAINT, BLUE, ORANGE), strict=True)):
            at = np.arange(len(cases)) + 0.26 * (i - 1)
            heights = [drift[suite, case] for case in cases]
            bars = ax.bar(at, heights, 0.24, color=colour, label=GYROS[suite])
            ax.bar_label(bars, [f"{height:.1f}" for height in heights], padding=2, fontsize=8.5, **BACKED)
        ax.axhline(FEW_DEG, color=RED, lw=1, ls="--", label="a few degrees")
        ax.set_yscale("log")
        ax.set_ylim(0.5, 800.0)
        ax.set_xticks(range(len(cases)), list(cases))
        ax.grid(visible=False, axis="x")
        ax.legend(ncols=4, loc="upper right")
        label(ax, "", "deg per axis after a minute, RMS")

    def lines(case: str) -> tuple[Row, ...]:
        return tuple(line(f"{GYROS[s]}, {case}", "deg/min", drift[s, case], "<=", FEW_DEG) for s in AUTHORS)

    raw, worst, circling = (max(drift[s, case] for s in AUTHORS) for case in cases)
    return Finding(
        stands=lines("as delivered"),
        condition="if the offset was measured at power-up, flying straight",
        under=lines("offset measured"),
        told=f"The authors' own gyros drift by {raw:.0f} degrees per axis in a minute as delivered, by "
        f"{worst:.1f} with the offset measured in two seconds at rest (they warm up), and by {circling:.0f} in a "
        "circle, where errors of gain add up.",
        seeds=len(seeds),
        draw=draw,
    )


def _power_up(seeds: Sequence[int]) -> Finding:
    def sizes(suite: str, seed: int) -> list[float]:
        """Offset before, after rest, and after swaying, deg/s."""
        true = sensed(Rest(), 2.0, suite, {}, seed).truth["gyro_bias_b_rad_s"][-1]
        found = (np.zeros(3), *(_at_power_up(suite, seed, motion).gyro_b_rad_s for motion in (Rest(), SWAYING)))
        return [float(np.degrees(np.linalg.norm(true - offset))) for offset in found]

    each = np.array([[sizes(suite, seed) for seed in seeds] for suite in GYROS])
    delivered, rested, swayed = np.sqrt(np.mean(np.square(each), axis=1)).T

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Gyro offset that is left after two seconds of averaging at power-up")
        cases = {
            "not measured": (delivered, FAINT),
            "in a hand that sways": (swayed, ORANGE),
            "at rest": (rested, BLUE),
        }
        for i, (case, (values, colour)) in enumerate(cases.items()):
            bars = ax.bar(np.arange(len(GYROS)) + 0.26 * (i - 1), values, 0.24, color=colour, label=case)
            ax.bar_label(bars, [f"{value:.2f}" for value in values], padding=2, fontsize=8.5)
        ax.set_xticks(range(len(GYROS)), list(GYROS.values()))
        ax.grid(visible=False, axis="x")
        ax.set_ylim(0.0, 9.5)
        ax.legend(ncols=3, loc="upper left")
        label(ax, "", "offset left, deg/s, RMS")

    return Finding(
        stands=tuple(
            line(f"{name}: part of the offset left", "", left / of, "<=", 0.1)
            for name, left, of in zip(GYROS.values(), rested, delivered, strict=True)
        ),
        told=f"Of {delivered.max():.1f} deg/s at most {rested.max():.2f} are left after two seconds at rest. In a hand "
        f"that sways at up to 10 deg/s it is {swayed.max():.1f}: that much of the sway is taken for offset.",
        seeds=len(seeds),
        draw=draw,
    )


GAIN = 1.1


def _gain(_seeds: Sequence[int]) -> Finding:
    log = sensed(TURN, 300.0)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = misread(log, (GAIN,) * 3)
    predicted = np.degrees((GAIN - 1.0) * log.truth["imu_omega_b_rad_s"][-1])
    learning, without = (begin(Premerlani(p), start).replay(rows) for p in (printed(), printed(k_i=0.0)))
    alone = begin(GyroOnly(), start).replay(rows)
    learnt = np.degrees(learning["gyro_bias_b_rad_s"])
    error, left, over = (attitude_deg(out["R_eb"], log) for out in (learning, without, alone))
    minute = round(MINUTE_S * IMU_HZ) - 1
    turned_deg = np.degrees(np.linalg.norm(log.truth["imu_omega_b_rad_s"][:minute].sum(axis=0)) / IMU_HZ)
    swept = (GAIN - 1.0) * turned_deg
    expected_over = min(swept % 360.0, 360.0 - swept % 360.0)

    def draw(figure: Figure) -> None:
        rates, angle = axes(figure, "The integral takes the gain for an offset", "and the attitude comes back")
        for i, (name, colour) in enumerate((("y", ORANGE), ("z", BLUE))):
            rates.plot(t_s, learnt[:, i + 1], color=colour, label=f"learnt, {name} gyro")
            rates.axhline(predicted[i + 1], color=colour, ls="--", lw=1)
        rates.annotate("dashed: a tenth of the true rate", (120.0, 0.65), color=FAINT)
        rates.legend(loc="lower right")
        label(rates, "time in the turn, s", "offset, deg/s")
        angle.plot(t_s, left, color=FAINT, label="without the integral term")
        angle.plot(t_s, error, color=BLUE, label="with it")
        angle.legend()
        label(angle, "time in the turn, s", "attitude error, deg")

    apart = float(np.linalg.norm(learnt[-1] - predicted) / np.linalg.norm(predicted))
    return Finding(
        stands=(
            line("gyros alone over-rotate, against a tenth of the turn", "", over[minute] / expected_over, ">=", 0.9),
            line("offset learnt against a tenth of the rate, apart", "", apart, "<=", 0.1),
            line("attitude error after five minutes", "deg", error[-1], "<=", 1.0),
        ),
        told=f"Gyros that read a tenth too much in a turn of 30 degrees of bank: the integral learns "
        f"{learnt[-1][1]:.2f} and {learnt[-1][2]:.2f} deg/s about y and z where a tenth of the rate is "
        f"{predicted[1]:.2f} and {predicted[2]:.2f}, and {error[-1]:.1f} degrees of error are left of {left[-1]:.1f} "
        "without it. What was learnt is wrong as soon as the turn ends.",
        seeds=0,
        draw=draw,
    )


def _sensitivity(seeds: Sequence[int]) -> Finding:
    boards = {"ADXRS401, 15 mV/(deg/s)": "devboard_green", "LISY300AL, 3.3 mV/(deg/s)": "devboard_red"}
    flown = {gyro: flights("turns_180", seeds, {"suite": suite}) for gyro, suite in boards.items()}
    series = {gyro: [inclination_error_deg(flight) for flight in these] for gyro, these in flown.items()}
    each = {gyro: np.array([rms(one.judged_values) for one in these]) for gyro, these in series.items()}
    dear, cheap = (rms(values) for values in each.values())

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Turns in wind: inclination error with sensitive and less sensitive gyros")
        for i, ((gyro, values), colour) in enumerate(zip(each.items(), (ORANGE, BLUE), strict=True)):
            bars = ax.bar(np.arange(len(seeds)) + 0.38 * (i - 0.5), values, 0.36, color=colour, label=gyro)
            ax.bar_label(bars, [f"{value:.1f}" for value in values], padding=2, fontsize=8.5)
        ax.set_xticks(range(len(seeds)), [f"seed {seed}" for seed in seeds])
        ax.set_ylim(0.0, 1.25 * max(values.max() for values in each.values()))
        ax.grid(visible=False, axis="x")
        ax.legend(ncols=2)
        label(ax, "", "inclination error, deg RMS")

    return Finding(
        stands=(line("inclination error, less sensitive over sensitive", "", cheap / dear, "<=", 1.2),),
        told=f"The same turns in the same wind: {dear:.2f} degrees RMS with gyros of 15 mV/(deg/s), {cheap:.2f} with "
        "gyros of 3.3, whose counts are almost five times as coarse.",
        seeds=len(seeds),
        draw=draw,
    )


BIAS_G, LONG_S = 0.02, 600.0
GYRO_DEG_S = 0.1


def _no_accumulation(_seeds: Sequence[int]) -> Finding:
    log = sensed(StraightLevel(), LONG_S)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = log.measured.copy()
    rows["force_b_m_s2"][:, 1] += BIAS_G * G_M_S2
    leaning = inclination_deg(begin(Premerlani(aboard()), start).replay(rows)["R_eb"], log)
    offset = np.radians([GYRO_DEG_S, 0.0, 0.0])
    turning = inclination_deg(begin(GyroOnly(), start).replay(misread(log, offset_rad_s=offset))["R_eb"], log)
    minute = round(MINUTE_S * IMU_HZ) - 1
    expected = math.degrees(math.asin(BIAS_G))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "An offset of either, for ten minutes of straight flight")
        ax.plot(t_s / 60.0, turning, color=ORANGE, label="gyro, 0.1 deg/s, uncorrected")
        ax.plot(t_s / 60.0, leaning, color=BLUE, label="accelerometer, 0.02 g")
        ax.legend()
        label(ax, "time, min", "inclination error, deg")

    return Finding(
        stands=(
            line("accelerometer: ten minutes over one", "", leaning[-1] / leaning[minute], "<=", 1.1),
            line("accelerometer: ten minutes, apart from asin 0.02", "deg", abs(leaning[-1] - expected), "<=", 0.1),
            line("gyro: ten minutes over one", "", turning[-1] / turning[minute], ">=", 9.0),
        ),
        told=f"An accelerometer that is off by 0.02 g tilts the estimate by {leaning[minute]:.2f} degrees after a "
        f"minute and by {leaning[-1]:.2f} after ten; an uncorrected gyro offset of 0.1 deg/s by "
        f"{turning[minute]:.0f} and {turning[-1]:.0f}.",
        seeds=0,
        draw=draw,
    )


CHARACTERISTICS = "Gyro characteristics"
CLAIMS = (
    Claim(
        name="drift_per_minute",
        title="Gyros alone drift by a few degrees a minute",
        paper=Paper.THEORY,
        place="Computing direction cosines from gyro signals, last paragraph",
        says="Integrating gyros of modest performance, without any correction, is very accurate: the drift is of the "
        "order of a few degrees per minute.",
        expected=Verdict.WITH_CONDITION,
        measure=_drift,
    ),
    Claim(
        name="offset_at_power_up",
        title="Most of the offset goes at power-up",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Offset",
        says="Most of a gyro's offset can be removed by measuring it during power-up, provided that the gyros are kept "
        "motionless.",
        expected=Verdict.CONFIRMED,
        measure=_power_up,
    ),
    Claim(
        name="sensitive_gyros",
        title="Gyros need not be sensitive",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Gyro sensitivity",
        says="It was once thought that gyros of 15 mV per deg/s were needed; the matrix works well with less sensitive "
        "ones.",
        expected=Verdict.CONFIRMED,
        measure=_sensitivity,
        seeds=5,
    ),
    Claim(
        name="gain_as_offset",
        title="A wrong gain acts as an offset in a turn",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Calibration",
        says="Gains set too high over-rotate the matrix in a continuous turn; the error that begins to accumulate is "
        "treated as an offset and compensated for.",
        expected=Verdict.CONFIRMED,
        measure=_gain,
        seeds=0,
    ),
    Claim(
        name="accelerometer_offset",
        title="Offsets of accelerometers do not add up",
        paper=Paper.THEORY,
        place="Accelerometers, on the choice of one",
        says="Accelerometers are less critical than gyros: they measure orientation itself, so a change of their "
        "offset makes an error that stays as it is, where a gyro's accumulates.",
        expected=Verdict.CONFIRMED,
        measure=_no_accumulation,
        seeds=0,
    ),
)
