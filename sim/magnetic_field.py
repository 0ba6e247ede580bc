"""The earth's magnetic field at a place and a date: the World Magnetic Model.

NOAA and BGS, "The US/UK World Magnetic Model for 2025-2030" (WMM2025): a spherical harmonic expansion of degree 12
with a linear change in time.  It covers the core field only, not local rocks or steel.
"""

import math
from functools import cache
from typing import Any, Final

import numpy as np

from estimator.interface import Array

FIRST_YEAR: Final = 2025.0
LAST_YEAR: Final = 2030.0
EARLIEST_YEAR: Final = 2010.0  # of the older models, for the declination of recorded flights


def require_year(owner: str, year: float) -> None:
    """Reject a date that the model does not cover: ValueError."""
    if not FIRST_YEAR <= year <= LAST_YEAR:
        raise ValueError(
            f"{owner} = {year!r} (decimal): choose {FIRST_YEAR:g} to {LAST_YEAR:g}, the world magnetic model's years"
        )


@cache
def _model(first_year: int) -> Any:
    from pygeomag import GeoMag  # not loaded by a flight without a magnetometer

    return GeoMag(base_year=first_year)


def _calculated(latitude_deg: float, longitude_deg: float, height_m: float, year: float, first_year: float) -> Any:
    """The field by the model of `first_year`; ValueError if there is no such place."""
    for name, angle_deg, most_deg in (("latitude_deg", latitude_deg, 90.0), ("longitude_deg", longitude_deg, 180.0)):
        if not abs(angle_deg) <= most_deg:
            raise ValueError(f"{name} = {angle_deg!r} deg: choose an angle from {-most_deg:g} to {most_deg:g} deg")
    return _model(int(first_year)).calculate(glat=latitude_deg, glon=longitude_deg, alt=1e-3 * height_m, time=year)


@cache
def field_e_ut(latitude_deg: float, longitude_deg: float, height_m: float, year: float) -> Array:
    """The field in north, east, down, microtesla, shape (3,), read-only.

    latitude_deg, longitude_deg : geodetic, -90..90 and -180..180      year : decimal, 2025..2030
    height_m : above the ellipsoid (or the sea: 30 m are 1 nT)

    Raises
    ------
    ValueError      no such place on earth, or a date that the model does not cover
    """
    require_year("year", year)
    if not -1e3 <= height_m <= 850e3:
        raise ValueError(f"height_m = {height_m!r} m: choose a height from -1000 to 850000 m, which the model covers")
    found = _calculated(latitude_deg, longitude_deg, height_m, year, FIRST_YEAR)
    field = 1e-3 * np.array([found.x, found.y, found.z])  # from nanotesla
    field.flags.writeable = False
    return field


@cache
def declination_rad(latitude_deg: float, longitude_deg: float, height_m: float, year: float) -> float:
    """Magnetic north from true north, positive to the east, by the model of that year; see `field_e_ut`.

    year : decimal; clipped to 2010..2030
    """
    year = min(max(year, EARLIEST_YEAR), LAST_YEAR)
    first_year = min(5.0 * (year // 5.0), FIRST_YEAR)
    return math.radians(_calculated(latitude_deg, longitude_deg, height_m, year, first_year).d)
