"""Throws that are not as they should be: long, banked, weak, tail first; each has its consequence."""

import math

import numpy as np
import pytest

from scenarios.harness.config import override
from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find
from sim.log import Outcome


def thrown(seed=2, **changes):
    """A hand launch with fields of its start changed, its time since the release, and its truth."""
    flight = fly_scenario(find("hand_launch"), {f"start.{k}": v for k, v in changes.items()}, seed=seed)
    return flight, flight.log.truth["t_s"] - flight.release_s, flight.log.truth


@pytest.mark.parametrize(("push_m_s2", "push_s"), [(10.0, 0.8), (27.0, 0.3), (40.0, 0.2), (6.0, 1.4)])
def test_push_of_any_length_no_thrust_in_the_hand_and_soon_after_it(push_m_s2, push_s):
    """The propeller stands at the release, and the throttle opens within 0.1 s of it; 40 m/s2 is beyond full scale."""
    flight, t_s, truth = thrown(push_m_s2=push_m_s2, push_s=push_s)
    assert np.all(truth["rotor_rpm"][t_s <= 1e-9] == 0.0)
    assert np.all(truth["thrust_n"][t_s <= 1e-9] <= 0.0)
    assert 0.0 < t_s[np.argmax(truth["throttle"] > 0.0)] < 0.1
    assert flight.outcome is Outcome.COMPLETED


@pytest.mark.parametrize("roll_deg", [-45.0, 45.0])
def test_throw_banked_is_levelled_within_2_s_above_the_ground(roll_deg):
    """45 degrees of bank in the hand: level to 10 degrees within 2 s, and then it climbs."""
    flight, t_s, truth = thrown(seed=1, roll_deg=roll_deg)
    R = truth["R_eb"]
    bank_deg = np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    assert bank_deg[np.searchsorted(t_s, 0.0)] == pytest.approx(roll_deg, rel=0, abs=12.0)
    after = (t_s > 2.0) & (t_s < 6.0)
    assert np.abs(bank_deg[after]).max() < 10.0
    assert -truth["p_e_m"][t_s > 0.0, 2].max() > 1.0
    assert flight.outcome is Outcome.COMPLETED


def test_throw_tail_first_is_not_a_throw_the_motor_stays_off():
    """It falls to the ground with the motor off: full throttle would drive it into the thrower."""
    flight, _, truth = thrown(backwards=True)
    assert flight.outcome is Outcome.GROUND_CONTACT
    assert np.all(truth["throttle"] == 0.0)


def test_throw_at_a_third_of_the_speed_hits_the_ground():
    """2.7 m/s, 40 % of the stalling speed: the motor starts, but the height of a hand is not enough."""
    flight, t_s, truth = thrown(push_s=0.1)
    assert flight.outcome is Outcome.GROUND_CONTACT
    assert t_s[-1] < 1.5
    assert np.all(truth["rotor_rpm"][t_s <= 1e-9] == 0.0)


def test_throw_slow_off_a_slope_is_caught_by_the_motor():
    """5.4 m/s, 20 % below the stall, 30 m above the ground: it loses less than 6 m and climbs."""
    flight, t_s, truth = thrown(push_s=0.2, height_m=30.0)
    assert flight.outcome is Outcome.COMPLETED
    assert -truth["p_e_m"][t_s > 0.0, 2].max() > 24.0


@pytest.mark.parametrize(
    ("name", "value", "right"),
    [
        ("start.roll_deg", 100.0, "at most 90"),
        ("start.roll_deg", math.nan, "finite"),
        ("start.backwards", "sideways", "boolean"),
        ("start.push_m_s2", -27.0, "above 0"),
    ],
)
def test_throw_impossible_is_rejected_in_one_line(name, value, right):
    """The field, its value, and what would be right."""
    with pytest.raises(ValueError, match=right) as problem:
        override(find("hand_launch").config, {name: value})
    assert name in str(problem.value)
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize("seed", [7, 9])
@pytest.mark.parametrize(("learn_held_s", "outcome"), [(20.0, Outcome.COMPLETED), (0.0, Outcome.GROUND_CONTACT)])
def test_throw_without_calibration_needs_the_offset_learnt_in_the_hand(seed, learn_held_s, outcome):
    """Held for 8 s with an offset of some degrees per second: the slow loop alone comes too late."""
    changes = {"estimator_params.learn_held_s": learn_held_s, "duration_s": 15.0}
    assert fly_scenario(find("cold_start"), changes, seed=seed).outcome is outcome
