"""The closed forms of every prescribed motion agree with each other, with SciPy and with the plant's rows."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.interface import NEUTRAL, ActuatorCommand
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.log import Log
from sim.motion.hover import Hover
from sim.motion.prescribed_plant import (
    GRAVITY_M_S2,
    Coning,
    FreeFall,
    HandHeld,
    Loop,
    PrescribedPlant,
    Rest,
    SteadyTurn,
    StraightLevel,
)
from sim.motion.turn_table import TurnTable
from sim.place import LATITUDE_DEG
from sim.truth import EARTH_RATE_RAD_S

WIND = (3.0, -4.0, 0.5)
MOTIONS = {
    "rest": Rest(0.3, -0.2, 2.0),
    "hand_held": HandHeld(),
    "coning": Coning(),
    "free_fall": FreeFall(tumble_rad_s=1.5),
    "straight_level": StraightLevel(0.7, wind_e_m_s=WIND, surge_m_s2=2.0),
    "steady_turn": SteadyTurn(math.radians(35.0), heading_rad=1.0, wind_e_m_s=WIND),
    "loop": Loop(heading_rad=-2.0, wind_e_m_s=WIND),
    "hover": Hover(1.0),
    "turn_table": TurnTable(0.3, circle_s=2.0, quarter_s=1.2),
}
moving = pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
T_S = np.linspace(0.1, 6.0, 97)
DELTA_S = 1e-4  # of the central differences


def flown(motion, n_ticks=200, rates=None, latitude_deg=LATITUDE_DEG):
    """Truth rows of a flight of `motion`."""
    log = Log.empty(n_ticks)
    plant = PrescribedPlant(motion, rates or Rates(), latitude_deg)
    plant.reset(log)
    for k in range(n_ticks):
        assert plant.advance(k, NEUTRAL) is None
    return log.truth


def test_from_euler_any_angles_agrees_with_scipy():
    """The Euler composition is SciPy's intrinsic yaw, pitch, roll."""
    roll, pitch, yaw = np.random.default_rng(1).uniform(-np.pi, np.pi, (3, 500))
    expected = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=-1)).as_matrix()
    # Round-off: a handful of products of sines.
    np.testing.assert_allclose(from_euler(roll, pitch, yaw), expected, rtol=0, atol=1e-14)


@moving
def test_motion_derivatives_agree_with_central_differences(motion):
    """Velocity, acceleration and body rate are the derivatives of position, velocity and attitude."""
    before, at, after = motion.at(T_S - DELTA_S), motion.at(T_S), motion.at(T_S + DELTA_S)
    turned = Rotation.from_matrix(np.swapaxes(before.R_eb, 1, 2) @ after.R_eb)
    # Third derivatives stay below 60 SI units: 60 delta^2 / 6 = 1e-7; round-off 100 m x 2e-16 / 1e-4 = 2e-10.
    limit = 60.0 * DELTA_S**2 / 6.0 + 1e-9
    for derivative, expected in (
        ((after.p_e_m - before.p_e_m) / (2 * DELTA_S), at.v_e_m_s),
        ((after.v_e_m_s - before.v_e_m_s) / (2 * DELTA_S), at.a_e_m_s2),
        (turned.as_rotvec() / (2 * DELTA_S), at.omega_b_rad_s),
    ):
        np.testing.assert_allclose(derivative, expected, rtol=0, atol=limit)


@moving
def test_motion_begins_at_its_height_above_the_launch_point(motion):
    """Down is positive; whatever moves begins above the origin, the hover half a metre beside it."""
    north_m, east_m, down_m = motion.at(np.zeros(1)).p_e_m[0]
    assert down_m == pytest.approx(-motion.height_m, rel=0, abs=1e-12)
    assert math.hypot(north_m, east_m) < 0.5


@moving
def test_motion_attitude_is_a_rotation(motion):
    """Every attitude is orthogonal with determinant 1."""
    R_eb = motion.at(T_S).R_eb
    np.testing.assert_allclose(R_eb @ np.swapaxes(R_eb, 1, 2), np.tile(np.eye(3), (97, 1, 1)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R_eb), 1.0, rtol=0, atol=1e-14)


def test_hand_held_never_exceeds_its_peak_rate_and_uses_half_of_it():
    """Calibration may be moved at up to 3 deg/s and no more."""
    rate = np.linalg.norm(HandHeld().at(np.arange(0.0, 600.0, 0.01)).omega_b_rad_s, axis=1)
    assert math.radians(1.5) <= rate.max() <= math.radians(3.0)


@pytest.mark.parametrize("bank_deg", [-60.0, -20.0, 20.0, 35.0, 60.0])
def test_steady_turn_without_sideslip_obeys_tan_bank(bank_deg):
    """tan(bank) = V x turn rate / g, the felt force stands on the wing, and the air comes from ahead."""
    V = 14.0
    truth = flown(SteadyTurn(math.radians(bank_deg), V, wind_e_m_s=WIND))
    # The earth's rotation is left out of the closed form: Coriolis 2 x 7.3e-5 x 20 m/s = 3e-3 m/s^2, 7.3e-5 rad/s.
    heading_rate = np.linalg.norm(truth["imu_omega_b_rad_s"], axis=1)
    tan_bank = V * heading_rate / GRAVITY_M_S2
    np.testing.assert_allclose(
        tan_bank, abs(math.tan(math.radians(bank_deg))), rtol=0, atol=V * EARTH_RATE_RAD_S / GRAVITY_M_S2
    )
    side, along = truth["imu_force_b_m_s2"][:, 1], truth["imu_force_b_m_s2"][:, 0]
    np.testing.assert_allclose(side, 0.0, rtol=0, atol=3e-3)
    np.testing.assert_allclose(along, 0.0, rtol=0, atol=3e-3)
    np.testing.assert_allclose(truth["airspeed_m_s"], V, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth["beta_rad"], 0.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(truth["alpha_rad"], 0.0, rtol=0, atol=1e-14)


def test_steady_turn_without_bank_flies_straight():
    """A bank of zero is no division by zero: it is straight flight."""
    at = SteadyTurn(0.0, 10.0).at(T_S)
    np.testing.assert_allclose(at.p_e_m[:, 0], 10.0 * T_S, rtol=0, atol=1e-12)
    np.testing.assert_allclose(at.a_e_m_s2, 0.0, rtol=0, atol=0)


@pytest.mark.parametrize("latitude_deg", [-90.0, 0.0, 42.8])
def test_rest_feels_gravity_and_the_earths_rotation(latitude_deg):
    """Level and facing north, at rest: (0, 0, -g) and the earth's rate, by latitude (WGS 84 gravity to 1e-9)."""
    truth = flown(Rest(), 3, latitude_deg=latitude_deg)
    # g of the WGS 84 ellipsoid at the equator and the poles, NIMA TR8350.2; at 42.8 deg by Somigliana's formula.
    g = {-90.0: 9.8321849378, 0.0: 9.7803253359, 42.8: GRAVITY_M_S2}[latitude_deg]
    lat = math.radians(latitude_deg)
    np.testing.assert_allclose(truth["imu_force_b_m_s2"], np.tile([0.0, 0.0, -g], (3, 1)), rtol=0, atol=1e-9)
    earth = EARTH_RATE_RAD_S * np.array([math.cos(lat), 0.0, -math.sin(lat)])
    np.testing.assert_allclose(truth["imu_omega_b_rad_s"], np.tile(earth, (3, 1)), rtol=0, atol=1e-16)


def test_plant_advance_fills_its_row_alone_and_obeys_nobody():
    """A row is filled in its own tick, whatever is commanded."""
    log = Log.empty(10)
    plant = PrescribedPlant(Loop(), Rates())
    plant.reset(log)
    for k in range(4):
        plant.advance(k, ActuatorCommand(1.0, -1.0, 1.0, 1.0))
    np.testing.assert_array_equal(log.truth["t_s"] > 0.0, np.arange(10) < 4)
    np.testing.assert_array_equal(log.truth[:4], flown(Loop(), 10)[:4])


@pytest.mark.parametrize("imu_hz", [40, 50, 100, 200])
def test_plant_ticks_end_at_whole_intervals(imu_hz):
    """Row k holds the end of the interval: t = (k + 1) dt."""
    truth = flown(StraightLevel(0.0, 10.0), 50, Rates(imu_hz=imu_hz))
    np.testing.assert_allclose(truth["t_s"], np.arange(1, 51) / imu_hz, rtol=0, atol=1e-14)
    np.testing.assert_allclose(truth["p_e_m"][:, 0], 10.0 * np.arange(1, 51) / imu_hz, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: SteadyTurn(2.0), "bank_rad = 2.0 rad"),
        (lambda: SteadyTurn(0.5, 0.0), "airspeed_m_s = 0.0 m/s"),
        (lambda: Loop(0.0), "pitch_rate_rad_s = 0.0 rad/s"),
        (lambda: StraightLevel(surge_s=-1.0), "surge_s = -1.0 s"),
        (lambda: PrescribedPlant(Rest(), Rates(), math.nan), "latitude_deg = nan deg"),
    ],
)
def test_motion_with_impossible_parameters_is_refused(make, said):
    """The message names field, value and unit, and what to choose."""
    with pytest.raises(ValueError, match=f"{said}: choose"):
        make()
