"""The shape of an aeroplane: the checked ``[geometry]`` table of its airframe.toml, and derived quantities.

Body axes, origin at the centre of gravity: x forward, y right, z down, metres.
"""

import tomllib
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from estimator.interface import Array

SLENDER_FULLNESS = 0.55  # fuselage volume over its bounding box, of a model with pod and boom


@dataclass(frozen=True)
class Shape:
    """The outline; the wing consists of flat panels with a straight quarter chord.

    panel_y_m : (n + 1,) ends of the right wing's panels along the span, top view
    panel_chord_m : (n + 1,) chords there        panel_dihedral_deg : (n,) dihedral of each panel
    wing_x_m, wing_z_m : quarter chord of the root        tail_arm_m : back to the quarter chord of tail and fin
    fuselage_z_m : mid-height at the wing       tail_z_m : of the tailplane and the root of the fin
    aileron_y_m : (2,) ends of the right aileron, or empty
    elevator_part, rudder_part, aileron_part : fraction of the chord that moves; 0: none
    elevator_throw_deg, rudder_throw_deg, aileron_throw_deg : full deflection to one side
    """

    span_m: float
    panel_y_m: tuple[float, ...]
    panel_chord_m: tuple[float, ...]
    panel_dihedral_deg: tuple[float, ...]
    wing_x_m: float
    wing_z_m: float
    fuselage_length_m: float
    nose_x_m: float
    fuselage_height_m: float
    fuselage_width_m: float
    fuselage_z_m: float
    tail_arm_m: float
    tail_z_m: float
    tail_span_m: float
    tail_chord_m: float
    fin_height_m: float
    fin_chord_m: float
    elevator_part: float
    rudder_part: float
    aileron_part: float
    aileron_y_m: tuple[float, ...]
    elevator_throw_deg: float
    rudder_throw_deg: float
    propeller_diameter_m: float
    aileron_throw_deg: float = 0.0

    @classmethod
    def of(cls, airframe: Path) -> "Shape":
        """From an airframe.toml; ValueError if a key is missing or the panels are inconsistent."""
        table: dict[str, Any] = tomllib.loads(airframe.read_text(encoding="utf-8"))["geometry"]
        missing = [f.name for f in fields(cls) if f.name not in table and f.default is MISSING]
        if missing:
            raise ValueError(f"{airframe}: [geometry] lacks {', '.join(missing)}")
        values: dict[str, Any] = {f.name: table[f.name] for f in fields(cls) if f.name in table}
        values = {k: tuple(map(float, v)) if isinstance(v, list) else float(v) for k, v in values.items()}
        shape = cls(**values)
        y, n = shape.panel_y_m, len(shape.panel_dihedral_deg)
        if not (len(y) == len(shape.panel_chord_m) == n + 1 and y[0] == 0.0 and np.all(np.diff(y) > 0.0)):
            raise ValueError(
                f"{airframe}: panel_y_m {y} m must rise from 0, with as many chords and one dihedral fewer"
            )
        if abs(2.0 * y[-1] - shape.span_m) > 1e-9:
            raise ValueError(f"{airframe}: span_m {shape.span_m} m is not twice the last panel_y_m, {y[-1]} m")
        return shape

    @cached_property
    def wing_area_m2(self) -> float:
        """Area, top view."""
        c = np.array(self.panel_chord_m)
        return float(np.sum(np.diff(self.panel_y_m) * (c[1:] + c[:-1])))

    @property
    def chord_m(self) -> float:
        """Mean chord, reference length of the pitching moment."""
        return self.wing_area_m2 / self.span_m

    @property
    def aspect(self) -> float:
        return self.span_m**2 / self.wing_area_m2

    @property
    def tail_area_m2(self) -> float:
        return self.tail_span_m * self.tail_chord_m

    @property
    def tail_volume(self) -> float:
        return self.tail_area_m2 * self.tail_arm_m / (self.wing_area_m2 * self.chord_m)

    @cached_property
    def panel_rise_m(self) -> Array:
        """Height of the panel ends above the root, shape (n + 1,)."""
        rise = np.diff(self.panel_y_m) * np.tan(np.radians(self.panel_dihedral_deg))
        return np.concatenate(([0.0], np.cumsum(rise)))

    def chord_at(self, y_m: Array) -> Array:
        return np.interp(np.abs(y_m), self.panel_y_m, self.panel_chord_m)

    def rise_at(self, y_m: Array) -> Array:
        return np.interp(np.abs(y_m), self.panel_y_m, self.panel_rise_m)

    @property
    def fuselage_volume_m3(self) -> float:
        return SLENDER_FULLNESS * self.fuselage_length_m * self.fuselage_height_m * self.fuselage_width_m

    def touching_points(self) -> dict[str, tuple[float, float, float]]:
        """Ground contact points, body axes."""
        half = 0.5 * self.span_m
        tip = self.wing_z_m - float(self.panel_rise_m[-1])
        belly = self.fuselage_z_m + 0.5 * self.fuselage_height_m + 0.01
        tail = self.nose_x_m - self.fuselage_length_m
        return {
            "NOSE": (self.nose_x_m, 0.0, self.fuselage_z_m),
            "BELLY_FRONT": (0.5 * self.nose_x_m, 0.0, belly),
            "BELLY_REAR": (-0.25, 0.0, belly),
            "TAIL": (tail, 0.0, self.tail_z_m + 0.02),
            "FIN_TOP": (tail, 0.0, self.tail_z_m - self.fin_height_m),
            "LEFT_TIP": (self.wing_x_m, -half, tip),
            "RIGHT_TIP": (self.wing_x_m, half, tip),
        }
