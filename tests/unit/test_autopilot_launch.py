"""The throw is felt, and nothing else is."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.airframes import AutopilotParams
from autopilot.dcm import _PARAMS, _STATE, DcmAutopilot
from autopilot.energy import hold_height, throttle_for
from autopilot.interface import Mode, Setpoint
from autopilot.launch import LaunchParams, climb_away, feel_throw
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Measurements

G_M_S2 = 9.80665
DT_S = 0.02
PARAMS = LaunchParams()


def record(group, params):
    p = np.zeros(1, _PARAMS[group])
    p[0] = astuple(params)
    return p[0]


def everything():
    p = np.zeros(1, _PARAMS)
    for group in _PARAMS.names:
        p[0][group] = astuple(getattr(AutopilotParams(), group))
    return p[0]


def cruising():
    s = np.zeros(1, _STATE)[0]
    s["airspeed_m_s"] = s["airspeed_wanted_m_s"] = AutopilotParams().energy.airspeed_m_s
    s["true_factor"] = 1.0
    return s


def feel(forces_x, R_eb):
    """Ticks until the throw is felt, or None."""
    s, p = np.zeros(1, _STATE)[0], record("launch", PARAMS)
    s["thrown_s"] = -1.0
    row = np.zeros(1, MEASURED_DTYPE)[0]
    for k, force_x in enumerate(forces_x):
        row["force_b_m_s2"] = (force_x, 0.0, -G_M_S2)
        if feel_throw(R_eb, row, s, p, DT_S) >= 0.0:
            return k + 1
    return None


def motor_on(forces_x, R_eb):
    """Tick at which the motor may start, or None."""
    s, p = np.zeros(1, _STATE)[0], record("launch", PARAMS)
    s["thrown_s"] = -1.0
    row = np.zeros(1, MEASURED_DTYPE)[0]
    for k, force_x in enumerate(forces_x):
        row["force_b_m_s2"] = (force_x, 0.0, -G_M_S2)
        if feel_throw(R_eb, row, s, p, DT_S) >= PARAMS.motor_delay_s:
            return k
    return None


def pitched(degrees):
    return Rotation.from_euler("Y", degrees, degrees=True).as_matrix()


@pytest.mark.parametrize("pitch_deg", [-60.0, 0.0, 12.0, 45.0, 90.0])
def test_feel_throw_held_and_swayed_for_two_seconds_is_not_felt(pitch_deg):
    """Gravity at any pitch, with 0.5 g of sway at 1 Hz on it and noise of 0.02 g, is no throw."""
    t_s = np.arange(100) * DT_S
    noise = np.random.Generator(np.random.PCG64(1)).normal(0.0, 0.02 * G_M_S2, 100)
    gravity = G_M_S2 * math.sin(math.radians(pitch_deg))  # specific force of rest: minus gravity
    forces = gravity + 0.5 * G_M_S2 * np.sin(2 * math.pi * t_s) + noise
    assert feel(forces, pitched(pitch_deg)) is None


def test_feel_throw_knock_of_one_tick_is_not_felt():
    """A 3 g knock that lasts one sample is no throw."""
    assert feel([0.0] * 10 + [3.0 * G_M_S2] + [0.0] * 10, np.eye(3)) is None


@pytest.mark.parametrize("pitch_deg", [0.0, 12.0])
def test_feel_throw_push_of_2_75_g_is_felt_within_a_tenth_of_a_second(pitch_deg):
    """The throw of the hand launch, 27 m/s2 along the nose."""
    force = 2.75 * G_M_S2 + G_M_S2 * math.sin(math.radians(pitch_deg))
    ticks = feel([force] * 10, pitched(pitch_deg))
    assert ticks is not None
    assert ticks * DT_S <= 0.1


@pytest.mark.parametrize(
    ("push_m_s2", "push_s"),
    [(6.0, 2.0), (6.0, 0.8), (8.0, 0.6), (10.0, 0.8), (10.0, 2.0), (27.0, 0.3), (40.0, 0.1), (40.0, 2.0)],
)
@pytest.mark.parametrize("pitch_deg", [0.0, 15.0])
def test_feel_throw_motor_waits_for_the_end_of_the_push_and_no_longer(push_m_s2, push_s, pitch_deg):
    """Of any length and strength, also beyond the full scale of 3 g; afterwards drag slows it down a little."""
    at_rest = G_M_S2 * math.sin(math.radians(pitch_deg))
    push = min(push_m_s2 + at_rest, 3.0 * G_M_S2)
    n = round(push_s / DT_S)
    noise = np.random.Generator(np.random.PCG64(2)).normal(0.0, 0.5, 50 + n + 25)
    on = motor_on(np.array([at_rest] * 50 + [push] * n + [-1.5] * 25) + noise, pitched(pitch_deg))
    assert on is not None
    assert 0 < on - (50 + n) <= 5


def test_feel_throw_push_that_falters_goes_on():
    """A dip of one sample in the push is not its end."""
    forces = [0.0] * 10 + [20.0] * 10 + [2.0] + [20.0] * 10 + [-1.0] * 10
    assert motor_on(forces, np.eye(3)) > 31


@pytest.mark.parametrize("hz", [0.8, 1.0, 2.0, 3.0])
def test_feel_throw_waved_along_the_nose_does_not_start_the_motor(hz):
    """Waved with up to 1.7 m/s, at most 1.2 g, from rest: each swing ends in a swing back."""
    t_s = np.arange(200) * DT_S
    w = 2.0 * math.pi * hz
    forces = min(1.7 * w, 1.2 * G_M_S2) * np.cos(w * t_s) * np.minimum(t_s, 1.0)
    assert motor_on(forces, np.eye(3)) is None


@pytest.mark.parametrize("then_m_s2", [0.0, -6.0])
def test_feel_throw_in_a_car_does_not_start_the_motor(then_m_s2):
    """6 s at 3 m/s2, then it cruises or brakes."""
    assert motor_on([3.0] * 300 + [then_m_s2] * 100, np.eye(3)) is None


def test_feel_throw_slowed_down_after_the_push_is_still_in_the_hand():
    """A push of 4 m/s and a stop by the same hand; a throw afterwards counts."""
    stopped = [0.0] * 10 + [20.0] * 10 + [-20.0] * 10 + [0.0] * 50
    assert motor_on(stopped, np.eye(3)) is None
    assert motor_on([*stopped, *[27.0] * 15, *[-1.0] * 10], np.eye(3)) == 96


def test_climb_away_follows_the_throw_from_no_power_to_the_height():
    """Motor off in the hand, then full, then that of the climb, which ends below the height for good."""
    s, p = cruising(), everything()
    row = np.zeros(1, MEASURED_DTYPE)[0]
    row["gps_valid"] = 1

    def at(thrown_s, height_m):
        row["gps_p_e_m"] = (0.0, 0.0, -height_m)
        return climb_away(thrown_s, 50.0, row, s, p, DT_S)

    assert at(-1.0, 1.7) == (PARAMS.climb_pitch_rad, 0.0)
    assert at(0.0, 1.7) == (PARAMS.climb_pitch_rad, 0.0)
    assert at(0.02, 60.0) == (PARAMS.climb_pitch_rad, 0.0)  # above the height already: still no power
    assert s["levelled_off"] == 0
    assert at(0.3, 1.7) == (PARAMS.climb_pitch_rad, 1.0)
    assert at(PARAMS.full_throttle_s, 20.0) == (
        PARAMS.climb_pitch_rad,
        throttle_for(PARAMS.climb_pitch_rad, s, p["energy"]),
    )
    near_pitch, near_throttle = at(12.0, 49.0)
    assert near_pitch < PARAMS.climb_pitch_rad
    assert near_throttle < 1.0
    assert s["levelled_off"] == 1
    s["climb_integral_rad"] = 0.0
    pitch, throttle = at(13.0, 40.0)  # below the height again: the height loop goes on, not the launch
    assert (pitch, throttle) == hold_height(50.0, row, cruising(), p, DT_S)


def test_launch_mode_in_the_hand_keeps_motor_off_and_learns_nothing():
    """However long it is held tilted, the throttle stays at 0 (though the set-point asks) and no integral winds up."""
    autopilot, held = DcmAutopilot(), Setpoint(Mode.LAUNCH, throttle=1.0)
    rows = np.zeros(1, MEASURED_DTYPE)
    rows["dt_s"] = DT_S
    tilted = AttitudeEstimate(Rotation.from_euler("ZYX", [0.3, 0.2, 0.4]).as_matrix())
    commands = {autopilot.update(tilted, Measurements(rows, 0), held) for _ in range(500)}
    assert len(commands) == 1
    assert commands.pop().throttle == 0.0
