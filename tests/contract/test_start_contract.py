"""All estimators start equal: one with a magnetometer begins with its heading, whatever was spoilt before."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import estimator as package
from estimator.blocks.calibration import Calibration
from estimator.interface import MEASURED_DTYPE, ImuSample, Measurements
from estimator.peers.peers import Imufusion
from estimator.rotation import heading_error_rad, heading_rad, inclination_error_rad

G, DT, N = 9.80665, 0.02, 60
DECLINATION_RAD = math.radians(-13.0)
FIELD_E_UT = np.array([19.0 * math.cos(DECLINATION_RAD), 19.0 * math.sin(DECLINATION_RAD), 45.0])
FIRST, EVERY = 20, 5  # the first field that can be believed comes in this row
HEADINGS_DEG = (-160.0, -50.0, 75.0, 179.0)
SPOILT_UT = {"nan": (np.nan, 5.0, 40.0), "overflow": (-4096 / 13.0, 5.0, 40.0), "dead": (0.0, 0.0, 0.0)}


# Madgwick's correction has one size, 0.041 rad/s x 0.02 s = 0.05 degrees, and dances round the goal; with a steep field
# that is three times as much of heading.
MOST_DEG = 0.2


def class_of(name):
    """The class of a registered estimator."""
    module, _, attribute = package.ESTIMATORS[name].partition(":")
    return getattr(importlib.import_module(module), attribute)


IN_THE_PAST = {"ins_ekf"}  # corrects what it estimated earlier: tests of its own
MAGNETIC = [n for n in package.ESTIMATORS if "magnetometer" in class_of(n).uses and n not in IN_THE_PAST]


def made(name, **known):
    """An estimator that knows of its magnetometer and of the declination."""
    make = class_of(name)
    try:
        params = make().params
    except ImportError as problem:
        pytest.skip(str(problem))
    known |= {"declination_rad": DECLINATION_RAD}
    known |= {"use_magnetometer": True} if hasattr(params, "use_magnetometer") else {}
    return make(replace(params, **known))


def held(R_eb, n=N):
    """Rows of something held still at `R_eb`, with fields from row FIRST on, ten a second."""
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT, DT
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = [1e-6, -1e-6, 1e-6], R_eb.T @ [0.0, 0.0, -G]
    rows["mag_new"][FIRST::EVERY], rows["mag_b_ut"] = 1, R_eb.T @ FIELD_E_UT
    return rows


def flown(estimator, rows):
    """The attitude after each row."""
    return np.array([estimator.update(Measurements(rows, k)).R_eb for k in range(len(rows))])


def settled(name):
    """The row from which on the heading is there.

    VQF is told the magnetometer's interval by the second field; `gps_velocity` corrects with the sample that follows.
    """
    return FIRST + {"peer_vqf": EVERY, "gps_velocity_magnetometer": 1}.get(name, 0)


@pytest.mark.parametrize("heading_deg", HEADINGS_DEG)
@pytest.mark.parametrize("name", MAGNETIC)
def test_first_field_sets_the_heading_on_the_ground(name, heading_deg):
    """Held banked and nose up: the heading is true, declination and tilt allowed for, from the first field on."""
    R = Rotation.from_euler("ZYX", [heading_deg, 8.0, -12.0], degrees=True).as_matrix()
    rows, estimator = held(R), made(name)
    estimator.reset(ImuSample(2.0, 2.0, np.zeros(3), rows["force_b_m_s2"][0]))
    got = flown(estimator, rows)
    error_deg = np.degrees(np.abs(heading_error_rad(got, R)))
    assert error_deg[settled(name) :].max() < MOST_DEG
    assert np.degrees(inclination_error_rad(got, R)).max() < MOST_DEG
    assert np.degrees(np.abs(heading_rad(got[: FIRST - 1]))).max() < MOST_DEG  # until then nobody knew: north


@pytest.mark.parametrize("name", MAGNETIC)
def test_first_field_sets_the_heading_in_the_air(name):
    """Without a sample of something at rest an estimator begins level; flying level, the heading is as good."""
    R = Rotation.from_euler("Z", 130.0, degrees=True).as_matrix()
    rows, estimator = held(R), made(name)
    estimator.reset(None)
    error_deg = np.degrees(np.abs(heading_error_rad(flown(estimator, rows), R)))
    assert error_deg[settled(name) :].max() < MOST_DEG


@pytest.mark.parametrize("name", MAGNETIC)
def test_calibrated_field_sets_the_heading(name):
    """Every one of them is told of the iron that the turn-table found: packages of others and originals too."""
    R = Rotation.from_euler("ZYX", [110.0, -5.0, 10.0], degrees=True).as_matrix()
    iron, hard = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.0], [0.0, 0.0, 1.0]]), np.array([12.0, -7.0, 20.0])
    rows = held(R)
    rows["mag_b_ut"] = rows["mag_b_ut"] @ iron.T + hard
    found = Calibration(tuple(hard), tuple(map(tuple, np.linalg.inv(iron))))
    for calibration, lowest_deg, highest_deg in ((found, 0.0, MOST_DEG), (Calibration(), 5.0, 180.0)):
        estimator = made(name, calibration=calibration)
        estimator.reset(ImuSample(2.0, 2.0, np.zeros(3), rows["force_b_m_s2"][0]))
        off_deg = abs(math.degrees(float(heading_error_rad(flown(estimator, rows)[settled(name)], R))))
        assert lowest_deg <= off_deg < highest_deg


@pytest.mark.parametrize("what", SPOILT_UT)
@pytest.mark.parametrize("name", MAGNETIC)
def test_spoilt_first_field_starts_nothing(name, what):
    """NaN, the overflow of an HMC5843, a sensor that reads zero: the heading waits for the next field, and is true."""
    R = Rotation.from_euler("Z", -100.0, degrees=True).as_matrix()
    rows, estimator = held(R), made(name)
    rows["mag_new"][5], rows["mag_b_ut"][5] = 1, SPOILT_UT[what]
    estimator.reset(ImuSample(2.0, 2.0, np.zeros(3), rows["force_b_m_s2"][0]))
    got = flown(estimator, rows)
    assert np.degrees(np.abs(heading_rad(got[: FIRST - 1]))).max() < MOST_DEG
    assert np.degrees(np.abs(heading_error_rad(got[settled(name) :], R))).max() < MOST_DEG
    assert estimator.refused == {"magnetometer": 1}


@pytest.mark.parametrize("name", MAGNETIC)
def test_vertical_field_sets_no_heading(name):
    """At a magnetic pole there is no heading: attitudes stay finite and level, and a field that tells one sets it."""
    R = Rotation.from_euler("Z", 60.0, degrees=True).as_matrix()
    rows, estimator = held(R), made(name)
    rows["mag_b_ut"][: FIRST + EVERY] = [0.0, 0.0, 60.0]
    estimator.reset(ImuSample(2.0, 2.0, np.zeros(3), rows["force_b_m_s2"][0]))
    got = flown(estimator, rows)
    assert np.all(np.isfinite(got))
    assert np.degrees(inclination_error_rad(got, R)).max() < MOST_DEG


def test_imufusion_begins_with_the_first_course():
    """It has a GPS and no magnetometer: the first fix that is fast enough sets the heading, the tilt stays."""
    pytest.importorskip("imufusion", reason='needs pip install "wingslevel[peers]"')
    R = Rotation.from_euler("ZYX", [-140.0, 0.0, 15.0], degrees=True).as_matrix()
    rows, estimator = held(R), Imufusion()
    rows["gps_new"][[8, FIRST]], rows["gps_valid"][8:] = 1, 1
    rows["gps_course_rad"], rows["gps_speed_m_s"] = math.radians(220.0), 12.0
    rows["gps_course_rad"][8], rows["gps_speed_m_s"][8] = 1.0, 0.5  # too slow to have a course
    estimator.reset(ImuSample(2.0, 2.0, np.zeros(3), rows["force_b_m_s2"][0]))
    got = flown(estimator, rows)
    assert np.degrees(np.abs(heading_rad(got[: FIRST - 1]))).max() < MOST_DEG
    assert np.degrees(np.abs(heading_error_rad(got[FIRST:], R))).max() < MOST_DEG
    assert np.degrees(inclination_error_rad(got, R)).max() < MOST_DEG


@pytest.mark.parametrize("name", sorted(package.ESTIMATORS))
def test_start_in_the_air_is_level_with_no_offset(name):
    """`reset(None)`: every estimator begins level, heading north, and believes that the gyro has no offset."""
    try:
        estimator = class_of(name)()
    except ImportError as problem:
        pytest.skip(str(problem))
    rows = held(np.eye(3), 1)
    estimator.reset(ImuSample(2.0, 2.0, np.full(3, 0.1), np.array([3.0, 1.0, -9.0])))  # another flight's
    estimator.reset(None)
    estimate = estimator.update(Measurements(rows, 0))
    np.testing.assert_allclose(estimate.R_eb, np.eye(3), rtol=0, atol=1e-6)
    np.testing.assert_allclose(estimate.gyro_bias_b_rad_s, 0.0, rtol=0, atol=1e-6)
