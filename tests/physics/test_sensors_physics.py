"""Analytic physics through the sensors: rest, free fall, and the coordinated turn."""

import math

import numpy as np
import pytest

from autopilot.interface import NEUTRAL
from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import GRAVITY_M_S2, FreeFall, PrescribedPlant, Rest, SteadyTurn
from sim.place import LATITUDE_DEG
from sim.sensors.suite import SUITES, Suite
from sim.truth import EARTH_RATE_RAD_S

G0 = 9.80665
BANK_RAD, V_M_S = math.radians(35.0), 12.6


def flown(motion, suite="ideal", n_ticks=500, seed=0, flight=0):
    """Log of `n_ticks` of `motion` seen by the sensors `suite`."""
    rates, log = Rates(), Log.empty(n_ticks)
    plant, sensors = PrescribedPlant(motion, rates), Suite(SUITES[suite], rates, seed, flight)
    plant.reset(log)
    sensors.reset(log)
    for k in range(n_ticks):
        plant.advance(k, NEUTRAL)
        sensors.measure(k)
    return log


def test_level_at_rest_through_ideal_sensors_reads_gravity_upwards():
    """(0, 0, -g) and the earth's rotation; the GPS says: here, standing still."""
    rows = flown(Rest(height_m=2.0)).measured
    np.testing.assert_allclose(rows["force_b_m_s2"], np.tile([0.0, 0.0, -GRAVITY_M_S2], (500, 1)), rtol=0, atol=1e-14)
    lat = math.radians(LATITUDE_DEG)
    earth = EARTH_RATE_RAD_S * np.array([math.cos(lat), 0.0, -math.sin(lat)])
    np.testing.assert_allclose(rows["gyro_b_rad_s"], np.tile(earth, (500, 1)), rtol=0, atol=1e-16)
    np.testing.assert_array_equal(rows["gps_p_e_m"][-1], [0.0, 0.0, -2.0])
    np.testing.assert_array_equal(rows["gps_v_e_m_s"][-1], 0.0)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(30.0, 0.0), (0.0, 20.0), (-60.0, 45.0), (180.0, 0.0)])
def test_tilted_at_rest_through_ideal_sensors_gives_the_tilt(roll_deg, pitch_deg):
    """Specific force is minus gravity seen from the body: roll and pitch follow by arctangents."""
    f = flown(Rest(math.radians(roll_deg), math.radians(pitch_deg), 1.0), n_ticks=2).measured["force_b_m_s2"][-1]
    np.testing.assert_allclose(math.cos(math.atan2(-f[1], -f[2]) - math.radians(roll_deg)), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(math.asin(f[0] / GRAVITY_M_S2), math.radians(pitch_deg), rtol=0, atol=1e-12)


def test_free_fall_through_ideal_sensors_reads_zero():
    """Dropped and tumbling: nothing but the Coriolis force of the prescribed straight fall, 2 x 7.3e-5 x v."""
    log = flown(FreeFall(tumble_rad_s=2.0), n_ticks=200)
    limit = 2.0 * EARTH_RATE_RAD_S * log.truth["v_e_m_s"][:, 2] + 1e-13
    assert np.all(np.linalg.norm(log.measured["force_b_m_s2"], axis=1) <= limit)


def test_free_fall_through_generic_sensors_reads_zero_on_average():
    """Over 100 flights the mean is zero within 4.5 sigma of bias and noise, and the Coriolis force."""
    means = [flown(FreeFall(), "generic", 50, flight=i).measured["force_b_m_s2"].mean(axis=0) for i in range(100)]
    sigma = math.hypot(0.02, 0.02 / math.sqrt(50)) * G0 / math.sqrt(100)
    assert np.abs(np.mean(means, axis=0)).max() <= 4.5 * sigma + 2.0 * EARTH_RATE_RAD_S * GRAVITY_M_S2


def felt_turn(rows):
    """Bank from the specific force, turn rate from the gyro, speed from the GPS: means of one flight."""
    force = np.linalg.norm(rows["force_b_m_s2"].mean(axis=0))
    rate = np.linalg.norm(rows["gyro_b_rad_s"].mean(axis=0))
    return force, rate, rows["gps_speed_m_s"][rows["gps_valid"] == 1].mean()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_level_turn_without_sideslip_through_ideal_sensors_obeys_tan_bank(side):
    """tan(bank) = V x rate / g from sensor readings alone, within 2 % (measured 0.3 %), and no side force."""
    rows = flown(SteadyTurn(side * BANK_RAD, V_M_S)).measured
    force, rate, speed = felt_turn(rows[50:])
    bank = math.acos(GRAVITY_M_S2 / force)
    assert abs(speed * rate / GRAVITY_M_S2 / math.tan(bank) - 1.0) <= 0.02
    assert abs(bank / BANK_RAD - 1.0) <= 0.02
    assert np.abs(rows["force_b_m_s2"][:, 1]).max() <= 2.0 * EARTH_RATE_RAD_S * V_M_S
    assert math.copysign(1.0, rows["gyro_b_rad_s"][-1, 2]) == side


def test_level_turn_without_sideslip_through_generic_sensors_obeys_tan_bank():
    """The same within 2 % through cheap sensors, pooled over 200 flights, the filter's loss of speed made good.

    A first-order filter shortens a turning vector by 1 / sqrt(1 + (rate x T)^2).  A gyro bias of 1 deg/s is 4 %
    of the rate, a gain error 1.5 %: 4.3 % / sqrt(200) = 0.3 % remains; 0.02 g of accelerometer bias leaves less.
    """
    flights = [flown(SteadyTurn(BANK_RAD, V_M_S), "generic", flight=i).measured[300:] for i in range(200)]
    force, rate, speed = np.mean([felt_turn(rows) for rows in flights], axis=0)
    airspeed = speed * math.hypot(1.0, rate * SUITES["generic"].gps.filter_s)
    bank = math.acos(GRAVITY_M_S2 / force)
    assert abs(airspeed * rate / GRAVITY_M_S2 / math.tan(bank) - 1.0) <= 0.02
    assert abs(airspeed / V_M_S - 1.0) <= 0.02
    assert speed / V_M_S <= 0.93  # the loss is there: 1 / hypot(1, 0.545) = 0.88
