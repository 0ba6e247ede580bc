"""The scenarios flown: the oracle and the default estimator pass, broken estimators do not, flights repeat."""

from functools import cache

import numpy as np
import pytest

from estimator.interface import AttitudeEstimate
from scenarios.harness.config import FlightConfig
from scenarios.harness.flight import fly_config, fly_scenario
from scenarios.harness.metrics.manoeuvres import roll_outs
from scenarios.harness.registry import find, registered
from scenarios.harness.verdict import Verdict, judge
from sim.log import Flight, Outcome, Phase

NAMES = sorted(registered())
TO_FAIL = {name for name, scenario in registered().items() if scenario.expected_to_fail}


@cache
def flown(name: str, seed: int, estimator: str | None) -> Flight:
    """A flight, cached for all tests that use it; None is the scenario's own estimator."""
    return fly_scenario(find(name), seed=seed, estimator=estimator)


def same(a: Flight, b: Flight) -> bool:
    """Whether two logs are equal to the last bit."""
    return all(
        getattr(a.log, table).tobytes() == getattr(b.log, table).tobytes() for table in ("truth", "measured", "flown")
    )


class AlwaysLevel:
    """Always estimates level and north."""

    def update(self, _m):
        return AttitudeEstimate(np.eye(3))


class UpsideDown:
    """Always estimates upside down."""

    def update(self, _m):
        return AttitudeEstimate(np.diag((1.0, -1.0, -1.0)))


class RaisesAtThree:
    """Raises 3 s after power-up."""

    def update(self, m):
        if m.imu.t_s > 3.0:
            raise RuntimeError("had enough")
        return AttitudeEstimate(np.eye(3))


@pytest.mark.parametrize("name", sorted(set(NAMES) - TO_FAIL))
def test_oracle_passes_every_scenario(name):
    """With the true attitude every scenario passes: failures are due to the estimator."""
    scenario = find(name)
    verdict = Verdict.of((scenario, judge(scenario, flown(name, seed, "oracle"))) for seed in (0, 1))
    assert verdict.passed, verdict.to_markdown()


@pytest.mark.parametrize("name", sorted(TO_FAIL))
def test_oracle_does_not_pass_scenarios_that_expect_a_failure(name):
    """With the true attitude the aeroplane flies on, and the expected failure does not occur."""
    flight = flown(name, 0, "oracle")
    assert flight.outcome == Outcome.COMPLETED
    assert not judge(find(name), flight).passed


@pytest.mark.parametrize("name", NAMES)
def test_every_scenario_passes_with_its_own_estimator(name):
    """The project's gate on two seeds, with the limits of single flights (the pooled limits are for ten seeds)."""
    scenario = find(name)
    for seed in (0, 1):
        verdict = judge(scenario, flown(name, seed, None))
        assert verdict.passed, (verdict.outcome, verdict.message, [row for row in verdict.rows if not row.passed])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("broken", [AlwaysLevel, UpsideDown])
def test_broken_estimator_fails_every_scenario(name, broken):
    """An estimator that ignores its sensors must not pass."""
    scenario = find(name)
    assert not judge(scenario, fly_scenario(scenario, estimator=broken)).passed


def test_estimator_that_raises_ends_the_flight_with_its_name_and_the_time():
    """The flight up to there is judged, and the exit code is 1."""
    scenario = find("crosswind")
    flight = fly_scenario(scenario, estimator=RaisesAtThree)
    assert flight.outcome == Outcome.ESTIMATOR_FAILED
    assert "RaisesAtThree at 3.02 s" in flight.message
    assert len(flight.log) == 150
    assert Verdict.of([(scenario, judge(scenario, flight))]).exit_code == 1


def test_flight_of_the_same_seed_is_bit_equal_and_of_another_is_not():
    """In every column of truth, measurements and estimate."""
    scenario = find("hand_launch")
    assert same(fly_scenario(scenario, seed=0), flown("hand_launch", 0, None))
    assert not same(flown("hand_launch", 1, None), flown("hand_launch", 0, None))


def test_flight_flown_again_from_its_manifest_is_bit_equal():
    """The resolved configuration determines the flight."""
    scenario, overrides = find("hand_launch"), {"wind": "4@random", "gps.latency_s": "0.6", "duration_s": "6"}
    first = fly_scenario(scenario, overrides, seed=3)
    assert same(first, fly_config(scenario, FlightConfig(**first.manifest["config"])))


def test_hand_launch_is_held_thrown_and_then_flies():
    """8 s in the hand at 1.7 m, then 0.3 s of 27 m/s^2: 8.1 m/s along the nose, over the ground, at the release."""
    flight = flown("hand_launch", 0, "oracle")
    truth = flight.log.truth
    phases = truth["phase"][np.flatnonzero(np.diff(truth["phase"], prepend=-1))]
    assert list(phases) == [Phase.HELD, Phase.THROWN, Phase.FLYING]
    assert flight.release_s == pytest.approx(8.3, rel=0, abs=1e-9)
    held = truth[truth["phase"] == Phase.HELD]
    np.testing.assert_allclose(-held["p_e_m"][:, 2], 1.7, rtol=0, atol=1e-6)
    # The nose turns with the wrist while it is pushed, at 15 deg/s: that bends the path, and costs 1 % at most.
    released = truth[truth["phase"] == Phase.THROWN][-1]
    assert np.linalg.norm(released["v_e_m_s"]) == pytest.approx(8.1, rel=0, abs=0.1)


@pytest.mark.parametrize("side", ["left", "right"])
def test_wind_blows_from_the_configured_direction(side):
    """5 m/s from the left of a northward flight blows east; turbulence off, so to the last digits of a degree."""
    from_deg, east_m_s = {"left": (270.0, 5.0), "right": (90.0, -5.0)}[side]
    overrides = {
        "start.heading_deg": 0, "wind": f"5@{from_deg}", "air.turbulence_w20_m_s": 0, "duration_s": 25,
    }  # fmt: skip
    flight = fly_scenario(find("crosswind"), overrides, estimator="oracle")
    np.testing.assert_allclose(
        flight.log.truth["wind_e_m_s"][:, :2], [[0.0, east_m_s]] * len(flight.log), rtol=0, atol=0.01
    )
    # Holding the course, the nose is asin(5 / airspeed) into the wind.
    last = flight.log.truth[-1]
    crab_rad = np.arctan2(last["R_eb"][1, 0], last["R_eb"][0, 0])
    assert np.sin(crab_rad) == pytest.approx(-east_m_s / last["airspeed_m_s"], rel=0, abs=0.06)  # 3.5 degrees


def test_turns_180_are_turns_of_the_course_by_half_a_circle():
    """Three roll-outs; 10 s after each the course is reversed, within the weave of the course hold."""
    flight = flown("turns_180", 0, "oracle")
    t_s, v = flight.log.truth["t_s"], flight.log.truth["v_e_m_s"]
    course = np.unwrap(np.arctan2(v[:, 1], v[:, 0]))
    outs = roll_outs(flight)
    assert len(outs) == 3
    settled = [course[np.searchsorted(t_s, t)] for t in (24.0, *(r.t_s + 15.0 for r in outs))]
    turned_deg = np.degrees(np.abs(np.diff(settled)))
    np.testing.assert_allclose(turned_deg, 180.0, rtol=0, atol=12.0)
    straight_s = [r.until_s - r.t_s for r in outs]
    assert min(straight_s) >= 30.0


def test_gyro_gain_is_learnt_as_an_equivalent_offset():
    """In a steady turn a gain of 0.9 equals an offset of -0.1 times the rate, within the part's gain error of 1.5 %.

    The true offset of the part, times 0.9, is in the truth; 0.3 deg/s is what gain and cross-axis of the part make
    of 16 deg/s at one sigma, and the scatter of what is learnt in turbulence.
    """
    flight = flown("gyro_gain", 0, None)
    late = flight.log.truth["t_s"] > 100.0
    learnt = flight.log.flown["gyro_bias_b_rad_s"][late, 2] - flight.log.truth["gyro_bias_b_rad_s"][late, 2]
    predicted = -0.1 * flight.log.truth["imu_omega_b_rad_s"][late, 2].mean()
    assert predicted < np.radians(-1.2)
    np.testing.assert_allclose(learnt.mean(), predicted, rtol=0, atol=np.radians(0.3))


def test_gps_latency_is_harmless_if_the_estimator_knows_it():
    """If the same late fixes are compared with the heading of that time, the heading error is a tenth."""
    scenario = find("gps_latency")
    row = {"unaware": 0.0, "known": 0.0}
    for name, changes in (("unaware", {}), ("known", {"estimator_params.gps_latency_s": 12.0})):
        verdict = judge(scenario, fly_scenario(scenario, changes, seed=0))
        row[name] = next(r.measured for r in verdict.rows if r.name.startswith("heading"))
    assert row["known"] < 0.1 * row["unaware"]


def test_hand_launch_with_the_accelerometer_alone_dives_while_it_estimates_a_climb():
    """The elevator is down and the nose falls while the estimate shows a climb; the throw is that of `hand_launch`."""
    flight = flown("hand_launch_accelerometer", 0, None)
    falling = flight.log.truth[-25:-5]  # half a second, ending a tenth before the ground
    believed = flight.log.flown[-25:-5]
    assert (believed["R_eb"][:, 2, 0] < 0.0).mean() > 0.9
    assert believed["elevator"].mean() < -0.2
    assert np.diff(-falling["R_eb"][:, 2, 0]).mean() < 0.0
    plain = flown("hand_launch", 0, None).log.truth
    np.testing.assert_array_equal(plain[plain["phase"] == Phase.HELD]["R_eb"][:100], flight.log.truth["R_eb"][:100])


@pytest.mark.parametrize("degrees", [30.0, 45.0, 60.0])
def test_turns_180_at_a_bank_carry_the_load_of_it(degrees):
    """A level turn needs a load factor of 1 / cos(bank), 2 at 60 degrees: the median, within turbulence."""
    flight = flown(f"turns_180_bank_{degrees:g}", 0, "oracle")
    truth = flight.log.truth
    bank = np.degrees(np.abs(np.arctan2(truth["R_eb"][:, 2, 1], truth["R_eb"][:, 2, 2])))
    held = np.abs(bank - degrees) < 3.0
    load = -truth["imu_force_b_m_s2"][held, 2] / 9.80665
    assert held.sum() * flight.dt_s > 2.0
    assert np.median(load) == pytest.approx(1.0 / np.cos(np.radians(degrees)), rel=0.1)


def test_milestones_are_events_of_the_flight():
    """The end of the third loop, the roll-outs and the pass home are in the recording."""
    texts = {e.text for name in ("loops", "turns_180", "return_to_launch") for e in flown(name, 0, "oracle").events}
    assert texts >= {"third loop ended", "rolled out", "over the launch point"}
