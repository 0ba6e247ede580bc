"""The shape of the aeroplane: closed parts, outward normals, the size that the geometry says."""

import numpy as np
import pytest

from sim.mesh import KEYS, aeroplane, geometry_of, signed_volume_m3

PARTS = ("wing", "fuselage", "tailplane", "fin", "propeller")
ROUND_OFF_M = 1e-12  # a few operations on lengths of about a metre


@pytest.fixture(scope="module")
def geometry():
    return geometry_of("endurance")


@pytest.fixture(scope="module")
def parts(geometry):
    return aeroplane(geometry)


def welded(mesh):
    """Triangles of the mesh over distinct points: vertices doubled at an edge are one again."""
    _, index = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    return index[mesh.triangles]


@pytest.mark.parametrize("name", PARTS)
def test_part_edges_run_once_in_each_direction(parts, name):
    """A closed, consistently turned surface has every edge twice, once each way; none is doubled or open."""
    triangles = welded(parts[name])
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges)
    assert {(b, a) for a, b in directed} == directed


@pytest.mark.parametrize("name", PARTS)
def test_part_euler_characteristic_is_that_of_a_sphere(parts, name):
    """Vertices - edges + faces = 2: no holes, no handles, nothing left over."""
    triangles = welded(parts[name])
    n_faces = len(triangles)
    assert len(np.unique(triangles)) - 3 * n_faces // 2 + n_faces == 2


@pytest.mark.parametrize("name", PARTS)
def test_part_normals_are_unit_and_on_the_side_their_triangles_face(parts, name):
    """Outward: the enclosed volume is positive, and every corner's normal lies within a right angle of its face."""
    mesh = parts[name]
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    face = np.cross(b - a, c - a)
    assert signed_volume_m3(mesh) > 0.0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=0, atol=1e-12)
    for corner in range(3):
        assert np.all(np.einsum("ij,ij->i", mesh.normals[mesh.triangles[:, corner]], face) > 0.0)


def test_every_part_mirrored_is_itself(parts):
    """Left and right are alike: the points mirrored in the plane of symmetry are the same set of points."""
    for mesh in parts.values():
        points = {tuple(p) for p in np.round(mesh.vertices, 9) + 0.0}
        mirrored = {tuple(p) for p in np.round(mesh.vertices * [1.0, -1.0, 1.0], 9) + 0.0}
        assert mirrored == points


def test_extents_equal_the_geometry(parts, geometry):
    """Each length of the table is found again in the vertices."""
    low = {name: mesh.vertices.min(axis=0) for name, mesh in parts.items()}
    high = {name: mesh.vertices.max(axis=0) for name, mesh in parts.items()}
    size = {name: high[name] - low[name] for name in parts}
    tail_z_m = high["fin"][2]
    expected = {
        size["wing"][1]: geometry["span_m"],
        size["wing"][0]: geometry["root_chord_m"],
        high["wing"][0]: geometry["wing_x_m"] + 0.25 * geometry["root_chord_m"],
        size["fuselage"][0]: geometry["fuselage_length_m"],
        size["fuselage"][1]: geometry["fuselage_width_m"],
        size["fuselage"][2]: geometry["fuselage_height_m"],
        high["fuselage"][0]: geometry["nose_x_m"],
        size["tailplane"][0]: geometry["tail_chord_m"],
        size["tailplane"][1]: geometry["tail_span_m"],
        high["tailplane"][0]: -geometry["tail_arm_m"] + 0.25 * geometry["tail_chord_m"],
        size["fin"][0]: geometry["fin_chord_m"],
        tail_z_m - low["fin"][2]: geometry["fin_height_m"],
        size["propeller"][1]: geometry["propeller_diameter_m"],
        size["propeller"][2]: geometry["propeller_diameter_m"],
    }
    np.testing.assert_allclose(list(expected), list(expected.values()), rtol=0, atol=ROUND_OFF_M)


def test_wing_tips_rise_by_the_dihedral(geometry):
    """Six degrees more of dihedral lift the quarter chord of the tips by the half span times the tangents' gain."""
    half_span_m = 0.5 * geometry["span_m"]
    tips = []
    for dihedral_deg in (0.0, 6.0):
        wing = aeroplane({**geometry, "dihedral_deg": dihedral_deg})["wing"].vertices
        tips.append(wing[wing[:, 1] > half_span_m - 1e-9][:, 2])
    np.testing.assert_allclose(tips[0] - tips[1], half_span_m * np.tan(np.radians(6.0)), rtol=0, atol=ROUND_OFF_M)


@pytest.mark.parametrize("key", KEYS)
def test_geometry_without_a_key_is_refused_by_its_name(geometry, key):
    lacking = {name: value for name, value in geometry.items() if name != key}
    with pytest.raises(ValueError, match=key):
        aeroplane(lacking)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_geometry_with_an_impossible_length_is_refused_with_its_value(geometry, value):
    with pytest.raises(ValueError, match=rf"span_m = {value:g}"):
        aeroplane({**geometry, "span_m": value})


def test_unknown_aircraft_is_refused_by_its_name():
    with pytest.raises(ValueError, match="'zeppelin'"):
        geometry_of("zeppelin")
