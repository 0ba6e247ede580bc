"""The wind estimate of `estimator.ap_dcm`, which ArduPilot took from MatrixPilot.

References
----------
ArduPilot, libraries/AP_AHRS/AP_AHRS_DCM, revision 279f6d00 of 10 July 2013.
"""

import numpy as np

from estimator.blocks.wind import check_wind
from estimator.compiler.jit import kernel

AIR_LIFE_S = 1.0  # an older airspeed is not used
WIND_RESTART_S, WIND_STRAIGHT_S = 10.0, 2.0
STRAIGHT_SHARE, STRAIGHT_KNOWN = 0.08, 0.9  # of the wind taken from each airspeed; and after which it is reported
WIND_TURN, WIND_JUMP_M_S = 0.2, 20.0  # smallest change of the nose, and largest accepted step


@kernel
def learn_wind(s):  # type: ignore[no-untyped-def]
    """Learn the wind from the change of velocity with a change of the nose, or directly from airspeed.

    The velocity through the air is V times the nose f: two ground velocities with different noses give V and the wind.
    """
    v, f, v0, f0, wind = s.v_e_m_s, s.R_eb[:, 0], s.v_wind_e_m_s, s.nose_last, s.wind_e_m_s
    since_s = s.clock_s - s.wind_s
    turned = np.sqrt((f[0] - f0[0]) ** 2 + (f[1] - f0[1]) ** 2 + (f[2] - f0[2]) ** 2)
    if since_s > WIND_RESTART_S:
        remember_nose(s)
    elif turned > WIND_TURN:
        airspeed = np.sqrt((v[0] - v0[0]) ** 2 + (v[1] - v0[1]) ** 2 + (v[2] - v0[2]) ** 2) / turned
        angle = np.arctan2(v[1] - v0[1], v[0] - v0[0]) - np.arctan2(f[1] - f0[1], f[0] - f0[0])
        if s.overwritten_wind:
            remember_nose(s)
        c, z = airspeed * np.cos(angle), airspeed * np.sin(angle)
        fx, fy, fz = f[0] + f0[0], f[1] + f0[1], f[2] + f0[2]
        x = 0.5 * (v[0] + v0[0] - (c * fx - z * fy))
        y = 0.5 * (v[1] + v0[1] - (z * fx + c * fy))
        down = 0.5 * (v[2] + v0[2] - airspeed * fz)
        known = np.sqrt(wind[0] * wind[0] + wind[1] * wind[1] + wind[2] * wind[2])
        if np.sqrt(x * x + y * y + down * down) < known + WIND_JUMP_M_S:
            blend_wind(s, 0.05, x, y, down)
        remember_nose(s)
    elif since_s > WIND_STRAIGHT_S and s.air_age_s <= AIR_LIFE_S:
        a = s.airspeed_m_s
        blend_wind(s, STRAIGHT_SHARE, v[0] - a * f[0], v[1] - a * f[1], v[2] - a * f[2])
        if s.compass:
            s.straight_share += STRAIGHT_SHARE * (1.0 - s.straight_share)


@kernel
def examine_wind(s):  # type: ignore[no-untyped-def]
    """Set ``s.wind_known``, whether the wind is reported: no part of the original, which uses it in any case.

    It is if the airspeeds in different directions confirm it (`estimator.blocks.wind`), or if it was learnt from a
    measured airspeed along a nose that a compass gives.
    """
    check_wind(s, s.v_e_m_s[0], s.v_e_m_s[1], s.interval_s)
    if s.straight_share > STRAIGHT_KNOWN and s.air_age_s <= AIR_LIFE_S:
        s.wind_known = 1


@kernel
def remember_nose(s):  # type: ignore[no-untyped-def]
    """Keep the present nose and velocity for the next wind estimate."""
    s.wind_s = s.clock_s
    for i in range(3):
        s.nose_last[i] = s.R_eb[i, 0]
        s.v_wind_e_m_s[i] = s.v_e_m_s[i]


@kernel
def blend_wind(s, share, x, y, z):  # type: ignore[no-untyped-def]
    """Move the wind estimate by `share` towards the one just measured."""
    wind = s.wind_e_m_s
    wind[0] += share * (x - wind[0])
    wind[1] += share * (y - wind[1])
    wind[2] += share * (z - wind[2])
