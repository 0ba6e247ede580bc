"""Dryden turbulence at low altitude (MIL-F-8785C, section 3.7; MIL-HDBK-1797, section 4.9).

One-sided spectra over the spatial frequency Omega [rad/m]; sigma^2 is their integral from 0 to infinity:

    Phi_u = sigma_u^2 2 L_u / pi          / (1 + (L_u Omega)^2)
    Phi_v = sigma_v^2   L_v / pi (1 + 3 (L_v Omega)^2) / (1 + (L_v Omega)^2)^2          Phi_w likewise
    Phi_p = sigma_w^2 / L_w  0.8 (pi L_w / 4 b)^(1/3) / (1 + (4 b Omega / pi)^2)
    Phi_q = Omega^2 Phi_w / (1 + (4 b Omega / pi)^2)
    Phi_r = Omega^2 Phi_v / (1 + (3 b Omega / pi)^2)

with b the span, and from 10 ft to 1000 ft (3 m to 305 m) above the ground, h in ft,

    L_w = h          L_u = L_v = h / (0.177 + 0.000823 h)^1.2
    sigma_w = 0.1 W20          sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4

Below and above, the values at these bounds are used.  The handbook defines L_v and L_w as half of these and gives the
same spectra.  u is along the mean wind, w vertical.  q follows from w and r from v, q = -dw/dx and r = dv/dx averaged
over the aeroplane, so that flying into rising air pitches it up; p, q and r are about the axes of the aeroplane, and r
is in phase with v for flight downwind.

All are linear filters of white noise over the distance flown through frozen air (Taylor), not over time.  Steps of any
length are exact: x <- Phi x + C z with the matrix exponential Phi, the covariance C C^T of the noise over the step
(Van Loan, 1978), and unit normal z.  So the statistics do not depend on the tick length, and for an aeroplane at rest
in still air the turbulence is constant.
"""

import math
from typing import Final

import numpy as np

from estimator.compiler.jit import kernel

KNOT_M_S = 1852.0 / 3600.0
SEVERITIES_M_S: Final = {  # W20 of the words of MIL-F-8785C: 15, 30 and 45 knots
    "calm": 0.0,
    "light": round(15.0 * KNOT_M_S, 2),
    "moderate": round(30.0 * KNOT_M_S, 2),
    "severe": round(45.0 * KNOT_M_S, 2),
}
FT = 0.3048  # the standard counts heights in feet
LOWEST_M, HIGHEST_M = 10.0 * FT, 1000.0 * FT
FAR_M = 1e6  # beyond all correlation

# Of one flight: parameters, filter states (each of unit strength), and room for the matrices of a step.
FIELDS = [
    ("w20_m_s", "f8"),
    ("span_m", "f8"),
    ("along_wind", "f8", (2,)),  # unit vector (north, east) of the u axis
    ("x_u", "f8"),
    ("x_v", "f8", (3,)),
    ("x_w", "f8", (3,)),
    ("x_p", "f8"),
    ("phi", "f8", (3, 3)),
    ("spread", "f8", (3, 3)),
    ("term", "f8", (3, 3)),
    ("room", "f8", (3, 3)),
]
STREAMS = {"turbulence u": 1, "turbulence v": 3, "turbulence w": 3, "turbulence p": 1}  # normals for each tick
_TERMS = 15  # of the series: the last one is below 0.5^15 / 15! = 2e-17
_A, _B = math.sqrt(3.0), 1.0 - math.sqrt(3.0)  # (1 + sqrt(3) s) / (1 + s)^2 = _A / (1 + s) + _B / (1 + s)^2


@kernel
def strengths(height_m, w20_m_s):  # type: ignore[no-untyped-def]
    """Standard deviations (along and across the wind, vertical) and scale lengths (the same), m/s and m."""
    h = min(max(height_m, LOWEST_M), HIGHEST_M)
    factor = 0.177 + 0.000823 * h / FT
    sigma_w = 0.1 * w20_m_s
    return sigma_w / factor**0.4, sigma_w, h / factor**1.2, h


@kernel
def sigma_p_rad_s(sigma_w, scale_w, span_m):  # type: ignore[no-untyped-def]
    """Standard deviation of the roll rate of the air: root of the integral of Phi_p."""
    variance = 0.8 * (np.pi * scale_w / (4.0 * span_m)) ** (1.0 / 3.0) * np.pi**2 / (8.0 * span_m * scale_w)
    return sigma_w * np.sqrt(variance)


@kernel
def transition(distance_m, scale_m, averaged_m, s):  # type: ignore[no-untyped-def]
    """Write ``s.phi`` and ``s.spread`` of a step of the states (x1, x2, m), which give v and r (or w and q).

        dx1 = -x1 / L dx + dW / sqrt(L)     dx2 = (x1 - x2) / L dx     dm = (v - m) / l dx
        v = sqrt(3) x1 + (1 - sqrt(3)) x2          filtered derivative of v: (v - m) / l

    L : scale_m          l : averaged_m, 4 b / pi or 3 b / pi
    Taylor series of the exponential and of the covariance over a fraction of the step, doubled up to the whole.
    """
    a, b = distance_m / scale_m, distance_m / averaged_m
    doublings = 0
    while max(2.0 * a, 4.0 * b) > 0.5:
        a, b, doublings = 0.5 * a, 0.5 * b, doublings + 1
    phi, spread, term, room = s.phi, s.spread, s.term, s.room
    phi[:] = 0.0
    spread[:] = 0.0
    spread[0, 0] = a
    room[:] = spread
    phi[0, 0] = phi[1, 1] = phi[2, 2] = 1.0
    term[:] = phi
    for k in range(1, _TERMS + 1):
        for j in range(3):  # term <- A term / k, columns
            t0, t1, t2 = term[0, j], term[1, j], term[2, j]
            term[0, j] = -a * t0 / k
            term[1, j] = a * (t0 - t1) / k
            term[2, j] = b * (_A * t0 + _B * t1 - t2) / k
            for i in range(3):
                phi[i, j] += term[i, j]
        _lyapunov(a, b, k + 1, room)
        for i in range(3):
            for j in range(3):
                spread[i, j] += room[i, j]
    for _ in range(doublings):
        _double(s)


@kernel
def _lyapunov(a, b, k, q):  # type: ignore[no-untyped-def]
    """q <- (A q + q A^T) / k of a symmetric q, in place."""
    q00, q10, q11, q20, q21, q22 = q[0, 0], q[1, 0], q[1, 1], q[2, 0], q[2, 1], q[2, 2]
    q[0, 0] = -2.0 * a * q00 / k
    q[1, 0] = q[0, 1] = a * (q00 - 2.0 * q10) / k
    q[1, 1] = 2.0 * a * (q10 - q11) / k
    q[2, 0] = q[0, 2] = (b * (_A * q00 + _B * q10 - q20) - a * q20) / k
    q[2, 1] = q[1, 2] = (b * (_A * q10 + _B * q11 - q21) + a * (q20 - q21)) / k
    q[2, 2] = 2.0 * b * (_A * q20 + _B * q21 - q22) / k


@kernel
def _double(s):  # type: ignore[no-untyped-def]
    """A step of twice the length: spread <- spread + phi spread phi^T, phi <- phi phi."""
    phi, spread, term, room = s.phi, s.spread, s.term, s.room
    for i in range(3):
        for j in range(3):
            term[i, j] = phi[i, 0] * spread[0, j] + phi[i, 1] * spread[1, j] + phi[i, 2] * spread[2, j]
            room[i, j] = phi[i, 0] * phi[0, j] + phi[i, 1] * phi[1, j] + phi[i, 2] * phi[2, j]
    for i in range(3):
        for j in range(3):
            spread[i, j] += term[i, 0] * phi[j, 0] + term[i, 1] * phi[j, 1] + term[i, 2] * phi[j, 2]
    phi[:] = room


@kernel
def wander(x, z, s):  # type: ignore[no-untyped-def]
    """x <- phi x + C z with C the Cholesky factor of the spread; zero for a step of zero length."""
    phi, q = s.phi, s.spread
    c00 = np.sqrt(q[0, 0])
    c10 = q[1, 0] / c00 if c00 > 0.0 else 0.0
    c20 = q[2, 0] / c00 if c00 > 0.0 else 0.0
    c11 = np.sqrt(max(q[1, 1] - c10 * c10, 0.0))
    c21 = (q[2, 1] - c20 * c10) / c11 if c11 > 0.0 else 0.0
    c22 = np.sqrt(max(q[2, 2] - c20 * c20 - c21 * c21, 0.0))
    x0, x1, x2 = x[0], x[1], x[2]
    x[0] = phi[0, 0] * x0 + c00 * z[0]
    x[1] = phi[1, 0] * x0 + phi[1, 1] * x1 + c10 * z[0] + c11 * z[1]
    x[2] = phi[2, 0] * x0 + phi[2, 1] * x1 + phi[2, 2] * x2 + c20 * z[0] + c21 * z[1] + c22 * z[2]


@kernel
def wander_alone(x, z, lengths):  # type: ignore[no-untyped-def]
    """As `wander`, for one state of a first-order filter, over `lengths` of its scale."""
    return np.exp(-lengths) * x + np.sqrt(-np.expm1(-2.0 * lengths)) * z


@kernel
def add_turbulence(distance_m, height_m, z, s, wind_e, rate_b):  # type: ignore[no-untyped-def]
    """Advance by `distance_m`; add the turbulence to `wind_e` and write its rates into `rate_b`, both shape (3,).

    z : shape (8,), unit normal, in the order of STREAMS          s : record with the FIELDS
    """
    sigma_u, sigma_w, scale_u, scale_w = strengths(height_m, s.w20_m_s)
    pitched_m, yawed_m = 4.0 * s.span_m / np.pi, 3.0 * s.span_m / np.pi
    s.x_u = wander_alone(s.x_u, z[0], distance_m / scale_u)
    s.x_p = wander_alone(s.x_p, z[7], distance_m / pitched_m)
    transition(distance_m, scale_u, yawed_m, s)
    wander(s.x_v, z[1:4], s)
    transition(distance_m, scale_w, pitched_m, s)
    wander(s.x_w, z[4:7], s)
    v = _A * s.x_v[0] + _B * s.x_v[1]
    w = _A * s.x_w[0] + _B * s.x_w[1]
    north, east = s.along_wind[0], s.along_wind[1]
    wind_e[0] += sigma_u * (north * s.x_u - east * v)
    wind_e[1] += sigma_u * (east * s.x_u + north * v)
    wind_e[2] += sigma_w * w
    rate_b[0] = sigma_p_rad_s(sigma_w, scale_w, s.span_m) * s.x_p
    rate_b[1] = -sigma_w * (w - s.x_w[2]) / pitched_m
    rate_b[2] = sigma_u * (v - s.x_v[2]) / yawed_m
