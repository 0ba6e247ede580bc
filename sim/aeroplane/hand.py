"""The hand that holds, sways, pushes and releases the aeroplane.

While held, the motion is a closed form.  During the push, the hand supplies the force that makes the acceleration
over the ground exactly `push_m_s2` along the nose, and the moment that brings the body rates linearly to those of
the release, whatever motor and air contribute.
"""

import math

import numpy as np

from estimator.interface import Array
from sim.plant import HandThrow


def check(start: HandThrow) -> None:
    """Reject impossible parameters of a throw: ValueError."""
    if min(start.sway_hz) <= 0.0:
        raise ValueError(f"sway_hz {start.sway_hz} Hz: must be above 0 (for no sway set sway_rad_s to 0)")
    for what, value, unit in (
        ("hold_s", start.hold_s, "s"), ("push_s", start.push_s, "s"),
        ("push_m_s2", abs(start.push_m_s2), "m/s2"), ("height_m", start.height_m, "m"),
    ):  # fmt: skip
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{what} {value} {unit}: must be above 0")


def sway(start: HandThrow, t_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Roll, pitch, yaw [rad] and body rates relative to the earth [rad/s] of the aeroplane in the hand.

    The Euler rates are ``a sin(2 pi f t + phase)``; the angles are their integral about the attitude of the throw.
    """
    angles = [start.roll_rad, start.pitch_rad, start.heading_rad]
    rates = [0.0, 0.0, 0.0]
    for i in range(3):
        w = 2.0 * math.pi * start.sway_hz[i]
        phase = w * t_s + start.sway_phase_rad[i]
        angles[i] -= start.sway_rad_s[i] / w * math.cos(phase)
        rates[i] = start.sway_rad_s[i] * math.sin(phase)
    roll, pitch, yaw = angles
    dr, dp, dy = rates
    # Body rates from Euler rates (Etkin & Reid, section 4.4).
    p = dr - dy * math.sin(pitch)
    q = dp * math.cos(roll) + dy * math.cos(pitch) * math.sin(roll)
    r = -dp * math.sin(roll) + dy * math.cos(pitch) * math.cos(roll)
    return (roll, pitch, yaw), (p, q, r)


def guide(
    R_eb: Array, omega_b_rad_s: Array, wanted_b_rad_s: Array, others: tuple[Array, Array],
    push_m_s2: float, g_m_s2: float, mass_kg: float, inertia_kg_m2: Array, dt_s: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Force [N] and moment [N m] of the pushing hand, body axes, for one physics step.

    wanted_b_rad_s : rates after the step     others : force and moment except those of hand and gravity
    Newton: ``m a = F_hand + F_others + m R^T g``; Euler: ``I dw = M_hand + M_others - w x I w``.
    """
    force_others, moment_others = others
    force = mass_kg * (np.array([push_m_s2, 0.0, 0.0]) - g_m_s2 * R_eb[2]) - force_others
    gyroscopic = np.cross(omega_b_rad_s, inertia_kg_m2 * omega_b_rad_s)
    moment = inertia_kg_m2 * (wanted_b_rad_s - omega_b_rad_s) / dt_s + gyroscopic - moment_others
    return force, moment
