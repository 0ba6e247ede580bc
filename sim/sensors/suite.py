"""The sensors of one aeroplane: gyro, accelerometer and GPS, measured together by one kernel per tick.

Row k of the measured log is filled from the truth of rows up to k alone.
"""

from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.interface import MEASURED_DTYPE, Measurements
from estimator.jit import kernel
from sim.clock import Rates
from sim.log import TRUTH_DTYPE, Log
from sim.rng import stream
from sim.sensors import accelerometer, gps, gyro
from sim.sensors.accelerometer import AccelerometerParams, measure_force
from sim.sensors.gps import GpsParams, receive
from sim.sensors.gyro import GyroParams, measure_rate


@dataclass(frozen=True, slots=True)
class SuiteParams:
    """What is fitted, and how good each part is."""

    gyro: GyroParams = field(default_factory=GyroParams)
    accelerometer: AccelerometerParams = field(default_factory=AccelerometerParams)
    gps: GpsParams = field(default_factory=GpsParams)


_INF = float("inf")

SUITES = MappingProxyType(
    {
        "generic": SuiteParams(),
        "generic_6g": SuiteParams(accelerometer=AccelerometerParams(range_g=6.0)),
        "ideal": SuiteParams(
            GyroParams(0.0, 0.0, 0.0, 0.0, gain=0.0, cross_axis=0.0, range_deg_s=_INF, bits=0),
            AccelerometerParams(0.0, 0.0, range_g=_INF, bits=0),
            GpsParams(0.0, 0.0, 0.0, velocity_noise_m_s=0.0, wander_horizontal_m=0.0, wander_vertical_m=0.0),
        ),
    }
)

UNIT = np.dtype(
    [("dt_s", "f8"), ("gyro", gyro.UNIT), ("accelerometer", accelerometer.UNIT), ("gps", gps.UNIT)],
    align=True,
)
NOISE = np.dtype([*gyro.NOISE, *accelerometer.NOISE, *gps.NOISE], align=True)


class Snapshot(NamedTuple):
    """All that makes these sensors these: the units fitted and the errors drawn; the past is in the log."""

    unit: NDArray[np.void]
    noise: NDArray[np.void]


class Suite:
    """The sensors of flight number `flight` of the campaign `seed`.

    Its errors are drawn in `reset`; its only memory are the earlier rows of the log.
    """

    def __init__(self, params: SuiteParams, rates: Rates, seed: int, flight: int = 0) -> None:
        self.params = params
        self.rates = rates
        self._source = partial(stream, seed, flight)
        self._truth = np.zeros(0, TRUTH_DTYPE)
        self._measured = self._seen = np.zeros(0, MEASURED_DTYPE)
        self._noise = np.zeros(0, NOISE)
        self._unit = np.zeros(1, UNIT)

    def reset(self, log: Log) -> None:
        """Power up: draw the errors of a flight as long as `log`, whose rows `measure` fills from 0 on."""
        self._truth, self._measured = log.truth, log.measured
        self._seen = log.measured.view()
        self._seen.flags.writeable = False
        unit, noise = np.zeros(1, UNIT), np.zeros(len(log), NOISE)
        gyro.make(self.params.gyro, self._source, unit["gyro"])
        accelerometer.make(self.params.accelerometer, unit["accelerometer"])
        gps.make(self.params.gps, self.rates, unit["gps"])
        gyro.draw(self.params.gyro, self.rates, self._source, noise)
        accelerometer.draw(self.params.accelerometer, self.rates, self._source, noise)
        gps.draw(self.params.gps, self.rates, self._source, noise)
        unit["dt_s"] = self.rates.dt_s
        self._unit, self._noise = unit, noise

    def measure(self, k: int) -> Measurements:
        """Measure tick `k`, whose truth row is complete; a read-only view of its row.

        Raises
        ------
        IndexError      the log has no row `k`, or there is no log yet
        """
        _measure(self._truth, self._measured, self._noise, k, self._unit)
        return tuple.__new__(Measurements, (self._seen, k))  # spares the constructor's Python: 0.15 us

    def snapshot(self) -> Snapshot:
        """What `restore` needs to go on; neither array is ever changed after `reset`."""
        return Snapshot(self._unit, self._noise)

    def restore(self, snapshot: Snapshot) -> None:
        """Be the sensors of `snapshot` from the next tick on; call `reset` with the log first."""
        if len(snapshot.noise) < len(self._truth):
            raise ValueError(
                f"snapshot of {len(snapshot.noise)} ticks: the log has {len(self._truth)} ticks; "
                "choose one taken in a flight at least as long"
            )
        self._unit, self._noise = snapshot


@kernel
def _measure(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    if k < 0 or k >= min(len(measured), len(noise)):
        raise IndexError("the log has no such row: call reset(log) with a log as long as the flight")
    measured[k].t_s = truth[k].t_s
    measured[k].dt_s = unit[0].dt_s
    measure_rate(truth, measured, noise, k, unit[0].gyro)
    measure_force(truth, measured, noise, k, unit[0].accelerometer)
    receive(truth, measured, noise, k, unit[0].gps)
