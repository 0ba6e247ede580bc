"""ArduPilot's AP_AHRS_DCM of 12 July 2013, the algorithm that van Zundert et al. ported to Simulink.

One pass per inertial sample: integrate the gyros and renormalise (their chapter 2), correct yaw by compass or by
the course over ground (3.1), and, at every GPS fix, correct all three axes by the mean specific force of the
interval in the earth frame, against gravity and the change of GPS velocity (3.2; Premerlani's note of 2011).
The proportional terms are held in between; the integral is updated after every five seconds of slow rotation.

Quirks
------
Faults of the original, corrected in later versions or obvious to a reader, each have a name in `Quirk`.
`JULY_2013` is all of them, the original; the default is the empty set, the same algorithm corrected.

Differences between the report's text and the code that it describes
--------------------------------------------------------------------
* The integral is not "set equal to" the saturated sum: the saturated sum is added to it, and cleared.
* Eqn 3.12 integrates the error in the earth frame; the code integrates it in the body frame, as Eqn 3.11 has it.
* The third element of the error (Eqn 3.9) is zeroed only with a compass and without GPS.
* Without GPS the correction comes once in 0.2 s, and the proportional term is held from one to the next.

Left out: the trim of the board, the eightfold gains before arming, the position.  The reported rate has no
proportional terms in it: they turn the estimate, not the aeroplane.  Beyond the original: samples are screened as
in every estimator here, steps of more than 0.2 rad are taken in parts, and power-up levels on the mean sample if
there is one; ``reset(None)`` is level and north, as in 2013.

References
----------
ArduPilot, libraries/AP_AHRS/AP_AHRS_DCM, revision 279f6d00 of 10 July 2013; delay line: 56bcda72 of 5 November 2013.
J. van Zundert, F. Bruning, B. de Jager, "Direction cosine matrix based IMU implementation in Matlab/Simulink", 2013.
W. Premerlani, "Roll-pitch gyro drift compensation", 2011, Eqns 3-5.   W. Premerlani, "Fast rotations", 2011.
"""

import math

import numpy as np

from estimator.ap_dcm.wind import AIR_LIFE_S, examine_wind, learn_wind
from estimator.ap_dcm.yaw import FIX_LIFE_S, MIN_SPEED_M_S, SPIN_LIMIT_RAD_S, correct_yaw, spin_gain
from estimator.blocks.air import true_airspeed_factor
from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import clip, cross, dot, put
from estimator.blocks.magnetometer import FIELD, take_field
from estimator.blocks.screening import FORCE_GOOD, GPS, airspeed_came, fix_came, health_of, refuse, screen, take_rate
from estimator.blocks.wind import WIND_CHECK
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, Column, HeadingReference, ImuSample
from estimator.params.ap_dcm import AP_DCM_2013, MOST_FIXES, ApDcmParams, Quirk
from estimator.rotation import LONGEST_STEP_RAD, level, propagate, renormalise_exactly

LONGEST_PAUSE_S = 0.2  # after a longer one the interval restarts, and its gyro sample is lost
LEARN_S = 5.0 + 1e-5  # the integral moves once in so much slow rotation: 25 fixes of 0.2 s in float32 just miss it
NO_GPS_S = 0.2 - 1e-5  # interval of correction without GPS: 20 samples of 10 ms just reach it
LAUNCH_M_S2 = 7.0  # forward specific force of a throw
CLIP_G = 0.5

_STATE = (
    *(Column(quirk.value, (), "see Quirk", integer=True) for quirk in Quirk),
    Column("use_magnetometer", (), "1 where its samples are taken", integer=True),
    Column("omega_p_b", (3,), "proportional roll-pitch correction, held between two of them, Eqn 3.11"),
    Column("omega_yaw_p", (), "proportional yaw correction, about body z, Eqn 3.4"),
    Column("omega_i_b", (3,), "integral correction; minus the offset learnt since"),
    Column("omega_sum_b", (3,), "next change of the integral, Eqns 3.5 and 3.12"),
    Column("sum_s", (), "time of slow rotation in that sum"),
    Column("omega_total_b", (3,), "corrected rate that is integrated, Eqn 2.1"),
    Column("spin_rad_s", (), "length of the corrected rate without proportional terms"),
    Column("R_euler_eb", (3, 3), "attitude whose roll, pitch and yaw are used"),
    Column("error_b", (3,), "roll-pitch-yaw error of the specific force, body axes, Eqn 3.10"),
    Column("yaw_found", (), "1 once heading was set", integer=True),
    Column("force_sum_e_m_s", (3,), "integral of the specific force in earth axes, Eqn 3.7"),
    Column("force_s", (), "time in that sum"),
    Column("interval_s", (), "time since the last correction"),
    Column("begun", (), "1 once a velocity begins the interval", integer=True),
    Column("lock", (), "1 if the interval began with a fix", integer=True),
    Column("force_e_g", (3,), "mean specific force, earth axes"),
    Column("reference_e", (3,), "its reference direction, Eqn 3.8 and the note's Eqn 3"),
    Column("delayed", (MOST_FIXES, 3), "mean specific forces that await their velocity"),
    Column("oldest", (), "index of the oldest of them", integer=True),
    Column("delay_begun", (), "1 once they are filled", integer=True),
    Column("v_e_m_s", (3,), "velocity at the end of the interval"),
    Column("v_last_e_m_s", (3,), "velocity at its beginning"),
    Column("new_fix", (), "1 where a usable fix arrived in this tick", integer=True),
    Column("fix_age_s", (), "time since it"),
    Column("course_rad", (), "its course"),
    Column("course", (2,), "the same as a unit vector, north and east"),
    Column("speed_m_s", (), "its ground speed"),
    Column("new_course", (), "1 while the last fix has not corrected yaw", integer=True),
    Column("field_age_s", (), "time since it"),
    Column("new_field", (), "1 while it has not corrected yaw", integer=True),
    Column("airspeed_m_s", (), "last airspeed measured, or of the last fix less the wind"),
    Column("air_age_s", (), "time since the last one measured"),
    Column("off_course_s", (), "how long the compass has been off the course"),
    Column("compass", (), "1 where the compass is to be used", integer=True),
    Column("compass_yaw_s", (), "when the compass last corrected yaw"),
    Column("course_yaw_s", (), "when the course last corrected yaw"),
    Column("nose_last", (3,), "nose at the last wind estimate"),
    Column("v_wind_e_m_s", (3,), "velocity at the last wind estimate"),
    Column("straight_share", (), "part of the wind taken from measured airspeed along a compass's nose"),
    Column("wind_s", (), "time of that; -inf before the first"),
)
STATE_DTYPE = state_dtype(ApDcmParams, *FIELD, *WIND_CHECK, *_STATE)


@kernel
def take_arrivals(row, s):  # type: ignore[no-untyped-def]
    """Take plausible samples of GPS, magnetometer and airspeed that arrived."""
    s.fix_age_s += s.dt_s
    s.field_age_s += s.dt_s
    s.air_age_s += s.dt_s
    s.new_fix = 0
    if fix_came(row, s):
        v, course, speed = row.gps_v_e_m_s, row.gps_course_rad, row.gps_speed_m_s
        moving = abs(v[0]) < 1000.0 and abs(v[1]) < 1000.0 and abs(v[2]) < 1000.0  # NaN is not
        if moving and abs(course) < 100.0 and 0.0 <= speed < 1000.0:
            s.new_fix, s.new_course, s.fix_age_s, s.course_rad, s.speed_m_s = 1, 1, 0.0, course, speed
            s.course[0], s.course[1] = np.cos(course), np.sin(course)
        else:
            refuse(s, GPS)
    if s.use_magnetometer and take_field(row, s):
        s.new_field, s.field_age_s = 1, 0.0
    if airspeed_came(row, s):
        factor = true_airspeed_factor(row, s.elevation_m)  # EAS2TAS
        s.airspeed_m_s, s.air_age_s = factor * max(row.equivalent_airspeed_m_s, 0.0), 0.0


@kernel
def turn(row, s, good):  # type: ignore[no-untyped-def]
    """Integrate the corrected rate (Eqns 2.1-2.3) and renormalise; a lost matrix goes back to the sample before."""
    for i in range(3):
        s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i] - s.omega_i_b[i]
    take_rate(row, s, good)
    w, total = s.omega_b_rad_s, s.omega_total_b
    s.spin_rad_s = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    for i in range(3):
        total[i] = w[i] + s.omega_p_b[i]
    total[2] += s.omega_yaw_p
    if s.stale_euler:
        _copy(s.R_eb, s.R_euler_eb)
    angle_rad = s.dt_s * np.sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2])
    parts = 1
    if angle_rad >= LONGEST_STEP_RAD:  # not NaN: with one part the matrix is then found lost
        parts += int(min(angle_rad / LONGEST_STEP_RAD, 1000.0))
    for _ in range(parts):
        propagate(s.R_eb, total, s.dt_s / parts)
        if not renormalise_exactly(s.R_eb):
            _begin_anew(s)
            break
    if not s.stale_euler:
        _copy(s.R_eb, s.R_euler_eb)


@kernel
def _begin_anew(s):  # type: ignore[no-untyped-def]
    """Restore the previous sample's attitude, or level, and clear all corrections: one of them was invalid."""
    _copy(s.R_euler_eb, s.R_eb)
    if not renormalise_exactly(s.R_eb):
        level(s.R_eb)
    s.omega_yaw_p = s.sum_s = s.spin_rad_s = 0.0
    for i in range(3):
        s.omega_p_b[i] = s.omega_i_b[i] = s.omega_sum_b[i] = s.omega_b_rad_s[i] = 0.0
        s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i]


@kernel
def _copy(source, target):  # type: ignore[no-untyped-def]
    for i in range(3):
        for j in range(3):
            target[i, j] = source[i, j]


@kernel
def end_of_interval(row, s):  # type: ignore[no-untyped-def]
    """Whether the specific force can be compared now; sets the velocity ``s.v_e_m_s`` at the end of the interval."""
    v, wind = s.v_e_m_s, s.wind_e_m_s
    if s.fix_age_s <= FIX_LIFE_S:
        if not s.new_fix:
            return False
        for i in range(3):
            v[i] = row.gps_v_e_m_s[i]
            if not s.lock:
                s.v_last_e_m_s[i] = v[i]
        s.lock = 1
        if s.air_age_s > AIR_LIFE_S:
            s.airspeed_m_s = np.hypot(v[0] - wind[0], v[1] - wind[1])
    else:
        if s.interval_s < NO_GPS_S:
            return False
        for i in range(3):  # only the turn of the nose shows the motion then
            v[i] = s.R_eb[i, 0] * s.airspeed_m_s + wind[i]
        s.lock = 0
    if s.begun:
        return True
    s.begun = 1  # the first velocity ends no interval
    for i in range(3):
        s.v_last_e_m_s[i] = v[i]
    return False


@kernel
def compare_force(s):  # type: ignore[no-untyped-def]
    """Fill ``s.error_b``: mean specific force of the interval x gravity and GPS acceleration (note's Eqns 3-5)."""
    force, reference = s.force_e_g, s.reference_e
    reference[0], reference[1], reference[2] = 0.0, 0.0, -1.0  # Eqn 3.8
    moving = s.lock or s.fly_forward
    for i in range(3):
        force[i] = s.force_sum_e_m_s[i] / (s.force_s * G_M_S2)  # Eqn 3.7
        if moving:
            change = s.gps_gain * (s.v_e_m_s[i] - s.v_last_e_m_s[i]) / (s.interval_s * G_M_S2)
            reference[i] += clip(change, -CLIP_G, CLIP_G) if i == 2 and s.vertical_clip else change
    _normalise(reference)
    if not s.short_force or force[0] ** 2 + force[1] ** 2 + force[2] ** 2 > 1.0:
        _normalise(force)
    if moving and s.gps_delay_fixes > 0:
        delay_force(s)
    x, y, z = cross(force, reference)  # Eqn 3.9
    if s.compass:  # yaw comes from the compass, but for the share that a bank makes visible in the acceleration
        R = s.R_euler_eb
        known = s.fix_age_s <= FIX_LIFE_S and s.gps_gain == 1.0
        z *= abs(R[2, 1]) / max(np.hypot(R[2, 1], R[2, 2]), 1e-9) if known else 0.0
    for j in range(3):
        s.error_b[j] = s.R_eb[0, j] * x + s.R_eb[1, j] * y + s.R_eb[2, j] * z  # Eqn 3.10


@kernel
def _normalise(a):  # type: ignore[no-untyped-def]
    """Scale to unit length, in place; a vector without direction becomes zero."""
    length = np.sqrt(dot(a, a))
    put(a, 1.0 / length if length > 1e-9 else 0.0, a)


@kernel
def delay_force(s):  # type: ignore[no-untyped-def]
    """Replace ``s.force_e_g`` by that of `gps_delay_fixes` intervals ago."""
    for i in range(3):
        now = s.force_e_g[i]
        if not s.delay_begun:
            for back in range(MOST_FIXES):
                s.delayed[back, i] = now
        s.force_e_g[i] = s.delayed[s.oldest, i]
        s.delayed[s.oldest, i] = now
    s.delay_begun = 1
    s.oldest = (s.oldest + 1) % s.gps_delay_fixes


@kernel
def sum_force(row, s, good):  # type: ignore[no-untyped-def]
    """Add the sample to the mean specific force of the interval, in earth axes (Eqns 3.6 and 3.7)."""
    f = row.force_b_m_s2
    s.interval_s += s.dt_s
    if good & FORCE_GOOD:
        s.force_s += s.dt_s
        for i in range(3):
            s.force_sum_e_m_s[i] += (s.R_eb[i, 0] * f[0] + s.R_eb[i, 1] * f[1] + s.R_eb[i, 2] * f[2]) * s.dt_s


@kernel
def correct_by_force(row, s, good):  # type: ignore[no-untyped-def]
    """At the end of an interval, correct by its mean specific force (Eqns 3.8-3.12)."""
    if not end_of_interval(row, s):
        return
    if s.force_s > 0.5 * s.interval_s:  # else too little of the interval was measured
        compare_force(s)
    else:
        s.error_b[0] = s.error_b[1] = s.error_b[2] = 0.0
    gain = s.kp * spin_gain(s)
    if good & FORCE_GOOD and thrown(row.force_b_m_s2[0], s):
        gain *= 0.5
    for i in range(3):
        s.omega_p_b[i] = gain * s.error_b[i]  # Eqn 3.11
        if s.spin_rad_s < SPIN_LIMIT_RAD_S:
            s.omega_sum_b[i] += s.ki * s.error_b[i] * s.interval_s  # Eqn 3.12, in the body frame
    if s.spin_rad_s < SPIN_LIMIT_RAD_S:
        s.sum_s += s.interval_s
    if s.sum_s >= LEARN_S:
        limit = s.gyro_drift_rad_s2 * s.sum_s
        for i in range(3):
            s.omega_i_b[i] += clip(s.omega_sum_b[i], -limit, limit)
            s.omega_sum_b[i] = 0.0
        s.sum_s = 0.0
    if s.lock and s.fly_forward and s.estimate_wind:
        learn_wind(s)
        if s.speed_m_s >= MIN_SPEED_M_S:
            examine_wind(s)
    forget_interval(s)
    for i in range(3):
        s.v_last_e_m_s[i] = s.v_e_m_s[i]


@kernel
def thrown(forward_m_s2, s):  # type: ignore[no-untyped-def]
    """Whether an aeroplane that is not fast yet is pushed forward, at less than 30 degrees of pitch."""
    slow = s.fix_age_s <= FIX_LIFE_S and s.speed_m_s < MIN_SPEED_M_S
    return s.fly_forward and slow and forward_m_s2 >= LAUNCH_M_S2 and abs(s.R_euler_eb[2, 0]) < 0.5


@kernel
def forget_interval(s):  # type: ignore[no-untyped-def]
    """Start a new interval of the mean specific force."""
    s.interval_s = s.force_s = 0.0
    for i in range(3):
        s.force_sum_e_m_s[i] = 0.0


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One inertial sample, in the original's order; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        take_arrivals(row, s)
        if s.dt_s > LONGEST_PAUSE_S:
            forget_interval(s)
            s.lock = 0  # the old velocity does not belong to the new interval
        else:
            turn(row, s, good)
            sum_force(row, s, good)  # before a heading is set: the interval was measured in the previous frame
            correct_yaw(s)
            correct_by_force(row, s, good)
    return health_of(s, s.yaw_found, s.fix_age_s <= FIX_LIFE_S or s.compass)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class ApDcm(Compiled[ApDcmParams]):
    """ArduPilot's DCM of July 2013 with its known faults corrected."""

    heading_reference: HeadingReference = "course"  # "nose" where a magnetometer is known to be fitted
    uses = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = ApDcmParams()

    def __init__(self, params: ApDcmParams | None = None) -> None:
        super().__init__(params)
        if self.params.use_magnetometer:
            self.heading_reference = "nose"

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["use_magnetometer"] = self.params.use_magnetometer in (None, True)
        for quirk in self.params.quirks:
            s[Quirk(quirk).value] = 1
        s["R_euler_eb"] = s["R_eb"]
        s["fix_age_s"] = s["field_age_s"] = s["air_age_s"] = math.inf
        s["wind_s"] = s["compass_yaw_s"] = s["course_yaw_s"] = -math.inf


class ApDcm2013(ApDcm):
    """ArduPilot's DCM of 12 July 2013 as it was, with all its faults."""

    _default = AP_DCM_2013
