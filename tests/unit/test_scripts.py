"""The scripts that scenarios share."""

import math

import pytest

from autopilot.interface import Mode, Setpoint
from scenarios.harness.config import FlightConfig, InFlightStart
from scenarios.harness.scripts import ahead, launch, straight, turning


def config_of(**manoeuvre):
    """A configuration that starts on a heading of 40 degrees."""
    return FlightConfig(start=InFlightStart(heading_deg=40.0), manoeuvre=manoeuvre)


@pytest.mark.parametrize(
    ("script", "manoeuvre", "setpoint"),
    [
        (straight, {"height_m": 70.0}, Setpoint(Mode.COURSE, course_rad=math.radians(40.0), height_m=70.0)),
        (launch, {"height_m": 30.0}, Setpoint(Mode.LAUNCH, height_m=30.0)),
        (
            turning,
            {"bank_deg": 30.0, "pitch_deg": 3.0},
            Setpoint(Mode.STABILISE, bank_rad=math.radians(30.0), pitch_rad=math.radians(3.0)),
        ),
    ],
)
def test_script_is_one_setpoint_from_the_start(script, manoeuvre, setpoint):
    """Made from the initial heading and the manoeuvre, in force from the release on."""
    ((t_s, first),) = script(config_of(**manoeuvre))
    assert (t_s, repr(first)) == (0.0, repr(setpoint))  # by repr: the throttle is NaN


def test_ahead_limits_the_bank_only_if_it_is_given():
    """Without bank_deg the default of the set-point stays."""
    assert ahead(config_of(height_m=1.0, bank_deg=25.0)).bank_limit_rad == math.radians(25.0)
    assert ahead(config_of(height_m=1.0)).bank_limit_rad == Setpoint(Mode.COURSE).bank_limit_rad
