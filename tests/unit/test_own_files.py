"""Files of the user's own: by name and by import, several of one name, with compiled kernels, and scenarios."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.equipping import load_estimator
from scenarios.harness.own_files import module_of_file
from scenarios.harness.registry import find
from sim import recording
from sim.log import Outcome

KERNELS = """
import numba
import numpy as np
from estimator.interface import AttitudeEstimate
from estimator.compiler.jit import kernel

@numba.njit(cache=True)
def once(x):
    return {factor} * x

@numba.njit(cache=True)
def twice(x):
    return once(once(x))

@kernel
def first(x):
    return once(x) + 1.0

@kernel
def second(x):
    return first(x) + twice(x)

class Mine:
    value = second(1.0)
    def update(self, m):
        return AttitudeEstimate(np.eye(3))
"""
BY_NAME = "from scenarios.harness.equipping import load_estimator; print(load_estimator('{file}:Mine').value)"
BY_IMPORT = "import sys; sys.path.insert(0, '{folder}'); import own; print(own.Mine.value)"
SCENARIO = """
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.bench_rest import SCENARIO as REST
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.metrics import Measured
from scenarios.harness.scenario import Scenario
from scenarios.harness.config import override

CONFIG = override(REST.config, {{"duration_s": 0.2}})
def script(config):
    return REST.script(config)
def metric(flight):
    return Measured(0.0)
def moments(flight):
    return [0.1]
{change}
SCENARIO = Scenario("mine", "Mine.", CONFIG, script, (SURVIVED, Check("c", "m", metric, 1.0)), {{"half-way": moments}})
"""
FLY = ("fly", "mine.py", "--no-rerun")


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def value_in_a_new_process(here: Path, program: str, cwd: Path | None = None) -> float:
    """What `program` prints, run by itself with a cache of its own."""
    env = {**os.environ, "XDG_CACHE_HOME": str(here / "cache"), "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=cwd or here, env=env, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


@pytest.mark.parametrize("by_name_first", [True, False])
def test_file_with_cached_kernels_works_by_name_and_by_import(here: Path, by_name_first: bool) -> None:
    """In two processes, in either order: what one has cached, the other can load; also from another folder,
    and where the name is taken there by another file."""
    (here / "own.py").write_text(KERNELS.format(factor=0.5))
    (here / "elsewhere").mkdir()
    (here / "elsewhere" / "own.py").write_text(KERNELS.format(factor=3.0))
    programs = [BY_NAME.format(file="own.py"), BY_IMPORT.format(folder=here)]
    for program in programs if by_name_first else reversed(programs):
        assert value_in_a_new_process(here, program) == 1.75
    there = here / "elsewhere"
    assert value_in_a_new_process(here, BY_NAME.format(file="../own.py"), there) == 1.75
    assert value_in_a_new_process(here, BY_NAME.format(file="own.py"), there) == 13.0


def test_two_files_of_one_name_work_in_one_process(here: Path) -> None:
    """Each keeps its own code and its own kernels, and an import of the name gives the first."""
    for folder, factor in (("one", 0.5), ("two", 2.0)):
        (here / folder).mkdir()
        (here / folder / "own_twin.py").write_text(KERNELS.format(factor=factor))
    one, two = (load_estimator(f"{folder}/own_twin.py:Mine") for folder in ("one", "two"))
    assert (one.value, two.value) == (1.75, 7.0)
    assert type(one).__module__ != type(two).__module__
    assert load_estimator("one/own_twin.py:Mine").value == 1.75
    import own_twin  # type: ignore[import-not-found]

    assert own_twin.Mine.value == 1.75


@pytest.mark.parametrize("name", ["json.py", "numpy.py", "sim.py", "my-own.py", "turtle.py"])
def test_file_called_like_something_else_hides_nothing(here: Path, name: str) -> None:
    """Python's own modules, installed ones and ours stay what they are."""
    (here / name).write_text("x = 1\n")
    before = dict(sys.modules)
    module = module_of_file(here / name, ValueError)
    assert module.x == 1
    stem = name.removesuffix(".py")
    assert module.__name__ not in (stem, "numpy")
    assert sys.modules.get(stem) is before.get(stem)


def test_file_is_run_anew_each_time_and_seen_when_it_changes(here: Path) -> None:
    """Flights share nothing, and an edit counts."""
    (here / "own_counter.py").write_text("n = [0]\n")
    module_of_file(here / "own_counter.py", ValueError).n[0] = 5
    assert module_of_file(here / "own_counter.py", ValueError).n == [0]
    (here / "own_counter.py").write_text("n = [1, 2]\n")
    assert module_of_file(here / "own_counter.py", ValueError).n == [1, 2]


def test_file_that_was_imported_is_the_same_module(here: Path, monkeypatch) -> None:
    """Its classes are the ones that the program has."""
    (here / "own_imported.py").write_text("class Mine:\n    def update(self, m): pass\n")
    monkeypatch.syspath_prepend(str(here))
    import own_imported  # type: ignore[import-not-found]

    assert type(load_estimator("own_imported.py:Mine")) is own_imported.Mine


def one_line(capfd) -> str:
    """The only line on standard error, without anything on standard output."""
    stdout, stderr = capfd.readouterr()
    (line,) = stderr.splitlines()
    assert not stdout
    return line


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("raise SystemExit(0)", "scenario 'mine.py': SystemExit: 0 (mine.py, line 17)"),
        ("raise KeyboardInterrupt", "scenario 'mine.py': KeyboardInterrupt: no message (mine.py, line 17)"),
        ("x = = 1", "scenario 'mine.py': SyntaxError: invalid syntax (mine.py, line 17)"),
        (
            "def script(config): 1 / 0",
            "scenario mine: script: ZeroDivisionError: division by zero (mine.py, line 17, in",
        ),
        ("def script(config): raise GeneratorExit", "GeneratorExit: no message (mine.py, line 17, in script)"),
        ("def script(config): return None", "script: it returned None; it must return a Script"),
        ("def script(config): return Script([(0.0, 'up')])", "at 0 s it asks for 'up'; it must ask for a Setpoint"),
        ("def script(config): return Script([(0.0, Setpoint(77))])", "asks for mode 77; it must ask for a Mode"),
        ("def script(config): return Script([])", "Script: no setpoint; give at least one"),
        ("metric = 3", "checks is (Check(name='survived'"),
        ("CONFIG = {}", "config is {}; it must be a FlightConfig"),
        ("script = None", "script is None; it must be a function"),
        ("moments = 'noon'", "milestones is {'half-way': 'noon'}; it must be functions by names"),
        ("Scenario = dict", "TypeError: dict expected at most 1 argument, got 6 (mine.py, line 18)"),
        ("def Scenario(*a): return None", "must export SCENARIO, a Scenario; it is None"),
        ("def Check(*a): return SURVIVED", "checks named twice: survived (mine.py, line 18)"),
    ],
)
def test_scenario_file_with_a_fault_is_one_line_and_exit_code_2(here: Path, capfd, change: str, says: str) -> None:
    """Whatever it raises, or is made of: before anything is flown."""
    (here / "mine.py").write_text(SCENARIO.format(change=change))
    assert run(list(FLY)) == 2
    assert says in one_line(capfd)
    assert not (here / "flights").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("def metric(flight): 1 / 0", "ZeroDivisionError: division by zero (mine.py, line 17, in metric)"),
        ("def metric(flight): raise SystemExit(0)", "SystemExit: 0 (mine.py, line 17, in metric)"),
        ("def metric(flight): raise StopIteration", "StopIteration: no message (mine.py, line 17, in metric)"),
        ("def metric(flight): return True", "its metric returned True; it must return a Measured"),
        ("def metric(flight): return Measured('low')", "ValueError: could not convert string to float: 'low'"),
        (
            "def moments(flight): raise KeyboardInterrupt",
            "KeyboardInterrupt: no message (mine.py, line 17, in moments)",
        ),
        ("def moments(flight): return ['noon']", "milestone 'half-way': ValueError: could not convert string to float"),
        ("def moments(flight): return 3", "milestone 'half-way': TypeError: 'int' object is not iterable"),
    ],
)
@pytest.mark.parametrize("command", ["fly", "check", "compare"])
def test_scenario_that_raises_while_it_judges_fails_the_flight_and_keeps_it(
    here: Path, capfd, change: str, says: str, command: str
) -> None:
    """The flight was flown: it is recorded, the other checks are told, and the verdict is that it failed."""
    (here / "mine.py").write_text(SCENARIO.format(change=change))
    options = {
        "fly": ("--no-rerun",),
        "check": ("--seeds", "0-1", "--workers", "1"),
        "compare": ("--seeds", "0", "--workers", "1", "--estimators", "gyro_only"),
    }[command]
    code = run([command, "mine.py", *options, "--json", "v.json"])
    report = (here / "v.json").read_text()
    stdout, stderr = capfd.readouterr()
    assert "Traceback" not in stdout + stderr
    assert says in report.replace('\\"', '"')
    assert code == 1
    assert says in stdout.replace("\n", " ") or command == "fly"  # there in the table, which wraps
    if command == "fly":
        assert not stderr
        (manifest,) = here.glob("flights/*/manifest.json")
        assert recording.load(manifest.parent).outcome == Outcome.COMPLETED


@pytest.mark.parametrize("field", ["sense", "pooled"])
def test_check_of_an_unknown_sense_is_refused(here: Path, field: str) -> None:
    """A slip such as ``<`` must not be read as ``>=``."""
    check = f"def Check(*a): from scenarios.harness.checks import Check as C; return C(*a, {field}='<')"
    (here / "mine.py").write_text(
        SCENARIO.format(change=check.replace(": from", ":\n    from").replace("; ", "\n    "))
    )
    with pytest.raises(ValueError, match=r"checks is .* must be Checks \(mine\.py, line 20\)"):
        find("mine.py")


@pytest.mark.parametrize("command", ["check", "compare"])
def test_script_that_raises_for_one_seed_fails_that_flight_and_loses_no_other(here: Path, capfd, command: str) -> None:
    """It did not when it was asked before the first."""
    change = "def script(config):\n    if config.seed == 1: raise SystemExit(0)\n    return REST.script(config)"
    (here / "mine.py").write_text(SCENARIO.format(change=change))
    options = ["--estimators", "gyro_only"] if command == "compare" else []
    assert run([command, "mine.py", "--seeds", "0-2", "--workers", "1", *options, "--json", "v.json"]) == 1
    flights = json.loads((here / "v.json").read_text())["flights"]
    assert [flight["outcome"] for flight in flights] == ["completed", "scenario_failed", "completed"]
    assert flights[1]["message"] == "scenario mine: script: SystemExit: 0 (mine.py, line 18, in script)"
    assert not flights[1]["passed"]
    assert flights[1]["message"] in capfd.readouterr().out


@pytest.mark.parametrize(
    ("line", "is_refused"),
    [
        ("import sim", True),
        ("from sim import SCALE", True),
        ("import sim.loop", False),
        ("from sim import loop", False),
    ],
)
def test_own_module_that_a_package_of_ours_hides_is_named(here: Path, line: str, is_refused: bool) -> None:
    """Not silently our package in place of the user's sim.py; an import that only ours can give is left alone."""
    Path("sim.py").write_text("SCALE = 2.0\n", encoding="utf-8")
    Path("own.py").write_text(
        f"{line}\n\nclass Mine:\n    def update(self, m):\n        return None\n", encoding="utf-8"
    )
    if is_refused:
        with pytest.raises(
            ValueError, match=r"own\.py imports 'sim', a package of wingslevel: rename your own .*sim\.py"
        ):
            load_estimator("own.py:Mine")
    else:
        load_estimator("own.py:Mine")
