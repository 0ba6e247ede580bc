"""The open-loop side of the claims: what sensors make of a motion in closed form, and how far off an estimate is."""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from autopilot.interface import NEUTRAL
from estimator.blocks.calibration import Calibration
from estimator.interface import G_M_S2, Array, ImuSample
from estimator.rotation import inclination_error_rad
from sim import place
from sim.clock import Rates
from sim.log import Log
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import Motion, PrescribedPlant
from sim.motion.turn_table import TurnTable
from sim.power_up import sample_at_rest
from sim.sensors.fitting import suite_params
from sim.sensors.suite import Suite

RATES = Rates(gps_hz=5.0)
FIELD_E_UT = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
DECLINATION_RAD = math.atan2(FIELD_E_UT[1], FIELD_E_UT[0])


def seen(
    motion: Motion,
    duration_s: float,
    suite: str = "ideal",
    changes: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    rates: Rates = RATES,
) -> Log:
    """The log of `motion`, seen by the sensors of `suite` with `changes` by dotted names."""
    log = Log.empty(rates.ticks(duration_s))
    plant, sensors = PrescribedPlant(motion, rates), Suite(suite_params(suite, changes or {}), rates, seed)
    plant.reset(log)
    sensors.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        sensors.measure(k)
    return log


def felt_at_rest(R_eb: Array) -> ImuSample:
    """What perfect sensors feel at rest at the attitude `R_eb`: powers an estimator up at that tilt, heading north."""
    return ImuSample(0.0, RATES.dt_s, np.zeros(3), -G_M_S2 * R_eb[2])


def mean_at_rest(suite: str, seed: int) -> ImuSample | None:
    """What the inertial sensors of that board read at rest in the mean, level, before they are moved."""
    return sample_at_rest(suite_params(suite, {}), RATES, seed)


@lru_cache(maxsize=32)
def calibration(suite: str, seed: int) -> Calibration:
    """Of the magnetometer of that board, turned on a table about each axis."""
    table = TurnTable(heading_rad=DECLINATION_RAD)
    rows = seen(table, table.duration_s, suite, seed=seed).measured
    return Calibration.from_turns(rows["mag_b_ut"][rows["mag_new"] == 1])


def tilt_deg(R_eb: Array, log: Log) -> Array:
    """Inclination errors of the last estimates of `log`, degrees, shape of their number."""
    return np.degrees(inclination_error_rad(R_eb, log.truth["R_eb"][-len(R_eb) :]))
