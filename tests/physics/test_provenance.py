"""Figures of PROVENANCE.md, each against what the model gives: a figure that has drifted fails, and so does a new one.

The tables are read from the files.  A figure agrees if it is what is computed here, rounded to the digits it has.
"""

import importlib
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from scenarios.harness.commands.aircraft import make
from sim.aeroplane.jsbsim_model import AIRCRAFT, Model
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.aeroplane.trim import trim
from sim.air import STILL
from sim.log import Log
from sim.plant import InFlight

NAMES = ("endurance", "gentle_lady")
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")
HEIGHT_M = 200.0


def rows(aircraft):
    """Section, figure and value of each row of the tables."""
    section = ""
    for line in (AIRCRAFT / aircraft / "PROVENANCE.md").read_text().splitlines():
        if line.startswith("## "):
            section = line[3:]
        elif line.startswith("| ") and not line.startswith("| figure"):
            figure, value = (cell.strip() for cell in line.strip("|").split("|")[:2])
            yield section, figure, value


def agree(text, computed):
    """Whether the numbers of `text` are `computed`, rounded to the digits they have."""
    given = NUMBER.findall(text)
    if len(given) != len(computed):
        return False
    places = [len(number.partition(".")[2]) for number in given]
    return all(
        abs(float(number) - value) <= 0.5000001 * 10.0**-digits
        for number, value, digits in zip(given, computed, places, strict=True)
    )


class File:
    """The model's own file."""

    def __init__(self, aircraft):
        root = ET.parse(AIRCRAFT / aircraft / f"{aircraft}.xml").getroot()
        self.functions = {f.get("name"): f for f in root.iter("function")}

    def value(self, function):
        return math.prod(float(v.text) for v in self.functions[function].find("product").findall("value"))

    def table(self, function, alpha_deg):
        lines = next(self.functions[function].iter("tableData")).text.strip().splitlines()
        lines = [line.split() for line in lines if len(line.split()) == len(lines[1].split())]
        table = np.array(lines, float)
        return np.interp(alpha_deg, table[:, 0], table[:, 1])

    def slope(self, function):
        """Per radian, between 0 and 2 degrees."""
        return (self.table(function, 2.0) - self.table(function, 0.0)) / math.radians(2.0)


def of_the_file(aircraft):
    """Figures of the design and of the model's file, by the figure's name."""
    file, design = File(aircraft), importlib.import_module(f"sim.aircraft.{aircraft}.build").DESIGN
    shape, i = design.shape, design.balance.inertia_kg_m2
    pitch, yaw = file.value("aero/moment/pitch-elevator"), file.value("aero/moment/yaw-rudder")
    found = {
        "mass": (design.balance.mass_kg,),
        "centre of gravity": (25.0 + 100.0 * shape.wing_x_m / shape.chord_m,),
        "cruise": (design.cruise_m_s,),
        "inertia": (i[0, 0], i[1, 1], i[2, 2], -i[0, 2]),
        "lift slope, moment slope": (file.slope("aero/force/lift-alpha"), file.slope("aero/moment/pitch-alpha")),
        "pitch damping": (file.value("aero/moment/pitch-q"),),
        "dihedral effect": (file.value("aero/moment/roll-beta"),),
        "side force, yaw stiffness": (file.value("aero/force/side-beta"), file.value("aero/moment/yaw-beta")),
        "roll damping": (file.table("aero/moment/roll-p", 0.0),),
        "yaw damping": (file.value("aero/moment/yaw-r"),),
        "cross terms": (file.table("aero/moment/roll-r", 0.0), file.table("aero/moment/yaw-p", 0.0)),
        "greatest lift": (max(file.table("aero/force/lift-alpha", alpha) for alpha in range(20)),),
    }
    if aircraft == "gentle_lady":
        own = {"span": (shape.span_m,), "wing area": (shape.wing_area_m2,)}
        return found | own | {"elevator, rudder at full throw": (pitch, yaw)}
    roll, adverse = file.value("aero/moment/roll-aileron"), file.value("aero/moment/yaw-aileron")
    return found | {"aileron, elevator, rudder at full throw": (roll, adverse, pitch, yaw)}


def of_the_page(aircraft):
    """Figures that `wingslevel aircraft` computes."""
    page = make(aircraft).to_json()
    found = {
        "stall speed": page["stall_speed_m_s"],
        "best glide ratio": page["glide_ratio"],
        "speed of the best glide": page["best_glide_speed_m_s"],
        "least sink": page["min_sink_m_s"],
        "speed of the least sink": page["min_sink_speed_m_s"],
        "best climb": page["climb_m_s"],
        "speed of the best climb": page["climb_speed_m_s"],
        "steepest climb": page["climb_angle_deg"],
        "top speed": page["top_speed_m_s"],
        "static margin": 100.0 * page["static_margin"],
        "roll rate": page["roll_rate_deg_s"],
        "time to 45 deg of bank": page["time_to_45_deg_bank_s"],
    }
    return {figure: (value,) for figure, value in found.items() if value is not None}


def flown(pilot, seconds, aircraft="endurance", airspeed_m_s=None, bank_deg=None):
    """Truth of a flight in still air from the cruise, or another speed or bank; `pilot(t_s, last row, trim)`."""
    plant = JsbsimPlant(aircraft, start=InFlight(0.0, HEIGHT_M, airspeed_m_s=airspeed_m_s))
    log = Log.empty(round(seconds / plant.dt_s))
    plant.reset(log)
    t = plant.trimmed
    if bank_deg is not None:
        banked = (math.radians(bank_deg), t.pitch_rad, 0.0)
        plant.begin((0.0, 0.0, -HEIGHT_M), banked, t.air_velocity_b_m_s, command=t.command)
    for k in range(len(log)):
        assert plant.advance(k, pilot(k * plant.dt_s, log.truth[max(k - 1, 0)], t.command)) is None
    return log.truth


def bank_deg(row):
    return math.degrees(math.atan2(row["R_eb"][2, 1], row["R_eb"][2, 2]))


def static_thrust_n():
    model = Model("endurance", 200)
    model.place(10.0, (0.0, 0.0, 0.0), np.zeros(3), (0.0,) * 3, ActuatorCommand(0, 0, 0, 1.0), STILL, 400)
    return model.thrust_n()


def loop_radius_m():
    """Half the height of the loop, the wings kept from rolling."""

    def pull(_t, row, _trim):
        return ActuatorCommand(float(-0.15 * row["omega_b_rad_s"][0]), 0.7, 0.0, 1.0)

    truth = flown(pull, 6.0, airspeed_m_s=17.0)
    angle = np.cumsum(truth["imu_omega_b_rad_s"][:, 1]) * 0.02
    return 0.5 * np.ptp(truth["p_e_m"][: int(np.argmax(angle > 2.0 * np.pi)), 2])


def of_flights(aircraft):
    """Figures that must be flown."""
    if aircraft == "gentle_lady":
        model = Model(aircraft, 200)
        rudder = flown(lambda _t, _row, c: c._replace(rudder=0.5), 2.0, aircraft)
        alone = flown(lambda _t, _row, c: c, 20.0, aircraft, bank_deg=25.0)
        return {
            "sink at 7 m/s": (-trim(model, 7.0).climb_m_s,),
            "sink at 9 m/s": (-trim(model, 9.0).climb_m_s,),
            "bank after 2 s of half rudder": (bank_deg(rudder[-1]),),
            "bank of 25 deg left alone, 20 s later": (bank_deg(alone[-1]),),
        }
    pitching = flown(lambda _t, _row, _c: ActuatorCommand(0.0, 1.0, 0.0, 1.0), 1.0, airspeed_m_s=17.0)
    alone = flown(lambda t, _row, c: c._replace(aileron=0.5 if t < 0.4 else 0.0), 20.0)
    return {
        "static thrust": (static_thrust_n(),),
        "fastest pitch rate": (math.degrees(pitching["omega_b_rad_s"][:, 1].max()),),
        "radius of a loop": (loop_radius_m(),),
        "bank left alone": (bank_deg(alone[100]),),
        "bank left alone, 16 s later": (bank_deg(alone[900]),),
    }


@pytest.fixture(scope="module", params=NAMES)
def compared(request):
    """Rows of a file, and what is computed for them."""
    aircraft = request.param
    return list(rows(aircraft)), of_the_file(aircraft) | of_the_page(aircraft) | of_flights(aircraft)


def test_every_figure_is_what_the_model_gives(compared):
    listed, computed = compared
    wrong = [
        f"{figure}: {value!r}, computed {', '.join(f'{x:.5g}' for x in computed[figure])}"
        for _, figure, value in listed
        if figure in computed and not agree(value, computed[figure])
    ]
    assert wrong == []


def test_every_figure_that_comes_out_is_computed_and_every_computed_one_is_listed(compared):
    """A row that nothing computes would not be noticed when it goes wrong."""
    listed, computed = compared
    assert {figure for section, figure, _ in listed if section.startswith("What comes out")} <= set(computed)
    assert set(computed) <= {figure for _, figure, _ in listed}


@pytest.mark.parametrize("aircraft", NAMES)
def test_sentences_say_what_the_outline_gives(aircraft):
    """Figures among the words of the tables: the margin with the motor off, and the endurance's proportions."""
    file, shape = File(aircraft), importlib.import_module(f"sim.aircraft.{aircraft}.build").DESIGN.shape
    text = (AIRCRAFT / aircraft / "PROVENANCE.md").read_text()
    margin = -100.0 * file.slope("aero/moment/pitch-alpha") / file.slope("aero/force/lift-alpha")
    if aircraft == "endurance":
        assert f"static margin {margin:.0f} % with the motor off" in text
        area, aspect, tail = shape.wing_area_m2, shape.aspect, shape.tail_volume
        assert f"a wing warp of {file.value('aero/moment/roll-rig')} balances it" in text
        assert f"wing area {area:.2f} m2, aspect ratio {aspect:.1f}, tail volume {tail:.2f}" in text
    else:
        assert f"static margin {margin:.1f} %" in text
        assert f"tail volume {shape.tail_volume:.2f}" in text


@pytest.mark.parametrize(
    ("text", "computed", "same"),
    [
        ("206 deg/s", (161.0,), False),
        ("161 deg/s", (160.55,), True),
        ("6.9 m/s", (6.951,), False),
        ("0.062, 0.092 kg m2, product 0.0033", (0.0618, 0.0923, 0.00333), True),
        ("0.062", (0.0618, 0.0923), False),
        ("-0.33 /rad", (0.33,), False),
    ],
)
def test_figure_agrees_only_with_what_it_is_rounded_from(text, computed, same):
    assert agree(text, computed) is same
