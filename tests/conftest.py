"""What all tests share: how hypothesis searches, a Ctrl-C that arrives, and compilers of C, C++ and Rust."""

import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# The gate is the same every time: what is drawn follows from the test alone, nothing is remembered, and a compiler or a
# busy machine is no failure.  `make fuzz` searches on, with another seed each time.
_SLOW_MACHINE = (HealthCheck.too_slow,)
settings.register_profile("gate", derandomize=True, database=None, deadline=None, suppress_health_check=_SLOW_MACHINE)
settings.register_profile(
    "explore", max_examples=2000, derandomize=False, print_blob=True, deadline=None, suppress_health_check=_SLOW_MACHINE
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """SIGINT raises KeyboardInterrupt, as at a terminal: under nohup, or in the background of a shell, it is ignored.

    Processes started meanwhile get it, too: an ignored signal is inherited, a handled one is not.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


_INCLUDE = str(Path(__file__).resolve().parents[1] / "wingslevel" / "include")
_STRICT = ("-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC", f"-I{_INCLUDE}")
_COMPILERS = {
    ".c": ("cc", "-std=c99", *_STRICT),
    ".cpp": ("c++", "-std=c++11", *_STRICT),
    ".rs": ("rustc", "-D", "warnings", "-O", "--crate-type", "cdylib"),
}


@pytest.fixture
def build(tmp_path: Path) -> Callable[..., Path]:
    """Builds a shared library from a source file, or from text and the name of one; skips without the compiler."""

    def _build(source: Path | str, name: str = "mine.c", *options: str) -> Path:
        path = source if isinstance(source, Path) else tmp_path / name
        command = _COMPILERS[path.suffix]
        if shutil.which(command[0]) is None:
            pytest.skip(f"no compiler {command[0]}")
        if isinstance(source, str):
            path.write_text(source, encoding="utf-8")
        library = tmp_path / f"{path.stem}.so"
        rest = () if path.suffix == ".rs" else ("-lm",)
        arguments = [*command, *options, str(path), "-o", str(library), *rest]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return library

    return _build
