"""The filter to copy: closed forms of its loops, its lag in turns, what it says of itself, and a copy that flies."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from estimator import complementary
from estimator.complementary import Complementary, ComplementaryParams
from estimator.interface import MEASURED_DTYPE, Health, ImuSample
from estimator.rotation import heading_error_rad, inclination_error_rad
from scenarios.harness.equipping import equipped
from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find

G, DT = 9.80665, 0.02
SLOW_S = 1e12  # a bias that is not learnt


def rows_of(R, speed_m_s=0.0, course_rad=0.0, gps_every=10, gyro_b_rad_s=(0.0, 0.0, 0.0), turn_rad_s=0.0):
    """Perfect measurements of the attitudes `R`, (n, 3, 3): a fix every so many samples, level flight along `course`.

    In a turn about the vertical at `turn_rad_s`, the force is gravity's and that of omega x (speed, 0, 0).
    """
    n = len(R)
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(n) + 1) * DT, DT
    rows["gyro_b_rad_s"] = gyro_b_rad_s
    rows["force_b_m_s2"] = np.cross(gyro_b_rad_s, [speed_m_s, 0.0, 0.0]) - G * R[:, 2]
    rows["gps_course_rad"], rows["gps_speed_m_s"] = course_rad, speed_m_s
    rows["gps_v_e_m_s"][:, 0] = speed_m_s * np.cos(course_rad)
    rows["gps_v_e_m_s"][:, 1] = speed_m_s * np.sin(course_rad)
    if speed_m_s > 0.0:
        rows["gps_new"][::gps_every], rows["gps_valid"] = 1, 1
    return rows


def still(R, seconds, **how):
    """The same, of an attitude that stays."""
    return rows_of(np.tile(R, (round(seconds / DT), 1, 1)), **how)


@pytest.mark.parametrize("tilt_s", [2.0, 5.0])
def test_tilt_left_follows_the_closed_form_of_its_time_constant(tilt_s):
    """The rate of recovery is sin(e) / tilt_s, so tan(e / 2) decays exponentially; half of e per step is the error."""
    e0 = math.radians(40.0)
    rows = still(Rotation.from_euler("x", e0).as_matrix(), 10.0)
    estimates = Complementary(ComplementaryParams(tilt_s=tilt_s, bias_s=SLOW_S)).replay(rows)
    left = inclination_error_rad(estimates["R_eb"], Rotation.from_euler("x", e0).as_matrix())
    expected = 2.0 * np.arctan(math.tan(0.5 * e0) * np.exp(-rows["t_s"] / tilt_s))
    np.testing.assert_allclose(left, expected, rtol=0, atol=e0 * DT / tilt_s)


@pytest.mark.parametrize("heading_s", [2.0, 6.0])
def test_heading_left_follows_the_closed_form_of_its_time_constant(heading_s):
    """The same about the vertical, on a straight course to the east of the nose."""
    e0 = math.radians(70.0)
    R = Rotation.from_euler("z", e0).as_matrix()
    rows = still(R, 20.0, speed_m_s=12.0, course_rad=e0)
    estimates = Complementary(ComplementaryParams(heading_s=heading_s)).replay(rows)
    left = -heading_error_rad(estimates["R_eb"], R)
    expected = 2.0 * np.arctan(math.tan(0.5 * e0) * np.exp(-rows["t_s"] / heading_s))
    np.testing.assert_allclose(left, expected, rtol=0, atol=e0 * DT / heading_s)


def test_heading_is_found_from_the_opposite_direction():
    """Beyond a right angle the correction is as large as it gets: no dead point at 180 degrees."""
    R = Rotation.from_euler("z", math.pi).as_matrix()
    rows = still(R, 30.0, speed_m_s=12.0, course_rad=math.pi)
    last = Complementary().replay(rows)["R_eb"][-1]
    assert abs(math.degrees(float(heading_error_rad(last, R)))) < 0.5


def test_gyro_bias_is_learnt_along_the_closed_form():
    """At rest, tilt e and learnt bias b: de/dt = -e / tilt_s + b0 - b, db/dt = e / (tilt_s bias_s)."""
    b0, p = 0.01, ComplementaryParams()
    estimates = Complementary().replay(still(np.eye(3), 60.0, gyro_b_rad_s=(b0, 0.0, 0.0)))
    A = np.array([[-1.0 / p.tilt_s, -1.0, b0], [1.0 / (p.tilt_s * p.bias_s), 0.0, 0.0], [0.0, 0.0, 0.0]])
    for t_s in (5.0, 20.0, 60.0):
        e, b, _ = expm(A * t_s) @ [0.0, 0.0, 1.0]
        k = round(t_s / DT) - 1
        np.testing.assert_allclose(estimates["gyro_bias_b_rad_s"][k], [b, 0.0, 0.0], rtol=0, atol=0.01 * b0)
        np.testing.assert_allclose(math.asin(estimates["R_eb"][k, 2, 1]), e, rtol=0, atol=0.01 * b0 * p.tilt_s)


def in_a_turn(latency_s, believed_s, seconds=40.0):
    """Inclination and heading error, degrees, in the last 10 s of a turn at 35 degrees of bank with late fixes."""
    bank, speed = math.radians(35.0), 12.0
    rate = G * math.tan(bank) / speed
    n = round(seconds / DT)
    t_s = (np.arange(n) + 1) * DT
    R = Rotation.from_euler("ZYX", np.stack([rate * t_s, 0.0 * t_s, 0.0 * t_s + bank], axis=1)).as_matrix()
    gyro = rate * np.array([0.0, math.sin(bank), math.cos(bank)])
    rows = rows_of(R, speed, rate * (t_s - latency_s), gyro_b_rad_s=gyro)
    estimator = Complementary(ComplementaryParams(gps_latency_s=believed_s))
    estimator.reset(ImuSample(2.0, DT, np.zeros(3), -G * R[0, 2]))  # held with the wing down
    got = estimator.replay(rows)["R_eb"]
    last = slice(round(-10.0 / DT), None)
    tilt_deg = np.degrees(inclination_error_rad(got[last], R[last])).max()
    return tilt_deg, np.degrees(heading_error_rad(got[last], R[last])).mean()


def test_steady_turn_with_a_known_latency_keeps_tilt_and_heading():
    """The centrifugal term keeps the tilt, the turn since the fix the heading: what is left is of the step."""
    tilt_deg, heading_deg = in_a_turn(0.4, 0.4)
    assert tilt_deg < 0.1
    assert abs(heading_deg) < 0.33  # half a sample of turn


def test_steady_turn_with_an_unknown_latency_lags_by_it():
    """A latency of 0.4 s that is taken for 0 leaves the heading late by the turn in 0.4 s."""
    _, heading_deg = in_a_turn(0.4, 0.0)
    rate_deg_s = math.degrees(G * math.tan(math.radians(35.0)) / 12.0)
    np.testing.assert_allclose(heading_deg, -0.4 * rate_deg_s, rtol=0, atol=1.0)


def test_force_far_from_gravity_does_not_tilt_the_estimate():
    """A throw of 2 g along the nose for half a second leaves the attitude where it was."""
    rows = still(np.eye(3), 0.5)
    rows["force_b_m_s2"] += [2.0 * G, 0.0, 0.0]
    np.testing.assert_array_equal(Complementary().replay(rows)["R_eb"][-1], np.eye(3))


def test_health_starts_is_good_with_a_course_and_poor_without():
    """Starting until the heading has been near the course, poor once the fixes have stopped for two seconds."""
    R = Rotation.from_euler("z", 1.0).as_matrix()
    rows = still(R, 20.0, speed_m_s=12.0, course_rad=1.0)
    rows["gps_new"][500:] = 0
    health = Complementary().replay(rows)["health"]
    assert health[0] == Health.STARTING
    assert health[490] == Health.GOOD
    assert health[490 + round(complementary.FIX_LIFE_S / DT) + 1] == Health.POOR


@pytest.mark.parametrize("change", [{"tilt_s": 0.0}, {"heading_s": -1.0}, {"bias_s": math.nan}, {"gps_filter_s": -0.1}])
def test_params_that_cannot_be_are_rejected(change):
    """One line with the field, the value and what is right."""
    (name,) = change
    with pytest.raises(ValueError, match=f"{name} is .*; it must be"):
        ComplementaryParams(**change)


def test_copied_file_flies_as_the_users_own_estimator(tmp_path: Path):
    """What README and CONTRIBUTING say: copy the file, name it, set its parameters; the same flight bit for bit."""
    own = tmp_path / "my_filter.py"
    shutil.copy(complementary.__file__, own)
    spec = f"{own}:Complementary"
    assert equipped(spec, settings={"tilt_s": 9.0}).code.params.tilt_s == 9.0
    crosswind, changes = find("crosswind"), {"duration_s": 3.0}
    ours, theirs = (fly_scenario(crosswind, changes, estimator=name) for name in ("complementary", spec))
    np.testing.assert_array_equal(theirs.log.flown["R_eb"], ours.log.flown["R_eb"])
