"""Faults of the sensors from the command line and from a scenario's file: flown, recorded, flown again, refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.commands import check as gate
from scenarios.harness.config import FlightConfig
from scenarios.harness.flight import fly_config
from scenarios.harness.registry import find
from sim.log import Log
from sim.recording import load

SHORT = ("fly", "hand_launch", "--no-rerun", "--duration", "2")
SCENARIO = """
from dataclasses import replace
from scenarios.hand_launch import SCENARIO as HAND_LAUNCH

config = HAND_LAUNCH.config.model_copy(update={"duration_s": 2.0})
SCENARIO = replace(HAND_LAUNCH, name="failing", config=type(config)(**config.model_dump() | {"faults": FAULTS}))
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def recorded(here):
    """The only recording there is."""
    (folder,) = (here / "flights").iterdir()
    return load(folder)


def test_fly_with_faults_shows_them_and_can_be_flown_again_from_its_manifest(here):
    """Two faults, one from the hand: readings, events, manifest; the manifest alone flies the same bits."""
    assert run([*SHORT, "--fault", "accel:dropout@-3--2", "--fault", "gyro.x:stuck@1"]) in (0, 1)
    flight = recorded(here)
    assert flight.manifest["config"]["faults"] == ["accelerometer:dropout@-3--2", "gyro.x:stuck@1"]
    since_s = flight.log.measured["t_s"] - flight.release_s
    dropped = np.all(flight.log.measured["force_b_m_s2"] == 0.0, axis=1)
    np.testing.assert_array_equal(dropped, (since_s > -3.0 - 1e-9) & (since_s < -2.0 - 1e-9))
    stuck = flight.log.measured["gyro_b_rad_s"][since_s > 1.0 - 1e-9, 0]
    assert len(stuck) == 51  # 1.00 to 2.00 s, both ends
    assert np.ptp(stuck) == 0.0
    events = {event.text: event.t_s - flight.release_s for event in flight.events if event.text.startswith("fault")}
    expected = {
        "fault accelerometer:dropout@-3--2": -3.0,
        "fault accelerometer:dropout@-3--2 ended": -2.0,
        "fault gyro.x:stuck@1": 1.0,
    }
    assert events == pytest.approx(expected, rel=0, abs=1e-9)
    again = fly_config(find("hand_launch"), FlightConfig(**flight.manifest["config"]))
    for table in Log.__slots__:
        assert getattr(again.log, table).tobytes() == getattr(flight.log, table).tobytes()


def test_fault_changes_nothing_before_it_begins(here):
    """Not one bit of the flight up to the window, its wind, its hand and its noise."""
    hand_launch = find("hand_launch")
    config = hand_launch.config.model_copy(update={"duration_s": 2.0})
    clean = fly_config(hand_launch, config)
    wrong = fly_config(hand_launch, config.model_copy(update={"faults": ("gyro:spikes=300,0.5@1",)}))
    before = clean.log.truth["t_s"] - clean.release_s < 1.0 - 1e-9
    assert clean.log.measured[before].tobytes() == wrong.log.measured[before].tobytes()
    assert clean.log.truth[before].tobytes() == wrong.log.truth[before].tobytes()
    assert clean.log.measured[~before].tobytes() != wrong.log.measured[~before].tobytes()


def test_scenario_file_names_faults_and_the_option_replaces_them(here):
    """A scenario fails as its file says; --fault says otherwise."""
    (here / "failing.py").write_text(SCENARIO.replace("FAULTS", '("gps:outage@0-1", "gyro:bias=1@1")'))
    config = find("failing.py").config
    assert config.faults == ("gps:outage@0-1", "gyro:bias=1@1")
    assert run(["fly", "failing.py", "--no-rerun", "--fault", "gps:jump@1"]) in (0, 1)
    assert recorded(here).manifest["config"]["faults"] == ["gps:jump=50,0@1"]


def test_scenario_file_with_a_fault_that_cannot_be_is_refused(here, capsys):
    """In one line that names the file and the fault."""
    (here / "failing.py").write_text(SCENARIO.replace("FAULTS", '("gyro:stick@0-1",)'))
    assert run(["fly", "failing.py"]) == 2
    line = capsys.readouterr().err
    assert "failing.py" in line
    assert "did you mean stuck" in line
    assert line.count("\n") == 1


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("gyro.x:stick@20-25", "did you mean stuck"),
        ("giro:stuck@20-25", "did you mean gyro"),
        ("gyro", "gyro.x:stuck@20-25"),
        ("mag:stuck@2", "no magnetometer fitted"),
    ],
)
@pytest.mark.parametrize("command", [["fly", "hand_launch"], ["check", "hand_launch", "--seeds", "0"]])
def test_fault_that_cannot_be_is_refused_before_anything_is_flown(command, fault, words, here, capsys):
    """One line, exit code 2, no file."""
    assert run([*command, "--fault", fault]) == 2
    line = capsys.readouterr().err
    assert words in line
    assert line.count("\n") == 1
    assert not any(here.iterdir())


def test_check_flies_every_seed_with_the_faults(here, monkeypatch):
    """The gate is given the same faults; a gyro without an x axis fails it."""
    hand_launch = find("hand_launch")
    short = replace(hand_launch, config=hand_launch.config.model_copy(update={"duration_s": 4.0}))
    monkeypatch.setattr(gate, "find", lambda _: short)
    monkeypatch.setattr("scenarios.harness.flight.find", lambda _: short)
    arguments = ["check", "hand_launch", "--seeds", "0", "--workers", "1", "--json", "verdict.json"]
    assert run([*arguments, "--fault", "gyro:saturated@0.5"]) == 1
    assert not json.loads((here / "verdict.json").read_text())["passed"]


def test_fault_that_the_flight_is_too_short_for_is_warned_of(here, capsys):
    """It is flown, and a line on standard error says that the fault was never met."""
    assert run([*SHORT, "--fault", "gyro.x:stuck@20-25"]) in (0, 1)
    assert "warning: fault gyro.x:stuck@20-25 never happens" in capsys.readouterr().err
    assert not any("stuck" in event.text for event in recorded(here).events)
