"""From outline and masses to the model: the files are what build.py writes, and its parts meet closed forms."""

import importlib
import json
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sim.aeroplane.jsbsim_model import AIRCRAFT, Model
from sim.aeroplane.trim import accelerations, trim
from sim.aircraft.design import aerodynamics, builder
from sim.aircraft.design.lattice import Attached, flap_effectiveness
from sim.aircraft.design.masses import Box, Spread, balance
from sim.aircraft.design.shape import Shape
from sim.aircraft.design.stall import Polars, plate_normal
from sim.aircraft.endurance import build

NAMES = ("endurance", "gentle_lady")
NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?|-?\d+")
RENDER = "import json, sys; from sim.aircraft.{0}.build import render; sys.stdout.write(json.dumps(render()))"


@pytest.fixture(scope="module")
def shape():
    return Shape.of(AIRCRAFT / "endurance" / "airframe.toml")


@pytest.mark.parametrize("name", NAMES)
def test_committed_model_equals_what_build_writes(name):
    """`python -m sim.aircraft.<name>.build` writes the committed files anew.

    In a process of its own, for AeroSandbox warns when it is imported.  The text is the same to the letter; the
    numbers may differ by a unit of the fourth digit, as linear algebra does between processors.
    """
    said = subprocess.run(
        [sys.executable, "-c", RENDER.format(name)], check=False, capture_output=True, text=True, timeout=300
    )
    assert said.returncode == 0, said.stderr
    files = json.loads(said.stdout)
    assert f"{name}.xml" in files
    for file, text in files.items():
        committed = (AIRCRAFT / name / file).read_text()
        assert NUMBER.sub("#", committed) == NUMBER.sub("#", text)
        was, now = (np.array(NUMBER.findall(t), float) for t in (committed, text))
        np.testing.assert_allclose(now, was, rtol=1e-4, atol=2e-4)


def test_write_puts_every_file_into_the_folder_of_the_aeroplane(tmp_path, monkeypatch):
    """What was rendered, to the letter, and nothing else."""
    files = {"kite.xml": "<fdm_config/>\n", "motor.xml": "<motor name='\u00b5'/>\n"}
    monkeypatch.setattr(builder, "render", lambda _design: files)
    builder.write(SimpleNamespace(folder=tmp_path))
    assert {file.name: file.read_text(encoding="utf-8") for file in tmp_path.iterdir()} == files


@pytest.mark.parametrize("name", NAMES)
def test_tables_over_all_angles_close_and_are_sorted(name):
    """Each table runs from -180 to 180 degrees, ends where it began, and lets no coefficient jump."""
    tables = [
        t for t in ET.parse(AIRCRAFT / name / f"{name}.xml").iter("table") if t.find("independentVar") is not None
    ]
    assert len(tables) >= 7
    for table in tables:
        lines = table.find("tableData").text.strip().splitlines()
        if len(table.findall("independentVar")) == 2:
            lines = lines[1:]
        rows = np.array([line.split() for line in lines], float)
        alpha, values = rows[:, 0], rows[:, 1:]
        assert (alpha[0], alpha[-1]) == (-180.0, 180.0)
        assert (np.diff(alpha) > 0.0).all()
        np.testing.assert_allclose(values[0], values[-1], rtol=0, atol=2e-3)
        assert np.abs(np.diff(values, axis=0)).max() < 0.9


def test_flap_effectiveness_meets_the_closed_forms():
    """Thin aerofoils: all of the chord turns the section, half of it 1/2 + 1/pi, and a small part 4 / pi sqrt(part)."""
    assert flap_effectiveness(1.0) == pytest.approx(1.0, rel=1e-12)
    assert flap_effectiveness(0.5) == pytest.approx(0.5 + 1.0 / np.pi, rel=1e-12)
    assert flap_effectiveness(1e-6) == pytest.approx(4.0 / np.pi * 1e-3, rel=1e-3)
    assert flap_effectiveness(0.0) == 0.0


def test_inertia_of_a_box_and_of_an_even_wing_meet_the_closed_forms(shape):
    """m (b2 + c2) / 12 and the rule of parallel axes; a straight spar m b2 / 12."""
    part = Box("box", 2.0, (0.0, 0.0, 0.0), (0.3, 0.2, 0.1))
    found = balance([part], shape)
    assert found.mass_kg == pytest.approx(2.0, rel=1e-12)
    expected = 2.0 / 12.0 * np.diag([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2])
    np.testing.assert_allclose(found.inertia_kg_m2, expected, rtol=0, atol=1e-12)
    ends = [Box("front", 1.0, (0.5, 0.0, 0.1)), Box("back", 1.0, (-0.5, 0.0, -0.1))]
    expected = 2.0 * np.array([[0.01, 0.0, -0.05], [0.0, 0.26, 0.0], [-0.05, 0.0, 0.25]])
    np.testing.assert_allclose(balance(ends, shape).inertia_kg_m2, expected, rtol=0, atol=1e-12)
    spar = balance([Spread("spar", 1.0, 0.0, 0.25), Box("weight", 1e-9, (0.0, 0.0, 0.0))], _flat(shape))
    # 400 points: 1 - 1 / 400^2 of the even rod.
    assert spar.inertia_kg_m2[2, 2] == pytest.approx(shape.span_m**2 / 12.0, rel=1e-5)


def _flat(shape):
    values = {**vars(shape), "wing_x_m": 0.0, "wing_z_m": 0.0, "panel_dihedral_deg": (0.0,)}
    return Shape(**{k: v for k, v in values.items() if k in Shape.__dataclass_fields__})


def test_masses_off_balance_are_refused_with_the_place_of_the_centre_of_gravity(shape):
    """The builder is told where the centre of gravity is."""
    with pytest.raises(ValueError, match=r"centre of gravity is at x, y, z = \[100\. +0\. +0\.\] mm"):
        balance([Box("battery", 0.3, (0.1, 0.0, 0.0))], shape)


def test_airframe_with_a_key_missing_or_panels_that_do_not_fit_is_refused(tmp_path):
    """One line that names the file and what is wrong."""
    text = (AIRCRAFT / "gentle_lady" / "airframe.toml").read_text()
    broken = tmp_path / "airframe.toml"
    broken.write_text(text.replace("tail_arm_m", "tail_leg_m"))
    with pytest.raises(ValueError, match="lacks tail_arm_m"):
        Shape.of(broken)
    broken.write_text(text.replace("panel_y_m = [0.0, 0.56,", "panel_y_m = [0.0, 1.56,"))
    with pytest.raises(ValueError, match=r"panel_y_m .* must rise"):
        Shape.of(broken)
    broken.write_text(text.replace("span_m = 1.988", "span_m = 2.988", 1))
    with pytest.raises(ValueError, match=r"span_m 2\.988 m is not twice"):
        Shape.of(broken)


@pytest.mark.parametrize("aspect", [4.0, 6.92, 15.0])
def test_plate_across_the_flow_has_the_drag_of_viterna_and_corrigan(aspect):
    """Normal force at 90 degrees against another published fit, 1.11 + 0.018 A (NASA TM-82944), within 6 %."""
    assert plate_normal(np.pi / 2.0, aspect) == pytest.approx(1.11 + 0.018 * aspect, rel=0.06)


@pytest.fixture(scope="module")
def polars(shape):
    """A wing with figures chosen here: roll damping of strips is -a / 6 for an even chord."""
    slope = 4.6
    zero = dict.fromkeys(Attached.__dataclass_fields__, 0.0)
    attached = Attached(
        **{**zero, "cl_zero": 0.3, "cl_alpha": slope, "cm_alpha": -0.9, "wing_cl_zero": 0.3, "wing_cl_alpha": slope,
           "roll_p": -0.5, "yaw_p": -0.04, "roll_r": 0.1, "induced": (0.05, 0.0, 0.0)}
    )  # fmt: skip
    even = {**vars(_flat(shape)), "panel_chord_m": (0.23, 0.23)}
    even = Shape(**{k: v for k, v in even.items() if k in Shape.__dataclass_fields__})
    return Polars(even, attached, np.array([-10.0, 10.0]), np.array([0.02, 0.02]), 0.01, 0.0, (-0.8, 1.35))


def test_greatest_lift_of_the_wing_is_nine_tenths_of_its_sections(polars):
    """The stall is placed by Raymer's rule."""
    a = np.radians(np.arange(0.0, 25.0, 0.05))
    lift, _, _ = polars.lift_drag_pitch(a)
    # The tailplane adds nothing here but its plate beyond the stall.
    assert lift[a < polars.stall_rad[1]].max() == pytest.approx(0.9 * 1.35, rel=0.01)


def test_roll_damping_of_strips_is_a_sixth_of_the_slope_and_scaled_to_the_lattice(polars):
    """The attached value is the lattice's; the scale is its ratio to a / 6, up to the normal force's share of drag."""
    attached, _ = polars.rolling(np.zeros(1), np.array([0.0]))
    assert attached[0, 0] == pytest.approx(-0.5, rel=1e-9)
    assert polars._strip_scale == pytest.approx(0.5 / ((4.6 + 0.03) / 6.0), rel=0.01)


def test_rolling_wing_past_the_stall_is_driven_until_it_turns_fast(polars):
    """Autorotation: damped below the stall, driven just past it, damped again at a greater helix angle and angle."""
    alpha = np.radians([4.0, 1.0 + np.degrees(polars.stall_rad[1]), 40.0])
    roll, yaw = polars.rolling(alpha, np.array([0.02, 0.2, 0.6]))
    assert roll[0, 0] < -0.4
    assert roll[1, 0] > 0.2
    assert roll[1, 2] < 0.0
    assert roll[2].max() < -0.1
    assert yaw[1, 0] > 0.1  # towards the wing that drops: it has lost the suction of its nose


def test_folding_propeller_neither_brakes_nor_is_driven():
    """Folded blades have no drag: no term for stopped blades, and no thrust or power below 0 in the tables."""
    fixed = build.DESIGN
    folding = replace(fixed, drive=replace(fixed.drive, folding=True))
    assert aerodynamics._stopped_propeller(fixed)
    assert not aerodynamics._stopped_propeller(folding)
    least = {}
    for design in (fixed, folding):
        root = ET.fromstring(builder._propeller(design.drive, design.shape.propeller_diameter_m))
        tables = [np.array(t.text.split(), float).reshape(-1, 2)[:, 1] for t in root.iter("tableData")]
        least[design.drive.folding] = [t.min() for t in tables]
    assert max(least[False]) < 0.0
    assert least[True] == [0.0, 0.0]


@pytest.mark.parametrize("name", NAMES)
def test_simple_outline_agrees_with_the_panels(name):
    """Root, tip and mean dihedral, for whoever draws a straight wing, are those of the panels."""
    g = tomllib.loads((AIRCRAFT / name / "airframe.toml").read_text())["geometry"]
    shape = Shape.of(AIRCRAFT / name / "airframe.toml")
    assert (g["root_chord_m"], g["tip_chord_m"]) == (shape.panel_chord_m[0], shape.panel_chord_m[-1])
    rise = np.degrees(np.arctan(shape.panel_rise_m[-1] / shape.panel_y_m[-1]))
    assert rise == pytest.approx(g["dihedral_deg"], rel=0, abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_every_aeroplane_says_where_its_figures_come_from(name):
    """PROVENANCE.md stands beside each model."""
    text = (Path(AIRCRAFT) / name / "PROVENANCE.md").read_text()
    assert text.count("assumption") > 10


@pytest.mark.parametrize("aircraft", ["endurance", "gentle_lady"])
def test_moments_turn_the_aeroplane_by_euler_with_the_inertia_of_its_parts(aircraft):
    """I dw = M in JSBSim, with the tensor summed here from the parts: its products have the sign of JSBSim's file."""
    design = importlib.import_module(f"sim.aircraft.{aircraft}.build").DESIGN
    model = Model(aircraft, 200)
    t = trim(model, model.airframe["cruise"]["airspeed_m_s"])
    turning = accelerations(model, replace(t, rudder=0.5), 60.0)[3:]
    moment = model.force_and_moment()[1]
    np.testing.assert_allclose(design.balance.inertia_kg_m2 @ turning, moment, rtol=0, atol=1e-3 * abs(moment[2]))
    np.testing.assert_allclose(model.inertia_tensor_kg_m2(), design.balance.inertia_kg_m2, rtol=0, atol=2e-5)
