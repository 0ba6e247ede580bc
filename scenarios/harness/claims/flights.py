"""The flights of claims, each flown once in a process: several claims look at the same ones.

The logs handed out are read-only, for they are shared.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from scenarios.harness.flight import fly_scenario
from scenarios.harness.plugins import Maker
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario
from sim.log import Flight, Outcome

KEPT = 64  # flights: of a minute each, 150 MB
NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What decides a flight: two that are equal are the same flight.  A scenario of one's own counts by identity."""

    scenario: str | int
    changes: str
    seed: int
    estimator: str | Maker | None
    made_of: tuple[Scenario, Mapping[str, Any]] = field(compare=False)


def flights(
    scenario: str | Scenario,
    seeds: Sequence[int],
    changes: Mapping[str, Any] = NOTHING,
    estimator: str | Maker | None = None,
) -> list[Flight]:
    """Fly `scenario` once on each of `seeds`, or remember that it was.

    Parameters
    ----------
    scenario    a name, or one of one's own that is made once, at the head of a module
    changes     fields of the configuration by dotted names, see `config.override`
    estimator   as `fly_scenario` takes it; None is the scenario's own

    Raises
    ------
    ValueError          as `fly_scenario` does      KeyboardInterrupt   Ctrl-C ended a flight
    """
    flown = find(scenario) if isinstance(scenario, str) else scenario
    key = scenario if isinstance(scenario, str) else id(scenario)
    told = json.dumps(dict(changes), sort_keys=True, default=str)
    return [_fly(_Wanted(key, told, seed, estimator, (flown, changes))) for seed in seeds]


@lru_cache(maxsize=KEPT)
def _fly(wanted: _Wanted) -> Flight:
    scenario, changes = wanted.made_of
    flight = fly_scenario(scenario, changes, seed=wanted.seed, estimator=wanted.estimator)
    if flight.outcome == Outcome.INTERRUPTED:
        raise KeyboardInterrupt  # nothing is concluded from half a flight
    for rows in (flight.log.truth, flight.log.measured, flight.log.flown):
        rows.flags.writeable = False
    return flight
