"""The loop: the one place that orders the calls.

    plant -> truth -> sensors -> measurements -> estimator -> estimate -> autopilot -> command -> plant

Nothing is written while flying except into the rows of the log.  Whatever ends a flight, the rows up to there
are returned.
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

Watch = Callable[[Log, int], None]  # shown the log and the number of its rows that are filled


def fly(
    plant: Plant,
    suite: Suite,
    estimator: AttitudeEstimator,
    autopilot: Autopilot,
    script: Script,
    log: Log,
    *,
    calibration_s: float = 0.0,
    on_ground: ImuSample | None = None,
    manifest: dict[str, Any] | None = None,
    watch: Watch | None = None,
) -> Flight:
    """Fly until the rows of `log` are full or the flight ends.

    Parameters
    ----------
    script          set-points by time since the release
    calibration_s   time after power-up over which the inertial samples are averaged for ``estimator.reset``;
                    0 where the flight starts in the air
    on_ground       what ``estimator.reset`` is given then: a mean sample from before the flight, or None
    manifest        seed, resolved configuration, versions: goes into the recording
    watch           called once a simulated second with the log and the number of rows filled so far
    """
    outcome, message, k = Outcome.COMPLETED, "", 0
    reference: HeadingReference = "course"
    second, tick_ns, late = round(1.0 / plant.dt_s), 1e9 * plant.dt_s, 0
    to_release_s = plant.dt_s - plant.release_s
    command = NEUTRAL
    try:
        with listening():
            plant.reset(log)
            suite.reset(log)
            reference = make_ready(estimator, autopilot, log)
            n_calibration = round(calibration_s / plant.dt_s)
            for k in range(len(log)):
                ended = plant.advance(k, command)
                if ended is not None:
                    outcome = ended
                    break
                measured = suite.measure(k)
                if k < n_calibration:
                    record_command(log.flown, k, command)
                    continue
                if k == n_calibration:
                    power_up(estimator, mean_sample(log.measured[:k]) if k else on_ground)
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
    except FlightCodeFailed as failure:
        outcome, message = failure.outcome, str(failure)
    except SimulationDiverged as blow_up:
        outcome, message = Outcome.DIVERGED, str(blow_up)
    except Interrupted:
        outcome, message = Outcome.INTERRUPTED, f"interrupted {k * plant.dt_s:.1f} s after power-up"
    except TimedOut:
        outcome = Outcome.TIMED_OUT
        message = f"the time for this flight was up {k * plant.dt_s:.1f} s after power-up"
    flown = log.until(k)
    events = events_of(flown, outcome, message, script, plant.release_s)
    return Flight(flown, plant.dt_s, plant.release_s, outcome, reference, message, events, manifest or {}, late)


def make_ready(estimator: AttitudeEstimator, autopilot: Autopilot, log: Log) -> HeadingReference:
    """Reset the autopilot; show the oracle, and nobody else, the log of the flight to come.

    Returns what the heading of the estimator converges to.
    """
    if issubclass(type(estimator), Oracle):  # isinstance() would believe a class that says it is one
        estimator.watch(log)  # type: ignore[attr-defined]
    with blaming(Outcome.AUTOPILOT_FAILED, autopilot, 0.0):
        if hasattr(autopilot, "reset"):
            autopilot.reset()
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, 0.0):
        return reference_of(estimator)


def power_up(estimator: AttitudeEstimator, on_ground: ImuSample | None) -> None:
    """Switch the estimator on with the mean inertial sample `on_ground`, or None where there is none."""
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
