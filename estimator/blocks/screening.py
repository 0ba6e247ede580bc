"""Screening of samples: every estimator handles NaN, spikes, repeated and lost samples in the same way.

The state of an estimator has the columns of `SCREEN` and of `compiled.BELIEF`.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.gps_integrity import WATCH, fix_is_sound
from estimator.compiler.jit import inlined
from estimator.interface import G_M_S2, GOOD, POOR, STARTING, Array, Column, ImuSample
from estimator.rotation import from_euler

SHORTEST_INTERVAL_S = 1e-6  # no gyro samples faster; quotients by an interval stay finite
LONGEST_GAP_S = 0.5  # after a longer gap the attitude is unknown: the estimate continues from where it was
CLOCK_BACK_S = 1.0  # a time this far back means that the clock was set
# An offset that is learnt up to a limit, and has been this close to it for this long, is larger than can be learnt.
AT_LIMIT, AT_LIMIT_S = 0.98, 10.0
COAST_S = 0.25  # how long the last good rate replaces rejected ones
# Beyond these a mean sample is not at rest; gyros are sold with offsets of up to +-40 deg/s.
AT_REST_RAD_S, AT_REST_G = math.radians(45.0), 0.2
AIRSPEED_RANGE_M_S = 1000.0

PASSED, GYRO_GOOD, FORCE_GOOD = 1, 2, 4  # bits that `screen` returns: time has passed, gyro and accelerometer are good
ALL_GOOD = 7

REFUSED = ("time", "gyro", "accelerometer", "gps", "magnetometer", "airspeed")
"""Names under which rejected samples are counted, in the column `refused`."""
TIME, GYRO, FORCE, GPS, MAG, AIR = range(len(REFUSED))

SCREEN = (
    Column("gyro_range_rad_s", (), "a rate beyond this is rejected"),
    Column("force_range_m_s2", (), "a specific force beyond this is rejected"),
    Column("started", (), "1 once a sample was accepted", integer=True),
    Column("t_s", (), "time of the last accepted sample, by the clock of the samples"),
    Column("clock_s", (), "elapsed time; never runs back"),
    Column("dt_s", (), "time that this tick covers"),
    Column("bad_s", (), "time without a good gyro sample"),
    Column("rejected", (), "ticks in which something was rejected", integer=True),
    Column("at_limit_s", (), "how long what is learnt has been at its limit"),
    Column("spoilt", (), "1 if this tick is already counted there", integer=True),
    Column("refused", (len(REFUSED),), "rejected samples by instrument, see REFUSED", integer=True),
    *WATCH,
)


@inlined
def _within(a, limit):  # type: ignore[no-untyped-def]
    """Whether all three components are within +-limit; NaN is not."""
    return (abs(a[0]) <= limit) & (abs(a[1]) <= limit) & (abs(a[2]) <= limit)  # cheaper than short-circuiting


@inlined
def _interval_s(row, s):  # type: ignore[no-untyped-def]
    """Time that this sample covers; 0 if its time or interval is impossible."""
    t, dt = row.t_s, row.dt_s
    if not (np.isfinite(t) and SHORTEST_INTERVAL_S <= dt <= LONGEST_GAP_S):
        return 0.0
    if s.started:
        gap = t - s.t_s
        if gap < -CLOCK_BACK_S:
            s.t_s = t  # this sample is lost, the next one counts
        if gap <= 0.0:
            return 0.0
        if 1.5 * dt < gap <= LONGEST_GAP_S:
            dt = gap  # samples were lost: this one covers them
    s.started = 1
    s.t_s = t
    return dt


@inlined
def refuse(s, what):  # type: ignore[no-untyped-def]
    """Count a rejected sample of the instrument `what` (an index of REFUSED), and the tick once."""
    s.refused[what] += 1
    if not s.spoilt:
        s.spoilt = 1
        s.rejected += 1


@inlined
def screen_gyro(row, s):  # type: ignore[no-untyped-def]
    """Check the time and the gyro of `row`, set ``s.dt_s``, count a rejection: without the accelerometer.

    Returns
    -------
    int    0 if no time has passed, else PASSED, with GYRO_GOOD if so
    """
    s.spoilt = 0
    s.dt_s = _interval_s(row, s)
    if s.dt_s <= 0.0:
        refuse(s, TIME)
        return 0
    s.clock_s += s.dt_s
    if _within(row.gyro_b_rad_s, s.gyro_range_rad_s):
        s.bad_s = 0.0
        return PASSED | GYRO_GOOD
    s.bad_s += s.dt_s
    refuse(s, GYRO)
    return PASSED


@inlined
def screen(row, s):  # type: ignore[no-untyped-def]
    """Check the inertial sample of `row`, set ``s.dt_s``, count a rejection.

    Returns
    -------
    int    0 if no time has passed, else PASSED, with GYRO_GOOD and FORCE_GOOD if so
    """
    good = screen_gyro(row, s)
    if good:
        if _within(row.force_b_m_s2, s.force_range_m_s2):
            good |= FORCE_GOOD
        else:
            refuse(s, FORCE)
    return good


@inlined
def fix_came(row, s):  # type: ignore[no-untyped-def]
    """Whether a fix arrived in `row` that can be true, see `gps_integrity`; counts a rejection."""
    if not row.gps_new:
        return False
    down, rate = s.R_eb[2], s.omega_b_rad_s
    if fix_is_sound(row, down[0] * rate[0] + down[1] * rate[1] + down[2] * rate[2], s):
        return True
    refuse(s, GPS)
    return False


@inlined
def airspeed_came(row, s):  # type: ignore[no-untyped-def]
    """Whether a plausible airspeed arrived in `row`; it may be below zero, as a pitot tube at rest reads.

    NaN is rejected only after a first airspeed: before, it means that no pitot tube is fitted or none has reported.
    Needs ``s.air_age_s``, infinite before the first.
    """
    if not row.air_new:
        return False
    if abs(row.equivalent_airspeed_m_s) < AIRSPEED_RANGE_M_S:
        return True
    if s.air_age_s < np.inf or not np.isnan(row.equivalent_airspeed_m_s):
        refuse(s, AIR)
    return False


@inlined
def watch_limit(learnt_b, limit, s):  # type: ignore[no-untyped-def]
    """Record how long `learnt_b`, shape (3,), has been at its `limit`: an axis there for `AT_LIMIT_S` is an illness.

    The offset of the gyro is then larger than what is subtracted, and the rest of it goes into the attitude.
    """
    near = AT_LIMIT * limit
    at_limit = (abs(learnt_b[0]) >= near) | (abs(learnt_b[1]) >= near) | (abs(learnt_b[2]) >= near)
    s.at_limit_s = s.at_limit_s + s.dt_s if at_limit else 0.0


@inlined
def health_of(s, found, referenced):  # type: ignore[no-untyped-def]
    """The `Health` of this tick: STARTING until the heading is `found`, GOOD while a fresh reference corrects it.

    POOR while a sample is rejected, without a reference, and at a limit, see `watch_limit`.
    """
    if s.spoilt:
        return POOR
    if not found:
        return STARTING
    return GOOD if referenced and s.at_limit_s < AT_LIMIT_S else POOR


@inlined
def take_rate(row, s, good):  # type: ignore[no-untyped-def]
    """Set ``s.omega_b_rad_s``: gyro less estimated bias; the last one if the sample is rejected, zero if that lasts."""
    for i in range(3):
        if good & GYRO_GOOD:
            s.omega_b_rad_s[i] = row.gyro_b_rad_s[i] - s.gyro_bias_b_rad_s[i]
        elif s.bad_s > COAST_S:
            s.omega_b_rad_s[i] = 0.0


def refusals(state: NDArray[Any]) -> dict[str, int]:
    """Rejected samples by instrument, from a state record of shape (1,)."""
    return {name: int(n) for name, n in zip(REFUSED, state["refused"][0], strict=True) if n}


def offset_at_rest(sample: ImuSample) -> Array:
    """Gyro offset from a mean sample at rest, shape (3,), rad/s; zero if it is not at rest."""
    offset = np.array(sample.gyro_b_rad_s, np.float64)
    return offset if np.all(np.abs(offset) < AT_REST_RAD_S) else np.zeros(3)


def attitude_at_rest(sample: ImuSample) -> Array:
    """Tilt from a mean sample at rest, heading north, shape (3, 3); level if it is not at rest."""
    x, y, z = (-float(f) for f in sample.force_b_m_s2)  # gravity in body axes
    if not abs(math.hypot(x, y, z) / G_M_S2 - 1.0) < AT_REST_G:
        return np.eye(3)
    return from_euler(math.atan2(y, z), math.atan2(-x, math.hypot(y, z)), 0.0)
