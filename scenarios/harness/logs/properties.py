"""What the rows of a log say about the instruments: rates, and whether the receiver has a vertical velocity."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known

CLIMB_M = 5.0  # a receiver reports no vertical velocity if it is 0 while the height changes by more than this
MEASURED = ("imu_rate_hz", "gps_rate_hz", "gps_stamped", "gps_vertical_velocity")  # can be measured in any log


def measured(rows: NDArray[Any]) -> dict[str, Known]:
    """Properties that can be measured in `rows`, by the names of `estimator.instruments.PROPERTIES`.

    A receiver that reports no vertical velocity leaves it 0 in every fix.
    """
    known: dict[str, Known] = {}
    if len(rows) > 1:
        step_s = float(np.median(np.diff(rows["t_s"])))
        known["imu_rate_hz"] = Known(_rate_hz(step_s), "log", "median interval of the rows")
    fixes = rows[rows["gps_new"] > 0]
    if len(fixes):
        vertical = bool(np.any(fixes["gps_v_e_m_s"][:, 2] != 0.0))
        known["gps_vertical_velocity"] = Known(vertical, "log", "vertical velocity of the fixes")
    if len(fixes) > 2:
        step_s = float(np.median(np.diff(fixes["t_s"])))
        known["gps_rate_hz"] = Known(_rate_hz(step_s), "log", "median interval of the fixes")
    return known


def sensors(rows: NDArray[Any]) -> tuple[str, ...]:
    """The sensors of which `rows` hold a sample."""
    air = (rows["air_new"] > 0) & np.isfinite(rows["equivalent_airspeed_m_s"])
    has = {"gps": rows["gps_new"], "magnetometer": rows["mag_new"], "airspeed": air}
    return ("gyro", "accelerometer", *(name for name, new in has.items() if np.any(new)))


def _rate_hz(step_s: float) -> float:
    """The rate for an interval, without the digits that come from rounded times."""
    return float(f"{1.0 / step_s:.6g}") if step_s > 0.0 else 0.0
