"""Stability derivatives of a linear model, and textbook approximations of the modes.

Stability axes: the body axes rotated about y so that x points along the trimmed flight and w is zero.

References
----------
Nelson, R. C., "Flight Stability and Automatic Control", 2nd ed., 1998, chapters 3 to 5: the derivatives, and the
two-state approximations of the short period and the Dutch roll, the single-state one of the roll.
Bairstow, L., "Applied Aerodynamics", 2nd ed., 1939: the slow pair of roots of a quartic whose others are fast.
Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, chapter 6: the spiral root as the ratio of the last
two coefficients of the characteristic equation.
Lanchester, F. W., "Aerodonetics", 1908: the phugoid at a constant angle of attack.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from estimator.interface import G_M_S2, Array
from sim.aeroplane.linear import ASYMMETRIC, SYMMETRIC, LinearModel, Mode, derivative

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model

U, V, W, P, Q, R, ROLL, PITCH = range(8)


@dataclass(frozen=True, slots=True)
class Airframe:
    """Quantities that convert forces to coefficients: aeroplane, air, lift and drag at a trim."""

    mass_kg: float
    inertia_kg_m2: Array  # (3, 3), about the centre of gravity, body axes
    area_m2: float
    span_m: float
    chord_m: float
    density_kg_m3: float
    airspeed_m_s: float
    lift_n: float  # including the thrust component across the path
    drag_n: float

    @classmethod
    def of(cls, model: "Model", linear: LinearModel) -> "Airframe":
        """Of `model` at the trim of `linear`; the thrust acts along the body x axis."""
        t, x = linear.trim, linear.x
        derivative(model, x, linear.u)
        weight_n = model.mass_kg() * G_M_S2
        return cls(
            model.mass_kg(), model.inertia_tensor_kg_m2(), *model.wing(), model.density_kg_m3(), t.airspeed_m_s,
            weight_n * math.cos(t.climb_rad),
            model.thrust_n() * math.cos(t.alpha_rad) - weight_n * math.sin(t.climb_rad),
        )  # fmt: skip

    @property
    def pressure_force_n(self) -> float:
        """Dynamic pressure times wing area."""
        return 0.5 * self.density_kg_m3 * self.airspeed_m_s**2 * self.area_m2


def _to_stability(linear: LinearModel) -> Array:
    """R_sb: from body to stability axes."""
    c, s = math.cos(linear.trim.alpha_rad), math.sin(linear.trim.alpha_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def stability_axes(linear: LinearModel) -> Array:
    """A of u v w p q r roll pitch, shape (8, 8), with velocities and rates in stability axes.

    The Euler angles remain those of the body.
    """
    T = np.eye(8)
    T[:3, :3] = T[3:6, 3:6] = _to_stability(linear)
    return T @ linear.A[:8, :8] @ T.T


def coefficients(linear: LinearModel, frame: Airframe) -> dict[str, float]:
    """Dimensionless derivatives per radian, rates as p b / 2V and q c / 2V, controls per full deflection.

    Lift and moments in stability axes, with the thrust as a function of the state.  Lift turns with the flow, the
    forces of the linear model do not; the drag term accounts for that (Nelson, chapter 3).
    """
    R_sb = _to_stability(linear)
    A, speed, qs = stability_axes(linear), frame.airspeed_m_s, frame.pressure_force_n
    moments = (R_sb @ frame.inertia_kg_m2 @ R_sb.T) @ A[3:6]
    controls_force, controls_moment = R_sb @ linear.B[:3], R_sb @ frame.inertia_kg_m2 @ linear.B[3:6]
    span, chord = frame.span_m, frame.chord_m
    per_span, per_chord, force = qs * span, qs * chord, frame.mass_kg / qs
    p_hat, q_hat = 2.0 * speed / span, 2.0 * speed / chord
    roll, pitch, yaw = moments[0] / per_span, moments[1] / per_chord, moments[2] / per_span
    values = {
        "CL_alpha": -force * A[W, W] * speed - frame.drag_n / qs,
        "CL_q": -force * (A[W, Q] - speed) * q_hat,
        "Cm_alpha": pitch[W] * speed,
        "Cm_q": pitch[Q] * q_hat,
        "CY_beta": force * A[V, V] * speed,
        "Cl_beta": roll[V] * speed,
        "Cl_p": roll[P] * p_hat,
        "Cl_r": roll[R] * p_hat,
        "Cn_beta": yaw[V] * speed,
        "Cn_p": yaw[P] * p_hat,
        "Cn_r": yaw[R] * p_hat,
        "Cl_aileron": controls_moment[0, 0] / per_span,
        "Cn_aileron": controls_moment[2, 0] / per_span,
        "Cm_elevator": controls_moment[1, 1] / per_chord,
        "CL_elevator": -force * controls_force[2, 1],
        "Cn_rudder": controls_moment[2, 2] / per_span,
        "Cl_rudder": controls_moment[0, 2] / per_span,
    }
    return {name: float(value) for name, value in values.items()}


def textbook(linear: LinearModel) -> dict[str, Mode]:
    """Textbook approximations of the modes from the derivatives of `linear`, by mode name."""
    A, speed = stability_axes(linear), linear.trim.airspeed_m_s
    return {
        "short_period": _pair("short_period", A[W, W] * A[Q, Q] - speed * A[Q, W], -(A[Q, Q] + A[W, W])),
        "phugoid": _phugoid(A),
        "roll": Mode("roll", (complex(A[P, P]),)),
        "dutch_roll": _dutch_roll(A),
        "spiral": _spiral(A),
    }


def lanchester(airspeed_m_s: float, glide_ratio: float) -> Mode:
    """The phugoid at a constant angle of attack: omega = sqrt(2) g / V, damping ratio D / L / sqrt(2)."""
    omega = math.sqrt(2.0) * G_M_S2 / airspeed_m_s
    return _pair("phugoid", omega**2, 2.0 * omega / (math.sqrt(2.0) * glide_ratio))


def _phugoid(A: Array) -> Mode:
    """s^2 + (D / C - B E / C^2) s + E / C of the quartic s^4 + B s^3 + C s^2 + D s + E (Bairstow).

    The formulas of Nelson (two states) and Lanchester keep the angle of attack constant.  In a small aeroplane pitch
    damping is as strong as stiffness, and the angle of attack does not recover within a phugoid period.
    """
    _, b, c, d, e = np.poly(A[np.ix_(SYMMETRIC, SYMMETRIC)])
    return _pair("phugoid", e / c, d / c - b * e / c**2)


def _dutch_roll(A: Array) -> Mode:
    """Sideslip and yaw only: omega^2 = (Y_b N_r - N_b Y_r + V N_b) / V, 2 zeta omega = -(Y_b / V + N_r)."""
    y_v, n_v, n_r = A[V, V], A[R, V], A[R, R]
    return _pair("dutch_roll", y_v * n_r - n_v * A[V, R], -(y_v + n_r))  # A[V, R] is Y_r - V


def _spiral(A: Array) -> Mode:
    """Minus the ratio of the last two coefficients of the characteristic equation of v p r roll."""
    *_, before, last = np.poly(A[np.ix_(ASYMMETRIC, ASYMMETRIC)])
    return Mode("spiral", (complex(-last / before),))


def _pair(name: str, stiffness: float, damping: float) -> Mode:
    """The two roots of s^2 + damping s + stiffness."""
    first, second = np.roots([1.0, damping, stiffness])
    return Mode(name, (complex(first), complex(second)))
