"""Start, measurements and restart of `estimator.ins_ekf`; `s` is a record of its `STATE_DTYPE`, explained there."""

import math

import numpy as np

from estimator.blocks.kernels import dot, wrap
from estimator.blocks.screening import AIR, GPS, MAG, refuse
from estimator.compiler.jit import kernel
from estimator.ins_ekf.kernels import (
    BIAS,
    FORCE,
    GAIN,
    LAG,
    LATENCY,
    TILT,
    VEL,
    WIND_NE,
    N,
    airspeed,
    fuse,
    magnetic_course,
    no_gradient,
    predict,
    through_air,
    transpose,
    turn_in_earth,
)
from estimator.rotation import level, renormalise

SIZE = 640  # most waiting samples: 12.8 s at 50 Hz, 3.2 s at 200 Hz
PSEUDO_S = 0.2  # from one pseudo-measurement to the next
FIX_LIFE_S = 2.0  # without a fix for longer, the velocity is assumed to stay
RESTART_S = 3.0  # fixes rejected for longer: restart
SLOWEST_AIRSPEED_M_S = 5.0  # slowest at which no sideslip is assumed
CRUISE_S = 5.0  # time constant of the remembered airspeed
HELD_SPEED_M_S, SILENT_SPEED_M_S = 0.5, 3.0  # sigmas of a speed: at rest, remembered
HELD_M_S2 = 0.5  # sigma of the acceleration while standing or held
START_TILT_RAD, RESTART_TILT_RAD = math.radians(15.0), 0.7
STEADY_M_S = 1.0  # sigma of the receiver's filter lag at the start
FRAME_RAD = 0.01  # sigma of the heading in the frame of unknown heading, before a match
MATCH_RAD = 1.0  # sigma of the heading at a match; the fix then corrects it
STANDING_M_S = 0.3  # sigma of a fix of exactly zero: some receivers report that at low speed (static navigation)
TANGENT_SHARE = 0.5  # of the latency's variance, for the error of the tangent: in a throw the rate changes within it
SURPRISE_SHARE, MOST_SURPRISE = 0.1, 50.0  # weight of a fix in the mean, and its largest value
CUT_GYRO, CUT_FORCE, HAS_FIX, HAS_MAG, HAS_AIR, STAMPED = 1, 2, 4, 8, 16, 32  # bits of a waiting sample


# Start


@kernel
def forget(P, first, count, sigma):  # type: ignore[no-untyped-def]
    """Make `count` states from `first` on independent of all others, with the standard deviation `sigma`."""
    for i in range(first, first + count):
        for j in range(N):
            P[i, j] = P[j, i] = 0.0
        P[i, i] = sigma * sigma


@kernel
def start(s, tilt_sigma_rad, speed_sigma_m_s):  # type: ignore[no-untyped-def]
    """Restart from the present attitude and biases; velocity zero with `speed_sigma_m_s`, wind zero."""
    forget(s.P, TILT, 3, tilt_sigma_rad)
    forget(s.P, TILT + 2, 1, FRAME_RAD)
    forget(s.P, BIAS, 3, s.gyro_bias_sigma_rad_s)
    forget(s.P, GAIN, 3, s.gyro_gain_sigma)
    forget(s.P, FORCE, 3, s.force_bias_sigma_m_s2)
    forget(s.P, LAG, 3, speed_sigma_m_s)
    forget(s.P, VEL, 3, np.hypot(speed_sigma_m_s, STEADY_M_S))
    for i in range(3):  # in steady motion the receiver's velocity is the true one
        s.P[VEL + i, LAG + i] = s.P[LAG + i, VEL + i] = speed_sigma_m_s**2
    forget(s.P, LATENCY, 1, s.gps_latency_sigma_s)
    length = max(np.hypot(s.R_filter_eb[0, 0], s.R_filter_eb[1, 0]), 1e-3)
    s.nose_at_start[0], s.nose_at_start[1] = s.R_filter_eb[0, 0] / length, s.R_filter_eb[1, 0] / length
    forget(s.P, WIND_NE, 2, s.wind_sigma_m_s)
    for i in range(3):
        s.v_e_m_s[i] = s.lagged_v_e_m_s[i] = s.lagged_rate_m_s2[i] = s.wind_e_m_s[i] = 0.0
    s.seeded = s.aligned = 0
    s.cruise_m_s, s.cruise_sigma_m_s = 0.0, 10.0
    s.refusing_s = 0.0
    s.surprise = 1.0


@kernel
def start_at_rest(state, force):  # type: ignore[no-untyped-def]
    """Start at rest: no velocity, tilt from the mean reading `force`, shape (3,), with which its bias is correlated."""
    s = state[0]
    start(s, START_TILT_RAD, HELD_SPEED_M_S)
    s.seeded = 1
    R, h = s.R_filter_eb, s.h
    for axis in range(2):  # the acceleration along north and east is zero
        no_gradient(h)
        f0, f1, f2 = dot(R[0], force), dot(R[1], force), dot(R[2], force)
        if axis == 0:
            h[TILT + 1], h[TILT + 2] = f2, -f1
        else:
            h[TILT], h[TILT + 2] = -f2, f0
        for j in range(3):
            h[FORCE + j] = -R[axis, j]
        fuse(s, 0.0, HELD_M_S2**2, math.inf)


@kernel
def start_in_air(state):  # type: ignore[no-untyped-def]
    """Start in flight: roughly level, all else unknown."""
    start(state[0], START_TILT_RAD, state[0].wind_sigma_m_s)


@kernel
def turn_pairs(P, c, z):  # type: ignore[no-untyped-def]
    """Rotate north and east of each pair of rows by the angle of cosine `c` and sine `z`."""
    for first in (TILT, VEL, LAG, WIND_NE):
        for j in range(N):
            a, b = P[first, j], P[first + 1, j]
            P[first, j], P[first + 1, j] = c * a - z * b, z * a + c * b


@kernel
def turn_heading(s, angle_rad):  # type: ignore[no-untyped-def]
    """Turn the whole estimate about the vertical, out of the frame of unknown heading."""
    turn_in_earth(s.R_filter_eb, 0.0, 0.0, angle_rad)
    c, z = np.cos(angle_rad), np.sin(angle_rad)
    for v in (s.v_e_m_s, s.lagged_v_e_m_s, s.lagged_rate_m_s2, s.wind_e_m_s):
        v[0], v[1] = c * v[0] - z * v[1], z * v[0] + c * v[1]
    n = s.nose_at_start
    n[0], n[1] = c * n[0] - z * n[1], z * n[0] + c * n[1]
    turn_pairs(s.P, c, z)
    transpose(s.P)
    turn_pairs(s.P, c, z)


@kernel
def doubt_heading(s, sigma_rad):  # type: ignore[no-untyped-def]
    """Add an uncertainty of heading with which both velocities turn."""
    h = s.h
    no_gradient(h)
    h[TILT + 2] = sigma_rad
    h[VEL], h[VEL + 1] = -s.v_e_m_s[1] * sigma_rad, s.v_e_m_s[0] * sigma_rad
    h[LAG], h[LAG + 1] = -s.lagged_v_e_m_s[1] * sigma_rad, s.lagged_v_e_m_s[0] * sigma_rad
    for i in range(N):
        for j in range(N):
            s.P[i, j] += h[i] * h[j]


@kernel
def begin_with_fix(s, z, fast):  # type: ignore[no-untyped-def]
    """Take the velocity at the start, along the nose there, from the first fix `z`, shape (3,).

    The motion since the start is trusted: with a start at rest the receiver would now hold y, so it holds y + V nose.
    V makes that as long as the fix; its direction is matched afterwards.
    """
    if s.fix_age_s > FIX_LIFE_S:  # the start was too long ago: start now
        start(s, max(START_TILT_RAD, np.sqrt(s.P[TILT, TILT])), s.wind_sigma_m_s)
    y, n = s.lagged_v_e_m_s, s.nose_at_start
    speed = 0.0
    if fast:
        along = n[0] * y[0] + n[1] * y[1]
        root = along * along + z[0] * z[0] + z[1] * z[1] - y[0] * y[0] - y[1] * y[1]
        speed = np.sqrt(max(root, 0.0)) - along
    for i in range(2):
        s.v_e_m_s[i] += speed * n[i]
        y[i] += speed * n[i]
    s.seeded = 1


# Measurements


@kernel
def find_heading(s, z, speed):  # type: ignore[no-untyped-def]
    """Turn the estimate so that its velocity inside the receiver points along the fix `z`, shape (3,).

    Returns
    -------
    bool    False if that velocity is too uncertain or too slow: the fix cannot be used
    """
    y0, y1 = s.lagged_v_e_m_s[0], s.lagged_v_e_m_s[1]
    if s.P[LAG, LAG] + s.P[LAG + 1, LAG + 1] > max(speed, s.wind_sigma_m_s * 1.5) ** 2:
        s.seeded = 0  # too uncertain for a match: start again with the next fix
        s.fix_age_s = math.inf
        return False
    if np.hypot(y0, y1) < 0.5 * s.min_speed_m_s:
        return False  # the receiver reports motion that the estimate does not have yet
    turn_heading(s, np.arctan2(z[1], z[0]) - np.arctan2(y1, y0))
    doubt_heading(s, MATCH_RAD)
    s.aligned = 1
    return True


@kernel
def was_never_at_rest(s, speed):  # type: ignore[no-untyped-def]
    """Whether a fix is too fast for a start at rest: the flight then began in the air."""
    sigma = np.sqrt(max(s.P[LAG, LAG], s.P[LAG + 1, LAG + 1]))
    return speed - np.hypot(s.lagged_v_e_m_s[0], s.lagged_v_e_m_s[1]) > 0.5 * s.min_speed_m_s + s.gate * sigma


@kernel
def take_fix(s, i):  # type: ignore[no-untyped-def]
    """Use the fix beside waiting sample `i`; the filter is at the end of that sample."""
    z, early = s.w_fix_v_e_m_s[i], s.w_fix_early_s[i]
    unsure = STANDING_M_S if z[0] == 0.0 and z[1] == 0.0 else 0.0  # sigma besides the receiver's noise
    for j in range(3):  # to the end of the sample
        z[j] += early * s.lagged_rate_m_s2[j]
    speed = np.hypot(z[0], z[1])
    fast = speed >= s.min_speed_m_s
    if fast and s.seeded and not s.aligned and was_never_at_rest(s, speed):
        s.seeded = 0
        s.fix_age_s = math.inf
    if not s.seeded:
        begin_with_fix(s, z, fast)
    if not s.aligned:
        if not fast:
            unsure = max(speed, unsure)  # a horizontal velocity has no direction yet
        elif not find_heading(s, z, speed):
            return
    if fuse_velocity(s, i, z, unsure):
        s.fix_age_s = s.refusing_s = 0.0
        return
    refuse(s, GPS)
    s.refusing_s = max(s.refusing_s, 1e-9)
    if s.refusing_s > RESTART_S:
        restart(s)


@kernel
def fuse_velocity(s, i, z, unsure):  # type: ignore[no-untyped-def]
    """Fuse the velocity `z`, shape (3,), of the fix beside waiting sample `i`; returns whether all of it was accepted.

    unsure : further sigma of the horizontal components, m/s

    If innovations are larger than expected, the noise of the receiver is scaled up in proportion: the receiver is
    worse than assumed, or vibration is.
    """
    stamped = (s.w_bits[i] & STAMPED) != 0
    components = 3 if s.gps_vertical_velocity else 2
    noise = s.gps_noise_m_s**2
    more = noise * (max(1.0, s.surprise) - 1.0)
    accepted, surprise = 0, 0.0
    for j in range(components):
        rate = s.lagged_rate_m_s2[j]
        no_gradient(s.h)
        s.h[LAG + j] = 1.0
        innovation = z[j] - s.lagged_v_e_m_s[j]
        if not stamped:  # a latency longer by dL: the fix was true earlier, y(t - dL) = y - dL dy/dt
            innovation += (s.latency_s - s.w_fix_latency_s[i]) * rate
            s.h[LATENCY] = -rate if s.aligned else 0.0
        doubt = s.gps_lag_sigma_s**2 + (0.0 if stamped else TANGENT_SHARE * s.P[LATENCY, LATENCY])
        variance = noise + more + doubt * rate * rate
        if j < 2:
            variance += unsure * unsure
        accepted += fuse(s, innovation, variance, s.gate)
        surprise += min(innovation * innovation / (s.expected - more), MOST_SURPRISE)
    if s.aligned:
        s.surprise += SURPRISE_SHARE * (surprise / components - s.surprise)
    return accepted == components


@kernel
def restart(s):  # type: ignore[no-untyped-def]
    """Restart in the air, from the present attitude, or level if it has been inverted for seconds."""
    if s.lift_e_m_s2 > 0.0:
        level(s.R_filter_eb)
    start(s, RESTART_TILT_RAD, s.wind_sigma_m_s)
    s.fix_age_s = 0.0


@kernel
def take_mag(s, i):  # type: ignore[no-untyped-def]
    """Use the magnetic heading beside waiting sample `i`; the first one sets the heading.

    Iron can turn an uncalibrated field by any angle: such a field only turns the frame of unknown heading, until a
    moving fix comes.
    """
    innovation = wrap(s.declination_rad - magnetic_course(s, s.w_mag_b_ut[i]))
    if not s.magnetometer_calibrated:
        if not s.aligned:
            turn_heading(s, innovation)
        s.mag_started = 1
        return
    if not s.aligned:
        turn_heading(s, innovation)
        doubt_heading(s, MATCH_RAD)
        innovation = wrap(s.declination_rad - magnetic_course(s, s.w_mag_b_ut[i]))
        s.aligned = 1
    if not fuse(s, innovation, s.magnetic_noise_rad**2, s.gate):
        refuse(s, MAG)


@kernel
def take_airspeed(s, i):  # type: ignore[no-untyped-def]
    """Use the airspeed beside waiting sample `i`, in flight."""
    if s.seeded and s.aligned and s.w_airspeed_m_s[i] > SLOWEST_AIRSPEED_M_S:
        innovation = s.w_airspeed_m_s[i] - airspeed(s)
        if not fuse(s, innovation, s.airspeed_noise_m_s**2, s.gate):
            refuse(s, AIR)


@kernel
def take_pseudo(s):  # type: ignore[no-untyped-def]
    """No sideslip in flight; without vertical velocity, little incidence; without GPS, the recent airspeed."""
    along = through_air(s, 0)
    silent = s.fix_age_s > FIX_LIFE_S
    if s.aligned and along > SLOWEST_AIRSPEED_M_S:
        if not silent:
            s.cruise_m_s += (along - s.cruise_m_s) * (PSEUDO_S / CRUISE_S if s.cruise_m_s > 0.0 else 1.0)
            s.cruise_sigma_m_s = SILENT_SPEED_M_S
        across = through_air(s, 1)
        fuse(s, -across, s.sideslip_sigma_m_s**2, s.gate)
    if not (s.gps_vertical_velocity or silent):
        down = through_air(s, 2)
        fuse(s, -down, s.incidence_sigma_m_s**2, s.gate)
    if silent:
        for axis in range(3):
            aim = s.cruise_m_s if axis == 0 else 0.0
            seen = through_air(s, axis)
            fuse(s, aim - seen, s.cruise_sigma_m_s**2, math.inf)


# One sample


@kernel
def advance_filter(s):  # type: ignore[no-untyped-def]
    """Advance the filter by the oldest waiting sample and what lies beside it; returns whether it was corrected."""
    i = s.oldest
    bits, dt = s.w_bits[i], s.w_dt_s[i]
    predict(s, s.w_gyro[i], s.w_force[i], dt, bits & CUT_GYRO, bits & CUT_FORCE)
    s.filter_clock_s = s.w_clock_s[i]
    s.fix_age_s += dt
    s.refusing_s += dt if s.refusing_s > 0.0 else 0.0
    s.pseudo_s += dt
    s.lift_e_m_s2 += (s.force_e[2] - s.lift_e_m_s2) * min(dt / FIX_LIFE_S, 1.0)
    corrected = (bits & (HAS_FIX | HAS_MAG | HAS_AIR)) != 0
    if bits & HAS_FIX:
        take_fix(s, i)
    if bits & HAS_MAG:
        take_mag(s, i)
    if bits & HAS_AIR:
        take_airspeed(s, i)
    if s.pseudo_s >= PSEUDO_S - 1e-6:
        s.pseudo_s = 0.0
        take_pseudo(s)
        corrected = True
    s.oldest = (i + 1) % SIZE
    s.waiting -= 1
    keep_sane(s)
    return corrected


@kernel
def keep_sane(s):  # type: ignore[no-untyped-def]
    """Keep the attitude on SO(3); restart if a number has diverged."""
    total = 0.0
    for i in range(N):
        total += s.P[i, i]
    for i in range(3):
        total += abs(s.v_e_m_s[i]) + abs(s.lagged_v_e_m_s[i])
    whole = renormalise(s.R_filter_eb)
    if not whole:
        level(s.R_filter_eb)
    if not (whole and total < 1e9):
        for i in range(3):
            s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i]
            s.gyro_gain[i] = s.force_bias_b_m_s2[i] = 0.0
        start(s, RESTART_TILT_RAD, s.wind_sigma_m_s)
        s.rejected += 1
