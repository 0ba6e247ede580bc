"""The shape of an aeroplane for the eye, made from the few lengths of its ``[geometry]`` table.

A handful of closed lofts in body axes (x forward, y right, z down, origin at the centre of gravity): aerofoils
along the span, rounded sections along the fuselage, a thin disc for the propeller.  Physics never sees it.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array

KEYS = (
    "span_m", "root_chord_m", "tip_chord_m", "dihedral_deg", "wing_x_m", "wing_z_m",
    "fuselage_length_m", "nose_x_m", "fuselage_height_m", "fuselage_width_m",
    "tail_arm_m", "tail_span_m", "tail_chord_m", "fin_height_m", "fin_chord_m", "propeller_diameter_m",
)  # fmt: skip

# Along the fuselage, nose to tail: fraction of the length, of the width, of the height; and how far the
# centre line has risen, in half heights.
_FUSELAGE = np.array(
    [
        (0.000, 0.16, 0.13, 0.00),
        (0.010, 0.34, 0.28, 0.00),
        (0.035, 0.52, 0.44, 0.00),
        (0.070, 0.70, 0.62, 0.00),
        (0.140, 0.92, 0.82, 0.03),
        (0.230, 1.00, 1.00, 0.00),
        (0.340, 1.00, 1.00, 0.00),
        (0.450, 0.86, 0.86, 0.08),
        (0.600, 0.56, 0.57, 0.24),
        (0.800, 0.36, 0.36, 0.42),
        (0.960, 0.22, 0.24, 0.52),
        (1.000, 0.10, 0.12, 0.56),
    ]
)
_TIP = np.array([(0.0, 1.0), (0.45, 0.955), (0.75, 0.82), (0.93, 0.60), (1.0, 0.34)])  # outward, chord left


_AIRCRAFT = Path(__file__).parent / "aircraft"


class Mesh(NamedTuple):
    """A closed surface.

    vertices : shape (n, 3), metres, body axes   triangles : shape (m, 3), counter-clockwise seen from outside
    normals : shape (n, 3), unit, outward; vertices are doubled where the surface has an edge
    """

    vertices: Array
    triangles: NDArray[np.uint32]
    normals: Array


def geometry_of(aircraft: str) -> dict[str, float]:
    """The ``[geometry]`` table of the named aeroplane; ValueError where there is no such aeroplane."""
    path = _AIRCRAFT / aircraft / "airframe.toml"
    if not path.is_file():
        raise ValueError(f"no geometry of aircraft {aircraft!r}: there is no {path}")
    return dict(tomllib.loads(path.read_text(encoding="utf-8"))["geometry"])


def aeroplane(geometry: Mapping[str, float]) -> dict[str, Mesh]:
    """The parts of the aeroplane that `geometry` describes: wing, fuselage, tailplane, fin, propeller.

    Parameters
    ----------
    geometry    the ``[geometry]`` table of an ``airframe.toml``.  ``wing_x_m``, ``wing_z_m`` place the quarter
                chord of the wing root, ``tail_arm_m`` (positive aft) the quarter chord of tailplane and fin;
                the fuselage runs aft from ``nose_x_m``, where the propeller turns

    Raises
    ------
    ValueError    naming the key that is missing, or not a length
    """
    g = _checked(geometry)
    half_height = 0.5 * g["fuselage_height_m"]
    centre_z_m = float(np.clip(0.0, g["wing_z_m"] - half_height, g["wing_z_m"] + half_height))  # it carries the wing
    tail_x_m = -g["tail_arm_m"]
    from_nose = (g["nose_x_m"] - tail_x_m) / g["fuselage_length_m"]
    tail_z_m = centre_z_m - half_height * float(np.interp(from_nose, _FUSELAGE[:, 0], _FUSELAGE[:, 3]))
    half_span, tail_half_span = 0.5 * g["span_m"], 0.5 * g["tail_span_m"]
    return {
        "wing": _surface(
            (g["wing_x_m"], 0.0, g["wing_z_m"]), half_span, -half_span * np.tan(np.radians(g["dihedral_deg"])),
            g["root_chord_m"], g["tip_chord_m"], thickness=0.12, camber=0.03,
        ),
        "fuselage": _fuselage(g, centre_z_m),
        "tailplane": _surface(
            (tail_x_m, 0.0, tail_z_m), tail_half_span, 0.0,
            g["tail_chord_m"], 0.75 * g["tail_chord_m"], thickness=0.08,
        ),
        "fin": _fin((tail_x_m, 0.0, tail_z_m), g["fin_height_m"], g["fin_chord_m"]),
        "propeller": _disc((g["nose_x_m"], 0.0, centre_z_m), 0.5 * g["propeller_diameter_m"]),
    }  # fmt: skip


def signed_volume_m3(mesh: Mesh) -> float:
    """Volume inside a closed mesh (divergence theorem); negative where its triangles face inward."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def _checked(geometry: Mapping[str, float]) -> dict[str, float]:
    signed = ("dihedral_deg", "wing_x_m", "wing_z_m", "nose_x_m")
    found = {}
    for key in KEYS:
        if key not in geometry:
            raise ValueError(f"geometry lacks {key}")
        value = float(geometry[key])
        if not np.isfinite(value) or (key not in signed and value <= 0.0):
            raise ValueError(f"geometry {key} = {value:g} is not a length in metres above 0")
        found[key] = value
    return found


def _aerofoil(thickness: float, camber: float, n: int = 11) -> Array:
    """Unit-chord NACA section, shape (2 n - 1, 2): (aft of the quarter chord, up); trailing edge, top, nose, bottom.

    Thickness polynomial of the NACA four-digit family with the closed trailing edge, a parabolic mean line
    highest at 40 % (Abbott & von Doenhoff, Theory of Wing Sections, 1959, section 6.4).
    """
    x = 0.5 * (1.0 + np.cos(np.linspace(0.0, np.pi, n)))
    t = 5.0 * thickness * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    m, p = camber, 0.4
    line = np.where(x < p, m / p**2 * (2.0 * p * x - x**2), m / (1.0 - p) ** 2 * (1.0 - 2.0 * p + 2.0 * p * x - x**2))
    top, bottom = np.column_stack((x - 0.25, line + t)), np.column_stack((x - 0.25, line - t))
    return np.vstack((top, bottom[-2::-1]))


def _surface(
    root_e_m: tuple[float, float, float],
    half_span_m: float,
    tip_rise_m: float,
    root_chord_m: float,
    tip_chord_m: float,
    *,
    thickness: float,
    camber: float = 0.0,
) -> Mesh:
    """Wing or tailplane, tip to tip, straight at the quarter chord, with rounded tips."""
    round_from = max(1.0 - 0.6 * tip_chord_m / half_span_m, 0.6)
    out = np.concatenate(([0.0, 0.5], round_from + (1.0 - round_from) * _TIP[:, 0]))
    chord = root_chord_m + (tip_chord_m - root_chord_m) * out
    chord[2:] *= _TIP[:, 1]
    section = _aerofoil(thickness, camber)
    rings = []
    for side, fractions in ((-1.0, range(len(out) - 1, 0, -1)), (1.0, range(len(out)))):
        for i in fractions:
            x_m = root_e_m[0] - chord[i] * section[:, 0]
            y_m = np.full(len(section), side * out[i] * half_span_m)
            z_m = root_e_m[2] + tip_rise_m * out[i] - chord[i] * section[:, 1]
            rings.append(np.column_stack((x_m, y_m, z_m)))
    return _loft(np.array(rings))


def _fin(root_m: tuple[float, float, float], height_m: float, chord_m: float) -> Mesh:
    """Fin, upright from the tail's centre line, trailing edge straight, rounded at the top."""
    up = np.concatenate(([0.0, 0.4], 0.6 + 0.4 * _TIP[:, 0]))
    chord = chord_m * (1.0 - 0.35 * up)
    chord[2:] *= _TIP[:, 1]
    section = _aerofoil(0.08, 0.0)
    trailing_x_m = root_m[0] - 0.75 * chord_m
    rings = []
    for u, c in zip(up, chord, strict=True):
        x_m, y_m = trailing_x_m + c * (0.75 - section[:, 0]), c * section[:, 1]
        rings.append(np.column_stack((x_m, y_m, np.full(len(section), root_m[2] - u * height_m))))
    return _loft(np.array(rings))


def _fuselage(g: Mapping[str, float], centre_z_m: float) -> Mesh:
    """Fuselage of rounded sections (superellipses of exponent 2.5), its ends closed flat."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)  # a multiple of 4: the extremes are vertices
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.8
    down = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.8
    across[np.abs(across) < 1e-9], down[np.abs(down) < 1e-9] = 0.0, 0.0
    half_width, half_height = 0.5 * g["fuselage_width_m"], 0.5 * g["fuselage_height_m"]
    rings = []
    for x, width, height, rise in _FUSELAGE:
        x_m = np.full(len(angle), g["nose_x_m"] - x * g["fuselage_length_m"])
        z_m = centre_z_m + half_height * (height * down - rise)
        rings.append(np.column_stack((x_m, half_width * width * across, z_m)))
    return _loft(np.array(rings), closed=True)


def _disc(centre_m: tuple[float, float, float], radius_m: float) -> Mesh:
    """Propeller disc: two very flat cones, rim to rim."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    rim = np.column_stack((np.zeros(48), radius_m * np.cos(angle), radius_m * np.sin(angle)))
    hub = np.array([[0.01 * radius_m, 0.0, 0.0]])
    here = np.arange(48)
    fan = np.column_stack((np.zeros(48, int), 1 + here, 1 + np.roll(here, -1)))
    vertices = np.vstack((hub, rim, -hub, rim)) + np.array(centre_m)
    return _finished(vertices, np.vstack((fan, fan[:, ::-1] + 49)))


def _loft(rings: Array, *, closed: bool = False) -> Mesh:
    """Skin over `rings`, shape (s, k, 3), and flat ends.

    closed : the ring's last point joins its first smoothly; else the two coincide, at a sharp trailing edge
    """
    s, k, _ = rings.shape
    grid = np.arange(s * k).reshape(s, k)
    if closed:
        grid = np.column_stack((grid, grid[:, 0]))
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    skin = np.concatenate((np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3)))
    n = k if closed else k - 1  # the ends are polygons of distinct points
    # Zip the polygon from its first point: top and bottom in turn, so that a cambered section stays inside itself.
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
    return _finished(vertices, np.vstack((skin, end + s * k, end[:, ::-1] + s * k + n)))


def _finished(vertices: Array, triangles: NDArray[np.int64]) -> Mesh:
    """Mesh with its triangles turned outward, and area-weighted normals."""
    mesh = Mesh(vertices, triangles.astype(np.uint32), np.zeros_like(vertices))
    if signed_volume_m3(mesh) < 0.0:
        mesh = mesh._replace(triangles=np.ascontiguousarray(mesh.triangles[:, ::-1]))
    a, b, c = vertices[mesh.triangles].transpose(1, 0, 2)
    for corner in range(3):
        np.add.at(mesh.normals, mesh.triangles[:, corner], np.cross(b - a, c - a))
    return mesh._replace(normals=mesh.normals / np.linalg.norm(mesh.normals, axis=1, keepdims=True))
