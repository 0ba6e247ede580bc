"""Calls of flight code and the checks of its results.

Estimators and autopilots may be user code.  One that raises, or returns something that is not a rotation or not a
command, ends the flight with a message that names the class, the time, the fault and the line of its file.
"""

import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.interface import ActuatorCommand, Autopilot, Mode, Setpoint
from estimator.compiler.jit import kernel
from estimator.interface import Array, AttitudeEstimate, AttitudeEstimator, HeadingReference, Health, Measurements
from sim.log import Outcome
from sim.outside.blame import Refused, home_of, shown, summary, theirs
from sim.outside.signals import check
from sim.outside.wording import class_name

N_HEALTH, N_MODES = len(Health), len(Mode)
ROTATION_TOLERANCE = 1e-2  # largest |R R^T - I| accepted as a rotation
_UNKNOWN_WIND = np.full(3, np.nan)
LARGEST = 1e6  # rad/s, m/s: of a valid rate, bias or wind
_FAULTS = {
    2: "R_eb is not finite",
    3: f"R_eb is not a rotation: |R R^T - I| above {ROTATION_TOLERANCE:g}, or a reflection",
    4: f"omega_b_rad_s is not finite, or beyond {LARGEST:g} rad/s",
    5: f"gyro_bias_b_rad_s is not finite, or beyond {LARGEST:g} rad/s",
    6: f"health is not a Health: {', '.join(f'{h} {h.name}' for h in Health)}",
    7: f"wind_e_m_s is beyond {LARGEST:g} m/s",
}
_COMMAND_FAULTS = {
    1: "aileron {0:g}, elevator {1:g}, rudder {2:g}, throttle {3:g}: must be within -1..1, the throttle within 0..1",
    2: f"mode {{0}} is not a Mode: {', '.join(f'{m} {m.name}' for m in Mode)}",
}
_VECTORS = ((3, 3), (3,), (3,), (3,))
_COLUMNS = dict(
    zip(("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "wind_e_m_s", "health"), (*_VECTORS, ()), strict=True)
)
_ndarray = np.ndarray  # faster than the attribute


class Unusable(Refused):
    """A result of flight code that is not a valid estimate or command."""


class FlightCodeFailed(RuntimeError):
    """An estimator or autopilot raised or returned an invalid result; `outcome` says which of the two."""

    def __init__(self, outcome: Outcome, who: object, t_s: float, fault: str) -> None:
        super().__init__(f"{class_name(who)} at {t_s:.2f} s: {fault}")
        self.outcome = outcome


@kernel
def _record_estimate(flown, k, R_eb, omega, bias, wind, health):  # type: ignore[no-untyped-def]
    """Write the estimate into row `k`; returns 0 or the number of the fault."""
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
    for i in range(3):
        if not abs(omega[i]) <= LARGEST:
            return 4
        if not abs(bias[i]) <= LARGEST:
            return 5
        if abs(wind[i]) > LARGEST:  # NaN: unknown
            return 7
    return 0


@kernel
def _record_estimates(flown, R_eb, omega, bias, wind, health):  # type: ignore[no-untyped-def]
    """Write an estimate into every row; returns the row of the first fault and its number, or 0."""
    for k in range(len(flown)):
        fault = _record_estimate(flown, k, R_eb[k], omega[k], bias[k], wind[k], health[k])
        if fault:
            return k, fault
    return len(flown), 0


@kernel
def _record_command(flown, k, aileron, elevator, rudder, throttle, mode, bank, pitch):  # type: ignore[no-untyped-def]
    """Write the command into row `k`; returns 0 or the number of the fault."""
    row = flown[k]
    row.aileron, row.elevator, row.rudder, row.throttle = aileron, elevator, rudder, throttle
    row.bank_demand_rad, row.pitch_demand_rad = bank, pitch
    if not 0 <= mode < N_MODES or mode != int(mode):  # rejects NaN
        return 2
    row.mode = mode
    within = abs(aileron) <= 1.0 and abs(elevator) <= 1.0 and abs(rudder) <= 1.0 and 0.0 <= throttle <= 1.0
    return 0 if within else 1  # NaN fails


def record_estimate(flown: NDArray[Any], k: int, e: AttitudeEstimate) -> AttitudeEstimate:
    """Write estimate `e` into row `k` of `flown`; Unusable if it is invalid.

    Returns `e`, converted to float arrays if it was given as lists or the like.
    """
    if type(e) is not AttitudeEstimate:
        raise Unusable(f"update() returned {class_name(e)}; it must return an AttitudeEstimate")
    try:
        R_eb, omega, bias, wind, health = e
        if wind is None:
            wind = _UNKNOWN_WIND
        if (
            R_eb.__class__ is omega.__class__ is bias.__class__ is wind.__class__ is _ndarray
            and (R_eb.shape, omega.shape, bias.shape, wind.shape) == _VECTORS
            and (health.__class__ is Health or health.__class__ is int)
        ):
            fault = _record_estimate(flown, k, R_eb, omega, bias, wind, int(health))
            if fault:
                raise Unusable(_FAULTS[fault])
            return e
    except Unusable:
        raise
    except Exception:  # arrays of any kind: checked in detail below
        pass
    e = _plain_estimate(e)
    fault = _record_estimate(
        flown, k, e.R_eb, e.omega_b_rad_s, e.gyro_bias_b_rad_s,
        _UNKNOWN_WIND if e.wind_e_m_s is None else e.wind_e_m_s, int(e.health),
    )  # fmt: skip
    if fault:
        raise Unusable(_FAULTS[fault])
    return e


def record_estimates(flown: NDArray[Any], estimates: object) -> tuple[int, str]:
    """Write the result of a ``replay()`` into `flown`, row by row as `record_estimate` would.

    Returns
    -------
    the number of valid rows, and the fault of the next one, empty if all are valid

    Raises
    ------
    Unusable      `estimates` is not a structured array of that many rows
    """
    n = len(flown)
    right = f"it must return a structured array of {n} rows with {', '.join(_COLUMNS)}"
    if not isinstance(estimates, np.ndarray) or estimates.dtype.names is None:
        raise Unusable(f"replay() returned {class_name(estimates)}; {right}")
    missing = [name for name in _COLUMNS if name not in estimates.dtype.names]
    if missing or estimates.shape != (n,):
        what = f"without {', '.join(missing)}" if missing else f"of shape {estimates.shape}"
        raise Unusable(f"replay() returned an array {what}; {right}")
    columns = [_numbers(name, estimates[name], (n, *shape)) for name, shape in _COLUMNS.items()]
    if not np.array_equal(columns[4], np.rint(columns[4])):
        raise Unusable(_FAULTS[6])
    good, fault = _record_estimates(flown, *columns[:4], np.clip(columns[4], -1, N_HEALTH).astype(np.int64))
    return good, _FAULTS[fault] if fault else ""


def _plain_estimate(e: AttitudeEstimate) -> AttitudeEstimate:
    """`e` in new float arrays; Unusable for other types or shapes."""
    if len(e) != len(AttitudeEstimate._fields):
        raise Unusable(f"the AttitudeEstimate has {len(e)} fields; it must have {len(AttitudeEstimate._fields)}")
    R_eb, omega, bias = (_numbers(name, e[i], _VECTORS[i]) for i, name in enumerate(AttitudeEstimate._fields[:3]))
    wind = None if e.wind_e_m_s is None else _numbers("wind_e_m_s", e.wind_e_m_s, (3,))
    try:
        health = Health(operator.index(e.health))
    except (TypeError, ValueError):
        raise Unusable(f"{_FAULTS[6]}; it is {shown(e.health)}") from None
    return AttitudeEstimate(R_eb, omega, bias, wind, health)


def _numbers(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """`value` as a new float array of that shape; Unusable if it is not one."""
    array = np.asarray(value)
    if array.shape != shape:
        raise Unusable(f"{name} has shape {array.shape}; it must have shape {shape}")
    if array.dtype.kind not in "fiu":
        raise Unusable(f"{name} is made of {array.dtype}; it must be made of numbers")
    if np.ma.isMaskedArray(value) and np.ma.getmaskarray(value).any():
        raise Unusable(f"{name} has masked elements")
    with np.errstate(over="ignore"):  # too large a number becomes infinite and is rejected
        return np.array(array, dtype=np.float64, order="C")


def record_command(flown: NDArray[Any], k: int, command: ActuatorCommand) -> ActuatorCommand:
    """Write `command` into row `k` of `flown`; Unusable if it is invalid.

    Returns `command`, converted to floats if it was given as another type.
    """
    if type(command) is not ActuatorCommand:
        raise Unusable(f"update() returned {class_name(command)}; it must return an ActuatorCommand")
    try:
        if not _record_command(flown, k, *command):
            return command
    except Exception:  # fields of any kind: checked in detail below
        pass
    command = _plain_command(command)
    fault = _record_command(flown, k, *command)
    if fault:
        raise Unusable(_COMMAND_FAULTS[fault].format(*command))
    return command


def _plain_command(command: ActuatorCommand) -> ActuatorCommand:
    """`command` in floats and an int; Unusable for other types."""
    names = ActuatorCommand._fields
    if len(command) != len(names):
        raise Unusable(f"the ActuatorCommand has {len(command)} fields; it must have {len(names)}")
    plain: dict[str, Any] = {}
    value: Any
    for name, value in zip(names, command, strict=True):
        if name == "mode":
            try:
                plain[name] = int(Mode(operator.index(value)))
            except (TypeError, ValueError):
                raise Unusable(_COMMAND_FAULTS[2].format(shown(value))) from None
        elif not issubclass(type(value), int | float | np.integer | np.floating):
            raise Unusable(f"{name} is {shown(value)}; it must be a number")
        else:
            try:
                plain[name] = float(value)
            except OverflowError:
                raise Unusable(f"{name} is {shown(value)}; it must be within -1..1") from None
    return ActuatorCommand(**plain)


def reference_of(estimator: object) -> HeadingReference:
    """What the heading of `estimator` converges to, by default the course; Unusable if neither course nor nose."""
    reference = getattr(estimator, "heading_reference", "course")
    if issubclass(type(reference), str):
        if str.__eq__(reference, "course"):
            return "course"
        if str.__eq__(reference, "nose"):
            return "nose"
    raise Unusable(f"heading_reference is {shown(reference)}; it must be 'course' or 'nose'")


def blaming(outcome: Outcome, who: object, t_s: float) -> theirs:
    """Turn any exception of `who` inside the block into a FlightCodeFailed, a result of the flight."""
    return theirs(lambda line: FlightCodeFailed(outcome, who, t_s, line), home_of(who))


def _failure(outcome: Outcome, who: object, measured: Measurements, error: BaseException) -> FlightCodeFailed:
    """The failure of `who`; raises instead if the command is interrupted or the time limit has passed."""
    check()  # flight code may have caught it and raised something else
    try:
        t_s = measured.imu.t_s
    except Exception:  # flight code may have reshaped the rows it was given
        t_s = float("nan")
    return FlightCodeFailed(outcome, who, t_s, summary(error, home_of(who)))


def estimate_of(estimator: AttitudeEstimator, measured: Measurements, flown: NDArray[Any], k: int) -> AttitudeEstimate:
    """Run the estimator for tick `k` and record its estimate; FlightCodeFailed if that is invalid."""
    try:
        return record_estimate(flown, k, estimator.update(measured))
    except BaseException as error:
        raise _failure(Outcome.ESTIMATOR_FAILED, estimator, measured, error) from error


def command_of(
    autopilot: Autopilot, estimate: AttitudeEstimate, measured: Measurements, setpoint: Setpoint,
    flown: NDArray[Any], k: int,
) -> ActuatorCommand:  # fmt: skip
    """Run the autopilot for tick `k` and record its command; FlightCodeFailed if that is invalid."""
    try:
        return record_command(flown, k, autopilot.update(estimate, measured, setpoint))
    except BaseException as error:
        raise _failure(Outcome.AUTOPILOT_FAILED, autopilot, measured, error) from error
