"""Coefficients of the attached flow from the shape, by AeroSandbox, which is needed only to rebuild a model.

Slopes, damping and control effects come from a vortex lattice of wing, tailplane and fin, with the tail in the
downwash of the wing; profile drag and section stall from `AeroBuildup` with NeuralFoil polars at the Reynolds number
of the cruise.  The fuselage is added by slender-body theory.

References
----------
Drela, M., "Flight Vehicle Aerodynamics", 2014, chapter 6: the vortex lattice.
Sharpe, P., "AeroSandbox", MIT thesis, 2021; "NeuralFoil", MIT thesis, 2024.
Glauert, H., "The Elements of Aerofoil and Airscrew Theory", 2nd ed., 1947, chapter X: hinged flaps.
Munk, M., "The Aerodynamic Forces on Airship Hulls", NACA TR-184, 1924: moment of a slender body.
Hoak, D. E., "USAF Stability and Control DATCOM", 1978, sections 5.2.1.1 and 5.2.2.1: side force of the body,
effect of the wing's height on the dihedral effect.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from estimator.interface import Array
from sim.aircraft.design.shape import Shape

MUNK = 0.9  # k2 - k1 of a body of fineness ratio 9 (NACA TR-184)
BODY_SIDE = 1.5  # K_i of DATCOM figure 5.2.1.1-7: wing high on the body
SPANWISE, CHORDWISE = 7, 5  # panels per section of a surface, and along the chord
STEP_DEG = 1.0  # of finite differences
RATE = 0.02  # of finite differences: angle at the wing tip or over half the chord
NARROW_M = 0.01  # width over which the aileron deflection starts and ends


@dataclass(frozen=True)
class Sections:
    """Aerofoils, by their names in the UIUC database, and incidences."""

    wing: str
    tail: str
    tail_incidence_deg: float
    wing_incidence_deg: float = 0.0


@dataclass(frozen=True)
class Attached:
    """Coefficients per radian (of angle, of p b / 2 V, q c / 2 V, r b / 2 V); named by effect and cause.

    Moments about the centre of gravity in body axes, on the wing's area, mean chord and span.
    """

    cl_zero: float
    cl_alpha: float
    cm_zero: float
    cm_alpha: float
    wing_cl_zero: float
    wing_cl_alpha: float
    tail_alpha: float  # contribution of the tailplane, in the downwash, to cl_alpha
    tail_incidence: float  # lift per radian of incidence of the tailplane
    downwash: float
    induced: tuple[float, float, float]  # drag of lift: coefficients of CL^2, CL, 1
    cl_q: float
    cm_q: float
    cy_beta: float
    roll_beta: float
    yaw_beta: float
    fin_yaw_beta: float  # the fin's part of yaw_beta
    cy_p: float
    cy_r: float
    roll_p: float
    yaw_p: float
    roll_r: float
    yaw_r: float
    fin_yaw_r: float  # the fin's part of yaw_r
    cy_rudder: float
    roll_rudder: float
    yaw_rudder: float
    roll_aileron: float
    yaw_aileron: float
    cl_elevator: float
    cm_elevator: float


def flap_effectiveness(part: float) -> float:
    """Change of zero-lift angle over deflection of a plain flap of `part` of the chord (Glauert, chapter X)."""
    if part <= 0.0:
        return 0.0
    theta = np.arccos(2.0 * min(part, 1.0) - 1.0)
    return float(1.0 - (theta - np.sin(theta)) / np.pi)


def _aerosandbox() -> Any:
    try:
        import aerosandbox
    except ImportError as missing:
        raise ImportError(
            "rebuilding an aircraft model requires AeroSandbox: pip install --group dev, or pip install aerosandbox"
        ) from missing
    return aerosandbox


class Lattice:
    """The aeroplane in AeroSandbox.

    Parameters
    ----------
    shape, sections         the aeroplane
    airspeed_m_s            of the cruise, for the Reynolds number
    alpha_rad               angle of attack of the linearisation
    """

    def __init__(self, shape: Shape, sections: Sections, airspeed_m_s: float, alpha_rad: float) -> None:
        self.asb = _aerosandbox()
        self.shape, self.sections = shape, sections
        self.airspeed_m_s, self.alpha_deg = airspeed_m_s, float(np.degrees(alpha_rad))

    def _wing(self, twist_deg: float) -> Any:
        """Tip to tip; `twist_deg` is added to the incidence along the right (+) and left (-) aileron."""
        s, asb = self.shape, self.asb
        stations, (inner, outer) = set(s.panel_y_m), (np.inf, np.inf)
        if twist_deg:
            inner, outer = s.aileron_y_m
            stations |= {inner, inner + NARROW_M, outer, outer + NARROW_M}
        stations_m = sorted(stations)
        airfoil = asb.Airfoil(self.sections.wing)
        sections = []
        for y in [-y for y in stations_m[:0:-1]] + stations_m:
            along = inner < abs(y) <= outer
            chord = float(s.chord_at(np.array(y)))
            sections.append(
                asb.WingXSec(
                    xyz_le=[-s.wing_x_m - 0.25 * chord, y, float(s.rise_at(np.array(y))) - s.wing_z_m],
                    chord=chord,
                    twist=self.sections.wing_incidence_deg + np.sign(y) * twist_deg * along,
                    airfoil=airfoil,
                )
            )
        return asb.Wing(name="wing", xsecs=sections)

    def _tail(self, twist_deg: float) -> Any:
        s, half = self.shape, 0.5 * self.shape.tail_span_m
        return self._plate(
            "tailplane", [(s.tail_arm_m - 0.25 * s.tail_chord_m, y, -s.tail_z_m) for y in (-half, 0.0, half)],
            s.tail_chord_m, self.sections.tail_incidence_deg + twist_deg,
        )  # fmt: skip

    def _fin(self, twist_deg: float) -> Any:
        s = self.shape
        x = s.tail_arm_m - 0.25 * s.fin_chord_m
        return self._plate("fin", [(x, 0.0, -s.tail_z_m + h) for h in (0.0, s.fin_height_m)], s.fin_chord_m, twist_deg)

    def _plate(self, name: str, edge: list[tuple[float, float, float]], chord_m: float, twist_deg: float) -> Any:
        airfoil = self.asb.Airfoil(self.sections.tail)
        sections = [self.asb.WingXSec(xyz_le=list(at), chord=chord_m, twist=twist_deg, airfoil=airfoil) for at in edge]
        return self.asb.Wing(name=name, xsecs=sections)

    def _fuselage(self) -> Any:
        s, asb = self.shape, self.asb
        along = np.array([0.0, 0.03, 0.12, 0.3, 0.45, 0.7, 1.0])
        width = np.array([0.3, 0.6, 0.9, 1.0, 0.85, 0.45, 0.2])
        return asb.Fuselage(
            name="fuselage",
            xsecs=[
                asb.FuselageXSec(
                    xyz_c=[-s.nose_x_m + a * s.fuselage_length_m, 0.0, 0.0],
                    width=w * s.fuselage_width_m, height=w * s.fuselage_height_m, shape=4.0,
                )
                for a, w in zip(along, width, strict=True)
            ],
        )  # fmt: skip

    def _airplane(self, wings: list[Any], fuselages: list[Any] | None = None) -> Any:
        s = self.shape
        return self.asb.Airplane(
            wings=wings, fuselages=fuselages or [], xyz_ref=[0.0, 0.0, 0.0],
            s_ref=s.wing_area_m2, c_ref=s.chord_m, b_ref=s.span_m,
        )  # fmt: skip

    def run(
        self, alpha_deg: float | None = None, beta_deg: float = 0.0, rates: tuple[float, float, float] = (0, 0, 0),
        tail_deg: float | None = 0.0, fin_deg: float | None = 0.0, aileron_deg: float = 0.0, wing: bool = True,
    ) -> Array:  # fmt: skip
        """CL, CD, CY, Cl, Cm, Cn of the lattice; rates p b / 2 V, q c / 2 V, r b / 2 V; None removes a surface."""
        wings = [self._wing(aileron_deg)] if wing else []
        if tail_deg is not None:
            wings.append(self._tail(tail_deg))
        if fin_deg is not None:
            wings.append(self._fin(fin_deg))
        s, v2 = self.shape, 2.0 * self.airspeed_m_s
        found = self.asb.VortexLatticeMethod(
            airplane=self._airplane(wings),
            op_point=self.asb.OperatingPoint(
                velocity=self.airspeed_m_s, alpha=self.alpha_deg if alpha_deg is None else alpha_deg, beta=beta_deg,
                p=rates[0] * v2 / s.span_m, q=rates[1] * v2 / s.chord_m, r=rates[2] * v2 / s.span_m,
            ),
            spanwise_resolution=SPANWISE, chordwise_resolution=CHORDWISE,
        ).run()  # fmt: skip
        return np.array([float(found[k]) for k in ("CL", "CD", "CY", "Cl", "Cm", "Cn")])

    def _lateral(self, step: float, **disturbed: Any) -> tuple[Array, Array]:
        """Derivatives of the whole aeroplane and of the fin alone.

        The fin is computed with the tailplane but without the wing, whose root vortex would lie in the plane of the
        fin, with a sidewash that depends on how close it happens to pass.
        """

        def change(**on: Any) -> Array:
            return (self.run(**on, **disturbed) - self.run(**on)) / step

        fin = change(wing=False) - change(wing=False, fin_deg=None)
        return change(fin_deg=None) + fin, fin

    @cached_property
    def attached(self) -> Attached:
        """All coefficients of the attached flow, by differences."""
        s, step = self.shape, np.radians(STEP_DEG)
        a = np.array([self.alpha_deg - 3.0, self.alpha_deg, self.alpha_deg + 3.0])
        sweep = np.array([self.run(alpha_deg=x) for x in a])
        base = sweep[1]
        alpha = (sweep[2] - sweep[0]) / np.radians(a[2] - a[0])
        wing = [self.run(alpha_deg=x, tail_deg=None, fin_deg=None) for x in a[::2]]
        wing_alpha = (wing[1] - wing[0]) / np.radians(a[2] - a[0])
        beta, fin_beta = self._lateral(step, beta_deg=STEP_DEG)
        p, _ = self._lateral(RATE, rates=(RATE, 0.0, 0.0))
        q = (self.run(rates=(0.0, RATE, 0.0)) - base) / RATE
        r, fin_r = self._lateral(RATE, rates=(0.0, 0.0, RATE))
        tail = (self.run(tail_deg=STEP_DEG) - base) / step
        fin = (self.run(wing=False, fin_deg=STEP_DEG) - self.run(wing=False)) / step
        fin *= np.sign(fin[5])  # nose to the right
        aileron = np.zeros(6)
        if s.aileron_y_m:
            aileron = (self.run(aileron_deg=-STEP_DEG) - self.run(aileron_deg=STEP_DEG)) / (2.0 * step)
        polar = np.polyfit(sweep[:, 0], sweep[:, 1], 2)
        downwash = 1.0 - float((alpha[4] - wing_alpha[4]) / tail[4])
        body = 2.0 * MUNK * s.fuselage_volume_m3 / s.wing_area_m2
        elevator, rudder, flap = (flap_effectiveness(x) for x in (s.elevator_part, s.rudder_part, s.aileron_part))
        at = np.radians(self.alpha_deg)
        # The lag of the downwash acts as q at the tail (Etkin & Reid, section 5.5): included in q, no alpha-dot term.
        lag = downwash * 2.0 * s.tail_arm_m / s.chord_m
        return Attached(
            cl_zero=base[0] - alpha[0] * at, cl_alpha=alpha[0],
            cm_zero=base[4] - alpha[4] * at, cm_alpha=alpha[4] + body / s.chord_m,
            wing_cl_zero=wing[0][0] - wing_alpha[0] * np.radians(a[0]), wing_cl_alpha=wing_alpha[0],
            tail_alpha=alpha[0] - wing_alpha[0], tail_incidence=tail[0], downwash=downwash,
            induced=(float(polar[0]), float(polar[1]), float(polar[2])),
            cl_q=q[0], cm_q=q[4] + tail[4] * lag,
            cy_beta=beta[2] - 2.0 * BODY_SIDE * s.fuselage_height_m * s.fuselage_width_m / s.wing_area_m2,
            roll_beta=beta[3] + self._wing_height(), yaw_beta=beta[5] - body / s.span_m,
            fin_yaw_beta=fin_beta[5],
            cy_p=p[2], cy_r=r[2],
            roll_p=p[3], yaw_p=p[5], roll_r=r[3], yaw_r=r[5], fin_yaw_r=fin_r[5],
            cy_rudder=rudder * fin[2], roll_rudder=rudder * fin[3], yaw_rudder=rudder * fin[5],
            roll_aileron=flap * aileron[3], yaw_aileron=flap * aileron[5],
            cl_elevator=-elevator * tail[0], cm_elevator=-elevator * tail[4],
        )  # fmt: skip

    def _wing_height(self) -> float:
        """Dihedral effect of the wing's height on the body, 1/rad (DATCOM 5.2.2.1)."""
        s = self.shape
        width = np.sqrt(s.fuselage_height_m * s.fuselage_width_m)
        return float(1.2 * np.sqrt(s.aspect) * s.wing_z_m / s.span_m * 2.0 * width / s.span_m)

    def profile_drag(self, alpha_deg: Array) -> Array:
        """Profile drag coefficient of surfaces and fuselage, without induced drag."""
        found = self.asb.AeroBuildup(
            airplane=self._airplane([self._wing(0.0), self._tail(0.0), self._fin(0.0)], [self._fuselage()]),
            op_point=self.asb.OperatingPoint(velocity=self.airspeed_m_s, alpha=alpha_deg),
        ).run()
        q = 0.5 * 1.225 * self.airspeed_m_s**2
        return np.asarray(found["D_profile"], float) / (q * self.shape.wing_area_m2)

    def section_limits(self, airspeed_m_s: float) -> tuple[float, float]:
        """Minimum and maximum lift coefficient of the wing section at `airspeed_m_s` (NeuralFoil)."""
        angles = np.arange(-15.0, 18.0, 0.25)
        polar = self.asb.Airfoil(self.sections.wing).get_aero_from_neuralfoil(
            alpha=angles, Re=airspeed_m_s * self.shape.chord_m / 1.46e-5, mach=0.0, model_size="xlarge"
        )
        lift = np.asarray(polar["CL"], float)
        return float(lift.min()), float(lift.max())
