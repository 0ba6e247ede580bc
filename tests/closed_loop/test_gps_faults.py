"""Faults of the fixes, flown in a circle about the launch point: noticed within 3 s, or flown on, as is stated.

Each is flown with a counterpart beside it that does not cope: an autopilot that believes every fix, one that is too
impatient for fewer fixes, an estimator without a course.
"""

from pathlib import Path

import numpy as np
import pytest

from autopilot.interface import Mode
from scenarios.harness.checks import SURVIVED
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.flight import fly_scenario
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import loiter
from sim.log import Outcome

BROKEN = Path(__file__).with_name("broken_autopilots.py")
BELIEVES = {"autopilot": f"{BROKEN}:BelievesEveryFix"}
FROM_S, TO_S, END_S = 40.0, 70.0, 90.0
CIRCLE = Scenario(
    name="circle_of_60_m",
    story="A circle about the launch point.",
    config=FlightConfig(
        duration_s=END_S,
        start=InFlightStart(height_m=80.0),
        air=AirConfig(wind_m_s=4.0, wind_from_deg="random", turbulence_w20_m_s=2.0),
        manoeuvre={"height_m": 80.0, "radius_m": 60.0},
    ),
    script=loiter,
    checks=(SURVIVED,),
)


def flown(fault, seed=1, estimator="premerlani", **changes):
    """The flight with that fault of the GPS for 30 s."""
    faults = f"gps:{fault}@{FROM_S:g}-{TO_S:g}"
    return fly_scenario(CIRCLE, {"faults": faults} | changes, seed=seed, estimator=estimator)


def blind_s(flight):
    """Times in CIRCLE or GLIDE, s after the release."""
    t_s = flight.log.truth["t_s"] - flight.release_s
    return t_s[np.isin(flight.log.flown["mode"], (Mode.CIRCLE, Mode.GLIDE))]


def inclination_deg(flight):
    """Error of the vertical."""
    cosine = np.sum(flight.log.truth["R_eb"][:, 2] * flight.log.flown["R_eb"][:, 2], axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def from_centre_m(flight):
    """Horizontal distance from the launch point."""
    return np.hypot(flight.log.truth["p_e_m"][:, 0], flight.log.truth["p_e_m"][:, 1])


@pytest.mark.parametrize("fault", ["stuck", "frozen_position", "frozen_velocity", "frozen_course", "jump=50,0"])
def test_fix_that_cannot_be_true_is_no_gps_within_3_s(fault):
    """No false alarm before, CIRCLE within 3 s, and back on the circle two seconds after the fault."""
    flight = flown(fault)
    assert flight.outcome == Outcome.COMPLETED
    blind = blind_s(flight)
    assert FROM_S < blind[0] <= FROM_S + 3.1  # the first fix of the window comes up to a quarter of a second late
    assert blind[-1] <= TO_S + (6.1 if fault.startswith("jump") else 2.6)  # it jumps back
    assert inclination_deg(flight)[round(FROM_S * 50) :].max() < 15.0  # 8.6 to 10.4


@pytest.mark.parametrize("fault", ["stuck", "frozen_position", "frozen_velocity", "frozen_course", "jump=50,0"])
def test_autopilot_that_believes_every_fix_does_not_notice(fault):
    """It never circles for lack of a GPS."""
    assert len(blind_s(flown(fault, **BELIEVES))) == 0


@pytest.mark.parametrize("fault", ["whole_degrees", "rate=1", "spikes=50,0.1"])
def test_fault_that_leaves_enough_is_flown_on(fault):
    """Course in whole degrees, one fix a second, every tenth position wrong: the circle goes on."""
    flight = flown(fault)
    assert flight.outcome == Outcome.COMPLETED
    assert len(blind_s(flight)) == 0
    assert from_centre_m(flight)[round(FROM_S * 50) :].max() < 100.0  # 60 is meant
    assert inclination_deg(flight)[round(FROM_S * 50) :].max() < 15.0


def test_autopilot_that_is_impatient_takes_fewer_fixes_for_none():
    """Its limit is shorter than the interval of the fixes."""
    assert len(blind_s(flown("rate=1", autopilot=f"{BROKEN}:Impatient"))) > 0


def test_drift_leads_the_aeroplane_away_and_the_attitude_stays():
    """Nothing shows it: 30 m in 30 s; its end is a jump back, and the circle returns to the launch point."""
    flight = flown("drift=1,0")
    assert flight.outcome == Outcome.COMPLETED
    assert blind_s(flight)[0] > TO_S
    turn = slice(round((TO_S - 29.0) * 50), round(TO_S * 50))
    assert flight.log.truth["p_e_m"][turn, 0].mean() < -8.0  # the last circle lies south of it
    assert inclination_deg(flight)[round(FROM_S * 50) :].max() < 15.0


@pytest.mark.parametrize(("changes", "survives"), [({}, True), ({"autopilot": f"{BROKEN}:TrustsThePitch"}, False)])
def test_circle_is_held_by_the_speed_where_the_pitch_is_wrong(changes, survives):
    """A minute without a GPS: the pitch of matrixpilot errs by 10 degrees."""
    stuck = {"faults": "gps:stuck@60-120", "duration_s": 125.0}
    flight = fly_scenario(CIRCLE, stuck | changes, seed=0, estimator="matrixpilot")
    assert (flight.outcome == Outcome.COMPLETED) == survives
    if survives:
        assert -flight.log.truth["p_e_m"][:, 2].max() > 15.0  # 22 or more, of 80
