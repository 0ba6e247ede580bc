"""A square flown upside down.

=============  ===================================================================================================
Story          Straight and level until everything has settled; then the autopilot rolls on its back and flies four legs
               of fifteen seconds, each a right angle to the right of the one before, and rolls back.
Verifies       Premerlani & Bizard, "Using DCM in control and navigation", 3 and 4: navigation by cross and dot product
               works even upside down, and r_zz tells that one is
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and is never below 80 m (from 120 m); it was truly upside down for 50 s and its course turned
               by three right angles meanwhile, less 36 degrees at most; upside down inclination error at most 6 degrees
               RMS, heading error at most 8; inclination error at most 5 degrees RMS from 10 to 30 s afterwards
=============  ===================================================================================================
"""

import math

from autopilot.figures import inverted_circuit
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
from scenarios.harness.metrics.manoeuvres import course_turned, inverted, last, total_s
from scenarios.harness.scenario import Scenario

FIRST_S, LEGS = 25.0, 4
FIRST, OVER = at(FIRST_S), last(inverted)


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(
        Mode.COURSE,
        course_rad=math.radians(config.heading_deg),
        height_m=m["height_m"],
        bank_limit_rad=math.radians(m["bank_deg"]),
    )
    square = inverted_circuit(FIRST_S, level, LEGS, m["leg_s"], level)
    return Script([Timed(0.0, level), *square.timed])


SCENARIO = Scenario(
    name="inverted",
    story=__doc__,
    config=FlightConfig(
        duration_s=120.0,
        start=InFlightStart(height_m=120.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 120.0, "leg_s": 15.0, "bank_deg": 25.0},
    ),
    script=_script,
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("upside down", "s", total_s(inverted), 50.0, ">="),  # 58.6, 8.6 left
        Check("course turned upside down", "turns", course_turned(inverted), 0.65, ">="),  # 0.68, 0.03 left
        Check("lowest height", "m", over(height_m, lowest, FIRST, end), 80.0, ">="),  # 106.2, 26.2 left
        Check(
            "inclination error RMS upside down",
            "deg",
            over(inclination_error_deg, rms, FIRST, OVER),
            6.0,  # 3.7, 2.3 left
            pooled="rms",
            per_flight_limit=9.0,
        ),
        Check(
            "heading error RMS upside down",
            "deg",
            over(heading_error_deg(), rms, FIRST, OVER, judged_share=0.9),
            8.0,  # 4.1, 3.9 left
            pooled="rms",
            per_flight_limit=12.0,
        ),
        Check(
            "inclination error RMS afterwards",
            "deg",
            over(inclination_error_deg, rms, after(OVER, 10.0), after(OVER, 30.0)),
            5.0,  # 1.8, 3.2 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"upright again": lambda flight: [OVER(flight)]},
)
