"""Hard iron by the min/max method: arithmetic, the turn-table's sweep, and how wrong a poor sweep makes it."""

import math

import numpy as np
import pytest
from scipy import stats

from autopilot.interface import NEUTRAL
from estimator.blocks.calibration import hard_iron_from_extremes
from sim import place
from sim.clock import Rates
from sim.log import Log
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import PrescribedPlant
from sim.motion.turn_table import TurnTable
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import Suite, SuiteParams

FIELD = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
STRENGTH = float(np.linalg.norm(FIELD))
TABLE = TurnTable(heading_rad=math.atan2(FIELD[1], FIELD[0]))
HARD = np.array([12.0, -7.0, 20.0])
DOUBTED_ONCE_IN = 1e-5


def swept(params, flight=0, table=TABLE):
    """Samples of a turn on the table, shape (m, 3)."""
    rates = Rates()
    log = Log.empty(rates.ticks(table.duration_s))
    plant, suite = PrescribedPlant(table, rates), Suite(SuiteParams(magnetometer=params), rates, 3, flight)
    plant.reset(log)
    suite.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        suite.measure(k)
    return log.measured["mag_b_ut"][log.measured["mag_new"] == 1]


def largest_miss_ut(rate_hz, table=TABLE):
    """How far from the extremes the nearest sample may be: half the largest angle between two, on either side."""
    half_rad = 2.0 * (2.0 * math.pi / table.circle_s) / rate_hz / 2.0  # twice the mean rate at the most
    return STRENGTH * (1.0 - math.cos(half_rad))


def test_offset_is_half_way_between_the_extremes():
    """Eqn 8, axis by axis, in numbers."""
    readings = [[1.0, -5.0, 0.0], [3.0, 9.0, 0.0], [2.0, 0.0, 7.0]]
    np.testing.assert_array_equal(hard_iron_from_extremes(np.array(readings)), [2.0, 2.0, 3.5])


def test_turn_table_points_every_axis_along_and_against_the_field():
    """To the bound of a quick sampling, at any circle; and a body that rests at both ends."""
    t_s = np.linspace(0.0, TABLE.duration_s, 20_001)
    at = TABLE.at(t_s)
    cosine = np.einsum("nij,i->nj", at.R_eb, FIELD) / STRENGTH
    np.testing.assert_allclose(cosine.max(axis=0), 1.0, rtol=0, atol=1e-5)  # 2.2e-3 rad apart: 6e-7
    np.testing.assert_allclose(cosine.min(axis=0), -1.0, rtol=0, atol=1e-5)
    np.testing.assert_allclose(at.omega_b_rad_s[[0, -1]], 0.0, rtol=0, atol=1e-12)
    assert not at.v_e_m_s.any()


def test_turn_table_comes_back_after_each_circle():
    """Each of the three circles ends in the attitude in which it began, and lies still afterwards."""
    c, q = TABLE.circle_s, TABLE.quarter_s
    for start_s in (0.0, c + q, 2.0 * (c + q)):
        before, after = TABLE.at(np.array([start_s, start_s + c])).R_eb
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-14)
    end, later = TABLE.at(np.array([1.0, 5.0]) * TABLE.duration_s).R_eb
    np.testing.assert_array_equal(end, later)


@pytest.mark.parametrize("field", ["circle_s", "quarter_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_turn_table_without_time_to_turn_is_refused(field, value):
    """Named, with its unit."""
    with pytest.raises(ValueError, match=f"TurnTable.{field} = .* s: choose"):
        TurnTable(**{field: value})


def test_hard_iron_without_noise_is_found_to_the_bound_of_the_sweep():
    """Half of what each extreme may have missed, at 10 Hz 0.01 uT; the drawn iron too."""
    bound = largest_miss_ut(10.0) / 2.0
    found = hard_iron_from_extremes(swept(MagnetometerParams(hard_iron_b_ut=tuple(HARD))))
    assert np.abs(found - HARD).max() <= bound  # measured: 0.006 of 0.013 uT
    assert bound <= 0.02
    for flight in range(3):
        params = MagnetometerParams(hard_iron_ut=10.0)
        drawn = swept(params, flight)[-1] - swept(MagnetometerParams(), flight)[-1]
        found = hard_iron_from_extremes(swept(params, flight))
        assert np.abs(found - drawn).max() <= bound
        assert np.abs(drawn).max() > 1.0


def test_hard_iron_is_found_whatever_the_soft_iron():
    """A soft iron stretches the sphere, but evenly about its centre."""
    params = MagnetometerParams(hard_iron_b_ut=tuple(HARD), soft_iron=0.1)
    found = hard_iron_from_extremes(swept(params))
    assert np.abs(found - HARD).max() <= 1.5 * largest_miss_ut(10.0) / 2.0  # the field is stretched by up to a half


def test_hard_iron_is_found_to_the_noise():
    """Over flights the error has at most the sigma of one reading: extremes of noise of opposite sign nearly cancel."""
    sigma = 0.5
    errors = []
    for flight in range(20):
        found = hard_iron_from_extremes(swept(MagnetometerParams(hard_iron_b_ut=tuple(HARD), noise_ut=sigma), flight))
        errors.append(found - HARD)
    high = stats.chi2.ppf(1.0 - DOUBTED_ONCE_IN, np.size(errors))
    assert np.sum(np.square(errors)) <= high * sigma**2
    assert np.abs(errors).max() > largest_miss_ut(10.0)  # it is the noise, not the sweep, that limits it


@pytest.mark.parametrize(("missed_along_deg", "missed_against_deg"), [(0, 0), (30, 0), (0, 45), (20, 60), (40, 40)])
def test_poor_sweep_is_wrong_by_what_it_missed(missed_along_deg, missed_against_deg):
    """|B| (cos a - cos b) / 2, where an axis came within the angle a of the field and b of its opposite."""
    a, b = math.radians(missed_along_deg), math.radians(missed_against_deg)
    angle = np.linspace(a, math.pi - b, 1001)  # between the axis and the field
    readings = 50.0 * np.cos(angle)[:, None] + HARD
    wrong = hard_iron_from_extremes(readings) - HARD
    np.testing.assert_allclose(wrong, 50.0 * (math.cos(a) - math.cos(b)) / 2.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("readings", [np.zeros((1, 3)), np.zeros((5, 2)), np.zeros(3), [[1.0, 2.0, math.nan]] * 3])
def test_readings_that_are_no_sweep_are_refused(readings):
    """Too few, not three axes, or not finite."""
    with pytest.raises(ValueError, match="field_b_ut"):
        hard_iron_from_extremes(np.array(readings))
