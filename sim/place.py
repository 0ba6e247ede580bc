"""The launch place, and the ground around it.

The launch point is the origin of the frame `e`, whose axes north, east and down are the local ones wherever the
aeroplane is. The position `p_e_m` is the integral of the velocity `v_e_m_s`: ``dp_e / dt = v_e`` at any distance, and
minus down is the height above the ellipsoid less that of the launch point. `Place.geodetic` and `Place.local` convert
to latitude and longitude and back by the metres per degree at the launch point, as users of a receiver do. Gravity,
the earth's rate and its magnetic field are those of the launch point.

The simulated sea is the WGS 84 ellipsoid: heights above both are equal.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LATITUDE_DEG: Final = 42.80
LONGITUDE_DEG: Final = -73.95
ELEVATION_M: Final = 0.0  # above the sea
YEAR: Final = 2026.5  # of the flight, for the magnetic field and the receiver's clock

HIGHEST_LATITUDE_DEG: Final = 89.0  # beyond, north and east turn within the flight box
LOWEST_M, HIGHEST_M = -430.0, 4000.0  # elevations: the shore of the Dead Sea, and the highest place tested
MOST_GROUND_M: Final = 500.0
GROUND_SLOPE: Final = 3.0  # metres out per metre of height, of the slope between the two levels
MAJOR_AXIS_M: Final = 6378137.0  # WGS 84
ECCENTRICITY2: Final = 6.69437999014e-3

Array = NDArray[np.float64]


def metres_per_degree(latitude_deg: float = LATITUDE_DEG, height_m: float = 0.0) -> tuple[float, float]:
    """Metres per degree of latitude and per degree of longitude, `height_m` above the WGS 84 ellipsoid.

    From its radii of curvature, M = a (1 - e^2) / (1 - e^2 sin^2)^(3/2) along the meridian and
    N = a / (1 - e^2 sin^2)^(1/2) across it.
    """
    latitude_rad = math.radians(latitude_deg)
    w2 = 1.0 - ECCENTRICITY2 * math.sin(latitude_rad) ** 2
    meridian_m, normal_m = MAJOR_AXIS_M * (1.0 - ECCENTRICITY2) / w2**1.5, MAJOR_AXIS_M / math.sqrt(w2)
    around_m = (normal_m + height_m) * math.cos(latitude_rad)
    return math.radians(meridian_m + height_m), max(math.radians(around_m), 1.0)  # at the poles a degree has no length


@dataclass(frozen=True, slots=True)
class Place:
    """A launch place.

    latitude_deg, longitude_deg : geodetic, WGS 84       elevation_m : of the launch point above the sea
    ground_m : height of the ground far from the launch point, relative to it
    ground_from_m : distance from the launch point up to which the ground is level with it; from there a slope of 1 in 3
        leads to `ground_m`
    """

    latitude_deg: float = LATITUDE_DEG
    longitude_deg: float = LONGITUDE_DEG
    elevation_m: float = ELEVATION_M
    ground_m: float = 0.0
    ground_from_m: float = 0.0

    @property
    def latitude_rad(self) -> float:
        return math.radians(self.latitude_deg)

    def ground_at_m(self, north_m: float, east_m: float) -> float:
        """Height of the ground relative to the launch point."""
        if not self.ground_m:
            return 0.0
        out_m = math.hypot(north_m, east_m) - self.ground_from_m
        return self.ground_m * min(max(out_m / (GROUND_SLOPE * abs(self.ground_m)), 0.0), 1.0)

    def geodetic(self, p_e_m: Array) -> Array:
        """Latitude, longitude (deg, -180..180) and height above the sea (m) of positions of shape (n, 3)."""
        return geodetic(p_e_m, self.latitude_deg, self.longitude_deg, self.elevation_m)

    def local(self, latitude_deg: Any, longitude_deg: Any, height_m: Any) -> Array:
        """The inverse of `geodetic`: positions, shape (n, 3)."""
        return local(latitude_deg, longitude_deg, height_m, self.latitude_deg, self.longitude_deg, self.elevation_m)


def geodetic(p_e_m: Array, latitude_deg: float, longitude_deg: float, height_m: float) -> Array:
    """Latitude, longitude (deg) and height of positions relative to an origin, see the module; shape (n, 3)."""
    north_m, east_m = metres_per_degree(latitude_deg, height_m)
    p_e_m = np.asarray(p_e_m, float)
    return np.stack(
        [
            latitude_deg + p_e_m[..., 0] / north_m,
            wrapped_deg(longitude_deg + p_e_m[..., 1] / east_m),
            height_m - p_e_m[..., 2],
        ],
        axis=-1,
    )


def local(
    latitudes_deg: Any, longitudes_deg: Any, heights_m: Any, latitude_deg: float, longitude_deg: float, height_m: float
) -> Array:
    """The inverse of `geodetic`: north, east and down from an origin, the shorter way over the date line."""
    north_m, east_m = metres_per_degree(latitude_deg, height_m)
    north = north_m * (np.asarray(latitudes_deg, float) - latitude_deg)
    east = east_m * wrapped_deg(np.asarray(longitudes_deg, float) - longitude_deg)
    return np.stack(np.broadcast_arrays(north, east, height_m - np.asarray(heights_m, float)), axis=-1)


def wrapped_deg(longitude_deg: Any) -> Any:
    """An angle as -180..180 degrees; one within that range keeps its bits."""
    longitude_deg = np.asarray(longitude_deg, float)
    return np.where(np.abs(longitude_deg) > 180.0, (longitude_deg + 180.0) % 360.0 - 180.0, longitude_deg)


LAUNCH_PLACE: Final = Place()
"""Where flights start unless the configuration says otherwise."""
