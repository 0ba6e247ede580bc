"""What a log of PX4 says of the instruments aboard: from its parameters and its topics, nothing invented."""

import math
import struct

import numpy as np
import pytest

from estimator.instruments import Known

FLAGS_END = 16 + 3 + 40
OF_2017 = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float gyro_integral_dt;"
    "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;float accelerometer_integral_dt;"
    "int32_t magnetometer_timestamp_relative;float[3] magnetometer_ga;int32_t baro_timestamp_relative;"
    "float baro_alt_meter;float baro_temp_celcius;",
}
NOT_THERE = 0x7FFFFFFF
VALIDATED = {
    "airspeed_validated": "uint64_t timestamp;float true_airspeed_m_s;bool airspeed_sensor_measurement_valid;"
    "int8_t selected_airspeed_index;uint8_t[6] _padding0;"
}
GPS = 2, 3  # places in the fields of vehicle_gps_position: latitude, longitude


@pytest.fixture
def known(logged, px4, read_back):
    """Reads the flight with initial parameters, and messages changed or left out."""

    def _read(parameters=None, change=lambda m: m, more=(), topics=None, without="vehicle_imu", changes=()):
        px4.PACKED.setdefault("int8_t", "b")
        told = [m for m in map(change, px4.messages(logged, without)) if m is not None]
        pieces = px4.ulog([*told, *more], px4.TODAY | (topics or {}))
        initial = b"".join(parameter(px4, name, value) for name, value in (parameters or {}).items())
        pieces[0] = pieces[0][:FLAGS_END] + initial + pieces[0][FLAGS_END:]
        for at, name, value in changes:
            pieces.insert(at, parameter(px4, name, value))
        return read_back(pieces, "flight.ulg")

    return _read


def parameter(px4, name, value):
    """One parameter message."""
    kind, code = ("float", "<f") if isinstance(value, float) else ("int32_t", "<i")
    key = f"{kind} {name}".encode()
    return px4.framed("P", bytes([len(key)]) + key + struct.pack(code, value))


def stamped(stamp_of):
    """Messages whose fixes have another timestamp_sample, from the time of arrival in microseconds."""
    return lambda m: (*m[:3], (m[3][0], stamp_of(m[0]), *m[3][2:])) if m[1] == "vehicle_gps_position" else m


def test_fix_is_true_at_its_time_of_sampling(logged, known):
    """110 ms before its arrival in this log."""
    log = known()
    held = log.rows["gps_valid"] > 0
    np.testing.assert_allclose(log.rows["gps_t_s"][held][0], logged.fix_us[0] / 1e6 - 0.11, rtol=0, atol=1e-9)
    assert log.known["gps_stamped"] == Known(True, "log", "vehicle_gps_position")


@pytest.mark.parametrize(
    "stamp_of",
    [lambda t: 0, lambda t: t, lambda t: t - 2000, lambda t: t + 50_000, lambda t: t - 10_000_000],
    ids=["zero", "arrival", "just before", "after", "ten seconds"],
)
def test_fix_without_a_time_of_sampling_has_no_stamp(known, stamp_of):
    """0 is none, and neither is what no fix can have: drivers that do not know it fill in the time of arrival."""
    log = known(change=stamped(stamp_of))
    held = log.rows["gps_valid"] > 0
    assert held.any()
    assert np.isnan(log.rows["gps_t_s"][held]).all()
    assert log.known["gps_stamped"].value is False


def test_single_fixes_without_a_stamp_do_not_cost_the_others_theirs(logged, known):
    """The one has none, the property holds for the log."""
    log = known(change=stamped(lambda t: 0 if t == logged.fix_us[20] else t - 110_000))
    assert np.count_nonzero(np.isnan(log.rows["gps_t_s"][log.rows["gps_new"] > 0])) == 1
    assert log.known["gps_stamped"].value is True


def test_delay_that_px4_assumed_is_known(known):
    """EKF2_GPS_DELAY in milliseconds."""
    found = known({"EKF2_GPS_DELAY": 175.0}).known["gps_latency_s"]
    assert found == Known(pytest.approx(0.175, rel=1e-9), "log", "EKF2_GPS_DELAY")
    assert "gps_latency_s" not in known().known


def test_declination_is_what_ekf2_would_take(known):
    """EKF2_MAG_DECL in degrees; with bit 0 of EKF2_DECL_TYPE that of the place, once there is a fix; else unknown."""
    log = known({"EKF2_DECL_TYPE": 6, "EKF2_MAG_DECL": 12.5})
    assert log.known["declination_rad"] == Known(pytest.approx(math.radians(12.5), rel=1e-6), "log", "EKF2_MAG_DECL")
    of_place = known({"EKF2_DECL_TYPE": 7, "EKF2_MAG_DECL": 12.5}).known["declination_rad"]
    assert math.degrees(of_place.value) == pytest.approx(3.4, rel=0, abs=0.2)  # Zurich in 2025
    assert of_place.origin.startswith("world magnetic model at the first fix, 2025 assumed")
    log = known({"EKF2_DECL_TYPE": 7, "EKF2_MAG_DECL": 12.5}, without="vehicle_imu vehicle_gps_position")
    assert log.known["declination_rad"].origin == "EKF2_MAG_DECL"
    assert "declination_rad" not in known().known


def test_parameter_counts_as_it_was_in_flight(known):
    """Changed at the beginning of the log, and near its end: the latter does not reach back."""
    changes = [(4000, "EKF2_MAG_DECL", 45.0), (3, "EKF2_MAG_DECL", 12.5)]
    log = known({"EKF2_DECL_TYPE": 0, "EKF2_MAG_DECL": 1.0}, changes=changes)
    assert math.degrees(log.known["declination_rad"].value) == pytest.approx(12.5, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "value"), [("SYS_HAS_NUM_ASPD", 0), ("FW_USE_AIRSPD", 0), ("FW_ARSP_MODE", 1), ("CBRK_AIRSPD_CHK", 162128)]
)
def test_airspeed_that_px4_does_not_use_is_not_given(logged, known, name, value):
    """The sensor may be aboard and logged; the ledger says which parameter."""
    log = known({name: value})
    assert log.ledger["airspeed"].left_out == {f"{name} is {value}": len(logged.air_us)}
    assert log.known["use_airspeed"] == Known(False, "log", name)
    assert "airspeed" not in log.sensors
    assert "airspeed" in known({"FW_ARSP_MODE": 0, "CBRK_AIRSPD_CHK": 0, "SYS_HAS_NUM_ASPD": 1}).sensors


@pytest.mark.parametrize(("name", "value"), [("SYS_HAS_MAG", 0), ("EKF2_MAG_TYPE", 5)])
def test_magnetometer_that_px4_does_not_use_is_not_given(logged, known, name, value):
    """There is none, or EKF2 is set to ignore it."""
    log = known({name: value})
    assert log.ledger["magnetometer"].left_out == {f"{name} is {value}": len(logged.field_us)}
    assert log.known["use_magnetometer"] == Known(False, "log", name)
    assert "magnetometer" in known({"SYS_HAS_MAG": 1, "EKF2_MAG_TYPE": 0}).sensors


def test_airspeed_that_nobody_measured_is_not_used(logged, known):
    """airspeed_validated falls back on ground speed less wind: index 0, or a measurement that is not valid."""
    told = []
    for i, (t, v) in enumerate(zip(logged.air_us, logged.airspeed, strict=True)):
        told.append((t, "airspeed_validated", 0, (t, v, i % 4 != 0, 0 if i % 4 == 1 else 1)))
    log = known(more=told, topics=VALIDATED, without="vehicle_imu airspeed")
    n = sum(i % 4 < 2 for i in range(len(logged.air_us)))
    assert log.ledger["airspeed"].left_out == {"not measured: from ground speed and wind": n}
    assert log.ledger["airspeed"].used == len(logged.air_us) - n


def test_airspeed_without_confidence_is_not_used(logged, known):
    """0 is a sensor that failed; a log in which it is always 0 does not fill it in."""
    topics = {"airspeed": "uint64_t timestamp;float indicated_airspeed_m_s;float true_airspeed_m_s;float confidence;"}
    sick = logged.air_us[20:60]
    log = known(change=lambda m: m if m[1] != "airspeed" else (*m[:3], (*m[3], float(m[0] not in sick))), topics=topics)
    assert log.ledger["airspeed"].left_out == {"unhealthy": 40}
    log = known(change=lambda m: m if m[1] != "airspeed" else (*m[:3], (*m[3], 0.0)), topics=topics)
    assert log.ledger["airspeed"].left_out == {}


def test_vertical_velocity_without_a_number_is_not_reported(known):
    """The fixes count, level."""
    log = known(change=lambda m: (*m[:3], (*m[3][:8], np.nan, *m[3][9:])) if m[1] == "vehicle_gps_position" else m)
    assert log.known["gps_vertical_velocity"] == Known(False, "log", "vehicle_gps_position.vel_d_m_s")
    assert not log.rows["gps_v_e_m_s"][:, 2].any()
    assert log.rows["gps_new"].sum() > 90


def test_magnetometer_and_barometer_of_2017_are_read(logged, px4, read_back):
    """Inside sensor_combined, repeated until the next; each in the tick of its own time, none where it says so."""
    fields = dict(zip(np.searchsorted(logged.t_us, logged.field_us), range(len(logged.field_us)), strict=True))
    airs = dict(zip(np.searchsorted(logged.t_us, logged.air_us), range(len(logged.air_us)), strict=True))
    told, i, j = [], -1, -1
    for k, (t, w, f) in enumerate(zip(logged.t_us, logged.rate, logged.force, strict=True)):
        i, j = fields.get(k, i), airs.get(k, j)
        mag = (NOT_THERE, 0.0, 0.0, 0.0) if i < 0 else (logged.field_us[i] - t, *(logged.field[i] / 100.0))
        baro = (NOT_THERE, 0.0) if j < 0 else (logged.air_us[j] - t, 488.0 + logged.height[j])
        told.append((t, "sensor_combined", 0, (t, *w, 0.02, 0, *f, 0.02, *mag, *baro, 20.0)))
    log = read_back(px4.ulog(told, OF_2017), "flight.ulg")
    expected = logged.expected()
    np.testing.assert_array_equal(log.rows["mag_new"], expected["mag_new"])
    np.testing.assert_allclose(log.rows["mag_b_ut"], expected["mag_b_ut"], rtol=0, atol=4e-6)
    above = expected["baro_height_m"] - logged.height[0]
    np.testing.assert_allclose(log.rows["baro_height_m"], above, rtol=0, atol=7e-5)
    for stream, n in (("magnetometer", len(logged.field_us)), ("barometer", len(logged.air_us))):
        assert (log.ledger[stream].read, log.ledger[stream].used) == (n, n)
    assert log.sensors == ("gyro", "accelerometer", "magnetometer")
    assert log.repairs == ()
