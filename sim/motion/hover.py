"""A hovering multi-rotor that sways about its position and tilts accordingly.

Rotor thrust acts only along the body z axis, so the craft tilts into every horizontal acceleration and the specific
force stays along the body z axis whatever the tilt: an accelerometer aboard does not sense the tilt of a hovering
craft.  Drag is neglected (Martin and Salauen, "The true role of accelerometer feedback in quadrotor control", ICRA
2010: what the accelerometer does sense is rotor drag).
"""

import math
from dataclasses import dataclass

import numpy as np

from estimator.interface import Array
from sim.motion.prescribed_plant import GRAVITY_M_S2, Kinematics

Sines = tuple[tuple[float, float, float], ...]  # of each: amplitude, frequency in hertz, phase in radians


@dataclass(frozen=True, slots=True)
class Hover:
    """Hovering in still air, each coordinate and the heading a sum of sines.

    north, east : amplitude [m], frequency [Hz], phase [rad] of each sine      yaw : the same, amplitude in radians
    heading_rad : mean heading          rotor_rpm : rotor speed, for vibration and motor current
    """

    heading_rad: float = 0.0
    north: Sines = ((0.40, 0.11, 0.0), (0.15, 0.31, 1.0))
    east: Sines = ((0.35, 0.09, 2.0), (0.15, 0.27, 3.0))
    yaw: Sines = ((math.radians(4.0), 0.05, 4.0), (math.radians(1.5), 0.17, 5.0))
    rotor_rpm: float = 5500.0  # not a multiple of the sample rate, which would alias to a constant force
    height_m: float = 5.0

    def __post_init__(self) -> None:
        for name in ("north", "east", "yaw"):
            value = np.asarray(getattr(self, name), np.float64)
            if value.ndim != 2 or value.shape[1] != 3 or not np.all(np.isfinite(value)):
                raise ValueError(f"Hover.{name} = {getattr(self, name)!r}: choose rows of amplitude, hertz, radians")
        if not 0.0 <= self.rotor_rpm < math.inf:
            raise ValueError(f"Hover.rotor_rpm = {self.rotor_rpm!r} rpm: choose a finite speed, 0 rpm or more")

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        (n, dn, ddn, dddn), (e, de, dde, ddde) = _derivatives(self.north, t_s), _derivatives(self.east, t_s)
        yaw, dyaw = _derivatives(self.yaw, t_s)[:2]
        none = 0.0 * t_s
        # Thrust balances gravity and accelerates; body z points the opposite way.
        z, dz = _unit(np.stack([-ddn, -dde, none + GRAVITY_M_S2]), np.stack([-dddn, -ddde, none]))
        cosine, sine = np.cos(self.heading_rad + yaw), np.sin(self.heading_rad + yaw)
        nose, dnose = np.stack([cosine, sine, none]), dyaw * np.stack([-sine, cosine, none])
        y, dy = _unit(np.cross(z, nose, axis=0), np.cross(dz, nose, axis=0) + np.cross(z, dnose, axis=0))
        x = np.cross(y, z, axis=0)
        # dR/dt = R skew(omega): omega is the rate of each axis towards the next.
        omega_b = np.stack([np.sum(z * dy, axis=0), np.sum(x * dz, axis=0), -np.sum(x * dy, axis=0)], axis=-1)
        return Kinematics(
            np.stack([x, y, z], axis=-1).swapaxes(0, 1),
            omega_b,
            np.stack([n, e, none - self.height_m], axis=-1),
            np.stack([dn, de, none], axis=-1),
            np.stack([ddn, dde, none], axis=-1),
        )


def _derivatives(sines: Sines, t_s: Array) -> Array:
    """A sum of sines and its first three derivatives, shape (4, n)."""
    amplitude, hz, phase = np.array(sines, np.float64).T[:, :, None]
    w = 2.0 * np.pi * hz
    angle = w * t_s + phase
    shapes = (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle), -(w**3) * np.cos(angle))
    return np.stack([np.sum(amplitude * shape, axis=0) for shape in shapes])


def _unit(v: Array, dv: Array) -> tuple[Array, Array]:
    """Unit vectors of `v`, shape (3, n), and their derivative when the derivative of `v` is `dv`."""
    length = np.linalg.norm(v, axis=0)
    u = v / length
    return u, (dv - u * np.sum(u * dv, axis=0)) / length
