"""True airspeeds of a log as the equivalent ones that a pitot tube measures."""

import numpy as np

from estimator.blocks.air import EXPONENT, LAPSE_K_M, TEMPERATURE_K
from estimator.instruments import DEEPEST_M, HIGHEST_M, Known
from estimator.interface import Array

BY_HEIGHT = "true airspeed: converted to equivalent by the height above the sea"
AT_SEA_LEVEL = "true airspeed: taken as equivalent, as at sea level; the log has no height above the sea"


def equivalent_m_s(true_m_s: Array, height_m: Array | float) -> Array:
    """Equivalent airspeed of a true one at a height above the sea, in the standard atmosphere (ISO 2533)."""
    ratio = 1.0 - LAPSE_K_M * np.clip(height_m, DEEPEST_M, HIGHEST_M) / TEMPERATURE_K
    return np.asarray(true_m_s * ratio ** (0.5 * (EXPONENT - 1.0)))


def elevation(altitude_m: float | None, why: str) -> dict[str, Known]:
    """``elevation_m`` by the altitude of the first fix; nothing if that is not a height on earth."""
    if altitude_m is None or not DEEPEST_M <= altitude_m <= HIGHEST_M:
        return {}
    return {"elevation_m": Known(float(altitude_m), "log", why)}
