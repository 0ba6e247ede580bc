"""The multi-rotor estimator of Dilshad and Jahan (2014): the DCM of Premerlani and Bizard with a magnetometer for yaw.

The gyros are integrated (Premerlani's Eqns 16-21); the accelerometer, without a centrifugal term, corrects roll and
pitch; every 125 ms the tilt-compensated magnetometer (Eqns 5-7) gives the yaw drift of the gyros; and over a long time
the course from three GPS positions (Eqn 9) corrects the magnetometer's declination and leftover iron.  All errors pass
one PI controller (Premerlani's Eqns 28-29).  Iron: `estimator.blocks.calibration` (Eqn 8).

The tilt of Eqns 5 and 6 is the accelerometer's.  That is right for a craft at rest or, on average, in hover.  In a
coordinated turn the accelerometer shows no bank: the vertical part of the field then counts as horizontal, and in
the north of America, where it is two and a half times the horizontal part, the heading is off by more than the bank.
This is the northerly turning error of magnetic compasses: banked to the right on a northerly heading, the compass shows
a turn to the left, and an autopilot that steers by it banks further.  In straight flight in a crosswind (the scenario,
calibrated sensors, seeds 0-2) the heading error is 82 degrees with this tilt and 9 with that of the matrix.  And the
course equals the heading only for an aeroplane in still air.  Neither is corrected here: this is the paper's estimator,
made for multi-rotors.

Axes
----
The paper turns both frames by 180 degrees about forward: body forward-left-up, earth north-west-up, so that its matrix
is D R_eb D with D = diag(1, -1, -1).  The update of the matrix is the same in either.  Only `heading_of_field` and
`paper_angles` use the paper's axes.

Errata
------
*Eqn 4.*  With R = R_x(phi) R_z(-psi) R_y(-theta), of Eqns 1 to 3, three elements have wrong signs in print: the second
terms of R_yx and R_zz, and the first of R_zx.  At zero angles the printed matrix is singular.  (The names R_y(theta_y)
in Eqn 2 and R_z(theta_z) in Eqn 3 are interchanged.)  Eqns 10 to 12 follow from the correct matrix; their ``tan^-2`` is
the arctangent of two arguments.  Yaw is the middle angle: roll and pitch are undefined at east and west, and yaw cannot
go beyond.

*Eqns 5 and 6* turn by the angle about the y axis, right-handed; the paper's pitch (nose up, Eqn 11) is its negative.
And the angles must be roll first, then pitch: with those of the usual order (``roll = arctan(y / z)``) the heading of
a body that is both rolled and pitched is wrong.  With roll first, Eqn 7 is the heading square to the wings, which
differs from the nose's by about roll times pitch: it is compared with the estimate's heading square to the wings.

*Eqns 7 and 9.*  ``arctan(Y / X)`` confuses south with north; read the arctangent of two arguments.

*"The gyro readings have been normalized before calculating the kinematics"* (section f).  A normalised rate is always
1 rad/s; the matrix is normalised instead.

Beyond the paper
----------------
The paper gives no gains.  "Reporting latency and filtering have been taken into account", it says of the GPS: here the
turn of the nose since then, through one lag, is added to the course.  In turns no course is used: Eqn 7 is wrong there.

References
----------
N. A. Dilshad and M. K. Jahan, "An Improvement Strategy on Direction Cosine Matrix based Attitude Estimation for
Multi-Rotor Autopilot", Global Journal of Researches in Engineering F 14(8), 2014.
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009.
"""

import math

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import cross, dot, put, wrap
from estimator.blocks.magnetometer import FIELD, take_field, turn_to_north
from estimator.blocks.pi import corrected_rate, feed_back, weigh
from estimator.blocks.screening import FORCE_GOOD, GPS, fix_came, health_of, refuse, screen, watch_limit
from estimator.compiler.jit import kernel
from estimator.interface import Array, Column, HeadingReference, ImuSample
from estimator.params.dilshad import DilshadParams as DilshadParams
from estimator.rotation import integrate

HEADING_LIFE_S = 1.0  # an older magnetometer heading is not used
STRAIGHT_RAD = math.radians(10.0)  # a nose that has turned further than this since the course was true is in a turn
LONGEST_STEP_S, FASTEST_M_S = 2.5, 300.0  # between two positions that give a velocity


_STATE = (
    Column("omega_p_b", (3,), "proportional rate correction"),
    Column("omega_i_b", (3,), "integral rate correction; minus the offset learnt since"),
    Column("omega_total_b", (3,), "corrected rate that is integrated"),
    Column("roll_pitch_b", (3,), "roll-pitch correction"),
    Column("yaw_b", (3,), "yaw correction"),
    Column("total_b", (3,), "weighted sum"),
    Column("heading_rad", (), "last heading of the magnetometer, Eqn 7, uncorrected"),
    Column("heading_age_s", (), "time since it"),
    Column("heading_due_s", (), "time accumulated for the next one"),
    Column("correction_rad", (), "correction of the magnetometer's heading, learnt from the GPS"),
    Column("drift", (), "yaw still needed, about down: sine of the angle, of size 1 beyond a right angle"),
    Column("turned_rad", (), "turn of the nose since the course was true"),
    Column("p_e_m", (2, 2), "the last two positions, north and east, the newer one first"),
    Column("p_age_s", (2,), "and how old they are"),
    Column("courses", (), "courses taken so far", integer=True),
    Column("aligned", (), "1 once the magnetometer has set the heading", integer=True),
)
STATE_DTYPE = state_dtype(DilshadParams, *FIELD, *_STATE)


@kernel
def heading_of_field(m, f):  # type: ignore[no-untyped-def]
    """Magnetic heading square to the wings, from north over east (Eqns 5 to 7); NaN without a field.

    Parameters
    ----------
    m : shape (3,)   field, body axes      f : shape (3,)   specific force of a body that is not accelerated
    """
    # The paper's axes: forward, left, up.
    mx, my, mz = m[0], -m[1], -m[2]
    fx, fy, fz = f[0], -f[1], -f[2]
    # Up, seen from a body that was rolled by r and then turned about y by p: (-sin p cos r, sin r, cos p cos r).
    across = np.sqrt(fx * fx + fz * fz)
    length = np.sqrt(across * across + fy * fy)
    sin_r, cos_r = fy / length, across / length
    sin_p, cos_p = -fx / across, fz / across
    x = mx * cos_p + mz * sin_p  # Eqn 5
    y = mx * sin_r * sin_p + my * cos_r - mz * sin_r * cos_p  # Eqn 6
    return np.arctan2(y, x)  # Eqn 7


@kernel
def take_heading(row, s, good):  # type: ignore[no-untyped-def]
    """Every 125 ms, compare the yaw with the magnetometer's heading; the first field sets it.

    The first one is compensated with the tilt of the matrix: a single sample of the accelerometer vibrates.
    """
    s.heading_age_s += s.dt_s
    s.heading_due_s = min(s.heading_due_s + s.dt_s, 2.0 * s.yaw_every_s)
    if s.heading_age_s > HEADING_LIFE_S:
        s.drift = 0.0
    came = take_field(row, s)
    if came and not s.aligned and turn_to_north(s.R_eb, s.field_b_ut, s.declination_rad):
        s.aligned = 1
    if not (came and good & FORCE_GOOD and s.heading_due_s >= s.yaw_every_s):
        return
    heading = heading_of_field(s.field_b_ut, row.force_b_m_s2) + s.declination_rad
    if not np.isfinite(heading):  # free fall, or no field
        return
    s.heading_due_s -= s.yaw_every_s
    s.heading_age_s, s.heading_rad = 0.0, heading
    heading += s.correction_rad
    hx, hy = np.cos(heading), np.sin(heading)
    x, y = s.R_eb[1, 1], -s.R_eb[0, 1]  # square to the wings
    s.drift = x * hy - y * hx  # Premerlani's Eqn 23
    if x * hx + y * hy < 0.0:
        s.drift = np.copysign(np.hypot(x, y), s.drift)


@kernel
def take_course(row, s):  # type: ignore[no-untyped-def]
    """Correct the magnetometer by the course from three consecutive positions (section e, Eqn 9)."""
    w, dt = s.omega_b_rad_s, s.dt_s
    rate = w[0] * s.R_eb[2, 0] + w[1] * s.R_eb[2, 1] + w[2] * s.R_eb[2, 2]
    s.turned_rad += dt * rate - min(dt / s.gps_lag_s, 1.0) * s.turned_rad
    s.p_age_s[0] += dt
    s.p_age_s[1] += dt
    if not fix_came(row, s):
        return
    x, y = row.gps_p_e_m[0], row.gps_p_e_m[1]
    if not (abs(x) < 1e6 and abs(y) < 1e6 and 0.0 <= row.gps_speed_m_s < 1000.0):
        refuse(s, GPS)
        return
    first_s, second_s = s.p_age_s[1] - s.p_age_s[0], s.p_age_s[0]
    # Two velocities between three positions, and their average.
    vx = 0.5 * ((x - s.p_e_m[0, 0]) / second_s + (s.p_e_m[0, 0] - s.p_e_m[1, 0]) / first_s)
    vy = 0.5 * ((y - s.p_e_m[0, 1]) / second_s + (s.p_e_m[0, 1] - s.p_e_m[1, 1]) / first_s)
    near = second_s <= LONGEST_STEP_S and first_s <= LONGEST_STEP_S
    s.p_e_m[1, 0], s.p_e_m[1, 1], s.p_age_s[1] = s.p_e_m[0, 0], s.p_e_m[0, 1], s.p_age_s[0]
    s.p_e_m[0, 0], s.p_e_m[0, 1], s.p_age_s[0] = x, y, 0.0
    straight = abs(s.turned_rad) <= STRAIGHT_RAD and s.heading_age_s <= HEADING_LIFE_S
    # Positions 0.2 s apart that are 0.3 m wrong give a false 1 m/s; the receiver's own speed does not.
    moving = s.min_speed_m_s <= row.gps_speed_m_s <= FASTEST_M_S and np.hypot(vx, vy) <= FASTEST_M_S
    if not (near and straight and moving):
        return
    course = np.arctan2(vy, vx) + s.turned_rad  # Eqn 9, and the turn since
    s.courses += 1
    part = max(1.0 / s.courses, min(second_s / s.gps_weight_s, 1.0))  # a mean at first, then one that forgets
    if s.gps_weight_s < np.inf:
        s.correction_rad = wrap(s.correction_rad + part * wrap(course - s.heading_rad - s.correction_rad))


@kernel
def roll_pitch_correction(row, s):  # type: ignore[no-untyped-def]
    """Fill ``s.roll_pitch_b``: measured down x estimated down (Premerlani's Eqn 27, corrected)."""
    f = row.force_b_m_s2
    length = np.sqrt(dot(f, f))
    put(s.roll_pitch_b, -1.0 / length if length > 0.0 else 0.0, cross(f, s.R_eb[2]))


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample, in the order of the paper's Fig. 8; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        corrected_rate(row, s, good)
        integrate(s.R_eb, s.omega_total_b, s.dt_s)
        if good & FORCE_GOOD:
            roll_pitch_correction(row, s)
        else:
            s.roll_pitch_b[0] = s.roll_pitch_b[1] = s.roll_pitch_b[2] = 0.0
        take_heading(row, s, good)
        take_course(row, s)
        for i in range(3):
            s.yaw_b[i] = s.drift * s.R_eb[2, i]  # Premerlani's Eqn 24
        weigh(s.w_rp, s.roll_pitch_b, s.w_y, s.yaw_b, s.total_b)
        feed_back(s.total_b, s.k_p, s.k_i, s.offset_limit_rad_s, s.dt_s, s.omega_p_b, s.omega_i_b)
        watch_limit(s.omega_i_b, s.offset_limit_rad_s, s)
    return health_of(s, s.aligned, s.heading_age_s <= HEADING_LIFE_S)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


def paper_angles(R_eb: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw [rad] as the paper reads them off its matrix (Eqns 10 to 12), each of shape (...).

    For comparison with the paper.  Yaw is within 90 degrees of north; at 90 degrees roll and pitch are undefined.
    """
    # The paper's matrix is D R_eb D with D = diag(1, -1, -1): elements between x and the others change their sign.
    r_xx, r_xy, r_xz = R_eb[..., 0, 0], -R_eb[..., 0, 1], -R_eb[..., 0, 2]
    r_yy, r_zy = R_eb[..., 1, 1], R_eb[..., 2, 1]
    return np.arctan2(r_zy, r_yy), -np.arctan2(r_xz, r_xx), np.arcsin(np.clip(r_xy, -1.0, 1.0))


class Dilshad(Compiled[DilshadParams]):
    """Dilshad and Jahan (2014): yaw from the magnetometer, no centrifugal term; for multi-rotors.

    The first field sets the heading.
    """

    heading_reference: HeadingReference = "course"  # in the long run, through the GPS; "nose" without its correction
    uses = ("gyro", "accelerometer", "gps", "magnetometer")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = DilshadParams()

    def __init__(self, params: DilshadParams | None = None) -> None:
        super().__init__(params)
        if math.isinf(self.params.gps_weight_s):
            self.heading_reference = "nose"

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["heading_age_s"] = s["p_age_s"] = math.inf
        s["heading_due_s"] = s["yaw_every_s"]
