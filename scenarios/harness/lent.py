"""Flight code that is passed as an object, not by name: known under a name while it flies, in worker processes too."""

import io
import pickle
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FunctionType
from typing import Any

_held: dict[str, Any] = {}  # classes and functions by name
_received: dict[str, bytes] = {}  # the same, pickled, in a worker process that has not needed them yet


@contextmanager
def lend(makers: Mapping[str, Any]) -> Iterator[None]:
    """Inside the block, flight code can be named as in `makers`: what makes it, by name."""
    before = dict(_held)
    _held.update(makers)
    try:
        yield
    finally:
        _held.clear()
        _held.update(before)


def is_lent(name: str) -> bool:
    """Whether `name` is that of an object."""
    return name in _held or name in _received


def find(name: str) -> Any:
    """The object; in a worker process whatever importing its module raises."""
    if name not in _held:
        _held[name] = pickle.loads(_received[name])
    return _held[name]


def packed() -> dict[str, bytes]:
    """All that is lent, for a worker process; what cannot be sent is left out."""
    return {name: pickle.dumps(maker) for name, maker in _held.items() if not why_unsendable(maker)} | _received


def receive(makers: Mapping[str, bytes]) -> None:
    """In a worker process: what `packed` gave."""
    _received.update(makers)


def why_unsendable(maker: Any) -> str:
    """Why a worker process cannot be given `maker`, in a few words; empty where it can."""
    found = _Modules(io.BytesIO())
    try:
        found.dump(maker)
    except Exception as problem:  # anyone's objects
        name = maker.__qualname__ if isinstance(maker, FunctionType | type) else ""
        if name.endswith("<lambda>"):
            return "it is a lambda"
        return "it is defined inside a function" if "<" in name else f"it cannot be pickled ({type(problem).__name__})"
    for name in sorted(found.modules):
        if name == "__main__":
            return "it is defined in the script or notebook itself"
        if not _can_be_imported(name):
            return f"its module {name} cannot be imported by name"
    return ""


class _Modules(pickle.Pickler):
    """Notes the modules that an object needs where it is unpickled."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file)
        self.modules: set[str] = set()

    def reducer_override(self, thing: Any) -> Any:
        """Called for each object; changes nothing."""
        if isinstance(thing, FunctionType | type):
            self.modules.add(thing.__module__)
        return NotImplemented


def _can_be_imported(name: str) -> bool:
    """Whether a new process that imports `name` gets the file of the module of this process."""
    loaded = sys.modules.get(name)
    file = getattr(loaded, "__file__", None)
    if loaded is None or file is None:
        return loaded is not None and name in sys.builtin_module_names
    path, spec, parts = None, None, name.split(".")
    for i in range(len(parts)):
        spec = _spec(".".join(parts[: i + 1]), path)
        if spec is None:
            return False
        path = spec.submodule_search_locations
    return bool(spec and spec.origin == file)


def _spec(name: str, path: Any) -> Any:
    """What the finders find, whatever has been imported."""
    found = (finder.find_spec(name, path) for finder in sys.meta_path if hasattr(finder, "find_spec"))
    return next((spec for spec in found if spec is not None), None)
