"""What the sensors said as the aeroplane lay level on the ground, before a flight that starts in the air."""

from typing import Any

from numpy.typing import NDArray

from autopilot.interface import NEUTRAL
from estimator.interface import ImuSample
from sim.clock import Rates
from sim.log import Log
from sim.prescribed_plant import PrescribedPlant, Rest
from sim.sensors.fitting import SuiteParams
from sim.sensors.suite import Suite


def sample_at_rest(params: SuiteParams, rates: Rates, seed: int, flight: int = 0) -> ImuSample | None:
    """Mean inertial sample of the very sensors of a flight over ``board.rest_s``; None where that is 0.

    Offsets, gains and mounting are those of the flight, for they come from its streams.
    """
    n_ticks = rates.ticks(params.board.rest_s)
    if n_ticks == 0:
        return None
    log, plant, suite = Log.empty(n_ticks), PrescribedPlant(Rest(), rates), Suite(params, rates, seed, flight)
    plant.reset(log)
    suite.reset(log)
    for k in range(n_ticks):
        plant.advance(k, NEUTRAL)
        suite.measure(k)
    return mean_sample(log.measured)


def mean_sample(rows: NDArray[Any]) -> ImuSample:
    """The mean inertial sample of measured rows, its time that of the last."""
    gyro, force = rows["gyro_b_rad_s"].mean(axis=0), rows["force_b_m_s2"].mean(axis=0)
    return ImuSample(float(rows["t_s"][-1]), float(rows["dt_s"].sum()), gyro, force)
