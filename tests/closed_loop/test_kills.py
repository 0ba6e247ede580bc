"""Killed at any moment: what has its real name is complete, and the next command clears up what was left.

The moments are drawn with a fixed seed.  Half of them lie anywhere in the life of a command, the other half just
after it has begun to write.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from estimator.compiler import kernel_cache
from scenarios.harness.cli.app import run
from sim import recording
from sim.view import rerun_view

ROOT = Path(recording.__file__).parents[1]
FLY = ["fly", "hand_launch", "--duration", "2", "--out", "flights"]
MAIN = "from scenarios.harness.gate.guard import main; main()"


def start(*arguments):
    """A command in a process of its own, and of its own group."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-c", MAIN, *arguments],
        env=env, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def kill(process, wait_s, after):
    """Kill the command `wait_s` after its start, or after something has appeared in the folder `after`."""
    there = set(os.listdir(after)) if after else set()
    end_s = time.monotonic() + 60.0
    while after and set(os.listdir(after)) <= there and process.poll() is None and time.monotonic() < end_s:
        time.sleep(0.001)
    try:
        process.wait(wait_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def group_is_gone(process, within_s=10.0):
    """Whether all processes of the command's group end."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def check_all(folder):
    """Every file and folder has its real name and is complete."""
    assert not list(folder.rglob(".*"))
    assert not [path for path in kernel_cache.base().rglob(".*") if kernel_cache.owner.is_left_behind(path)]
    recordings = list(folder.glob("flights/*"))
    for path in recordings:
        assert len(recording.load(path).log) > 0
        assert {file.name for file in path.iterdir()} - {"flight.rrd"} == {"flight.parquet", "manifest.json"}
        if (path / "flight.rrd").exists():
            assert rerun_view._is_complete((path / "flight.rrd").read_bytes())
    for report in folder.glob("*.json"):
        json.loads(report.read_text())
    return len(recordings)


def life_s(folder):
    """How long the command takes here, with all its kernels compiled; it must pass."""
    run([*FLY[:-1], str(folder)])
    began_s = time.monotonic()
    process = start(*FLY[:-1], str(folder))
    assert process.wait(120.0) in (0, 1)
    return time.monotonic() - began_s


def kill_often(folder, n, seed):
    """Kill the command at `n` moments; the next command must find and leave nothing half done."""
    draw = random.Random(seed)
    whole_s = life_s(folder / "first")
    here = folder / "here"
    here.mkdir()
    os.chdir(here)
    killed = 0
    for k in range(n):
        wrote = bool(k % 2)
        process = start(*FLY, "--json", f"{k}.json")
        # Where there is no folder of flights yet, the draft is beside where that will be.
        after = ("flights" if os.path.isdir("flights") else ".") if wrote else None
        kill(process, draw.uniform(0.0, 0.3 if wrote else whole_s), after)
        killed += process.returncode == -signal.SIGKILL
        assert group_is_gone(process)
        assert all(recording.load(path) for path in Path("flights").glob("[!.]*"))  # complete before anybody clears up
        if k % 3 == 2 or k == n - 1:
            assert run([*FLY, "--no-rerun", "--seed", str(k), "--json", "next.json"]) in (0, 1)
            assert check_all(here) > 0
            shutil.rmtree("flights")
    assert killed > n // 3


def test_kill_a_few_moments_leave_nothing_half_done(tmp_path, monkeypatch):
    """Three of the moments of the long proof."""
    monkeypatch.chdir(tmp_path)
    kill_often(tmp_path, 3, seed=1)


@pytest.mark.long
def test_kill_a_hundred_moments_leave_nothing_half_done(tmp_path, monkeypatch):
    """Wherever it is killed: no leftovers, no incomplete recording, no process."""
    monkeypatch.chdir(tmp_path)
    kill_often(tmp_path, 100, seed=2)


@pytest.mark.long
def test_commands_at_the_same_time_write_into_one_folder_and_lose_nothing(tmp_path, monkeypatch):
    """Six at once, two of them killed on the way: four recordings of their own names, all complete."""
    monkeypatch.chdir(tmp_path)
    run([*FLY[:-1], str(tmp_path / "first")])
    processes = [start(*FLY, "--json", f"{k}.json") for k in range(6)]
    for process in processes[:2]:
        kill(process, 0.5, None)
    assert all(process.wait(120.0) in (0, 1) for process in processes[2:])
    assert run([*FLY, "--no-rerun", "--seed", "9"]) in (0, 1)
    n = check_all(tmp_path)
    assert n == 5
    told = [json.loads(Path(f"{k}.json").read_text())["recording"] for k in range(2, 6)]
    assert len({*told}) == 4
    assert all(Path(place).is_dir() for place in told)
