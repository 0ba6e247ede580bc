"""Bad input on the command line: one clear line, exit code 2, nothing written."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from scenarios.harness.cli import values as cli_values
from scenarios.harness.cli.app import run

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


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("fly", "crosswind", "--duration", "nan"), "'nan': write a plain finite number"),
        (("fly", "crosswind", "--duration", "\u0663"), "write a plain finite number"),
        (("fly", "crosswind", "--duration", "1e-320"), "one tick of the loop"),
        (("fly", "crosswind", "--duration", "36000", "--imu-rate", "200"), "at most 12255 s at 200 Hz: the log is"),
        (("fly", "crosswind", "--seed", "9" * 5000), "write a whole number"),
        (("fly", "crosswind", "--seed", str(2**32)), "must be at most 4294967295"),
        (("fly", "crosswind", "--set", "duration_s=1_000"), "duration_s = 1_000 s: write a plain finite number"),
        (("fly", "crosswind", "--set", "seed=0x10"), "seed = 0x10: write a plain finite number"),
        (("fly", "crosswind", "--set", "gps.latency_s=1e308"), "must be 0, or between 1e-12 and 1e+09 in size"),
        (("fly", "crosswind", "--set", "gps.latency_s=" + "[" * 5000), "must be a number"),
        (("fly", "crosswind", "--set", "estimator_params.k_p=[1,NaN]"), "in size"),
        (("fly", "crosswind", "--set", "board.rest_s=1e9"), "choose at most 600 s"),
        (("fly", "crosswind", "--set", "suits.nonsense=1"), "unknown parameter 'suits.nonsense'"),
        (("fly", "crosswind", "--wind", "\u0665@90"), "for instance 5@270"),
        (("fly", "crosswind", "--gust", "\u0665@1s"), "for instance 4@12s"),
        (("fly", "crosswind", "--thermals", "\u0665"), "write"),
        (("fly", "crosswind", "--out", ""), "--out: the text is empty"),
        (("fly", "crosswind", "--json="), "--json: the text is empty"),
        (("fly", "crosswind", "--out", "a\0b"), "NUL"),
        (("fly", "crosswind", "--json", "x" * 256), "x" * 40),
        (("fly", "crosswind", "--json", "/dev/full"), "cannot write to /dev/full: no space left"),
        (("check", "crosswind", "--seeds", "\u0660-\u0669"), "0-9 or 0,2,5-7"),
        (("check", "crosswind", "--seeds", "0-99999999"), "more than 10000 at once"),
        (("check", "--seeds", "0-9999"), "at most 100000 flights"),
        (("check", "--workers", "100000"), "choose 1 to"),
        (("compare", "crosswind", "--estimators", "premerlani,,gyro_only"), "an empty name"),
        (("replay", "/dev/full"), "a device"),
        (("replay", "x.csv", "--settle", "inf"), "write a plain finite number"),
        (("bench", "--seconds", "1e9"), "choose 2 to 3600 s"),
        (("agree", "/dev/full", "/dev/null"), "a device"),
    ],
)
def test_numbers_and_names_that_cannot_be_are_one_line_and_exit_code_2(
    arguments: tuple[str, ...], says: str, tmp_path: Path, monkeypatch, capfd
) -> None:
    """Before anything is flown or written, and without repeating thousands of characters."""
    monkeypatch.chdir(tmp_path)
    assert run(list(arguments)) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("wingslevel: ")
    assert says in line
    assert len(line) < 700
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("where", [0, 1])
def test_quiet_before_or_after_the_command_prints_nothing_but_reports(where: int, tmp_path: Path, capfd) -> None:
    """The JSON is written all the same."""
    arguments = ["list", "--json", str(tmp_path / "list.json")]
    arguments.insert(where, "--quiet")
    assert run(arguments) == 0
    assert capfd.readouterr() == ("", "")
    assert "crosswind" in (tmp_path / "list.json").read_text()


@pytest.mark.parametrize(
    ("duration", "code", "line"),
    [("1", 1, r"FAILED: \d of (\d) checks passed\n"), ("40", 0, r"passed: (\d) of \1 checks\n")],
)
def test_quiet_flight_prints_one_line(duration: str, code: int, line: str, tmp_path: Path, capfd) -> None:
    """The word is that of the verdict."""
    assert run(["fly", "hand_launch", "-q", "--no-rerun", "--duration", duration, "--out", str(tmp_path)]) == code
    assert re.fullmatch(line, capfd.readouterr().out)


def test_quiet_is_forgotten_by_the_next_command(capfd) -> None:
    """It is a wish for one command."""
    run(["--quiet", "list"])
    assert run(["list"]) == 0
    assert "crosswind" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("complete", "typed", "found"),
    [
        (cli_values.scenarios, "hand_launch_g", ["hand_launch_gust"]),
        (cli_values.estimators, "gyro_only,premer", ["gyro_only,premerlani"]),
        (cli_values.aircraft, "end", ["endurance"]),
        (cli_values.suites, "apm", ["apm2"]),
        (cli_values.autopilots, "d", ["dcm"]),
        (cli_values.claims, "offset_at", ["offset_at_power_up"]),
    ],
)
def test_completion_of_a_name_is_what_begins_so(complete: Callable, typed: str, found: list[str]) -> None:
    """Of the last name of a list, too."""
    assert list(complete(typed)) == found


def test_completion_imports_nothing_heavy() -> None:
    """A key was pressed, and somebody waits."""
    code = (
        "import sys; from scenarios.harness.cli import app, values; values.scenarios(''); values.claims('');"
        "print([m for m in ('numpy', 'numba', 'jsbsim', 'pyarrow', 'rich') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("arguments", [["--help"], ["check", "--help"], ["list"]])
def test_reader_that_closes_the_pipe_is_no_error(arguments: list[str]) -> None:
    """As with ``| head -1``: nothing on standard error, exit code 0."""
    code = "import sys; from scenarios.harness.gate.guard import main; main()"
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], stdout=write, stderr=subprocess.PIPE, text=True, check=False
        )
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (0, "")
