"""Soft iron by the ellipsoid, and both irons from one turn on the table, against the matrix that made the readings."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.interface import NEUTRAL
from estimator.blocks.calibration import Calibration, soft_iron_from_ellipsoid
from sim import place
from sim.clock import Rates
from sim.log import Log
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import PrescribedPlant
from sim.motion.turn_table import TurnTable
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

FIELD = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
TABLE = TurnTable(heading_rad=math.atan2(FIELD[1], FIELD[0]))
HARD = np.array([12.0, -7.0, 20.0])
BENT = np.array([[1.1, 0.05, -0.02], [0.05, 0.95, 0.03], [-0.02, 0.03, 0.9]])  # iron bends symmetrically


def turned(params, flight=0):
    """Readings of a turn on the table, shape (m, 3), and the matrix of the unit that made them."""
    rates = Rates()
    log = Log.empty(rates.ticks(TABLE.duration_s))
    plant, suite = PrescribedPlant(TABLE, rates), Suite(SuiteParams(magnetometer=params), rates, 3, flight)
    plant.reset(log)
    suite.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        suite.measure(k)
    return log.measured["mag_b_ut"][log.measured["mag_new"] == 1], suite.snapshot().unit["magnetometer"]["A"][0]


def of_unit_determinant(M):
    """`M` scaled so that it keeps volumes."""
    return M / np.linalg.det(M) ** (1.0 / 3.0)


def strengths(readings, calibration):
    """Lengths of the corrected readings."""
    corrected = (readings - np.array(calibration.hard_iron_b_ut)) @ np.array(calibration.soft_iron).T
    return np.linalg.norm(corrected, axis=1)


def test_soft_iron_of_exact_readings_is_the_inverse_of_the_iron():
    """Readings in all directions, no noise: to round-off the inverse of the symmetric matrix, of determinant 1."""
    directions = Rotation.random(60, rng=np.random.default_rng(1)).as_matrix()[:, 0]
    found = soft_iron_from_ellipsoid(50.0 * directions @ BENT + HARD, HARD)
    np.testing.assert_allclose(found, of_unit_determinant(np.linalg.inv(BENT)), rtol=0, atol=1e-12)


@pytest.mark.parametrize("flight", range(3))
def test_turn_on_the_table_finds_soft_iron_and_leaves_a_sphere(flight):
    """Three great circles are enough: 10 % of iron leaves less than 0.01 % of the strength."""
    readings, A = turned(MagnetometerParams(rate_hz=50.0, hard_iron_b_ut=tuple(HARD), soft_iron=0.1), flight)
    calibration = Calibration.from_turns(readings)
    # Samples 0.0126 rad apart at the most miss the extremes of 52 uT by 52 (0.0063)^2 / 2 = 1e-3 uT.
    np.testing.assert_allclose(calibration.hard_iron_b_ut, HARD, rtol=0, atol=1.1e-3)
    np.testing.assert_allclose(calibration.soft_iron, of_unit_determinant(np.linalg.inv(A)), rtol=0, atol=1e-4)
    corrected = strengths(readings, calibration)
    assert np.ptp(corrected) < 1e-4 * corrected.mean()


def test_turn_on_the_table_of_a_real_part_leaves_a_hundredth():
    """HMC5843 with gains, cross axes, noise and counts: a spread of 16 % becomes that of its noise, 0.8 %."""
    params = SUITES["dilshad_9dof"].magnetometer
    readings, A = turned(params)
    before, after = (
        np.std(strengths(readings, c)) / np.linalg.norm(FIELD)
        for c in (Calibration(), Calibration.from_turns(readings))
    )
    assert before > 0.1
    # Noise of 0.4 uT a sample in a field of 52 uT is 0.8 %; Eqn 8 takes half of it for hard iron, another 0.4 %.
    assert after < 0.012
    # Of a matrix that is not symmetric a rotation is left, and nothing else.
    left = of_unit_determinant(np.array(Calibration.from_turns(readings).soft_iron) @ A)
    np.testing.assert_allclose(left @ left.T, np.eye(3), rtol=0, atol=0.01)


@pytest.mark.parametrize(
    "readings",
    [
        np.tile([20.0, 3.0, 40.0], (30, 1)),
        np.stack([np.cos(np.arange(30.0)), np.sin(np.arange(30.0)), 0.0 * np.arange(30.0)], axis=1),
        np.zeros((30, 3)),
        np.random.default_rng(0).normal(size=(30, 3)) * [100.0, 1.0, 1.0],
    ],
    ids=["still", "one_circle", "nothing", "a_stick"],
)
def test_readings_on_no_ellipsoid_are_refused(readings):
    """One line that says what to do, not a matrix of nonsense."""
    with pytest.raises(ValueError, match="turn the magnetometer about all three axes"):
        soft_iron_from_ellipsoid(readings, np.zeros(3))


@pytest.mark.parametrize(
    ("readings", "said"),
    [
        (np.zeros((8, 3)), "at least 9 rows"),
        (np.zeros((30, 2)), "rows of 3 axes"),
        (np.full((30, 3), np.nan), "not finite"),
    ],
)
def test_readings_that_are_none_are_refused(readings, said):
    """Too few, of two axes, not finite."""
    with pytest.raises(ValueError, match=said):
        soft_iron_from_ellipsoid(readings, np.zeros(3))


@pytest.mark.parametrize(
    ("field", "value"), [("hard_iron_b_ut", (1.0, 2.0)), ("soft_iron", ((1.0, 0.0, math.nan),) * 3), ("soft_iron", 1.0)]
)
def test_impossible_calibration_is_refused(field, value):
    """Shapes and finite numbers."""
    with pytest.raises(ValueError, match=f"Calibration.{field} = .*choose finite numbers of shape"):
        Calibration(**{field: value})
