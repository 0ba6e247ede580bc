"""How a route of waypoints was flown, from the true motion: waypoints reached, and distance from the legs.

A waypoint is reached when the aeroplane, having reached those before it, first comes horizontally near it.
The distance from the legs is the distance from the nearer of two: the leg to the next waypoint and the one before it,
because a corner is rounded.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from autopilot.interface import Waypoint
from estimator.interface import Array
from scenarios.harness.metrics import Measured, Metric, Series, SeriesOf, time_s
from sim.log import Flight, Phase

REACHED_M = 30.0


def reached(p_e_m: Array, route: Sequence[Waypoint], near_m: float = REACHED_M) -> NDArray[np.int64]:
    """Number of waypoints reached up to each tick, counted on from round to round, shape (n,).

    Raises
    ------
    ValueError      two consecutive waypoints are so close that both are reached at one place
    """
    for w, then in zip(route, (*route[1:], *route[:1]), strict=True):
        apart_m = math.hypot(then.north_m - w.north_m, then.east_m - w.east_m)
        if apart_m <= 2.0 * near_m:
            apart = f"{tuple(w)} and {tuple(then)} m, {apart_m:g} m apart"
            raise ValueError(f"route: {apart}; the distance must be more than {2.0 * near_m:g} m")
    counts, k = np.zeros(len(p_e_m), np.int64), 0
    distances = [np.hypot(p_e_m[:, 0] - w.north_m, p_e_m[:, 1] - w.east_m) for w in route]
    while route:
        due = int(counts[-1]) if len(counts) else 0
        near = np.flatnonzero(distances[due % len(route)][k:] <= near_m)
        if not len(near):
            return counts
        k += int(near[0])
        counts[k:] = due + 1
    return counts


def _off_leg(p_e_m: Array, begin: Array, end: Array) -> tuple[Array, Array]:
    """Horizontal distance to a leg, and height missing to the straight line along it, m; each of shape (n,)."""
    way = end[:, :2] - begin[:, :2]
    length = np.maximum(np.sum(way**2, axis=1), 1e-9)
    share = np.clip(np.sum((p_e_m[:, :2] - begin[:, :2]) * way, axis=1) / length, 0.0, 1.0)
    at = begin + share[:, None] * (end - begin)
    return np.hypot(*(p_e_m[:, :2] - at[:, :2]).T), at[:, 2] + p_e_m[:, 2]


def _off_route(flight: Flight, route: Sequence[Waypoint]) -> tuple[Array, Array]:
    """Cross-track distance and height missing at the nearer leg, m, each of shape (n,)."""
    p_e_m, points = flight.log.truth["p_e_m"], np.array(route, np.float64)
    due = reached(p_e_m, route)
    ends = [points[(due + i) % len(route)] for i in (-2, -1, 0)]
    (before, low), (now, high) = (_off_leg(p_e_m, ends[i], ends[i + 1]) for i in (0, 1))
    return np.minimum(before, now), np.where(before < now, low, high)


def off_route_m(route: Sequence[Waypoint]) -> SeriesOf:
    """Horizontal distance from the legs of `route`, m."""
    return lambda flight: _judged(flight, _off_route(flight, route)[0])


def height_missing_m(route: Sequence[Waypoint]) -> SeriesOf:
    """Height of the straight line between waypoints above the aeroplane, m."""
    return lambda flight: _judged(flight, _off_route(flight, route)[1])


def waypoints_reached(route: Sequence[Waypoint], near_m: float = REACHED_M) -> Metric:
    """Metric: number of waypoints reached, in their order."""

    def metric(flight: Flight) -> Measured:
        counts = reached(flight.log.truth["p_e_m"], route, near_m)
        return Measured(float(counts[-1]) if len(counts) else math.nan)

    return metric


def _judged(flight: Flight, value: Array) -> Series:
    return Series(time_s(flight), value, flight.log.truth["phase"] == Phase.FLYING)
