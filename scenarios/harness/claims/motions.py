"""Estimators on prescribed motions: claims that need no flight.

The motion is a closed form, the sensors are those of `sim.sensors`, and nothing is steered by the estimate.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.calibration import Calibration
from estimator.interface import G_M_S2, Array, ImuSample
from estimator.premerlani import PremerlaniParams
from estimator.rotation import inclination_error_rad, rotation_error_rad
from sim import place
from sim.clock import Rates
from sim.log import Log
from sim.loop import sense
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import Motion, PrescribedPlant
from sim.motion.turn_table import TurnTable
from sim.power_up import sample_at_rest
from sim.sensors.fitting import suite_params
from sim.sensors.suite import Suite

IMU_HZ = 50
STEP_S = 1.0 / IMU_HZ
RATES = Rates(imu_hz=IMU_HZ, gps_hz=5.0)
FIELD_E_UT = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
DECLINATION_RAD = math.atan2(FIELD_E_UT[1], FIELD_E_UT[0])

# The GPS receiver of the generic suite, with otherwise perfect sensors: a 1 s filter and 0.3 s of latency, at 4 Hz.
FILTER_S, LATENCY_S = 1.0, 0.3
LAGGED: Mapping[str, Any] = MappingProxyType({"gps.filter_s": FILTER_S, "gps.latency_s": LATENCY_S})
# The same receiver as parameters of an estimator.
RECEIVER: Mapping[str, Any] = MappingProxyType({"gps_filter_s": FILTER_S, "gps_latency_s": LATENCY_S})
# `premerlani` without what was added to the paper: launch gate, limit of integration, airspeed, clipping.
NEVER = 1e9
AS_PRINTED: Mapping[str, Any] = MappingProxyType(
    {"launch_gate": NEVER, "integrate_below_rad_s": NEVER, "use_airspeed": False}
)
# The paper's numbered equations alone: without the GPS-lag filter too, which the text only mentions.
EQUATIONS_ONLY: Mapping[str, Any] = MappingProxyType(
    {**AS_PRINTED, "gps_lag_filter": False, "rotate_history": False, "force_full_scale_m_s2": NEVER}
)


def aboard(**params: Any) -> PremerlaniParams:
    """Parameters of `premerlani` that know the receiver."""
    return PremerlaniParams(**{**RECEIVER, **params})


def printed(**params: Any) -> PremerlaniParams:
    """The same, without what was added to the paper."""
    return aboard(**{**AS_PRINTED, **params})


def seen(
    motion: Motion,
    duration_s: float,
    suite: str = "ideal",
    changes: Mapping[str, Any] = MappingProxyType({}),
    seed: int = 0,
    rates: Rates | None = RATES,
) -> Log:
    """Truth of `motion` and measurements of the sensors of `suite` with `changes`; read-only, because it is shared.

    `rates` None: an IMU at 50 Hz and the suite's own GPS rate.
    """
    return _seen(motion, duration_s, suite, tuple(sorted(changes.items())), seed, rates)  # type: ignore[arg-type]


def sensed(
    motion: Motion, duration_s: float, suite: str = "ideal", changes: Mapping[str, Any] = LAGGED, seed: int = 0
) -> Log:
    """The same with the suite's own GPS rate; by default perfect sensors and a lagged GPS."""
    return seen(motion, duration_s, suite, changes, seed, None)


@lru_cache(maxsize=8)  # logs of ten minutes take 50 MB each
def _seen(
    motion: Motion, duration_s: float, suite: str, changes: tuple[tuple[str, Any], ...], seed: int, rates: Rates | None
) -> Log:
    params = suite_params(suite, dict(changes))
    rates = rates or Rates(imu_hz=IMU_HZ, gps_hz=params.gps.rate_hz)
    log = Log.empty(rates.ticks(duration_s))
    sense(PrescribedPlant(motion, rates), Suite(params, rates, seed), log)
    log.truth.flags.writeable = log.measured.flags.writeable = False
    return log


def misread(log: Log, gain: Sequence[float] = (1.0, 1.0, 1.0), offset_rad_s: Array | float = 0.0) -> NDArray[Any]:
    """Measured rows of `log` with a gyro gain and an offset added, shape (3,) or (n, 3)."""
    rows = log.measured.copy()
    rows["gyro_b_rad_s"] = rows["gyro_b_rad_s"] * np.array(gain) + offset_rad_s
    return rows


def begin(estimator: Any, R_eb: Array, calibrated_by: ImuSample | None = None) -> Any:
    """Reset `estimator` and set its attitude to `R_eb`, shape (3, 3), with the heading locked."""
    estimator.reset(calibrated_by)
    state = estimator.snapshot()
    state["R_eb"][0] = R_eb
    if "locked" in state.dtype.names:
        state["locked"] = 1
    estimator.restore(state)
    return estimator


def felt_at_rest(R_eb: Array) -> ImuSample:
    """Reading of perfect sensors at rest at the attitude `R_eb`; resets an estimator to that tilt, heading north."""
    return ImuSample(0.0, RATES.dt_s, np.zeros(3), -G_M_S2 * R_eb[2])


def mean_at_rest(suite: str, seed: int) -> ImuSample | None:
    """Mean reading of the inertial sensors of that board at rest, level, before the motion."""
    return sample_at_rest(suite_params(suite, {}), RATES, seed)


@lru_cache(maxsize=32)
def calibration(suite: str, seed: int) -> Calibration:
    """Calibration of that board's magnetometer from turns about each axis on a turntable."""
    table = TurnTable(heading_rad=DECLINATION_RAD)
    rows = seen(table, table.duration_s, suite, seed=seed).measured
    return Calibration.from_turns(rows["mag_b_ut"][rows["mag_new"] == 1])


def tilt_deg(R_eb: Array, log: Log) -> Array:
    """Inclination errors of the last ``len(R_eb)`` ticks of `log`, degrees."""
    return np.degrees(inclination_error_rad(R_eb, log.truth["R_eb"][-len(R_eb) :]))


def attitude_deg(R_eb: Array, log: Log) -> Array:
    """Angle between estimated and true attitude at every tick, degrees, shape (n,)."""
    return np.degrees(rotation_error_rad(R_eb, log.truth["R_eb"]))
