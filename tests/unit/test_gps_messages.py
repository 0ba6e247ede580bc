"""GPS fixes as messages: what is written comes back, and both libraries and plain byte layouts agree on it.

Bounds are half a unit of the last digit that a format carries.
"""

import io
import struct
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pynmeagps import NMEAReader
from pyubx2 import UBX_PROTOCOL, UBXReader

from estimator.interface import MEASURED_DTYPE
from sim import gps_messages
from sim.gps_messages import LAUNCH, START, Accuracy, Fixes, Place, decode_nmea, decode_ubx, encode_nmea, encode_ubx
from sim.place import LATITUDE_DEG, LONGITUDE_DEG, YEAR

KNOT_M_S = 1852 / 3600
MINUTE = 1e-7  # unit of an NMEA minute
M_PER_DEG = 111_700.0  # of latitude at the pole, where a degree is longest; of longitude at most 111 320 m
READ_DEG = 0.5e-10  # pynmeagps rounds degrees to ten digits
FLOAT_M = 1e-7  # earth-centred coordinates are 6e6 m long, and pymap3d goes through them and back
ROUND_TRIP = settings(max_examples=settings.default.max_examples * 3 // 5)


def fixes_of(t_s, p_e_m, v_e_m_s, accuracy: Accuracy = Accuracy(2.1, 2.5, 0.1)) -> Fixes:  # noqa: B008
    """Fixes through the log, as the simulated receiver leaves them."""
    rows = np.zeros(len(t_s), MEASURED_DTYPE)
    rows["gps_new"] = rows["gps_valid"] = 1
    rows["gps_t_s"], rows["t_s"] = t_s, np.asarray(t_s) + 0.3
    rows["gps_p_e_m"], rows["gps_v_e_m_s"] = p_e_m, v_e_m_s
    v = rows["gps_v_e_m_s"]
    rows["gps_course_rad"] = np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi)
    rows["gps_speed_m_s"] = np.hypot(v[:, 0], v[:, 1])
    return Fixes.from_log(rows, accuracy)


def one(t_s: float = 1.0, p_e_m=(10.0, -20.0, -30.0), v_e_m_s=(3.0, 4.0, -1.0)) -> Fixes:
    """A single fix."""
    return fixes_of([t_s], [p_e_m], [v_e_m_s])


def degrees(p_e_m, place: Place):
    """Latitude, longitude and height by the radii of curvature at the origin: an ellipsoid in its textbook form."""
    a, b, phi = 6378137.0, 6356752.314245, np.radians(place.latitude_deg)
    root = np.hypot(a * np.cos(phi), b * np.sin(phi))
    meridian_m, normal_m = (a * b) ** 2 / root**3 + place.height_m, a**2 / root + place.height_m
    north, east, down = p_e_m.T
    latitude_deg = place.latitude_deg + np.degrees(north / meridian_m)
    return latitude_deg, place.longitude_deg + np.degrees(east / (normal_m * np.cos(phi))), place.height_m - down


@st.composite
def flights(draw) -> tuple[Fixes, Place, datetime]:
    """Fixes at whole milliseconds, within 5 km of any place off the poles, at any time that both formats can say."""
    times = draw(st.lists(st.integers(0, 200_000_000), min_size=1, max_size=5, unique=True).map(sorted))
    n = len(times)

    def vectors(*axes):
        return draw(st.lists(st.tuples(*(st.floats(a, b) for a, b in axes)), min_size=n, max_size=n))

    place = Place(draw(st.floats(-80, 80)), draw(st.floats(-180, 180)), draw(st.floats(-400, 4000)))
    start = datetime(2000, 1, 1, tzinfo=UTC) + timedelta(milliseconds=draw(st.integers(0, 60 * 365 * 86_400_000)))
    p, v = vectors((-5e3, 5e3), (-5e3, 5e3), (-5e3, 500)), vectors((-300, 300), (-300, 300), (-100, 100))
    return fixes_of(np.array(times) / 1000, p, v), place, start


def circular(a, b):
    """Angle between two directions, rad."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def sentence(content: str) -> bytes:
    """`content` between $ and *, with the checksum as the standard says: exclusive or of all characters."""
    return f"${content}*{reduce(xor, content.encode()):02X}\r\n".encode()


def gga(clock: str, lat: str = "4807.038,N", quality: str = "1", talker: str = "GP", height: str = "545.4") -> bytes:
    """A GGA as other receivers write it."""
    return sentence(f"{talker}GGA,{clock},{lat},01131.000,E,{quality},08,0.9,{height},M,46.9,M,,")


def rmc(clock: str, date: str = "230394", motion: str = "022.4,084.4", status: str = "A", talker: str = "GP") -> bytes:
    """An RMC as other receivers write it, magnetic variation included."""
    return sentence(f"{talker}RMC,{clock},{status},4807.038,N,01131.000,E,{motion},{date},003.1,W")


# --- written and read back


@ROUND_TRIP
@given(flights())
def test_nmea_round_trip_is_exact_to_its_resolution(flight) -> None:
    """Every field comes back within half a unit of its last digit, stamps exactly; vertical velocity does not."""
    fixes, place, start = flight
    reading = decode_nmea(encode_nmea(fixes, place, start), place, start)
    back = reading.fixes
    assert not reading.problems
    np.testing.assert_array_equal(back.t_s, fixes.t_s)
    half_m = (0.5 * MINUTE / 60 + READ_DEG) * M_PER_DEG + FLOAT_M
    # The vertical 7 km away leans by 1.1e-3: that share of an error along one axis shows in another.
    assert (np.abs(back.p_e_m - fixes.p_e_m) <= np.array([half_m, half_m, 0.5e-3 + FLOAT_M]) * 1.01).all()
    half_kn = 0.5e-3 * KNOT_M_S
    np.testing.assert_allclose(back.speed_m_s, fixes.speed_m_s, rtol=0, atol=half_kn + 1e-12)
    half_rad = np.radians(0.5e-3) + 1e-12
    assert circular(back.course_rad, fixes.course_rad).max() <= half_rad
    across = np.abs(back.v_e_m_s[:, :2] - fixes.v_e_m_s[:, :2])
    assert (across <= (half_kn + half_rad * fixes.speed_m_s + 1e-9)[:, None]).all()
    assert np.isnan(back.v_e_m_s[:, 2]).all()
    assert np.isnan([back.horizontal_acc_m, back.vertical_acc_m, back.speed_acc_m_s, back.course_acc_rad]).all()
    assert np.isnan(back.arrival_s).all()
    np.testing.assert_array_equal(back.satellites, fixes.satellites)


@ROUND_TRIP
@given(flights())
def test_ubx_round_trip_is_exact_to_its_resolution(flight) -> None:
    """Every field comes back within half a unit of its last digit, stamps exactly."""
    fixes, place, start = flight
    reading = decode_ubx(encode_ubx(fixes, place, start), place, start)
    back = reading.fixes
    assert not reading.problems
    np.testing.assert_array_equal(back.t_s, fixes.t_s)
    half_m = 0.5e-7 * M_PER_DEG + FLOAT_M
    lean = np.array([0.0, 0.0, 1.5e-3 * half_m])  # the vertical 7 km away leans by 1.1e-3
    assert (np.abs(back.p_e_m - fixes.p_e_m) <= np.array([half_m, half_m, 0.5e-3 + FLOAT_M]) * 1.01 + lean).all()
    half = 0.5e-3 + 1e-12
    np.testing.assert_allclose(back.v_e_m_s, fixes.v_e_m_s, rtol=0, atol=half)
    np.testing.assert_allclose(back.speed_m_s, fixes.speed_m_s, rtol=0, atol=half)
    assert circular(back.course_rad, fixes.course_rad).max() <= np.radians(0.5e-5) + 1e-12
    for name in ("horizontal_acc_m", "vertical_acc_m", "speed_acc_m_s"):
        np.testing.assert_allclose(getattr(back, name), getattr(fixes, name), rtol=0, atol=half)
    np.testing.assert_allclose(back.course_acc_rad, fixes.course_acc_rad, rtol=0, atol=np.radians(0.5e-5) + 1e-12)
    np.testing.assert_array_equal(back.satellites, fixes.satellites)


@ROUND_TRIP
@given(flights())
def test_what_was_read_is_written_as_the_same_bytes(flight) -> None:
    """Rounding happens once: reading and writing again changes no byte of either format."""
    for encode, decode in ((encode_nmea, decode_nmea), (encode_ubx, decode_ubx)):
        data = encode(*flight)
        assert encode(decode(data, *flight[1:]).fixes, *flight[1:]) == data


@ROUND_TRIP
@given(flights())
def test_nmea_read_by_pynmeagps_says_what_was_written(flight) -> None:
    """The library's own reader finds three sentences a fix, each at its place and time, none over 82 characters."""
    fixes, place, start = flight
    data = encode_nmea(fixes, place, start)
    assert max(map(len, data.splitlines(keepends=True))) <= 82
    found = [m for _, m in NMEAReader(io.BytesIO(data), nmeaonly=True, quitonerror=2)]
    assert [m.identity for m in found] == ["GNGGA", "GNRMC", "GNVTG"] * len(fixes)
    latitude_deg, longitude_deg, height_m = degrees(fixes.p_e_m, place)
    for i in range(len(fixes)):
        g, r, v = found[3 * i : 3 * i + 3]
        utc = start + timedelta(milliseconds=round(fixes.t_s[i] * 1000))
        assert (g.time, r.time, r.date) == (utc.time(), utc.time(), utc.date())
        for m in (g, r):
            assert abs(m.lat - latitude_deg[i]) <= 0.5 * MINUTE / 60 + READ_DEG + 1e-12
            assert circular(np.radians(m.lon), np.radians(longitude_deg[i])) <= np.radians(
                0.51 * MINUTE / 60 + READ_DEG
            )
        assert abs(g.alt - height_m[i]) <= 0.5e-3 + 1e-9
        assert (g.quality, g.sep, r.status) == (1, 0.0, "A")
        assert (r.spd, r.cog) == (v.sogn, v.cogt)
        assert 0.0 <= r.cog < 360.0
        assert v.sogk == pytest.approx(1.852 * v.sogn, rel=0, abs=0.5e-3 + 1e-9)


@ROUND_TRIP
@given(flights())
def test_ubx_by_the_byte_layout_says_what_was_written(flight) -> None:
    """Plain struct at the offsets of the protocol specification finds the numbers, and Fletcher's sum holds."""
    fixes, place, start = flight
    data = encode_ubx(fixes, place, start)
    latitude_deg, longitude_deg, height_m = degrees(fixes.p_e_m, place)
    assert len(data) == 100 * len(fixes)
    for i in range(len(fixes)):
        frame = data[100 * i : 100 * (i + 1)]
        assert frame[:6] == b"\xb5\x62\x01\x07\x5c\x00"
        a = b = 0
        for byte in frame[2:-2]:
            a = (a + byte) & 0xFF
            b = (b + a) & 0xFF
        assert frame[-2:] == bytes((a, b))
        p = frame[6:-2]
        year, month, day, hour, minute, second, valid = struct.unpack_from("<HBBBBBB", p, 4)
        utc = start + timedelta(milliseconds=round(fixes.t_s[i] * 1000))
        (nano,) = struct.unpack_from("<i", p, 16)
        assert -5_000_000 <= nano < 995_000_000
        assert datetime(year, month, day, hour, minute, second, tzinfo=UTC) + timedelta(microseconds=nano / 1000) == utc
        assert (valid & 0x07, p[20], p[21] & 0x01, p[23]) == (0x07, 3, 1, 12)
        lon, lat, height, msl, h_acc, v_acc = struct.unpack_from("<iiiiII", p, 24)
        assert abs(lat * 1e-7 - latitude_deg[i]) <= 0.5e-7 + 1e-12
        assert circular(np.radians(lon * 1e-7), np.radians(longitude_deg[i])) <= np.radians(0.5e-7) + 1e-14
        assert abs(height - 1000 * height_m[i]) <= 0.5 + 1e-5
        assert (msl, h_acc, v_acc) == (height, 2100, 2500)
        *v_mm_s, speed, course, s_acc, course_acc = struct.unpack_from("<iiiiiII", p, 48)
        assert np.abs(v_mm_s - 1000 * fixes.v_e_m_s[i]).max() <= 0.5 + 1e-9
        assert abs(speed - 1000 * fixes.speed_m_s[i]) <= 0.5 + 1e-9
        assert 0 <= course < 36_000_000
        assert s_acc == 100
        assert abs(course_acc - 1e5 * np.degrees(np.arctan2(0.1, fixes.speed_m_s[i]))) <= 0.5 + 1e-6


def test_nmea_of_a_known_fix_is_the_text_of_the_standard() -> None:
    """The fix of the textbook sentence: 48 deg 7.038 min N, 11 deg 31 min E, 545.4 m, 22.4 kn towards 84.4 deg."""
    place = Place(48 + 7.038 / 60, 11 + 31 / 60, 545.4)
    course = np.radians(84.4)
    speed = 22.4 * KNOT_M_S
    fix = one(0.0, (0.0, 0.0, 0.0), (speed * np.cos(course), speed * np.sin(course), 0.0))
    assert encode_nmea(fix, place, datetime(1994, 3, 23, 12, 35, 19, tzinfo=UTC), talker="GP") == (
        sentence("GPGGA,123519.000,4807.0380000,N,01131.0000000,E,1,12,,545.400,M,0.000,M,,")
        + sentence("GPRMC,123519.000,A,4807.0380000,N,01131.0000000,E,22.400,84.400,230394,,,A")
        + sentence("GPVTG,84.400,T,,M,22.400,N,41.485,K,A")
    )


def test_checksum_of_the_textbook_sentence() -> None:
    """The judge of checksums used here, against the two sentences that every description of NMEA 0183 shows."""
    assert gga("123519").endswith(b"*47\r\n")
    assert rmc("123519").endswith(b"*6A\r\n")


@pytest.mark.parametrize(
    ("angle_deg", "text"),
    [
        (43 - 1e-10, b"4300.0000000,N"),
        (-1e-10, b"0000.0000000,N"),
        (-0.5, b"0030.0000000,S"),
    ],
)
def test_nmea_minutes_never_round_up_to_sixty(angle_deg: float, text: bytes) -> None:
    """A hair below a whole degree is that degree; there is no southern zero."""
    assert text in encode_nmea(one(p_e_m=(0.0, 0.0, 0.0)), Place(angle_deg, 10.0, 0.0))


def test_course_just_below_north_is_zero_not_360() -> None:
    """359.9999 degrees and more rounds to north in both formats."""
    fix = one(v_e_m_s=(100.0, -1e-7, 0.0))
    assert b",0.000,020726," in encode_nmea(fix)
    assert decode_ubx(encode_ubx(fix)).fixes.course_rad[0] == 0.0


# --- time


@pytest.mark.parametrize(
    ("start", "t_s", "expected"),
    [
        # The two examples of the specification, section "UTC representation".
        ((2024, 3, 5, 12, 49, 23), 0.521, (2024, 3, 5, 12, 49, 23, 521_000_000)),
        ((2011, 12, 31, 23, 59, 59), 0.9993, (2012, 1, 1, 0, 0, 0, -700_000)),
        ((2024, 3, 5, 12, 49, 23), 0.005, (2024, 3, 5, 12, 49, 23, 5_000_000)),
        ((2024, 3, 5, 12, 49, 23), 0.994999999, (2024, 3, 5, 12, 49, 23, 994_999_999)),
        ((2024, 3, 5, 12, 49, 23), 0.995, (2024, 3, 5, 12, 49, 24, -5_000_000)),
    ],
)
def test_ubx_utc_is_rounded_to_hundredths_and_nano_is_the_rest(start, t_s: float, expected) -> None:
    """Date and time as the receiver rounds them; the exact time comes back from both together."""
    data = encode_ubx(one(t_s), start=datetime(*start, tzinfo=UTC))
    m = UBXReader.parse(data)
    assert (m.year, m.month, m.day, m.hour, m.min, m.second, m.nano) == expected
    assert decode_ubx(data, start=datetime(*start, tzinfo=UTC)).fixes.t_s[0] == t_s


@pytest.mark.parametrize(
    ("utc", "itow_ms"),
    [
        # 1 June 2025 is a Sunday; GPS is ahead of UTC by 18 s since 2017, by 17 s before, by 13 s until 2006.
        (datetime(2025, 6, 1, 12, tzinfo=UTC), (12 * 3600 + 18) * 1000),
        (datetime(2025, 5, 31, 23, 59, 50, tzinfo=UTC), 8_000),
        (datetime(2016, 12, 31, 23, 0, tzinfo=UTC), (6 * 86_400 + 23 * 3600 + 17) * 1000),
        (datetime(2005, 12, 31, 12, 0, tzinfo=UTC), (6 * 86_400 + 12 * 3600 + 13) * 1000),
    ],
)
def test_ubx_time_of_week_counts_leap_seconds(utc: datetime, itow_ms: int) -> None:
    """The GPS time of week by hand, across the end of a week and before leap seconds."""
    assert struct.unpack_from("<I", encode_ubx(one(0.0), start=utc), 6) == (itow_ms,)


@pytest.mark.parametrize("talker", ["GN", "GP", "GL"])
def test_nmea_day_turns_over_at_midnight(talker: str) -> None:
    """Fixes on both sides of New Year are 0.25 s apart, whoever speaks."""
    start = datetime(2024, 12, 31, 23, 59, 59, 500_000, tzinfo=UTC)
    times = [0.0, 0.25, 0.5, 0.75]
    data = encode_nmea(fixes_of(times, np.zeros((4, 3)), np.ones((4, 3))), start=start, talker=talker)
    assert b",311224," in data
    assert b",010125," in data
    reading = decode_nmea(data)
    assert (reading.start, reading.fixes.t_s.tolist()) == (start, times)


def test_nmea_without_any_date_turns_over_by_the_clock() -> None:
    """GGA alone says no date: it is that of the start, and a clock that falls by half a day passed midnight."""
    start = datetime(2025, 2, 28, 23, 59, tzinfo=UTC)
    reading = decode_nmea(gga("235959") + gga("000001") + gga("120000"), start=start)
    assert reading.fixes.t_s.tolist() == [59.0, 61.0, 43_260.0]
    assert reading.count("no speed") == 3


def test_nmea_date_that_comes_late_holds_for_what_was_before() -> None:
    """The first RMC dates the GGA before it, on the other side of midnight."""
    reading = decode_nmea(gga("235959") + gga("000000") + rmc("000000", date="010325"))
    assert reading.start == datetime(2025, 2, 28, 23, 59, 59, tzinfo=UTC)
    assert reading.fixes.t_s.tolist() == [0.0, 1.0]


@pytest.mark.parametrize("encode", [encode_nmea, encode_ubx])
@pytest.mark.parametrize(
    ("start", "t_s", "message"),
    [
        (datetime(2025, 6, 1, 12), 1.0, "add a time zone"),
        (datetime(1979, 6, 1, tzinfo=UTC), 1.0, "6 January 1980"),
        (datetime(2068, 12, 31, 23, 59, 59, tzinfo=UTC), 1.0, "2068"),
        (START, 1e12, "2068"),
    ],
)
def test_start_that_no_message_can_say_is_refused(encode, start: datetime, t_s: float, message: str) -> None:
    """A start without a zone, before GPS, or past two-digit years is one clear line."""
    with pytest.raises(ValueError, match=message):
        encode(one(t_s), start=start)


# --- what is not known


def test_fix_without_a_time_of_its_own_has_that_of_its_arrival() -> None:
    """A recorded log does not say when its fixes were true: they are written all the same."""
    rows = np.zeros(2, MEASURED_DTYPE)
    rows["gps_new"], rows["t_s"], rows["gps_t_s"] = 1, [5.0, 6.0], [np.nan, 5.7]
    np.testing.assert_array_equal(Fixes.from_log(rows).t_s, [5.0, 5.7])


@pytest.mark.parametrize("column", ["p_e_m", "t_s"])
def test_fix_that_is_not_finite_is_a_message_without_a_fix(column: str) -> None:
    """A receiver that reports NaN says that it has no fix; the others come back."""
    fixes = fixes_of([1.0, 2.0, 3.0], np.zeros((3, 3)), np.ones((3, 3)))
    getattr(fixes, column)[1] = np.nan
    for encode, decode in ((encode_nmea, decode_nmea), (encode_ubx, decode_ubx)):
        reading = decode(encode(fixes), LAUNCH, START)
        assert reading.fixes.t_s.tolist() == [1.0, 3.0]
        assert {problem.kind for problem in reading.problems} == {"no fix" if column == "p_e_m" else "no time"}


def test_nmea_leaves_out_a_motion_that_is_not_known_and_ubx_the_fix() -> None:
    """NMEA has empty fields for it; NAV-PVT has none, and a number would be invented."""
    fixes = fixes_of([1.0, 2.0], np.zeros((2, 3)), np.ones((2, 3)))
    fixes.speed_m_s[0] = np.nan
    reading = decode_nmea(encode_nmea(fixes), LAUNCH, START)
    assert reading.fixes.t_s.tolist() == [1.0, 2.0]
    assert np.isnan(reading.fixes.v_e_m_s[0]).all()
    assert reading.count("no speed") == 1
    reading = decode_ubx(encode_ubx(fixes), LAUNCH, START)
    assert reading.fixes.t_s.tolist() == [2.0]
    assert reading.count("no fix") == 1


def test_height_that_is_not_known_is_an_empty_field_and_comes_back_unknown() -> None:
    """A file of RMC alone can be written again: NMEA without a height, and NAV-PVT without a fix."""
    fixes = decode_nmea(rmc("120000"), place=Place(48.0, 11.5, 500.0)).fixes
    back = decode_nmea(encode_nmea(fixes, Place(48.0, 11.5, 500.0)), Place(48.0, 11.5, 500.0))
    assert back.count("no height") == 1
    # Written at the level of the place and read at its height, 13 m apart at 13 km: 13 m / 6.4e6 m of 13 km is 27 mm.
    np.testing.assert_allclose(back.fixes.p_e_m[0, :2], fixes.p_e_m[0, :2], rtol=0, atol=0.03)
    assert np.isnan(back.fixes.p_e_m[0, 2])
    with pytest.raises(ValueError, match=r"found: no fix 1"):
        decode_ubx(encode_ubx(fixes))


@pytest.mark.parametrize("place", [Place(91.0, 0.0, 0.0), Place(0.0, -181.0, 0.0), Place(0.0, 0.0, np.nan)])
def test_place_that_does_not_exist_is_refused(place: Place) -> None:
    """Writing and reading alike."""
    for call in (lambda: encode_nmea(one(), place), lambda: encode_ubx(one(), place), lambda: decode_ubx(FIRST, place)):
        with pytest.raises(ValueError, match=r"latitude must be -90..90 deg"):
            call()


def test_talker_that_no_receiver_is_is_refused() -> None:
    """Two capital letters, or the sentences would not be read again."""
    with pytest.raises(ValueError, match="talker 'gps': must be two capital letters"):
        encode_nmea(one(), talker="gps")


def test_unknown_accuracy_comes_back_unknown() -> None:
    """NaN is the largest number of the field, not a number that a reader would trust."""
    fixes = fixes_of([1.0], [[0.0, 0.0, 0.0]], [[1.0, 2.0, 3.0]], Accuracy())
    back = decode_ubx(encode_ubx(fixes)).fixes
    assert np.isnan([back.horizontal_acc_m, back.vertical_acc_m, back.speed_acc_m_s, back.course_acc_rad]).all()


def test_velocity_beyond_the_field_is_refused() -> None:
    """3000 km/s does not fit a NAV-PVT message: one line says which fix."""
    with pytest.raises(ValueError, match="fix 0 does not fit"):
        encode_ubx(one(v_e_m_s=(3e6, 0.0, 0.0)))


def test_log_gives_the_fixes_that_arrived() -> None:
    """Rows without a new fix are left out; the time of arrival is the tick's, not the receiver's."""
    rows = np.zeros(6, MEASURED_DTYPE)
    rows["t_s"] = np.arange(1, 7) * 0.02
    rows["gps_new"][[1, 4]] = 1
    rows["gps_t_s"][1:4], rows["gps_t_s"][4:] = 0.01, 0.05
    fixes = Fixes.from_log(rows)
    assert (fixes.t_s.tolist(), fixes.arrival_s.tolist()) == ([0.01, 0.05], [0.04, 0.1])


# --- files of other receivers


def test_nmea_of_another_receiver_is_read() -> None:
    """The textbook sentences among satellites, a comment and a proprietary one, relative to the first fix."""
    data = b"# log of 23 March\n" + sentence("GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1") + sentence("PMTK001,604,3")
    reading = decode_nmea(data + gga("123519") + rmc("123519") + gga("123520", lat="4807.138,N") + rmc("123520"))
    assert (reading.problems, reading.ignored) == ((), 3)
    assert reading.start == datetime(1994, 3, 23, 12, 35, 19, tzinfo=UTC)
    # Above the ellipsoid: altitude and the separation of the geoid.
    np.testing.assert_allclose(reading.place, (48 + 7.038 / 60, 11 + 31 / 60, 545.4 + 46.9), rtol=0, atol=1e-9)
    assert reading.fixes.t_s.tolist() == [0.0, 1.0]
    np.testing.assert_allclose(reading.fixes.p_e_m[0], 0.0, rtol=0, atol=FLOAT_M)
    # A tenth of a minute north, by the meridian's radius of curvature at 48.12 deg, 6 374 720 m, and the height;
    # pynmeagps rounds each end to 1e-10 deg (11 micrometres), the radius is good to 1e-6.
    north_m = np.radians(0.1 / 60) * (6_335_439.327 / (1 - 0.00669438 * np.sin(np.radians(48.118)) ** 2) ** 1.5 + 592.3)
    assert reading.fixes.p_e_m[1, 0] == pytest.approx(north_m, rel=1e-6, abs=3e-5)
    np.testing.assert_allclose(reading.fixes.speed_m_s, 22.4 * KNOT_M_S, rtol=0, atol=1e-12)
    np.testing.assert_allclose(reading.fixes.course_rad, np.radians(84.4), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("data", "kind", "where", "t_s"),
    [
        (gga("120000") + gga("120001").replace(b"4807.038", b"4907.038") + gga("120002"), "checksum", "line 2", [0, 2]),
        (gga("120000") + gga("120001")[:40], "truncated", "line 2", [0]),
        (gga("120000") + gga("120001")[:-6], "truncated", "line 2", [0]),
        (gga("120000") + gga("120001").partition(b"*")[0] + b"\r\n" + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + gga("120001", lat="9907.038,N") + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + gga("120001", lat="4807.038,X") + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + gga("120001", quality="x") + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + sentence("GPRMC,120001,A") + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + gga("") + gga("120002"), "no time", "line 2", [0, 2]),
        (gga("120000") + gga("126001") + gga("120002"), "no time", "line 2", [0, 2]),
        (gga("120000") + gga("120001", quality="0") + gga("120002"), "no fix", "line 2", [0, 2]),
        (gga("120000") + gga("120001") + rmc("120001", status="V"), "no fix", "line 2", [0]),
        (gga("120000") + gga("120001", lat=",") + gga("120002"), "malformed", "line 2", [0, 2]),
        (gga("120000") + gga("120000", talker="GL") + gga("120001"), "repeated", "line 2", [0, 1]),
        (gga("120001") + gga("120002") + gga("120000"), "out of order", "line 3", [0, 1, 2]),
        (gga("120000") + gga("120001", height="nan"), "no height", "line 2", [0, 1]),
        (gga("120000") + gga("120001") + rmc("120001", motion=","), "no speed", "line 2", [0, 1]),
        (gga("120000") + gga("120001") + rmc("120001", motion="3.0,"), "no course", "line 2", [0, 1]),
    ],
)
def test_nmea_that_is_wrong_is_told_with_its_line(data: bytes, kind: str, where: str, t_s: list[int]) -> None:
    """What is dropped, repaired or missing is told by kind and line, and every other fix is kept."""
    reading = decode_nmea(data)
    assert [p for p in reading.problems if (p.kind, p.where) == (kind, where)], reading.problems
    assert reading.fixes.t_s.tolist() == t_s


def test_nmea_velocity_of_vtg_where_rmc_is_missing() -> None:
    """VTG has no time: it belongs to the sentences before it."""
    vtg = sentence("GPVTG,090.0,T,,M,010.0,N,018.5,K")
    reading = decode_nmea(gga("120000") + vtg + gga("120001"))
    np.testing.assert_allclose(reading.fixes.v_e_m_s[0, :2], (0.0, 10 * KNOT_M_S), rtol=0, atol=1e-12)
    assert np.isnan(reading.fixes.v_e_m_s[1]).all()


def test_nmea_course_left_out_at_rest_leaves_the_velocity() -> None:
    """Many receivers say no course while they stand: the velocity is zero all the same."""
    reading = decode_nmea(gga("120000") + rmc("120000", motion="0.0,"))
    assert reading.fixes.v_e_m_s[0, :2].tolist() == [0.0, 0.0]
    assert np.isnan(reading.fixes.course_rad[0])


def test_nmea_rmc_alone_has_no_height_but_a_place() -> None:
    """Without GGA down is not known; north and east are, at the height of the place."""
    reading = decode_nmea(rmc("120000"), place=Place(48.0, 11.0, 500.0))
    there = np.ravel(degrees(np.nan_to_num(reading.fixes.p_e_m), Place(48.0, 11.0, 500.0)))
    np.testing.assert_allclose(there[:2], (48 + 7.038 / 60, 11 + 31 / 60), rtol=0, atol=READ_DEG)
    assert np.isnan(reading.fixes.p_e_m[0, 2])


THREE = fixes_of([1.0, 2.0, 3.0], np.arange(9.0).reshape(3, 3), np.ones((3, 3)))


def pvt(**changed: int) -> bytes:
    """The second of three messages with fields changed, and its checksum made anew; offsets as in the layout."""
    layout = {"year": ("<H", 4), "month": ("<B", 6), "valid": ("<B", 11), "fixType": ("<B", 20), "flags": ("<B", 21)}
    payload = bytearray(encode_ubx(THREE)[106:198])
    for name, value in changed.items():
        form, at = layout[name]
        struct.pack_into(form, payload, at, value)
    return framed(bytes(payload))


def framed(payload: bytes, identity: bytes = b"\x01\x07") -> bytes:
    """A UBX frame around `payload`, by the specification's description of Fletcher's checksum."""
    body = identity + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return b"\xb5b" + body + bytes((a, b))


FIRST, SECOND, THIRD = (encode_ubx(THREE)[i : i + 100] for i in (0, 100, 200))


@pytest.mark.parametrize(
    ("data", "kind", "t_s"),
    [
        (FIRST + SECOND[:50] + b"\x00" + SECOND[51:] + THIRD, "checksum", [1, 3]),
        (FIRST + SECOND[:4] + b"\xff\xff" + SECOND[6:] + THIRD, "checksum", [1, 3]),  # a wrong length
        (FIRST + SECOND[:60] + THIRD, "checksum", [1, 3]),
        (FIRST + SECOND + THIRD[:-1], "truncated", [1, 2]),
        (FIRST + SECOND + THIRD[:3], "truncated", [1, 2]),
        (FIRST + framed(b"\x00" * 40) + THIRD, "malformed", [1, 3]),
        (FIRST + pvt(month=13) + THIRD, "malformed", [1, 3]),
        (FIRST + pvt(valid=0) + THIRD, "no time", [1, 3]),
        (FIRST + pvt(fixType=5) + THIRD, "no fix", [1, 3]),
        (FIRST + pvt(flags=0) + THIRD, "no fix", [1, 3]),
        (FIRST + pvt(fixType=2) + THIRD, "no height", [1, 2, 3]),
        (FIRST + FIRST + THIRD, "repeated", [1, 3]),
        (FIRST + THIRD + SECOND, "out of order", [1, 2, 3]),
    ],
)
def test_ubx_that_is_wrong_is_told_with_its_place(data: bytes, kind: str, t_s: list[int]) -> None:
    """What is dropped, repaired or missing is told by kind and byte, and every other fix is kept."""
    reading = decode_ubx(data, LAUNCH, START)
    assert reading.count(kind) == len(reading.problems) == 1
    assert int(reading.problems[0].where.removeprefix("byte ")) in (100, 200)
    assert reading.fixes.t_s.tolist() == t_s


def test_ubx_among_other_protocols_is_found() -> None:
    """Sentences, RTCM bytes and other UBX messages between are passed over; an old receiver's shorter one is read."""
    short = framed(SECOND[6 : 6 + 84])
    other = framed(b"\x05" * 16, b"\x01\x21")
    data = gga("120000") + FIRST + b"\xd3\x00\x13\xb5" + other + b"$G\xff\xfe" + short + gga("120001") + THIRD
    reading = decode_ubx(data, LAUNCH, START)
    assert (reading.problems, reading.ignored) == ((), 1)
    assert reading.fixes.t_s.tolist() == [1.0, 2.0, 3.0]
    assert [m.identity for _, m in UBXReader(io.BytesIO(FIRST + other + THIRD), protfilter=UBX_PROTOCOL)] == [
        "NAV-PVT", "NAV-TIMEUTC", "NAV-PVT",
    ]  # fmt: skip


@pytest.mark.parametrize(("encode", "decode"), [(encode_nmea, decode_nmea), (encode_ubx, decode_ubx)])
@given(data=st.data())
def test_one_damaged_byte_costs_one_fix_at_most(encode, decode, data) -> None:
    """Both checksums find any single damaged byte, and no other fix suffers."""
    good = encode(THREE)
    at, other = data.draw(st.integers(0, len(good) - 1)), data.draw(st.integers(1, 255))
    reading = decode(good[:at] + bytes((good[at] ^ other,)) + good[at + 1 :], LAUNCH, START)
    whole = decode(good, LAUNCH, START).fixes
    assert len(reading.fixes) >= 2
    equal = 0
    for i, t_s in enumerate(reading.fixes.t_s):
        (j,) = np.flatnonzero(whole.t_s == t_s)
        equal += all(
            np.array_equal(getattr(reading.fixes, f.name)[i], getattr(whole, f.name)[j], True) for f in fields(Fixes)
        )
    assert equal >= 2


@pytest.mark.parametrize("decode", [decode_nmea, decode_ubx])
@settings(max_examples=settings.default.max_examples * 2)
@given(noise=st.lists(st.one_of(st.binary(max_size=40), st.sampled_from([FIRST, FIRST[:30], gga("120000"), rmc("x")]))))
def test_bytes_of_any_kind_are_read_or_refused(decode, noise: list[bytes]) -> None:
    """Nothing in a file makes a reader fail in another way than by its one line."""
    try:
        assert len(decode(b"".join(noise)).fixes) >= 1
    except ValueError as error:
        assert "no GPS fix" in str(error)  # noqa: PT017 - a fix may well be there


@pytest.mark.parametrize("sentences", ["GPGGA,120000,{}", "GPRMC,120000,{}", "GPVTG,{}"])
@settings(max_examples=settings.default.max_examples * 3 // 2)
@given(payload=st.lists(st.sampled_from(["", "1", "-1", "nan", "inf", "A", "N", "E", "4807.038", "1e999", "é", "0"])))
def test_sentence_of_any_fields_is_read_or_refused(sentences: str, payload: list[str]) -> None:
    """A sentence with a good checksum and senseless fields loses no other fix."""
    reading = decode_nmea(gga("115959") + sentence(sentences.format(",".join(payload))))
    assert reading.fixes.t_s[0] == 0.0
    assert np.isfinite(reading.fixes.p_e_m[:, :2]).all()


def test_file_without_a_fix_is_refused_with_what_it_holds(tmp_path) -> None:
    """One line names the file and what was found instead."""
    path = tmp_path / "log.nmea"
    path.write_bytes(gga("120000", quality="0") + gga("120001")[:-3] + b"0\r\n" + sentence("GPGSV,1,1,00"))
    with pytest.raises(
        ValueError, match=r"log.nmea: no GPS fix in it \(found: checksum 1, no fix 1, other messages 1\)"
    ):
        gps_messages.read_nmea(path)
    with pytest.raises(ValueError, match=r"log.nmea: no GPS fix in it: no sentences or messages found"):
        gps_messages.read_ubx(path)
    with pytest.raises(ValueError, match=r"cannot read .*none.ubx: No such file"):
        gps_messages.read_ubx(tmp_path / "none.ubx")


def test_files_are_written_and_read(tmp_path) -> None:
    """Paths in, paths out; what was there is replaced."""
    for write, read in (
        (gps_messages.write_nmea, gps_messages.read_nmea),
        (gps_messages.write_ubx, gps_messages.read_ubx),
    ):
        path = tmp_path / "fixes"
        write(one(), path)
        assert write(THREE, path) == path
        assert read(path, LAUNCH, START).fixes.t_s.tolist() == [1.0, 2.0, 3.0]
    assert [p.name for p in tmp_path.iterdir()] == ["fixes"]


def test_default_origin_is_the_launch_point() -> None:
    """A fix at the origin is where the aeroplane is thrown."""
    reading = decode_ubx(encode_ubx(one(p_e_m=(0.0, 0.0, 0.0))))
    np.testing.assert_allclose(reading.place[:2], (LATITUDE_DEG, LONGITUDE_DEG), rtol=0, atol=0.5e-7)


@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("pynmeagps", lambda: encode_nmea(one())),
        ("pynmeagps", lambda: decode_nmea(gga("120000"))),
        ("pyubx2", lambda: encode_ubx(one())),
        ("pyubx2", lambda: decode_ubx(FIRST)),
    ],
)
def test_missing_package_is_told_with_what_to_install(package: str, call, monkeypatch) -> None:
    """One line says what is missing and how to get it."""
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(ValueError, match=rf'{package} is not installed: pip install "wingslevel\[logs\]"'):
        call()


def test_fixes_are_independent_of_the_log() -> None:
    """Changing a copy changes no log."""
    rows = np.zeros(1, MEASURED_DTYPE)
    rows["gps_new"] = 1
    fixes = Fixes.from_log(rows)
    replace(fixes).p_e_m[:] = 1.0
    assert not rows["gps_p_e_m"].any()


def test_power_comes_up_on_the_date_of_the_magnetic_field() -> None:
    """The middle of 2026 is noon of 2 July, 182.5 of 365 days after new year."""
    assert YEAR == 2026.5
    assert datetime(2026, 7, 2, 12, tzinfo=UTC) == START
