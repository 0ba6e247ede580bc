"""Three inside loops, one after the other, flown by a scripted stick.

=============  ===================================================================================================
Story          Straight and level until everything has settled, a shallow dive for speed, then three loops at a
               constant pitch rate; the autopilot takes over and levels the wings.
               Variant, outside loops: pushed from the top, one and then another, each after a dive of its own, for
               upside down the wing lifts little and drags much.
Verifies       Premerlani & Bizard: the matrix has no singular attitude (Eqn 17, 18-21) and the roll-pitch correction
               with its centrifugal term (Eqns 25-27) brings it back upright
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; the nose truly came round three times; from 10 to 30 s after the third loop inclination
               error at most 5 degrees RMS.  Outside: twice, the other way round; the same 5 degrees
=============  ===================================================================================================
"""

import math

from autopilot.figures import DIVE, inside_loops, outside_loops
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, end, height_m, inclination_error_deg, lowest, over, rms, start
from scenarios.harness.metrics.manoeuvres import (
    inverted,
    last,
    loops_end_s,
    most_loops,
    most_outside_loops,
    turns_that_count,
)
from scenarios.harness.scenario import Scenario

LOOPS = 3
LOOPED = loops_end_s(LOOPS)
OUTSIDE, EVERY_S, PUSHED = 2, 25.0, last(inverted)


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
    loops = inside_loops(m["first_s"], LOOPS, level, pitch_rate_rad_s=math.radians(m["pitch_rate_deg_s"]))
    return Script([Timed(0.0, level), *loops.timed])


def _outside(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
    rate_rad_s = math.radians(m["pitch_rate_deg_s"])
    first, second = (
        outside_loops(begin_s, 1, level, pitch_rate_rad_s=rate_rad_s, run_in=DIVE)
        for begin_s in (m["first_s"], m["first_s"] + EVERY_S)
    )
    return Script([Timed(0.0, level), *first.timed, *second.timed])


SCENARIO = Scenario(
    name="loops",
    story=__doc__,
    config=FlightConfig(
        duration_s=75.0,
        start=InFlightStart(height_m=100.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 100.0, "first_s": 25.0, "pitch_rate_deg_s": 110.0},
    ),
    script=_script,
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("loops flown", "turns", most_loops, turns_that_count(LOOPS), ">="),  # 3.01, 0.06 left
        Check(
            "inclination error RMS",
            "deg",
            over(inclination_error_deg, rms, after(LOOPED, 10.0), after(LOOPED, 30.0)),
            5.0,  # 2.6, 2.4 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"third loop ended": lambda flight: [LOOPED(flight)]},
)

VARIANTS = {"outside": "Two outside loops, flown by a scripted stick."}

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "outside",
        VARIANTS["outside"],
        {"duration_s": 100.0, "start.height_m": 150.0, "manoeuvre.height_m": 150.0, "manoeuvre.pitch_rate_deg_s": 68.0},
        script=_outside,
        checks=(
            SURVIVED,
            Check(
                "outside loops flown", "turns", most_outside_loops, turns_that_count(OUTSIDE), ">="
            ),  # 2.07, 0.13 left
            Check("lowest height", "m", over(height_m, lowest, start, end), 60.0, ">="),  # 73.0, 13.0 left
            Check(
                "inclination error RMS",
                "deg",
                over(inclination_error_deg, rms, after(PUSHED, 10.0), after(PUSHED, 30.0)),
                5.0,  # 2.1, 2.9 left
                pooled="rms",
                per_flight_limit=7.5,
            ),
        ),
        milestones={"last upside down": lambda flight: [PUSHED(flight)]},
    ),
)
