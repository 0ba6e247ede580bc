"""Signs and sizes of the stabilisation, against rotations built by SciPy, never by the code under test."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.dcm import _PARAMS
from autopilot.stabilise import (
    StabiliseParams,
    extra_lift,
    rate_control,
    rate_demand,
    roll_error,
    shorter_way,
    turn_rate,
)
from estimator.interface import G_M_S2

ROUND_OFF = 1e-12  # a dozen products of numbers up to a few units
PARAMS = StabiliseParams()
STILL = np.zeros(3)
CRUISE_M_S = PARAMS.airspeed_m_s
angle = st.floats(-math.pi, math.pi)
pitch = st.floats(-1.5, 1.5)


def attitude(roll_rad, pitch_rad, yaw_rad=0.0):
    return Rotation.from_euler("ZYX", [yaw_rad, pitch_rad, roll_rad]).as_matrix()


def record(params=PARAMS):
    p = np.zeros(1, _PARAMS["stabilise"])
    p[0] = astuple(params)
    return p[0]


def state():
    return np.zeros(1, np.dtype([("roll_integral", "f8"), ("pitch_integral", "f8")], align=True))[0]


def control_of(demand, R_eb, omega):
    return rate_control(demand, R_eb, omega, CRUISE_M_S, 1.0, state(), record(), 0.0)


@given(roll=angle, pitch=pitch, yaw=angle, bank=st.floats(-1.4, 1.4))
def test_roll_error_any_attitude_rolling_that_way_brings_the_wings_nearer(roll, pitch, yaw, bank):
    """A small body roll in the direction of the error turns the vertical towards the demanded one."""
    R = attitude(roll, pitch, yaw)
    error = roll_error(R, STILL, bank, 1.0)
    off = math.remainder(bank - roll, 2.0 * math.pi)
    if abs(off) < 1e-3 or abs(abs(off) - math.pi) < 1e-3:
        return  # there, or exactly opposite: either way is right
    rolled = R @ Rotation.from_rotvec([1e-4 * math.copysign(1.0, error), 0.0, 0.0]).as_matrix()
    wanted = np.array([math.sin(bank), math.cos(bank)])
    before, after = (m[2, 1:] / np.hypot(*m[2, 1:]) @ wanted for m in (R, rolled))
    assert after > before


@given(roll=st.floats(-1.5, 1.5), pitch=pitch, yaw=angle)
def test_roll_error_upright_for_wings_level_is_minus_r_zy(roll, pitch, yaw):
    """For wings level the error is the paper's r_zy, with the sign that removes it."""
    R = attitude(roll, pitch, yaw)
    np.testing.assert_allclose(roll_error(R, STILL, 0.0, 1.0), -R[2, 1], rtol=0, atol=ROUND_OFF)


@given(roll=angle, yaw=angle, bank=st.floats(-1.4, 1.4))
def test_roll_error_level_nose_equals_sine_or_saturates(roll, yaw, bank):
    """With the nose level it is the sine of the missing bank, and full beyond 90 degrees."""
    missing = math.remainder(bank - roll, 2.0 * math.pi)
    if abs(abs(missing) - math.pi / 2) < 1e-9 or abs(abs(missing) - math.pi) < 1e-9:
        return
    expected = math.sin(missing) if abs(missing) < math.pi / 2 else math.copysign(1.0, missing)
    np.testing.assert_allclose(roll_error(attitude(roll, 0.0, yaw), STILL, bank, 1.0), expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("degrees", [95.0, 135.0, 179.0, -95.0, -135.0, -179.0])
def test_roll_demand_inverted_is_saturated_the_shorter_way(degrees):
    """With r_zz < 0 the roll rate demanded is the limit, opposite to the bank."""
    R = attitude(math.radians(degrees), 0.1)
    p, _, _ = rate_demand(R, STILL, 0.0, 0.0, 1.0, CRUISE_M_S, record())
    assert p == -math.copysign(PARAMS.roll_rate_limit_rad_s, degrees)


def test_roll_demand_exactly_inverted_keeps_rolling_the_way_it_rolls():
    """Upside down within a degree, the roll under way decides, so that noise cannot hold it there."""
    for side in (-1.0, 1.0):
        R = attitude(math.pi + side * math.radians(1.0), 0.0)  # the shorter way is against the roll
        assert roll_error(R, np.array([side, 0.0, 0.0]), 0.0, 1.0) == side


@pytest.mark.parametrize("degrees", [91.0, 120.0, 180.0, -120.0, -91.0])
@pytest.mark.parametrize("nose_deg", [-40.0, 0.0, 40.0])
def test_elevator_inverted_is_never_up(degrees, nose_deg):
    """Upside down up-elevator would pull towards the ground, whatever pitch is asked for."""
    R = attitude(math.radians(degrees), math.radians(nose_deg))
    demand = rate_demand(R, STILL, 0.0, math.radians(15.0), 1.0, CRUISE_M_S, record())
    assert demand[1] <= 0.0
    assert control_of(demand, R, STILL)[1] <= 0.0


@given(roll=st.floats(-1.3, 1.3), pitch=st.floats(-1.2, 1.2), wanted=st.floats(-0.5, 0.5), yaw=angle)
def test_pitch_demand_upright_turns_the_nose_towards_the_demand(roll, pitch, wanted, yaw):
    """A small rotation by the demanded pitch rate, less the turn's, moves the nose towards the demanded pitch."""
    if abs(wanted - pitch) < 1e-2:
        return
    R = attitude(roll, pitch, yaw)
    _, q, _ = rate_demand(R, STILL, roll, wanted, 1.0, CRUISE_M_S, record())
    q -= turn_rate(R, 1.0, CRUISE_M_S) * R[2, 1]
    turned = R @ Rotation.from_rotvec([0.0, 1e-4 * np.sign(q), 0.0]).as_matrix()
    assert np.sign(-turned[2, 0] + R[2, 0]) == np.sign(wanted - pitch)


@given(bank=st.floats(-1.0, 1.0), yaw=angle)
def test_rate_demand_coordinated_turn_is_the_turn_seen_in_the_body(bank, yaw):
    """Banked as demanded, nose level: the demand is R^T (0, 0, g tan(bank) / V), pitch and yaw rate alike."""
    R = attitude(bank, 0.0, yaw)
    turning = G_M_S2 * math.tan(bank) / CRUISE_M_S
    expected = Rotation.from_matrix(R).inv().apply([0.0, 0.0, turning])
    np.testing.assert_allclose(
        rate_demand(R, STILL, bank, 0.0, 1.0, CRUISE_M_S, record()), expected, rtol=0, atol=ROUND_OFF
    )


@given(bank=st.floats(-1.0, 1.0))
def test_rate_control_coordinated_turn_does_not_leak_into_the_pitch_damping(bank):
    """The mixing problem: in a true turn the elevator is the one of the load alone, none of it damps the turn."""
    R = attitude(bank, 0.0)
    omega = R.T @ [0.0, 0.0, G_M_S2 * math.tan(bank) / CRUISE_M_S]
    undamped = StabiliseParams(
        elevator_per_rate_error_s=0.0, roll_control_per_rate_error_s=0.0, rudder_per_rate_error_s=0.0
    )
    demand = rate_demand(R, omega, bank, 0.0, 1.0, CRUISE_M_S, record())
    damped = rate_control(demand, R, omega, CRUISE_M_S, 1.0, state(), record(), 0.02)
    without = rate_control(demand, R, omega, CRUISE_M_S, 1.0, state(), record(undamped), 0.02)
    np.testing.assert_allclose(damped, without, rtol=0, atol=ROUND_OFF)


def test_rate_control_turn_of_a_flat_bank_would_leak_without_the_matrix():
    """The same turn rate with wings level is a yaw error: the rudder answers, the elevator does not."""
    level, omega = np.eye(3), np.array([0.0, 0.0, 0.5])
    roll, pitch_control, yaw = control_of(rate_demand(level, omega, 0.0, 0.0, 1.0, CRUISE_M_S, record()), level, omega)
    assert (roll, pitch_control) == (0.0, 0.0)
    assert yaw == pytest.approx(-0.5 * PARAMS.rudder_per_rate_error_s, rel=0, abs=ROUND_OFF)


def test_elevator_grows_with_bank_on_either_side():
    """A level turn needs up-elevator that depends on the bank."""
    elevators = []
    for degrees in (0.0, 15.0, 30.0, 45.0, 60.0):
        both = []
        for side in (-1.0, 1.0):
            bank = side * math.radians(degrees)
            R = attitude(bank, 0.0)
            demand = rate_demand(R, STILL, bank, 0.0, 1.0, CRUISE_M_S, record())
            both.append(control_of(demand, R, np.array(demand))[1])
        np.testing.assert_allclose(both[0], both[1], rtol=0, atol=ROUND_OFF)
        elevators.append(both[0])
    assert elevators[0] == pytest.approx(0.0, rel=0, abs=ROUND_OFF)
    assert np.all(np.diff(elevators) > 0.01)


@given(bank=st.floats(-1.04, 1.04))
def test_extra_lift_level_turn_is_one_over_r_zz_minus_one(bank):
    """V q / g + r_zz - 1 with the pitch rate of a level turn is the load factor less one, 1 / cos(bank) - 1."""
    q = G_M_S2 * math.tan(bank) * math.sin(bank) / CRUISE_M_S
    load = extra_lift(q, math.cos(bank), CRUISE_M_S, 1.0, record())
    np.testing.assert_allclose(load, 1.0 / math.cos(bank) - 1.0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize(("r_zz", "less"), [(1.0, 0.0), (-1.0, 2.0)])
def test_extra_lift_loop_is_centripetal_with_or_against_the_weight(r_zz, less):
    """At the bottom of a loop the lift carries the weight besides, at the top the weight helps to turn."""
    q = 1.5
    expected = CRUISE_M_S * q / G_M_S2 - less
    np.testing.assert_allclose(extra_lift(q, r_zz, CRUISE_M_S, 1.0, record()), expected, rtol=0, atol=ROUND_OFF)


@given(roll=angle, pitch=pitch, yaw=angle, omega=st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_rate_control_more_rate_gives_less_control(roll, pitch, yaw, omega):
    """Damping: turning quicker about an axis always lowers that axis' control."""
    R, omega = attitude(roll, pitch, yaw), np.array(omega)
    before = control_of((0.0, 0.0, 0.0), R, omega)
    for axis in range(3):
        after = control_of((0.0, 0.0, 0.0), R, omega + 0.1 * np.eye(3)[axis])
        assert after[axis] < before[axis]


@given(roll=angle, pitch=pitch, yaw=angle, bank=st.floats(-1.4, 1.4), nose=st.floats(-0.5, 0.5))
def test_rate_demand_inverted_is_upright_in_axes_turned_half_round_the_nose(roll, pitch, yaw, bank, nose):
    """Turned by 180 degrees about x, the same demand: p the same, q and r the opposite."""
    R, still = attitude(roll, pitch, yaw), np.array([0.0, 0.0, 0.0])
    turned = R @ Rotation.from_euler("X", 180.0, degrees=True).as_matrix()
    if abs(abs(math.remainder(roll - bank, 2.0 * math.pi)) - math.pi) < 1e-6:
        return  # exactly opposite: either way is right
    upright = rate_demand(R, still, bank, nose, 1.0, CRUISE_M_S, record())
    inverted = rate_demand(turned, still, bank, nose, -1.0, CRUISE_M_S, record())
    np.testing.assert_allclose(inverted, (upright[0], -upright[1], -upright[2]), rtol=0, atol=ROUND_OFF)


@given(bank=st.floats(-1.0, 1.0), yaw=angle)
def test_rate_demand_inverted_turn_goes_the_same_way_over_the_ground(bank, yaw):
    """A positive bank turns right on the back too: the rate about the vertical is g tan(bank) / V."""
    R = attitude(math.pi + bank, 0.0, yaw)
    demand = np.array(rate_demand(R, STILL, bank, 0.0, -1.0, CRUISE_M_S, record()))
    expected = [0.0, 0.0, G_M_S2 * math.tan(bank) / CRUISE_M_S]
    np.testing.assert_allclose(R @ demand, expected, rtol=0, atol=ROUND_OFF)


def test_elevator_inverted_level_is_down_elevator_for_two_g_less():
    """On its back the wing carries the weight the other way round: two units of cruise lift less, less with speed."""
    R = attitude(math.pi, 0.0)
    for speed_m_s in (CRUISE_M_S, 1.3 * CRUISE_M_S):
        lift = extra_lift(0.0, R[2, 2], speed_m_s, 1.0, record())
        np.testing.assert_allclose(lift, -((CRUISE_M_S / speed_m_s) ** 2) - 1.0, rtol=0, atol=ROUND_OFF)
    assert extra_lift(-10.0, -1.0, CRUISE_M_S, 1.0, record()) == -PARAMS.inverted_lift - 1.0


@given(speed=st.floats(8.0, 20.0), rate=st.floats(-2.0, 2.0), axis=st.sampled_from([0, 2]))
def test_rate_control_deflection_for_a_rate_goes_with_one_over_speed(speed, rate, axis):
    """The same helix angle p b / 2 V takes the same deflection."""
    demand = (rate, 0.0, 0.0) if axis == 0 else (0.0, 0.0, rate)
    at_cruise = control_of(demand, np.eye(3), STILL)[axis]
    fast = rate_control(demand, np.eye(3), STILL, speed, 1.0, state(), record(), 0.0)[axis]
    np.testing.assert_allclose(fast, at_cruise * CRUISE_M_S / speed, rtol=0, atol=ROUND_OFF)


@given(speed=st.floats(8.0, 20.0), load=st.floats(0.2, 1.3))
def test_extra_lift_for_a_load_goes_with_one_over_speed_squared(speed, load):
    """L = n W: the lift coefficient is n (V_c / V)^2 of that at cruise."""
    np.testing.assert_allclose(
        extra_lift(0.0, load, speed, 1.0, record()) + 1.0,
        min(load * (CRUISE_M_S / speed) ** 2, 1.0 + PARAMS.load_limit),
        rtol=0,
        atol=ROUND_OFF,
    )


def test_integral_at_the_stop_waits_and_otherwise_is_limited():
    """A surface at its stop must not wind up its integral; a lasting error never passes the limit."""
    s, p = state(), record()
    for _ in range(1000):
        rate_control((10.0, 10.0, 0.0), np.eye(3), STILL, CRUISE_M_S, 1.0, s, p, 0.02)
    assert (s["roll_integral"], s["pitch_integral"]) == (0.0, 0.0)
    for _ in range(1000):
        rate_control((0.4, 0.2, 0.0), np.eye(3), STILL, CRUISE_M_S, 1.0, s, p, 0.02)
    assert s["roll_integral"] == PARAMS.integral_limit
    assert s["pitch_integral"] == PARAMS.integral_limit


def test_shorter_way_either_side_of_a_right_angle_is_continuous():
    """The sine ends at 1 where saturation begins."""
    np.testing.assert_allclose(shorter_way(math.sin(1.570), math.cos(1.570), 0.0), 1.0, rtol=0, atol=1e-6)
    assert shorter_way(math.sin(1.571), math.cos(1.571), 0.0) == 1.0
    assert shorter_way(-0.1, -0.99, 0.0) == -1.0
