"""Navigation from the matrix, also upside down: prescribed inverted turns, and an inverted square in flight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autopilot.guidance import heading_error
from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.premerlani import Premerlani
from estimator.rotation import from_euler
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.flights import course_rad, flights, percentage
from scenarios.harness.claims.motions import aboard, begin, sensed, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, Panel
from scenarios.harness.metrics import survived, time_s
from scenarios.harness.metrics.manoeuvres import inverted
from scenarios.inverted import FIRST_S, LEGS
from sim.log import Flight, Log
from sim.motion.prescribed_plant import GRAVITY_M_S2, Kinematics, Motion, SteadyTurn

FLOWN_S, SETTLED_S = 120.0, 20.0
BANK_RAD = math.radians(20.0)
OFF_RAD = math.radians(40.0)
DIRECTIONS_RAD = np.radians(np.arange(0.0, 360.0, 15.0))


@dataclass(frozen=True, slots=True)
class OnItsBack:
    """A level turn upside down, `bank_rad` from wings level inverted."""

    bank_rad: float
    airspeed_m_s: float = 12.6
    height_m: float = 60.0

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`: path and heading of a `SteadyTurn`, rolled by half a turn about the nose."""
        upright = SteadyTurn(self.bank_rad, self.airspeed_m_s, height_m=self.height_m)
        path = upright.at(t_s)
        rate = upright.turn_rate_rad_s
        roll = self.bank_rad + math.pi
        omega_b = np.tile([0.0, rate * math.sin(roll), rate * math.cos(roll)], (len(t_s), 1))
        R_eb = from_euler(roll, 0.0, rate * t_s)
        return Kinematics(R_eb, omega_b, path.p_e_m, path.v_e_m_s, path.a_e_m_s2)


def _estimated(motion: Motion, roll_rad: float) -> tuple[Log, Array]:
    """What is sensed of a turn, and the attitudes estimated from wings level with a heading error of 40 degrees."""
    log = sensed(motion, FLOWN_S)
    start = from_euler(np.array([roll_rad]), 0.0, OFF_RAD)[0]
    return log, begin(Premerlani(aboard()), start).replay(log.measured)["R_eb"]


def _steering_error_deg(R_eb: Array, log: Log) -> Array:
    """Largest error of the deviation from any direction, by cross and dot product, shape (n,)."""
    course = np.arctan2(log.truth["v_e_m_s"][:, 1], log.truth["v_e_m_s"][:, 0])
    worst = np.zeros(len(course))
    for wanted in DIRECTIONS_RAD:
        sine, cosine = heading_error(R_eb[:, 0, 0], R_eb[:, 1, 0], math.cos(wanted), math.sin(wanted))
        error = np.arctan2(sine, cosine) - (wanted - course)
        worst = np.maximum(worst, np.abs(np.degrees(np.angle(np.exp(1j * error)))))
    return worst


LEG_S = 15.0  # of the square
LAST_S = 4.0  # of a leg: by then the corner is behind
ON_THE_LEG_DEG = 10.0


def _turned_deg(flight: Flight) -> Array:
    """True course relative to the first leg, to the right, degrees."""
    start_rad = math.radians(flight.manifest["config"]["start"]["heading_deg"])
    return np.degrees(np.unwrap(wrap(course_rad(flight) - start_rad)))


def _setpoint_deg(flight: Flight) -> Array:
    """The same of the commanded leg: 90 degrees more for each."""
    return 90.0 * np.clip(np.floor((time_s(flight) - FIRST_S) / LEG_S), 0, LEGS - 1)


def _off_the_legs_deg(flight: Flight) -> list[float]:
    """Error of the mean course at the end of each leg; NaN if the leg is not flown upside down."""
    t_s, off = time_s(flight), np.abs(_turned_deg(flight) - _setpoint_deg(flight))
    ends_s = [FIRST_S + (leg + 1) * LEG_S for leg in range(LEGS)]
    at_end = [(t_s > end_s - LAST_S) & (t_s <= end_s) for end_s in ends_s]
    return [float(off[at].mean()) if inverted(flight)[at].all() else math.nan for at in at_end]


def _wrong_sign(flight: Flight) -> int:
    """Number of ticks with the wrong sign of r_zz, except within 6 degrees of knife edge."""
    true, estimated = flight.log.truth["R_eb"][:, 2, 2], flight.log.flown["R_eb"][:, 2, 2]
    return int(np.sum((np.sign(true) != np.sign(estimated)) & (np.abs(true) > 0.1)))


def _square(flown: Sequence[Flight]) -> Panel:
    panel = Panel("An inverted square in flight", "deg to the right of the first leg", yticks=(0, 90, 180, 270))
    shown = [(f, (time_s(f) > FIRST_S) & (time_s(f) < FIRST_S + LEGS * LEG_S)) for f in flown]
    panel.traces([(time_s(f)[at] - FIRST_S, _turned_deg(f)[at]) for f, at in shown], GREEN, "course")
    flight, at = shown[0]
    panel.curve(time_s(flight)[at] - FIRST_S, _setpoint_deg(flight)[at], FAINT, "setpoint", "--", lw=1)
    return panel


@claim(Paper.THEORY, "Using DCM in control and navigation, uses 3 to 5", seeds=5)
def upside_down(seeds: Sequence[int]) -> Finding:
    """The matrix can be used for steering upside down.

    Cross and dot product of the nose with the desired direction give the way to turn even upside down; the sign of r_zz
    shows that the aircraft is inverted, and the third row with the gyros gives the turn rate.
    """
    flown = flights("inverted", seeds)
    off_the_legs = float(np.max([_off_the_legs_deg(flight) for flight in flown]))
    survive = percentage(flown, lambda flight: bool(survived(flight).value))
    log, R_eb = _estimated(OnItsBack(BANK_RAD), math.pi)
    upright_log, upright_R_eb = _estimated(SteadyTurn(BANK_RAD), 0.0)
    steering, upright = _steering_error_deg(R_eb, log), _steering_error_deg(upright_R_eb, upright_log)
    t_s = log.truth["t_s"]
    later = t_s > SETTLED_S
    off, off_upright = float(steering[later].max()), float(upright[later].max())
    r_zz = R_eb[:, 2, 2]
    sign_wrong = int(np.sum(np.sign(r_zz) != np.sign(log.truth["R_eb"][:, 2, 2])))
    turn_deg_s = np.degrees(np.einsum("ni,ni->n", R_eb[:, 2], log.measured["gyro_b_rad_s"]))
    true_deg_s = math.degrees(GRAVITY_M_S2 * math.tan(BANK_RAD) / 12.6)
    rate_error = float(np.abs(turn_deg_s - true_deg_s)[later].max())

    error = Panel("Error of the way to turn", "deg, the worst of 24 directions", xlim=(0.0, 40.0))
    error.curve(t_s, steering, BLUE, "upside down")
    error.curve(t_s, upright, ORANGE, "upright", "--", lw=1.2)
    elements = Panel("Estimated upside down", "r_zz; turn rate over true", legend="center right", xlim=(0.0, 40.0))
    elements.curves(t_s, {"r_zz": r_zz, "turn rate / true": turn_deg_s / true_deg_s}, (BLUE, ORANGE))
    elements.level(0.0)
    return Finding(
        lines=[
            line("upside down: largest steering error", "deg", off, "<=", 5.0),
            line("upside down: inclination error", "deg", float(tilt_deg(R_eb, log)[later].max()), "<=", 5.0),
            line("upside down: ticks with the wrong sign of r_zz", "", sign_wrong, "<=", 0.0),
            line("upside down: error of the turn rate about the vertical", "deg/s", rate_error, "<=", 0.5),
            line("in flight: flights that survive", "%", survive, ">=", 100.0),
            line("in flight: largest course error of a leg", "deg", off_the_legs, "<=", ON_THE_LEG_DEG),
            line("in flight: ticks with the wrong sign of r_zz", "", max(map(_wrong_sign, flown)), "<=", 0.0),
        ],
        summary=f"In inverted turns that begin with a heading error of 40 degrees, the deviation from any direction by "
        f"cross and dot product has an error of {off:.1f} degrees once yaw is locked (upright {off_upright:.1f}), the "
        f"turn rate one of {rate_error:.2f} deg/s, and r_zz is always negative. In an inverted square in wind, steered "
        f"by the estimate, the course error at the end of a leg is at most {off_the_legs:.0f} degrees.",
        panels=[error, elements, _square(flown)],
    )
