"""What is refused before anything is flown or written: names and values that cannot be, each in one line."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from scenarios.harness.aboard import flight_code, require_heard, unheard
from scenarios.harness.commands.catalogue import aircraft
from scenarios.harness.config import FlightConfig, override, resolve
from scenarios.harness.gate import guard
from scenarios.harness.plugins import near_misses
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario
from sim.outside.signals import TimedOut, limited

_PREPARING = "what is flown"
_LOADING = "while it was loaded, before anything was flown or written"


@contextmanager
def in_time(limit_s: float | None) -> Iterator[None]:
    """Refuse flight code and scenario files that take longer than `limit_s` to be loaded and constructed.

    Raises
    ------
    ValueError      one line, also where they ended the process
    """
    if _PREPARING in guard.lost:
        raise ValueError(f"flight code or a scenario file: the process {guard.lost[_PREPARING].message} {_LOADING}")
    try:
        with guard.watched(_PREPARING, None if limit_s is None else limit_s + guard.GRACE_S), limited(limit_s):
            yield
    except TimedOut:
        raise ValueError(f"flight code or a scenario file: took longer than {limit_s:g} s {_LOADING}") from None


def prepared(name: str, changes: Mapping[str, Any], *, lenient: bool = False) -> tuple[Scenario, FlightConfig]:
    """The scenario `name` and its configuration with `changes`, resolved; everything that they name is there.

    lenient : accept a property of the instruments that is set and that no flight code has a parameter for

    Raises
    ------
    ValueError      one line: what is wrong, and what would be right
    """
    scenario = find(name)
    config = resolve(override(scenario.config, changes))
    if config.aircraft not in aircraft():
        raise ValueError(f"unknown aircraft {config.aircraft!r}: {near_misses(config.aircraft, aircraft())}")
    code = flight_code(config)
    if not lenient:
        require_heard(config, code)
    scenario.scripted(config)
    return scenario, config


def unheard_settings(config: FlightConfig) -> list[str]:
    """Properties of the instruments that are set under the resolved `config` and that no flight code is given."""
    return unheard(config, flight_code(config))
