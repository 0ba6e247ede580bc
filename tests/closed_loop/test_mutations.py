"""What each scenario catches: flight code broken in one respect, which fails where that respect matters.

Each row of the table is a scenario and what breaks it: a baseline, the default estimator with one idea of the
paper taken out, or an autopilot with a fault of its own; and the check that must notice.  The unbroken ones pass
the same seeds in `test_scenarios`.  Where the point of a scenario is a failure, it is the cure that must fail.
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
NO_OFFSET_EVER = {"estimator_params.k_i": 0, "estimator_params.learn_held_s": 0}
NO_LAG_FILTER = {"estimator_params.gps_lag_filter": "false", "estimator_params.rotate_history": "false"}
WEAK_FEEDBACK = {"estimator_params.w_rp": 0.05}
TRUSTS_FORCE = {"estimator_params.w_rp": 3.0}
NO_YAW = {"estimator_params.w_y": 0}
UNAWARE = {"withheld": "gps_latency_s"}
NOT_TOLD_THE_ELEVATION = {"withheld": "elevation_m"}
UNTURNED = {"turn_table": False}
TOLD_THE_LATENCY = {"estimator_params.gps_latency_s": 12.0}
BROKEN_AUTOPILOTS = Path(__file__).with_name("broken_autopilots.py")
TURNS_AT_THE_CORNER = {"autopilot": f"{BROKEN_AUTOPILOTS}:TurnsAtTheCorner"}
NEVER_MISSES_THE_GPS = {"autopilot": f"{BROKEN_AUTOPILOTS}:NeverMissesTheGps"}
CLIMBS_ON = {"autopilot": f"{BROKEN_AUTOPILOTS}:ClimbsOn"}
FLIES_THROUGH_THE_FENCE = {"autopilot": f"{BROKEN_AUTOPILOTS}:FliesThroughTheFence"}
LOOKS_TOO_LATE = {"autopilot": f"{BROKEN_AUTOPILOTS}:LooksAtTheFenceTooLate"}
BELIEVES_EVERY_FIX = {"autopilot": f"{BROKEN_AUTOPILOTS}:BelievesEveryFix"}
FOLLOWS_THE_COURSE = {"autopilot": f"{BROKEN_AUTOPILOTS}:FollowsTheCourse"}
CRUISES_ON = {"autopilot": f"{BROKEN_AUTOPILOTS}:CruisesOn"}
NEVER_INVERTED = {"autopilot": f"{BROKEN_AUTOPILOTS}:NeverInverted"}
HALF_THE_RATE = {"autopilot": f"{BROKEN_AUTOPILOTS}:HalfTheRate"}
IGNORES_THE_ELEVATOR = {"autopilot": f"{BROKEN_AUTOPILOTS}:IgnoresTheElevator"}
NEVER_TRIMS = {"autopilot": f"{BROKEN_AUTOPILOTS}:NeverTrims"}
RUDDER_STUCK = {"autopilot": f"{BROKEN_AUTOPILOTS}:RudderStuck"}


class Mutation(NamedTuple):
    """A scenario, the estimator that flies it and what is changed in it, and the check that fails."""

    scenario: str
    estimator: str
    changes: dict[str, object]
    noticed_by: str


MUTATIONS = (
    Mutation("bench_rest", "gyro_only", {}, "inclination error RMS"),
    Mutation("bench_rest", "accelerometer_only", {}, "offset across the vertical not learnt"),
    Mutation("bench_rest", "premerlani", NO_OFFSET, "offset across the vertical not learnt"),
    Mutation("bench_rest_magnetometer", "dilshad", UNTURNED, "heading error at its worst"),
    Mutation("bench_rest_magnetometer", "premerlani", {}, "heading, standard deviation"),
    Mutation("circle", "accelerometer_only", {}, "survived"),
    Mutation("circle", "gyro_only", {}, "heading error RMS"),
    Mutation("circle", "premerlani", NO_LAG_FILTER, "heading error RMS"),
    Mutation("cold_start", "gyro_only", {}, "survived"),
    Mutation("cold_start", "premerlani", NO_OFFSET_EVER, "offset not learnt"),
    Mutation("cold_start_moved", "accelerometer_only", {}, "survived"),
    Mutation("cold_start_moved", "premerlani", NO_OFFSET_EVER, "inclination within 6 deg for good"),
    Mutation("cold_start_no_gps", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("crosswind", "gyro_only", {}, "survived"),
    Mutation("crosswind", "premerlani", NO_YAW, "heading error RMS"),
    Mutation("crosswind_strong", "premerlani", NO_YAW, "heading error RMS"),
    Mutation("faults", "accelerometer_only", {}, "survived"),
    Mutation("faults", "premerlani", TRUSTS_FORCE, "inclination error, accelerometer stuck"),
    Mutation("fence", "premerlani", FLIES_THROUGH_THE_FENCE, "greatest distance from the launch point"),
    Mutation("fence", "premerlani", LOOKS_TOO_LATE, "greatest distance from the launch point"),
    Mutation("gentle_lady_launch", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("gentle_lady_launch_calm", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("gentle_lady_launch_cross_wind", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("gentle_lady_launch_gust", "premerlani", TRUSTS_FORCE, "inclination error RMS"),
    Mutation("gentle_lady_launch_head_wind", "gyro_only", {}, "heading within 15 deg for good"),
    Mutation("gentle_lady_return", "gyro_only", {}, "inclination error RMS"),
    Mutation("gps_latency", "premerlani", TOLD_THE_LATENCY, "heading error RMS, to be large"),
    Mutation("gps_latency_ms_200", "premerlani", NO_YAW, "heading error RMS"),
    Mutation("gps_latency_s_1", "premerlani", NO_LAG_FILTER, "heading error RMS"),
    Mutation(
        "gps_latency_s_3", "premerlani", {"estimator_params.gps_latency_s": 3.0}, "heading error RMS, to be large"
    ),
    Mutation("gps_latency_told_12", "premerlani", UNAWARE, "heading error RMS"),
    Mutation("gps_latency_told_3", "premerlani", UNAWARE, "heading error RMS"),
    Mutation("gps_outage", "gyro_only", {}, "survived"),
    Mutation("gps_outage", "premerlani", NEVER_MISSES_THE_GPS, "circled"),
    Mutation("gps_outage", "premerlani", NO_OFFSET, "inclination error RMS afterwards"),
    Mutation("gyro_gain", "gyro_only", {}, "heading error RMS"),
    Mutation("gyro_gain", "premerlani", NO_OFFSET, "mean error of the corrected yaw rate"),
    Mutation("gyro_offset", "premerlani", NO_OFFSET, "offset not learnt"),
    Mutation("gyro_saturation", "gyro_only", {}, "survived"),
    Mutation("gyro_saturation", "premerlani", WEAK_FEEDBACK, "inclination within 15 deg for good"),
    Mutation("hand_launch", "accelerometer_only", {}, "survived"),
    Mutation("hand_launch_accelerometer", "premerlani", {}, "pitch when it hits the ground"),
    Mutation("hand_launch_calm", "premerlani", TRUSTS_FORCE, "survived"),
    Mutation("hand_launch_cross_wind", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("hand_launch_gust", "accelerometer_only", {}, "survived"),
    Mutation("hand_launch_head_wind", "gyro_only", {}, "heading within 15 deg for good"),
    Mutation("inverted", "gyro_only", {}, "survived"),
    Mutation("inverted", "premerlani", NO_YAW, "heading error RMS upside down"),
    Mutation("inverted", "premerlani", NEVER_INVERTED, "upside down"),
    Mutation("iron", "gps_velocity_magnetometer", UNTURNED, "heading error of the nose RMS"),
    Mutation("iron", "gyro_only", {}, "heading error of the nose RMS"),
    Mutation(
        "iron_uncalibrated",
        "gps_velocity_magnetometer",
        {"turn_table": True},
        "heading error of the nose, to be large",
    ),
    Mutation("launch_no_gps", "premerlani", CLIMBS_ON, "greatest height"),
    Mutation("loiter_gps_stuck", "gyro_only", {}, "survived"),
    Mutation("loiter_gps_stuck", "premerlani", BELIEVES_EVERY_FIX, "circled"),
    Mutation("loiter_wind", "premerlani", FOLLOWS_THE_COURSE, "greatest distance from the centre"),
    Mutation("loiter_wind_nose", "gps_velocity_nose", CRUISES_ON, "heading error RMS"),
    Mutation("loops", "premerlani", WEAK_FEEDBACK, "inclination error RMS"),
    Mutation("loops_outside", "premerlani", WEAK_FEEDBACK, "inclination error RMS"),
    Mutation("motor_dead", "premerlani", IGNORES_THE_ELEVATOR, "angle of attack"),
    Mutation("motor_dead", "premerlani", {"faults": "motor:dead@20-25"}, "time to the ground"),
    Mutation("motor_dead_battery", "premerlani", IGNORES_THE_ELEVATOR, "angle of attack"),
    Mutation("maiden_flight", "premerlani", NEVER_TRIMS, "off the course RMS"),
    Mutation("return_to_launch", "premerlani", NO_YAW, "first within 25 m of the launch point"),
    Mutation("return_to_launch_strong_wind", "premerlani", NO_YAW, "first within 25 m of the launch point"),
    Mutation("return_to_launch_strong_wind_nose", "premerlani", NO_YAW, "first within 25 m of the launch point"),
    Mutation(
        "return_to_launch_stronger_wind", "gps_velocity_nose", CRUISES_ON, "first within 25 m of the launch point"
    ),
    Mutation("rolls", "premerlani", WEAK_FEEDBACK, "inclination error RMS while rolling"),
    Mutation("rolls", "premerlani", HALF_THE_RATE, "rolled to the left"),
    Mutation("rolls_figures", "premerlani", WEAK_FEEDBACK, "inclination error RMS afterwards"),
    Mutation("soaring", "accelerometer_only", {}, "survived"),
    Mutation("soaring", "premerlani", NO_YAW, "height at the end"),
    Mutation("stall_spin", "premerlani", NO_YAW, "heading within 15 deg for good"),
    Mutation("stall_spin", "premerlani", WEAK_FEEDBACK, "inclination error RMS afterwards"),
    Mutation("stall_spin", "premerlani", RUDDER_STUCK, "spun"),
    Mutation("turbulence_mission", "premerlani", NO_YAW, "waypoints reached"),
    Mutation("turbulence_mission", "premerlani", TURNS_AT_THE_CORNER, "off the legs RMS"),
    Mutation("turns_180", "accelerometer_only", {}, "survived"),
    Mutation("turns_180", "premerlani", NO_YAW, "heading below 10 deg after roll-out"),
    Mutation("turns_180_bank_30", "premerlani", WEAK_FEEDBACK, "inclination error RMS while banked"),
    Mutation("turns_180_bank_45", "premerlani", NO_YAW, "heading below 10 deg after roll-out"),
    Mutation("turns_180_bank_60", "premerlani", TRUSTS_FORCE, "inclination error RMS while banked"),
    Mutation("turns_180_bank_60", "premerlani", {"manoeuvre.bank_deg": 45.0}, "banked by 54 deg or more"),
    Mutation("turns_180_high", "premerlani", NOT_TOLD_THE_ELEVATION, "inclination error RMS while banked"),
    Mutation("vertical", "premerlani", NO_YAW, "heading error RMS afterwards"),
    Mutation("vertical", "premerlani", TRUSTS_FORCE, "inclination error RMS while going up and over"),
    Mutation("vertical", "premerlani", RUDDER_STUCK, "swung round to the left"),
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
    whole = any(flight.outcome == Outcome.COMPLETED for flight in flown) or not noticed.note
    assert mutation.noticed_by == "survived" or whole
