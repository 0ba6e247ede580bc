"""A real flight: an UltraStick with pitot tube and 1 Hz GPS, against the attitude of the filter it had aboard.

The log, thor75.mat (University of Minnesota; https://github.com/AuraUAS/navigation), is not part of the project.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from estimator.interface import MEASURED_DTYPE, ImuSample
from estimator.params.gains import recommended_gains
from estimator.premerlani import Premerlani, PremerlaniParams
from estimator.rotation import from_euler, heading_error_rad, inclination_error_rad

FOLDER = os.environ.get("WINGSLEVEL_DATA", "")
AIRBORNE_M_S = 8.0
AT_REST = 100  # samples


@pytest.fixture(scope="module")
def flight():
    """Rows, reference attitudes, and where it was airborne."""
    path = Path(FOLDER) / "thor75.mat"
    if not FOLDER or not path.is_file():
        pytest.skip("no thor75.mat in the folder that WINGSLEVEL_DATA names")
    data = loadmat(path, squeeze_me=True, struct_as_record=False)["flight_data"]
    t = data.time
    rows = np.zeros(len(t), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t, np.clip(np.diff(t, prepend=t[0] - 0.02), 0.005, 0.1)
    rows["gyro_b_rad_s"] = np.stack([data.p, data.q, data.r], axis=-1)
    rows["force_b_m_s2"] = np.stack([data.ax, data.ay, data.az], axis=-1)
    # Held between reports: a new one is where it changes.
    rows["gps_new"][1:] = (np.diff(data.vn) != 0.0) | (np.diff(data.ve) != 0.0)
    rows["gps_course_rad"] = np.arctan2(data.ve, data.vn) % (2.0 * np.pi)
    rows["gps_speed_m_s"] = np.hypot(data.vn, data.ve)
    rows["air_new"], rows["equivalent_airspeed_m_s"] = 1, data.ias
    airborne = rows["gps_speed_m_s"] > AIRBORNE_M_S
    return rows[1:], from_euler(data.phi, data.theta, data.psi)[1:], airborne[1:]


def errors_deg(flight, **params):
    """Inclination and heading error airborne, RMS, of the recommended gains for a receiver that does not filter."""
    rows, R, airborne = flight
    estimator = Premerlani(recommended_gains(base=PremerlaniParams(gps_filter_s=0.0, gps_latency_s=0.0, **params)))
    start = rows[:AT_REST]
    estimator.reset(ImuSample(0.0, 0.02, start["gyro_b_rad_s"].mean(axis=0), start["force_b_m_s2"].mean(axis=0)))
    R_estimated = estimator.replay(rows)["R_eb"]
    assert estimator.rejected == 0
    return tuple(
        np.degrees(np.sqrt(np.mean(error(R_estimated, R)[airborne] ** 2)))
        for error in (inclination_error_rad, heading_error_rad)
    )


def test_real_flight_inclination_with_airspeed_and_course(flight):
    """2.4 degrees RMS over six minutes, a quarter of them beyond 30 degrees of bank; ground speed alone is worse."""
    inclination, _ = errors_deg(flight)
    assert inclination <= 2.6
    assert inclination < errors_deg(flight, use_airspeed=False)[0]


def test_real_flight_heading_with_learnt_wind(flight):
    """The course is 17 degrees off the nose, RMS; with the wind learnt in the turns it is 8, and no worse inclined."""
    inclination, heading = errors_deg(flight, learn_wind=True)
    assert inclination <= 2.6
    assert heading <= 9.0
    assert heading < 0.6 * errors_deg(flight)[1]
