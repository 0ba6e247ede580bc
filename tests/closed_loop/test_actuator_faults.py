"""Actuator and motor faults flown: what the aeroplane survives, and what it does not, as the documentation says."""

from functools import cache

import numpy as np
import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.metrics import inclination_error_deg
from scenarios.harness.registry import find
from sim.log import Outcome

BEGIN_S, DURATION_S = 20.0, 70.0
SEEDS = (0, pytest.param(1, marks=pytest.mark.long))


@cache
def flown(fault, seed=0, scenario="turns_180", **changes):
    """A flight with turns at 80 m, 3 m/s of wind and turbulence, on the default estimator."""
    faults = [fault] if fault else []
    return fly_scenario(find(scenario), {"faults": faults, "duration_s": DURATION_S, **changes}, seed=seed)


def since_begin(flight):
    return flight.log.truth[round(BEGIN_S / flight.dt_s) :]


def bank_error_deg(flight):
    """RMS of bank minus demand from the fault on."""
    R, wanted = since_begin(flight)["R_eb"], flight.log.flown["bank_demand_rad"][-len(since_begin(flight)) :]
    bank = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    return float(np.degrees(np.sqrt(np.nanmean((bank - wanted) ** 2))))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "fault",
    [
        "aileron:stuck=0", "aileron:lost", "aileron:slow=0.5", "aileron:slack=0.4", "elevator:stuck", "elevator:lost",
        "elevator:slow=0.5", "elevator:slack=0.4", "rudder:stuck=0.5", "rudder:reversed", "rudder:lost", "motor:weak",
        "motor:stuck=1",
    ],
)  # fmt: skip
def test_fault_that_is_survived(fault, seed):
    """50 s on, with turns, it still flies, well above the ground."""
    flight = flown(f"{fault}@{BEGIN_S:g}", seed)
    assert flight.outcome == Outcome.COMPLETED
    assert -since_begin(flight)["p_e_m"][:, 2].max() > 25.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("fault", "within_s"),
    [
        ("aileron:stuck=0.3", 25.0),
        ("aileron:reversed", 25.0),
        ("elevator:reversed", 12.0),
        ("elevator:stuck=-0.5", 12.0),
    ],
)
def test_fault_that_is_not_survived(fault, within_s, seed):
    """It is down within this time, also on the true attitude: the control has failed, and not the estimate."""
    for estimator in ("premerlani", "oracle"):
        flight = flown(f"{fault}@{BEGIN_S:g}", seed, estimator=estimator)
        assert flight.outcome == Outcome.GROUND_CONTACT
        assert flight.log.truth["t_s"][-1] - BEGIN_S < within_s
    error = inclination_error_deg(flown(f"{fault}@{BEGIN_S:g}", seed)).within(BEGIN_S, BEGIN_S + 1.0)
    assert error.value.max() < 15.0


def test_slack_makes_the_bank_swing():
    """A limit cycle: with play of 0.4 in the ailerons the roll rate is half again as large, the bank twice as wrong."""
    sound, slack = flown(""), flown(f"aileron:slack=0.4@{BEGIN_S:g}")
    assert bank_error_deg(slack) > 2.0 * bank_error_deg(sound)
    rolling = [np.std(since_begin(flight)["omega_b_rad_s"][:, 0]) for flight in (slack, sound)]
    assert rolling[0] > 1.3 * rolling[1]


def test_slow_aileron_is_worse_the_slower():
    """At half a deflection a second the bank is hardly less exact; at a tenth it is lost, and the flight survives."""
    half, tenth = (bank_error_deg(flown(f"aileron:slow={rate}@{BEGIN_S:g}")) for rate in (0.5, 0.1))
    assert half < 8.0
    assert tenth > 20.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("scenario", "changes"),
    [
        ("crosswind", {"estimator": "ap_dcm"}),
        ("turbulence_mission", {}),
        ("gps_outage", {"faults": ("gps:outage@20", "motor:dead@40")}),
        ("hand_launch", {"faults": ("motor:dead@2",), "duration_s": 60.0}),
    ],
)
def test_dead_motor_ends_in_a_landing(scenario, changes, seed):
    """Whatever it was doing, and without fixes: down at less than 3 m/s, wings within 25 degrees of level."""
    conditions = {"faults": ("motor:dead@30",), "duration_s": 230.0} | changes
    flight = fly_scenario(find(scenario), conditions, seed=seed)
    assert flight.outcome == Outcome.GROUND_CONTACT
    down = flight.log.truth[-6]
    assert down["v_e_m_s"][2] < 3.0
    assert abs(np.degrees(np.arctan2(down["R_eb"][2, 1], down["R_eb"][2, 2]))) < 25.0


def test_events_name_the_fault_and_its_end():
    """As for sensors."""
    flight = flown("rudder:stuck=0.5@20-30", duration_s=35.0)
    events = {event.text: event.t_s for event in flight.events if "rudder" in event.text}
    assert events == {"fault rudder:stuck=0.5@20-30": 20.0, "fault rudder:stuck=0.5@20-30 ended": 30.0}
    assert flight.manifest["config"]["faults"] == ["rudder:stuck=0.5@20-30"]
