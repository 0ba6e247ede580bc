"""Every estimator of the registry obeys the protocol, keeps nothing that it was lent, and lends nothing it keeps."""

import importlib

import numpy as np
import pytest

import estimator as package
from estimator.interface import (
    MEASURED_DTYPE,
    AttitudeEstimate,
    AttitudeEstimator,
    GpsFix,
    Health,
    ImuSample,
    Measurements,
)

N = 400


@pytest.fixture(params=sorted(package.ESTIMATORS))
def make(request):
    """The class of each registered estimator."""
    module, _, name = package.ESTIMATORS[request.param].partition(":")
    return getattr(importlib.import_module(module), name)


@pytest.fixture
def rows():
    """A plausible flight with 5 Hz of GPS, a broken sample and a repeated time; read-only, as in the loop."""
    rng = np.random.default_rng(5)
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(N) + 1) * 0.02, 0.02
    rows["gyro_b_rad_s"] = rng.normal(0.0, 0.4, (N, 3))
    rows["force_b_m_s2"] = rng.normal([0.0, 0.0, -9.8], 1.0, (N, 3))
    rows["gps_new"][10::10] = 1
    rows["gps_valid"][10:] = 1
    rows["gps_course_rad"], rows["gps_speed_m_s"] = 1.0, 12.0
    rows["gps_v_e_m_s"] = [12.0 * np.cos(1.0), 12.0 * np.sin(1.0), 0.0]
    rows["gyro_b_rad_s"][200] = np.nan
    rows["t_s"][300] = rows["t_s"][299]
    rows.flags.writeable = False
    return rows


def fly(estimator, rows):
    """Every estimate of a flight."""
    return [estimator.update(Measurements(rows, k)) for k in range(len(rows))]


def columns(estimates):
    """The numbers of a flight's estimates, as copies."""
    return np.array([[*e.R_eb.ravel(), *e.omega_b_rad_s, *e.gyro_bias_b_rad_s, e.health] for e in estimates])


def test_update_over_a_flight_returns_attitudes(make, rows):
    """Protocol, types, shapes; a finite rotation at every tick, bad samples included."""
    estimator = make()
    assert isinstance(estimator, AttitudeEstimator)
    assert estimator.heading_reference in ("course", "nose")
    for estimate in fly(estimator, rows):
        assert isinstance(estimate, AttitudeEstimate)
        assert estimate.R_eb.shape == (3, 3)
        assert np.abs(estimate.R_eb @ estimate.R_eb.T - np.eye(3)).max() < 1e-3
        assert np.linalg.det(estimate.R_eb) > 0.0
        assert estimate.omega_b_rad_s.shape == estimate.gyro_bias_b_rad_s.shape == (3,)
        assert np.all(np.isfinite(columns([estimate])))
        assert isinstance(estimate.health, Health)


def test_update_returned_arrays_are_the_callers_to_keep(make, rows):
    """An estimate of an earlier tick does not change later, and writing on it changes no later one."""
    estimator, spoilt = make(), make()
    first = estimator.update(Measurements(rows, 0))
    kept = columns([first])
    rest = columns([estimator.update(Measurements(rows, k)) for k in range(1, N)])
    np.testing.assert_array_equal(columns([first]), kept)
    after_spoiling = []
    for k in range(N):
        estimate = spoilt.update(Measurements(rows, k))
        after_spoiling.append(columns([estimate])[0])
        estimate.R_eb[:] = estimate.omega_b_rad_s[:] = estimate.gyro_bias_b_rad_s[:] = np.nan
    np.testing.assert_array_equal(after_spoiling[1:], rest)


def test_update_writes_nothing_on_the_rows(make, rows):
    """Measurements are lent: even rows that could be written stay as they were."""
    writable = rows.copy()
    fly(make(), writable)
    assert writable.tobytes() == rows.tobytes()


def test_update_looks_at_its_own_tick_and_earlier_ones_alone(make, rows):
    """What later rows hold makes no difference: no estimator sees the future."""
    changed = rows.copy()
    changed[N // 2 :] = np.zeros(1, MEASURED_DTYPE)
    np.testing.assert_array_equal(columns(fly(make(), rows[: N // 2])), columns(fly(make(), changed)[: N // 2]))


def test_update_single_measurements_equal_rows_of_a_log(make, rows):
    """`Measurements.of` and a row of the log are the same to an estimator."""
    one, other = make(), make()
    for k in range(100):
        row = rows[k]
        imu = ImuSample(row["t_s"], row["dt_s"], row["gyro_b_rad_s"], row["force_b_m_s2"])
        fix = GpsFix(0.0, np.zeros(3), row["gps_v_e_m_s"], row["gps_course_rad"], row["gps_speed_m_s"])
        single = Measurements.of(imu, gps=fix if row["gps_new"] else None)
        np.testing.assert_array_equal(columns([one.update(single)]), columns([other.update(Measurements(rows, k))]))


@pytest.mark.parametrize("on_ground", [None, ImuSample(2.0, 0.02, np.full(3, 0.02), np.array([1.0, -2.0, -9.5]))])
def test_reset_equals_new_and_two_instances_share_nothing(make, rows, on_ground):
    """The same flight thrice: new, reset after use, and beside another one in flight."""
    new, used, beside = make(), make(), make()
    fly(used, rows)
    for estimator in (new, used):
        estimator.reset(on_ground)
    fly(beside, rows)
    np.testing.assert_array_equal(columns(fly(used, rows)), columns(fly(new, rows)))


def test_power_up_takes_the_tilt_from_the_sample(make):
    """Held at 10 degrees of bank and 20 of pitch, the first attitude says so."""
    roll, pitch = np.radians([10.0, 20.0])
    force = -9.8 * np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    estimator = make()
    estimator.reset(ImuSample(2.0, 0.02, np.zeros(3), force))
    estimate = estimator.update(Measurements.of(ImuSample(2.02, 0.02, np.zeros(3), force)))
    single = make.__module__ == "estimator.peers"  # a package may compute in single precision
    np.testing.assert_allclose(estimate.R_eb[2] * -9.8, force, rtol=0, atol=1e-6 if single else 1e-9)


def test_register_own_class_enters_it_and_refuses_a_taken_name():
    """One decorator makes an estimator nameable; a name means one class."""

    class Own:
        def update(self, _measurements):
            """Level, always."""
            return AttitudeEstimate(np.eye(3))

    try:
        assert package.register("own")(Own) is Own
        assert package.ESTIMATORS["own"].endswith("Own")
        package.register("own")(Own)  # a module imported again
        with pytest.raises(ValueError, match="'premerlani' is already"):
            package.register("premerlani")(Own)
    finally:
        package.ESTIMATORS.pop("own", None)
