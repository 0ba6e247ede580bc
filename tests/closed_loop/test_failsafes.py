"""The failsafes flown in turbulence: what the autopilot does when radio, GPS, estimator or height are missing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.dcm import DcmAutopilot
from autopilot.failsafe import FailsafeParams
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script
from estimator.interface import Health
from estimator.premerlani import Premerlani, PremerlaniParams
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.air import Air
from sim.clock import Rates
from sim.faults import Fault
from sim.log import Flight, Log, Outcome
from sim.loop import fly
from sim.plant import InFlight
from sim.sensors.suite import SUITES, Suite

AHEAD = Setpoint(Mode.COURSE, height_m=100.0)
AIR = Air((0.0, -4.0, 0.0), 3.0)
GPS = SUITES["generic"].gps
KNOWN = PremerlaniParams(gps_filter_s=GPS.filter_s, gps_latency_s=GPS.latency_s)  # to the estimator


def flown(script, duration_s, *, estimator=None, height_m=100.0, aircraft="endurance", faults=(), seed=0) -> Flight:
    """On the default estimator and the generic sensors, in 4 m/s of wind from the east and turbulence."""
    rates = Rates()
    plant = JsbsimPlant(aircraft, start=InFlight(0.0, height_m=height_m), air=AIR, rates=rates, seed=seed)
    suite = Suite(SUITES["generic"], rates, seed, 0, list(faults), 0.0)
    autopilot = DcmAutopilot(aircraft=aircraft)
    return fly(
        plant, suite, estimator or Premerlani(KNOWN), autopilot, Script(script), Log.empty(rates.ticks(duration_s))
    )


def heights_m(flight):
    return -flight.log.truth["p_e_m"][:, 2]


def bank_deg(flight):
    R = flight.log.truth["R_eb"]
    return np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]))


def modes(flight):
    """The modes flown, in their order."""
    mode = flight.log.flown["mode"]
    return [Mode(m) for m in mode[np.flatnonzero(np.diff(mode, prepend=-1))]]


def test_radio_lost_comes_home():
    """Ten seconds after it falls silent 250 m out: within 25 m of the launch point within a minute, and it says so."""
    flight = flown([(0.0, AHEAD), (20.0, replace(AHEAD, radio=False))], 90.0)
    assert flight.outcome == Outcome.COMPLETED
    assert modes(flight) == [Mode.COURSE, Mode.RETURN]
    p = flight.log.truth["p_e_m"]
    out_m = np.hypot(p[:, 0], p[:, 1])
    assert out_m[1000] > 200.0
    assert out_m[1000:].min() < 25.0
    assert {("mode return: no radio", "warn"), ("radio lost", "warn")} <= {(e.text, e.level) for e in flight.events}


def test_radio_lost_in_a_manoeuvre_of_the_pilot_comes_home():
    """Let go in a roll by hand, stick over: it rolls upright, climbs back and comes home."""
    roll = Setpoint(Mode.MANUAL, aileron=1.0, throttle=0.6, height_m=100.0)
    flight = flown([(0.0, AHEAD), (20.0, roll), (21.0, replace(roll, radio=False))], 80.0)
    assert flight.outcome == Outcome.COMPLETED
    p = flight.log.truth["p_e_m"][1050:]
    assert np.hypot(p[:, 0], p[:, 1]).min() < 25.0
    assert heights_m(flight).min() > 60.0


def test_gps_lost_circles_then_glides_and_flies_on():
    """A minute of silence: gentle bank, nowhere near the ground, at most 250 m away from where it began; then on."""
    flight = flown([(0.0, AHEAD)], 120.0, faults=[Fault("gps", "outage", (), 20.0, 80.0)])
    assert flight.outcome == Outcome.COMPLETED
    assert modes(flight) == [Mode.COURSE, Mode.CIRCLE, Mode.GLIDE, Mode.COURSE]
    silent = slice(1300, 4000)
    assert abs(bank_deg(flight)[silent]).max() < 30.0
    assert np.all(flight.log.truth["throttle"][flight.log.flown["mode"] == Mode.GLIDE][50:] < 0.01)
    assert heights_m(flight).min() > 40.0
    # With 4 m/s of wind it drifts by 240 m in that minute; straight on it would have flown 750 m.
    v = flight.log.truth["v_e_m_s"][silent, :2] - flight.log.truth["wind_e_m_s"][silent, :2]
    assert np.hypot(*(v.sum(axis=0) * flight.dt_s)) < 250.0
    assert {"mode circle: no GPS", "mode glide: no GPS for a long time"} <= {e.text for e in flight.events}
    np.testing.assert_allclose(heights_m(flight)[-250:], 100.0, rtol=0, atol=12.0)


class FallsIll(Premerlani):
    """The default estimator, POOR from 60 s on; from 70 s on its attitude is garbage, and turns about."""

    def update(self, m):
        estimate, t_s = super().update(m), m.imu.t_s
        if t_s < 60.0:
            return estimate
        if t_s > 70.0:
            nonsense = Rotation.from_euler("ZYX", [t_s, 0.4 * math.sin(t_s), 2.0 + t_s]).as_matrix()
            estimate = estimate._replace(R_eb=nonsense, omega_b_rad_s=np.array([1.0, -2.0, 3.0]))
        return estimate._replace(health=Health.POOR)


def without_level(monkeypatch):
    """An autopilot that believes its estimator whatever that says."""
    never = replace(DcmAutopilot().params, failsafe=FailsafeParams(unhealthy_s=1e9))
    monkeypatch.setattr("autopilot.dcm.params_of", lambda _aircraft: never)


@pytest.mark.parametrize("mode", [Mode.COURSE, Mode.STABILISE])
def test_unhealthy_estimator_stays_aloft_for_a_minute_with_wings_level(mode):
    """On gyros alone from the last healthy attitude on: the bank drifts, and stays below 20 degrees (14 measured)."""
    flight = flown([(0.0, replace(AHEAD, mode=mode))], 140.0, estimator=FallsIll(KNOWN))
    assert flight.outcome == Outcome.COMPLETED
    assert modes(flight) == [mode, Mode.LEVEL]
    assert abs(bank_deg(flight)[3300:]).max() < 20.0
    assert heights_m(flight).min() > 80.0
    assert "mode level: estimator unhealthy" in {e.text for e in flight.events}


def test_unhealthy_estimator_would_crash_who_believes_it(monkeypatch):
    """What the test above tells apart."""
    without_level(monkeypatch)
    assert flown([(0.0, AHEAD)], 140.0, estimator=FallsIll(KNOWN)).outcome == Outcome.GROUND_CONTACT


def test_low_height_climbs_straight_before_it_turns():
    """Told to turn back at 12 m: hardly any bank until it is at 30 m, then the turn that was asked for."""
    back = Setpoint(Mode.COURSE, course_rad=math.pi, height_m=60.0)
    flight = flown([(0.0, back)], 60.0, height_m=12.0)
    assert flight.outcome == Outcome.COMPLETED
    assert modes(flight) == [Mode.COURSE, Mode.LOW, Mode.COURSE]  # nobody knows the height before the first fix
    low = flight.log.flown["mode"] == Mode.LOW
    assert np.argmax(low) < 100
    assert abs(bank_deg(flight)[low][100:]).max() < 25.0
    assert abs(bank_deg(flight)[~low]).max() > 28.0
    assert heights_m(flight).min() > 8.0
    assert 28.0 < heights_m(flight)[np.flatnonzero(low)[-1]] < 45.0
    np.testing.assert_allclose(heights_m(flight)[-250:], 60.0, rtol=0, atol=10.0)


def test_low_sailplane_lands_straight():
    """On its way home it comes down: wings near to level in the last seconds, and the ground is where it ends."""
    home = Setpoint(Mode.RETURN)
    flight = flown([(0.0, home)], 90.0, height_m=20.0, aircraft="gentle_lady")
    assert flight.outcome == Outcome.GROUND_CONTACT
    assert modes(flight) == [Mode.RETURN, Mode.LOW]
    assert abs(bank_deg(flight)[-250:]).max() < 15.0


@pytest.mark.parametrize(("radius_m", "left"), [(60.0, False), (100.0, True)])
def test_loiter_in_wind_and_turbulence_keeps_the_circle(radius_m, left):
    """4 m/s of wind, sensors with their noise, the default estimator: within 20 m of the circle (14 measured,
    10 on the true attitude), and 12 m of the height."""
    setpoint = Setpoint(Mode.LOITER, north_m=100.0, east_m=50.0, radius_m=radius_m, left=left, height_m=100.0)
    flight = flown([(0.0, setpoint)], 120.0)
    assert flight.outcome == Outcome.COMPLETED
    p = flight.log.truth["p_e_m"][3000:]
    np.testing.assert_allclose(np.hypot(p[:, 0] - 100.0, p[:, 1] - 50.0), radius_m, rtol=0, atol=20.0)
    np.testing.assert_allclose(heights_m(flight)[3000:], 100.0, rtol=0, atol=12.0)
