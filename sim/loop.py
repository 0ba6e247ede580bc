"""The loop: the only place that determines the order of calls.

    plant -> truth -> sensors -> measurements -> estimator -> estimate -> autopilot -> command -> plant

In flight only the rows of the log are written.  However a flight ends, the rows up to then are returned.
"""

from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

from numpy.typing import NDArray

from autopilot.interface import NEUTRAL, Autopilot
from autopilot.pilot import Script
from estimator.interface import AttitudeEstimator, HeadingReference, ImuSample
from sim.events import events_of
from sim.flight_code import FlightCodeFailed, blaming, command_of, estimate_of, record_command, reference_of
from sim.log import Flight, Log, Outcome
from sim.oracle import Oracle
from sim.outside.signals import Interrupted, TimedOut, check, listening
from sim.plant import Plant, SimulationDiverged
from sim.sensors.suite import Suite

Watch = Callable[[Log, int], None]  # called with the log and the number of rows filled


def fly(
    plant: Plant, suite: Suite, estimator: AttitudeEstimator, autopilot: Autopilot, script: Script, log: Log, *,
    calibration_s: float = 0.0, on_ground: ImuSample | None = None, manifest: dict[str, Any] | None = None,
    watch: Watch | None = None,
) -> Flight:  # fmt: skip
    """Fly until the rows of `log` are full or the flight ends.

    Parameters
    ----------
    script          setpoints by time since the release
    calibration_s   time over which inertial samples are averaged for ``estimator.reset``; 0 for a start in the air
    on_ground       sample for ``estimator.reset`` in that case: a mean from before the flight, or None
    manifest        seed, resolved configuration, versions, for the recording
    watch           called once per simulated second with the log and the number of rows filled so far
    """
    outcome, message, k, late, command = Outcome.COMPLETED, "", 0, 0, NEUTRAL
    reference: HeadingReference = "course"
    second, tick_ns, n_calibration = round(1.0 / plant.dt_s), 1e9 * plant.dt_s, round(calibration_s / plant.dt_s)
    to_release_s = plant.dt_s - plant.release_s
    try:
        with listening():
            plant.reset(log)
            suite.reset(log)
            lossy = suite.loses_samples
            reference = make_ready(estimator, autopilot, log)
            for k in range(len(log)):
                if (ended := plant.advance(k, command)) is not None:
                    outcome = ended
                    break
                measured = suite.measure(k)
                if k < n_calibration:
                    record_command(log.flown, k, command)
                    continue
                if k == n_calibration:
                    power_up(estimator, mean_sample(log.measured[:k]) if k else on_ground)
                if lossy and suite.lost(k):  # no sample, no pass: the last estimate and command stay
                    log.flown[k] = log.flown[k - 1]
                    check()
                    continue
                setpoint = script.at(k * plant.dt_s + to_release_s)
                began_ns = perf_counter_ns()
                estimate = estimate_of(estimator, measured, log.flown, k)
                late += perf_counter_ns() - began_ns > tick_ns
                command = command_of(autopilot, estimate, measured, setpoint, log.flown, k)
                if k % second == second - 1:
                    check()
                    if watch is not None:
                        watch(log, k + 1)
            else:
                k = len(log)
    except (FlightCodeFailed, SimulationDiverged, Interrupted, TimedOut) as error:
        outcome, message = _ending(error, k * plant.dt_s)
    flown = log.until(k)
    events = events_of(flown, outcome, message, script, plant.release_s)
    return Flight(flown, plant.dt_s, plant.release_s, outcome, reference, message, events, manifest or {}, late)


def _ending(error: BaseException, t_s: float) -> tuple[Outcome, str]:
    """Outcome and message of a flight that `error` ended at `t_s`."""
    if isinstance(error, FlightCodeFailed):
        return error.outcome, str(error)
    if isinstance(error, Interrupted):
        return Outcome.INTERRUPTED, f"interrupted {t_s:.1f} s after power-up"
    if isinstance(error, TimedOut):
        return Outcome.TIMED_OUT, f"the time for this flight was up {t_s:.1f} s after power-up"
    return Outcome.DIVERGED, str(error)


def make_ready(estimator: AttitudeEstimator, autopilot: Autopilot, log: Log) -> HeadingReference:
    """Reset the autopilot; give the oracle, and no other estimator, the log of the flight.

    Returns what the heading of the estimator converges to.
    """
    if issubclass(type(estimator), Oracle):  # isinstance() could be fooled by the class
        estimator.watch(log)  # type: ignore[attr-defined]
    with blaming(Outcome.AUTOPILOT_FAILED, autopilot, 0.0):
        if hasattr(autopilot, "reset"):
            autopilot.reset()
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, 0.0):
        return reference_of(estimator)


def power_up(estimator: AttitudeEstimator, on_ground: ImuSample | None) -> None:
    """Reset the estimator with the mean inertial sample `on_ground`, or None if there is none."""
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, on_ground.t_s if on_ground else 0.0):
        if hasattr(estimator, "reset"):
            estimator.reset(on_ground)


def sense(plant: Plant, suite: Suite, log: Log) -> Log:
    """Fill the rows of `log` with the motion of `plant`, controls neutral, and what `suite` measures of it.

    The open loop: no estimator, no autopilot, and every row is filled even if the plant reports an outcome.

    Returns
    -------
    `log` itself
    """
    plant.reset(log)
    suite.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        suite.measure(k)
    return log


def mean_sample(rows: NDArray[Any]) -> ImuSample:
    """Mean inertial sample of measured rows, shape (n,), n > 0; its time is that of the last row."""
    gyro, force = rows["gyro_b_rad_s"].mean(axis=0), rows["force_b_m_s2"].mean(axis=0)
    return ImuSample(float(rows["t_s"][-1]), float(rows["dt_s"].sum()), gyro, force)
