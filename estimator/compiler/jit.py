"""The decorator of every compiled kernel.

numba keys its cache by the file of the function alone: after an edit of a *callee* in another file it would load a
stale kernel.  Ours is keyed by all sources that a kernel's module imports, see `kernel_cache`.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba.core import event

from estimator.compiler import compiling
from estimator.compiler.kernel_cache import KernelCache, cache_of


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` to machine code on first call, cached on disk; division by zero gives inf, not an error.

    A kernel of the loop takes few, array-typed arguments and allocates nothing.
    """
    return _compile(function)


def inlined(function: Callable[..., Any]) -> Any:
    """A `kernel` that is always inlined into its caller: for the steps of an algorithm that runs at every tick.

    Inside one function the compiler keeps the state in registers; a call makes it write and read all of it.
    """
    return _compile(function, forceinline=True)


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    compiled = numba.njit(error_model="numpy", **options)(function)
    cache = cache_of(function)
    if cache is not None:  # a function typed at a prompt has no source file
        compiled._cache = cache
    return compiled


class _Compiles(event.Listener):  # type: ignore[misc]
    """Reports the start and end of each compilation; loading a kernel from the cache is none."""

    def on_start(self, event: Any) -> None:
        compiling.enter()
        if name := _name(event):
            compiling.begins(name)

    def on_end(self, event: Any) -> None:
        if name := _name(event):
            compiling.ends(name)
        compiling.leave()


class _Passes(event.Listener):  # type: ignore[misc]
    """Called between the passes of the compiler, where it can be interrupted."""

    def on_start(self, event: Any) -> None:  # noqa: ARG002 - the compiler's signature
        compiling.pause()

    def on_end(self, event: Any) -> None:
        pass


def _name(event: Any) -> str:
    """Name of the kernel that is compiled; empty for a library function that is part of one."""
    dispatcher = event.data["dispatcher"]
    is_ours = isinstance(getattr(dispatcher, "_cache", None), KernelCache)
    return dispatcher.py_func.__qualname__ if is_ours else ""


event.register("numba:compile", _Compiles())
event.register("numba:run_pass", _Passes())
