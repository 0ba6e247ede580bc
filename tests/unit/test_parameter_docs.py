"""Docstrings of parameter dataclasses: every field is documented with its default, and with its effect when changed."""

import math
import re
from dataclasses import MISSING, fields

import pytest

from autopilot.airframes import AutopilotParams
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.board import BoardParams
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.magnetometer import MagnetometerParams

AUTOPILOT = [f.default_factory for f in fields(AutopilotParams)]
SENSORS = [
    GyroParams, AccelerometerParams, BoardParams, GpsParams, MagnetometerParams, AirspeedParams, BarometerParams,
]  # fmt: skip
SCALES = {"deg": math.radians(1.0), "g": 9.80665}


def entries(params):
    """Entries of the docstring: names of the fields -> text."""
    found, names = {}, ()
    for line in params.__doc__.splitlines():
        head = re.match(r"    (\w+(?:, \w+)*) : (.*)", line)
        if head:
            names = tuple(head[1].split(", "))
            found[names] = head[2]
        elif names and line.startswith("        "):
            found[names] += " " + line.strip()
        else:
            names = ()
    return found


def defaults(text, n):
    """The `n` defaults named in the text of an entry: numbers in SI, words and truth values as they are."""
    named = re.search(r"default ([^):;]*)", text)[1]
    words = [part.strip() for part in re.split(r",| and ", named) if part.strip()]
    values = [value_of(word) for word in words]
    # "1 deg" after a list holds for the last number alone; a single value holds for all fields.
    return values * n if len(values) == 1 else values


def value_of(word):
    number, _, unit = word.partition(" ")
    if number in ("True", "False"):
        return number == "True"
    try:
        return float(number) * SCALES.get(unit, 1.0)
    except ValueError:
        return number


@pytest.mark.parametrize("params", [*AUTOPILOT, *SENSORS], ids=lambda params: params.__name__)
def test_every_field_is_documented_with_the_default_it_has(params):
    """And no entry names a field that is not there."""
    documented = [name for names in entries(params) for name in names]
    assert sorted(documented) == sorted(f.name for f in fields(params))
    actual = {f.name: f.default for f in fields(params)}
    for names, text in entries(params).items():
        assert "default " in text, names
        for name, value in zip(names, defaults(text, len(names)), strict=True):
            default = actual[name]
            assert default is not MISSING
            for part in default if isinstance(default, tuple) else (default,):
                assert part == (pytest.approx(value) if isinstance(value, float) else value), name


@pytest.mark.parametrize("params", AUTOPILOT, ids=lambda params: params.__name__)
def test_every_autopilot_parameter_says_what_a_change_does(params):
    """Higher, lower, or wrong: what the user sees in flight."""
    for names, text in entries(params).items():
        assert re.search(r"\b(higher|lower|wrong|below)\b", text, re.IGNORECASE), names


@pytest.mark.parametrize("params", SENSORS, ids=lambda params: params.__name__)
def test_sensor_parameters_state_the_rule_for_raising_them(params):
    """One sentence for all errors; entries name the exceptions."""
    assert re.search(r"A larger figure .* unless stated otherwise,?\s+and 0\s+removes", params.__doc__, re.DOTALL)
