"""A check that is killed at any moment: no process stays, nothing finished is lost, nothing is left lying about."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-c", "from scenarios.harness.gate.guard import main; main()"]
CHECK = ["check", "crosswind", "--seeds", "0-5", "--set", "duration_s=2", "--estimator", "gyro_only", "--workers", "2"]
REPORTS = ["--json", "v.json", "--junit", "v.xml", "--markdown", "v.md", "--ledger", "kept"]


def started(here: Path) -> subprocess.Popen[bytes]:
    """A check in a session of its own."""
    return subprocess.Popen(
        [*COMMAND, *CHECK, *REPORTS], cwd=here, env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


def session(leader: int) -> list[int]:
    """Processes of the session of `leader` that are alive."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[3]) == leader and fields[0] not in ("Z", "X"):
            found.append(int(path.parent.name))
    return found


def settled(leader: int) -> list[int]:
    """Processes of the session that stay, after time enough to end."""
    for _ in range(200):
        if not (left := session(leader)):
            break
        time.sleep(0.05)
    return left


def killed_at_random(here: Path, kills: int, seed: int, longest_s: float) -> None:
    """Kill the check that many times; see after each that it goes on where it was, at last that all is as it was."""
    draw, kept = random.Random(seed), 0
    fly_scenario(find("crosswind"), {"duration_s": 1.0}, estimator="gyro_only")  # compiles
    for _ in range(kills):
        process = started(here)
        time.sleep(draw.uniform(0.0, longest_s))
        process.send_signal(draw.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM]))
        code = process.wait(timeout=300)
        assert settled(process.pid) == []
        assert code in (-signal.SIGKILL, -signal.SIGTERM, 130, 0, 1)
        now = len([path for path in here.glob("kept/*.json") if not path.name.startswith(".")])
        assert now >= kept
        kept = now if now < 6 else 0
        if now == 6:
            for path in here.glob("kept/*.json"):
                path.unlink()
    assert started(here).wait(timeout=300) in (0, 1)
    verdict = json.loads((here / "v.json").read_text())
    assert verdict["run"]["flown"] + verdict["run"]["resumed"] == len(verdict["flights"]) == 6
    assert sorted(path.name for path in here.iterdir()) == ["kept", "v.json", "v.md", "v.xml"]
    assert all(path.suffix == ".json" and not path.name.startswith(".") for path in (here / "kept").iterdir())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_check_killed_at_random_moments_goes_on_where_it_was(tmp_path: Path) -> None:
    """A few moments; the long tests try a hundred."""
    killed_at_random(tmp_path, 4, seed=1, longest_s=6.0)


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_check_killed_at_a_hundred_moments_goes_on_where_it_was(tmp_path: Path) -> None:
    """From the first instruction to the last report."""
    killed_at_random(tmp_path, 100, seed=2, longest_s=6.0)
