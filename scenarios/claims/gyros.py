"""Gyros and accelerometers: drift, offset, gain, and how sensitive the gyros must be."""

import math
from collections.abc import Sequence

import numpy as np

from estimator.baselines import GyroOnly
from estimator.interface import G_M_S2, ImuSample
from estimator.premerlani import Premerlani
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import flights, rms_of_each
from scenarios.harness.claims.motions import IMU_HZ, aboard, attitude_deg, begin, misread, printed, sensed, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, Panel
from scenarios.harness.metrics import inclination_error_deg, rms
from sim.loop import mean_sample
from sim.motion.prescribed_plant import HandHeld, Motion, Rest, SteadyTurn, StraightLevel
from sim.rows import Row

FEW_DEG = 5.0  # "a few degrees"
MINUTE = round(60.0 * IMU_HZ) - 1  # the tick that ends the first minute
GYROS = {"generic": "generic", "devboard_green": "ADXRS401", "devboard_red": "LISY300AL"}
AUTHORS = ("devboard_green", "devboard_red")  # the authors' own boards
TURN = SteadyTurn(math.radians(30.0))
SWAYING = HandHeld(math.radians(10.0))


def _at_power_up(suite: str, seed: int, motion: Motion = Rest()) -> ImuSample:  # noqa: B008 - it is frozen
    """Mean sample of the sensors of `suite` over two seconds after power-up."""
    return mean_sample(sensed(motion, 2.0, suite, {}, seed).measured)


def _drift_deg(suite: str, motion: Motion, seed: int, calibrated: bool) -> float:
    """Attitude error per axis of the gyros alone, a minute after a known attitude."""
    log = sensed(motion, 60.0, suite, {}, seed)
    start = sensed(motion, 1.0 / IMU_HZ, "ideal", {}).truth["R_eb"][0]
    estimator = begin(GyroOnly(), start, _at_power_up(suite, seed) if calibrated else None)
    return float(attitude_deg(estimator.replay(log.measured)["R_eb"], log)[-1]) / math.sqrt(3.0)


@claim(
    Paper.THEORY,
    "Computing direction cosines from gyro signals, last paragraph",
    expected=Verdict.WITH_CONDITION,
    seeds=10,
)
def drift_per_minute(seeds: Sequence[int]) -> Finding:
    """Gyros alone drift by a few degrees per minute.

    Integration of ordinary gyros without any correction is very accurate: the drift is a few degrees per minute.
    """
    cases: dict[str, tuple[Motion, bool]] = {
        "as delivered": (StraightLevel(), False),
        "offset measured": (StraightLevel(), True),
        "offset measured, circling": (TURN, True),
    }
    drift = {
        (suite, case): rms(np.array([_drift_deg(suite, motion, seed, calibrated) for seed in seeds]))
        for suite in GYROS
        for case, (motion, calibrated) in cases.items()
    }

    def lines(case: str) -> list[Row]:
        return [line(f"{GYROS[s]}, {case}", "deg/min", drift[s, case], "<=", FEW_DEG) for s in AUTHORS]

    panel = Panel("Error after a minute on gyros alone", "deg per axis, RMS", log="y", columns=4, ylim=(0.5, 800.0))
    bars = {GYROS[s]: ([drift[s, c] for c in cases], col) for s, col in zip(GYROS, (FAINT, BLUE, ORANGE), strict=True)}
    panel.bars(list(cases), bars)
    panel.level(FEW_DEG, RED, label="a few degrees")
    raw, worst, circling = (max(drift[s, case] for s in AUTHORS) for case in cases)
    return Finding(
        lines=lines("as delivered"),
        condition="if the offset was measured at power-up, in straight flight",
        conditional_lines=lines("offset measured"),
        summary=f"The authors' gyros drift by {raw:.0f} degrees per axis in a minute as delivered. With the offset "
        f"measured for two seconds at rest it is {worst:.1f}, because they warm up, and in a circle {circling:.0f}, "
        "because of their gain errors.",
        panels=[panel],
    )


@claim(Paper.THEORY, "Gyro characteristics, Offset", seeds=10)
def offset_at_power_up(seeds: Sequence[int]) -> Finding:
    """Most of the gyro offset can be removed at power-up.

    Most of a gyro's offset can be removed by measuring it during power-up, if the gyros are kept motionless.
    """

    def sizes(suite: str, seed: int) -> list[float]:
        """Offset not removed if it is not measured, measured at rest, and measured while swaying, deg/s."""
        true = sensed(Rest(), 2.0, suite, {}, seed).truth["gyro_bias_b_rad_s"][-1]
        found = (np.zeros(3), *(_at_power_up(suite, seed, motion).gyro_b_rad_s for motion in (Rest(), SWAYING)))
        return [float(np.degrees(np.linalg.norm(true - offset))) for offset in found]

    each = np.array([[sizes(suite, seed) for seed in seeds] for suite in GYROS])
    delivered, rested, swayed = np.sqrt(np.mean(np.square(each), axis=1)).T

    panel = Panel("Gyro offset left after averaging for two seconds", "deg/s RMS", columns=3, ylim=(0.0, 9.5))
    bars = {"not measured": (delivered, FAINT), "swaying in a hand": (swayed, ORANGE), "at rest": (rested, BLUE)}
    panel.bars(list(GYROS.values()), bars, "{:.2f}")
    return Finding(
        lines=[
            line(f"{name}: offset left, over the whole offset", "", left / of, "<=", 0.1)
            for name, left, of in zip(GYROS.values(), rested, delivered, strict=True)
        ],
        summary=f"Of {delivered.max():.1f} deg/s, at most {rested.max():.2f} are left after two seconds at rest. In a "
        f"hand that sways at up to 10 deg/s it is {swayed.max():.1f}, because part of the motion is taken for offset.",
        panels=[panel],
    )


@claim(Paper.THEORY, "Gyro characteristics, Gyro sensitivity", seeds=5)
def sensitive_gyros(seeds: Sequence[int]) -> Finding:
    """Gyros need not be sensitive.

    It was once thought that gyros of 15 mV per deg/s were needed; the matrix works well with less sensitive ones.
    """
    boards = {"ADXRS401, 15 mV/(deg/s)": "devboard_green", "LISY300AL, 3.3 mV/(deg/s)": "devboard_red"}
    each = {
        gyro: rms_of_each(flights("turns_180", seeds, {"suite": suite}), inclination_error_deg)
        for gyro, suite in boards.items()
    }
    sensitive, coarse = (rms(values) for values in each.values())

    panel = Panel(
        "Inclination error in turns in wind", "deg RMS", columns=2, ylim=(0.0, 1.25 * np.max([*each.values()]))
    )
    bars = {gyro: (values, colour) for (gyro, values), colour in zip(each.items(), (ORANGE, BLUE), strict=True)}
    panel.bars([f"seed {seed}" for seed in seeds], bars)
    return Finding(
        lines=[line("inclination error, less sensitive over sensitive", "", coarse / sensitive, "<=", 1.2)],
        summary=f"In the same turns and wind the inclination error is {sensitive:.2f} degrees RMS with gyros of "
        f"15 mV/(deg/s) and {coarse:.2f} with gyros of 3.3, whose resolution is almost five times coarser.",
        panels=[panel],
    )


GAIN = 1.1


@claim(Paper.THEORY, "Gyro characteristics, Calibration")
def gain_as_offset() -> Finding:
    """In a turn, a gain error looks like an offset.

    Gyro gains set too high over-rotate the matrix in a continuous turn; the error that begins to accumulate is treated
    as an offset and compensated.
    """
    log = sensed(TURN, 300.0)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = misread(log, (GAIN,) * 3)
    predicted = np.degrees((GAIN - 1.0) * log.truth["imu_omega_b_rad_s"][-1])
    learning, without = (begin(Premerlani(p), start).replay(rows) for p in (printed(), printed(k_i=0.0)))
    alone = begin(GyroOnly(), start).replay(rows)
    learnt = np.degrees(learning["gyro_bias_b_rad_s"])
    error, left, over = (attitude_deg(out["R_eb"], log) for out in (learning, without, alone))
    swept = (GAIN - 1.0) * np.degrees(np.linalg.norm(log.truth["imu_omega_b_rad_s"][:MINUTE].sum(axis=0)) / IMU_HZ)
    expected_over = min(swept % 360.0, 360.0 - swept % 360.0)
    apart = float(np.linalg.norm(learnt[-1] - predicted) / np.linalg.norm(predicted))

    rates = Panel("The integral learns the gain error as an offset", "offset, deg/s", "time in the turn, s")
    for axis, name, colour in ((1, "learnt, y gyro", ORANGE), (2, "learnt, z gyro", BLUE)):
        rates.curve(t_s, learnt[:, axis], colour, name)
        rates.level(predicted[axis], colour)
    rates.note("dashed: 10 % of the true rate", 120.0, 0.65)
    angle = Panel("and the attitude error vanishes", "attitude error, deg", "time in the turn, s")
    angle.curves(t_s, {"without the integral term": left, "with it": error}, (FAINT, BLUE))
    return Finding(
        lines=[
            line("gyros alone: error over 10 % of the turn", "", over[MINUTE] / expected_over, ">=", 0.9),
            line("learnt offset minus 10 % of the rate, relative", "", apart, "<=", 0.1),
            line("attitude error after five minutes", "deg", error[-1], "<=", 1.0),
        ],
        summary=f"In a turn at 30 degrees of bank with gyros that read 10 % too much, the integral learns "
        f"{learnt[-1][1]:.2f} and {learnt[-1][2]:.2f} deg/s about y and z; 10 % of the rate is {predicted[1]:.2f} and "
        f"{predicted[2]:.2f}. The attitude error is {error[-1]:.1f} degrees, without the integral {left[-1]:.1f}. What "
        "was learnt is wrong as soon as the turn ends.",
        panels=[rates, angle],
    )


BIAS_G, GYRO_DEG_S = 0.02, 0.1


@claim(Paper.THEORY, "Accelerometers, on the choice of one")
def accelerometer_offset() -> Finding:
    """Accelerometer offsets do not accumulate.

    Accelerometers are less critical than gyros: they measure orientation directly, so a change of offset causes a
    constant error, while that of a gyro accumulates.
    """
    log = sensed(StraightLevel(), 600.0)
    t_s, start = log.truth["t_s"], log.truth["R_eb"][0]
    rows = log.measured.copy()
    rows["force_b_m_s2"][:, 1] += BIAS_G * G_M_S2
    leaning = tilt_deg(begin(Premerlani(aboard()), start).replay(rows)["R_eb"], log)
    offset = np.radians([GYRO_DEG_S, 0.0, 0.0])
    turning = tilt_deg(begin(GyroOnly(), start).replay(misread(log, offset_rad_s=offset))["R_eb"], log)
    expected = math.degrees(math.asin(BIAS_G))

    panel = Panel("Ten minutes of straight flight with an offset", "inclination error, deg", "time, min")
    errors = {"gyro, 0.1 deg/s, uncorrected": turning, "accelerometer, 0.02 g": leaning}
    panel.curves(t_s / 60.0, errors, (ORANGE, BLUE))
    return Finding(
        lines=[
            line("accelerometer: error after ten minutes over one", "", leaning[-1] / leaning[MINUTE], "<=", 1.1),
            line("accelerometer: error minus asin 0.02", "deg", abs(leaning[-1] - expected), "<=", 0.1),
            line("gyro: error after ten minutes over one", "", turning[-1] / turning[MINUTE], ">=", 9.0),
        ],
        summary=f"An accelerometer offset of 0.02 g causes an inclination error of {leaning[MINUTE]:.2f} degrees after "
        f"a minute and {leaning[-1]:.2f} after ten; an uncorrected gyro offset of 0.1 deg/s one of "
        f"{turning[MINUTE]:.0f} and {turning[-1]:.0f}.",
        panels=[panel],
    )
