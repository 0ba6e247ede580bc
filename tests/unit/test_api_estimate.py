"""The public API on plain arrays: `wl.estimate`."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import wingslevel as wl
from estimator.interface import G_M_S2
from scenarios.harness.logs import read
from scenarios.harness.replay import Window, replay

RATE_HZ, SECONDS = 50, 20


def still(roll_deg: float, pitch_deg: float) -> tuple[Any, Any, Any]:
    """Times, rates and specific forces of something that lies still, tilted."""
    n = RATE_HZ * SECONDS
    R_eb = Rotation.from_euler("ZYX", [0.0, pitch_deg, roll_deg], degrees=True).as_matrix()
    force = R_eb.T @ np.array([0.0, 0.0, -G_M_S2])
    return np.arange(1, n + 1) / RATE_HZ, np.zeros((n, 3)), np.tile(force, (n, 1))


@pytest.mark.parametrize("estimator", ["premerlani", "ap_dcm", "starlino"])
def test_estimate_of_something_still_is_its_tilt(estimator: str) -> None:
    """Roll and pitch are those of the specific force, in every row, those of the calibration too."""
    found = wl.estimate(*still(20.0, -10.0), estimator=estimator, calibration_s=2.0)
    assert len(found) == RATE_HZ * SECONDS
    assert found.first == 2 * RATE_HZ
    np.testing.assert_allclose(found.euler_deg[:, :2], np.tile([20.0, -10.0], (len(found), 1)), rtol=0, atol=0.05)
    expected = Rotation.from_quat(found.quaternion_eb[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(found.R_eb, expected, rtol=0, atol=1e-7)
    assert (found.quaternion_eb[:, 0] >= 0.0).all()


def test_estimate_of_a_flight_is_its_replay(tmp_path: Any) -> None:
    """The arrays of a recording give what a replay of it gives, with the same knowledge of the instruments."""
    flight = wl.fly("hand_launch", duration=12, seed=1)
    log = read(flight.save(tmp_path, rerun=False) / "flight.parquet")
    expected = replay(log, "premerlani", {}, Window(calibration_s=2.0))
    m = flight.measured
    fixes = m[m["gps_new"] > 0]
    found = wl.estimate(
        m["t_s"], m["gyro_b_rad_s"], m["force_b_m_s2"],
        gps={"t_s": fixes["t_s"], "v_e_m_s": fixes["gps_v_e_m_s"], "p_e_m": fixes["gps_p_e_m"]},
        params={name: entry.value for name, entry in expected.known.items() if entry.source != "assumed"},
        calibration_s=2.0,
    )  # fmt: skip
    first = found.first
    assert first == expected.first
    assert not m["mag_new"].any()
    assert not m["air_new"].any()
    np.testing.assert_allclose(found.R_eb[first:], expected.log.flown["R_eb"][first:], rtol=0, atol=1e-9)
    true_deg = Rotation.from_matrix(flight.truth["R_eb"]).as_euler("ZYX", degrees=True)[:, [2, 1]]
    airborne = flight.t_s > flight.release_s + 3.0
    assert np.abs(found.euler_deg[airborne, :2] - true_deg[airborne]).max() < 10.0


def turning(seconds: float, yaw_deg_s: float, rate_hz: int = RATE_HZ) -> tuple[Any, Any, Any]:
    """Times, rates and specific forces of something level that turns at a constant rate."""
    n = round(seconds * rate_hz)
    gyro = np.tile([0.0, 0.0, np.radians(yaw_deg_s)], (n, 1))
    return np.arange(1, n + 1) / rate_hz, gyro, np.tile([0.0, 0.0, -9.8], (n, 1))


def test_estimate_of_a_constant_rate_is_its_integral() -> None:
    """20 deg/s of yaw for 30 s are 600 deg: no offset is taken from the start of a turn."""
    found = wl.estimate(*turning(30.0, 20.0), estimator="gyro_only")
    assert found.euler_deg[-1, 2] == pytest.approx(600.0 - 360.0, abs=0.01)
    np.testing.assert_array_equal(found.gyro_bias_b_rad_s, 0.0)
    assert (found.first, found.calibration_b_rad_s) == (0, None)
    assert repr(found) == "<Attitudes of gyro_only, 1500 samples, 30.0 s>"


def test_estimate_of_a_coordinated_turn_without_gps_keeps_its_heading() -> None:
    """Banked by 30 deg at 15 m/s: the body rates turn the heading at g tan(30 deg) / 15 m/s.

    The estimator starts level to the north and its axis of rotation is constant.  Its integration is of first order:
    0.6 deg after 433 deg at 50 Hz, a tenth of that at 500 Hz.
    """
    n, bank = 20 * 500, np.radians(30.0)
    rate_rad_s = G_M_S2 * np.tan(bank) / 15.0
    gyro = np.tile(rate_rad_s * np.array([0.0, np.sin(bank), np.cos(bank)]), (n, 1))
    force = np.tile([0.0, 0.0, -G_M_S2 / np.cos(bank)], (n, 1))
    found = wl.estimate(1.0 / 500, gyro, force, estimator="gyro_only")
    exact = Rotation.from_rotvec(20.0 * gyro[0])
    assert np.degrees((exact.inv() * Rotation.from_matrix(found.R_eb[-1])).magnitude()) < 0.1


def test_estimate_says_which_offset_a_calibration_took() -> None:
    """Asked for, it takes the constant rate as an offset, and says so."""
    found = wl.estimate(*turning(30.0, 20.0), estimator="gyro_only", calibration_s=2)
    assert found.calibration_b_rad_s == pytest.approx([0.0, 0.0, np.radians(20.0)])
    assert "calibrated over 100 samples: gyro offset (0, 0, 20) deg/s" in repr(found)


def test_estimate_takes_two_seconds_of_samples() -> None:
    """As long as the calibration of a replay."""
    assert len(wl.estimate(*turning(2.0, 1.0))) == 100


@pytest.mark.parametrize("interval_s", [10.0, 1e-6])
def test_estimate_warns_of_an_implausible_interval(interval_s: float) -> None:
    """Milliseconds, or something else."""
    _, gyro, force = still(0.0, 0.0)
    with pytest.warns(wl.WingslevelWarning, match=r"t_s has a median interval of .* must be in seconds"):
        wl.estimate(interval_s * np.arange(1, len(gyro) + 1), gyro, force)


@pytest.mark.parametrize("factor", [0.01, 10.0, 1000.0])
@pytest.mark.parametrize("estimator", ["premerlani", "gyro_only"])
def test_estimate_warns_of_a_magnetometer_in_other_units(factor: float, estimator: str) -> None:
    """Gauss, milligauss and nanotesla, also if the estimator has no use for it."""
    mag: Any = {"t_s": [1.0, 2.0], "field_b_ut": np.array([[20.0, 0.0, 40.0]] * 2) * factor}
    with pytest.warns(wl.WingslevelWarning, match=r"mag\['field_b_ut'\] has a median size of .* uT"):
        wl.estimate(*still(0.0, 0.0), estimator=estimator, mag=mag)


def test_estimate_takes_an_interval_and_lists() -> None:
    """One number is the interval of the samples; lists are arrays."""
    t_s, gyro, force = still(5.0, 0.0)
    by_times = wl.estimate(t_s, gyro, force)
    by_interval = wl.estimate(1.0 / RATE_HZ, gyro.tolist(), force.tolist())
    np.testing.assert_allclose(by_interval.t_s, t_s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_interval.R_eb, by_times.R_eb, rtol=0, atol=1e-9)


def test_estimate_takes_your_own_class() -> None:
    """It sees what arrived, when it arrived, and nothing else."""
    seen: list[tuple[int, str]] = []

    class Mine:
        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            row = round(m.imu.t_s * RATE_HZ) - 1
            seen.extend((row, name) for name in ("gps", "mag", "air") if getattr(m, name) is not None)
            if m.gps is not None:
                assert (m.gps.speed_m_s, m.gps.course_rad) == (pytest.approx(5.0), pytest.approx(np.arctan2(4.0, 3.0)))
            return wl.AttitudeEstimate(np.eye(3), gyro_bias_b_rad_s=np.array([0.1, 0.2, 0.3]))

    t_s, gyro, force = still(0.0, 0.0)
    found = wl.estimate(
        t_s, gyro, force, estimator=Mine, calibration_s=0.0,
        gps={"t_s": [5.0, 6.0, 6.999], "v_e_m_s": [[3, 4, 0], [np.nan] * 3, [3, 4, 0]]},
        mag={"t_s": [8.0], "field_b_ut": [[20, 0, 40]]},
        air={"t_s": [9.0], "equivalent_airspeed_m_s": [12.0]},
    )  # fmt: skip
    assert seen == [(249, "gps"), (349, "gps"), (399, "mag"), (449, "air")]
    np.testing.assert_array_equal(found.gyro_bias_b_rad_s[-1], [0.1, 0.2, 0.3])
    assert np.isnan(found.wind_e_m_s).all()
    assert (found.health == wl.Health.GOOD).all()


def test_estimate_as_a_table() -> None:
    """A row for each sample, with angles and the name of the health; a line and a table about it."""
    found = wl.estimate(*still(20.0, -10.0), calibration_s=2.0)
    frame = found.to_pandas()
    assert len(frame) == len(found)
    assert frame["roll_deg"].iloc[-1] == pytest.approx(20.0, abs=0.05)
    assert set(frame["health_name"]) <= {"starting", "good", "poor"}
    calibrated = "calibrated over 100 samples: gyro offset (0, 0, 0) deg/s"
    assert repr(found) == f"<Attitudes of premerlani, 1000 samples, 20.0 s, {calibrated}>"
    assert "roll at the end" in found._repr_html_()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gyro_b_rad_s": np.zeros((1000, 2))}, r"gyro_b_rad_s has shape \(1000, 2\); it must be \(N, 3\)"),
        ({"gyro_b_rad_s": "fast"}, "gyro_b_rad_s is not an array of numbers"),
        ({"force_b_m_s2": np.zeros((7, 3))}, "force_b_m_s2 has 7 rows, gyro_b_rad_s has 1000"),
        ({"t_s": np.arange(7)}, "t_s has 7 rows, gyro_b_rad_s has 1000"),
        ({"t_s": np.zeros(1000)}, r"t_s\[1\] = 0 s follows 0 s"),
        ({"t_s": -0.02}, "must be above 0"),
        ({"gyro_b_rad_s": np.full((1000, 3), np.nan)}, r"gyro_b_rad_s\[0\] = \[nan, nan, nan\]"),
        ({"gps": {"t_s": [1.0]}}, "gps holds no 'v_e_m_s'"),
        ({"gps": {"t": [1.0]}}, "gps holds 't'"),
        ({"gps": {"t_s": [1.0, 2.0], "v_e_m_s": [[0, 0, 0]]}}, "has 1 rows, its t_s has 2"),
        ({"gps": {"t_s": [1e9], "v_e_m_s": [[0, 0, 0]]}}, "no sample between"),
        ({"gps": [1.0]}, "must be a dict"),
        ({"mag": {"t_s": [1.0]}}, "mag holds no 'field_b_ut'"),
        ({"estimator": "premerlni"}, "premerlani"),
        ({"estimator": "oracle"}, "oracle"),
        ({"params": {"kp": 1.0}}, "k_p"),
        ({"calibration_s": 1e4}, "calibration_s"),
        ({"calibration_s": None}, "calibration_s = None: must be a number"),
        ({"params": [1]}, "params = .*must be a dict"),
        ({"gps": {"t_s": [31.0], "v_e_m_s": [[0, 0, 0]]}}, r"no sample between 0 s and 20 s"),
    ],
)
def test_estimate_refuses_in_one_line(changes: dict[str, Any], message: str) -> None:
    """What does not fit is named, with what would be right."""
    t_s, gyro, force = still(0.0, 0.0)
    with pytest.raises(wl.WingslevelError, match=message) as refused:
        wl.estimate(**{"t_s": t_s, "gyro_b_rad_s": gyro, "force_b_m_s2": force, **changes})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("gyro_factor", "force_factor", "message"),
    [(1.0, 1.0 / G_M_S2, "in g"), (1.0, -1.0, "points down"), (180.0, 1.0, "degrees per second")],
)
def test_estimate_warns_of_other_units(gyro_factor: float, force_factor: float, message: str) -> None:
    """Degrees, multiples of g, and the other sign are likely mistakes."""
    t_s, gyro, force = still(0.0, 0.0)
    with pytest.warns(wl.WingslevelWarning, match=message):
        wl.estimate(t_s, (gyro + 0.03) * gyro_factor, force * force_factor, calibration_s=0.0)


def test_estimate_of_an_estimator_that_fails_raises() -> None:
    """There is no attitude to return; the line names the class and the time."""

    class Broken:
        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            raise RuntimeError("broken")

    with pytest.raises(wl.WingslevelError, match=r"Broken.*broken"):
        wl.estimate(*still(0.0, 0.0), estimator=Broken)
