"""Other people's modules that hide ours: a file ``sim.py`` beside a script, a package ``scenarios`` installed later.

Checked when wingslevel is imported, by looking the names up; nothing is imported for it.
"""

import importlib.util
import sys
from pathlib import Path

PACKAGES = ("estimator", "autopilot", "sim", "scenarios")
_HOME = Path(__file__).resolve().parents[1]
USAGE = 2  # exit code of the command


def in_pytest() -> bool:
    """Whether this process is one of pytest."""
    return "_pytest.config" in sys.modules


def require_ours() -> None:
    """Require that an import of each of our packages gives ours.

    Raises
    ------
    ImportError     one line: which file hides which package, and what to do
    SystemExit      the same printed, exit code 2, where the process is the command ``wingslevel``
    """
    problem = next(filter(None, map(_hidden, PACKAGES)), "")
    if not problem:
        return
    if _is_command():
        sys.stderr.write(f"wingslevel: {problem}\n")
        raise SystemExit(USAGE)
    raise ImportError(problem, name="wingslevel")


def _hidden(package: str) -> str:
    """One line on what hides `package`; empty where nothing does."""
    place = _place(package)
    ours = _HOME / package
    if place is None:
        return f"package {package!r} of wingslevel is missing from {_HOME}: install wingslevel again"
    if place.resolve() in (ours, ours / "__init__.py"):
        return ""
    start = "wingslevel needs its own package"
    if "site-packages" in place.parts or "dist-packages" in place.parts:
        return (
            f"{start} {package!r}, but another one is installed at {place}: uninstall that one, or use wingslevel in a "
            "virtual environment of its own"
        )
    return f"{start} {package!r}, but {place} hides it: rename that file or folder, or run from another folder"


def _place(package: str) -> Path | None:
    """The file or folder that an import of `package` would give."""
    loaded = sys.modules.get(package)
    try:
        spec = loaded.__spec__ if loaded is not None else importlib.util.find_spec(package)
    except (ImportError, ValueError, AttributeError):
        spec = None
    if spec is None:
        file = getattr(loaded, "__file__", None)
        return Path(file) if file else None
    if spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    return Path(spec.origin) if spec.origin else None


def _is_command() -> bool:
    """Whether this process was started as ``wingslevel`` or ``python -m wingslevel``."""
    if sys.argv and Path(sys.argv[0]).name.removesuffix(".exe") in ("wingslevel", "wingslevel-script.py"):
        return True
    return sys.orig_argv[1:3] == ["-m", "wingslevel"]
