"""What a log of ArduPilot says of the instruments aboard: from its parameters and its messages, nothing invented."""

import math
import warnings

import numpy as np
import pytest

from estimator.instruments import Known

PARM = {"PARM": ("QNf", "TimeUS,Name,Value", "s--", "F--")}
GPA = {"GPA": ("QBCCCCfBIH", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta", "s#-mmnd-ss", "F-0BBB0-CC")}


@pytest.fixture
def known(logged, dataflash, read_back):
    """Reads the flight with parameters, name -> value or a list of (time in us, name, value), and more messages."""

    def _read(parameters=(), formats=None, more=(), change=lambda m: m, without=""):
        listed = [(0, n, v) for n, v in parameters.items()] if isinstance(parameters, dict) else parameters
        told = [change(m) for m in dataflash.messages(logged, without)]
        told = [m for m in told if m is not None]
        told += [(t, "PARM", (t, name.encode(), value)) for t, name, value in listed]
        writer = dataflash.Writer(dataflash.TODAY | PARM | GPA | (formats or {}))
        return read_back(writer.log([*told, *more]), "flight.bin")

    return _read


def test_fix_has_no_stamp_even_where_the_time_of_arrival_is_logged(logged, known):
    """TimeUS is when it was logged, and GPA.SMS when it arrived: neither says when the fix was true."""
    arrived = [(t, "GPA", (t, 0, 1.5, 0.9, 1.4, 0.2, 0.0, 1, (t - 7000) // 1000, 200)) for t in logged.fix_us]
    log = known(more=arrived)
    held = log.rows["gps_valid"] > 0
    assert held.any()
    assert np.isnan(log.rows["gps_t_s"][held]).all()
    assert log.known["gps_stamped"] == Known(False, "log", "GPS")


def test_rates_are_those_of_the_log(known):
    """Medians: 50 samples and 5 fixes a second."""
    log = known()
    assert log.known["imu_rate_hz"].value == pytest.approx(50.0, rel=1e-6)
    assert log.known["gps_rate_hz"].value == pytest.approx(5.0, rel=1e-6)


def test_declination_that_was_set_is_taken(known):
    """COMPASS_AUTODEC 0: the parameter in radians, positive east."""
    log = known({"COMPASS_AUTODEC": 0, "COMPASS_DEC": -0.1875})
    assert log.known["declination_rad"] == Known(-0.1875, "log", "COMPASS_DEC")


def test_declination_by_the_firmwares_default_is_said_to_be_so(known):
    """Neither in the log: COMPASS_AUTODEC is 1; COMPASS_DEC, where that is 0, is 0."""
    assert known().known["declination_rad"].origin.endswith("2022.2; COMPASS_AUTODEC is 1 by default")
    found = known({"COMPASS_AUTODEC": 0}).known["declination_rad"]
    assert found == Known(0.0, "log", "COMPASS_AUTODEC is 0, COMPASS_DEC is not logged: 0 by default")


@pytest.mark.parametrize("week", [1800, 2200, 2440])
def test_declination_of_itself_is_that_of_the_field_at_the_first_fix(known, week):
    """Against the international reference field of that date, at 47.4 N, 8.5 E; the models differ by 0.1 degrees."""
    import datetime

    import ppigrf

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        date = datetime.datetime(1980, 1, 6) + datetime.timedelta(weeks=week)
        east, north, _ = ppigrf.igrf(8.5, 47.4, 0.488, date)
    log = known(
        {"COMPASS_AUTODEC": 1, "COMPASS_DEC": 0.7},
        change=lambda m: m if m[1] != "GPS" else (m[0], "GPS", (*m[2][:4], week, *m[2][5:])),
    )
    expected_deg = math.degrees(math.atan2(float(east.squeeze()), float(north.squeeze())))
    assert math.degrees(log.known["declination_rad"].value) == pytest.approx(expected_deg, rel=0, abs=0.1)
    assert log.known["declination_rad"].origin.startswith("world magnetic model at the first fix, 20")


def test_declination_of_a_log_without_a_date_says_which_is_assumed(known):
    """The week of GPS time is 0 until the receiver knows it."""
    log = known(change=lambda m: m if m[1] != "GPS" else (m[0], "GPS", (*m[2][:4], 0, *m[2][5:])))
    assert "2025 assumed, as the log has no date" in log.known["declination_rad"].origin


def test_declination_without_a_fix_is_what_the_firmware_last_found(known):
    """It keeps it in COMPASS_DEC; without that there is nothing to know."""
    log = known({"COMPASS_AUTODEC": 1, "COMPASS_DEC": 0.0625}, without="GPS")
    assert log.known["declination_rad"] == Known(0.0625, "log", "COMPASS_DEC, without a fix")
    assert "declination_rad" not in known(without="GPS").known


def test_parameter_counts_as_it_was_in_flight(logged, known):
    """Logged again where it changes: what held when the aeroplane first flew; a later change does not reach back."""
    first, flying = int(logged.t_us[0]), int(logged.fix_us[0])
    log = known([(first - 2, "COMPASS_AUTODEC", 0), (first - 1, "COMPASS_DEC", 0.125), (first, "COMPASS_DEC", 0.25),
                 (flying + 1000, "COMPASS_DEC", 0.5)])  # fmt: skip
    assert log.known["declination_rad"].value == 0.25
    late = known(
        [
            (flying + 1000, "COMPASS_AUTODEC", 0),
            (flying + 1001, "COMPASS_DEC", 0.5),
            (flying + 90_000, "COMPASS_DEC", 0.625),
        ]
    )  # fmt: skip - a log that was begun in the air
    assert late.known["declination_rad"].value == 0.5


@pytest.mark.parametrize("name", ["GPS_DELAY_MS", "GPS1_DELAY_MS"])
def test_delay_of_the_receiver_is_known_where_it_is_set(known, name):
    """In milliseconds; 0 is the driver's default, which the log does not hold."""
    assert known({name: 220}).known["gps_latency_s"] == Known(pytest.approx(0.22, rel=1e-9), "log", name)
    assert "gps_latency_s" not in known({name: 0}).known
    assert "gps_latency_s" not in known({"GPS2_DELAY_MS": 220, "GPS_DELAY_MS2": 220}).known


def test_parameters_of_a_simulator_are_not_read(known):
    """No real log has them: what is known is the same with and without."""
    simulated = {"SIM_GPS1_LAG_MS": 300, "SIM_GPS1_HZ": 10, "SIM_MAG1_OFS_X": 30, "SIM_ARSPD_RND": 2}
    assert known(simulated).known == known().known


def test_airspeed_that_the_firmware_does_not_use_is_not_given(logged, known):
    """ARSPD_USE 0: it stands in the ledger with that reason."""
    log = known({"ARSPD_USE": 0})
    assert "airspeed" not in log.sensors
    assert not log.rows["air_new"].any()
    assert log.known["use_airspeed"] == Known(False, "log", "ARSPD_USE")
    entry = log.ledger["airspeed"]
    assert (entry.read, entry.used, entry.left_out) == (len(logged.air_us), 0, {"ARSPD_USE is 0": len(logged.air_us)})
    assert "use_airspeed" not in known({"ARSPD_USE": 1}).known


def test_airspeed_used_at_zero_throttle_is_given_while_it_was_in_use(logged, known):
    """ARSPD_USE 2: ARSP.U says when; a sensor that is not in use for another reason is left out likewise."""
    middle = logged.air_us[len(logged.air_us) // 2]

    def gliding_later(m):
        return m if m[1] != "ARSP" else (m[0], "ARSP", (*m[2][:5], int(m[0] > middle), 1))

    n = int(np.sum(logged.air_us <= middle))
    for use, reason in ((2, "ARSPD_USE is 2: used at zero throttle only"), (1, "ARSP.U is 0: not in use")):
        entry = known({"ARSPD_USE": use}, change=gliding_later).ledger["airspeed"]
        assert entry.left_out == {reason: n}
        assert entry.used == len(logged.air_us) - n


def test_compass_that_the_firmware_does_not_use_is_not_given(logged, known):
    """COMPASS_USE 0: the next one that is used is read; where none is, there is none, and the ledger says why."""
    second = [(t, "MAG", (t, 1, *(5.0 * b), 1)) for t, b in zip(logged.field_us, logged.field, strict=True)]
    log = known({"COMPASS_USE": 0, "COMPASS_USE2": 1}, more=second)
    np.testing.assert_allclose(log.rows["mag_b_ut"][-1], 0.5 * logged.field[-1], rtol=0, atol=0.051)
    assert any("MAG 1 (of 0, 1)" in line for line in log.notes)
    for off in ({"COMPASS_USE": 0, "COMPASS_USE2": 0}, {"COMPASS_ENABLE": 0, "COMPASS_USE": 1}):
        log = known(off, more=second)
        assert "magnetometer" not in log.sensors
        reason = "COMPASS_ENABLE is 0" if "COMPASS_ENABLE" in off else "COMPASS_USE is 0"
        assert log.ledger["magnetometer"].left_out == {reason: len(logged.field_us)}
        assert log.known["use_magnetometer"] == Known(False, "log", reason.split()[0])


def test_vertical_velocity_is_known_to_be_there_or_not(logged, dataflash, known):
    """Without a column, always zero while the height changes, or by the receiver's own flag; it reads 0 then."""
    gps = dataflash.TODAY["GPS"]
    lacking = {
        "GPS": ("QBBIHBcLLeff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs", gps[2][:12], gps[3][:12])
    }
    short = known(formats=lacking, change=lambda m: m if m[1] != "GPS" else (m[0], "GPS", m[2][:12]))
    zero = known(change=lambda m: m if m[1] != "GPS" else (m[0], "GPS", (*m[2][:12], 0.0, 0.0)))
    flag = known(more=[(m[0], "GPA", (m[0], 0, 1, 1, 1, 1, 0.0, 0, 0, 200)) for m in [(30_500_000,)]])
    stray = known(
        change=lambda m: (
            m if m[1] != "GPS" else (m[0], "GPS", (*m[2][:12], 30.0 if m[0] == logged.fix_us[50] else 0.0, 0.0))
        )
    )
    nothing = known(change=lambda m: m if m[1] != "GPS" else (m[0], "GPS", (*m[2][:12], math.nan, 0.0)))
    for log, origin in ((short, "GPS has no VZ"), (zero, "GPS"), (stray, "GPS"), (flag, "GPA.VV"), (nothing, "GPS.VZ")):
        assert log.known["gps_vertical_velocity"] == Known(False, "log", origin)
        assert not log.rows["gps_v_e_m_s"][:, 2].any()
        assert log.rows["gps_new"].sum() > 90
    assert known().known["gps_vertical_velocity"] == Known(True, "log", "GPS")


def test_receiver_that_was_used_most_is_read(logged, known):
    """GPS.U: the second one here, faster by a tenth; without the column it is the first."""
    used = {"GPS": ("QBBIHBcLLefffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U",
                    "s#-s-S-DUmnhn-", "F--C-0BGGB000-")}  # fmt: skip

    def second_is_used(m):
        if m[1] != "GPS":
            return m
        speed = 1.1 * np.hypot(*logged.v_e[np.searchsorted(logged.fix_us, m[0] - 1), :2])
        fix = m[2][:13] if m[2][1] == 0 else (*m[2][:10], speed, *m[2][11:13])
        return m[0], "GPS", (*fix, m[2][1])

    log = known(formats=used, change=second_is_used)
    assert any("GPS 1 (of 0, 1)" in line for line in log.notes)
    expected = 1.1 * np.hypot(*logged.v_e[-1, :2])
    assert log.rows["gps_speed_m_s"][-1] == pytest.approx(expected, rel=1e-6)
