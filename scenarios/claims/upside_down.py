"""Navigation straight from the matrix, upside down as well: prescribed turns on the back, and a square flown so."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from autopilot.guidance import heading_error
from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.premerlani import Premerlani
from estimator.rotation import from_euler
from scenarios.claims._flown import course_rad
from scenarios.claims._open_loop import aboard, begin, inclination_deg, sensed
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, axes, label
from scenarios.harness.metrics import survived, time_s
from scenarios.harness.metrics.manoeuvres import inverted
from scenarios.inverted import FIRST_S, LEGS
from sim.log import Flight, Log, Phase
from sim.motion.prescribed_plant import CALM, GRAVITY_M_S2, Kinematics, SteadyTurn

FLOWN_S, SETTLED_S = 120.0, 20.0
BANK_RAD = math.radians(20.0)
OFF_RAD = math.radians(40.0)
DIRECTIONS_RAD = np.radians(np.arange(0.0, 360.0, 15.0))


@dataclass(frozen=True, slots=True)
class OnItsBack:
    """A level turn upside down: the wings carry it with the belly up, `bank_rad` from there."""

    bank_rad: float
    airspeed_m_s: float = 12.6
    height_m: float = 60.0
    phase: ClassVar[Phase] = Phase.FLYING
    wind_e_m_s: ClassVar[tuple[float, float, float]] = CALM

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`: path and heading of a `SteadyTurn`, rolled over by half a turn about the nose."""
        upright = SteadyTurn(self.bank_rad, self.airspeed_m_s, height_m=self.height_m)
        path = upright.at(t_s)
        rate = upright.turn_rate_rad_s
        roll = self.bank_rad + math.pi
        omega_b = np.tile([0.0, rate * math.sin(roll), rate * math.cos(roll)], (len(t_s), 1))
        R_eb = from_euler(roll, 0.0, rate * t_s)
        return Kinematics(R_eb, omega_b, path.p_e_m, path.v_e_m_s, path.a_e_m_s2)


def _steering_error_deg(R_eb: Array, log: Log) -> Array:
    """Largest error of the deviation from any direction asked for, by cross and dot product, shape (n,)."""
    course = np.arctan2(log.truth["v_e_m_s"][:, 1], log.truth["v_e_m_s"][:, 0])
    worst = np.zeros(len(course))
    for asked in DIRECTIONS_RAD:
        sine, cosine = heading_error(R_eb[:, 0, 0], R_eb[:, 1, 0], math.cos(asked), math.sin(asked))
        error = np.arctan2(sine, cosine) - (asked - course)
        worst = np.maximum(worst, np.abs(np.degrees(np.angle(np.exp(1j * error)))))
    return worst


LEG_S = 15.0  # of the square
LAST_S = 4.0  # of a leg: by then the corner lies behind
ON_THE_LEG_DEG = 10.0


def _turned_deg(flight: Flight) -> Array:
    """True course from the first leg on, to the right, degrees."""
    start_rad = math.radians(flight.manifest["config"]["start"]["heading_deg"])
    return np.degrees(np.unwrap(wrap(course_rad(flight) - start_rad)))


def _asked_deg(flight: Flight) -> Array:
    """The same of the leg that is asked for: a right angle more each time."""
    return 90.0 * np.clip(np.floor((time_s(flight) - FIRST_S) / LEG_S), 0, LEGS - 1)


def _off_the_legs_deg(flight: Flight) -> list[float]:
    """By how much the mean course is off, at the end of each leg; NaN where it is not flown upside down."""
    t_s, off = time_s(flight), np.abs(_turned_deg(flight) - _asked_deg(flight))
    ends_s = [FIRST_S + (leg + 1) * LEG_S for leg in range(LEGS)]
    at_end = [(t_s > end_s - LAST_S) & (t_s <= end_s) for end_s in ends_s]
    return [float(off[at].mean()) if inverted(flight)[at].all() else math.nan for at in at_end]


def _wrong_way_up(flight: Flight) -> int:
    """Ticks at which r_zz has the wrong sign, but for those within 6 degrees of knife edge."""
    true, told = flight.log.truth["R_eb"][:, 2, 2], flight.log.flown["R_eb"][:, 2, 2]
    return int(np.sum((np.sign(true) != np.sign(told)) & (np.abs(true) > 0.1)))


def _upside_down(seeds: Sequence[int]) -> Finding:
    flown = flights("inverted", seeds)
    off_the_legs = float(np.max([_off_the_legs_deg(flight) for flight in flown]))
    survive = 100.0 * float(np.mean([survived(flight).value for flight in flown]))
    logs = {
        way: sensed(motion, FLOWN_S) for way, motion in (("back", OnItsBack(BANK_RAD)), ("belly", SteadyTurn(BANK_RAD)))
    }
    found, steering, tilt = {}, {}, {}
    for way, log in logs.items():
        roll_rad = math.pi if way == "back" else 0.0
        start = from_euler(np.array([roll_rad]), 0.0, OFF_RAD)[0]  # wings level, the heading 40 degrees wrong
        R_eb = found[way] = begin(Premerlani(aboard()), start).replay(log.measured)["R_eb"]
        steering[way], tilt[way] = _steering_error_deg(R_eb, log), inclination_deg(R_eb, log)
    later = logs["back"].truth["t_s"] > SETTLED_S
    r_zz, true_r_zz = found["back"][:, 2, 2], logs["back"].truth["R_eb"][:, 2, 2]
    omega_b = logs["back"].measured["gyro_b_rad_s"]
    turn_deg_s = np.degrees(np.einsum("ni,ni->n", found["back"][:, 2], omega_b))
    true_deg_s = math.degrees(GRAVITY_M_S2 * math.tan(BANK_RAD) / 12.6)
    rate_error = float(np.abs(turn_deg_s - true_deg_s)[later].max())
    sign_wrong = int(np.sum(np.sign(r_zz) != np.sign(true_r_zz)))
    off, off_belly = (float(steering[way][later].max()) for way in ("back", "belly"))

    def draw(figure: Figure) -> None:
        error, elements, square = axes(figure, "Way to turn: error", "On its back: told", "A square flown on its back")
        t_s = logs["back"].truth["t_s"]
        error.plot(t_s, steering["back"], color=BLUE, label="on its back")
        error.plot(t_s, steering["belly"], "--", color=ORANGE, label="upright", lw=1.2)
        error.set_xlim(0.0, 40.0)
        error.legend()
        label(error, "time, s", "deg, the worst of 24 directions")
        for values, colour, name in ((r_zz, BLUE, "r_zz"), (turn_deg_s / true_deg_s, ORANGE, "rate of turn / true")):
            elements.plot(t_s, values, color=colour, label=name)
        elements.axhline(0.0, color=FAINT, lw=1)
        elements.set_xlim(0.0, 40.0)
        elements.legend(loc="center right")
        label(elements, "time, s", "r_zz; part of the true rate")
        for i, flight in enumerate(flown):
            shown = (time_s(flight) > FIRST_S) & (time_s(flight) < FIRST_S + LEGS * LEG_S)
            t_s = time_s(flight)[shown] - FIRST_S
            square.plot(t_s, _turned_deg(flight)[shown], color=GREEN, lw=1, label=None if i else "course")
            if i == 0:
                square.plot(t_s, _asked_deg(flight)[shown], "--", color=FAINT, lw=1, label="asked for")
        square.set_yticks((0, 90, 180, 270))
        square.legend(loc="upper left")
        label(square, "time, s", "deg to the right of the first leg")

    return Finding(
        stands=(
            line("direction asked for: largest error, upside down", "deg", off, "<=", 5.0),
            line("tilt error, upside down", "deg", float(tilt["back"][later].max()), "<=", 5.0),
            line("ticks at which r_zz has the wrong sign", "", sign_wrong, "<=", 0.0),
            line("rate of turn about the vertical: error", "deg/s", rate_error, "<=", 0.5),
            line("flown: flights that survive", "%", survive, ">=", 100.0),
            line("flown: course off the one asked for, any leg", "deg", off_the_legs, "<=", ON_THE_LEG_DEG),
            line("flown: ticks at which r_zz has the wrong sign", "", max(map(_wrong_way_up, flown)), "<=", 0.0),
        ),
        told=f"In turns on its back, the heading 40 degrees wrong at first, the deviation from any direction is "
        f"told to {off:.1f} degrees by cross and dot product once yaw is locked (upright: {off_belly:.1f}), the rate "
        f"of turn to {rate_error:.2f} deg/s, and r_zz is negative all the time. A square flown on "
        f"its back in wind, steered by the estimate, is at most {off_the_legs:.0f} degrees off its course at the end "
        "of any leg.",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="upside_down",
        title="The matrix steers upside down as well",
        paper=Paper.THEORY,
        place="Using DCM in control and navigation, uses 3 to 5",
        says="Cross and dot product of the nose with the direction wanted tell the way to turn even upside down, the "
        "sign of r_zz tells that one is, and the third row with the gyros tells the rate of turn.",
        expected=Verdict.CONFIRMED,
        measure=_upside_down,
        seeds=5,
    ),
)
