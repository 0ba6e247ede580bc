"""Bad input on the command line: one clear line, exit code 2, nothing written."""

import os
from pathlib import Path

import pytest

from scenarios.harness.cli import run

FLY = ("fly", "hand_launch")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("fly", "hand_lunch"), "unknown scenario 'hand_lunch': did you mean hand_launch"),
        (("fly", "no_such_file.py"), "no file 'no_such_file.py'"),
        ((*FLY, "--estimator", "premelani"), "unknown estimator 'premelani': did you mean premerlani?"),
        ((*FLY, "--autopilot", "dmc"), "unknown autopilot 'dmc': did you mean dcm?"),
        ((*FLY, "--aircraft", "endurence"), "unknown aircraft 'endurence': did you mean endurance?"),
        ((*FLY, "--sensors", "generc"), "unknown sensor suite 'generc': did you mean generic"),
        ((*FLY, "--wind", "banana"), "for instance 5@270"),
        ((*FLY, "--gps-rate", "3"), "choose 1, 2, 2.5, 4, 5"),
        ((*FLY, "--imu-rate", "30"), "choose 40, 50, 100, 200 Hz"),
        ((*FLY, "--duration", "-3"), "duration_s = -3.0 s: must be above 0 s"),
        ((*FLY, "--turbulence", "-1"), "must be at least 0 m/s"),
        ((*FLY, "--seed", "-1"), "seed = -1: must be at least 0"),
        ((*FLY, "--seed", "x"), "'--seed'"),
        ((*FLY, "--set", "latency"), "write name=value"),
        ((*FLY, "--set", "gps.latncy_s=1"), "did you mean gps.latency_s"),
        ((*FLY, "--set", "gps.latency_s=late"), "must be a number"),
        ((*FLY, "--winds", "5@270"), "--wind"),
        ((*FLY, "--json", "nowhere/verdict.json"), "there is no folder nowhere"),
        (("fly",), "Missing argument"),
        (("chekc", "hand_launch"), "Did you mean 'check'?"),
        (("check", "hand_lunch"), "did you mean hand_launch"),
        (("check", "--seeds", "9-0"), "0-9 or 0,2,5-7"),
        (("check", "--seeds", "0-x"), "0-9 or 0,2,5-7"),
        (("check", "--workers", "0"), "'--workers'"),
        (("check", "--estimator", "premelani"), "did you mean premerlani?"),
        (("check", "--junit", "nowhere/junit.xml"), "there is no folder nowhere"),
        (("check", "--set", "seed=4"), "name the seeds to fly with --seeds"),
        (("fly", "crosswind", "--set", "start.height_m=1500"), "inside the flight box"),
        (("bench", "--estimator", "premelani"), "did you mean premerlani?"),
        (("view", "no_flight"), "no_flight"),
        (("view",), "fly first"),
    ],
)
def test_command_line_wrong_is_one_line_and_exit_code_2(
    arguments: tuple[str, ...], says: str, tmp_path: Path, monkeypatch, capfd
) -> None:
    """Every mistake is named in one line on standard error, before anything is flown or written."""
    monkeypatch.chdir(tmp_path)
    assert run(list(arguments)) == 2
    stdout, stderr = capfd.readouterr()
    (line,) = stderr.splitlines()
    assert line.startswith("wingslevel: ")
    assert says in line
    assert not stdout
    assert not list(tmp_path.iterdir())


def test_fly_into_a_file_is_refused_before_flying(tmp_path: Path, monkeypatch, capfd) -> None:
    """A folder for recordings that cannot be one is noticed first, and left as it was."""
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("mine")
    assert run([*FLY, "--out", "taken/flights"]) == 2
    assert "cannot write to taken/flights" in capfd.readouterr().err
    assert Path("taken").read_text() == "mine"


def test_json_into_a_folder_is_refused(tmp_path: Path, capfd) -> None:
    """A report cannot replace a folder."""
    assert run([*FLY, "--json", str(tmp_path)]) == 2
    assert "it is a folder" in capfd.readouterr().err


def test_json_into_a_link_is_written_where_it_points(tmp_path: Path) -> None:
    """A link stays a link."""
    (tmp_path / "there.json").write_text("old")
    (tmp_path / "here.json").symlink_to("there.json")
    assert run(["list", "--json", str(tmp_path / "here.json")]) == 0
    assert (tmp_path / "here.json").is_symlink()
    assert "hand_launch" in (tmp_path / "there.json").read_text()


def test_json_into_a_pipe_is_written_into_it(tmp_path: Path) -> None:
    """A pipe (or a device) is not replaced by a file."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        assert run(["list", "--json", str(pipe)]) == 0
        assert pipe.is_fifo()
        assert b"hand_launch" in os.read(reader, 100_000)
    finally:
        os.close(reader)
