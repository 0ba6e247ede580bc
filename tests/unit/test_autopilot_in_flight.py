"""The autopilot flies each aeroplane on the true attitude: what the gains are for."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.airframes import params_of
from autopilot.dcm import DcmAutopilot
from autopilot.figures import inside_loops
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.air import STILL, Air
from sim.clock import Rates
from sim.log import Log, Outcome
from sim.loop import fly
from sim.oracle import Oracle
from sim.plant import HandThrow, InFlight
from sim.rng import stream
from sim.sensors.suite import SUITES, Suite

LEVEL = Setpoint(Mode.STABILISE, pitch_rad=math.radians(1.0))
LADY = params_of("gentle_lady")
GLIDE = Setpoint(Mode.STABILISE, pitch_rad=LADY.energy.pitch_trim_rad)


def flown(start, script, duration_s, *, air=STILL, seed=0, suite="ideal", aircraft="endurance", estimator=None):
    """Truth rows from the release on, which must all have been flown."""
    rates = Rates()
    plant = JsbsimPlant(aircraft, start=start, air=air, rates=rates, seed=seed)
    log = Log.empty(rates.ticks(plant.release_s + duration_s))
    autopilot = DcmAutopilot(heading_reference=Oracle.heading_reference, aircraft=aircraft)
    flight = fly(plant, Suite(SUITES[suite], rates, seed), estimator or Oracle(), autopilot, Script(script), log)
    assert flight.outcome == Outcome.COMPLETED
    return flight.log.truth[rates.ticks(plant.release_s) :]


def bank_deg(truth):
    return np.degrees(np.arctan2(truth["R_eb"][:, 2, 1], truth["R_eb"][:, 2, 2]))


def height_m(truth):
    return -truth["p_e_m"][:, 2]


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_stabilise_bank_step_is_quick_without_overshoot_and_turns_level(side):
    """To 35 degrees in about 1 s with < 15 % overshoot; half a turn loses < 3 m (0.8 s, 2 % and 1 m measured)."""
    banked = Setpoint(Mode.STABILISE, bank_rad=side * math.radians(35.0), pitch_rad=LEVEL.pitch_rad)
    truth = flown(InFlight(0.0), [(0.0, LEVEL), (2.0, banked)], 14.0)
    share = side * bank_deg(truth)[100:] / 35.0
    assert np.argmax(share > 0.9) * 0.02 <= 1.2
    assert share.max() < 1.15
    np.testing.assert_allclose(share[300:], 1.0, rtol=0, atol=0.03)
    heading = np.unwrap(np.arctan2(truth["R_eb"][:, 1, 0], truth["R_eb"][:, 0, 0]))
    half_turn = np.argmax(abs(heading) > math.pi)
    assert half_turn > 0
    assert abs(height_m(truth)[half_turn] - 60.0) < 3.0


@pytest.mark.parametrize("rolled_s", [0.85, 1.05, 1.2])
def test_stabilise_inverted_rolls_upright_and_recovers(rolled_s):
    """Let go at about 130, 170 and 210 degrees of bank, rolling: level within 3 s, < 25 m lost (23 m measured)."""
    roll = Setpoint(Mode.MANUAL, aileron=1.0, throttle=0.6)
    truth = flown(InFlight(0.0, height_m=100.0), [(0.0, LEVEL), (1.0, roll), (1.0 + rolled_s, LEVEL)], 10.0)
    let_go = round((1.0 + rolled_s) / 0.02)
    assert abs(bank_deg(truth)[let_go]) > 120.0
    assert np.all(abs(bank_deg(truth)[let_go + 150 :]) < 10.0)
    assert height_m(truth).min() > 75.0


def test_stabilise_turbulence_keeps_wings_level():
    """W20 = 3 m/s, sensors with their noise, a minute hands off: bank below 5 degrees (1.1 degrees measured)."""
    air = Air((0.0, -5.0, 0.0), 3.0)
    truth = flown(InFlight(0.0), [(0.0, LEVEL)], 60.0, air=air, seed=4, suite="generic")
    assert abs(bank_deg(truth)).max() < 5.0


@pytest.mark.parametrize("flight", range(6))
def test_launch_random_throws_never_sink_and_climb_away(flight):
    """8.1 m/s, twisted by the hand at up to 15 deg/s, 2 m/s of wind: never below 1.5 m, above 10 m by 20 s."""
    random = stream(17, flight, "throw")
    heading, wind_to = random.uniform(0.0, 2.0 * math.pi, 2)
    twist = np.radians(random.uniform(-15.0, 15.0, 3))
    throw = HandThrow(
        heading_rad=heading,
        pitch_rad=math.radians(10.0),
        sway_rad_s=(0.05, 0.05, 0.05),
        sway_hz=(0.3, 0.4, 0.25),
        sway_phase_rad=tuple(random.uniform(0.0, 6.0, 3)),
        release_rate_b_rad_s=tuple(twist),
        hold_s=3.0,
    )
    air = Air((2.0 * math.cos(wind_to), 2.0 * math.sin(wind_to), 0.0), 3.0)
    truth = flown(throw, [(0.0, Setpoint(Mode.LAUNCH))], 20.0, air=air, seed=flight, suite="generic")
    assert height_m(truth).min() >= 1.5
    assert height_m(truth)[-1] > 10.0


def test_inside_loops_three_come_round_in_the_planned_time_and_end_level():
    """The nose turns three times within 5 % when the script says so; then the wings level and the height is held."""
    level = Setpoint(Mode.COURSE, height_m=100.0)
    loops = inside_loops(2.0, 3, level)
    truth = flown(InFlight(0.0, height_m=100.0), [(0.0, level), *loops.timed], loops.ends_s + 15.0)
    nose = np.unwrap(np.arctan2(-truth["R_eb"][:, 2, 0], truth["R_eb"][:, 0, 0]))
    np.testing.assert_allclose(nose[round(loops.ends_s / 0.02)] / (2.0 * math.pi), 3.0, rtol=0, atol=0.15)
    assert height_m(truth).min() > 80.0
    assert abs(bank_deg(truth)[-250:]).max() < 5.0
    np.testing.assert_allclose(height_m(truth)[-1], 100.0, rtol=0, atol=5.0)


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 180.0, 270.0])
def test_return_any_wind_passes_the_launch_point(from_deg):
    """From 300 m out, heading away, in 5 m/s: within 25 m of the launch point in under 80 s (45 s measured)."""
    wind = -5.0 * np.exp(1j * math.radians(from_deg))
    home = Setpoint(Mode.RETURN, height_m=60.0)
    truth = flown(
        InFlight(0.0, north_m=300.0),
        [(0.0, home)],
        80.0,
        air=Air((wind.real, wind.imag, 0.0), 3.0),
        suite="generic",
    )
    assert np.hypot(truth["p_e_m"][:, 0], truth["p_e_m"][:, 1]).min() < 25.0
    assert 40.0 < height_m(truth).min() < height_m(truth).max() < 80.0


def test_sailplane_glide_settles_at_its_speed_with_wings_level():
    """Hands off in still air: the pitch of the glide gives the speed that the gains assume within 7 %."""
    truth = flown(InFlight(0.0), [(0.0, GLIDE)], 30.0, aircraft="gentle_lady")[-500:]
    np.testing.assert_allclose(truth["airspeed_m_s"], LADY.energy.airspeed_m_s, rtol=0.07, atol=0)
    assert abs(bank_deg(truth)).max() < 1.0
    sink_m_s = -np.polyfit(truth["t_s"], height_m(truth), 1)[0]
    assert 0.4 < sink_m_s < 0.8


class ReadsNoseLow(Oracle):
    """The truth, but for a nose that seems lower than it is."""

    def __init__(self, rad):
        super().__init__()
        self.error = Rotation.from_euler("Y", -rad).as_matrix()

    def update(self, m):
        truth = super().update(m)
        return truth._replace(R_eb=truth.R_eb @ self.error)


def test_sailplane_pitch_believed_too_low_is_slower_but_does_not_stall():
    """8 degrees too low, it pulls; the elevator that it may hold ends at about the best glide, 6.3 m/s (stall: 4.6)."""
    wrong = ReadsNoseLow(math.radians(8.0))
    truth = flown(InFlight(0.0), [(0.0, Setpoint(Mode.COURSE))], 40.0, aircraft="gentle_lady", estimator=wrong)
    assert truth["airspeed_m_s"][-1000:].min() > 5.5
    assert truth["airspeed_m_s"][-1000:].max() < 0.95 * LADY.energy.airspeed_m_s
    assert np.degrees(truth["alpha_rad"]).max() < 6.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_sailplane_bank_step_by_rudder_alone_is_damped(side):
    """To 25 degrees by way of slip and dihedral: within 4 s, without much overshoot, and it stays there."""
    banked = Setpoint(Mode.STABILISE, bank_rad=side * math.radians(25.0), pitch_rad=GLIDE.pitch_rad)
    truth = flown(InFlight(0.0), [(0.0, GLIDE), (2.0, banked)], 20.0, aircraft="gentle_lady")
    share = side * bank_deg(truth)[100:] / 25.0
    assert np.argmax(share > 0.9) * 0.02 <= 4.0
    assert share.max() < 1.2
    np.testing.assert_allclose(share[600:], 1.0, rtol=0, atol=0.1)
    assert not truth["aileron"].any()
    assert np.degrees(truth["alpha_rad"]).max() < 8.0


@pytest.mark.parametrize("flight", range(6))
def test_sailplane_thrown_off_a_slope_glides_away_with_wings_level(flight):
    """8.1 m/s over the ground in 2 m/s of wind from anywhere, twisted by the hand: no stall."""
    random = stream(18, flight, "throw")
    heading, wind_to = random.uniform(0.0, 2.0 * math.pi, 2)
    throw = HandThrow(
        heading_rad=heading,
        pitch_rad=math.radians(2.0),
        sway_rad_s=(0.05, 0.05, 0.05),
        sway_hz=(0.5, 0.6, 0.45),
        sway_phase_rad=tuple(random.uniform(0.0, 6.0, 3)),
        release_rate_b_rad_s=tuple(np.radians(random.uniform(-15.0, 15.0, 3))),
        height_m=40.0,
        hold_s=3.0,
    )
    air = Air((2.0 * math.cos(wind_to), 2.0 * math.sin(wind_to), 0.0), 3.0)
    script = [(0.0, Setpoint(Mode.LAUNCH))]
    truth = flown(throw, script, 20.0, air=air, seed=flight, suite="generic", aircraft="gentle_lady")
    assert np.degrees(truth["alpha_rad"]).max() < 9.0
    assert abs(bank_deg(truth)).max() < 15.0


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 180.0, 270.0])
def test_sailplane_return_any_wind_passes_the_launch_point(from_deg):
    """From 150 m out, heading away, in 2 m/s: within 25 m of the launch point in under 60 s."""
    wind = -2.0 * np.exp(1j * math.radians(from_deg))
    truth = flown(
        InFlight(0.0, north_m=150.0, height_m=100.0),
        [(0.0, Setpoint(Mode.RETURN))],
        60.0,
        air=Air((wind.real, wind.imag, 0.0), 3.0),
        suite="generic",
        aircraft="gentle_lady",
    )
    assert np.hypot(truth["p_e_m"][:, 0], truth["p_e_m"][:, 1]).min() < 25.0
    assert abs(bank_deg(truth)).max() < 45.0
