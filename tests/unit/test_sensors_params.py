"""Parameters that no sensor has are refused in one line: field, value, unit, and what would be right."""

import math
import re

import pytest

from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams


@pytest.mark.parametrize(
    ("make", "field", "value", "unit"),
    [
        (GyroParams, "bias_deg_s", -1.0, "deg/s"),
        (GyroParams, "drift_deg_s_min", math.nan, "deg/s/min"),
        (GyroParams, "walk_deg_s_sqrt_s", math.inf, "deg/s/sqrt(s)"),
        (GyroParams, "noise_density_deg_s_sqrt_hz", -0.1, "deg/s/sqrt(Hz)"),
        (GyroParams, "gain", -0.01, "(a fraction)"),
        (GyroParams, "cross_axis", math.nan, "(a fraction)"),
        (GyroParams, "range_deg_s", 0.0, "deg/s"),
        (GyroParams, "range_deg_s", math.inf, "deg/s"),
        (GyroParams, "range_deg_s", math.nan, "deg/s"),
        (GyroParams, "bits", -1, "bit"),
        (GyroParams, "bits", 9.5, "bit"),
        (GyroParams, "bits", 64, "bit"),
        (AccelerometerParams, "bias_g", -0.02, "g"),
        (AccelerometerParams, "noise_density_ug_sqrt_hz", math.nan, "ug/sqrt(Hz)"),
        (AccelerometerParams, "range_g", -3.0, "g"),
        (AccelerometerParams, "bits", 100, "bit"),
        (GpsParams, "filter_s", -1.0, "s"),
        (GpsParams, "latency_s", -0.1, "s"),
        (GpsParams, "first_fix_s", math.inf, "s"),
        (GpsParams, "velocity_noise_m_s", -0.1, "m/s"),
        (GpsParams, "wander_horizontal_m", math.nan, "m"),
        (GpsParams, "wander_vertical_m", -2.0, "m"),
        (GpsParams, "wander_s", 0.0, "s"),
    ],
)
def test_sensor_with_impossible_parameter_is_refused(make, field, value, unit):
    """One line that names the field, its value and unit, and says what to choose."""
    said = re.escape(f"{make.__name__}.{field} = {value!r} {unit}: choose ")
    with pytest.raises(ValueError, match=said) as error:
        make(**{field: value})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("bits", [1, 8, 10, 24])
def test_sensor_with_a_real_converter_is_accepted(bits):
    """From a comparator to the best that is sold; none at all is 0 bits, which may have any range."""
    assert GyroParams(bits=bits).bits == bits
    assert AccelerometerParams(range_g=math.inf, bits=0).range_g == math.inf
