"""The estimators with a magnetometer meet broken samples in every column: rotations, replay and snapshot hold."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.blocks.magnetometer import believable, turn_to_north
from estimator.compiler.jit import kernel
from estimator.dilshad import Dilshad
from estimator.interface import MEASURED_DTYPE, Measurements
from estimator.params.shared import FIELD_RANGE_UT
from estimator.starlino import Starlino

N = 400


@kernel
def call_believable(reading, limit_ut):
    """An inlined kernel is entered from another one."""
    return believable(reading, limit_ut)


BROKEN = np.array([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 1e-300, 5.0, -5.0])


def rows_of(seed):
    """A craft that stands in some attitude, with magnetometer and GPS; a twentieth of all numbers is broken."""
    rng = np.random.default_rng(seed)
    R = Rotation.random(rng=rng).as_matrix()
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(N) + 1) * 0.02, 0.02
    rows["force_b_m_s2"], rows["mag_b_ut"] = -9.8 * R[2], R.T @ [19.6, 0.0, 47.8]
    rows["mag_new"], rows["gps_new"] = rng.random((2, N)) < 0.3
    rows["gps_speed_m_s"], rows["gps_p_e_m"] = 8.0, rng.normal(0.0, 10.0, (N, 3)).cumsum(axis=0)
    for name in rows.dtype.names:
        if rows.dtype[name].base.kind == "f":
            spoilt = rng.random(rows[name].shape) < 0.05
            rows[name][spoilt] = rng.choice(BROKEN, spoilt.sum())
    rows.flags.writeable = False
    return rows


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("make", [Starlino, Dilshad])
def test_broken_samples_leave_a_rotation_and_are_counted(make, seed):
    """Orthonormal to 1e-3, determinant above zero, everything finite, whatever comes."""
    estimator = make()
    got = estimator.replay(rows_of(seed))
    R = got["R_eb"]
    assert np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max() < 1e-3
    assert np.linalg.det(R).min() > 0.0
    assert np.all(np.isfinite(got["omega_b_rad_s"]))
    assert np.all(np.isfinite(got["gyro_bias_b_rad_s"]))
    assert estimator.rejected > 0


@pytest.mark.parametrize("make", [Starlino, Dilshad])
def test_replay_equals_streaming_over_a_snapshot(make):
    """Half a flight, snapshot, another instance restored from it, the other half: bit for bit the replay."""
    rows = rows_of(99)
    expected = make().replay(rows)["R_eb"]
    first, second = make(), make()
    got = [first.update(Measurements(rows, k)).R_eb for k in range(N // 2)]
    second.restore(first.snapshot())
    got += [second.update(Measurements(rows, k)).R_eb for k in range(N // 2, N)]
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("seed", range(8))
def test_turn_to_north_sets_the_heading_and_keeps_the_tilt(seed):
    """Any attitude turned about the vertical by any angle comes back to the true one; the oracle made the field."""
    rng = np.random.default_rng(seed)
    R, declination = Rotation.random(rng=rng).as_matrix(), rng.uniform(-3.0, 3.0)
    field_b = R.T @ Rotation.from_euler("z", declination).apply([19.6, 0.0, 47.8])
    believed = Rotation.from_euler("z", rng.uniform(-3.0, 3.0)).as_matrix() @ R
    assert turn_to_north(believed, field_b, declination)
    np.testing.assert_allclose(believed, R, rtol=0, atol=1e-12)


@pytest.mark.parametrize("tilt_deg", [5.0, -10.0])
def test_turn_to_north_with_a_wrong_bank_errs_by_the_tangent_of_the_dip(tilt_deg):
    """Level believed, banked in truth, nose to the north: atan(tan(dip) sin(bank)) of heading."""
    bank, dip = math.radians(tilt_deg), math.atan2(47.8, 19.6)
    field_b = Rotation.from_euler("x", bank).as_matrix().T @ [19.6, 0.0, 47.8]
    believed = np.eye(3)
    assert turn_to_north(believed, field_b, 0.0)
    expected = -math.atan(math.tan(dip) * math.sin(bank))
    assert math.atan2(believed[1, 0], believed[0, 0]) == pytest.approx(expected, rel=0, abs=1e-12)


@pytest.mark.parametrize("field_b", [[0.0, 0.0, 50.0], [0.5, -0.5, 60.0], [0.0, 0.0, 0.0]])
def test_turn_to_north_vertical_field_changes_nothing(field_b):
    """Within 1.1 degrees of the vertical, or no field at all: no heading."""
    believed = np.eye(3)
    assert not turn_to_north(believed, np.array(field_b), 0.1)
    np.testing.assert_array_equal(believed, np.eye(3))


@pytest.mark.parametrize(
    ("reading", "can_be"),
    [
        ([20.0, 0.0, 45.0], True),
        ([-199.0, 150.0, 10.0], True),
        ([0.5, 0.5, 0.5], False),
        ([20.0, math.nan, 45.0], False),
        ([math.inf, 0.0, 45.0], False),
        ([20.0, 0.0, -4096 / 13.0], False),
    ],
)
def test_believable_tells_a_field_from_what_is_none(reading, can_be):
    """NaN, infinity, an HMC5843's overflow and a sensor that reads next to nothing are not the earth's field."""
    assert bool(call_believable(np.array(reading), FIELD_RANGE_UT)) is can_be
