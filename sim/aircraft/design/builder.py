"""From a design to the files of a JSBSim model: shape and masses -> coefficients -> XML.

Each aeroplane's `build.py` states a `Design`; `render` turns it into text.  Conventions of the models:

- Surfaces are -1..1 and positive where they roll right, pitch up, yaw right: ``servo/aileron|elevator|rudder``.
- The damping terms see the body's rates less those of the air, which anybody may set: `AIR_RATES`.
- A model without a motor has ``propulsion/engine/*`` and the throttle all the same; they read 0.

Reference: Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, chapters 2 to 5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from estimator.interface import Array
from sim.aircraft.design.lattice import Attached, Lattice, Sections
from sim.aircraft.design.masses import Balance, Part, balance
from sim.aircraft.design.model_xml import HEADER, apply, axis, function, location, number, product, table, table_2d
from sim.aircraft.design.shape import Shape
from sim.aircraft.design.stall import Polars

# Rotation of the air, body axes, rad/s, in the sense of p, q, r: properties of every model, 0 until they are set.
AIR_RATES = ("gust/p-rad_sec", "gust/q-rad_sec", "gust/r-rad_sec")

ALPHA_DEG = np.concatenate([np.arange(-180, -25, 5), np.arange(-25, 26, 1), np.arange(30, 181, 5)]).astype(float)
ROLLING_DEG = np.concatenate(
    [np.arange(-180, -25, 15), np.arange(-24, 0, 2), np.arange(0, 25, 1), np.arange(30, 181, 15)]
)
HELIX = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 1.0, 2.0, 4.0])
PROFILE_DEG = np.arange(-12.0, 15.0, 1.0)
FOLDED_J = 5.0  # advance ratio at the end of the propeller's tables, beyond which it counts as stopped


@dataclass(frozen=True)
class Surfaces:
    """effectiveness : part of the effect in theory; aileron_stalled : part left on a stalled wing."""

    effectiveness: float = 0.8
    aileron_stalled: float = 0.4


@dataclass(frozen=True)
class Servos:
    """lag_rad_s : bandwidth; rate_per_s : full deflections a second; throttle_per_s : soft start."""

    lag_rad_s: float = 30.0
    rate_per_s: float = 8.0
    throttle_per_s: float = 2.0


@dataclass(frozen=True)
class Drive:
    """Motor and propeller.

    propeller : rows of advance ratio J = V / (n D), thrust and power coefficients
    folding : the blades fold when the air would drive them: no drag
    stopped_area_m2 : drag area of the stopped propeller that does not fold
    tail_in_wash, fin_in_wash : parts of tailplane and fin in the slipstream
    roll_rig : rolling moment coefficient of a little wing warp, against the torque in the cruise
    """

    volts: float
    kv: float
    ohm: float
    no_load_a: float
    rotor_kg_m2: float
    propeller: tuple[tuple[float, float, float], ...]
    folding: bool
    stopped_area_m2: float
    tail_in_wash: float
    fin_in_wash: float
    roll_rig: float


@dataclass(frozen=True)
class Ground:
    """Soft springs: stiff ones bounce the aeroplane at 200 Hz."""

    spring_n_m: float = 400.0
    damping_n_s_m: float = 10.0
    friction: float = 0.5


@dataclass(frozen=True)
class Design:
    """An aeroplane: its shape comes from the airframe.toml in `folder`, the rest is here.

    cruise_m_s, cruise_rad : speed of the Reynolds number and angle of attack about which the slopes are taken
    stall_m_s : speed of the Reynolds number of the stall
    cd_extra : drag of what the outline does not show: gaps, pushrods, rubber bands, a rough covering
    cd_lift : the same growing with lift, times CL^2: body and joints in the wing's lift, bubbles behind the spar
    """

    folder: Path
    about: str
    sections: Sections
    parts: tuple[Part, ...]
    cruise_m_s: float
    cruise_rad: float
    stall_m_s: float
    cd_extra: float
    cd_lift: float
    drive: Drive | None = None
    surfaces: Surfaces = Surfaces()
    servos: Servos = Servos()
    ground: Ground = Ground()

    @property
    def name(self) -> str:
        return self.folder.name

    @cached_property
    def shape(self) -> Shape:
        return Shape.of(self.folder / "airframe.toml")

    @cached_property
    def balance(self) -> Balance:
        return balance(self.parts, self.shape)

    @cached_property
    def _lattice(self) -> Lattice:
        return Lattice(self.shape, self.sections, self.cruise_m_s, self.cruise_rad)

    @property
    def attached(self) -> Attached:
        return self._lattice.attached

    @cached_property
    def polars(self) -> Polars:
        drag, limits = self._lattice.profile_drag(PROFILE_DEG), self._lattice.section_limits(self.stall_m_s)
        return Polars(self.shape, self.attached, PROFILE_DEG, drag, self.cd_extra, self.cd_lift, limits)


def _common(d: Design) -> list[str]:
    """Functions that the axes share."""
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

    A surface in it sees the cross flow of the flight and the speed of the slipstream: what goes with an angle of
    the flow or with a rate gains as the speed, what goes with a deflection as its square.
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


def _aerodynamics(d: Design) -> str:
    """Forces in wind axes, moments in body axes."""
    a, s = d.attached, d.surfaces
    alpha = np.radians(ALPHA_DEG)
    cl, cd, cm = d.polars.lift_drag_pitch(alpha)
    elevator = np.radians(d.shape.elevator_throw_deg) * s.effectiveness
    rudder = np.radians(d.shape.rudder_throw_deg) * s.effectiveness
    area, span, chord = "metrics/Sw-sqft", "metrics/bw-ft", "metrics/cbarw-ft"
    force = ("aero/qbar-psf", area)
    tail_q, fin_q = ("aero/tail-qbar-psf", "aero/fin-qbar-psf") if d.drive else ("aero/qbar-psf", "aero/qbar-psf")
    roll, pitch = (*force, span), (*force, chord)
    p, q, r = (f"aero/{x}-rad_sec" for x in "pqr")
    b2v, c2v, side, cos_a = "aero/bi2vel", "aero/ci2vel", "aero/sin-beta", "aero/cos-alpha"
    rolling = d.polars.rolling(np.radians(ROLLING_DEG), HELIX)
    roll_p, yaw_p = (table_2d("aero/alpha-deg", ROLLING_DEG, "aero/helix", HELIX, v) for v in rolling)

    def over_alpha(values: Array) -> str:
        return table("aero/alpha-deg", ALPHA_DEG, values)

    blocks = [
        *_common(d),
        axis(
            "LIFT",
            product("aero/force/lift-alpha", *force, "aero/cos2-beta", over_alpha(cl)),
            product("aero/force/lift-q", *force, c2v, q, a.cl_q),
            product("aero/force/lift-elevator", tail_q, area, cos_a, "servo/elevator", a.cl_elevator * elevator),
        ),
        axis(
            "DRAG",
            product("aero/force/drag-alpha", *force, "aero/cos2-beta", over_alpha(cd)),
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
        axis(
            "ROLL",
            product("aero/moment/roll-beta", *roll, side, "aero/dihedral-shape", a.roll_beta),
            product("aero/moment/roll-p", *roll, b2v, p, roll_p, about="autorotation past the stall"),
            product("aero/moment/roll-r", *roll, b2v, r, over_alpha(d.polars.roll_of_yawing(alpha))),
            product("aero/moment/roll-rudder", fin_q, area, span, cos_a, "servo/rudder", a.roll_rudder * rudder),
            *_ailerons(d, "roll", a.roll_aileron),
        ),
        axis(
            "PITCH",
            product("aero/moment/pitch-alpha", *pitch, "aero/cos2-beta", over_alpha(cm)),
            product("aero/moment/pitch-q", *pitch, c2v, q, a.cm_q),
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
    return "<aerodynamics>\n" + "\n".join(blocks) + "\n</aerodynamics>"


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
    """What the slipstream adds to the tailplane's stiffness and damping."""
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
    """The same of the fin."""
    if d.drive is None:
        return []
    a, moment = d.attached, ("aero/fin-wash-psf", "metrics/Sw-sqft", "metrics/bw-ft")
    return [
        product("aero/moment/yaw-beta-wash", *moment, "aero/sin-beta", a.fin_yaw_beta),
        product("aero/moment/yaw-r-wash", *moment, "aero/bi2vel", "aero/r-rad_sec", a.fin_yaw_r),
    ]


def _stopped_propeller(d: Design) -> list[str]:
    """Drag of a propeller that turns slower than its tables reach: all of it when stopped, none where they end."""
    if d.drive is None or d.drive.folding:
        return []
    turning = apply("quotient", apply("product", "propulsion/engine/propeller-rpm", _j_per_rpm(d)), "velocities/vt-fps")
    part = apply("max", 0.0, apply("difference", 1.0, apply("pow", turning, 2.0)))
    area_ft2 = d.drive.stopped_area_m2 / 0.3048**2
    return [product("aero/force/drag-propeller", "aero/qbar-psf", area_ft2, part, about="stopped blades")]


def _j_per_rpm(d: Design) -> float:
    """n D J / V = 1 at the end of the tables: the factor of rpm / (ft/s)."""
    return FOLDED_J * d.shape.propeller_diameter_m / 0.3048 / 60.0


def _metrics_and_mass(d: Design) -> str:
    b, at = d.balance, (0.0, 0.0, 0.0)
    i = b.inertia_kg_m2
    return f"""<metrics>
  <wingarea unit="M2">{d.shape.wing_area_m2:.5f}</wingarea>
  <wingspan unit="M">{d.shape.span_m:.4f}</wingspan>
  <chord unit="M">{d.shape.chord_m:.5f}</chord>
  {location(at, "AERORP")}
  {location(at, "EYEPOINT")}
  {location(at, "VRP")}
</metrics>
<mass_balance negated_crossproduct_inertia="true">
  <ixx unit="KG*M2">{i[0, 0]:.5f}</ixx>
  <iyy unit="KG*M2">{i[1, 1]:.5f}</iyy>
  <izz unit="KG*M2">{i[2, 2]:.5f}</izz>
  <ixz unit="KG*M2">{-i[0, 2]:.5f}</ixz>
  <emptywt unit="KG">{b.mass_kg:.4f}</emptywt>
  {location(at, "CG")}
</mass_balance>"""


def _ground_reactions(d: Design) -> str:
    g = d.ground
    points = "\n".join(
        f"""  <contact type="STRUCTURE" name="{name}">
    {location(at)}
    <static_friction>{g.friction}</static_friction>
    <dynamic_friction>{g.friction}</dynamic_friction>
    <spring_coeff unit="N/M">{g.spring_n_m}</spring_coeff>
    <damping_coeff unit="N/M/SEC">{g.damping_n_s_m}</damping_coeff>
  </contact>"""
        for name, at in d.shape.touching_points().items()
    )
    return f"<ground_reactions>\n{points}\n</ground_reactions>"


def _hand() -> str:
    """The hand that throws: a force and a moment on the body, zero in flight."""
    direction = "<direction><x>1</x><y>0</y><z>0</z></direction>"
    return f"""<external_reactions>
  <force name="hand" frame="BODY">{location((0.0, 0.0, 0.0))}{direction}</force>
  <moment name="hand_moment" frame="BODY">{direction}</moment>
</external_reactions>"""


def _propulsion(d: Design) -> str:
    if d.drive is None:
        return ""
    disc = location((d.shape.nose_x_m, 0.0, 0.0))
    return f"""<propulsion>
  <engine file="motor">
    {disc}
    <orient unit="DEG"><roll>0</roll><pitch>0</pitch><yaw>0</yaw></orient>
    <feed>0</feed>
    <thruster file="propeller">
      {disc}
      <orient unit="DEG"><roll>0</roll><pitch>0</pitch><yaw>0</yaw></orient>
      <sense>1</sense>
    </thruster>
  </engine>
</propulsion>
"""


def _flight_control(d: Design) -> str:
    """Servos; + rolls right, + nose up, + nose right, for commands and for positions alike."""
    s = d.servos
    surfaces = "\n".join(
        f"""    <actuator name="{name}-servo">
      <input>fcs/{name}-cmd-norm</input>
      <lag>{s.lag_rad_s:g}</lag>
      <rate_limit>{s.rate_per_s:g}</rate_limit>
      <clipto><min>-1</min><max>1</max></clipto>
      <output>servo/{name}</output>
    </actuator>"""
        for name in ("aileron", "elevator", "rudder")
    )
    properties = ["servo/aileron", "servo/elevator", "servo/rudder", *AIR_RATES]
    if d.drive is None:
        properties += [
            "propulsion/engine/propeller-rpm",
            "propulsion/engine/thrust-lbs",
            "fcs/throttle-cmd-norm",
            "fcs/throttle-pos-norm",
        ]
    else:
        surfaces += f"""
    <actuator name="speed-controller">
      <input>fcs/throttle-cmd-norm</input>
      <rate_limit>{s.throttle_per_s:g}</rate_limit>
      <clipto><min>0</min><max>1</max></clipto>
      <output>fcs/throttle-pos-norm</output>
    </actuator>"""
    own = "\n".join(f'  <property value="0">{name}</property>' for name in properties)
    return f"""<flight_control name="servos">
{own}
  <channel name="servos">
{surfaces}
  </channel>
</flight_control>"""


def _propeller(drive: Drive, diameter_m: float) -> str:
    def rows(name: str, column: int) -> str:
        values = [max(row[column], 0.0) if drive.folding else row[column] for row in drive.propeller]
        lines = "\n".join(f"    {row[0]:6.2f} {v:9.4f}" for row, v in zip(drive.propeller, values, strict=True))
        return f'  <table name="{name}" type="internal">\n    <tableData>\n{lines}\n    </tableData>\n  </table>'

    return f"""<propeller name="propeller">
  <ixx unit="KG*M2">{number(drive.rotor_kg_m2)}</ixx>
  <diameter unit="M">{diameter_m:g}</diameter>
  <numblades>2</numblades>
  <gearratio>1</gearratio>
  <p_factor>0</p_factor>
  <constspeed>0</constspeed>
  <minpitch>20</minpitch>
  <maxpitch>20</maxpitch>
{rows("C_THRUST", 1)}
{rows("C_POWER", 2)}
</propeller>
"""


def _motor(drive: Drive) -> str:
    return f"""<brushless_dc_motor name="motor">
  <maxvolts unit="VOLTS">{drive.volts:g}</maxvolts>
  <velocityconstant>{drive.kv:g}</velocityconstant>
  <coilresistance unit="OHMS">{drive.ohm:g}</coilresistance>
  <noloadcurrent unit="AMPERES">{drive.no_load_a:g}</noloadcurrent>
</brushless_dc_motor>
"""


def render(d: Design) -> dict[str, str]:
    """The model's files, {name: text}, as they belong beside the aeroplane's build.py."""
    pieces: list[Callable[[Design], str]] = [_metrics_and_mass, _ground_reactions]
    last: list[Callable[[Design], str]] = [_flight_control, _aerodynamics]
    parts = [*(p(d) for p in pieces), _hand(), *filter(None, [_propulsion(d).rstrip()]), *(p(d) for p in last)]
    model = (
        f'<fdm_config name="{d.name}" version="2.0" release="ALPHA">\n'
        f"<fileheader><description>{d.about}</description></fileheader>\n" + "\n".join(parts) + "\n</fdm_config>\n"
    )
    files = {f"{d.name}.xml": HEADER + model}
    if d.drive is not None:
        files["motor.xml"] = HEADER + _motor(d.drive)
        files["propeller.xml"] = HEADER + _propeller(d.drive, d.shape.propeller_diameter_m)
    return files


def write(d: Design) -> None:
    """Write the model's files."""
    for name, text in render(d).items():
        (d.folder / name).write_text(text, encoding="utf-8")
