"""Turns: removing centrifugal acceleration from the accelerometer reading, and the speed used for that."""

import math
from collections.abc import Sequence

import numpy as np

from estimator.blocks.compiled import write_estimate
from estimator.compiler.jit import kernel
from estimator.premerlani import Premerlani, step
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import flights, hit_ground, percentage, pooled_rms, tuned
from scenarios.harness.claims.motions import NEVER
from scenarios.harness.claims.picture import BLUE, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import bank_size_deg, inclination_error_deg, time_s

SETTLED_S = 20.0
LASTS = {"duration_s": 120.0}
TURNS_DEG = 5.0  # acceptable inclination error of a turning aeroplane, as in the scenario turns_180
CRUISE_M_S = 12.6
LIGHT_M_S, STRONG_M_S = 0.1 * CRUISE_M_S, 0.4 * CRUISE_M_S
WINDS_M_S = (0.0, LIGHT_M_S, 0.2 * CRUISE_M_S, STRONG_M_S)


@kernel
def _step_at_zero_airspeed(rows, k, state):  # type: ignore[no-untyped-def]
    """`premerlani` with an airspeed that is always zero: Eqn 25 vanishes, the rest stays."""
    s = state[0]
    s.use_airspeed = 0  # ignore a sensor that measures otherwise
    s.airspeed_m_s = s.air_age_s = 0.0
    return step(rows, k, state)


@kernel
def _replay_at_zero_airspeed(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], _step_at_zero_airspeed(rows, k, state), estimates[k])


class Uncompensated(Premerlani):
    """The paper's estimator without Eqn 25: the accelerometer reading is taken for gravity."""

    _step = staticmethod(_step_at_zero_airspeed)
    _replay = staticmethod(_replay_at_zero_airspeed)


@claim(Paper.THEORY, "Accelerometers, Eqns 25 and 26", seeds=5)
def centrifugal_compensation(seeds: Sequence[int]) -> Finding:
    """Centrifugal compensation makes the accelerometer usable in turns.

    An aeroplane can turn indefinitely, so centrifugal acceleration must be removed from the accelerometer reading; turn
    rate times speed along the nose is accurate enough for that.
    """
    calm = {**LASTS, "air.wind_m_s": 0.0}
    compensated = flights("circle", seeds, calm)
    # No launch gate either, which would drop readings whose length differs from gravity.
    uncompensated = flights("circle", seeds, {**calm, **tuned(launch_gate=NEVER)}, Uncompensated)
    good, bad = (pooled_rms(flown, inclination_error_deg, SETTLED_S) for flown in (compensated, uncompensated))
    bank = float(np.median([np.median(bank_size_deg(f).within(SETTLED_S, math.inf).value) for f in compensated]))
    swayed = np.concatenate([bank_size_deg(f).within(10.0, math.inf).value for f in uncompensated])
    ended_s = float(np.median([time_s(flight)[-1] for flight in uncompensated]))

    error = Panel("Inclination error in a turn of two minutes", "deg", ylim=(0.0, 42.0))
    true_bank = Panel("True bank; setpoint 30 deg", "deg", ylim=(0.0, 60.0))
    for flown, colour, name in ((uncompensated, RED, "not compensated"), (compensated, BLUE, "Eqns 25 and 26")):
        error.flights(flown, inclination_error_deg, colour, name)
        true_bank.flights(flown, bank_size_deg, colour)
    return Finding(
        lines=[
            line("inclination error, compensated", "deg RMS", good, "<=", TURNS_DEG),
            line("compensated error over uncompensated error", "", good / bad, "<=", 0.25),
            line("uncompensated: flights that hit the ground", "%", percentage(uncompensated, hit_ground), ">=", 90.0),
        ],
        summary=f"At {bank:.0f} degrees of bank in calm air, the inclination error is {good:.1f} degrees RMS. Without "
        f"the centrifugal term the accelerometer levels the matrix in the turn: {bad:.0f} degrees. The bank varies "
        f"between {swayed.min():.0f} and {swayed.max():.0f} degrees, and after {ended_s:.0f} s the aeroplane, which "
        "started at 200 m, hits the ground.",
        panels=[error, true_bank],
    )


@claim(Paper.THEORY, "Accelerometers, above Eqn 25", expected=Verdict.WITH_CONDITION, seeds=3)
def ground_speed(seeds: Sequence[int]) -> Finding:
    """Ground speed can be used in the centrifugal term.

    The ground speed can replace the speed along the nose, because the ground is an inertial frame.
    """
    ways = {
        "ground speed (Eqn 25)": ({}, ORANGE),
        "speed learnt in turns": (tuned(turn_speed=True), BLUE),
        "ground velocity minus learnt wind": (tuned(learn_wind=True), GREEN),
    }

    def error_deg(wind_m_s: float, way: str) -> float:
        flown = flights("circle", seeds, {**LASTS, "air.wind_m_s": wind_m_s, **ways[way][0]})
        return pooled_rms(flown, inclination_error_deg, SETTLED_S)

    errors = {way: [error_deg(wind_m_s, way) for wind_m_s in WINDS_M_S] for way in ways}
    ground, turns, less_wind = errors.values()
    light = WINDS_M_S.index(LIGHT_M_S)

    panel = Panel("Inclination error in a steady turn, by the speed used", "deg RMS", "wind, m/s", ylim=(0.0, 12.0))
    for way, (_, colour) in ways.items():
        panel.curve(WINDS_M_S, errors[way], colour, way, "o-")
    panel.level(TURNS_DEG, text="acceptable in turns", side="left")
    return Finding(
        lines=[line("inclination error, wind 40 % of the airspeed", "deg RMS", ground[-1], "<=", TURNS_DEG)],
        condition="if the wind is at most a tenth of the airspeed",
        conditional_lines=[
            line("inclination error, wind 10 % of the airspeed", "deg RMS", ground[light], "<=", TURNS_DEG)
        ],
        summary=f"With ground speed the inclination error in a steady turn is {ground[0]:.1f} degrees RMS in calm air, "
        f"{ground[light]:.1f} at 1.3 m/s of wind and {ground[-1]:.1f} at 5 m/s. The ground is an inertial frame, but "
        "Eqn 25 needs the velocity along the nose, which is the airspeed. With an airspeed learnt in flight the error "
        f"is {turns[-1]:.1f} or {less_wind[-1]:.1f} at 5 m/s.",
        panels=[panel],
    )
