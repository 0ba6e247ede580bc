"""Write the JSBSim model of the aeroplane: one place of numbers, turned into XML.

    python -m sim.aircraft.endurance.build

The outline is in airframe.toml, the coefficients come from `aero`, masses, servos, motor and contacts are here.
Structural axes of the XML: x aft, y right, z up, metres, origin at the centre of gravity.
"""

import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np

from sim.aircraft.endurance.aero import Aero, Outline

HERE = Path(__file__).parent
MASS_KG = 1.4
INERTIA_KG_M2 = (0.06, 0.08, 0.13)
SERVO_LAG_RAD_S = 30.0
SERVO_RATE_PER_S = 8.0  # full deflections a second: 60 deg of the arm in 0.17 s, 45 deg to the stop
THROTTLE_RATE_PER_S = 2.0  # soft start of the speed controller
MOTOR = {"volts": 11.1, "kv": 850.0, "ohm": 0.14, "no_load_a": 0.8}
ROTOR_INERTIA_KG_M2 = 1.0e-4
# Advance ratio J = V / (n D), thrust and power coefficients; above J = 0.8 the air drives the propeller.  With the
# throttle shut the controller brakes and the blades fold: no thrust, no drag.
PROPELLER = (
    (0.0, 0.110, 0.0520), (0.1, 0.107, 0.0530), (0.2, 0.102, 0.0540), (0.3, 0.094, 0.0530), (0.4, 0.082, 0.0505),
    (0.5, 0.066, 0.0455), (0.6, 0.047, 0.0375), (0.7, 0.025, 0.0255), (0.8, 0.002, 0.0120), (0.9, -0.022, -0.0030),
    (1.0, -0.045, -0.0160), (1.4, -0.110, -0.0450), (2.0, -0.190, -0.0750), (5.0, -0.800, -0.2600),
)  # fmt: skip
CONTACT = {"spring_n_m": 400.0, "damping_n_s_m": 10.0, "friction": 0.5}


def contacts(geometry: dict[str, float]) -> dict[str, tuple[float, float, float]]:
    """Points that can touch the ground, structural axes, metres."""
    half = 0.5 * geometry["span_m"]
    tip = -geometry["wing_z_m"] + half * np.tan(np.radians(geometry["dihedral_deg"]))
    belly = -0.5 * geometry["fuselage_height_m"] - 0.02
    tail = geometry["fuselage_length_m"] - geometry["nose_x_m"]
    return {
        "NOSE": (-geometry["nose_x_m"], 0.0, -0.03),
        "BELLY_FRONT": (-0.20, 0.0, belly),
        "BELLY_REAR": (0.25, 0.0, belly),
        "TAIL": (tail, 0.0, -0.02),
        "FIN_TOP": (tail, 0.0, geometry["fin_height_m"]),
        "LEFT_TIP": (0.0, -half, tip),
        "RIGHT_TIP": (0.0, half, tip),
    }


def outline(geometry: dict[str, float]) -> Outline:
    """The part of the geometry that the coefficients need."""
    return Outline(**{f.name: geometry[f.name] for f in fields(Outline)})


def _alphas_deg() -> np.ndarray:
    """Angles of the tables: every degree through the stalls, every 5 elsewhere; the ends are the same direction."""
    return np.concatenate([np.arange(-180, -25, 5), np.arange(-25, 26, 1), np.arange(30, 181, 5)]).astype(float)


def _table(variable: str, rows: list[tuple[float, float]]) -> str:
    body = "\n".join(f"          {x:8.1f} {y:10.5f}" for x, y in rows)
    return (
        f'        <table>\n          <independentVar lookup="row">{variable}</independentVar>\n'
        f"          <tableData>\n{body}\n          </tableData>\n        </table>"
    )


def _alpha_table(values: np.ndarray) -> str:
    return _table("aero/alpha-deg", list(zip(_alphas_deg(), np.round(values, 5) + 0.0, strict=True)))


def _function(name: str, *factors: str | float, about: str = "") -> str:
    """An XML function: the product of properties, numbers and ready-made XML."""
    lines = []
    for f in factors:
        if isinstance(f, str):
            lines.append(f if f.lstrip().startswith("<") else f"        <property>{f}</property>")
        else:
            lines.append(f"        <value>{f:.6g}</value>")
    note = f"      <description>{about}</description>\n" if about else ""
    product = "\n".join(["      <product>", *lines, "      </product>"])
    return f'    <function name="{name}">\n{note}{product}\n    </function>'


def _axis(name: str, *functions: str) -> str:
    return f'  <axis name="{name}">\n' + "\n".join(functions) + "\n  </axis>"


def _aerodynamics(a: Aero) -> str:
    """Forces in wind axes, moments in body axes; rates are those against the turbulent air."""
    alpha = np.radians(_alphas_deg())
    cl, cd, cm = a.lift_drag_pitch(alpha)
    force = ("aero/qbar-psf", "metrics/Sw-sqft")
    roll = (*force, "metrics/bw-ft")
    pitch = (*force, "metrics/cbarw-ft")
    p, q, r = (f"velocities/{x}-aero-rad_sec" for x in "pqr")
    b2v, c2v = "aero/bi2vel", "aero/ci2vel"
    sin_b = "        <sin><property>aero/beta-rad</property></sin>"
    cos_b = "        <cos><property>aero/beta-rad</property></cos>"
    cos_a = "        <cos><property>aero/alpha-rad</property></cos>"
    side, shape, warp = "aero/sin-beta", "aero/roll-shape", "aero/aileron-shape"
    f = _function
    blocks = [
        f(side, sin_b),
        f("aero/cos-beta", cos_b),
        f("aero/cos2-beta", cos_b, cos_b, about="flow along the span makes no lift: the tables see the rest"),
        f("aero/cos-alpha", cos_a, about="tail surfaces work backwards in reversed flow"),
        f(shape, _alpha_table(a.roll_shape(alpha)), about="roll damping and dihedral, over the attached value"),
        f(warp, _alpha_table(a.aileron_shape(alpha)), about="aileron effect, over the attached value"),
        _axis(
            "LIFT",
            f("aero/force/lift-alpha", *force, "aero/cos2-beta", _alpha_table(cl)),
            f("aero/force/lift-q", *force, c2v, q, a.cl_q),
            f("aero/force/lift-elevator", *force, "aero/cos-alpha", "servo/elevator", a.cl_elevator),
        ),
        _axis(
            "DRAG",
            f("aero/force/drag-alpha", *force, "aero/cos2-beta", _alpha_table(cd)),
            f("aero/force/drag-beta", *force, side, side, -a.cy_beta, about="the side force, along the wind"),
        ),
        _axis(
            "SIDE",
            f("aero/force/side-beta", *force, side, "aero/cos-beta", a.cy_beta, about="the same, across the wind"),
            f("aero/force/side-rudder", *force, "aero/cos-alpha", "servo/rudder", a.cy_rudder),
        ),
        _axis(
            "ROLL",
            f("aero/moment/roll-beta", *roll, side, shape, a.cl_beta),
            f("aero/moment/roll-p", *roll, b2v, p, shape, a.cl_p),
            f("aero/moment/roll-r", *roll, b2v, r, a.cl_r),
            f("aero/moment/roll-aileron", *roll, "servo/aileron", warp, a.figures.aileron_roll),
            f("aero/moment/roll-rig", *roll, warp, a.figures.roll_rig, about="balances the motor in the cruise"),
        ),
        _axis(
            "PITCH",
            f("aero/moment/pitch-alpha", *pitch, "aero/cos2-beta", _alpha_table(cm)),
            f("aero/moment/pitch-q", *pitch, c2v, q, a.cm_q),
            f("aero/moment/pitch-elevator", *pitch, "aero/cos-alpha", "servo/elevator", a.cm_elevator),
        ),
        _axis(
            "YAW",
            f("aero/moment/yaw-beta", *roll, side, a.cn_beta),
            f("aero/moment/yaw-p", *roll, b2v, p, shape, a.cn_p),
            f("aero/moment/yaw-r", *roll, b2v, r, a.cn_r),
            f("aero/moment/yaw-aileron", *roll, "servo/aileron", warp, a.figures.aileron_adverse),
            f("aero/moment/yaw-rudder", *roll, "aero/cos-alpha", "servo/rudder", a.cn_rudder),
        ),
    ]
    return "<aerodynamics>\n" + "\n".join(blocks) + "\n</aerodynamics>"


def _location(x: float, y: float, z: float, name: str = "", tag: str = "location") -> str:
    label = f' name="{name}"' if name else ""
    return f'<{tag}{label} unit="M"><x>{x:.4f}</x><y>{y:.4f}</y><z>{z:.4f}</z></{tag}>'


def _metrics_and_mass(o: Outline) -> str:
    ixx, iyy, izz = INERTIA_KG_M2
    return f"""<metrics>
  <wingarea unit="M2">{o.wing_area_m2:.5f}</wingarea>
  <wingspan unit="M">{o.span_m:.4f}</wingspan>
  <chord unit="M">{o.chord_m:.5f}</chord>
  {_location(0, 0, 0, "AERORP")}
  {_location(0, 0, 0, "EYEPOINT")}
  {_location(0, 0, 0, "VRP")}
</metrics>
<mass_balance>
  <ixx unit="KG*M2">{ixx}</ixx>
  <iyy unit="KG*M2">{iyy}</iyy>
  <izz unit="KG*M2">{izz}</izz>
  <emptywt unit="KG">{MASS_KG}</emptywt>
  {_location(0, 0, 0, "CG")}
</mass_balance>"""


def _ground_reactions(geometry: dict[str, float]) -> str:
    """Soft springs: stiff ones bounce the aeroplane at 200 Hz."""
    points = "\n".join(
        f"""  <contact type="STRUCTURE" name="{name}">
    {_location(*at)}
    <static_friction>{CONTACT["friction"]}</static_friction>
    <dynamic_friction>{CONTACT["friction"]}</dynamic_friction>
    <spring_coeff unit="N/M">{CONTACT["spring_n_m"]}</spring_coeff>
    <damping_coeff unit="N/M/SEC">{CONTACT["damping_n_s_m"]}</damping_coeff>
  </contact>"""
        for name, at in contacts(geometry).items()
    )
    return f"<ground_reactions>\n{points}\n</ground_reactions>"


def _propulsion(geometry: dict[str, float]) -> str:
    return f"""<propulsion>
  <engine file="motor">
    {_location(-geometry["nose_x_m"], 0, 0)}
    <orient unit="DEG"><roll>0</roll><pitch>0</pitch><yaw>0</yaw></orient>
    <feed>0</feed>
    <thruster file="propeller">
      {_location(-geometry["nose_x_m"], 0, 0)}
      <orient unit="DEG"><roll>0</roll><pitch>0</pitch><yaw>0</yaw></orient>
      <sense>1</sense>
    </thruster>
  </engine>
</propulsion>"""


def _flight_control() -> str:
    """Servos; + rolls right, + nose up, + nose right, for commands and for positions alike."""
    surfaces = "\n".join(
        f"""    <actuator name="{name}-servo">
      <input>fcs/{name}-cmd-norm</input>
      <lag>{SERVO_LAG_RAD_S:g}</lag>
      <rate_limit>{SERVO_RATE_PER_S:g}</rate_limit>
      <clipto><min>-1</min><max>1</max></clipto>
      <output>servo/{name}</output>
    </actuator>"""
        for name in ("aileron", "elevator", "rudder")
    )
    return f"""<flight_control name="servos">
  <property value="0">servo/aileron</property>
  <property value="0">servo/elevator</property>
  <property value="0">servo/rudder</property>
  <channel name="servos">
{surfaces}
    <actuator name="speed-controller">
      <input>fcs/throttle-cmd-norm</input>
      <rate_limit>{THROTTLE_RATE_PER_S:g}</rate_limit>
      <clipto><min>0</min><max>1</max></clipto>
      <output>fcs/throttle-pos-norm</output>
    </actuator>
  </channel>
</flight_control>"""


def _hand() -> str:
    """The hand that throws: a force and a moment on the body, zero in flight."""
    direction = "<direction><x>1</x><y>0</y><z>0</z></direction>"
    return f"""<external_reactions>
  <force name="hand" frame="BODY">{_location(0, 0, 0)}{direction}</force>
  <moment name="hand_moment" frame="BODY">{direction}</moment>
</external_reactions>"""


def _propeller(diameter_m: float) -> str:
    def table(name: str, column: int) -> str:
        rows = "\n".join(f"    {row[0]:6.2f} {row[column]:9.4f}" for row in PROPELLER)
        return f'  <table name="{name}" type="internal">\n    <tableData>\n{rows}\n    </tableData>\n  </table>'

    return f"""<propeller name="propeller">
  <ixx unit="KG*M2">{ROTOR_INERTIA_KG_M2:g}</ixx>
  <diameter unit="M">{diameter_m:g}</diameter>
  <numblades>2</numblades>
  <gearratio>1</gearratio>
  <p_factor>0</p_factor>
  <constspeed>0</constspeed>
  <minpitch>20</minpitch>
  <maxpitch>20</maxpitch>
{table("C_THRUST", 1)}
{table("C_POWER", 2)}
</propeller>"""


def _motor() -> str:
    return f"""<brushless_dc_motor name="motor">
  <maxvolts unit="VOLTS">{MOTOR["volts"]:g}</maxvolts>
  <velocityconstant>{MOTOR["kv"]:g}</velocityconstant>
  <coilresistance unit="OHMS">{MOTOR["ohm"]:g}</coilresistance>
  <noloadcurrent unit="AMPERES">{MOTOR["no_load_a"]:g}</noloadcurrent>
</brushless_dc_motor>"""


def render() -> dict[str, str]:
    """The model's files, {name: text}, as they belong beside this one."""
    geometry = tomllib.loads((HERE / "airframe.toml").read_text())["geometry"]
    o = outline(geometry)
    header = '<?xml version="1.0"?>\n<!-- Written by build.py: change the numbers there. -->\n'
    parts = (
        _metrics_and_mass(o),
        _ground_reactions(geometry),
        _hand(),
        _propulsion(geometry),
        _flight_control(),
        _aerodynamics(Aero(o)),
    )
    model = (
        '<fdm_config name="endurance" version="2.0" release="ALPHA">\n'
        "<fileheader><description>Electric model aeroplane, see PROVENANCE.md</description></fileheader>\n"
        + "\n".join(parts)
        + "\n</fdm_config>"
    )
    return {
        "endurance.xml": f"{header}{model}\n",
        "motor.xml": f"{header}{_motor()}\n",
        "propeller.xml": f"{header}{_propeller(geometry['propeller_diameter_m'])}\n",
    }


if __name__ == "__main__":
    for name, text in render().items():
        (HERE / name).write_text(text)
