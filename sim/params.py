"""Parameter dataclasses by dotted field names: units, typed values, changes, and suggestions for misspelt names."""

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from types import MappingProxyType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from sim.outside.wording import brief

T = TypeVar("T")
_MOST_NAMES = 60  # in one message; beyond that, names with the same first part are listed as one

# Ends of field names and their units; the first match counts.
_UNITS = (
    ("noise_density_deg_s_sqrt_hz", "deg/s/sqrt(Hz)"), ("noise_density_ug_sqrt_hz", "ug/sqrt(Hz)"),
    ("_deg_s_sqrt_s", "deg/s/sqrt(s)"), ("_ug_sqrt_s", "ug/sqrt(s)"), ("_deg_s_min", "deg/s/min"),
    ("_per_k_deg_s", "deg/s/K"), ("_per_k_mg", "mg/K"), ("_per_k", "1/K"), ("mv_deg_s", "mV/(deg/s)"),
    ("mv_g", "mV/g"), ("_deg_s_g", "deg/s/g"), ("_deg_s", "deg/s"), ("_rad_s", "rad/s"), ("_m_s2", "m/s2"),
    ("_m_s", "m/s"), ("_deg", "deg"), ("_hz", "Hz"), ("_hpa", "hPa"), ("_pa_min", "Pa/min"),
    ("_pa", "Pa"), ("_ut", "uT"), ("_ug", "ug"),
    ("_mg", "mg"), ("_rpm", "rpm"), ("_m", "m"), ("_g", "g"), ("_s", "s"), ("_k", "K"), ("_v", "V"), ("_mah", "mAh"),
    ("_ohm", "ohm"),
    ("bits", "bit"),
)  # fmt: skip


def unit_of(name: str) -> str:
    """Unit given by the end of a field's name; empty if none."""
    return next((unit for end, unit in _UNITS if name.endswith(end)), "")


# Fields whose names differ from another field of the part only by the unit.
_WORDS = {
    "drift_s": "drift time", "wander_s": "wander time", "velocity_wander_s": "velocity wander time",
    "warming_s": "warming time",
    "motor_rpm": "motor speed", "vibration_deg_s": "vibration turning", "vibration_rpm": "vibration at speed",
}  # fmt: skip


def words_of(name: str) -> str:
    """A field's name as words, without its unit: ``noise_density_ug_sqrt_hz`` is noise density.

    No two fields of a part have the same words.
    """
    if name in _WORDS:
        return _WORDS[name]
    end = next((end.removeprefix("noise_density") for end, _ in _UNITS if name.endswith(end)), "")
    words = (name if end == "bits" else name.removesuffix(end)).strip("_").removesuffix("_b").replace("_", " ")
    if end.startswith("_per_k"):
        return f"{words} per kelvin"
    return f"{words}, body axes" if f"_b{end}" in name else words


def near_misses(name: str, names: Iterable[str], written: Mapping[str, str] = MappingProxyType({})) -> str:
    """End of a message about an unknown `name`: the most similar names, or all names.

    written : how to write a name, if not as it is
    """
    possible = sorted(names)
    slips = difflib.get_close_matches(name.lower(), possible, n=3, cutoff=0.85)  # a typing error
    close = slips or difflib.get_close_matches(name.lower(), possible, n=3, cutoff=0.5)
    if not close and len(possible) > _MOST_NAMES:
        head = f"{name.partition('.')[0]}."
        possible = [n for n in possible if n.startswith(head)] or _by_heads(possible)
    to_write = list(dict.fromkeys(written.get(each, each) for each in close or possible))
    return f"did you mean {' or '.join(to_write)}?" if close else f"choose from {', '.join(to_write)}"


def _by_heads(names: list[str]) -> list[str]:
    """Names in order, those with the same first part as one: ``gps.*``."""
    return list(dict.fromkeys(f"{head}.*" if dot else head for head, dot, _ in (n.partition(".") for n in names)))


def dotted_fields(params: Any) -> list[str]:
    """Field names of a parameter dataclass, nested ones with dots; parts not fitted are left out."""
    names: list[str] = []
    for f in fields(params):
        value = getattr(params, f.name)
        if is_dataclass(value):
            names += [f"{f.name}.{inner}" for inner in dotted_fields(value)]
        elif value is not None or not _is_part(type(params), f.name):
            names.append(f.name)
    return names


def changed(params: T, changes: Mapping[str, Any], what: str) -> T:
    """A copy of the frozen dataclass `params` with fields changed by dotted names.

    Raises
    ------
    ValueError      unknown field of `what` (with suggestions), part not fitted, or invalid value
    """
    for name, value in changes.items():
        known = dotted_fields(params)
        if name not in known:
            require_fitted(params, name, what)
            raise ValueError(f"unknown parameter {name!r} of {what}: {near_misses(name, known)}")
        params = _change(params, name, value, name, what)
    return params


def require_fitted(params: Any, name: str, what: str) -> None:
    """Reject the dotted `name` of a field of a part that is not fitted in `what`: ValueError."""
    head = name.partition(".")[0]
    if _is_part(type(params), head) and getattr(params, head) is None:
        raise ValueError(f"parameter {name!r} of {what}: no {head} fitted; choose a suite that has one")


def _is_part(owner: type, name: str) -> bool:
    """Whether the field is a nested dataclass, or None if that part is not fitted."""
    hint = get_type_hints(owner).get(name)
    return any(is_dataclass(choice) for choice in (hint, *get_args(hint)))


def _change(params: Any, rest: str, value: Any, name: str, what: str) -> Any:
    head, _, rest = rest.partition(".")
    if rest:
        return replace(params, **{head: _change(getattr(params, head), rest, value, name, what)})
    try:
        value = typed(value, get_type_hints(type(params))[head])
    except ValueError as error:
        raise ValueError(f"{shown(name, value)} of {what}: {error}") from None
    return replace(params, **{head: value})


def shown(name: str, value: Any) -> str:
    """A field with its value and unit, as in messages."""
    return f"{name} = {brief(value)} {unit_of(name)}".rstrip()


def typed(value: Any, hint: Any) -> Any:
    """`value` converted to the type declared by a dataclass: numbers to float, lists of numbers to tuple.

    Raises
    ------
    ValueError      what the value must be
    """
    origin = get_origin(hint)
    if origin in (Union, UnionType):
        return _one_of(value, get_args(hint))
    if origin is Literal:
        if value not in get_args(hint):
            raise ValueError(f"must be {' or '.join(map(str, get_args(hint)))}")
        return value
    if origin is tuple:
        return _numbers(value, get_args(hint))
    if hint is bool:
        if value not in (True, False):
            raise ValueError("must be true or false")
        return bool(value)
    if hint in (int, float):
        return _number(value, hint)
    if hint is str and not isinstance(value, str):
        raise ValueError("must be a text")
    return value


def _one_of(value: Any, choices: tuple[Any, ...]) -> Any:
    """`value` as the first type that fits."""
    if value is None and type(None) in choices:
        return None
    refusals = []
    for choice in choices:
        if choice is not type(None):
            try:
                return typed(value, choice)
            except ValueError as error:
                refusals.append(str(error))
    raise ValueError(" or ".join(refusals))


def _number(value: Any, kind: type) -> Any:
    try:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:  # hundreds of digits
        number = math.nan
    if math.isnan(number) or (kind is int and not number.is_integer()):
        raise ValueError(f"must be a {'whole number' if kind is int else 'number'}")
    return kind(number)


def _numbers(value: Any, hints: tuple[Any, ...]) -> Any:
    endless = hints[-1] is Ellipsis  # tuple[float, ...]
    if not isinstance(value, list | tuple) or not (endless or len(value) == len(hints)):
        raise ValueError("must be a list of numbers" if endless else f"must be a list of {len(hints)} numbers")
    return tuple(typed(number, hints[0]) for number in value)
