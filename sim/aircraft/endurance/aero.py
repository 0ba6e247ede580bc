"""Aerodynamic coefficients of the aeroplane, worked out from its outline and a few stated figures.

Small angles: lifting-line and tail-volume formulas of the textbooks.  Large angles: the normal force of a flat
plate, faded in over the stall, so that every table is closed over +-180 degrees and flying backwards, tumbling
and mushing stay finite and plausible.

References
----------
Helmbold, H. B., "Der unverwundene Ellipsenfluegel als tragende Flaeche", Jahrbuch 1942 der Deutschen
Luftfahrtforschung, pp. I 111-113: lift slope of a wing of any aspect ratio.
Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, chapters 2, 3 and 5: tail volume, downwash, damping.
Beard, R. W. and McLain, T. W., "Small Unmanned Aircraft", 2012, Eqn 4.10: the blend over the stall.
Lindenburg, C., "Stall coefficients", ECN-RX--01-004, 2001: normal force of stalled finite plates.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from estimator.interface import Array

STRIP_3D = 0.62  # assumption: roll damping of a whole wing over that of its strips, each alone

END_PLATE = 1.55  # effective aspect ratio of a fin on a tailplane over its own (DATCOM 5.3.1.1, typical)


@dataclass(frozen=True)
class Outline:
    """Plan of the aeroplane, metres: the geometry table of airframe.toml, as far as the coefficients need it."""

    span_m: float
    root_chord_m: float
    tip_chord_m: float
    dihedral_deg: float
    wing_x_m: float
    tail_arm_m: float
    tail_span_m: float
    tail_chord_m: float
    fin_height_m: float
    fin_chord_m: float

    @property
    def wing_area_m2(self) -> float:
        return 0.5 * (self.root_chord_m + self.tip_chord_m) * self.span_m

    @property
    def chord_m(self) -> float:
        """Mean chord."""
        return self.wing_area_m2 / self.span_m

    @property
    def aspect(self) -> float:
        return self.span_m**2 / self.wing_area_m2


@dataclass(frozen=True)
class Figures:
    """What the outline does not say.  Every one is an assumption; PROVENANCE.md argues each."""

    cl_cruise: float = 0.38  # where the two cross derivatives that go with lift are taken
    cl_zero: float = 0.30  # lift at alpha = 0: cambered section and incidence
    stall_rad: float = float(np.radians(13.5))  # where half the wing has stalled
    stall_sharpness: float = 55.0  # 1 / rad, of the blend: attached to stalled within about 5 degrees
    cd_zero: float = 0.040  # whole aeroplane: wing, fuselage, tail, holes and gear stubs
    oswald: float = 0.80
    cm_zero: float = 0.0119  # trims the cruise with the elevator in line
    cm_alpha_fuselage: float = 0.15  # Multhopp's destabilising body
    plate_cd90_2d: float = 1.98  # flat plate across the flow (Hoerner 1965)
    cy_beta_fuselage: float = -0.12
    cn_beta_fuselage: float = -0.020
    cl_beta_high_wing: float = -0.025
    elevator_throw_rad: float = float(np.radians(20.0))
    elevator_tau: float = 0.55  # 45 % of the tail's chord moves
    rudder_throw_rad: float = float(np.radians(25.0))
    rudder_tau: float = 0.60
    aileron_roll: float = 0.105  # rolling moment at full aileron
    aileron_adverse: float = -0.006  # yawing moment at full aileron, against the roll
    aileron_stalled: float = 0.4  # part of it left on a stalled wing
    roll_rig: float = 0.000962  # wing warp that holds against the motor's torque in the cruise


def lift_slope(aspect: float) -> float:
    """Lift slope of a wing, 1/rad (Helmbold)."""
    return 2.0 * np.pi * aspect / (2.0 + np.sqrt(aspect**2 + 4.0))


def plate_normal(alpha_rad: ArrayLike, cd90_2d: float, aspect: float) -> Array:
    """Normal-force coefficient of a finite flat plate, odd in alpha, any alpha (Lindenburg 2001)."""
    s = np.sin(np.asarray(alpha_rad, float))
    return cd90_2d * s * (1.0 / (0.56 + 0.44 * np.abs(s)) - 0.41 * (1.0 - np.exp(-17.0 / aspect)))


@dataclass(frozen=True)
class Aero:
    """The coefficients; moments about the centre of gravity, lengths of reference the mean chord and the span."""

    outline: Outline
    figures: Figures = field(default_factory=Figures)

    @cached_property
    def wing_slope(self) -> float:
        return lift_slope(self.outline.aspect)

    @cached_property
    def tail_slope(self) -> float:
        return lift_slope(self.outline.tail_span_m / self.outline.tail_chord_m)

    @cached_property
    def tail_area(self) -> float:
        """Area of the tailplane over that of the wing."""
        return self.outline.tail_span_m * self.outline.tail_chord_m / self.outline.wing_area_m2

    @cached_property
    def tail_volume(self) -> float:
        return self.tail_area * self.outline.tail_arm_m / self.outline.chord_m

    @cached_property
    def downwash(self) -> float:
        """Change of downwash with alpha at the tail of an elliptic wing (Etkin & Reid, chapter 2)."""
        return 2.0 * self.wing_slope / (np.pi * self.outline.aspect)

    @cached_property
    def cl_alpha(self) -> float:
        return self.wing_slope + self.tail_slope * self.tail_area * (1.0 - self.downwash)

    @cached_property
    def cm_alpha(self) -> float:
        """Wing ahead, tail behind, fuselage (Etkin & Reid, chapter 2)."""
        wing = self.wing_slope * self.outline.wing_x_m / self.outline.chord_m
        return wing - self.tail_volume * self.tail_slope * (1.0 - self.downwash) + self.figures.cm_alpha_fuselage

    @cached_property
    def cm_q(self) -> float:
        """Pitch damping; the lag of the downwash (alpha-dot) is lumped in (Etkin & Reid, chapter 5)."""
        arm = self.outline.tail_arm_m / self.outline.chord_m
        return -2.0 * self.tail_volume * self.tail_slope * arm * (1.0 + self.downwash)

    @cached_property
    def cl_q(self) -> float:
        return 2.0 * self.tail_volume * self.tail_slope

    @cached_property
    def cl_elevator(self) -> float:
        """Lift of the tail at full elevator; trailing edge up, so the lift is downwards."""
        return -self.tail_slope * self.tail_area * self.figures.elevator_tau * self.figures.elevator_throw_rad

    @cached_property
    def cm_elevator(self) -> float:
        """Pitching moment at full elevator, nose up."""
        return -self.cl_elevator * self.outline.tail_arm_m / self.outline.chord_m

    @cached_property
    def _fin(self) -> tuple[float, float]:
        """Side-force slope of the fin on the wing's area, and its arm in spans; the tailplane acts as an end plate."""
        o = self.outline
        slope = lift_slope(END_PLATE * o.fin_height_m / o.fin_chord_m)
        return slope * o.fin_height_m * o.fin_chord_m / o.wing_area_m2, o.tail_arm_m / o.span_m

    @cached_property
    def cy_beta(self) -> float:
        return -self._fin[0] + self.figures.cy_beta_fuselage

    @cached_property
    def cn_beta(self) -> float:
        return self._fin[0] * self._fin[1] + self.figures.cn_beta_fuselage

    @cached_property
    def cn_r(self) -> float:
        """Yaw damping of the fin, and a little of the wing."""
        return -2.0 * self._fin[0] * self._fin[1] ** 2 - 0.01

    @cached_property
    def cn_rudder(self) -> float:
        """Yawing moment at full rudder, nose right."""
        return self._fin[0] * self._fin[1] * self.figures.rudder_tau * self.figures.rudder_throw_rad

    @cached_property
    def cy_rudder(self) -> float:
        return -self.cn_rudder / self._fin[1]

    @cached_property
    def cl_beta(self) -> float:
        """Dihedral: strips of a straight wing, thinned at the tips as in roll damping; and the high wing."""
        return -0.25 * self.wing_slope * np.radians(self.outline.dihedral_deg) * 0.85 + self.figures.cl_beta_high_wing

    @cached_property
    def cl_p(self) -> float:
        """Roll damping of an attached wing: its strips, each with the wing's slope, times STRIP_3D."""
        return -STRIP_3D * self.wing_slope / 6.0

    @cached_property
    def cl_r(self) -> float:
        """Rolling moment of yawing: the faster wing lifts more, cruise lift / 4; and the fin above the axis."""
        return 0.25 * self.figures.cl_cruise + 0.02

    @cached_property
    def cn_p(self) -> float:
        """Yawing moment of rolling: tilted lift, minus cruise lift / 8."""
        return -0.125 * self.figures.cl_cruise

    def stalled(self, alpha_rad: ArrayLike) -> Array:
        """How far the wing has stalled, 0..1: Beard & McLain, Eqn 4.10."""
        a, m, a0 = np.asarray(alpha_rad, float), self.figures.stall_sharpness, self.figures.stall_rad
        rising, falling = np.exp(np.clip(-m * (a - a0), -60, 60)), np.exp(np.clip(m * (a + a0), -60, 60))
        return (1.0 + rising + falling) / ((1.0 + rising) * (1.0 + falling))

    def lift_drag_pitch(self, alpha_rad: ArrayLike) -> tuple[Array, Array, Array]:
        """CL, CD, Cm of the whole aeroplane with surfaces in line, at any angle of attack."""
        a, f, o = np.asarray(alpha_rad, float), self.figures, self.outline
        s = self.stalled(a)
        cl = f.cl_zero + self.cl_alpha * a
        cd = f.cd_zero + cl**2 / (np.pi * o.aspect * f.oswald)
        cm = f.cm_zero + self.cm_alpha * a
        wing = plate_normal(a, f.plate_cd90_2d, o.aspect)
        tail = plate_normal(a, f.plate_cd90_2d, o.tail_span_m / o.tail_chord_m)
        normal = wing + self.tail_area * tail
        # A stalled wing's force acts near half its chord, the tail's at its arm; both pitch the nose down.
        cm_plate = -wing * (0.25 - o.wing_x_m / o.chord_m) - self.tail_volume * tail
        return (
            (1.0 - s) * cl + s * normal * np.cos(a),
            (1.0 - s) * cd + s * (f.cd_zero + normal * np.sin(a)),
            (1.0 - s) * cm + s * cm_plate,
        )

    def roll_shape(self, alpha_rad: ArrayLike) -> Array:
        """Roll damping (and dihedral effect) over their attached value, at any alpha, never below 0.

        A rolling wing changes the normal velocity w of its strips.  With w = V sin(alpha) at constant u, the
        force of a strip grows with w as ``2 sin(alpha) CN + cos(alpha) dCN/dalpha``; this falls below zero just
        past the stall (autorotation), where it is cut off at zero.
        """
        a = np.asarray(alpha_rad, float)
        h = 1e-4

        def normal(x: Array) -> Array:
            s = self.stalled(x)
            plate = plate_normal(x, self.figures.plate_cd90_2d, self.outline.aspect)
            return (1.0 - s) * (self.figures.cl_zero + self.wing_slope * x) + s * plate

        slope = 2.0 * np.sin(a) * normal(a) + np.cos(a) * (normal(a + h) - normal(a - h)) / (2.0 * h)
        return np.clip(slope / self.wing_slope, 0.0, 1.0)

    def aileron_shape(self, alpha_rad: ArrayLike) -> Array:
        """Aileron effect over its attached value: weak on a stalled wing, reversed flying backwards."""
        a = np.asarray(alpha_rad, float)
        return np.cos(a) * (1.0 - (1.0 - self.figures.aileron_stalled) * self.stalled(a))
