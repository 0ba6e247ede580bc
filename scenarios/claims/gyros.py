"""Gyros: how fast they drift, what a wrong gain and the end of their range do, and whether dear ones are needed."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.baselines import GyroOnly
from estimator.interface import MEASURED_DTYPE, ImuSample
from estimator.premerlani import Premerlani
from scenarios.claims._open_loop import (
    IMU_HZ,
    attitude_deg,
    begin,
    misread,
    printed,
    sensed,
)
from scenarios.harness.checks import Row
from scenarios.harness.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claim_flights import flights
from scenarios.harness.claim_picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.manoeuvres import loops_end_s
from scenarios.harness.metrics import inclination_error_deg, rms, settled_after_s
from sim.log import Flight
from sim.power_up import mean_sample
from sim.prescribed_plant import HandHeld, Motion, Rest, SteadyTurn, StraightLevel

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


RANGE_DEG_S, PEAK_DEG_S, PULSE_S = 100.0, 160.0, 2.0


def _area_not_seen(_seeds: Sequence[int]) -> Finding:
    t_s = (np.arange(round(PULSE_S * IMU_HZ)) + 0.5) / IMU_HZ
    peaks = np.linspace(60.0, 240.0, 19)  # beyond, half a turn is lost
    rows = np.zeros((len(t_s),), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t_s + 0.5 / IMU_HZ, 1.0 / IMU_HZ
    rows["force_b_m_s2"] = (0.0, 0.0, -9.8)

    def error_deg(peak: float) -> float:
        """Of the gyros alone after a pulse of pitch rate, a half sine that is clipped."""
        rate = np.minimum(peak * np.sin(np.pi * t_s / PULSE_S), RANGE_DEG_S)
        rows["gyro_b_rad_s"][:, 1] = np.radians(rate)
        R_eb = begin(GyroOnly(), np.eye(3)).replay(rows)["R_eb"][-1]
        true_rad = math.radians(2.0 * peak * PULSE_S / np.pi)
        pitched_rad = math.atan2(-R_eb[2, 0], R_eb[0, 0])
        return math.degrees(abs((true_rad - pitched_rad + np.pi) % (2.0 * np.pi) - np.pi))

    def area_deg(peak: float) -> float:
        """Between the half sine and the end of the range, in closed form."""
        if peak <= RANGE_DEG_S:
            return 0.0
        clips = math.asin(RANGE_DEG_S / peak)  # phase at which it begins to clip
        return PULSE_S / np.pi * (2.0 * peak * math.cos(clips) - RANGE_DEG_S * (np.pi - 2.0 * clips))

    measured, areas = (np.array([f(peak) for peak in peaks]) for f in (error_deg, area_deg))
    apart = float(np.abs(measured - areas).max())

    def draw(figure: Figure) -> None:
        pulse, angle = axes(figure, "A pitch rate beyond the range of the gyro", "The angle that is lost is the area")
        fine = np.linspace(0.0, PULSE_S, 200)
        true = PEAK_DEG_S * np.sin(np.pi * fine / PULSE_S)
        pulse.plot(fine, true, color=BLUE, label="true rate")
        pulse.plot(fine, np.minimum(true, RANGE_DEG_S), color=ORANGE, label="what the gyro says")
        pulse.fill_between(fine, np.minimum(true, RANGE_DEG_S), true, color=RED, alpha=0.18, lw=0)
        pulse.annotate(f"{area_deg(PEAK_DEG_S):.0f} deg", (0.84, 120.0), color=RED)
        pulse.legend(loc="lower center")
        label(pulse, "time, s", "pitch rate, deg/s")
        angle.plot(peaks, areas, color=FAINT, ls="--", label="area between the two")
        angle.plot(peaks, measured, "o", ms=4, color=BLUE, label="error of the matrix")
        angle.legend()
        label(angle, "peak of the rate, deg/s", "angle, deg")

    return Finding(
        stands=(line("angle lost against area, apart at most", "deg", apart, "<=", 1.0),),
        told=f"A pulse of two seconds with a peak of {PEAK_DEG_S:.0f} deg/s on a gyro that ends at {RANGE_DEG_S:.0f} "
        f"leaves {error_deg(PEAK_DEG_S):.1f} degrees; the area is {area_deg(PEAK_DEG_S):.1f}. From 60 to 240 deg/s the "
        f"two are never more than {apart:.2f} degrees apart.",
        seeds=0,
        draw=draw,
    )


LOOPED = loops_end_s(3)
ERASED_DEG, IN_ORDER_OF_S = 10.0, 15.0
NO_GATE = {"estimator_params.launch_gate": math.inf}  # the paper has none


def _after_the_loops(flight: Flight) -> Any:
    """Inclination error from the end of the third loop on, for 40 s."""
    looped_s = LOOPED(flight)
    return inclination_error_deg(flight).within(looped_s, looped_s + 40.0)


def _saturation_erased(seeds: Sequence[int]) -> Finding:
    flown = {
        "as printed": flights("gyro_saturation", seeds, NO_GATE),
        "a fifth of the weight": flights("gyro_saturation", seeds, {**NO_GATE, "estimator_params.w_rp": 0.06}),
    }
    errors = {how: [_after_the_loops(flight) for flight in these] for how, these in flown.items()}
    erased = {how: [settled_after_s(series, ERASED_DEG) for series in these] for how, these in errors.items()}
    left = float(np.mean([series.value[: 2 * IMU_HZ].max() for series in errors["as printed"]]))
    mean_s, slowest_s = float(np.mean(erased["as printed"])), float(np.max(erased["as printed"]))
    slack = [t for t in erased["a fifth of the weight"] if math.isfinite(t)]

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Three loops beyond the range of the gyros, and what comes after")
        for how, colour in (("a fifth of the weight", FAINT), ("as printed", BLUE)):
            for i, series in enumerate(errors[how]):
                since = series.t_s - series.t_s[0]
                ax.plot(since, series.value, color=colour, lw=1.3, label=how if i == 0 else None)
        ax.axhline(ERASED_DEG, color=RED, ls="--", lw=1, label="counts as erased")
        ax.legend()
        ax.set_ylim(0.0, None)
        label(ax, "time after the third loop, s", "inclination error, deg")

    return Finding(
        stands=(
            line("error left by the loops, mean", "deg", left, ">=", 2.0 * ERASED_DEG),
            line("below 10 deg for good, mean", "s", mean_s, "<=", IN_ORDER_OF_S),
            line("below 10 deg for good, slowest", "s", slowest_s, "<=", 2.0 * IN_ORDER_OF_S),
        ),
        told=f"Gyros that end at 100 deg/s in loops at 110 deg/s and more leave {left:.0f} degrees. With a weight of "
        f"0.3 they are gone after {mean_s:.0f} s in the mean; with a fifth of it {len(slack)} of {len(seeds)} flights "
        "come below 10 degrees for good within 40 s.",
        seeds=len(seeds),
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
        name="area_not_seen",
        title="A saturated gyro loses the area it did not see",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Saturation",
        says="A gyro beyond its range leaves an angular error equal to the area between the actual rate and the "
        "saturated one.",
        expected=Verdict.CONFIRMED,
        measure=_area_not_seen,
        seeds=0,
    ),
    Claim(
        name="saturation_erased",
        title="Feedback erases what saturation left in about 10 s",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Saturation",
        says="The simplest way with saturation are feedback gains large enough to erase the error in a reasonable "
        "time, of the order of 10 seconds.",
        expected=Verdict.CONFIRMED,
        measure=_saturation_erased,
        seeds=5,
    ),
)
