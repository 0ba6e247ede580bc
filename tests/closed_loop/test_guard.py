"""The process around a command: what flight code does to its own process never passes for a verdict."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-c", "from scenarios.harness.gate.guard import main; main()"]
OWN = """
import os, signal, sys, threading, time
import numpy as np
from estimator.interface import AttitudeEstimate

LEVEL = AttitudeEstimate(np.eye(3))


class Leaves:
    def update(self, m):
        if m.imu.t_s > 1.0:
            os._exit(0)
        return LEVEL


class Killed:
    def update(self, m):
        os.kill(os.getpid(), signal.SIGKILL)


class Deaf:
    def update(self, m):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
        while True:
            pass


class Writes:
    def update(self, m):
        for descriptor in range(1, 20):
            try:
                os.write(descriptor, b'{"passed": true}')
            except OSError:
                pass
        return LEVEL


class Stays:
    def __init__(self):
        threading.Thread(target=time.sleep, args=(1e6,)).start()

    def update(self, m):
        return LEVEL


class Unborn:
    def __init__(self):
        os._exit(0)

    def update(self, m):
        return LEVEL


class Unborn2:
    def __init__(self):
        time.sleep(1e6)

    def update(self, m):
        return LEVEL


class Shuts:
    def update(self, m):
        sys.stdout.close()
        sys.stderr.close()
        return LEVEL


class Closes:
    def update(self, m):
        os.closerange(1, 50)
        return LEVEL


class Slow:
    def update(self, m):
        time.sleep(0.05)
        return LEVEL
"""
QUICK = ("--set", "duration_s=2", "--no-rerun", "--json", "-")


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """The kernels that the commands need."""
    fly_scenario(find("crosswind"), {"duration_s": 1.0})
    fly_scenario(find("crosswind"), {"duration_s": 1.0}, estimator="gyro_only")


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with estimators that are not to be trusted."""
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    return tmp_path


def environment() -> dict[str, str]:
    """Of a command."""
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def wingslevel(here: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command, run to its end."""
    return subprocess.run(
        [*COMMAND, *arguments], cwd=here, env=environment(), text=True, capture_output=True, timeout=300
    )


@pytest.mark.parametrize(
    ("name", "options", "outcome", "says"),
    [
        ("Leaves", (), "worker_died", "the process ended by itself (exit code 0)"),
        ("Killed", (), "worker_died", "the process was killed by signal 9 (Killed)"),
        (
            "Deaf",
            ("--flight-timeout", "2"),
            "timed_out",
            "the process gave no answer within the time limit and was stopped",
        ),
    ],
)
def test_fly_estimator_that_ends_its_process_is_reported_with_exit_code_1(
    here: Path, name: str, options: tuple[str, ...], outcome: str, says: str
) -> None:
    """Nothing came back of the flight; the verdict is complete all the same."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", f"own.py:{name}", *QUICK, *options)
    verdict = json.loads(done.stdout)
    (flight,) = verdict["flights"]
    assert (done.returncode, verdict["passed"], flight["outcome"], flight["message"]) == (1, False, outcome, says)
    assert verdict["recording"] is None
    assert "Traceback" not in done.stderr


def test_fly_estimator_that_ends_its_process_before_flying_is_exit_code_2(here: Path) -> None:
    """Nothing was flown: the estimator cannot be constructed."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Unborn", *QUICK)
    assert (done.returncode, done.stdout) == (2, "")
    assert "ended by itself (exit code 0)" in done.stderr


def test_fly_estimator_that_is_never_constructed_is_given_up(here: Path) -> None:
    """A constructor that hangs is refused when the time is up."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Unborn2", "--flight-timeout", "3", *QUICK)
    assert (done.returncode, done.stdout) == (2, "")
    assert "took longer than 3 s while it was loaded" in done.stderr


def test_fly_estimator_that_closes_the_streams_is_reported_all_the_same(here: Path) -> None:
    """What is printed after the flight goes where it belongs."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Shuts", "--set", "duration_s=2", "--no-rerun")
    assert done.returncode == 1
    assert "recording   flights/crosswind-Shuts-seed0" in done.stdout


def test_fly_estimator_that_writes_to_every_descriptor_leaves_the_json_whole(here: Path) -> None:
    """Standard output is the parent's alone."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Writes", *QUICK)
    assert json.loads(done.stdout)["flights"][0]["estimator"] == "own.py:Writes"
    assert done.returncode == 1


def test_fly_estimator_that_closes_every_descriptor_is_no_pass(here: Path) -> None:
    """The parent hears nothing any more, and so passes nothing."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Closes", *QUICK)
    assert done.returncode != 0


def test_fly_estimator_whose_thread_never_ends_does_not_keep_the_command(here: Path) -> None:
    """The command ends when it is done, not when flight code lets it."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Stays", *QUICK)
    assert json.loads(done.stdout)["flights"][0]["outcome"] in ("completed", "ground_contact")


def test_fly_estimator_slower_than_the_tick_is_warned_of(here: Path) -> None:
    """It would fall behind aboard an aeroplane."""
    done = wingslevel(here, "fly", "crosswind", "--estimator", "own.py:Slow", *QUICK)
    assert "updates of the estimator took longer than the tick of 20 ms" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_check_that_is_cancelled_reports_what_was_finished(here: Path, number: int) -> None:
    """Ctrl-C, and SIGTERM as CI systems send it: every report is written, marked as incomplete, exit code 130."""
    files = ["--json", "v.json", "--junit", "v.xml", "--markdown", "v.md", "--ledger", "kept"]
    arguments = ["check", "crosswind", "--seeds", "0-499", "--set", "duration_s=2", "--workers", "1", *files]
    process = subprocess.Popen(
        [*COMMAND, *arguments], cwd=here, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    while not list(here.glob("kept/*.json")) and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    verdict = json.loads((here / "v.json").read_text())
    assert process.returncode == 130
    assert "interrupted" in said
    assert (verdict["passed"], verdict["interrupted"]) == (False, True)
    assert 0 < len(verdict["flights"]) < 500
    missing = f"{500 - len(verdict['flights'])} of 500 flights are missing"
    assert missing in (here / "v.md").read_text()
    assert missing in (here / "v.xml").read_text()


def test_replay_estimator_that_ends_its_process_leaves_the_others_their_scores(here: Path) -> None:
    """The log is replayed once more without it; it has failed, exit code 1."""
    assert wingslevel(here, "fly", "crosswind", "--set", "duration_s=2", "--no-rerun").returncode in (0, 1)
    names = "gyro_only,own.py:Leaves,accelerometer_only"
    done = wingslevel(here, "replay", "flights/crosswind-premerlani-seed0", "--estimator", names, *QUICK[2:])
    each = json.loads(done.stdout)["estimators"]
    assert done.returncode == 1
    assert each["Leaves"]["failure"] == "the process ended by itself (exit code 0)"
    assert (each["Leaves"]["recording"], each["Leaves"]["inclination_rms_deg"]) == (None, None)
    assert all(Path(here, each[name]["recording"]).is_dir() for name in ("gyro_only", "accelerometer_only"))
    assert len(list((here / "flights").iterdir())) == 3


def test_bench_estimator_that_ends_its_process_is_exit_code_1(here: Path) -> None:
    """One line says so, and the JSON."""
    done = wingslevel(here, "bench", "--estimator", "own.py:Leaves", "--seconds", "2", "--repeats", "3", "--json", "-")
    assert done.returncode == 1
    assert "ended by itself (exit code 0)" in json.loads(done.stdout)["failure"]


def test_fly_json_on_a_full_device_is_said_and_no_pass(here: Path) -> None:
    """What cannot be written makes the command fail."""
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    arguments = ["fly", "crosswind", "--estimator", "gyro_only", *QUICK]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, *arguments], cwd=here, env=environment(), stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert "cannot write the JSON to standard output" in done.stderr


def test_fly_estimator_that_leaves_the_working_directory_loses_no_report(here: Path) -> None:
    """Paths are those of the person who typed them."""
    source = "import os\nfrom own import *\nclass Goes(Stays):\n    def __init__(self):\n        os.chdir('/')\n"
    (here / "goes.py").write_text(source, encoding="utf-8")
    wingslevel(here, "fly", "crosswind", "--estimator", "goes.py:Goes", *QUICK[:-1], "v.json")
    assert Path(here, json.loads((here / "v.json").read_text())["recording"]).is_dir()


@pytest.mark.parametrize("command", ["bench", "replay"])
def test_estimator_that_ends_its_process_unwatched_is_exit_code_2(here: Path, command: str) -> None:
    """Where nobody watches, the parent's own word stands: no command ends well without saying so."""
    log = ["flights/crosswind-premerlani-seed0"] if command == "replay" else []
    if log:
        wingslevel(here, "fly", "crosswind", "--set", "duration_s=2", "--no-rerun")
    done = wingslevel(here, command, *log, "--estimator", "own.py:Unborn", "--json", "-")
    assert (done.returncode, done.stdout) == (2, "")
    assert "ended by itself (exit code 0) before anything was flown or written" in done.stderr


@pytest.mark.parametrize("from_thread", [False, True])
def test_signal_after_the_end_of_a_command_does_not_change_its_exit_code(from_thread: bool) -> None:
    """Between the end of the command and the sending of its code; also a signal that another thread receives."""
    program = f"""
        import os, signal, sys, threading, time
        from scenarios.harness.gate import guard

        def command():
            guard.stage("while it judged", guard.BROKEN)
            if {from_thread}:
                threading.Thread(target=time.sleep, args=(5.0,), daemon=True).start()
            return 1

        def late():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.1)

        guard._flush = late
        sys.exit(guard.guarded(command))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=False, timeout=60)
    assert done.returncode == 1
