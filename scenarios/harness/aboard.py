"""What is known of the instruments of a flight, and the calibration of its magnetometer on the ground.

The record comes from the data sheets of the suite, from the world magnetic model at the launch point, and from what
the user sets (``instruments``) or withholds (``withheld``) in the configuration.  It is the same for every seed.

The calibration is a measurement, not a property: if the configuration says ``turn_table``, an estimator whose
parameters have a ``calibration`` is given the result of turning its own magnetometer on a turn-table.
"""

import inspect
import math
from dataclasses import asdict
from typing import Any

from estimator.blocks.calibration import Calibration
from estimator.instruments import Instruments, Known
from scenarios.harness.config import FlightConfig
from scenarios.harness.equipping import Equipped, equipped, params_of
from scenarios.harness.plugins import Maker
from sim.place import LAUNCH_PLACE, Place
from sim.power_up import field_on_turn_table
from sim.sensors.fitting import SuiteParams
from sim.sensors.known import data_sheets


def instruments_of(config: FlightConfig, suite: SuiteParams) -> Instruments:
    """What is known aboard under the resolved `config`, which carries `suite`."""
    known = data_sheets(suite, config.rates.build(), config.suite)
    if suite.magnetometer is not None:
        declination_rad = _declination_rad(config.place.build(), suite.magnetometer.year)
        known["declination_rad"] = Known(declination_rad, "data sheet", "world magnetic model")
    if config.place.elevation_m != LAUNCH_PLACE.elevation_m:
        known["elevation_m"] = Known(config.place.elevation_m, "set", "place.elevation_m")
    if config.turn_table:
        known["magnetometer_calibrated"] = Known(True, "set", "turn_table")
    return Instruments(known, config.instruments, config.withheld)


def equipped_estimator(
    config: FlightConfig, suite: SuiteParams, instruments: Instruments, maker: Maker | None = None
) -> tuple[Equipped, FlightConfig]:
    """The estimator of the resolved `config`, made by `maker` if given, and `config` with its calibration.

    The calibration goes into ``estimator_params``, unless it is set there.  A function sets its own parameters: what
    it makes is left alone.
    """
    spec, settings = maker or config.estimator, config.estimator_params
    made = equipped(spec, instruments, settings)
    set_by_hand = any(name.partition(".")[0] == "calibration" for name in settings)
    if not config.turn_table or set_by_hand or not (maker is None or inspect.isclass(maker)):
        return made, config
    if not hasattr(params_of(spec, made.code), "calibration"):
        return made, config
    found = _calibration(config, suite, instruments.value("declination_rad", 0.0))
    settings = {**settings, **{f"calibration.{name}": value for name, value in asdict(found).items()}}
    return equipped(spec, instruments, settings), config.model_copy(update={"estimator_params": settings})


def _declination_rad(place: Place, year: float) -> float:
    from sim.magnetic_field import field_e_ut  # here, so that flights without a magnetometer do not load the model

    north_ut, east_ut, _ = field_e_ut(place.latitude_deg, place.longitude_deg, place.elevation_m, year)
    return math.atan2(east_ut, north_ut)


def _calibration(config: FlightConfig, suite: Any, declination_rad: float) -> Calibration:
    rates = config.rates.build()
    return Calibration.from_turns(
        field_on_turn_table(
            suite, rates, config.seed, config.flight, declination_rad=declination_rad, place=config.place.build()
        )
    )
