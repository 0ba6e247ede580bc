"""The public API over many flights: `wl.check`, `wl.compare`, `wl.replay`, with estimators of every kind."""

import json
import os
import subprocess
import sys
import textwrap
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wingslevel as wl
from estimator.baselines import GyroOnly
from scenarios.harness.cli.app import run

SHORT: dict[str, Any] = {"duration": 3, "seeds": (0, 1)}


class Level:
    """Believes that it flies level, to the north."""

    def __init__(self, k: float = 1.0) -> None:
        self.k = k

    def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
        """Always the same."""
        return wl.AttitudeEstimate(np.eye(3))


def test_check_is_that_of_the_command(tmp_path: Path) -> None:
    """The same verdicts, whether flown here or in worker processes."""
    options = ["--seeds", "0-1", "--set", "duration_s=3", "--wind", "3@90"]
    run(["check", "crosswind", *options, "--json", str(tmp_path / "check.json")])
    told = json.loads((tmp_path / "check.json").read_text())
    here = wl.check("crosswind", wind="3@90", workers=1, **SHORT)
    there = wl.check(["crosswind"], wind=(3, 90), workers=2, duration=3, seeds="0-1")
    for result in (here, there):
        data = json.loads(json.dumps(result.to_json()))
        assert data["flights"] == told["flights"]
        assert data["pooled"] == told["pooled"]
        assert result.passed == told["passed"]
    assert [flight.metrics for flight in here.flights] == [flight["metrics"] for flight in told["flights"]]


def test_check_result_shows_itself() -> None:
    """A line, a table for notebooks, a data frame, JUnit and Markdown."""
    result = wl.check("crosswind", estimator=Level, workers=1, **SHORT)
    assert repr(result).startswith("<CheckResult FAILED: 0 of 2 flights, 0 of 1 scenarios pooled")
    html = result._repr_html_()
    assert "crosswind" in html
    assert "2 flights failed" in html
    frame = result.to_pandas()
    assert list(frame["seed"]) == [0, 1]
    assert list(frame["inclination_rms_deg"]) == [flight.metrics["inclination_rms_deg"] for flight in result.flights]
    assert result.to_junit().startswith("<?xml")
    assert result.to_markdown().startswith("# Verdict")
    assert len(result) == 2


@pytest.mark.parametrize("workers", [1, 2])
def test_check_sends_a_class_that_can_be_imported(workers: int) -> None:
    """A class, and a partial of it, of an installed module."""
    for estimator in (GyroOnly, partial(GyroOnly)):
        result = wl.check("crosswind", estimator=estimator, workers=workers, **SHORT)
        assert [flight.outcome for flight in result.flights] == ["completed"] * 2, result.flights[0].message
        assert result.flights[0].estimator.startswith("estimator.baselines:GyroOnly")


def local() -> type:
    """A class inside a function."""

    class Local(Level):
        pass

    return Local


@pytest.mark.parametrize(
    ("estimator", "why"),
    [
        (local(), "because it is defined inside a function"),
        (lambda: Level(2.0), "because it is a lambda"),
        (partial(local(), k=3.0), "because it cannot be pickled"),
    ],
)
def test_check_flies_here_what_cannot_be_sent(estimator: Any, why: str) -> None:
    """Without `workers` they fly in this process, with several they are refused."""
    result = wl.check("crosswind", estimator=estimator, **SHORT)
    assert [flight.outcome for flight in result.flights] == ["completed"] * 2
    with pytest.raises(wl.WingslevelError, match=rf"cannot be sent .* {why}.*file\.py:Class") as refused:
        wl.check("crosswind", estimator=estimator, workers=2, **SHORT)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wl.compare("crosswind", []), "estimators holds none: name at least one"),
        (lambda: wl.compare("crosswind", seeds=[]), "seeds holds none: name at least one"),
        (lambda: wl.check([]), "scenarios holds none: name at least one"),
        (lambda: wl.check("crosswind", seeds=[]), "seeds holds none: name at least one"),
        (lambda: wl.check("crosswind", seeds=3.5), "seeds = 3.5: must be numbers"),  # type: ignore[arg-type]
        (lambda: wl.check(3), "scenario = 3: must be a name or a path"),  # type: ignore[arg-type]
        (lambda: wl.check("crosswind", progress=3), "progress = 3: must be True"),  # type: ignore[arg-type]
        (lambda: wl.check("crosswind", params=[1]), "params = .*must be a dict"),  # type: ignore[arg-type]
        (lambda: wl.compare(None), "scenario = None: must be a name or a path"),  # type: ignore[arg-type]
        (lambda: wl.replay("log.csv", []), "estimators holds none: name at least one"),
        (lambda: wl.replay(None), "log = None: must be a name or a path"),  # type: ignore[arg-type]
        (lambda: wl.replay("log.csv", withhold=3), "withhold = 3: must be a text"),  # type: ignore[arg-type]
        (lambda: wl.replay("log.csv", settle="soon"), "settle = 'soon': must be a number"),
    ],
)
def test_nothing_and_wrong_types_are_refused_in_one_line(call: Any, message: str) -> None:
    """An empty list is a mistake, not a short form for all."""
    with pytest.raises(wl.WingslevelError, match=message) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_check_sets_parameters_of_a_class() -> None:
    """By name, as of the command."""
    ours = wl.check("crosswind", estimator="premerlani", params={"k_p": 0.3}, workers=1, **SHORT)
    from estimator.premerlani import Premerlani

    own = wl.check("crosswind", estimator=Premerlani, params={"k_p": 0.3}, workers=1, **SHORT)
    assert [f.metrics for f in ours.flights] == [f.metrics for f in own.flights]


def test_check_keeps_a_ledger(tmp_path: Path) -> None:
    """The second call flies nothing; a class has no files to go by."""
    first = wl.check("crosswind", ledger=tmp_path, workers=1, **SHORT)
    again = wl.check("crosswind", ledger=tmp_path, workers=1, **SHORT)
    assert (first.to_json()["run"]["flown"], again.to_json()["run"]["flown"]) == (2, 0)
    assert first.flights == again.flights
    with pytest.raises(wl.WingslevelError, match="ledger: name the estimator"):
        wl.check("crosswind", ledger=tmp_path, estimator=Level, **SHORT)


def test_check_says_what_it_left_out() -> None:
    """A note, and nothing printed."""
    result = wl.check("gps_latency*", estimator="gyro_only", seeds=0, duration=3, workers=1)
    assert any("left out" in note for note in result.notes)


def test_campaigns_print_nothing(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Neither here nor in worker processes."""
    wl.check("crosswind", seeds=0, duration=1, workers=2)
    with pytest.warns(wl.WingslevelWarning, match="never happens"):
        wl.compare("crosswind", ["gyro_only", Level], seeds=0, duration=1, faults="gps:outage@30", workers=1)
    flight = wl.fly("hand_launch", duration=2)
    wl.replay(flight.save(tmp_path), ["premerlani", Level])
    assert capfd.readouterr() == ("", "")


def test_compare_is_that_of_the_command(tmp_path: Path) -> None:
    """The same numbers but for the time that they took."""
    options = ["--estimators", "premerlani,gyro_only", "--seeds", "0-1", "--set", "duration_s=3"]
    run(["compare", "crosswind", *options, "--json", str(tmp_path / "compare.json")])
    told = json.loads((tmp_path / "compare.json").read_text())
    result = wl.compare("crosswind", ["premerlani", "gyro_only"], workers=1, **SHORT)
    data = json.loads(json.dumps(result.to_json()))
    for each in (*told["estimators"], *data["estimators"]):
        for key in ("update_ns", "replay_ns"):
            assert each.pop(key) > 0
    assert data == told
    assert list(result.estimators) == ["premerlani", "gyro_only"]
    assert len(result.flights) == 4


def test_compare_takes_classes_and_shows_itself() -> None:
    """Two functions of one name stay apart; a line, a table, a data frame, a picture."""
    result = wl.compare("crosswind", [Level, lambda: Level(), lambda: Level(2.0), "gyro_only"], **SHORT)
    names = list(result.estimators)
    assert len(set(names)) == 4
    assert "<lambda>(2)" in names[2]
    assert result.passed
    assert repr(result).startswith("<Comparison crosswind, 2 seeds: ")
    assert "&lt;lambda&gt;" in result._repr_html_()
    assert list(result.to_pandas()["estimator"]) == names
    assert result.plot()._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert result.to_markdown().startswith("# crosswind")


def test_replay_is_that_of_the_command(tmp_path: Path) -> None:
    """The same scores; nothing is recorded without a folder."""
    log = wl.fly("hand_launch", duration=20).save(tmp_path / "log", rerun=False) / "flight.parquet"
    run(["replay", str(log), "--estimator", "premerlani,gyro_only", "--settle", "2", "--no-rerun",
         "--out", str(tmp_path / "out"), "--json", str(tmp_path / "replay.json")])  # fmt: skip
    told = json.loads((tmp_path / "replay.json").read_text())
    result = wl.replay(log, ["premerlani", "gyro_only"], settle=2)
    data = json.loads(json.dumps(result.to_json()))
    for each in (*told["estimators"].values(), *data["estimators"].values()):
        each.pop("recording")
        each.pop("ns_per_update")
    assert data == told
    assert (
        result["premerlani"].metrics["inclination_rms_deg"] == told["estimators"]["premerlani"]["inclination_rms_deg"]
    )
    assert result.passed


def test_replay_takes_a_class_and_shows_itself(tmp_path: Path) -> None:
    """Its flights have the attitude of the log as truth; they are recorded where a folder is named."""
    log = wl.fly("hand_launch", duration=5).save(tmp_path / "log", rerun=False)
    result = wl.replay(log, Level, settle=0, folder=tmp_path / "out")
    (flight,) = result.flights
    assert (flight.estimator, flight.judged, flight.seed) == ("Level", False, None)
    (folder,) = (tmp_path / "out").iterdir()
    assert repr(wl.load(folder)) == repr(flight)
    assert "replay of" in repr(flight)
    assert (repr(result), result.not_judged) == ("<Replay of log: Level>", "")
    assert "Level" in result._repr_html_()
    assert list(result.to_pandas()["estimator"]) == ["Level"]
    assert flight.plot().axes
    with pytest.raises(wl.WingslevelError, match="no verdict"):
        flight.verdict  # noqa: B018 - it raises


def test_replay_that_judges_nothing_says_why(tmp_path: Path) -> None:
    """It does not pass, and its one line is no list of good numbers."""
    log = wl.fly("hand_launch", duration=2).save(tmp_path / "log", rerun=False)
    result = wl.replay(log, Level, airborne=100)
    assert not result.passed
    assert result.not_judged in repr(result)
    assert "100 m/s" in result.not_judged


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wl.check("crosswnd"), "crosswind"),
        (lambda: wl.check("crosswind", seeds="a"), "0-9"),
        (lambda: wl.check("crosswind", seeds=[-1]), "seeds"),
        (lambda: wl.check("crosswind", workers=0), "workers"),
        (lambda: wl.check("crosswind", settings={"seed": 3}), "as an argument"),
        (lambda: wl.check("crosswind", timeout=-1), "timeout"),
        (lambda: wl.check("crosswind", estimator=Level()), "name the class"),
        (lambda: wl.compare("crosswind", ["premerlani", "nobody"]), "nobody"),
        (lambda: wl.compare("crosswind", ["premerlani"], params={"kp": 1}), "k_p"),
        (lambda: wl.replay("nowhere.csv"), "nowhere.csv"),
    ],
)
def test_campaigns_refuse_in_one_line(call: Any, message: str) -> None:
    """Before anything is flown."""
    with pytest.raises(wl.WingslevelError, match=message) as refused:
        call()
    assert "\n" not in str(refused.value)


def script(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run a script of the user's."""
    (folder / "mine.py").write_text(textwrap.dedent(text), encoding="utf-8")
    root = str(Path(wl.__file__).resolve().parents[1])
    env = {**os.environ, "PYTHONPATH": root}
    return subprocess.run(
        [sys.executable, "mine.py"], cwd=folder, env=env, capture_output=True, text=True, timeout=120, check=False
    )


CLASS = """
    import numpy as np
    import wingslevel as wl
    print("run")
    class Mine:
        def update(self, m):
            return wl.AttitudeEstimate(np.eye(3))
"""


def test_script_without_a_guard_flies_its_own_class(tmp_path: Path) -> None:
    """No `if __name__ == "__main__"`: the script is run once, and its class flies."""
    done = script(tmp_path, f"{CLASS}    print(wl.check('crosswind', estimator=Mine, seeds=(0, 1), duration=2))")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "run"
    assert len(done.stdout.splitlines()) == 2


def test_script_without_a_guard_may_use_workers(tmp_path: Path) -> None:
    """The processes do not run the script again."""
    done = script(tmp_path, f"{CLASS}    print(wl.check('crosswind', seeds=(0, 1), duration=2, workers=2))")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("run") == 1


def test_script_that_names_itself_is_refused(tmp_path: Path) -> None:
    """Loading the file would fly again, and so on: one line says what to do."""
    done = script(tmp_path, f"{CLASS}    wl.check('crosswind', estimator='mine.py:Mine', seeds=0, duration=2)")
    assert done.returncode == 1
    assert 'if __name__ == "__main__":' in done.stderr.splitlines()[-1]
    assert done.stdout.count("run") == 2


def test_module_that_flies_as_it_is_imported_costs_its_flights(tmp_path: Path) -> None:
    """A worker process that imports it does not start others."""
    (tmp_path / "filters.py").write_text(
        textwrap.dedent(CLASS) + "import scenarios.harness.gate.workers as w\n"
        "if w._Worker.inside: wl.check('crosswind', seeds=0, duration=1)\n",
        encoding="utf-8",
    )
    done = script(
        tmp_path,
        """
        import wingslevel as wl, filters
        for flight in wl.check("crosswind", estimator=filters.Mine, seeds=(0, 1), duration=1, workers=2).flights:
            print(flight.outcome, flight.message)
        """,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("a worker process cannot start others") == 2
