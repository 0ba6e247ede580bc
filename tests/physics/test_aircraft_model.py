"""The coefficients in the models' files against the class of aeroplane and against each other."""

import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from sim.aeroplane.jsbsim_model import AIRCRAFT
from sim.aircraft.design.shape import Shape

NAMES = ("endurance", "gentle_lady")


class Coefficients:
    """What the XML of an aeroplane says."""

    def __init__(self, name):
        self.name = name
        self.shape = Shape.of(AIRCRAFT / name / "airframe.toml")
        self.root = ET.parse(AIRCRAFT / name / f"{name}.xml").getroot()
        self.mass_kg = float(self.root.find("mass_balance/emptywt").text)
        self.functions = {f.get("name"): f for f in self.root.iter("function")}

    def value(self, function):
        """Product of the numbers of a function."""
        return float(np.prod([float(v.text) for v in self.functions[function].find("product").findall("value")]))

    def table(self, function):
        """Angles of attack [deg] and values, (n,) or (n, m)."""
        lines = next(self.functions[function].iter("tableData")).text.strip().splitlines()
        if len(lines[0].split()) < len(lines[1].split()):
            lines = lines[1:]
        rows = np.array([line.split() for line in lines], float)
        return rows[:, 0], rows[:, 1:].squeeze()

    def at(self, function, alpha_deg):
        return np.interp(alpha_deg, *self.table(function))

    def slope(self, function):
        """Per radian, between 0 and 4 degrees."""
        return (self.at(function, 4.0) - self.at(function, 0.0)) / np.radians(4.0)


@pytest.fixture(scope="module", params=NAMES)
def model(request):
    return Coefficients(request.param)


def test_wing_area_and_loading_are_of_the_class(model):
    """Endurance 0.37 m2 and 1.4 kg; Gentle Lady 663 square inches and 25 ounces."""
    area_m2, mass_kg = {"endurance": (0.37, 1.4), "gentle_lady": (663 * 0.0254**2, 25 * 0.0283495)}[model.name]
    assert model.shape.wing_area_m2 == pytest.approx(area_m2, rel=2e-3)
    assert float(model.root.find("metrics/wingarea").text) == pytest.approx(area_m2, rel=2e-3)
    assert model.mass_kg == pytest.approx(mass_kg, rel=2e-3)


def test_inertia_is_that_of_its_size_and_order(model):
    """Radii of gyration: 12 to 18 % of the span in roll; yaw is the greatest and below the sum (a flat body)."""
    i = {a: float(model.root.find(f"mass_balance/i{a}").text) for a in ("xx", "yy", "zz")}
    assert 0.12 < np.sqrt(i["xx"] / model.mass_kg) / model.shape.span_m < 0.18
    assert max(i["xx"], i["yy"]) < i["zz"] < i["xx"] + i["yy"]


def test_lift_stalls_and_drops(model):
    """A real stall: the greatest lift, 1.1 to 1.4, between 8 and 14 degrees, a fifth of it gone five degrees later."""
    alpha, cl = model.table("aero/force/lift-alpha")
    top = int(np.argmax(np.where(np.abs(alpha) < 25.0, cl, 0.0)))
    assert 8.0 <= alpha[top] <= 14.0
    assert 1.1 < cl[top] < 1.4
    assert model.at("aero/force/lift-alpha", alpha[top] + 5.0) < 0.8 * cl[top]


def test_lift_slope_lies_between_lifting_line_and_section(model):
    """Wing and tail: above Helmbold's slope of the wing alone, below it plus a tail without downwash."""

    def helmbold(aspect):
        return 2.0 * np.pi * aspect / (2.0 + np.sqrt(aspect**2 + 4.0))

    s, slope = model.shape, model.slope("aero/force/lift-alpha")
    tail = helmbold(s.tail_span_m / s.tail_chord_m) * s.tail_area_m2 / s.wing_area_m2
    assert helmbold(s.aspect) < slope < helmbold(s.aspect) + tail


def test_forces_at_any_angle_take_energy_out_of_the_flight(model):
    """Drag is positive everywhere: no angle of attack can drive the aeroplane."""
    assert model.table("aero/force/drag-alpha")[1].min() > 0.02


def test_pitching_moment_has_one_stable_trim_over_all_angles(model):
    """Nose-down above the trim and nose-up below it, all the way round: it always swaps ends to fly forwards."""
    alpha, cm = model.table("aero/moment/pitch-alpha")
    inside = np.abs(alpha) < 178.0
    assert (cm[inside & (alpha > 3.0)] < 0.0).all()
    assert (cm[inside & (alpha < -2.0)] > 0.0).all()


def test_static_margin_is_that_of_a_trainer(model):
    """Neutral point 10 to 20 % of the chord behind the centre of gravity (measured 16 and 17)."""
    assert 0.10 < -model.slope("aero/moment/pitch-alpha") / model.slope("aero/force/lift-alpha") < 0.20


def test_tailplane_flies_in_the_downwash(model):
    """The stiffness in pitch is far below that of a tail in free air."""
    s = model.shape
    wing = 4.7 * s.wing_x_m / s.chord_m
    free = wing - s.tail_volume * 3.7
    assert model.slope("aero/moment/pitch-alpha") > 0.8 * free


def test_pitch_damping_is_that_of_the_tail(model):
    """Cm_q is -2 a V_H l / c (1 + downwash) and a little for the wing: within a quarter (Etkin & Reid, chapter 5)."""
    s = model.shape
    expected = -2.0 * 3.6 * s.tail_volume * s.tail_arm_m / s.chord_m * 1.35
    assert model.value("aero/moment/pitch-q") == pytest.approx(expected, rel=0.25)


def test_roll_damping_vanishes_past_the_stall_and_comes_back_across_the_flow(model):
    """Damped when attached, driving within 4 degrees of the stall, a third or more with the flow across the wing."""
    alpha, roll = model.table("aero/moment/roll-p")
    stalled = alpha[np.argmax(np.where(np.abs(alpha) < 25.0, roll[:, 0], -9.0))]
    assert -0.65 < np.interp(0.0, alpha, roll[:, 0]) < -0.45
    assert 9.0 < stalled < 18.0
    assert roll[:, 0].max() > 0.3
    assert np.interp(90.0, alpha, roll[:, 0]) < -0.3 * 0.5
    assert roll[:, -1].max() < 0.0  # turning fast it is damped at any angle: no rate can run away


def test_lateral_stiffness_is_that_of_the_class(model):
    """Dihedral effect and weathercock stability, and a spiral that is slow either way (Etkin & Reid, chapter 6)."""
    dihedral, weathercock = model.value("aero/moment/roll-beta"), model.value("aero/moment/yaw-beta")
    assert {"endurance": -0.12, "gentle_lady": -0.2}[model.name] < dihedral
    assert dihedral < {"endurance": -0.07, "gentle_lady": -0.12}[model.name]
    assert 0.04 < weathercock < 0.12
    roll_r = model.at("aero/moment/roll-r", 2.0)
    assert 0.7 < dihedral * model.value("aero/moment/yaw-r") / (weathercock * roll_r) < 1.4


BROKEN = """
import shutil, sys
from pathlib import Path
from sim.aeroplane import jsbsim_model
copy = Path(sys.argv[1])
shutil.copytree(jsbsim_model.AIRCRAFT / "endurance", copy / "endurance")
model = copy / "endurance" / "endurance.xml"
model.write_text(model.read_text().replace('<engine file="motor">', '<engine file="none">'))
jsbsim_model.AIRCRAFT = copy
try:
    jsbsim_model.Model("endurance", 200)
except RuntimeError as error:
    Path(sys.argv[1], "said").write_text(str(error))
"""


def test_broken_model_is_refused_by_name(tmp_path):
    """JSBSim only warns of a model without its engine; here it is an error.  In a process of its own: it may abort."""
    subprocess.run([sys.executable, "-c", BROKEN, str(tmp_path)], check=False, capture_output=True, timeout=120)
    assert "'endurance'" in (tmp_path / "said").read_text()
