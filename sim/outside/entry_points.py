"""Entry points of installed packages, found without importing them.

    [project.entry-points."wingslevel.estimators"]
    my_filter = "my_package.filters:MyFilter"

The groups are ``wingslevel.estimators``, ``.autopilots``, ``.scenarios`` and ``.suites``.  Names already used by
wingslevel or by an earlier package are ignored; `ignored` lists them.
"""

import importlib
from collections.abc import Container, Iterator
from importlib.metadata import EntryPoint, distributions, entry_points
from pathlib import Path
from typing import Any, NamedTuple

from sim.outside.blame import Refused, shown
from sim.outside.wording import printable

OURS = "wingslevel"


class Offer(NamedTuple):
    """One entry point.

    kind : "estimators", "autopilots", "scenarios" or "suites"      value : its target, ``package.module:Name``
    origin : distribution and version, ``my_package 1.2``
    """

    kind: str
    name: str
    value: str
    origin: str

    @property
    def module(self) -> str:
        """The module of the target."""
        return self.value.partition(":")[0].strip()

    @property
    def package(self) -> str:
        """The top-level package of the module, which contains the user code."""
        return self.module.partition(".")[0]

    def load(self) -> Any:
        """Import the target, a module or its attribute; may raise any exception of the user code."""
        point = EntryPoint(self.name, self.value, f"{OURS}.{self.kind}")
        if not point.pattern.match(self.value):
            raise Refused(f"{shown(self.value)} must be package.module:Name")
        return point.load()

    def resource(self) -> Path | None:
        """The file of a target ``package:file.toml``; None for a Python object."""
        _, _, name = (part.strip() for part in self.value.partition(":"))
        if not name.endswith(".toml"):
            return None
        return _folder(importlib.import_module(self.module)) / name


def offered(kind: str, ours: Container[str]) -> dict[str, Offer]:
    """Entry points of a kind, by name, without the names in `ours`."""
    found: dict[str, Offer] = {}
    for offer in _offers(kind):
        if offer.name not in ours:
            found.setdefault(offer.name, offer)
    return found


def ignored(kind: str, ours: Container[str], name: str | None = None) -> list[str]:
    """A line for each entry point (of that `name`) that is ignored because its name is taken."""
    lines: list[str] = []
    first: dict[str, Offer] = {}
    for offer in _offers(kind):
        if name is not None and offer.name != name:
            continue
        owner = OURS if offer.name in ours else first.setdefault(offer.name, offer).origin
        if first.get(offer.name) is not offer:
            what = f"{kind[:-1]} {printable(offer.name)} of {offer.origin}"
            lines.append(f"{what} is ignored: {owner} has one of that name")
    return lines


def _offers(kind: str) -> Iterator[Offer]:
    """Every entry point of a kind, in order of name and distribution."""
    points = sorted(_points(f"{OURS}.{kind}"), key=lambda point: (point.name, _origin(point), point.value))
    for point in points:
        yield Offer(kind, point.name, point.value, _origin(point))


def _points(group: str) -> list[EntryPoint]:
    try:
        return list(entry_points(group=group))
    except Exception:  # damaged metadata of one package must not hide the others
        return [point for each in _readable() for point in each if point.group == group]


def _readable() -> Iterator[list[EntryPoint]]:
    for distribution in distributions():
        try:
            yield list(distribution.entry_points)
        except Exception:  # damaged metadata
            continue


def _origin(point: EntryPoint) -> str:
    try:
        return printable(f"{point.dist.name} {point.dist.version}") if point.dist else "an installed package"
    except Exception:  # damaged metadata
        return "an installed package"


def _folder(package: Any) -> Path:
    """Folder of an imported package, or of the file of a module."""
    places = list(getattr(package, "__path__", ())) or [Path(package.__file__).parent]
    return Path(places[0])
