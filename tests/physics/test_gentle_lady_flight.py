"""The sailplane flown: glide, stall, turns by rudder alone, autorotation, wild states, energy, convergence.

Limits are those of the class, with the measured value beside each.  The flights go straight to JSBSim's model; the
glide is found here by root finding of its own.
"""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from autopilot.interface import ActuatorCommand
from sim.aeroplane.jsbsim_model import FT_TO_M, Model
from sim.air import STILL
from sim.place import LATITUDE_DEG
from sim.truth import gravity_m_s2

HEIGHT_M = 60.0
G_M_S2 = gravity_m_s2(math.radians(LATITUDE_DEG))
READ = {
    "roll": "attitude/phi-rad", "pitch": "attitude/theta-rad", "alpha": "aero/alpha-rad", "beta": "aero/beta-rad",
    "p": "velocities/p-rad_sec", "q": "velocities/q-rad_sec", "r": "velocities/r-rad_sec", "v": "velocities/vt-fps",
    "height": "position/from-start-neu-u-ft", "north": "position/from-start-neu-n-ft",
    "east": "position/from-start-neu-e-ft", "down_v": "velocities/v-down-fps", "psi_dot": "velocities/psidot-rad_sec",
}  # fmt: skip
IN_FEET = ("v", "height", "north", "east", "down_v")


@pytest.fixture(scope="module")
def model():
    return Model("gentle_lady", 200)


@pytest.fixture(scope="module")
def cruise(model):
    return model.airframe["cruise"]


def put(model, speed, alpha, path, command, roll=0.0, omega=(0.0, 0.0, 0.0)):
    """Place the sailplane gliding: speed [m/s], angle of attack and of the path [rad]."""
    v_b = speed * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    model.place(HEIGHT_M, (roll, alpha + path, 0.0), v_b, omega, command, STILL, 1)


def glide(model, speed):
    """Angle of attack, elevator, angle of the path at which nothing accelerates."""

    def residual(x):
        put(model, speed, x[0], x[2], ActuatorCommand(0.0, x[1], 0.0, 0.0))
        return model.accelerations()[[0, 2, 4]]

    found = root(residual, (0.06, 0.0, -0.08), tol=1e-11)
    assert np.abs(found.fun).max() < 1e-9
    return found.x


def fly(model, seconds, pilot, roll=0.0, speed=None, trimmed=None):
    """Columns of READ, SI, a row a step; `pilot(t_s, row)` gives the command, starting in a glide."""
    c = model.airframe["cruise"]
    alpha, elevator, path = trimmed if trimmed is not None else (
        math.radians(c["alpha_deg"]), c["elevator"], math.radians(c["flight_path_deg"])
    )  # fmt: skip
    put(model, speed or c["airspeed_m_s"], alpha, path, ActuatorCommand(0.0, elevator, 0.0, 0.0), roll)
    get = [model.getter(name) for name in READ.values()]
    send = [model.setter(f"fcs/{s}-cmd-norm") for s in ("aileron", "elevator", "rudder", "throttle")]
    rows = np.empty((round(seconds / model.dt_s), len(READ)))
    start = np.array([g() if name in ("north", "east") else 0.0 for name, g in zip(READ, get, strict=True)])
    row = dict(zip(READ, (g() for g in get), strict=True))
    for k in range(len(rows)):
        for write, value in zip(send, pilot(k * model.dt_s, row)[:4], strict=True):
            write(value)
        model.run()
        rows[k] = [g() for g in get]
        row = dict(zip(READ, rows[k], strict=True))
    rows -= start
    return {name: rows[:, i] * (FT_TO_M if name in IN_FEET else 1.0) for i, name in enumerate(READ)}


def hands_off(cruise, rudder=0.0, elevator=0.0):
    command = ActuatorCommand(0.0, cruise["elevator"] + elevator, rudder, 0.0)
    return lambda _t, _row: command


def test_cruise_of_the_airframe_file_is_the_best_glide(model, cruise):
    """The numbers of airframe.toml are the trim at their speed, and no speed near it glides farther."""
    alpha, elevator, path = glide(model, cruise["airspeed_m_s"])
    listed = (cruise["alpha_deg"], cruise["elevator"], cruise["flight_path_deg"])
    # As many digits as the file has.
    np.testing.assert_allclose([math.degrees(alpha), elevator, math.degrees(path)], listed, rtol=0, atol=2e-5)
    for other in (-0.4, 0.4):
        assert glide(model, cruise["airspeed_m_s"] + other)[2] < path


def test_glide_polar_is_of_the_class(model):
    """Best glide 12 to 17 (measured 12.5), least sink 0.45 to 0.7 m/s (measured 0.46)."""
    speeds = np.arange(4.8, 9.3, 0.2)
    path = np.array([glide(model, v)[2] for v in speeds])
    assert 12.0 < (-1.0 / np.tan(path)).max() < 17.0
    sink = -speeds * np.sin(path)
    assert 0.445 < sink.min() < 0.7
    assert np.abs(sink[(speeds > 5.9) & (speeds < 7.1)] - 0.575).max() < 0.15


def test_trimmed_glide_holds_for_half_a_minute(model, cruise):
    """Hands off, speed within 0.1 m/s, path within 0.3 degrees, bank within half a degree."""
    rows = fly(model, 30.0, hands_off(cruise))
    np.testing.assert_allclose(rows["v"], cruise["airspeed_m_s"], rtol=0, atol=0.1)
    path = np.degrees(np.arcsin(-rows["down_v"] / rows["v"]))
    np.testing.assert_allclose(path, cruise["flight_path_deg"], rtol=0, atol=0.3)
    assert np.degrees(np.abs(rows["roll"])).max() < 0.5


def test_throttle_is_ignored_and_the_motor_reads_zero(cruise):
    """Without a motor the same flight comes out whatever the throttle, and rpm and thrust read 0."""
    idle = fly(Model("gentle_lady", 200), 2.0, lambda _t, _row: ActuatorCommand(0.0, cruise["elevator"], 0.0, 0.0))
    model = Model("gentle_lady", 200)
    full = fly(model, 2.0, lambda _t, _row: ActuatorCommand(0.0, cruise["elevator"], 0.0, 1.0))
    for name in READ:
        np.testing.assert_array_equal(idle[name], full[name])
    names = ("propulsion/engine/propeller-rpm", "propulsion/engine/thrust-lbs", "fcs/throttle-pos-norm")
    assert not model.get(*names).any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rudder_yaws_and_then_rolls_its_own_way(model, cruise, sign):
    """Half rudder: the nose goes first, the dihedral rolls after it, 10 to 40 degrees in 2 s (measured 16)."""
    rows = fly(model, 2.0, hands_off(cruise, rudder=0.5 * sign))
    assert sign * rows["r"][60] > 0.1
    assert sign * rows["beta"][60] < 0.0
    assert 10.0 < math.degrees(sign * rows["roll"][-1]) < 40.0


def test_spiral_hands_off_is_slow(model, cruise):
    """From a bank of 25 degrees it neither snaps upright nor dives: 3 to 30 degrees 20 s later (measured 10)."""
    rows = fly(model, 20.0, hands_off(cruise), roll=math.radians(25.0))
    assert 3.0 < math.degrees(rows["roll"][-1]) < 30.0
    assert rows["v"].max() < 9.0


def test_coordinated_turn_by_rudder_meets_the_closed_form(model, cruise):
    """A bank of 25 degrees held by the rudder: tan(bank) = V psi_dot / g, corrected for slip and path, within 4 %."""

    def pilot(_t, row):
        error = math.radians(25.0) - row["roll"]
        rudder = float(np.clip(1.2 * error - 0.3 * row["p"], -1.0, 1.0))
        return ActuatorCommand(0.0, cruise["elevator"] + 0.15, rudder, 0.0)

    rows = fly(model, 40.0, pilot, roll=math.radians(25.0))
    last = {name: column[-4000:].mean() for name, column in rows.items()}
    assert abs(math.degrees(last["roll"]) - 25.0) < 5.0
    # Side force of slip and yaw rate on fin, body and dihedral, C_Y q S: all that acts across the wings.
    half_span_in_s = 1.99 / (2.0 * last["v"])
    c_y = -0.327 * last["beta"] + 0.253 * last["r"] * half_span_in_s - 0.293 * last["p"] * half_span_in_s
    side = c_y * 0.5 * 1.19 * last["v"] ** 2 * 0.428 / 0.71
    flat = last["v"] * math.cos(math.asin(last["down_v"] / last["v"]))
    bank = math.atan(last["psi_dot"] * flat / G_M_S2) - side / (G_M_S2 * math.cos(last["roll"]))
    assert math.tan(bank) == pytest.approx(math.tan(last["roll"]), rel=0.04)


def turn(model, cruise, elevator):
    """Rows from 3.0 to 5.5 s of a turn entered with 0.3 rudder; `elevator` is added at 3 s."""

    def pilot(t, _row):
        up = min(1.0, cruise["elevator"] + (elevator if t >= 3.0 else 0.0))
        return ActuatorCommand(0.0, up, 0.3, 0.0)

    rows = fly(model, 5.5, pilot)
    return {name: column[600:] for name, column in rows.items()}


def test_stalled_turn_departs_and_a_normal_one_does_not(model, cruise):
    """The elevator pulled up in a turn: to a third it tightens the turn, fully a wing drops at many times the rate."""
    normal, stalled = turn(model, cruise, 0.3), turn(model, cruise, 1.0)
    assert np.degrees(normal["alpha"]).max() < 10.0  # measured 3
    assert np.degrees(normal["roll"]).max() < 45.0  # measured 33
    assert np.degrees(stalled["alpha"]).max() > 11.0  # past the stall at 10; measured 12.5
    assert np.degrees(stalled["roll"]).max() > 70.0  # measured 77
    assert np.abs(stalled["p"]).max() > 4.0 * np.abs(normal["p"]).max()  # measured 1.8 and 0.14 rad/s


def test_stalled_wing_disturbed_rolls_on_and_a_flying_one_does_not(model):
    """A roll rate dies out within a second below the stall; 2 degrees past it, held there, it grows (autorotation)."""
    moment = model.getter("aero/moment/roll-p")
    for alpha_deg, sign in ((4.0, -1.0), (14.5, 1.0), (40.0, -1.0)):
        put(model, 6.0, math.radians(alpha_deg), -0.08, ActuatorCommand(0.0, 0.0, 0.0, 0.0), omega=(0.3, 0.0, 0.0))
        assert sign * moment() > 0.0


def test_rotation_of_the_air_takes_the_place_of_that_of_the_body(model):
    """Air that turns with the aeroplane damps nothing; air that turns alone acts as the aeroplane's opposite turn."""
    still = ActuatorCommand(0.0, 0.0, 0.0, 0.0)
    names = [f"aero/moment/{m}" for m in ("roll-p", "roll-r", "pitch-q", "yaw-p", "yaw-r")]
    air = [model.setter(f"gust/{x}-rad_sec") for x in "pqr"]
    rates = (0.4, -0.3, 0.2)
    put(model, 7.0, 0.05, -0.08, still, omega=tuple(-x for x in rates))
    turning = model.get(*names)
    assert np.abs(turning).min() > 0.0
    try:
        for write, rate in zip(air, rates, strict=True):
            write(rate)
        put(model, 7.0, 0.05, -0.08, still)
        np.testing.assert_allclose(model.get(*names), turning, rtol=1e-3, atol=1e-9)
        put(model, 7.0, 0.05, -0.08, still, omega=rates)
        # What is left is the turning of the earth, 7e-5 rad/s.
        np.testing.assert_allclose(model.get(*names), 0.0, rtol=0, atol=1e-3 * np.abs(turning).max())
    finally:
        for write in air:
            write(0.0)


def energy_error(physics_hz):
    """Joules by which kinetic and potential energy and the work of the air's force part in a lively 4 s."""
    model = Model("gentle_lady", physics_hz)
    force = [model.getter(f"forces/fb{a}-total-lbs") for a in "xyz"]
    speed = [model.getter(f"velocities/{a}-fps") for a in "uvw"]
    up, power, energy = model.getter("position/from-start-neu-u-ft"), [], []
    c = model.airframe["cruise"]
    to_watt = 4.4482216152605 * FT_TO_M

    def pilot(t, _row):
        if t > 0.0:
            power.append(to_watt * sum(f() * v() for f, v in zip(force, speed, strict=True)))
            v2 = FT_TO_M**2 * sum(v() ** 2 for v in speed)
            energy.append(model.mass_kg() * (0.5 * v2 + G_M_S2 * FT_TO_M * up()))
        return ActuatorCommand(0.0, c["elevator"] + 0.5 * math.sin(4.0 * t), 0.5 * math.sin(3.0 * t), 0.0)

    fly(model, 4.0, pilot)
    work = np.sum(0.5 * (np.array(power[1:]) + np.array(power[:-1]))) * model.dt_s
    assert abs(work) > 5.0
    return abs(energy[-1] - energy[0] - work), abs(work)


def test_energy_balance_closes_to_the_order_of_the_integrator():
    """Kinetic plus potential energy changes by the work of the air: within 1e-4 of it, and at a coarse step more.

    The rest at fine steps, 0.0006 J of 14 J, is gravity, which differs from the constant here by some 1e-4 m/s2.
    """
    coarse, work = energy_error(25)
    middle, _ = energy_error(50)
    fine, _ = energy_error(200)
    assert fine < 1e-4 * work
    assert middle < 0.5 * coarse  # measured 0.0020 and 0.017 J
    assert coarse < 2e-3 * work


def test_halving_the_time_step_converges_at_first_order():
    """JSBSim's mixed integrators are of first order: against 1600 Hz the error at 100 Hz is 15/7 of that at 200 Hz."""

    def pilot(t, _row):
        return ActuatorCommand(0.0, 0.3 * math.sin(2.0 * t), 0.4 * math.sin(1.5 * t), 0.0)

    end = {}
    for hz in (100, 200, 400, 1600):
        rows = fly(Model("gentle_lady", hz), 5.0, pilot)
        end[hz] = np.array([rows[name][-1] for name in ("north", "east", "height")])
    error = {hz: float(np.linalg.norm(end[hz] - end[1600])) for hz in (100, 200, 400)}
    assert 1.6 < error[100] / error[200] < 2.7
    assert 1.7 < error[200] / error[400] < 3.0  # 7/3
    assert error[200] < 0.03  # m, measured 0.019


wild_rate = st.floats(-6.0, 6.0)


@settings(max_examples=settings.default.max_examples // 4)
@given(
    quaternion=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    v_b=st.tuples(st.floats(-15.0, 20.0), st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)),
    omega=st.tuples(wild_rate, wild_rate, wild_rate),
    command=st.builds(ActuatorCommand, *[st.floats(-1.0, 1.0)] * 3, st.just(0.0)),
)
def test_wild_state_any_attitude_and_motion_stays_finite(model, quaternion, v_b, omega, command):
    """Tail slides, inverted, backwards, sideways, stalled, spun: five seconds later it is still a flight."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # straight up and down are among the attitudes
        yaw, pitch, roll = Rotation.from_quat(quaternion).as_euler("ZYX")
    model.place(300.0, (roll, pitch, yaw), np.array(v_b), omega, command, STILL, 1)
    get = [model.getter(name) for name in READ.values()]
    seen = np.empty((1000, len(get)))
    for row in seen:
        model.run()
        row[:] = [g() for g in get]
    assert np.isfinite(seen).all()
    column = dict(zip(READ, seen.T, strict=True))
    # Nothing that falls for 5 s from 25 m/s is faster than 55.
    assert column["v"].max() * FT_TO_M < 55.0
    assert max(np.abs(column[x]).max() for x in "pqr") < 40.0
