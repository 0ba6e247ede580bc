"""The wind, learnt from how the ground velocity changes while the nose turns.

Horizontally, with north + i east as one complex number, an aeroplane that flies where its nose points has

    v = w + c f

``v`` the ground velocity, ``w`` the wind, ``f`` the nose as the gyros see it, whose heading may be off by any
constant angle, and ``c`` the airspeed, turned by that angle.  Straight ahead the two terms cannot be told apart;
in a turn ``f`` moves and ``w`` does not.  From two fixes alone, c = dv / df and w = v - c f: that is the wind
estimate of MatrixPilot and ArduPilot, which takes |dv| / |df| for the airspeed and turns the nose by the angle from
df to dv.  Here every fix counts, by as much as it tells: a Kalman filter with the two complex states w and c, whose
covariance says how well the wind is known.

Two things the caller owes.  ``f`` has passed the receiver's own filter and latency, as ``v`` has.  And ``f`` is free
of yaw corrections: a nose that was pulled towards the course would find no wind.  No airspeed is needed.

References
----------
W. Premerlani, "IMU wind estimation (theory)", 2009 (the two-fix form).
"""

from estimator.compiler.jit import kernel
from estimator.interface import Column

WIND_BEFORE_M_S = 4.0  # wind per axis that is expected before anything is known of it
AIRSPEED_BEFORE_M_S = 30.0  # size of c, likewise
WIND_WALK = 0.06  # how quickly the wind changes, m/s per root second
AIRSPEED_WALK = 0.6  # how quickly airspeed, and its direction against the gyros' nose, do
RESIDUAL_M_S = 1.0  # sideslip, angle of attack, gusts: what one second of fixes is off by
SURPRISE = 16.0  # squared innovation over its variance beyond which a fix is not believed
KNOWN_M_S = 0.9  # the wind is known once its standard deviation is below
FORGET_S = 4.0  # how long surprises must go on until the airspeed is learnt anew
SHORTEST_NOSE = 0.5  # a filtered nose shorter than this was in a loop or a spin

WIND_FILTER = (
    Column("air_m_s", (2,), "c: airspeed, turned from the heading of the gyros' nose to the true one"),
    Column("wind_variance", (), "of the wind, per axis, (m/s)^2; 0 before the first fix"),
    Column("air_variance", (), "of c, per axis, (m/s)^2"),
    Column("wind_air_covariance", (2,), "E[w conj(c)], the complex covariance of the two, per axis"),
)


@kernel
def learn_wind(s, nose_north, nose_east, v_north_m_s, v_east_m_s, dt_s):  # type: ignore[no-untyped-def]
    """Take one GPS velocity into the belief of wind and airspeed; call it at fixes in flight.

    Parameters
    ----------
    s : record with the columns of BELIEF and WIND_FILTER    read and written
    nose_north, nose_east     horizontal nose, filtered and late like the fix, free of yaw corrections; a short one
                              (a loop, a spin) teaches nothing
    v_north_m_s, v_east_m_s   reported ground velocity
    dt_s                      time since the last fix

    Returns
    -------
    bool    whether the fix was believed
    """
    f = complex(nose_north, nose_east)
    w, c = complex(s.wind_e_m_s[0], s.wind_e_m_s[1]), complex(s.air_m_s[0], s.air_m_s[1])
    ww, cc, wc = s.wind_variance, s.air_variance, complex(s.wind_air_covariance[0], s.wind_air_covariance[1])
    if ww == 0.0:
        ww, cc = WIND_BEFORE_M_S**2, AIRSPEED_BEFORE_M_S**2
    ww = min(ww + WIND_WALK**2 * dt_s, WIND_BEFORE_M_S**2)
    cc = min(cc + AIRSPEED_WALK**2 * dt_s, AIRSPEED_BEFORE_M_S**2)

    e = complex(v_north_m_s, v_east_m_s) - w - c * f
    # What gusts and sideslip do to one fix they do to its neighbours: fixes of a second count as one.
    residual = RESIDUAL_M_S**2 / min(max(dt_s, 1e-3), 1.0)
    w_e, c_e = ww + wc * f.conjugate(), wc.conjugate() + cc * f.conjugate()  # covariances with e
    variance = (w_e + c_e * f).real + residual
    clear = abs(f) >= SHORTEST_NOSE
    believed = clear and abs(e) ** 2 <= SURPRISE * variance
    if clear and not believed:  # if this goes on, airspeed or the gyros' heading are no longer what they were
        cc = min(cc + abs(e) ** 2 * min(dt_s / FORGET_S, 1.0), AIRSPEED_BEFORE_M_S**2)
    if believed:
        w, c = w + w_e * e / variance, c + c_e * e / variance
        ww -= abs(w_e) ** 2 / variance
        cc -= abs(c_e) ** 2 / variance
        wc -= w_e * c_e.conjugate() / variance
    s.wind_e_m_s[0], s.wind_e_m_s[1] = w.real, w.imag
    s.air_m_s[0], s.air_m_s[1] = c.real, c.imag
    s.wind_variance, s.air_variance = max(ww, 1e-6), max(cc, 1e-6)
    s.wind_air_covariance[0], s.wind_air_covariance[1] = wc.real, wc.imag
    s.wind_known = 1 if s.wind_variance < KNOWN_M_S**2 else 0
    return believed
