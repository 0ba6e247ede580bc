"""Validation errors of pydantic in one line: the field, its value, the unit, and what would be right."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from sim.outside.wording import brief, printable
from sim.params import unit_of

_M = TypeVar("_M", bound=BaseModel)


def validated(model: type[_M], data: Mapping[str, Any]) -> _M:
    """`model` of `data`; a one-line ValueError if it does not fit."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ValueError(_one_line(error)) from None


_BOUNDS = {"greater_than": ("gt", "above"), "greater_than_equal": ("ge", "at least"),
           "less_than": ("lt", "below"), "less_than_equal": ("le", "at most")}  # fmt: skip
_WHOLE = ("int_parsing", "int_type", "int_from_float")
# Branches of unions that pydantic adds to the place of an error; they are not part of a field's name.
_BRANCHES = ("in_flight", "hand_throw", "bench", "float", "constrained-float", "HandMotion")


def _one_line(error: ValidationError) -> str:
    """The first thing wrong, as field = value unit: what would be right."""
    found = error.errors()
    first = min(found, key=lambda e: e["type"] == "literal_error")  # of "a number or a word", the number says more
    kind = first["type"]
    if kind == "value_error":
        return str(first["ctx"]["error"])
    where = ".".join(str(part) for part in first["loc"] if str(part) not in _BRANCHES and "[" not in str(part))
    unit = unit_of(where)
    shown = f"{where} = {_shown(first['input'])} {unit}".strip()
    choices = "".join(f" or {e['ctx']['expected']}" for e in found if e["type"] == "literal_error" and e != first)
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        bound = first["ctx"][key]
        return f"{shown}: must be {words} {bound if isinstance(bound, int) else f'{bound:g}'} {unit}".strip() + choices
    if kind in _WHOLE or kind in ("float_parsing", "float_type"):
        return f"{shown}: must be a {'whole number' if kind in _WHOLE else 'number'}{choices}"
    if kind == "finite_number":
        return f"{shown}: must be a finite number"
    if kind == "extra_forbidden":
        return f"unknown parameter {brief(where)}"
    return f"{shown}: {printable(first['msg'][0].lower() + first['msg'][1:])}"


def _shown(value: Any) -> str:
    """`value` as typed, in quotes unless it is a number."""
    try:
        float(value)
    except (TypeError, ValueError, OverflowError):
        return brief(value)
    return printable(str(value), 60)
