"""Roll-pitch drift from the change of GPS velocity: Premerlani's note of 2011, with a choice of yaw reference.

An accelerometer measures gravity minus acceleration (Eqn 1), and the attitude rotates that into the earth frame
(Eqn 2).  Integrated between two GPS reports it must equal gravity less the change of the reported velocity (Eqn 3); the
cross product of the two sides is the error of the attitude (Eqns 4 and 5).  No airspeed, angle of attack or sideslip is
assumed, so the method holds in turns, in wind and in loops, where the centrifugal term of the first paper does not.

Lag --- A receiver reports velocity filtered and late.  The left side of Eqn 3, and the nose, pass the same filter and
are recalled from one latency ago, with all corrections made since (`estimator.blocks.gyro_frame`).  An error found at
a report is removed evenly until the next one, by 1 - exp(-K_P W interval): the same loop at 1 and at 10 Hz.

Yaw --- ``course`` and ``nose``: the matrix itself is turned to the nose, the direction of the velocity through the air
(Eqns 22 to 24 of the paper of 2009, with v_gps - wind for the course).  The wind is learnt in turns
(`estimator.blocks.wind`); before the first turn that is the course over ground.  With ``course`` the reported heading
is that of the paper: the reported matrix is turned by the crab angle.  Eqn 4 so compares along the true heading in
either case; along the course, a crab of 23 degrees becomes a tilt in every turn.  ``magnetometer``: to magnetic north.

Before the yaw lock
-------------------
With an unknown heading, an acceleration along the ground counts as tilt: 11 degrees in a launch.  Until the nose is
near the reference, and without reports, the paper of 2009 is used instead (Eqns 25 to 27): the acceleration is the
speed times the turn rate of the nose.  Integrated, that is Eqn 3 with the velocity along the nose.  There is no
correction while the length of the resulting gravity is wrong.

References
----------
W. Premerlani, "Roll-Pitch Gyro Drift Compensation", 2011.
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009.
"""

import math

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.gyro_frame import (
    GYRO_FRAME,
    apply_corrections,
    attitude,
    recall,
    start_gyro_frame,
    sum_up,
    to_earth,
)
from estimator.blocks.kernels import cross, dot, put
from estimator.blocks.magnetometer import FIELD, take_field
from estimator.blocks.pi import feed_back
from estimator.blocks.screening import GPS, fix_came, health_of, refuse, screen, take_rate, watch_limit
from estimator.blocks.wind import WIND_FILTER, learn_wind
from estimator.compiler.jit import inlined, kernel
from estimator.interface import G_M_S2, Column, HeadingReference, ImuSample
from estimator.params.gps_velocity import MAGNETOMETER as GPS_VELOCITY_MAGNETOMETER
from estimator.params.gps_velocity import NOSE as GPS_VELOCITY_NOSE
from estimator.params.gps_velocity import YAW_REFERENCES
from estimator.params.gps_velocity import GpsVelocityParams as GpsVelocityParams

FIX_LIFE_S = 2.5  # reports further apart are not compared
LOCK_LIFE_S = 30.0  # after so long without reports, the heading counts as unknown
STAND_IN_S = 0.1  # interval of the 2009 correction, where it is used
LOCK_RAD, LOCK_S = math.radians(15.0), 1.0  # yaw is locked once it was this close for this long
LEAST_DOWN = 0.3  # of gravity, in the measured vertical
COURSE, NOSE, MAGNETOMETER = 0, 1, 2
_STATE = (
    Column("yaw_reference", (), "COURSE, NOSE or MAGNETOMETER", integer=True),
    Column("omega_i_b", (3,), "integral rate correction, Eqn 29; minus the offset learnt since"),
    Column("since_fix_g_m_s", (3,), "left side of Eqn 3 over the last interval"),
    Column("fix_t_s", (), "when the last fix was true, by the clock of the state"),
    Column("interval_s", (), "from the fix before it"),
    Column("v_e_m_s", (3,), "velocity of the last fix"),
    Column("fix_age_s", (), "time since a fix arrived"),
    Column("mag_t_s", (), "time of the last magnetometer sample"),
    Column("stand_in_t_s", (), "start of the interval of the 2009 correction"),
    Column("stand_in_g", (6,), "`felt_g_m_s` and nose at that time"),
    Column("error_e", (3,), "present error, earth axes, Eqn 4"),
    Column("error_g", (3,), "the same, or another vector, in the gyros' frame"),
    Column("total_b", (3,), "weighted error, Eqn 28"),
    Column("omega_p_b", (3,), "proportional rate correction, Eqn 29"),
    Column("near_s", (), "how long the yaw error has been small"),
    Column("locked", (), "1 once yaw was found", integer=True),
)
STATE_DTYPE = state_dtype(GpsVelocityParams, *FIELD, *WIND_FILTER, *GYRO_FRAME, *_STATE)


@kernel
def correct(s, error_e, weight, k_i, interval_s, rate_e):  # type: ignore[no-untyped-def]
    """Pass an error through the PI controller (Eqns 5, 28, 29); set `rate_e`, which removes it within the interval."""
    for i in range(3):
        s.error_g[i] = s.R_eg[0, i] * error_e[0] + s.R_eg[1, i] * error_e[1] + s.R_eg[2, i] * error_e[2]
    for i in range(3):
        along = s.R_gb[0, i] * s.error_g[0] + s.R_gb[1, i] * s.error_g[1] + s.R_gb[2, i] * s.error_g[2]  # Eqn 5
        s.total_b[i] = weight * along
    w = s.omega_b_rad_s
    turning = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) >= s.integrate_below_rad_s
    decay = s.k_p * weight * interval_s
    k_p = s.k_p * (-np.expm1(-decay) / decay if decay > 0.0 else 1.0)
    feed_back(s.total_b, k_p, 0.0 if turning else k_i, s.offset_limit_rad_s, interval_s, s.omega_p_b, s.omega_i_b)
    for i in range(3):
        s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i] - s.omega_i_b[i]
        rate_e[i] = k_p * weight * error_e[i]


@kernel
def correct_tilt(s, error_e, weight, interval_s):  # type: ignore[no-untyped-def]
    """Roll-pitch error, earth axes, to be removed within `interval_s`."""
    correct(s, error_e, weight, s.k_i, interval_s, s.tilt_rate_e)
    s.tilt_left_s = interval_s


@kernel
def correct_yaw(s, sine, cosine, length, interval_s):  # type: ignore[no-untyped-def]
    """Yaw error: `sine` and `cosine` of the angle still to turn, both times `length`, which weighs it.

    The cross product of Eqn 23 decreases beyond a right angle: there only its sign is used, with full size.
    """
    near = cosine > 0.0 and abs(sine) < np.tan(LOCK_RAD) * cosine
    s.near_s = s.near_s + interval_s if near else 0.0
    if s.near_s >= LOCK_S:
        s.locked = 1
    ground = sine if cosine >= 0.0 else np.copysign(length, sine)  # Eqn 23
    s.error_e[0] = s.error_e[1] = 0.0
    s.error_e[2] = ground  # Eqn 24: along the vertical
    k_i = s.k_i if s.locked else 0.0  # an unknown initial yaw is no gyro offset
    correct(s, s.error_e, s.w_y, k_i, interval_s, s.yaw_rate_e)
    s.yaw_left_s = interval_s


@kernel
def roll_pitch_at_fix(s, dv_e_m_s):  # type: ignore[no-untyped-def]
    """Eqns 3 and 4 over the interval between two fixes, `dv_e_m_s` the change of the reported velocity."""
    left = to_earth(s, s.since_fix_g_m_s)  # left side of Eqn 3
    down = s.interval_s * G_M_S2 - dv_e_m_s[2]
    if not s.gps_vertical_velocity:
        # As measured, so that the cross product compares the horizontal components; but downward, or an inverted
        # estimate would stay inverted.
        down = max(left[2], LEAST_DOWN * s.interval_s * G_M_S2)
    right = (-dv_e_m_s[0], -dv_e_m_s[1], down)
    # Eqn 4, divided by both lengths, but by no less than half of gravity's, so that free fall has little weight.
    least = 0.5 * s.interval_s * G_M_S2
    scale = 1.0 / (max(np.sqrt(dot(left, left)), least) * max(np.sqrt(dot(right, right)), least))
    put(s.error_e, scale, cross(left, right))
    correct_tilt(s, s.error_e, s.w_rp, s.interval_s)


@kernel
def stand_in(s):  # type: ignore[no-untyped-def]
    """The roll-pitch correction of 2009 (Eqns 25 to 27), over the time since it was last computed.

    Integrated, omega x V is the speed times the change of the nose.  The speed is that of the last fix, however old:
    a speed of zero would let every turn without a GPS look level, and a circle become a spiral.
    """
    apply_corrections(s)
    interval_s = s.clock_s - s.stand_in_t_s
    speed = np.hypot(s.air_m_s[0], s.air_m_s[1]) if s.wind_known else np.hypot(s.v_e_m_s[0], s.v_e_m_s[1])
    for i in range(3):
        felt, nose = s.felt_g_m_s[i], s.R_gb[i, 0]
        s.error_e[i] = felt - s.stand_in_g[i] + speed * (nose - s.stand_in_g[3 + i])  # Eqns 25 and 26
        s.stand_in_g[i], s.stand_in_g[3 + i] = felt, nose
    s.stand_in_t_s = s.clock_s
    if interval_s > 2.0 * STAND_IN_S or s.unfelt_s > 0.0:
        return
    x, y, z = to_earth(s, s.error_e)
    length = np.sqrt(x * x + y * y + z * z)
    if length > 0.0 and abs(length / (interval_s * G_M_S2) - 1.0) <= s.launch_gate:
        s.error_e[0], s.error_e[1], s.error_e[2] = y / length, -x / length, 0.0  # Eqn 27: seen in earth, x down
        correct_tilt(s, s.error_e, s.w_start, interval_s)


@kernel
def yaw_at_fix(s):  # type: ignore[no-untyped-def]
    """Learn the wind, and compare the nose of the fix with the velocity over the ground or through the air."""
    north, east, _ = to_earth(s, s.at_fix_g[3:])
    v_north, v_east = s.v_e_m_s[0], s.v_e_m_s[1]
    if np.hypot(v_north, v_east) < s.min_speed_m_s:
        return
    c, z = np.cos(s.yaw_applied_rad), np.sin(s.yaw_applied_rad)
    learn_wind(s, c * north + z * east, c * east - z * north, v_north, v_east, s.interval_s)
    if s.yaw_reference == MAGNETOMETER:
        return
    # The nose of now, and the velocity through the air that is expected along it.
    x, y, _ = to_earth(s, s.R_gb[:, 0])
    f0, f1 = c * x + z * y, c * y - z * x
    air0, air1 = s.air_m_s[0] * f0 - s.air_m_s[1] * f1, s.air_m_s[0] * f1 + s.air_m_s[1] * f0
    speed = np.hypot(air0, air1)
    if speed < s.min_speed_m_s:
        return
    sine, cosine = (x * air1 - y * air0) / speed, (x * air0 + y * air1) / speed
    correct_yaw(s, sine, cosine, np.hypot(x, y), s.interval_s)
    if s.yaw_reference == COURSE:
        over0, over1 = air0 + s.wind_e_m_s[0], air1 + s.wind_e_m_s[1]
        over = np.hypot(over0, over1)
        if over >= s.min_speed_m_s:
            s.crab[0] = (air0 * over0 + air1 * over1) / (speed * over)
            s.crab[1] = (air0 * over1 - air1 * over0) / (speed * over)


@kernel
def take_fix(row, s):  # type: ignore[no-untyped-def]
    """Process a GPS report."""
    v = row.gps_v_e_m_s
    vertical = abs(v[2]) < 1000.0 or not s.gps_vertical_velocity
    if not (abs(v[0]) < 1000.0 and abs(v[1]) < 1000.0 and vertical):
        refuse(s, GPS)
        return
    apply_corrections(s)
    before0, before1, before2 = s.at_fix_g[0], s.at_fix_g[1], s.at_fix_g[2]
    t_s = s.clock_s - s.gps_latency_s
    recall(s, t_s)
    s.since_fix_g_m_s[0] = s.at_fix_g[0] - before0
    s.since_fix_g_m_s[1] = s.at_fix_g[1] - before1
    s.since_fix_g_m_s[2] = s.at_fix_g[2] - before2
    s.interval_s = t_s - s.fix_t_s
    s.fix_t_s, s.fix_age_s = t_s, 0.0
    for i in range(3):
        s.error_e[i] = v[i] - s.v_e_m_s[i]
        s.v_e_m_s[i] = v[i]
    if 0.0 < s.interval_s <= FIX_LIFE_S:
        if s.locked and s.clock_s >= s.blind_until_s:
            roll_pitch_at_fix(s, s.error_e)
        yaw_at_fix(s)


@kernel
def turn_to_north(s, sine, cosine):  # type: ignore[no-untyped-def]
    """Turn the heading at once by the angle of that sine and cosine: the first field sets it."""
    for j in range(3):
        x, y = s.R_eg[0, j], s.R_eg[1, j]
        s.R_eg[0, j], s.R_eg[1, j] = cosine * x - sine * y, sine * x + cosine * y
    s.yaw_applied_rad += np.arctan2(sine, cosine)
    apply_corrections(s)


@kernel
def take_mag(row, s):  # type: ignore[no-untyped-def]
    """Correct the yaw by the angle between the horizontal field and magnetic north."""
    if not take_field(row, s):
        return
    m = s.field_b_ut
    apply_corrections(s)
    for i in range(3):
        s.error_g[i] = s.R_gb[i, 0] * m[0] + s.R_gb[i, 1] * m[1] + s.R_gb[i, 2] * m[2]
    north, east, _ = to_earth(s, s.error_g)
    length, interval_s = np.hypot(north, east), s.clock_s - s.mag_t_s
    if not length > 0.0:
        return
    c, z = np.cos(s.declination_rad), np.sin(s.declination_rad)
    sine, cosine = (north * z - east * c) / length, (north * c + east * z) / length
    if s.mag_t_s == -np.inf:
        turn_to_north(s, sine, cosine)
    elif 0.0 < interval_s <= FIX_LIFE_S:
        correct_yaw(s, sine, cosine, 1.0, interval_s)
    s.mag_t_s = s.clock_s


@inlined
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One inertial sample, and the report that came with it; returns the `Health`."""
    row, s = rows[k], state[0]
    t_before = s.t_s
    good = screen(row, s)
    if good:
        take_rate(row, s, good)  # Eqn 16
        if not sum_up(row, s, good, s.t_s - t_before):
            s.locked = 0
        attitude(s)
        watch_limit(s.omega_i_b, s.offset_limit_rad_s, s)
        s.fix_age_s += s.dt_s
        if fix_came(row, s):
            take_fix(row, s)
        if s.yaw_reference == MAGNETOMETER:
            take_mag(row, s)
        if s.fix_age_s > LOCK_LIFE_S and s.yaw_reference != MAGNETOMETER:
            s.locked = 0
        if not (s.locked and s.fix_age_s <= FIX_LIFE_S) and s.clock_s - s.stand_in_t_s >= STAND_IN_S:
            stand_in(s)
    return health_of(s, s.locked, s.fix_age_s <= FIX_LIFE_S)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class GpsVelocity(Compiled[GpsVelocityParams]):
    """Premerlani (2011): roll and pitch from the change of GPS velocity, yaw from the course."""

    heading_reference: HeadingReference = "course"  # "nose" with another `yaw_reference`
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = GpsVelocityParams()

    def __init__(self, params: GpsVelocityParams | None = None) -> None:
        super().__init__(params)
        self.heading_reference = "course" if self.params.yaw_reference == "course" else "nose"

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["yaw_reference"] = YAW_REFERENCES.index(self.params.yaw_reference)
        start_gyro_frame(s)
        s["fix_age_s"] = math.inf
        s["fix_t_s"] = s["mag_t_s"] = -math.inf
        s["stand_in_g"][3:] = s["R_eb"][:, 0]


class GpsVelocityNose(GpsVelocity):
    """gps_velocity with the nose as heading: wind learnt in turns is subtracted from the GPS velocity."""

    _default = GPS_VELOCITY_NOSE


class GpsVelocityMagnetometer(GpsVelocity):
    """gps_velocity with the heading from the magnetometer."""

    uses = ("gyro", "accelerometer", "gps", "magnetometer")
    _default = GPS_VELOCITY_MAGNETOMETER
