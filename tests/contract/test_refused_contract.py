"""Every estimator counts a sample that it does not believe under its instrument, and none of an instrument unused."""

import importlib

import numpy as np
import pytest

import estimator as package
from estimator.interface import MEASURED_DTYPE, Measurements

N, BAD = 200, 150
GPS_COLUMNS = ("gps_t_s", "gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s")
SPOILT = {  # what is spoilt: the instrument it counts for, the flag that announces it, columns and value
    "gyro of NaN": ("gyro", None, ("gyro_b_rad_s",), np.nan),
    "gyro beyond any range": ("gyro", None, ("gyro_b_rad_s",), 100.0),
    "force of NaN": ("accelerometer", None, ("force_b_m_s2",), np.nan),
    "force beyond any range": ("accelerometer", None, ("force_b_m_s2",), 1e4),
    "fix of NaN": ("gps", "gps_new", GPS_COLUMNS, np.nan),
    "fix of infinity": ("gps", "gps_new", GPS_COLUMNS, np.inf),
    "field of NaN": ("magnetometer", "mag_new", ("mag_b_ut",), np.nan),
    "field of a transformer": ("magnetometer", "mag_new", ("mag_b_ut",), 5000.0),
    "field that overflowed": ("magnetometer", "mag_new", ("mag_b_ut",), -4096 / 13.0),
    "field of zero": ("magnetometer", "mag_new", ("mag_b_ut",), 0.0),
    "airspeed of NaN": ("airspeed", "air_new", ("equivalent_airspeed_m_s",), np.nan),
    "airspeed of infinity": ("airspeed", "air_new", ("equivalent_airspeed_m_s",), np.inf),
}


@pytest.fixture(params=sorted(package.ESTIMATORS))
def made(request):
    """Each registered estimator, with the magnetometer in use where it has a switch for it."""
    module, _, attribute = package.ESTIMATORS[request.param].partition(":")
    make = getattr(importlib.import_module(module), attribute)
    try:
        estimator = make()
    except ImportError as problem:
        pytest.skip(str(problem))
    params = getattr(estimator, "params", None)
    if hasattr(params, "use_magnetometer"):
        from dataclasses import replace

        calibrated = {"magnetometer_calibrated": True} if hasattr(params, "magnetometer_calibrated") else {}
        estimator = make(replace(params, use_magnetometer=True, **calibrated))
    return estimator


def steady_flight():
    """Rows of straight flight to the north with every instrument; 5 Hz of GPS, 10 Hz of the others."""
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(N) + 1) * 0.02, 0.02
    rows["gyro_b_rad_s"], rows["force_b_m_s2"] = [1e-4, -1e-4, 1e-4], [0.0, 0.0, -9.80665]
    rows["gps_new"][::10], rows["gps_valid"], rows["gps_t_s"] = 1, 1, rows["t_s"]
    rows["gps_v_e_m_s"], rows["gps_speed_m_s"] = [12.0, 0.0, 0.0], 12.0
    rows["gps_p_e_m"][:, 0] = 12.0 * rows["t_s"]
    rows["mag_new"][::5], rows["mag_b_ut"] = 1, [19.0, 0.0, 45.0]
    rows["air_new"][::5], rows["equivalent_airspeed_m_s"], rows["baro_height_m"] = 1, 12.0, 40.0
    return rows


def fly(estimator, rows):
    """All rows, one by one."""
    for k in range(len(rows)):
        estimator.update(Measurements(rows, k))


def test_believable_flight_counts_nothing(made):
    """The flight into which single bad samples are put in the other tests."""
    fly(made, steady_flight())
    assert made.refused == {}
    assert made.rejected == 0


@pytest.mark.parametrize("what", SPOILT)
def test_bad_sample_counts_once_under_its_instrument(made, what):
    """One sample, one count, one tick; none where the instrument is not used."""
    instrument, flag, columns, value = SPOILT[what]
    rows = steady_flight()
    assert flag is None or rows[flag][BAD] == 1
    for column in columns:
        rows[column][BAD] = value
    fly(made, rows)
    used = instrument in made.uses
    assert made.refused == ({instrument: 1} if used else {})
    assert made.rejected == int(used)


def test_repeated_time_counts_under_time_and_nothing_else(made):
    """No time passed: nothing else of the row is looked at, and all that came before it stays counted once."""
    rows = steady_flight()
    rows["t_s"][BAD] = rows["t_s"][BAD - 1]
    rows["gyro_b_rad_s"][BAD] = rows["mag_b_ut"][BAD] = np.nan
    fly(made, rows)
    assert made.refused == {"time": 1}
    assert made.rejected == 1


def test_refused_counts_samples_and_rejected_counts_ticks(made):
    """All instruments spoilt in one tick: a count for each that is used, and one tick."""
    rows = steady_flight()
    for _, _, columns, value in SPOILT.values():
        for column in columns:
            rows[column][BAD] = value if np.isnan(value) else rows[column][BAD]
    fly(made, rows)
    assert made.refused == dict.fromkeys(made.uses, 1)
    assert made.rejected == 1


def test_airspeed_of_nan_before_the_first_is_no_pitot_tube(made):
    """A barometer alone reports air data whose airspeed is NaN: nothing was refused."""
    rows = steady_flight()
    rows["equivalent_airspeed_m_s"] = np.nan
    fly(made, rows)
    assert made.refused == {}


def test_airspeed_below_zero_is_no_refusal(made):
    """A pitot tube reads a little below zero at rest, and where the wind comes from behind."""
    rows = steady_flight()
    rows["equivalent_airspeed_m_s"][BAD:] = -0.5
    fly(made, rows)
    assert made.refused == {}


@pytest.mark.parametrize("column", [c for c in GPS_COLUMNS if c != "gps_t_s"])
def test_fix_with_one_number_missing_is_refused_or_unused(made, column):
    """NaN in a single component: counted as one fix, or it was none of those that are used; never half believed."""
    rows = steady_flight()
    spoilt = rows[column][BAD : BAD + 1]
    spoilt[..., -1:] = np.nan
    fly(made, rows)
    assert made.refused in ({}, {"gps": 1})
    assert "gps" in made.uses or made.refused == {}


def test_unknown_time_stamps_of_fixes_change_nothing(made):
    """A receiver that stamps nothing has NaN for the time of a fix: no refusal, and the heading is found as ever."""
    rows = steady_flight()
    rows["gps_t_s"] = np.nan
    fly(made, rows)
    assert made.refused == {}
    estimate = made.update(Measurements(rows[-1:], 0))
    assert np.all(np.isfinite(estimate.R_eb))


def test_fix_lost_again_is_survived(made):
    """A log in which ``gps_valid`` goes back to 0, its columns too, and comes back: no refusal, finite attitudes."""
    rows = steady_flight()
    gone = rows[80:120]
    for column in (*GPS_COLUMNS, "gps_new", "gps_valid"):
        gone[column] = 0
    fly(made, rows)
    assert made.refused == {}
    estimate = made.update(Measurements(rows[-1:], 0))
    assert np.all(np.isfinite(estimate.R_eb))
