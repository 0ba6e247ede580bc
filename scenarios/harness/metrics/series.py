"""Series and metrics: attitude errors against the truth, and the motion of the aeroplane itself.

A series has a value per tick, a flag that says where it is judged, and times relative to the release.  A metric
reduces a flight to one value, with the number of samples used and the number expected of a whole window.  A flight that
ended early, or a window in which nothing was judged, has fewer samples than expected.

The attitude error is the angle of ``R_est @ R_true.T``.  Its two parts are the inclination error, the angle between the
two ``r_z`` rows, and the heading error, of ``atan2(r_yx, r_xx)``.  Heading is undefined near the vertical, and the
course at low speed: it is judged where ``|r_zx| < 0.9`` and the ground speed exceeds 3 m/s, or at rest on a table.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.interface import Mode
from estimator.blocks.kernels import wrap
from estimator.interface import Array, HeadingReference
from estimator.rotation import heading_error_rad, heading_rad, inclination_error_rad, rotation_error_rad
from sim.log import Flight, Outcome, Phase

STEEPEST_R_ZX = 0.9  # sine of the pitch beyond which heading is not judged
SLOWEST_M_S = 3.0  # ground speed below which there is no course
_ROUND_OFF_S = 1e-6  # of times; ticks lie at least milliseconds apart


class Measured(NamedTuple):
    """One value of a flight, with the number of samples it rests on and the number expected."""

    value: float
    samples: int = 1
    expected: int = 1

    @property
    def complete(self) -> bool:
        """Whether there were at least as many samples as expected."""
        return self.samples >= self.expected > 0


NOTHING = Measured(math.nan, 0, 1)
Metric = Callable[[Flight], Measured]
Moment = Callable[[Flight], float]  # seconds after the release, NaN if it never came


@dataclass(frozen=True, slots=True)
class Series:
    """A value per tick: times after the release, values, and where they are judged; each of shape (n,)."""

    t_s: Array
    value: Array
    judged: NDArray[np.bool_]

    def within(self, from_s: float, to_s: float) -> "Series":
        """The ticks that end later than `from_s` and no later than `to_s`."""
        inside = _inside(self.t_s, from_s, to_s)
        return Series(self.t_s[inside], self.value[inside], self.judged[inside])

    @property
    def judged_values(self) -> Array:
        """The values that are judged, shape (m,)."""
        return self.value[self.judged]


SeriesOf = Callable[[Flight], Series]


def _inside(t_s: Array, from_s: float, to_s: float) -> NDArray[np.bool_]:
    return (t_s > from_s + _ROUND_OFF_S) & (t_s <= to_s + _ROUND_OFF_S)


def time_s(flight: Flight) -> Array:
    """Times of the ticks after the release, s, shape (n,)."""
    return flight.log.truth["t_s"] - flight.release_s


def planned_end_s(flight: Flight) -> float:
    """Planned end of the flight, s after the release, from its manifest."""
    return float(flight.manifest["config"]["duration_s"])


def _series(flight: Flight, value: Array, judged: NDArray[np.bool_] | None = None) -> Series:
    t_s = time_s(flight)
    let_go = (flight.log.truth["phase"] >= Phase.FLYING) & (t_s > _ROUND_OFF_S)
    return Series(t_s, value, let_go if judged is None else let_go & judged)


def inclination_error_deg(flight: Flight) -> Series:
    """Angle between the estimated and the true vertical (the ``r_z`` rows), degrees."""
    log = flight.log
    return _series(flight, np.degrees(inclination_error_rad(log.flown["R_eb"], log.truth["R_eb"])))


def attitude_error_deg(flight: Flight) -> Series:
    """Angle of the rotation ``R_est @ R_true.T``, degrees."""
    log = flight.log
    return _series(flight, np.degrees(rotation_error_rad(log.flown["R_eb"], log.truth["R_eb"])))


def heading_error_deg(against: HeadingReference | None = None) -> SeriesOf:
    """Size of the heading error, degrees, relative to the true nose or the true course over ground (without lag).

    None: relative to the heading reference of the flight's estimator.
    """

    def series(flight: Flight) -> Series:
        truth, R_est = flight.log.truth, flight.log.flown["R_eb"]
        R_true, v_e = truth["R_eb"], truth["v_e_m_s"]
        judged_against = against or flight.heading_reference
        if judged_against == "course":
            error = wrap(heading_rad(R_est) - np.arctan2(v_e[:, 1], v_e[:, 0]))
        else:
            error = heading_error_rad(R_est, R_true)
        judged = np.hypot(v_e[:, 0], v_e[:, 1]) > SLOWEST_M_S
        if judged_against == "nose":
            judged |= truth["phase"] == Phase.RESTING
        judged &= np.abs(R_true[:, 2, 0]) < STEEPEST_R_ZX
        return _series(flight, np.degrees(np.abs(error)), judged)

    return series


def gyro_bias_error_deg_s(flight: Flight) -> Series:
    """Length of the difference between the estimated and the true gyro bias, deg/s."""
    difference = flight.log.flown["gyro_bias_b_rad_s"] - flight.log.truth["gyro_bias_b_rad_s"]
    return _series(flight, np.degrees(np.linalg.norm(difference, axis=1)))


def rate_size_deg_s(axis: str) -> SeriesOf:
    """Size of the true rate about the body `axis`, x, y or z, deg/s: mean over the tick."""
    i = "xyz".index(axis)
    return lambda flight: _series(flight, np.degrees(np.abs(flight.log.truth["imu_omega_b_rad_s"][:, i])))


def rate_error_deg_s(axis: str) -> SeriesOf:
    """Error of the drift-corrected rate about the body `axis`, x, y or z, deg/s: estimate less truth over the tick."""
    i = "xyz".index(axis)

    def series(flight: Flight) -> Series:
        error = flight.log.flown["omega_b_rad_s"][:, i] - flight.log.truth["imu_omega_b_rad_s"][:, i]
        return _series(flight, np.degrees(error))

    return series


def wind_error_m_s(flight: Flight) -> Series:
    """Error of the estimated horizontal wind against the flight's mean true wind, m/s; judged where it is estimated."""
    mean = flight.log.truth["wind_e_m_s"][:, :2].mean(axis=0)
    value = np.linalg.norm(flight.log.flown["wind_e_m_s"][:, :2] - mean, axis=1)
    return _series(flight, value, np.isfinite(value))


def orthogonality_error(flight: Flight) -> Series:
    """Largest element of ``|R R^T - I|`` of the estimate."""
    R = flight.log.flown["R_eb"]
    return _series(flight, np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)))


def launch_distance_m(flight: Flight) -> Series:
    """True horizontal distance from the launch point."""
    p_e = flight.log.truth["p_e_m"]
    return _series(flight, np.hypot(p_e[:, 0], p_e[:, 1]))


def height_m(flight: Flight) -> Series:
    """True height above the launch point."""
    return _series(flight, -flight.log.truth["p_e_m"][:, 2])


def bank_size_deg(flight: Flight) -> Series:
    """Size of the true bank angle, degrees."""
    R = flight.log.truth["R_eb"]
    return _series(flight, np.degrees(np.abs(np.arctan2(R[:, 2, 1], R[:, 2, 2]))))


def believed_pitch_deg(flight: Flight) -> Series:
    """Estimated pitch angle, degrees."""
    return _series(flight, _pitch_deg(flight.log.flown["R_eb"]))


def _pitch_deg(R_eb: Array) -> Array:
    return np.degrees(np.arcsin(np.clip(-R_eb[:, 2, 0], -1.0, 1.0)))


def angle_of_attack_deg(flight: Flight) -> Series:
    """True angle of attack, degrees."""
    return _series(flight, np.degrees(flight.log.truth["alpha_rad"]))


def start(flight: Flight) -> float:  # noqa: ARG001 - a Moment like any other
    """The release."""
    return 0.0


def end(flight: Flight) -> float:
    """The planned end of the flight."""
    return planned_end_s(flight)


def last(flight: Flight) -> float:
    """The last tick flown, planned or not."""
    return float(time_s(flight)[-1]) if len(flight.log) else math.nan


def at(t_s: float) -> Moment:
    """The moment `t_s` after the release."""
    return lambda _flight: t_s


def after(moment: Moment, delay_s: float) -> Moment:
    """`delay_s` after `moment`."""
    return lambda flight: moment(flight) + delay_s


def rms(values: Array) -> float:
    """Root of the mean square; NaN if there are no values."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


def mean_size(values: Array) -> float:
    """Size of the mean, in which noise averages out; NaN if there are no values."""
    return float(abs(np.mean(values))) if len(values) else math.nan


def p95(values: Array) -> float:
    """95th percentile; NaN if there are no values."""
    return float(np.percentile(values, 95.0)) if len(values) else math.nan


def highest(values: Array) -> float:
    """The largest value; NaN if there are none."""
    return float(np.max(values)) if len(values) else math.nan


def lowest(values: Array) -> float:
    """The smallest value; NaN if there are none."""
    return float(np.min(values)) if len(values) else math.nan


def over(
    series: SeriesOf,
    reduce: Callable[[Array], float],
    from_: Moment = start,
    to: Moment = end,
    *,
    judged_share: float = 1.0,
) -> Metric:
    """Metric: the judged values of `series` between two moments, reduced to one.

    judged_share : the fraction of the window's ticks that must be judged, 0..1
    """

    def metric(flight: Flight) -> Measured:
        from_s, to_s = from_(flight), to(flight)
        if not to_s > from_s:  # or one of them is NaN
            return NOTHING
        values = series(flight).within(from_s, to_s).judged_values
        whole = math.floor((to_s - from_s) / flight.dt_s + 1e-6) - 1  # a tick may straddle either end
        return Measured(reduce(values), len(values), max(1, math.floor(judged_share * whole)))

    return metric


def settled_after_s(series: Series, limit: float) -> float:
    """Time from the start of `series` until the value stays at or below `limit`; NaN if it never does.

    It counts to the first tick that is judged and good after the last one that is judged and is not.  Ticks that are
    not judged say nothing, as where the ground speed is too low for a course; at the end they are NaN.
    """
    if len(series.t_s) == 0:
        return math.nan
    good = series.judged & (series.value <= limit)
    if not good[-1]:
        return math.nan
    bad = np.flatnonzero(series.judged & ~good)
    after = bad[-1] + 1 if len(bad) else 0
    return float(series.t_s[after + np.argmax(good[after:])] - series.t_s[0])


def settling(series: SeriesOf, limit: float, from_: Moment = start, to: Moment = end) -> Metric:
    """Metric: time after `from_` until `series` stays at or below `limit` up to `to`, s."""

    def metric(flight: Flight) -> Measured:
        from_s, to_s = from_(flight), to(flight)
        if not to_s > from_s:
            return NOTHING
        window = series(flight).within(from_s, to_s)
        whole = math.floor((to_s - from_s) / flight.dt_s + 1e-6) - 1
        return Measured(settled_after_s(window, limit), len(window.t_s), max(1, whole))

    return metric


def survived(flight: Flight) -> Measured:
    """Metric: 1 if the flight lasted as long as planned, else 0."""
    return Measured(float(flight.outcome == Outcome.COMPLETED))


def ground_contact_s(flight: Flight) -> Measured:
    """Metric: when it hit the ground, s after the release; not measured if it did not."""
    return Measured(last(flight)) if flight.outcome == Outcome.GROUND_CONTACT else NOTHING


def pitch_at_ground_deg(flight: Flight) -> Measured:
    """Metric: true pitch when it hit the ground, degrees; not measured if it did not."""
    if flight.outcome != Outcome.GROUND_CONTACT or not len(flight.log):
        return NOTHING
    return Measured(float(_pitch_deg(flight.log.truth["R_eb"])[-1]))


def height_at_m(t_s: float) -> Metric:
    """Metric: true height above the launch point `t_s` after the release."""

    def metric(flight: Flight) -> Measured:
        values = height_m(flight).within(t_s - flight.dt_s, t_s).value
        return Measured(float(values[-1])) if len(values) else NOTHING

    return metric


def launch_distance_at_m(t_s: float) -> Metric:
    """Metric: true horizontal distance from the launch point `t_s` after the release."""

    def metric(flight: Flight) -> Measured:
        values = launch_distance_m(flight).within(t_s - flight.dt_s, t_s).value
        return Measured(float(values[-1])) if len(values) else NOTHING

    return metric


def nearest_m(from_s: float, to_s: float) -> Metric:
    """Metric: smallest horizontal distance from the launch point between two times, m."""
    return lambda flight: Measured(lowest(launch_distance_m(flight).within(from_s, to_s).judged_values))


def pass_time_s(radius_m: float) -> Metric:
    """Metric: when the launch point was first passed within `radius_m`, s after the release; NaN if never."""

    def metric(flight: Flight) -> Measured:
        distance = launch_distance_m(flight)
        near = np.flatnonzero(distance.judged & (distance.value <= radius_m))
        return Measured(float(distance.t_s[near[0]]) if len(near) else math.nan)

    return metric


def time_in_mode_s(mode: Mode) -> Metric:
    """Metric: how long `mode` was in force after the release, as the autopilot reports it, s."""
    return lambda flight: Measured(flight.dt_s * int(np.sum((flight.log.flown["mode"] == mode) & (time_s(flight) > 0))))


def summary(flight: Flight) -> dict[str, float | None]:
    """The general metrics of a flight, from the release to its end, by name with unit; None if not measurable.

    ``heading_rms_deg`` is relative to the heading reference of the flight's estimator, the nose or the course.
    """
    incline, geodesic = inclination_error_deg(flight), attitude_error_deg(flight)
    course, nose = heading_error_deg("course")(flight), heading_error_deg("nose")(flight)
    heading = course if flight.heading_reference == "course" else nose
    numbers = {
        "inclination_rms_deg": rms(incline.judged_values),
        "inclination_p95_deg": p95(incline.judged_values),
        "inclination_max_deg": highest(incline.judged_values),
        "heading_rms_deg": rms(heading.judged_values),
        "heading_against_course_rms_deg": rms(course.judged_values),
        "heading_against_nose_rms_deg": rms(nose.judged_values),
        "attitude_rms_deg": rms(geodesic.judged_values),
        "gyro_bias_error_rms_deg_s": rms(gyro_bias_error_deg_s(flight).judged_values),
        "wind_error_rms_m_s": rms(wind_error_m_s(flight).judged_values) if len(flight.log) else math.nan,
        "orthogonality_max": highest(orthogonality_error(flight).judged_values),
        "height_min_m": lowest(height_m(flight).judged_values),
        "flown_s": float(time_s(flight)[-1]) if len(flight.log) else math.nan,
    }
    return {name: value if math.isfinite(value) else None for name, value in numbers.items()}
