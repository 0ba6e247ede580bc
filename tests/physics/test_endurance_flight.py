"""The aeroplane flown: trim, stall, climb, roll, pitch, loops, and wild states.

Limits are engineering ones: the class of aeroplane, with the measured value beside each.
"""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.interface import NEUTRAL, ActuatorCommand
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.aeroplane.trim import Trim, accelerations, trim
from sim.log import Log
from sim.plant import InFlight

HEIGHT_M = 200.0


@pytest.fixture(scope="module")
def plant():
    return JsbsimPlant(start=InFlight(heading_rad=0.0, height_m=HEIGHT_M))


@pytest.fixture(scope="module")
def trimmed(plant):
    return plant.trimmed.command


def fly(plant, seconds, pilot):
    """Truth rows of `seconds`; `pilot(t_s, last row)` gives the command."""
    log = Log.empty(round(seconds / plant.dt_s))
    plant.reset(log)
    for k in range(len(log)):
        assert plant.advance(k, pilot(k * plant.dt_s, log.truth[max(k - 1, 0)])) is None
    return log.truth


def level(row):
    """Aileron that levels the wings."""
    return float(np.clip(-2.0 * row["R_eb"][2, 1] - 0.15 * row["omega_b_rad_s"][0], -1.0, 1.0))


def bank_deg(rows):
    return np.degrees(np.arctan2(rows["R_eb"][:, 2, 1], rows["R_eb"][:, 2, 2]))


def test_cruise_of_the_airframe_file_is_what_the_root_finder_finds(plant):
    """The numbers in airframe.toml are those of the model, and nothing accelerates there but by Coriolis."""
    cruise = plant.airframe["cruise"]
    found = trim(plant.model, cruise["airspeed_m_s"])
    listed = Trim.of(cruise)
    np.testing.assert_allclose(  # as many digits as the file has
        [found.alpha_rad, found.elevator, found.throttle, found.aileron],
        [listed.alpha_rad, listed.elevator, listed.throttle, 0.0], rtol=0, atol=1e-5,
    )  # fmt: skip
    remaining = accelerations(plant.model, listed, 60.0)
    rpm = plant.model.get("propulsion/engine/propeller-rpm")[0]
    assert abs(rpm - cruise["rotor_rpm"]) < 1.0
    coriolis_m_s2 = 2.0 * 7.292115e-5 * cruise["airspeed_m_s"]
    assert np.abs(remaining[:3]).max() < coriolis_m_s2 + 1e-4
    assert np.abs(remaining[3:]).max() < 1e-3


def test_trimmed_start_after_a_second_hardly_accelerates(plant, trimmed):
    """One second into a start in the air everything is still as it was."""
    rows = fly(plant, 1.0, lambda _t, _row: trimmed)
    np.testing.assert_allclose(rows["v_e_m_s"][-1] - rows["v_e_m_s"][0], 0.0, rtol=0, atol=0.02)
    np.testing.assert_allclose(rows["omega_b_rad_s"], 0.0, rtol=0, atol=0.002)
    assert abs(np.diff(rows["rotor_rpm"])).max() < 5.0


def test_stall_speed_in_a_slow_deceleration_is_of_the_class(plant):
    """The lowest speed at which the wing carries the weight lies between 6.5 and 7.5 m/s (measured 6.8)."""
    rows = fly(plant, 12.0, lambda t, row: ActuatorCommand(level(row), 0.05 * t, 0.0, 0.0))
    carried = rows["imu_force_b_m_s2"][:, 2] < -0.95 * 9.8
    slowest = rows["airspeed_m_s"][carried].min()
    assert 6.5 < slowest < 7.5


def test_full_up_elevator_at_idle_stalls_again_and_again_and_sinks_slowly(plant):
    """Held fully up with the motor off it bucks, deep in the stall each time, and the ailerons keep it upright."""
    rows = fly(plant, 14.0, lambda _t, row: ActuatorCommand(level(row), 1.0, 0.0, 0.0))
    assert np.degrees(rows["alpha_rad"]).max() > 40.0  # measured 106
    sink = (rows["p_e_m"][-1, 2] - rows["p_e_m"][100, 2]) / 12.0
    assert 1.0 < sink < 5.0  # measured 2.7
    assert np.abs(bank_deg(rows)).max() < 60.0  # measured 34: a wing drops, and is lifted


def turn(plant, elevator):
    """Rows after 5 s of a turn at idle that the ailerons have held; they stay where they are, the elevator as given."""
    log = Log.empty(350)
    plant.reset(log)
    bank = math.radians(30.0)
    speed = plant.trimmed.airspeed_m_s * np.array([1.0, 0.0, 0.016])
    plant.begin((0.0, 0.0, -HEIGHT_M), (bank, plant.trimmed.alpha_rad, 0.0), speed, command=plant.trimmed.command)
    aileron = 0.0
    for k in range(len(log)):
        row, t = log.truth[max(k - 1, 0)], k * plant.dt_s
        if t < 5.0:
            roll = math.atan2(row["R_eb"][2, 1], row["R_eb"][2, 2]) if k else bank
            aileron = float(np.clip(2.0 * (bank - roll) - 0.3 * row["omega_b_rad_s"][0], -1.0, 1.0))
        up = min(0.45, 0.1 + 0.08 * t) if t < 5.0 else elevator
        assert plant.advance(k, ActuatorCommand(aileron, up, 0.0, 0.0)) is None
    return log.truth[250:]


def test_stalled_turn_departs_and_a_normal_one_does_not(plant):
    """Full up elevator in a slow turn at idle drops a wing at once; without it the turn goes on as it was."""
    normal, stalled = turn(plant, 0.45), turn(plant, 1.0)
    assert np.degrees(stalled["alpha_rad"]).max() > 12.0
    assert np.abs(bank_deg(stalled) - bank_deg(stalled)[0]).max() > 25.0  # measured 41
    assert np.abs(stalled["omega_b_rad_s"][:, 0]).max() > 1.0  # measured 2.2
    assert np.abs(bank_deg(normal) - bank_deg(normal)[0]).max() < 5.0  # measured 3
    assert np.abs(normal["omega_b_rad_s"][:, 0]).max() < 0.1


def test_slow_stall_rocks_the_wings_against_the_ailerons(plant):
    """Slowed to the stall with the wings held level, it begins to rock past 40 degrees of bank (measured 84)."""
    rows = fly(plant, 20.0, lambda t, row: ActuatorCommand(level(row), min(1.0, 0.08 * t), 0.0, 0.0))
    assert np.abs(bank_deg(rows[:300])).max() < 2.0
    assert np.abs(bank_deg(rows)).max() > 40.0


def test_glide_with_the_motor_off_is_of_the_class(plant):
    """Best glide ratio between 8 and 12 (measured 9), from the energy lost over a long glide."""
    rows = fly(plant, 20.0, lambda _t, row: ActuatorCommand(level(row), 0.16, 0.0, 0.0))
    settled = rows[500:]
    v = settled["v_e_m_s"]
    lost_m = (np.diff(0.5 * np.sum(v[[0, -1]] ** 2, axis=1)) / 9.8 - np.diff(settled["p_e_m"][[0, -1], 2]))[0]
    way_m = np.sum(np.hypot(v[:, 0], v[:, 1])) * 0.02
    assert 8.0 < way_m / -lost_m < 12.0


def test_climb_at_full_throttle_is_of_the_class(plant):
    """Full throttle and a little up elevator climb at 3 to 6 m/s (measured 4.6)."""
    rows = fly(plant, 16.0, lambda _t, row: ActuatorCommand(level(row), 0.05, 0.0, 1.0))[400:]
    v = rows["v_e_m_s"]
    gained = -np.diff(rows["p_e_m"][[0, -1], 2])[0] + np.diff(0.5 * np.sum(v[[0, -1]] ** 2, axis=1))[0] / 9.8
    assert 3.0 < gained / (len(rows) * 0.02) < 6.0


def test_static_thrust_is_of_the_class(plant):
    """Held still at full throttle the propeller pulls 8 to 9 N (measured 8.9)."""
    plant.model.place(10.0, (0.0, 0.0, 0.0), np.zeros(3), (0.0,) * 3, ActuatorCommand(0, 0, 0, 1.0), plant.air, 400)
    thrust_n = 4.4482216 * plant.model.get("propulsion/engine/thrust-lbs")[0]
    assert 8.0 < thrust_n < 9.0


def place(plant, throttle, speed=12.0):
    """The model at `speed`, level at alpha 0, elevator full up and rudder full right, motor settled at `throttle`."""
    command = ActuatorCommand(0.0, 1.0, 1.0, throttle)
    plant.model.place(60.0, (0.0, 0.0, 0.0), np.array([speed, 0.0, 0.0]), (0.0,) * 3, command, plant.air, 400)


def test_slipstream_adds_to_elevator_and_rudder_as_momentum_theory_says(plant):
    """Dynamic pressure q + thrust / disc area on the part of tailplane and fin that stands in the slipstream."""
    get = plant.model.getter
    place(plant, 1.0)
    thrust_n = 4.4482216 * get("propulsion/engine/thrust-lbs")()
    q_pa = 47.880259 * get("aero/qbar-psf")()
    disc_m2 = 0.25 * np.pi * plant.airframe["geometry"]["propeller_diameter_m"] ** 2
    powered = get("aero/moment/pitch-elevator")(), get("aero/moment/yaw-rudder")()
    place(plant, 0.0)
    idle = get("aero/moment/pitch-elevator")(), get("aero/moment/yaw-rudder")()
    assert powered[0] / idle[0] == pytest.approx(1.0 + 0.4 * thrust_n / disc_m2 / q_pa, rel=1e-3)
    assert powered[1] / idle[1] == pytest.approx(1.0 + 0.5 * thrust_n / disc_m2 / q_pa, rel=1e-3)
    assert 1.3 < powered[0] / idle[0] < 1.8


def test_stopped_propeller_brakes_and_a_windmilling_one_pulls_back(plant):
    """With the throttle shut the blades stop: 45 cm2 of drag area; turning slower than the air they pull back."""
    get = plant.model.getter
    place(plant, 0.0)
    assert get("propulsion/engine/propeller-rpm")() < 1.0
    drag_n = 4.4482216 * get("aero/force/drag-propeller")()
    assert drag_n == pytest.approx(0.0045 * 47.880259 * get("aero/qbar-psf")(), rel=1e-6)
    place(plant, 0.25, speed=18.0)
    assert get("propulsion/engine/thrust-lbs")() < -0.05
    assert get("aero/force/drag-propeller")() == pytest.approx(0.0, abs=1e-9)


def test_motor_torque_rolls_against_the_propeller(plant):
    """The whole power goes into a torque on the airframe, P / omega, that rolls to the left (right-hand propeller)."""
    place(plant, 1.0)
    get = plant.model.getter
    power_w = 745.69987 * get("propulsion/engine/power-hp")()
    omega = get("propulsion/engine/propeller-rpm")() * np.pi / 30.0
    moment_nm = 1.3558179 * get("moments/l-prop-lbsft")()
    assert moment_nm < -0.05
    assert moment_nm == pytest.approx(-power_w / omega, rel=0.1)  # losses in the windings are part of the power


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_full_aileron_at_cruise_rolls_its_own_way_fast_enough(plant, trimmed, sign):
    """Positive aileron rolls right, at 120 deg/s or more (measured 207, down to 147 through knife edge)."""
    rows = fly(plant, 1.0, lambda _t, _row: trimmed._replace(aileron=sign))
    assert np.degrees(sign * rows["omega_b_rad_s"][10:, 0]).min() > 120.0
    assert sign * rows["aileron"][-1] == pytest.approx(1.0, rel=0, abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rudder_yaws_its_own_way(plant, trimmed, sign):
    """Positive rudder moves the nose to the right, and the right wing then drops."""
    rows = fly(plant, 1.0, lambda _t, _row: trimmed._replace(rudder=sign * 0.5))
    assert np.degrees(sign * rows["omega_b_rad_s"][15, 2]) > 10.0
    assert sign * rows["beta_rad"][25] < 0.0
    assert sign * bank_deg(rows)[-1] > 5.0


def test_full_elevator_at_loop_speed_pitches_fast_enough():
    """Positive elevator pitches up; from 17 m/s at 130 deg/s or more (measured 160)."""
    plant = JsbsimPlant(start=InFlight(0.0, HEIGHT_M, airspeed_m_s=17.0))
    rows = fly(plant, 1.0, lambda _t, _row: ActuatorCommand(0.0, 1.0, 0.0, 1.0))
    assert np.degrees(rows["omega_b_rad_s"][:, 1]).max() > 130.0


def test_loop_at_full_throttle_closes_with_the_radius_of_the_class():
    """From 17 m/s with 0.7 up elevator: all the way round, mean radius of 7 to 10 m (measured 8.2)."""
    plant = JsbsimPlant(start=InFlight(0.0, HEIGHT_M, airspeed_m_s=17.0))

    def pilot(_t, row):
        return ActuatorCommand(float(-0.15 * row["omega_b_rad_s"][0]), 0.7, 0.0, 1.0)

    rows = fly(plant, 6.0, pilot)
    angle = np.cumsum(rows["imu_omega_b_rad_s"][:, 1]) * 0.02
    assert angle[-1] > 2.0 * np.pi
    once = rows[: int(np.argmax(angle > 2.0 * np.pi))]
    radius_m = 0.5 * np.ptp(once["p_e_m"][:, 2])
    assert 7.0 < radius_m < 10.0
    assert once["R_eb"][:, 2, 2].min() < -0.95  # inverted on top


def test_spiral_from_a_bank_hands_off_is_near_neutral(plant, trimmed):
    """Left alone in a bank of 25 degrees it neither snaps upright nor tightens: 15 s later 10 to 40 degrees."""
    rows = fly(plant, 20.0, lambda t, _row: trimmed._replace(aileron=0.5 if t < 0.4 else 0.0))
    bank = bank_deg(rows)
    assert 20.0 < bank[100] < 35.0
    assert 10.0 < bank[-100] < 40.0  # measured 22


def test_dutch_roll_after_a_rudder_doublet_dies_out(plant, trimmed):
    """Two periods after the doublet less than a tenth of the sideslip is left (measured 0.02)."""

    def pilot(t, _row):
        return trimmed._replace(rudder=1.0 if t < 0.4 else -1.0 if t < 0.8 else 0.0)

    beta = np.degrees(fly(plant, 5.0, pilot)["beta_rad"])
    assert np.abs(beta).max() > 10.0
    assert np.abs(beta[175:]).max() < 0.1 * np.abs(beta).max()


def test_hands_off_cruise_stays_upright_for_a_minute(plant, trimmed):
    """The motor's torque is trimmed out: after a minute the bank is below 5 degrees (measured 0.001)."""
    rows = fly(plant, 60.0, lambda _t, _row: trimmed)
    assert np.abs(bank_deg(rows)).max() < 5.0
    np.testing.assert_allclose(rows["airspeed_m_s"], 12.6, rtol=0, atol=0.5)


wild_rate = st.floats(-6.0, 6.0)


@settings(max_examples=settings.default.max_examples // 4)
@given(
    quaternion=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    v_b=st.tuples(st.floats(-15.0, 25.0), st.floats(-15.0, 15.0), st.floats(-15.0, 15.0)),
    omega=st.tuples(wild_rate, wild_rate, wild_rate),
    command=st.builds(ActuatorCommand, *[st.floats(-1.0, 1.0)] * 3, st.floats(0.0, 1.0)),
)
def test_wild_state_any_attitude_and_motion_stays_finite(plant, quaternion, v_b, omega, command):
    """Tail slides, inverted, backwards, sideways, stalled, spun: five seconds later it is still a flight."""
    log = Log.empty(250)
    plant.reset(log)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # straight up and down are among the attitudes
        yaw, pitch, roll = Rotation.from_quat(quaternion).as_euler("ZYX")
    plant.begin((0.0, 0.0, -HEIGHT_M), (roll, pitch, yaw), np.array(v_b), omega, command, settle_s=0.1)
    for k in range(250):
        assert plant.advance(k, command) is None
    for name in log.truth.dtype.names:
        assert np.isfinite(log.truth[name]).all()
    # Terminal speed of a dive is 38 m/s; nothing that falls for 5 s from 33 m/s is faster than 50.
    assert log.truth["airspeed_m_s"].max() < 50.0
    assert np.abs(log.truth["omega_b_rad_s"]).max() < 40.0
    np.testing.assert_allclose(np.linalg.det(log.truth["R_eb"]), 1.0, rtol=0, atol=1e-12)


def test_tail_slide_comes_out_nose_down(plant):
    """Dropped backwards from the vertical it swaps ends and flies on, nose below the horizon."""
    log = Log.empty(150)
    plant.reset(log)
    plant.begin((0.0, 0.0, -HEIGHT_M), (0.0, math.radians(88.0), 0.0), np.array([-5.0, 0.0, 0.0]))
    for k in range(150):
        assert plant.advance(k, NEUTRAL) is None
    assert np.degrees(np.abs(log.truth["alpha_rad"])).max() > 150.0
    assert log.truth["R_eb"][:, 2, 0].max() > 0.7  # minus the sine of the pitch angle
    assert abs(np.degrees(log.truth["alpha_rad"][-1])) < 20.0
