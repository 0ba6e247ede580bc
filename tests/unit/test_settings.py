"""Parameters of estimators are spelled alike in every command, and a wrong name suggests the right one."""

import json
from pathlib import Path

import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.settings import names_of, without_others
from sim import recording

OWN = """
from dataclasses import dataclass
import numpy as np
from estimator.interface import AttitudeEstimate

@dataclass(frozen=True)
class Params:
    k_p: float = 0.5

class MyFilter:
    def __init__(self, params=Params()):
        self.params = params
    def update(self, measurements):
        return AttitudeEstimate(np.eye(3))
"""
SHORT = ("--set", "duration_s=1")


@pytest.fixture
def own(tmp_path: Path, monkeypatch) -> str:
    """An estimator in a file of the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    return "own.py:MyFilter"


def flown_with(folder: Path) -> dict[str, float]:
    """Parameters that the estimator was flown with, by the newest recording."""
    newest = max(folder.glob("flights/*/manifest.json"), key=lambda path: path.stat().st_mtime_ns)
    return json.loads(newest.read_text())["config"]["estimator_params"]


@pytest.mark.parametrize(
    ("spec", "names"),
    [
        ("premerlani", ("premerlani",)),
        ("own.py:MyFilter", ("my_filter", "MyFilter")),
        ("package.module:MyEKFFilter", ("my_ekf_filter", "MyEKFFilter")),
        ("package.module:Outer.Inner", ("inner", "Inner")),
        ("package:make", ("make",)),
        ("./build/mine.so", ("mine",)),
        (dict, ("dict",)),
    ],
)
def test_names_of_an_estimator(spec, names: tuple[str, ...]) -> None:
    """A registered name; of a class its name in snake case, or as it is; of a library its file's."""
    assert names_of(spec) == names


@pytest.mark.parametrize("name", ["k_p", "my_filter.k_p", "MyFilter.k_p", "estimator_params.k_p"])
def test_one_spelling_in_fly_check_compare_and_replay(own: str, name: str, tmp_path: Path, capsys) -> None:
    """The same text sets the same parameter in all four."""
    setting = ("--set", f"{name}=0.25")
    assert run(["fly", "crosswind", "--estimator", own, "--no-rerun", *SHORT, *setting]) in (0, 1)
    assert flown_with(tmp_path) == {"k_p": 0.25}
    assert run(["check", "crosswind", "--seeds", "0", "--workers", "1", "--estimator", own, *SHORT, *setting]) in (0, 1)
    assert run(["compare", "crosswind", "--estimators", own, "--seeds", "0", *SHORT, *setting]) in (0, 1)
    (log,) = tmp_path.glob("flights/*/flight.parquet")
    assert run(["replay", str(log), "--estimator", own, "--no-rerun", *setting]) in (0, 1)
    assert "unknown" not in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fly", "check", "compare"])
@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("kp=1", "did you mean my_filter.k_p?"),
        ("my_filter.kp=1", "did you mean k_p?"),
        ("premerlani.k_p=1", "premerlani does not fly, but my_filter does"),
        ("gps.latencys=1", "did you mean gps.latency_s"),
    ],
)
def test_unknown_parameter_suggests_one(own: str, command: str, setting: str, says: str, capsys) -> None:
    """One line, exit code 2, the same in all commands."""
    option = "--estimators" if command == "compare" else "--estimator"
    assert run([command, "crosswind", option, own, "--set", setting]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_compare_gives_each_estimator_its_own(own: str, capsys) -> None:
    """A name in front is for one of them; a bare one for all that have it, and a note says who has not."""
    words = [
        "compare",
        "crosswind",
        "--estimators",
        f"premerlani,gyro_only,{own}",
        "--seeds",
        "0",
        *SHORT,
        "--json",
        "-",
    ]
    assert run([*words, "--set", "premerlani.k_p=0.7", "--set", "my_filter.k_p=0.2"]) in (0, 1)
    assert json.loads(capsys.readouterr().out)["notes"] == []
    assert run([*words, "--set", "k_p=0.7"]) in (0, 1)
    (note,) = json.loads(capsys.readouterr().out)["notes"]
    assert note == f"k_p is set for premerlani, {own}; without that parameter: gyro_only"


def test_check_sets_a_parameter_only_where_its_estimator_flies(capsys) -> None:
    """Scenarios fly different estimators: the others are left as they are."""
    words = ["check", "crosswind", "hand_launch_accelerometer", "--seeds", "0", "--workers", "1", *SHORT]
    assert run([*words, "--set", "premerlani.k_p=0.7"]) in (0, 1)
    assert run([*words, "--set", "ins_ekf.k_p=0.7"]) == 2
    assert "ins_ekf does not fly" in capsys.readouterr().err


def test_changes_without_those_of_others() -> None:
    """What names no estimator is for all."""
    changes = {"k_p": 1, "premerlani.k_p": 2, "ap_dcm.k_p": 3, "gps.latency_s": 4}
    specs = ["premerlani", "ap_dcm"]
    assert without_others(changes, "ap_dcm", specs) == {"k_p": 1, "ap_dcm.k_p": 3, "gps.latency_s": 4}


def test_property_of_the_instruments_stays_one(tmp_path: Path, monkeypatch) -> None:
    """A bare name that is a property of the instruments goes to all flight code; behind an estimator, to it alone."""
    monkeypatch.chdir(tmp_path)
    assert run(["fly", "crosswind", "--no-rerun", *SHORT, "--set", "gps_latency_s=0.4"]) in (0, 1)
    (folder,) = (tmp_path / "flights").iterdir()
    config = recording.load(folder).manifest["config"]
    assert (config["instruments"], config["estimator_params"]) == ({"gps_latency_s": 0.4}, {})
    assert run(["fly", "crosswind", "--no-rerun", *SHORT, "--set", "premerlani.gps_latency_s=0.4"]) in (0, 1)
    assert flown_with(tmp_path) == {"gps_latency_s": 0.4}
