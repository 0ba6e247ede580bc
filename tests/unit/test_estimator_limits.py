"""An estimator whose learnt gyro offset has been at its limit for a while reports POOR; a moment's touch is GOOD."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.blocks.screening import AT_LIMIT_S
from estimator.complementary import MAX_BIAS_RAD_S, Complementary
from estimator.dilshad import Dilshad
from estimator.gps_velocity import GpsVelocity, GpsVelocityMagnetometer, GpsVelocityNose
from estimator.ins_ekf.ins_ekf import InsEkf
from estimator.interface import G_M_S2, GOOD, MEASURED_DTYPE, POOR
from estimator.matrixpilot import INTEGRAL_LIMIT_RAD_S, MatrixPilot
from estimator.premerlani import Premerlani

HZ, LIMIT_RAD_S = 50, math.radians(1.0)
WITH_LIMIT = {  # a limit of 1 deg/s
    "premerlani": (Premerlani, {"offset_limit_rad_s": LIMIT_RAD_S}),
    "gps_velocity": (GpsVelocity, {"offset_limit_rad_s": LIMIT_RAD_S}),
    "gps_velocity_nose": (GpsVelocityNose, {"offset_limit_rad_s": LIMIT_RAD_S}),
    "gps_velocity_magnetometer": (GpsVelocityMagnetometer, {"offset_limit_rad_s": LIMIT_RAD_S}),
    "dilshad": (Dilshad, {"offset_limit_rad_s": LIMIT_RAD_S}),
    "ins_ekf": (InsEkf, {"gyro_bias_sigma_rad_s": LIMIT_RAD_S / 12.0}),
}


def level_flight(offset_deg_s, seconds):
    """Measurements straight and level to the north at 15 m/s: the roll gyro reads `offset_deg_s`, or one per sample."""
    rows = np.zeros(seconds * HZ or len(offset_deg_s), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = np.arange(1, len(rows) + 1) / HZ, 1.0 / HZ
    rows["gyro_b_rad_s"][:, 0] = np.radians(offset_deg_s)
    rows["force_b_m_s2"][:, 2] = -G_M_S2
    rows["gps_new"][9::10] = rows["gps_valid"][9:] = 1
    rows["gps_t_s"], rows["gps_v_e_m_s"][:, 0], rows["gps_speed_m_s"] = rows["t_s"], 15.0, 15.0
    rows["mag_new"][4::5], rows["mag_b_ut"] = 1, (20.0, 0.0, 40.0)
    rows["equivalent_airspeed_m_s"] = rows["baro_height_m"] = np.nan
    return rows


def made(name):
    cls, changes = WITH_LIMIT[name]
    return cls(replace(cls._default, gps_latency_s=0.0, **changes) if hasattr(cls._default, "gps_latency_s")
               else replace(cls._default, **changes))  # fmt: skip


@pytest.mark.parametrize("name", WITH_LIMIT)
def test_estimator_at_the_limit_of_its_offset_is_poor(name):
    """An offset of 2 deg/s, a limit of 1: learnt up to the limit, GOOD for ten seconds more, then POOR to the end."""
    found = made(name).replay(level_flight(2.0, 400))
    learnt = np.abs(found["gyro_bias_b_rad_s"]).max(axis=1)
    reached = int(np.argmax(learnt >= 0.98 * LIMIT_RAD_S))
    assert learnt[-1] == pytest.approx(LIMIT_RAD_S, rel=0.02)
    ill = reached + round(AT_LIMIT_S * HZ)
    assert np.all(found["health"][reached : ill - 2] == GOOD)
    assert np.all(found["health"][ill + 2 :] == POOR)


@pytest.mark.parametrize("name", WITH_LIMIT)
def test_estimator_that_has_learnt_less_than_its_limit_is_good(name):
    """An offset of 0.9 deg/s, a limit of 1."""
    found = made(name).replay(level_flight(0.9, 300))
    np.testing.assert_array_equal(found["health"][100 * HZ :], GOOD)


def test_moment_at_the_limit_is_no_illness():
    """The offset is gone 2 s after the limit was reached: GOOD throughout."""
    ill = made("premerlani").replay(level_flight(3.0, 200))
    reached = int(np.argmax(np.abs(ill["gyro_bias_b_rad_s"]).max(axis=1) >= 0.98 * LIMIT_RAD_S))
    found = made("premerlani").replay(level_flight(np.repeat([3.0, 0.0], [reached + 2 * HZ, 60 * HZ]), 0))
    touched = np.abs(found["gyro_bias_b_rad_s"]).max(axis=1) >= 0.98 * LIMIT_RAD_S
    assert 2 * HZ <= touched.sum() < AT_LIMIT_S * HZ
    np.testing.assert_array_equal(found["health"][reached:], GOOD)
    assert ill["health"][-1] == POOR


def test_complementary_at_its_limit_is_poor():
    """45 deg/s learnt, 47 read."""
    flown = Complementary()
    flown._state["gyro_bias_b_rad_s"][0, 0], flown._state["aligned"] = MAX_BIAS_RAD_S, 1
    found = flown.replay(level_flight(47.0, 30))
    assert found["gyro_bias_b_rad_s"][-1, 0] == pytest.approx(MAX_BIAS_RAD_S, rel=0.02)
    assert found["health"][-1] == POOR


def test_matrixpilot_at_its_limit_is_poor():
    """Its limit is the range of 16 bits, 18 rad/s: out of reach, but watched like the others."""
    flown = MatrixPilot()
    flown._state["omega_i_b"][0, 0] = -INTEGRAL_LIMIT_RAD_S
    found = flown.replay(level_flight(math.degrees(INTEGRAL_LIMIT_RAD_S) + 2.0, 30))
    assert found["health"][-1] == POOR


def test_vqf_at_the_limit_of_its_package_is_poor():
    """The package learns 2 deg/s at most: 4 deg/s at rest."""
    pytest.importorskip("vqf")
    from estimator.interface import Measurements
    from estimator.peers.peers import Vqf

    for offset_deg_s, expected in ((4.0, POOR), (1.0, GOOD)):
        rows, flown = level_flight(offset_deg_s, 60), Vqf()
        rows["mag_new"] = 0
        health = [int(flown.update(Measurements(rows, k)).health) for k in range(len(rows))]
        assert health[-1] == expected
        assert health[5 * HZ] == GOOD
