"""Turns: the accelerometer freed of centrifugal acceleration, and the speed that it takes for that."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from estimator.blocks.compiled import write_estimate
from estimator.compiler.jit import kernel
from estimator.premerlani import Premerlani, step
from scenarios.claims._flown import pooled_rms, tuned
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import bank_size_deg, inclination_error_deg, time_s
from sim.log import Outcome

SETTLED_S = 20.0
LASTS = {"duration_s": 120.0}
TURNS_DEG = 5.0  # what may be asked of the tilt of an aeroplane that turns, as in the scenario turns_180
CRUISE_M_S = 12.6
LIGHT_M_S, STRONG_M_S = 0.1 * CRUISE_M_S, 0.4 * CRUISE_M_S
WINDS_M_S = (0.0, LIGHT_M_S, 0.2 * CRUISE_M_S, STRONG_M_S)


@kernel
def _step_as_if_standing(rows, k, state):  # type: ignore[no-untyped-def]
    """`premerlani` told all the time that its airspeed is zero: Eqn 25 vanishes, the rest stays."""
    s = state[0]
    s.use_airspeed = 0  # a sensor that knows better is not listened to
    s.airspeed_m_s = s.air_age_s = 0.0
    return step(rows, k, state)


@kernel
def _replay_as_if_standing(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], _step_as_if_standing(rows, k, state), estimates[k])


class Uncompensated(Premerlani):
    """The paper's estimator without Eqn 25: what the accelerometer feels is taken for gravity."""

    _step = staticmethod(_step_as_if_standing)
    _replay = staticmethod(_replay_as_if_standing)


def _centrifugal(seeds: Sequence[int]) -> Finding:
    calm = {**LASTS, "air.wind_m_s": 0.0}
    freed = flights("circle", seeds, calm)
    # Nor does the launch gate help it by dropping what is not as long as gravity.
    misled = flights("circle", seeds, {**calm, **tuned(launch_gate=1e9)}, Uncompensated)
    good, bad = (pooled_rms(flown, inclination_error_deg, SETTLED_S) for flown in (freed, misled))
    bank = float(np.median([np.median(bank_size_deg(f).within(SETTLED_S, math.inf).value) for f in freed]))
    down = 100.0 * float(np.mean([flight.outcome == Outcome.GROUND_CONTACT for flight in misled]))
    swayed = np.concatenate([bank_size_deg(f).within(10.0, math.inf).value for f in misled])
    ended_s = float(np.median([time_s(flight)[-1] for flight in misled]))

    def draw(figure: Figure) -> None:
        error, bank_ax = axes(figure, "Tilt error in a turn held for two minutes", "True bank; asked for: 30 deg")
        for flown, colour, name in ((misled, RED, "accelerometer as it is"), (freed, BLUE, "freed, Eqns 25 and 26")):
            for i, flight in enumerate(flown):
                series, style = inclination_error_deg(flight), {"color": colour, "lw": 1}
                error.plot(series.t_s, series.value, label=name if i == 0 else None, **style)
                bank_ax.plot(series.t_s, bank_size_deg(flight).value, **style)
        error.legend(loc="upper right")
        error.set_ylim(0.0, 42.0)
        bank_ax.set_ylim(0.0, 60.0)
        label(error, "time, s", "deg")
        label(bank_ax, "time, s", "deg")

    return Finding(
        stands=(
            line("tilt error, freed of centrifugal acceleration", "deg RMS", good, "<=", TURNS_DEG),
            line("part of the error that the term leaves", "", good / bad, "<=", 0.25),
            line("without it: flights that come down", "%", down, ">=", 90.0),
        ),
        told=f"Held at {bank:.0f} degrees of bank in calm air, the matrix is off by {good:.1f} degrees RMS. Without "
        f"the centrifugal term the accelerometer levels it against the turn: {bad:.0f} degrees; the bank sways between "
        f"{swayed.min():.0f} and {swayed.max():.0f} degrees, and after {ended_s:.0f} s the aeroplane has come down "
        "from 200 m to the ground.",
        seeds=len(seeds),
        draw=draw,
    )


def _ground_speed(seeds: Sequence[int]) -> Finding:
    ways = {
        "ground speed (Eqn 25)": ({}, ORANGE),
        "speed learnt in turns": (tuned(turn_speed=True), BLUE),
        "ground velocity less learnt wind": (tuned(learn_wind=True), GREEN),
    }

    def tilt(wind_m_s: float, way: str) -> float:
        flown = flights("circle", seeds, {**LASTS, "air.wind_m_s": wind_m_s, **ways[way][0]})
        return pooled_rms(flown, inclination_error_deg, SETTLED_S)

    errors = {way: [tilt(wind_m_s, way) for wind_m_s in WINDS_M_S] for way in ways}
    ground, turns, less_wind = errors.values()
    light = WINDS_M_S.index(LIGHT_M_S)

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Tilt error in a steady turn, by the speed that is put into Eqn 25")
        for way, (_, colour) in ways.items():
            ax.plot(WINDS_M_S, errors[way], "o-", color=colour, label=way)
        ax.axhline(TURNS_DEG, color=FAINT, ls="--", lw=1)
        ax.annotate("what may be asked in turns", (0.0, TURNS_DEG + 0.2), color=FAINT)
        ax.set_ylim(0.0, 12.0)
        ax.legend(loc="upper left")
        label(ax, "wind, m/s (12.6 m/s is the airspeed)", "deg RMS")

    return Finding(
        stands=(line("tilt error, wind 40 % of the airspeed", "deg RMS", ground[-1], "<=", TURNS_DEG),),
        condition="if the wind is no more than a tenth of the airspeed",
        under=(line("tilt error, wind 10 % of the airspeed", "deg RMS", ground[light], "<=", TURNS_DEG),),
        told=f"By ground speed the tilt in a steady turn is off by {ground[0]:.1f} degrees RMS in calm air, "
        f"{ground[light]:.1f} at 1.3 m/s of wind and {ground[-1]:.1f} at 5 m/s: the ground is an inertial frame, but "
        "Eqn 25 puts the velocity along the nose, and there only the airspeed belongs. With the speed through the air, "
        f"learnt in flight, it is {turns[-1]:.1f} or {less_wind[-1]:.1f} at 5 m/s.",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="centrifugal_compensation",
        title="Freed of centrifugal acceleration, the accelerometer tells down in a turn",
        paper=Paper.THEORY,
        place="Accelerometers, Eqns 25 and 26",
        says="An aeroplane can turn for ever, so centrifugal acceleration must be taken out of what the accelerometer "
        "feels; rate of turn times speed along the nose is exact enough for that.",
        expected=Verdict.CONFIRMED,
        measure=_centrifugal,
        seeds=5,
    ),
    Claim(
        name="ground_speed",
        title="Ground speed is the speed for the centrifugal term",
        paper=Paper.THEORY,
        place="Accelerometers, above Eqn 25",
        says="The speed over ground may be taken for the speed along the nose, since the ground is an inertial frame.",
        expected=Verdict.WITH_CONDITION,
        measure=_ground_speed,
        seeds=3,
    ),
)
