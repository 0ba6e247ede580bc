"""`wingslevel compare`: the same air and noise for each, numbers that agree with the flights, files, exit codes."""

import json
import math
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from estimator import ESTIMATORS
from scenarios.harness import timing
from scenarios.harness.checks import Row
from scenarios.harness.cli.app import run
from scenarios.harness.commands import compare, compare_picture, comparison
from scenarios.harness.flight import fly_scenario
from scenarios.harness.metrics import Series, inclination_error_deg, rms
from scenarios.harness.registry import find
from scenarios.harness.verdict import FlightVerdict, PooledVerdict
from sim.log import Outcome

QUICK = ("compare", "crosswind", "--set", "duration_s=4")


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """An empty working directory, and no time spent on timing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compare, "TIMED_S", 2.0)
    monkeypatch.setattr(timing, "REPEATS", 1)
    return tmp_path


def flights(data):
    """Which flights a report holds, in its order."""
    return [(f["estimator"], f["seed"]) for f in data["flights"]]


def untimed(data):
    """A report without what depends on the machine."""
    timed = {"update_ns": None, "replay_ns": None}
    return {**data, "estimators": [{**line, **timed} for line in data["estimators"]]}


def test_compare_tells_draws_and_writes(here: Path, capsys) -> None:
    """One command: table, picture, Markdown and JSON, all of the same flights; exit code 0 because all flew."""
    files = ["--json", "c.json", "--markdown", "c.md", "--picture", "c.png"]
    names = "premerlani,gyro_only"
    assert run([*QUICK, "--estimators", names, "--seeds", "0,3", "--workers", "1", *files]) == 0
    data = json.loads((here / "c.json").read_text())
    assert flights(data) == [(name, seed) for name in names.split(",") for seed in (0, 3)]
    first, second = data["estimators"]
    assert (first["given"], second["given"]) == (["gyro", "accelerometer", "gps"], ["gyro"])
    assert (first["heading_reference"], second["heading_reference"]) == ("course", "nose")
    for line in data["estimators"]:
        of_it = [f["metrics"] for f in data["flights"] if f["estimator"] == line["estimator"]]
        pooled = math.sqrt(np.mean([m["inclination_rms_deg"] ** 2 for m in of_it]))
        assert line["inclination_rms_deg"] == pytest.approx(pooled, rel=1e-12)
        assert line["inclination_max_deg"] == max(m["inclination_max_deg"] for m in of_it)
        against = f"heading_against_{line['heading_reference']}_rms_deg"
        assert line["heading_rms_deg"] == pytest.approx(math.sqrt(np.mean([m[against] ** 2 for m in of_it])), rel=1e-12)
        assert 0.0 < line["replay_ns"] < line["update_ns"]
        assert line["survived"] == line["flights"] == 2
    told = capsys.readouterr().out
    assert max(len(line) for line in told.splitlines()) <= 80
    for text in (told, (here / "c.md").read_text(encoding="utf-8")):
        assert all(f"{line['inclination_rms_deg']:.2f}" in text for line in data["estimators"])
    assert (here / "c.png").read_bytes().startswith(b"\x89PNG")


def test_compare_is_the_same_on_any_number_of_workers(here: Path) -> None:
    """But for what an update costs, which is the machine's."""
    for n in (1, 2):
        run(
            [
                *QUICK,
                "--estimators",
                "gyro_only,premerlani",
                "--seeds",
                "1-2",
                "--workers",
                str(n),
                "--json",
                f"{n}.json",
            ]
        )
    one, two = (untimed(json.loads((here / f"{n}.json").read_text())) for n in (1, 2))
    assert one == two


def test_compare_gives_each_the_flight_that_it_would_have_alone(here: Path) -> None:
    """The number in the table is that of the flight flown by itself, with the same seed: same air, same noise."""
    run([*QUICK, "--estimators", "gyro_only,premerlani", "--seeds", "5", "--workers", "1", "--json", "c.json"])
    data = json.loads((here / "c.json").read_text())
    alone = fly_scenario(find("crosswind"), {"duration_s": 4.0}, seed=5, estimator="premerlani")
    assert data["estimators"][1]["inclination_rms_deg"] == rms(inclination_error_deg(alone).judged_values)


def test_compare_options_reach_the_flight(here: Path) -> None:
    """Sensors, air and faults, as of `check`; what is fitted shows in what each is given."""
    options = ["--sensors", "ideal", "--wind", "calm", "--fault", "gps:outage@1"]
    run([*QUICK, "--estimators", "peer_vqf", "--seeds", "0", "--workers", "1", "--json", "c.json", *options])
    (line,) = json.loads((here / "c.json").read_text())["estimators"]
    assert line["given"] == ["gyro", "accelerometer", "magnetometer"]
    assert line["replay_ns"] is None
    assert line["update_ns"] > 0.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["compare", "crosswinds"], "crosswind"),
        ([*QUICK, "--estimators", "premerlany"], "premerlani"),
        ([*QUICK, "--set", "estimator=gyro_only"], "--estimators"),
        ([*QUICK, "--set", "seed=3"], "--seeds"),
        ([*QUICK, "--seeds", "a"], "0-9"),
        ([*QUICK, "--picture", "c.gif"], "png"),
        ([*QUICK, "--markdown", "nowhere/c.md"], "nowhere"),
    ],
)
def test_compare_refuses_in_one_line_before_flying(here: Path, capsys, arguments: list[str], said: str) -> None:
    """Exit code 2, and what would be right."""
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error.lower()


def test_compare_estimator_that_fails_is_exit_code_1_and_the_others_fly(here: Path, capsys) -> None:
    """A fault of one's own class is one line of the table; the rest is compared."""
    Path("own.py").write_text("class Clumsy:\n    def update(self, m):\n        return 1 / 0\n", encoding="utf-8")
    names = "own.py:Clumsy,gyro_only"
    assert run([*QUICK, "--estimators", names, "--seeds", "0", "--workers", "1", "--json", "c.json"]) == 1
    failed, flew = json.loads((here / "c.json").read_text())["estimators"]
    assert (failed["survived"], flew["survived"]) == (0, 1)
    assert failed["update_ns"] is None
    assert "ZeroDivisionError" in capsys.readouterr().out


def test_compare_interrupted_keeps_what_was_finished(here: Path, ctrl_c, in_process, monkeypatch, capsys) -> None:
    """Ctrl-C in the fourth of six flights: three are told, each estimator has at least one, exit code 130."""
    really, flown = compare.fly_scenario, []

    def until_interrupted(*args, **kwargs):
        flown.append(kwargs["seed"])
        if len(flown) == 4:
            signal.raise_signal(signal.SIGINT)
        return really(*args, **kwargs)

    monkeypatch.setattr(compare, "fly_scenario", until_interrupted)
    names = "gyro_only,accelerometer_only"
    assert run([*QUICK, "--estimators", names, "--seeds", "0-2", "--workers", "1", "--json", "c.json"]) == 130
    data = json.loads((here / "c.json").read_text())
    assert data["interrupted"] is True
    assert flights(data) == [("gyro_only", 0), ("gyro_only", 1), ("accelerometer_only", 0)]
    assert "gyro_only" in capsys.readouterr().out


def test_compare_worker_that_dies_costs_its_own_flights_alone(here: Path, capsys) -> None:
    """The estimator that ends its process fails; the other is compared."""
    Path("own.py").write_text(
        "import os\nclass Leaves:\n    def update(self, m):\n        os._exit(0)\n", encoding="utf-8"
    )
    assert run([*QUICK, "--estimators", "own.py:Leaves,gyro_only", "--seeds", "0", "--json", "c.json"]) == 1
    left, flew = json.loads((here / "c.json").read_text())["estimators"]
    assert (left["survived"], flew["survived"]) == (0, 1)
    assert "worker died: the process that flew it ended by itself (exit code 0)" in capsys.readouterr().out


def test_compare_without_names_flies_all_whose_package_is_there(monkeypatch, capsys) -> None:
    """One that cannot be loaded is left out, with a line that says why."""
    monkeypatch.setitem(sys.modules, "vqf", None)
    plan = compare.prepare("crosswind", [], [0], {})
    assert set(plan.names) == set(ESTIMATORS) - {"peer_vqf"}
    assert "wingslevel[peers]" in capsys.readouterr().err


def entrant(name, errors, outcome=Outcome.COMPLETED):
    """An estimator with made-up errors, a flight for each row of `errors`."""
    t = 0.02 * np.arange(1, errors.shape[1] + 1)
    rows = (Row("survived", "", 1.0, ">=", 1.0, True),)
    flown = tuple(
        comparison.Traced(
            FlightVerdict("crosswind", name, seed, outcome, rows, {"flown_s": 1.0}),
            *[Series(t, e, np.ones(len(t), bool))] * 2,
        )
        for seed, e in enumerate(errors)
    )
    pooled = PooledVerdict("crosswind", name, len(flown), rows)
    return comparison.Entrant(name, ("gyro",), "nose", len(flown), flown, pooled)


def test_entrant_numbers_of_known_errors() -> None:
    """Closed forms: RMS over flights of 3 and 4 degrees, 95 % and maximum over all samples."""
    numbers = entrant("a", np.array([[3.0] * 50, [4.0] * 50])).numbers
    assert numbers["inclination_rms_deg"] == pytest.approx(math.sqrt(12.5), rel=1e-12)
    assert numbers["inclination_p95_deg"] == numbers["inclination_max_deg"] == 4.0


@pytest.mark.parametrize("n", [1, 20])
def test_picture_of_one_and_of_many_estimators(tmp_path: Path, n: int) -> None:
    """From a single flight of nothing but zeros to more estimators than colours, some without a judged sample."""
    plan = compare.prepare("crosswind", ["gyro_only"], [0], {})
    errors = [entrant(f"a{i}", np.full((1 + i % 3, 200), 0.3 * i)) for i in range(n)]
    errors += [entrant("early", np.full((2, 0), 0.0), Outcome.GROUND_CONTACT)]
    compare_picture.draw(comparison.Comparison(plan.scenario, plan.config, (0,), tuple(errors)), tmp_path / "c.svg")
    drawn = (tmp_path / "c.svg").read_text(encoding="utf-8")
    assert all(f'"axes_{i}"' in drawn for i in range(1, 7))


def test_picture_of_nothing_is_refused(tmp_path: Path) -> None:
    """Interrupted before the first flight ended."""
    plan = compare.prepare("crosswind", ["gyro_only"], [0], {})
    none = comparison.Entrant("a", (), "nose", 1, (), None)
    with pytest.raises(ValueError, match="nothing was flown"):
        compare_picture.draw(comparison.Comparison(plan.scenario, plan.config, (0,), (none,)), tmp_path / "c.png")
