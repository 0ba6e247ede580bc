"""The standby attitude, against a motion made with SciPy: it must find a gyro offset and hold the attitude."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.dcm import DcmAutopilot
from autopilot.interface import Mode, Setpoint
from autopilot.standby import StandbyParams
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Health, Measurements

DT_S, SPEED_M_S, G_M_S2 = 0.02, 12.6, 9.80665
OFFSET_RAD_S = np.radians([2.0, -3.0, 2.5])
SICK = AttitudeEstimate(np.diag([-1.0, 1.0, -1.0]), np.array([1.0, 2.0, 3.0]), health=Health.POOR)


def weaving(t_s):
    """Bank, rad: gentle turns to both sides, as gusts make them."""
    return math.radians(8.0) * math.sin(2.0 * math.pi * t_s / 12.0)


def climbing(_t_s):
    """A steady climb by 5 degrees, wings level."""
    return 0.0


def motion(seconds, bank_rad, climb_rad):
    """Time, attitude, body rate, velocity and specific force of coordinated flight: tan(bank) = V w / g."""
    t_s = DT_S * np.arange(round(seconds / DT_S) + 1)
    bank = np.array([bank_rad(t) for t in t_s])
    heading_rad = 0.3 + np.cumsum(DT_S * G_M_S2 * np.tan(bank) / SPEED_M_S)
    attitude = Rotation.from_euler("ZYX", np.column_stack((heading_rad, np.full_like(bank, climb_rad), bank)))
    v = SPEED_M_S * attitude.apply([1.0, 0.0, 0.0])
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / DT_S
    force = attitude[1:].inv().apply(np.diff(v, axis=0) / DT_S - [0.0, 0.0, G_M_S2])
    return t_s[:-1], attitude[1:], rate, v[1:], force


def standby(seconds, bank_rad, *, climb_rad=0.0, params=None, accelerometer=True, gps=True, tilt_deg=0.0):
    """Errors of the standby attitude, deg, tick by tick, and its offset at the end, of an estimator ill after 1 s.

    The last healthy estimate is `tilt_deg` wrong in bank, and knows nothing of the offset.
    """
    whole = replace(DcmAutopilot().params, standby=params or StandbyParams())
    autopilot, row = DcmAutopilot(whole), np.zeros(1, MEASURED_DTYPE)
    t_s, attitude, rate, v, force = motion(seconds, bank_rad, climb_rad)
    wrong = (attitude * Rotation.from_euler("x", tilt_deg, degrees=True)).as_matrix()
    down, filtered, setpoint = attitude.as_matrix()[:, 2], v[0], Setpoint(Mode.STABILISE)
    force = force + np.random.default_rng(1).normal(0.0, 0.1, force.shape) if accelerometer else np.nan * force
    errors_deg, place = [], np.zeros(3)
    for k in range(len(t_s)):
        row["t_s"], row["dt_s"] = t_s[k], DT_S
        row["gyro_b_rad_s"], row["force_b_m_s2"] = rate[k] + OFFSET_RAD_S, force[k]
        filtered = filtered + DT_S / 1.0 * (v[k] - filtered)  # the receiver's own filter
        place = place + DT_S * filtered
        row["gps_new"] = gps and k % 10 == 0
        if row["gps_new"][0]:
            row["gps_valid"], row["gps_t_s"], row["gps_v_e_m_s"] = 1, t_s[k], filtered + 0.01 * (-1) ** (k // 10)
            row["gps_p_e_m"] = place
        estimate = AttitudeEstimate(wrong[k]) if t_s[k] < 1.0 else SICK
        autopilot.update(estimate, Measurements(row.copy(), 0), setpoint)
        cosine = autopilot._memory["s"]["R_kept_eb"][0, 2] @ down[k]
        errors_deg.append(math.degrees(math.acos(min(cosine, 1.0))))
    return np.array(errors_deg), autopilot._memory["s"]["bias_kept_b_rad_s"][0].copy()


def test_standby_finds_the_offset_and_the_vertical_in_gentle_turns():
    """Offsets of 2 to 3 deg/s that nobody has learnt, and 10 degrees of error at first: settled within 30 s."""
    errors_deg, offset = standby(90.0, weaving, tilt_deg=10.0)
    assert errors_deg.max() < 20.0
    assert errors_deg[round(30.0 / DT_S) :].max() < 3.0
    np.testing.assert_allclose(np.degrees(offset), np.degrees(OFFSET_RAD_S), rtol=0, atol=0.5)


def test_standby_without_corrections_tumbles():
    """What the test above tells apart: the gyros alone, less an offset that was not learnt."""
    still = StandbyParams(tilt_gain_1_s=0.0, tilt_offset_1_s2=0.0, yaw_gain_1_s=0.0, yaw_offset_1_s2=0.0)
    errors_deg, _ = standby(90.0, weaving, params=still)
    assert errors_deg.max() > 60.0


def test_standby_in_a_steady_turn_keeps_its_bank():
    """Ten degrees of bank feel like level flight to the accelerometer alone: the centrifugal part has its sign."""
    errors_deg, _ = standby(60.0, lambda _t: math.radians(10.0))
    assert errors_deg[round(40.0 / DT_S) :].max() < 4.0
    other_way, _ = standby(60.0, lambda _t: math.radians(-10.0))
    assert other_way[round(40.0 / DT_S) :].max() < 4.0


@pytest.mark.parametrize("bank_rad", [weaving, climbing])
def test_standby_without_an_accelerometer_takes_bank_from_the_turn_and_pitch_from_the_climb(bank_rad):
    """NaN from the accelerometer: coordinated flight and the GPS climb rate are enough."""
    climb_rad = math.radians(5.0) if bank_rad is climbing else 0.0
    errors_deg, _ = standby(90.0, bank_rad, climb_rad=climb_rad, accelerometer=False)
    assert errors_deg[round(45.0 / DT_S) :].max() < 6.0


def test_standby_without_fixes_flies_the_offset_in_yaw_as_a_gentle_turn():
    """The accelerometer holds pitch, and bank but for V offset / g, here 3 degrees."""
    errors_deg, _ = standby(90.0, climbing, gps=False)
    expected_deg = math.degrees(SPEED_M_S * OFFSET_RAD_S[2] / G_M_S2)
    np.testing.assert_allclose(errors_deg[-500:].mean(), expected_deg, rtol=0, atol=1.0)
