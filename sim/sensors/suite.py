"""The sensors of one aeroplane, measured together by one kernel per tick.

Row k of the measured log is filled from the truth of rows up to k alone.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import MEASURED_DTYPE, Measurements
from sim.clock import Rates
from sim.faults import Fault
from sim.log import TRUTH_DTYPE, Log
from sim.place import LAUNCH_PLACE, Place
from sim.rng import stream
from sim.sensors import accelerometer, air_data, board, gps, gyro, magnetometer, receiver, sampling
from sim.sensors.accelerometer import measure_force
from sim.sensors.air_data import measure_air
from sim.sensors.board import attend
from sim.sensors.faults import NO_FAULTS, fault_table, require_possible, spoil
from sim.sensors.fitting import SUITES as SUITES
from sim.sensors.fitting import SuiteParams as SuiteParams
from sim.sensors.gyro import measure_rate
from sim.sensors.magnetometer import measure_field
from sim.sensors.receiver import receive
from sim.sensors.sampling import EVERY_TICK, samples_of, take_sample

UNIT = np.dtype(
    [
        ("dt_s", "f8"), ("board", board.UNIT), ("gyro", gyro.UNIT), ("accelerometer", accelerometer.UNIT),
        ("gps", gps.UNIT), ("magnetometer", magnetometer.UNIT), ("air", air_data.UNIT),
    ],
    align=True,
)  # fmt: skip
NOISE = np.dtype([*gyro.NOISE, *accelerometer.NOISE, *gps.NOISE, *magnetometer.NOISE, *air_data.NOISE], align=True)
MEMORY = np.dtype(
    [
        ("board", board.MEMORY), ("gyro", gyro.MEMORY), ("accelerometer", accelerometer.MEMORY),
        ("gps", receiver.MEMORY), ("air", air_data.MEMORY), ("imu", sampling.MEMORY),
    ],
    align=True,
)  # fmt: skip


class Snapshot(NamedTuple):
    """The state of a suite: units, drawn errors, memory and faults; the rest is in the log."""

    unit: NDArray[np.void]
    noise: NDArray[np.void]
    memory: NDArray[np.void]
    faults: NDArray[np.void]
    samples: NDArray[np.void]


class Suite:
    """The sensors of flight number `flight` of the campaign `seed`, with `faults`, at a launch `place`.

    Of `faults` it takes those of sensors and inertial samples; their times count from the release, `release_s` after
    power-up.  Errors are drawn in `reset`.
    """

    def __init__(
        self, params: SuiteParams, rates: Rates, seed: int, flight: int = 0, faults: Sequence[Fault] = (),
        release_s: float = 0.0, place: Place = LAUNCH_PLACE,
    ) -> None:  # fmt: skip
        self._of_imu = [fault for fault in faults if fault.family == "imu"]
        self._of_sensors = [fault for fault in faults if fault.family == "sensor"]
        for fault in self._of_sensors:
            require_possible(fault, params, rates.gps_hz)
        for what in ("magnetometer", "airspeed", "barometer"):
            part = getattr(params, what)
            if part is not None:
                rates.steps_per_sample(what, part.rate_hz)  # rejected here, before the flight
        self.params = params
        self.rates, self.place = rates, place
        self._source = partial(stream, seed, flight)
        self._truth = np.zeros(0, TRUTH_DTYPE)
        self._measured = self._seen = self._shown = np.zeros(0, MEASURED_DTYPE)
        self._noise = np.zeros(0, NOISE)
        self._unit = np.zeros(1, UNIT)
        self._memory = np.zeros(1, MEMORY)
        self.faults, self._release_s = tuple(faults), release_s
        self._faults, self._samples = NO_FAULTS, EVERY_TICK
        self._uneven = False

    def reset(self, log: Log) -> None:
        """Power up: draw the errors of a flight as long as `log`, whose rows `measure` fills from row 0."""
        self._truth, self._measured = log.truth, log.measured
        # Flight code gets a view of a copy: even if it makes that writeable, or reshapes it, the recording is safe.
        copy = np.zeros(len(log), MEASURED_DTYPE)
        self._seen, self._shown = copy.view(), copy.view()
        self._shown.flags.writeable = False
        p, rates, source = self.params, self.rates, self._source
        unit, noise = np.zeros(1, UNIT), np.zeros(len(log), NOISE)
        unit["dt_s"] = rates.dt_s
        board.make(p.board, rates, source, unit["board"])
        gyro.make(p.gyro, p.board, rates, source, unit["gyro"])
        gyro.draw(p.gyro, p.board, rates, source, noise)
        accelerometer.make(p.accelerometer, p.board, rates, source, unit["accelerometer"])
        accelerometer.draw(p.accelerometer, p.board, rates, source, noise)
        gps.make(p.gps, rates, source, unit["gps"], self.place)
        gps.draw(p.gps, rates, source, noise)
        if p.magnetometer is not None:
            magnetometer.make(p.magnetometer, rates, source, unit["magnetometer"], self.place)
            magnetometer.draw(p.magnetometer, rates, source, noise)
        if p.airspeed is not None or p.barometer is not None:
            air_data.make(p.airspeed, p.barometer, rates, source, unit["air"], self.place)
            air_data.draw(p.airspeed, p.barometer, rates, source, noise)
        self._unit, self._noise, self._memory = unit, noise, np.zeros(1, MEMORY)
        self._faults = fault_table(self._of_sensors, self._release_s, rates, source, unit, len(log))
        self._samples = samples_of(p.board, self._of_imu, self._release_s, rates, source, len(log))
        self._uneven = len(self._samples) > 0

    def measure(self, k: int) -> Measurements:
        """Measure tick `k`, whose truth row is complete; returns a read-only view of a copy of its row.

        Raises
        ------
        IndexError      the log has no row `k`, or there is no log yet
        """
        _measure(self._truth, self._measured, self._seen, self._noise, k, self._unit, self._memory, self._faults)
        if self._uneven:
            take_sample(self._measured, self._seen, k, self._samples, self._memory["imu"][0])
        return tuple.__new__(Measurements, (self._shown, k))  # skips the constructor, 0.15 us

    @property
    def loses_samples(self) -> bool:
        """Whether some inertial samples of this flight never arrive; see `lost`."""
        return bool(self._samples["lost"].any())

    def lost(self, k: int) -> bool:
        """Whether the inertial sample of tick `k` does not arrive, in a flight that `loses_samples`."""
        return bool(self._samples["lost"][k])

    def snapshot(self) -> Snapshot:
        """The state for `restore`; its arrays are never changed later."""
        return Snapshot(self._unit, self._noise, self._memory.copy(), self._faults, self._samples)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from `snapshot` at the next tick; call `reset` with the log first."""
        if len(snapshot.noise) < len(self._truth):
            raise ValueError(
                f"snapshot of {len(snapshot.noise)} ticks: the log has {len(self._truth)} ticks; "
                "choose a snapshot of a flight at least as long"
            )
        self._unit, self._noise, self._faults = snapshot.unit, snapshot.noise, snapshot.faults
        self._samples, self._uneven = snapshot.samples, len(snapshot.samples) > 0
        self._memory = snapshot.memory.copy()


@kernel
def _measure(truth, measured, seen, noise, k, unit, memory, faults):  # type: ignore[no-untyped-def]
    if k < 0 or k >= min(len(measured), len(noise)):
        raise IndexError("the log has no such row: call reset(log) with a log as long as the flight")
    u, m = unit[0], memory[0]
    measured[k].t_s = truth[k].t_s
    measured[k].dt_s = u.dt_s
    if u.board.changes:
        attend(truth, k, u.board, m.board)
    measure_rate(truth, measured, noise, k, u.gyro, u.board, m.gyro, m.board)
    measure_force(truth, measured, noise, k, u.accelerometer, u.board, m.accelerometer, m.board)
    receive(truth, measured, noise, k, u.gps, m.gps)
    if u.magnetometer.fitted:
        measure_field(truth, measured, noise, k, u.magnetometer)
    if u.air.fitted:
        measure_air(truth, measured, noise, k, u.air, m.air)
    if len(faults):
        spoil(truth, measured, k, faults)
    seen[k] = measured[k]
