"""A vertical climb, then a stall turn.

=============  ===================================================================================================
Story          Straight and level until everything has settled; full throttle, then straight up until half of the speed
               is spent, and the nose is pushed down again.  Half a minute later the same, but the rudder swings the
               nose round at the top: it comes down the way it went up, and flies back.
Verifies       Premerlani & Bizard: navigation and control work pointing vertically; where the roll axis is vertical the
               course says nothing of yaw (Eqn 23 yields zero) and the gyros carry it across
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and is never below 80 m (from 120 m); it truly pointed within 15 degrees of straight up for
               2 s altogether and 1 s without a break, and swung round at the top; inclination error at most 10 degrees
               RMS until it is down again; from 10 to 30 s after that at most 5 degrees RMS, and so the heading error
=============  ===================================================================================================
"""

import math

from autopilot.figures import stall_turn, vertical_climb
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    after,
    at,
    end,
    heading_error_deg,
    height_m,
    inclination_error_deg,
    lowest,
    over,
    rms,
)
from scenarios.harness.metrics.manoeuvres import last, longest_s, total_s, turned, vertical
from scenarios.harness.scenario import Scenario

FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(vertical)


def _script(config: FlightConfig) -> Script:
    m, course_rad = config.manoeuvre, math.radians(config.heading_deg)
    out = Setpoint(Mode.COURSE, course_rad=course_rad, height_m=m["height_m"])
    back = Setpoint(Mode.COURSE, course_rad=course_rad + math.pi, height_m=m["height_m"])
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
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("straight up", "s", total_s(vertical), 2.0, ">="),  # 2.52, 0.52 left
        Check("straight up without a break", "s", longest_s(vertical), 1.0, ">="),  # 1.38, 0.38 left
        Check("swung round to the left", "turns", turned("z", -1.0), 0.4, ">="),  # 0.55, 0.15 left
        Check("lowest height", "m", over(height_m, lowest, FIRST, end), 80.0, ">="),  # 112.0, 32.0 left
        Check(
            "inclination error RMS while going up and over",
            "deg",
            over(inclination_error_deg, rms, FIRST, after(OVER, 5.0)),
            10.0,  # 7.5, 2.5 left
            pooled="rms",
            per_flight_limit=15.0,
        ),
        Check(
            "inclination error RMS afterwards",
            "deg",
            over(inclination_error_deg, rms, after(OVER, 10.0), after(OVER, 30.0)),
            5.0,  # 2.4, 2.6 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
        Check(
            "heading error RMS afterwards",
            "deg",
            over(heading_error_deg(), rms, after(OVER, 10.0), after(OVER, 30.0), judged_share=0.9),
            5.0,  # 1.6, 3.4 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"last straight up": lambda flight: [OVER(flight)]},
)
