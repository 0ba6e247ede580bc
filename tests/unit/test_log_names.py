"""Columns are recognised by words, axis and unit, as loggers, simulators and spreadsheets name them."""

import numpy as np
import pytest

from scenarios.harness.logs.column_names import automatic
from scenarios.harness.logs.quantities import QUANTITIES

DEG, G = np.pi / 180.0, 9.80665


@pytest.mark.parametrize(
    ("column", "quantity", "factor"),
    [
        ("gx", "gyro.x", 1.0),
        ("gyro_y_deg_s", "gyro.y", DEG),
        ("GyrZ [dps]", "gyro.z", DEG),
        ("Gyroscope X (deg/s)", "gyro.x", DEG),
        ("gyroRotationX(rad/s)", "gyro.x", 1.0),
        ("motionRotationRateZ(rad/s)", "gyro.z", 1.0),
        ("field.angular_velocity.y", "gyro.y", 1.0),
        ("/imu/data/angular_velocity/x", "gyro.x", 1.0),
        ("gyro_rad[0]", "gyro.x", 1.0),
        ("gyroADC[1] (deg/s)", "gyro.y", DEG),
        ("p (rad/s)", "gyro.x", 1.0),
        ("Wx", "gyro.x", 1.0),
        ("Roll rate (°/s)", "gyro.x", DEG),
        ("measured.gyro_b_rad_s.z", "gyro.z", 1.0),
        ("acc_x (g)", "force.x", G),
        ("accel_z_m_s2", "force.z", 1.0),
        ("Accelerometer Y (mG)", "force.y", 1e-3 * G),
        ("accelerometerAccelerationX(G)", "force.x", G),
        ("linear_acceleration.y", "force.y", 1.0),
        ("accelerometer_m_s2[2]", "force.z", 1.0),
        ("accSmooth[0]", "force.x", 1.0),
        ("Acceleration z (m/s²)", "force.z", 1.0),
        ("Acc Y m/s/s", "force.y", 1.0),
        ("mag_x_uT", "mag.x", 1.0),
        ("Magnetometer X (µT)", "mag.x", 1.0),
        ("magnetometer_ga[1]", "mag.y", 100.0),
        ("MagZ (mGauss)", "mag.z", 0.1),
        ("time_ms", "time", 1e-3),
        ("timestamp_us", "time", 1e-6),
        ("time (us)", "time", 1e-6),
        ("TimeUS", "time", 1e-6),
        ("Time (s)", "time", 1.0),
        ("%time", "time", 1.0),
        ("seconds_elapsed", "time", 1.0),
        ("measured.gps_v_e_m_s.e", "gps.ve", 1.0),
        ("measured.gps_p_e_m.d", "gps.d", 1.0),
        ("vel_m_s[0]", "gps.vn", 1.0),
        ("vel_n_m_s", "gps.vn", 1.0),
        ("VelD", "gps.vd", 1.0),
        ("GPS_speed (m/s)", "gps.speed", 1.0),
        ("Ground Speed (km/h)", "gps.speed", 1.0 / 3.6),
        ("locationSpeed(m/s)", "gps.speed", 1.0),
        ("speed over ground [knots]", "gps.speed", 1852.0 / 3600.0),
        ("Course (deg)", "gps.course", DEG),
        ("locationCourse(°)", "gps.course", DEG),
        ("cog_rad", "gps.course", 1.0),
        ("Latitude (deg)", "gps.latitude", DEG),
        ("locationLongitude(WGS84)", "gps.longitude", 1.0),
        ("GPS_altitude (ft)", "gps.altitude", 0.3048),
        ("gps_t_s", "gps.time", 1.0),
        ("gps_fix", "gps.fix", 1.0),
        ("truth.R_eb.zx", "r20", 1.0),
        ("roll_deg", "roll", DEG),
        ("Roll (deg)", "roll", DEG),
        ("motionYaw(rad)", "yaw", 1.0),
        ("orientation.w", "qw", 1.0),
        ("Airspeed", "airspeed", 1.0),
        ("Indicated Airspeed (kt)", "airspeed", 1852.0 / 3600.0),
        ("Baro Altitude (ft)", "height", 0.3048),
        ("dt_s", "interval", 1.0),
    ],
)  # fmt: skip
def test_name_in_use_is_recognised_with_its_unit(column, quantity, factor):
    """Factors are those of the definitions of the units."""
    found, rivals = automatic([column])
    assert rivals == {}
    assert found[column].quantity == quantity
    assert found[column].factor == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    "column",
    [
        "flown.R_eb.xx", "truth.airspeed_m_s", "mode", "gyro_x_bias", "GyroX offset", "NavRoll", "desired roll",
        "motionUserAccelerationX(G)", "accelerometer temperature", "roll sp", "mag_x_var", "Gyro X (counts)",
        "Accelerometer X (V/g)", "Speed (m/s)", "motor[0]", "rcCommand[1]", "locationTimestamp_since1970(s)",
        "wind_n", "throttle",
    ],
)  # fmt: skip
def test_name_of_something_else_is_left_alone(column):
    """What an autopilot believed or wanted, an error, or a number in counts is not what a sensor said."""
    assert automatic([column]) == ({}, {})


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize("spelled", ["{}", "{}_"])
def test_own_name_of_every_quantity_is_understood(name, spelled):
    """With a dot, or an underscore in its place."""
    column = name if spelled == "{}" else name.replace(".", "_")
    found, _ = automatic([column])
    assert found[column].quantity == name


def test_numbered_quaternion_has_the_scalar_part_first_from_zero_or_one():
    """PX4 counts from 0, ArduPilot from 1; three of four are no quaternion."""
    for names in ([f"q[{i}]" for i in range(4)], [f"Q{i}" for i in range(1, 5)]):
        found, _ = automatic(names)
        assert [found[name].quantity for name in names] == ["qw", "qx", "qy", "qz"]
    assert automatic(["q[0]", "q[1]", "q[2]"]) == ({}, {})


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (  # a telephone: two kinds of acceleration, several clocks
            "loggingTime(txt),locationTimestamp_since1970(s),accelerometerTimestamp_sinceReboot(s),"
            "accelerometerAccelerationX(G),gyroRotationX(rad/s),motionTimestamp_sinceReboot(s),"
            "motionUserAccelerationX(G),motionYaw(rad),magnetometerX(µT)",
            {"motionTimestamp_sinceReboot(s)": "time", "accelerometerAccelerationX(G)": "force.x",
             "gyroRotationX(rad/s)": "gyro.x", "magnetometerX(µT)": "mag.x", "motionYaw(rad)": "yaw"},
        ),
        (  # Betaflight's decoder: the filtered gyro, not the unfiltered
            "loopIteration,time (us),axisP[0],rcCommand[0],setpoint[0],gyroADC[0] (deg/s),gyroADC[1] (deg/s),"
            "gyroADC[2] (deg/s),gyroUnfilt[0] (deg/s),accSmooth[0] (g),accSmooth[1] (g),accSmooth[2] (g),motor[0]",
            {"time (us)": "time", **{f"gyroADC[{i}] (deg/s)": f"gyro.{a}" for i, a in enumerate("xyz")},
             **{f"accSmooth[{i}] (g)": f"force.{a}" for i, a in enumerate("xyz")}},
        ),
        (  # rostopic echo -p
            "%time,field.header.seq,field.header.stamp,field.orientation.x,field.orientation.y,field.orientation.z,"
            "field.orientation.w,field.orientation_covariance0,field.angular_velocity.x,field.linear_acceleration.x",
            {"%time": "time", **{f"field.orientation.{a}": f"q{a}" for a in "xyzw"},
             "field.angular_velocity.x": "gyro.x", "field.linear_acceleration.x": "force.x"},
        ),
        (  # ArduPilot's messages as text: of two clocks the one that tells its unit
            "timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
            {"TimeUS": "time", "GyrX": "gyro.x", "GyrY": "gyro.y", "GyrZ": "gyro.z", "AccX": "force.x",
             "AccY": "force.y", "AccZ": "force.z"},
        ),
        ("gyro_x,gyro_y,gyro_z,gyro2_x,gyro2_y,gyro2_z",  # the first of two units
         {"gyro_x": "gyro.x", "gyro_y": "gyro.y", "gyro_z": "gyro.z"}),
        ("roll,pitch,yaw,ref_roll,ref_pitch,ref_yaw,heading",  # the reference before an estimate
         {"ref_roll": "roll", "ref_pitch": "pitch", "ref_yaw": "yaw"}),
    ],
)  # fmt: skip
def test_header_of_a_logger_is_recognised_as_a_whole(header, expected):
    """Each quantity once, of the column that is named best; nothing competes."""
    found, rivals = automatic(header.split(","))
    assert {name: meaning.quantity for name, meaning in found.items()} == expected
    assert rivals == {}


def test_two_columns_that_are_named_equally_well_compete():
    """Nobody but the person knows which of the two was meant."""
    _, rivals = automatic(["gx", "gy", "gz", "gyro_x", "gyro_y", "gyro_z"])
    assert rivals == {f"gyro.{a}": (f"g{a}", f"gyro_{a}") for a in "xyz"}


def test_row_of_units_says_the_unit_of_a_column():
    """As the second line of many files does."""
    found, _ = automatic(["Time", "Wx"], {"Time": "ms", "Wx": "deg/s"})
    assert found["Time"].factor == pytest.approx(1e-3, rel=1e-15)
    assert found["Wx"].factor == pytest.approx(DEG, rel=1e-15)
    assert found["Wx"].unit_given
