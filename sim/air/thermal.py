"""Thermals: the updraft model of Allen, NASA/TM-2006-214019 ("Updraft Model for Development of Autonomous Soaring
Uninhabited Air Vehicles", 2006), equations 11 to 23.

Each thermal is a fixed column of rising air, stronger and wider with height up to the inversion; the sink between
the columns balances their mass flow.  The nearest column determines the updraft.

In two places the printed equations contradict the code in the appendix, which produced the report's figures and fits
its trapezoid; this follows the code: the shape is k1 |r / r2 + k3| to the power of k2, and k4 is the column of -0.195
to -0.0033.  Steps in that code (between rows of constants, and at r1 where the sink begins) are smoothed: constants
are interpolated and the sink is blended in from the centre.
"""

import math
from dataclasses import dataclass

import numpy as np

from estimator.compiler.jit import kernel

MOST = 20  # thermals in one flight
# Shape constants by r1 / r2: k1, k2, k3, k4 (appendix B).
RATIOS = np.array([0.14, 0.25, 0.36, 0.47, 0.58, 0.69, 0.80])
SHAPES = np.array(
    [
        [1.5352, 2.5826, -0.0113, -0.1950],
        [1.5265, 3.6054, -0.0176, -0.1265],
        [1.4866, 4.8356, -0.0320, -0.0818],
        [1.2042, 7.7904, 0.0848, -0.0445],
        [0.8816, 13.9720, 0.3404, -0.0216],
        [0.7067, 23.9940, 0.5689, -0.0099],
        [0.6189, 42.7965, 0.7157, -0.0033],
    ]
)
SPACING_HEIGHT = 0.4  # of the inversion: at which the report counts thermals per area
WIDEST = 0.0765  # largest outer radius over the inversion height: 0.102 x^(1/3) (1 - x / 4), at x = 1


@dataclass(frozen=True, slots=True)
class Thermals:
    """The thermals of one flight.

    places_e_m : (north, east) of each column from the launch point
    strength_m_s : the convective velocity scale w*; monthly means 1.3 m/s in December, 2.7 in July
    inversion_m : height of the inversion z_i above the ground; 440 m in December, 1975 m in July
    """

    places_e_m: tuple[tuple[float, float], ...] = ()
    strength_m_s: float = 2.0
    inversion_m: float = 1200.0

    def __post_init__(self) -> None:
        if len(self.places_e_m) > MOST or not all(len(p) == 2 and math.isfinite(sum(p)) for p in self.places_e_m):
            raise ValueError(f"places_e_m = {self.places_e_m}: give at most {MOST} pairs (north, east) in m")
        if not 0.0 <= self.strength_m_s <= 10.0:
            raise ValueError(f"strength_m_s = {self.strength_m_s} m/s: choose 0 to 10 m/s")
        if not 100.0 <= self.inversion_m <= 10_000.0:
            raise ValueError(f"inversion_m = {self.inversion_m} m: choose 100 to 10000 m")

    @property
    def area_m2(self) -> float:
        """Ground area over which the mass flow balances."""
        return area_of(len(self.places_e_m), self.inversion_m)


def area_of(number: int, inversion_m: float) -> float:
    """Ground area of `number` thermals [m2]: N = 0.6 X Y / (z_i r2) (equation 20)."""
    return number * inversion_m * float(radius_m(SPACING_HEIGHT * inversion_m, inversion_m)) / 0.6


def place(number: int, inversion_m: float, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Positions (north, east) of `number` thermals, uniform in a square around the launch point, not overlapping."""
    half_m = 0.5 * math.sqrt(area_of(number, inversion_m))
    places: list[tuple[float, float]] = []
    while len(places) < number:
        north_m, east_m = (float(x) for x in rng.uniform(-half_m, half_m, 2))
        if all(math.hypot(north_m - n, east_m - e) >= 2.0 * WIDEST * inversion_m for n, e in places):
            places.append((north_m, east_m))
    return tuple(places)


@kernel
def radius_m(height_m, inversion_m):  # type: ignore[no-untyped-def]
    """Outer radius r2 of an updraft (equation 12)."""
    x = height_m / inversion_m
    return max(10.0, 0.102 * x ** (1.0 / 3.0) * (1.0 - 0.25 * x) * inversion_m)


@kernel
def mean_updraft_m_s(height_m, inversion_m, strength_m_s):  # type: ignore[no-untyped-def]
    """Mean velocity of the rising air within r2 (equation 11), zero from 10/11 of the inversion upwards."""
    x = height_m / inversion_m
    return max(0.0, strength_m_s * x ** (1.0 / 3.0) * (1.0 - 1.1 * x))


@kernel
def bell(r, ratio):  # type: ignore[no-untyped-def]
    """Updraft at `r` outer radii over that at the centre, for r1 / r2 = `ratio` (equation 16)."""
    last = RATIOS.shape[0] - 2
    at = min(max((ratio - RATIOS[0]) / (RATIOS[1] - RATIOS[0]), 0.0), last + 1.0)  # evenly spaced
    i = min(int(at), last)
    part = at - i
    k1 = (1.0 - part) * SHAPES[i, 0] + part * SHAPES[i + 1, 0]
    k2 = (1.0 - part) * SHAPES[i, 1] + part * SHAPES[i + 1, 1]
    k3 = (1.0 - part) * SHAPES[i, 2] + part * SHAPES[i + 1, 2]
    k4 = (1.0 - part) * SHAPES[i, 3] + part * SHAPES[i + 1, 3]
    return max(0.0, 1.0 / (1.0 + (k1 * abs(r + k3)) ** k2) + k4 * r)


@kernel
def updraft_m_s(north_m, east_m, height_m, places, strength_m_s, inversion_m, area_m2):  # type: ignore[no-untyped-def]
    """Upward velocity of the air; `places` has a row (north, east) per thermal."""
    mean = mean_updraft_m_s(max(height_m, 0.0), inversion_m, strength_m_s)
    if mean == 0.0 or places.shape[0] == 0:
        return 0.0
    nearest2 = np.inf
    for i in range(places.shape[0]):
        nearest2 = min(nearest2, (north_m - places[i, 0]) ** 2 + (east_m - places[i, 1]) ** 2)
    x, r2 = height_m / inversion_m, radius_m(height_m, inversion_m)
    ratio = min(0.0011 * r2 + 0.14, 0.8)  # equation 13
    peak = 3.0 * mean * (1.0 - ratio) / (1.0 - ratio**3)  # so that the trapezoid's mean is `mean`
    r = np.sqrt(nearest2) / r2
    edge_share = 2.5 * (x - 0.5) if 0.5 < x <= 0.9 else 0.0  # share of the sink around the column, equation 18
    edge = edge_share * min(0.0, np.pi / 6.0 * np.sin(np.pi * r)) if ratio < r < 2.0 else 0.0  # equation 17
    columns_m2 = places.shape[0] * np.pi * r2 * r2
    sink = -columns_m2 * mean * (1.0 - edge_share) / (area_m2 - columns_m2)  # equation 21
    within = bell(r, ratio)
    return within * peak + edge * mean + (1.0 - within) * sink  # equation 23
