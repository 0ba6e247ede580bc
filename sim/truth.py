"""The earth's rotation and gravity, and the means over a tick that a perfect inertial unit measures."""

import numpy as np

from estimator.compiler.jit import kernel
from estimator.interface import Array

EARTH_RATE_RAD_S = 7.292115e-5  # WGS 84


def earth_rate_e_rad_s(latitude_rad: float) -> Array:
    """The earth's rotation in the local north-east-down frame, shape (3,)."""
    return EARTH_RATE_RAD_S * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])


def gravity_m_s2(latitude_rad: float, height_m: float = 0.0) -> float:
    """Apparent gravity at `height_m` above the WGS 84 ellipsoid.

    Somigliana's closed form on the ellipsoid, and the second-order expansion above it: 0.31 mm/s2 less per 100 m (NIMA
    TR8350.2, "Department of Defense World Geodetic System 1984", Eqns 4-1 and 4-3).
    """
    s2 = np.sin(latitude_rad) ** 2
    g_m_s2 = float(9.7803253359 * (1.0 + 0.00193185265241 * s2) / np.sqrt(1.0 - 0.00669437999013 * s2))
    flattening, m, major_axis_m = 1.0 / 298.257223563, 0.00344978650684, 6378137.0
    x = height_m / major_axis_m
    return float(g_m_s2 * (1.0 - 2.0 * (1.0 + flattening + m - 2.0 * flattening * s2) * x + 3.0 * x * x))


@kernel
def integrate_imu(R0_eb, v0_e_m_s, row, dt_s, g_m_s2, earth_rate_e):  # type: ignore[no-untyped-def]
    """Fill the perfect inertial means of `row` from the motion since the previous tick.

    As a delta-angle, delta-velocity inertial unit: the gyro is the rotation vector of ``R0_eb.T @ R_eb`` over dt
    plus the earth's rotation; the specific force is ``R.T (dv/dt + 2 earth x v - g)`` at the mid-tick attitude
    (with an error of (angle per tick)^2 / 24).

    R0_eb : (3, 3)   v0_e_m_s : (3,)   row : record of TRUTH with R_eb and v_e_m_s set   earth_rate_e : (3,) rad/s
    """
    R = row.R_eb
    # Rotation vector of D = R0^T R: sin(a) axis = (D - D^T) / 2.
    sx = sy = sz = trace = 0.0
    for i in range(3):
        trace += R0_eb[i, 0] * R[i, 0] + R0_eb[i, 1] * R[i, 1] + R0_eb[i, 2] * R[i, 2]
        sx += 0.5 * (R0_eb[i, 2] * R[i, 1] - R0_eb[i, 1] * R[i, 2])
        sy += 0.5 * (R0_eb[i, 0] * R[i, 2] - R0_eb[i, 2] * R[i, 0])
        sz += 0.5 * (R0_eb[i, 1] * R[i, 0] - R0_eb[i, 0] * R[i, 1])
    sine = np.sqrt(sx * sx + sy * sy + sz * sz)
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    scale = angle / sine if sine > 1e-9 else 1.0
    v = row.v_e_m_s
    wx, wy, wz = earth_rate_e[0], earth_rate_e[1], earth_rate_e[2]
    vn, ve, vd = 0.5 * (v[0] + v0_e_m_s[0]), 0.5 * (v[1] + v0_e_m_s[1]), 0.5 * (v[2] + v0_e_m_s[2])
    fn = (v[0] - v0_e_m_s[0]) / dt_s + 2.0 * (wy * vd - wz * ve)
    fe = (v[1] - v0_e_m_s[1]) / dt_s + 2.0 * (wz * vn - wx * vd)
    fd = (v[2] - v0_e_m_s[2]) / dt_s + 2.0 * (wx * ve - wy * vn) - g_m_s2
    # Mid-tick attitude: the mean of the two is exact along the axis of rotation, short by cos(angle / 2) across it.
    cosine = np.cos(0.5 * angle)
    nx, ny, nz = (sx / sine, sy / sine, sz / sine) if sine > 1e-9 else (0.0, 0.0, 0.0)
    f = row.imu_force_b_m_s2
    w = row.imu_omega_b_rad_s
    for i in range(3):
        rn, re, rd = 0.5 * (R0_eb[0, i] + R[0, i]), 0.5 * (R0_eb[1, i] + R[1, i]), 0.5 * (R0_eb[2, i] + R[2, i])
        f[i] = rn * fn + re * fe + rd * fd
        w[i] = rn * wx + re * wy + rd * wz
    along = (nx * f[0] + ny * f[1] + nz * f[2]) * (1.0 - 1.0 / cosine)
    f[0], f[1], f[2] = f[0] / cosine + nx * along, f[1] / cosine + ny * along, f[2] / cosine + nz * along
    w[0] += scale * sx / dt_s
    w[1] += scale * sy / dt_s
    w[2] += scale * sz / dt_s
