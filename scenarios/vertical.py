"""A vertical climb, then a stall turn.

=============  ===================================================================================================
Story          Straight and level until the estimator has converged.  Full throttle, then straight up until half of the
               speed is spent, and the nose is pushed down again.  Half a minute later the same, but at the top the
               rudder swings the nose round: the aeroplane comes down the way it went up, and flies back.
Verifies       Premerlani & Bizard: navigation and control work with the nose pointing straight up; with a vertical roll
               axis the course holds no information about yaw (Eqn 23 yields zero), and the gyros bridge the gap
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and keeps its height; it truly pointed within 15 degrees of straight up, in total and without
               a break, and swung round at the top; the inclination error is limited until it is down again, and from 10
               to 30 s after that inclination and heading errors are small
=============  ===================================================================================================
"""

import math
from dataclasses import replace

from autopilot.figures import stall_turn, vertical_climb
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, at, heading_error_deg, height_m, inclination_error_deg
from scenarios.harness.metrics.manoeuvres import last, longest_s, total_s, turned, vertical
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(vertical)
DOWN, LEVEL, LATER = after(OVER, 5.0), after(OVER, 10.0), after(OVER, 30.0)
TILT, HEADING = inclination_error_deg, heading_error_deg()


def _script(config: FlightConfig) -> Script:
    m, out = config.manoeuvre, ahead(config)
    back = replace(out, course_rad=out.course_rad + math.pi)
    pull_to_rad = math.radians(m["pull_to_deg"])
    up = vertical_climb(FIRST_S, m["climb_s"], out, pull_to_rad=pull_to_rad)
    over_the_top = stall_turn(FIRST_S + m["every_s"], m["stall_s"], back, pull_to_rad=pull_to_rad)
    return Script([Timed(0.0, out), *up.timed, *over_the_top.timed])


SCENARIO = Scenario(
    name="vertical",
    story=__doc__,
    config=FlightConfig(
        duration_s=100.0,
        start=InFlightStart(height_m=120.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 120.0, "every_s": 30.0, "climb_s": 1.0, "stall_s": 1.2, "pull_to_deg": 98.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("straight up", "s", total_s(vertical), 2.0, ">="),
        Check("straight up without a break", "s", longest_s(vertical), 1.0, ">="),
        Check("swung round to the left", "turns", turned("z", -1.0), 0.4, ">="),
        Check.lowest("lowest height", "m", height_m, 80.0, FIRST),
        Check.rms("inclination error RMS while going up and over", "deg", TILT, 10.0, FIRST, DOWN),
        Check.rms("inclination error RMS afterwards", "deg", TILT, 5.0, LEVEL, LATER),
        Check.rms("heading error RMS afterwards", "deg", HEADING, 5.0, LEVEL, LATER, judged_share=0.9),
    ),
    milestones={"last straight up": lambda flight: [OVER(flight)]},
)
