"""What the parameters in a PX4 log say about the instruments.

Initial parameters are those at the start of the log; a change counts if it was made before the first flight; in a log
without flight, every change counts.

| parameter | what it means here |
|-|-|
| EKF2_DECL_TYPE bit 0 | declination from the world magnetic model at the first fix, or EKF2_MAG_DECL, degrees |
| EKF2_GPS_DELAY | latency of a fix without a time of validity, ms |
| SYS_HAS_MAG, EKF2_MAG_TYPE | 0, 5: no magnetometer is used |
| SYS_HAS_NUM_ASPD, FW_USE_AIRSPD, FW_ARSP_MODE, CBRK_AIRSPD_CHK | 0, 0, 1 or 2, 162128: no airspeed is used |
"""

import math
from collections.abc import Iterable, Mapping

from estimator.instruments import Known
from scenarios.harness.logs.ardupilot import LONGEST_DELAY_MS, world_model

_FROM_MODEL = 1  # bit of EKF2_DECL_TYPE
_BREAKER = 162128  # a circuit breaker set to its own number is open
_NO_AIRSPEED: Mapping[str, tuple[int, ...]] = {
    "SYS_HAS_NUM_ASPD": (0,), "FW_USE_AIRSPD": (0,), "FW_ARSP_MODE": (1, 2), "CBRK_AIRSPD_CHK": (_BREAKER,),
}  # fmt: skip
_NO_COMPASS: Mapping[str, tuple[int, ...]] = {"SYS_HAS_MAG": (0,), "EKF2_MAG_TYPE": (5,)}
LOG_FASTER = "set bit 1 (estimator replay) of SDLOG_PROFILE"


def parameters(
    initial: Mapping[str, float], changes: Iterable[tuple[int, str, float]], flight_us: float
) -> dict[str, float]:
    """The parameters at the time `flight_us`; `changes` are time, name and value."""
    return {**initial, **{name: value for at_us, name, value in changes if at_us <= flight_us}}


def off(values: Mapping[str, float], what: str) -> str:
    """The parameter that switches the ``airspeed`` or ``magnetometer`` off; empty if it is in use."""
    switches = _NO_AIRSPEED if what == "airspeed" else _NO_COMPASS
    found = (name for name, those in switches.items() if values.get(name) in those)
    return next((f"{name} is {values[name]:g}" for name in found), "")


def latency(values: Mapping[str, float]) -> Known | None:
    """The latency of a fix."""
    delay_ms = values.get("EKF2_GPS_DELAY", math.nan)
    believed = 0.0 <= delay_ms <= LONGEST_DELAY_MS
    return Known(1e-3 * float(delay_ms), "log", "EKF2_GPS_DELAY") if believed else None


def declination(values: Mapping[str, float], place: tuple[float, float, float] | None, year: float) -> Known | None:
    """The declination as EKF2 determines it; None if the log lacks the parameters.

    place : of the first fix: latitude and longitude, degrees, and altitude, or None      year : NaN if unknown
    """
    kind, set_deg = values.get("EKF2_DECL_TYPE"), values.get("EKF2_MAG_DECL")
    if kind is not None and int(kind) & _FROM_MODEL and place is not None:
        return world_model(place, year, f"EKF2_DECL_TYPE is {int(kind)}")
    if set_deg is None or not abs(set_deg) <= 180.0:
        return None
    return Known(math.radians(float(set_deg)), "log", "EKF2_MAG_DECL")
