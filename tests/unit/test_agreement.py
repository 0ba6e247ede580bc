"""Two verdicts compared: what is equal, what is near enough, and what is not."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.commands import agree as agreement


def verdict(
    measured: float | None = 2.0, unit: str = "deg", outcome: str = "completed", seed: int = 0
) -> dict[str, Any]:
    """A verdict as `check` writes it, on one flight with one check, and its pool."""
    check = {"name": "tilt", "unit": unit, "measured": measured, "sense": "<=", "limit": 4.0, "passed": True}
    named = {"scenario": "level", "estimator": "mine", "passed": True, "checks": [check]}
    flight = {**named, "seed": seed, "flight": 0, "outcome": outcome, "message": "", "metrics": {}}
    return {"passed": True, "flights": [flight], "pooled": [{**copy.deepcopy(named), "n_flights": 1}]}


def compared(first: dict[str, Any], second: dict[str, Any], **options: Any) -> agreement.Agreement:
    """As the command does."""
    return agreement.compare(first, second, **options)


def test_agree_equal_verdicts_agree_without_tolerance() -> None:
    """Nothing differs, so nothing is allowed to."""
    found = compared(verdict(), verdict(), tolerance=0.0)
    assert found.agree
    assert found.worst() == []


@pytest.mark.parametrize(("value", "agrees"), [(2.29, True), (2.33, False), (1.71, True), (1.69, False), (None, False)])
def test_agree_value_within_its_units_and_relative_tolerance_agrees(value: float | None, agrees: bool) -> None:
    """0.2 deg and 5 % of the larger: 0.3 from 2 down, 0.316 up to 2.316."""
    assert compared(verdict(2.0), verdict(value)).agree is agrees


def test_agree_tolerance_scales_those_of_the_units() -> None:
    """A tenth of it allows a tenth: 0.02 deg and 0.5 %."""
    assert compared(verdict(2.0), verdict(2.029), tolerance=0.005).agree
    assert not compared(verdict(2.0), verdict(2.031), tolerance=0.005).agree


@pytest.mark.parametrize("unit", ["", "flights", "waypoints"])
def test_agree_counts_have_no_tolerance(unit: str) -> None:
    """Ten waypoints are not nine."""
    assert not compared(verdict(100.0, unit), verdict(99.0, unit)).agree


def test_agree_other_outcome_disagrees() -> None:
    """Whatever was measured."""
    found = compared(verdict(), verdict(outcome="ground_contact"))
    assert found.others == ("level, mine, seed 0 flight 0: completed in the first, ground contact in the second",)
    assert found.exit_code == 1


def test_agree_other_flights_disagree() -> None:
    """A flight that only one of them holds."""
    found = compared(verdict(seed=1), verdict(seed=2))
    assert [line.rpartition(": ")[2] for line in found.others] == ["only in the first", "only in the second"]


def test_agree_other_limits_disagree() -> None:
    """Verdicts of two versions of a scenario are no comparison of machines."""
    second = verdict()
    second["flights"][0]["checks"][0]["limit"] = 5.0
    assert "another limit" in compared(verdict(), second).others[0]


def test_agree_sensitive_scenario_is_reported_and_not_judged() -> None:
    """Unless it is asked for."""
    found = compared(verdict(2.0), verdict(4.0), reported=["lev*"])
    assert found.agree
    assert [d.judged for d in found.worst()] == [False, False]
    assert not compared(verdict(2.0), verdict(4.0), reported=[]).agree


def test_agree_command_tells_the_worst_and_its_exit_code(tmp_path: Path, capsys) -> None:
    """A table with the values, a last line, JSON, 1 where they disagree."""
    for name, data in (("a", verdict(2.0)), ("b", verdict(2.1)), ("c", verdict(3.0))):
        (tmp_path / name).write_text(json.dumps(data))
    a, b, c = (str(tmp_path / name) for name in "abc")
    assert run(["agree", a, b]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("agree: 1 flight, 2 values, 0 of them equal")
    assert run(["--quiet", "agree", a, c, "--json", str(tmp_path / "out.json")]) == 1
    out = capsys.readouterr().out
    assert out == "DISAGREE in 2 values and 0 other things: 1 flight, 2 values, 0 of them equal to the last bit\n"
    told = json.loads((tmp_path / "out.json").read_text())
    assert (told["agree"], told["differences"][0]["difference"], told["differences"][0]["agrees"]) == (
        False,
        1.0,
        False,
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not JSON"),
        ("[1]", "holds no flights"),
        ('{"flights": []}', "holds no flights"),
        ('{"flights": [3]}', "is not a verdict on a flight"),
        (
            '{"flights": [{"scenario": "x", "estimator": "y", "checks": [{"name": "n"}]}]}',
            "is not a verdict on a flight",
        ),
        ("[" * 100_000, "not JSON"),
    ],
)
def test_agree_file_that_is_no_verdict_is_refused_in_one_line(text: str, says: str, tmp_path: Path, capsys) -> None:
    """Exit code 2 names the file."""
    (tmp_path / "a.json").write_text(text)
    assert run(["agree", str(tmp_path / "a.json"), str(tmp_path / "a.json")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "a.json" in line
    assert says in line
