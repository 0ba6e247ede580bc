"""The gyro offset is learnt quickly in the hand, and nowhere else."""

import math

import numpy as np
import pytest

from estimator.interface import G_M_S2, MEASURED_DTYPE
from estimator.premerlani import Premerlani, PremerlaniParams

DT_S = 0.02
OFFSET = np.radians([2.5, -2.0, 0.0])


def in_the_hand(duration_s=8.0, *, speed_m_s=math.nan, force=1.0, sway_deg_s=0.0, turn_deg_s=0.0):
    """Rows with an offset, noise, a sway in roll, a turn about the vertical, and perhaps fixes of `speed_m_s`."""
    n = round(duration_s / DT_S)
    rows, random = np.zeros(n, MEASURED_DTYPE), np.random.Generator(np.random.PCG64(3))
    t_s = (np.arange(n) + 1) * DT_S
    rows["t_s"], rows["dt_s"], rows["gps_course_rad"] = t_s, DT_S, np.nan
    w, a = 2.0 * math.pi * 0.7, math.radians(sway_deg_s)
    roll = a / w * (1.0 - np.cos(w * t_s))
    rows["gyro_b_rad_s"] = OFFSET
    rows["gyro_b_rad_s"][:, 0] += a * np.sin(w * (t_s - 0.5 * DT_S))
    rows["gyro_b_rad_s"][:, 2] += math.radians(turn_deg_s)
    rows["force_b_m_s2"] = -force * G_M_S2 * np.stack([0.0 * roll, np.sin(roll), np.cos(roll)], axis=1)
    rows["force_b_m_s2"] += random.normal(0.0, 0.05, (n, 3))
    if math.isfinite(speed_m_s):
        rows["gps_new"][::10], rows["gps_valid"] = 1, 1
        rows["gps_speed_m_s"], rows["gps_course_rad"] = speed_m_s, 0.0
        rows["gps_v_e_m_s"][:, 0] = speed_m_s
    return rows


def missing_deg_s(rows, **params):
    """What is left of the offset about roll and pitch at the end, deg/s, and the offset learnt about yaw."""
    bias = Premerlani(PremerlaniParams(**params)).replay(rows)["gyro_bias_b_rad_s"][-1]
    return math.degrees(np.abs(bias - OFFSET)[:2].max()), math.degrees(bias[2])


@pytest.mark.parametrize("sway_deg_s", [0.0, 20.0])
@pytest.mark.parametrize("speed_m_s", [math.nan, 0.5])
def test_offset_in_the_hand_is_learnt_within_8_s(sway_deg_s, speed_m_s):
    """Without a fix, or with those of a receiver that stands still; swayed by 20 deg/s too."""
    left, _ = missing_deg_s(in_the_hand(sway_deg_s=sway_deg_s, speed_m_s=speed_m_s))
    assert left < 0.5
    assert missing_deg_s(in_the_hand(sway_deg_s=sway_deg_s, speed_m_s=speed_m_s), learn_held_s=0.0)[0] > 1.5


def test_offset_turned_about_the_vertical_is_not_learnt():
    """A turn table at 10 deg/s: the rotation stays a rotation."""
    left, yaw_deg_s = missing_deg_s(in_the_hand(turn_deg_s=10.0))
    assert left < 1.0
    assert abs(yaw_deg_s) < 0.2


def test_offset_with_a_course_is_learnt_slowly():
    """3.5 m/s over the ground into the wind, at 1 g: it flies."""
    rows = in_the_hand(speed_m_s=3.5)
    fast, slow = (Premerlani(PremerlaniParams(learn_held_s=held_s)).replay(rows) for held_s in (20.0, 0.0))
    np.testing.assert_array_equal(fast["R_eb"], slow["R_eb"])
    np.testing.assert_array_equal(fast["gyro_bias_b_rad_s"], slow["gyro_bias_b_rad_s"])


def test_offset_after_a_throw_is_learnt_slowly_for_good():
    """0.2 s of 2 g, then 1 g again without a GPS: what follows is a flight."""
    estimator = Premerlani()
    for rows, held in ((in_the_hand(3.0), 1), (in_the_hand(0.2, force=2.0), 0), (in_the_hand(6.0), 0)):
        rows["t_s"] += 10.0 * (1.0 + estimator.snapshot()["clock_s"][0])
        estimator.replay(rows)
        assert estimator.snapshot()["held"][0] == held


def test_offset_from_a_stuck_accelerometer_is_not_learnt_quickly():
    """Readings that repeat to the last digit."""
    rows = in_the_hand()
    rows["force_b_m_s2"] = (0.0, 0.0, -G_M_S2)
    estimator = Premerlani()
    estimator.replay(rows)
    assert estimator.snapshot()["held"][0] == 0
