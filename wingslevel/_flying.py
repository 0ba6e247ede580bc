"""`fly` and `load`."""

import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex, Unpack

from wingslevel._conditions import (
    Conditions,
    Estimator,
    changes_of,
    number_of,
    path_of,
    plain,
    shortly,
    with_conditions,
)
from wingslevel._crew import quietly
from wingslevel._errors import Interrupted, WingslevelError, WingslevelWarning, one_line
from wingslevel._flight import Flight, rows_of
from wingslevel._progress import Progress, progress_of

if TYPE_CHECKING:
    from scenarios.harness.config import FlightConfig
    from scenarios.harness.scenario import Scenario
    from sim.log import Log


@with_conditions
def fly(
    scenario: "str | os.PathLike[str] | Scenario",
    *,
    estimator: Estimator | None = None,
    params: Mapping[str, Any] | None = None,
    seed: SupportsIndex | None = None,
    timeout: SupportsFloat | None = None,
    progress: Progress = False,
    **conditions: Unpack[Conditions],
) -> Flight:
    """Fly a scenario once, and judge it.

    Parameters
    ----------
    scenario        name, ``file.py``, or a `Scenario`
    estimator       registered name, ``module:Class``, ``file.py:Class``, ``library.so``, a class, or a function that
                    makes a new one; None is the one of the scenario
    params          its parameters by name
    seed            selects noise, turbulence and throw; the same seed repeats the flight bit for bit.  None is that
                    of the scenario, 0
    timeout         wall-clock limit, seconds; the flight then ends as "timed_out"
    progress        True shows a bar where it takes longer than two seconds; or a function of (done_s, total_s)

    Returns
    -------
    The flight, however it ended: an estimator that raises is an outcome, and fails the verdict.

    Raises
    ------
    WingslevelError     one line: an unknown scenario or estimator, or an invalid value; nothing has been flown then
    Interrupted         Ctrl-C; its `result` is the flight up to that point
    """
    from scenarios.harness.flight import prepare
    from scenarios.harness.scenario import Scenario
    from scenarios.harness.verdict import judge
    from sim import recording
    from sim.log import Outcome

    changes = changes_of(fly, conditions, params)
    flown_in = scenario if isinstance(scenario, Scenario) else path_of("scenario", scenario)
    with quietly(), _timed(timeout):
        prepared = prepare(flown_in, changes, seed=plain(seed), estimator=plain(estimator))
        _warn_of_faults(prepared.scenario.name, prepared.config)
        with progress_of(progress, f"flying {prepared.scenario.name}", "s") as advance:

            def watch(log: "Log", n_rows: int) -> None:
                dt_s = 1.0 / prepared.config.rates.imu_hz
                advance(n_rows * dt_s, len(log) * dt_s)

            flown = prepared.fly(watch)
    judged = judge(prepared.scenario, flown)
    flown = replace(flown, manifest={**flown.manifest, "verdict": recording.plain(judged.rows)})
    flight = Flight(flown, judged)
    if flown.outcome == Outcome.INTERRUPTED:
        raise Interrupted(flight)
    return flight


@contextmanager
def _timed(timeout: SupportsFloat | None) -> Iterator[None]:
    """Limit what the block takes."""
    from sim.outside.signals import TimedOut, limited

    limit_s = None if timeout is None else number_of("timeout", timeout)
    if limit_s is not None and not 0.0 < limit_s < 1e6:
        raise WingslevelError(f"timeout = {shortly(timeout)} s: must be above 0 and below 1e6, or None")
    try:
        with limited(limit_s):
            yield
    except TimedOut:  # before the first tick, or after the last
        raise WingslevelError(f"timeout = {timeout!r} s: over before the flight began") from None


def _warn_of_faults(scenario: str, config: "FlightConfig") -> None:
    """Warn of faults for which the flight is too short."""
    from scenarios.harness.config.faults import never_met

    for line in never_met(scenario, config.faults, config.held_s, config.duration_s):
        warnings.warn(line, WingslevelWarning, stacklevel=3)


def load(path: str | os.PathLike[str]) -> Flight:
    """The flight recorded at `path`: a folder that `Flight.save` or the command wrote, or its ``flight.parquet``.

    Its verdict is the one recorded with it.

    Raises
    ------
    WingslevelError     one line: no recording, a truncated one, or one of another version
    """
    from scenarios.harness.verdict import FlightVerdict, metrics_of
    from sim import recording

    with one_line():
        recorded = recording.load(Path(path_of("path", path)))
        rows = rows_of(recorded)
        config = recorded.manifest.get("config")
        if rows is None or not config:
            return Flight(recorded)
        judged = FlightVerdict(
            str(recorded.manifest.get("scenario", "")), config["estimator"], config["seed"], recorded.outcome, rows,
            metrics_of(recorded, [row for row in rows if row.name != "milestones"]), recorded.message,
            config["flight"], Flight(recorded).known,
        )  # fmt: skip
        return Flight(recorded, judged)
