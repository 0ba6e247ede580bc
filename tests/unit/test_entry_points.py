"""Estimators, scenarios and suites of an installed package: found by name, listed with origin, never in the way."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from scenarios.harness import equipping
from scenarios.harness.cli.app import run
from scenarios.harness.cli.values import estimators as completed_estimators
from scenarios.harness.cli.values import scenarios as completed_scenarios
from scenarios.harness.cli.values import suites as completed_suites
from scenarios.harness.commands import listing
from scenarios.harness.config import FlightConfig, overridden, override, resolve
from scenarios.harness.flight import prepare
from scenarios.harness.gate.sources import decided_by
from sim.outside.entry_points import ignored, offered
from sim.sensors.fitting import load_suite, own_files

ROOT = Path(__file__).resolve().parents[2]
FILES = {
    "filters.py": '''
        import numpy as np
        from estimator.interface import AttitudeEstimate
        from PACKAGE.gains import GAIN

        class MyFilter:
            """A level estimate, whatever is measured."""
            def update(self, measurements):
                return AttitudeEstimate(np.eye(3) * GAIN)

        def make():
            return MyFilter()
        ''',
    "gains.py": "GAIN = 1.0",
    "raising.py": "raise RuntimeError('no licence')",
    "storm.py": '''
        """A storm from the west."""
        from dataclasses import replace
        from scenarios.crosswind import SCENARIO
        STORY = SCENARIO.config.model_copy(update={"duration_s": 2.0})
        SCENARIO = replace(SCENARIO, name="other", story=__doc__, config=STORY)
        NUMBER = 3
        ''',
    "bench.toml": """
        summary = "my bench"
        gyro = "my_gyro.toml"
        accelerometer = "generic"
        gps = "generic"
        """,
    "__init__.py": """
        from pathlib import Path
        BENCH = Path(__file__).with_name("bench.toml")
        """,
    "my_gyro.toml": (ROOT / "sim" / "sensors" / "parts" / "itg3200.toml").read_text(encoding="utf-8"),
}
POINTS = """
[wingslevel.estimators]
my_filter = PACKAGE.filters:MyFilter
made = PACKAGE.filters:make
premerlani = PACKAGE.filters:MyFilter
raising = PACKAGE.raising:X
missing = no_such_package.x:Y
number = PACKAGE.storm:NUMBER
malformed = what is this?
[wingslevel.scenarios]
storm = PACKAGE.storm
storm_object = PACKAGE.storm:SCENARIO
storm_number = PACKAGE.storm:NUMBER
[wingslevel.suites]
bench = PACKAGE:bench.toml
bench_path = PACKAGE:BENCH
bench_gone = PACKAGE:gone.toml
bench_number = PACKAGE.storm:NUMBER
"""
_packages = 0


def install(folder: Path, name: str, points: str, version: str = "1.2") -> Path:
    """Write a package with FILES and the metadata of an installed one; returns its folder."""
    package, metadata = folder / name, folder / f"{name}-{version}.dist-info"
    for made in (package, metadata):
        made.mkdir(parents=True)
    for file, text in FILES.items():
        lines = text.replace("PACKAGE", name).splitlines()
        blank = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
        (package / file).write_text("\n".join(line[blank:] for line in lines).strip() + "\n", encoding="utf-8")
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    (metadata / "entry_points.txt").write_text(points.replace("PACKAGE", name), encoding="utf-8")
    return package


@pytest.fixture
def package(tmp_path: Path, monkeypatch) -> Path:
    """The folder of an installed package, of another name for each test: modules are imported once."""
    global _packages
    _packages += 1
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(listing, "_noted", set())
    return install(tmp_path / "site", f"their_package_{_packages}", POINTS)


@pytest.fixture
def refused(capsys) -> Callable[..., str]:
    """Runs a command that must be refused with exit code 2, and gives the one line that says why."""

    def _refused(*arguments: str) -> str:
        assert run(list(arguments)) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    return _refused


def test_list_shows_where_each_comes_from_and_what_is_broken(package: Path, capsys) -> None:
    """Broken ones are one line each; the rest of the list is there."""
    assert run(["list", "--json", "-"]) == 0
    found, origin = json.loads(capsys.readouterr().out), f"{package.name} 1.2"
    assert found["estimators"]["gyro_only"]["from"] == "wingslevel"
    assert found["estimators"]["my_filter"] == {"about": "A level estimate, whatever is measured.", "from": origin}
    assert found["scenarios"]["storm"] == {"about": "A storm from the west.", "from": origin}
    assert found["scenarios"]["storm_object"] == {"about": "A storm from the west.", "from": origin}
    assert found["suites"]["bench"] == found["suites"]["bench_path"] == {"about": "my bench", "from": origin}
    broken = {
        name: one["broken"] for things in list(found.values())[:6] for name, one in things.items() if "broken" in one
    }
    assert broken == {
        "raising": "RuntimeError: no licence (raising.py, line 1)",
        "missing": "ModuleNotFoundError: No module named 'no_such_package'",
        "number": "3 is not a class; name the class, or a function that makes a new one for each flight",
        "malformed": "'what is this?' must be package.module:Name",
        "storm_number": f"{package.name}.storm:NUMBER is 3; it must be a Scenario, or a module that exports SCENARIO",
        "bench_gone": f"sensor suite '{package / 'gone.toml'}': no such file",
        "bench_number": f"{package.name}.storm:NUMBER is 3; it must be the path of a .toml file",
    }
    assert found["notes"] == [f"estimator premerlani of {origin} is ignored: wingslevel has one of that name"]


@pytest.mark.parametrize("kind", ["scenarios", "estimators", "autopilots", "aircraft", "suites", "parts"])
def test_list_of_one_kind_shows_that_kind_alone(kind: str, capsys) -> None:
    """As a table and as JSON."""
    assert run(["list", kind, "--json", "-"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == [kind]
    assert run(["list", kind]) == 0
    assert capsys.readouterr().out.splitlines()[0].strip() == kind


def test_list_of_parameters_says_default_unit_and_effect(capsys) -> None:
    """As JSON and as a table; what --set is written in front of is in its heading."""
    assert run(["list", "estimators", "premerlani", "--params", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)["estimators"]["premerlani"]
    assert set(found["k_p"]) == {"default", "unit", "meaning", "raised", "lowered"}
    assert (found["k_p"]["default"], found["k_p"]["unit"]) == (1.0, "1/s")
    assert found["force_full_scale_m_s2"]["default"] == "inf"
    assert all(found["k_p"].values())
    assert run(["list", "estimators", "premerlani", "--params"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert out.startswith("premerlani: --set premerlani.NAME=VALUE")
    assert f"k_p 1 1/s {found['k_p']['meaning'][:15]}" in out


def test_list_of_parameters_of_your_own_class(package: Path, capsys) -> None:
    """Also from a file; a class without parameters says so."""
    assert run(["list", "estimators", f"{package / 'filters.py'}:MyFilter", "--params"]) == 0
    assert "--set my_filter.NAME=VALUE" in (out := capsys.readouterr().out)
    assert "no parameters" in out


def test_list_of_parameters_of_another_kind_is_refused(refused) -> None:
    """Exit code 2, one line."""
    assert "only estimators have parameters" in refused("list", "scenarios", "--params")


def test_list_of_an_unknown_kind_or_name_suggests_one(refused) -> None:
    """Exit code 2, one line."""
    assert "did you mean estimators?" in refused("list", "estimatrs")
    assert "did you mean premerlani?" in refused("list", "estimators", "premerlni")


@pytest.mark.usefixtures("package")
def test_table_has_a_heading_for_each_package(capsys) -> None:
    """Those of wingslevel come first; a name that is taken is a note."""
    assert run(["list", "suites"]) == 0
    out = capsys.readouterr().out
    assert 0 <= out.index("generic_6g") < out.index("suites of their_package_") < out.index("my bench")


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("fly", "storm", "--estimator", "raising"), "RuntimeError: no licence (raising.py, line 1)"),
        (("fly", "storm", "--estimator", "missing"), "No module named 'no_such_package'"),
        (("check", "storm_number", "--seeds", "0"), "must be a Scenario"),
        (("compare", "storm", "--estimators", "my_filter,number"), "3 is not a class"),
        (("fly", "storm", "--sensors", "bench_gone"), "no such file"),
        (("fly", "strom"), "did you mean storm?"),
        (("fly", "storm", "--estimator", "my_filtre"), "did you mean my_filter?"),
        (("fly", "storm", "--sensors", "bnech"), "did you mean bench or bench_path"),
    ],
)
def test_broken_or_misspelt_is_one_line_and_exit_code_2(refused, arguments: tuple[str, ...], says: str) -> None:
    """Whatever their code raises on import; a near miss names theirs too."""
    assert says in refused(*arguments)


@pytest.mark.usefixtures("package")
def test_name_that_is_taken_means_ours_and_says_so(capsys) -> None:
    """The flight is that of wingslevel's own estimator; one line says which package is ignored."""
    assert type(equipping.load_estimator("premerlani")).__module__ == "estimator.premerlani"
    run(["fly", "storm", "--no-rerun"])
    assert capsys.readouterr().err.count("is ignored: wingslevel has one of that name") == 1


def test_of_two_packages_with_one_name_the_first_counts(tmp_path: Path, monkeypatch) -> None:
    """By the name of the distribution, and the other is told."""
    for name in ("zeta_package", "alpha_package"):
        install(tmp_path, name, "[wingslevel.estimators]\ntwice = PACKAGE.filters:MyFilter\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert offered("estimators", ())["twice"].origin == "alpha_package 1.2"
    assert ignored("estimators", ()) == [
        "estimator twice of zeta_package 1.2 is ignored: alpha_package 1.2 has one of that name"
    ]


def test_damaged_metadata_of_one_package_hides_no_other(package: Path) -> None:
    """A line without a value makes the standard library raise for all."""
    install(package.parent, "damaged_package", "[wingslevel.estimators]\nnothing\n")
    assert "my_filter" in offered("estimators", ())


@pytest.mark.usefixtures("package")
def test_shell_completes_names_of_installed_packages() -> None:
    """Without importing them."""
    assert "my_filter" in completed_estimators("my_")
    assert "storm" in completed_scenarios("sto")
    assert "bench" in completed_suites("ben")


def test_check_flies_them_in_other_processes_and_keeps_them(package: Path, capsys) -> None:
    """Scenario, estimator and suite of the package; the ledger knows them again, and not after an edit."""
    command = ["check", "storm*", "--seeds", "0-1", "--workers", "2", "--ledger", "kept", "--json", "-"]
    command += ["--estimator", "my_filter", "--sensors", "bench"]
    assert run(command) == 1  # a level estimate passes nothing
    told = capsys.readouterr()
    assert "left out: scenario 'storm_number'" in told.err
    verdict = json.loads(told.out)
    assert {(f["scenario"], f["outcome"]) for f in verdict["flights"]} == {
        ("storm", "completed"), ("storm_object", "completed"),
    }  # fmt: skip
    assert verdict["run"]["flown"] == 4
    assert run(command) == 1
    assert json.loads(capsys.readouterr().out)["run"]["resumed"] == 4


@pytest.mark.parametrize(
    ("file", "spec", "part"),
    [
        ("gains.py", "my_filter", "estimator"),
        ("gains.py", "made", "estimator"),
        ("storm.py", "my_filter", "scenario_file"),
        ("my_gyro.toml", "my_filter", "config"),
    ],
)
def test_fingerprint_covers_the_sources_of_the_package(package: Path, file: str, spec: str, part: str) -> None:
    """The estimator's module and what it imports, the scenario's module, the files of the suite."""
    from scenarios.harness.gate import sources

    def decides() -> object:
        for cached in (sources._of_file, sources._of_modules):
            cached.cache_clear()
        return decided_by("storm", prepare("storm", {"estimator": spec, "suite": "bench"}))[part]

    before = decides()
    (package / file).write_text((package / file).read_text() + "\n# edited\n")
    assert before != decides()


def test_suite_of_a_package_flies_again_from_the_record_without_the_package(package: Path, monkeypatch) -> None:
    """The resolved configuration holds its files, under paths that are the same on every machine."""
    config = resolve(*overridden(FlightConfig(), {"suite": "bench"}))
    assert sorted(config.files) == ["bench", "bench/my_gyro.toml"]
    fitted = load_suite("bench")
    assert fitted == load_suite(str(package / "bench.toml"))
    monkeypatch.setattr("sys.path", [path for path in __import__("sys").path if path != str(package.parent)])
    assert own_files("bench") == {}
    assert load_suite("bench", config.files) == fitted
    assert override(config, {"seed": 1}).files == config.files


def test_package_that_ends_the_process_is_listed_as_broken(package: Path) -> None:
    """Its own process is guarded: the list is complete all the same."""
    import os
    import subprocess
    import sys

    (package / "raising.py").write_text("import os\nos._exit(7)\n")
    code = "from scenarios.harness.gate.guard import main; main()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(package.parent)])}
    done = subprocess.run(
        [sys.executable, "-c", code, "list", "estimators", "--json", "-"],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["estimators"]
    assert found["raising"]["broken"] == "the process ended by itself (exit code 7) when it was imported"
    assert found["my_filter"]["about"] == "A level estimate, whatever is measured."
