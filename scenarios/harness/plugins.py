"""Flight code by name: estimators and autopilots of this project, of the person at the keyboard, of other packages.

A name is one of

``premerlani``        a name of the registry, or of an installed package that offers an entry point in the group
                      ``wingslevel.estimators`` or ``wingslevel.autopilots``
``package.module:Class``   anything that can be imported, also from the working directory
``path/to/file.py:Class``  a file

The class is called anew for each flight.  Its constructor is given what it asks for by name: ``instruments``, the
record of what is known of those aboard, or single properties of it, such as ``gps_latency_s``; an autopilot's also
the ``heading_reference`` of the estimator and the name of its ``aircraft``.  Fields of a dataclass ``params`` that are
named like a property are set to it.  Only ``update`` is required.
"""

import importlib
import importlib.util
import inspect
import sys
from collections import ChainMap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from autopilot import AUTOPILOTS
from estimator import ESTIMATORS
from estimator.instruments import Instruments, Known
from sim.params import changed, dotted_fields
from sim.params import near_misses as near_misses

if TYPE_CHECKING:  # names are looked up here before anything is flown: nothing heavy is imported for that
    from autopilot.interface import Autopilot
    from estimator.interface import AttitudeEstimator, HeadingReference

Maker = Callable[..., Any]  # a class, or a function that makes flight code

# The oracle sees the truth: it is not flight code and not in flight code's own registry.
_ALL_ESTIMATORS = ChainMap(ESTIMATORS, {"oracle": "sim.oracle:Oracle"})


class _Kind(NamedTuple):
    """What is looked up: its word for messages, our registry, the group of entry points, arguments of `update`."""

    word: str
    registry: Mapping[str, str]
    group: str
    arguments: tuple[str, ...]


_ESTIMATOR = _Kind("estimator", _ALL_ESTIMATORS, "wingslevel.estimators", ("measurements",))
_AUTOPILOT = _Kind("autopilot", AUTOPILOTS, "wingslevel.autopilots", ("estimate", "measurements", "setpoint"))


class PluginError(ValueError):
    """Flight code that cannot be found, loaded or used; the message is one line."""


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
    estimator: AttitudeEstimator = _load(_ESTIMATOR, spec)
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


def parameters_of(spec: str) -> set[str]:
    """Names of what can be set of the estimator `spec`: dotted fields of its ``params``, arguments of its constructor.

    Raises
    ------
    PluginError      as for `load_estimator`
    """
    params = getattr(load_estimator(spec), "params", None)
    named = set(dotted_fields(params)) if is_dataclass(params) else set()
    return named | (_arguments(_find(_ESTIMATOR, spec)) - {"params", "instruments", "self"})


def shared_settings(specs: Sequence[str], settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """`settings` for each of several estimators: those that it has, by the estimator's spec.

    A name may begin with that of one estimator, ``premerlani.gps_latency_s``: it is for that one alone.

    Raises
    ------
    ValueError      one line: a parameter that none of them has
    """
    short = {spec: spec.rpartition(":")[2] for spec in specs}
    of_each: dict[str, dict[str, Any]] = {spec: {} for spec in specs}
    has = {spec: parameters_of(spec) for spec in specs} if settings else {}
    own = {key: key.partition(".") for key in settings if key.partition(".")[0] in short.values() and "." in key}
    for key, value in settings.items():
        if key in own:
            continue
        takers = [spec for spec in specs if key in has[spec]]
        if not takers:
            known = sorted(set().union(*has.values()))
            who = f"estimator {specs[0]}" if len(specs) == 1 else f"any of {', '.join(specs)}"
            hint = near_misses(key, known) if known else "they have none"
            raise ValueError(f"unknown parameter {key!r} of {who}: {hint}")
        for spec in takers:
            of_each[spec][key] = value
    for key, (head, _, rest) in own.items():  # after those for all: what is set for one estimator wins
        of_each[next(spec for spec in specs if short[spec] == head)][rest] = settings[key]
    return of_each


def without(of_each: Mapping[str, Mapping[str, Any]], settings: Mapping[str, Any]) -> list[str]:
    """A line for each of the `settings` that some of the estimators do not have, from `shared_settings`."""
    lines = []
    for key in settings:
        takers = [spec for spec, own in of_each.items() if key in own]
        if takers and len(takers) < len(of_each):
            others = ", ".join(spec for spec in of_each if spec not in takers)
            lines.append(f"{key} is set for {', '.join(takers)}; without that parameter: {others}")
    return lines


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
    asked = _arguments(maker)
    code = _load(kind, spec, **also, **values, instruments=aboard)
    known = {name: aboard[name] for name in aboard if name in asked or "instruments" in asked}
    params = getattr(code, "params", None)
    if is_dataclass(params) and inspect.isclass(maker) and (settings or _takes_params(maker, {*also, *aboard})):
        places = _places(params, aboard)
        known |= {name: aboard[name] for name in aboard if name in places}
        changes = {place: values[name] for name, place in places.items() if name in values} | dict(settings)
        code = _with_params(kind, spec, code, changes, also)
    elif unheard := [name for name in settings if name not in asked]:
        raise ValueError(
            f"{kind.word} {_name_of(spec)!r} has no parameter {unheard[0]!r}: its constructor does not take it, and it "
            "has no dataclass params"
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


def _with_params(kind: _Kind, spec: "str | Maker", code: Any, changes: Mapping[str, Any], also: dict[str, Any]) -> Any:
    """Flight code like `code` with `changes` of its parameters; ValueError for one that it refuses."""
    if not changes:
        return code
    after = changed(code.params, changes, f"{kind.word} {_name_of(spec)}")
    maker: Any = type(code)
    asked = _arguments(maker)
    try:
        return maker(after, **{name: value for name, value in also.items() if name in asked})
    except TypeError as error:
        raise ValueError(f"{kind.word} {spec!r}: its class must take its params as an argument: {error}") from error


def _name_of(spec: "str | Maker") -> str:
    return spec if isinstance(spec, str) else getattr(spec, "__qualname__", type(spec).__name__)


def _check_reference(spec: "str | Maker", estimator: object) -> None:
    reference = heading_reference_of(estimator)
    if reference not in ("course", "nose"):
        raise PluginError(f"estimator {spec!r}: heading_reference is {reference!r}, must be 'course' or 'nose'")


def learnt(estimator: object, known: Mapping[str, Known]) -> dict[str, Known]:
    """`known` with the properties that `estimator` has learnt in flight, as its ``learnt`` tells, in their place."""
    found: Mapping[str, Any] = getattr(estimator, "learnt", None) or {}
    return {**known, **{name: Known(value, "learnt") for name, value in found.items()}}


def heading_reference_of(estimator: object) -> "HeadingReference":
    """What the heading of `estimator` converges to; the course where it does not say."""
    reference: HeadingReference = getattr(estimator, "heading_reference", "course")
    return reference


def load_autopilot(
    spec: str, heading_reference: "HeadingReference" = "course", aircraft: str = "endurance"
) -> "Autopilot":
    """A new autopilot by name, ``module:Class`` or ``file.py:Class``; PluginError as for `load_estimator`.

    heading_reference : of the estimator that it will steer on      aircraft : name of what it will fly; both are
    handed to a class that asks for them by these names
    """
    return _load(_AUTOPILOT, spec, heading_reference=heading_reference, aircraft=aircraft)


def _installed(kind: _Kind) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=kind.group) if point.name not in kind.registry}


def _offered(kind: _Kind) -> dict[str, str]:
    return {**kind.registry, **{name: point.value for name, point in _installed(kind).items()}}


def _load(kind: _Kind, spec: "str | Maker", **offered: Any) -> Any:
    """The object that `spec` names, constructed with those of the `offered` arguments that it asks for, and checked."""
    what = f"{kind.word} {_name_of(spec)!r}"
    try:
        made = _made(_find(kind, spec) if isinstance(spec, str) else spec, offered)
    except PluginError:
        raise
    except Exception as error:  # anything may go wrong in a person's own file: it is their file that is at fault
        raise PluginError(f"{what}: {_one_line(error)}") from error
    _check_update(what, kind, made)
    return made


def _made(maker: Any, offered: dict[str, Any]) -> Any:
    asked = _arguments(maker)
    return maker(**{name: value for name, value in offered.items() if name in asked})


def _arguments(maker: Any) -> set[str]:
    """Names of the arguments with which `maker` can be called."""
    try:
        return set(inspect.signature(maker).parameters)
    except (TypeError, ValueError):
        return set()  # compiled code that does not tell


def _find(kind: _Kind, spec: str) -> Any:
    """The class (or whatever is called to make one) that `spec` names."""
    if spec in kind.registry:
        spec = kind.registry[spec]
    elif ":" not in spec:
        installed = _installed(kind)
        if spec in installed:
            return installed[spec].load()
        hint = near_misses(spec, _offered(kind))
        raise PluginError(f"unknown {kind.word} {spec!r}: {hint} (one's own: module:Class or file.py:Class)")
    place, _, name = spec.rpartition(":")
    module = _module_of_file(Path(place)) if place.endswith(".py") else _module_by_name(kind, place)
    try:
        return getattr(module, name)
    except AttributeError:
        classes = [n for n, c in vars(module).items() if inspect.isclass(c) and c.__module__ == module.__name__]
        hint = near_misses(name, classes) if classes else "it defines no class"
        raise PluginError(f"{kind.word} {spec!r}: no class {name!r} in {place}; {hint}") from None


def _module_of_file(path: Path) -> ModuleType:
    """The module in the file at `path`; its folder can be imported from, after everything installed."""
    if not path.is_file():
        raise PluginError(f"no file {str(path)!r}")
    path = path.resolve()
    _also_import_from(path.parent)
    name = f"_wingslevel_file_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise PluginError(f"{str(path)!r} cannot be read as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look their module up by name
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _module_by_name(kind: _Kind, name: str) -> ModuleType:
    """The importable module `name`, also from the working directory."""
    _also_import_from(Path.cwd())
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not (name == error.name or name.startswith(f"{error.name}.")):
            raise  # the module is there; something that it imports is not
        raise PluginError(
            f"{kind.word} {name!r}: no such module here or installed (a file is named file.py:Class)"
        ) from None


def _also_import_from(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))  # last, so that nothing of ours can be shadowed


def _check_update(what: str, kind: _Kind, made: Any) -> None:
    """Refuse what has no ``update`` of the right number of arguments."""
    wanted = f"update({', '.join(kind.arguments)})"
    update = getattr(made, "update", None)
    if not callable(update):
        raise PluginError(f"{what}: {type(made).__name__} has no method {wanted}")
    try:
        signature = inspect.signature(update)
    except (TypeError, ValueError):
        return  # compiled code that does not tell
    try:
        signature.bind(*kind.arguments)
    except TypeError:
        raise PluginError(f"{what}: {type(made).__name__}.update takes {signature}, must be {wanted}") from None


def _one_line(error: BaseException) -> str:
    """`error` as one line: its kind, its text, and for a syntax error where it is."""
    return f"{type(error).__name__}: {' '.join(str(error).split()) or 'no message'}"
