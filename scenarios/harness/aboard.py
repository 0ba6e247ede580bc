"""What is known of the instruments of a flight, and the calibration of its magnetometer on the ground.

The record comes from the data sheets of the suite, from the world magnetic model at the launch point, and from what
the user sets (``instruments``) or withholds (``withheld``) in the configuration.  It is the same for every seed.

The calibration is no property but a measurement: where the configuration says ``turn_table``, an estimator whose
parameters have a ``calibration`` is given what the readings of its own magnetometer on the turn-table give.
"""

import inspect
import math
from dataclasses import asdict
from typing import Any, NamedTuple

from estimator.blocks.magnetometer import Calibration
from estimator.instruments import Instruments, Known
from scenarios.harness.config import FlightConfig
from scenarios.harness.fitted import suite_params
from scenarios.harness.plugins import (
    Equipped,
    Maker,
    equipped,
    equipped_autopilot,
    heading_reference_of,
    params_of,
)
from sim.place import ELEVATION_M, LATITUDE_DEG, LONGITUDE_DEG
from sim.power_up import field_on_turn_table
from sim.sensors.known import data_sheets


def instruments_of(config: FlightConfig) -> Instruments:
    """What is known aboard under the resolved `config`."""
    suite = suite_params(config.suite, config.sensors, config.files)
    known = data_sheets(suite, config.rates.build(), config.suite)
    if suite.magnetometer is not None:
        declination_rad = _declination_rad(suite.magnetometer.year)
        known["declination_rad"] = Known(declination_rad, "data sheet", "world magnetic model")
    if config.turn_table:
        known["magnetometer_calibrated"] = Known(True, "set", "turn_table")
    return Instruments(known, config.instruments, config.withheld)


class FlightCode(NamedTuple):
    """The estimator and the autopilot of a flight, new, each with what it was given of the instruments."""

    estimator: Equipped
    autopilot: Equipped


def flight_code(config: FlightConfig, maker: Maker | None = None) -> FlightCode:
    """Estimator and autopilot of the resolved `config`; `maker` makes the estimator where it is given.

    Raises
    ------
    ValueError      one line: flight code that is not there, or a parameter that it has not or refuses
    """
    aboard = instruments_of(config)
    estimator = equipped(maker or config.estimator, aboard, config.estimator_params)
    reference = heading_reference_of(estimator.code)
    return FlightCode(estimator, equipped_autopilot(config.autopilot, reference, config.aircraft, aboard))


def unheard(config: FlightConfig, code: FlightCode) -> list[str]:
    """Properties of the instruments that are set under the resolved `config` and that `code` is not given."""
    return [name for name in config.instruments if name not in code.estimator.known | code.autopilot.known]


def require_heard(config: FlightConfig, code: FlightCode) -> None:
    """Refuse, with a ValueError of one line, a property of the instruments that is set and that `code` is not given."""
    for name in unheard(config, code):
        raise ValueError(
            f"{name} = {config.instruments[name]!r}: neither estimator {config.estimator} nor autopilot "
            f"{config.autopilot} has a parameter of that name"
        )


def with_calibration(config: FlightConfig, maker: Maker | None = None) -> FlightConfig:
    """The resolved `config` with the calibration of its magnetometer in ``estimator_params``, where there is one.

    maker : makes the estimator where it is given; of a function nothing is changed, for it sets its own parameters
    """
    given = config.estimator_params
    by_hand = any(name.partition(".")[0] == "calibration" for name in given)
    if not config.turn_table or by_hand or not (maker is None or inspect.isclass(maker)):
        return config
    params = params_of(maker or config.estimator, equipped(maker or config.estimator).code)
    if not hasattr(params, "calibration"):
        return config
    declination_rad = instruments_of(config).value("declination_rad", 0.0)
    found = {f"calibration.{name}": value for name, value in asdict(_calibration(config, declination_rad)).items()}
    return config.model_copy(update={"estimator_params": {**given, **found}})


def _declination_rad(year: float) -> float:
    from sim.magnetic_field import field_e_ut  # here, so that flights without a magnetometer do not load the model

    north_ut, east_ut, _ = field_e_ut(LATITUDE_DEG, LONGITUDE_DEG, ELEVATION_M, year)
    return math.atan2(east_ut, north_ut)


def _calibration(config: FlightConfig, declination_rad: float) -> Calibration:
    fitted: Any = suite_params(config.suite, config.sensors, config.files)
    readings = field_on_turn_table(
        fitted, config.rates.build(), config.seed, config.flight, declination_rad=declination_rad
    )
    return Calibration.from_turns(readings)
