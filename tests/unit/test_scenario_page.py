"""The catalogue of the scenarios: complete, up to date, and its measured values those of today's flights."""

import json
import re
from pathlib import Path

import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.commands.agree import ABSOLUTE, RELATIVE, SENSITIVE
from scenarios.harness.commands.scenario_page import COLUMNS, Cells, measured_by, measured_in, page, story_of
from scenarios.harness.registry import find, registered
from scenarios.harness.seeds import parse_seeds
from sim.outside.wording import markdown

PAGE = Path(__file__).parents[2] / "docs" / "scenarios.md"
TEXT = PAGE.read_text(encoding="utf-8")
QUICK = ("hand_launch", "hand_launch_accelerometer", "gentle_lady_launch_calm")


def test_page_in_the_repository_is_that_of_the_scenarios():
    """Stories, limits, names and order: wingslevel list scenarios --markdown docs/scenarios.md"""
    assert page(registered(), measured_in(TEXT)) == TEXT


def test_page_in_the_repository_has_a_value_for_every_check():
    """A scenario that was added has been flown: wingslevel check --json, then --verdict."""
    found = measured_in(TEXT)
    names = {(scenario.name, markdown(c.name)) for scenario in registered().values() for c in scenario.checks}
    assert found.numbers.keys() == names
    assert all(re.fullmatch(r"[-\d.e+]+( of \d+ flights)?", cells.worst) for cells in found.numbers.values())
    assert len(parse_seeds(found.seeds)) >= 10


def flown(names, seeds, folder):
    """The cells of `names`, from flights of now."""
    path = folder / "verdict.json"
    assert run(["check", *names, "--seeds", seeds, "--workers", "1", "--quiet", "--json", str(path)]) == 0
    return measured_by(json.loads(path.read_text(encoding="utf-8"))).numbers


def differences(now, names):
    """Lines about each value of the page that differs by more than the last bits of another machine amount to."""
    then, lines = measured_in(TEXT).numbers, []
    for name in names:
        for check in find(name).checks:
            key = (name, markdown(check.name))
            pairs = zip((now[key].worst, now[key].pooled), (then[key].worst, then[key].pooled), strict=True)
            for ours, on_page in pairs:
                if check.pooled == "count" or not ours:
                    same = ours == on_page
                else:
                    a, b = float(ours), float(on_page)
                    same = abs(a - b) <= ABSOLUTE.get(check.unit, 0.0) + RELATIVE * max(abs(a), abs(b))
                lines += [] if same else [f"{key}: {ours} now, {on_page} on the page"]
    return lines


def test_page_in_the_repository_says_what_is_measured_now(tmp_path):
    """The short scenarios on all seeds of the page; the others are flown by the long test below."""
    assert differences(flown(QUICK, measured_in(TEXT).seeds, tmp_path), QUICK) == []


@pytest.mark.long
def test_page_in_the_repository_says_what_is_measured_now_of_every_scenario(tmp_path):
    """All flights of the page; the values of the scenario that a last bit can double are not compared."""
    names = sorted(set(registered()) - set(SENSITIVE))
    assert differences(flown(names, measured_in(TEXT).seeds, tmp_path), names) == []


def entry(seed, *measured, scenario="crosswind", estimator="premerlani"):
    """A flight of a verdict, with what its checks measured."""
    checks = [
        {"name": c.name, "unit": c.unit, "measured": m, "sense": c.sense, "limit": limit, "passed": True}
        for c, m, limit in zip(find(scenario).checks, measured, (1.0, 6.0, 4.5), strict=True)
    ]
    return {"scenario": scenario, "estimator": estimator, "seed": seed, "checks": checks}


def test_measured_by_a_verdict_takes_the_worst_flight_and_the_pooled_value():
    """Margins in per cent of the limit; another estimator's flights are not the scenario's."""
    flights = [entry(0, 1.0, 1.5, 0.9), entry(1, 1.0, 3.0, None), entry(2, 1.0, 9.9, 9.9, estimator="gyro_only")]
    pooled = entry(0, 1.0, 2.0, None)
    pooled["checks"][1]["limit"] = 4.0
    found = measured_by({"flights": flights, "pooled": [pooled]})
    assert found.seeds == "0-2"
    assert found.numbers == {
        ("crosswind", "survived"): Cells("2 of 2 flights"),
        ("crosswind", "inclination error RMS"): Cells("3.00", "50 %", "2.00", "50 %"),
        ("crosswind", "heading error RMS"): Cells("not measured", "", "not measured", ""),
    }


def test_page_holds_what_was_measured_and_gives_it_back():
    """A table per scenario, in which a reader, and the next page, find each value."""
    found = measured_by({"flights": [entry(3, 1.0, 3.0, 0.9)], "pooled": [entry(3, 1.0, 2.0, 0.9)]})
    text = page(registered(), found)
    assert "achieves on the seeds 3:" in text
    assert "| inclination error RMS | ≤ 6 deg | 3.00 | 50 % | ≤ 4 deg | 2.00 | 67 % |" in text
    assert text.count(COLUMNS) == len(registered())
    again = measured_in(text)
    assert {key: again.numbers[key] for key in found.numbers} == found.numbers
    assert set(again.numbers.values()) - set(found.numbers.values()) == {Cells()}
    assert page(registered(), again) == text


def test_links_of_the_page_lead_to_a_heading():
    """Every scenario is a heading, and every link within the page one of those."""
    headings = re.findall(r"^##+ (.*)$", TEXT, re.MULTILINE)
    assert set(registered()) <= set(headings)
    assert set(re.findall(r"\]\(#(\w+)\)", TEXT)) <= set(headings)


def test_story_of_a_docstring_is_its_table_and_what_follows():
    """Rows over several lines, double quotes of reStructuredText, paragraphs."""
    rule = "=============  ======"
    rows = "Story          One\n               two ``x|y``.\nWind           none"
    story = f"Short.\n\n{rule}\n{rows}\n{rule}\n\nMore\ntext.\n"
    assert story_of(story) == ({"Story": r"One two `x\|y`.", "Wind": "none"}, ["More text."])


def test_command_keeps_the_values_that_the_page_holds(tmp_path):
    """Without a verdict; a page that is not there yet has none."""
    path = tmp_path / "page.md"
    path.write_text(TEXT, encoding="utf-8")
    assert run(["list", "scenarios", "--markdown", str(path)]) == 0
    assert path.read_text(encoding="utf-8") == TEXT
    assert run(["list", "scenarios", "--markdown", str(tmp_path / "new.md")]) == 0
    assert set(measured_in((tmp_path / "new.md").read_text(encoding="utf-8")).numbers.values()) == {Cells()}


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--markdown", "page.md"], "the catalogue is of all scenarios"),
        (["aircraft", "--markdown", "page.md"], "the catalogue is of all scenarios"),
        (["scenarios", "crosswind", "--markdown", "page.md"], "the catalogue is of all scenarios"),
        (["scenarios", "--verdict", "verdict.json"], "the catalogue is of all scenarios"),
        (["scenarios", "--markdown", "page.md", "--verdict", "verdict.json"], "cannot read verdict.json"),
        (["scenarios", "--markdown", "no/page.md"], "there is no folder no"),
    ],
)
def test_command_refuses_in_one_line(arguments, line, tmp_path, monkeypatch, capsys):
    """Before anything is written."""
    monkeypatch.chdir(tmp_path)
    assert run(["list", *arguments]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert line in error
    assert list(tmp_path.iterdir()) == []
