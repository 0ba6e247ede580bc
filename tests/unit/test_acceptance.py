"""What the loop accepts from flight code, and how it blames."""

import math

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from estimator.interface import AttitudeEstimate, Health, ImuSample, Measurements
from sim.flight_code import FlightCodeFailed, Unusable, estimate_of, record_command, record_estimate
from sim.log import FLOWN_DTYPE, Outcome


@pytest.fixture
def flown():
    return np.zeros(2, FLOWN_DTYPE)


def rotation(angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_record_estimate_of_a_rotation_is_stored_bit_for_bit(flown):
    """What the estimator said is what the recording holds."""
    e = AttitudeEstimate(rotation(0.3), np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), None, Health.POOR)
    record_estimate(flown, 1, e)
    np.testing.assert_array_equal(flown["R_eb"][1], e.R_eb)
    np.testing.assert_array_equal(flown["omega_b_rad_s"][1], e.omega_b_rad_s)
    np.testing.assert_array_equal(flown["gyro_bias_b_rad_s"][1], e.gyro_bias_b_rad_s)
    assert np.isnan(flown["wind_e_m_s"][1]).all()
    assert flown["health"][1] == Health.POOR
    assert not flown["R_eb"][0].any()


def test_record_estimate_of_lists_and_single_precision_is_accepted(flown):
    """Someone's own estimator may well answer in lists or float32."""
    record_estimate(flown, 0, AttitudeEstimate(rotation(0.3).astype(np.float32).tolist()))
    np.testing.assert_allclose(flown["R_eb"][0], rotation(0.3), rtol=0, atol=1e-7)  # single precision


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"R_eb": np.full((3, 3), np.nan)}, "not finite"),
        ({"R_eb": 1.01 * np.eye(3)}, "not a rotation"),
        ({"R_eb": np.diag([1.0, 1.0, -1.0])}, "reflection"),
        ({"R_eb": np.eye(4)}, "shape"),
        ({"R_eb": np.zeros(9)}, "shape"),
        ({"R_eb": np.eye(3), "omega_b_rad_s": np.array([0.0, np.inf, 0.0])}, "omega_b_rad_s"),
        ({"R_eb": np.eye(3), "gyro_bias_b_rad_s": np.array([np.nan, 0.0, 0.0])}, "gyro_bias_b_rad_s"),
        ({"R_eb": np.eye(3), "omega_b_rad_s": np.zeros(2)}, "shape"),
        ({"R_eb": np.eye(3), "omega_b_rad_s": np.zeros((3, 1))}, "shape"),
        ({"R_eb": np.eye(3), "health": 9}, "health is not a Health: 0 STARTING, 1 GOOD, 2 POOR"),
    ],
)
def test_record_estimate_of_an_unusable_answer_is_refused_by_name(flown, change, fault):
    with pytest.raises(Unusable, match=fault):
        record_estimate(flown, 0, AttitudeEstimate(**change))


def test_estimate_of_an_estimator_that_raises_names_class_time_and_fault(flown):
    class Clumsy:
        def update(self, m):
            return 1 / 0

    m = Measurements.of(ImuSample(12.34, 0.02, np.zeros(3), np.zeros(3)))
    with pytest.raises(FlightCodeFailed, match=r"Clumsy at 12\.34 s: ZeroDivisionError: division by zero") as caught:
        estimate_of(Clumsy(), m, flown, 0)
    assert caught.value.outcome == Outcome.ESTIMATOR_FAILED


@pytest.mark.parametrize(
    "command", [(0.0, math.nan, 0.0, 0.0), (50.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.001, 0.0), (0.0, 0.0, 0.0, -0.1)]
)
def test_record_command_outside_what_a_servo_can_do_is_refused(flown, command):
    with pytest.raises(Unusable, match=r"must be within -1\.\.1, the throttle within 0\.\.1"):
        record_command(flown, 0, ActuatorCommand(*command))


def test_record_command_in_an_unknown_mode_is_refused_with_those_there_are(flown):
    with pytest.raises(Unusable, match=r"mode 77 is not a Mode: 0 MANUAL, .*5 LAUNCH"):
        record_command(flown, 0, ActuatorCommand(0.0, 0.0, 0.0, 0.0, 77))


@pytest.mark.parametrize("answer", [None, np.eye(3), (np.eye(3), np.zeros(3))])
def test_record_of_something_that_is_no_answer_says_what_is_wanted(flown, answer):
    with pytest.raises(Unusable, match=r"update\(\) returned \w+; it must return an AttitudeEstimate"):
        record_estimate(flown, 0, answer)
    with pytest.raises(Unusable, match=r"update\(\) returned \w+; it must return an ActuatorCommand"):
        record_command(flown, 0, answer)
