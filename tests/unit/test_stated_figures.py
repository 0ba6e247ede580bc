"""Figures in the stories of scenarios and in comments, each worked out again from the configuration and the model."""

import inspect
import math
import re
from dataclasses import astuple

import numpy as np
import pytest

from autopilot import airframes
from autopilot.airframes import params_of
from autopilot.dcm import _PARAMS
from autopilot.energy import speed_to_fly
from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find
from scenarios.harness.verdict import judge
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.linear import linearise, modes
from sim.aeroplane.trim import Trim, trim


def story(name):
    return " ".join(find(name).story.split())


def cruise_m_s(aircraft):
    return Trim.of(Model(aircraft, 200).airframe["cruise"]).airspeed_m_s


def percent(part, of):
    return f"{100.0 * part / of:.0f} %"


def test_throw_and_winds_of_the_hand_launch():
    start, flown_m_s = find("hand_launch").config.start, params_of("endurance").energy.airspeed_m_s
    assert cruise_m_s("endurance") == flown_m_s
    assert f"thrown at {percent(start.push_m_s2 * start.push_s, flown_m_s)} of cruise speed" in story("hand_launch")
    for variant in ("head_wind", "cross_wind"):
        wind_m_s = find(f"hand_launch_{variant}").config.air.wind_m_s
        assert f"{wind_m_s:g} m/s, {percent(wind_m_s, flown_m_s)} of the airspeed" in story("hand_launch")


def test_winds_of_the_sailplane():
    flown_m_s = params_of("gentle_lady").energy.airspeed_m_s
    for variant in ("head_wind", "cross_wind"):
        wind_m_s = find(f"gentle_lady_launch_{variant}").config.air.wind_m_s
        assert f"{wind_m_s:g} m/s, {percent(wind_m_s, flown_m_s)} of the airspeed" in story("gentle_lady_launch")


def test_crab_angles_of_the_crosswind():
    """The sine of the angle is the wind over the airspeed."""
    flown_m_s = params_of("endurance").energy.airspeed_m_s
    for name, words in (
        ("crosswind", "points {:.0f} degrees away"),
        ("crosswind_strong", "a crab angle of {:.0f} degrees"),
    ):
        wind_m_s = find(name).config.air.wind_m_s
        assert f"{percent(wind_m_s, flown_m_s)} of the airspeed" in story("crosswind")
        assert words.format(math.degrees(math.asin(wind_m_s / flown_m_s))) in story("crosswind")


def test_speeds_of_the_return_against_the_wind():
    """The airspeed that the autopilot chooses, and what is left of it over the ground."""
    p, text = params_of("endurance").energy, story("return_to_launch")
    winds = [find(f"return_to_launch_{name}").config.air.wind_m_s for name in ("strong_wind", "stronger_wind")]
    params = np.zeros(1, _PARAMS["energy"])
    params[0] = astuple(p)
    speeds = [speed_to_fly(wind_m_s, params[0]) for wind_m_s in winds]
    slow, fast = winds
    assert f"against {slow:g} m/s, {percent(slow, p.airspeed_m_s)} of the airspeed" in text
    assert f"against {fast:g} m/s, {percent(fast, p.airspeed_m_s)} of the cruise speed" in text
    assert f"{speeds[0]:.1f} m/s against {slow:g}, and {speeds[1]:.1f} against {fast:g}" in text
    assert f"That makes {speeds[0] - slow:.1f} and {speeds[1] - fast:.1f} m/s over ground" in text


def test_comments_on_the_sailplane_say_what_its_model_gives():
    """Best glide and its pitch, stall, and the period of the Dutch roll, in the comments of `autopilot.airframes`."""
    model, text = Model("gentle_lady", 200), inspect.getsource(airframes)
    best = trim(model, params_of("gentle_lady").energy.best_glide_m_s)
    assert f"best glide ({best.airspeed_m_s:.1f} m/s, pitch {math.degrees(best.pitch_rad):.1f} degrees)" in text
    assert f"into a stall ({params_of('gentle_lady').energy.stall_m_s:.1f} m/s)" in text
    by_name = {mode.name: mode for mode in modes(linearise(model, best))}
    assert f"the Dutch roll (period {by_name['dutch_roll'].period_s:.1f} s)" in text


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "it is {} to {} degrees RMS"),
        ({"wind": "calm"}, "``, {} to {} degrees"),
        ({"estimator_params.turn_speed": True}, "``, {} to {} degrees"),
    ],
)
def test_errors_in_banked_turns_are_in_the_range_that_the_story_gives(changes, words):
    """Over seeds 0 to 3, rounded to a degree, at each of the banks."""
    low, high = map(int, re.search(words.replace("{}", r"(\d+)"), story("turns_180")).groups())
    for bank_deg in (30, 45, 60):
        scenario = find(f"turns_180_bank_{bank_deg}")
        flights = [judge(scenario, fly_scenario(scenario, changes, seed=seed)) for seed in range(4)]
        found = [row.measured for v in flights for row in v.rows if row.name == "inclination error RMS while banked"]
        assert low <= round(math.sqrt(np.mean(np.square(found)))) <= high, bank_deg
