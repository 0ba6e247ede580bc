"""The sensor parts and suites that can be named, their list, and what a page is about.

A name is matched loosely: ``ITG-3200`` is ``itg3200``.
"""

from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from scenarios.harness.cli import console
from scenarios.harness.cli.reports import attempt, check_picture, refusal, reporting, usage
from scenarios.harness.commands import sensors
from scenarios.harness.commands.sensors import Subject
from sim.params import near_misses
from sim.sensors import trial
from sim.sensors.datasheet import KINDS, Part, load_part, part_names, read_text, read_toml
from sim.sensors.fitting import NO_FILES, SUITES, load_suite, suite_names, suite_parts, suite_settings

SHORT: Final = {
    "gyro": "gyro",
    "accelerometer": "force",
    "gps": "GPS",
    "magnetometer": "compass",
    "airspeed": "airspeed",
    "barometer": "baro",
}


def subject(name: str) -> Subject:
    """What the page of `name` is about: a suite, a part, or the file of either.

    Raises
    ------
    ValueError      one line: nothing of that name, with what comes near, or what is wrong in the file
    """
    suites = {_plain(suite): suite for suite in suite_names()}
    if _plain(name) in suites:
        return _suite(suites[_plain(name)])
    if name.endswith(".toml"):
        return _suite(name) if _is_suite(name) else _part(load_part(name))
    known = [*part_names(), *suite_names(), "perfect"]
    if _plain(name) not in map(_plain, known):
        hint = near_misses(name, known)
        raise ValueError(f"unknown part or suite {name!r}: {hint} (your own: path/to/part.toml)")
    return _part(load_part(name))


def _is_suite(path: str) -> bool:
    """Whether the file names parts, which a part's has tables for."""
    data = read_toml(path, read_text(Path(path), NO_FILES, "part"))
    return any(isinstance(data.get(kind), str) for kind in KINDS)


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _part(part: Part) -> Subject:
    about = f"{part.maker}, {part.summary}" if part.sources else part.summary
    datasheet = part.datasheet if part.sources else ""
    return Subject(part.name, about, datasheet, MappingProxyType({}), part.devices, part.sources)


def _suite(name: str) -> Subject:
    members = suite_parts(name)
    summary = members.pop("summary")
    fitted = load_suite(name)
    devices = {kind: getattr(fitted, kind) for kind in KINDS if getattr(fitted, kind) is not None}
    return Subject(name, summary, "", members, devices, MappingProxyType({}), suite_settings(name), fitted.board)


def to_json() -> dict[str, Any]:
    """Everything there is: parts with what is in them, suites with their members."""
    return {
        "parts": {name: _part_json(load_part(name)) for name in part_names()},
        "suites": {name: suite_parts(name) for name in SUITES},
    }


def _part_json(part: Part) -> dict[str, Any]:
    about = {"name": part.name, "maker": part.maker, "about": part.summary, "datasheet": part.datasheet}
    return about | {"sensors": list(part.devices)}


def print_report() -> None:
    """Print the list."""
    out = console.out()
    rows = []
    for name in part_names():
        part = load_part(name)
        rows.append([name, ", ".join(_word(kind) for kind in part.devices), f"{part.maker}, {part.summary}"])
    out.print(console.table("Parts", ("", "", ""), rows, text=(0, 1, 2), wrapping=(1, 2)))
    suites = {name: suite_parts(name) for name in SUITES}
    kinds = [kind for kind in KINDS if any(kind in members for members in suites.values())]
    rows = [[name, *(members.get(kind, "-") for kind in kinds)] for name, members in suites.items()]
    grid = console.table("Suites", ["", *(SHORT[kind] for kind in kinds)], rows, text=range(len(kinds) + 1))
    grid.padding = (0, 1, 0, 0)  # seven columns side by side on 80
    out.print(grid)


def _word(kind: str) -> str:
    return "GPS" if kind == "gps" else kind


def run(part: str | None, picture: Path | None, json_: str | None) -> None:
    """Do what the command line asks for: the list, or the page of `part`."""
    with reporting(json_) as report:
        if part is None:
            if picture is not None:
                raise refusal(f"--picture {picture}: name the part or the suite to draw")
            report(to_json())
            print_report()
            return
        with usage():
            check_picture(picture)
            about = subject(part)
            trial.check_rates(about.devices, part)
        with console.progress("lying still", "axis-hours") as advance:
            page = sensors.make(about, advance)
        if picture is not None:
            from scenarios.harness.commands import sensors_picture

            with attempt():
                sensors_picture.draw(page, picture)
        report(page.to_json())
        sensors.print_report(page)  # last: a reader who closes the pipe loses no file
