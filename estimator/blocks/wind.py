"""The wind, learnt from the change of ground velocity while the nose turns.

Horizontally, with north + i east as one complex number, an aeroplane without sideslip has

    v = w + c f

``v`` the ground velocity, ``w`` the wind, ``f`` the nose by the gyros, whose heading may be off by any constant angle,
and ``c`` the airspeed, turned by that angle.  In straight flight the two terms cannot be separated; in a turn ``f``
moves and ``w`` does not.  From two fixes alone, c = dv / df and w = v - c f: that is the wind estimate of MatrixPilot
and ArduPilot, which takes |dv| / |df| for the airspeed and turns the nose by the angle from df to dv.  Here every fix
counts by its information: a Kalman filter with the two complex states w and c, whose covariance is that of the wind.

The caller passes an ``f`` that has the receiver's filter and latency, as ``v`` has, and no yaw corrections: a nose that
is corrected towards the course would show no wind.  No airspeed is needed.

References
----------
W. Premerlani, "IMU wind estimation (theory)", 2009 (the two-fix form).
"""

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
