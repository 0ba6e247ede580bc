"""A memory of the motion in a frame to which later corrections of the attitude still apply.

Frame ``g`` is the earth frame by the gyros alone: ``R_gb`` integrates the corrected rate and nothing else.
Proportional corrections go into ``R_eg``, and the attitude is ``R_eb = R_eg @ R_gb``: Eqns 16 and 17 of Premerlani and
Bizard, with the proportional rate applied from the earth's side.

The counterpart of a late and filtered GPS velocity (integrated specific force, direction of the nose) is summed in
``g``, passes the receiver's filter there, and is recalled from one latency ago.  Multiplied by the present ``R_eg`` it
includes all corrections made since: the receiver's lag is then no lag in the feedback loop, whatever the gain.

The state has the columns of `GYRO_FRAME`, and the parameters ``gps_filter_s`` and ``gps_latency_s``.
"""

import math

import numpy as np

from estimator.blocks.screening import COAST_S, FORCE_GOOD, LONGEST_GAP_S
from estimator.compiler.jit import inlined, kernel
from estimator.interface import G_M_S2, Column
from estimator.rotation import integrate, level, renormalise

HISTORY, SPACING_S = 640, 0.0199  # remembered instants and their spacing: 12.7 s at any sample rate
DUE_S = 0.05  # corrections are slow: they are applied in steps no shorter than this
FLUSHED = 3.0  # time constants after which the filter has forgotten

GYRO_FRAME = (
    Column("R_gb", (3, 3), "attitude by the gyros alone"),
    Column("R_eg", (3, 3), "product of all corrections"),
    Column("R_og", (3, 3), "the same, turned about the vertical to the reported heading"),
    Column("yaw_applied_rad", (), "part of them about the vertical"),
    Column("crab", (2,), "cosine and sine of the angle from the nose to the reported heading"),
    Column("tilt_rate_e", (3,), "rate of the current roll-pitch correction"),
    Column("tilt_left_s", (), "time left of it"),
    Column("yaw_rate_e", (3,), "rate of the current yaw correction"),
    Column("yaw_left_s", (), "time left of it"),
    Column("due_s", (), "time for which they have not been applied yet"),
    Column("felt_g_m_s", (3,), "integral of gravity minus acceleration"),
    Column("force_g_m_s2", (3,), "the last of its summands"),
    Column("late_g", (6,), "that integral, m/s, and the nose, through the receiver's filter"),
    Column("weights_dt_s", (), "sample interval to which the next three belong"),
    Column("before", (), "filter: weight of its last output"),
    Column("start", (), "filter: weight of the input at the start of the interval"),
    Column("end", (), "filter: weight of the input at the end of the interval"),
    Column("history_t_s", (HISTORY,), "time of each remembered `late_g`"),
    Column("history", (HISTORY, 6), "remembered `late_g`"),
    Column("newest", (), "index of the newest of them", integer=True),
    Column("at_fix_g", (6,), "`late_g` of the last fix"),
    Column("unfelt_s", (), "time without a good accelerometer sample"),
    Column("blind_until_s", (), "until then the sums lack a part"),
)


def start_gyro_frame(s: np.void) -> None:
    """Set the columns of `GYRO_FRAME` in the zeroed record `s`: at rest in its attitude for all the past."""
    s["R_gb"] = s["R_eb"]
    s["R_eg"] = s["R_og"] = np.eye(3)
    s["crab"][0] = 1.0
    s["late_g"][2] = -G_M_S2 * s["gps_filter_s"]  # a filtered integral of gravity lags by the time constant
    s["late_g"][3:] = s["R_eb"][:, 0]
    s["history"] = s["at_fix_g"] = s["late_g"]
    s["blind_until_s"] = -math.inf


@kernel
def filter_weights(s):  # type: ignore[no-untyped-def]
    """Weights of the receiver's filter for an input that is linear within the interval: its exact solution."""
    s.weights_dt_s = s.dt_s
    s.before, s.end = 0.0, 1.0
    if s.gps_filter_s > 0.0:
        part = s.dt_s / s.gps_filter_s
        s.before = np.exp(-part)
        s.end = 1.0 + np.expm1(-part) / part
    s.start = 1.0 - s.before - s.end


@kernel
def go_blind(s):  # type: ignore[no-untyped-def]
    """Record that the sums lack a part that the coming reports contain."""
    s.blind_until_s = s.clock_s + s.gps_latency_s + FLUSHED * s.gps_filter_s


@inlined
def take_force(row, s, good):  # type: ignore[no-untyped-def]
    """Set ``s.force_g_m_s2`` from the accelerometer; a rejected sample is replaced by the last good one."""
    if good & FORCE_GOOD:
        # Gravity minus acceleration is -f: the sign of Premerlani's accelerometer.  It is a mean over the interval:
        # half an interval before its end the body had not turned as far, A - (omega x A) dt / 2.
        R, w, h = s.R_gb, s.omega_b_rad_s, 0.5 * s.dt_s
        x, y, z = -row.force_b_m_s2[0], -row.force_b_m_s2[1], -row.force_b_m_s2[2]
        a, b, c = x - h * (w[1] * z - w[2] * y), y - h * (w[2] * x - w[0] * z), z - h * (w[0] * y - w[1] * x)
        for i in range(3):
            s.force_g_m_s2[i] = R[i, 0] * a + R[i, 1] * b + R[i, 2] * c
        s.unfelt_s = 0.0
    else:
        s.unfelt_s += s.dt_s
        if s.unfelt_s > COAST_S:
            go_blind(s)


@inlined
def sum_up(row, s, good, gap_s):  # type: ignore[no-untyped-def]
    """Integrate gyros and accelerometer in ``g``, pass the sums through the receiver's filter, remember them.

    good : from `screen`     gap_s : time since the previous sample, by the clock of the samples
    Returns False if the attitude was lost.
    """
    R = s.R_gb
    nose0, nose1, nose2 = R[0, 0], R[1, 0], R[2, 0]
    kept = integrate(R, s.omega_b_rad_s, s.dt_s)
    if not kept:
        level(s.R_eg)
        level(s.R_og)
        go_blind(s)
    if gap_s > LONGEST_GAP_S:
        go_blind(s)
    take_force(row, s, good)
    if s.weights_dt_s != s.dt_s:
        filter_weights(s)
    before, start, end, dt_s = s.before, s.start, s.end, s.dt_s
    for i in range(3):
        felt = s.felt_g_m_s[i]
        now = felt + dt_s * s.force_g_m_s2[i]
        s.felt_g_m_s[i] = now
        s.late_g[i] = before * s.late_g[i] + start * felt + end * now
    s.late_g[3] = before * s.late_g[3] + start * nose0 + end * R[0, 0]
    s.late_g[4] = before * s.late_g[4] + start * nose1 + end * R[1, 0]
    s.late_g[5] = before * s.late_g[5] + start * nose2 + end * R[2, 0]
    if s.clock_s - s.history_t_s[s.newest] >= SPACING_S:
        k = s.newest + 1 if s.newest < HISTORY - 1 else 0
        s.history_t_s[k] = s.clock_s
        for i in range(6):
            s.history[k, i] = s.late_g[i]
        s.newest = k
    return kept


@kernel
def recall(s, t_s):  # type: ignore[no-untyped-def]
    """Set ``s.at_fix_g`` to `late_g` at `t_s`, interpolated between two remembered instants, or the oldest."""
    newer, part, t1, i = -1, 0.0, s.clock_s, s.newest  # -1: the present
    for _ in range(HISTORY):
        t0 = s.history_t_s[i]
        if t0 > t1:  # the ring has wrapped: the previous one was the oldest
            i = newer
            break
        if t0 <= t_s:
            part = (t_s - t0) / (t1 - t0) if t1 > t0 else 0.0
            break
        newer, t1 = i, t0
        i = i - 1 if i > 0 else HISTORY - 1
    for j in range(6):
        older_value = s.history[i, j]
        newer_value = s.history[newer, j] if newer >= 0 else s.late_g[j]
        s.at_fix_g[j] = older_value + part * (newer_value - older_value)


@inlined
def to_earth(s, v_g):  # type: ignore[no-untyped-def]
    """`v_g`, shape (3,), in earth axes with all corrections up to now, a tuple."""
    R, x, y, z = s.R_eg, v_g[0], v_g[1], v_g[2]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@inlined
def turn_earth(R, x_rad, y_rad, z_rad):  # type: ignore[no-untyped-def]
    """Rotate `R` by a small angle from the earth's side, in place and renormalised: each column c += angle x c."""
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]
        R[0, j] = a + y_rad * c - z_rad * b
        R[1, j] = b + z_rad * a - x_rad * c
        R[2, j] = c + x_rad * b - y_rad * a
    if not renormalise(R):
        level(R)


@kernel
def apply_corrections(s):  # type: ignore[no-untyped-def]
    """Apply the part of the current corrections that is due; at a report, before the result is used."""
    tilt_s, yaw_s = min(s.tilt_left_s, s.due_s), min(s.yaw_left_s, s.due_s)
    s.due_s = 0.0
    if tilt_s > 0.0 or yaw_s > 0.0:
        s.tilt_left_s -= tilt_s
        s.yaw_left_s -= yaw_s
        z_rad = s.tilt_rate_e[2] * tilt_s + s.yaw_rate_e[2] * yaw_s
        s.yaw_applied_rad += z_rad
        turn_earth(s.R_eg, s.tilt_rate_e[0] * tilt_s, s.tilt_rate_e[1] * tilt_s, z_rad)
    c, d = s.crab[0], s.crab[1]
    for j in range(3):
        x, y = s.R_eg[0, j], s.R_eg[1, j]
        s.R_og[0, j], s.R_og[1, j], s.R_og[2, j] = c * x - d * y, d * x + c * y, s.R_eg[2, j]


@inlined
def attitude(s):  # type: ignore[no-untyped-def]
    """Set ``R_eb = R_og @ R_gb``, corrections applied as they fall due."""
    s.due_s += s.dt_s
    if s.due_s >= DUE_S:
        apply_corrections(s)
    R, Q = s.R_og, s.R_gb
    for i in range(3):
        a, b, c = R[i, 0], R[i, 1], R[i, 2]
        s.R_eb[i, 0] = a * Q[0, 0] + b * Q[1, 0] + c * Q[2, 0]
        s.R_eb[i, 1] = a * Q[0, 1] + b * Q[1, 1] + c * Q[2, 1]
        s.R_eb[i, 2] = a * Q[0, 2] + b * Q[1, 2] + c * Q[2, 2]
