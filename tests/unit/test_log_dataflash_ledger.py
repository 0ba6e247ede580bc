"""Every message of an ArduPilot log is accounted for, and none enters where it does not belong."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError

SLOW = settings(
    max_examples=settings.default.max_examples * 2 // 5, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
HOW = ["drop", "double", "zero", "noise", "flip"]
GPS_STATUS, GPS_TIME = 2, 0  # places in the fields of a message
OF_2013 = "BIHBcLLeeCCf", "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ"


@pytest.fixture
def read(logged, dataflash, read_back):
    """Reads the flight with each message changed, or left out where that gives None, and more of them."""

    def _read(change=lambda m: m, more=(), formats=None, without="", name="flight.bin", **options):
        told = [m for m in map(change, dataflash.messages(logged, without)) if m is not None]
        writer = dataflash.Writer(dataflash.TODAY | (formats or {}))
        return read_back(writer.log([*told, *more]), name, **options)

    return _read


def first(m, name):
    """Whether the message is one of the first instance of `name`."""
    return m[1] == name and (name not in ("IMU", "GPS", "MAG", "ARSP", "BARO") or m[2][1] == 0)


def test_good_log_is_used_whole(logged, read):
    """Counts by the flight that was written; other instances are named, not counted."""
    log = read()
    counts = {name: (entry.read, entry.used, entry.left_out) for name, entry in log.ledger.items()}
    fixes, fields, airs = len(logged.fix_us), len(logged.field_us), len(logged.air_us)
    assert counts == {
        "imu": (1000, 1000, {}), "gps": (fixes, fixes, {}), "magnetometer": (fields, fields, {}),
        "airspeed": (airs, airs, {}), "barometer": (airs, airs, {}), "reference": (1000, 1000, {}),
    }  # fmt: skip
    assert log.notes == ("only one of several instances is read: IMU 0 (of 0, 1); GPS 0 (of 0, 1)",)


def test_each_reason_is_counted_by_itself(logged, read):
    """No fix, no number, a time far off, before and after the inertial record, replaced by the next."""
    fixes = logged.fix_us

    def spoil(m):
        if not first(m, "GPS"):
            return m
        i = int(np.flatnonzero(fixes == m[0])[0])
        v = list(m[2])
        if i in (10, 11, 12):
            v[GPS_STATUS] = 1
        elif i == 20:
            v[10] = np.nan
        elif i == 30:
            v[GPS_TIME] ^= 1 << 40
        return (m[0], "GPS", tuple(v))

    fix = next(
        m
        for m in map(
            spoil, [(fixes[0], "GPS", (fixes[0], 0, 3, 0, 2200, 12, 0.8, 47.4, 8.5, 488.0, 15.0, 20.0, 0.5, 0.0))]
        )
    )
    early, late = int(logged.t_us[0]) - 500_000, int(logged.t_us[-1]) + 500_000
    again = int(fixes[40]) - 1000  # in the same tick as the one after it
    more = [(t, "GPS", (t, *fix[2][1:])) for t in (early, late, again)]
    entry = read(spoil, more).ledger["gps"]
    assert entry.left_out == {
        "no fix of three dimensions": 3,
        "without a number": 1,
        "at a time far from its neighbours": 1,
        "outside the inertial record": 2,
        "replaced by a later one in the same row": 1,
    }
    assert (entry.read, entry.used) == (len(fixes) + 3, len(fixes) + 3 - 8)


def test_what_arrives_in_a_gap_of_the_inertial_record_does_not_enter_after_it(logged, read):
    """6 s without IMU: the row after it has no new fix, field or airspeed that is seconds old."""
    begin, end = int(logged.t_us[400]), int(logged.t_us[700])
    log = read(lambda m: None if m[1] == "IMU" and begin < m[0] < end else m)
    k = int(np.flatnonzero(np.diff(log.rows["t_s"]) > 1.0)[0]) + 1
    assert log.rows["t_s"][k] == pytest.approx(end / 1e6, rel=0, abs=1e-9)
    nominal_us = 30_000  # one interval and a half
    for stream, times in (("gps", logged.fix_us), ("magnetometer", logged.field_us), ("airspeed", logged.air_us),
                          ("barometer", logged.air_us)):  # fmt: skip
        lost = int(np.sum((times > begin) & (times < end - nominal_us)))
        assert log.ledger[stream].left_out == {"in a gap of the inertial record": lost}, stream
    # Between the last two before its end the attitude of the row after the gap is found.
    lost = int(np.sum((logged.t_us > begin) & (logged.t_us < end))) - 1
    assert log.ledger["reference"].left_out == {"in a gap of the inertial record": lost}
    for new, times in (("gps_new", logged.fix_us), ("mag_new", logged.field_us), ("air_new", logged.air_us)):
        near = np.any((times > end - nominal_us) & (times <= end))
        assert bool(log.rows[new][k]) == near, new


def test_fix_that_the_receiver_lost_is_no_longer_valid(logged, read):
    """From the message on that says so, until there is a fix again; the columns still hold the last one."""
    lost = logged.fix_us[30:50]
    rows = read(lambda m: (m[0], "GPS", (*m[2][:2], 1, *m[2][3:])) if first(m, "GPS") and m[0] in lost else m).rows
    t_us = np.round(1e6 * rows["t_s"])
    expected = (t_us >= logged.fix_us[0]) & ~((t_us >= lost[0]) & (t_us < logged.fix_us[50]))
    np.testing.assert_array_equal(rows["gps_valid"] > 0, expected)
    np.testing.assert_array_equal(rows["gps_v_e_m_s"][t_us == lost[10] // 20_000 * 20_000 + 20_000][0],
                                  rows["gps_v_e_m_s"][t_us < lost[0]][-1])  # fmt: skip


def test_fix_is_no_longer_valid_after_two_seconds_of_silence(logged, read):
    """A receiver whose cable came off says nothing at all."""
    silent = logged.fix_us[30:60]
    rows = read(lambda m: None if m[1] == "GPS" and m[0] in (*silent, *(silent + 1)) else m).rows
    last_s = rows["t_s"][np.flatnonzero(rows["gps_new"])[29]]
    valid = rows["gps_valid"] > 0
    quiet = (rows["t_s"] > last_s) & (rows["t_s"] < logged.fix_us[60] / 1e6)
    np.testing.assert_array_equal(valid[quiet], rows["t_s"][quiet] <= last_s + 2.0)
    assert valid[rows["t_s"] >= logged.fix_us[60] / 1e6].all()


def test_fixes_by_the_time_of_the_week_are_put_on_the_clock_of_the_log(logged, read, demand_same_rows):
    """GPS of 2013 without T: each arrived after the inertial record before it in the file, and by the next one."""

    def of_week(m):
        if m[1] != "GPS":
            return m
        v = m[2]
        return (
            None if v[1] else (m[0], "GPS", (3, 345_000_000 + (m[0] - 30_000_000) / 1e3, 1750, *v[5:9], 0.0, *v[9:13]))
        )

    log = read(of_week, formats={"GPS": (*OF_2013, "#s---DUmmnhn", "-C---GG00B00")})
    expected = logged.expected(stamped=False)
    for column in ("gps_new", "gps_valid"):
        np.testing.assert_array_equal(log.rows[column], expected[column])
    np.testing.assert_allclose(log.rows["gps_p_e_m"], expected["gps_p_e_m"], rtol=0, atol=0.025)
    assert log.ledger["gps"].used == len(logged.fix_us)
    assert "GPS: not on the clock of the log; placed by the order of the records" in log.repairs


def test_fix_by_the_time_of_the_week_in_a_gap_is_left_out(logged, read):
    """Nobody knows when in the gap it came."""
    begin, end = int(logged.t_us[400]), int(logged.t_us[500])

    def of_week(m):
        if m[1] == "IMU" and begin < m[0] < end:
            return None
        if m[1] != "GPS":
            return m
        v = m[2]
        return None if v[1] else (m[0], "GPS", (3, 345_000_000, 1750, *v[5:9], 0.0, *v[9:13]))

    entry = read(of_week, formats={"GPS": (*OF_2013, "#s---DUmmnhn", "-C---GG00B00")}).ledger["gps"]
    n = int(np.sum((logged.fix_us > begin) & (logged.fix_us <= end)))
    assert entry.left_out == {"in a gap of the inertial record": n}


@pytest.mark.parametrize("column", ["H", "Health"])
def test_health_of_the_barometer_is_looked_at_in_every_version(logged, read, column):
    """H until 4.4 and since 4.7, Health between."""
    formats = {"BARO": ("QBfffB", f"TimeUS,I,Alt,Press,Temp,{column}", "s#mPO-", "F-000-")}
    sick = logged.air_us[20:60]
    log = read(lambda m: m if m[1] != "BARO" else (*m[:2], (*m[2], int(m[0] not in sick))), formats=formats)
    assert log.ledger["barometer"].left_out == {"unhealthy": 40}
    held = log.rows["baro_height_m"][np.searchsorted(log.rows["t_s"], sick / 1e6)]
    np.testing.assert_allclose(held, logged.height[19], rtol=0, atol=1e-5)


def test_inertial_samples_that_call_themselves_unhealthy_are_left_out(logged, dataflash, read):
    """GH and AH; where most are, another unit must be chosen."""
    codes, columns, units, mults = dataflash.TODAY["IMU"]
    formats = {"IMU": (codes + "BB", columns + ",GH,AH", units + "--", mults + "--")}

    def sick(until):
        return lambda m: m if m[1] != "IMU" else (*m[:2], (*m[2], 1, int(m[0] > until or m[2][1] == 1)))

    log = read(sick(logged.t_us[9]), formats=formats)
    assert log.ledger["imu"].left_out == {"unhealthy": 10}
    with pytest.raises(LogError, match=r"800 of 1000 samples of IMU 0 are unhealthy by its own GH AH: choose another"):
        read(sick(logged.t_us[799]), formats=formats)
    assert len(read(sick(logged.t_us[799]), formats=formats, imu=1).rows) == 1000


@pytest.mark.parametrize(
    ("vehicle", "mask", "said"),
    [
        ("ArduPlane V4.5.7 (abc)", 0, r"set bit 7 \(IMU\) or bit 19 \(raw IMU\) of LOG_BITMASK$"),
        ("ArduCopter V4.6.2 (abc)", 145_118, r"bit 18 \(fast IMU\) or bit 19 \(raw IMU\) of LOG_BITMASK; "
                                             r"add 524288 to its 145118$"),
        ("AntennaTracker V4.5 (abc)", 0, r"set bit 3 \(IMU\) of LOG_BITMASK$"),
    ],
)  # fmt: skip
def test_inertial_unit_logged_too_slowly_is_refused_with_the_bit_to_set(logged, read, vehicle, mask, said):
    """Every 0.4 s: by vehicle, and by what LOG_BITMASK is where the log has it."""
    formats = {"MSG": ("QZ", "TimeUS,Message", "s-", "F-"), "PARM": ("QNf", "TimeUS,Name,Value", "s--", "F--")}
    start = int(logged.t_us[0])
    more = [(start, "MSG", (start, vehicle.encode()))]
    more += [(start, "PARM", (start, b"LOG_BITMASK", mask))] if mask else []

    def every_twentieth(m):
        return None if m[1] == "IMU" and (m[0] - start) % 400_000 else m

    with pytest.raises(LogError, match=r"IMU was logged every 0\.4 s; 0\.1 s or less can be replayed: " + ".*" + said):
        read(every_twentieth, more, formats)
    with pytest.raises(LogError, match=r"no inertial unit \(IMU, or GYR and ACC\): set bit"):
        read(more=more, formats=formats, without="IMU")


def test_raw_samples_are_read_where_the_others_were_logged_too_slowly(logged, dataflash, read):
    """IMU every 0.4 s, and GYR and ACC at the full rate beside it."""
    formats = {"GYR": ("QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ", "s#sEEE", "F-F000"),
               "ACC": ("QBQfff", "TimeUS,I,SampleUS,AccX,AccY,AccZ", "s#sooo", "F-F000")}  # fmt: skip
    raw = []
    for t, w, f in zip(logged.t_us, logged.rate, logged.force, strict=True):
        raw += [(t, "GYR", (t, 0, t, *w)), (t, "ACC", (t, 0, t, *f))]
    log = read(lambda m: None if m[1] == "IMU" and (m[0] - logged.t_us[0]) % 400_000 else m, raw, formats)
    assert len(log.rows) == 1000
    np.testing.assert_allclose(log.rows["force_b_m_s2"], logged.force, rtol=0, atol=2e-6)


def test_instances_that_there_are_are_listed(read):
    """For a number that is none of them."""
    with pytest.raises(LogError, match=r"flight\.bin: no inertial unit 5; IMU has 0 and 1$"):
        read(imu=5)


def test_message_whose_columns_are_others_is_reported(read):
    """A field without z is not read, and that is said."""
    log = read(lambda m: m if m[1] != "MAG" else (*m[:2], m[2][:4]),
               formats={"MAG": ("QBhh", "TimeUS,I,MagX,MagY", "s#GG", "F-CC")})  # fmt: skip
    assert any(line.startswith("MAG has no MagZ: ") and line.endswith(" messages not read") for line in log.repairs)
    assert "magnetometer" not in log.sensors


def test_stamps_that_jitter_are_no_loss(logged, read):
    """By up to 8 ms, as a busy logger stamps."""
    off = dict(zip(logged.t_us, np.random.default_rng(1).integers(-8000, 8001, len(logged.t_us)), strict=True))
    log = read(lambda m: (m[0] + off[m[0]], m[1], (m[0] + off[m[0]], *m[2][1:])) if m[1] == "IMU" else m)
    assert not any("lost" in line for line in log.repairs)
    assert len(log.rows) == 1000
    assert sum(entry.left_out.get("in a gap of the inertial record", 0) for entry in log.ledger.values()) == 0


@SLOW
@given(
    damage=st.lists(
        st.tuples(st.floats(0.0, 1.0), st.integers(0, 400), st.sampled_from(HOW)),
        max_size=8,
    ),
    seed=st.integers(0, 1000),
)  # fmt: skip
def test_books_agree_whatever_was_damaged(logged, dataflash, demand_agreement, damage, seed):
    """Bytes lost, doubled, blanked, overwritten or flipped anywhere: what is still read is accounted for."""
    rng = np.random.default_rng(seed)
    pieces = dataflash.Writer(dataflash.TODAY).log(dataflash.messages(logged, "ATT"))
    raw = bytearray(b"".join(pieces))
    for where, n, how in damage:
        at = int(where * (len(raw) - 1))
        piece = raw[at : at + n]
        flipped = bytes(b ^ (1 << int(rng.integers(8))) if rng.random() < 0.1 else b for b in piece)
        raw[at : at + n] = {"drop": b"", "double": piece * 2, "zero": bytes(len(piece)), "noise": rng.bytes(len(piece)),
                            "flip": flipped}[how]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.bin"
        path.write_bytes(raw)
        try:
            log = logs.read(path)
        except LogError:
            return
    demand_agreement(log)
