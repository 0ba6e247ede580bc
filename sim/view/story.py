"""The summary of a flight in Markdown: what was flown, how it ended, and its verdict."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from sim.log import Flight
from sim.outside.wording import markdown
from sim.place import LAUNCH_PLACE, Place
from sim.rows import Row, markdown_table


def setting(manifest: Mapping[str, Any], name: str, otherwise: Any = None) -> Any:
    """Entry `name` of the manifest, or of the resolved configuration in it (``config``)."""
    value = manifest.get(name, (manifest.get("config") or {}).get(name))
    return otherwise if value is None else value


def launch_place(manifest: Mapping[str, Any]) -> Place:
    """The launch place of a flight, or the origin of a replayed log; that of older recordings was the default."""
    given = setting(manifest, "place")
    known = {f.name: getattr(LAUNCH_PLACE, f.name) for f in fields(Place)}
    if isinstance(given, Mapping):
        known |= {name: float(given[name]) for name in known if isinstance(given.get(name), int | float)}
    for name in ("latitude_deg", "longitude_deg"):
        known[name] = float(setting(manifest, f"launch_{name}", known[name]))
    return Place(**known)


def story(flight: Flight) -> str:
    """What was flown and how it ended, as Markdown."""
    manifest = flight.manifest
    names = [setting(manifest, name) for name in ("scenario", "aircraft", "estimator", "autopilot")]
    seed = setting(manifest, "seed")
    what = ", ".join([*(str(name) for name in names if name), *([] if seed is None else [f"seed {seed}"])])
    end_s = float(flight.log.truth["t_s"][-1]) - flight.release_s if len(flight.log) else 0.0
    how = flight.outcome.replace("_", " ").capitalize() + f" at {end_s:.1f} s"
    message = f": {markdown(flight.message)}. " if flight.message else ". "
    lines = [f"## {markdown(what)}", "", how + message + _air(manifest), ""]
    if verdict := manifest.get("verdict"):
        lines += markdown_table(map(Row.from_json, verdict))
    lines += ["", f"Heading is judged against the true {flight.heading_reference}.", ""]
    orange = setting(manifest, "reference", "the truth")  # of a replayed log: the attitude recorded in it
    lines += [f"Orange is {markdown(orange)}, blue the estimate, green a sensor, grey a demand."]
    return "\n".join(lines)


def _air(manifest: Mapping[str, Any]) -> str:
    air = setting(manifest, "air")
    if not air:
        return ""
    wind = f"Wind {air['wind_m_s']:g} m/s from {air['wind_from_deg']:.0f}°" if air["wind_m_s"] else "No wind"
    shear = f" at 10 m, shear {air['shear']:g}" if air["wind_m_s"] and air.get("shear") else ""
    rest = [f"turbulence W20 = {air['turbulence_w20_m_s']:g} m/s"] if air["turbulence_w20_m_s"] else []
    for one, things in (("gust", air.get("gusts") or ()), ("thermal", air.get("thermals") or ())):
        rest += [f"{len(things)} {one}" + ("s" if len(things) > 1 else "")] if things else []
    return ", ".join([wind + shear, *rest]) + "."
