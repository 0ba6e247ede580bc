"""The cache of compiled kernels on disk.

Every module with kernels has a folder, named by the module and by a hash of all sources on which its kernels depend
(`estimator.compiler.sources`): after an edit only the kernels that can have changed are compiled again.

The cache never causes a failure.  Every file has a checksum; a damaged one is discarded and its kernel compiled again.
If nothing can be written (disk full, no permission), kernels are compiled in memory.  Both cases print one line.
"""

import hashlib
import os
import pickle
import re
import shutil
import stat
import sys
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from estimator.compiler import compiling, owner
from estimator.compiler.sources import OURS, Sources

_KEPT = 4  # folders kept per module, for other versions of its sources
_IN_USE_S = 86_400.0  # a folder used within this time is kept
_UNUSED_S = 30 * 86_400.0  # a folder not used within this time is removed
_LARGEST = 100_000_000  # bytes; no kernel comes near
_CHECKSUM = hashlib.sha256().digest_size
_sources = Sources()


class Damaged(Exception):
    """A file of the cache has changed since it was written."""


@cache
def base() -> Path:
    """The folder of all compiled kernels of this user; it need not exist."""
    home = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(home) if home else Path.home() / ".cache").absolute() / "wingslevel" / "kernels"
    except (RuntimeError, OSError):  # no home folder, or the working directory has been removed
        return Path(os.devnull) / "kernels"


def cache_of(function: Any) -> "KernelCache | None":
    """The cache of a Python function to be compiled; None if it is not in a file."""
    path = os.path.realpath(function.__code__.co_filename)
    return KernelCache(function, path) if os.path.isfile(path) else None


class KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of the function `py_func`, defined in the file at `path`."""

    def __init__(self, py_func: Any, path: str) -> None:
        digest = _sources.digest(path)
        self._py_func, self._name, self._source = py_func, py_func.__qualname__, path
        self._folder = base() / f"{_folder_name(py_func, path)}-{digest}"
        self._cache_path = str(self._folder)
        self._impl = _Impl(py_func, _Locator(self._folder, path, digest, py_func.__code__.co_firstlineno))
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, digest)
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code compiled for the signature `sig`, None if it has to be compiled."""
        _tidy()
        with compiling.held():  # it calls back from C, like the compiler
            try:
                found = super().load_overload(sig, target_context)
            except Exception as fault:  # a file may contain anything
                self._discard(fault)
                return None
        if found is not None:
            _touch(self._folder)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the code compiled for the signature `sig`, if possible."""
        if not _sources.unchanged(self._source):
            return  # edited since it was read: the code may come from either version
        try:
            is_new = not self._folder.is_dir()
            with compiling.held():
                super().save_overload(sig, data)
            if is_new:
                _prune(self._folder)
        except OSError as error:
            reason = error.strerror or type(error).__name__
            compiling.trouble(f"cannot write to {self._folder}: {reason}; kernels are compiled again next time")
        except Exception as fault:  # a user's function may hold what cannot be pickled
            compiling.trouble(f"cannot store {self._name}: {type(fault).__name__}; it is compiled every time")

    def _discard(self, fault: Exception) -> None:
        """Discard the files of this function, and report it unless another process was first."""
        files = self._cache_file.files()
        removed = [_remove(path) for path in (files if self._folder.is_dir() else [self._folder])]
        if any(removed) or not isinstance(fault, Damaged):
            what = str(fault) if isinstance(fault, Damaged) else f"{self._name} cannot be loaded ({_short(fault)})"
            compiling.trouble(f"{what}: discarded, compiling again")


def _folder_name(py_func: Any, path: str) -> str:
    """Name of the folder of the module that defines `py_func`.

    The compiler stores the name of the module with the code, and a user's file may be loaded under several names.
    """
    module = str(py_func.__module__ or "")
    ours = module.partition(".")[0] in OURS
    return Path(path).stem if ours or not module else re.sub(r"\W", "_", module)[-80:]


class _Locator:
    """Tells numba the folder of a function and the version of its source."""

    def __init__(self, folder: Path, path: str, digest: str, line: int) -> None:
        self._folder, self._py_file, self._digest, self._line = folder, path, digest, line

    def ensure_cache_path(self) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except FileExistsError:  # a file has its name
            self._folder.unlink()
            self._folder.mkdir()

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return self._digest

    def get_disambiguator(self) -> str:
        return str(self._line)


class _Impl(CompileResultCacheImpl):  # type: ignore[misc]
    """numba's serialisation of compiled code, in our folder."""

    def __init__(self, py_func: Any, locator: _Locator) -> None:
        self._locator = locator
        self._lineno = py_func.__code__.co_firstlineno
        module = Path(py_func.__code__.co_filename).stem
        self._filename_base = self.get_filename_base(
            f"{module}.{py_func.__qualname__}"[:150], getattr(sys, "abiflags", "")
        )


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    """The index and the data files of one function, each with its checksum.

    A data file is named by its key, so processes that write at the same time write the same file; it contains its key,
    and is written before the index names it.
    """

    def files(self) -> list[Path]:
        """All files of the function."""
        stem = self._index_name.removesuffix("nbi")
        folder = Path(self._cache_path)
        with suppress(OSError):
            return [folder / name for name in os.listdir(folder) if name.startswith(stem)]
        return []

    def load(self, key: Any) -> Any:
        name = self._load_index().get(key)
        if name is None:
            return None
        try:
            kept, data = self._load_data(name)
        except FileNotFoundError as error:
            raise Damaged(f"{self._data_path(name)} is missing") from error
        return data if kept == key else None

    def save(self, key: Any, data: Any) -> None:
        digest = hashlib.sha256(repr(key).encode(errors="backslashreplace")).hexdigest()[:12]
        name = self._index_name.removesuffix("nbi") + f"{digest}.nbc"
        self._save_data(name, (key, data))
        try:
            index = self._load_index()
        except (Damaged, OSError):
            index = {}
        self._save_index({**index, key: name})

    def _load_index(self) -> dict[Any, str]:
        try:
            data = _read(self._index_path)
        except FileNotFoundError:
            return {}
        version, rest = pickle.loads(data)  # the rest is not read for another version
        if version != self._version:
            return {}
        stamp, overloads = pickle.loads(rest)
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        rest = self._dump((self._source_stamp, overloads))
        _write(self._index_path, pickle.dumps((self._version, rest)))

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_read(self._data_path(name)))

    def _save_data(self, name: str, data: Any) -> None:
        _write(self._data_path(name), self._dump(data))


def _read(path: str) -> bytes:
    """The content of a file without its checksum; Damaged if that is wrong."""
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode) or about.st_size > _LARGEST:
            raise Damaged(f"{path} is damaged")
        with open(path, "rb") as file:
            data = file.read()
    except (FileNotFoundError, Damaged):
        raise
    except OSError as error:
        raise Damaged(f"{path} cannot be read ({error.strerror})") from error
    checksum, content = data[:_CHECKSUM], data[_CHECKSUM:]
    if hashlib.sha256(content).digest() != checksum:
        raise Damaged(f"{path} is damaged")
    return content


def _write(path: str, content: bytes) -> None:
    """Write a file, complete or not at all."""
    if os.path.isdir(path):
        _remove(Path(path))
    folder, name = os.path.split(path)
    temporary = os.path.join(folder, f".{name[-60:]}.{owner.mark()}")
    try:
        with open(temporary, "wb") as file:
            file.write(hashlib.sha256(content).digest())
            file.write(content)
        os.replace(temporary, path)
    finally:
        with suppress(OSError):  # already gone if it was renamed
            os.unlink(temporary)


def _remove(path: Path) -> bool:
    """Remove a file or a folder; returns whether this process did."""
    try:
        if path.is_dir() and not path.is_symlink():
            aside = path.with_name(f".{path.name[-60:]}.{owner.mark()}")
            path.rename(aside)  # atomic: no process finds half of it
            shutil.rmtree(aside, ignore_errors=True)
        else:
            path.unlink()
    except OSError:
        return False
    return True


def _touch(folder: Path) -> None:
    """Record that the folder was used, now and then."""
    with suppress(OSError):
        if time.time() - folder.stat().st_mtime > 0.1 * _IN_USE_S:
            os.utime(folder)


def _prune(new: Path) -> None:
    """Remove folders of other versions of the module whose folder is `new`: all but the few used most recently."""
    module = new.name.rpartition("-")[0]
    others = [(folder, age_s) for folder, age_s in _folders() if folder.name.rpartition("-")[0] == module]
    for folder, age_s in others[_KEPT:]:
        if age_s > _IN_USE_S:
            _remove(folder)


@cache
def _tidy() -> None:
    """Remove unused folders and leftover files: once per process, before the first kernel is loaded."""
    for folder, age_s in _folders():
        if age_s > _UNUSED_S or owner.is_left_behind(folder):
            _remove(folder)
            continue
        with suppress(OSError):
            for name in os.listdir(folder):
                if name.startswith(".") and owner.is_left_behind(folder / name):
                    _remove(folder / name)


def _folders() -> list[tuple[Path, float]]:
    """The folders of the cache with the time in seconds since each was used; the oldest last."""
    now_s, found = time.time(), []
    with suppress(OSError):
        for entry in os.scandir(base()):
            found.append((Path(entry.path), now_s - entry.stat(follow_symlinks=False).st_mtime))
    return sorted(found, key=lambda item: item[1])


def _short(fault: Exception) -> str:
    """The type of a fault and the beginning of its message."""
    try:
        text = " ".join(str(fault).split())[:120]
    except Exception:  # any class may raise here
        text = ""
    return f"{type(fault).__name__}: {text}" if text else type(fault).__name__
