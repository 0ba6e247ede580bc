"""What each scenario catches: estimators broken in one respect, each of which fails where that respect matters.

Each row of the table is a scenario and what breaks it: a baseline, or the default estimator with one idea of the
paper taken out; and the check that must notice.  The unbroken estimator passes the same seeds in `test_scenarios`.
For `gps_latency`, whose point is a failure, it is the cure that must fail.
"""

from pathlib import Path
from typing import NamedTuple

import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find, registered
from scenarios.harness.verdict import Verdict, judge
from sim.log import Outcome

SEEDS = (0, 1)
NO_OFFSET = {"estimator_params.k_i": 0}
NO_LAG_FILTER = {"estimator_params.gps_lag_filter": "false", "estimator_params.rotate_history": "false"}
WEAK_FEEDBACK = {"estimator_params.w_rp": 0.05}
TRUSTS_FORCE = {"estimator_params.w_rp": 3.0}
NO_YAW = {"estimator_params.w_y": 0}
TOLD_THE_LATENCY = {"estimator_params.gps_latency_s": 12.0}
_BROKEN = Path(__file__).with_name("broken_autopilots.py")
TURNS_AT_THE_CORNER = {"autopilot": f"{_BROKEN}:TurnsAtTheCorner"}
NEVER_MISSES_THE_GPS = {"autopilot": f"{_BROKEN}:NeverMissesTheGps"}


class Mutation(NamedTuple):
    """A scenario, the estimator that flies it and what is changed in it, and the check that fails."""

    scenario: str
    estimator: str
    changes: dict[str, object]
    noticed_by: str


MUTATIONS = (
    Mutation("circle", "accelerometer_only", {}, "survived"),
    Mutation("circle", "gyro_only", {}, "heading error RMS"),
    Mutation("circle", "premerlani", NO_LAG_FILTER, "heading error RMS"),
    Mutation("crosswind", "gyro_only", {}, "inclination error RMS"),
    Mutation("crosswind", "premerlani", NO_YAW, "heading error RMS"),
    Mutation("faults", "accelerometer_only", {}, "survived"),
    Mutation("faults", "premerlani", TRUSTS_FORCE, "inclination error, accelerometer stuck"),
    Mutation("gentle_lady_launch", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("gentle_lady_return", "gyro_only", {}, "inclination error RMS"),
    Mutation("gps_latency", "premerlani", TOLD_THE_LATENCY, "heading error RMS, to be large"),
    Mutation("gps_outage", "gyro_only", {}, "survived"),
    Mutation("gps_outage", "premerlani", NEVER_MISSES_THE_GPS, "circled"),
    Mutation("gps_outage", "premerlani", NO_OFFSET, "inclination error RMS afterwards"),
    Mutation("gyro_gain", "gyro_only", {}, "heading error RMS"),
    Mutation("gyro_gain", "premerlani", NO_OFFSET, "mean error of the corrected yaw rate"),
    Mutation("gyro_offset", "premerlani", NO_OFFSET, "offset not learnt"),
    Mutation("gyro_saturation", "gyro_only", {}, "survived"),
    Mutation("gyro_saturation", "premerlani", WEAK_FEEDBACK, "inclination within 15 deg for good"),
    Mutation("hand_launch", "accelerometer_only", {}, "survived"),
    Mutation("loops", "premerlani", WEAK_FEEDBACK, "inclination error RMS"),
    Mutation("return_to_launch", "premerlani", NO_YAW, "first within 25 m of the launch point"),
    Mutation("turbulence_mission", "premerlani", NO_YAW, "waypoints reached"),
    Mutation("turbulence_mission", "premerlani", TURNS_AT_THE_CORNER, "off the legs RMS"),
    Mutation("turns_180", "accelerometer_only", {}, "survived"),
    Mutation("turns_180", "premerlani", NO_YAW, "heading below 10 deg after roll-out"),
)


def test_every_scenario_has_a_mutation():
    """A scenario that nothing fails judges nothing."""
    assert {mutation.scenario for mutation in MUTATIONS} == set(registered())


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: f"{m.scenario}-{m.estimator}-{'-'.join(m.changes)}")
def test_scenario_notices_what_is_broken(mutation):
    """Pooled as the gate does, the check that is about what was taken out fails, and not only on flights cut short."""
    scenario = find(mutation.scenario)
    flown = [fly_scenario(scenario, mutation.changes, seed=s, estimator=mutation.estimator) for s in SEEDS]
    (pooled,) = Verdict.of((scenario, judge(scenario, flight)) for flight in flown).pooled
    noticed = pooled.rows[[check.name for check in scenario.checks].index(mutation.noticed_by)]
    assert not noticed.passed, noticed
    assert mutation.noticed_by == "survived" or any(flight.outcome == Outcome.COMPLETED for flight in flown)
