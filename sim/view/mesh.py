"""The drawn shape of an aeroplane, from the ``[geometry]`` table of its ``airframe.toml``; not used by the physics.

Closed lofts in body axes (x forward, y right, z down, origin at the centre of gravity): aerofoils along the span,
rounded sections along the fuselage, a thin disc for the propeller.  Ailerons, elevator and rudder are separate parts
that turn about their hinge lines.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from estimator.interface import Array
from sim.view.fuselage import canopy, disc, fuselage, spinner
from sim.view.loft import Mesh, Section, loft, section

KEYS = (
    "wing_x_m", "wing_z_m", "fuselage_length_m", "nose_x_m", "fuselage_height_m", "fuselage_width_m",
    "tail_arm_m", "tail_span_m", "tail_chord_m", "fin_height_m", "fin_chord_m", "propeller_diameter_m",
)  # fmt: skip
STRAIGHT_WING = ("span_m", "root_chord_m", "tip_chord_m", "dihedral_deg")
PANELS = ("panel_y_m", "panel_chord_m", "panel_dihedral_deg")
THROW_DEG = 25.0  # of a control surface at full deflection, if the geometry has no <control>_throw_deg

# Defaults: fraction of the chord that moves, and ends of the ailerons as fractions of the half span.
_PART = {"aileron": 0.24, "elevator": 0.40, "rudder": 0.45}
_AILERON_SPAN = (0.54, 0.92)

_TIP = np.array([(0.0, 1.0), (0.45, 0.955), (0.75, 0.82), (0.93, 0.60), (1.0, 0.34)])  # outward, chord left
_SOFT_TIP = np.array([(0.0, 1.0), (0.5, 0.96), (0.8, 0.87), (0.95, 0.74), (1.0, 0.60)])  # of tailplane and fin
_CLEAR_M = 0.0025  # gap beside the ends of a control surface
_RUDDER_FOOT = 0.16  # fraction of the fin height below the rudder, for the elevator to move

_AIRCRAFT = Path(__file__).parents[1] / "aircraft"


class Hinge(NamedTuple):
    """The hinge of a control surface.

    control : column of the log, -1..1     throw_rad : deflection at 1
    point_m : shape (3,), on the hinge line     axis : shape (3,), unit, along it; the part turns about it, right-handed
    """

    control: str
    throw_rad: float
    point_m: Array
    axis: Array

    def pose(self, deflection: Array) -> tuple[Array, Array]:
        """Pose at deflections of shape (n,): translations (n, 3) and quaternions (n, 4), scalar last.

        Rotation about a line through p displaces the origin by p - R p (Rodrigues' formula for R p).
        """
        angle = self.throw_rad * np.asarray(deflection, np.float64)[:, None]
        p, k = self.point_m, self.axis
        across = p - k * (k @ p)
        translation = across * (1.0 - np.cos(angle)) - np.cross(k, p) * np.sin(angle)
        return translation, np.hstack((k * np.sin(0.5 * angle), np.cos(0.5 * angle)))


class Part(NamedTuple):
    """A part of the aeroplane; `hinge` is None if it is fixed."""

    mesh: Mesh
    hinge: Hinge | None = None


def geometry_of(aircraft: str) -> dict[str, Any]:
    """The ``[geometry]`` table of the named aeroplane; ValueError if there is no such aeroplane."""
    path = _AIRCRAFT / aircraft / "airframe.toml"
    if not path.is_file():
        raise ValueError(f"no geometry of aircraft {aircraft!r}: {path} does not exist")
    return dict(tomllib.loads(path.read_text(encoding="utf-8"))["geometry"])


def aeroplane(geometry: Mapping[str, Any]) -> dict[str, Part]:
    """The parts of the aeroplane described by `geometry`, by name; left and right ones are separate.

    Parameters
    ----------
    geometry    the ``[geometry]`` table of an ``airframe.toml``.  ``wing_x_m``, ``wing_z_m`` place the quarter
                chord of the wing root, ``tail_arm_m`` (positive aft) that of tailplane and fin, ``tail_z_m`` the
                height of both; the fuselage, centred at ``fuselage_z_m``, extends aft from ``nose_x_m``, the
                position of the propeller.  The wing is straight (``span_m``, ``root_chord_m``, ``tip_chord_m``,
                ``dihedral_deg``) or made of panels (``panel_y_m`` and ``panel_chord_m`` at their ends, root first,
                ``panel_dihedral_deg`` of each).  ``aileron_part``, ``elevator_part``, ``rudder_part`` are the
                fractions of the chord that move, by up to ``aileron_throw_deg`` and so on; ``aileron_y_m`` are the
                ends of the right aileron.  A part of 0 means no such control, a diameter of 0 no propeller

    Raises
    ------
    ValueError    naming the key that is missing, or what is wrong with its value
    """
    g = _checked(geometry)
    half_height = 0.5 * g["fuselage_height_m"]
    # By default the fuselage carries the wing.
    carries_z_m = float(np.clip(0.0, g["wing_z_m"] - half_height, g["wing_z_m"] + half_height))
    centre_z_m = float(geometry.get("fuselage_z_m", carries_z_m))
    tail_z_m = float(geometry.get("tail_z_m", centre_z_m - 0.5 * half_height))
    parts = {
        **_wing(g, _panels(geometry), geometry),
        "fuselage": Part(fuselage(g, centre_z_m, tail_z_m)),
        "canopy": Part(canopy(g, centre_z_m)),
        **_tailplane(g, tail_z_m, geometry),
        **_fin(g, tail_z_m, geometry),
    }
    radius_m = 0.5 * g["propeller_diameter_m"]
    if radius_m > 0.0:
        parts["spinner"] = Part(spinner((g["nose_x_m"], 0.0, centre_z_m), 0.16 * radius_m))
        parts["propeller"] = Part(disc((g["nose_x_m"], 0.0, centre_z_m), radius_m))
    return parts


def _checked(geometry: Mapping[str, Any]) -> dict[str, float]:
    """The lengths and angles required for every aeroplane."""
    return {key: _length(geometry, key) for key in KEYS}


def _length(geometry: Mapping[str, Any], key: str) -> float:
    if key not in geometry:
        raise ValueError(f"geometry lacks {key}")
    value = float(geometry[key])
    signed = key in ("dihedral_deg", "wing_x_m", "wing_z_m", "nose_x_m")
    least = "0 or more" if key == "propeller_diameter_m" else "above 0"
    if not np.isfinite(value) or (not signed and (value < 0.0 or (value == 0.0 and least == "above 0"))):
        raise ValueError(f"geometry {key} = {value:g} is not a length in metres, {least}")
    return value


def _panels(geometry: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    """The right wing's panels: span, chord and rise at their ends, each shape (n + 1,), root first."""
    if PANELS[0] in geometry:
        missing = [key for key in PANELS if key not in geometry]
        if missing:
            raise ValueError(f"geometry lacks {missing[0]}")
        y_m, chord_m, dihedral_deg = (np.array(geometry[key], np.float64) for key in PANELS)
    else:
        span_m, root_m, tip_m, dihedral = (_length(geometry, key) for key in STRAIGHT_WING)
        y_m, chord_m, dihedral_deg = np.array([0.0, 0.5 * span_m]), np.array([root_m, tip_m]), np.array([dihedral])
    fit = len(y_m) == len(chord_m) == len(dihedral_deg) + 1 >= 2
    if not (fit and y_m[0] == 0.0 and np.all(np.diff(y_m) > 0.0) and np.all(chord_m > 0.0)):
        raise ValueError(
            f"geometry panel_y_m = {y_m.tolist()} m must rise from 0, with as many chords above 0 "
            "and one dihedral fewer"
        )
    rise_m = np.concatenate(([0.0], np.cumsum(np.diff(y_m) * np.tan(np.radians(dihedral_deg)))))
    return y_m, chord_m, rise_m


class _Blade(NamedTuple):
    """Half a wing or tailplane, or a fin: sections at the fractions `t` from root to tip.

    points_m : shape (n, 3), of the fraction `pivot` of the chord     chord_m : shape (n,)
    lift : shape (3,), direction of positive section heights          creases : fractions with an edge
    """

    t: Array
    points_m: Array
    chord_m: Array
    section: Section
    pivot: float
    lift: Array
    creases: tuple[float, ...] = ()

    def at(self, t: Array, profile: Array) -> Array:
        """`profile`, shape (k, 2), at the fractions `t`, shape (n,), as points of the body, shape (n, k, 3)."""
        point_m = np.column_stack([np.interp(t, self.t, self.points_m[:, i]) for i in range(3)])
        chord_m = np.interp(t, self.t, self.chord_m)[:, None, None]
        forward = np.outer(self.pivot - profile[:, 0], [1.0, 0.0, 0.0])
        return point_m[:, None, :] + chord_m * (forward + np.outer(profile[:, 1], self.lift))

    def fixed(self, cut: tuple[float, float] | None) -> Array:
        """Rings of the fixed part, root to tip; without the hinged part between the fractions of `cut`."""
        s = self.section
        start, end = cut or (2.0, 2.0)
        rings = []
        for t in np.unique(np.concatenate((self.t, [f for f in (start, end) if f <= 1.0]))):
            whole, hollow = (self.at(np.array([t]), p) for p in (s.whole, s.fixed))
            if t == start:
                rings += [whole, whole, hollow, hollow]  # twice each, for an edge
            elif t == end and t < 1.0:
                rings += [hollow, hollow, whole, whole]
            else:
                rings += [hollow if start < t <= end else whole] * (2 if t in self.creases else 1)
        return np.concatenate(rings)

    def hinged(self, control: str, cut: tuple[float, float], sign: float, throw_rad: float) -> Part:
        """The moving part between the fractions of `cut`; `sign` of the rotation about the line from root to tip."""
        length_m = float(np.linalg.norm(self.points_m[-1] - self.points_m[0]))
        clear = _CLEAR_M / length_m
        start, end = cut[0] + clear, cut[1] - (clear if cut[1] < 1.0 else 0.0)
        inner = self.t[(self.t > start) & (self.t < end)]
        rings = self.at(np.concatenate(([start], inner, [end])), self.section.hinged)
        line = self.at(np.array(cut), self.section.axis[None])[:, 0]
        along = line[1] - line[0]
        return Part(loft(rings), Hinge(control, throw_rad, line[0], sign * along / np.linalg.norm(along)))

    def mirrored(self) -> "_Blade":
        """The mirror image on the other side."""
        return self._replace(points_m=self.points_m * [1.0, -1.0, 1.0])


def _controlled(geometry: Mapping[str, Any], control: str) -> tuple[float, float]:
    """Fraction of the chord that moves with a control, and its deflection at 1, radians."""
    part = float(geometry.get(f"{control}_part", _PART[control]))
    throw_deg = float(geometry.get(f"{control}_throw_deg", THROW_DEG))
    if not 0.0 <= part <= 0.8:
        raise ValueError(f"geometry {control}_part = {part:g} is not a fraction of the chord from 0 to 0.8")
    if part > 0.0 and not 0.0 < throw_deg < 90.0:
        raise ValueError(f"geometry {control}_throw_deg = {throw_deg:g} is not an angle between 0 and 90 deg")
    return part, float(np.radians(throw_deg))


def _wing(g: Mapping[str, float], panels: tuple[Array, Array, Array], geometry: Mapping[str, Any]) -> dict[str, Part]:
    """Wing, tip to tip, panels with straight quarter chord, rounded tips; ailerons if it has them."""
    y_m, chord_m, rise_m = panels
    joints = y_m / y_m[-1]
    round_from = max(1.0 - 0.6 * chord_m[-1] / y_m[-1], 0.5 + 0.5 * joints[-2])
    t = np.concatenate((joints[:-1], round_from + (1.0 - round_from) * _TIP[:, 0]))
    chord = np.interp(t, joints, chord_m)
    chord[len(joints) - 1 :] *= _TIP[:, 1]
    points = np.column_stack(
        (np.full(len(t), g["wing_x_m"]), t * y_m[-1], g["wing_z_m"] - np.interp(t, joints, rise_m))
    )
    part, throw_rad = _controlled(geometry, "aileron")
    profile = section(0.11, 0.03, 1.0 - (part or _PART["aileron"]))
    right = _Blade(t, points, chord, profile, 0.25, np.array([0.0, 0.0, -1.0]), tuple(joints[1:-1]))
    if part == 0.0:
        return {"wing": Part(loft(_both(right, None)))}
    span = np.array(geometry.get("aileron_y_m", np.multiply(_AILERON_SPAN, y_m[-1])), np.float64)
    if span.shape != (2,) or not 0.0 < span[0] < span[1] < y_m[-1]:
        raise ValueError(f"geometry aileron_y_m = {span.tolist()} m must be two positions between 0 and {y_m[-1]:g} m")
    cut = float(span[0] / y_m[-1]), float(span[1] / y_m[-1])
    return {
        "wing": Part(loft(_both(right, cut))),
        "aileron_right": right.hinged("aileron", cut, -1.0, throw_rad),  # up, while the left one goes down
        "aileron_left": right.mirrored().hinged("aileron", cut, -1.0, throw_rad),
    }


def _both(right: _Blade, cut: tuple[float, float] | None) -> Array:
    """Rings of the fixed part from left tip to right tip, with an edge in the middle."""
    rings = right.fixed(cut)
    return np.concatenate((rings[::-1] * [1.0, -1.0, 1.0], rings))


def _tapered(
    root_e_m: Array, tip_e_m: Array, chord_m: float, taper: float, part: float, default: float, lift: tuple[float, ...]
) -> _Blade:
    """A blade from root to tip with a straight hinge line and rounded tip."""
    t = np.concatenate(([0.0], 0.55 + 0.45 * _SOFT_TIP[:, 0]))
    chord = chord_m * (1.0 + (taper - 1.0) * t)
    chord[1:] *= _SOFT_TIP[:, 1]
    hinge = 1.0 - (part or default)
    points = root_e_m + t[:, None] * (tip_e_m - root_e_m) + [chord_m * (0.25 - hinge), 0.0, 0.0]
    return _Blade(t, points, chord, section(0.08, 0.0, hinge), hinge, np.array(lift))


def _tailplane(g: Mapping[str, float], tail_z_m: float, geometry: Mapping[str, Any]) -> dict[str, Part]:
    """Tailplane and the two halves of the elevator."""
    part, throw_rad = _controlled(geometry, "elevator")
    root = np.array([-g["tail_arm_m"], 0.0, tail_z_m])
    tip = root + np.array([0.0, 0.5 * g["tail_span_m"], 0.0])
    right = _tapered(root, tip, g["tail_chord_m"], 0.92, part, _PART["elevator"], (0.0, 0.0, -1.0))
    if part == 0.0:
        return {"tailplane": Part(loft(_both(right, None)))}
    cut = max(0.02, 0.2 * g["fuselage_width_m"]) / (0.5 * g["tail_span_m"]), 1.0
    return {
        "tailplane": Part(loft(_both(right, cut))),
        "elevator_right": right.hinged("elevator", cut, -1.0, throw_rad),
        "elevator_left": right.mirrored().hinged("elevator", cut, 1.0, throw_rad),
    }


def _fin(g: Mapping[str, float], tail_z_m: float, geometry: Mapping[str, Any]) -> dict[str, Part]:
    """Fin and rudder."""
    part, throw_rad = _controlled(geometry, "rudder")
    root = np.array([-g["tail_arm_m"], 0.0, tail_z_m])
    blade = _tapered(
        root, root - [0.0, 0.0, g["fin_height_m"]], g["fin_chord_m"], 0.72, part, _PART["rudder"], (0.0, 1.0, 0.0)
    )
    if part == 0.0:
        return {"fin": Part(loft(blade.fixed(None)))}
    cut = _RUDDER_FOOT, 1.0
    return {"fin": Part(loft(blade.fixed(cut))), "rudder": blade.hinged("rudder", cut, 1.0, throw_rad)}
