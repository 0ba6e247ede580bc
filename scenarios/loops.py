"""Three inside loops in a row, flown by a scripted stick.

=============  ===================================================================================================
Story          Straight and level until the estimator has converged, a shallow dive for speed, then three loops at a
               constant pitch rate.  The autopilot takes over and levels the wings.
               ``loops_outside``: two outside loops, pushed from the top, each after its own dive, because upside down
               the wing has less lift and more drag.
Verifies       Premerlani & Bizard: the matrix has no singular attitude (Eqns 17-21), and the roll-pitch correction
               with its centrifugal term (Eqns 25-27) brings it back upright
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; the loops were truly flown; from 10 to 30 s after the last one the inclination error is
               small.  Outside loops must not cost too much height
=============  ===================================================================================================
"""

import math

from autopilot.figures import DIVE, inside_loops, outside_loops
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import Moment, after, height_m, inclination_error_deg
from scenarios.harness.metrics.manoeuvres import (
    inverted,
    last,
    loops_end_s,
    most_loops,
    most_outside_loops,
    turns_that_count,
)
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

LOOPS = 3
LOOPED = loops_end_s(LOOPS)
OUTSIDE, EVERY_S, PUSHED = 2, 25.0, last(inverted)
VARIANTS = {"outside": "Two outside loops, flown by a scripted stick."}


def _script(config: FlightConfig) -> Script:
    m, level = config.manoeuvre, ahead(config)
    loops = inside_loops(m["first_s"], LOOPS, level, pitch_rate_rad_s=math.radians(m["pitch_rate_deg_s"]))
    return Script([Timed(0.0, level), *loops.timed])


def _outside(config: FlightConfig) -> Script:
    m, level = config.manoeuvre, ahead(config)
    rate_rad_s = math.radians(m["pitch_rate_deg_s"])
    first, second = (
        outside_loops(begin_s, 1, level, pitch_rate_rad_s=rate_rad_s, run_in=DIVE)
        for begin_s in (m["first_s"], m["first_s"] + EVERY_S)
    )
    return Script([Timed(0.0, level), *first.timed, *second.timed])


def _recovered(over: Moment) -> Check:
    return Check.rms("inclination error RMS", "deg", inclination_error_deg, 5.0, after(over, 10.0), after(over, 30.0))


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
    checks=(
        SURVIVED,
        Check("loops flown", "turns", most_loops, turns_that_count(LOOPS), ">="),
        _recovered(LOOPED),
    ),
    milestones={"third loop ended": lambda flight: [LOOPED(flight)]},
)

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "outside",
        VARIANTS["outside"],
        {"duration_s": 100.0, "start.height_m": 150.0, "manoeuvre.height_m": 150.0, "manoeuvre.pitch_rate_deg_s": 68.0},
        script=_outside,
        checks=(
            SURVIVED,
            Check("outside loops flown", "turns", most_outside_loops, turns_that_count(OUTSIDE), ">="),
            Check.lowest("lowest height", "m", height_m, 60.0),
            _recovered(PUSHED),
        ),
        milestones={"last upside down": lambda flight: [PUSHED(flight)]},
    ),
)
