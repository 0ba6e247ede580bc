"""What is refused before anything is flown or written: names and values that cannot be, each in one line."""

from collections.abc import Mapping
from typing import Any

from scenarios.harness.aboard import flight_code
from scenarios.harness.catalogue import aircraft
from scenarios.harness.config import FlightConfig, override, resolve
from scenarios.harness.plugins import near_misses
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario


def prepared(name: str, changes: Mapping[str, Any]) -> tuple[Scenario, FlightConfig]:
    """The scenario `name` and its configuration with `changes`, resolved; everything that they name is there.

    Raises
    ------
    ValueError      one line: what is wrong, and what would be right
    """
    scenario = find(name)
    config = resolve(override(scenario.config, changes))
    if config.aircraft not in aircraft():
        raise ValueError(f"unknown aircraft {config.aircraft!r}: {near_misses(config.aircraft, aircraft())}")
    flight_code(config)
    return scenario, config
