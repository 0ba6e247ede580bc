"""The registry of scenarios: those of this package, of installed packages, and of the user's own files.

A module exports ``SCENARIO``, with the name of its file.  A module with variants also exports ``VARIANTS``, a literal
dictionary from the ending of each name to a summary (literal, so that a listing need not import it), and ``SCENARIOS``,
the scenario and its variants in that order.

An installed package offers a scenario by an entry point in the group ``wingslevel.scenarios``: a module that exports
``SCENARIO``, or a Scenario.  Its name is that of the entry point.
"""

import importlib
import pkgutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import cast

import scenarios
from scenarios.harness.cli import console
from scenarios.harness.own_files import module_of_file
from scenarios.harness.plugins import near_misses
from scenarios.harness.scenario import Scenario
from sim.outside.blame import Refused, shown, theirs
from sim.outside.entry_points import Offer, offered


@cache
def registered() -> Mapping[str, Scenario]:
    """All scenarios of the package by name, in order of name."""
    found = {}
    for info in sorted(pkgutil.iter_modules(scenarios.__path__), key=lambda info: info.name):
        if not info.ispkg:
            for scenario in _family(importlib.import_module(f"scenarios.{info.name}"), info.name):
                found[scenario.name] = scenario
    return MappingProxyType(found)


def matching(patterns: Iterable[str]) -> list[str]:
    """Names, without duplicates, of the scenarios that `patterns` select: names, files, or ``hand_launch*``.

    A plain name is not checked.

    Raises
    ------
    ValueError      a pattern that matches no scenario
    """
    names: dict[str, None] = {}
    for pattern in patterns:
        if "*" in pattern or "?" in pattern:
            found = [name for name in registered() if fnmatchcase(name, pattern)]
            found += [name for name in _offered() if fnmatchcase(name, pattern) and _can_be_loaded(name)]
            if not found:
                raise ValueError(f"no scenario matches {pattern!r}; `wingslevel list scenarios` lists all")
            names |= dict.fromkeys(found)
        else:
            names[pattern] = None
    return list(names)


def find(name: str) -> Scenario:
    """The scenario called `name`, or the one in a file, ``path/to/file.py``.

    Raises
    ------
    ValueError      no such scenario (with the near misses), or a file without one
    """
    if name.endswith(".py"):
        return _from_file(Path(name))
    if name in registered():
        return registered()[name]
    offers = _offered()
    if name not in offers:
        raise ValueError(
            f"unknown scenario {name!r}: {near_misses(name, [*registered(), *offers])} (your own: file.py)"
        )
    return _from_offer(offers[name])


def module_of_offer(name: str) -> str:
    """Name of the module that the entry point `name` points to; empty if no installed package offers it."""
    offers = {} if name in registered() else _offered()
    return offers[name].module if name in offers else ""


def _offered() -> dict[str, Offer]:
    """The scenarios that installed packages offer, by name."""
    return offered("scenarios", registered())


def _can_be_loaded(name: str) -> bool:
    """Whether a scenario of an installed package can be loaded; prints one line if not."""
    try:
        find(name)
    except ValueError as problem:
        console.error(f"left out: {problem}")
        return False
    return True


def _from_offer(offer: Offer) -> Scenario:
    with theirs(lambda line: ValueError(f"scenario {offer.name!r} of {offer.origin}: {line}"), offer.package):
        found = offer.load()
        scenario = _of(found) if isinstance(found, ModuleType) else found
        if not issubclass(type(scenario), Scenario):
            raise Refused(
                f"{offer.value} is {shown(scenario)}; it must be a Scenario, or a module that exports SCENARIO"
            )
        return replace(scenario, name=offer.name)


def _from_file(path: Path) -> Scenario:
    module = module_of_file(path, lambda line: ValueError(f"scenario {str(path)!r}: {line}"))
    with theirs(lambda line: ValueError(f"scenario {str(path)!r}: {line}"), str(path)):
        return _of(module)


def _of(module: ModuleType) -> Scenario:
    scenario = getattr(module, "SCENARIO", None)
    if not issubclass(type(scenario), Scenario):
        raise Refused(f"must export SCENARIO, a Scenario; it is {shown(scenario)}")
    return cast(Scenario, scenario)


def _family(module: ModuleType, where: str) -> tuple[Scenario, ...]:
    """The scenario of a module of the package and its variants; ValueError if their names do not match."""
    first = _of(module)
    family: tuple[Scenario, ...] = getattr(module, "SCENARIOS", (first,))
    names = [where, *(f"{where}_{ending}" for ending in getattr(module, "VARIANTS", {}))]
    if family[0] is not first or [scenario.name for scenario in family] != names:
        raise ValueError(f"scenario {where!r}: SCENARIOS must be SCENARIO and its VARIANTS, {', '.join(names)}")
    return family
