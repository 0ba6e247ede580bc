"""Flight code by name: estimators and autopilots of this project, of the person at the keyboard, of other packages.

A name is one of

``premerlani``        a name of the registry, or of an installed package that offers an entry point in the group
                      ``wingslevel.estimators`` or ``wingslevel.autopilots``
``package.module:Class``   anything that can be imported, also from the working directory
``path/to/file.py:Class``  a file
``path/to/library.so``     a shared library, see `scenarios.harness.c_library`: estimators only

The class is called anew for each flight.  Its constructor is given what it asks for by name: ``instruments``, the
record of what is known of those aboard, or single properties of it, such as ``gps_latency_s``; an autopilot's also
the ``heading_reference`` of the estimator and the name of its ``aircraft``.  Fields of a dataclass ``params`` that are
named like a property are set to it.  Only ``update`` is required.
"""

import importlib
import inspect
import numbers
from collections import ChainMap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from autopilot import AUTOPILOTS
from estimator import ESTIMATORS
from estimator.instruments import Instruments, Known, property_value
from scenarios.harness import lent
from scenarios.harness.own_files import also_import_from, library_named, module_of_file
from sim.outside.blame import Refused, home_of, place_of, shown, theirs
from sim.outside.entry_points import Offer, offered
from sim.outside.wording import class_name, described, printable
from sim.params import changed, dotted_fields
from sim.params import near_misses as near_misses

if TYPE_CHECKING:  # names are looked up here before anything is flown: nothing heavy is imported for that
    from autopilot.interface import Autopilot
    from estimator.interface import AttitudeEstimator, HeadingReference

Maker = Callable[..., Any]  # a class, or a function that makes flight code

# The oracle sees the truth: it is not flight code and not in flight code's own registry.
_ALL_ESTIMATORS = ChainMap(ESTIMATORS, {"oracle": "sim.oracle:Oracle"})


class _Kind(NamedTuple):
    """What is looked up: its word for messages, our registry, arguments of `update`."""

    word: str
    registry: Mapping[str, str]
    arguments: tuple[str, ...]


_NOT_SET = {"params", "instruments", "self"}  # arguments of constructors that are no settings
_ESTIMATOR = _Kind("estimator", _ALL_ESTIMATORS, ("measurements",))
_AUTOPILOT = _Kind("autopilot", AUTOPILOTS, ("estimate", "measurements", "setpoint"))
OURS: Mapping[str, Mapping[str, str]] = {f"{kind.word}s": kind.registry for kind in (_ESTIMATOR, _AUTOPILOT)}
"""The flight code of this project by name, with where each one is: "estimators" and "autopilots"."""


class PluginError(ValueError):
    """Flight code that cannot be found, loaded or used; the message is one line."""


def _refusing(kind: _Kind, spec: "str | Maker", home: str = "") -> theirs:
    """A block in which flight code named `spec` runs: what it raises is a PluginError that names it."""
    return theirs(lambda line: PluginError(f"{kind.word} {maker_name(spec)!r}: {line}"), home)


def estimators() -> dict[str, str]:
    """Names of all estimators that need no path, with where each one comes from."""
    return _offered(_ESTIMATOR)


def autopilots() -> dict[str, str]:
    """Names of all autopilots that need no path, with where each one comes from."""
    return _offered(_AUTOPILOT)


def load_estimator(spec: str) -> "AttitudeEstimator":
    """A new estimator by name, ``module:Class`` or ``file.py:Class``, that knows nothing of its instruments.

    Raises
    ------
    PluginError
        In one line: nothing of that name (with the near misses), code that cannot be imported or constructed, no
        ``update(measurements)``, or a ``heading_reference`` that is neither "course" nor "nose".
    """
    estimator: AttitudeEstimator = _made(_ESTIMATOR, spec, _find(_ESTIMATOR, spec), {})
    _check_reference(spec, estimator)
    return estimator


class Equipped(NamedTuple):
    """Flight code that knows its instruments, and what it was given of them, by name."""

    code: Any
    known: dict[str, Known]


def equipped(
    spec: "str | Maker", instruments: Instruments | None = None, settings: Mapping[str, Any] | None = None
) -> Equipped:
    """A new estimator that is given what is known of the instruments, with parameters changed.

    Parameters
    ----------
    spec            name, ``module:Class``, ``file.py:Class``, a class, or a function that makes one: what that has set
                    in its parameters is left alone
    instruments     None is what is assumed where nothing is known
    settings        parameters by dotted names, as the user sets them: they win over `instruments`

    Raises
    ------
    ValueError      in one line: as `load_estimator`; or it has no parameters, none of that name, or refuses a value
    """
    made = _equipped(_ESTIMATOR, spec, instruments or Instruments(), settings or {})
    _check_reference(spec, made.code)
    return made


def parameters_of(spec: "str | Maker") -> set[str]:
    """Names of what can be set of the estimator `spec`: dotted fields of its ``params``, arguments of its constructor.

    Raises
    ------
    PluginError      as for `load_estimator`
    """
    maker = _find(_ESTIMATOR, spec) if isinstance(spec, str) else spec
    params = params_of(spec, equipped(spec).code)
    named = set(dotted_fields(params)) if params is not None else set()
    return named | (_arguments(_ESTIMATOR, spec, maker) - _NOT_SET)


def params_of(spec: "str | Maker", estimator: object) -> Any:
    """The parameter dataclass of `estimator`, made of `spec`; None where it has none, PluginError where it raises."""
    return _params(_ESTIMATOR, spec, estimator)


def _params(kind: _Kind, spec: "str | Maker", code: object) -> Any:
    with _refusing(kind, spec, home_of(code)):
        params = getattr(code, "params", None)
        if isinstance(params, type) or not is_dataclass(params):
            return None
        dotted_fields(params)  # anyone's class: its fields may raise
        return params


def short_name(spec: "str | Maker") -> str:
    """What reports call an estimator: the name of its class, or of its library."""
    library = library_named(spec) if isinstance(spec, str) else None
    if library is not None:
        return library.short_name
    name, parenthesis, settings = maker_name(spec).partition("(")
    return f"{name.rpartition(':')[2]}{parenthesis}{settings}"


def equipped_autopilot(
    spec: str, heading_reference: "HeadingReference", aircraft: str, instruments: Instruments
) -> Equipped:
    """A new autopilot by name that is given what is known of the instruments; errors as for `load_autopilot`."""
    return _equipped(_AUTOPILOT, spec, instruments, {}, heading_reference=heading_reference, aircraft=aircraft)


def _equipped(
    kind: _Kind, spec: "str | Maker", instruments: Instruments, settings: Mapping[str, Any], **also: Any
) -> Equipped:
    aboard = instruments.changed({name: value for name, value in settings.items() if name in instruments})
    values = {name: known.value for name, known in aboard.given.items()}
    maker = _find(kind, spec) if isinstance(spec, str) else spec
    asked = _arguments(kind, spec, maker)
    of_constructor = {name: value for name, value in settings.items() if name in asked - {*_NOT_SET, *also}}
    offered = {**also, **values, "instruments": aboard, **of_constructor}
    code = _made(kind, spec, maker, offered)
    known = {name: aboard[name] for name in aboard if name in asked or "instruments" in asked}
    params = _params(kind, spec, code)
    if params is not None and inspect.isclass(maker):
        fields = set(dotted_fields(params))
        changes = {name: value for name, value in settings.items() if name not in of_constructor or name in fields}
        if changes or _takes_params(maker, {*also, *aboard}):
            places = _places(params, aboard)
            known |= {name: aboard[name] for name in aboard if name in places}
            given = {place: values[name] for name, place in places.items() if name in values}
            return Equipped(_with_params(kind, spec, params, given | changes, maker, offered) or code, known)
    elif unheard := [name for name in settings if name not in of_constructor]:
        raise ValueError(
            f"{kind.word} {maker_name(spec)!r} has no parameter {unheard[0]!r}: its constructor does not take it, and "
            "it has no dataclass params" + ("" if params is None else " that can be set: what a function made is kept")
        )
    return Equipped(code, known)


def _takes_params(maker: Any, others: set[str]) -> bool:
    """Whether the constructor's first argument can be the parameters: it is none of the `others`, offered by name."""
    try:
        first = next(iter(inspect.signature(maker).parameters), "")
    except (TypeError, ValueError):
        return False
    return bool(first) and first not in {*others, "instruments"}


def _places(params: Any, names: Iterable[str]) -> dict[str, str]:
    """Those of `names` that are fields of `params` or of a group in it, with their dotted names."""
    paths, wanted = dotted_fields(params), set(names)
    return {path.rpartition(".")[2]: path for path in paths if path.rpartition(".")[2] in wanted} | {
        path: path for path in paths if path in wanted
    }


def _with_params(
    kind: _Kind, spec: "str | Maker", params: Any, changes: Mapping[str, Any], maker: Maker, offered: Mapping[str, Any]
) -> Any:
    """Flight code with `changes` of its parameters, None where there are none; ValueError for one that is refused."""
    if not changes:
        return None
    home = home_of(maker)
    with _refusing(kind, spec, home):
        try:
            after, problem = changed(params, changes, f"{kind.word} {maker_name(spec)}"), ""
        except ValueError as error:
            if place_of(error, home):  # raised in their own code
                raise
            after, problem = None, described(error).partition(": ")[2]
    if problem:
        raise ValueError(problem)
    asked = _arguments(kind, spec, maker)
    with _refusing(kind, spec, home):
        first = next(iter(inspect.signature(maker).parameters), "")
        try:
            made = maker(after, **{name: value for name, value in offered.items() if name in asked - {first}})
        except TypeError as error:
            if place_of(error, home):
                raise
            raise Refused(f"its class must take its params as an argument: {printable(str(error))}") from error
    _check_update(kind, spec, made)
    return made


def maker_name(spec: "str | Maker") -> str:
    """What an estimator is called that is given by name, or by what makes it: ``package.module:Class``.

    What `functools.partial` sets is told behind it.
    """
    if isinstance(spec, str):
        return spec
    if isinstance(spec, partial):
        told = [*map(shown, spec.args), *(f"{name}={shown(value)}" for name, value in spec.keywords.items())]
        return f"{maker_name(spec.func)}({', '.join(told)})"
    try:
        name = getattr(spec, "__qualname__", None) or class_name(spec)
        return printable(f"{spec.__module__}:{name}")
    except BaseException:  # anyone's class
        return class_name(spec)


def _check_reference(spec: "str | Maker", estimator: object) -> None:
    from sim.flight_code import reference_of  # here, for it loads the compiler

    with _refusing(_ESTIMATOR, spec, home_of(estimator)):
        reference_of(estimator)


def learnt(estimator: object, known: Mapping[str, Known]) -> dict[str, Known]:
    """`known` with the properties that `estimator` has learnt in flight, as its ``learnt`` tells, in their place.

    Raises
    ------
    PluginError      one line: it raises, or is no mapping from properties of the instruments to their values
    """
    with _refusing(_ESTIMATOR, class_name(estimator), home_of(estimator)):
        found = getattr(estimator, "learnt", None)
        if found is None:
            return dict(known)
        if not isinstance(found, Mapping):
            raise Refused(f"learnt is {shown(found)}, must be a mapping from properties of the instruments to values")
        told = {}
        for name, value in found.items():  # not more than there are properties: others are refused
            if not isinstance(name, str) or not isinstance(value, numbers.Real):
                raise Refused(f"learnt holds {shown(name)}: {shown(value)}, must hold names and numbers")
            try:
                told[str(name)] = Known(property_value(name, value), "learnt")
            except ValueError as error:
                raise Refused(f"learnt: {error}") from error
        return {**known, **told}


def uses_of(estimator: object, instead: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the instruments that `estimator` can make something of; `instead` where it does not say.

    Raises
    ------
    PluginError      one line: it raises, or does not hold names
    """
    with _refusing(_ESTIMATOR, class_name(estimator), home_of(estimator)):
        uses = getattr(estimator, "uses", instead)
        if not isinstance(uses, tuple | list | set | frozenset) or not all(isinstance(name, str) for name in uses):
            raise Refused(f"uses is {shown(uses)}, must be names of instruments, such as ('gyro', 'gps')")
        return tuple(uses)


def heading_reference_of(estimator: object) -> "HeadingReference":
    """What the heading of `estimator` converges to; the course where it does not say, PluginError for another word."""
    from sim.flight_code import reference_of  # here, for it loads the compiler

    with _refusing(_ESTIMATOR, class_name(estimator), home_of(estimator)):
        return reference_of(estimator)


def load_autopilot(
    spec: str, heading_reference: "HeadingReference" = "course", aircraft: str = "endurance"
) -> "Autopilot":
    """A new autopilot by name, ``module:Class`` or ``file.py:Class``; PluginError as for `load_estimator`.

    heading_reference : of the estimator that it will steer on      aircraft : name of what it will fly; both are
    handed to a class that asks for them by these names
    """
    offered = {"heading_reference": heading_reference, "aircraft": aircraft}
    autopilot: Autopilot = _made(_AUTOPILOT, spec, _find(_AUTOPILOT, spec), offered)
    return autopilot


def load_class(word: str, spec: str) -> Any:
    """What makes flight code that `spec` names, not called yet; `word` is "estimator" or "autopilot".

    Raises
    ------
    PluginError     one line: nothing of that name, code that cannot be imported, or something that makes nothing
    """
    kind = _ESTIMATOR if word == _ESTIMATOR.word else _AUTOPILOT
    found = _find(kind, spec)
    _require_maker(kind, spec, found)
    return found


def module_of_offer(word: str, spec: str) -> str:
    """Name of the module that the entry point `spec` points to; empty where an installed package offers none such."""
    kind = _ESTIMATOR if word == _ESTIMATOR.word else _AUTOPILOT
    found = None if ":" in spec or spec in kind.registry else _installed(kind).get(spec)
    return "" if found is None else found.module


def _installed(kind: _Kind) -> dict[str, Offer]:
    return offered(f"{kind.word}s", kind.registry)


def _offered(kind: _Kind) -> dict[str, str]:
    return {**kind.registry, **{name: offer.value for name, offer in _installed(kind).items()}}


def _made(kind: _Kind, spec: "str | Maker", maker: Any, offered: Mapping[str, Any]) -> Any:
    """What `maker` makes of those of the `offered` arguments that it asks for, checked."""
    _require_maker(kind, spec, maker)
    asked = _arguments(kind, spec, maker)
    with _refusing(kind, spec, home_of(maker)):
        made = maker(**{name: value for name, value in offered.items() if name in asked})
    _check_update(kind, spec, made)
    return made


def _require_maker(kind: _Kind, spec: "str | Maker", maker: Any) -> None:
    if not callable(maker):
        raise PluginError(
            f"{kind.word} {maker_name(spec)!r}: {shown(maker)} is no class; name the class, or a function that makes a "
            "new one for each flight"
        )


def _arguments(kind: _Kind, spec: "str | Maker", maker: Any) -> set[str]:
    """Names of the arguments with which `maker` can be called."""
    with _refusing(kind, spec, home_of(maker)):
        try:
            parameters = inspect.signature(maker).parameters.values()
        except (TypeError, ValueError):
            return set()  # compiled code that does not tell
        return {p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}


def _find(kind: _Kind, spec: str) -> Any:
    """The class (or whatever is called to make one) that `spec` names."""
    if lent.is_lent(spec):
        with _refusing(kind, spec):
            return lent.find(spec)
    named = spec
    library = library_named(spec) if kind is _ESTIMATOR else None
    if library is not None:
        from scenarios.harness.c_library import class_of_library  # loads the machinery that only these need

        with _refusing(kind, spec):
            return class_of_library(library)
    if spec in kind.registry:
        spec = kind.registry[spec]
    elif ":" not in spec:
        installed = _installed(kind)
        if spec in installed:
            offer = installed[spec]
            named = f"{kind.word} {spec!r} of {offer.origin}"
            with theirs(lambda line: PluginError(f"{named}: {line}"), offer.package):
                return offer.load()
        hint = near_misses(spec, _offered(kind))
        raise PluginError(f"unknown {kind.word} {spec!r}: {hint} (your own: module:Class or file.py:Class)")
    place, _, name = spec.rpartition(":")
    if place.endswith(".py"):
        module = module_of_file(Path(place), lambda line: PluginError(f"{kind.word} {named!r}: {line}"))
    else:
        module = _module_by_name(kind, named, place)
    with _refusing(kind, named):
        try:
            return getattr(module, name)
        except AttributeError:
            classes = [n for n, c in vars(module).items() if inspect.isclass(c) and c.__module__ == module.__name__]
        hint = near_misses(name, classes) if classes else "it defines no class"
        raise Refused(f"no class {name!r} in {place}; {hint}")


def _module_by_name(kind: _Kind, spec: str, name: str) -> ModuleType:
    """The importable module `name`, also from the working directory."""
    also_import_from(Path.cwd())
    package = name.partition(".")[0]
    with _refusing(kind, spec, "" if package in ("estimator", "autopilot", "sim", "scenarios") else package):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or not (name == error.name or name.startswith(f"{error.name}.")):
                raise  # the module is there; something that it imports is not
        raise Refused(f"no module {name!r} here or installed (a file is named file.py:Class)")


def _check_update(kind: _Kind, spec: "str | Maker", made: Any) -> None:
    """Refuse what has no ``update`` of the right number of arguments."""
    wanted = f"update({', '.join(kind.arguments)})"
    with _refusing(kind, spec, home_of(made)):
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
            raise Refused(f"{class_name(made)}.update takes {signature}, must be {wanted}") from None
