"""Claims that are flown: the cheapest put to the test on few seeds, and what they are measured with."""

import math

import numpy as np
import pytest

from scenarios.claims import centrifugal, course, latency, launch, upside_down, vertical_flight
from scenarios.claims.centrifugal import Uncompensated
from scenarios.claims.latency import Kink
from scenarios.claims.upside_down import BANK_RAD, OnItsBack
from scenarios.claims.vertical_flight import UpAndOn
from scenarios.harness.claims.claim import Claim, Verdict
from scenarios.harness.claims.flights import crab_deg, flights, median, slowest
from scenarios.harness.claims.motions import aboard, begin, sensed, tilt_deg
from scenarios.harness.claims.run import claims
from sim.motion.prescribed_plant import SteadyTurn, inertial_rate_and_force
from sim.place import LATITUDE_DEG

MODULES = (launch, centrifugal, course, latency, upside_down, vertical_flight)
CLAIMS = {claim.name: claim for module in MODULES for claim in vars(module).values() if isinstance(claim, Claim)}


@pytest.mark.parametrize("claim", CLAIMS.values(), ids=CLAIMS)
def test_claim_is_well_formed(claim):
    """Each has a title, a place and a claim, and needs few seeds; every one is found by its name."""
    assert claim.place
    assert claim.title
    assert not claim.title.endswith(".")
    assert claim.says.endswith(".")
    assert 0 <= claim.seeds <= 10
    assert claims()[claim.name] is claim


@pytest.mark.parametrize("name", ["accelerometer_dives", "gps_filter_settles", "upside_down", "vertical_flight"])
def test_cheap_claims_are_confirmed(name):
    """The verdict on two seeds is the one expected of ten."""
    finding = CLAIMS[name].measure((0, 1))
    assert CLAIMS[name].expected == finding.verdict == Verdict.CONFIRMED, finding.lines


def test_dive_claim_is_refuted_where_the_accelerometer_gets_a_matrix(monkeypatch):
    """With the matrix flown in the accelerometer's place nobody dives, and the claim falls."""
    flown = launch.flights
    monkeypatch.setattr(launch, "flights", lambda scenario, seeds, changes, *_: flown(scenario, seeds, changes))
    assert CLAIMS["accelerometer_dives"].measure((0, 1)).verdict == Verdict.REFUTED


def test_large_weight_locks_sooner_than_a_small_one():
    """Four times the weight finds the heading in less than half the time, seed by seed."""
    for large, small in zip(*([launch._lock_s(f) for f in _thrown(w)] for w in (1.2, 0.3)), strict=True):
        assert large < 0.5 * small or small < 1.0  # seed 1 is thrown nearly north: as believed at power-up


def _thrown(w_y):
    return flights("hand_launch", (0, 1), {"estimator_params.w_y": w_y})


def test_uncompensated_estimator_is_drawn_to_the_felt_vertical():
    """Without Eqn 25 the tilt error of a steady turn is bank W / sqrt(W^2 + rate^2).

    The felt vertical leans by the bank and turns with the aeroplane; the correction lags it by 1 / W.
    """
    turn = SteadyTurn(math.radians(10.0))
    log = sensed(turn, 60.0)
    weight = 0.3
    estimator = begin(Uncompensated(aboard(w_rp=weight, w_y=0.0, k_i=0.0)), log.truth["R_eb"][0])
    measured_deg = tilt_deg(estimator.replay(log.measured)["R_eb"], log)[-1]
    expected_deg = 10.0 * weight / math.hypot(weight, turn.turn_rate_rad_s)
    assert measured_deg == pytest.approx(expected_deg, rel=0.03, abs=0)  # sine for angle: 0.5 %


def test_turn_on_its_back_feels_its_weight_on_the_belly_side():
    """Upside down in a level turn the wings push towards the belly by g / cos(bank); the body turns as the heading."""
    motion, t_s = OnItsBack(BANK_RAD), np.array([0.0, 3.0])
    omega_b, force_b = inertial_rate_and_force(motion, t_s, math.radians(LATITUDE_DEG))
    assert np.allclose(force_b[:, 1], 0.0, rtol=0, atol=0.02)  # the earth's rotation
    assert np.allclose(force_b[:, 2], 9.8 / math.cos(BANK_RAD), rtol=0, atol=0.05)  # gravity by latitude
    heading_rate = np.einsum("ni,ni->n", motion.at(t_s).R_eb[:, 2], omega_b)
    assert np.allclose(heading_rate, 9.8 * math.tan(BANK_RAD) / 12.6, rtol=0, atol=2e-3)


def test_climb_stays_on_its_path_and_along_its_nose():
    """Straight up in the middle, level at both ends, and the position is the integral of the velocity."""
    t_s = np.linspace(0.0, 140.0, 14001)
    at = UpAndOn().at(t_s)
    assert np.allclose(at.v_e_m_s[(t_s > 70.0) & (t_s < 90.0)], (0.0, 0.0, -12.6), rtol=0, atol=1e-12)
    assert np.allclose(at.v_e_m_s[(t_s < 60.0) | (t_s > 100.0)], (12.6, 0.0, 0.0), rtol=0, atol=1e-12)
    assert np.allclose(at.R_eb[:, :, 0] * 12.6, at.v_e_m_s, rtol=0, atol=1e-12)
    mean_v, mean_a = (0.5 * (of[1:] + of[:-1]) * 0.01 for of in (at.v_e_m_s, at.a_e_m_s2))
    # The trapezium: a^2 dt^3 / 12 a step; where the acceleration begins or ends half a step of 2 m/s^2, four times.
    assert np.allclose(np.cumsum(mean_v, axis=0), at.p_e_m[1:] - at.p_e_m[0], rtol=0, atol=1e-3)
    assert np.allclose(np.cumsum(mean_a, axis=0), at.v_e_m_s[1:] - at.v_e_m_s[0], rtol=0, atol=0.05)


def test_kink_turns_the_velocity_at_once_and_stays_on_its_path():
    """Before the kink north, after it east, and the position is the integral of the velocity."""
    t_s = np.linspace(0.0, 20.0, 2001)
    at = Kink().at(t_s)
    assert np.allclose(at.v_e_m_s[t_s < 9.995], (12.6, 0.0, 0.0), rtol=0, atol=1e-12)
    assert np.allclose(at.v_e_m_s[t_s > 10.005], (0.0, 12.6, 0.0), rtol=0, atol=1e-12)
    travelled = np.cumsum(at.v_e_m_s[1:], axis=0) * 0.01
    assert np.allclose(at.p_e_m[1:] - at.p_e_m[0], travelled, rtol=0, atol=0.2)  # a step of 12.6 m/s x 0.01 s


def test_crab_is_the_arc_sine_of_crosswind_over_airspeed():
    """Across 5 m/s of wind at about 12.6 m/s of airspeed the nose stands 23 degrees off the course."""
    (flight,) = flights("crosswind", (0,), {"air.turbulence_w20_m_s": 0.0, "duration_s": 60.0})
    settled = flight.log.truth["t_s"] > 30.0
    expected = np.degrees(np.arcsin(5.0 / np.median(flight.log.truth["airspeed_m_s"][settled])))
    assert abs(np.median(crab_deg(flight)[settled])) == pytest.approx(expected, rel=0, abs=1.5)  # sideslip


def test_times_that_never_came_are_not_forgotten():
    """Never counts as longest for the median, and spoils the slowest."""
    assert median([1.0, math.nan, 2.0]) == 2.0
    assert median([math.nan, math.nan, 2.0]) == math.inf
    assert slowest([1.0, 3.0]) == 3.0
    assert math.isnan(slowest([1.0, math.nan]))
    assert math.isnan(slowest([]))
