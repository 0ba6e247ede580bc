"""Integration: what a step of Eqn 17 neglects, how short it must be, and why angles will not do."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from estimator.interface import Array
from estimator.rotation import integrate, propagate, rotation_error_rad
from scenarios.claims._open_loop import STEP_S
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, axes, label
from scenarios.harness.metrics import inclination_error_deg, rms
from sim.motion.prescribed_plant import SteadyTurn

RATE_DEG_S = 60.0  # the paper's example


def _one_step_error(rate_rad_s: float, step_s: float) -> float:
    """Largest element by which one step of Eqn 17 about one axis misses the true rotation."""
    rotation_vector = np.array([0.0, 0.0, rate_rad_s * step_s])
    stepped = np.eye(3)
    propagate(stepped, rotation_vector / step_s, step_s)
    return float(np.abs(stepped - Rotation.from_rotvec(rotation_vector).as_matrix()).max())


def _second_order(_seeds: Sequence[int]) -> Finding:
    measured = _one_step_error(np.radians(RATE_DEG_S), STEP_S)
    rates = np.geomspace(10.0, 400.0, 60)
    errors = [_one_step_error(np.radians(rate), STEP_S) for rate in rates]
    order = float(np.polyfit(np.log(rates), np.log(errors), 1)[0])

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "What one step of 20 ms misses, by rate of turn")
        ax.loglog(rates, np.array(errors) * 100.0, color=BLUE, lw=2)
        ax.axhline(0.02, color=FAINT, ls="--", lw=1)
        ax.annotate("0.02 % as claimed", (11.0, 0.022), color=FAINT)
        ax.plot(RATE_DEG_S, measured * 100.0, "o", color=BLUE)
        label(ax, "rate of turn, deg/s", "largest element missed, %")

    return Finding(
        stands=(
            line("missed by one step at 60 deg/s", "%", measured * 100.0, "<=", 0.025),
            line("order of the error", "", order, ">=", 1.9),
        ),
        told=f"One step of 20 ms at 60 deg/s misses {measured * 100.0:.3f} % of the matrix; it grows with the "
        f"{order:.2f}th power of the angle.",
        seeds=0,
        draw=draw,
    )


def _exact(omega_b_rad_s: Array, step_s: float) -> Array:
    """Attitude after constant rates over steps, from level on, shape (3, 3)."""
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


STEPS_MS = (5, 10, 20, 25, 50, 100)
FINE_S, FLOWN_S = 0.005, 60.0
RATES_HZ = (50, 100, 200)


def _time_step(seeds: Sequence[int]) -> Finding:
    drift: dict[str, Array] = {}
    for scenario in ("turns_180", "loops"):
        each = []
        for flight in flights(scenario, seeds, {"rates.imu_hz": 200}):
            omega = flight.log.truth["imu_omega_b_rad_s"][: round(FLOWN_S / FINE_S)]
            omega = omega[: len(omega) // 20 * 20]  # whole steps of each length
            true = _exact(omega, FINE_S)
            means = (omega.reshape(-1, n, 3).mean(axis=1) for n in (round(ms / 5) for ms in STEPS_MS))
            minutes = len(omega) * FINE_S / 60.0
            each.append(
                [
                    math.degrees(rotation_error_rad(_stepped(mean, ms / 1000.0), true)) / minutes
                    for mean, ms in zip(means, STEPS_MS, strict=True)
                ]
            )
        drift[scenario] = np.sqrt(np.mean(np.square(each), axis=0))
    errors = {
        hz: rms(
            np.array(
                [
                    rms(inclination_error_deg(flight).judged_values)
                    for flight in flights("turns_180", seeds, {"rates.imu_hz": hz})
                ]
            )
        )
        for hz in RATES_HZ
    }
    at = STEPS_MS.index(20)
    worse = errors[50] - errors[200]

    def draw(figure: Figure) -> None:
        alone, flown = axes(figure, "A minute of Eqn 17 on perfect gyros", "In flight with everything")
        for (scenario, values), colour in zip(drift.items(), (BLUE, ORANGE), strict=True):
            alone.loglog(STEPS_MS, values, "o-", color=colour, label=scenario)
        alone.axvline(20.0, color=FAINT, ls="--", lw=1)
        alone.set_xticks(STEPS_MS, [str(ms) for ms in STEPS_MS])
        alone.minorticks_off()
        alone.legend()
        label(alone, "time step, ms", "attitude error, deg")
        bars = flown.bar([f"{1000 // hz} ms" for hz in RATES_HZ], list(errors.values()), 0.5, color=BLUE)
        flown.bar_label(bars, [f"{value:.2f}" for value in errors.values()], padding=2)
        flown.set_ylim(0.0, 1.2 * max(errors.values()))
        flown.grid(visible=False, axis="x")
        label(flown, "time step, turns_180", "inclination error, deg RMS")

    return Finding(
        stands=(
            line("turns: steps of 20 ms alone", "deg/min", drift["turns_180"][at], "<=", 1.0),
            line("loops: steps of 20 ms alone", "deg/min", drift["loops"][at], "<=", 1.0),
            line("in flight, 50 Hz worse than 200 Hz by", "deg", worse, "<=", 0.2),
        ),
        condition="with the drift correction at work",
        under=(line("in flight, 50 Hz worse than 200 Hz by", "deg", worse, "<=", 0.2),),
        told=f"On perfect gyros, steps of 20 ms alone make {drift['turns_180'][at]:.1f} degrees in a minute with turns "
        f"and {drift['loops'][at]:.1f} in one with loops. In flight, with drift correction, {errors[50]:.2f} degrees "
        f"at 50 Hz compare with {errors[200]:.2f} at 200 Hz.",
        seeds=len(seeds),
        draw=draw,
    )


def _angles_do_not_add(_seeds: Sequence[int]) -> Finding:
    turn = SteadyTurn(math.radians(30.0))
    t_s: Array = np.arange(1, round(60.0 / STEP_S) + 1) * np.float64(STEP_S)
    at = turn.at(t_s)
    summed = np.degrees(np.cumsum(at.omega_b_rad_s, axis=0) * STEP_S)
    R = turn.at(np.zeros(1)).R_eb[0].copy()
    error, pitch = np.empty(len(t_s)), np.empty(len(t_s))
    for k, omega in enumerate(at.omega_b_rad_s):
        integrate(R, omega, STEP_S)
        error[k] = math.degrees(rotation_error_rad(R, at.R_eb[k]))
        pitch[k] = math.degrees(math.asin(np.clip(-R[2, 0], -1.0, 1.0)))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A level turn of 30 degrees of bank: the pitch that the pitch gyro adds up to")
        ax.plot(t_s, summed[:, 1], color=ORANGE, label="pitch rate, integrated")
        ax.plot(t_s, np.zeros(len(t_s)), color=FAINT, ls="--", lw=1, label="true pitch", zorder=5)
        ax.plot(t_s, pitch, color=BLUE, label="pitch of the matrix")
        ax.legend()
        label(ax, "time in the turn, s", "pitch, deg")

    return Finding(
        stands=(
            line("pitch of an integrated gyro after a minute, off", "deg", abs(summed[-1, 1]), ">=", 90.0),
            line("attitude error of the matrix", "deg", error[-1], "<=", 1.0),
        ),
        told=f"In a minute of level turning the pitch gyro adds up to {summed[-1, 1]:.0f} degrees of pitch that are "
        f"not there; the matrix, from the same rates, is off by {error[-1]:.2f}.",
        seeds=0,
        draw=draw,
    )


def _sampled_rate(_seeds: Sequence[int]) -> Finding:
    accelerations = np.geomspace(10.0, 200.0, 12)  # deg/s^2
    n = round(1.0 / STEP_S)

    def error_deg(acceleration: float, meaned: bool) -> float:
        """After one second of spinning up from rest about an axis that leans."""
        axis = np.array([1.0, 2.0, 2.0]) / 3.0
        rates = np.radians(acceleration) * (np.arange(n) + 0.5 * meaned)[:, None] * STEP_S * axis
        true = Rotation.from_rotvec(axis * np.radians(acceleration) * 0.5).as_matrix()
        return math.degrees(rotation_error_rad(_stepped(rates, STEP_S), true))

    begin, mean = (np.array([error_deg(a, meaned) for a in accelerations]) for meaned in (False, True))
    order = float(np.polyfit(np.log(accelerations), np.log(begin), 1)[0])

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "One second of spinning up, each step at one rate")
        ax.plot(accelerations, begin, "o-", color=ORANGE, label="the rate at its beginning")
        ax.plot(accelerations, mean, "o-", color=GREEN, label="the mean rate over it")
        ax.legend()
        label(ax, "rotational acceleration, deg/s²", "attitude error, deg")

    return Finding(
        stands=(line("power of the acceleration, off one by", "", abs(order - 1.0), "<=", 0.1),),
        told=f"Sampled at the beginning of each step, the error of a second grows with the {order:.2f}th power of "
        f"the acceleration: {np.interp(100.0, accelerations, begin):.2f} degrees at 100 deg/s². Of a gyro that "
        f"averages over the step, as those aboard do, {np.interp(100.0, accelerations, mean):.2f} are left.",
        seeds=0,
        draw=draw,
    )


COSINES = "Computing direction cosines from gyro signals"
CLAIMS = (
    Claim(
        name="sampled_rate",
        title="Integration errs in proportion to the rotational acceleration",
        paper=Paper.THEORY,
        place="Introduction, integration error",
        says="The method takes the rate to be constant over the time step, which introduces an error in proportion to "
        "the rotational acceleration.",
        expected=Verdict.CONFIRMED,
        measure=_sampled_rate,
        seeds=0,
    ),
    Claim(
        name="angles_do_not_add",
        title="Integrating the gyros into angles will not do",
        paper=Paper.THEORY,
        place=f"{COSINES}, above Eqn 12",
        says="Rotations do not commute: simply integrating the gyro signals into angles does not work; the rotation of "
        "the axes has to be tracked.",
        expected=Verdict.CONFIRMED,
        measure=_angles_do_not_add,
        seeds=0,
    ),
    Claim(
        name="second_order",
        title="Eqn 17 is right to the second order",
        paper=Paper.THEORY,
        place=f"{COSINES}, below Eqn 17",
        says="The update of a step neglects what is of second order in the angle: at 60 deg/s and 50 steps a second "
        "that is about 0.02 % of an element.",
        expected=Verdict.CONFIRMED,
        measure=_second_order,
        seeds=0,
    ),
    Claim(
        name="time_step",
        title="Steps of 0.02 s are short enough",
        paper=Paper.THEORY,
        place=f"{COSINES}, below Eqn 17",
        says="The only approximation of the update is that the time step is short; 0.02 s, 40 to 50 Hz, are typical.",
        expected=Verdict.WITH_CONDITION,
        measure=_time_step,
        seeds=3,
    ),
)
