"""Estimators on motions that are prescribed: what the claims share that need no flight.

The sensors are those of `sim.sensors`, the motion a closed form, and nobody steers: what an estimator believes changes
nothing.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.interface import NEUTRAL
from estimator.interface import Array, ImuSample
from estimator.premerlani import PremerlaniParams
from estimator.rotation import inclination_error_rad, rotation_error_rad
from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import Motion, PrescribedPlant
from sim.sensors.fitting import suite_params
from sim.sensors.suite import Suite

IMU_HZ = 50
STEP_S = 1.0 / IMU_HZ
# Perfect sensors but for the lag of the receiver, as in the generic suite: a 1 s filter and 0.3 s of latency, at 4 Hz.
FILTER_S, LATENCY_S = 1.0, 0.3
LAGGED: Mapping[str, Any] = MappingProxyType({"gps.filter_s": FILTER_S, "gps.latency_s": LATENCY_S})
# That receiver, as parameters of an estimator.
RECEIVER: Mapping[str, Any] = MappingProxyType({"gps_filter_s": FILTER_S, "gps_latency_s": LATENCY_S})
# Of `premerlani`, what the paper's own text has: neither its gates nor what it learns of clipping and turning.
AS_PRINTED: Mapping[str, Any] = MappingProxyType(
    {"launch_gate": math.inf, "integrate_below_rad_s": math.inf, "use_airspeed": False}
)


def aboard(**params: Any) -> PremerlaniParams:
    """Parameters of `premerlani` that know the receiver."""
    return PremerlaniParams(**{**RECEIVER, **params})


def printed(**params: Any) -> PremerlaniParams:
    """Parameters of `premerlani` without what goes beyond the paper's text, but for the GPS-lag filter it names."""
    return aboard(**{**AS_PRINTED, **params})


@lru_cache(maxsize=16)
def _sensed(motion: Motion, duration_s: float, suite: str, changes: tuple[tuple[str, Any], ...], seed: int) -> Log:
    params = suite_params(suite, dict(changes))
    rates = Rates(imu_hz=IMU_HZ, gps_hz=params.gps.rate_hz)
    log = Log.empty(rates.ticks(duration_s))
    plant, sensors = PrescribedPlant(motion, rates), Suite(params, rates, seed)
    plant.reset(log)
    sensors.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        sensors.measure(k)
    log.truth.flags.writeable = log.measured.flags.writeable = False
    return log


def sensed(
    motion: Motion, duration_s: float, suite: str = "ideal", changes: Mapping[str, Any] = LAGGED, seed: int = 0
) -> Log:
    """The truth of `motion` and what the sensors say of it, at 50 Hz; read-only, for it is shared."""
    told = tuple(sorted(changes.items()))
    return _sensed(motion, duration_s, suite, told, seed)  # type: ignore[arg-type]  # motions are frozen


def misread(log: Log, gain: Sequence[float] = (1.0, 1.0, 1.0), offset_rad_s: Array | float = 0.0) -> NDArray[Any]:
    """The measured rows of `log` with a gyro that has another gain and an offset, shape (3,) or (n, 3)."""
    rows = log.measured.copy()
    rows["gyro_b_rad_s"] = rows["gyro_b_rad_s"] * np.array(gain) + offset_rad_s
    return rows


def begin(estimator: Any, R_eb: Array, calibrated_by: ImuSample | None = None) -> Any:
    """Power `estimator` up and tell it that its attitude is `R_eb`, shape (3, 3); its heading counts as found."""
    estimator.reset(calibrated_by)
    state = estimator.snapshot()
    state["R_eb"][0] = R_eb
    if "locked" in state.dtype.names:
        state["locked"] = 1
    estimator.restore(state)
    return estimator


def inclination_deg(R_eb: Array, log: Log) -> Array:
    """Inclination error at every tick, degrees, shape (n,)."""
    return np.degrees(inclination_error_rad(R_eb, log.truth["R_eb"]))


def attitude_deg(R_eb: Array, log: Log) -> Array:
    """Angle between estimated and true attitude at every tick, degrees, shape (n,)."""
    return np.degrees(rotation_error_rad(R_eb, log.truth["R_eb"]))
