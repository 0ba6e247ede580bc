"""A calibration turn-table: a full circle about each body axis, that axis held level across the magnetic field.

The other two axes then pass exactly along and against the field, as when Dilshad and Jahan (2014) turn their
magnetometer "in a circle for each of the three axes".  A quarter turn between circles brings the next axis across
the field.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from estimator.interface import Array
from estimator.rotation import from_euler
from sim.log import Phase
from sim.motion.prescribed_plant import Kinematics

# Body axis and angle of each turn; the axes x, y, z start north, east, down (magnetic).
_PARTS = ((1, 2.0 * math.pi), (2, 0.5 * math.pi), (0, 2.0 * math.pi), (1, 0.5 * math.pi), (2, 2.0 * math.pi))


@dataclass(frozen=True, slots=True)
class TurnTable:
    """Circles about y, x and z, each from rest to rest, with quarter turns between them; then at rest.

    heading_rad : initial heading of the x axis; equal to the magnetic declination, turn axes lie across the field
    circle_s : duration of a circle      quarter_s : duration of a quarter turn
    """

    heading_rad: float = 0.0
    circle_s: float = 20.0
    quarter_s: float = 5.0
    height_m: float = 1.0
    phase: ClassVar[Phase] = Phase.HELD

    def __post_init__(self) -> None:
        for name in ("circle_s", "quarter_s"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"TurnTable.{name} = {value!r} s: choose a finite time above 0 s")

    @property
    def duration_s(self) -> float:
        """Time until all three circles are complete."""
        return 3.0 * self.circle_s + 2.0 * self.quarter_s

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        still = np.zeros((len(t_s), 3))
        omega_b = still.copy()
        R_eb = from_euler(0.0, 0.0, self.heading_rad + 0.0 * t_s)
        start_s = 0.0
        for axis, angle_rad in _PARTS:
            lasts_s = self.circle_s if angle_rad > math.pi else self.quarter_s
            gone = np.clip((t_s - start_s) / lasts_s, 0.0, 1.0)
            # From rest to rest: the rate is a raised cosine.
            turned_rad = angle_rad * (gone - np.sin(2.0 * np.pi * gone) / (2.0 * np.pi))
            omega_b[:, axis] += angle_rad / lasts_s * (1.0 - np.cos(2.0 * np.pi * gone))
            euler = [0.0 * t_s] * 3
            euler[axis] = turned_rad
            R_eb = R_eb @ from_euler(*euler)
            start_s += lasts_s
        return Kinematics(R_eb, omega_b, still - np.array([0.0, 0.0, self.height_m]), still, still)
