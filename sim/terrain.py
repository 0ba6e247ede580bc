"""Kernels of the launch place: motion over the ellipsoid, and the height of the ground."""

import math

from estimator.compiler.jit import kernel
from sim.place import ECCENTRICITY2, GROUND_SLOPE, MAJOR_AXIS_M


@kernel
def moved_m(latitude_rad, by_latitude_rad, by_longitude_rad, height_m):  # type: ignore[no-untyped-def]
    """North and east, m, of a small motion on the WGS 84 ellipsoid, `height_m` above it; latitude is the middle one.

    The radii of curvature are those of `sim.place.metres_per_degree`.  The longitude may jump at the date line.
    """
    w2 = 1.0 - ECCENTRICITY2 * math.sin(latitude_rad) ** 2
    w = math.sqrt(w2)
    meridian_m, normal_m = MAJOR_AXIS_M * (1.0 - ECCENTRICITY2) / (w2 * w), MAJOR_AXIS_M / w
    if abs(by_longitude_rad) > math.pi:
        by_longitude_rad -= math.copysign(2.0 * math.pi, by_longitude_rad)
    return (meridian_m + height_m) * by_latitude_rad, (normal_m + height_m) * math.cos(latitude_rad) * by_longitude_rad


@kernel
def ground_height_m(north_m, east_m, ground_m, from_m):  # type: ignore[no-untyped-def]
    """Height of the ground relative to the launch point, as `sim.place.Place.ground_at_m`."""
    if ground_m == 0.0:
        return 0.0
    out_m = math.sqrt(north_m * north_m + east_m * east_m) - from_m
    return ground_m * min(max(out_m / (GROUND_SLOPE * abs(ground_m)), 0.0), 1.0)
