"""What the claims share that are flown: estimators by their parameters, errors with a sign, values pooled."""

import math
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.rotation import heading_rad
from scenarios.harness.metrics import SeriesOf, bank_size_deg, end, rms
from scenarios.harness.metrics.manoeuvres import RollOut, roll_outs
from sim.log import Flight

TURNING_DEG = 20.0  # bank beyond which an aeroplane is said to turn


def tuned(**params: Any) -> dict[str, Any]:
    """Changes of a configuration that set fields of its estimator's parameters."""
    return {f"estimator_params.{name}": value for name, value in params.items()}


_NEVER = 1e9
# `premerlani` with what the paper's equations have and nothing else; it names the lag filter, but for later.
PUBLISHED: Mapping[str, Any] = MappingProxyType(
    {
        "gps_lag_filter": False,
        "rotate_history": False,
        "launch_gate": _NEVER,
        "integrate_below_rad_s": _NEVER,
        "use_airspeed": False,
        "force_full_scale_m_s2": _NEVER,
    }
)


def course_rad(flight: Flight) -> Array:
    """True course over ground, shape (n,)."""
    v_e = flight.log.truth["v_e_m_s"]
    return np.arctan2(v_e[:, 1], v_e[:, 0])


def course_error_deg(flight: Flight) -> Array:
    """Estimated heading less the true course, -180..180 degrees, shape (n,)."""
    return np.degrees(wrap(heading_rad(flight.log.flown["R_eb"]) - course_rad(flight)))


def crab_deg(flight: Flight) -> Array:
    """True nose less the true course, -180..180 degrees, shape (n,)."""
    return np.degrees(wrap(heading_rad(flight.log.truth["R_eb"]) - course_rad(flight)))


def pooled_rms(flown: Sequence[Flight], series: SeriesOf, from_s: float, to_s: float = math.inf) -> float:
    """RMS of `series` between two times over all the flights, each for as long as it lasted; NaN if none did."""
    return rms(np.concatenate([series(flight).within(from_s, to_s).judged_values for flight in flown]))


def rms_in_turns(flown: Sequence[Flight], series: SeriesOf, from_s: float) -> float:
    """The same where the true bank was more than 20 degrees, to the end."""
    parts = []
    for flight in flown:
        turning = bank_size_deg(flight).within(from_s, math.inf).value > TURNING_DEG
        errors = series(flight).within(from_s, math.inf)
        parts.append(errors.value[turning & errors.judged])
    return rms(np.concatenate(parts))


def roll_outs_after(flight: Flight, from_s: float, watched_s: float = 0.0) -> list[RollOut]:
    """Roll-outs after `from_s` that are followed by at least `watched_s` before the next turn or the planned end."""
    found = [r for r in roll_outs(flight) if r.t_s > from_s]
    return [r for r in found if min(r.until_s, end(flight)) - r.t_s >= watched_s]


def slowest(times_s: Iterable[float]) -> float:
    """The longest of some times; NaN if one never came or there are none."""
    times = list(times_s)
    return max(times) if times and not any(map(math.isnan, times)) else math.nan


def median(times_s: Iterable[float]) -> float:
    """The middle one of some times, of which one that never came counts as the longest; infinite if most never came."""
    return float(np.median([math.inf if math.isnan(t) else t for t in times_s]))
