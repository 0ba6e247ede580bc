"""The air that the aeroplane flies through: a steady wind and turbulence."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Air:
    """A steady wind, the same at every height, with turbulence of MIL-F-8785C on it.

    wind_e_m_s : (north, east, down)   velocity of the air over the ground: where it blows to
    turbulence_w20_m_s : float         the wind at 20 ft that sets the strength of low-altitude turbulence, 0 is none;
                                       the standard calls 7.7 light, 15 moderate, 23 severe
    """

    wind_e_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turbulence_w20_m_s: float = 0.0

    def __post_init__(self) -> None:
        if len(self.wind_e_m_s) != 3 or not all(math.isfinite(w) and abs(w) <= 50.0 for w in self.wind_e_m_s):
            raise ValueError(f"wind {self.wind_e_m_s} m/s: give three numbers (north, east, down) within +-50 m/s")
        if not 0.0 <= self.turbulence_w20_m_s <= 50.0:
            raise ValueError(f"turbulence {self.turbulence_w20_m_s} m/s (wind at 20 ft): choose 0 to 50 m/s")


STILL = Air()
