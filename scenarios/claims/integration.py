"""Integration: the error of one step of Eqn 17, the time step, and integrating angles instead of the matrix."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import integrate, propagate, rotation_error_rad
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import flights, rms_of_each
from scenarios.harness.claims.motions import STEP_S
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, Panel
from scenarios.harness.metrics import inclination_error_deg, rms
from sim.motion.prescribed_plant import SteadyTurn

RATE_DEG_S = 60.0  # the paper's example
COSINES = "Computing direction cosines from gyro signals"


def _exact(omega_b_rad_s: Array, step_s: float) -> Array:
    """Attitude after constant rates over steps, from level, shape (3, 3)."""
    R = Rotation.identity()
    for turn in Rotation.from_rotvec(omega_b_rad_s * step_s):
        R = R * turn
    return np.asarray(R.as_matrix())


def _stepped(omega_b_rad_s: Array, step_s: float, update: Callable[..., object] = integrate) -> Array:
    """The same by Eqn 17 and renormalisation."""
    R = np.eye(3)
    for omega in omega_b_rad_s:
        update(R, omega, step_s)
    return R


@claim(Paper.THEORY, "Introduction, integration error")
def sampled_rate() -> Finding:
    """The integration error is proportional to the rotational acceleration.

    The method takes the rate to be constant over the time step, which causes an error proportional to the rotational
    acceleration.
    """
    accelerations = np.geomspace(10.0, 200.0, 12)  # deg/s^2
    n = round(1.0 / STEP_S)

    def error_deg(acceleration: float, averaged: bool) -> float:
        """After one second of spinning up from rest about a tilted axis."""
        axis = np.array([1.0, 2.0, 2.0]) / 3.0
        rates = np.radians(acceleration) * (np.arange(n) + 0.5 * averaged)[:, None] * STEP_S * axis
        true = Rotation.from_rotvec(axis * np.radians(acceleration) * 0.5).as_matrix()
        return math.degrees(rotation_error_rad(_stepped(rates, STEP_S), true))

    first, mean = (np.array([error_deg(a, averaged) for a in accelerations]) for averaged in (False, True))
    order = float(np.polyfit(np.log(accelerations), np.log(first), 1)[0])

    panel = Panel("Error after spinning up for one second", "attitude error, deg", "rotational acceleration, deg/s²")
    errors = {"rate at the beginning of each step": first, "mean rate over each step": mean}
    panel.curves(accelerations, errors, (ORANGE, GREEN), "o-")
    return Finding(
        lines=[line("exponent of the acceleration, difference from 1", "", abs(order - 1.0), "<=", 0.1)],
        summary=f"If the rate is sampled at the beginning of each step, the error after a second grows with the "
        f"{order:.2f}th power of the acceleration: {np.interp(100.0, accelerations, first):.2f} degrees at 100 deg/s². "
        f"With gyros that average over the step, as those on board do, it is "
        f"{np.interp(100.0, accelerations, mean):.2f}.",
        panels=[panel],
    )


@claim(Paper.THEORY, f"{COSINES}, above Eqn 12")
def angles_do_not_add() -> Finding:
    """Integrating gyro signals into angles does not work.

    Rotations do not commute: simply integrating the gyro signals into angles does not work; the rotation of the axes
    has to be tracked.
    """
    turn = SteadyTurn(math.radians(30.0))
    t_s: Array = np.arange(1, round(60.0 / STEP_S) + 1) * np.float64(STEP_S)
    at = turn.at(t_s)
    summed = np.degrees(np.cumsum(at.omega_b_rad_s, axis=0) * STEP_S)
    R = turn.at(np.zeros(1)).R_eb[0].copy()
    pitch = np.empty(len(t_s))
    for k, omega in enumerate(at.omega_b_rad_s):
        integrate(R, omega, STEP_S)
        pitch[k] = math.degrees(math.asin(np.clip(-R[2, 0], -1.0, 1.0)))
    error = math.degrees(rotation_error_rad(R, at.R_eb[-1]))

    panel = Panel("Integrated pitch rate in a level turn at 30 degrees of bank", "pitch, deg", "time in the turn, s")
    panel.curve(t_s, summed[:, 1], ORANGE, "pitch rate, integrated")
    panel.curve(t_s, 0.0 * t_s, FAINT, "true pitch", "--", lw=1, zorder=5)
    panel.curve(t_s, pitch, BLUE, "pitch of the matrix")
    return Finding(
        lines=[
            line("integrated pitch rate: error after a minute", "deg", abs(summed[-1, 1]), ">=", 90.0),
            line("matrix: attitude error after a minute", "deg", error, "<=", 1.0),
        ],
        summary=f"In a minute of level turning the pitch rate integrates to {summed[-1, 1]:.0f} degrees of pitch, but "
        f"the true pitch is zero; the matrix, from the same rates, has an error of {error:.2f} degrees.",
        panels=[panel],
    )


def _one_step_error(rate_rad_s: float, step_s: float) -> float:
    """Largest error of an element after one step of Eqn 17 about one axis."""
    rotation_vector = np.array([0.0, 0.0, rate_rad_s * step_s])
    stepped = np.eye(3)
    propagate(stepped, rotation_vector / step_s, step_s)
    return float(np.abs(stepped - Rotation.from_rotvec(rotation_vector).as_matrix()).max())


@claim(Paper.THEORY, f"{COSINES}, below Eqn 17")
def second_order() -> Finding:
    """Eqn 17 is accurate to second order.

    One step neglects terms of second order in the angle: at 60 deg/s and 50 steps per second, about 0.02 % of an
    element.
    """
    percent = 100.0 * _one_step_error(np.radians(RATE_DEG_S), STEP_S)
    rates = np.geomspace(10.0, 400.0, 60)
    errors = np.array([_one_step_error(np.radians(rate), STEP_S) for rate in rates])
    order = float(np.polyfit(np.log(rates), np.log(errors), 1)[0])

    panel = Panel("Error of one step of 20 ms", "largest error of an element, %", "turn rate, deg/s", log="xy")
    panel.curve(rates, errors * 100.0, BLUE)
    panel.curve(RATE_DEG_S, percent, BLUE, style="o")
    panel.level(0.02, text="0.02 % as claimed", side="left")
    return Finding(
        lines=[
            line("error of one step at 60 deg/s", "%", percent, "<=", 0.025),
            line("order of the error", "", order, ">=", 1.9),
        ],
        summary=f"The error of one step of 20 ms at 60 deg/s is {percent:.3f} % of an element; it grows with the "
        f"{order:.2f}th power of the angle.",
        panels=[panel],
    )


STEPS_MS = (5, 10, 20, 25, 50, 100)
FINE_S, FLOWN_S = 0.005, 60.0
RATES_HZ = (50, 100, 200)


def _drift_by_step(scenario: str, seeds: Sequence[int]) -> Array:
    """Attitude error per minute of Eqn 17 on perfect gyros, for each of `STEPS_MS`, RMS of the flights, deg/min."""
    each = []
    for flight in flights(scenario, seeds, {"rates.imu_hz": 200}):
        omega = flight.log.truth["imu_omega_b_rad_s"][: round(FLOWN_S / FINE_S)]
        omega = omega[: len(omega) // 20 * 20]  # whole steps of each length
        true = _exact(omega, FINE_S)
        means = (omega.reshape(-1, ms // 5, 3).mean(axis=1) for ms in STEPS_MS)
        errors = [rotation_error_rad(_stepped(m, ms / 1e3), true) for m, ms in zip(means, STEPS_MS, strict=True)]
        each.append(np.degrees(errors) / (len(omega) * FINE_S / 60.0))
    return np.asarray(np.sqrt(np.mean(np.square(each), axis=0)))


@claim(Paper.THEORY, f"{COSINES}, below Eqn 17", expected=Verdict.WITH_CONDITION, seeds=3)
def time_step(seeds: Sequence[int]) -> Finding:
    """Steps of 0.02 s are short enough.

    The only approximation of the update is that the time step is short; 0.02 s, 40 to 50 Hz, are typical.
    """
    drift = {scenario: _drift_by_step(scenario, seeds) for scenario in ("turns_180", "loops")}
    flown = {hz: flights("turns_180", seeds, {"rates.imu_hz": hz}) for hz in RATES_HZ}
    errors = {hz: rms(rms_of_each(these, inclination_error_deg)) for hz, these in flown.items()}
    turns, loops = (values[STEPS_MS.index(20)] for values in drift.values())
    in_flight = line("in flight: error at 50 Hz minus error at 200 Hz", "deg", errors[50] - errors[200], "<=", 0.2)

    alone = Panel("A minute of Eqn 17 on perfect gyros", "error, deg", "time step, ms", log="xy", xticks=STEPS_MS)
    alone.curves(STEPS_MS, drift, (BLUE, ORANGE), "o-")
    alone.upright(20.0)
    complete = Panel("In flight, turns_180", "inclination error, deg RMS", ylim=(0.0, 1.2 * max(errors.values())))
    complete.bars([f"{1000 // hz} ms" for hz in RATES_HZ], {"": (list(errors.values()), BLUE)}, "{:.2f}")
    return Finding(
        lines=[
            line("turns: drift with steps of 20 ms", "deg/min", turns, "<=", 1.0),
            line("loops: drift with steps of 20 ms", "deg/min", loops, "<=", 1.0),
            in_flight,
        ],
        condition="with drift correction",
        conditional_lines=[in_flight],
        summary=f"On perfect gyros without correction, steps of 20 ms cause a drift of {turns:.1f} degrees in a minute "
        f"with turns and {loops:.1f} with loops. In flight, with drift correction, the inclination error is "
        f"{errors[50]:.2f} degrees at 50 Hz and {errors[200]:.2f} at 200 Hz.",
        panels=[alone, complete],
    )
