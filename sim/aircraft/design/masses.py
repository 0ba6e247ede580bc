"""Mass, balance and inertia of an aeroplane from the list of its parts.

A part is a box of uniform density (a point if its size is 0) or is spread over the wing in proportion to a power of
the chord: 1 for a skin, 0 for a spar, 2 for ribs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.interface import Array
from sim.aircraft.design.shape import Shape

BALANCE_M = 0.002  # tolerance of the centre of gravity: what a builder can feel


@dataclass(frozen=True)
class Box:
    """`mass_kg` uniformly in a box: centre and size along body x, y, z."""

    name: str
    mass_kg: float
    at_m: tuple[float, float, float]
    size_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Spread:
    """`mass_kg` over the whole wing, per span as the chord to `power`, centred at `part` of the chord."""

    name: str
    mass_kg: float
    power: float
    part: float


Part = Box | Spread


def points(part: Part, shape: Shape) -> tuple[Array, Array]:
    """Masses (n,) [kg] and positions (n, 3) [m] with the mass, balance and inertia of the part."""
    if isinstance(part, Box):
        # Two masses at +-size / sqrt(12) on each axis have the second moments of the uniform box.
        corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) / np.sqrt(12.0)
        return np.full(8, part.mass_kg / 8.0), np.array(part.at_m) + corners * np.array(part.size_m)
    n = 400
    y = (np.arange(n) + 0.5) / n * shape.span_m - 0.5 * shape.span_m
    chord = shape.chord_at(y)
    weight = chord**part.power
    x = shape.wing_x_m + (0.25 - part.part) * chord
    return part.mass_kg * weight / weight.sum(), np.column_stack((x, y, shape.wing_z_m - shape.rise_at(y)))


@dataclass(frozen=True)
class Balance:
    """mass_kg; cg_m : (3,) body axes; inertia_kg_m2 : (3, 3) tensor about the centre of gravity."""

    mass_kg: float
    cg_m: Array
    inertia_kg_m2: Array


def balance(parts: Sequence[Part], shape: Shape) -> Balance:
    """Sum of the parts; ValueError if they do not balance at the origin."""
    each = [points(p, shape) for p in parts]
    m, r = np.concatenate([e[0] for e in each]), np.concatenate([e[1] for e in each])
    total = float(m.sum())
    cg = m @ r / total
    if np.abs(cg).max() > BALANCE_M:
        raise ValueError(
            f"the centre of gravity is at x, y, z = {np.round(1e3 * cg, 1)} mm: move the battery or the lead until "
            f"it is within {1e3 * BALANCE_M:g} mm of the origin"
        )
    d = r - cg
    inertia = np.einsum("n,nk,nk->", m, d, d) * np.eye(3) - np.einsum("n,ni,nj->ij", m, d, d)
    return Balance(total, cg, inertia)
