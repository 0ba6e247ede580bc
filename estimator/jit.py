"""The decorator of every compiled kernel, with a disk cache that notices an edited callee.

numba keys its cache by the file of the function alone: a kernel whose *callee* in another file was edited
would be loaded stale.  The cache therefore lives in a directory named by a hash over all kernel sources of
the project, so that any edit compiles anew and nothing else does.
"""

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import config

_ROOT = Path(__file__).resolve().parent.parent
_PACKAGES = ("estimator", "autopilot", "sim")  # where kernels live
_KEPT = 4  # cache directories of other versions of the sources that are left alone


def sources_hash(root: Path = _ROOT) -> str:
    """Hash of every Python source of the packages that hold kernels, below `root`, 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(str(path.relative_to(root)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_dir() -> Path:
    """Directory of the compiled kernels of exactly these sources; made on first use, old ones pruned."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wingslevel" / "kernels"
    here = base / sources_hash()
    try:
        here.mkdir(parents=True, exist_ok=True)
        os.utime(here)
        others = sorted(base.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)
        for stale in others[_KEPT + 1 :]:
            shutil.rmtree(stale, ignore_errors=True)
    except OSError:
        pass  # no writable cache: numba falls back by itself, and compiles in memory at worst
    return here


def cache_of(module: str) -> Path:
    """Directory of the compiled kernels of `module`: of somebody else's, one of its own.

    numba keeps the name of the module with what it caches, and the same file may be loaded under several.
    """
    return cache_dir() if module.partition(".")[0] in _PACKAGES else cache_dir() / "others" / re.sub(r"\W", "_", module)


def is_cold() -> bool:
    """True where no kernel of these sources has been compiled yet: the first flight will take seconds."""
    return not any(cache_dir().rglob("*.nbi"))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` to machine code on first call, cached on disk; division by zero gives inf, not an error.

    Used as a plain decorator.  A kernel of the loop takes few, array-typed arguments and
    allocates nothing.
    """
    return _compile(function)


def inlined(function: Callable[..., Any]) -> Any:
    """A `kernel` that always becomes part of its caller: for the steps of an algorithm that runs at every tick.

    Inside one function the compiler keeps the state in registers; a call makes it write and read all of it.
    """
    return _compile(function, forceinline=True)


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_of(function.__module__ or ""))
    try:
        return numba.njit(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:  # no place to cache in (a function typed at a prompt, a read-only home)
        return numba.njit(error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = before
