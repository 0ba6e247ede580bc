"""A receiver's columns: what arrived and when, its stamps, a lost fix, units that nobody said; flags of arrival."""

import numpy as np
import pytest

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.logs.validity import usable


@pytest.fixture
def read(held, tmp_path):
    """Reads the columns of a held motion, with others in the place of its GPS."""

    def _read(extra, columns=None):
        table = {n: v for n, v in held.columns(attitude=False).items() if n not in ("vn", "ve")} | extra
        path = tmp_path / "log.csv"
        path.write_text("\n".join(held.lines(table)).replace("nan", ""))
        if columns is None:
            return logs.read(path)
        (tmp_path / "own.toml").write_text(columns)
        return logs.read(path, columns=str(tmp_path / "own.toml"))

    return _read


def fixes(n, every=10, first=4):
    """A velocity in every tenth row, nothing between."""
    at = np.arange(first, n, every)
    vn, ve = np.full(n, np.nan), np.full(n, np.nan)
    vn[at], ve[at] = 5.0 + 0.1 * np.arange(len(at)), -3.0
    return at, vn, ve


def test_stamps_of_the_fixes_are_taken_and_known(held, read):
    """The time at which a fix was true, 0.24 s before it arrived, by the log's clock."""
    at, vn, ve = fixes(held.n)
    stamp = np.full(held.n, np.nan)
    stamp[at] = held.t_s[at] - 0.24
    log = read({"vn": vn, "ve": ve, "gps_t_s": stamp})
    np.testing.assert_array_equal(np.flatnonzero(log.rows["gps_new"]), at)
    np.testing.assert_allclose(log.rows["gps_t_s"][at], held.t_s[at] - 0.24, rtol=0, atol=1e-9)
    known = {name: entry.value for name, entry in log.known.items()}
    assert known == {"gps_stamped": True, "gps_vertical_velocity": False, "gps_rate_hz": 5.0, "imu_rate_hz": 50.0}


def test_fix_without_a_stamp_has_none(held, read):
    """It is not invented; the property says so."""
    _, vn, ve = fixes(held.n)
    log = read({"vn": vn, "ve": ve})
    assert np.isnan(log.rows["gps_t_s"]).all()
    assert log.known["gps_stamped"].value is False


def test_stamps_of_another_clock_are_not_used(held, read):
    """Seconds of the week are no times of the log."""
    at, vn, ve = fixes(held.n)
    week = np.full(held.n, np.nan)
    week[at] = 345_600.0 + held.t_s[at]
    log = read({"vn": vn, "ve": ve, "gps_time": week})
    assert np.isnan(log.rows["gps_t_s"]).all()
    assert log.known["gps_stamped"].value is False
    assert "gps.time is -345600 s before the arrival of the fixes, so on another clock: not used" in log.repairs


def test_stamps_in_the_unit_of_the_time_are_converted_with_it(held, read):
    """Both in milliseconds, of which nobody said so."""
    at, vn, ve = fixes(held.n)
    stamp = np.full(held.n, np.nan)
    stamp[at] = 1e3 * (held.t_s[at] - 0.1)
    log = read({"t": 1e3 * held.t_s, "vn": vn, "ve": ve, "gps_t": stamp})
    np.testing.assert_allclose(log.rows["gps_t_s"][at], held.t_s[at] - 0.1, rtol=0, atol=1e-9)


def test_vertical_velocity_is_known_where_it_is_reported(held, read):
    """A column of zeros is none where the height changes by more than 5 m."""
    at, vn, ve = fixes(held.n)
    assert read({"vn": vn, "ve": ve}).known["gps_vertical_velocity"].value is False
    for down, height_m, expected in ((0.25, 0.0, True), (0.0, 0.0, True), (0.0, 20.0, False)):
        vd, gps_d = np.full(held.n, np.nan), np.full(held.n, np.nan)
        vd[at], gps_d[at] = down, np.linspace(0.0, -height_m, len(at))
        log = read({"vn": vn, "ve": ve, "vd": vd, "gps_d": gps_d})
        assert log.known["gps_vertical_velocity"].value is expected
        np.testing.assert_array_equal(log.rows["gps_v_e_m_s"][at, 2], down)


def test_map_says_more_than_the_columns(held, read):
    """What a person knows of the receiver wins over what was measured."""
    _, vn, ve = fixes(held.n)
    log = read({"vn": vn, "ve": ve}, "[instruments]\ngps_rate_hz = 4\ngps_latency_s = 0.1\n")
    known = {name: (entry.value, entry.source) for name, entry in log.known.items()}
    assert known["gps_rate_hz"] == (4, "log")
    assert known["gps_latency_s"] == (0.1, "log")


def test_lost_fix_ends_the_one_before_and_is_counted(held, read):
    """Status 1 for a second: its reports are left out, and the last fix is of no use until the next."""
    at, vn, ve = fixes(held.n)
    status = np.full(held.n, np.nan)
    status[at] = 3.0
    status[at[20:25]] = 1.0
    log = read({"vn": vn, "ve": ve, "gps_fix": status})
    expected = np.arange(held.n) >= at[0]
    expected[at[20] : at[25]] = False
    np.testing.assert_array_equal(log.rows["gps_valid"], expected)
    entry = log.ledger["gps"]
    assert (entry.read, entry.used, entry.left_out) == (50, 45, {"no fix of three dimensions": 5})


def test_silent_receiver_is_of_no_use_after_two_seconds(held, read):
    """Longer than three of its intervals, and than 2 s."""
    at, vn, ve = fixes(held.n)
    vn[at[20:40]] = ve[at[20:40]] = np.nan
    rows = read({"vn": vn, "ve": ve}).rows
    silent = (held.t_s > held.t_s[at[19]] + 2.0 + 1e-9) & (held.t_s < held.t_s[at[40]] - 1e-9)
    np.testing.assert_array_equal(rows["gps_valid"] > 0, (np.arange(held.n) >= at[0]) & ~silent)


def test_usable_takes_three_intervals_of_a_slow_receiver():
    """Fixes every 2 s: after one, the next 6 s; a loss in the row of a fix does not count."""
    t_s = np.arange(40.0)
    new = np.isin(t_s, [2, 4, 6, 8, 20])
    lost = np.isin(t_s, [20, 23])
    expected = ((t_s >= 2) & (t_s <= 14)) | ((t_s >= 20) & (t_s < 23))
    np.testing.assert_array_equal(usable(new, t_s, lost), expected)
    assert not usable(np.zeros(40, np.bool_), t_s, lost).any()


def test_gps_without_a_velocity_is_in_the_ledger(held, read):
    """Positions alone are read and not used, and the reason is said."""
    at = np.arange(4, held.n, 10)
    latitude, longitude = np.full(held.n, np.nan), np.full(held.n, np.nan)
    latitude[at], longitude[at] = 47.0 + 1e-6 * at, 8.0
    log = read({"lat": latitude, "lon": longitude})
    entry = log.ledger["gps"]
    assert (entry.read, entry.used, entry.left_out) == (50, 0, {"without a velocity": 50})
    assert log.sensors == ("gyro", "accelerometer")
    assert any("GPS without a velocity" in line for line in log.repairs)


def test_position_in_integers_is_of_degrees_and_millimetres(held, read):
    """As PX4 and u-blox write it: 1e-7 degrees, millimetres."""
    at, vn, ve = fixes(held.n)
    of_degrees = {"lat": 47.0 + 1e-4 * (np.arange(held.n) > 250), "lon": 8.0 + 0.0 * vn, "alt": 488.0 + 0.0 * vn}
    of_degrees["lat"] = np.where(np.isfinite(vn), of_degrees["lat"], np.nan)
    of_degrees["lon"] = np.where(np.isfinite(vn), 8.0, np.nan)
    expected = read({"vn": vn, "ve": ve} | of_degrees)
    found = read(
        {"vn": vn, "ve": ve, "lat": np.round(1e7 * of_degrees["lat"]), "lon": np.round(1e7 * of_degrees["lon"]),
         "alt": np.where(np.isfinite(vn), 488e3, np.nan)}
    )  # fmt: skip
    np.testing.assert_allclose(found.rows["gps_p_e_m"], expected.rows["gps_p_e_m"], rtol=0, atol=0.02)
    assert found.place == pytest.approx((47.0, 8.0), rel=0, abs=1e-9)
    assert found.rows["gps_p_e_m"][at[-1], 0] == pytest.approx(11.12, rel=0, abs=0.02)  # 1e-4 degrees of latitude


def test_flags_say_what_arrived(held, read):
    """Values that stay the same arrive where the flags say, of the field, the air and the receiver."""
    ones = np.ones(held.n)
    new = {name: (np.arange(held.n) % every == 0) * 1.0 for name, every in (("gps", 10), ("mag", 5), ("air", 2))}
    log = read(
        {"gps_new": new["gps"], "vn": 8.0 * ones, "ve": ones, "mag_new": new["mag"], "mx": 20.0 * ones,
         "my": 0.0 * ones, "mz": 40.0 * ones, "air_new": new["air"], "airspeed": 9.0 * ones, "height": 3.0 * ones}
    )  # fmt: skip
    for name in new:
        np.testing.assert_array_equal(log.rows[f"{name}_new"], new[name])
    used = {stream: entry.used for stream, entry in log.ledger.items()}
    assert used == {"imu": 500, "gps": 50, "magnetometer": 100, "airspeed": 250, "barometer": 250}


def test_speed_and_course_are_kept_as_reported(held, read):
    """Beside a velocity that was rounded otherwise."""
    at, vn, ve = fixes(held.n)
    speed, course = np.hypot(vn, ve) + 0.01, np.arctan2(ve, vn) % (2.0 * np.pi) + 0.002
    log = read({"vn": vn, "ve": ve, "gps_speed": speed, "course": course})
    np.testing.assert_allclose(log.rows["gps_speed_m_s"][at], speed[at], rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.rows["gps_course_rad"][at], course[at], rtol=0, atol=1e-9)


def test_intervals_of_the_file_are_those_of_the_rows(held, read):
    """Where they are those between its rows; else they are found from the times."""
    jitter = 0.02 + 0.001 * np.sin(np.arange(held.n))
    np.testing.assert_allclose(read({"dt": jitter}).rows["dt_s"], jitter, rtol=0, atol=1e-12)
    other = read({"dt": np.full(held.n, 0.005)})
    np.testing.assert_allclose(other.rows["dt_s"], 0.02, rtol=0, atol=1e-9)
    assert "intervals of 0.005 s do not fit the rows, which are 0.02 s apart: not used" in other.repairs


def test_force_in_counts_is_refused_with_the_way_out(held, read):
    """2048 counts are a g: nobody can know that but the person."""
    counts = {f"a{a}": np.round(2048.0 / 9.80665 * held.force[:, i]) for i, a in enumerate("xyz")}
    with pytest.raises(LogError, match=r"its median is 2048\.02 m/s\^2.*counts need a factor in a column map"):
        read(counts)


@pytest.mark.parametrize(
    ("instruments", "said"),
    [
        ("gps_latency_s = 0.45", True),
        ("gps_latency_s = 0.45\ngps_stamped = false", False),
        ("gps_latency_s = 0.45\ngps_stamped = true", False),
        ("gps_rate_hz = 4", False),
    ],
)
def test_latency_of_a_map_beside_stamps_is_said_to_give_way(held, read, instruments, said):
    """Nobody writes it and wonders why it changes nothing: by its stamps a fix is 0.24 s late."""
    at, vn, ve = fixes(held.n)
    stamp = np.full(held.n, np.nan)
    stamp[at] = held.t_s[at] - 0.24
    notes = read({"vn": vn, "ve": ve, "gps_t_s": stamp}, f"[instruments]\n{instruments}\n").notes
    assert len(notes) == said
    assert all("gps_latency_s = 0.45 s in the map" in note and "0.24 s late" in note for note in notes)
    assert read({"vn": vn, "ve": ve}, "[instruments]\ngps_latency_s = 0.45\n").notes == ()


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e200])
def test_number_that_no_sensor_reads_is_none(held, read, value):
    """In one fix and one sample of the gyro, which are left out and counted; no arithmetic overflows."""
    at, vn, ve = fixes(held.n)
    vn[at[3]] = value
    gyro = held.rate[:, 0].copy()
    gyro[200] = value
    log = read({"vn": vn, "ve": ve, "gx": gyro})
    assert len(log.rows) == held.n - 1
    assert log.ledger["imu"].left_out == {"without a number": 1}
    assert log.ledger["gps"].left_out == {"without a number": 1}
    assert all(entry.agrees for entry in log.ledger.values())
