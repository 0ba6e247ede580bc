"""The commands themselves: what they print, write and return."""

import json
import re
import signal
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.commands import check as gate
from scenarios.harness.commands.bench import STAGES
from scenarios.harness.flight import Prepared
from scenarios.harness.seeds import parse_seeds
from sim import recording
from sim.log import Outcome

SHORT = ("fly", "hand_launch", "--no-rerun")
DOUBTFUL = """
import signal

import numpy as np

from estimator.interface import AttitudeEstimate


class Doubtful:
    def update(self, m):
        if m.imu.t_s > 5.0:
            signal.raise_signal(signal.SIGINT)
        return AttitudeEstimate(np.eye(3))
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def ended_with(monkeypatch):
    """Makes the next flights end with another outcome than they had."""

    def patch(outcome: Outcome) -> None:
        really = Prepared.fly
        monkeypatch.setattr(
            Prepared, "fly", lambda *a, **k: replace(really(*a, **k), outcome=outcome, message="as told")
        )

    return patch


def test_version_is_that_of_the_package(capsys) -> None:
    """`--version` tells what is installed."""
    assert run(["--version"]) == 0
    assert re.fullmatch(r"wingslevel \d+\.\d+\.\d+\n", capsys.readouterr().out)


@pytest.mark.parametrize("arguments", [[], ["--help"], ["fly", "-h"], ["check", "--help"], ["bench", "--help"]])
def test_help_is_shown_and_succeeds(arguments: list[str], capsys) -> None:
    """Help is asked for in every usual way."""
    assert run(arguments) == 0
    assert "Usage: wingslevel" in capsys.readouterr().out


def test_fly_json_on_standard_output_is_nothing_but_json(here: Path, capfd) -> None:
    """A script reads standard output, a person standard error; no flight prints into the JSON."""
    code = run([*SHORT, "--json", "-"])
    stdout, stderr = capfd.readouterr()
    data = json.loads(stdout)
    (flight,) = data["flights"]
    assert (flight["scenario"], flight["estimator"], flight["seed"]) == ("hand_launch", "premerlani", 0)
    assert code == (0 if data["passed"] else 1)
    assert all({"name", "unit", "measured", "limit", "passed"} <= check.keys() for check in flight["checks"])
    assert all(check["name"] in stderr for check in flight["checks"])
    assert recording.load(here / data["recording"]).outcome == Outcome.COMPLETED


def test_fly_twice_keeps_both_recordings(here: Path) -> None:
    """No flight is written over another; the same seed gives the same bits."""
    for _ in range(2):
        run([*SHORT, "--set", "duration_s=2"])
    first, second = sorted((here / "flights").iterdir())
    assert recording.digest(recording.load(first)) == recording.digest(recording.load(second))


def test_fly_overrides_reach_the_manifest(here: Path) -> None:
    """What was asked for on the command line is what the recording says was flown."""
    run([*SHORT, "--wind", "3@270", "--gps-rate", "2", "--duration", "2", "--seed", "7", "--set", "gps.latency_s=0.5"])
    (folder,) = (here / "flights").iterdir()
    config = recording.load(folder).manifest["config"]
    assert (config["air"]["wind_m_s"], config["air"]["wind_from_deg"]) == (3.0, 270.0)
    assert (config["rates"]["gps_hz"], config["duration_s"], config["seed"]) == (2.0, 2.0, 7)
    assert config["sensors"] == {"gps.latency_s": 0.5}


@pytest.mark.usefixtures("here")
def test_fly_table_fits_80_columns_and_is_not_coloured_in_a_pipe(capsys, monkeypatch) -> None:
    """Tables are for terminals of any width above 80; escape codes are for terminals."""
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    run(list(SHORT))
    out = capsys.readouterr().out
    assert "\x1b" not in out
    table = out.partition("completed")[0]
    assert max(len(line.rstrip()) for line in table.splitlines()) <= 80
    assert re.search(r"inclination error RMS +\d+\.\d\d +<= 6 +deg +(pass|FAIL)", table)


@pytest.mark.usefixtures("here")
def test_fly_colour_survives_a_pipe_where_forced(capsys, monkeypatch) -> None:
    """FORCE_COLOR asks for escape codes in any case."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    run(list(SHORT))
    assert "\x1b[" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("outcome", "code"), [(Outcome.DIVERGED, 3), (Outcome.INTERRUPTED, 130), (Outcome.GROUND_CONTACT, 1)]
)
def test_fly_exit_code_tells_how_it_ended_and_the_recording_is_kept(
    here: Path, ended_with, outcome: Outcome, code: int, capsys
) -> None:
    """Whatever ends a flight, it is recorded up to there."""
    ended_with(outcome)
    assert run([*SHORT, "--duration", "3"]) == code
    (folder,) = (here / "flights").iterdir()
    assert recording.load(folder).outcome == outcome
    assert "as told" in capsys.readouterr().out


def test_fly_estimator_that_raises_is_exit_code_1_and_one_line(here: Path, capsys) -> None:
    """A fault of one's own estimator is a result of the flight, told by class, time and fault."""
    Path("own.py").write_text(
        "class Clumsy:\n    def update(self, m):\n        print('noise')\n        return 1 / 0\n", encoding="utf-8"
    )
    assert run([*SHORT, "--estimator", "own.py:Clumsy"]) == 1
    assert re.search(r"estimator failed .*: Clumsy at 2\.\d+ s: ZeroDivisionError", capsys.readouterr().out)
    (folder,) = (here / "flights").iterdir()
    assert recording.load(folder).outcome == Outcome.ESTIMATOR_FAILED


@pytest.mark.usefixtures("here")
def test_fly_estimator_that_prints_leaves_the_json_alone(capfd) -> None:
    """What flight code prints goes to standard error while standard output carries JSON."""
    Path("own.py").write_text("class Loud:\n    def update(self, m):\n        print('noise')\n", encoding="utf-8")
    run([*SHORT, "--estimator", "own.py:Loud", "--json", "-"])
    stdout, stderr = capfd.readouterr()
    assert json.loads(stdout)["flights"][0]["outcome"] == "estimator_failed"
    assert "noise" in stderr


def test_fly_interrupted_keeps_the_recording_up_to_there(here: Path, ctrl_c, capsys) -> None:
    """Ctrl-C in the middle of the air: exit code 130, and a whole recording of the part that was flown."""
    Path("own.py").write_text(DOUBTFUL, encoding="utf-8")
    assert run([*SHORT, "--estimator", "own.py:Doubtful"]) == 130
    (folder,) = (here / "flights").iterdir()
    flight = recording.load(folder)
    assert flight.outcome == Outcome.INTERRUPTED
    assert flight.log.truth["t_s"][-1] == pytest.approx(5.0, abs=0.05)
    assert "interrupted" in capsys.readouterr().out


def test_check_reports_are_the_same_on_any_number_of_workers(here: Path) -> None:
    """The flights are decided by their names and seeds, not by who flew them."""
    flown = ["check", "hand_launch", "crosswind", "--seeds", "0,3", "--set", "duration_s=5"]
    codes = {run([*flown, "--workers", str(n), "--json", f"{n}.json", "--junit", f"{n}.xml"]) for n in (1, 2)}
    assert len(codes) == 1
    one, two = (json.loads((here / f"{n}.json").read_text()) for n in (1, 2))
    assert one.pop("run")["flown"] == two.pop("run")["flown"] == 4
    assert one == two
    untimed = [re.sub(r' time="[^"]*"', "", (here / f"{n}.xml").read_text()) for n in (1, 2)]
    assert untimed[0] == untimed[1]
    assert [(f["scenario"], f["seed"]) for f in one["flights"]] == [
        (name, seed) for name in ("hand_launch", "crosswind") for seed in (0, 3)
    ]
    assert [(p["scenario"], p["n_flights"]) for p in one["pooled"]] == [("hand_launch", 2), ("crosswind", 2)]


def test_check_reports_for_people_and_for_ci_are_written(here: Path) -> None:
    """JUnit and Markdown carry every check of the scenario."""
    run(["check", "hand_launch", "--seeds", "1", "--workers", "1", "--junit", "j.xml", "--markdown", "m.md"])
    cases = ElementTree.parse(here / "j.xml").getroot().iter("testcase")
    assert any("inclination error RMS" in case.get("name", "") for case in cases)
    assert "inclination error RMS" in (here / "m.md").read_text(encoding="utf-8")


def test_check_interrupted_keeps_what_was_finished(here: Path, ctrl_c, in_process, monkeypatch, capfd) -> None:
    """Ctrl-C in the third of four flights: two are judged, marked as not all, and exit code 130."""
    really, flown = gate.fly_scenario, []

    def until_interrupted(*args, **kwargs):
        flown.append(kwargs["seed"])
        if len(flown) == 3:
            signal.raise_signal(signal.SIGINT)
        return really(*args, **kwargs)

    monkeypatch.setattr(gate, "fly_scenario", until_interrupted)
    code = run(["check", "hand_launch", "--seeds", "0-3", "--workers", "1", "--json", "-", "--junit", "j.xml"])
    stdout, stderr = capfd.readouterr()
    data = json.loads(stdout)
    assert code == 130
    assert [flight["seed"] for flight in data["flights"]] == [0, 1]
    assert (data["passed"], data["interrupted"]) == (False, True)
    assert "interrupted" in stderr
    assert "2 of 4 flights are missing" in (here / "j.xml").read_text()


@pytest.mark.parametrize(("text", "seeds"), [("3", [3]), ("0-2", [0, 1, 2]), ("5,0-1,5", [5, 0, 1])])
def test_parse_seeds_ranges_and_lists(text: str, seeds: list[int]) -> None:
    """Each seed once, in the order in which they were named."""
    assert parse_seeds(text) == seeds


def test_bench_json_names_every_figure_with_its_unit(capfd) -> None:
    """The figures agree with each other; the limits themselves are for a quiet machine."""
    code = run(["bench", "--seconds", "2", "--repeats", "3", "--json", "-"])
    data = json.loads(capfd.readouterr().out)
    assert code == (0 if data["passed"] else 1)
    ratio = data["closed_loop_us_per_tick"] / data["bare_us_per_tick"]
    assert data["closed_loop_ratio"] == pytest.approx(ratio, rel=1e-12)
    assert data["bare_us_per_tick"] > 0.0
    assert min(data["estimator_ns_per_call"], data["estimator_update_ns"]) > 0.0
    assert set(data["stages_us_per_tick"]) == set(STAGES)
    assert min(data["stages_us_per_tick"].values()) > 0.0


@pytest.mark.parametrize(
    ("names", "left_out"),
    [
        ([], True),
        (["gps_latency*"], True),
        (["gps_latency"], False),
        (["gps_lat*", "gps_latency", "gps_latency_s_3"], False),
    ],
)
def test_check_with_ones_own_estimator_says_what_it_leaves_out(names: list[str], left_out: bool, capfd) -> None:
    """Those that pass where their own estimator fails, in one line of standard error, unless named in full."""
    flown = {task.scenario for task in gate.tasks(names, [0], "gyro_only", {})}
    lines = [line for line in capfd.readouterr().err.splitlines() if "left out" in line]
    assert ("gps_latency" not in flown) == left_out
    assert ("gps_latency_s_3" not in flown) == (left_out or "gps_latency_s_3" not in names)
    assert "gps_latency_told_3" in flown or "gps_latency*" not in names
    assert len(lines) == left_out
    assert all("gps_latency, gps_latency_s_3" in line for line in lines)


def test_check_of_nothing_but_failures_to_show_is_refused(capfd) -> None:
    """A gate that flies nothing would pass."""
    assert run(["check", "hand_launch_accel*", "--seeds", "0", "--estimator", "gyro_only"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "hand_launch_accelerometer" in line
    assert "name it in full" in line


def test_check_of_a_pattern_flies_the_family() -> None:
    """Whatever the scenario's own estimator, where none is named."""
    flown = [task.scenario for task in gate.tasks(["turns_180*", "turns_180"], [0, 1], None, {})]
    assert flown[::2] == ["turns_180", "turns_180_bank_30", "turns_180_bank_45", "turns_180_bank_60", "turns_180_high"]
    assert flown[::2] == flown[1::2]
    assert {task.scenario for task in gate.tasks(["hand_launch*"], [0], None, {})} >= {"hand_launch_accelerometer"}
