"""Fuselage, canopy and propeller of an aeroplane as closed surfaces, in body axes, metres."""

from collections.abc import Mapping

import numpy as np

from estimator.interface import Array
from sim.view.loft import Mesh, finished, loft

# Along the fuselage, nose to tail: fractions of length, width and height; and rise of the centre line towards the
# tailplane.  With a motor in the nose, and without.
_POWERED = np.array(
    [
        (0.000, 0.40, 0.34, 0.00),
        (0.012, 0.52, 0.44, 0.00),
        (0.045, 0.66, 0.58, 0.00),
        (0.090, 0.80, 0.74, 0.00),
        (0.150, 0.94, 0.90, 0.02),
        (0.230, 1.00, 1.00, 0.00),
        (0.340, 1.00, 1.00, 0.00),
        (0.450, 0.86, 0.86, 0.14),
        (0.600, 0.58, 0.58, 0.42),
        (0.800, 0.36, 0.37, 0.80),
        (0.960, 0.22, 0.24, 1.00),
        (1.000, 0.10, 0.12, 1.04),
    ]
)
_SAILPLANE = np.array(
    [
        (0.000, 0.10, 0.10, -0.30),
        (0.008, 0.26, 0.24, -0.28),
        (0.030, 0.46, 0.42, -0.22),
        (0.080, 0.72, 0.66, -0.12),
        (0.150, 0.92, 0.88, -0.02),
        (0.230, 1.00, 1.00, 0.00),
        (0.330, 1.00, 1.00, 0.00),
        (0.450, 0.74, 0.80, 0.20),
        (0.600, 0.46, 0.52, 0.52),
        (0.800, 0.30, 0.36, 0.84),
        (0.960, 0.22, 0.28, 1.00),
        (1.000, 0.14, 0.20, 1.04),
    ]
)


def fuselage(g: Mapping[str, float], centre_z_m: float, tail_z_m: float) -> Mesh:
    """Fuselage of rounded sections with flat ends."""
    across, down = _superellipse(24, 2.5)
    table = _POWERED if g["propeller_diameter_m"] > 0.0 else _SAILPLANE
    half_width, half_height = 0.5 * g["fuselage_width_m"], 0.5 * g["fuselage_height_m"]
    rings = []
    for x, width, height, rise in table:
        x_m = np.full(len(across), g["nose_x_m"] - x * g["fuselage_length_m"])
        z_m = centre_z_m + half_height * height * down + rise * (tail_z_m - centre_z_m)
        rings.append(np.column_stack((x_m, half_width * width * across, z_m)))
    return loft(np.array(rings), closed=True)


def canopy(g: Mapping[str, float], centre_z_m: float) -> Mesh:
    """A canopy on top of the nose, between motor and wing."""
    ahead_m = g["nose_x_m"] - g["wing_x_m"] - 0.10 * g["fuselage_length_m"]
    across, down = _superellipse(20, 2.0)
    along = np.cos(np.linspace(0.06 * np.pi, 0.94 * np.pi, 11))
    round_it = np.sqrt(1.0 - along**2)[:, None]
    x_m = g["wing_x_m"] + 0.52 * ahead_m + 0.34 * ahead_m * along
    y_m = 0.38 * g["fuselage_width_m"] * round_it * across
    z_m = centre_z_m - 0.27 * g["fuselage_height_m"] * (1.0 - 0.35 * along[:, None])
    z_m = z_m + 0.35 * g["fuselage_height_m"] * round_it * down
    return loft(np.stack((np.broadcast_to(x_m[:, None], y_m.shape), y_m, z_m), axis=-1), closed=True)


def spinner(centre_m: tuple[float, float, float], radius_m: float) -> Mesh:
    """Round cap in front of the propeller."""
    across, down = _superellipse(16, 2.0)
    angle = np.linspace(0.0, 0.45 * np.pi, 6)[:, None]
    x_m = np.broadcast_to(1.6 * radius_m * np.sin(angle), (6, 16))
    y_m, z_m = (radius_m * np.cos(angle) * around for around in (across, down))
    return loft(np.stack((x_m, y_m, z_m), axis=-1) + np.array(centre_m), closed=True)


def disc(centre_m: tuple[float, float, float], radius_m: float) -> Mesh:
    """Propeller disc: two very flat cones, rim to rim."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    rim = np.column_stack((np.zeros(48), radius_m * np.cos(angle), radius_m * np.sin(angle)))
    hub = np.array([[0.01 * radius_m, 0.0, 0.0]])
    here = np.arange(48)
    fan = np.column_stack((np.zeros(48, int), 1 + here, 1 + np.roll(here, -1)))
    vertices = np.vstack((hub, rim, -hub, rim)) + np.array(centre_m)
    return finished(vertices, np.vstack((fan, fan[:, ::-1] + 49)))


def _superellipse(n: int, exponent: float) -> tuple[Array, Array]:
    """Points of a rounded square of half side 1: across and down; includes the extremes if `n` is a multiple of 4."""
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    across, down = (np.sign(f) * np.abs(f) ** (2.0 / exponent) for f in (np.cos(angle), np.sin(angle)))
    across[np.abs(across) < 1e-9], down[np.abs(down) < 1e-9] = 0.0, 0.0
    return across, down
