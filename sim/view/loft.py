"""Closed surfaces over rings of points, and the aerofoil sections used as rings of a wing."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array

_AFT, _FORE, _NOSE = 4, 9, 9  # points of a section: on the hinged part, ahead of it, around its nose
_WEDGE = 0.15  # bulge of the face of the fixed part over half the thickness; a flat face would have no inside
_NOSE_FILLS = 0.9  # of the thickness at the hinge: the rounded nose of the hinged part


class Mesh(NamedTuple):
    """A closed surface.

    vertices : shape (n, 3), metres, body axes   triangles : shape (m, 3), counter-clockwise seen from outside
    normals : shape (n, 3), unit, outward; vertices are doubled where the surface has an edge
    """

    vertices: Array
    triangles: NDArray[np.uint32]
    normals: Array


class Section(NamedTuple):
    """An aerofoil of chord 1 with a hinge, as points (behind the leading edge, above the chord line).

    Each ring runs from the trailing edge over the top to the nose and back along the bottom.

    whole, fixed, hinged : shape (k, 2), the aerofoil, its part ahead of the hinge, and the hinged part
    axis : shape (2,), the hinge, midway between top and bottom
    """

    whole: Array
    fixed: Array
    hinged: Array
    axis: Array


def section(thickness: float, camber: float, hinge: float) -> Section:
    """NACA section cut at the fraction `hinge` of its chord.

    Thickness polynomial of the four-digit family with the closed trailing edge, a parabolic mean line highest at
    40 % (Abbott & von Doenhoff, Theory of Wing Sections, 1959, section 6.4).

    The fixed part ends in a face at the hinge; the hinged part has a round nose inside the fixed part, so that no gap
    opens at any deflection.
    """
    x_fore = hinge * (1.0 - np.sin(np.linspace(0.0, 0.5 * np.pi, _FORE)))  # denser at the nose
    fore = _heights(x_fore, thickness, camber)
    half = 0.5 * (fore[0][0] - fore[1][0])
    axis = np.array([hinge, fore[1][0] + half])
    ahead = np.vstack((np.column_stack((x_fore, fore[0])), np.column_stack((x_fore, fore[1]))[-2::-1]))

    def closed_by(over: Array, between: Array, under: Array) -> Array:
        return np.vstack((over, between, under[::-1]))

    def skin(x: Array) -> tuple[Array, Array]:
        top, bottom = _heights(x, thickness, camber)
        return np.column_stack((x, top)), np.column_stack((x, bottom))

    face = np.linspace([_WEDGE * half, 0.0], [0.0, half], _AFT)
    angle = np.linspace(0.5 * np.pi, 1.5 * np.pi, _NOSE)
    nose = _NOSE_FILLS * half * np.column_stack((np.cos(angle), np.sin(angle)))
    over, under = skin(np.linspace(1.0, hinge, _AFT))
    over_hinged, under_hinged = skin(np.linspace(1.0, hinge + _WEDGE * half, _AFT))
    return Section(
        whole=closed_by(over, ahead, under),
        fixed=closed_by(axis + face, ahead, axis + face * [1.0, -1.0]),
        hinged=closed_by(over_hinged, axis + nose, under_hinged),
        axis=axis,
    )


def _heights(x: Array, thickness: float, camber: float) -> tuple[Array, Array]:
    """Top and bottom of the unit section at the fractions `x` of the chord."""
    half = 5.0 * thickness * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    half[x == 1.0] = 0.0  # the coefficients sum to zero except for round-off
    p = 0.4
    ahead, behind = (2.0 * p * x - x**2) / p**2, (1.0 - 2.0 * p + 2.0 * p * x - x**2) / (1.0 - p) ** 2
    line = camber * np.where(x < p, ahead, behind)
    return line + half, line - half


def loft(rings: Array, *, closed: bool = False) -> Mesh:
    """Skin over `rings`, shape (s, k, 3), with flat ends.

    A duplicate ring makes an edge there, and so does a point duplicated in every ring.

    closed : the last point of a ring joins the first smoothly; if not, they coincide at a sharp trailing edge
    """
    s, k, _ = rings.shape
    grid = np.arange(s * k).reshape(s, k)
    if closed:
        grid = np.column_stack((grid, grid[:, 0]))
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    skin = np.concatenate((np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3)))
    n = k if closed else k - 1  # the ends are polygons of distinct points
    # Triangulate from the first point, top and bottom alternately, so that triangles stay inside a cambered section.
    zipped = []
    low, high = 0, n - 1
    while high - low >= 2:
        zipped.append((low, low + 1, high))
        low += 1
        if high - low >= 2:
            zipped.append((low, high - 1, high))
            high -= 1
    end = np.array(zipped)
    vertices = np.vstack((rings.reshape(-1, 3), rings[0, :n], rings[-1, :n]))
    return finished(vertices, np.vstack((skin, end + s * k, end[:, ::-1] + s * k + n)))


def signed_volume_m3(mesh: Mesh) -> float:
    """Volume inside a closed mesh (divergence theorem); negative if its triangles face inward."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def finished(vertices: Array, triangles: NDArray[np.int64]) -> Mesh:
    """Mesh without degenerate triangles or unused vertices, facing outward, with area-weighted normals."""
    corners = vertices[triangles]
    flat = np.any([np.all(corners[:, i] == corners[:, i - 1], axis=1) for i in range(3)], axis=0)
    used, index = np.unique(triangles[~flat], return_inverse=True)
    vertices = vertices[used]
    mesh = Mesh(vertices, index.reshape(-1, 3).astype(np.uint32), np.zeros_like(vertices))
    if signed_volume_m3(mesh) < 0.0:
        mesh = mesh._replace(triangles=np.ascontiguousarray(mesh.triangles[:, ::-1]))
    a, b, c = vertices[mesh.triangles].transpose(1, 0, 2)
    for corner in range(3):
        np.add.at(mesh.normals, mesh.triangles[:, corner], np.cross(b - a, c - a))
    return mesh._replace(normals=mesh.normals / np.linalg.norm(mesh.normals, axis=1, keepdims=True))
