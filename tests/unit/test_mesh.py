"""The shape of the aeroplanes: closed parts, outward normals, the size the geometry says, hinges that turn aright."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sim import aircraft as aircraft_package
from sim.view.loft import section, signed_volume_m3
from sim.view.mesh import KEYS, PANELS, STRAIGHT_WING, aeroplane, geometry_of

ROUND_OFF_M = 1e-12  # a few operations on lengths of about a metre
STRAIGHT = {
    "span_m": 1.60, "root_chord_m": 0.26, "tip_chord_m": 0.2025, "dihedral_deg": 5.0, "wing_x_m": 0.012,
    "wing_z_m": -0.045, "fuselage_length_m": 1.10, "nose_x_m": 0.40, "fuselage_height_m": 0.11,
    "fuselage_width_m": 0.08, "tail_arm_m": 0.66, "tail_span_m": 0.52, "tail_chord_m": 0.13, "fin_height_m": 0.20,
    "fin_chord_m": 0.16, "propeller_diameter_m": 0.254, "rudder_throw_deg": 20.0,
}  # fmt: skip
POLYHEDRAL = {
    "panel_y_m": [0.0, 0.56, 0.994], "panel_chord_m": [0.229, 0.229, 0.166], "panel_dihedral_deg": [5.0, 11.0],
    "wing_x_m": 0.022, "wing_z_m": -0.040, "fuselage_length_m": 1.04, "nose_x_m": 0.33, "fuselage_height_m": 0.085,
    "fuselage_width_m": 0.055, "tail_arm_m": 0.62, "tail_z_m": -0.02, "tail_span_m": 0.60, "tail_chord_m": 0.115,
    "fin_height_m": 0.22, "fin_chord_m": 0.165, "elevator_part": 0.28, "rudder_part": 0.45, "aileron_part": 0.0,
    "propeller_diameter_m": 0.0,
}  # fmt: skip
SHIPPED = sorted(path.parent.name for path in Path(aircraft_package.__file__).parent.glob("*/airframe.toml"))
AEROPLANES = {"straight": STRAIGHT, "polyhedral": POLYHEDRAL, **{name: geometry_of(name) for name in SHIPPED}}
MADE = {name: aeroplane(geometry) for name, geometry in AEROPLANES.items()}
EVERY_PART = [(name, part) for name, parts in MADE.items() for part in parts]
HINGED = [(name, part) for name, part in EVERY_PART if MADE[name][part].hinge]
# Where the trailing edge goes when the control is positive, body axes: the rotation follows from the air's push.
TRAILING_EDGE_GOES = {
    "aileron_right": (0.0, 0.0, -1.0),  # up: less lift on the right, it rolls right
    "aileron_left": (0.0, 0.0, 1.0),
    "elevator_right": (0.0, 0.0, -1.0),  # up: the tail is pushed down, the nose rises
    "elevator_left": (0.0, 0.0, -1.0),
    "rudder": (0.0, 1.0, 0.0),  # right: the tail is pushed left, the nose goes right
}


def welded(mesh):
    """Triangles of the mesh over distinct points: vertices doubled at an edge are one again."""
    _, index = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    return index[mesh.triangles]


def throw_rad(aircraft, part):
    """The deflection that the geometry asks for; 25 degrees where it says nothing."""
    return np.radians(AEROPLANES[aircraft].get(f"{part.hinge.control}_throw_deg", 25.0))


def moved(part, deflection):
    """Vertices of a hinged part at a deflection, by SciPy's rotation and the translation beside it."""
    translation, quaternion = part.hinge.pose(np.array([deflection]))
    return Rotation.from_quat(quaternion[0]).apply(part.mesh.vertices) + translation[0]


def from_hinge_m(part, points):
    """Distance of points from the hinge line."""
    return np.linalg.norm(np.cross(points - part.hinge.point_m, part.hinge.axis), axis=1)


@pytest.mark.parametrize(("aircraft", "name"), EVERY_PART)
def test_part_edges_run_once_in_each_direction(aircraft, name):
    """A closed, consistently turned surface has every edge twice, once each way; none is doubled or open."""
    triangles = welded(MADE[aircraft][name].mesh)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges)
    assert {(b, a) for a, b in directed} == directed


@pytest.mark.parametrize(("aircraft", "name"), EVERY_PART)
def test_part_euler_characteristic_is_that_of_a_sphere(aircraft, name):
    """Vertices - edges + faces = 2: no holes, no handles, nothing left over."""
    triangles = welded(MADE[aircraft][name].mesh)
    n_faces = len(triangles)
    assert len(np.unique(triangles)) - 3 * n_faces // 2 + n_faces == 2


@pytest.mark.parametrize(("aircraft", "name"), EVERY_PART)
def test_part_normals_are_unit_and_on_the_side_their_triangles_face(aircraft, name):
    """Outward: the enclosed volume is positive, and every corner's normal lies within a right angle of its face."""
    mesh = MADE[aircraft][name].mesh
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    face = np.cross(b - a, c - a)
    assert signed_volume_m3(mesh) > 0.0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=0, atol=1e-12)
    for corner in range(3):
        assert np.all(np.einsum("ij,ij->i", mesh.normals[mesh.triangles[:, corner]], face) > 0.0)


@pytest.mark.parametrize("aircraft", AEROPLANES)
def test_aeroplane_mirrored_is_itself(aircraft):
    """Left and right are alike: mirrored in the plane of symmetry, all points together are the same set of points."""
    vertices = np.vstack([part.mesh.vertices for part in MADE[aircraft].values()])
    points = {tuple(p) for p in np.round(vertices, 9) + 0.0}
    assert {tuple(p) for p in np.round(vertices * [1.0, -1.0, 1.0], 9) + 0.0} == points


@pytest.mark.parametrize("aircraft", AEROPLANES)
def test_extents_equal_the_geometry(aircraft):
    """Each length of the table is found again in the vertices, the control surfaces not deflected."""
    geometry, low, high = AEROPLANES[aircraft], {}, {}
    groups = {"tail": ("tailplane", "elevator_right", "elevator_left"), "fin": ("fin", "rudder")}
    for name in ("wing", "fuselage", "tail", "fin", "propeller"):
        found = [MADE[aircraft][part].mesh.vertices for part in groups.get(name, (name,)) if part in MADE[aircraft]]
        if found:
            low[name], high[name] = np.vstack(found).min(axis=0), np.vstack(found).max(axis=0)
    size = {name: high[name] - low[name] for name in low}
    span_m = 2.0 * geometry["panel_y_m"][-1] if "panel_y_m" in geometry else geometry["span_m"]
    root_chord_m = geometry["panel_chord_m"][0] if "panel_y_m" in geometry else geometry["root_chord_m"]
    expected = [
        (size["wing"][1], span_m),
        (size["wing"][0], root_chord_m),
        (high["wing"][0], geometry["wing_x_m"] + 0.25 * root_chord_m),
        (size["fuselage"][0], geometry["fuselage_length_m"]),
        (size["fuselage"][1], geometry["fuselage_width_m"]),
        (high["fuselage"][0], geometry["nose_x_m"]),
        (size["tail"][0], geometry["tail_chord_m"]),
        (size["tail"][1], geometry["tail_span_m"]),
        (high["tail"][0], -geometry["tail_arm_m"] + 0.25 * geometry["tail_chord_m"]),
        (size["fin"][0], geometry["fin_chord_m"]),
        (high["fin"][2], geometry.get("tail_z_m", high["fin"][2])),
        (size["fin"][2], geometry["fin_height_m"]),
    ]
    if geometry["propeller_diameter_m"] > 0.0:
        expected += [(size["propeller"][axis], geometry["propeller_diameter_m"]) for axis in (1, 2)]
    found, asked = zip(*expected, strict=True)
    np.testing.assert_allclose(found, asked, rtol=0, atol=ROUND_OFF_M)


def test_wing_tips_rise_by_the_dihedral():
    """Six degrees more of dihedral lift the quarter chord of the tips by the half span times the tangents' gain."""
    half_span_m = 0.5 * STRAIGHT["span_m"]
    tips = []
    for dihedral_deg in (0.0, 6.0):
        wing = aeroplane({**STRAIGHT, "dihedral_deg": dihedral_deg})["wing"].mesh.vertices
        tips.append(wing[wing[:, 1] > half_span_m - 1e-9][:, 2])
    np.testing.assert_allclose(tips[0] - tips[1], half_span_m * np.tan(np.radians(6.0)), rtol=0, atol=ROUND_OFF_M)


def test_panels_rise_each_by_its_own_dihedral():
    """At the joint by the inner panel's tangent, at the tip by both; against the same wing lying flat."""
    wing = MADE["polyhedral"]["wing"].mesh.vertices
    flat = aeroplane({**POLYHEDRAL, "panel_dihedral_deg": [0.0, 0.0]})["wing"].mesh.vertices
    at_joint, at_tip = np.isclose(flat[:, 1], 0.56), np.isclose(flat[:, 1], 0.994)
    joint_m = 0.56 * np.tan(np.radians(5.0))
    tip_m = joint_m + 0.434 * np.tan(np.radians(11.0))
    assert at_joint.any()
    assert at_tip.any()
    np.testing.assert_allclose((flat - wing)[at_joint, 2], joint_m, rtol=0, atol=ROUND_OFF_M)
    np.testing.assert_allclose((flat - wing)[at_tip, 2], tip_m, rtol=0, atol=ROUND_OFF_M)


def test_one_panel_is_the_straight_wing():
    """Both forms of the geometry make the same aeroplane, vertex by vertex."""
    rest = {key: value for key, value in STRAIGHT.items() if key not in STRAIGHT_WING}
    straight = dict(zip(STRAIGHT_WING, (1.6, 0.26, 0.2, 5.0), strict=True))
    panel = dict(zip(PANELS, ([0.0, 0.8], [0.26, 0.2], [5.0]), strict=True))
    one, other = aeroplane({**rest, **straight}), aeroplane({**rest, **panel})
    for name, part in one.items():
        np.testing.assert_array_equal(part.mesh.vertices, other[name].mesh.vertices)


def test_each_aeroplane_has_the_controls_and_the_propeller_of_its_geometry():
    """No part of the chord, no surface; no diameter, no propeller."""
    assert {p.hinge.control for p in MADE["straight"].values() if p.hinge} == {"aileron", "elevator", "rudder"}
    assert {p.hinge.control for p in MADE["polyhedral"].values() if p.hinge} == {"elevator", "rudder"}
    assert "propeller" in MADE["straight"]
    assert not {"propeller", "spinner"} & set(MADE["polyhedral"])
    bare = aeroplane({**POLYHEDRAL, "elevator_part": 0.0, "rudder_part": 0.0})
    assert [name for name, part in bare.items() if part.hinge] == []


@pytest.mark.parametrize(("aircraft", "name"), HINGED)
def test_surface_turns_about_its_hinge_line_by_its_throw(aircraft, name):
    """Points of the line stay; every vertex keeps its distance from it; the trailing edge turns by the throw."""
    part = MADE[aircraft][name]
    on_line = part.hinge.point_m + np.outer([-0.3, 0.0, 0.7], part.hinge.axis)
    translation, quaternion = part.hinge.pose(np.array([0.6]))
    stays = Rotation.from_quat(quaternion[0]).apply(on_line) + translation[0]
    np.testing.assert_allclose(stays, on_line, rtol=0, atol=ROUND_OFF_M)
    before, after = part.mesh.vertices, moved(part, 0.6)
    np.testing.assert_allclose(from_hinge_m(part, after), from_hinge_m(part, before), rtol=0, atol=ROUND_OFF_M)
    edge = np.argmin(before[:, 0])
    arms = [p[edge] - part.hinge.point_m for p in (before, after)]
    one, other = (arm - part.hinge.axis * (arm @ part.hinge.axis) for arm in arms)
    angle_rad = np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)
    np.testing.assert_allclose(angle_rad, 0.6 * throw_rad(aircraft, part), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("aircraft", "name"), HINGED)
def test_positive_control_moves_the_trailing_edge_so_that_the_rotation_follows(aircraft, name):
    """By the sine of the throw of its arm, to the side that the sign convention of the controls asks for."""
    part = MADE[aircraft][name]
    edge = np.argmin(part.mesh.vertices[:, 0])
    went = (moved(part, 1.0) - part.mesh.vertices)[edge]
    arm_m = from_hinge_m(part, part.mesh.vertices)[edge]
    along = went @ np.array(TRAILING_EDGE_GOES[name])
    # Camber slopes an aileron's arm by 4 deg, which costs 1 - (sin 29 - sin 4) / sin 25 = 2 %; dihedral 1 - cos 5.
    np.testing.assert_allclose(along, arm_m * np.sin(throw_rad(aircraft, part)), rtol=0.03, atol=0)


@pytest.mark.parametrize(("aircraft", "name"), HINGED)
def test_front_of_a_surface_stays_inside_what_it_is_hinged_to(aircraft, name):
    """The nose is round about the hinge and thinner than the fixed part there: it comes out at no deflection."""
    part = MADE[aircraft][name]
    fixed = MADE[aircraft][{"aileron": "wing", "elevator": "tailplane", "rudder": "fin"}[part.hinge.control]].mesh
    for deflection in (-1.0, 0.0, 1.0):
        points = moved(part, deflection)
        # Within the span of the part, how thick the fixed part is at the hinge: the furthest of its rear face.
        ahead = points[points[:, 0] > part.hinge.point_m[0] + 1e-4]
        rear = fixed.vertices[from_hinge_m(part, fixed.vertices) < 0.03]
        thick = np.sort(from_hinge_m(part, rear))[-1]
        assert len(ahead) > 0
        assert from_hinge_m(part, ahead).max() < thick


def test_hinged_section_has_a_nose_of_constant_radius_below_the_skin():
    """Of all points ahead of the hinge none is further from it than nine tenths of the half thickness there."""
    s = section(0.12, 0.03, 0.75)
    ahead = s.hinged[s.hinged[:, 0] < 0.75 - 1e-9]
    radius = np.linalg.norm(ahead - s.axis, axis=1)
    at_hinge = s.whole[np.isclose(s.whole[:, 0], 0.75)]
    half_thickness = 0.5 * np.ptp(at_hinge[:, 1])
    np.testing.assert_allclose(radius, 0.9 * half_thickness, rtol=0, atol=1e-12)
    np.testing.assert_allclose(s.axis[1], at_hinge[:, 1].mean(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("thickness", [0.08, 0.12])
def test_section_thickness_is_that_of_the_naca_four_digits(thickness):
    """At half chord the tabulated 5.294 % of NACA 0012 (Abbott & von Doenhoff), less what closing the edge takes."""
    whole = section(thickness, 0.0, 0.5).whole
    at_half = whole[np.isclose(whole[:, 0], 0.5)]
    closing = 5.0 * thickness * (0.1036 - 0.1015) * 0.5**4
    tabulated = 0.05294 / 0.12 * thickness
    # The table has five digits, rounded: 5e-6 a side.
    np.testing.assert_allclose(np.ptp(at_half[:, 1]), 2.0 * (tabulated - closing), rtol=0, atol=1e-5)
    assert np.ptp(whole[:, 1]) <= thickness * 1.0005


@pytest.mark.parametrize("key", KEYS + STRAIGHT_WING)
def test_geometry_without_a_key_is_refused_by_its_name(key):
    lacking = {name: value for name, value in STRAIGHT.items() if name != key}
    with pytest.raises(ValueError, match=key):
        aeroplane(lacking)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_geometry_with_an_impossible_length_is_refused_with_its_value(value):
    with pytest.raises(ValueError, match=rf"tail_span_m = {value:g}"):
        aeroplane({**STRAIGHT, "tail_span_m": value})


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"panel_y_m": [0.0, 0.6, 0.5]}, "panel_y_m"),
        ({"panel_chord_m": [0.2, 0.2]}, "panel_y_m"),
        ({"elevator_part": 1.2}, r"elevator_part = 1\.2"),
        ({"rudder_throw_deg": 120.0}, r"rudder_throw_deg = 120"),
        ({"aileron_part": 0.2, "aileron_y_m": [0.5, 1.5]}, r"aileron_y_m = \[0\.5, 1\.5\]"),
    ],
)
def test_geometry_that_does_not_fit_together_is_refused_by_name(wrong, named):
    with pytest.raises(ValueError, match=named):
        aeroplane({**POLYHEDRAL, **wrong})


def test_unknown_aircraft_is_refused_by_its_name():
    with pytest.raises(ValueError, match="'zeppelin'"):
        geometry_of("zeppelin")
