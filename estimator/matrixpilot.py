"""MatrixPilot's estimator in its present form (since 2017): the paper's, with turns that need no GPS.

Frames.  MatrixPilot's body axes are left wing, nose, down, its earth axes west, north, down.  Here all equations are
rewritten for our axes; in flight only the specific force is converted:

    omega = (p, q, r) = (omega_y, -omega_x, omega_z),    a = gravity - acceleration = -force_b = (a_y, -a_x, a_z)

Differences from the paper (Premerlani & Bizard)
------------------------------------------------
*Centrifugal acceleration without GPS* replaces Eqns 25-26.  It is perpendicular to nose and rate, so the gyros give its
direction u; its size ``w_V = |omega x V|`` is the one that makes the remaining force as long as gravity:
``|a + w_V u| = g``.  The sign of the turn selects one of the two roots; a steady level turn is a double root.  The
direction is that of the measured rate, without the integral correction (with it, 2 degrees of tilt off the firmware).
`centrifugal_from_gps` restores Eqns 25-26, with the speed through the air.

*Forward acceleration* is the difference of the airspeed between two GPS reports, held until the next.

*Yaw* is compared with the velocity through the air, not the course, once the wind is known.  The error is computed at a
report and held in body axes until the next.  A report is assumed to be late by one report: course, speed and climb are
extrapolated by their last change.  (In the firmware a speed extrapolated below zero becomes a large unsigned number,
which turns an aeroplane at rest; here it is zero.)

*Wind* from pairs of reports between which the nose turned: the change of ground velocity equals that of the velocity
through the air, whose direction is the nose's.  Yaw that is found late is a turn without a change of velocity: it
leaves a false wind of some metres per second that takes several turns to fade.  It is reported once the airspeeds in
different directions confirm it (`estimator.blocks.wind`); the estimator itself uses it as the firmware does.

*Renormalisation* (2017) keeps the direction of the Z row: E = D x N, then N = E x D, and Eqn 21.  The error of Eqn 17
then tilts the matrix as much as with Eqns 18-20 (`estimator.rotation.renormalise`), in the other direction.

*Rotation in a sample* is lengthened to its tangent: Eqn 17 then turns by the right angle.

*Gains* rise with the spin rate; the integral is held while turning.  Eqn 27 is used in the correct order, reference x
estimate (see `estimator.premerlani`, Errata).

Fixed point
-----------
`fixed_point` rounds as the 16-bit processor does: every stored number is an integer count, rounded to the nearest, ties
to even (convergent), and saturated; only the integral has 32 bits.  Matrix elements are 2.14; the 1.15 arithmetic
halves a product of two of them, which is then doubled, so that 13 bits remain.  Angles of velocities have 8 bits.  The
processor's sums are exact (40 bits).  Counts are those of the UDB4 board.

Left out: angle of attack in the compensation (a wing model configured in the firmware), the magnetometer, and dead
reckoning, which the attitude does not use.

References
----------
MatrixPilot, libDCM, revision of 2023, described in words; W. Premerlani and P. Bizard, "Direction Cosine Matrix
IMU: Theory", 2009.
"""

import math

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import clip, cross, put, wrap
from estimator.blocks.screening import FORCE_GOOD, GPS, fix_came, health_of, refuse, screen, take_rate, watch_limit
from estimator.blocks.wind import WIND_CHECK, check_wind
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, Column, ImuSample
from estimator.params.matrixpilot import CLASSIC as CLASSIC
from estimator.params.matrixpilot import UDB4 as UDB4
from estimator.params.matrixpilot import UDB5 as UDB5
from estimator.params.matrixpilot import MatrixPilotParams as MatrixPilotParams
from estimator.rotation import NEAR, level, propagate, renormalise

BOOST_RAD_S, MOST_BOOST = math.radians(50.0), 10.0  # spin beyond which the gains rise, and how far
LEARN_BELOW_RAD_S = math.radians(20.0)  # the integral is held while spinning faster
GAIN_TIME_S, GAIN_RANGE = 10.0, 0.1  # time constant and range of the gain calibration
INTEGRAL_LIMIT_RAD_S = 18.0  # range of its 16 bits: no limit in practice
FIX_LIFE_S = 4.5  # reports further apart form no pair; an older one is not used
LEAST_AIRSPEED_M_S = 2.0  # slower through the air: the course over ground is the better reference
LEAST_TURN = 0.4  # change of the unit nose between two reports that gives the wind
WIND_PART = 1.0 / 16.0  # of each new measurement of the wind
LOCK_RAD, LOCK_S = math.radians(15.0), 1.0  # yaw is found once it was this close for this long
LONGEST_STEP_RAD = 0.1  # keeps the renormalised matrix within 5e-4 of a rotation

GYRO_COUNT_RAD_S = 3.0 * 6.0 / 32768.0  # 5461.33 / 3 counts per rad/s
FORCE_COUNT = 1.0 / 2000.0  # of gravity
ANGLE_COUNT = 1.0 / 16384.0  # 2.14
MATRIX_COUNT = 1.0 / 8192.0  # 2.14 halved and doubled
SPEED_COUNT_M_S = 0.01
COURSE_COUNT_RAD = 2.0 * math.pi / 256.0

_STATE = (
    Column("omega_p_b", (3,), "proportional rate correction"),
    Column("omega_i_b", (3,), "integral rate correction; minus the offset learnt since"),
    Column("gyro_gain", (3,), "true rate over corrected reading, near one"),
    Column("spin_rad_s", (), "length of the corrected rate"),
    Column("g_ref_b", (3,), "reference of gravity, in units of gravity"),
    Column("turn_m_s2", (), "centrifugal acceleration |omega x V|"),
    Column("roll_pitch_b", (3,), "error of down"),
    Column("yaw_b", (3,), "error of yaw, held from report to report"),
    Column("fixes", (), "successive reports, up to two", integer=True),
    Column("fix_age_s", (), "time since the last report"),
    Column("report", (3,), "course [rad], ground speed and sink rate [m/s] of the last report"),
    Column("down_m", (), "height of the last report, positive down, where it replaces the sink rate"),
    Column("v_e_m_s", (3,), "ground velocity, extrapolated to the present"),
    Column("airspeed_m_s", (), "length of that less the wind"),
    Column("forward_m_s2", (), "change of airspeed between the last two reports"),
    Column("nose_then", (3,), "nose of the last report that began a pair for the wind"),
    Column("v_then_e_m_s", (3,), "its velocity"),
    Column("pair_begun", (), "1 once there is one", integer=True),
    Column("near_s", (), "how long the yaw error has been small"),
    Column("locked", (), "1 once yaw was found", integer=True),
)
STATE_DTYPE = state_dtype(MatrixPilotParams, *WIND_CHECK, *_STATE)


@kernel
def stored(x, count):  # type: ignore[no-untyped-def]
    """`x` as stored in 16 bits of `count`: convergent rounding and saturation."""
    return count * clip(np.rint(x * (1.0 / count)), -32768.0, 32767.0)


@kernel
def _store(a, count):  # type: ignore[no-untyped-def]
    a[0], a[1], a[2] = stored(a[0], count), stored(a[1], count), stored(a[2], count)


@kernel
def centrifugal(a, q, r, tilt):  # type: ignore[no-untyped-def]
    """Size of the centrifugal acceleration, without GPS (MatrixPilot 2017).

    Parameters
    ----------
    a : shape (3,)     gravity minus acceleration, body axes
    q, r : float       measured pitch and yaw rate, without the integral correction
    tilt : shape (3,)  Z row of the attitude

    Returns
    -------
    n_q, n_r, size : direction of (q, r), and ``omega x V = size (0, n_r, -n_q)``, in units of gravity as `a` is
    """
    turn = np.sqrt(q * q + r * r)
    if turn == 0.0:
        return 0.0, 0.0, 0.0
    n_q, n_r = q / turn, r / turn
    felt = a[2] * n_q - a[1] * n_r
    upright = tilt[2] * n_q - tilt[1] * n_r
    # Along the nose gravity is taken from the attitude: thrust does not disturb it.
    square = felt * felt + 1.0 - a[1] * a[1] - a[2] * a[2] - tilt[0] * tilt[0]
    root = np.sqrt(max(square, 0.0))
    size = felt + root if felt < 0.0 or upright < 0.0 else felt - root
    return n_q, n_r, max(size, 0.0)


@kernel
def gravity_reference(row, s):  # type: ignore[no-untyped-def]
    """Fill ``s.g_ref_b``: the accelerometer less centrifugal and forward acceleration."""
    f, w, g = row.force_b_m_s2, s.omega_b_rad_s, s.g_ref_b
    for i in range(3):
        g[i] = -f[i] / G_M_S2  # gravity minus acceleration
    if s.fixed_point:
        _store(g, FORCE_COUNT)
    if s.centrifugal_from_gps:
        v = s.airspeed_m_s / G_M_S2
        y, z = w[2] * v, -w[1] * v  # omega x (V, 0, 0): the paper's Eqns 25-26
    else:
        n_q, n_r, size = centrifugal(g, w[1] - s.omega_i_b[1], w[2] - s.omega_i_b[2], s.R_eb[2])
        s.turn_m_s2 = size * G_M_S2
        y, z = n_r * size, -n_q * size
    g[0] += s.forward_m_s2 / G_M_S2
    g[1] += y
    g[2] += z
    if s.fixed_point:
        _store(g, FORCE_COUNT)


@kernel
def renormalise_keeping_tilt(R_eb, fixed_point):  # type: ignore[no-untyped-def]
    """Bring the matrix back to a rotation, in place, keeping the direction of the Z row; False if lost."""
    put(R_eb[1], 1.0, cross(R_eb[2], R_eb[0]))  # E = D x N
    put(R_eb[0], 1.0, cross(R_eb[1], R_eb[2]))  # N = E x D
    for i in range(3):
        if fixed_point:
            _store(R_eb[i], MATRIX_COUNT)
        square = R_eb[i, 0] ** 2 + R_eb[i, 1] ** 2 + R_eb[i, 2] ** 2
        if not abs(square - 1.0) < 0.1:  # no longer within reach of Eqn 21
            return renormalise(R_eb)
        put(R_eb[i], 1.5 - 0.5 * square if abs(square - 1.0) < NEAR else 1.0 / np.sqrt(square), R_eb[i])  # Eqn 21
        if fixed_point:
            _store(R_eb[i], MATRIX_COUNT)
    return True


@kernel
def rotate(s):  # type: ignore[no-untyped-def]
    """Turn the attitude by the corrected rate (Eqns 16-17, the angle lengthened to its tangent); False if lost."""
    x = s.gyro_gain[0] * (s.omega_b_rad_s[0] + s.omega_p_b[0]) * s.dt_s  # Eqn 16
    y = s.gyro_gain[1] * (s.omega_b_rad_s[1] + s.omega_p_b[1]) * s.dt_s
    z = s.gyro_gain[2] * (s.omega_b_rad_s[2] + s.omega_p_b[2]) * s.dt_s
    angle = np.sqrt(x * x + y * y + z * z)
    parts = 1 + int(min(angle / LONGEST_STEP_RAD, 1000.0))  # one, at the rates of the firmware's aeroplanes
    tangent = (1.0 + (angle / parts) ** 2 / 3.0) / parts
    theta = s.roll_pitch_b  # working memory until this tick's error is known
    theta[0], theta[1], theta[2] = x * tangent, y * tangent, z * tangent
    if s.fixed_point:
        _store(theta, ANGLE_COUNT)
    for _ in range(parts):
        propagate(s.R_eb, theta, 1.0)
        if s.fixed_point:
            for i in range(3):
                _store(s.R_eb[i], MATRIX_COUNT)
        saved = renormalise_keeping_tilt(s.R_eb, s.fixed_point) if s.keep_tilt else renormalise(s.R_eb)
        if not saved:
            level(s.R_eb)
            return False
    return True


@kernel
def roll_pitch_error(s):  # type: ignore[no-untyped-def]
    """Fill ``s.roll_pitch_b``: reference x estimate (Eqn 27, corrected), pitch limited for launches."""
    g, R = s.g_ref_b, s.R_eb
    limit = s.pitch_error_limit
    s.roll_pitch_b[0] = g[1] * R[2, 2] - g[2] * R[2, 1]
    s.roll_pitch_b[1] = clip(g[2] * R[2, 0] - g[0] * R[2, 2], -limit, limit)
    s.roll_pitch_b[2] = g[0] * R[2, 1] - g[1] * R[2, 0]
    if s.fixed_point:
        _store(s.roll_pitch_b, 2.0 * FORCE_COUNT)  # a product with a 2.14 number, halved


@kernel
def take_report(row, s):  # type: ignore[no-untyped-def]
    """Take a GPS report: extrapolated velocity, forward acceleration, wind, yaw error."""
    s.fix_age_s += s.dt_s
    if s.fix_age_s > FIX_LIFE_S and s.fixes > 0:  # lost: no pair, no yaw
        s.fixes = s.pair_begun = 0
        s.near_s = s.forward_m_s2 = 0.0
        s.yaw_b[0] = s.yaw_b[1] = s.yaw_b[2] = 0.0
    if not fix_came(row, s):
        if row.gps_new:  # nor can the correction that is held from the last one be trusted
            s.forward_m_s2 = s.yaw_b[0] = s.yaw_b[1] = s.yaw_b[2] = 0.0
        return
    course, speed, sink, down = row.gps_course_rad, row.gps_speed_m_s, row.gps_v_e_m_s[2], row.gps_p_e_m[2]
    vertical = abs(down) < 1e6 if s.climb_from_height else abs(sink) < 1000.0
    if not (abs(course) < 100.0 and 0.0 <= speed < 1000.0 and vertical):
        refuse(s, GPS)
        return
    if s.climb_from_height:
        sink = (down - s.down_m) / s.fix_age_s if s.fixes > 0 and s.fix_age_s > 0.0 else 0.0
        s.down_m = down
    carry_on(course, speed, sink, s)
    if s.estimate_wind:
        learn_wind(s)
        if speed > s.min_speed_m_s:
            check_wind(s, speed * np.cos(course), speed * np.sin(course), s.fix_age_s)
    before = s.airspeed_m_s
    x, y, z = (s.v_e_m_s[0] - s.wind_e_m_s[0], s.v_e_m_s[1] - s.wind_e_m_s[1], s.v_e_m_s[2] - s.wind_e_m_s[2])
    s.airspeed_m_s = np.sqrt(x * x + y * y + z * z)
    if s.fixes == 2 and s.forward_acceleration and s.fix_age_s > 0.0:
        s.forward_m_s2 = (s.airspeed_m_s - before) / s.fix_age_s
    yaw_error(x, y, s)
    s.fix_age_s = 0.0


@kernel
def carry_on(course, speed, sink, s):  # type: ignore[no-untyped-def]
    """Set ``s.v_e_m_s``: the report plus its change since the previous one."""
    if s.fixed_point:
        course = np.rint(course / COURSE_COUNT_RAD) * COURSE_COUNT_RAD
        speed, sink = stored(speed, SPEED_COUNT_M_S), stored(sink, SPEED_COUNT_M_S)
    c, v, z = course, speed, sink
    if s.late_by_one_report and s.fixes > 0:
        c += wrap(course - s.report[0])
        v = max(2.0 * speed - s.report[1], 0.0)
        z = 2.0 * sink - s.report[2]
    s.report[0], s.report[1], s.report[2] = course, speed, sink
    s.v_e_m_s[0], s.v_e_m_s[1], s.v_e_m_s[2] = v * np.cos(c), v * np.sin(c), z
    s.fixes = min(s.fixes + 1, 2)


@kernel
def learn_wind(s):  # type: ignore[no-untyped-def]
    """Measure the wind between two reports whose noses differ: v = V f + wind, with V and a turn about down unknown."""
    R, v, f0, v0, wind = s.R_eb, s.v_e_m_s, s.nose_then, s.v_then_e_m_s, s.wind_e_m_s
    fx, fy, fz = R[0, 0] - f0[0], R[1, 0] - f0[1], R[2, 0] - f0[2]
    turned = np.sqrt(fx * fx + fy * fy + fz * fz)
    if s.pair_begun and turned > LEAST_TURN:
        x, y, z = v[0] - v0[0], v[1] - v0[1], v[2] - v0[2]
        airspeed = np.sqrt(x * x + y * y + z * z) / turned
        theta = np.arctan2(y, x) - np.arctan2(fy, fx)
        if s.fixed_point:
            theta = np.rint(theta / COURSE_COUNT_RAD) * COURSE_COUNT_RAD
        c, n = airspeed * np.cos(theta), airspeed * np.sin(theta)
        sx, sy, sz = R[0, 0] + f0[0], R[1, 0] + f0[1], R[2, 0] + f0[2]
        wind[0] += WIND_PART * (0.5 * (v[0] + v0[0] - c * sx + n * sy) - wind[0])
        wind[1] += WIND_PART * (0.5 * (v[1] + v0[1] - n * sx - c * sy) - wind[1])
        wind[2] += WIND_PART * (0.5 * (v[2] + v0[2] - airspeed * sz) - wind[2])
    elif s.pair_begun:
        return
    for i in range(3):
        f0[i], v0[i] = R[i, 0], v[i]
    s.pair_begun = 1


@kernel
def yaw_error(x, y, s):  # type: ignore[no-untyped-def]
    """Fill ``s.yaw_b`` from the velocity (x, y) through the air, or the course where that is slow (Eqns 23-24)."""
    if x * x + y * y < LEAST_AIRSPEED_M_S**2:
        x, y = s.v_e_m_s[0], s.v_e_m_s[1]
    length = np.hypot(x, y)
    ground = 0.0
    if np.hypot(s.v_e_m_s[0], s.v_e_m_s[1]) > s.min_speed_m_s and length > 0.0:
        if s.fixed_point:
            angle = np.rint(np.arctan2(y, x) / COURSE_COUNT_RAD) * COURSE_COUNT_RAD
            x, y, length = np.cos(angle), np.sin(angle), 1.0
        ground = (s.R_eb[0, 0] * y - s.R_eb[1, 0] * x) / length  # Eqn 23
        along = (s.R_eb[0, 0] * x + s.R_eb[1, 0] * y) / length
        near = along > 0.0 and abs(ground) < np.tan(LOCK_RAD) * along
        s.near_s = s.near_s + s.fix_age_s if near else 0.0
        if s.near_s >= LOCK_S:
            s.locked = 1
    for i in range(3):
        s.yaw_b[i] = ground * s.R_eb[2, i]  # Eqn 24
    if s.fixed_point:
        _store(s.yaw_b, MATRIX_COUNT)


@kernel
def feed_back(s):  # type: ignore[no-untyped-def]
    """Proportional and integral corrections (Eqns 28-29, a pair of gains for each error), and the gyros' gain."""
    boost = 1.0
    if s.spin_boost:
        boost = clip(s.spin_rad_s / BOOST_RAD_S, 1.0, MOST_BOOST)
    learning = s.dt_s if s.spin_rad_s < LEARN_BELOW_RAD_S else 0.0
    for i in range(3):
        e_rp, e_yaw = s.roll_pitch_b[i], s.yaw_b[i]
        s.omega_p_b[i] = boost * (s.k_p_rp * e_rp + s.k_p_yaw * e_yaw)
        integral = s.omega_i_b[i] + learning * (s.k_i_rp * e_rp + s.k_i_yaw * e_yaw)
        s.omega_i_b[i] = clip(integral, -INTEGRAL_LIMIT_RAD_S, INTEGRAL_LIMIT_RAD_S)
    if s.fixed_point:
        _store(s.omega_p_b, GYRO_COUNT_RAD_S)
    if s.calibrate_gain and s.spin_rad_s > BOOST_RAD_S:
        part = s.dt_s / GAIN_TIME_S / (s.spin_rad_s * s.spin_rad_s)
        for i in range(3):
            gain = s.gyro_gain[i] + part * s.omega_b_rad_s[i] * s.omega_p_b[i]
            s.gyro_gain[i] = clip(gain, 1.0 - GAIN_RANGE, 1.0 + GAIN_RANGE)


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One pass over row `k`; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        for i in range(3):
            s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i] - s.omega_i_b[i]
        take_rate(row, s, good)
        w = s.omega_b_rad_s
        if s.fixed_point:
            _store(w, GYRO_COUNT_RAD_S)
        s.spin_rad_s = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        if good & FORCE_GOOD:
            gravity_reference(row, s)
        if not rotate(s):
            s.locked = 0
        if good & FORCE_GOOD:
            roll_pitch_error(s)
        else:
            s.roll_pitch_b[0] = s.roll_pitch_b[1] = s.roll_pitch_b[2] = 0.0
        take_report(row, s)
        feed_back(s)
        watch_limit(s.omega_i_b, INTEGRAL_LIMIT_RAD_S, s)
    return health_of(s, s.locked, s.fix_age_s <= FIX_LIFE_S)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class MatrixPilot(Compiled[MatrixPilotParams]):
    """MatrixPilot since 2017: Premerlani and Bizard with a centrifugal term that needs no GPS."""

    heading_reference = "nose"
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = UDB4

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["gyro_gain"] = 1.0
        s["fix_age_s"] = math.inf
