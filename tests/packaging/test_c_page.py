"""What docs/c_estimators.md shows works: its sources are built by its own commands, and flown; the Rust structs fit."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from estimator.interface import MEASURED_DTYPE, ImuSample, Measurements
from estimator.rotation import exp
from scenarios.harness.equipping import load_estimator

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "c_estimators.md").read_text(encoding="utf-8")
COMMAND = 'wingslevel() { python -m wingslevel "$@"; }'  # whatever version has its script in the environment
LANGUAGES = {"c": ("mine.c", "cc"), "cpp": ("mine_cpp.cpp", "c++"), "rust": ("mine_rust.rs", "rustc")}


def block(language: str) -> str:
    """The one fenced block of a language."""
    (source,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.M | re.S)
    return source


def commands(file: str) -> str:
    """The shell block that builds `file`."""
    (found,) = (shell for shell in re.findall(r"^```bash\n(.*?)^```", PAGE, re.M | re.S) if file in shell)
    return found


def environment() -> dict[str, str]:
    """Of a shell in which `python` runs this tree."""
    scripts = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return {**os.environ, "PATH": scripts, "PYTHONPATH": str(ROOT)}


@pytest.fixture
def built(tmp_path: Path, monkeypatch):
    """Builds the source of a language as the page says, in a new folder; skips without the compiler."""
    monkeypatch.chdir(tmp_path)

    def _built(language: str) -> Path:
        file, compiler = LANGUAGES[language]
        if shutil.which(compiler) is None:
            pytest.skip(f"no compiler {compiler}")
        (tmp_path / file).write_text(block(language), encoding="utf-8")
        build = commands(file).splitlines()[0]
        done = subprocess.run(
            ["bash", "-euc", build], env=environment(), capture_output=True, text=True, check=False, timeout=300
        )
        assert (done.returncode, done.stderr) == (0, "")
        return tmp_path / f"{Path(file).stem}.so"

    return _built


@pytest.mark.parametrize("language", LANGUAGES)
def test_page_commands_build_and_fly(built, language, tmp_path):
    """Each line as it stands, in a shell: the library flies to an end of the flight, whatever its checks say."""
    built(language)
    flies = commands(LANGUAGES[language][0]).splitlines()[1]
    done = subprocess.run(
        ["bash", "-euc", f"{COMMAND}; {flies} --set duration_s=3 --no-rerun --json verdict.json"],
        env=environment(), capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    (flight,) = json.loads((tmp_path / "verdict.json").read_text())["flights"]
    assert flight["outcome"] in ("completed", "ground_contact")


def rows_of(omega_b_rad_s) -> np.ndarray:
    """Two seconds at a steady rate."""
    rows = np.zeros(100, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"], rows["gyro_b_rad_s"] = 0.02 * np.arange(1, 101), 0.02, omega_b_rad_s
    return rows


@pytest.mark.parametrize(
    ("language", "omega"), [("c", (0.3, -0.2, 0.5)), ("cpp", (0.0, 0.0, 0.5)), ("rust", (0.0, 0.0, 0.5))]
)
def test_page_estimators_integrate_the_gyro(built, language, omega):
    """Against the exponential of the rotation vector; a sample that is NaN is left out. The structs arrive whole."""
    estimator = load_estimator(str(built(language)))
    rows = rows_of(omega)
    for k in range(100):
        last = estimator.update(Measurements(rows, k))
    np.testing.assert_allclose(last.R_eb, exp(2.0 * np.array(omega)), rtol=0, atol=1e-12)
    rows["gyro_b_rad_s"] = np.nan
    np.testing.assert_array_equal(estimator.update(Measurements(rows, 0)).R_eb, last.R_eb)
    assert (last.wind_e_m_s, last.health) == (None, 1)


def test_page_estimator_in_c_starts_with_the_tilt_at_rest(built):
    """Held at 10 degrees of bank and 20 of pitch."""
    roll, pitch = np.radians([10.0, 20.0])
    force = -9.8 * np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    estimator = load_estimator(str(built("c")))
    estimator.reset(ImuSample(2.0, 0.02, np.zeros(3), force))
    estimate = estimator.update(Measurements(rows_of((0.0, 0.0, 0.0)), 0))
    np.testing.assert_allclose(estimate.R_eb[2] * -9.8, force, rtol=0, atol=1e-12)


def test_page_rust_structs_have_the_fields_of_the_header():
    """Names in order and types, struct by struct: what is copied by hand is compared."""
    header = (ROOT / "wingslevel" / "include" / "wingslevel_estimator.h").read_text(encoding="utf-8")
    source = block("rust")
    for struct in ("Parameter", "Description", "Measurements", "Estimate"):
        (c,) = re.findall(rf"typedef struct wingslevel_{struct.lower()} {{\n(.*?)\n}}", header, re.S)
        (rust,) = re.findall(rf"pub struct {struct} {{\n(.*?)\n}}", source, re.S)
        declared = re.findall(r"^ +(?:const )?(\w+) (\**)(\w+)((?:\[\d\])*);", c, re.M)
        expected = [(name.lower(), _rust(kind, star, sizes)) for kind, star, name, sizes in declared]
        assert re.findall(r"^ +(\w+): ([^,/]+),", rust, re.M) == expected


def _rust(kind: str, star: str, sizes: str) -> str:
    """A type of C in Rust."""
    plain = {"uint32_t": "u32", "uint64_t": "u64", "int64_t": "i64", "double": "f64", "char": "c_char"}
    found = plain.get(kind, kind.removeprefix("wingslevel_").capitalize())
    for size in reversed(re.findall(r"\d", sizes)):
        found = f"[{found}; {size}]"
    return f"*const {found}" if star else found
