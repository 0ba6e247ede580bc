"""Flight code by name: estimators and autopilots of this project, of the person at the keyboard, of other packages.

A name is one of

``premerlani``        a name of the registry, or of an installed package that offers an entry point in the group
                      ``wingslevel.estimators`` or ``wingslevel.autopilots``
``package.module:Class``   anything that can be imported, also from the working directory
``path/to/file.py:Class``  a file
``path/to/library.so``     a shared library, see `scenarios.harness.c_library`: estimators only

The class is called anew for each flight; only ``update`` is required (`scenarios.harness.equipping`).
"""

import importlib
import inspect
from collections import ChainMap
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from autopilot import AUTOPILOTS
from estimator import ESTIMATORS
from scenarios.harness import lent
from scenarios.harness.own_files import also_import_from, hint_for_file, library_named, module_of_file
from sim.outside.blame import Refused, home_of, shown, theirs
from sim.outside.entry_points import Offer, offered
from sim.outside.wording import class_name, printable
from sim.params import near_misses as near_misses

if TYPE_CHECKING:  # names are looked up here before anything is flown: nothing heavy is imported for that
    pass

Maker = Callable[..., Any]  # a class, or a function that makes flight code

# The oracle sees the truth: it is not flight code and not in flight code's own registry.
_ALL_ESTIMATORS = ChainMap(ESTIMATORS, {"oracle": "sim.oracle:Oracle"})


class Kind(NamedTuple):
    """What is looked up: its word for messages, our registry, arguments of `update`."""

    word: str
    registry: Mapping[str, str]
    arguments: tuple[str, ...]


NOT_SET = {"params", "instruments", "self"}  # arguments of constructors that are not settings
ESTIMATOR = Kind("estimator", _ALL_ESTIMATORS, ("measurements",))
AUTOPILOT = Kind("autopilot", AUTOPILOTS, ("estimate", "measurements", "setpoint"))
OURS: Mapping[str, Mapping[str, str]] = {f"{kind.word}s": kind.registry for kind in (ESTIMATOR, AUTOPILOT)}
"""The flight code of this project by name, with where each one is: "estimators" and "autopilots"."""


class PluginError(ValueError):
    """Flight code that cannot be found, loaded or used; the message is one line."""


def refusing(kind: Kind, spec: "str | Maker", home: str = "") -> theirs:
    """A block in which flight code named `spec` runs: what it raises is a PluginError that names it."""
    return theirs(lambda line: PluginError(f"{kind.word} {maker_name(spec)!r}: {line}"), home)


def estimators() -> dict[str, str]:
    """Names of all estimators that need no path, with where each one comes from."""
    return _offered(ESTIMATOR)


def autopilots() -> dict[str, str]:
    """Names of all autopilots that need no path, with where each one comes from."""
    return _offered(AUTOPILOT)


def short_name(spec: "str | Maker") -> str:
    """What reports call an estimator: the name of its class, or of its library."""
    library = library_named(spec) if isinstance(spec, str) else None
    if library is not None:
        return library.short_name
    name, parenthesis, settings = maker_name(spec).partition("(")
    return f"{name.rpartition(':')[2]}{parenthesis}{settings}"


def maker_name(spec: "str | Maker") -> str:
    """What an estimator is called that is given by name, or by what makes it: ``package.module:Class``.

    What `functools.partial` sets follows in brackets.
    """
    if isinstance(spec, str):
        return spec
    if isinstance(spec, partial):
        settings = [*map(shown, spec.args), *(f"{name}={shown(value)}" for name, value in spec.keywords.items())]
        return f"{maker_name(spec.func)}({', '.join(settings)})"
    try:
        name = getattr(spec, "__qualname__", None) or class_name(spec)
        return printable(f"{spec.__module__}:{name}")
    except BaseException:  # anyone's class
        return class_name(spec)


def load_class(word: str, spec: str) -> Any:
    """What makes flight code that `spec` names, not called yet; `word` is "estimator" or "autopilot".

    Raises
    ------
    PluginError     one line: nothing of that name, code that cannot be imported, or something that makes nothing
    """
    kind = ESTIMATOR if word == ESTIMATOR.word else AUTOPILOT
    found = find_maker(kind, spec)
    require_maker(kind, spec, found)
    return found


def module_of_offer(word: str, spec: str) -> str:
    """Name of the module that the entry point `spec` points to; empty where an installed package offers none such."""
    kind = ESTIMATOR if word == ESTIMATOR.word else AUTOPILOT
    found = None if ":" in spec or spec in kind.registry else _installed(kind).get(spec)
    return "" if found is None else found.module


def _installed(kind: Kind) -> dict[str, Offer]:
    return offered(f"{kind.word}s", kind.registry)


def _offered(kind: Kind) -> dict[str, str]:
    return {**kind.registry, **{name: offer.value for name, offer in _installed(kind).items()}}


def require_maker(kind: Kind, spec: "str | Maker", maker: Any) -> None:
    if not callable(maker):
        raise PluginError(
            f"{kind.word} {maker_name(spec)!r}: {shown(maker)} is not a class; name the class, or a function that "
            "makes a new one for each flight"
        )


def arguments_of(kind: Kind, spec: "str | Maker", maker: Any) -> set[str]:
    """Names of the arguments with which `maker` can be called."""
    with refusing(kind, spec, home_of(maker)):
        try:
            parameters = inspect.signature(maker).parameters.values()
        except (TypeError, ValueError):
            return set()  # compiled code that does not tell
        return {p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}


def find_maker(kind: Kind, spec: str) -> Any:
    """The class (or whatever is called to make one) that `spec` names."""
    if lent.is_lent(spec):
        with refusing(kind, spec):
            return lent.find(spec)
    named = spec
    library = library_named(spec) if kind is ESTIMATOR else None
    if library is not None:
        from scenarios.harness.c_library import class_of_library  # loads the machinery that only these need

        with refusing(kind, spec):
            return class_of_library(library)
    if spec in kind.registry:
        spec = kind.registry[spec]
    elif instead := hint_for_file(spec, libraries=kind is ESTIMATOR):
        raise PluginError(instead)
    elif ":" not in spec:
        installed = _installed(kind)
        if spec in installed:
            offer = installed[spec]
            named = f"{kind.word} {spec!r} of {offer.origin}"
            with theirs(lambda line: PluginError(f"{named}: {line}"), offer.package):
                return offer.load()
        hint = near_misses(spec, _offered(kind))
        raise PluginError(f"unknown {kind.word} {spec!r}: {hint} (your own: module:Class, file.py:Class or library.so)")
    place, _, name = spec.rpartition(":")
    if place.endswith(".py"):
        module = module_of_file(Path(place), lambda line: PluginError(f"{kind.word} {named!r}: {line}"))
    else:
        module = _module_by_name(kind, named, place)
    with refusing(kind, named):
        try:
            return getattr(module, name)
        except AttributeError:
            classes = [n for n, c in vars(module).items() if inspect.isclass(c) and c.__module__ == module.__name__]
        hint = near_misses(name, classes) if classes else "it defines no class"
        raise Refused(f"no class {name!r} in {place}; {hint}")


def _module_by_name(kind: Kind, spec: str, name: str) -> ModuleType:
    """The importable module `name`, also from the working directory."""
    also_import_from(Path.cwd())
    package = name.partition(".")[0]
    with refusing(kind, spec, "" if package in ("estimator", "autopilot", "sim", "scenarios") else package):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or not (name == error.name or name.startswith(f"{error.name}.")):
                raise  # the module is there; something that it imports is not
        raise Refused(f"no module {name!r} here or installed (a file is named file.py:Class)")


def check_update(kind: Kind, spec: "str | Maker", made: Any) -> None:
    """Refuse what has no ``update`` of the right number of arguments."""
    wanted = f"update({', '.join(kind.arguments)})"
    with refusing(kind, spec, home_of(made)):
        update = getattr(made, "update", None)
        if not callable(update):
            raise Refused(f"{class_name(made)} has no method {wanted}")
        try:
            signature = inspect.signature(update)
        except (TypeError, ValueError):
            return  # compiled code that does not tell
        try:
            signature.bind(*kind.arguments)
        except TypeError:
            raise Refused(
                f"{class_name(made)}.update() takes {signature}; define it as update(self, {', '.join(kind.arguments)})"
            ) from None
