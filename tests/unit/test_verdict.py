"""The verdict as JSON, JUnit XML and Markdown, and its exit code."""

import json
import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import FlightConfig
from scenarios.harness.metrics import Measured, summary
from scenarios.harness.scenario import Scenario
from scenarios.harness.verdict import FlightVerdict, Verdict, judge, metric_name, metrics_of
from sim.log import Flight, Log, Outcome, Phase


def scenario_of(name="level"):
    """A scenario with a tilt of at most 4 degrees pooled; the tilt comes from the manifest of the made-up flights."""
    tilt = Check("tilt RMS", "deg", lambda f: Measured(f.manifest["tilt"]), 4.0, pooled="rms", per_flight_limit=6.0)
    script = Script([Timed(0.0, Setpoint(Mode.STABILISE))])
    return Scenario(name, "", FlightConfig(), lambda _config: script, (SURVIVED, tilt))


def flown(tilt, seed=0, outcome=Outcome.COMPLETED, message="", estimator="premerlani"):
    """A flight of one tick whose manifest says what its tilt is."""
    log = Log.empty(1)
    log.truth["R_eb"], log.truth["phase"] = log.flown["R_eb"], Phase.FLYING
    config = FlightConfig(seed=seed, estimator=estimator).model_dump(mode="json")
    return Flight(log, 0.02, 0.0, outcome, "course", message, manifest={"config": config, "tilt": tilt})


def verdict_of(*flights, scenario=None):
    """The verdict on flights of one scenario."""
    scenario = scenario or scenario_of()
    return Verdict.of((scenario, judge(scenario, flight)) for flight in flights)


def test_verdict_on_good_flights_passes_with_exit_code_0():
    """3 and 4 degrees are within 6 each, and sqrt((9 + 16) / 2) = 3.54 within 4 together."""
    verdict = verdict_of(flown(3.0), flown(4.0, seed=1))
    assert verdict.passed
    assert verdict.exit_code == 0
    assert verdict.pooled[0].rows[1].measured == pytest.approx(math.sqrt(12.5), rel=1e-15)


def test_verdict_gates_the_pooled_value_too():
    """Each flight within its own limit of 6, together above 4: exit code 1."""
    verdict = verdict_of(flown(3.0), flown(5.0, seed=1))
    assert all(flight.passed for flight in verdict.flights)
    assert not verdict.passed
    assert verdict.exit_code == 1


def test_verdict_gates_each_flight_too():
    """One at 7 among many at 0 pools to 2.2 and still fails."""
    verdict = verdict_of(flown(7.0), *(flown(0.0, seed=seed) for seed in range(1, 10)))
    assert verdict.pooled[0].passed
    assert verdict.exit_code == 1


def test_verdict_on_nothing_fails():
    """Without flights the gate fails."""
    assert verdict_of().exit_code == 1


@pytest.mark.parametrize(
    ("outcome", "code"),
    [(Outcome.DIVERGED, 3), (Outcome.GROUND_CONTACT, 1), (Outcome.ESTIMATOR_FAILED, 1), (Outcome.COMPLETED, 0)],
)
def test_exit_code_tells_a_blow_up_from_a_failed_check(outcome, code):
    """A crash is a result; a simulation that blew up is not."""
    assert verdict_of(flown(1.0, outcome=outcome)).exit_code == code


def test_verdict_pools_each_scenario_and_estimator_apart():
    """Flights of two estimators are never averaged."""
    level, other = scenario_of(), scenario_of("other")
    judged = [
        (level, judge(level, flown(1.0))),
        (level, judge(level, flown(9.0, estimator="gyro_only"))),
        (other, judge(other, flown(1.0))),
    ]
    verdict = Verdict.of(judged)
    pools = [(v.scenario, v.estimator, v.n_flights, v.passed) for v in verdict.pooled]
    assert pools == [
        ("level", "premerlani", 1, True),
        ("level", "gyro_only", 1, False),
        ("other", "premerlani", 1, True),
    ]


def test_json_holds_every_check_of_every_flight_and_pooled():
    """The names and values that scripts rely on; what was not measured is null, and it is strict JSON."""
    text = verdict_of(flown(3.0), flown(math.nan, seed=1)).to_json_text()
    data = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert data["passed"] is False
    first, second = data["flights"]
    assert {k: first[k] for k in ("scenario", "estimator", "seed", "outcome", "passed")} == {
        "scenario": "level", "estimator": "premerlani", "seed": 0, "outcome": "completed", "passed": True
    }  # fmt: skip
    assert first["checks"][1] == {
        "name": "tilt RMS", "unit": "deg", "measured": 3.0, "sense": "<=", "limit": 6.0, "passed": True
    }  # fmt: skip
    assert second["checks"][1]["measured"] is None
    assert second["checks"][1]["passed"] is False
    (pooled,) = data["pooled"]
    assert (pooled["scenario"], pooled["n_flights"], pooled["passed"]) == ("level", 2, False)
    assert [c["limit"] for c in pooled["checks"]] == [2, 4.0]


def test_junit_counts_what_it_holds_and_survives_any_message():
    """Counts agree with the attributes, with a message full of characters that XML forbids."""
    verdict = verdict_of(flown(3.0), flown(7.0, 1, Outcome.ESTIMATOR_FAILED, 'Mine at 3 s: <"bad"> & \x00\x1b[0m'))
    root = ElementTree.fromstring(verdict.to_junit())
    (suite,) = root.findall("testsuite")
    cases = suite.findall("testcase")
    assert suite.get("tests") == str(len(cases)) == "5"  # two checks of seed 0, the error of seed 1, two pooled
    counts = {kind: sum(case.find(kind) is not None for case in cases) for kind in ("failure", "error", "skipped")}
    assert counts == {"failure": int(suite.get("failures")), "error": 1, "skipped": int(suite.get("skipped"))}
    assert len({(case.get("classname"), case.get("name")) for case in cases}) == 5
    (error,) = suite.findall("testcase/error")
    assert error.get("type") == "estimator_failed"
    assert '<"bad"> & \\x00\\x1b[0m' in error.get("message")


def test_markdown_shows_failed_flights_with_their_numbers():
    """The pooled table always, the table of a flight only if it failed."""
    text = verdict_of(flown(3.0), flown(7.0, 1, Outcome.GROUND_CONTACT)).to_markdown()
    assert text.startswith("# Verdict: FAILED")
    assert "## level, premerlani, 2 flights" in text
    assert "| tilt RMS | 7.00 deg | ≤ 6 deg | **FAIL** |" in text
    assert "### seed 1 flight 0: ground_contact" in text
    assert "### seed 0" not in text


def test_json_metrics_are_the_general_ones_and_the_value_of_each_check():
    """The same names in the verdict and in its JSON; the value of a check is the one that was judged."""
    flight = flown(3.0)
    verdict = verdict_of(flight)
    metrics = json.loads(verdict.to_json_text())["flights"][0]["metrics"]
    assert metrics == summary(flight) | {"survived": 1.0, "tilt_rms_deg": 3.0} == verdict.flights[0].metrics
    assert verdict_of(flown(math.nan)).flights[0].metrics["tilt_rms_deg"] is None


@pytest.mark.parametrize(
    ("check", "unit", "name"),
    [
        ("heading error RMS", "deg", "heading_error_rms_deg"),
        ("inclination error RMS, learnt", "deg", "inclination_error_rms_learnt_deg"),
        ("offset not learnt", "deg/s", "offset_not_learnt_deg_s"),
        ("survived", "", "survived"),
        ("Überflug (2.5 m)", "m", "berflug_2_5_m_m"),
        ("\ud800\n", "°", "check"),
    ],
)
def test_metric_name_is_snake_case_with_the_unit(check, unit, name):
    """Whatever the check is called: lower-case ASCII letters, digits and underscores."""
    assert metric_name(check, unit) == name


def test_metrics_of_checks_with_names_that_are_taken_are_numbered():
    """A check never hides a general metric, nor another check."""
    flight = flown(1.0)
    limits = {"inclination RMS": 5.0, "tilt: RMS": 6.0, "tilt, RMS": 7.0}
    rows = [Check(name, "deg", lambda _f, v=v: Measured(v), 9.0).judge(flight) for name, v in limits.items()]
    metrics = metrics_of(flight, rows)
    assert summary(flight).items() <= metrics.items()
    assert (metrics["inclination_rms_deg_2"], metrics["tilt_rms_deg"], metrics["tilt_rms_deg_2"]) == (5.0, 6.0, 7.0)


def died(seed, estimator="premerlani"):
    """A flight whose process died."""
    return FlightVerdict("level", estimator, seed, Outcome.WORKER_DIED, (), {}, "killed by signal 9")


def verdict_with_dead(*seeds):
    """Flights of 3 degrees on seeds 0 and 1, and those of `seeds` that died."""
    scenario = scenario_of()
    judged = [judge(scenario, flown(3.0, seed)) for seed in (0, 1)]
    return Verdict.of((scenario, flight) for flight in [*judged, *map(died, seeds)])


def test_flight_without_rows_is_missing_from_the_pool_and_fails_it():
    """The checks are pooled over the flights that finished, and fail."""
    verdict = verdict_with_dead(2)
    (pool,) = verdict.pooled
    assert not verdict.passed
    assert not pool.passed
    assert pool.n_flights == 3
    survived, tilt = pool.rows
    assert (survived.measured, survived.limit, survived.passed) == (2, 3, False)
    assert tilt.measured == pytest.approx(3.0, rel=1e-15)
    assert {row.note for row in pool.rows} == {"1 of 3 flights missing"}
    assert not any(row.passed for row in pool.rows)


def test_flight_without_rows_is_one_line_of_markdown_and_one_error():
    """A process that died is reported once."""
    verdict = verdict_with_dead(2)
    text = verdict.to_markdown()
    assert text.count("worker_died: killed by signal 9") == 1
    assert text.rstrip().endswith("### seed 2 flight 0: worker_died: killed by signal 9")
    (suite,) = ElementTree.fromstring(verdict.to_junit()).findall("testsuite")
    assert (suite.get("tests"), suite.get("errors"), suite.get("failures"), suite.get("skipped")) == (
        "7",
        "1",
        "0",
        "2",
    )
    (error,) = suite.findall("testcase/error")
    assert error.get("type") == "worker_died"
    json.loads(verdict.to_json_text())


def test_flights_that_all_died_are_a_verdict_too():
    """Nothing to pool, nothing measured."""
    scenario = scenario_of()
    verdict = Verdict.of((scenario, died(seed)) for seed in range(2))
    assert verdict.exit_code == 1
    assert [row.note for row in verdict.pooled[0].rows] == ["2 of 2 flights missing"] * 2
    assert ElementTree.fromstring(verdict.to_junit()).get("errors") == "2"
    assert json.loads(verdict.to_json_text())["pooled"][0]["checks"][1]["measured"] is None
    assert verdict.to_markdown().count("| not measured (2 of 2 flights missing) |") == 1


@pytest.mark.parametrize(
    "outcome",
    [Outcome.ESTIMATOR_FAILED, Outcome.AUTOPILOT_FAILED, Outcome.TIMED_OUT, Outcome.DIVERGED, Outcome.INTERRUPTED],
)
def test_junit_flight_that_ended_in_an_error_is_one_error_and_no_failure(outcome):
    """Its checks are not reported beside the error."""
    root = ElementTree.fromstring(verdict_of(flown(9.0, outcome=outcome, message="Mine: why")).to_junit())
    assert (root.get("errors"), root.get("failures")) == ("1", "0")
    (error,) = root.findall("testsuite/testcase/error")
    assert (error.get("type"), error.get("message")) == (str(outcome), f"{outcome.replace('_', ' ')}: Mine: why")


def test_flight_that_ended_in_an_error_has_not_passed_whatever_was_measured():
    """A flight cut short by an error fails, even if all its checks pass."""
    tilt = Check("tilt", "deg", lambda f: Measured(1.0), 4.0)
    scenario = replace(scenario_of(), checks=(tilt,))
    verdict = verdict_of(flown(1.0, outcome=Outcome.TIMED_OUT), scenario=scenario)
    assert verdict.flights[0].rows[0].passed
    assert verdict.exit_code == 1


def test_junit_times_of_the_cases_add_up_to_those_of_the_flights():
    """The first case of a flight carries its time; times do not change the result."""
    scenario = scenario_of()
    judged = [judge(scenario, flown(3.0, seed)) for seed in (0, 1)]
    timed = [replace(flight, wall_s=wall_s) for flight, wall_s in zip(judged, (1.25, 2.5), strict=True)]
    with_times, without = (Verdict.of((scenario, flight) for flight in flights) for flights in (timed, judged))
    root = ElementTree.fromstring(with_times.to_junit())
    cases = [float(case.get("time")) for case in root.iter("testcase")]
    assert cases == [1.25, 0.0, 2.5, 0.0, 0.0, 0.0]
    assert root.get("time") == root.find("testsuite").get("time") == "3.750"
    assert with_times == without
    assert with_times.to_json_text() == without.to_json_text()
    assert with_times.to_markdown() == without.to_markdown()
