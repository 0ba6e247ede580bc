"""The contract of every registered scenario, and the errors of the registry."""

import json
from pathlib import Path

import numpy as np
import pytest

import scenarios
from autopilot.interface import Mode
from scenarios.harness.config import FlightConfig, resolve
from scenarios.harness.metrics import planned_end_s, summary
from scenarios.harness.registry import find, registered
from scenarios.harness.verdict import judge, metric_name
from sim.log import Flight, Log, Outcome, Phase

NAMES = sorted(registered())
SECTIONS = ("Story", "Verifies", "Aircraft", "Wind", "Sensors", "Passes when")


def test_registry_names_scenarios_after_their_files():
    """Every file of the package is a scenario, under the name of its file."""
    assert set(NAMES) >= {"hand_launch", "crosswind", "turns_180", "loops", "return_to_launch"}
    files = {path.stem for folder in scenarios.__path__ for path in Path(folder).glob("*.py")}
    assert {name for name in NAMES if name in files} == files - {"__init__"}
    assert all(any(name == stem or name.startswith(f"{stem}_") for stem in files) for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_scenario_story_has_every_section(name):
    """The docstring of the file is a table with all sections."""
    scenario = find(name)
    assert scenario.name == name
    lines = scenario.story.splitlines()
    for section in SECTIONS:
        assert any(line.startswith(section) for line in lines), section
    assert scenario.summary.endswith(".")


@pytest.mark.parametrize("name", NAMES)
def test_scenario_resolves_the_same_from_the_same_seed_and_through_json(name):
    """The resolved configuration is plain numbers: equal for equal seeds, different for others."""
    scenario = find(name)
    first = resolve(scenario.config)
    assert resolve(scenario.config) == first
    assert FlightConfig(**json.loads(first.model_dump_json())) == first
    other = resolve(scenario.config.model_copy(update={"seed": 1}))
    assert other.heading_deg != first.heading_deg


@pytest.mark.parametrize("name", NAMES)
def test_scenario_script_begins_at_the_start_and_ends_before_the_flight(name):
    """The first set-point is in force from the start, the last before the end."""
    scenario = find(name)
    config = resolve(scenario.config)
    timed = list(scenario.script(config))
    assert timed[0].t_s <= 0.0
    assert timed[-1].t_s < config.duration_s
    assert all(isinstance(t.setpoint.mode, Mode) for t in timed)


@pytest.mark.parametrize("name", NAMES)
def test_scenario_checks_demand_survival_and_say_their_units(name):
    """Every check has a name and, unless it counts, a unit; survival is first, unless a crash is expected."""
    checks = find(name).checks
    assert checks[0].name == "survived" or find(name).expected_to_fail
    assert all(check.name and (check.unit or check.name == "survived") for check in checks)


@pytest.mark.parametrize("name", NAMES)
def test_scenario_checks_have_unique_metric_names(name):
    """No metric of a flight has to be numbered: no check has the name of a general metric or of another check."""
    general = summary(Flight(Log.empty(0), 0.02, 0.0, Outcome.DIVERGED, "course"))
    names = [*general, *(metric_name(check.name, check.unit) for check in find(name).checks)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("n_ticks", [0, 1, 500])
def test_scenario_checks_fail_a_flight_that_ended_early(name, n_ticks):
    """On a flight of no, one or 500 ticks no check of estimate or manoeuvre passes, and none raises."""
    scenario = find(name)
    log = Log.empty(n_ticks)
    log.truth["R_eb"], log.truth["phase"] = log.flown["R_eb"], Phase.FLYING
    log.truth["t_s"] = 0.02 * np.arange(1, n_ticks + 1)
    config = resolve(scenario.config).model_dump(mode="json")
    flight = Flight(log, 0.02, 0.0, Outcome.GROUND_CONTACT, "course", manifest={"config": config})
    assert planned_end_s(flight) == scenario.config.duration_s
    verdict = judge(scenario, flight)
    over_windows = [row for row in verdict.rows if row.name.startswith(("inclination", "heading", "loops flown"))]
    assert not verdict.passed
    assert not any(row.passed for row in (verdict.rows[0], *over_windows))
    assert scenario.events(flight) is not None


def test_varied_overrides_limits_only_and_rejects_unknown_checks():
    """The variant has the checks of its scenario in their order, with the limits that are named."""
    first = find("crosswind")
    name = "inclination error RMS"
    variant = first.varied("again", "Again.", {"duration_s": 30.0}, {name: 2.0})
    assert (variant.name, variant.summary, variant.config.duration_s) == ("crosswind_again", "Again.", 30.0)
    pairs = list(zip(first.checks, variant.checks, strict=True))
    assert [b.limit for _, b in pairs] == [1.0, 2.0, 3.0]
    assert all(a == b or (a.name, b.per_flight_limit, a.metric) == (name, 3.0, b.metric) for a, b in pairs)
    with pytest.raises(ValueError, match=r"scenario crosswind_again: .* does not have: tilt"):
        first.varied("again", "Again.", {}, {"tilt": 2.0})


def test_find_of_an_unknown_scenario_names_the_near_misses():
    """One line, with similar names."""
    with pytest.raises(ValueError, match=r"unknown scenario 'hand_lunch': did you mean hand_launch"):
        find("hand_lunch")


def test_find_of_a_file_is_its_scenario(tmp_path):
    """A file that exports SCENARIO works as a registered scenario does."""
    path = tmp_path / "mine.py"
    path.write_text(
        "from dataclasses import replace\n"
        "from scenarios.crosswind import SCENARIO as crosswind\n"
        "SCENARIO = replace(crosswind, name='mine')\n"
    )
    assert find(str(path)).name == "mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1\n", "must export SCENARIO"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("def (\n", "SyntaxError"),
    ],
)
def test_find_of_a_file_without_a_scenario_is_one_line(tmp_path, text, words):
    """The line names what is wrong in the file."""
    path = tmp_path / "broken.py"
    path.write_text(text)
    with pytest.raises(ValueError, match=words) as refused:
        find(str(path))
    assert "broken.py" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_find_of_a_missing_file_is_one_line(tmp_path):
    """The line has the path as typed."""
    with pytest.raises(ValueError, match="no file"):
        find(str(tmp_path / "nowhere.py"))
