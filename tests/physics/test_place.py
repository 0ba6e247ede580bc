"""The launch place in the plant: thin air, gravity, one convention of position, and the height of the ground."""

import math

import numpy as np
import pymap3d
import pytest

from autopilot.interface import ActuatorCommand
from estimator.blocks.air import DENSITY_KG_M3, density_ratio, true_over_equivalent
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.jsbsim_plant import FlightBox, JsbsimPlant
from sim.air import Air, MovingAir
from sim.clock import Rates
from sim.log import Log, Outcome
from sim.place import Place, geodetic, local, metres_per_degree
from sim.plant import InFlight
from sim.terrain import ground_height_m, moved_m
from sim.truth import gravity_m_s2

FAR = FlightBox(25_000.0, 5000.0)
COARSE = Rates(100, 50)  # the straight flight of half an hour needs no more


def straight(place, heading_deg, ticks, airspeed_m_s=17.0):
    """A trimmed flight in still air, 300 m up, with an aileron that holds the heading: truth, plant and outcome."""
    heading_rad = math.radians(heading_deg)
    start = InFlight(heading_rad, height_m=300.0, airspeed_m_s=airspeed_m_s)
    plant = JsbsimPlant(start=start, rates=COARSE, box=FAR, place=place)
    log = Log.empty(ticks)
    plant.reset(log)
    trimmed, outcome = plant.trimmed.command, None
    aileron = trimmed.aileron
    for k in range(ticks):
        if (outcome := plant.advance(k, trimmed._replace(aileron=aileron))) is not None:
            break
        if k % 5 == 0:
            R = log.truth["R_eb"][k]
            off_rad = math.remainder(heading_rad - math.atan2(R[1, 0], R[0, 0]), 2.0 * math.pi)
            wanted_rad = min(max(off_rad, -0.3), 0.3)
            aileron = trimmed.aileron + 0.3 * (wanted_rad - math.atan2(R[2, 1], R[2, 2]))
    return log.truth[: k + 1], plant, outcome


def integrated(truth):
    """The integral of the local velocity from the first row on, by the trapezoidal rule."""
    v, dt_s = truth["v_e_m_s"], truth["t_s"][1] - truth["t_s"][0]
    return 0.5 * dt_s * (v[1:] + v[:-1]).sum(axis=0)


@pytest.mark.parametrize(
    ("place", "heading_deg"),
    [
        (Place(), 45.0),
        pytest.param(Place(), 180.0, marks=pytest.mark.long),
        (Place(-35.0, 179.95, 1500.0), 90.0),
        pytest.param(Place(60.0, 10.0, 500.0), 300.0, marks=pytest.mark.long),
    ],
)
def test_position_at_20_km_is_the_integral_of_the_local_velocity(place, heading_deg):
    """Also over the date line; a tangent frame of the launch is 31 m too high there and up to 30 m off across.

    The oracle for the height is JSBSim's altitude over the ellipsoid; for the ground covered, its latitude on the
    meridian ellipse.
    """
    truth, plant, outcome = straight(place, heading_deg, 62_000)
    assert outcome is None
    way = truth["p_e_m"][-1] - truth["p_e_m"][0]
    assert math.hypot(*way[:2]) > 20_000.0
    np.testing.assert_allclose(way, integrated(truth), rtol=0, atol=1e-3)
    latitude_rad, altitude_ft = plant.model.get("position/lat-geod-rad", "position/geod-alt-ft")
    np.testing.assert_allclose(-truth["p_e_m"][-1, 2], 0.3048 * altitude_ft - place.elevation_m, rtol=0, atol=1e-6)
    # Meridian arc by Simpson's rule on its radius of curvature, raised by the height flown.
    phi = np.linspace(math.radians(place.latitude_deg), latitude_rad, 101)
    radius_m = 6378137.0 * (1.0 - 6.69437999014e-3) / (1.0 - 6.69437999014e-3 * np.sin(phi) ** 2) ** 1.5
    raised_m = place.elevation_m - truth["p_e_m"][:, 2].mean()
    weights = np.ones(101)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    arc_m = (phi[1] - phi[0]) / 3.0 * (weights @ (radius_m + raised_m))
    np.testing.assert_allclose(truth["p_e_m"][-1, 0], arc_m, rtol=0, atol=0.02)


def test_position_near_the_launch_is_that_of_its_tangent_frame():
    """Below 1 mm within 100 m, by the geodetic library's own transformation: the convention matters further out."""
    start = InFlight(0.3, height_m=60.0)
    plant = JsbsimPlant(start=start, rates=Rates())
    log = Log.empty(400)
    plant.reset(log)
    where = ("position/lat-geod-deg", "position/long-gc-deg", "position/geod-alt-ft")
    *first, first_ft = plant.model.get(*where)
    for k in range(400):
        plant.advance(k, plant.trimmed.command)
    *last, last_ft = plant.model.get(*where)
    n, e, d = pymap3d.geodetic2ned(*last, 0.3048 * last_ft, *first, 0.3048 * first_ft)
    assert math.hypot(n, e) > 90.0
    np.testing.assert_allclose(log.truth["p_e_m"][-1] - (0.0, 0.0, -60.0), (n, e, d), rtol=0, atol=1e-3)


def test_motion_over_the_ellipsoid_takes_the_short_way_over_the_date_line():
    """From 179.9999 east to 179.9999 west is east, and the same as anywhere else on that parallel."""
    across = moved_m(0.5, 0.0, math.radians(-179.9999 - 179.9999), 100.0)
    along = moved_m(0.5, 0.0, math.radians(0.0002), 100.0)
    np.testing.assert_allclose(across, along, rtol=0, atol=1e-6)
    assert across[1] > 0.0


@pytest.mark.parametrize("place", [Place(), Place(-33.9, 151.2, 20.0), Place(64.1, -21.9, 3000.0), Place(0.1, 180.0)])
def test_latitude_and_longitude_of_positions_and_back(place):
    """To a nanometre within 20 km, also over date line and equator; longitudes stay within 180 degrees."""
    p_e_m = np.random.default_rng(3).uniform(-20e3, 20e3, (200, 3))
    there = place.geodetic(p_e_m)
    assert np.abs(there[:, 1]).max() <= 180.0
    np.testing.assert_allclose(place.local(*there.T), p_e_m, rtol=0, atol=1e-7)
    north_m, east_m = metres_per_degree(place.latitude_deg, place.elevation_m)
    moved = np.array(moved_m(place.latitude_rad, math.radians(1.0), math.radians(1.0), place.elevation_m))
    np.testing.assert_allclose((north_m, east_m), moved, rtol=1e-12, atol=0)
    assert geodetic(np.zeros((1, 3)), 12.0, 34.0, 56.0).tolist() == [[12.0, 34.0, 56.0]]
    assert local(12.0, 34.0, 56.0, 12.0, 34.0, 56.0).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("aircraft", ["endurance", "gentle_lady"])
@pytest.mark.parametrize(
    ("latitude_deg", "elevation_m"), [(42.8, 4000.0), (-35.0, 2500.0), (89.0, 0.0), (31.5, -430.0)]
)
def test_flight_begins_trimmed_anywhere_at_the_same_equivalent_airspeed(aircraft, latitude_deg, elevation_m):
    """Thinner air needs a faster flight, by the root of the density; density and gravity are those of JSBSim."""
    place = Place(latitude_deg, 7.0, elevation_m)
    plant = JsbsimPlant(aircraft, start=InFlight(1.0, height_m=60.0), rates=Rates(), place=place)
    log = Log.empty(50)
    plant.reset(log)
    for k in range(50):
        assert plant.advance(k, plant.trimmed.command) is None
    row = log.truth[49]
    cruise_m_s = plant.airframe["cruise"]["airspeed_m_s"]
    np.testing.assert_allclose(row["airspeed_m_s"] / true_over_equivalent(elevation_m), cruise_m_s, rtol=2e-3, atol=0)
    above_m = elevation_m - row["p_e_m"][2]
    rho = DENSITY_KG_M3 * density_ratio(above_m)
    np.testing.assert_allclose(plant.model.density_kg_m3(), rho, rtol=4e-4, atol=0)
    # What the aeroplane feels: its own forces per mass, in JSBSim's field of gravity.
    felt = plant.model.force_and_moment()[0] / plant.model.mass_kg()
    np.testing.assert_allclose(row["imu_force_b_m_s2"], felt, rtol=0, atol=0.02)


def test_gravity_falls_with_height_as_in_the_free_air():
    """0.3086 mGal a metre, the free-air gradient of textbooks."""
    at_sea, high = gravity_m_s2(math.pi / 4), gravity_m_s2(math.pi / 4, 4000.0)
    np.testing.assert_allclose((at_sea - high) / 4000.0, 3.086e-6, rtol=2e-3, atol=0)
    np.testing.assert_allclose(at_sea, 9.80620, rtol=0, atol=1e-5)
    assert gravity_m_s2(0.7) == gravity_m_s2(0.7, 0.0)


@pytest.mark.parametrize("rises_m", [-30.0, 40.0])
def test_height_of_the_ground_is_a_step_with_a_slope(rises_m):
    """Level near the launch, a slope of 1 in 3 from there on; the kernel and the place agree."""
    place = Place(ground_m=rises_m, ground_from_m=50.0)
    for out_m, share in ((0.0, 0.0), (50.0, 0.0), (50.0 + 1.5 * abs(rises_m), 0.5), (1e4, 1.0)):
        n, e = out_m * math.cos(2.0), out_m * math.sin(2.0)
        assert place.ground_at_m(n, e) == pytest.approx(share * rises_m, abs=1e-9)
        assert ground_height_m(n, e, rises_m, 50.0) == pytest.approx(share * rises_m, abs=1e-9)
    assert Place().ground_at_m(1e4, 0.0) == 0.0


@pytest.mark.parametrize(("ground_m", "ends"), [(-100.0, None), (270.0, None), (400.0, Outcome.GROUND_CONTACT)])
def test_higher_ground_is_hit_and_lower_ground_is_not(ground_m, ends):
    """At 300 m above the launch point; the slope that begins 300 m out reaches that height 900 m further."""
    truth, _, outcome = straight(Place(ground_m=ground_m, ground_from_m=300.0), 70.0, 5500)
    assert outcome is ends
    if ends:
        assert math.hypot(*truth["p_e_m"][-1, :2]) == pytest.approx(300.0 + 900.0, abs=15.0)
    else:
        assert math.hypot(*truth["p_e_m"][-1, :2]) > 1500.0


def test_glide_from_a_hill_ends_on_the_ground_below():
    """Motor off, 20 m up: on level ground it lands 20 m lower, from a hill of 30 m another 30 m lower and later."""
    ends = []
    for ground_m in (0.0, -30.0):
        start = InFlight(0.0, height_m=20.0)
        plant = JsbsimPlant(
            start=start, rates=Rates(), place=Place(elevation_m=800.0, ground_m=ground_m, ground_from_m=20.0)
        )
        log = Log.empty(3000)
        plant.reset(log)
        off = ActuatorCommand(0.0, plant.trimmed.command.elevator, 0.0, 0.0)
        k = next(k for k in range(3000) if plant.advance(k, off) is not None)
        ends.append((k, -log.truth[k]["p_e_m"][2]))
    assert ends[0][1] == pytest.approx(0.0, abs=0.6)
    assert ends[1][1] == pytest.approx(-30.0, abs=0.6)
    assert ends[1][0] > ends[0][0] + 100


def test_wind_and_thermals_know_the_height_above_the_ground():
    """The power law at 40 m above a valley that is 30 m lower is that of 70 m."""
    air = Air((5.0, 0.0, 0.0), shear=0.2)
    for place, height_m in ((Place(), 40.0), (Place(ground_m=-30.0, ground_from_m=10.0), 70.0)):
        moving = MovingAir(air, 1.5, 0.02, 0.0, 0, 0, place)
        moving.start(10, (500.0, 0.0, -40.0))
        assert moving.wind_e_m_s[0] == pytest.approx(5.0 * (height_m / 10.0) ** 0.2, rel=1e-12)


def test_terrain_of_the_model_is_at_the_elevation():
    """JSBSim's own height above the terrain is that above the launch point, at any elevation."""
    for elevation_m in (0.0, 3000.0):
        model = Model("endurance", 200, site=Place(elevation_m=elevation_m))
        model.place(
            12.0, (0.0, 0.0, 0.0), np.array([12.0, 0.0, 0.0]), (0.0,) * 3, ActuatorCommand(0, 0, 0, 0), Air(), 1
        )
        agl_ft, sea_ft = model.get("position/h-agl-ft", "position/geod-alt-ft")
        np.testing.assert_allclose((0.3048 * agl_ft, 0.3048 * sea_ft), (12.0, 12.0 + elevation_m), rtol=0, atol=1e-3)
