"""Flight code, made and given what it asks for: known instruments, parameters, and what it says of itself.

The constructor is given what it asks for by name: ``instruments``, the record of what is known of those aboard, or
single properties of it, such as ``gps_latency_s``; an autopilot's also the ``heading_reference`` of the estimator and
the name of its ``aircraft``.  Fields of a dataclass ``params`` that are named like a property are set to it.
"""

import inspect
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from estimator.instruments import Instruments, Known, property_value
from scenarios.harness.plugins import (
    AUTOPILOT,
    ESTIMATOR,
    NOT_SET,
    Kind,
    Maker,
    arguments_of,
    check_update,
    find_maker,
    maker_name,
    refusing,
    require_maker,
)
from sim.outside.blame import Refused, home_of, place_of, shown
from sim.outside.wording import class_name, described, printable
from sim.params import changed, dotted_fields, near_misses

if TYPE_CHECKING:
    from autopilot.fence import FenceParams
    from autopilot.interface import Autopilot
    from estimator.interface import AttitudeEstimator, HeadingReference


def load_estimator(spec: str) -> "AttitudeEstimator":
    """A new estimator by name, ``module:Class`` or ``file.py:Class``, that knows nothing of its instruments.

    Raises
    ------
    PluginError
        In one line: nothing of that name (with the near misses), code that cannot be imported or constructed, no
        ``update(measurements)``, or a ``heading_reference`` that is neither "course" nor "nose".
    """
    estimator: AttitudeEstimator = _made(ESTIMATOR, spec, find_maker(ESTIMATOR, spec), {})
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
    made = _equipped(ESTIMATOR, spec, instruments or Instruments(), settings or {})
    _check_reference(spec, made.code)
    return made


def parameters_of(spec: "str | Maker") -> set[str]:
    """Names of what can be set of the estimator `spec`: dotted fields of its ``params``, arguments of its constructor.

    Raises
    ------
    PluginError      as for `load_estimator`
    """
    maker = find_maker(ESTIMATOR, spec) if isinstance(spec, str) else spec
    params = params_of(spec, equipped(spec).code)
    named = set(dotted_fields(params)) if params is not None else set()
    return named | (arguments_of(ESTIMATOR, spec, maker) - NOT_SET)


def params_of(spec: "str | Maker", estimator: object) -> Any:
    """The parameter dataclass of `estimator`, made of `spec`; None where it has none, PluginError where it raises."""
    return _params(ESTIMATOR, spec, estimator)


def _params(kind: Kind, spec: "str | Maker", code: object) -> Any:
    with refusing(kind, spec, home_of(code)):
        params = getattr(code, "params", None)
        if isinstance(params, type) or not is_dataclass(params):
            return None
        dotted_fields(params)  # anyone's class: its fields may raise
        return params


def equipped_autopilot(
    spec: str, heading_reference: "HeadingReference", aircraft: str, instruments: Instruments,
    fence: "FenceParams | None" = None,
) -> Equipped:  # fmt: skip
    """A new autopilot by name that is given what is known of the instruments; errors as for `load_autopilot`.

    fence : None is none; ValueError where there is one and the autopilot has no argument for it
    """
    also: dict[str, Any] = {"heading_reference": heading_reference, "aircraft": aircraft}
    if fence is not None:
        if "fence" not in arguments_of(AUTOPILOT, spec, find_maker(AUTOPILOT, spec)):
            raise ValueError(
                f"fence: autopilot {spec!r} has no argument 'fence' and would fly through it; use one that has, or "
                "fence.action=report"
            )
        also["fence"] = fence
    return _equipped(AUTOPILOT, spec, instruments, {}, **also)


def _equipped(
    kind: Kind, spec: "str | Maker", instruments: Instruments, settings: Mapping[str, Any], **also: Any
) -> Equipped:
    aboard = instruments.changed({name: value for name, value in settings.items() if name in instruments})
    values = {name: known.value for name, known in aboard.given.items()}
    maker = find_maker(kind, spec) if isinstance(spec, str) else spec
    asked = arguments_of(kind, spec, maker)
    of_constructor = {name: value for name, value in settings.items() if name in asked - {*NOT_SET, *also}}
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
        settable = sorted(asked - {*NOT_SET, *also})
        if settable and params is None:
            raise ValueError(
                f"{kind.word} {maker_name(spec)!r} has no parameter {unheard[0]!r}: {near_misses(unheard[0], settable)}"
            )
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
    kind: Kind, spec: "str | Maker", params: Any, changes: Mapping[str, Any], maker: Maker, offered: Mapping[str, Any]
) -> Any:
    """Flight code with `changes` of its parameters, None where there are none; ValueError for one that is refused."""
    if not changes:
        return None
    home = home_of(maker)
    with refusing(kind, spec, home):
        try:
            after, problem = changed(params, changes, f"{kind.word} {maker_name(spec)}"), ""
        except ValueError as error:
            if place_of(error, home):  # raised in their own code
                raise
            after, problem = None, described(error).partition(": ")[2]
    if problem:
        raise ValueError(problem)
    asked = arguments_of(kind, spec, maker)
    with refusing(kind, spec, home):
        first = next(iter(inspect.signature(maker).parameters), "")
        try:
            made = maker(after, **{name: value for name, value in offered.items() if name in asked - {first}})
        except TypeError as error:
            if place_of(error, home):
                raise
            raise Refused(f"its class must take its params as an argument: {printable(str(error))}") from error
    check_update(kind, spec, made)
    return made


def _check_reference(spec: "str | Maker", estimator: object) -> None:
    from sim.flight_code import reference_of  # here, for it loads the compiler

    with refusing(ESTIMATOR, spec, home_of(estimator)):
        reference_of(estimator)


def learnt(estimator: object, known: Mapping[str, Known]) -> dict[str, Known]:
    """`known` with the properties that `estimator` has learnt in flight, as its ``learnt`` tells, in their place.

    Raises
    ------
    PluginError      one line: it raises, or is not a mapping from properties of the instruments to their values
    """
    with refusing(ESTIMATOR, class_name(estimator), home_of(estimator)):
        found = getattr(estimator, "learnt", None)
        if found is None:
            return dict(known)
        if not isinstance(found, Mapping):
            raise Refused(
                f"learnt is {shown(found)}; it must be a mapping from properties of the instruments to values"
            )
        reported = {}
        for name, value in found.items():  # not more than there are properties: others are refused
            if not isinstance(name, str) or not isinstance(value, numbers.Real):
                raise Refused(f"learnt holds {shown(name)}: {shown(value)}; it must hold names and numbers")
            try:
                reported[str(name)] = Known(property_value(name, value), "learnt")
            except ValueError as error:
                raise Refused(f"learnt: {error}") from error
        return {**known, **reported}


def uses_of(estimator: object, instead: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the instruments that `estimator` can make something of; `instead` where it does not say.

    Raises
    ------
    PluginError      one line: it raises, or does not hold names
    """
    with refusing(ESTIMATOR, class_name(estimator), home_of(estimator)):
        uses = getattr(estimator, "uses", instead)
        if not isinstance(uses, tuple | list | set | frozenset) or not all(isinstance(name, str) for name in uses):
            raise Refused(f"uses is {shown(uses)}; it must be names of instruments, such as ('gyro', 'gps')")
        return tuple(uses)


def heading_reference_of(estimator: object) -> "HeadingReference":
    """What the heading of `estimator` converges to; the course where it does not say, PluginError for another word."""
    from sim.flight_code import reference_of  # here, for it loads the compiler

    with refusing(ESTIMATOR, class_name(estimator), home_of(estimator)):
        return reference_of(estimator)


def load_autopilot(
    spec: str, heading_reference: "HeadingReference" = "course", aircraft: str = "endurance"
) -> "Autopilot":
    """A new autopilot by name, ``module:Class`` or ``file.py:Class``; PluginError as for `load_estimator`.

    heading_reference : of the estimator that it will steer on      aircraft : name of what it will fly; both are
    handed to a class that asks for them by these names
    """
    offered = {"heading_reference": heading_reference, "aircraft": aircraft}
    autopilot: Autopilot = _made(AUTOPILOT, spec, find_maker(AUTOPILOT, spec), offered)
    return autopilot


def _made(kind: Kind, spec: "str | Maker", maker: Any, offered: Mapping[str, Any]) -> Any:
    """What `maker` makes of those of the `offered` arguments that it asks for, checked."""
    require_maker(kind, spec, maker)
    asked = arguments_of(kind, spec, maker)
    with refusing(kind, spec, home_of(maker)):
        made = maker(**{name: value for name, value in offered.items() if name in asked})
    check_update(kind, spec, made)
    return made
