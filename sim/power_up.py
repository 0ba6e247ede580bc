"""Sensor data from before the flight: at rest, level on the ground, and on a calibration turn-table.

Biases, gains, iron and mounting are those of the flight, drawn from its random streams.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array, ImuSample
from sim.clock import Rates
from sim.log import Log
from sim.loop import mean_sample, sense
from sim.motion.prescribed_plant import Motion, PrescribedPlant, Rest
from sim.motion.turn_table import TurnTable
from sim.place import LAUNCH_PLACE, Place
from sim.sensors.fitting import SuiteParams
from sim.sensors.suite import Suite


def sample_at_rest(
    params: SuiteParams, rates: Rates, seed: int, flight: int = 0, place: Place = LAUNCH_PLACE
) -> ImuSample | None:
    """Mean inertial sample of the sensors of a flight over ``board.rest_s``; None if that is 0."""
    if rates.ticks(params.board.rest_s) == 0:
        return None
    return mean_sample(_measured(Rest(), params.board.rest_s, params, rates, seed, flight, place))


def field_on_turn_table(
    params: SuiteParams,
    rates: Rates,
    seed: int,
    flight: int = 0,
    *,
    declination_rad: float = 0.0,
    place: Place = LAUNCH_PLACE,
) -> Array:
    """Readings of the magnetometer of a flight on the calibration turn-table, shape (n, 3), microtesla.

    The motor is off: its field in flight is not included.
    """
    table = TurnTable(declination_rad)
    rows = _measured(table, table.duration_s, params, rates, seed, flight, place)
    return np.asarray(rows["mag_b_ut"][rows["mag_new"] == 1])


def _measured(
    motion: Motion, duration_s: float, params: SuiteParams, rates: Rates, seed: int, flight: int, place: Place
) -> NDArray[Any]:
    """Measured rows of `motion` by the sensors of a flight."""
    plant = PrescribedPlant(motion, rates, place.latitude_deg, elevation_m=place.elevation_m)
    suite = Suite(params, rates, seed, flight, place=place)
    return sense(plant, suite, Log.empty(rates.ticks(duration_s))).measured
