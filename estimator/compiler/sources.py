"""The sources on which a compiled kernel depends: its module and everything that it imports, directly or not.

Imports are found in the text: at the top, in a function, over several lines.  An import that is never executed counts
as well: that costs a compilation, whereas a missed one would run old code.  Installed packages are not read: for those
that a user's file imports, the path, size and time of change of each file are used.

This runs whenever a module with kernels is imported: paths are plain strings here, which is five times as fast.
"""

import hashlib
import os
import re
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from os.path import abspath, dirname, isdir, isfile

ROOT = dirname(dirname(dirname(abspath(__file__))))
OURS = ("estimator", "autopilot", "sim", "scenarios")

_FROM = re.compile(r"from[ \t]*(\.*[ \t]*[\w.]*)[ \t]*\bimport\b[ \t]*(\((?:[^)#]|#[^\n]*)*\)|[^\n#;]+)")
_PLAIN = re.compile(r"import[ \t]+([^\n#;]+)")
_BY_NAME = re.compile(r"\b(?:import_module|__import__)\(\s*[\"'](\.*[\w.]+)[\"']")
_COMMENT = re.compile(r"#[^\n]*")


class Sources:
    """Digests of the import closures of files; each file is read once.

    root : folder of our packages
    """

    def __init__(self, root: str = ROOT) -> None:
        self._root = root
        self._ours = tuple(f"{root}{os.sep}{package}{os.sep}" for package in OURS)
        self._digests: dict[str, str] = {}
        self._imports: dict[str, tuple[str, ...]] = {}
        self._stats: dict[str, tuple[int, int]] = {}
        self._located: dict[tuple[str, str], tuple[str, ...]] = {}

    def closure(self, path: str) -> list[str]:
        """The file at `path` and all files that it imports, directly or not, in a fixed order."""
        found, waiting = {path}, [path]
        while waiting:
            for file in self._imports_of(waiting.pop()):
                if file not in found:
                    found.add(file)
                    waiting.append(file)
        return sorted(found)

    def digest(self, path: str) -> str:
        """Hash of the names and contents of the closure of `path`, 16 hexadecimal digits."""
        whole = hashlib.sha256()
        for source in self.closure(path):
            name = source[len(self._root) :] if source.startswith(self._ours) else source
            whole.update(f"{name}\0{self._digests[source]}\0".encode(errors="surrogateescape"))
        return whole.hexdigest()[:16]

    def unchanged(self, path: str) -> bool:
        """Whether the closure of `path` is unchanged on disk since it was read."""
        return all(_stat(source) == self._stats[source] for source in self.closure(path))

    def _imports_of(self, path: str) -> tuple[str, ...]:
        """The files that the one at `path` imports; read once."""
        if path not in self._imports:
            self._stats[path] = _stat(path)
            try:
                with open(path, "rb") as file:
                    data = file.read()
            except OSError:
                data = b""  # removed since: its imports are unknown
            self._digests[path] = hashlib.sha256(data).hexdigest()
            found = dict.fromkeys(file for name in imported(data) for file in self._files_of(name, path))
            self._imports[path] = tuple(file for file in found if file != path)
        return self._imports[path]

    def _files_of(self, name: str, importer: str) -> tuple[str, ...]:
        """The files that ``import name`` executes, for `importer`."""
        folder = dirname(importer)
        if name.startswith("."):
            absolute = name.lstrip(".")
            for _ in range(len(name) - len(absolute) - 1):
                folder = dirname(folder)
            return self._below(folder, absolute)
        top = name.partition(".")[0]
        found = self._below(self._root, name) if top in OURS else ()
        if found or importer.startswith(self._ours) or top in sys.stdlib_module_names:
            return found
        package = _package_of(importer)
        for base in dict.fromkeys((folder, dirname(package), *_path())):
            found = self._below(base, name)
            if found:
                break
        else:
            found = tuple(_files_of_module(name))
        if top != os.path.basename(package):
            self._note(found)
        return found

    def _note(self, files: tuple[str, ...]) -> None:
        """Identify those of `files` that are installed by size and time."""
        for path in files:
            if path not in self._imports and _is_library(path):
                self._stats[path] = _stat(path)
                self._digests[path], self._imports[path] = f"{self._stats[path]}", ()

    def _below(self, base: str, name: str) -> tuple[str, ...]:
        """The files of the packages and of the module along the dotted `name`, below the folder `base`."""
        key = (base, name)
        if key in self._located:
            return self._located[key]
        if name:
            above = name.rpartition(".")[0]
            found = self._below(base, above) if above else ()
            here = os.path.join(base, *name.split("."))
            if found and not found[-1].endswith("__init__.py"):
                pass  # the rest is a name in a module
            elif isfile(os.path.join(here, "__init__.py")):
                found = (*found, os.path.join(here, "__init__.py"))
            elif isfile(f"{here}.py"):
                found = (*found, f"{here}.py")
        else:
            init = os.path.join(base, "__init__.py")
            found = (init,) if isfile(init) else ()
        self._located[key] = found
        return found


def imported(source: bytes) -> Iterator[str]:
    """Names that the text of a module imports, as written, relative ones with their dots.

    ``from a import b`` gives ``a`` and ``a.b``: `b` may be a module or a name in one.
    """
    text = source.decode("utf-8", "replace")
    if "\\" in text or "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")
    at, end = text.find("import"), 0
    while at >= 0:
        line = max(end, text.rfind("\n", 0, at) + 1)
        line = max(line, text.rfind(";", line, at) + 1, text.rfind(":", line, at) + 1)
        before = text[line:at].strip()
        match = None
        if not before:
            match = _PLAIN.match(text, at)
        elif before.startswith("from"):  # else it is a word in prose
            match = _FROM.match(text, text.index("from", line))
        if match:
            yield from _names_of(match)
        end = match.end() if match else at + len("import")
        at = text.find("import", end)
    if "import_module" in text or "__import__" in text:
        yield from _BY_NAME.findall(text)


def _names_of(match: re.Match[str]) -> Iterator[str]:
    if match.re is _PLAIN:
        yield from _listed(match[1])
        return
    origin = "".join(match[1].split())
    yield origin
    dot = "" if origin.endswith(".") else "."
    yield from (f"{origin}{dot}{name}" for name in _listed(match[2]) if name != "*")


def _listed(text: str) -> Iterator[str]:
    """The names of ``a, b as c``, in parentheses or not."""
    for entry in _COMMENT.sub("", text).replace("(", " ").replace(")", " ").split(","):
        words = entry.split()
        if words:
            yield words[0]


def _stat(path: str) -> tuple[int, int]:
    """Size and time of change, zeros if the file is gone."""
    try:
        found = os.stat(path)
    except OSError:
        return 0, 0
    return found.st_size, found.st_mtime_ns


def _package_of(path: str) -> str:
    """Folder of the outermost package of the module at `path`; the module itself if it is in none."""
    top = path
    while isfile(os.path.join(dirname(top), "__init__.py")) and dirname(top) != top:
        top = dirname(top)
    return top


def _files_of_module(name: str) -> Iterator[str]:
    """File of an imported module, for modules that are in no folder of their name."""
    while name:
        file = getattr(sys.modules.get(name), "__file__", None)
        if file and file.endswith(".py"):
            yield file
        name = name.rpartition(".")[0]


def _path() -> list[str]:
    return [abspath(entry) for entry in sys.path if isdir(entry or os.curdir)]


@cache
def _libraries() -> tuple[str, ...]:
    return tuple(f"{sysconfig.get_path(name)}{os.sep}" for name in ("stdlib", "platstdlib", "purelib", "platlib"))


def _is_library(path: str) -> bool:
    """Whether the file at `path` belongs to an installed package."""
    return f"{os.sep}site-packages{os.sep}" in path or "dist-packages" in path or path.startswith(_libraries())
