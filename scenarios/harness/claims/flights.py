"""Flights for claims, and what is measured over several of them.

Each flight is flown once per process, because several claims look at the same ones.  Logs are shared, so read-only.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.rotation import heading_rad
from scenarios.harness.flight import fly_scenario
from scenarios.harness.metrics import SeriesOf, bank_size_deg, end, rms
from scenarios.harness.metrics.manoeuvres import RollOut, roll_outs
from scenarios.harness.plugins import Maker
from scenarios.harness.registry import find
from scenarios.harness.scenario import Scenario
from sim.log import Flight, Log, Outcome

KEPT = 64  # flights; 150 MB if each lasts a minute
TURNING_DEG = 20.0  # bank angle beyond which the aeroplane is turning
NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What determines a flight.  A `Scenario` object is identified by its identity."""

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
    """Fly `scenario` on each of `seeds`; flights already flown in this process are reused.

    Parameters
    ----------
    scenario    a name, or a scenario that is made once, at the top of a module
    changes     fields of the configuration by dotted names, see `config.override`
    estimator   as `fly_scenario` takes it; None is the scenario's own

    Raises
    ------
    ValueError          as `fly_scenario` does      KeyboardInterrupt   Ctrl-C ended a flight
    """
    flown = find(scenario) if isinstance(scenario, str) else scenario
    key = scenario if isinstance(scenario, str) else id(scenario)
    text = json.dumps(dict(changes), sort_keys=True, default=str)
    return [_fly(_Wanted(key, text, seed, estimator, (flown, changes))) for seed in seeds]


@lru_cache(maxsize=KEPT)
def _fly(wanted: _Wanted) -> Flight:
    scenario, changes = wanted.made_of
    flight = fly_scenario(scenario, changes, seed=wanted.seed, estimator=wanted.estimator)
    if flight.outcome == Outcome.INTERRUPTED:
        raise KeyboardInterrupt  # an incomplete flight proves nothing
    for rows in (flight.log.truth, flight.log.measured, flight.log.flown):
        rows.flags.writeable = False
    return flight


def clean_log(scenario: str, changes: Mapping[str, Any] = NOTHING) -> Log:
    """Log of a flight steered by the true attitude: calm air, start to the north, perfect sensors."""
    clean = {"suite": "ideal", "air.wind_m_s": 0.0, "air.turbulence_w20_m_s": 0.0, "start.heading_deg": 0.0}
    return flights(scenario, [0], {**clean, **changes}, "sim.oracle:Oracle")[0].log


def tuned(**params: Any) -> dict[str, Any]:
    """Configuration changes that set parameters of the flight's estimator."""
    return {f"estimator_params.{name}": value for name, value in params.items()}


def course_rad(flight: Flight) -> Array:
    """True course over ground, shape (n,)."""
    v_e = flight.log.truth["v_e_m_s"]
    return np.arctan2(v_e[:, 1], v_e[:, 0])


def course_error_deg(flight: Flight) -> Array:
    """Estimated heading minus true course, -180..180 degrees, shape (n,)."""
    return np.degrees(wrap(heading_rad(flight.log.flown["R_eb"]) - course_rad(flight)))


def crab_deg(flight: Flight) -> Array:
    """True heading of the nose minus true course, -180..180 degrees, shape (n,)."""
    return np.degrees(wrap(heading_rad(flight.log.truth["R_eb"]) - course_rad(flight)))


def pooled_rms(flown: Sequence[Flight], series: SeriesOf, from_s: float, to_s: float = math.inf) -> float:
    """RMS of `series` between two times over all ticks of all flights; NaN if there are none."""
    return rms(np.concatenate([series(flight).within(from_s, to_s).judged_values for flight in flown]))


def rms_of_each(flown: Sequence[Flight], series: SeriesOf) -> Array:
    """RMS of `series` in each flight, shape (number of flights,)."""
    return np.array([rms(series(flight).judged_values) for flight in flown])


def rms_in_turns(flown: Sequence[Flight], series: SeriesOf, from_s: float) -> float:
    """RMS of `series` from `from_s` to the end where the true bank exceeds 20 degrees."""
    parts = []
    for flight in flown:
        turning = bank_size_deg(flight).within(from_s, math.inf).value > TURNING_DEG
        errors = series(flight).within(from_s, math.inf)
        parts.append(errors.value[turning & errors.judged])
    return rms(np.concatenate(parts))


def percentage(flown: Sequence[Flight], is_so: Callable[[Flight], bool]) -> float:
    """Percentage of the flights for which `is_so`."""
    return 100.0 * float(np.mean([is_so(flight) for flight in flown]))


def hit_ground(flight: Flight) -> bool:
    """Whether the flight ended on the ground."""
    return flight.outcome == Outcome.GROUND_CONTACT


def roll_outs_after(flight: Flight, from_s: float, watched_s: float = 0.0) -> list[RollOut]:
    """Roll-outs after `from_s` with at least `watched_s` before the next turn or the planned end."""
    found = [r for r in roll_outs(flight) if r.t_s > from_s]
    return [r for r in found if min(r.until_s, end(flight)) - r.t_s >= watched_s]


def slowest(times_s: Iterable[float]) -> float:
    """The longest of several times; NaN if one is NaN (never reached) or there are none."""
    times = list(times_s)
    return max(times) if times and not any(map(math.isnan, times)) else math.nan


def median(times_s: Iterable[float]) -> float:
    """The median of several times; NaN (never reached) counts as infinite."""
    return float(np.median([math.inf if math.isnan(t) else t for t in times_s]))
