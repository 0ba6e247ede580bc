"""The ``<aerodynamics>`` of a JSBSim model: forces in wind axes and moments in body axes, from tables and products.

The damping terms use the body rates minus those of the air, which can be set: `AIR_RATES`.
Reference: Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, chapters 2 to 5.
"""

import numpy as np

from estimator.interface import Array
from sim.aircraft.design.design import Design
from sim.aircraft.design.model_xml import apply, axis, function, product, table, table_2d

# Rotation of the air, body axes, rad/s, in the sense of p, q, r: properties of every model, 0 until set.
AIR_RATES = ("gust/p-rad_sec", "gust/q-rad_sec", "gust/r-rad_sec")

ALPHA_DEG = np.concatenate([np.arange(-180, -25, 5), np.arange(-25, 26, 1), np.arange(30, 181, 5)]).astype(float)
ROLLING_DEG = np.concatenate(
    [np.arange(-180, -25, 15), np.arange(-24, 0, 2), np.arange(0, 25, 1), np.arange(30, 181, 15)]
)
HELIX = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 1.0, 2.0, 4.0])
FOLDED_J = 5.0  # advance ratio at the end of the propeller tables, beyond which it counts as stopped


def _common(d: Design) -> list[str]:
    """Functions shared by the axes."""
    helix = apply("product", "aero/bi2vel", apply("abs", "aero/p-rad_sec"))
    rates = [
        function(f"aero/{x}-rad_sec", apply("difference", f"velocities/{x}-aero-rad_sec", air),
                 "body rate less that of the air")
        for x, air in zip("pqr", AIR_RATES, strict=True)
    ]  # fmt: skip
    sin_b, cos_b = apply("sin", "aero/beta-rad"), apply("cos", "aero/beta-rad")
    alpha, p = np.radians(ALPHA_DEG), d.polars
    blocks = [
        *rates,
        function("aero/helix", helix, "helix angle of the wing tip, without its sign"),
        product("aero/sin-beta", sin_b),
        product("aero/cos-beta", cos_b),
        product("aero/cos2-beta", cos_b, cos_b, about="flow along the span makes no lift: the tables see the rest"),
        product("aero/cos-alpha", apply("cos", "aero/alpha-rad"), about="tail surfaces work backwards in reverse"),
        product("aero/dihedral-shape", table("aero/alpha-deg", ALPHA_DEG, p.dihedral_shape(alpha)),
                about="dihedral effect, over the attached value"),
    ]  # fmt: skip
    if d.shape.aileron_y_m or d.drive is not None:
        shape = p.aileron_shape(alpha, d.surfaces.aileron_stalled)
        blocks.append(
            product("aero/aileron-shape", table("aero/alpha-deg", ALPHA_DEG, shape),
                    about="aileron effect, over the attached value")
        )  # fmt: skip
    return blocks + _slipstream(d)


def _slipstream(d: Design) -> list[str]:
    """Dynamic pressure at tailplane and fin (momentum theory: q + T / A in the contracted slipstream).

    A surface in the slipstream has the cross flow of the flight and the speed of the slipstream: effects of flow
    angles and rates grow with the speed, effects of deflections with its square.
    """
    if d.drive is None:
        return []
    disc_ft2 = 0.25 * np.pi * (d.shape.propeller_diameter_m / 0.3048) ** 2
    blocks = []
    for name, part in (("tail", d.drive.tail_in_wash), ("fin", d.drive.fin_in_wash)):
        pressure = apply("product", "propulsion/engine/thrust-lbs", part / disc_ft2)
        both = apply("max", 0.0, apply("sum", "aero/qbar-psf", pressure))
        root = apply("sqrt", apply("product", "aero/qbar-psf", f"aero/{name}-qbar-psf"))
        blocks += [
            function(f"aero/{name}-qbar-psf", both, "with the slipstream"),
            function(
                f"aero/{name}-wash-psf", apply("difference", root, "aero/qbar-psf"), "its gain for the cross flow"
            ),
        ]
    return blocks


def aerodynamics(d: Design) -> str:
    """Forces in wind axes, moments in body axes."""
    return "<aerodynamics>\n" + "\n".join([*_common(d), *_forces(d), *_moments(d)]) + "\n</aerodynamics>"


def _over_alpha(values: Array) -> str:
    return table("aero/alpha-deg", ALPHA_DEG, values)


def _tail_pressures(d: Design) -> tuple[str, str]:
    """Properties with the dynamic pressure at tailplane and fin."""
    return ("aero/tail-qbar-psf", "aero/fin-qbar-psf") if d.drive else ("aero/qbar-psf", "aero/qbar-psf")


def _full_deflections(d: Design) -> tuple[float, float]:
    """Effective full deflections of elevator and rudder, rad."""
    throws = np.radians([d.shape.elevator_throw_deg, d.shape.rudder_throw_deg]) * d.surfaces.effectiveness
    return float(throws[0]), float(throws[1])


def _forces(d: Design) -> list[str]:
    a = d.attached
    cl, cd, _ = d.polars.lift_drag_pitch(np.radians(ALPHA_DEG))
    elevator, rudder = _full_deflections(d)
    tail_q, fin_q = _tail_pressures(d)
    area, b2v, side, cos_a = "metrics/Sw-sqft", "aero/bi2vel", "aero/sin-beta", "aero/cos-alpha"
    force, (p, q, r) = ("aero/qbar-psf", area), (f"aero/{x}-rad_sec" for x in "pqr")
    return [
        axis(
            "LIFT",
            product("aero/force/lift-alpha", *force, "aero/cos2-beta", _over_alpha(cl)),
            product("aero/force/lift-q", *force, "aero/ci2vel", q, a.cl_q),
            product("aero/force/lift-elevator", tail_q, area, cos_a, "servo/elevator", a.cl_elevator * elevator),
        ),
        axis(
            "DRAG",
            product("aero/force/drag-alpha", *force, "aero/cos2-beta", _over_alpha(cd)),
            product("aero/force/drag-beta", *force, side, side, -a.cy_beta, about="the side force, along the wind"),
            *_stopped_propeller(d),
        ),
        axis(
            "SIDE",
            product(
                "aero/force/side-beta", *force, side, "aero/cos-beta", a.cy_beta, about="the same, across the wind"
            ),
            product("aero/force/side-p", *force, b2v, p, a.cy_p),
            product("aero/force/side-r", *force, b2v, r, a.cy_r, about="the fin's, balances the rudder's in a turn"),
            product("aero/force/side-rudder", fin_q, area, cos_a, "servo/rudder", a.cy_rudder * rudder),
        ),
    ]


def _moments(d: Design) -> list[str]:
    a, alpha = d.attached, np.radians(ALPHA_DEG)
    _, _, cm = d.polars.lift_drag_pitch(alpha)
    elevator, rudder = _full_deflections(d)
    tail_q, fin_q = _tail_pressures(d)
    area, span, chord = "metrics/Sw-sqft", "metrics/bw-ft", "metrics/cbarw-ft"
    roll, pitch, (p, q, r) = (
        ("aero/qbar-psf", area, span), ("aero/qbar-psf", area, chord), (f"aero/{x}-rad_sec" for x in "pqr")
    )  # fmt: skip
    b2v, side, cos_a = "aero/bi2vel", "aero/sin-beta", "aero/cos-alpha"
    rolling = d.polars.rolling(np.radians(ROLLING_DEG), HELIX)
    roll_p, yaw_p = (table_2d("aero/alpha-deg", ROLLING_DEG, "aero/helix", HELIX, v) for v in rolling)
    return [
        axis(
            "ROLL",
            product("aero/moment/roll-beta", *roll, side, "aero/dihedral-shape", a.roll_beta),
            product("aero/moment/roll-p", *roll, b2v, p, roll_p, about="autorotation past the stall"),
            product("aero/moment/roll-r", *roll, b2v, r, _over_alpha(d.polars.roll_of_yawing(alpha))),
            product("aero/moment/roll-rudder", fin_q, area, span, cos_a, "servo/rudder", a.roll_rudder * rudder),
            *_ailerons(d, "roll", a.roll_aileron),
        ),
        axis(
            "PITCH",
            product("aero/moment/pitch-alpha", *pitch, "aero/cos2-beta", _over_alpha(cm)),
            product("aero/moment/pitch-q", *pitch, "aero/ci2vel", q, a.cm_q),
            product(
                "aero/moment/pitch-elevator", tail_q, area, chord, cos_a, "servo/elevator", a.cm_elevator * elevator
            ),
            *_washed_pitch(d),
        ),
        axis(
            "YAW",
            product("aero/moment/yaw-beta", *roll, side, a.yaw_beta),
            product("aero/moment/yaw-p", *roll, b2v, p, yaw_p),
            product("aero/moment/yaw-r", *roll, b2v, r, a.yaw_r),
            product("aero/moment/yaw-rudder", fin_q, area, span, cos_a, "servo/rudder", a.yaw_rudder * rudder),
            *_ailerons(d, "yaw", a.yaw_aileron),
            *_washed_yaw(d),
        ),
    ]


def _ailerons(d: Design, name: str, slope: float) -> list[str]:
    moment = ("aero/qbar-psf", "metrics/Sw-sqft", "metrics/bw-ft")
    terms = []
    if d.shape.aileron_y_m:
        full = slope * np.radians(d.shape.aileron_throw_deg) * d.surfaces.effectiveness
        terms.append(product(f"aero/moment/{name}-aileron", *moment, "servo/aileron", "aero/aileron-shape", full))
    if d.drive and name == "roll":
        about = "balances the motor's torque in the cruise"
        terms.append(product("aero/moment/roll-rig", *moment, "aero/aileron-shape", d.drive.roll_rig, about=about))
    return terms


def _washed_pitch(d: Design) -> list[str]:
    """Contribution of the slipstream to stiffness and damping of the tailplane."""
    if d.drive is None:
        return []
    a, moment = d.attached, ("aero/tail-wash-psf", "metrics/Sw-sqft", "metrics/cbarw-ft")
    arm = d.shape.tail_arm_m / d.shape.chord_m
    sin_a = apply("sin", "aero/alpha-rad")
    return [
        product("aero/moment/pitch-alpha-wash", *moment, sin_a, "aero/cos2-beta", -a.tail_alpha * arm),
        product("aero/moment/pitch-q-wash", *moment, "aero/ci2vel", "aero/q-rad_sec", -2.0 * a.tail_incidence * arm**2),
    ]


def _washed_yaw(d: Design) -> list[str]:
    """Contribution of the slipstream to stiffness and damping of the fin."""
    if d.drive is None:
        return []
    a, moment = d.attached, ("aero/fin-wash-psf", "metrics/Sw-sqft", "metrics/bw-ft")
    return [
        product("aero/moment/yaw-beta-wash", *moment, "aero/sin-beta", a.fin_yaw_beta),
        product("aero/moment/yaw-r-wash", *moment, "aero/bi2vel", "aero/r-rad_sec", a.fin_yaw_r),
    ]


def _stopped_propeller(d: Design) -> list[str]:
    """Drag of a propeller that turns slower than its tables cover: full when stopped, none where they end."""
    if d.drive is None or d.drive.folding:
        return []
    turning = apply("quotient", apply("product", "propulsion/engine/propeller-rpm", _j_per_rpm(d)), "velocities/vt-fps")
    part = apply("max", 0.0, apply("difference", 1.0, apply("pow", turning, 2.0)))
    area_ft2 = d.drive.stopped_area_m2 / 0.3048**2
    return [product("aero/force/drag-propeller", "aero/qbar-psf", area_ft2, part, about="stopped blades")]


def _j_per_rpm(d: Design) -> float:
    """n D J / V = 1 at the end of the tables: the factor of rpm / (ft/s)."""
    return FOLDED_J * d.shape.propeller_diameter_m / 0.3048 / 60.0
