"""Small motions about a trim: the linear model, by central differences through JSBSim, and its natural modes.

States: velocity over the ground in body axes (u, v, w), body rates (p, q, r), Euler angles (roll, pitch, yaw) and
position (north, east, down); inputs: aileron, elevator, rudder, throttle.  The air is still, the surfaces are fixed,
and the propeller turns at the steady speed of each state (its time constant, 0.07 s, is short compared with all modes
except roll).

Position and heading matter only through the earth's rotation and are left out of the modes.  Of the other nine
states four are symmetric (short period, phugoid), four asymmetric (roll subsidence, Dutch roll, spiral), and height
gives a root near zero through the air density.

References
----------
Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, chapters 4 and 6.
Perez-Arriaga, I. J., Verghese, G. C. and Schweppe, F. C., "Selective modal analysis with applications to electric
power systems", IEEE Trans. PAS-101, 1982: participation factors.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from sim.aeroplane.trim import Trim, earth_to_body, settled

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model

STATES = ("u", "v", "w", "p", "q", "r", "roll", "pitch", "yaw", "north", "east", "down")
INPUTS = ("aileron", "elevator", "rudder", "throttle")
STEPS = np.array([1e-3] * 6 + [1e-4] * 3 + [1.0] * 3)  # of finite differences: m/s, rad/s, rad, m
COMMAND_STEP = 1e-3
SYMMETRIC, ASYMMETRIC, HEIGHT = (0, 2, 4, 7), (1, 3, 5, 6), 11
DYNAMIC = (*SYMMETRIC, *ASYMMETRIC, HEIGHT)
ROLL_RATE, SIDE_SPEED, YAW_RATE = (ASYMMETRIC.index(STATES.index(name)) for name in "pvr")


@dataclass(frozen=True, slots=True)
class LinearModel:
    """d(dx)/dt = A dx + B du about a trim.

    A : (12, 12), states as in STATES       B : (12, 4), inputs as in INPUTS
    trim : of the linearisation             x, u : states and commands there
    """

    A: Array
    B: Array
    trim: Trim
    x: Array
    u: ActuatorCommand


@dataclass(frozen=True, slots=True)
class Mode:
    """A natural mode: two eigenvalues, a conjugate pair or both real, or a single real one."""

    name: str
    eigenvalues: tuple[complex, ...]

    @property
    def omega_rad_s(self) -> float:
        """Natural frequency; of a single real root its magnitude; NaN for two real roots of which one diverges."""
        product = math.prod(abs(e) for e in self.eigenvalues)
        if len(self.eigenvalues) == 2 and (self.eigenvalues[0] * self.eigenvalues[1]).real < 0.0:
            return math.nan
        return float(product ** (1.0 / len(self.eigenvalues)))

    @property
    def damping(self) -> float:
        """Damping ratio; 1 or -1 for a single real root."""
        return float(-np.mean([e.real for e in self.eigenvalues]) / self.omega_rad_s)

    @property
    def period_s(self) -> float:
        """Period of the oscillation; infinite if there is none."""
        turning = max(abs(e.imag) for e in self.eigenvalues)
        return 2.0 * math.pi / turning if turning > 0.0 else math.inf

    @property
    def slowest_per_s(self) -> float:
        """Largest real part of the roots."""
        return max(e.real for e in self.eigenvalues)

    @property
    def time_to_half_s(self) -> float:
        """Time to half amplitude; infinite if it grows."""
        return math.log(2.0) / -self.slowest_per_s if self.slowest_per_s < 0.0 else math.inf

    @property
    def time_to_double_s(self) -> float:
        """Time to double amplitude; infinite if it decays."""
        return math.log(2.0) / self.slowest_per_s if self.slowest_per_s > 0.0 else math.inf


def euler_rates(euler_rad: Array, omega_b_rad_s: Array) -> Array:
    """Rates of change of roll, pitch and yaw (Etkin & Reid, section 4.4)."""
    roll, pitch, _ = euler_rad
    p, q, r = omega_b_rad_s
    across = q * math.sin(roll) + r * math.cos(roll)
    return np.array([p + math.tan(pitch) * across, q * math.cos(roll) - r * math.sin(roll), across / math.cos(pitch)])


def derivative(model: "Model", x: Array, u: ActuatorCommand) -> Array:
    """dx/dt of the aeroplane at state `x` (12,) and command `u`, the propeller turning steadily."""
    roll, pitch, yaw = (float(angle) for angle in x[6:9])
    p, q, r = (float(rate) for rate in x[3:6])
    settled(model, -float(x[11]), (roll, pitch, yaw), x[:3], (p, q, r), u)
    body_e = np.array([earth_to_body(axis, (roll, pitch, yaw)) for axis in np.eye(3)])  # rows: earth axes, body frame
    return np.concatenate([model.accelerations(), euler_rates(x[6:9], x[3:6]), body_e @ x[:3]])


def state_of(t: Trim, height_m: float, heading_rad: float = 0.0) -> Array:
    """The states at a trim in still air, shape (12,)."""
    place = (0.0, 0.0, -height_m)
    return np.concatenate([t.air_velocity_b_m_s, t.omega_b_rad_s, t.euler_rad(heading_rad), place])


def linearise(model: "Model", t: Trim, height_m: float = 60.0) -> LinearModel:
    """The linear model about the trim `t`, heading north in still air."""
    x, u = state_of(t, height_m), t.command
    A, B = np.zeros((12, 12)), np.zeros((12, 4))
    for j, h in enumerate(STEPS):
        if STATES[j] not in ("north", "east"):  # no effect
            step = np.zeros(12)
            step[j] = h
            A[:, j] = (derivative(model, x + step, u) - derivative(model, x - step, u)) / (2.0 * h)
    for j, name in enumerate(INPUTS):
        here = getattr(u, name)
        low, high = max(here - COMMAND_STEP, 0.0 if name == "throttle" else -1.0), min(here + COMMAND_STEP, 1.0)
        change = derivative(model, x, u._replace(**{name: high})) - derivative(model, x, u._replace(**{name: low}))
        B[:, j] = change / (high - low)
    return LinearModel(A, B, t, x, u)


def modes(linear: LinearModel) -> tuple[Mode, ...]:
    """The natural modes, identified by the participation of the states.

    The participation of state k in mode i is |left eigenvector i, k| times |right eigenvector i, k|, independent of
    the units of the states.  If roll and spiral combine into a slow oscillation, as with dihedral and little roll
    damping, they form one mode, ``roll_spiral``.
    """
    values, right = np.linalg.eig(linear.A[np.ix_(DYNAMIC, DYNAMIC)])
    part = np.abs(right) * np.abs(np.linalg.inv(right)).T  # [state, mode]
    part /= part.sum(axis=0)
    height = int(np.argmax(part[8]))
    rest = [i for i in range(9) if i != height]
    symmetric = sorted(rest, key=lambda i: -float(part[:4, i].sum()))[:4]
    asymmetric = [i for i in rest if i not in symmetric]
    by_speed = sorted(symmetric, key=lambda i: abs(values[i]))
    found = [_mode("short_period", values[by_speed[2:]]), _mode("phugoid", values[by_speed[:2]])]
    return (*found, *_asymmetric(values[asymmetric], part[np.ix_(range(4, 8), asymmetric)]))


def _mode(name: str, values: Array) -> Mode:
    return Mode(name, tuple(complex(v) for v in sorted(values, key=lambda v: (v.real, v.imag))))


def _asymmetric(values: Array, part: Array) -> tuple[Mode, ...]:
    """Roll, Dutch roll and spiral among four roots; `part` [v p r roll, root] are the participations."""
    turning = np.abs(values.imag) > 1e-9
    if turning.all():
        order = np.argsort(-part[SIDE_SPEED] - part[YAW_RATE])
        return _mode("dutch_roll", values[order[:2]]), _mode("roll_spiral", values[order[2:]])
    real = np.flatnonzero(~turning)  # four if the Dutch roll is overdamped, too
    rolls = real[int(np.argmax(part[ROLL_RATE][real]))]
    rest = real[real != rolls]
    spiral = rest[int(np.argmin(np.abs(values[rest])))]
    dutch = [i for i in range(4) if i not in (rolls, spiral)]
    return _mode("dutch_roll", values[dutch]), _mode("roll", values[[rolls]]), _mode("spiral", values[[spiral]])
