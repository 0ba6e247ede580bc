"""The Kalman filter inside `estimator.ins_ekf`: its error state, one prediction, one scalar measurement.

Error state, true value less estimate, N = 21 numbers:

=======  ====  =====================================================================================
TILT     3     small rotation in earth axes, ``R_true = Exp(tilt) R_eb``; its third is the heading
VEL      3     velocity over the ground, earth axes
BIAS     3     gyro bias, body axes
GAIN     3     relative gain error of each gyro axis
FORCE    3     accelerometer bias, body axes
LAG      3     velocity inside the receiver, behind its first-order filter, earth axes
WIND     2     north and east velocity of the air
LATENCY  1     age of a fix on arrival
=======  ====  =====================================================================================

An attitude error in earth axes separates the heading, which may be unknown, from the tilt, which is known.

The covariance ``P`` is advanced as ``F (F P)^T`` by row operations alone: F differs from the identity in nine rows.
Every measurement is a scalar and is fused in Joseph's form, in which round-off cannot make P indefinite.

References
----------
J. Sola, "Quaternion kinematics for the error-state Kalman filter", 2017 (arXiv:1711.02508), chapters 5 to 7; the
numbers below are of its sections, with the global angular error of chapter 7.
P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed. 2013.
R. S. Bucy and P. D. Joseph, "Filtering for Stochastic Processes with Applications to Guidance", 1968.
"""

import numpy as np

from estimator.blocks.kernels import clip, dot
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2

N = 21
TILT, VEL, BIAS, GAIN, FORCE, LAG, WIND_NE, LATENCY = 0, 3, 6, 9, 12, 15, 18, 20

FULL = 0.97  # share of the full scale above which a reading may be clipped
CUT_RAD_S, CUT_M_S2, CUT_S = 1.0, 10.0, 0.1  # sigma and correlation time of the missing part
CROSS_S = 2.0  # correlation time of an error that turns with the body: about a radian of turn
FORCE_GAIN_SHARE = 0.5  # relative gain error of an accelerometer per bias sigma in g: at high load it errs by more
LATENCY_WALK_S_SQRT_S = 0.001  # random walk of the latency, sigma after one second
BIAS_LIMIT = 6.0  # limit of gain, wind and the bias of the force, in initial sigmas
GYRO_LIMIT = 12.0  # limit of the gyro bias, likewise


@kernel
def rodrigues(squared):  # type: ignore[no-untyped-def]
    """``sin(a) / a`` and ``(1 - cos(a)) / a^2`` of an angle whose square is given."""
    if squared < 0.01:  # the series is accurate to 1e-13 here, without a sine
        a = 1.0 - squared / 6.0 * (1.0 - squared / 20.0 * (1.0 - squared / 42.0))
        b = 0.5 - squared / 24.0 * (1.0 - squared / 30.0 * (1.0 - squared / 56.0))
        return a, b
    angle = np.sqrt(squared)
    return np.sin(angle) / angle, (1.0 - np.cos(angle)) / squared


@kernel
def turn_in_body(R, x, y, z):  # type: ignore[no-untyped-def]
    """``R <- R Exp((x, y, z))``, in place: the body turns by a rotation vector in body axes [rad]."""
    a, b = rodrigues(x * x + y * y + z * z)
    for i in range(3):  # each row r becomes r + a t + b t x phi with t = r x phi
        r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
        t0, t1, t2 = r1 * z - r2 * y, r2 * x - r0 * z, r0 * y - r1 * x
        R[i, 0] = r0 + a * t0 + b * (t1 * z - t2 * y)
        R[i, 1] = r1 + a * t1 + b * (t2 * x - t0 * z)
        R[i, 2] = r2 + a * t2 + b * (t0 * y - t1 * x)


@kernel
def turn_in_earth(R, x, y, z):  # type: ignore[no-untyped-def]
    """``R <- Exp((x, y, z)) R``, in place: a rotation vector in earth axes [rad]."""
    a, b = rodrigues(x * x + y * y + z * z)
    for j in range(3):  # each column c becomes c + a t + b phi x t with t = phi x c
        c0, c1, c2 = R[0, j], R[1, j], R[2, j]
        t0, t1, t2 = y * c2 - z * c1, z * c0 - x * c2, x * c1 - y * c0
        R[0, j] = c0 + a * t0 + b * (y * t2 - z * t1)
        R[1, j] = c1 + a * t1 + b * (z * t0 - x * t2)
        R[2, j] = c2 + a * t2 + b * (x * t1 - y * t0)


@kernel
def true_rate(gyro, s, i):  # type: ignore[no-untyped-def]
    """Rate about body axis `i` from a reading: gyro = (1 + gain) rate + bias."""
    return (gyro[i] - s.gyro_bias_b_rad_s[i]) / (1.0 + s.gyro_gain[i])


@kernel
def advance_state(s, gyro, force, dt):  # type: ignore[no-untyped-def]
    """Move attitude, velocity and the receiver's filter by one inertial sample; store what F needs.

    gyro, force : shape (3,), the readings, means over `dt` s
    """
    for i in range(3):
        s.rate_b[i] = true_rate(gyro, s, i)
        for j in range(3):
            s.R_half[i, j] = s.R_filter_eb[i, j]
    # Half a rotation, the force in earth axes there, and the other half: exact for constant rates (5.1.1).
    x, y, z = 0.5 * dt * s.rate_b[0], 0.5 * dt * s.rate_b[1], 0.5 * dt * s.rate_b[2]
    turn_in_body(s.R_half, x, y, z)
    for i in range(3):
        for j in range(3):
            s.R_filter_eb[i, j] = s.R_half[i, j]
    turn_in_body(s.R_filter_eb, x, y, z)
    # The receiver's filter, dy/dt = (v - y) / T, solved exactly for a velocity that is linear within the sample.
    keep, end = filter_weights(s.gps_filter_s, dt)
    s.lag_keep, s.lag_end = keep, end
    for i in range(3):
        f = 0.0
        for j in range(3):
            f += s.R_half[i, j] * (force[j] - s.force_bias_b_m_s2[j])
        s.force_e[i] = f
        before = s.v_e_m_s[i]
        s.v_e_m_s[i] = before + dt * (f + G_M_S2 if i == 2 else f)
        lagged = keep * s.lagged_v_e_m_s[i] + (1.0 - keep - end) * before + end * s.v_e_m_s[i]
        s.lagged_rate_m_s2[i] = (lagged - s.lagged_v_e_m_s[i]) / dt
        s.lagged_v_e_m_s[i] = lagged


@kernel
def filter_weights(time_constant_s, dt):  # type: ignore[no-untyped-def]
    """Weights of the old output and the newest input of a first-order filter; a time constant of 0 is no filter."""
    if time_constant_s <= 0.0:
        return 0.0, 1.0
    step = dt / time_constant_s
    fade = np.expm1(-step)
    return 1.0 + fade, 1.0 + fade / step


@kernel
def apply_transition(P, s, dt):  # type: ignore[no-untyped-def]
    """``P <- F P``, in place, with the values that `advance_state` kept (Sola 7.2, with the states added here)."""
    R, f, w = s.R_half, s.force_e, s.rate_b
    keep, end = s.lag_keep, s.lag_end
    old = 1.0 - keep - end
    f0, f1, f2 = dt * f[0], dt * f[1], dt * f[2]
    for i in range(3):
        for j in range(N):
            P[LAG + i, j] = keep * P[LAG + i, j] + old * P[VEL + i, j]
    for j in range(N):  # d(vel)/dt = tilt x f - R force_bias
        t0, t1, t2 = P[TILT, j], P[TILT + 1, j], P[TILT + 2, j]
        P[VEL, j] += t1 * f2 - t2 * f1
        P[VEL + 1, j] += t2 * f0 - t0 * f2
        P[VEL + 2, j] += t0 * f1 - t1 * f0
    for i in range(3):
        r0, r1, r2 = dt * R[i, 0], dt * R[i, 1], dt * R[i, 2]
        for j in range(N):
            P[VEL + i, j] -= r0 * P[FORCE, j] + r1 * P[FORCE + 1, j] + r2 * P[FORCE + 2, j]
    for i in range(3):  # d(tilt)/dt = -R (bias + rate gain) / (1 + gain)
        gain, r = s.gyro_gain, R[i]
        b0, b1, b2 = dt * r[0] / (1.0 + gain[0]), dt * r[1] / (1.0 + gain[1]), dt * r[2] / (1.0 + gain[2])
        g0, g1, g2 = b0 * w[0], b1 * w[1], b2 * w[2]
        for j in range(N):
            P[TILT + i, j] -= b0 * P[BIAS, j] + b1 * P[BIAS + 1, j] + b2 * P[BIAS + 2, j]
            P[TILT + i, j] -= g0 * P[GAIN, j] + g1 * P[GAIN + 1, j] + g2 * P[GAIN + 2, j]
    for i in range(3):
        for j in range(N):
            P[LAG + i, j] += end * P[VEL + i, j]


@kernel
def transpose(P):  # type: ignore[no-untyped-def]
    """Transpose in place."""
    for i in range(N):
        for j in range(i):
            P[i, j], P[j, i] = P[j, i], P[i, j]


@kernel
def symmetrise(P):  # type: ignore[no-untyped-def]
    """Replace P by the mean of itself and its transpose, in place."""
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@kernel
def grow(P, first, count, variance, limit):  # type: ignore[no-untyped-def]
    """Add `variance` to states whose variance is below `limit`."""
    for i in range(first, first + count):
        if P[i, i] < limit:
            P[i, i] += variance


@kernel
def add_process_noise(s, dt, gyro_cut, force_cut):  # type: ignore[no-untyped-def]
    """``P <- P + Q`` for one sample; `gyro_cut`, `force_cut` where a reading is clipped or missing.

    A one-sided density d gives a sample of dt s the variance d^2 / (2 dt), and its integral d^2 dt / 2.
    """
    P, w = s.P, s.rate_b
    squared = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    # An error with variance v and correlation time t acts, over longer times, as white noise of 2 v t.
    tilt = 0.5 * s.gyro_noise_rad_s_sqrt_hz**2 + 2.0 * CROSS_S * s.gyro_cross_axis**2 * squared
    velocity = 0.5 * s.force_noise_m_s2_sqrt_hz**2
    f = s.force_e
    pull = np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) - G_M_S2
    velocity += 2.0 * CROSS_S * (FORCE_GAIN_SHARE * s.force_bias_sigma_m_s2 / G_M_S2 * pull) ** 2
    if gyro_cut:
        tilt += 2.0 * CUT_S * CUT_RAD_S**2
    if force_cut:
        velocity += 2.0 * CUT_S * CUT_M_S2**2
    grow(P, TILT, 3, tilt * dt, 10.0)
    grow(P, VEL, 3, velocity * dt, 1e6)
    grow(P, BIAS, 3, s.gyro_walk_rad_s_sqrt_s**2 * dt, s.gyro_bias_sigma_rad_s**2)
    grow(P, WIND_NE, 2, s.wind_walk_m_s_sqrt_s**2 * dt, s.wind_sigma_m_s**2)
    grow(P, LATENCY, 1, LATENCY_WALK_S_SQRT_S**2 * dt, s.gps_latency_sigma_s**2)


@kernel
def predict(s, gyro, force, dt, gyro_cut, force_cut):  # type: ignore[no-untyped-def]
    """Advance state and covariance by one inertial sample."""
    advance_state(s, gyro, force, dt)
    apply_transition(s.P, s, dt)  # F P
    transpose(s.P)  # (F P)^T = P F^T
    apply_transition(s.P, s, dt)  # F P F^T
    symmetrise(s.P)
    add_process_noise(s, dt, gyro_cut, force_cut)


@kernel
def fuse(s, innovation, variance, gate):  # type: ignore[no-untyped-def]
    """Fuse a scalar measurement whose gradient is ``s.h``.

    Returns
    -------
    bool    False if the innovation is beyond `gate` of its sigmas, and nothing was changed; the variance of the
            innovation is in ``s.expected``
    """
    P, h, gain, left = s.P, s.h, s.gain, s.left
    expected = variance
    for i in range(N):
        left[i] = 0.0
    for j in range(N):
        if h[j] != 0.0:
            for i in range(N):
                left[i] += P[j, i] * h[j]
    for i in range(N):
        expected += h[i] * left[i]
    s.expected = expected
    if not innovation * innovation <= gate * gate * expected:  # NaN is rejected
        return False
    for i in range(N):
        gain[i] = left[i] / expected
    # Joseph: P <- (I - K h) P (I - K h)^T + K variance K^T, as M = (I - K h) P and then M - (M h) K^T + ...
    for i in range(N):
        for j in range(N):
            P[i, j] -= gain[i] * left[j]
    for i in range(N):
        left[i] = 0.0
        for j in range(N):
            left[i] += P[i, j] * h[j]
    for i in range(N):
        for j in range(N):
            P[i, j] += (variance * gain[i] - left[i]) * gain[j]
    symmetrise(P)
    correct_state(s, innovation)
    return True


@kernel
def correct_state(s, innovation):  # type: ignore[no-untyped-def]
    """Add gain times innovation to the estimate (Sola 6.2)."""
    k = s.gain
    turn_in_earth(s.R_filter_eb, k[0] * innovation, k[1] * innovation, k[2] * innovation)
    limit = GYRO_LIMIT * s.gyro_bias_sigma_rad_s
    for i in range(3):
        s.v_e_m_s[i] += k[VEL + i] * innovation
        s.lagged_v_e_m_s[i] += k[LAG + i] * innovation
        calibrated = s.calibrated_offset_b_rad_s[i]
        change = s.gyro_bias_b_rad_s[i] - calibrated + k[BIAS + i] * innovation
        s.gyro_bias_b_rad_s[i] = calibrated + clip(change, -limit, limit)
        s.gyro_gain[i] = within(s.gyro_gain[i] + k[GAIN + i] * innovation, s.gyro_gain_sigma)
        s.force_bias_b_m_s2[i] = within(s.force_bias_b_m_s2[i] + k[FORCE + i] * innovation, s.force_bias_sigma_m_s2)
    for i in range(2):
        s.wind_e_m_s[i] = within(s.wind_e_m_s[i] + k[WIND_NE + i] * innovation, s.wind_sigma_m_s)
    s.latency_s = clip(s.latency_s + k[LATENCY] * innovation, 0.0, s.longest_latency_s)


@kernel
def within(x, sigma):  # type: ignore[no-untyped-def]
    """`x` limited to `BIAS_LIMIT` initial sigmas."""
    return clip(x, -BIAS_LIMIT * sigma, BIAS_LIMIT * sigma)


@kernel
def no_gradient(h):  # type: ignore[no-untyped-def]
    """Zero the gradient."""
    for i in range(N):
        h[i] = 0.0


@kernel
def through_air(s, axis):  # type: ignore[no-untyped-def]
    """Velocity through the air along body `axis`, m/s, and its gradient in ``s.h``.

    u = v - wind; along the axis r (a column of R) it is r . u, and tilt adds (r x u) . tilt.
    """
    R, h = s.R_filter_eb, s.h
    no_gradient(h)
    r0, r1, r2 = R[0, axis], R[1, axis], R[2, axis]
    u0, u1, u2 = s.v_e_m_s[0] - s.wind_e_m_s[0], s.v_e_m_s[1] - s.wind_e_m_s[1], s.v_e_m_s[2]
    h[TILT], h[TILT + 1], h[TILT + 2] = r1 * u2 - r2 * u1, r2 * u0 - r0 * u2, r0 * u1 - r1 * u0
    h[VEL], h[VEL + 1], h[VEL + 2] = r0, r1, r2
    h[WIND_NE], h[WIND_NE + 1] = -r0, -r1
    return r0 * u0 + r1 * u1 + r2 * u2


@kernel
def airspeed(s):  # type: ignore[no-untyped-def]
    """Length of the velocity through the air, m/s, and its gradient in ``s.h``."""
    h = s.h
    no_gradient(h)
    u0, u1, u2 = s.v_e_m_s[0] - s.wind_e_m_s[0], s.v_e_m_s[1] - s.wind_e_m_s[1], s.v_e_m_s[2]
    speed = np.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    if speed > 0.1:
        h[VEL], h[VEL + 1], h[VEL + 2] = u0 / speed, u1 / speed, u2 / speed
        h[WIND_NE], h[WIND_NE + 1] = -u0 / speed, -u1 / speed
    return speed


@kernel
def magnetic_course(s, m):  # type: ignore[no-untyped-def]
    """Direction of the measured field `m`, shape (3,), over the ground, rad, and its gradient in ``s.h``."""
    R, h = s.R_filter_eb, s.h
    no_gradient(h)
    x, y, z = dot(R[0], m), dot(R[1], m), dot(R[2], m)
    squared = max(x * x + y * y, 1e-12)
    h[TILT], h[TILT + 1], h[TILT + 2] = -z * x / squared, -z * y / squared, 1.0
    return np.arctan2(y, x)
