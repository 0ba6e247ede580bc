"""Starlino's tutorial: the effect of its weights at rest, in the hand and in turns."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.baselines import GyroOnly
from estimator.blocks.compiled import Compiled
from estimator.interface import Array
from estimator.rotation import heading_error_rad
from estimator.starlino import NED_FROM_NWU, Starlino, StarlinoParams
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import clean_log
from scenarios.harness.claims.motions import (
    DECLINATION_RAD,
    RATES,
    calibration,
    felt_at_rest,
    mean_at_rest,
    seen,
    tilt_deg,
)
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import highest, rms
from sim.motion.prescribed_plant import FreeFall, HandHeld, Motion, Rest, SteadyTurn, StraightLevel

S_G, S_A = 20.0, 1.0  # comment 49
BOARD = "dilshad_9dof"


def set_attitude(estimator: Starlino, R_eb: Array) -> Starlino:
    """The estimator with the attitude `R_eb`."""
    state = estimator.snapshot()
    state["R_eb"], state["dcm"] = R_eb, NED_FROM_NWU @ R_eb
    estimator.restore(state)
    return estimator


def six_axes(s_g: float = S_G, band: float = 0.2) -> Starlino:
    """Without a magnetometer."""
    return Starlino(StarlinoParams(s_g=s_g, s_a=S_A, band=band, use_magnetometer=False))


def _unsteady(axis: Array) -> float:
    """Noise of a direction, rad, shape (n, 3): standard deviation of its horizontal components."""
    return float(np.sqrt(np.mean(np.var(axis[:, :2], axis=0))))


def _noise_left(seed: int, weights: Sequence[float]) -> Array:
    """Noise of the estimated direction of down at rest, over that of the accelerometer, for each gyro weight."""
    log, start = seen(Rest(), 60.0, "generic", seed=seed), mean_at_rest("generic", seed)
    f = log.measured["force_b_m_s2"][500:]
    left = []
    for s_g in weights:
        estimator = six_axes(float(s_g))
        estimator.reset(start)
        left.append(_unsteady(estimator.replay(log.measured)["R_eb"][500:, 2]))
    return np.array(left) / _unsteady(-f / np.linalg.norm(f, axis=1)[:, None])


@claim(Paper.STARLINO, "Part 4, and comment 49", seeds=10)
def starlino_weights(seeds: Sequence[int]) -> Finding:
    """Weights of 1 and 20 are good.

    The weights are chosen for the desired response and the acceptable noise; 1 for the accelerometer and 20 for the
    gyro give good results in most cases.
    """
    ten_s = seen(Rest(), 10.0)
    tilted = np.asarray(Rotation.from_rotvec([0.0, math.radians(10.0), 0.0]).as_matrix())
    falling = {
        s_g: tilt_deg(set_attitude(six_axes(s_g), tilted).replay(ten_s.measured)["R_eb"], ten_s)
        for s_g in (5.0, S_G, 80.0)
    }
    samples = int(np.flatnonzero(falling[S_G] < 10.0 / math.e)[0]) + 1
    weights = np.geomspace(2.0, 320.0, 12)
    noise = [_noise_left(seed, (*weights, S_G)) for seed in seeds]
    percent = 100.0 * np.sqrt(np.mean(np.square(noise), axis=0))

    response = Panel("Response to an inclination error of 10°", "inclination error, deg")
    shown = {f"gyro weight {s_g:.0f} times the accelerometer's": tilt for s_g, tilt in falling.items()}
    response.curves(ten_s.truth["t_s"], shown, (ORANGE, BLUE, GREEN))
    quiet = Panel("Accelerometer noise left", "%", "gyro weight", log="xy", xticks=(2, 20, 200), yticks=(5, 10, 20, 40))
    w = S_A / (weights + S_A)
    quiet.curve(weights, 100.0 * np.sqrt(w / (2.0 - w)), FAINT, "closed form, white noise", "--")
    quiet.curve(weights, percent[:-1], BLUE, "measured", "o")
    quiet.curve([S_G], percent[-1:], RED, "1 and 20", "o")
    return Finding(
        lines=[
            line("time for an inclination error to fall to 1/e", "s", samples * RATES.dt_s, "<=", 1.0),
            line("accelerometer noise left", "%", percent[-1], "<=", 25.0),
        ],
        summary=f"With weights of 1 and 20 an inclination error falls to 1/e in {samples} samples, "
        f"{samples * RATES.dt_s:.2f} s at 50 Hz ((s_g + s_a) / s_a = 21), and {percent[-1]:.0f} % of the accelerometer "
        "noise is left at rest (16 % in closed form). The weights count samples: at 200 Hz the response is four times "
        "as fast.",
        panels=[response, quiet],
    )


def _largest_deg(motion: Motion, lasts_s: float, band: float = 0.2) -> float:
    """Largest inclination error on a motion, from the true attitude on."""
    log = seen(motion, lasts_s)
    estimator = set_attitude(six_axes(band=band), log.truth["R_eb"][0])
    return highest(tilt_deg(estimator.replay(log.measured)["R_eb"], log))


def _half_turn_deg(bank_deg: float, band: float = 0.2) -> float:
    turn = SteadyTurn(math.radians(bank_deg))
    return _largest_deg(turn, math.pi / turn.turn_rate_rad_s, band)


def _flown_deg(bank_deg: float) -> float:
    """Largest inclination error in half a turn in flight."""
    log = clean_log("turns_180", {"manoeuvre.bank_deg": bank_deg, "duration_s": 60.0})
    estimator = six_axes()
    estimator.reset(felt_at_rest(log.truth["R_eb"][0]))
    return highest(tilt_deg(estimator.replay(log.measured)["R_eb"], log)[1000:])


@claim(Paper.STARLINO, "Comments 31 and 49", expected=Verdict.WITH_CONDITION)
def starlino_dynamic_weight() -> Finding:
    """A lower weight rejects short accelerations.

    If the accelerometer has a lower weight whenever its length is not that of gravity, it does not affect the estimate
    during a turn, a fall or a change of speed.
    """
    speed_up = _largest_deg(StraightLevel(surge_m_s2=4.0, surge_s=8.0), 2.0)
    fall = _largest_deg(FreeFall(tumble_rad_s=1.0), 2.0)
    banks, banks_flown = np.arange(10.0, 61.0, 2.0), (20.0, 30.0, 40.0, 50.0)
    flown = {bank: _flown_deg(bank) for bank in banks_flown}

    panel = Panel("Inclination error after half a turn", "largest inclination error, deg", "bank, deg")
    panel.curve(banks, [_half_turn_deg(bank, math.inf) for bank in banks], FAINT, "full weight", "--")
    panel.curve(banks, [_half_turn_deg(bank) for bank in banks], BLUE, "dynamic weight, banked from the start")
    panel.curve(banks_flown, list(flown.values()), RED, "dynamic weight, in flight with rolling in and out", "o")
    falling = line("2 s of free fall: largest error", "deg", fall, "<=", 5.0)
    return Finding(
        lines=[
            line("half a turn in flight, 30 deg of bank: largest error", "deg", flown[30.0], "<=", 5.0),
            line("half a turn in flight, 50 deg of bank: largest error", "deg", flown[50.0], "<=", 5.0),
            line("2 s of speeding up at 0.4 g: largest error", "deg", speed_up, "<=", 5.0),
            falling,
        ],
        condition="if the specific force differs from gravity by a fifth or more all the time",
        conditional_lines=[
            line("half a turn, 40 deg of bank from the start: largest error", "deg", _half_turn_deg(40.0), "<=", 5.0),
            falling,
        ],
        summary=f"In half a turn in flight the inclination error is {flown[30.0]:.0f} degrees at 30 degrees of bank, "
        f"{flown[50.0]:.0f} at 50: the specific force differs from gravity by a fifth only beyond 34 degrees, and the "
        f"half second of rolling in is enough. Speeding up at 0.4 g causes {speed_up:.0f} degrees, a fall none.",
        panels=[panel],
    )


@claim(Paper.STARLINO, "Part 4", seeds=10)
def starlino_drift(seeds: Sequence[int]) -> Finding:
    """Inclination does not drift, heading does.

    Locked to the accelerometer, the matrix does not drift too much; without a magnetometer the heading does.
    """
    ends: dict[str, list[tuple[float, float]]] = {"gyros alone": [], "6 axes": [], "9 axes": []}
    tilts: dict[str, Array] = {}
    headings: dict[str, Array] = {}
    for seed in seeds:
        log, start = seen(HandHeld(), 600.0, BOARD, seed=seed), mean_at_rest(BOARD, seed)
        nine_axes = StarlinoParams(calibration=calibration(BOARD, seed), declination_rad=DECLINATION_RAD)
        estimators: tuple[Compiled[Any], ...] = (GyroOnly(), six_axes(), Starlino(nine_axes))
        for name, estimator in zip(ends, estimators, strict=True):
            estimator.reset(start)  # type: ignore[attr-defined]
            R = estimator.replay(log.measured)["R_eb"]
            tilt = tilt_deg(R, log)
            heading = np.degrees(np.abs(np.unwrap(heading_error_rad(R, log.truth["R_eb"]))))
            ends[name].append((highest(tilt), float(heading[-1])))
            if seed == seeds[0]:
                tilts[name], headings[name] = tilt[::50], heading[::50]
    (gyro_tilt, _), (six_tilt, six_heading), (_, nine_heading) = (
        tuple(rms(column) for column in np.array(values).T) for values in ends.values()
    )

    panels = []
    for errors, what in ((tilts, "inclination"), (headings, "heading")):
        panel = Panel(f"Held in a hand: {what}", f"{what} error, deg", "time, minutes", log="y", ylim=(0.1, 2000.0))
        for name, colour in zip(ends, (FAINT, ORANGE, BLUE), strict=True):
            minutes = log.truth["t_s"][::50] / 60.0
            panel.curve(minutes, errors[name], colour, name, lw=3.0 if name == "6 axes" else 1.5)
        panels.append(panel)
    return Finding(
        lines=[
            line("6 axes: largest inclination error in 10 minutes", "deg", six_tilt, "<=", 3.0),
            line("gyros alone: largest inclination error in 10 minutes", "deg", gyro_tilt, ">=", 10.0),
            line("6 axes: heading error after 10 minutes", "deg", six_heading, ">=", 10.0),
            line("9 axes: heading error after 10 minutes", "deg", nine_heading, "<=", 10.0),
        ],
        summary=f"Held in a hand for 10 minutes, the inclination error is at most {six_tilt:.1f} degrees, mostly from "
        f"the accelerometer offset; with gyros alone it is {gyro_tilt:.0f}. The heading drifts by {six_heading:.0f} "
        f"degrees without a magnetometer; with one, its error is {nine_heading:.1f}.",
        panels=panels,
    )
