"""A complementary filter on the rotation matrix: the estimator to copy for your own.

Gyros are good in the short term, gravity and the GPS course in the long term.  Each sample turns the matrix by the
gyros, plus a small correction towards the two references:

* gravity, in body axes, is ``omega x v - f``: the specific force less the centrifugal acceleration of a turn, with the
  speed v of the last fix along the nose;
* the heading is the GPS course, turned on by what the aeroplane has turned since the fix was true.

The same tilt error, integrated, is the gyro bias.  `step` is the whole algorithm; the class below it only holds the
parameters and the state.  Copy this file, change `step`, and fly it::

    wingslevel fly crosswind --estimator my_filter.py:Complementary --set heading_s=4

It is the filter of Mahony et al. with the centrifugal term and the course of Premerlani and Bizard.

References
----------
R. Mahony, T. Hamel and J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", 2008.
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import clip
from estimator.blocks.screening import AT_LIMIT_S, FORCE_GOOD, GPS, fix_came, refuse, screen, take_rate, watch_limit
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, GOOD, POOR, STARTING, Column, ImuSample
from estimator.params.shared import Params
from estimator.rotation import integrate

MIN_SPEED_M_S = 3.0  # a slower course says nothing about the heading
FIX_LIFE_S = 2.0  # nor does an older one
FASTEST_M_S = 1000.0  # a fix beyond it is no measurement
MAX_BIAS_RAD_S = math.radians(45.0)  # whatever the accelerometer says, no gyro is further off
GRAVITY_BAND_M_S2 = 3.0  # further from g, the force is a throw or a pull-up, not gravity
ALIGNED = 0.3  # sine of the heading error below which the heading counts as found


@dataclass(frozen=True, slots=True)
class ComplementaryParams(Params):
    """What can be tuned: ``--set tilt_s=10``.  `wingslevel list estimators --params` shows these texts.

    tilt_s : s  time constant of the tilt correction
        higher: smoother, less disturbed by manoeuvres, slower to recover; lower: follows accelerations too
    heading_s : s  time constant of the heading correction
        higher: less course noise; lower: the heading is found sooner
    bias_s : s  time constant of the gyro bias; keep it above 4 tilt_s
        higher: steadier bias; lower: follows a drifting gyro, overshoots after a large tilt error
    gps_latency_s : s  age of a fix on arrival, set from the data sheet of the receiver
        higher: more of the turn since then is added to the course; lower: less.  An error makes the heading wrong while
        turning
    gps_filter_s : s  time constant of the receiver's velocity filter, likewise
        higher: as for the latency; lower: as for the latency
    """

    _positive: ClassVar = ("tilt_s", "heading_s", "bias_s")
    tilt_s: float = 5.0
    heading_s: float = 2.0
    bias_s: float = 20.0
    gps_latency_s: float = 0.3
    gps_filter_s: float = 0.0


STATE_DTYPE = state_dtype(
    ComplementaryParams,
    Column("v_e_m_s", (3,), "velocity of the last fix"),
    Column("fix_age_s", (), "time since it arrived"),
    Column("aligned", (), "1 once the heading has been near the course", integer=True),
)


@kernel
def take_fix(row, s):  # type: ignore[no-untyped-def]
    """Keep the velocity of a fix that arrived; reject one that cannot be true."""
    s.fix_age_s += s.dt_s
    if fix_came(row, s):
        v = row.gps_v_e_m_s
        if abs(v[0]) < FASTEST_M_S and abs(v[1]) < FASTEST_M_S and abs(v[2]) < FASTEST_M_S:  # NaN is not
            s.v_e_m_s[0], s.v_e_m_s[1], s.v_e_m_s[2], s.fix_age_s = v[0], v[1], v[2], 0.0
        else:
            refuse(s, GPS)


@kernel
def tilt_error(f, s):  # type: ignore[no-untyped-def]
    """The small rotation, in body axes, from the estimated down axis to the measured gravity; a tuple."""
    w, v = s.omega_b_rad_s, s.v_e_m_s
    speed = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    x, y, z = -f[0], w[2] * speed - f[1], -w[1] * speed - f[2]  # omega x (speed, 0, 0) - f
    if abs(np.sqrt(x * x + y * y + z * z) - G_M_S2) > GRAVITY_BAND_M_S2:
        return 0.0, 0.0, 0.0
    a, b, c = s.R_eb[2, 0] / G_M_S2, s.R_eb[2, 1] / G_M_S2, s.R_eb[2, 2] / G_M_S2
    return y * c - z * b, z * a - x * c, x * b - y * a  # gravity x down


@kernel
def heading_error(s):  # type: ignore[no-untyped-def]
    """Sine of the angle from the nose to the present course, positive to the right; 1 beyond a right angle."""
    north, east, w = s.v_e_m_s[0], s.v_e_m_s[1], s.omega_b_rad_s
    speed = np.sqrt(north * north + east * east)
    if speed < MIN_SPEED_M_S or s.fix_age_s > FIX_LIFE_S:
        return 0.0
    error = (s.R_eb[0, 0] * east - s.R_eb[1, 0] * north) / speed
    if s.R_eb[0, 0] * north + s.R_eb[1, 0] * east < 0.0:
        error = 1.0 if error > 0.0 else -1.0
    turn_rad_s = s.R_eb[2, 0] * w[0] + s.R_eb[2, 1] * w[1] + s.R_eb[2, 2] * w[2]
    # The aeroplane has gone on turning since the fix was true; the matrix is that of the sample before.
    error += turn_rad_s * (s.gps_latency_s + s.gps_filter_s + s.fix_age_s - s.dt_s)
    return clip(error, -1.0, 1.0)


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample: the whole algorithm; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)  # which parts of this sample are plausible
    if not good:
        return POOR  # no time has passed
    take_rate(row, s, good)  # omega_b_rad_s = gyro - bias
    take_fix(row, s)
    x, y, z = tilt_error(row.force_b_m_s2, s) if good & FORCE_GOOD else (0.0, 0.0, 0.0)
    yaw = heading_error(s)
    s.aligned |= s.fix_age_s < FIX_LIFE_S and 0.0 < abs(yaw) < ALIGNED
    w, down, pull, turn = s.omega_b_rad_s, s.R_eb[2], 1.0 / s.tilt_s, yaw / s.heading_s
    corrected = w[0] + pull * x + turn * down[0], w[1] + pull * y + turn * down[1], w[2] + pull * z + turn * down[2]
    integrate(s.R_eb, corrected, s.dt_s)
    learn = s.dt_s / (s.tilt_s * s.bias_s)
    for i, tilt in enumerate((x, y, z)):
        s.gyro_bias_b_rad_s[i] = clip(s.gyro_bias_b_rad_s[i] - learn * tilt, -MAX_BIAS_RAD_S, MAX_BIAS_RAD_S)
    watch_limit(s.gyro_bias_b_rad_s, MAX_BIAS_RAD_S, s)
    if not s.aligned:
        return STARTING
    return POOR if s.spoilt or s.fix_age_s > FIX_LIFE_S or s.at_limit_s >= AT_LIMIT_S else GOOD


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class Complementary(Compiled[ComplementaryParams]):
    """Complementary filter on the rotation matrix: the example to copy for your own."""

    heading_reference = "course"
    uses = ("gyro", "accelerometer", "gps")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = ComplementaryParams()

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["fix_age_s"] = math.inf  # tilt and gyro bias are set from the mean sample on the ground
