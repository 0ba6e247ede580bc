"""Trimmed level flight by root finding: the angle of attack and the commands at which nothing accelerates.

JSBSim's own trim marches a propeller this small with a step at which it is unstable; here the motion is frozen
for a second while the propeller finds its speed, and the accelerations that remain are driven to zero.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import root  # type: ignore[import-untyped]

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from sim.air import STILL

if TYPE_CHECKING:
    from sim.jsbsim_plant import Model


@dataclass(frozen=True, slots=True)
class Trim:
    """Level flight in still air, wings level; commands in -1..1, throttle in 0..1."""

    airspeed_m_s: float
    alpha_rad: float
    elevator: float
    throttle: float
    aileron: float = 0.0

    @classmethod
    def of(cls, cruise: dict[str, Any]) -> "Trim":
        """From the table `cruise` of an airframe.toml."""
        alpha_rad = math.radians(cruise["alpha_deg"])
        return cls(cruise["airspeed_m_s"], alpha_rad, cruise["elevator"], cruise["throttle"])

    @property
    def command(self) -> ActuatorCommand:
        return ActuatorCommand(self.aileron, self.elevator, 0.0, self.throttle)


def accelerations(model: "Model", t: Trim, height_m: float) -> Array:
    """What remains at `t`: rates of change of body velocity [m/s2] and body rates [rad/s2], shape (6,)."""
    v_b = t.airspeed_m_s * np.array([math.cos(t.alpha_rad), 0.0, math.sin(t.alpha_rad)])
    spin = round(1.0 / model.dt_s)  # a second is 15 time constants of the motor
    model.place(height_m, (0.0, t.alpha_rad, 0.0), v_b, (0.0, 0.0, 0.0), t.command, STILL, spin)
    return model.accelerations()


def trim(model: "Model", airspeed_m_s: float, height_m: float = 60.0) -> Trim:
    """Find the trim for `airspeed_m_s`; ValueError where there is none (too slow or too fast to fly level)."""
    cruise = Trim.of(model.airframe["cruise"])

    def at(x: Array) -> Trim:
        return Trim(airspeed_m_s, *(float(v) for v in x))

    def residual(x: Array) -> Array:
        if not (math.isfinite(x.sum()) and np.all(np.abs(x) < 3.0)):
            return np.full(4, 1e3)
        return accelerations(model, at(x), height_m)[[0, 2, 3, 4]]

    # Lift as in the cruise: alpha above that of no lift goes with 1 / V^2, roughly.
    guess = [cruise.alpha_rad + 0.07 * ((cruise.airspeed_m_s / airspeed_m_s) ** 2 - 1.0), 0.0, cruise.throttle, 0.0]
    found = root(residual, guess, tol=1e-10)
    alpha, elevator, throttle, aileron = found.x
    flyable = max(abs(elevator), abs(aileron)) <= 1.0 and 0.0 <= throttle <= 1.0 and abs(alpha) < 0.3
    if not (np.max(np.abs(found.fun)) < 1e-6 and flyable):
        raise ValueError(
            f"airspeed_m_s {airspeed_m_s} m/s: no level trim at {height_m:g} m, choose one between stall and top speed"
        )
    return at(found.x)
