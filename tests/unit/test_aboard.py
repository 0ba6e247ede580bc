"""What is known aboard of the magnetometer before a flight: declination, and what a turn on the table gives."""

import math

import numpy as np
import pytest

from estimator.blocks.calibration import Calibration
from estimator.gps_velocity import GpsVelocityMagnetometer, GpsVelocityParams
from estimator.interface import MEASURED_DTYPE
from estimator.rotation import from_euler, heading_rad
from scenarios.harness.config import FlightConfig, override
from scenarios.harness.flight import prepare_config
from scenarios.harness.registry import find
from sim import place
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import GRAVITY_M_S2

FIELD = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
HARD_IRON = (6.0, -10.0, 8.0)
CLEAN = {
    "magnetometer.hard_iron_b_ut": HARD_IRON,
    **{f"magnetometer.{name}": 0.0 for name in ("hard_iron_ut", "soft_iron", "gain", "cross_axis", "noise_ut")},
}


def prepared(**changes):
    """A flight with apm2, prepared."""
    data = {"suite": "apm2", "estimator": "gps_velocity_magnetometer", "turn_table": True, **changes}
    scenario = find("crosswind")
    return prepare_config(scenario, scenario.config.model_copy(update=data))


def test_turned_on_the_table_the_hard_iron_is_found_and_nothing_else():
    """No other error than counts of 0.077 uT, and the sweep's steps of 4 degrees at most: 54 (1 - cos 4) = 0.13 uT."""
    told = prepared(sensors=CLEAN).config.estimator_params
    np.testing.assert_allclose(told["calibration.hard_iron_b_ut"], HARD_IRON, rtol=0, atol=0.15)
    np.testing.assert_allclose(told["calibration.soft_iron"], np.eye(3), rtol=0, atol=0.01)


def test_turned_on_the_table_it_is_the_magnetometer_of_the_flight():
    """What is found differs by seed, as the irons do; and takes the flight's own readings to the earth's field."""
    first, second = (prepared(seed=seed).config.estimator_params for seed in (0, 1))
    assert first["calibration.hard_iron_b_ut"] != second["calibration.hard_iron_b_ut"]


@pytest.mark.parametrize("turned", [True, False])
def test_declination_is_known_with_or_without_turning(turned):
    """13 degrees west at the launch point, from the world magnetic model; a turn makes the magnetometer usable."""
    aboard = prepared(turn_table=turned).instruments
    assert aboard.value("declination_rad") == math.atan2(FIELD[1], FIELD[0])
    assert (aboard.value("use_magnetometer"), aboard.value("magnetometer_calibrated")) == (True, turned)


def test_calibration_by_hand_is_kept():
    """Numbers that somebody typed are not measured anew."""
    by_hand = {"declination_rad": 0.1, "calibration.hard_iron_b_ut": (1.0, 2.0, 3.0)}
    assert prepared(estimator_params=by_hand).config.estimator_params == by_hand


@pytest.mark.parametrize(("suite", "estimator"), [("apm2", "premerlani"), ("apm2", "oracle"), ("generic", "dilshad")])
def test_nothing_is_calibrated_where_nobody_has_a_calibration(suite, estimator):
    """An estimator that takes no magnetometer, one without parameters, and sensors without a magnetometer."""
    found = prepared(suite=suite, estimator=estimator, turn_table=suite == "apm2")
    assert found.config.estimator_params == {}
    assert (found.instruments.value("declination_rad") is None) is (suite == "generic")


def test_turning_a_magnetometer_that_is_not_fitted_is_refused():
    """One line with the suite."""
    with pytest.raises(ValueError, match="sensor suite generic has no magnetometer to be turned"):
        override(FlightConfig(), {"turn_table": True})


def estimated_heading_error(heading, hard_iron_b_ut, **params):
    """Heading error [rad] of `gps_velocity_magnetometer` after 400 s level at rest under a field with hard iron."""
    R = from_euler(0.0, 0.0, np.array([heading]))[0]
    rows = np.zeros(20_000, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, 20_001), 0.02
    rows["force_b_m_s2"] = (0.0, 0.0, -GRAVITY_M_S2)
    rows["mag_new"][::5] = 1
    rows["mag_b_ut"] = R.T @ FIELD + hard_iron_b_ut
    declination = math.atan2(FIELD[1], FIELD[0])
    settings = GpsVelocityParams(yaw_reference="magnetometer", declination_rad=declination, **params)
    R_est = GpsVelocityMagnetometer(settings).replay(rows)["R_eb"][-1]
    return math.remainder(float(heading_rad(R_est)) - heading, 2.0 * math.pi)


@pytest.mark.parametrize("heading_deg", range(0, 360, 30))
def test_level_hard_iron_turns_the_heading_as_the_geometry_says(heading_deg):
    """The needle points along the sum of the horizontal field b and the iron h: off by at most asin(h / b)."""
    heading = math.radians(heading_deg)
    b, h = np.hypot(*FIELD[:2]), np.array(HARD_IRON)
    magnetic = heading - math.atan2(FIELD[1], FIELD[0])
    x, y = b * math.cos(magnetic) + h[0], -b * math.sin(magnetic) + h[1]
    expected = math.remainder(math.atan2(-y, x) - magnetic, 2.0 * math.pi)
    error = estimated_heading_error(heading, h)
    assert error == pytest.approx(expected, rel=0, abs=1e-5)  # twelve time constants of the integral, 33 s
    assert abs(error) <= math.asin(np.hypot(h[0], h[1]) / b) + 1e-5


def test_level_hard_iron_taken_off_leaves_no_error():
    """The same iron in the calibration."""
    error = estimated_heading_error(1.0, np.array(HARD_IRON), calibration=Calibration(HARD_IRON))
    assert error == pytest.approx(0.0, rel=0, abs=1e-5)


def test_reading_beyond_the_range_is_rejected_and_counted():
    """A reading that no earth and no iron make corrects nothing."""
    rows = np.zeros(10, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, 11), 0.02
    rows["force_b_m_s2"], rows["mag_new"], rows["mag_b_ut"] = (0.0, 0.0, -GRAVITY_M_S2), 1, (0.0, 20.0, 300.0)
    estimator = GpsVelocityMagnetometer()
    R = estimator.replay(rows)["R_eb"]
    assert estimator.rejected == 10
    np.testing.assert_allclose(R[-1], np.eye(3), rtol=0, atol=1e-12)
