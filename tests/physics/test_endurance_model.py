"""The aeroplane's coefficients and files against closed forms and published figures."""

import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from sim.aircraft.endurance.aero import Aero, lift_slope, plate_normal

from sim.aircraft.endurance import build


@pytest.fixture(scope="module")
def geometry():
    return tomllib.loads((build.HERE / "airframe.toml").read_text())["geometry"]


@pytest.fixture(scope="module")
def aero(geometry):
    return Aero(build.outline(geometry))


@pytest.mark.parametrize("name", ["endurance.xml", "motor.xml", "propeller.xml"])
def test_committed_model_equals_what_build_writes(name):
    """The XML is a product: `python -m sim.aircraft.endurance.build` makes it anew."""
    assert (build.HERE / name).read_text() == build.render()[name]


def test_tables_over_all_angles_close_and_are_sorted():
    """Each table over alpha runs from -180 to 180 degrees, ends where it began, and has no step in between."""
    tables = [
        np.array(data.text.split(), float).reshape(-1, 2)
        for data in ET.fromstring(build.render()["endurance.xml"]).iter("tableData")
    ]
    assert len(tables) == 5
    for table in tables:
        alpha, value = table.T
        assert (alpha[0], alpha[-1]) == (-180.0, 180.0)
        assert (np.diff(alpha) > 0.0).all()
        # The tables are written with five digits.
        assert abs(value[0] - value[-1]) < 1e-4
        assert np.abs(np.diff(value)).max() < 0.6


def test_lift_slope_thin_and_long_wings_meet_their_limits():
    """Helmbold: 2 pi for a wing without end, pi A / 2 for a very slender one (Jones)."""
    assert lift_slope(1e6) == pytest.approx(2.0 * np.pi, rel=1e-5)
    assert lift_slope(1e-3) == pytest.approx(np.pi * 1e-3 / 2.0, rel=1e-3)


@pytest.mark.parametrize("aspect", [4.0, 6.92, 15.0])
def test_plate_across_the_flow_has_the_drag_of_viterna_and_corrigan(aspect):
    """Normal force at 90 degrees against another published fit, 1.11 + 0.018 A (NASA TM-82944), within 6 %."""
    assert plate_normal(np.pi / 2.0, 1.98, aspect) == pytest.approx(1.11 + 0.018 * aspect, rel=0.06)


def test_wing_area_and_loading_are_of_the_class(geometry):
    """0.37 m2, and 1.4 kg on it."""
    area = build.outline(geometry).wing_area_m2
    assert area == pytest.approx(0.37, rel=0, abs=1e-6)
    assert build.MASS_KG / area == pytest.approx(3.78, rel=0, abs=0.01)


def test_lift_stalls_between_eleven_and_fourteen_degrees_and_drops(aero):
    """A real stall: the greatest lift near 12 degrees, a fifth of it gone four degrees later."""
    degrees = np.arange(0.0, 25.0, 0.1)
    cl, _, _ = aero.lift_drag_pitch(np.radians(degrees))
    top = int(np.argmax(cl))
    assert 11.0 <= degrees[top] <= 14.0
    assert 1.1 < cl[top] < 1.4
    assert cl[top + 50] < 0.8 * cl[top]


def test_forces_at_any_angle_take_energy_out_of_the_flight(aero):
    """Drag is positive everywhere: no angle of attack can drive the aeroplane."""
    _, cd, _ = aero.lift_drag_pitch(np.radians(np.arange(-180.0, 180.5, 0.5)))
    assert cd.min() > 0.03


def test_pitching_moment_has_one_stable_trim_over_all_angles(aero):
    """Nose-down above the trim and nose-up below it, all the way round: it always swaps ends to fly forwards."""
    degrees = np.arange(-178.0, 178.5, 0.5)
    _, _, cm = aero.lift_drag_pitch(np.radians(degrees))
    assert (cm[degrees > 2.0] < 0.0).all()
    assert (cm[degrees < 0.0] > 0.0).all()


def test_static_margin_is_that_of_a_trainer(aero):
    """Neutral point 10 to 20 % of the chord behind the centre of gravity."""
    assert 0.10 < -aero.cm_alpha / aero.cl_alpha < 0.20


def test_roll_damping_vanishes_past_the_stall_and_comes_back_across_the_flow(aero):
    """None just past the stall, most of it at small angles, a third or more with the flow across the wing."""
    shape = aero.roll_shape(np.radians([0.0, 14.0, 15.0, 90.0]))
    np.testing.assert_allclose(shape[:3], [1.0, 0.0, 0.0], rtol=0, atol=0.01)
    assert 0.3 < shape[3] < 0.7
    assert (aero.roll_shape(np.radians(np.arange(-180.0, 181.0))) >= 0.0).all()


def test_lateral_coefficients_near_neutral_spiral(aero):
    """Spiral: Cl_beta Cn_r against Cn_beta Cl_r, within a third of each other (Etkin & Reid, chapter 6)."""
    ratio = (aero.cl_beta * aero.cn_r) / (aero.cn_beta * aero.cl_r)
    assert 0.75 < ratio < 1.35


BROKEN = """
import shutil, sys
from pathlib import Path
from sim import jsbsim_plant
copy = Path(sys.argv[1])
shutil.copytree(jsbsim_plant.AIRCRAFT / "endurance", copy / "endurance")
model = copy / "endurance" / "endurance.xml"
model.write_text(model.read_text().replace('<engine file="motor">', '<engine file="none">'))
jsbsim_plant.AIRCRAFT = copy
try:
    jsbsim_plant.Model("endurance", 200)
except RuntimeError as error:
    Path(sys.argv[1], "said").write_text(str(error))
"""


def test_broken_model_is_refused_by_name(tmp_path):
    """JSBSim only warns of a model without its engine; here it is an error.  In a process of its own: it may abort."""
    subprocess.run([sys.executable, "-c", BROKEN, str(tmp_path)], check=False, capture_output=True, timeout=120)
    assert "'endurance'" in (tmp_path / "said").read_text()
