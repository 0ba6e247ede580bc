"""The border between the loop and flight code: what is asked of it, and what is accepted as an answer.

Estimators and autopilots may be anyone's.  One that raises, or answers with something that is no rotation or no
command, ends the flight with a line that names the class, the time and the fault.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.interface import ActuatorCommand, Autopilot, Mode, Setpoint
from estimator.interface import Array, AttitudeEstimate, AttitudeEstimator, Health, Measurements
from estimator.jit import kernel
from sim.log import Outcome
from sim.signals import Interrupted, TimedOut, check
from sim.wording import described, printable

N_HEALTH, N_MODES = len(Health), len(Mode)
ROTATION_TOLERANCE = 1e-2  # largest |R R^T - I| that is still taken for a rotation
_UNKNOWN_WIND = np.full(3, np.nan)
_FAULTS = {
    1: "R_eb must have shape (3, 3), the vectors shape (3,)",
    2: "R_eb is not finite",
    3: f"R_eb is no rotation: |R R^T - I| above {ROTATION_TOLERANCE:g}, or a reflection",
    4: "omega_b_rad_s is not finite",
    5: "gyro_bias_b_rad_s is not finite",
    6: f"health is no Health: {', '.join(f'{h} {h.name}' for h in Health)}",
}
_COMMAND_FAULTS = {
    1: "aileron {0:g}, elevator {1:g}, rudder {2:g}, throttle {3:g}: must be within -1..1, the throttle within 0..1",
    2: f"mode {{4}} is no Mode: {', '.join(f'{m} {m.name}' for m in Mode)}",
}
_VECTORS = ((3, 3), (3,), (3,), (3,))


class Unusable(ValueError):
    """An answer of flight code that is no estimate or no command."""


class FlightCodeFailed(RuntimeError):
    """An estimator or autopilot raised or gave an unusable answer; `outcome` says which of the two."""

    def __init__(self, outcome: Outcome, who: object, t_s: float, fault: str) -> None:
        super().__init__(f"{type(who).__name__} at {t_s:.2f} s: {fault}")
        self.outcome = outcome


@kernel
def _record_estimate(flown, k, R_eb, omega, bias, wind, health):  # type: ignore[no-untyped-def]
    """Write the estimate into row `k`; returns 0, or the number of the fault."""
    row = flown[k]
    worst = 0.0
    for i in range(3):
        row.omega_b_rad_s[i], row.gyro_bias_b_rad_s[i], row.wind_e_m_s[i] = omega[i], bias[i], wind[i]
        for j in range(3):
            row.R_eb[i, j] = R_eb[i, j]
            dot = R_eb[i, 0] * R_eb[j, 0] + R_eb[i, 1] * R_eb[j, 1] + R_eb[i, 2] * R_eb[j, 2]
            off = abs(dot - 1.0 if i == j else dot)
            if not np.isfinite(off):
                return 2
            worst = max(worst, off)
    row.health = health
    if health < 0 or health >= N_HEALTH:
        return 6
    determinant = (
        R_eb[0, 0] * (R_eb[1, 1] * R_eb[2, 2] - R_eb[1, 2] * R_eb[2, 1])
        + R_eb[0, 1] * (R_eb[1, 2] * R_eb[2, 0] - R_eb[1, 0] * R_eb[2, 2])
        + R_eb[0, 2] * (R_eb[1, 0] * R_eb[2, 1] - R_eb[1, 1] * R_eb[2, 0])
    )
    if worst > ROTATION_TOLERANCE or determinant < 0.0:
        return 3
    if not np.isfinite(omega[0] + omega[1] + omega[2]):
        return 4
    if not np.isfinite(bias[0] + bias[1] + bias[2]):
        return 5
    return 0


@kernel
def _record_command(flown, k, aileron, elevator, rudder, throttle, mode, bank, pitch):  # type: ignore[no-untyped-def]
    """Write the command into row `k`; returns 0, or the number of the fault."""
    row = flown[k]
    row.aileron, row.elevator, row.rudder, row.throttle = aileron, elevator, rudder, throttle
    row.mode, row.bank_demand_rad, row.pitch_demand_rad = mode, bank, pitch
    if mode < 0 or mode >= N_MODES:
        return 2
    within = abs(aileron) <= 1.0 and abs(elevator) <= 1.0 and abs(rudder) <= 1.0 and 0.0 <= throttle <= 1.0
    return 0 if within else 1  # NaN is not within


def _as_floats(value: Any) -> Array:
    return np.ascontiguousarray(value, dtype=np.float64)


def record_estimate(flown: NDArray[Any], k: int, e: AttitudeEstimate) -> None:
    """Write estimate `e` into row `k` of `flown`; Unusable where it is none."""
    if e.__class__ is not AttitudeEstimate:
        raise Unusable(f"update() returned {type(e).__name__}, must return an AttitudeEstimate")
    R_eb, omega, bias, wind, health = e
    if wind is None:
        wind = _UNKNOWN_WIND
    if not (R_eb.__class__ is omega.__class__ is bias.__class__ is wind.__class__ is np.ndarray):
        R_eb, omega, bias, wind = _as_floats(R_eb), _as_floats(omega), _as_floats(bias), _as_floats(wind)
    if (R_eb.shape, omega.shape, bias.shape, wind.shape) != _VECTORS:
        raise Unusable(_FAULTS[1])
    fault = _record_estimate(flown, k, R_eb, omega, bias, wind, int(health))
    if fault:
        raise Unusable(_FAULTS[fault])


def record_command(flown: NDArray[Any], k: int, command: ActuatorCommand) -> None:
    """Write `command` into row `k` of `flown`; Unusable where it is none."""
    if command.__class__ is not ActuatorCommand:
        raise Unusable(f"update() returned {type(command).__name__}, must return an ActuatorCommand")
    fault = _record_command(flown, k, *command)
    if fault:
        raise Unusable(_COMMAND_FAULTS[fault].format(*command))


@contextmanager
def blaming(outcome: Outcome, who: object, t_s: float) -> Iterator[None]:
    """Turn whatever `who` raises inside the block into a FlightCodeFailed: it is a result of the flight."""
    try:
        yield
    except BaseException as error:
        raise _failure(outcome, who, t_s, error) from error


def _failure(outcome: Outcome, who: object, t_s: float, error: BaseException) -> FlightCodeFailed:
    """What ends the flight of `who`; raises instead where it is the command that shall end, or the time that is up."""
    if isinstance(error, Interrupted | TimedOut):
        raise error
    check()  # flight code may have swallowed it, and raised something else
    fault = printable(str(error)) if isinstance(error, Unusable) else described(error)
    return FlightCodeFailed(outcome, who, t_s, fault)


def estimate_of(estimator: AttitudeEstimator, measured: Measurements, flown: NDArray[Any], k: int) -> AttitudeEstimate:
    """Ask the estimator for tick `k` and record what it says; FlightCodeFailed where that is unusable."""
    try:
        estimate = estimator.update(measured)
        record_estimate(flown, k, estimate)
    except BaseException as error:
        raise _failure(Outcome.ESTIMATOR_FAILED, estimator, measured.imu.t_s, error) from error
    return estimate


def command_of(
    autopilot: Autopilot,
    estimate: AttitudeEstimate,
    measured: Measurements,
    setpoint: Setpoint,
    flown: NDArray[Any],
    k: int,
) -> ActuatorCommand:
    """Ask the autopilot for tick `k` and record what it commands; FlightCodeFailed where that is unusable."""
    try:
        command = autopilot.update(estimate, measured, setpoint)
        record_command(flown, k, command)
    except BaseException as error:
        raise _failure(Outcome.AUTOPILOT_FAILED, autopilot, measured.imu.t_s, error) from error
    return command
