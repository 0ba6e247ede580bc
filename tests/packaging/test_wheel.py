"""The wheel: what is in it, and that it works alone, far from the checkout."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from scenarios.harness.registry import registered

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("estimator", "autopilot", "sim", "scenarios", "wingslevel")
DATA = (".xml", ".toml", ".md", ".obj", ".glb", ".h", ".c")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The wheel of this checkout."""
    into = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(into), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = into.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory) -> Path:
    """The `bin` folder of a new virtual environment with the wheel in it.

    The dependencies are borrowed from this environment, so that nothing is downloaded.  The checkout, which may be
    installed here as editable, is not.
    """
    home = tmp_path_factory.mktemp("venv")
    venv.create(home, with_pip=False)
    bin_ = home / ("Scripts" if os.name == "nt" else "bin")
    python = str(bin_ / "python")
    command = [sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", str(wheel)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    purelib = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    Path(purelib, "borrowed.pth").write_text("\n".join(map(str, borrowed())) + "\n", encoding="utf-8")
    return bin_


def borrowed() -> list[Path]:
    """Folders of this environment that hold installed packages: site-packages, and what its .pth files add to it."""
    site = Path(sysconfig.get_path("purelib"))
    added = [site / line for path in site.glob("*.pth") for line in path.read_text(encoding="utf-8").splitlines()]
    return [site, *(folder for folder in added if folder.is_dir() and not folder.samefile(ROOT))]


def call(command: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run `command` in `cwd`, without any help from the environment of the tests."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(command, cwd=cwd, env=clean, capture_output=True, text=True, check=False)


def test_wheel_contains_every_source_and_data_file(wheel: Path) -> None:
    """No XML of an aeroplane and no TOML of a sensor is left behind, and nothing else is packed."""
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    expected = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if (path.suffix in (".py", *DATA) or path.name == "py.typed") and "__pycache__" not in path.parts
    }
    assert names == expected
    assert any(name.endswith(".xml") for name in names)
    for folder in ("parts", "suites"):
        assert any(name.startswith(f"sim/sensors/{folder}/") and name.endswith(".toml") for name in names)


def test_wheel_installed_is_what_runs(installed: Path, tmp_path: Path) -> None:
    """The five packages come from the wheel; the checkout is nowhere on the path."""
    names = ", ".join(PACKAGES)
    code = f"import {names}, json, sys; print(json.dumps([[p.__file__ for p in ({names})], sys.path]))"
    done = call([str(installed / "python"), "-c", code], tmp_path)
    assert done.returncode == 0, done.stderr
    files, path = json.loads(done.stdout)
    assert all(Path(file).is_relative_to(installed.parent) for file in files)
    assert str(ROOT) not in path


def test_wheel_installed_lists_and_flies(installed: Path, tmp_path: Path) -> None:
    """From another directory: the command lists its scenarios, flies one, and records it."""
    command = str(installed / "wingslevel")
    listed = call([command, "list", "--json", "-"], tmp_path)
    assert listed.returncode == 0, listed.stderr
    assert set(json.loads(listed.stdout)["scenarios"]) == set(registered())
    flown = call([command, "fly", "hand_launch", "--duration", "5", "--json", "-"], tmp_path)
    assert flown.returncode in (0, 1), flown.stderr
    assert flown.stdout, flown.stderr
    data = json.loads(flown.stdout)
    assert data["flights"][0]["outcome"] == "completed"
    assert {"flight.parquet", "manifest.json", "flight.rrd"} == {
        path.name for path in (tmp_path / data["recording"]).iterdir()
    }
    manifest = json.loads((tmp_path / data["recording"] / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["versions"]["wingslevel"] != "not installed"


def test_wheel_installed_is_typed(installed: Path, tmp_path: Path) -> None:
    """A user's script passes mypy --strict against the wheel, where each mistake in it is found; and it runs."""
    script = tmp_path / "script.py"
    script.write_text((ROOT / "tests" / "packaging" / "typed_script.py").read_text(encoding="utf-8"), encoding="utf-8")
    python = str(installed / "python")
    checked = call([sys.executable, "-m", "mypy", "--strict", "--python-executable", python, "script.py"], tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    ran = call([python, "script.py"], tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (ran.stdout, ran.stderr) == ("", "")


def test_wheel_installed_loads_nothing_heavy(installed: Path, tmp_path: Path) -> None:
    """Importing the public API loads the standard library alone, and the names of all packages are found."""
    code = "import sys, wingslevel; print(*{name.partition('.')[0] for name in sys.modules})"
    done = call([str(installed / "python"), "-c", code], tmp_path)
    assert done.returncode == 0, done.stderr
    heavy = {"numpy", "numba", "jsbsim", "rerun", "matplotlib", "pyarrow", "pydantic", "scipy", "pandas"}
    assert not heavy & set(done.stdout.split())
