"""From a design to the files of a JSBSim model: shape and masses -> coefficients -> XML.

Each aeroplane's `build.py` states a `Design`; `render` turns it into text.  Conventions of the models:

- Surfaces are -1..1 and positive for roll right, pitch up, yaw right: ``servo/aileron|elevator|rudder``.
- A model without a motor still has ``propulsion/engine/*`` and the throttle; they read 0.
"""

from sim.aircraft.design.aerodynamics import AIR_RATES, aerodynamics
from sim.aircraft.design.design import Design, Drive
from sim.aircraft.design.model_xml import HEADER, location, number


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
<mass_balance negated_crossproduct_inertia="false">
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
    """The throwing hand: a force and a moment on the body, zero in flight."""
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
    """Servos; positive is roll right, nose up, nose right, for commands and positions."""
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
        properties += [f"propulsion/engine/{name}" for name in ("propeller-rpm", "thrust-lbs")]
        properties += [f"fcs/throttle-{name}-norm" for name in ("cmd", "pos")]
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
    """The files of the model, {name: text}, as stored beside the aeroplane's build.py."""
    parts = [
        _metrics_and_mass(d), _ground_reactions(d), _hand(), _propulsion(d).rstrip(), _flight_control(d),
        aerodynamics(d),
    ]  # fmt: skip
    model = (
        f'<fdm_config name="{d.name}" version="2.0" release="ALPHA">\n'
        f"<fileheader><description>{d.about}</description></fileheader>\n"
        + "\n".join(part for part in parts if part) + "\n</fdm_config>\n"
    )  # fmt: skip
    files = {f"{d.name}.xml": HEADER + model}
    if d.drive is not None:
        files["motor.xml"] = HEADER + _motor(d.drive)
        files["propeller.xml"] = HEADER + _propeller(d.drive, d.shape.propeller_diameter_m)
    return files


def write(d: Design) -> None:
    """Write the files of the model."""
    for name, text in render(d).items():
        (d.folder / name).write_text(text, encoding="utf-8")
