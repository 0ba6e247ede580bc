"""A fingerprint of everything that decides a flight: scenario, configuration, flight code and versions.

The project and other code are treated alike: the file behind a name, the other Python files of its folder (or of its
whole package), and every module that these have imported.  Data files that flight code reads are not covered.
"""

import hashlib
import importlib.metadata
import json
import platform
import sys
import sysconfig
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from scenarios.harness.flight import Prepared
from scenarios.harness.own_files import library_named
from scenarios.harness.plugins import module_of_offer
from scenarios.harness.registry import module_of_offer as module_of_scenario
from sim.recording import versions

_ROOT = Path(__file__).resolve().parents[3]
_OURS = ("estimator", "autopilot", "sim", "scenarios")
_KINDS = {".py", ".toml", ".xml"}
_PEERS = ("scipy", "ahrs", "imufusion", "vqf")  # packages that our estimators use


def decided_by(named: str, prepared: Prepared) -> dict[str, Any]:
    """Everything that decides a flight; `named` is the name or file of its scenario."""
    config = prepared.config
    return {
        "scenario": prepared.scenario.name,
        "scenario_file": _of_scenario(named),
        "config": config.model_dump(mode="json"),
        "estimator": _of_code("estimator", config.estimator, type(prepared.estimator.code).__module__),
        "autopilot": _of_code("autopilot", config.autopilot, type(prepared.autopilot.code).__module__),
        "wingslevel": _ours(),
        "versions": _versions(),
    }


def fingerprint(decides: dict[str, Any]) -> str:
    """SHA-256 of `decides`, hexadecimal."""
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


@cache
def _versions() -> dict[str, str]:
    """Versions of the packages that compute, and the kind of machine, which decides the last bits of numbers."""
    found = {name: version for name, version in versions().items() if name != "python"}
    for package in _PEERS:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found | {"machine": f"{platform.system()} {platform.machine()}"}


@cache
def _ours() -> str:
    """Every source and data file of the project itself."""
    files = (path for package in _OURS for path in (_ROOT / package).rglob("*") if path.suffix in _KINDS)
    return _hash(files, _ROOT)


def _of_scenario(named: str) -> str:
    """The user code of the scenario `named`; empty if the scenario is part of the project."""
    return _of_file(Path(named)) if named.endswith(".py") else _of_others(module_of_scenario(named))


def _of_code(word: str, spec: str, module: str) -> str:
    """The user code of `spec`, whose class is in `module`; empty if it is part of the project."""
    if (library := library_named(spec)) is not None:
        return library.sha256
    place = spec.rpartition(":")[0] or module_of_offer(word, spec)
    return _of_file(Path(place)) if place.endswith(".py") else _of_others(place, module)


def _of_others(*modules: str) -> str:
    """The imported `modules` that are user code."""
    found = {name for name in modules if name in sys.modules and _is_others(sys.modules[name])}
    return _of_modules(frozenset(found)) if found else ""


@cache
def _of_file(path: Path) -> str:
    path = path.resolve()
    loaded = [name for name, module in list(sys.modules.items()) if _file_of(module) == path]
    beside = _hash(path.parent.glob("*.py"), path.parent)
    return fingerprint({"beside": beside, "imported": _of_modules(frozenset(loaded))})


@cache
def _of_modules(names: frozenset[str]) -> str:
    """The modules of these names, their packages, and all user modules that they import."""
    files: set[Path] = set()
    seen, waiting = set(names), list(names)
    while waiting:
        module = sys.modules[waiting.pop()]
        if (path := _file_of(module)) is not None:
            files.add(path)
            files |= set(_package_of(module, path))
        used = {getattr(thing, "__name__" if isinstance(thing, ModuleType) else "__module__", None) or ""
                for thing in list(vars(module).values())}  # fmt: skip
        for name in used - seen:
            if isinstance(name, str) and name in sys.modules and _is_others(sys.modules[name]):
                seen.add(name)
                waiting.append(name)
    return _hash(files, None)


def _package_of(module: ModuleType, path: Path) -> Iterable[Path]:
    """All files of the package of a module."""
    depth = module.__name__.count(".")
    if not depth and path.name != "__init__.py":
        return ()
    top = path.parents[depth if path.name == "__init__.py" else depth - 1]
    return top.rglob("*.py")


def _is_others(module: ModuleType) -> bool:
    """Whether a module is part of neither the project nor Python."""
    path = _file_of(module)
    if path is None or path.suffix != ".py" or any(path.is_relative_to(_ROOT / name) for name in _OURS):
        return False
    standard = [Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")]
    installed = [Path(sysconfig.get_path(name)).resolve() for name in ("purelib", "platlib")]
    if any(path.is_relative_to(folder) for folder in installed):
        return module.__name__.partition(".")[0] not in _FIXED
    return not any(path.is_relative_to(folder) for folder in standard)


# Installed packages whose version is in the fingerprint or has no effect; others are read file by file.
_FIXED = {"numpy", "numba", "llvmlite", "jsbsim", "scipy", "ahrs", "imufusion", "vqf", "pytest", "_pytest"}


def _file_of(module: ModuleType) -> Path | None:
    file = getattr(module, "__file__", None)
    return Path(file).resolve() if isinstance(file, str) else None


def _hash(files: Iterable[Path], root: Path | None) -> str:
    """Over the names, below `root` if there is one, and the contents of `files`."""
    digest = hashlib.sha256()
    for path in sorted(set(files)):
        name = path.relative_to(root).as_posix() if root is not None else path.name
        data = path.read_bytes()
        digest.update(f"{name}:{len(data)};".encode("utf-8", "surrogateescape"))
        digest.update(data)
    return digest.hexdigest()
