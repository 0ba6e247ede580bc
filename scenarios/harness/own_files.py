"""Modules in the user's files: estimators, autopilots and scenarios named as ``path/to/file.py``.

A file is run again for each flight, so that flights share nothing.  Its module has the name under which it would be
imported, if that name is free; otherwise, as for a second file of that name, a name made from its path.  Compiled
kernels are cached with the name of their module.  Kernels of a file with a name made from its path are cached in a
separate folder, so that any process can load them.
"""

import ast
import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from sim.outside.blame import Refused, theirs

PREFIX = "wingslevel"
_PACKAGES = ("estimator", "autopilot", "sim", "scenarios")
_HOME = Path(__file__).resolve().parents[2]
LIBRARIES = (".so", ".dylib", ".dll")
SOURCES = (".c", ".cc", ".cpp", ".cxx", ".c++", ".h", ".hpp", ".rs")
_run: dict[str, ModuleType] = {}  # modules that were made here, by name
_running: set[Path] = set()  # files whose code is being run


class Library(NamedTuple):
    """A shared library: its file, and the prefix of its five functions."""

    path: Path
    prefix: str = PREFIX

    @property
    def short_name(self) -> str:
        """What its parameters may be set by: that of the file without its ending, or the prefix."""
        return self.path.name.partition(".")[0] if self.prefix == PREFIX else self.prefix

    @property
    def sha256(self) -> str:
        """Hash of the bytes of the file, hexadecimal."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()


def library_named(spec: str) -> Library | None:
    """The library that ``mine.so`` or ``mine.so:prefix`` names; None for the name of anything else."""
    if spec.endswith(LIBRARIES):
        return Library(Path(spec))
    file, colon, prefix = spec.rpartition(":")
    return Library(Path(file), prefix) if colon and file.endswith(LIBRARIES) else None


def hint_for_file(spec: str, *, libraries: bool) -> str:
    """What to write instead of `spec`, if that is a Python file without a class, or a source file; empty otherwise.

    libraries : whether a shared library can be used as well
    """
    file = next((each for each in (spec, spec.rpartition(":")[0]) if each.endswith(SOURCES)), "")
    if file and libraries:
        return f"{file} is a source file: build a shared library from it first (docs/c_estimators.md)"
    path = Path(spec)
    if path.suffix != ".py":
        return ""
    if not path.is_file():
        return f"no file {spec!r}"
    try:
        classes = [node for node in ast.parse(path.read_bytes()).body if isinstance(node, ast.ClassDef)]
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):  # anyone's file
        classes = []
    classes.sort(key=lambda node: all(getattr(each, "name", "") != "update" for each in node.body))
    return f"{spec}: name the class in it, for instance {spec}:{classes[0].name if classes else 'Class'}"


def module_of_file(path: Path, refuse: Callable[[str], Exception]) -> ModuleType:
    """The module in the file at `path`; its folder can be imported from, after everything installed.

    Raises
    ------
    what `refuse` makes of one line: no such file, or whatever its code raised
    """
    if not path.is_file():
        raise refuse(f"no file {str(path)!r}")
    path = path.resolve()
    also_import_from(path.parent)
    hidden = next(_modules_hidden_by_ours(path), None)
    if hidden is not None:
        raise refuse(f"{path.name} imports {hidden.stem!r}, a package of wingslevel: rename your own {hidden}")
    with theirs(refuse, str(path)):
        imported = sys.modules.get(path.stem)
        if imported is not None and imported is not _run.get(path.stem) and _is_in(imported, path):
            return imported  # by an import statement
        return _executed(path)


def _modules_hidden_by_ours(path: Path) -> Iterator[Path]:
    """Modules beside the file at `path` that it imports, but that a package of wingslevel of the same name hides."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return  # reported when it is run
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module in _PACKAGES:
            package = importlib.import_module(node.module)
            is_ours = (
                hasattr(package, a.name) or importlib.util.find_spec(f"{node.module}.{a.name}") for a in node.names
            )
            names = [] if all(is_ours) else [node.module]
        for name in names:
            for beside in (path.parent / f"{name}.py", path.parent / name):
                if name in _PACKAGES and beside.exists() and beside not in (path, _HOME / name):
                    yield beside


def also_import_from(folder: Path) -> None:
    """Let modules in `folder` be imported, after all others, so that they cannot hide installed packages."""
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _executed(path: Path) -> ModuleType:
    name = path.stem if _is_free(path) else _name_apart(path)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise Refused(f"{path.name!r} cannot be read as Python")
    if path in _running:
        raise Refused(f'{path.name} flies itself while it is loaded: put such calls under if __name__ == "__main__":')
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = _run[name] = module  # dataclasses and pickle look their module up by name
    _running.add(path)
    try:
        with _cached_apart(name, apart=name != path.stem):
            spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name, None)
        raise
    finally:
        _running.discard(path)
    return module


def _is_free(path: Path) -> bool:
    """Whether an import by the file's own name gives the file at `path` or its module made here."""
    name = path.stem
    if not name.isidentifier() or (path.parent / "__init__.py").exists():
        return False
    if name in sys.modules:
        return _is_in(sys.modules[name], path)
    importlib.invalidate_caches()  # the file may be newer than what the finders have seen
    spec = importlib.util.find_spec(name)
    return spec is not None and spec.origin is not None and Path(spec.origin).resolve() == path


def _is_in(module: ModuleType, path: Path) -> bool:
    file = getattr(module, "__file__", None)
    return isinstance(file, str) and Path(file).resolve() == path


def _name_apart(path: Path) -> str:
    return f"_wingslevel_file_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"


@contextmanager
def _cached_apart(name: str, *, apart: bool) -> Iterator[None]:
    """Let numba cache what is compiled inside in a folder of that name."""
    if not apart:
        yield
        return
    from numba import config

    from estimator.compiler.kernel_cache import base

    before, config.CACHE_DIR = config.CACHE_DIR, str(base() / f"{name}-numba")
    try:
        yield
    finally:
        config.CACHE_DIR = before
