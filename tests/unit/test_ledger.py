"""The ledger of verdicts: what is kept comes back the same, and only where nothing that decides it has changed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from estimator.instruments import Known
from scenarios.harness.checks import Row
from scenarios.harness.cli.app import run
from scenarios.harness.flight import prepare
from scenarios.harness.gate import sources
from scenarios.harness.gate.ledger import Ledger
from scenarios.harness.verdict import FlightVerdict
from sim.log import Outcome

OWN = """
import numpy as np
from helper import SCALE
from estimator.interface import AttitudeEstimate


class Own:
    def update(self, m):
        return AttitudeEstimate(np.eye(3) * SCALE)
"""


def verdict(**changes) -> FlightVerdict:
    """A verdict with one of each that is hard to write."""
    rows = (
        Row("error", "deg", 0.1 + 0.2, "<=", 3.0, True),
        Row("nothing", "deg", float("nan"), "<=", 3.0, False, "0 of 3 samples"),
        Row("far", "m", float("inf"), ">=", 1.0, True),
    )
    fields = {"metrics": {"a": 1 / 3, "b": None}, "known": {"gps_latency_s": Known(0.3, "set", "")}, "wall_s": 1.25}
    return replace(
        FlightVerdict("crosswind", "own.py:Own", 3, Outcome.COMPLETED, rows, {}, "a line"), **fields | changes
    )


def test_verdict_that_is_kept_comes_back_the_same_to_the_bit(tmp_path: Path) -> None:
    """Numbers that JSON does not know, too."""
    ledger = Ledger(tmp_path)
    ledger.keep("k" * 64, verdict())
    found = ledger.find("k" * 64, "crosswind", 3)
    assert repr(found) == repr(verdict())


@pytest.mark.parametrize("outcome", [Outcome.TIMED_OUT, Outcome.WORKER_DIED, Outcome.INTERRUPTED])
def test_verdict_of_the_moment_is_not_kept(tmp_path: Path, outcome: Outcome) -> None:
    """The next time the machine may be quicker."""
    Ledger(tmp_path).keep("k" * 64, verdict(outcome=outcome))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "bend",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: text.replace("0.30000000000000004", "0.1"),
        lambda text: text.replace('"passed": true', '"passed": false').replace("completed", "diverged"),
        lambda text: "[" * 100_000,
        lambda text: "null",
    ],
)
def test_file_that_was_damaged_is_left_out_and_said(tmp_path: Path, bend, capsys) -> None:
    """Nobody's verdict is taken from half a file, or from one that somebody has edited."""
    ledger = Ledger(tmp_path)
    ledger.keep("k" * 64, verdict())
    (path,) = tmp_path.iterdir()
    path.write_text(bend(path.read_text()))
    assert ledger.find("k" * 64, "crosswind", 3) is None
    assert "is damaged: its flight is flown again" in capsys.readouterr().err


def fingerprint(spec: str, **changes) -> str:
    """Of a flight of the estimator."""
    for cached in (sources._of_file, sources._of_modules):
        cached.cache_clear()  # of another run
    prepared = prepare("crosswind", {"estimator": spec, **changes})
    return sources.fingerprint(sources.decided_by("crosswind", prepared))


def test_fingerprint_changes_with_everything_that_decides_a_flight(tmp_path: Path, monkeypatch) -> None:
    """An edit of the estimator, of what it imports, a parameter, the estimator itself; not the same again."""
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(OWN, encoding="utf-8")
    Path("helper.py").write_text("SCALE = 1.0\n", encoding="utf-8")
    first = fingerprint("own.py:Own")
    assert fingerprint("own.py:Own") == first
    others = [fingerprint("own.py:Own", duration_s=5.0), fingerprint("gyro_only")]
    Path("helper.py").write_text("SCALE = 1.1\n", encoding="utf-8")
    others.append(fingerprint("own.py:Own"))
    Path("helper.py").write_text("SCALE = 1.0\n", encoding="utf-8")
    assert fingerprint("own.py:Own") == first
    Path("own.py").write_text(OWN + "\n", encoding="utf-8")
    others.append(fingerprint("own.py:Own"))
    assert len({first, *others}) == 5


def test_check_with_a_ledger_flies_what_is_missing_and_tells_the_same(tmp_path: Path, monkeypatch, in_process) -> None:
    """JSON but for `run`, Markdown, and JUnit with its times: byte for byte those of a run without a ledger."""
    monkeypatch.chdir(tmp_path)
    check = ["check", "crosswind", "hand_launch", "--set", "duration_s=3"]

    def reports(seeds: str, name: str, *options: str) -> tuple[int, dict, list[str]]:
        files = ["--json", f"{name}.json", "--markdown", f"{name}.md", "--junit", f"{name}.xml"]
        code = run([*check, "--seeds", seeds, *files, *options])
        data = json.loads(Path(f"{name}.json").read_text())
        return code, data.pop("run"), [json.dumps(data), Path(f"{name}.md").read_text()]

    plain = reports("0-2", "plain")
    begun = reports("0-1", "begun", "--ledger", "kept")
    resumed = reports("0-2", "resumed", "--ledger", "kept")
    again = reports("0-2", "again", "--ledger", "kept")
    assert [(run["flown"], run["resumed"]) for _, run, _ in (plain, begun, resumed, again)] == [
        (6, 0), (4, 0), (2, 4), (0, 6),
    ]  # fmt: skip
    assert plain[0] == resumed[0] == again[0]
    assert plain[2] == resumed[2] == again[2]
    assert Path("resumed.xml").read_text() == Path("again.xml").read_text()
    assert len(list(Path("kept").iterdir())) == 6
