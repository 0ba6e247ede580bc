"""What the autopilot believes of the aeroplane, against the trimmed model: at any speed, either side up."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from scipy.optimize import least_squares

from autopilot.airframes import params_of
from autopilot.dcm import _GROUPS, _MEMORY, _PARAMS, _STATE
from autopilot.energy import level_flight
from autopilot.lift import feel_lift
from estimator.interface import MEASURED_DTYPE
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.performance import measure
from sim.aeroplane.trim import Trim, accelerations, trim


@pytest.fixture(scope="module")
def endurance():
    return Model("endurance", 200)


def believed(aircraft, airspeed_m_s, *, inverted=0):
    p, s = np.zeros(1, _PARAMS["energy"]), np.zeros(1, _STATE)[0]
    p[0] = astuple(params_of(aircraft).energy)
    s["airspeed_wanted_m_s"], s["inverted"], s["true_factor"] = airspeed_m_s, inverted, 1.0
    return level_flight(s, p[0])


@pytest.mark.parametrize("airspeed_m_s", [9.0, 10.0, 12.6, 15.0, 18.0])
def test_level_flight_upright_is_that_of_the_trimmed_model(endurance, airspeed_m_s):
    """Pitch within 0.5 degrees, throttle within 0.05, from near the stall to near the top speed."""
    t = trim(endurance, airspeed_m_s)
    pitch_rad, throttle = believed("endurance", airspeed_m_s)
    np.testing.assert_allclose(math.degrees(pitch_rad), math.degrees(t.pitch_rad), rtol=0, atol=0.5)
    np.testing.assert_allclose(throttle, t.throttle, rtol=0, atol=0.05)


@pytest.mark.parametrize("airspeed_m_s", [14.0, 16.0])
def test_level_flight_inverted_is_that_of_the_trimmed_model(endurance, airspeed_m_s):
    """The same on its back, where nothing accelerates with the nose 7 degrees up: the autopilot flies what exists."""

    def flight(x):
        return Trim(airspeed_m_s, x[0], x[1], x[2], roll_rad=math.pi)

    found = least_squares(lambda x: accelerations(endurance, flight(x), 60.0)[[0, 2, 4]], (-0.12, -0.3, 0.7))
    assert np.abs(found.fun).max() < 1e-6
    pitch_rad, throttle = believed("endurance", airspeed_m_s, inverted=1)
    np.testing.assert_allclose(math.degrees(pitch_rad), math.degrees(flight(found.x).pitch_rad), rtol=0, atol=0.5)
    np.testing.assert_allclose(throttle, found.x[2], rtol=0, atol=0.03)


@pytest.mark.parametrize("airspeed_m_s", [6.5, 7.4, 8.0, 9.0])
def test_level_flight_of_a_sailplane_is_the_glide_of_the_trimmed_model(airspeed_m_s):
    """Without a motor the pitch is that of the glide at the speed, within 0.7 degrees."""
    t = trim(Model("gentle_lady", 200), airspeed_m_s)
    pitch_rad, throttle = believed("gentle_lady", airspeed_m_s)
    np.testing.assert_allclose(math.degrees(pitch_rad), math.degrees(t.pitch_rad), rtol=0, atol=0.7)
    assert throttle == 0.0


@pytest.mark.parametrize("aircraft", ["endurance", "gentle_lady"])
def test_stall_and_best_glide_are_those_of_the_model(aircraft):
    """Speeds that the energy loop counts on, within 3 %."""
    e, of = params_of(aircraft).energy, measure(Model(aircraft, 200))
    np.testing.assert_allclose(e.stall_m_s, of.stall.airspeed_m_s, rtol=0.03, atol=0)
    np.testing.assert_allclose(e.best_glide_m_s, of.best_glide.airspeed_m_s, rtol=0.03, atol=0)


@pytest.mark.parametrize("bank_rad", [0.0, 0.5])
@pytest.mark.parametrize("throttle", [None, 0.0])
@pytest.mark.parametrize("airspeed_m_s", [7.6, 8.7, 10.0, 12.6])
def test_airspeed_from_the_elevator_is_that_of_the_trimmed_model(endurance, airspeed_m_s, throttle, bank_rad):
    """Level, gliding and turning, from 9 % above the stall to cruise: within 6 % of the airspeed."""
    if bank_rad and airspeed_m_s < 8.0:
        return  # stalled
    t = trim(endurance, airspeed_m_s, throttle=throttle, bank_rad=bank_rad)
    params, s, row = params_of("endurance"), np.zeros(1, _STATE)[0], np.zeros(1, MEASURED_DTYPE)[0]
    p = np.zeros(1, _MEMORY)["p"][0]
    for group in _GROUPS:
        p[group] = astuple(getattr(params, group))
    accelerations(endurance, t, 60.0)
    row["force_b_m_s2"] = endurance.force_and_moment()[0] / endurance.mass_kg()
    row["gyro_b_rad_s"][1] = 9.8 / airspeed_m_s * math.tan(bank_rad) * math.sin(bank_rad) * math.cos(t.pitch_rad)
    s["elevator"] = t.command[1]
    for _ in range(500):
        feel_lift(row, s, p, 0.02)
    assert s["lift_m_s"] == pytest.approx(airspeed_m_s, rel=0.06)
