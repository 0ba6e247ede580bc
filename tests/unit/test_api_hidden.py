"""Other people's modules that hide our packages: one line says which file does, and what to do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import wingslevel as wl

ROOT = Path(wl.__file__).resolve().parents[1]


def python(folder: Path, *arguments: str, first: str = "") -> subprocess.CompletedProcess[str]:
    """Run Python in `folder`; `first` comes before our packages on the path."""
    path = os.pathsep.join(filter(None, (first, str(ROOT))))
    env = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=env, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("name", ["sim", "scenarios", "estimator", "autopilot"])
def test_file_beside_a_script_is_named(tmp_path: Path, name: str) -> None:
    """As a file or as a package: the import fails with one line."""
    (tmp_path / "script.py").write_text("import wingslevel as wl\nprint(wl.scenarios())\n")
    file, package = tmp_path / f"{name}.py", tmp_path / name
    file.write_text("")
    done = python(tmp_path, "script.py")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"ImportError: wingslevel needs its own package {name!r}, but {file} hides it: rename that file or folder, or "
        "run from another folder"
    )
    file.unlink()
    package.mkdir()
    (package / "__init__.py").write_text("")
    assert f"but {package} hides it" in python(tmp_path, "script.py").stderr.splitlines()[-1]


def test_module_that_was_imported_before_is_named(tmp_path: Path) -> None:
    """It hides ours even where the path would find ours."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "sim.py").write_text("")
    code = "import sys; sys.path.insert(0, 'elsewhere'); import sim; del sys.path[0]; import wingslevel"
    done = python(tmp_path, "-c", code)
    assert str(tmp_path / "elsewhere" / "sim.py") in done.stderr.splitlines()[-1]


def test_folder_without_code_hides_nothing(tmp_path: Path) -> None:
    """A folder of data beside the script comes after our packages."""
    (tmp_path / "sim").mkdir()
    (tmp_path / "scenarios").mkdir()
    assert python(tmp_path, "-c", "import wingslevel as wl; wl.fly; print(wl.__version__)").returncode == 0


@pytest.mark.parametrize(
    "started",
    [
        ["-m", "wingslevel"],
        ["-c", "import sys; sys.argv[0] = '/usr/bin/wingslevel'; from wingslevel.__main__ import main; main()"],
    ],
)
def test_command_says_it_in_one_line(tmp_path: Path, started: list[str]) -> None:
    """Exit code 2, and nothing else printed."""
    (tmp_path / "sim.py").write_text("")
    done = python(tmp_path, *started, "list", first=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"wingslevel: wingslevel needs its own package 'sim', but {tmp_path / 'sim.py'} hides it")


def test_installed_package_of_the_same_name_is_named(tmp_path: Path) -> None:
    """It cannot be renamed: another environment helps."""
    site = tmp_path / "lib" / "site-packages"
    (site / "autopilot").mkdir(parents=True)
    (site / "autopilot" / "__init__.py").write_text("")
    done = python(tmp_path, "-c", "import wingslevel", first=str(site))
    assert done.stderr.splitlines()[-1] == (
        f"ImportError: wingslevel needs its own package 'autopilot', but another one is installed at "
        f"{site / 'autopilot'}: uninstall that one, or use wingslevel in a virtual environment of its own"
    )


def test_module_runs_as_a_command(tmp_path: Path) -> None:
    """``python -m wingslevel`` is the command."""
    done = python(tmp_path, "-m", "wingslevel", "--version")
    assert (done.returncode, done.stdout) == (0, f"wingslevel {wl.__version__}\n"), done.stderr
