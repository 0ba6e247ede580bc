"""Modules beside the tests: test folders are no packages, from which they could be imported."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

_HERE = Path(__file__).parent


def beside(path: Path) -> ModuleType:
    """The module in the file at `path`."""
    name = f"_fuzz_{path.stem}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


@pytest.fixture(scope="session")
def targets(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """What is read, and how it is damaged."""
    beside(_HERE / "mutations.py")
    unit = _HERE.parent / "unit"
    for name in ("conftest", "test_log_dataflash", "test_log_ulog"):
        beside(unit / f"{name}.py")
    return beside(_HERE / "targets.py")
