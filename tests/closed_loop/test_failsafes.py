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
from autopilot.standby import StandbyParams
from estimator.interface import Health
from estimator.premerlani import Premerlani, PremerlaniParams
from scenarios.harness.flight import fly_scenario
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


class IllEarly(Premerlani):
    """POOR from 20 s on, before the gyro offset is learnt; `attitude` is then what it says."""

    def __init__(self, attitude):
        super().__init__(KNOWN)
        self._attitude = attitude

    def update(self, m):
        estimate, t_s = super().update(m), m.imu.t_s
        if t_s < 20.0:
            return estimate
        return estimate._replace(R_eb=self._attitude(estimate.R_eb, t_s), health=Health.POOR)


ILLNESSES = {
    "stays as it was": lambda R_eb, _t: R_eb,
    "upside down": lambda R_eb, _t: R_eb @ np.diag([1.0, -1.0, -1.0]),
    "constant": lambda _R, _t: np.eye(3),
    "tumbles slowly": lambda R_eb, t_s: Rotation.from_euler("x", 0.2 * (t_s - 20.0)).as_matrix() @ R_eb,
    "garbage": lambda _R, t_s: Rotation.from_euler("ZYX", [t_s, 0.4 * math.sin(t_s), 2.0 + t_s]).as_matrix(),
}


@pytest.mark.parametrize(("illness", "seed"), list(zip(ILLNESSES, (1, 2, 1, 2, 1), strict=True)))
def test_estimator_ill_before_it_learnt_its_offset_flies_on_level(illness, seed):
    """No calibration, POOR after 20 s, whatever it says: a minute and a half with wings level at its height."""
    flight = flown([(0.0, AHEAD)], 110.0, estimator=IllEarly(ILLNESSES[illness]), seed=seed)
    assert flight.outcome == Outcome.COMPLETED
    assert modes(flight)[-1] == Mode.LEVEL
    assert heights_m(flight).min() > 60.0
    assert abs(bank_deg(flight)[2000:]).max() < 12.0


def test_level_on_the_gyros_alone_would_crash(monkeypatch):
    """What the test above tells apart: the last offset of the estimator is not that of the gyros."""
    still = StandbyParams(tilt_gain_1_s=0.0, tilt_offset_1_s2=0.0, yaw_gain_1_s=0.0, yaw_offset_1_s2=0.0)
    alone = replace(DcmAutopilot().params, standby=still)
    monkeypatch.setattr("autopilot.dcm.params_of", lambda _aircraft: alone)
    flight = flown([(0.0, AHEAD)], 110.0, estimator=IllEarly(ILLNESSES["stays as it was"]), seed=1)
    assert flight.outcome == Outcome.GROUND_CONTACT


@pytest.mark.parametrize("lacking", ["gps", "radio", "both"])
def test_estimator_ill_and_nobody_to_help_lands_wings_level(lacking):
    """Motor off after half a minute without GPS, or a minute without radio; down within two minutes, gently."""
    faults = [] if lacking == "radio" else [Fault("gps", "outage", (), 40.0, math.inf)]
    script = [(0.0, AHEAD)] if lacking == "gps" else [(0.0, AHEAD), (30.0, replace(AHEAD, radio=False))]
    flight = flown(script, 220.0, estimator=IllEarly(ILLNESSES["garbage"]), faults=faults, height_m=60.0, seed=1)
    assert flight.outcome == Outcome.GROUND_CONTACT
    assert modes(flight) == [Mode.COURSE, Mode.LEVEL, Mode.LAND]
    land = flight.log.flown["mode"] == Mode.LAND
    assert abs(bank_deg(flight)[land]).max() < 15.0
    assert np.all(flight.log.truth["throttle"][land][50:] < 0.01)
    assert flight.log.truth["v_e_m_s"][-1, 2] < 3.0
    assert "mode land: estimator unhealthy, and no GPS or no radio" in {e.text for e in flight.events}


def test_launch_that_never_has_a_fix_comes_down_nearby():
    """A climb that ends, half a minute of circle, a glide: on the ground within three minutes, not 300 m up."""
    plain = {"faults": "gps:outage@-60-", "duration_s": 170.0}
    flight = fly_scenario("launch_no_gps", plain, seed=0)
    assert flight.outcome == Outcome.GROUND_CONTACT
    assert modes(flight)[-3:] == [Mode.LAUNCH, Mode.CIRCLE, Mode.GLIDE]
    assert heights_m(flight).max() < 75.0
    p = flight.log.truth["p_e_m"]
    assert np.hypot(p[:, 0], p[:, 1]).max() < 600.0
    assert flight.log.truth["v_e_m_s"][-1, 2] < 3.5


@pytest.mark.parametrize(("action", "mode"), [("loiter", Mode.LOITER), ("glide", Mode.GLIDE)])
def test_fence_actions_last_until_another_setpoint_is_commanded(action, mode):
    """Around the launch point, or down with the motor off; not back to the course that led out of the fence."""
    flight = fly_scenario("fence", {"fence.action": action, "duration_s": 70.0}, seed=0)
    assert modes(flight) == [Mode.COURSE, mode]
    p = flight.log.truth["p_e_m"]
    assert np.hypot(p[:, 0], p[:, 1]).max() < (260.0 if action == "loiter" else 700.0)
    assert f"mode {action}: the fence" in {e.text for e in flight.events}


def test_fence_that_is_only_reported_changes_nothing_but_the_events():
    """Bit for bit the flight without a fence."""
    reported = fly_scenario("fence", {"fence.action": "report", "duration_s": 30.0}, seed=0)
    none = fly_scenario("crosswind", {"wind": "5@tail", "start.height_m": 80.0, "manoeuvre.height_m": 80.0,
                                      "duration_s": 30.0, "air.turbulence_w20_m_s": 3.0}, seed=0)  # fmt: skip
    np.testing.assert_array_equal(reported.log.truth["p_e_m"], none.log.truth["p_e_m"])
    assert {("outside the fence", "warn")} <= {(e.text, e.level) for e in reported.events}


def test_fence_ceiling_limits_the_height_that_is_commanded():
    """Commanded to climb to 150 m under a ceiling of 110 m: it stays under it."""
    changes = {"fence.radius_m": 2000.0, "fence.height_m": 110.0, "manoeuvre.height_m": 150.0}
    flight = fly_scenario("fence", changes, seed=1)
    assert heights_m(flight).max() < 110.0
    np.testing.assert_allclose(heights_m(flight)[-500:].mean(), 100.0, rtol=0, atol=4.0)


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
