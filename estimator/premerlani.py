"""The direction-cosine-matrix estimator of Premerlani and Bizard: gyros integrated, accelerometer and GPS correct.

One pass per inertial sample, in the paper's order: integrate the gyros (Eqns 16-17), renormalise (18-21), compare the
nose with the course over ground (22-24) and the down axis with the accelerometer less centrifugal acceleration (25-27),
and feed both errors back through one PI controller (28-29).

Errata
------
*Eqn 27.*  The paper prints the roll-pitch correction as ``r_z x g_reference``.  With the update of Eqn 17 that
diverges: 9 degrees of tilt become 180.  ``g_reference x r_z`` is right.  The order depends on the frame in which the
vector is fixed.  The nose is fixed in the body and compared in the earth frame: there estimate x reference is the
rotation still needed (Eqn 23 is right).  Down is fixed in the earth and compared in the body frame, which turns the
other way: there it is reference x estimate.

*Eqn 25.*  ``omega`` is the gyro with the integral correction, without the proportional one: that one corrects the
attitude, the aeroplane does not turn by it, and it would count as centrifugal acceleration.

*Eqn 20* prints the Z row's elements as ``r_xx r_xy r_xz``; read ``r_zx r_zy r_zz``.

Beyond the paper
----------------
Each has a parameter that turns it off, but the yaw lock.

*GPS-lag filter* (`estimator.blocks.gps_lag`; the paper names it, without equations).  The nose passes the receiver's
filter and latency before it is compared with the course.  Filtering a vector also shrinks the speed of a turning
aeroplane: it is divided by the length of the equally filtered nose.  `rotate_history` takes the lag out of the loop.

*Yaw lock.*  The cross product of Eqn 23 decreases beyond 90 degrees of error and vanishes at 180.  Beyond 90 degrees
only its sign is used, with full size.

*No learning in turns.*  In a turn the course lags and the crab changes: the yaw error has the sign of the turn, and so
has the bank through which Eqn 24 passes it to the pitch axis.  Their product has the same sign left and right: the
integral would learn it as an offset of the pitch gyro.

*Launch gate.*  While the length of ``g_reference`` is not that of gravity, it contains forward acceleration or a wrong
speed: no roll-pitch correction then.

*Speed through the air.* In wind the ground speed of Eqn 25 is not the speed that turns the aeroplane. The best
available speed is used: that of the airspeed sensor, as true airspeed (`estimator.blocks.air`); with `turn_speed` one
learnt in level turns (a turn about the vertical accelerates horizontally: the speed for which ``g_reference`` is at
right angles to ``omega x V``; MatrixPilot has used such a speed since 2017); with `learn_wind` ground velocity less
wind.

*Wind* (off by default; the paper: "somehow compute the wind vector").  Learnt in turns, `estimator.blocks.wind`.  The
reference of Eqn 22 is then the direction of ground velocity less wind, and the heading converges to the nose.

*In the hand* (`estimator.blocks.held`).  Before it is first moved, a faster loop learns the offset.

*Saturation* (the paper: "error will be introduced into the roll-pitch orientation").  A clipped axis is replaced by the
value that the estimate expects, so that only the other axes correct.  The full scale comes from the data sheet.

*Yaw lock after the launch* (the paper: "a large weight"; off by default).  A larger weight until yaw is locked.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009.
"""

import math

import numpy as np

from estimator.blocks.air import true_airspeed_factor
from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.gps_lag import (
    LAG,
    corrected_nose,
    filter_nose,
    recall_nose,
    start_history,
    turn_frame,
)
from estimator.blocks.held import FASTER_I_1_S2, FASTER_P_1_S, HELD, watch_held
from estimator.blocks.kernels import clip, cross, dot, put
from estimator.blocks.pi import correct, corrected_rate, learn_offset, weigh
from estimator.blocks.screening import FORCE_GOOD, GPS, airspeed_came, fix_came, health_of, refuse, screen, watch_limit
from estimator.blocks.wind import WIND_FILTER, learn_wind
from estimator.compiler.jit import inlined, kernel
from estimator.interface import G_M_S2, Column, HeadingReference, ImuSample
from estimator.params.premerlani import LEAST_CLIP_M_S2
from estimator.params.premerlani import PremerlaniParams as PremerlaniParams
from estimator.rotation import integrate

FIX_LIFE_S = 2.0  # an older fix is not used
AIR_LIFE_S = 1.0  # nor is an older airspeed
LOCK_TAN, LOCK_S = math.tan(math.radians(15.0)), 1.0  # yaw is locked once it was this close for this long
TURN_RAD_S, TURN_S = 0.3, 3.0  # slowest turn that gives a speed, and time constant of learning it
SHORTEST_NOSE = 0.3  # a shorter filtered nose (a loop, a spin) cannot restore the speed
CLIPPED = 0.99  # of the full scale: the largest count of 8 bits is 0.992 of it


_STATE = (
    Column("omega_p_b", (3,), "proportional rate correction, Eqn 29"),
    Column("omega_i_b", (3,), "integral rate correction, Eqn 29; minus the offset learnt since"),
    Column("omega_total_b", (3,), "corrected rate that is integrated, Eqn 16"),
    Column("roll_pitch_b", (3,), "roll-pitch correction, Eqn 27"),
    Column("yaw_b", (3,), "yaw correction, Eqn 24"),
    Column("total_b", (3,), "weighted sum, Eqn 28"),
    Column("learning", (), "1 where the integral uses the total of this sample", integer=True),
    Column("g_ref_b_m_s2", (3,), "reference of gravity, Eqn 26"),
    Column("largest_b_m_s2", (3,), "largest reading of each accelerometer axis"),
    Column("may_clip", (), "1 where the full scale is known or searched for", integer=True),
    Column("clipped", (), "which axes are clipped: 1 x, 2 y, 4 z", integer=True),
    Column("speed_m_s", (), "speed of Eqn 25 from the last fix"),
    Column("turn_speed_m_s", (), "the same, learnt in turns; 0 before"),
    Column("airspeed_m_s", (), "the same from the last air-data sample"),
    Column("air_age_s", (), "time since that"),
    Column("course", (2,), "COGX, COGY of the last fix, Eqn 22"),
    Column("fix_age_s", (), "time since a usable fix"),
    Column("near_s", (), "how long the yaw error has been small"),
    Column("locked", (), "1 once yaw was found", integer=True),
)
STATE_DTYPE = state_dtype(PremerlaniParams, *WIND_FILTER, *LAG, *HELD, *_STATE)


@inlined
def take_air(row, s):  # type: ignore[no-untyped-def]
    """Take an airspeed that arrived."""
    s.air_age_s += s.dt_s
    if s.use_airspeed and airspeed_came(row, s) and row.equivalent_airspeed_m_s > 0.0:
        s.airspeed_m_s = row.equivalent_airspeed_m_s * true_airspeed_factor(row, s.elevation_m)
        s.air_age_s = 0.0


@inlined
def take_fix(row, s):  # type: ignore[no-untyped-def]
    """Take a fix that arrived, if it is plausible."""
    s.fix_age_s += s.dt_s
    if fix_came(row, s):
        if abs(row.gps_course_rad) < 100.0 and 0.0 <= row.gps_speed_m_s < 1000.0:
            believe_fix(row.gps_course_rad, row.gps_speed_m_s, s)
        else:
            refuse(s, GPS)


@inlined
def nose_length(s):  # type: ignore[no-untyped-def]
    """Length of the horizontal nose that belongs to the last fix."""
    return np.sqrt(s.nose_at_fix[0] * s.nose_at_fix[0] + s.nose_at_fix[1] * s.nose_at_fix[1])


@kernel
def believe_fix(course_rad, speed_m_s, s):  # type: ignore[no-untyped-def]
    """Set the reference (Eqn 22) and the speed of Eqn 25, and recall the nose that belongs to them."""
    recall_nose(s)
    north, east = speed_m_s * np.cos(course_rad), speed_m_s * np.sin(course_rad)
    if s.learn_wind:
        if speed_m_s >= s.min_speed_m_s:
            learn_wind(s, s.nose_at_fix[0], s.nose_at_fix[1], north, east, s.fix_age_s)
        if s.wind_known:
            north, east = north - s.wind_e_m_s[0], east - s.wind_e_m_s[1]
    speed = np.sqrt(north * north + east * east)
    s.speed_m_s = speed
    if s.gps_lag_filter:  # the filter shortened the nose and the velocity alike
        s.speed_m_s /= clip(nose_length(s), SHORTEST_NOSE, 1.0)
    if speed >= s.min_speed_m_s:
        s.fix_age_s = 0.0
        s.course[0], s.course[1] = north / speed, east / speed  # Eqn 22


@inlined
def yaw_correction(s):  # type: ignore[no-untyped-def]
    """Fill ``s.yaw_b`` (Eqns 23 and 24), zero without a fresh fix; return its weight."""
    ground = 0.0
    if s.fix_age_s <= FIX_LIFE_S:
        x, y = corrected_nose(s)
        ground = x * s.course[1] - y * s.course[0]  # Eqn 23
        along = x * s.course[0] + y * s.course[1]
        s.near_s = s.near_s + s.dt_s if abs(ground) < LOCK_TAN * along else 0.0
        if s.near_s >= LOCK_S:
            s.locked = 1
        if along < 0.0:  # more than a right angle off: full size
            ground = np.copysign(np.sqrt(x * x + y * y), ground)
    weight = s.w_y if s.locked else max(s.w_y, s.w_y_until_lock)
    for i in range(3):
        s.yaw_b[i] = ground * s.R_eb[2, i]  # Eqn 24
    if s.rotate_history:
        turn_frame(s, s.k_p * weight * ground * s.dt_s)
    return weight


@inlined
def find_clipped(f, s):  # type: ignore[no-untyped-def]
    """Set ``s.clipped``: axes at full scale, given or found."""
    s.clipped = 0
    for i in range(3):
        size = abs(f[i])
        if size >= s.clip_m_s2:
            s.clipped |= 1 << i
        if s.find_clip and size >= s.largest_b_m_s2[i]:
            # Other readings than the full scale do not occur twice to the last digit, except at rest.
            if size == s.largest_b_m_s2[i] and size > LEAST_CLIP_M_S2:
                s.clipped |= 1 << i
            s.largest_b_m_s2[i] = size


@kernel
def learn_turn_speed(f, s):  # type: ignore[no-untyped-def]
    """Learn the speed that makes the acceleration of Eqn 25 horizontal, turning about the vertical."""
    w, v = s.omega_b_rad_s, s.speed_m_s
    around = w[0] * s.R_eb[2, 0] + w[1] * s.R_eb[2, 1] + w[2] * s.R_eb[2, 2]
    across = w[1] * w[1] + w[2] * w[2]  # |omega x nose|^2
    if v < s.min_speed_m_s or across < TURN_RAD_S**2 or around * around < 0.8 * (across + w[0] * w[0]):
        return
    # Level, g_ref is perpendicular to omega x nose = (0, w_z, -w_y): (-f + V omega x nose) . (omega x nose) = 0.
    felt = clip((f[1] * w[2] - f[2] * w[1]) / across, 0.0, 3.0 * v)
    if s.turn_speed_m_s == 0.0:
        s.turn_speed_m_s = v
    s.turn_speed_m_s += (1.0 - np.exp(-s.dt_s / TURN_S)) * (felt - s.turn_speed_m_s)


@inlined
def speed_through_air(f, s):  # type: ignore[no-untyped-def]
    """The speed of Eqn 25: a sensor's, else the one learnt in turns, else that of the last fix."""
    if s.air_age_s <= AIR_LIFE_S:
        return s.airspeed_m_s
    if s.turn_speed:
        if not s.clipped:
            learn_turn_speed(f, s)
        if s.turn_speed_m_s > 0.0:
            return s.turn_speed_m_s
    return s.speed_m_s


@inlined
def roll_pitch_correction(row, s):  # type: ignore[no-untyped-def]
    """Fill ``s.roll_pitch_b`` (Eqns 25 to 27, the last with its sign corrected); zero outside the launch gate."""
    f, w, g = row.force_b_m_s2, s.omega_b_rad_s, s.g_ref_b_m_s2
    if s.may_clip:
        find_clipped(f, s)
    v = speed_through_air(f, s)
    # The paper's accelerometer is gravity minus acceleration, which is -f.  Eqn 25: omega x (v, 0, 0).
    g[0] = -f[0]  # Eqn 26
    g[1] = -f[1] + w[2] * v
    g[2] = -f[2] - w[1] * v
    if s.clipped:
        for i in range(3):
            g[i] = G_M_S2 * s.R_eb[2, i] if s.clipped & (1 << i) else g[i]
    length = np.sqrt(dot(g, g))
    plausible = length > 0.0 and abs(length / G_M_S2 - 1.0) <= s.launch_gate
    put(s.roll_pitch_b, 1.0 / length if plausible else 0.0, cross(g, s.R_eb[2]))  # Eqn 27, corrected


@inlined
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One pass over row `k`; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        corrected_rate(row, s, good)
        if s.held:
            learn_offset(s.roll_pitch_b, FASTER_P_1_S, FASTER_I_1_S2, s.offset_limit_rad_s, s.dt_s, s.omega_i_b)
        elif s.learning:  # of the previous sample: the processor need not wait for it, and it changes slowly
            learn_offset(s.total_b, s.k_p, s.k_i, s.offset_limit_rad_s, s.dt_s, s.omega_i_b)
        watch_limit(s.omega_i_b, s.offset_limit_rad_s, s)
        if not integrate(s.R_eb, s.omega_total_b, s.dt_s):  # Eqns 17-21
            s.locked = 0
        filter_nose(s)
        take_air(row, s)
        take_fix(row, s)
        w_y = yaw_correction(s)
        if good & FORCE_GOOD:
            roll_pitch_correction(row, s)
        else:
            s.roll_pitch_b[0] = s.roll_pitch_b[1] = s.roll_pitch_b[2] = 0.0
        weigh(s.w_rp, s.roll_pitch_b, w_y, s.yaw_b, s.total_b)
        correct(s.total_b, s.k_p, s.omega_p_b)
        w = s.omega_b_rad_s
        watch_held(row.force_b_m_s2, w, s)
        if s.held:
            correct(s.roll_pitch_b, FASTER_P_1_S, s.omega_p_b)
        s.learning = w[0] * w[0] + w[1] * w[1] + w[2] * w[2] < s.integrate_below_rad_s * s.integrate_below_rad_s
    return health_of(s, s.locked, s.fix_age_s <= FIX_LIFE_S)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class Premerlani(Compiled[PremerlaniParams]):
    """Premerlani and Bizard (2009): gyros, centrifugal term, yaw from the GPS course."""

    heading_reference: HeadingReference = "course"  # "nose" with `learn_wind`
    uses = ("gyro", "accelerometer", "gps", "airspeed")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = PremerlaniParams()

    def __init__(self, params: PremerlaniParams | None = None) -> None:
        super().__init__(params)
        if self.params.learn_wind:
            self.heading_reference = "nose"

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        if math.isinf(self.params.clip_m_s2):
            s["clip_m_s2"] = CLIPPED * self.params.force_full_scale_m_s2
        s["may_clip"] = self.params.find_clip or math.isfinite(s["clip_m_s2"])
        s["fix_age_s"] = s["air_age_s"] = math.inf
        start_history(s)
