"""What a person does for the magnetometer before a flight: enters the declination, turns it on the table.

An estimator whose parameters have a ``declination_rad`` is told that of the launch point, as from a map; one whose
parameters have a ``calibration`` is told, where the configuration says ``turn_table``, what the readings of its own
magnetometer on the turn-table give.  Either goes into ``estimator_params``, unless it stands there already.
"""

import math
from dataclasses import asdict
from typing import Any

from estimator.magnetometer import Calibration
from scenarios.harness.config import FlightConfig
from scenarios.harness.fitted import suite_params
from scenarios.harness.plugins import load_estimator
from sim.place import ELEVATION_M, LATITUDE_DEG, LONGITUDE_DEG
from sim.power_up import field_on_turn_table
from sim.sensors.fitting import SuiteParams


def with_compass(config: FlightConfig) -> FlightConfig:
    """The resolved `config` with what its estimator is told of the magnetometer; unchanged where none is fitted."""
    fitted = suite_params(config.suite, config.sensors, config.files)
    if fitted.magnetometer is None:
        return config
    params, given = getattr(load_estimator(config.estimator), "params", None), config.estimator_params
    told: dict[str, Any] = {}
    declination_rad = _declination_rad(fitted.magnetometer.year)
    if hasattr(params, "declination_rad") and "declination_rad" not in given:
        told["declination_rad"] = declination_rad
    by_hand = any(name.partition(".")[0] == "calibration" for name in given)
    if config.turn_table and hasattr(params, "calibration") and not by_hand:
        found = _calibration(config, fitted, declination_rad)
        told |= {f"calibration.{name}": value for name, value in asdict(found).items()}
    return config.model_copy(update={"estimator_params": {**given, **told}})


def _declination_rad(year: float) -> float:
    from sim.magnetic_field import field_e_ut  # here, so that flights without a magnetometer do not load the model

    north_ut, east_ut, _ = field_e_ut(LATITUDE_DEG, LONGITUDE_DEG, ELEVATION_M, year)
    return math.atan2(east_ut, north_ut)


def _calibration(config: FlightConfig, fitted: SuiteParams, declination_rad: float) -> Calibration:
    readings = field_on_turn_table(
        fitted, config.rates.build(), config.seed, config.flight, declination_rad=declination_rad
    )
    return Calibration.from_turns(readings)
