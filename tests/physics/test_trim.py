"""Trimmed flight: nothing accelerates, forces balance as they must, and what cannot be flown is refused by name."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.aeroplane.jsbsim_model import AIRCRAFT, Model
from sim.aeroplane.jsbsim_plant import JsbsimPlant, rotation_of
from sim.aeroplane.trim import Search, Trim, accelerations, earth_to_body, surfaces, trim
from sim.air import Air
from sim.log import Log
from sim.plant import InFlight
from sim.truth import gravity_m_s2

NAMES = sorted(p.parent.name for p in AIRCRAFT.glob("*/airframe.toml"))
HEIGHT_M = 60.0
CORIOLIS = 2.0 * 7.292115e-5  # m/s2 per m/s

FLIGHTS = {
    "level": {},
    "slow": {"airspeed_m_s": 8.0},
    "fast": {"airspeed_m_s": 20.0},
    "climb at full throttle": {"throttle": 1.0},
    "climb of 0.1 rad": {"climb_rad": 0.1},
    "glide": {"throttle": 0.0},
    "level turn right": {"bank_rad": math.radians(45.0)},
    "level turn left": {"bank_rad": math.radians(-45.0)},
    "gliding turn": {"bank_rad": math.radians(30.0), "throttle": 0.0},
    "level in wind": {"heading_rad": 1.0, "wind_e_m_s": (3.0, -4.0, 0.0)},
    "level turn in wind and updraft": {"bank_rad": 0.5, "heading_rad": 2.0, "wind_e_m_s": (-5.0, 2.0, -1.0)},
}


@pytest.fixture(scope="module")
def model():
    return Model("endurance", 200)


def place(model, t, settle, heading_rad=0.0, wind_e_m_s=(0.0, 0.0, 0.0)):
    """Put the model into the trim and spin the propeller up in simulated time."""
    euler_rad = t.euler_rad(heading_rad)
    v_b = t.air_velocity_b_m_s + earth_to_body(wind_e_m_s, euler_rad)
    model.place(HEIGHT_M, euler_rad, v_b, t.omega_b_rad_s, t.command, Air(wind_e_m_s=wind_e_m_s), settle)


def specific_force_e(model, t):
    """All forces but gravity over mass, earth axes, heading north."""
    R_eb = np.empty((3, 3))
    rotation_of(*t.euler_rad(), R_eb)
    return R_eb @ model.force_and_moment()[0] / model.mass_kg()


@pytest.mark.parametrize("flight", FLIGHTS.values(), ids=FLIGHTS)
def test_trim_of_every_kind_leaves_no_acceleration(model, flight):
    """All six accelerations below 1e-9, in a model of its own whose propeller has turned for four seconds."""
    options = {"airspeed_m_s": 12.6} | flight
    t = trim(model, height_m=HEIGHT_M, **options)
    other = Model("endurance", 200)
    heading_rad, wind = options.get("heading_rad", 0.0), options.get("wind_e_m_s", (0.0, 0.0, 0.0))
    place(other, t, 800, heading_rad, wind)
    left = other.accelerations()
    # The wind turns in the body's axes as the body turns: that part is not the aeroplane's.
    left[:3] += np.cross(t.omega_b_rad_s, earth_to_body(wind, t.euler_rad(heading_rad)))
    np.testing.assert_allclose(left, 0.0, rtol=0, atol=1e-9)  # measured 1e-10 and below
    assert t.beta_rad == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_glide_of_every_aircraft_leaves_no_acceleration(name):
    """With or without motor and ailerons: the glide at cruise speed and a turn of 20 degrees in it."""
    model = Model(name, 200)
    speed = model.airframe["cruise"]["airspeed_m_s"]
    for bank_rad in (0.0, math.radians(20.0)):
        t = trim(model, speed, HEIGHT_M, throttle=0.0, bank_rad=bank_rad)
        np.testing.assert_allclose(accelerations(model, t, HEIGHT_M), 0.0, rtol=0, atol=1e-9)
        assert t.climb_rad < 0.0


def test_glide_path_is_the_ratio_of_drag_to_lift(model):
    """In a straight glide the forces across and along the path carry cos and sin of its angle of the weight."""
    t = trim(model, 9.0, HEIGHT_M, throttle=0.0)
    place(model, t, 2)
    north, _, down = specific_force_e(model, t)
    along = north * math.cos(t.climb_rad) - down * math.sin(t.climb_rad)
    across = -north * math.sin(t.climb_rad) - down * math.cos(t.climb_rad)
    g = gravity_m_s2(math.radians(42.8))
    # The turning earth bends and lifts the path by no more than Coriolis does, and g falls by 2e-4 over 60 m.
    allowed = CORIOLIS * 9.0 + 3e-4
    np.testing.assert_allclose([along, across], [g * math.sin(t.climb_rad), g * math.cos(t.climb_rad)], 0, allowed)


@pytest.mark.parametrize("bank_deg", [-45.0, 15.0, 30.0, 60.0])
def test_level_turn_is_pulled_round_by_its_forces(model, bank_deg):
    """The horizontal force across the path is V times the rate of turn, the vertical one the weight, none along it."""
    t = trim(model, 14.0, HEIGHT_M, bank_rad=math.radians(bank_deg))
    place(model, t, 800)
    g = gravity_m_s2(math.radians(42.8))
    force_e = specific_force_e(model, t)
    allowed = CORIOLIS * 14.0 + 3e-4
    R_eb = np.empty((3, 3))
    rotation_of(*t.euler_rad(), R_eb)
    north, east, _ = R_eb @ t.air_velocity_b_m_s / 14.0
    along, across = north * force_e[0] + east * force_e[1], north * force_e[1] - east * force_e[0]
    measured = [along, across, force_e[2]]
    np.testing.assert_allclose(measured, [0.0, 14.0 * t.turn_rate_rad_s, -g], rtol=0, atol=allowed)
    assert math.copysign(1.0, t.turn_rate_rad_s) == math.copysign(1.0, bank_deg)


@pytest.mark.parametrize("bank_deg", [-30.0, 30.0, 45.0])
def test_level_turn_without_sideslip_follows_the_bank(model, bank_deg):
    """tan(bank) = V * rate / g within 2 %: fin and rudder, opposed in moment, are opposed in force as well."""
    t = trim(model, 14.0, HEIGHT_M, bank_rad=math.radians(bank_deg))
    assert 14.0 * t.turn_rate_rad_s / 9.806 == pytest.approx(math.tan(t.roll_rad), rel=0.02)


def test_level_flight_in_wind_is_that_in_still_air(model):
    """A steady wind shifts the frame: it changes the trim no more than the turning earth does (5 m/s: 7e-4 m/s2)."""
    still = trim(model, 12.6, HEIGHT_M, heading_rad=1.0)
    blown = trim(model, 12.6, HEIGHT_M, heading_rad=1.0, wind_e_m_s=(3.0, -4.0, 0.0))
    change = [getattr(blown, n) - getattr(still, n) for n in ("alpha_rad", "elevator", "throttle", "roll_rad")]
    # CL / CL_alpha is 0.07 rad for g: 7e-4 m/s2 is 5e-6 rad; drag and thrust follow, the bank directly.
    np.testing.assert_allclose(change, 0.0, rtol=0, atol=2e-4)
    place(model, still, 800, 1.0, (3.0, -4.0, 0.0))
    np.testing.assert_allclose(model.accelerations()[:3], 0.0, rtol=0, atol=1.1 * CORIOLIS * 5.0)
    np.testing.assert_allclose(model.accelerations()[3:], 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (-4.0, 3.0, 0.0)])
def test_trimmed_flight_stays_trimmed_for_half_a_minute(wind):
    """Hands off for 30 s: the change of Coriolis and the integrator move speed, height and bank by no more than this.

    Measured: 0.0007 m/s, 8 mm, 0.010 deg, the most of it in the wind, for which the start does not trim.
    """
    plant = JsbsimPlant(start=InFlight(heading_rad=0.7, height_m=HEIGHT_M), air=Air(wind_e_m_s=wind))
    log = Log.empty(1500)
    plant.reset(log)
    for k in range(1500):
        assert plant.advance(k, plant.trimmed.command) is None
    rows = log.truth
    bank = np.arctan2(rows["R_eb"][:, 2, 1], rows["R_eb"][:, 2, 2])
    assert np.abs(rows["airspeed_m_s"] - 12.6).max() < 0.003
    assert np.abs(-rows["p_e_m"][:, 2] - HEIGHT_M).max() < 0.03
    assert np.degrees(np.abs(bank)).max() < 0.03


REFUSED = {
    "below the stall": (
        {"airspeed_m_s": 6.0},
        r"airspeed_m_s 6\.0 m/s: no level trim at 60 m, below the stall: .*above",
    ),
    "stalled in a turn": ({"airspeed_m_s": 9.0, "bank_rad": 1.2}, r"no level turn trim .*below the stall"),
    "faster than the motor": ({"airspeed_m_s": 25.0}, r"no level trim .*throttle would exceed 1: .*full throttle"),
    "steeper than the motor": ({"climb_rad": 0.9}, r"no climbing trim .*throttle would exceed 1"),
    "steeper than the glide": ({"climb_rad": -0.4}, r"no descending trim .*throttle would exceed 0: .*motor off"),
    "climb and throttle": ({"climb_rad": 0.1, "throttle": 0.5}, r"climb_rad 0\.1 and throttle 0\.5: give one"),
    "throttle beyond 1": ({"throttle": 1.5}, r"throttle 1\.5: choose 0 to 1"),
    "no speed": ({"airspeed_m_s": math.nan}, r"airspeed_m_s nan m/s: choose"),
    "knife edge": ({"bank_rad": 1.57}, r"bank_rad 1\.57 rad: choose"),
    "straight up": ({"climb_rad": 1.5}, r"climb_rad 1\.5 rad: choose"),
}


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_flight_that_cannot_be_is_refused_by_what_it_lacks(model, options, message):
    with pytest.raises(ValueError, match=message):
        trim(model, height_m=HEIGHT_M, **({"airspeed_m_s": 12.6} | options))


@pytest.mark.parametrize("name", [n for n in NAMES if not Model(n, 200).powered])
def test_aircraft_without_a_motor_glides_and_says_why_it_does_not_climb(name):
    model = Model(name, 200)
    speed = model.airframe["cruise"]["airspeed_m_s"]
    assert trim(model, speed).climb_rad < 0.0
    with pytest.raises(ValueError, match=r"climb_rad 0\.0: .* has no motor"):
        trim(model, speed, climb_rad=0.0)


def test_aileron_is_found_where_there_is_one(model):
    assert surfaces(model) == ("aileron", "elevator", "rudder")


def test_pitch_and_velocity_of_a_trim_give_its_path(model):
    """The body velocity, turned to earth axes, climbs at the angle that was asked, whatever bank and sideslip."""
    t = Trim(10.0, 0.1, 0.0, 0.0, beta_rad=-0.05, roll_rad=0.8, climb_rad=-0.3)
    R_eb = np.empty((3, 3))
    rotation_of(*t.euler_rad(0.4), R_eb)
    v_e = R_eb @ t.air_velocity_b_m_s
    np.testing.assert_allclose(-v_e[2], 10.0 * math.sin(-0.3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(earth_to_body(v_e, t.euler_rad(0.4)), t.air_velocity_b_m_s, rtol=0, atol=1e-12)
    turning = Trim(10.0, 0.1, 0.0, 0.0, roll_rad=0.8, turn_rate_rad_s=0.5)
    rotation_of(*turning.euler_rad(0.4), R_eb)
    np.testing.assert_allclose(R_eb @ turning.omega_b_rad_s, [0.0, 0.0, 0.5], rtol=0, atol=1e-12)


def test_trim_takes_few_evaluations(model, monkeypatch):
    """A level trim is one Jacobian and a handful of steps: at most 25 placements of the model (measured 13 to 15)."""
    calls = []
    original = Model.place
    monkeypatch.setattr(Model, "place", lambda self, *a: (calls.append(1), original(self, *a))[1])
    trim(model, 12.0, HEIGHT_M)
    assert len(calls) <= 25


@pytest.mark.parametrize("throttle", [1.0, 1.0 - 2e-5, 0.6])
def test_jacobian_at_a_bound_is_that_just_inside(model, throttle):
    """The throttle stops at 1: differences taken beyond it would say that more throttle changes nothing."""
    search = Search(model, ("throttle", "alpha_rad", "climb_rad", "roll_rad", *surfaces(model)), HEIGHT_M)
    t = Trim(14.0, 0.03, -0.05, throttle)
    column = search.jacobian(t, search.remaining(t))[:, 0]
    less, more = (search.remaining(replace(t, throttle=throttle - d)) for d in (2e-3, 0.0))
    assert column[0] > 1.0  # m/s^2 of all the throttle
    np.testing.assert_allclose(column, (more - less) / 2e-3, rtol=0, atol=0.02 * column[0])
