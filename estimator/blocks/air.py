"""Density of the air, and the two airspeeds.

A pitot tube measures the dynamic pressure q = rho V^2 / 2, and reads the equivalent airspeed

    EAS = sqrt(2 q / rho_0) = V sqrt(rho / rho_0),        rho_0 = 1.225 kg/m3

which determines lift, stall and control.  Winds and turns need the true airspeed V: 5 % more at 1,000 m above the sea,
15 % more at 2,900 m.  The density is that of the standard atmosphere at the elevation of the launch place plus the
height above it; a day 10 K warmer than standard makes the true airspeed 1.7 % higher.

Source: ISO 2533:1975, Standard Atmosphere, Eqns 12 and 14, troposphere; geometric height counts as geopotential (0.02 %
of the density at 4,000 m).
"""

import math
from typing import Final

from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.instruments import DEEPEST_M, HIGHEST_M
from estimator.interface import G_M_S2

PRESSURE_PA: Final = 101325.0  # at sea level
TEMPERATURE_K: Final = 288.15
LAPSE_K_M: Final = 0.0065
GAS_CONSTANT_J_KG_K: Final = 287.05287
DENSITY_KG_M3: Final = PRESSURE_PA / (GAS_CONSTANT_J_KG_K * TEMPERATURE_K)  # 1.225
EXPONENT: Final = G_M_S2 / (GAS_CONSTANT_J_KG_K * LAPSE_K_M)  # of the pressure, 5.2559
MOST_HEIGHT_M: Final = 5000.0  # above the launch place; more is a broken sensor


@kernel
def density_ratio(height_m):  # type: ignore[no-untyped-def]
    """Density of the standard atmosphere at a height above the sea, over that at sea level."""
    return (1.0 - LAPSE_K_M * clip(height_m, DEEPEST_M, HIGHEST_M + MOST_HEIGHT_M) / TEMPERATURE_K) ** (EXPONENT - 1.0)


@kernel
def true_over_equivalent(height_m):  # type: ignore[no-untyped-def]
    """True over equivalent airspeed at a height above the sea: 1 at sea level, 1.155 at 2,900 m."""
    return 1.0 / math.sqrt(density_ratio(height_m))


@kernel
def height_above_launch(row):  # type: ignore[no-untyped-def]
    """Height for the density, m: barometric, else by GPS, else 0.

    row : measured
    """
    height_m = row.baro_height_m
    if abs(height_m) <= MOST_HEIGHT_M:  # NaN is not
        return height_m
    height_m = -row.gps_p_e_m[2]
    return height_m if row.gps_valid and abs(height_m) <= MOST_HEIGHT_M else 0.0


@kernel
def true_airspeed_factor(row, elevation_m):  # type: ignore[no-untyped-def]
    """True over equivalent airspeed where the aeroplane is.

    row : measured   elevation_m : of the launch place above the sea
    """
    return true_over_equivalent(elevation_m + height_above_launch(row))
