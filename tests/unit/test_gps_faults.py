"""Faults of the fixes: what each leaves right and what it makes wrong, in a level turn at 5 Hz."""

import numpy as np
import pytest

from autopilot.interface import NEUTRAL
from scenarios.harness.config import FlightConfig, override
from scenarios.harness.config.faults import parse_fault
from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import PrescribedPlant, SteadyTurn
from sim.sensors.suite import SUITES, Suite

RATES = Rates(gps_hz=5.0)
FROM_S, TO_S = 4.0, 8.0
WINDOW = "@4-8"
FIX = ("gps_t_s", "gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s")


def fixes(*faults, seconds=12.0):
    """The rows in which a fix arrived."""
    log = Log.empty(RATES.ticks(seconds))
    plant = PrescribedPlant(SteadyTurn(0.6, wind_e_m_s=(3.0, 1.0, 0.0)), RATES)
    suite = Suite(SUITES["generic"], RATES, 3, faults=[parse_fault(fault) for fault in faults])
    plant.reset(log)
    suite.reset(log)
    for k in range(len(log)):
        plant.advance(k, NEUTRAL)
        suite.measure(k)
    return log.measured[log.measured["gps_new"] == 1]


CLEAN = fixes()
T_S = CLEAN["t_s"]
HIT = (T_S >= FROM_S - 1e-9) & (T_S < TO_S - 1e-9)  # 20 fixes
LAST = CLEAN[np.flatnonzero(HIT)[0] - 1]  # before the window


def assert_same(wrong, names, rows=slice(None)):
    """Those columns are as without the fault, bit for bit."""
    for name in names:
        np.testing.assert_array_equal(wrong[name][rows], CLEAN[name][rows], err_msg=name)


@pytest.mark.parametrize(
    ("kind", "frozen"),
    [
        ("frozen_position", ("gps_p_e_m",)),
        ("frozen_velocity", ("gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s")),
        ("stuck", ("gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s")),
    ],
)
def test_frozen_columns_repeat_the_last_fix_and_the_others_are_right(kind, frozen):
    """To the last bit, in the window and nowhere else; the time stamps go on."""
    wrong = fixes(f"gps:{kind}{WINDOW}")
    assert HIT.sum() == 20
    assert_same(wrong, FIX, ~HIT)
    assert_same(wrong, set(FIX) - set(frozen))
    for name in frozen:
        assert np.all(wrong[name][HIT] == LAST[name])
        assert not np.any(CLEAN[name][HIT] == LAST[name])


def test_course_in_whole_degrees_is_within_half_a_degree_and_the_velocity_follows():
    """The speed and the climb rate stay; the velocity has that speed along the rounded course."""
    wrong = fixes(f"gps:whole_degrees{WINDOW}")
    assert_same(wrong, FIX, ~HIT)
    assert_same(wrong, ("gps_t_s", "gps_p_e_m", "gps_speed_m_s"))
    course_deg = np.degrees(wrong["gps_course_rad"][HIT])
    np.testing.assert_allclose(course_deg, np.round(course_deg), rtol=0, atol=1e-9)
    off_deg = (course_deg - np.degrees(CLEAN["gps_course_rad"][HIT]) + 180.0) % 360.0 - 180.0
    assert 0.3 < np.abs(off_deg).max() <= 0.5 + 1e-9
    assert course_deg.min() >= 0.0
    assert course_deg.max() < 360.0
    v = wrong["gps_v_e_m_s"][HIT]
    np.testing.assert_allclose(np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0, course_deg, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.hypot(v[:, 0], v[:, 1]), wrong["gps_speed_m_s"][HIT], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(v[:, 2], CLEAN["gps_v_e_m_s"][HIT, 2])


def test_lower_rate_leaves_every_fifth_fix_as_it_was():
    """1 Hz of 5 Hz: those with a whole second as time stamp; all fixes again after the window."""
    wrong = fixes(f"gps:rate=1{WINDOW}")
    kept = ~HIT | (np.abs(CLEAN["gps_t_s"] - np.round(CLEAN["gps_t_s"])) < 1e-9)
    assert (kept & HIT).sum() == 4
    assert wrong[list(FIX)].tobytes() == CLEAN[kept][list(FIX)].tobytes()


def test_drift_moves_the_position_at_the_velocity_that_it_adds():
    """From zero at the last good fix, 2 m/s north and 1 m/s west; speed and course are those of the velocity."""
    wrong = fixes(f"gps:drift=2,-1{WINDOW}")
    assert_same(wrong, FIX, ~HIT)
    elapsed_s = CLEAN["gps_t_s"][HIT] - LAST["gps_t_s"]
    off_m = wrong["gps_p_e_m"] - CLEAN["gps_p_e_m"]
    np.testing.assert_allclose(off_m[HIT], np.outer(elapsed_s, [2.0, -1.0, 0.0]), rtol=0, atol=1e-9)
    v = wrong["gps_v_e_m_s"][HIT]
    np.testing.assert_allclose(v - CLEAN["gps_v_e_m_s"][HIT], [[2.0, -1.0, 0.0]] * 20, rtol=0, atol=1e-12)
    np.testing.assert_allclose(wrong["gps_speed_m_s"][HIT], np.hypot(v[:, 0], v[:, 1]), rtol=0, atol=1e-12)
    course = np.arctan2(v[:, 1], v[:, 0]) % (2.0 * np.pi)
    np.testing.assert_allclose(wrong["gps_course_rad"][HIT], course, rtol=0, atol=1e-12)


def test_velocity_and_position_frozen_before_the_first_fix_are_zero():
    """As a frozen course is then 0: a receiver that never knew better."""
    wrong = fixes("gps:frozen_position@-99-8", "gps:frozen_velocity@-99-8")
    for name in FIX[1:]:
        assert not wrong[name][T_S < TO_S - 1e-9].any()


def test_values_of_new_faults_are_written_out_in_the_configuration():
    """A manifest does not depend on defaults."""
    config = override(FlightConfig(), {"faults": "gps:rate@3-4 gps:drift@20 gps:drift=0,2.5@30-40"})
    assert config.faults == ("gps:rate=1@3-4", "gps:drift=1,0@20", "gps:drift=0,2.5@30-40")
