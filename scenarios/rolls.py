"""Three aileron rolls to the right and three to the left.

=============  ===================================================================================================
Story          Straight and level until the estimator has converged.  Then every ten seconds the nose is raised and the
               stick moved over for a full roll, three times to the right and three times to the left.
               ``rolls_figures``: an Immelmann, half a loop and half a roll, and a split S, half a roll and half a loop.
               Each reverses the heading.
Verifies       Premerlani & Bizard: rotations are integrated as a matrix, so no attitude is special (Eqns 17-21);
               feedback removes what the gain errors of the gyros leave behind (Eqns 25-29)
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and keeps its height; the figures were truly flown; the inclination error is limited from the
               first to the last of them and small from 10 to 30 s afterwards
=============  ===================================================================================================
"""

import math
from dataclasses import replace

from autopilot.figures import aileron_roll, immelmann, split_s
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, at, height_m, inclination_error_deg
from scenarios.harness.metrics.manoeuvres import inverted, last, most_loops, turned, turns_that_count
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

ROLLS = 3
SHORT = 0.1  # turns that the rolls together may end short, 12 degrees each
FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(inverted)
TILT = inclination_error_deg
VARIANTS = {"figures": "An Immelmann, then a split S."}


def _rolls(config: FlightConfig) -> Script:
    m, level = config.manoeuvre, ahead(config)
    rate_rad_s = math.radians(m["roll_rate_deg_s"])
    rolls = (
        aileron_roll(FIRST_S + i * m["every_s"], 1, level, right=i < ROLLS, roll_rate_rad_s=rate_rad_s)
        for i in range(2 * ROLLS)
    )
    return Script([Timed(0.0, level), *(timed for roll in rolls for timed in roll.timed)])


def _figures(config: FlightConfig) -> Script:
    m, out = config.manoeuvre, ahead(config)
    back = replace(out, course_rad=out.course_rad + math.pi, height_m=m["height_m"] + 15.0)
    rate_rad_s = math.radians(m["roll_rate_deg_s"])
    up = immelmann(FIRST_S, back, roll_rate_rad_s=rate_rad_s)
    down = split_s(FIRST_S + 1.5 * m["every_s"], out, roll_rate_rad_s=rate_rad_s)
    return Script([Timed(0.0, out), *up.timed, *down.timed])


SCENARIO = Scenario(
    name="rolls",
    story=__doc__,
    config=FlightConfig(
        duration_s=115.0,
        start=InFlightStart(height_m=120.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 120.0, "roll_rate_deg_s": 180.0, "every_s": 10.0},
    ),
    script=_rolls,
    checks=(
        SURVIVED,
        Check("rolled to the right", "turns", turned("x", 1.0), ROLLS - SHORT, ">="),
        Check("rolled to the left", "turns", turned("x", -1.0), ROLLS - SHORT, ">="),
        Check.lowest("lowest height", "m", height_m, 80.0, FIRST),
        Check.rms("inclination error RMS while rolling", "deg", TILT, 10.0, FIRST, OVER),
        Check.rms("inclination error RMS afterwards", "deg", TILT, 5.0, after(OVER, 10.0), after(OVER, 30.0)),
    ),
    milestones={"last roll was upside down": lambda flight: [OVER(flight)]},
)

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "figures",
        VARIANTS["figures"],
        {"duration_s": 80.0},
        script=_figures,
        checks=(
            SURVIVED,
            Check("nose came round", "turns", most_loops, turns_that_count(1), ">="),
            Check("rolled to the right", "turns", turned("x", 1.0), 1.0 - SHORT, ">="),
            *SCENARIO.checks[3:],
        ),
    ),
)
