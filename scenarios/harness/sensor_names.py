"""The sensor parts and suites that can be named, their list, and what a page is about.

A name is matched loosely: ``ITG-3200`` is ``itg3200``.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from scenarios.harness import console
from scenarios.harness.sensor_page import Subject
from sim.sensors.datasheet import KINDS, Part, load_part, part_names
from sim.sensors.fitting import load_suite, suite_members, suite_names, suite_summary

BUILT_IN = ("generic", "perfect")


def subject(name: str) -> Subject:
    """What the page of `name` is about: a suite, a part, or a part's file.

    Raises
    ------
    ValueError      one line: nothing of that name, with what comes near, or what is wrong in the file
    """
    suite = _loose(name)
    return _suite(suite) if suite is not None else _part(load_part(name))


def _loose(name: str) -> str | None:
    """The suite that `name` means, None where it means none."""
    plain = {_plain(suite): suite for suite in suite_names()}
    return plain.get(_plain(name))


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _part(part: Part) -> Subject:
    about = f"{part.maker}, {part.summary}" if part.sources else part.summary
    datasheet = part.datasheet if part.sources else ""
    return Subject(part.name, about, datasheet, MappingProxyType({}), part.devices, part.sources)


def _suite(name: str) -> Subject:
    fitted = load_suite(name)
    devices = {kind: getattr(fitted, kind) for kind in KINDS if getattr(fitted, kind) is not None}
    return Subject(name, suite_summary(name), "", suite_members(name), devices, MappingProxyType({}))


def to_json() -> dict[str, Any]:
    """Everything there is: parts with what is in them, suites with their members."""
    return {
        "parts": {name: _part_json(load_part(name)) for name in part_names()},
        "suites": {name: {"about": suite_summary(name)} | dict(suite_members(name)) for name in suite_names()},
    }


def _part_json(part: Part) -> dict[str, Any]:
    about = {"name": part.name, "maker": part.maker, "about": part.summary, "datasheet": part.datasheet}
    return about | {"sensors": list(part.devices)}


def tell() -> None:
    """Print the list."""
    out = console.out()
    rows = []
    for name in part_names():
        part = load_part(name)
        rows.append([name, ", ".join(_word(kind) for kind in part.devices), f"{part.maker}, {part.summary}"])
    out.print(console.table("Parts", ("", "", ""), rows, text=(0, 1, 2), wrapping=(1, 2)))
    kinds = [kind for kind in KINDS if any(kind in suite_members(name) for name in suite_names())]
    rows = [[name, *_cells(suite_members(name), kinds)] for name in suite_names()]
    headings = ("", *(_word(kind) for kind in kinds))
    out.print(console.table("Suites", headings, rows, text=range(len(headings)), wrapping=range(1, len(headings))))


def _cells(members: Mapping[str, str], kinds: list[str]) -> list[str]:
    return [members.get(kind, "-") for kind in kinds]


def _word(kind: str) -> str:
    return "GPS" if kind == "gps" else kind
