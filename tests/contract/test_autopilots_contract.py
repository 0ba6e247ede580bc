"""What every registered autopilot must do, whatever it is."""

import importlib
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot import AUTOPILOTS
from autopilot.interface import ActuatorCommand, Autopilot, Mode, Setpoint, Waypoint
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Measurements

NAMES = sorted(AUTOPILOTS)
finite = st.floats(-1e6, 1e6)
vector = st.tuples(finite, finite, finite)
ROUTE = (Waypoint(100.0, 0.0, 60.0), Waypoint(100.0, 150.0, 80.0), Waypoint(-50.0, 0.0, 60.0))
setpoints = st.sampled_from(
    [
        Setpoint(mode, aileron=0.2, bank_rad=0.3, rate_b_rad_s=(0.1, 1.5, 0.0), course_rad=4.0, route=ROUTE)
        for mode in Mode
    ]
)


def make(name):
    module, _, cls = AUTOPILOTS[name].partition(":")
    return getattr(importlib.import_module(module), cls)()


def accept(command):
    """The command is one: finite, within the limits."""
    assert isinstance(command, ActuatorCommand)
    assert all(math.isfinite(c) for c in command[:4])
    assert all(-1.0 <= c <= 1.0 for c in command[:3])
    assert 0.0 <= command.throttle <= 1.0
    assert int(command.mode) in set(Mode)


def flight(n, seed=3):
    """A made-up flight: attitudes, rates, measurements, set-points."""
    random = np.random.Generator(np.random.PCG64(seed))
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"], rows["gps_valid"] = np.arange(n) * 0.02, 0.02, 1
    rows["gps_t_s"] = rows["t_s"] - 0.3
    rows["gps_p_e_m"] = np.cumsum(random.normal(0.0, 1.0, (n, 3)), axis=0) - (100.0, 50.0, 45.0)
    rows["gps_v_e_m_s"] = random.normal(0.0, 5.0, (n, 3))
    rows["force_b_m_s2"] = random.normal((0.0, 0.0, -9.8), 3.0, (n, 3))
    attitudes = Rotation.from_rotvec(np.cumsum(random.normal(0.0, 0.05, (n, 3)), axis=0)).as_matrix()
    rates = random.normal(0.0, 0.5, (n, 3))
    plan = [Setpoint(mode, bank_rad=0.4, course_rad=2.0, route=ROUTE) for mode in Mode]
    for k in range(n):
        wind = None if k % 50 < 25 else np.array([3.0, -2.0, 0.0])
        yield (
            AttitudeEstimate(attitudes[k], rates[k], wind_e_m_s=wind),
            Measurements(rows, k),
            plan[k * len(plan) // n],
        )


def fly(autopilot, ticks):
    return np.array([autopilot.update(*tick) for tick in ticks])


@pytest.mark.parametrize("name", NAMES)
def test_autopilot_speaks_the_protocol(name):
    """It can be made without arguments and has `update`."""
    assert isinstance(make(name), Autopilot)


@pytest.mark.hypothesis
@pytest.mark.parametrize("name", NAMES)
def test_update_any_rotation_and_measurement_gives_a_command_within_limits(name):
    """Any attitude, rate, wind and finite measurement, in any mode, one after the other."""
    autopilot = make(name)

    @given(
        quaternion=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 1e-3),
        omega=vector, wind=st.none() | vector, force=vector, position=vector, velocity=vector,
        times=st.tuples(finite, st.floats(0.0, 10.0), finite), valid=st.integers(0, 1), setpoint=setpoints,
    )  # fmt: skip
    def commands_are_finite(quaternion, omega, wind, force, position, velocity, times, valid, setpoint):
        rows = np.zeros(1, MEASURED_DTYPE)
        rows["t_s"], rows["dt_s"], rows["gps_t_s"] = times
        rows["gps_new"] = rows["gps_valid"] = valid
        rows["force_b_m_s2"], rows["gps_p_e_m"], rows["gps_v_e_m_s"] = force, position, velocity
        wind = None if wind is None else np.array(wind)
        R_eb = Rotation.from_quat(quaternion).as_matrix()
        accept(
            autopilot.update(AttitudeEstimate(R_eb, np.array(omega), wind_e_m_s=wind), Measurements(rows, 0), setpoint)
        )

    commands_are_finite()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", list(Mode))
def test_update_attitude_that_is_not_a_number_gives_neutral_controls(name, mode):
    """A NaN in any entry of the attitude or the rate: still controls, motor off, and sane again afterwards."""
    (good, m, _), *_ = flight(1)
    setpoint = Setpoint(mode, route=ROUTE)
    for entry in range(12):
        autopilot, fresh = make(name), make(name)
        R_eb, omega = good.R_eb.copy(), good.omega_b_rad_s.copy()
        (R_eb.reshape(9) if entry < 9 else omega)[entry % 9] = math.nan
        command = autopilot.update(AttitudeEstimate(R_eb, omega), m, setpoint)
        assert command[:4] == (0.0, 0.0, 0.0, 0.0)
        np.testing.assert_array_equal(autopilot.update(good, m, setpoint), fresh.update(good, m, setpoint))


@pytest.mark.parametrize("name", NAMES)
def test_update_same_flight_twice_is_bit_equal(name):
    """Nothing but the inputs decides."""
    np.testing.assert_array_equal(fly(make(name), flight(600)), fly(make(name), flight(600)))


@pytest.mark.parametrize("name", NAMES)
def test_reset_equals_new(name):
    """A used autopilot, reset, flies as a new one does."""
    used = make(name)
    fly(used, flight(600, seed=8))
    used.reset()
    np.testing.assert_array_equal(fly(used, flight(600)), fly(make(name), flight(600)))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cut", [30, 299, 550])
def test_snapshot_restored_continues_bit_equal(name, cut):
    """N ticks, snapshot, others in between, restore, N more: the same as 2 N."""
    ticks = list(flight(600))
    autopilot = make(name)
    whole = fly(make(name), ticks)
    fly(autopilot, ticks[:cut])
    snapshot = autopilot.snapshot()
    fly(autopilot, flight(100, seed=9))
    for _ in range(2):  # restoring does not use the snapshot up
        autopilot.restore(snapshot)
        np.testing.assert_array_equal(fly(autopilot, ticks[cut:]), whole[cut:])


@pytest.mark.parametrize("name", NAMES)
def test_update_leaves_its_inputs_alone(name):
    """Arrays handed over are never edited, and may be read-only."""
    for estimate, m, setpoint in flight(60):
        arrays = (estimate.R_eb, estimate.omega_b_rad_s, m.rows)
        before = [a.copy() for a in arrays]
        for a in arrays:
            a.flags.writeable = False
        make(name).update(estimate, m, setpoint)
        for a, b in zip(arrays, before, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", NAMES)
def test_update_lists_for_arrays_are_taken(name):
    """A plain estimator may answer with nested lists."""
    (good, m, _), *_ = flight(1)
    setpoint = Setpoint(Mode.STABILISE)
    lists = AttitudeEstimate(good.R_eb.tolist(), good.omega_b_rad_s.tolist())
    np.testing.assert_array_equal(make(name).update(lists, m, setpoint), make(name).update(good, m, setpoint))
