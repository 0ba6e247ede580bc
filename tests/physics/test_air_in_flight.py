"""The air around the flying aeroplane: JSBSim flies in what the truth says, in the hand and out of it."""

import math

import numpy as np
import pytest

from autopilot.interface import NEUTRAL, ActuatorCommand
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.jsbsim_plant import AIR_RATES, JsbsimPlant
from sim.air import Air, Gust, MovingAir, Thermals
from sim.log import Log, Phase
from sim.plant import HandThrow, InFlight

LEVEL = InFlight(heading_rad=0.6, height_m=100.0)
THROW = HandThrow(1.0, 0.2, (0.0,) * 3, (0.5,) * 3, (0.0,) * 3, (0.0,) * 3, hold_s=2.0)


def flown(plant, seconds, command=None):
    """Truth rows of `seconds` at the trim, or under `command`."""
    log = Log.empty(round(seconds / plant.dt_s))
    plant.reset(log)
    for k in range(len(log)):
        assert plant.advance(k, command or plant.trimmed.command) is None
    return log.truth


def test_jsbsim_flies_in_the_wind_of_the_truth():
    """Airspeed, angle of attack and sideslip of JSBSim follow from the wind column and the motion."""
    air = Air((3.0, 2.0, 0.0), 6.0, 0.14, (Gust((0.0, 0.0, -2.0), 0.5, 2.0),), Thermals(((0.0, 0.0),)))
    plant = JsbsimPlant(start=LEVEL, air=air, seed=3)
    last = flown(plant, 1.5)[-1]
    through_air_b = last["R_eb"].T @ (last["v_e_m_s"] - last["wind_e_m_s"])
    found = plant.model.get("velocities/u-aero-fps", "velocities/v-aero-fps", "velocities/w-aero-fps") * 0.3048
    np.testing.assert_allclose(found, through_air_b, rtol=0, atol=1e-9)
    assert last["airspeed_m_s"] == pytest.approx(np.linalg.norm(through_air_b), rel=1e-12)


def test_wind_in_the_hand_is_that_at_the_height_of_the_hand():
    """5 m/s at 10 m with an exponent of 0.14 is 5 (1.7 / 10)^0.14 = 3.90 m/s in the hand."""
    plant = JsbsimPlant(start=THROW, air=Air((0.0, 5.0, 0.0), shear=0.14))
    rows = flown(plant, 3.5, ActuatorCommand(0.0, 0.1, 0.0, 1.0))
    held = rows[rows["phase"] == Phase.HELD]
    assert len(held) > 50
    np.testing.assert_allclose(held["wind_e_m_s"], [[0.0, 5.0 * 0.17**0.14, 0.0]] * len(held), rtol=0, atol=1e-12)
    np.testing.assert_allclose(held["airspeed_m_s"], 3.9015, rtol=0, atol=1e-4)
    # The wind of a tick is that where the aeroplane was at its beginning.
    height_m = -rows["p_e_m"][:-1, 2]
    np.testing.assert_allclose(rows["wind_e_m_s"][1:, 1], 5.0 * (height_m / 10.0) ** 0.14, rtol=0, atol=1e-9)
    assert np.ptp(height_m) > 1.0


def test_turbulence_in_the_hand_blows_past_with_the_mean_wind():
    """A standing aeroplane feels the gusts that the wind carries along, and none where there is no wind."""
    windy = flown(JsbsimPlant(start=THROW, air=Air((0.0, 5.0, 0.0), 5.0)), 1.9, NEUTRAL)
    assert windy["wind_e_m_s"].std(axis=0).min() > 0.03
    start = MovingAir(Air((0.0, 5.0, 0.0), 5.0), 1.7, 0.02, 0.0, 0)
    start.start(10, (0.0, 0.0, -1.7))
    # The first tick stands still: no airspeed was known before it.
    np.testing.assert_allclose(windy["wind_e_m_s"][0], start.wind_e_m_s, rtol=0, atol=1e-12)


def test_gust_in_flight_is_exact_and_counts_from_the_release():
    """Half the peak times 1 - cos on the truth's own clock."""
    plant = JsbsimPlant(start=THROW, air=Air((1.0, 0.0, 0.0), gusts=(Gust((0.0, 2.0, -1.0), 0.4, 1.0),)))
    rows = flown(plant, 4.0, ActuatorCommand(0.0, 0.1, 0.0, 1.0))
    part = (rows["t_s"] - plant.release_s - 0.4) / 1.0
    share = np.where((part > 0.0) & (part < 1.0), 0.5 - 0.5 * np.cos(2.0 * np.pi * part), 0.0)
    expected = np.array([1.0, 0.0, 0.0]) + share[:, None] * np.array([0.0, 2.0, -1.0])
    np.testing.assert_allclose(rows["wind_e_m_s"], expected, rtol=0, atol=1e-9)
    assert share.max() > 0.99


def test_flight_starts_trimmed_in_whatever_blows_there():
    """No jolt in the first tick by turbulence, shear or a thermal: airspeed and angle of attack are the trim's."""
    air = Air((-4.0, 3.0, 0.0), 8.0, 0.2, thermals=Thermals(((0.0, 0.0),)))
    plant = JsbsimPlant(start=LEVEL, air=air, seed=11)
    first = flown(plant, 0.1)[0]
    # In a tick the force of a change of the air of 0.1 sigma at most: some 0.02 m/s and 0.5 degrees.
    assert first["airspeed_m_s"] == pytest.approx(plant.trimmed.airspeed_m_s, rel=0, abs=0.05)
    assert first["alpha_rad"] == pytest.approx(plant.trimmed.alpha_rad, rel=0, abs=0.01)
    assert np.linalg.norm(first["wind_e_m_s"] - air.mean_wind_e_m_s(100.0)) > 0.2


def test_thermal_lifts_the_aeroplane():
    """Circling aside: flown through the centre, the wind column shows the updraft of the report."""
    plant = JsbsimPlant(start=InFlight(0.0, 60.0), air=Air(thermals=Thermals(((60.0, 0.0),))))
    up = -flown(plant, 10.0)["wind_e_m_s"][:, 2]
    assert up.max() == pytest.approx(1.7056, rel=0, abs=0.05)  # 60 m up: worked by hand from the report
    assert up[-1] < 0.2


def test_rates_of_the_air_are_written_where_the_aeroplane_has_a_place_for_them(monkeypatch):
    """The properties hold what the moving air says; an aeroplane without them flies all the same."""
    load = Model.__init__

    def with_places(self, *args):
        load(self, *args)
        for name in AIR_RATES:
            self.fdm[name] = 0.0  # JSBSim makes a property by writing it

    monkeypatch.setattr(Model, "__init__", with_places)
    plant = JsbsimPlant(start=LEVEL, air=Air((0.0, 4.0, 0.0), 8.0), seed=2)
    seen = []
    log = Log.empty(200)
    plant.reset(log)
    for k in range(len(log)):
        plant.advance(k, plant.trimmed.command)
        seen.append(plant.model.get(*AIR_RATES))
    seen = np.array(seen)
    moving = MovingAir(plant.air, 1.7, plant.dt_s, 0.0, seed=2)
    moving.state["span_m"] = plant.model.get("metrics/bw-ft")[0] * 0.3048
    moving.start(len(log), (0.0, 0.0, -100.0))
    expected = np.array([moving.blow(log.truth, k)[3:] for k in range(len(log))])
    np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-15)
    assert seen.std(axis=0).min() > 0.01


@pytest.mark.parametrize("air", [Air(), Air((5.0, -3.0, 0.0))], ids=["still", "steady"])
@pytest.mark.parametrize("start", [LEVEL, THROW], ids=["in_flight", "thrown"])
def test_air_that_is_steady_costs_nothing(air, start, monkeypatch):
    """No kernel is called, tick after tick; the wind column holds all the same."""

    def never(*_):
        raise AssertionError("the air was asked although it is steady")

    monkeypatch.setattr(MovingAir, "blow", never)
    rows = flown(JsbsimPlant(start=start, air=air), 3.0, ActuatorCommand(0.0, 0.1, 0.0, 0.8))
    np.testing.assert_allclose(rows["wind_e_m_s"], [air.wind_e_m_s] * len(rows), rtol=0, atol=1e-12)


def test_turbulence_of_several_flights_has_the_strength_of_the_standard():
    """MIL-F-8785C at 60 m: 0.1 W20 vertically, that over (0.177 + 0.000823 h_ft)^0.4 along and across the wind."""
    first, vertical = [], 0.8
    for flight in range(200):
        plant = MovingAir(Air((3.0, 3.0, 0.0), 8.0), 1.7, 0.02, 0.0, seed=5, flight=flight)
        plant.start(1, (0.0, 0.0, -60.0))
        first.append(plant.wind_e_m_s - [3.0, 3.0, 0.0])
    sigma = np.array([vertical / (0.177 + 0.000823 * 60.0 / 0.3048) ** 0.4] * 2 + [vertical])
    ratio = np.sum(np.square(first), axis=0) / sigma**2 / 200
    # Chi-square of 200: 0.63 to 1.45 with a probability of 0.9998.
    assert (ratio > 0.63).all()
    assert (ratio < 1.45).all()
    assert math.isclose(sigma[0] / sigma[2], 1.5414, rel_tol=1e-3)
