"""The wind, learnt from the change of ground velocity while the nose turns, and a check of one learnt otherwise.

Horizontally, with north + i east as one complex number, an aeroplane without sideslip has

    v = w + c f

``v`` the ground velocity, ``w`` the wind, ``f`` the nose by the gyros, whose heading may be off by any constant angle,
and ``c`` the airspeed, turned by that angle.  In straight flight the two terms cannot be separated; in a turn ``f``
moves and ``w`` does not.  From two fixes alone, c = dv / df and w = v - c f: that is the wind estimate of MatrixPilot
and ArduPilot, which takes |dv| / |df| for the airspeed and turns the nose by the angle from df to dv.  Here every fix
counts by its information: a Kalman filter with the two complex states w and c, whose covariance is that of the wind.

The caller of `learn_wind` passes an ``f`` that has the receiver's filter and latency, as ``v`` has, and no yaw
corrections: a nose that is corrected towards the course would show no wind.  No airspeed is needed.

A wind that an estimator learns in its own way, from two fixes at a time, carries no measure of its error.  It can be
checked without a nose: with the right wind the airspeed ``|v - w|`` is the same in all directions.  That is linear,

    |v|^2 = 2 v . w + (V^2 - |w|^2),

so the regression of ``|v|^2`` on ``v`` gives a second wind and its standard deviation.  Straight flight, in which ``v``
does not change, leaves the latter large.  `check_wind` lets a wind be reported while the two agree.

References
----------
W. Premerlani, "IMU wind estimation (theory)", 2009 (the two-fix form).
"""

import math

from estimator.compiler.jit import kernel
from estimator.interface import Column

WIND_BEFORE_M_S = 4.0  # sigma of the wind per axis, initially
AIRSPEED_BEFORE_M_S = 30.0  # size of c, initially
WIND_WALK = 0.06  # random walk of the wind, m/s per root second
AIRSPEED_WALK = 0.6  # the same of airspeed and of its direction against the gyros' nose
RESIDUAL_M_S = 1.0  # sigma of one second of fixes, from sideslip, angle of attack and gusts
SURPRISE = 16.0  # squared innovation over its variance beyond which a fix is rejected
KNOWN_M_S = 0.9  # the wind is known once its standard deviation is below
FORGET_S = 4.0  # duration of rejections after which the airspeed is learnt again
SHORTEST_NOSE = 0.5  # a filtered nose shorter than this was in a loop or a spin

WIND_FILTER = (
    Column("air_m_s", (2,), "c: airspeed, turned from the heading of the gyros' nose to the true one"),
    Column("wind_variance", (), "of the wind, per axis, (m/s)^2; 0 before the first fix"),
    Column("air_variance", (), "of c, per axis, (m/s)^2"),
    Column("wind_air_covariance", (2,), "E[w conj(c)], the complex covariance of the two, per axis"),
)

CHECK_S = 60.0  # time constant with which the regression forgets
CHECK_SIGMA_M_S = 0.5  # largest standard deviation of the regression's wind with which a wind is reported
STEADY_M_S = 0.7  # residual of the airspeed beyond which it has changed too much to tell a wind
AGREE_M_S, AGREE_FOR_S = 1.0, 20.0  # largest difference, and for how long, with which it is
LEAST_SPREAD = 1e-3  # smallest variance of the velocity for which the regression is solved, (m/s)^2

WIND_CHECK = (
    Column("checked_s", (), "weight of the fixes of the regression, in seconds"),
    Column("checked_v", (2,), "their sum of v"),
    Column("checked_vv", (3,), "of v_n v_n, v_n v_e, v_e v_e"),
    Column("agreed_s", (), "how long the two winds have agreed"),
    Column("checked_y", (4,), "of |v|^2, |v|^2 v_n, |v|^2 v_e, |v|^4"),
)


@kernel
def sum_velocity(s, north, east, dt_s):  # type: ignore[no-untyped-def]
    """Add one GPS velocity to the sums of the regression, which forget."""
    keep = math.exp(-dt_s / CHECK_S)
    y = north * north + east * east
    s.checked_s = keep * s.checked_s + dt_s
    s.checked_v[0] = keep * s.checked_v[0] + dt_s * north
    s.checked_v[1] = keep * s.checked_v[1] + dt_s * east
    s.checked_vv[0] = keep * s.checked_vv[0] + dt_s * north * north
    s.checked_vv[1] = keep * s.checked_vv[1] + dt_s * north * east
    s.checked_vv[2] = keep * s.checked_vv[2] + dt_s * east * east
    s.checked_y[0] = keep * s.checked_y[0] + dt_s * y
    s.checked_y[1] = keep * s.checked_y[1] + dt_s * y * north
    s.checked_y[2] = keep * s.checked_y[2] + dt_s * y * east
    s.checked_y[3] = keep * s.checked_y[3] + dt_s * y * y


@kernel
def wind_by_speed(s):  # type: ignore[no-untyped-def]
    """Wind (north, east) of the regression of `sum_velocity`, and its standard deviation, m/s; infinite if none."""
    n = s.checked_s
    if not n > 0.0:
        return 0.0, 0.0, math.inf
    v0, v1, y = s.checked_v[0] / n, s.checked_v[1] / n, s.checked_y[0] / n
    c00, c01, c11 = s.checked_vv[0] / n - v0 * v0, s.checked_vv[1] / n - v0 * v1, s.checked_vv[2] / n - v1 * v1
    b0, b1 = s.checked_y[1] / n - y * v0, s.checked_y[2] / n - y * v1
    least = 0.5 * (c00 + c11) - math.sqrt((0.5 * (c00 - c11)) ** 2 + c01 * c01)  # smaller eigenvalue
    if not least > LEAST_SPREAD:
        return 0.0, 0.0, math.inf
    determinant = c00 * c11 - c01 * c01
    w0, w1 = 0.5 * (c11 * b0 - c01 * b1) / determinant, 0.5 * (c00 * b1 - c01 * b0) / determinant
    square = max(y - 2.0 * (v0 * w0 + v1 * w1) + w0 * w0 + w1 * w1, 1.0)  # of the airspeed
    left = max(s.checked_y[3] / n - y * y - 2.0 * (w0 * b0 + w1 * b1), 0.0)
    # A regression that found hardly any airspeed took the velocity of straight flight for the wind: there the speed
    # over the ground says how little the directions differ.
    residual_m_s = 0.5 * math.sqrt(left / square)
    if residual_m_s > STEADY_M_S:
        return w0, w1, math.inf
    return w0, w1, RESIDUAL_M_S * math.sqrt(max(square, y) / (n * least))


@kernel
def check_wind(s, v_north_m_s, v_east_m_s, dt_s):  # type: ignore[no-untyped-def]
    """Set ``s.wind_known``: whether the airspeeds of the last minute confirm the wind; call it at fixes in flight.

    Parameters
    ----------
    s : record with the columns of BELIEF and WIND_CHECK     read and written
    v_north_m_s, v_east_m_s   reported ground velocity
    dt_s                      time since the last fix
    """
    sum_velocity(s, v_north_m_s, v_east_m_s, min(max(dt_s, 0.0), 1.0))
    north, east, sigma_m_s = wind_by_speed(s)
    apart_m_s = math.hypot(north - s.wind_e_m_s[0], east - s.wind_e_m_s[1])
    agree = sigma_m_s < CHECK_SIGMA_M_S and apart_m_s < AGREE_M_S
    s.agreed_s = s.agreed_s + dt_s if agree else 0.0
    s.wind_known = 1 if s.agreed_s >= AGREE_FOR_S else 0


@kernel
def learn_wind(s, nose_north, nose_east, v_north_m_s, v_east_m_s, dt_s):  # type: ignore[no-untyped-def]
    """Update wind and airspeed with one GPS velocity; call it at fixes in flight.

    Parameters
    ----------
    s : record with the columns of BELIEF and WIND_FILTER    read and written
    nose_north, nose_east     horizontal nose, filtered and late like the fix, free of yaw corrections; a short one
                              (a loop, a spin) teaches nothing
    v_north_m_s, v_east_m_s   reported ground velocity
    dt_s                      time since the last fix

    Returns
    -------
    bool    whether the fix was accepted
    """
    f = complex(nose_north, nose_east)
    w, c = complex(s.wind_e_m_s[0], s.wind_e_m_s[1]), complex(s.air_m_s[0], s.air_m_s[1])
    ww, cc, wc = s.wind_variance, s.air_variance, complex(s.wind_air_covariance[0], s.wind_air_covariance[1])
    if ww == 0.0:
        ww, cc = WIND_BEFORE_M_S**2, AIRSPEED_BEFORE_M_S**2
    ww = min(ww + WIND_WALK**2 * dt_s, WIND_BEFORE_M_S**2)
    cc = min(cc + AIRSPEED_WALK**2 * dt_s, AIRSPEED_BEFORE_M_S**2)

    e = complex(v_north_m_s, v_east_m_s) - w - c * f
    # Gusts and sideslip affect neighbouring fixes alike: the fixes of one second count as one.
    residual = RESIDUAL_M_S**2 / min(max(dt_s, 1e-3), 1.0)
    w_e, c_e = ww + wc * f.conjugate(), wc.conjugate() + cc * f.conjugate()  # covariances with e
    variance = (w_e + c_e * f).real + residual
    clear = abs(f) >= SHORTEST_NOSE
    accepted = clear and abs(e) ** 2 <= SURPRISE * variance
    if clear and not accepted:  # if this persists, airspeed or the gyros' heading have changed
        cc = min(cc + abs(e) ** 2 * min(dt_s / FORGET_S, 1.0), AIRSPEED_BEFORE_M_S**2)
    if accepted:
        w, c = w + w_e * e / variance, c + c_e * e / variance
        ww -= abs(w_e) ** 2 / variance
        cc -= abs(c_e) ** 2 / variance
        wc -= w_e * c_e.conjugate() / variance
    s.wind_e_m_s[0], s.wind_e_m_s[1] = w.real, w.imag
    s.air_m_s[0], s.air_m_s[1] = c.real, c.imag
    s.wind_variance, s.air_variance = max(ww, 1e-6), max(cc, 1e-6)
    s.wind_air_covariance[0], s.wind_air_covariance[1] = wc.real, wc.imag
    s.wind_known = 1 if s.wind_variance < KNOWN_M_S**2 else 0
    return accepted
