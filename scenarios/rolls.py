"""Three aileron rolls to the right and three to the left.

=============  ===================================================================================================
Story          Straight and level until everything has settled; then every ten seconds the nose is raised and the stick
               put over for a whole roll, three times right, three times left.
               Variant: Immelmann and split S: up by half a loop and half a roll, back down by half a roll and half a
               loop, each of which ends with the heading reversed.
Verifies       Premerlani & Bizard: rotations are integrated as a matrix, so that no attitude is special (Eqn 17,
               18-21); what the gain error of the gyros leaves behind, the feedback removes (Eqns 25-29)
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and is never below 80 m (from 120 m); the figures were truly flown; inclination error at most
               10 degrees RMS from the first to the last of them, and at most 5 degrees RMS from 10 to 30 s after it
=============  ===================================================================================================
"""

import math

from autopilot.figures import aileron_roll, immelmann, split_s
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, at, end, height_m, inclination_error_deg, lowest, over, rms
from scenarios.harness.metrics.manoeuvres import inverted, last, most_loops, turned, turns_that_count
from scenarios.harness.scenario import Scenario

ROLLS = 3
SHORT = 0.1  # turns that the rolls together may end short, 12 degrees each
FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(inverted)


def _rolls(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
    rate_rad_s = math.radians(m["roll_rate_deg_s"])
    rolls = (
        aileron_roll(FIRST_S + i * m["every_s"], 1, level, right=i < ROLLS, roll_rate_rad_s=rate_rad_s)
        for i in range(2 * ROLLS)
    )
    return Script([Timed(0.0, level), *(timed for roll in rolls for timed in roll.timed)])


def _figures(config: FlightConfig) -> Script:
    m, course_rad = config.manoeuvre, math.radians(config.heading_deg)
    out = Setpoint(Mode.COURSE, course_rad=course_rad, height_m=m["height_m"])
    back = Setpoint(Mode.COURSE, course_rad=course_rad + math.pi, height_m=m["height_m"] + 15.0)
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
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("rolled to the right", "turns", turned("x", 1.0), ROLLS - SHORT, ">="),  # 2.97, 0.07 left
        Check("rolled to the left", "turns", turned("x", -1.0), ROLLS - SHORT, ">="),  # 2.98, 0.08 left
        Check("lowest height", "m", over(height_m, lowest, FIRST, end), 80.0, ">="),  # 115.6, 35.6 left
        Check(
            "inclination error RMS while rolling",
            "deg",
            over(inclination_error_deg, rms, FIRST, OVER),
            10.0,  # 6.3, 3.7 left
            pooled="rms",
            per_flight_limit=15.0,
        ),
        Check(
            "inclination error RMS afterwards",
            "deg",
            over(inclination_error_deg, rms, after(OVER, 10.0), after(OVER, 30.0)),
            5.0,  # 1.7, 3.3 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"last roll was upside down": lambda flight: [OVER(flight)]},
)

VARIANTS = {"figures": "An Immelmann and a split S, in turn."}

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "figures",
        VARIANTS["figures"],
        {"duration_s": 80.0},
        script=_figures,
        checks=(
            SURVIVED,
            Check("nose came round", "turns", most_loops, turns_that_count(1), ">="),  # 1.05, 0.10 left
            Check("rolled to the right", "turns", turned("x", 1.0), 1.0 - SHORT, ">="),  # 1.01, 0.11 left
            *SCENARIO.checks[3:],  # 111.3, 31.3 left; 7.7, 2.3 left; 3.0, 2.0 left
        ),
    ),
)
