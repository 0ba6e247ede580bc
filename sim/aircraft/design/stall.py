"""The wing at any angle of attack, attached, stalled or as a flat plate, and its behaviour in roll.

Past the stall a descending strip loses lift: roll damping fades, reverses (autorotation) and returns once the whole
wing is stalled.  It is computed strip by strip for each angle of attack and helix angle ``p b / 2 V``, so that wing
drop and spin rate result from the model.

References
----------
Beard, R. W. and McLain, T. W., "Small Unmanned Aircraft", 2012, Eqn 4.10: the blend over the stall.
Lindenburg, C., "Stall coefficients", ECN-RX--01-004, 2001: normal force of stalled finite plates.
Glauert, H., "The Rotation of an Aerofoil about a Fixed Axis", ARC R&M 595, 1919: autorotation from strips.
Raymer, D. P., "Aircraft Design", Eqn 12.15: greatest lift of a wing is 0.9 of its section's.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq  # type: ignore[import-untyped]

from estimator.interface import Array
from sim.aircraft.design.lattice import Attached
from sim.aircraft.design.shape import Shape

WING_LIMIT = 0.9  # maximum lift of the wing over that of its section
STALL_SHARPNESS = 55.0  # 1 / rad: attached to stalled within about 5 degrees
PLATE_CD90 = 1.98  # normal force of a flat plate across the flow, in two dimensions (Hoerner 1965)
PLATE_SKIN = 0.02  # chordwise force of a stalled section: skin friction, no leading-edge suction
SMALL = 0.01  # helix angle of a derivative


def plate_normal(alpha_rad: ArrayLike, aspect: float) -> Array:
    """Normal-force coefficient of a finite flat plate, odd in alpha, any alpha (Lindenburg 2001)."""
    s = np.sin(np.asarray(alpha_rad, float))
    return PLATE_CD90 * s * (1.0 / (0.56 + 0.44 * np.abs(s)) - 0.41 * (1.0 - np.exp(-17.0 / aspect)))


@dataclass(frozen=True)
class Polars:
    """Coefficients of the whole aeroplane at all angles of attack.

    profile_deg, profile_cd : (n,) profile drag of the attached flow
    cd_extra, cd_lift : drag not in the outline; the second times CL^2
    section_limits : minimum and maximum lift coefficient of the wing section
    """

    shape: Shape
    attached: Attached
    profile_deg: Array
    profile_cd: Array
    cd_extra: float
    cd_lift: float
    section_limits: tuple[float, float]

    @cached_property
    def stall_rad(self) -> tuple[float, float]:
        """Angles with half the wing stalled, negative and positive, for a maximum lift 0.9 of the section's."""

        def excess(at: float, side: float, limit: float) -> float:
            a = np.linspace(0.0, at, 400) * side  # beyond it the plate dominates
            s = 1.0 / (1.0 + np.exp(np.clip(STALL_SHARPNESS * (at - side * a), -60.0, 60.0)))
            return float((side * self._wing_lift(a, s)).max()) - WING_LIMIT * abs(limit)

        low, high = self.section_limits
        below = brentq(excess, np.radians(2.0), np.radians(20.0), args=(-1.0, low))
        return -float(below), float(brentq(excess, np.radians(4.0), np.radians(24.0), args=(1.0, high)))

    def stalled(self, alpha_rad: ArrayLike) -> Array:
        """Stalled fraction of the wing, 0..1 (Beard & McLain, Eqn 4.10, with two stall angles)."""
        a, (low, high) = np.asarray(alpha_rad, float), self.stall_rad
        above = 1.0 / (1.0 + np.exp(np.clip(-STALL_SHARPNESS * (a - high), -60.0, 60.0)))
        below = 1.0 / (1.0 + np.exp(np.clip(STALL_SHARPNESS * (a - low), -60.0, 60.0)))
        return above + below - above * below

    def _wing_lift(self, a: Array, s: Array) -> Array:
        plate = plate_normal(a, self.shape.aspect)
        return (1.0 - s) * (self.attached.wing_cl_zero + self.attached.wing_cl_alpha * a) + s * plate * np.cos(a)

    def _profile(self, a: Array) -> Array:
        return np.interp(np.degrees(a), self.profile_deg, self.profile_cd) + self.cd_extra

    def lift_drag_pitch(self, alpha_rad: ArrayLike) -> tuple[Array, Array, Array]:
        """CL, CD, Cm of the whole aeroplane with neutral controls, at any angle of attack."""
        a, c, o = np.asarray(alpha_rad, float), self.attached, self.shape
        s = self.stalled(a)
        cl = c.cl_zero + c.cl_alpha * a
        cd = self._profile(a) + np.polyval(c.induced, cl) + self.cd_lift * cl**2
        cm = c.cm_zero + c.cm_alpha * a
        wing = plate_normal(a, o.aspect)
        tail = plate_normal(a, o.tail_span_m / o.tail_chord_m)
        normal = wing + o.tail_area_m2 / o.wing_area_m2 * tail
        # The force of a stalled wing acts near half chord, that of the tail at its arm; both pitch nose down.
        cm_plate = -wing * (0.25 - o.wing_x_m / o.chord_m) - o.tail_volume * tail
        floor = float(self._profile(np.zeros(1))[0])
        return (
            (1.0 - s) * cl + s * normal * np.cos(a),
            (1.0 - s) * cd + s * (floor + normal * np.sin(a)),
            (1.0 - s) * cm + s * cm_plate,
        )

    def _strip(self, a: Array) -> tuple[Array, Array]:
        """Normal and rearward force coefficients of a strip of the wing at the local angle `a`."""
        s = self.stalled(a)
        cl = self.attached.wing_cl_zero + self.attached.wing_cl_alpha * a
        cd = self._profile(a)
        normal = (1.0 - s) * (cl * np.cos(a) + cd * np.sin(a)) + s * plate_normal(a, self.shape.aspect)
        rearward = (1.0 - s) * (cd * np.cos(a) - cl * np.sin(a)) + s * PLATE_SKIN * np.cos(a)
        return normal, rearward

    def _strips(self, alpha_rad: float, p_hat: float, r_hat: float) -> Array:
        """Rolling and yawing moment coefficients (2,) of the wing turning at ``p b / 2 V`` and ``r b / 2 V``."""
        n = 240
        eta = (np.arange(n) + 0.5) * 2.0 / n - 1.0
        chord = self.shape.chord_at(0.5 * self.shape.span_m * eta)
        u, w = np.cos(alpha_rad) - r_hat * eta, np.sin(alpha_rad) + p_hat * eta
        normal, rearward = self._strip(np.arctan2(w, u))
        arm = 0.25 * self.shape.span_m / self.shape.wing_area_m2 * chord * (u * u + w * w) * eta * 2.0 / n
        return np.array([-np.sum(normal * arm), np.sum(rearward * arm)])

    @cached_property
    def _strip_scale(self) -> float:
        """Roll damping of the lattice over that of independent strips: the effect of the wing's own downwash."""
        return self.attached.roll_p / float(self._strips(0.0, SMALL, 0.0)[0] / SMALL)

    def rolling(self, alpha_rad: Array, helix: Array) -> tuple[Array, Array]:
        """Rolling and yawing moment per ``p b / 2 V``, each shape (alpha, helix); even in the helix angle.

        Attached, they are those of the lattice; the contribution of the tail is constant.
        """
        k = self._strip_scale
        found = np.array([[self._strips(a, h, 0.0) / h for h in np.maximum(helix, SMALL)] for a in alpha_rad])
        fixed = self.attached.yaw_p - k * self._strips(0.0, SMALL, 0.0)[1] / SMALL
        # The flow at the fin reverses when flying backwards.
        return k * found[:, :, 0], k * found[:, :, 1] + fixed * np.cos(alpha_rad)[:, None]

    def roll_of_yawing(self, alpha_rad: Array) -> Array:
        """Rolling moment per ``r b / 2 V``: the advancing wing lifts more, unless stalled."""
        k = self._strip_scale
        found = np.array([(self._strips(a, 0.0, SMALL) - self._strips(a, 0.0, -SMALL))[0] for a in alpha_rad])
        still = float((self._strips(0.0, 0.0, SMALL) - self._strips(0.0, 0.0, -SMALL))[0])
        return self.attached.roll_r + k * (found - still) / (2.0 * SMALL)

    def dihedral_shape(self, alpha_rad: ArrayLike) -> Array:
        """Dihedral effect over its attached value: the lift slope of a strip, at least 0.

        With w = V sin(alpha) at constant u, the force of a strip grows with w as
        ``2 sin(alpha) CN + cos(alpha) dCN/dalpha``.
        """
        a, h = np.asarray(alpha_rad, float), 1e-4
        slope = 2.0 * np.sin(a) * self._strip(a)[0]
        slope += np.cos(a) * (self._strip(a + h)[0] - self._strip(a - h)[0]) / (2.0 * h)
        return np.clip(slope / self.attached.wing_cl_alpha, 0.0, 1.0)

    def aileron_shape(self, alpha_rad: ArrayLike, left_stalled: float) -> Array:
        """Aileron effect over its attached value: weak on a stalled wing, reversed when flying backwards."""
        a = np.asarray(alpha_rad, float)
        return np.cos(a) * (1.0 - (1.0 - left_stalled) * self.stalled(a))
