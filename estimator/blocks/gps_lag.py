"""The nose as the GPS receiver would report it: filtered and late, with later corrections applied.

A receiver passes velocity through a filter (typically exponential, 1 s) and reports it late.  A course is therefore
compared with a nose that passed the same filter: "that way, the dynamics of the two vectors used in the estimation
of the yaw error are matched" (the paper names this filter of Paul Bizard's, without equations).

A filter inside a feedback loop delays the correction, and a delay destabilises.  So the filter runs on the motion
measured by the gyros alone, in a frame that turns with the proportional yaw corrections (`turn_frame`); all of them are
then applied to its output at once.  The loop has no lag, whatever the receiver's.

An estimator that uses this has the columns of `LAG` in its state, and the parameters ``gps_lag_filter`` (off: neither
filter nor latency), ``gps_filter_s`` and ``gps_latency_s``.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009, section "GPS".
"""

import numpy as np

from estimator.compiler.jit import inlined, kernel
from estimator.interface import Column

HISTORY, SPACING_S = 640, 0.0199  # remembered noses and their spacing: 12.7 s at any sample rate
LARGE_RAD = 0.05  # a larger correction is turned exactly; the small-angle form errs by its cube / 3

LAG = (
    Column("nose", (2,), "filtered horizontal nose, in the frame of the history"),
    Column("nose_at_fix", (2,), "the same, at the time of the last fix"),
    Column("frame", (2,), "cosine and sine of the angle by which corrections have turned the estimate from that frame"),
    Column("gain_dt_s", (), "interval for which the gain was computed"),
    Column("gain", (), "gain of the filter per sample"),
    Column("history_t_s", (HISTORY,), "time of each remembered nose"),
    Column("history", (HISTORY, 2), "remembered filtered noses"),
    Column("newest", (), "index of the newest of them", integer=True),
)


def start_history(s: np.void) -> None:
    """Set the columns of `LAG` in the zeroed record `s`: the nose of ``R_eb``, for all the past."""
    s["nose"] = s["nose_at_fix"] = s["history"] = s["R_eb"][:2, 0]
    s["frame"] = 1.0, 0.0


@inlined
def filter_nose(s):  # type: ignore[no-untyped-def]
    """Pass the horizontal nose through the receiver's filter and remember it."""
    if s.dt_s != s.gain_dt_s:
        lagged = s.gps_lag_filter and s.gps_filter_s > 0.0
        s.gain = 1.0 - np.exp(-s.dt_s / s.gps_filter_s) if lagged else 1.0
        s.gain_dt_s = s.dt_s
    x = s.frame[0] * s.R_eb[0, 0] + s.frame[1] * s.R_eb[1, 0]
    y = s.frame[0] * s.R_eb[1, 0] - s.frame[1] * s.R_eb[0, 0]
    s.nose[0] += s.gain * (x - s.nose[0])
    s.nose[1] += s.gain * (y - s.nose[1])
    if s.clock_s - s.history_t_s[s.newest] >= SPACING_S:
        i = s.newest + 1 if s.newest < HISTORY - 1 else 0
        s.history_t_s[i], s.history[i, 0], s.history[i, 1] = s.clock_s, s.nose[0], s.nose[1]
        s.newest = i


@kernel
def recall_nose(s):  # type: ignore[no-untyped-def]
    """Set ``s.nose_at_fix`` to the filtered nose of one latency ago, interpolated, or the oldest."""
    t_s = s.clock_s - s.gps_latency_s if s.gps_lag_filter else s.clock_s
    newer_t_s, x, y = s.clock_s, s.nose[0], s.nose[1]
    i = later = s.newest
    while s.history_t_s[i] > t_s:
        older = i - 1 if i > 0 else HISTORY - 1
        if s.history_t_s[older] >= s.history_t_s[i]:  # the ring has wrapped: this is the oldest
            t_s = s.history_t_s[i]
            break
        later, i = i, older
    if later != i:
        newer_t_s, x, y = s.history_t_s[later], s.history[later, 0], s.history[later, 1]
    gap_s = newer_t_s - s.history_t_s[i]
    part = (t_s - s.history_t_s[i]) / gap_s if gap_s > 0.0 else 1.0
    s.nose_at_fix[0] = s.history[i, 0] + part * (x - s.history[i, 0])
    s.nose_at_fix[1] = s.history[i, 1] + part * (y - s.history[i, 1])


@inlined
def turn_frame(s, angle_rad):  # type: ignore[no-untyped-def]
    """Record that the estimate will be turned by `angle_rad` about the vertical."""
    cosine, sine = 1.0, angle_rad  # Eqn 17 in the plane, and Eqn 21 below
    if abs(angle_rad) > LARGE_RAD:
        cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    c, z = cosine * s.frame[0] - sine * s.frame[1], cosine * s.frame[1] + sine * s.frame[0]
    scale = 1.5 - 0.5 * (c * c + z * z)
    s.frame[0], s.frame[1] = scale * c, scale * z


@inlined
def corrected_nose(s):  # type: ignore[no-untyped-def]
    """The nose of the last fix with all later corrections applied: north and east."""
    x, y = s.nose_at_fix[0], s.nose_at_fix[1]
    return s.frame[0] * x - s.frame[1] * y, s.frame[1] * x + s.frame[0] * y
