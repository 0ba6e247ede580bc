"""Parameter dataclasses with some of their fields changed by name: sensors fitted, estimators tuned."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from scenarios.harness.plugins import near_misses
from sim.sensors.suite import SUITES, SuiteParams

T = TypeVar("T")


def dotted_fields(params: Any) -> list[str]:
    """Names of the fields of a parameter dataclass, nested ones with dots."""
    names: list[str] = []
    for f in fields(params):
        value = getattr(params, f.name)
        names += [f"{f.name}.{inner}" for inner in dotted_fields(value)] if is_dataclass(value) else [f.name]
    return names


def changed(params: T, changes: Mapping[str, Any], what: str) -> T:
    """A copy of the frozen dataclass `params` with fields changed by their dotted names.

    Raises
    ------
    ValueError      an unknown field of `what` (with the near misses), or a value that the dataclass refuses
    """
    for name, value in changes.items():
        known = dotted_fields(params)
        if name not in known:
            raise ValueError(f"unknown parameter {name!r} of {what}: {near_misses(name, known)}")
        params = _change(params, name, value, what)
    return params


def _change(params: Any, name: str, value: Any, what: str) -> Any:
    head, _, rest = name.partition(".")
    before = getattr(params, head)
    if rest:
        return replace(params, **{head: _change(before, rest, value, what)})
    if isinstance(before, bool):
        if value not in (True, False):
            raise ValueError(f"{name} of {what} = {value!r}: must be true or false")
        return replace(params, **{head: bool(value)})
    if isinstance(before, int | float):
        number = float(value) if isinstance(value, int | float) else None
        if number is None or (isinstance(before, int) and not number.is_integer()):
            kind = "whole number" if isinstance(before, int) else "number"
            raise ValueError(f"{name} of {what} = {value!r}: must be a {kind}")
        value = type(before)(number)
    return replace(params, **{head: value})


def suite_params(suite: str, changes: Mapping[str, float]) -> SuiteParams:
    """The suite of that name with some fields changed; ValueError where there is no such suite or field."""
    if suite not in SUITES:
        raise ValueError(f"unknown sensor suite {suite!r}: {near_misses(suite, SUITES)}")
    return changed(SUITES[suite], changes, f"sensor suite {suite}")
