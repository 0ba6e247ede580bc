"""Every message of a PX4 log is accounted for, none enters where it does not belong, and no length is too long."""

import struct
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
FLAGS_AT = 16 + 3


@pytest.fixture
def pieces(logged, px4):
    """The flight as pieces of a log, with each message changed, or left out where that gives None."""

    def _pieces(change=lambda m: m, without="vehicle_imu", topics=None):
        told = [m for m in map(change, px4.messages(logged, without)) if m is not None]
        return px4.ulog(told, px4.TODAY | (topics or {}))

    return _pieces


def crash_dump(px4, length):
    """An information message of that many bytes, such as is appended after a crash."""
    key = b"char[%d] hardfault_plain" % (length - 2)
    return px4.framed("M", b"\0" + bytes([len(key)]) + key + b"x" * (length - 2 - len(key)))


def appended(first, places):
    """The first piece of a log with the flag bits of data that were appended at these places."""
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", *places, *(0,) * (3 - len(places)))
    return first[:FLAGS_AT] + flags + first[FLAGS_AT + 40 :]


def test_good_log_is_used_whole(logged, pieces, read_back):
    """Counts by the flight that was written."""
    log = read_back(pieces(), "flight.ulg")
    fixes, fields, airs = len(logged.fix_us), len(logged.field_us), len(logged.air_us)
    assert {name: (entry.read, entry.used, entry.left_out) for name, entry in log.ledger.items()} == {
        "imu": (1000, 1000, {}), "gps": (fixes, fixes, {}), "magnetometer": (fields, fields, {}),
        "airspeed": (airs, airs, {}), "barometer": (airs, airs, {}), "reference": (1000, 1000, {}),
    }  # fmt: skip
    assert log.repairs == ()


@pytest.mark.parametrize("length", [8192, 8193, 17_453, 65_535])
def test_message_of_any_length_is_whole(logged, px4, pieces, read_back, length):
    """Crash dumps are longer than 8192 bytes; nothing before or behind them is lost, and they are no damage."""
    records = pieces()
    dump = crash_dump(px4, length)
    assert len(dump) == length + 3
    log = read_back([*records[:700], dump, *records[700:], dump], "flight.ulg")
    assert log.repairs == ()
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate, rtol=0, atol=1e-7)


def test_data_appended_after_a_crash_are_found_where_the_flags_say(logged, px4, pieces, read_back):
    """The message before them was cut off; what its length spans is not taken with it, and three dumps follow."""
    records = pieces()
    cut = records[-1][:9]
    dump = crash_dump(px4, 17_453)
    begin = sum(map(len, records[:-1])) + len(cut)
    records[0] = appended(records[0], [begin, begin + len(dump), begin + 2 * len(dump)])
    log = read_back([*records[:-1], cut, dump, dump, dump], "flight.ulg")
    assert log.repairs == (f"9 bytes outside complete messages left out, first at byte {begin - len(cut)}",)
    assert len(log.rows) == 1000


def test_message_that_was_cut_off_by_a_crash_does_not_take_appended_data_for_its_end(logged, px4, pieces, read_back):
    """Though what was appended ends where it would have ended, and another message follows there."""
    records = pieces()
    last = max(k for k, record in enumerate(records) if len(record) == 50)  # of sensor_combined
    cut = records[last][:20]
    text = px4.framed("L", b"6" + bytes(8) + b"hardfault, reset..")
    assert len(cut) + len(text) == len(records[last])
    begin = sum(map(len, records[:last])) + len(cut)
    records[0] = appended(records[0], [begin])
    log = read_back([*records[:last], cut, text, *records[last + 1 :]], "flight.ulg")
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate[:999], rtol=0, atol=1e-7)
    assert log.repairs == (f"20 bytes outside complete messages left out, first at byte {begin - 20}",)


def test_flags_that_point_nowhere_do_no_harm(pieces, read_back):
    """Damaged places: behind the end, and into the middle of a message."""
    records = pieces()
    records[0] = appended(records[0], [1 << 40, sum(map(len, records[:500])) + 7, 3])
    log = read_back(records, "flight.ulg")
    assert log.repairs == ()
    assert len(log.rows) == 1000


def test_newer_format_is_refused(pieces, read_back):
    """An incompatible flag that nobody knows yet: such a log must not be read."""
    records = pieces()
    records[0] = records[0][: FLAGS_AT + 8] + b"\x02" + records[0][FLAGS_AT + 9 :]
    with pytest.raises(LogError, match=r"a newer ULog format, by its incompatible flags 0200000000000000: cannot be"):
        read_back(records, "flight.ulg")


def test_each_reason_is_counted_by_itself(logged, px4, pieces, read_back):
    """No fix, no velocity, no number, a time far off, and one replaced by the next in the same tick."""

    def spoil(m):
        if m[1] != "vehicle_gps_position":
            return m
        i, v = int(np.flatnonzero(logged.fix_us == m[0])[0]), list(m[3])
        if i in (10, 11):
            v[10] = 2
        elif i == 15:
            v[11] = False
        elif i == 20:
            v[6] = np.nan
        elif i == 30:
            v[0] = int(v[0]) ^ (1 << 40)
        elif i == 41:
            v[0] = int(logged.fix_us[40]) - 1000
        return (*m[:3], tuple(v))

    entry = read_back(pieces(spoil), "flight.ulg").ledger["gps"]
    assert entry.left_out == {
        "no fix of three dimensions": 2,
        "no velocity (vel_ned_valid is 0)": 1,
        "without a number": 1,
        "at a time far from its neighbours": 1,
        "replaced by a later one in the same row": 1,
    }
    assert entry.used == len(logged.fix_us) - 6


def test_what_arrives_in_a_gap_of_the_inertial_record_does_not_enter_after_it(logged, pieces, read_back):
    """6 s without sensor_combined: the row after it has nothing new that is seconds old."""
    begin, end = int(logged.t_us[400]), int(logged.t_us[700])
    log = read_back(pieces(lambda m: None if m[1] == "sensor_combined" and begin < m[0] < end else m), "flight.ulg")
    k = int(np.flatnonzero(np.diff(log.rows["t_s"]) > 1.0)[0]) + 1
    for stream, new, times in (("gps", "gps_new", logged.fix_us), ("magnetometer", "mag_new", logged.field_us),
                               ("airspeed", "air_new", logged.air_us)):  # fmt: skip
        late = (times > begin) & (times < end - 30_000)
        assert log.ledger[stream].left_out == {"in a gap of the inertial record": int(late.sum())}
        assert bool(log.rows[new][k]) == np.any((times >= end - 30_000) & (times <= end))


def test_fix_that_the_receiver_lost_is_no_longer_valid(logged, pieces, read_back):
    """fix_type below 3 for four seconds."""
    lost = logged.fix_us[30:50]
    rows = read_back(
        pieces(lambda m: (*m[:3], (*m[3][:10], 1, True)) if m[1] == "vehicle_gps_position" and m[0] in lost else m),
        "flight.ulg",
    ).rows
    t_us = np.round(1e6 * rows["t_s"])
    expected = (t_us >= logged.fix_us[0]) & ~((t_us >= lost[0]) & (t_us < logged.fix_us[50]))
    np.testing.assert_array_equal(rows["gps_valid"] > 0, expected)


@pytest.mark.parametrize(("without", "imu", "said"), [
    ("", 5, r"no inertial unit 5; vehicle_imu has 0 and 1; without --imu sensor_combined is read$"),
    ("vehicle_imu", 0, r"no inertial unit 0; there is no topic vehicle_imu; without --imu sensor_combined is read$"),
    ("sensor_combined", 2, r"no inertial unit 2; vehicle_imu has 0 and 1$"),
])  # fmt: skip
def test_instances_that_there_are_are_listed(pieces, read_back, without, imu, said):
    """For a number that is none of them."""
    with pytest.raises(LogError, match=said):
        read_back(pieces(without=without), "flight.ulg", imu=imu)


def test_inertial_unit_logged_too_slowly_is_refused_with_what_to_set(logged, pieces, read_back):
    """sensor_combined every 0.4 s."""

    def thin(m):
        return None if m[1] == "sensor_combined" and (m[0] - logged.t_us[0]) % 400_000 else m

    with pytest.raises(LogError, match=r"every 0\.4 s; 0\.1 s or less can be replayed: set bit 1 .* of SDLOG_PROFILE$"):
        read_back(pieces(thin), "flight.ulg")


def test_stamps_that_jitter_are_no_loss(logged, pieces, read_back):
    """By up to 8 ms; the interval that the log states holds."""
    off = dict(zip(logged.t_us, np.random.default_rng(1).integers(-8000, 8001, len(logged.t_us)), strict=True))

    def shake(m):
        return (m[0], *m[1:3], (m[0] + off[m[0]], *m[3][1:])) if m[1] == "sensor_combined" else m

    log = read_back(pieces(shake), "flight.ulg")
    assert log.repairs == ()
    np.testing.assert_allclose(log.rows["dt_s"], 0.02, rtol=0, atol=1e-9)


@SLOW
@given(
    damage=st.lists(
        st.tuples(st.floats(0.0, 1.0), st.integers(0, 400), st.sampled_from(HOW)),
        max_size=8,
    ),
    seed=st.integers(0, 1000),
)
def test_books_agree_whatever_was_damaged(pieces, demand_agreement, damage, seed):
    """Bytes lost, doubled, blanked, overwritten or flipped anywhere: what is still read is accounted for."""
    rng = np.random.default_rng(seed)
    raw = bytearray(b"".join(pieces()))
    for where, n, how in damage:
        at = int(where * (len(raw) - 1))
        piece = raw[at : at + n]
        flipped = bytes(b ^ (1 << int(rng.integers(8))) if rng.random() < 0.1 else b for b in piece)
        raw[at : at + n] = {"drop": b"", "double": piece * 2, "zero": bytes(len(piece)), "noise": rng.bytes(len(piece)),
                            "flip": flipped}[how]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.ulg"
        path.write_bytes(raw)
        try:
            log = logs.read(path)
        except LogError:
            return
    demand_agreement(log)
