"""The launch point: the origin of the local north-east-down frame `e`."""

import math
from typing import Final

LATITUDE_DEG: Final = 42.80
LONGITUDE_DEG: Final = -73.95
ELEVATION_M: Final = 0.0  # above the sea, as the ground in JSBSim
YEAR: Final = 2026.5  # of the flight, for the magnetic field and the receiver's clock

_MAJOR_AXIS_M: Final = 6378137.0  # WGS 84
_ECCENTRICITY2: Final = 6.69437999014e-3


def metres_per_degree(latitude_deg: float = LATITUDE_DEG) -> tuple[float, float]:
    """Metres per degree of latitude and per degree of longitude on the WGS 84 ellipsoid.

    From its radii of curvature, M = a (1 - e^2) / (1 - e^2 sin^2)^(3/2) along the meridian and
    N = a / (1 - e^2 sin^2)^(1/2) across it.
    """
    latitude_rad = math.radians(latitude_deg)
    w2 = 1.0 - _ECCENTRICITY2 * math.sin(latitude_rad) ** 2
    meridian_m, normal_m = _MAJOR_AXIS_M * (1.0 - _ECCENTRICITY2) / w2**1.5, _MAJOR_AXIS_M / math.sqrt(w2)
    return math.radians(meridian_m), math.radians(normal_m * math.cos(latitude_rad))
