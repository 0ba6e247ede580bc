"""The launch point: one place on earth, from which the local north-east-down frame `e` hangs."""

from typing import Final

LATITUDE_DEG: Final = 42.80
LONGITUDE_DEG: Final = -73.95
ELEVATION_M: Final = 0.0  # above the sea; JSBSim's ground lies there
YEAR: Final = 2026.5  # of the flight, for the magnetic field, which changes
