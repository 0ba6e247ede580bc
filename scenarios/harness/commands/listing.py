"""`wingslevel list`: everything with a name, where it comes from, and the parameters of estimators.

What installed packages offer is imported for it, one entry point at a time: one that is broken is listed as broken, and
hides no other.
"""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenarios.harness import plugins
from scenarios.harness.cli import console
from scenarios.harness.cli.reports import reporting, usage
from scenarios.harness.commands.catalogue import KINDS, ours
from scenarios.harness.gate import guard
from scenarios.harness.parameters import Parameter, default_text, estimator_parameters
from scenarios.harness.settings import names_of
from sim.outside.entry_points import OURS, Offer, ignored, offered
from sim.outside.signals import TimedOut, limited
from sim.outside.wording import printable
from sim.params import near_misses

if TYPE_CHECKING:
    from scenarios.harness.config import FlightConfig

LOADING_S = 60.0  # wall-clock limit for each entry point


@dataclass(frozen=True, slots=True)
class Listed:
    """One thing with a name.

    origin : "wingslevel", or a distribution with its version      broken : why it cannot be used, one line, or empty
    """

    about: str
    origin: str = OURS
    broken: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {"about": self.about, "from": self.origin} | ({"broken": self.broken} if self.broken else {})


@dataclass(frozen=True, slots=True)
class Listing:
    """All that is listed: kind -> name -> what it is.

    notes : a line for each entry point that is ignored, because its name is taken
    """

    kinds: Mapping[str, Mapping[str, Listed]]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain data: kind -> name -> about, from, broken; and the notes, where there are any."""
        kinds = {kind: {name: one.to_json() for name, one in things.items()} for kind, things in self.kinds.items()}
        return kinds | ({"notes": list(self.notes)} if self.notes else {})


def listing(kind: str | None = None, names: Sequence[str] = ()) -> Listing:
    """What is to be listed: everything, or one kind, or some names of it.

    Raises
    ------
    ValueError      one line: no such kind, or nothing of that name
    """
    if kind is not None and kind not in KINDS:
        raise ValueError(f"list {printable(kind)}: {near_misses(kind, KINDS)}")
    known, notes = ours(), []
    found: dict[str, dict[str, Listed]] = {}
    for each in KINDS if kind is None else (kind,):
        things = {name: Listed(about) for name, about in known[each].items()}
        offers = offered(each, things)
        for name in names:
            if name not in things and name not in offers:
                raise ValueError(f"unknown {each[:-1]} {name!r}: {near_misses(name, [*things, *offers])}")
        chosen = {name: offer for name, offer in offers.items() if not names or name in names}
        things = {name: one for name, one in things.items() if not names or name in names}
        found[each] = dict(sorted((things | {name: _loaded(offer) for name, offer in chosen.items()}).items()))
        notes += ignored(each, known[each])
    return Listing(found, tuple(notes))


def _loaded(offer: Offer) -> Listed:
    """An entry point with the line that its own code says about it, or why it is broken."""
    what = f"entry point {offer.kind} {offer.name}"
    if what in guard.lost:
        return Listed("", offer.origin, f"the process {guard.lost[what].message} when it was imported")
    try:
        with guard.watched(what, LOADING_S + guard.GRACE_S), limited(LOADING_S):
            return Listed(printable(_ABOUT[offer.kind](offer)), offer.origin)
    except TimedOut:
        return Listed("", offer.origin, f"importing it took longer than {LOADING_S:g} s")
    except ValueError as problem:
        named, line = f"{offer.kind[:-1]} {offer.name!r}: ", str(problem)
        why = line.partition(f" of {offer.origin}: ")[2] or line.removeprefix(named)
        return Listed("", offer.origin, printable(why))


def _about_code(offer: Offer) -> str:
    maker = plugins.load_class(offer.kind[:-1], offer.name)
    text = inspect.getdoc(maker) if inspect.isclass(maker) or inspect.isfunction(maker) else None
    return (text or offer.value).partition("\n")[0]


def _about_scenario(offer: Offer) -> str:
    from scenarios.harness.registry import find

    return find(offer.name).summary


def _about_suite(offer: Offer) -> str:
    from sim.sensors.fitting import load_suite, suite_parts

    load_suite(offer.name)
    return suite_parts(offer.name)["summary"]


_ABOUT = {
    "estimators": _about_code, "autopilots": _about_code, "scenarios": _about_scenario, "suites": _about_suite,
}  # fmt: skip


def parameters(kind: str | None, specs: Sequence[str]) -> dict[str, list[Parameter]]:
    """The parameters of estimators, for ``--set``.

    specs : names, ``module:Class`` or ``file.py:Class``; every estimator that can be loaded, if none is named

    Raises
    ------
    ValueError      one line: a kind that has no parameters, no such estimator
    """
    if kind not in (None, "estimators"):
        raise ValueError(f"list {printable(kind)} --params: only estimators have parameters")
    found = {}
    for spec in specs or sorted(plugins.estimators()):
        try:
            found[spec] = estimator_parameters(spec)
        except plugins.PluginError as problem:
            if specs:
                raise
            console.error(f"left out: {problem}")
    return found


def parameters_json(found: Mapping[str, Sequence[Parameter]]) -> dict[str, Any]:
    """Plain data: estimator -> parameter -> default, unit, meaning, raised, lowered."""

    def about(parameter: Parameter) -> dict[str, Any]:
        plain = parameter._asdict()
        name, default = plain.pop("name"), plain.pop("default")
        known = default is None or isinstance(default, bool | int | str)
        finite = isinstance(default, float) and math.isfinite(default)
        return {"set": name, "default": default if known or finite else default_text(default), **plain}

    return {spec: {entry.pop("set"): entry for entry in map(about, parameters)} for spec, parameters in found.items()}


def print_parameters(found: Mapping[str, Sequence[Parameter]]) -> None:
    """A table for each estimator: name, default and unit, then what it is and what a change does."""
    for spec, params in found.items():
        rows = [[p.name, f"{default_text(p.default)} {_unit(p.unit)}".strip(), _text(p)] for p in params]
        title = f"{spec}: --set {names_of(spec)[0]}.NAME=VALUE"
        rows = rows or [["no parameters", "", ""]]
        table = console.table(title, ("", "", ""), rows, text=(0, 1, 2), wrapping=(1, 2))
        console.out().print(table)


def _unit(unit: str) -> str:
    return "" if unit in ("-", "switch", "choice") else unit


def _text(parameter: Parameter) -> str:
    up, down = ("on", "off") if parameter.unit == "switch" else ("higher", "lower")
    effects = {up: parameter.raised, down: parameter.lowered}
    return "; ".join([parameter.meaning, *(f"{way}: {text}" for way, text in effects.items() if text)]).strip("; ")


_noted: set[tuple[str, str]] = set()


def note_ignored(scenario: str, config: "FlightConfig") -> None:
    """Say, once each, which entry points have the name of something of wingslevel that flies, and are ignored."""
    from scenarios.harness.registry import registered
    from sim.sensors.fitting import SUITES

    for kind, known, name in (
        ("scenarios", registered(), scenario),
        ("estimators", plugins.OURS["estimators"], config.estimator),
        ("autopilots", plugins.OURS["autopilots"], config.autopilot),
        ("suites", SUITES, config.suite),
    ):
        if (kind, name) not in _noted:
            _noted.add((kind, name))
            for line in ignored(kind, known, name):
                console.note(line)


def print_listing(listing: Listing) -> None:
    """A table for each kind, then one for each package that offers some of it; then the notes."""
    for kind, things in listing.kinds.items():
        for origin in sorted({one.origin for one in things.values()}, key=lambda origin: (origin != OURS, origin)):
            lines = {name: one.about for name, one in things.items() if one.origin == origin and not one.broken}
            lines |= {n: f"broken: {one.broken}" for n, one in things.items() if one.origin == origin and one.broken}
            title = kind if origin == OURS else f"{kind} of {origin}"
            console.out().print(console.name_table(title, lines))
    for note in listing.notes:
        console.line(f"note        {note}", "yellow")


def run(kind: str | None, names: Sequence[str], *, params: bool, json_: str | None) -> None:
    """Do what the command line asks for."""
    with reporting(json_) as report:
        if params:
            with usage():
                about = parameters(kind, names)
            report({"estimators": parameters_json(about)})
            print_parameters(about)
            return
        with usage():
            found = listing(kind, names)
        report(found.to_json())
        print_listing(found)
