"""Damaged files of every kind that is read: each is read, or refused in one line that names it.

``WINGSLEVEL_FUZZ_SEED`` and ``WINGSLEVEL_FUZZ_N`` choose other damage, and more of it:
``WINGSLEVEL_FUZZ_SEED=7 WINGSLEVEL_FUZZ_N=50000 pytest tests/fuzz -m long``.
"""

import os
import resource
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scenarios.harness.cli.app import run

NAMES = (
    "csv",
    "text",
    "tabs",
    "gzip",
    "matlab",
    "dataflash",
    "ulog",
    "vectors",
    "attitudes",
    "map",
    "part",
    "suite",
    "parquet",
    "recording",
    "manifest",
    "nmea",
    "ubx",
)
SEED = int(os.environ.get("WINGSLEVEL_FUZZ_SEED", "0"))
FEW, MANY = 60, int(os.environ.get("WINGSLEVEL_FUZZ_N", "2000"))
WHOLE_COMMANDS = 40  # one in so many is read by the command too
LONGEST_S, MOST_KB = 10, 2 << 20
WITHOUT_A_PATH = ("nmea", "ubx")  # bytes are handed over, and have no name


class Hang(BaseException):
    """A file that is read for too long; no ValueError, whoever catches those."""


@contextmanager
def watched(seconds: float = LONGEST_S) -> Iterator[None]:
    """Raise `Hang` in the block after so many seconds."""

    def up(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def demand_one_line(said: str, named: str) -> None:
    """Demand a line that a terminal can show, and that says which file."""
    assert "\n" not in said, said
    assert said.isprintable(), said
    assert len(said) < 1200, len(said)
    assert named in said, said


def refused(target: Any, path: Path, *, named: bool) -> bool:
    """Read the file; whether it was refused, as it must be."""
    try:
        with watched():
            target.read(path)
    except ValueError as error:
        if isinstance(error.__cause__, Warning):  # made an error here: a user would have seen it beside the line
            raise error.__cause__ from None
        demand_one_line(str(error), path.parent.name if named else "")
        return True
    return False


def arguments(target: Any, path: Path) -> list[str]:
    """Of the command that reads the file; what it writes goes beside it."""
    told: list[str] = target.command(path)
    return [*told, "--no-rerun", "--out", str(path.parent / "out")] if told[0] == "replay" else told


def command_ends_well(target: Any, path: Path, capsys: Any) -> None:
    """Run the whole command on the file: exit code 0, 1 or 2, and with 2 one line on standard error."""
    out = path.parent / "out"
    with watched(3.0 * LONGEST_S):
        target.also(path, out)
        code = run(arguments(target, path))
    shutil.rmtree(out, ignore_errors=True)
    err = capsys.readouterr().err
    assert code in (0, 1, 2), code
    lines = [line for line in err.splitlines() if line.startswith("wingslevel: ")]
    assert "Traceback" not in err, err
    assert len(lines) == (1 if code == 2 else 0), err


def hunt(targets: ModuleType, name: str, n: int, folder: Path, capsys: Any) -> dict[str, int]:
    """Damage and read `n` times; how many were refused, read, and damaged at all."""
    target = targets.make(name, folder / "scratch")
    at = folder / f"{name}-here"
    at.mkdir()
    path = at / target.name
    target.make(at)
    target.read(path)  # while it is whole
    if target.command is not None:  # from here on everything is compiled
        assert run(arguments(target, path)) in (0, 1, 2)
        capsys.readouterr()
    found, whole = {"refused": 0, "read": 0, "damaged": 0}, path.read_bytes()
    for k in range(n):
        path.write_bytes(target.damaged(np.random.default_rng([SEED, NAMES.index(name), k])))
        found["damaged"] += path.read_bytes() != whole
        try:
            found["refused" if refused(target, path, named=name not in WITHOUT_A_PATH) else "read"] += 1
            if target.command is not None and k % WHOLE_COMMANDS == 7:
                command_ends_well(target, path, capsys)
        except BaseException as fault:  # of any kind: which damage it was is what one needs to know
            fault.add_note(f"{name}, damage {k} of seed {SEED}: {path}")
            raise
    return found


@pytest.mark.parametrize("name", NAMES)
def test_damaged_file_is_read_or_refused_in_one_line(targets, tmp_path, capsys, name):
    """A few of each kind; nearly all differ from the whole file, which some readers mend and others refuse."""
    found = hunt(targets, name, FEW, tmp_path, capsys)
    assert found["refused"] + found["read"] == FEW
    assert found["damaged"] > 0.8 * FEW


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_many_damaged_files_are_read_or_refused_in_one_line(targets, tmp_path, capsys, name):
    """As many as asked for, and no more memory than a small file may take."""
    found = hunt(targets, name, MANY, tmp_path, capsys)
    assert found["refused"] + found["read"] == MANY
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < MOST_KB
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < MOST_KB
