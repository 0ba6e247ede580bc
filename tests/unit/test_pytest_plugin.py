"""The pytest plugin, in pytest processes of its own: one test for each seed, clear messages, numbers in the report."""

import os
import re
import shlex
import xml.etree.ElementTree as ElementTree
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace

import pytest

import wingslevel as wl
from wingslevel import pytest_plugin

pytest_plugins = ["pytester"]

# Until this tree is installed again after a change of its entry points, pytest does not find the plugin by itself.
_INSTALLED = any(point.name == "wingslevel" for point in entry_points(group="pytest11"))
PLUGIN = () if _INSTALLED else ("-p", "wingslevel.pytest_plugin")
KERNELS = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
HEAVY = (
    "numpy",
    "numba",
    "jsbsim",
    "rerun",
    "pyarrow",
    "scipy",
    "matplotlib",
    "pydantic",
    "scenarios",
    "sim",
    "estimator",
)

OWN = """
import numpy as np
import pytest
from wingslevel import AttitudeEstimate


class Level:
    def update(self, measurements):
        return AttitudeEstimate(np.eye(3))


"""


@pytest.fixture
def plugged(pytester: pytest.Pytester, monkeypatch) -> pytest.Pytester:
    """A folder of tests; processes started in it find compiled kernels where this one does."""
    monkeypatch.setenv("XDG_CACHE_HOME", KERNELS)
    monkeypatch.setenv("COLUMNS", "300")
    # The modules that a test loads stay: numba cannot be loaded a second time in one process.
    monkeypatch.setattr(pytester, "_sys_modules_snapshot", SimpleNamespace(restore=lambda: None))
    return pytester


def run(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """Run pytest with the plugin, in another process."""
    return pytester.runpytest_subprocess(
        *PLUGIN, "--strict-markers", "-W", "error", "-p", "no:cacheprovider", *arguments
    )


def test_one_test_for_each_seed_with_numbers_in_the_report(plugged: pytest.Pytester) -> None:
    """Over two processes: the message, the short summary, JUnit, the recording that is kept, the table at the end."""
    plugged.makepyfile(
        OWN
        + """
@pytest.mark.flight("crosswind", estimator=Level, seeds=range(2), duration=1)
def test_level(flown, within):
    within(flown, inclination_rms_deg=1.0, flown_s=(0.5, None))


@pytest.mark.flight("crosswind", seeds="0,7", duration=1)
def test_ours(flown, within):
    within(flown, inclination_rms_deg=45.0, height_min_m=(20.0, 200.0))
"""
    )
    result = run(plugged, "-n", "2", "--junitxml=report.xml")
    result.assert_outcomes(passed=2, failed=2)
    out = result.stdout.str()
    assert re.search(r"^E +AssertionError: inclination_rms_deg: measured \d+\.\d\d, limit 1\.00$", out, re.M)
    assert re.search(
        r"^FAILED \S+::test_level\[crosswind-seed1\] - inclination_rms_deg: measured \S+, limit 1\.00", out, re.M
    )
    assert re.search(r"^crosswind, Level +0 of 2 +\S+ deg \(worst \S+\) +\S+ deg", out, re.M)
    assert re.search(r"^crosswind, premerlani +2 of 2 ", out, re.M)
    cases = {case.get("name"): case for case in ElementTree.parse(plugged.path / "report.xml").iter("testcase")}
    assert set(cases) == {
        "test_level[crosswind-seed0]", "test_level[crosswind-seed1]",
        "test_ours[crosswind-seed0]", "test_ours[crosswind-seed7]",
    }  # fmt: skip
    told = {name: {p.get("name"): p.get("value") for p in case.iter("property")} for name, case in cases.items()}
    numbers = {"flight", "inclination_rms_deg", "heading_rms_deg"}
    assert set(told["test_ours[crosswind-seed7]"]) == numbers
    kept = told["test_level[crosswind-seed1]"]
    assert set(kept) == {*numbers, "recording"}
    flight = wl.load(kept["recording"])
    assert (flight.seed, f"{flight.metrics['inclination_rms_deg']}") == (1, kept["inclination_rms_deg"])
    assert f"recording: {kept['recording']}" in out
    (again,) = set(re.findall(r"fly it again: (wingslevel .*--seed 1 .*)", out))
    assert shlex.split(again) == [
        "wingslevel", "fly", "crosswind", "--seed", "1", "--estimator",
        "test_one_test_for_each_seed_with_numbers_in_the_report.py:Level", "--duration", "1",
    ]  # fmt: skip


def test_verdict_that_fails_is_told_in_the_summary(plugged: pytest.Pytester) -> None:
    """`assert flown.passed` says which check failed, and --wl-out keeps every recording."""
    plugged.makepyfile(
        """
import pytest

@pytest.mark.flight("crosswind", duration=1, seeds=3)
def test_verdict(flown):
    assert flown.passed

@pytest.mark.flight("crosswind", duration=1)
def test_nothing(flown):
    assert len(flown) == 50
"""
    )
    result = run(plugged, "--wl-out", "kept")
    result.assert_outcomes(passed=1, failed=1)
    out = result.stdout.str()
    assert re.search(r"^FAILED \S+ - inclination error RMS: not measured, limit 6.00 deg; heading", out, re.M)
    assert "fly it again: wingslevel fly crosswind --seed 3 --duration 1" in out
    assert f"recording: {plugged.path / 'kept' / 'crosswind-premerlani-seed3'}" in out
    assert sorted(path.name for path in (plugged.path / "kept").iterdir()) == [
        "crosswind-premerlani-seed0", "crosswind-premerlani-seed3",
    ]  # fmt: skip


def test_tests_without_flights_import_nothing_heavy(plugged: pytest.Pytester) -> None:
    """Every run of pytest loads the plugin; it costs milliseconds, also where the package sim is somebody else's."""
    plugged.makepyfile(sim="MINE = True")
    plugged.makepyfile(f"""
import sys

def test_modules(request):
    assert "wingslevel.pytest_plugin" in sys.modules
    assert not set({HEAVY!r}) & set(sys.modules)

def test_own_sim():
    import sim
    assert sim.MINE
""")
    run(plugged).assert_outcomes(passed=2)


def test_seeds_options_and_selection_at_collection(plugged: pytest.Pytester) -> None:
    """The option wins over the tests, and these over the ini value; -k picks a seed; nothing is flown for that."""
    plugged.makeini("[pytest]\nwl_seeds = 5-6\n")
    plugged.makepyfile(
        test_these="""
import pytest

pytestmark = pytest.mark.flight("crosswind")

@pytest.mark.flight("crosswind", seeds=[1, 2])
@pytest.mark.flight("circle", seeds=3)
def test_two(flown):
    ...

@pytest.mark.flight("circle", estimator="premerlani")
@pytest.mark.flight("circle", estimator="ins_ekf")
def test_estimators(flown):
    ...

def test_module(flown):
    ...
"""
    )

    def collected(*arguments: str) -> list[str]:
        lines = run(plugged, "--collect-only", "-q", *arguments).stdout.str().splitlines()
        return [line.partition("::")[2] for line in lines if "::" in line]

    assert collected() == [
        "test_two[crosswind-seed1]", "test_two[crosswind-seed2]", "test_two[circle-seed3]",
        "test_estimators[circle-premerlani-seed5]", "test_estimators[circle-premerlani-seed6]",
        "test_estimators[circle-ins_ekf-seed5]", "test_estimators[circle-ins_ekf-seed6]",
        "test_module[crosswind-seed5]", "test_module[crosswind-seed6]",
    ]  # fmt: skip
    assert collected("--wl-seeds", "8", "-k", "test_two") == ["test_two[crosswind-seed8]", "test_two[circle-seed8]"]
    assert collected("-k", "seed3") == ["test_two[circle-seed3]"]


@pytest.mark.parametrize(
    ("marker", "arguments", "says"),
    [
        ('"crosswind"', "", "a test marked flight takes the argument flown"),
        ("", "flown", "mark it with pytest.mark.flight(scenario, estimator=..., seeds=...)"),
        ('"crosswind", seeds="0-"', "flown", "seeds = '0-': write numbers and ranges"),
    ],
)
def test_marker_that_cannot_be_used_is_an_error_of_that_test(plugged, marker: str, arguments: str, says: str) -> None:
    """In one line; the other tests of the file run."""
    plugged.makepyfile(
        f"import pytest\n\n@pytest.mark.flight({marker})\ndef test_it({arguments}):\n    ...\n\ndef test_other(): ...\n"
    )
    result = run(plugged)
    result.assert_outcomes(passed=1, errors=1)
    out = result.stdout.str()
    assert [line for line in out.splitlines() if says in line and not line.startswith("ERROR ")] == [
        next(line for line in out.splitlines() if line.removeprefix("E").strip().startswith(says))
    ]
    assert "Traceback" not in out
    assert "pytest_plugin.py" not in out


def test_flight_that_cannot_be_flown_is_one_line(plugged: pytest.Pytester) -> None:
    """Misspelt names of scenarios, options and metrics suggest the right ones; flown wants a marker."""
    plugged.makepyfile(
        """
import pytest

@pytest.mark.flight("crosswnd")
def test_scenario(flown): ...

@pytest.mark.flight("crosswind", wnd="5@270")
def test_option(flown): ...

def test_unmarked(flown): ...

@pytest.mark.flight("crosswind", duration=1)
def test_metric(flown, within):
    within(flown, inclination_rms=1.0)
"""
    )
    result = run(plugged)
    result.assert_outcomes(failed=1, errors=3)
    out = result.stdout.str()
    details, summary = out.split("short test summary info")
    for text in (
        "cannot fly crosswnd: unknown scenario 'crosswnd': did you mean crosswind",
        "cannot fly crosswind: ",
        "mark the test with pytest.mark.flight",
        "unknown metric 'inclination_rms': did you mean inclination_rms_deg",
    ):
        assert (details.count(text), summary.count(text)) == (1, 1), text
    assert "wind" in next(line for line in out.splitlines() if "cannot fly crosswind" in line)
    assert "During handling" not in out
    assert "pytest_plugin.py" not in details
    assert re.search(r"^FAILED \S+::test_metric\[crosswind-seed0\] - (Failed: )?within: unknown metric", summary, re.M)


def test_junit_report_of_one_process_warns_of_nothing(plugged: pytest.Pytester) -> None:
    """Warnings are errors here; the numbers are in the report."""
    plugged.makepyfile(
        """
import pytest

@pytest.mark.flight("crosswind", duration=1)
def test_it(flown): ...
"""
    )
    result = run(plugged, "--junitxml=report.xml")
    result.assert_outcomes(passed=1)
    assert "warning" not in result.stdout.str().lower()
    (case,) = ElementTree.parse(plugged.path / "report.xml").iter("testcase")
    assert {p.get("name") for p in case.iter("property")} == {"flight", "inclination_rms_deg", "heading_rms_deg"}


def test_error_in_a_test_is_not_hidden_by_the_verdict(plugged: pytest.Pytester) -> None:
    """The summary names the exception, not a check that failed as well."""
    plugged.makepyfile(
        """
import pytest

@pytest.mark.flight("crosswind", duration=1, seeds=3)
def test_it(flown):
    assert not flown.passed
    flown.metrics["no_such_metric"]
"""
    )
    result = run(plugged)
    result.assert_outcomes(failed=1)
    assert re.search(r"^FAILED \S+ - KeyError: 'no_such_metric'", result.stdout.str(), re.M)


def test_flight_that_ends_early_is_never_within(plugged: pytest.Pytester) -> None:
    """An estimator that raises after a second has small errors until then."""
    plugged.makepyfile(
        """
import pytest
import wingslevel as wl

class Raising:
    def update(self, measurements):
        raise RuntimeError("enough")

@pytest.mark.flight("crosswind", estimator=Raising, duration=1)
def test_it(flown, within):
    within(flown, inclination_rms_deg=(None, 180.0))
"""
    )
    result = run(plugged)
    result.assert_outcomes(failed=1)
    result.stdout.re_match_lines([r"E +AssertionError: outcome: estimator_failed \(.*enough.*\)"])


def test_last_failed_repeats_the_seed(plugged: pytest.Pytester) -> None:
    """Names of tests are the same in every run."""
    plugged.makepyfile(
        """
import pytest

@pytest.mark.flight("crosswind", seeds=range(2), duration=1)
def test_it(flown):
    assert flown.seed != 1
"""
    )
    for arguments, outcomes in (((), {"passed": 1, "failed": 1}), (("--lf",), {"failed": 1})):
        result = plugged.runpytest_subprocess(*PLUGIN, "--strict-markers", *arguments)
        result.assert_outcomes(**outcomes)


def test_command_that_flies_it_again_has_every_option(request) -> None:
    """Those of wingslevel.fly as the command spells them; pytest's own command where something has no name there."""
    options = {
        "estimator": "own.py:Mine", "params": {"k_p": 0.5}, "wind": (5, 270), "gust": ["4@12s", "3@15s:up"],
        "faults": "gps:outage@10", "gps_rate": 1, "withhold": ["gps_latency_s", "gps_filter_s"], "timeout": 60,
        "settings": {"gps.latency_s": 0.5}, "turbulence": None,
    }  # fmt: skip
    task = pytest_plugin._Task("crosswind", 2, options)
    assert pytest_plugin._again(task, request.node) == (
        "wingslevel fly crosswind --seed 2 --estimator own.py:Mine --set estimator_params.k_p=0.5 --wind 5@270 "
        "--gust 4@12s --gust 3@15s:up --fault gps:outage@10 --gps-rate 1 --withhold gps_latency_s,gps_filter_s "
        "--flight-timeout 60 --set gps.latency_s=0.5"
    )
    unnamed = pytest_plugin._Task("crosswind", 2, {"estimator": lambda: None})
    assert pytest_plugin._again(unnamed, request.node) == shlex.join(["pytest", request.node.nodeid])


def test_file_beside_the_test_is_found_from_another_folder(tmp_path: Path, monkeypatch) -> None:
    """Relative names mean the working directory first."""
    (tmp_path / "mine.py").touch()
    monkeypatch.chdir(tmp_path.parent)
    assert pytest_plugin._beside("mine.py:Mine", tmp_path) == f"{tmp_path / 'mine.py'}:Mine"
    assert pytest_plugin._beside("mine.py", tmp_path) == str(tmp_path / "mine.py")
    assert pytest_plugin._beside("premerlani", tmp_path) == "premerlani"
    monkeypatch.chdir(tmp_path)
    assert pytest_plugin._beside("mine.py:Mine", tmp_path.parent) == "mine.py:Mine"
