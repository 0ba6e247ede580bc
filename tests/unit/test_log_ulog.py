"""PX4's logs: what is read equals what was written, by several versions of its topics; damage is told."""

import json
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.cli.app import run
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.replay import Window, replay, why_none

PACKED = {"uint8_t": "B", "int32_t": "i", "uint32_t": "I", "uint64_t": "Q", "float": "f", "double": "d", "bool": "?"}
TODAY = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
    "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint32_t accelerometer_integral_dt;"
    "uint8_t accelerometer_clipping;uint8_t[3] _padding0;",
    "vehicle_imu": "uint64_t timestamp;uint64_t timestamp_sample;float[3] delta_angle;float[3] delta_velocity;"
    "uint32_t delta_angle_dt;uint32_t delta_velocity_dt;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t timestamp_sample;double latitude_deg;double longitude_deg;"
    "double altitude_msl_m;float vel_m_s;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;float cog_rad;"
    "uint8_t fix_type;bool vel_ned_valid;",
    "vehicle_magnetometer": "uint64_t timestamp;uint64_t timestamp_sample;float[3] magnetometer_ga;",
    "airspeed": "uint64_t timestamp;float indicated_airspeed_m_s;float true_airspeed_m_s;",
    "vehicle_air_data": "uint64_t timestamp;float baro_alt_meter;",
    "vehicle_attitude": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
    "vehicle_attitude_groundtruth": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
}
# Floats of 24 bits, of rates below 2 rad/s, 20 m/s^2, 60 uT, 30 m/s and 600 m; a degree is 1e5 m, a double 1e-14 of it.
RESOLUTION = {
    "gyro_b_rad_s": 1e-7, "force_b_m_s2": 2e-6, "mag_b_ut": 4e-6, "gps_speed_m_s": 3e-6, "gps_course_rad": 1e-6,
    "gps_v_e_m_s": 2e-6, "gps_p_e_m": 1e-3, "equivalent_airspeed_m_s": 4e-6, "baro_height_m": 7e-5,
}  # fmt: skip
Message = tuple[int, str, int, tuple[Any, ...]]  # time, topic, instance, fields
FIX_BYTES = 3 + 2 + struct.calcsize("<QQdddfffffB?")  # of a message, with its header and the number of its topic
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"


def framed(kind: str, body: bytes) -> bytes:
    """One ULog message."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(messages: list[Message], topics: dict[str, str] = TODAY) -> list[bytes]:
    """A log: header and definitions, then a message each in order of time."""
    head = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000) + framed("B", bytes(40))
    for name, fields in topics.items():
        head += framed("F", f"{name}:{fields}".encode())
    present = sorted({(name, instance) for _, name, instance, _ in messages})
    for number, (name, instance) in enumerate(present):
        head += framed("A", struct.pack("<BH", instance, number) + name.encode())
    records = [head]
    for _, name, instance, values in sorted(messages, key=lambda m: m[0]):
        code = "<H"
        for field in filter(None, topics[name].split(";")):
            kind, _, count = field.split(" ")[0].rstrip("]").partition("[")
            if not field.split(" ")[1].startswith("_padding"):  # at the end, and not written
                code += f"{count}{PACKED[kind]}"
        records.append(framed("D", struct.pack(code, present.index((name, instance)), *values)))
    return records


def quaternions(R_eb: Any) -> Any:
    """w, x, y, z of the attitudes."""
    return Rotation.from_matrix(R_eb).as_quat()[:, [3, 0, 1, 2]]


def messages(flight: Any, without: str = "") -> list[Message]:
    """The flight as PX4 logs it today: times of arrival in `timestamp`, those of sampling 110 ms before for fixes."""
    told: list[Message] = []
    for t, w, f, q in zip(flight.t_us, flight.rate, flight.force, quaternions(flight.R_eb), strict=True):
        told.append((t, "sensor_combined", 0, (t, *w, 20_000, 0, *f, 20_000, 0)))
        told.append((t, "vehicle_imu", 0, (t + 700, t, *(0.02 * w), *(0.02 * f), 20_000, 20_000)))
        told.append((t, "vehicle_imu", 1, (t + 700, t, *(0.04 * w), *(0.02 * f), 20_000, 20_000)))
        told.append((t, "vehicle_attitude", 0, (t + 2_000, t, *(-q))))
        told.append((t, "vehicle_attitude_groundtruth", 0, (t, 0, *q)))
    for t, (latitude, longitude, altitude), (n, e, d) in zip(flight.fix_us, flight.geodetic, flight.v_e, strict=True):
        fix = (t, t - 110_000, latitude, longitude, altitude, np.hypot(n, e), n, e, d, np.arctan2(e, n), 3, True)
        told.append((t, "vehicle_gps_position", 0, fix))
    told += [
        (t, "vehicle_magnetometer", 0, (t, 0, *(b / 100.0)))
        for t, b in zip(flight.field_us, flight.field, strict=True)
    ]  # fmt: skip
    for t, v, h in zip(flight.air_us, flight.airspeed, flight.height, strict=True):
        told += [(t, "airspeed", 0, (t, v, 1.03 * v)), (t, "vehicle_air_data", 0, (t, 488.0 + h))]
    return [message for message in told if message[1] not in without.split()]


def expected_of(flight: Any, latency_s: float = 0.11) -> Any:
    """Rows that should be read: fixes were true before they arrived, heights count from the first."""
    rows = flight.expected()
    rows["gps_t_s"][rows["gps_valid"] > 0] -= latency_s
    rows["baro_height_m"] -= flight.height[0]
    return rows


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., logs.RecordedLog]:
    """Writes messages to a log and reads it."""

    def _write(records: list[bytes], name: str = "flight.ulg", **options: Any) -> logs.RecordedLog:
        path = tmp_path / name
        path.write_bytes(b"".join(records))
        return logs.read(path, **options)

    return _write


def test_log_is_read_as_it_was_written(logged, demand_same_rows, write):
    """Every column to the resolution of floats, every arrival in its tick, the simulator's attitude as truth."""
    log = write(ulog(messages(logged)))
    demand_same_rows(log.rows, expected_of(logged), RESOLUTION)
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")
    assert log.repairs == ()
    assert log.place == pytest.approx((47.4, 8.5), rel=0, abs=1e-9)
    assert log.reference is not None
    assert (log.reference.kind, log.reference.name) == ("truth", "vehicle_attitude_groundtruth in flight.ulg")
    np.testing.assert_allclose(log.reference.R_eb, logged.R_eb, rtol=0, atol=3e-7)


def test_attitude_that_was_flown_on_stands_at_the_time_of_its_sample(logged, write):
    """Without ground truth, a quaternion of either sign; published 2 ms after the sample that it is of."""
    reference = write(ulog(messages(logged, without="vehicle_attitude_groundtruth"))).reference
    assert reference is not None
    assert (reference.kind, reference.name) == ("filter", "vehicle_attitude in flight.ulg")
    np.testing.assert_allclose(reference.R_eb, logged.R_eb, rtol=0, atol=3e-7)


def test_log_of_2017_is_read_as_it_was_written(logged, demand_same_rows, write):
    """Intervals in seconds, positions in whole numbers, no time of sampling, no airspeed or barometer."""
    topics = {
        "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float gyro_integral_dt;"
        "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;float accelerometer_integral_dt;",
        "vehicle_gps_position": "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt;float vel_n_m_s;"
        "float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;bool vel_ned_valid;",
        "sensor_mag": "uint64_t timestamp;float x;float y;float z;",
        "vehicle_attitude": "uint64_t timestamp;float rollspeed;float[4] q;",
    }
    told: list[Message] = []
    for t, w, f, q in zip(logged.t_us, logged.rate, logged.force, quaternions(logged.R_eb), strict=True):
        told.append((t, "sensor_combined", 0, (t, *w, 0.02, 0, *f, 0.02)))
        told.append((t, "vehicle_attitude", 0, (t, 0.0, *q)))
    for t, place, v in zip(logged.fix_us, logged.geodetic, logged.v_e, strict=True):
        whole = (round(float(x)) for x in place * [1e7, 1e7, 1e3])
        told.append((t, "vehicle_gps_position", 0, (t, *whole, *v, 3, True)))
    told += [(t, "sensor_mag", 0, (t, *(b / 100.0))) for t, b in zip(logged.field_us, logged.field, strict=True)]
    expected = logged.expected(stamped=False)
    for missing, nothing in (("air_new", 0), ("equivalent_airspeed_m_s", 0.0), ("baro_height_m", np.nan)):
        expected[missing] = nothing
    log = write(ulog(told, topics))
    # The interval is a float of 0.02 s; 1e-7 degrees are 11 mm.
    demand_same_rows(log.rows, expected, RESOLUTION | {"dt_s": 2e-9, "gps_p_e_m": 0.02})
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer")


def test_inertial_unit_is_chosen_by_its_number(logged, demand_same_rows, write):
    """Instances of vehicle_imu, increments; the second turns twice as fast here; without sensor_combined the first."""
    told = messages(logged, without="vehicle_attitude vehicle_attitude_groundtruth")
    rows = write(ulog(told), imu=1).rows
    np.testing.assert_allclose(rows["gyro_b_rad_s"], 2.0 * logged.rate, rtol=0, atol=3e-7)
    np.testing.assert_allclose(rows["force_b_m_s2"], logged.force, rtol=0, atol=4e-6)
    alone = [message for message in told if message[1] != "sensor_combined"]
    loose = RESOLUTION | {"gyro_b_rad_s": 2e-7, "force_b_m_s2": 4e-6}  # rounded twice
    demand_same_rows(write(ulog(alone)).rows, expected_of(logged), loose)
    with pytest.raises(
        LogError, match=r"no inertial unit 2; vehicle_imu has 0 and 1; without --imu sensor_combined is read"
    ):
        write(ulog(told), imu=2)


def test_samples_that_were_not_logged_are_stood_for_by_the_next(logged, write):
    """Every fourth sample of 5 ms: each row stands for 20 ms, and the log says so; one lost row more, for 40."""
    told = [
        (t, name, i, (*v[:4], 5_000, *v[5:9], 5_000, 0) if name == "sensor_combined" else v)
        for t, name, i, v in messages(logged, without="vehicle_imu")
        if not (name == "sensor_combined" and t == logged.t_us[100])
    ]
    log = write(ulog(told))
    assert log.repairs == (
        "sensor_combined: means over 5 ms logged every 20 ms; each is taken for the time since the one before",
        f"1 samples lost, covered by the next one; first at {logged.t_us[101] / 1e6:.2f} s",
    )
    assert log.rows["dt_s"][[0, 50, 100]].tolist() == pytest.approx([0.02, 0.02, 0.04], rel=0, abs=1e-9)


def test_vehicle_imu_logged_for_statistics_is_refused(logged, write):
    """Twice a second by default."""
    told = [
        m
        for m in messages(logged, without="sensor_combined")
        if m[1] != "vehicle_imu" or (m[0] - logged.t_us[0]) % 500_000 == 0
    ]
    with pytest.raises(LogError, match=r"vehicle_imu was logged every 0\.5 s; 0\.1 s or less can be replayed"):
        write(ulog(told))


def test_fix_without_three_dimensions_or_velocity_is_not_used(logged, write):
    """fix_type below 3, and vel_ned_valid of 0."""
    told = []
    for t, name, i, v in messages(logged):
        if name == "vehicle_gps_position" and t < logged.t_us[700]:
            v = (*v[:10], 2, True) if t < logged.t_us[300] else (*v[:10], 3, False)
        told.append((t, name, i, v))
    rows = write(ulog(told)).rows
    assert np.flatnonzero(rows["gps_new"]).tolist() == [
        k for k in np.flatnonzero(logged.expected()["gps_new"]) if k > 700
    ]
    assert not rows["gps_valid"][:700].any()


@pytest.mark.parametrize(("without", "height_m"), [((), 488.0 + 60.0), (("vehicle_air_data",), 488.0)])
def test_true_airspeed_alone_is_converted_by_the_height(logged, write, without, height_m):
    """NaN in indicated_airspeed_m_s: by the barometer's altitude, or by that of the fixes; the log says so."""
    told = [
        (t, name, i, (v[0], np.nan, v[2]) if name == "airspeed" else v)
        for t, name, i, v in messages(logged, "vehicle_imu") if name not in without
    ]  # fmt: skip
    log = write(ulog(told))
    share = (1.0 - 0.0065 * height_m / 288.15) ** 2.12794
    expected = 1.03 * logged.airspeed[-1] * share
    assert log.rows["equivalent_airspeed_m_s"][-1] == pytest.approx(expected, rel=2e-3)
    assert log.repairs == ("true airspeed: converted to equivalent by the height above the sea",)
    assert log.known["elevation_m"].value == pytest.approx(488.0, abs=10.0)


def test_accelerometer_that_was_not_there_is_left_out(logged, write):
    """accelerometer_timestamp_relative at its largest says that there was none."""
    told = [
        (t, n, i, (*v[:5], 0x7FFFFFFF, 0.0, 0.0, 0.0, *v[9:]) if n == "sensor_combined" and t == logged.t_us[40] else v)
        for t, n, i, v in messages(logged, "vehicle_imu")
    ]
    log = write(ulog(told))
    assert len(log.rows) == 999
    assert log.repairs[0] == (
        "column accelerometer_m_s2[0] (force.x): 1 without a number left out, first sensor_combined 41"
    )


def test_end_that_was_cut_off_and_dropouts_are_told(logged, write):
    """A last message of 30 bytes instead of more; the logger's own report that it could not follow."""
    records = ulog(messages(logged, "vehicle_imu"))
    last = max(k for k, record in enumerate(records) if len(record) == 50)  # of sensor_combined
    dropouts = [framed("O", struct.pack("<H", ms)) for ms in (120, 80)]
    log = write([records[0], *dropouts, *records[1:last], records[last][:30]])
    assert log.repairs == (
        f"30 bytes outside complete messages left out, first at byte {sum(map(len, [*dropouts, *records[:last]]))}",
        "2 times the logger could not follow, for 0.20 s in all",
    )
    assert len(log.rows) == 999


def test_damaged_bytes_are_left_out_and_counted(logged, write):
    """What looks like a message of 8000 bytes, and one of a topic that nobody announced: no message is lost for it."""
    records = ulog(messages(logged, "vehicle_imu vehicle_attitude"))
    strange = framed("D", struct.pack("<H", 999) + bytes(20))
    log = write([*records[:500], b"\x40\x1fI", *records[500:800], strange, *records[800:]])
    first = sum(map(len, records[:500]))
    assert log.repairs == (f"{3 + len(strange)} bytes outside complete messages left out, first at byte {first}",)
    assert len(log.rows) == 1000
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], logged.rate, rtol=0, atol=1e-7)


def test_log_with_data_appended_after_a_crash_is_read_whole(logged, demand_same_rows, write):
    """The mark says at which byte the appended data begin, the message before them cut off; damage moves that place."""
    records = ulog(messages(logged, "vehicle_imu"))
    before = [records[0], b"\0" * 5, *records[1:3000], records[3000][:7]]
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", sum(map(len, before)), 0, 0)
    before[0] = before[0].replace(framed("B", bytes(40)), framed("B", flags))
    log = write([*before, *records[3000:]])
    demand_same_rows(log.rows, expected_of(logged), RESOLUTION)
    assert log.repairs == (f"12 bytes outside complete messages left out, first at byte {len(records[0])}",)


def test_damaged_times_are_left_out_and_late_ones_sorted(logged, write):
    """One clock reading with a flipped bit, two messages exchanged, one written twice."""
    records = ulog(messages(logged, "vehicle_imu"))
    at = [k for k, record in enumerate(records) if len(record) == 50]
    flipped = bytearray(records[at[200]])
    flipped[10] ^= 1  # 2^40 microseconds
    records[at[200]] = bytes(flipped)
    records[at[300]], records[at[301]] = records[at[301]], records[at[300]]
    records[at[400]] += records[at[400]]
    log = write(records)
    assert log.repairs[:3] == (
        "sensor_combined: 1 at a time far from its neighbours left out, first 201",
        "column sensor_combined.timestamp (time): 1 out of order, sorted; first sensor_combined 302",
        "column sensor_combined.timestamp (time): 1 repeated, left out; first sensor_combined 402",
    )
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], np.delete(logged.rate, 200, axis=0), rtol=0, atol=1e-7)
    assert log.rows["dt_s"][200] == pytest.approx(0.04, rel=0, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_log_damaged_anywhere_is_read_or_refused_in_one_line(logged, write, seed, capfd):
    """Bytes overwritten, lost and doubled at random places: never another error, never a word on the terminal."""
    rng = np.random.default_rng(seed)
    raw = bytearray(b"".join(ulog(messages(logged, "vehicle_imu vehicle_attitude"))))
    for _ in range(rng.integers(1, 12)):
        at, n = int(rng.integers(len(raw))), int(rng.integers(1, 300))
        raw[at : at + n] = (rng.bytes(n), b"", raw[at : at + n] * 2, bytes(n))[rng.integers(4)]
    refusal = ""
    try:
        log = write([bytes(raw)])
    except LogError as error:
        refusal = str(error)
    else:
        assert log.repairs
        assert np.all(np.diff(log.rows["t_s"]) > 0.0)
    assert "\n" not in refusal
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"", r"the file is empty, not a ULog file of PX4 \(\.ulg\)"),
        (bytes(range(256)), r"cannot be read as a ULog file: Invalid file format \(Failed to parse header\)"),
        (
            ulog([])[0],
            r"vehicle_imu\): set bit 1 \(estimator replay\) of SDLOG_PROFILE; it has none that we know",
        ),
        (b"".join(ulog([(9, "airspeed", 0, (9, 1.0, 1.0))])), "SDLOG_PROFILE; it has airspeed 0"),
    ],
)
def test_file_without_an_inertial_unit_is_refused(write, raw, said):
    """Empty, foreign, or without the topics: one line."""
    with pytest.raises(LogError, match=said) as error:
        write([raw])
    assert "\n" not in str(error.value)


def test_topic_without_a_field_is_refused_by_its_name(logged, write):
    """A version of a topic that we do not know: what is missing, and what is there."""
    topics = TODAY | {"airspeed": "uint64_t timestamp;float speed;"}
    told = [(t, n, i, v[:2] if n == "airspeed" else v) for t, n, i, v in messages(logged, "vehicle_imu")]
    with pytest.raises(LogError, match="airspeed has no field true_airspeed_m_s; it has timestamp, speed"):
        write(ulog(told, topics))


def test_missing_package_is_told_with_what_installs_it(logged, write, monkeypatch):
    """One line that can be pasted."""
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(LogError, match=r'logs of PX4 need pyulog: pip install "wingslevel\[logs\]"'):
        write(ulog([]))


def test_replay_of_the_file_scores_as_the_flight_itself(logged, write, tmp_path, monkeypatch, capfd):
    """Through the command line: the scores are those of the rows that were written, to the resolution of the log."""
    monkeypatch.chdir(tmp_path)
    write(ulog(messages(logged)))
    capfd.readouterr()
    assert run(["replay", "flight.ulg", "--estimator", "premerlani", "--no-rerun", "--json", "-"]) == 0
    data = json.loads(capfd.readouterr().out)
    flown = replace(logged.log(), rows=expected_of(logged, 0.0))
    expected = replay(flown, "premerlani", {"elevation_m": 488.0}).scores
    for name in ("inclination_rms_deg", "heading_rms_deg", "rotation_max_deg"):
        assert data[name] == pytest.approx(expected[name], rel=0, abs=1e-3)
    assert (data["rows"], data["reference_kind"]) == (1000, "truth")
    assert run(["replay", "flight.ulg", "--imu", "1", "--no-rerun", "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["rotation_rms_deg"] > 2.0 * data["rotation_rms_deg"]


def test_attitude_without_a_number_is_one_that_cannot_be_judged(logged, write):
    """The log has one: all of it is in the ledger, and the reason is said; it is not as if there had been none."""
    told = [
        (t, n, i, (*v[:2], *4 * [np.nan]) if "attitude" in n else v) for t, n, i, v in messages(logged)
    ]  # fmt: skip
    log = write(ulog(told))
    entry = log.ledger["reference"]
    assert (entry.read, entry.used, entry.left_out) == (len(logged.t_us), 0, {"no attitude": len(logged.t_us)})
    said = f"vehicle_attitude_groundtruth in flight.ulg: no attitude can be used: {len(logged.t_us)} no attitude"
    assert why_none(log, Window()) == said


def test_topic_whose_definition_lost_its_time_is_refused_by_name(logged, write):
    """One damaged byte in the header: nothing behind it can be placed."""
    records = ulog(messages(logged))
    head = records[0].replace(b"vehicle_magnetometer:uint64_t timestamp;", b"vehicle_magnetometer:uint64_t timestamq;")
    assert head != records[0]
    with pytest.raises(LogError, match=r"the definition of topic vehicle_magnetometer has no timestamp: it is damaged"):
        write([head, *records[1:]])


def test_fix_with_a_signalling_nan_is_one_without_a_number(logged, write):
    """As damaged bytes make it: no warning of the arithmetic, and the fix is in the ledger."""
    records = ulog(messages(logged))
    signalling = struct.pack("<I", 0x7F800001)
    k = next(i for i, r in enumerate(records) if i and len(r) == FIX_BYTES)
    north = FIX_BYTES - 2 - 5 * 4 + 4  # behind the speed: vel_n, vel_e, vel_d, course, then two bytes
    records[k] = records[k][:north] + signalling + records[k][north + 4 :]
    entry = write(records).ledger["gps"]
    assert (entry.read, entry.left_out) == (len(logged.fix_us), {"without a number": 1})
