"""The estimators with a magnetometer meet broken samples in every column: rotations, replay and snapshot hold."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.dilshad import Dilshad
from estimator.interface import MEASURED_DTYPE, Measurements
from estimator.starlino import Starlino

N = 400
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
