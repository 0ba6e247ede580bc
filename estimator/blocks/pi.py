"""The weighted proportional-plus-integral drift controller, Eqns 28 and 29 of the paper.

Linearised about a small attitude error e (one axis, one reference) with an uncorrected gyro offset b, the loop is

    de/dt = b - K_P W e + w_I,    dw_I/dt = -K_I W e    so    s^2 + K_P W s + K_I W = 0

The integral ends at -b with no error left; its slow eigenvalue is close to K_I / K_P.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009, section "Feedback controller".
"""

import numpy as np

from estimator.blocks.kernels import clip
from estimator.blocks.screening import take_rate
from estimator.compiler.jit import inlined


@inlined
def corrected_rate(row, s, good):  # type: ignore[no-untyped-def]
    """The rate to integrate: gyro less offset and plus corrections (Eqn 16); ``s.omega_b_rad_s`` is it without P."""
    for i in range(3):
        s.gyro_bias_b_rad_s[i] = s.calibrated_offset_b_rad_s[i] - s.omega_i_b[i]
    take_rate(row, s, good)
    for i in range(3):
        s.omega_total_b[i] = s.omega_b_rad_s[i] + s.omega_p_b[i]


@inlined
def weigh(w_rp, roll_pitch_b, w_y, yaw_b, total_b):  # type: ignore[no-untyped-def]
    """Fill `total_b` with the weighted sum of the two corrections, all of shape (3,), body axes (Eqn 28)."""
    for i in range(3):
        total_b[i] = w_rp * roll_pitch_b[i] + w_y * yaw_b[i]


@inlined
def feed_back(total_b, k_p, k_i, offset_limit_rad_s, dt_s, omega_p_b, omega_i_b):  # type: ignore[no-untyped-def]
    """Update the proportional and the integral rate corrections, in place (Eqn 29); see `learn_offset`.

    Parameters
    ----------
    total_b : shape (3,)             weighted correction, Eqn 28
    k_p, k_i : float                 gains, 1/s and 1/s^2 per unit of correction
    offset_limit_rad_s : float       largest gyro offset that is learnt, per axis
    omega_p_b, omega_i_b : shape (3,)  rate corrections, written
    """
    correct(total_b, k_p, omega_p_b)
    learn_offset(total_b, k_p, k_i, offset_limit_rad_s, dt_s, omega_i_b)


@inlined
def correct(total_b, k_p, omega_p_b):  # type: ignore[no-untyped-def]
    """Set the proportional rate correction (Eqn 29, first line)."""
    for i in range(3):
        omega_p_b[i] = k_p * total_b[i]


@inlined
def learn_offset(total_b, k_p, k_i, offset_limit_rad_s, dt_s, omega_i_b):  # type: ignore[no-untyped-def]
    """Update the integral rate correction, in place (Eqn 29, second line).

    In the steady state the proportional correction equals at most the offset still to be learnt.  A correction larger
    than the limit therefore has another cause (yaw lock, a turn in wind, a throw): the integral sees no more of it than
    such an offset would cause.  There is no other anti-wind-up.
    """
    step_s = k_i * dt_s
    squared = k_p * k_p * (total_b[0] * total_b[0] + total_b[1] * total_b[1] + total_b[2] * total_b[2])
    if squared > offset_limit_rad_s * offset_limit_rad_s:
        step_s *= offset_limit_rad_s / np.sqrt(squared)
    for i in range(3):
        omega_i_b[i] = clip(omega_i_b[i] + step_s * total_b[i], -offset_limit_rad_s, offset_limit_rad_s)
