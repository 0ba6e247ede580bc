"""`estimate`: plain arrays in, attitude out."""

import difflib
import warnings
from collections.abc import Mapping
from typing import Any, NotRequired, SupportsFloat, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingslevel._attitudes import Attitudes
from wingslevel._conditions import Estimator, number_of, params_of, plain
from wingslevel._errors import WingslevelError, WingslevelWarning, one_line

Array = NDArray[np.float64]
FASTEST_RAD_S, LEAST_M_S2 = 3.0, 4.0  # medians of a gyro in deg/s, of an accelerometer in g
INTERVAL_S = (1e-5, 0.5)  # plausible medians of the sample interval
FIELD_UT = (2.0, 200.0)  # plausible medians of a magnetometer; the field of the earth has 22 to 67


class GpsArrays(TypedDict):
    """M fixes of a GPS.

    t_s : shape (M,), when each arrived, on the clock of the inertial samples
    v_e_m_s : shape (M, 3), velocity over the ground, north, east, down; down is NaN or 0 where it is not reported
    p_e_m : shape (M, 3), position from any fixed point; without it no estimator knows where it is
    stamp_s : shape (M,), when each was true by its own stamp, on the same clock
    """

    t_s: ArrayLike
    v_e_m_s: ArrayLike
    p_e_m: NotRequired[ArrayLike]
    stamp_s: NotRequired[ArrayLike]


class MagArrays(TypedDict):
    """M samples of a magnetometer: `t_s` of shape (M,), `field_b_ut` of shape (M, 3), microtesla."""

    t_s: ArrayLike
    field_b_ut: ArrayLike


class AirArrays(TypedDict):
    """M samples of air data: `t_s` of shape (M,), equivalent airspeed and barometric height of shape (M,)."""

    t_s: ArrayLike
    equivalent_airspeed_m_s: NotRequired[ArrayLike]
    height_m: NotRequired[ArrayLike]


def estimate(
    t_s: ArrayLike,
    gyro_b_rad_s: ArrayLike,
    force_b_m_s2: ArrayLike,
    *,
    gps: GpsArrays | None = None,
    mag: MagArrays | None = None,
    air: AirArrays | None = None,
    estimator: Estimator = "premerlani",
    params: Mapping[str, Any] | None = None,
    calibration_s: SupportsFloat = 0.0,
) -> Attitudes:
    """Estimate the attitude from arrays of measurements, in one call.

    Parameters
    ----------
    t_s             shape (N,), seconds, increasing: end of each inertial sample.  Or one number, their interval
    gyro_b_rad_s    shape (N, 3), angular rates, body axes forward, right, down
    force_b_m_s2    shape (N, 3), specific force (acceleration minus gravity): level at rest (0, 0, -9.8)
    gps, mag, air   measurements of other instruments, see `GpsArrays`, `MagArrays`, `AirArrays`
    estimator       registered name, ``module:Class``, ``file.py:Class``, a class, or a function that makes a new one
    params          its parameters by name, and what is known of the instruments, ``{"gps_latency_s": 0.3}``
    calibration_s   seconds at the start whose mean gives tilt and gyro offset at power-up.  Ask for it only if the
                    device is at rest then: a slow steady turn cannot be told from a gyro offset.  0 is none; a start
                    that moves too much is not used.  `Attitudes.calibration_b_rad_s` is the offset that was taken

    Returns
    -------
    Attitude, rates, offsets of the gyros, wind and health, a row for each sample.

    Raises
    ------
    WingslevelError     shapes that do not fit, NaN or non-numeric values, times that do not increase, an
                        estimator that cannot be found or that fails
    """
    from scenarios.harness.replay import Window, replay

    with one_line():
        log = _log(t_s, gyro_b_rad_s, force_b_m_s2, gps, mag, air)
        window = Window(calibration_s=number_of("calibration_s", calibration_s))
        replayed = replay(log, plain(estimator), params_of(params), window)
    if replayed.failure:
        raise WingslevelError(replayed.failure)
    return Attitudes(replayed)


def _log(t_s: Any, gyro: Any, force: Any, gps: Any, mag: Any, air: Any) -> Any:
    """The measurements as a log ready for replay."""
    from estimator.instruments import Known
    from estimator.interface import MEASURED_DTYPE
    from scenarios.harness.logs.properties import measured
    from scenarios.harness.logs.recorded import RecordedLog

    gyro_b_rad_s, force_b_m_s2 = _array("gyro_b_rad_s", gyro, 3), _array("force_b_m_s2", force, 3)
    n = len(gyro_b_rad_s)
    if len(force_b_m_s2) != n:
        raise WingslevelError(f"force_b_m_s2 has {len(force_b_m_s2)} rows, gyro_b_rad_s has {n}")
    if n < 2:
        raise WingslevelError(f"gyro_b_rad_s has {n} rows: at least 2 are needed")
    _warn_of_units(gyro_b_rad_s, force_b_m_s2)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"] = _times(t_s, n)
    steps = np.diff(rows["t_s"])
    _warn_of_interval(float(np.median(steps)))
    rows["dt_s"] = np.concatenate(([np.median(steps)], steps))
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = gyro_b_rad_s, force_b_m_s2
    rows["equivalent_airspeed_m_s"] = rows["baro_height_m"] = np.nan
    instruments = ["gyro", "accelerometer"]
    for name, given, take in (("gps", gps, _take_gps), ("magnetometer", mag, _take_mag), ("airspeed", air, _take_air)):
        if given is not None:
            take(rows, given)
            instruments.append(name)
    known = {**measured(rows), "gps_stamped": Known("stamp_s" in (gps or {}), "log", "stamp_s")}
    return RecordedLog(rows, "arrays", tuple(instruments), known=known)


def _times(given: Any, n: int) -> Array:
    """Times of `n` samples, shape (n,), of times or of an interval."""
    times = np.asarray(given, dtype=np.float64)
    if times.ndim == 0:
        if not (np.isfinite(times) and times > 0.0):
            raise WingslevelError(f"t_s = {float(times)!r} s: an interval must be above 0")
        return np.asarray(np.arange(1, n + 1) * float(times))
    times = _array("t_s", times, 0)
    if len(times) != n:
        raise WingslevelError(f"t_s has {len(times)} rows, gyro_b_rad_s has {n}")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        k = int(back[0]) + 1
        raise WingslevelError(f"t_s[{k}] = {times[k]:.9g} s follows {times[k - 1]:.9g} s: times must increase")
    return times


def _array(name: str, given: Any, width: int, *, holes: bool = False) -> Array:
    """`given` as shape (M, width), or (M,) where `width` is 0; with `holes` it may hold NaN."""
    right = f"(N, {width})" if width else "(N,)"
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise WingslevelError(f"{name} is not an array of numbers; it must have shape {right}") from None
    if values.ndim != (2 if width else 1) or (width and values.shape[1] != width):
        raise WingslevelError(f"{name} has shape {values.shape}; it must be {right}")
    bad = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
    if len(bad) and not holes:
        raise WingslevelError(
            f"{name}[{int(bad[0])}] = {values[bad[0]].tolist()}: remove rows that contain NaN or infinity"
        )
    return values


def _warn_of_units(gyro: Array, force: Array) -> None:
    """Warn of what looks like other units, or another sign."""
    fast, heavy = (float(np.median(np.linalg.norm(v, axis=1))) for v in (gyro, force))
    warned = ""
    if fast > FASTEST_RAD_S:
        warned = f"gyro_b_rad_s has a median of {fast:.3g} rad/s: is it in degrees per second?"
    elif heavy < LEAST_M_S2:
        warned = f"force_b_m_s2 has a median of {heavy:.3g} m/s^2: is it in g, or without gravity?"
    elif float(np.median(force[:, 2])) > LEAST_M_S2:
        warned = "force_b_m_s2 points down: level at rest, in axes forward, right, down, it must be (0, 0, -9.8)"
    if warned:
        warnings.warn(warned, WingslevelWarning, stacklevel=4)


def _warn_of_interval(interval_s: float) -> None:
    """Warn of a sample interval that no inertial sensor has."""
    if not INTERVAL_S[0] <= interval_s <= INTERVAL_S[1]:
        warned = f"t_s has a median interval of {interval_s:.3g} s, which is implausible: t_s must be in seconds"
        warnings.warn(warned, WingslevelWarning, stacklevel=4)


def _arrivals(name: str, given: Mapping[str, Any], fields: Mapping[str, int], rows: Any) -> dict[str, Any]:
    """Arrays of an instrument by field, with the row of each sample under "at" ("new" where rows have one)."""
    if not isinstance(given, Mapping):
        raise WingslevelError(f"{name} is {type(given).__name__}; it must be a dict with {', '.join(('t_s', *fields))}")
    odd = [key for key in given if key not in ("t_s", *fields)]
    if odd or "t_s" not in given:
        wrong = f"holds {odd[0]!r}" if odd else "holds no 't_s'"
        near = difflib.get_close_matches(odd[0], fields, n=1, cutoff=0.5) if odd and isinstance(odd[0], str) else []
        wrong += f", did you mean {near[0]!r}?" if near else ":"
        raise WingslevelError(f"{name} {wrong} it may hold {', '.join(('t_s', *fields))}")
    t_s = _array(f"{name}['t_s']", given["t_s"], 0)
    found: dict[str, Any] = {}
    for field, width in fields.items():
        if field in given:
            found[field] = _array(f"{name}[{field!r}]", given[field], width, holes=True)
            if len(found[field]) != len(t_s):
                raise WingslevelError(f"{name}[{field!r}] has {len(found[field])} rows, its t_s has {len(t_s)}")
    if np.any(np.diff(t_s) < 0.0):
        raise WingslevelError(f"{name}['t_s'] must not decrease")
    at = np.searchsorted(rows["t_s"], t_s - 1e-9)
    began_s = rows["t_s"][0] - rows["dt_s"][0]
    inside = (at < len(rows)) & (t_s > began_s - 1e-9)
    if not inside.any():
        first_s, last_s = (round(float(t), 9) + 0.0 for t in (began_s, rows["t_s"][-1]))
        raise WingslevelError(f"{name}['t_s']: no sample between {first_s:.9g} s and {last_s:.9g} s")
    last = np.full(len(rows), -1)
    last[at[inside]] = np.flatnonzero(inside)  # of several in a row the last one stays
    found["new"], found["last"] = last >= 0, np.maximum.accumulate(last)
    return found


def _held(found: Mapping[str, Any], name: str, before: float = 0.0) -> Any:
    """The last value of a field so far in each row, `before` the first one; None where the field was not given."""
    if name not in found:
        return None
    values, last = found[name], found["last"]
    shape = (len(last),) + (1,) * (values.ndim - 1)
    return np.where((last >= 0).reshape(shape), values[last], before)


def _take_gps(rows: Any, given: Any) -> None:
    from scenarios.harness.logs.validity import usable

    found = _arrivals("gps", given, {"v_e_m_s": 3, "p_e_m": 3, "stamp_s": 0}, rows)
    velocity = _held(found, "v_e_m_s")
    if velocity is None:
        raise WingslevelError("gps holds no 'v_e_m_s'")
    good = np.isfinite(velocity[:, :2]).all(axis=1)
    new = found["new"] & good
    velocity = np.where(np.isfinite(velocity), velocity, 0.0)
    rows["gps_new"], rows["gps_v_e_m_s"] = new, velocity
    rows["gps_valid"] = usable(new, rows["t_s"], found["new"] & ~good)
    rows["gps_course_rad"] = np.arctan2(velocity[:, 1], velocity[:, 0]) % (2.0 * np.pi)
    rows["gps_speed_m_s"] = np.hypot(velocity[:, 0], velocity[:, 1])
    position, stamp = _held(found, "p_e_m"), _held(found, "stamp_s", np.nan)
    rows["gps_t_s"] = np.nan if stamp is None else stamp
    if position is not None:
        rows["gps_p_e_m"] = np.where(np.isfinite(position), position, 0.0)


def _take_mag(rows: Any, given: Any) -> None:
    found = _arrivals("mag", given, {"field_b_ut": 3}, rows)
    field = _held(found, "field_b_ut")
    if field is None:
        raise WingslevelError("mag holds no 'field_b_ut'")
    good = np.isfinite(field).all(axis=1)
    size_ut = np.linalg.norm(field[found["new"] & good], axis=1)
    if len(size_ut) and not FIELD_UT[0] <= (median_ut := float(np.median(size_ut))) <= FIELD_UT[1]:
        warned = f"mag['field_b_ut'] has a median size of {median_ut:.3g} uT: is it in gauss, milligauss or nanotesla?"
        warnings.warn(warned, WingslevelWarning, stacklevel=4)
    rows["mag_new"], rows["mag_b_ut"] = found["new"] & good, np.where(good[:, None], field, 0.0)


def _take_air(rows: Any, given: Any) -> None:
    found = _arrivals("air", given, {"equivalent_airspeed_m_s": 0, "height_m": 0}, rows)
    rows["air_new"] = found["new"]
    for field, column in (("equivalent_airspeed_m_s", "equivalent_airspeed_m_s"), ("height_m", "baro_height_m")):
        values = _held(found, field, np.nan)
        if values is not None:
            rows[column] = values
