"""`ap_dcm` with all quirks is ArduPilot of July 2013: held to what the original printed for the same input.

Rotation differences are angles of R_ours R_original^T.  The original calculated in single precision and printed seven
decimals: 1e-5 degrees is all that can be had.  What remains on E100 is its start (0.013 degrees in the first heading
from the magnetometer, gone in seconds) and single precision where times decide.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.ap_dcm import JULY_2013, ApDcm, ApDcmParams, Quirk
from estimator.blocks.kernels import wrap
from estimator.interface import MEASURED_DTYPE, Measurements
from estimator.rotation import inclination_error_rad, rotation_error_rad, to_euler
from scenarios.harness.logs import reference
from scenarios.harness.logs.reference import COUNT_UT

DATA = Path(__file__).parent / "data" / "ap_ahrs_dcm"
ORIGINALS = {
    "E100 mag": ("E100_ap2013_mag_nogps_copter", {"fly_forward": False}),
    "A50 mag": ("A50_ap2013_mag", {"declination_rad": np.radians(10.0)}),
    "A50 gps": ("A50_ap2013_gps", {"use_magnetometer": False}),
    "C50 mag": ("C50_ap2013_mag", {"declination_rad": np.radians(10.0)}),
    "C50 gps": ("C50_ap2013_gps", {"use_magnetometer": False}),
}


class Case(NamedTuple):
    """Input as the original got it, its output, and the truth."""

    rows: np.ndarray
    original_R_eb: np.ndarray
    true_R_eb: np.ndarray


@cache
def load(name):
    """The named case: GPS in whole cm/s and 0.01 degrees, magnetometer in whole counts."""
    output, _ = ORIGINALS[name]
    path = DATA / f"{output[:3] if output[3] == '_' else 'E100'}_in.csv.gz"
    log = reference.read(path, DATA / f"{output}.csv.gz")
    rows = log.rows.copy()
    for column, step in (
        ("gps_v_e_m_s", 0.01),
        ("gps_speed_m_s", 0.01),
        ("gps_course_rad", np.radians(0.01)),
        ("mag_b_ut", COUNT_UT),
    ):
        rows[column] = step * np.rint(rows[column] / step)
    return Case(rows, log.reference.R_eb, reference.read(path).reference.R_eb)


def make(name, quirks=JULY_2013, **options):
    """The estimator with the settings of the original; it begins as `reset(None)`, R = I."""
    return ApDcm(ApDcmParams(quirks=frozenset(quirks), **{**ORIGINALS[name][1], **options}))


def difference_deg(R_eb, other_R_eb):
    """RMS and maximum of the angle between two attitudes."""
    angle = np.degrees(rotation_error_rad(R_eb, other_R_eb))
    return np.sqrt(np.mean(angle**2)), angle.max()


# Asked for: 0.01 / 0.05 on E100, 0.05 / 0.15 on A50, 0.2 / 0.4 on C50 gps.  Measured: E100 0.0026 / 0.0132,
# A50 5e-6 / 3e-5, C50 mag 0.0005 / 0.0042 (first heading again), C50 gps 1e-5 / 7e-5.
@pytest.mark.parametrize(
    ("name", "rms_deg", "max_deg"),
    [
        ("E100 mag", 0.005, 0.02),
        ("A50 mag", 0.001, 0.002),
        ("A50 gps", 0.001, 0.002),
        ("C50 mag", 0.002, 0.01),
        ("C50 gps", 0.001, 0.002),
    ],
)
def test_july_2013_is_the_original(name, rms_deg, max_deg):
    """All quirks on, the rotation is what the original printed for every sample."""
    case = load(name)
    rms, largest = difference_deg(make(name).replay(case.rows)["R_eb"], case.original_R_eb)
    assert rms <= rms_deg
    assert largest <= max_deg


def test_van_zundert_target_of_half_a_degree_is_met():
    """His bench case, his measure: Euler angles within 0.5 degrees of the original's, away from vertical pitch."""
    case = load("E100 mag")
    ours = to_euler(make("E100 mag").replay(case.rows)["R_eb"])
    original = to_euler(case.original_R_eb)
    upright = np.abs(original[1]) < np.radians(85.0)
    assert upright.sum() > 5000
    for angle, his in zip(ours, original, strict=True):
        assert np.degrees(np.abs(wrap(angle - his))[upright]).max() < 0.1  # measured: 0.04


def replay_integral_by_hand(case, *, set_integral, earth_frame):
    """The bench case with the integral of van Zundert's section 3 kept here, in place of the estimator's own.

    set_integral : the integral is set to the saturated sum, as the report has it; else the sum is added to it
    earth_frame : the error is integrated in the earth frame, Eqn 3.12 as printed; else in the body frame
    """
    estimator = make("E100 mag")
    p = estimator.params
    integral, total, total_s = np.zeros(3), np.zeros(3), 0.0
    attitudes = np.empty((len(case.rows), 3, 3))
    before = estimator.snapshot()
    for k in range(len(case.rows)):
        attitudes[k] = estimator.update(Measurements(case.rows, k)).R_eb
        after = estimator.snapshot()
        old, new = before[0], after[0]
        slow = new["spin_rad_s"] < np.radians(20.0)
        if slow and new["compass_yaw_s"] > old["compass_yaw_s"] > 0.0:
            since_s = new["compass_yaw_s"] - old["compass_yaw_s"]
            total[2] += p.ki_yaw * since_s * new["omega_yaw_p"] / p.kp_yaw  # Eqns 3.4 and 3.5
        if slow and old["begun"] and new["interval_s"] == 0.0:
            interval_s = old["interval_s"] + new["dt_s"]
            error = new["R_eb"] @ new["error_b"] if earth_frame else new["error_b"]
            total += p.ki * interval_s * error  # Eqn 3.12
            total_s += interval_s
            if total_s >= 5.0 + 1e-5:
                limit = p.gyro_drift_rad_s2 * total_s
                integral = np.clip(total, -limit, limit) + (0.0 if set_integral else integral)
                total, total_s = np.zeros(3), 0.0
        new["omega_i_b"] = integral
        estimator.restore(after)
        before = after
    return attitudes


@pytest.mark.parametrize(
    ("set_integral", "earth_frame", "low_deg", "high_deg"),
    [(False, False, 0.0, 0.02), (True, False, 0.0, 0.02), (False, True, 0.1, 0.25)],
)
def test_van_zundert_misreadings_on_a_minute_of_bench(set_integral, earth_frame, low_deg, high_deg):
    """E100 turns slowly enough to learn for 8 s of its 60: the integral moves once, and set is the same as added.

    Measured: 0.013 degrees at most with Eqn 3.12 in the body frame (the code), 0.16 in the earth frame (the report).
    """
    case = load("E100 mag")
    attitudes = replay_integral_by_hand(case, set_integral=set_integral, earth_frame=earth_frame)
    _, largest = difference_deg(attitudes, case.original_R_eb)
    assert low_deg <= largest <= high_deg


def two_minutes_of_bench():
    """Turned by hand at up to 49 deg/s for 120 s at 100 Hz, with the gyro offsets of E100 and a perfect compass."""
    dt_s, n = 0.01, 12000
    t_s = dt_s * np.arange(n + 1)
    angles = [90.0 * np.sin(t_s / 4.6) + 90.0, 40.0 * np.sin(t_s / 2.1 + 1.0), 60.0 * np.sin(t_s / 1.75)]
    attitude = Rotation.from_euler("ZYX", np.transpose(angles), degrees=True)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t_s[1:], dt_s
    rows["gyro_b_rad_s"] = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / dt_s + np.radians([0.8, -0.6, 0.5])
    rows["force_b_m_s2"] = attitude[1:].inv().apply([0.0, 0.0, -9.80665])
    rows["mag_new"][9::10] = 1
    rows["mag_b_ut"] = attitude[1:].inv().apply([20.0, 0.0, 44.0])
    return Case(rows, make("E100 mag").replay(rows)["R_eb"], attitude[1:].as_matrix())


@pytest.mark.parametrize(
    ("set_integral", "earth_frame", "low_deg", "high_deg"),
    [(False, False, 0.0, 1e-9), (True, False, 0.8, 1.4), (False, True, 1.2, 2.0), (True, True, 1.2, 2.0)],
)
def test_van_zundert_missed_his_target_by_two_misreadings(set_integral, earth_frame, low_deg, high_deg):
    """In two minutes of bench each of two sentences of his report costs more than the half degree that he aimed at.

    The original is `ap_dcm` here, which is it to 0.02 degrees.  Measured: set instead of added, 1.1 degrees; the error
    integrated in the earth frame, 1.6; both, 1.6.  No misreading: the integral kept here is the estimator's own.
    """
    case = two_minutes_of_bench()
    attitudes = replay_integral_by_hand(case, set_integral=set_integral, earth_frame=earth_frame)
    _, largest = difference_deg(attitudes, case.original_R_eb)
    assert low_deg <= largest <= high_deg


def tilt_deg(name, quirks, **options):
    """RMS and maximum of the tilt error against the truth, once in the air."""
    case = load(name)
    tilt = np.degrees(inclination_error_rad(make(name, quirks, **options).replay(case.rows)["R_eb"], case.true_R_eb))
    flown = tilt[case.rows["t_s"] > 40.0]
    return np.sqrt(np.mean(flown**2)), flown.max()


@pytest.mark.parametrize(
    ("mended", "gps_deg", "mag_deg"),
    [
        ((), (2.5, 16.4), (1.2, 9.2)),
        ((Quirk.UNWRAPPED_COURSE,), (1.2, 9.2), (1.2, 9.2)),
        ((Quirk.STALE_EULER,), (1.2, 9.2), (1.2, 9.2)),
        ((Quirk.VERTICAL_CLIP,), (1.9, 10.2), (0.4, 2.3)),
        ((Quirk.UNWRAPPED_COURSE, Quirk.VERTICAL_CLIP), (0.4, 2.3), (0.4, 2.3)),
        ((Quirk.STUCK_P_GAIN,), (2.7, 18.2), (1.4, 11.2)),
        (tuple(Quirk), (0.34, 1.7), (0.34, 1.7)),
    ],
    ids=lambda value: "+".join(value) or "as is" if not value or isinstance(value[0], str) else str(value[0]),
)
def test_what_each_quirk_costs_with_ideal_sensors(mended, gps_deg, mag_deg):
    """Tilt errors of A50 with some quirks mended: the heading set at every fix, and the clip, are what it costs.

    Setting the heading costs nothing by itself: it costs the sample of roll and pitch that the stale angles lose.
    """
    for name, expected in (("A50 gps", gps_deg), ("A50 mag", mag_deg)):
        assert tilt_deg(name, JULY_2013 - set(mended)) == pytest.approx(expected, rel=0.1, abs=0)


@pytest.mark.parametrize(("name", "late_deg", "matched_deg"), [("C50 gps", 5.0, 2.0), ("C50 mag", 5.0, 1.2)])
def test_delay_line_that_matches_the_lag_removes_it(name, late_deg, matched_deg):
    """GPS velocity 0.4 s late: two fixes of delay bring the mended tilt error from over 6 degrees to 1.5 or less."""
    assert tilt_deg(name, ())[0] > late_deg  # measured: 6.7, 6.3
    assert tilt_deg(name, (), gps_delay_fixes=2)[0] < matched_deg  # measured: 1.5, 0.9


def test_delay_line_without_a_lag_does_harm():
    """The November default of two fixes, with a GPS that is not late, tilts by degrees: delay must match lag."""
    quirks = JULY_2013 - {Quirk.UNWRAPPED_COURSE, Quirk.VERTICAL_CLIP}
    assert tilt_deg("A50 mag", quirks, gps_delay_fixes=2) == pytest.approx((3.9, 17.5), rel=0.1, abs=0)
