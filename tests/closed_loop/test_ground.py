"""Ground that is lower or higher than the launch point, flown closed loop."""

import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find
from sim.log import Outcome

HILL = {"place.ground_m": -30.0, "place.ground_from_m": 20.0}


@pytest.mark.parametrize(("changes", "lands_m"), [({}, 0.0), (HILL, -30.0)])
def test_sailplane_thrown_from_a_hill_sinks_below_the_launch_point(changes, lands_m):
    """On level ground it lands at that height; below the hill it flies on and lands 30 m lower."""
    flown = fly_scenario(find("gentle_lady_launch_calm"), {"duration_s": 150.0, **changes}, seed=0)
    assert flown.outcome is Outcome.GROUND_CONTACT
    assert -flown.log.truth["p_e_m"][-1, 2] == pytest.approx(lands_m, abs=0.7)


@pytest.mark.parametrize(("ground_m", "ends"), [(-70.0, Outcome.COMPLETED), (70.0, Outcome.GROUND_CONTACT)])
def test_higher_ground_ends_a_flight_that_lower_ground_does_not(ground_m, ends):
    """The stated consequence: the autopilot holds its height above the launch point, and flies into the slope."""
    changes = {"duration_s": 60.0, "place.ground_m": ground_m, "place.ground_from_m": 300.0}
    flown = fly_scenario(find("crosswind"), changes, seed=1)
    assert flown.outcome is ends
    if ends is Outcome.GROUND_CONTACT:
        assert -flown.log.truth["p_e_m"][-1, 2] > 40.0
