"""Discrete gusts of the 1-cosine shape (MIL-F-8785C, section 3.7).

The gust of the standard rises to its peak as (1 - cos) / 2; here it also falls the same way (as in 14 CFR 25.341):

    V(t) = V_peak / 2 (1 - cos(2 pi (t - t_start) / T))     for t_start <= t <= t_start + T, else 0

At the airspeed V the gust length d_m of the standard is T V / 2.
"""

import math
from dataclasses import dataclass

from estimator.compiler.jit import kernel

STRONGEST_M_S = 30.0


@dataclass(frozen=True, slots=True)
class Gust:
    """One gust.

    peak_e_m_s : (north, east, down)   velocity of the air added at the peak
    start_s : since the release        length_s : from calm to calm, > 0
    """

    peak_e_m_s: tuple[float, float, float]
    start_s: float
    length_s: float

    def __post_init__(self) -> None:
        if len(self.peak_e_m_s) != 3 or not math.hypot(*self.peak_e_m_s) <= math.sqrt(3.0) * STRONGEST_M_S:
            raise ValueError(
                f"gust of {self.peak_e_m_s} m/s: give three numbers (north, east, down) within +-{STRONGEST_M_S:g} m/s"
            )
        if not math.isfinite(self.start_s):
            raise ValueError(f"gust start_s = {self.start_s} s: give the finite time since the release")
        if not 0.0 < self.length_s < math.inf:
            raise ValueError(f"gust length_s = {self.length_s} s: must be above 0 s")


@kernel
def add_gusts(t_s, gusts, wind_e):  # type: ignore[no-untyped-def]
    """Add the gusts at `t_s` since the release to `wind_e`, shape (3,); rows of `gusts`: peak (3), start, length."""
    for i in range(gusts.shape[0]):
        part = (t_s - gusts[i, 3]) / gusts[i, 4]
        if 0.0 < part < 1.0:
            share = 0.5 * (1.0 - math.cos(2.0 * math.pi * part))
            for j in range(3):
                wind_e[j] += share * gusts[i, j]
