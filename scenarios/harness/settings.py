"""Parameters of estimators by name, the same in every command: ``--set k_p=0.5`` or ``--set my_filter.k_p=0.5``.

A name that begins with that of an estimator is for that one alone.  The name of an estimator in a file or a module is
its class's, as it is (``MyFilter.k_p``) or in snake case (``my_filter.k_p``); that of a library is its file's.  Without
the name of an estimator, a parameter is set for all that have it.  ``estimator_params.k_p`` means the same as ``k_p``.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from scenarios.harness import plugins
from scenarios.harness.equipping import parameters_of
from scenarios.harness.own_files import library_named
from scenarios.harness.plugins import Maker, short_name
from sim.outside.wording import brief
from sim.params import near_misses

PREFIX = "estimator_params."
_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def names_of(spec: str | Maker) -> tuple[str, ...]:
    """What an estimator may be called in front of a parameter; the name to suggest comes first."""
    if isinstance(spec, str) and (":" not in spec or library_named(spec)):
        return (short_name(spec),)
    name = short_name(spec).partition("(")[0].rpartition(".")[2]
    return tuple(dict.fromkeys((_WORDS.sub("_", name).lower(), name)))


def addressed(key: str, specs: Sequence[str | Maker]) -> list[Any]:
    """Those of `specs` that the name of a parameter begins with."""
    head, dot, _ = key.partition(".")
    return [spec for spec in specs if dot and head in names_of(spec)]


def without_others(changes: Mapping[str, Any], spec: str, specs: Sequence[str]) -> dict[str, Any]:
    """`changes` for the flights of one estimator, without what is for another of `specs` alone."""
    meant = {key: addressed(key, specs) for key in changes}
    return {key: value for key, value in changes.items() if not meant[key] or spec in meant[key]}


def parameter_name(key: str, spec: str | Maker, known: Iterable[str]) -> str:
    """The name in the configuration of a parameter of the estimator `spec`: ``estimator_params.k_p``.

    known : other names that may have been meant

    Raises
    ------
    ValueError      one line: no such parameter, with those that come near
    """
    if addressed(key, [spec]):
        return PREFIX + key.partition(".")[2]
    has, name = parameters_of(spec), names_of(spec)[0]
    if key in has:
        return PREFIX + key
    head, dot, _ = key.partition(".")
    if dot and head in plugins.estimators():
        raise ValueError(f"unknown parameter {brief(key)}: {head} does not fly, but {name} does")
    raise ValueError(f"unknown parameter {brief(key)}: {_suggestion(key, known, {spec: has})}")


def split(
    changes: Mapping[str, Any], specs: Sequence[str], is_field: Callable[[str], bool]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Overrides of the flight, and settings of the estimators `specs`, for `shared_settings`.

    is_field : whether a name is one of the configuration of the flight
    """
    unclear = [key for key in changes if not (key.startswith(PREFIX) or addressed(key, specs) or is_field(key))]
    has = set().union(*map(parameters_of, specs)) if unclear else set()
    ours = {key for key in changes if key.startswith(PREFIX) or addressed(key, specs)} | (has & set(unclear))
    settings = {key.removeprefix(PREFIX): changes[key] for key in changes if key in ours}
    return {key: value for key, value in changes.items() if key not in ours}, settings


def shared_settings(specs: Sequence[str], settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """`settings` for each of several estimators, by the estimator's spec: those that it has, or that name it.

    Raises
    ------
    ValueError      one line: a parameter that none of them has
    """
    of_each: dict[str, dict[str, Any]] = {spec: {} for spec in specs}
    for_all = [key for key in settings if not addressed(key, specs)]
    has = {spec: parameters_of(spec) for spec in specs} if for_all else {}
    for key in for_all:
        takers = [spec for spec in specs if key in has[spec]]
        if not takers:
            who = f"estimator {specs[0]}" if len(specs) == 1 else f"any of {', '.join(specs)}"
            hint = _suggestion(key, (), has) if any(has.values()) else "they have none"
            raise ValueError(f"unknown parameter {key!r} of {who}: {hint}")
        for spec in takers:
            of_each[spec][key] = settings[key]
    for key in settings:  # after those for all: what is set for one estimator wins
        for spec in addressed(key, specs):
            of_each[spec][key.partition(".")[2]] = settings[key]
    return of_each


def lines_on_others(of_each: Mapping[str, Mapping[str, Any]], settings: Mapping[str, Any]) -> list[str]:
    """A line for each of the `settings` that some of the estimators do not have, from `shared_settings`."""
    lines = []
    for key in settings:
        takers = [spec for spec, own in of_each.items() if key in own]
        if takers and len(takers) < len(of_each):
            others = ", ".join(spec for spec in of_each if spec not in takers)
            lines.append(f"{key} is set for {', '.join(takers)}; without that parameter: {others}")
    return lines


def _suggestion(key: str, known: Iterable[str], has: Mapping[Any, Iterable[str]]) -> str:
    """The end of a message about an unknown `key`; parameters are written behind the name of their estimator."""
    written = {name: f"{names_of(spec)[0]}.{name}" for spec, names in has.items() for name in names}
    others = set(known)
    return near_misses(
        key, {*others, *written, *written.values()}, {k: v for k, v in written.items() if k not in others}
    )
