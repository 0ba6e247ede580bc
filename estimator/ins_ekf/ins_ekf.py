"""An inertial navigation filter that models its sensors: the achievable accuracy, at twenty times the cost.

An error-state Kalman filter of 21 states (`estimator.ins_ekf.kernels`): attitude, velocity, gyro bias and gain,
accelerometer bias, the velocity inside the GPS receiver behind its filter, the horizontal wind, and the latency of the
receiver.  `InsEkfParams` describes its sensors; `InsEkf.sigma` gives the accuracy of its estimate.

*Delayed horizon.*  A fix is old when it arrives.  The filter therefore runs one latency behind the present; inertial
samples wait in a buffer, each fix beside the sample in which it was true.  The attitude of the present is that of the
filter, integrated forward with the waiting gyro samples, again after every correction.

*Latency.*  A fix with a plausible time stamp is placed by the stamp.  Any other is placed by the latency, whose error
dL is a state: the receiver reported y(t - dL) = y(t) - dL dy/dt, so the gradient of a fix is -dy/dt, which is nonzero
whenever the aeroplane accelerates (Skog and Handel; Li and Mourikis).  A fix that was placed before the latency
changed is moved along the same tangent.  `InsEkf.learnt` reports the latency once it is known.  A delay and a
first-order filter look alike at low frequencies: a wrong ``gps_filter_s`` is largely absorbed by the latency.

*Sideslip.*  An aeroplane flies where its nose points: zero velocity through the air along the wing is a measurement
five times a second.  It separates nose and course, and so yields wind and heading.  If the receiver reports no vertical
velocity, the same is assumed of the body's z axis, with a larger sigma.

*Heading at the start.*  A Kalman filter cannot represent an error of half a turn.  Until the aeroplane moves, the
heading is that of the magnetometer, or north, and does no harm: no measurement has a direction.  The throw is then
integrated like any motion, in a frame of unknown heading; once the GPS reports a velocity, the angle between that and
the velocity estimated inside the receiver is the heading error, whatever the wind.  The whole estimate is turned by it,
and the fix is then fused with a heading (and the velocities that turn with it) uncertain by a radian.  A start in the
air is the same with one more unknown, the speed along the nose, which makes the two velocities equally long.  A fix
much faster than a start at rest allows means that the flight began in the air after all.

*Clipped readings*: for these samples the process noise covers what may be missing.

*Without GPS* for two seconds, the velocity through the air is assumed to stay what it was, along the nose, with a large
sigma; without any velocity ever, zero.  That is gravity aiding, weak enough for turns, for as long as it lasts.

*Rejected fixes.*  An innovation beyond `gate` sigmas is rejected and counted.  If innovations stay larger than their
sigmas, the receiver's noise is scaled up to match.  If nothing is accepted for three seconds the filter is wrong, not
the receiver: it restarts in the air, from its attitude.

The earth's rotation (15 deg/h) and curvature are left out; they are below the gyro's walk.

References
----------
J. Sola, "Quaternion kinematics for the error-state Kalman filter", 2017, arXiv:1711.02508.
A. Khosravian, J. Trumpf, R. Mahony, T. Hamel, "State estimation for invariant systems on Lie groups with delayed
output measurements", Automatica 2016: observer on delayed data, predictor to the present.
I. Skog and P. Handel, "Time synchronization errors in loosely coupled GPS-aided inertial navigation systems", IEEE
Transactions on Intelligent Transportation Systems 12(4), 2011: the latency as a state, and when it is observable.
M. Li and A. I. Mourikis, "Online temporal calibration for camera-IMU systems: theory and algorithms", International
Journal of Robotics Research 33(7), 2014: the same in a filter that moves the measurement as the estimate changes.
T. A. Johansen et al., "On estimation of wind velocity, angle-of-attack and sideslip angle of small UAVs using
standard sensors", ICUAS 2015.
"""

import math

import numpy as np

from estimator.blocks.air import true_airspeed_factor
from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.magnetometer import FIELD, take_field
from estimator.blocks.screening import (
    AT_LIMIT_S,
    COAST_S,
    FORCE_GOOD,
    GPS,
    GYRO_GOOD,
    airspeed_came,
    fix_came,
    refuse,
    screen,
    watch_limit,
)
from estimator.compiler.jit import kernel
from estimator.ins_ekf.flight import (
    CUT_FORCE,
    CUT_GYRO,
    FIX_LIFE_S,
    HAS_AIR,
    HAS_FIX,
    HAS_MAG,
    SIZE,
    STAMPED,
    advance_filter,
    start_at_rest,
    start_in_air,
)
from estimator.ins_ekf.kernels import (
    BIAS,
    FORCE,
    FULL,
    GAIN,
    GYRO_LIMIT,
    LAG,
    LATENCY,
    TILT,
    VEL,
    WIND_NE,
    N,
    true_rate,
    turn_in_body,
)
from estimator.interface import G_M_S2, GOOD, POOR, STARTING, Array, Column, ImuSample
from estimator.params.ins_ekf import FLOORS, InsEkfParams
from estimator.rotation import level, renormalise

LONGEST_STAMPED_S = 2.0  # an older stamp comes from another clock
LEARNT_SHARE = 0.5  # a latency counts as learnt once its sigma is below this share of the initial one
SHRINK_S = 0.005  # most by which the horizon approaches the present from fix to fix
WIND_KNOWN_M_S = 1.5  # sigma, both axes together, below which the wind is reported
GOOD_HEADING_RAD, GOOD_TILT_RAD = math.radians(15.0), math.radians(5.0)  # sigmas of a good attitude

_FILTER = (
    Column("R_filter_eb", (3, 3), "attitude at the filter's time"),
    Column("v_e_m_s", (3,), "velocity over the ground, at the filter's time"),
    Column("gyro_gain", (3,), "relative gain error of each gyro axis"),
    Column("force_bias_b_m_s2", (3,), "accelerometer bias"),
    Column("lagged_v_e_m_s", (3,), "velocity inside the receiver, behind its filter"),
    Column("lagged_rate_m_s2", (3,), "how fast that changes"),
    Column("filter_clock_s", (), "the filter's time"),
    Column("P", (N, N), "covariance of the error state"),
    Column("h", (N,), "gradient of a measurement"),
    Column("gain", (N,), "Kalman gain"),
    Column("left", (N,), "covariance times gradient"),
    Column("R_half", (3, 3), "attitude in the middle of the last sample"),
    Column("rate_b", (3,), "rate in it"),
    Column("force_e", (3,), "specific force in it, earth axes"),
    Column("lag_keep", (), "weight of the old output of the receiver's filter"),
    Column("lag_end", (), "weight of its newest input"),
    Column("expected", (), "variance of the last innovation"),
    Column("surprise", (), "square of a fix's innovation over its variance, recent mean"),
    Column("latency_s", (), "estimated latency of a fix without a stamp"),
    Column("longest_latency_s", (), "upper limit of that"),
)
_AROUND = (
    Column("delay_s", (), "how far the filter is behind the present"),
    Column("seeded", (), "1 once the velocity is initialised", integer=True),
    Column("aligned", (), "1 once the heading was found", integer=True),
    Column("fix_age_s", (), "time since a fix was accepted"),
    Column("refusing_s", (), "time since the first of the recent rejected fixes, 0 if the last was accepted"),
    Column("mag_started", (), "1 once an uncalibrated magnetometer gave a first heading", integer=True),
    Column("unstamped", (), "number of fixes without a stamp", integer=True),
    Column("pseudo_s", (), "time since the last pseudo-measurements"),
    Column("air_age_s", (), "infinite before the first airspeed, else 0"),
    Column("cruise_m_s", (), "recent airspeed, for use without GPS"),
    Column("cruise_sigma_m_s", (), "sigma of that"),
    Column("lift_e_m_s2", (), "recent mean of the downward specific force: minus gravity in any flight"),
    Column("nose_at_start", (2,), "horizontal nose where the filter started"),
    Column("oldest", (), "index of the oldest waiting sample", integer=True),
    Column("waiting", (), "number of waiting samples", integer=True),
    Column("w_clock_s", (SIZE,), "when each waiting sample ended"),
    Column("w_dt_s", (SIZE,), "time that it covers"),
    Column("w_gyro", (SIZE, 3), "its gyro reading"),
    Column("w_force", (SIZE, 3), "its accelerometer reading"),
    Column("w_bits", (SIZE,), "what is clipped and what lies beside it", integer=True),
    Column("w_fix_v_e_m_s", (SIZE, 3), "velocity of the fix that was true in it"),
    Column("w_fix_early_s", (SIZE,), "time from that to its end"),
    Column("w_fix_latency_s", (SIZE,), "latency with which it was placed"),
    Column("w_mag_b_ut", (SIZE, 3), "field measured in it"),
    Column("w_airspeed_m_s", (SIZE,), "true airspeed measured in it"),
)
STATE_DTYPE = state_dtype(InsEkfParams, *FIELD, *_FILTER, *_AROUND)


# Waiting samples


@kernel
def push(row, s, good):  # type: ignore[no-untyped-def]
    """Append the sample of `row`; a rejected part is replaced by its estimate and marked."""
    if s.waiting == SIZE:
        advance_filter(s)
    i = (s.oldest + s.waiting) % SIZE
    s.waiting += 1
    s.w_clock_s[i], s.w_dt_s[i] = s.clock_s, s.dt_s
    bits = 0
    for j in range(3):
        if good & GYRO_GOOD:
            s.w_gyro[i, j] = row.gyro_b_rad_s[j]
            s.omega_b_rad_s[j] = true_rate(row.gyro_b_rad_s, s, j)
        else:
            if s.bad_s > COAST_S:
                s.omega_b_rad_s[j] = 0.0
            s.w_gyro[i, j] = (1.0 + s.gyro_gain[j]) * s.omega_b_rad_s[j] + s.gyro_bias_b_rad_s[j]
        s.w_force[i, j] = row.force_b_m_s2[j] if good & FORCE_GOOD else -G_M_S2 * s.R_eb[2, j]
        if not abs(s.w_gyro[i, j]) < FULL * s.gyro_full_scale_rad_s:
            bits |= CUT_GYRO
        if not abs(s.w_force[i, j]) < FULL * s.force_full_scale_m_s2:
            bits |= CUT_FORCE
    if not good & GYRO_GOOD:
        bits |= CUT_GYRO
    if not good & FORCE_GOOD:
        bits |= CUT_FORCE
    s.w_bits[i] = bits


@kernel
def attach_fix(row, s):  # type: ignore[no-untyped-def]
    """Put the fix of `row` beside the waiting sample in which it was true."""
    v = row.gps_v_e_m_s
    vertical = abs(v[2]) < 1000.0 or not s.gps_vertical_velocity
    if not (abs(v[0]) < 1000.0 and abs(v[1]) < 1000.0 and vertical):
        refuse(s, GPS)
        return
    bits, late_s = HAS_FIX, s.latency_s
    if s.gps_stamped and 0.0 <= row.t_s - row.gps_t_s <= LONGEST_STAMPED_S:  # NaN is no stamp
        bits, late_s = HAS_FIX | STAMPED, row.t_s - row.gps_t_s
    else:
        s.unstamped += 1
    s.delay_s = max(late_s, s.delay_s - SHRINK_S)
    i = (s.oldest + s.waiting - 1) % SIZE
    for back in range(1, s.waiting):
        earlier = (s.oldest + s.waiting - 1 - back) % SIZE
        if s.w_clock_s[earlier] < s.clock_s - late_s - 1e-9:
            break
        i = earlier
    s.w_bits[i] |= bits
    s.w_fix_early_s[i] = min(max(s.w_clock_s[i] - (s.clock_s - late_s), 0.0), s.w_dt_s[i])
    s.w_fix_latency_s[i] = s.clock_s - s.w_clock_s[i] + s.w_fix_early_s[i]
    for j in range(3):
        s.w_fix_v_e_m_s[i, j] = v[j]


@kernel
def attach_others(row, s):  # type: ignore[no-untyped-def]
    """Put magnetometer and air data of `row` beside the newest sample."""
    i = (s.oldest + s.waiting - 1) % SIZE
    wanted = s.use_magnetometer and (s.magnetometer_calibrated or not (s.mag_started or s.aligned))
    if wanted and take_field(row, s):
        s.w_bits[i] |= HAS_MAG
        for j in range(3):
            s.w_mag_b_ut[i, j] = s.field_b_ut[j]
    if s.use_airspeed and airspeed_came(row, s):
        s.air_age_s = 0.0
        s.w_bits[i] |= HAS_AIR
        s.w_airspeed_m_s[i] = true_airspeed_factor(row, s.elevation_m) * max(row.equivalent_airspeed_m_s, 0.0)


# The present


@kernel
def turn_on(s, i):  # type: ignore[no-untyped-def]
    """Turn the present attitude by waiting sample `i`."""
    dt, gyro = s.w_dt_s[i], s.w_gyro[i]
    turn_in_body(s.R_eb, dt * true_rate(gyro, s, 0), dt * true_rate(gyro, s, 1), dt * true_rate(gyro, s, 2))


@kernel
def reach_present(s):  # type: ignore[no-untyped-def]
    """Set the present attitude: the filter's, turned by all waiting samples."""
    for i in range(3):
        for j in range(3):
            s.R_eb[i, j] = s.R_filter_eb[i, j]
    for k in range(s.waiting):
        turn_on(s, (s.oldest + k) % SIZE)


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample: see the module; returns the `Health`."""
    row, s = rows[k], state[0]
    before = s.rejected
    good = screen(row, s)
    if good:
        push(row, s, good)
        if fix_came(row, s):
            attach_fix(row, s)
        attach_others(row, s)
        turn_on(s, (s.oldest + s.waiting - 1) % SIZE)
        corrected = False
        while s.waiting > 0 and s.w_clock_s[s.oldest] <= s.clock_s - s.delay_s + 1e-9:
            corrected |= advance_filter(s)
        if corrected:
            reach_present(s)
        if not renormalise(s.R_eb):
            level(s.R_eb)
        limit = GYRO_LIMIT * s.gyro_bias_sigma_rad_s
        bias, start = s.gyro_bias_b_rad_s, s.calibrated_offset_b_rad_s
        watch_limit((bias[0] - start[0], bias[1] - start[1], bias[2] - start[2]), limit, s)
        s.wind_known = s.aligned and s.P[WIND_NE, WIND_NE] + s.P[WIND_NE + 1, WIND_NE + 1] < WIND_KNOWN_M_S**2
    return health(s, s.rejected != before)


@kernel
def health(s, rejecting):  # type: ignore[no-untyped-def]
    """The `Health` from the filter's own sigmas."""
    if not s.aligned:
        return STARTING
    tilt = s.P[TILT, TILT] + s.P[TILT + 1, TILT + 1]
    if rejecting or s.fix_age_s > FIX_LIFE_S or s.at_limit_s >= AT_LIMIT_S or not tilt < GOOD_TILT_RAD**2:
        return POOR
    return GOOD if s.P[TILT + 2, TILT + 2] < GOOD_HEADING_RAD**2 else STARTING


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class InsEkf(Compiled[InsEkfParams]):
    """Error-state Kalman filter with 21 states that models the sensors and learns the wind.

    Started at power-up it assumes rest; started in the air it takes velocity and heading from the first fix.
    """

    heading_reference = "nose"
    uses = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = InsEkfParams()

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:
        for name, least in FLOORS.items():
            s[name] = max(s[name], least)
        s["air_age_s"] = math.inf
        s["delay_s"] = s["latency_s"] = self.params.gps_latency_s
        s["longest_latency_s"] = self.params.longest_latency_s
        s["lift_e_m_s2"] = -G_M_S2
        s["R_filter_eb"] = s["R_eb"]
        if on_ground is None:
            start_in_air(self._state)
        else:
            start_at_rest(self._state, np.array(on_ground.force_b_m_s2, np.float64))

    @property
    def learnt(self) -> dict[str, float]:
        """Properties of the instruments learnt in flight, by name: ``gps_latency_s``, or nothing.

        The latency counts as learnt once fixes without a stamp have come and its sigma has fallen below half of
        `InsEkfParams.gps_latency_sigma_s`.
        """
        s, prior_s = self._state[0], self.params.gps_latency_sigma_s
        if prior_s <= 0.0 or not s["unstamped"] or not s["P"][LATENCY, LATENCY] < (LEARNT_SHARE * prior_s) ** 2:
            return {}
        return {"gps_latency_s": float(s["latency_s"])}

    def sigma(self) -> dict[str, Array]:
        """Standard deviations of the state, at the filter's time, one delay behind the present.

        Returns
        -------
        dict    tilt_e_rad (3,), v_e_m_s (3,), gyro_bias_b_rad_s (3,), gyro_gain (3,), force_bias_b_m_s2 (3,),
                lagged_v_e_m_s (3,), wind_e_m_s (2,), gps_latency_s (1,)
        """
        sigmas = np.sqrt(np.diagonal(self._state["P"][0]))
        parts = {
            "tilt_e_rad": (TILT, 3), "v_e_m_s": (VEL, 3), "gyro_bias_b_rad_s": (BIAS, 3), "gyro_gain": (GAIN, 3),
            "force_bias_b_m_s2": (FORCE, 3), "lagged_v_e_m_s": (LAG, 3), "wind_e_m_s": (WIND_NE, 2),
            "gps_latency_s": (LATENCY, 1),
        }  # fmt: skip
        return {name: sigmas[first : first + count] for name, (first, count) in parts.items()}
