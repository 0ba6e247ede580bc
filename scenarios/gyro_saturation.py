"""Inside loops faster than the gyros can tell.

=============  ===================================================================================================
Story          A shallow dive for speed, then the stick is pulled to 110 deg/s for as long as three loops take at that
               rate, with gyros that end at 100 deg/s.  Nobody aboard sees that it turns faster than that: the pull goes
               on beyond the third loop, and the estimate is left 50 to 100 degrees behind.
Verifies       Premerlani & Bizard, "Saturation": a gyro at its end leaves an error as large as the angle that it did
               not see; feedback erases it in a reasonable time, on the order of 10 seconds
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; gyros of +-100 deg/s
Passes when    it survives; the nose truly came round three times, faster than 105 deg/s; inclination error below 15
               degrees for good within 25 s of the third loop's end, and at most 5 degrees RMS from 20 to 40 s after it
=============  ===================================================================================================
"""

import math

from autopilot.figures import inside_loops
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    after,
    end,
    highest,
    inclination_error_deg,
    over,
    rate_size_deg_s,
    rms,
    settling,
    start,
)
from scenarios.harness.metrics.manoeuvres import loops_end_s, most_loops, turns_that_count
from scenarios.harness.scenario import Scenario

LOOPS = 3
LOOPED = loops_end_s(LOOPS)
FULL_SCALE_DEG_S = 100.0


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
    loops = inside_loops(m["first_s"], LOOPS, level, pitch_rate_rad_s=math.radians(m["pitch_rate_deg_s"]))
    return Script([Timed(0.0, level), *loops.timed])


SCENARIO = Scenario(
    name="gyro_saturation",
    story=__doc__,
    config=FlightConfig(
        duration_s=85.0,
        start=InFlightStart(height_m=200.0),  # it may dive by 100 m before it knows which way is up
        sensors={"gyro.range_deg_s": FULL_SCALE_DEG_S},
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 200.0, "first_s": 25.0, "pitch_rate_deg_s": 110.0},
    ),
    script=_script,
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("loops flown", "turns", most_loops, turns_that_count(LOOPS), ">="),  # 3.91, 0.96 left
        Check(
            "fastest pitch rate flown",
            "deg/s",
            over(rate_size_deg_s("y"), highest, start, end),
            1.05 * FULL_SCALE_DEG_S,  # 166.6, 61.6 left
            ">=",
        ),
        Check(
            "inclination within 15 deg for good",
            "s",
            settling(inclination_error_deg, 15.0, LOOPED, end),
            25.0,  # 16.1, 8.9 left
        ),
        Check(
            "inclination error RMS",
            "deg",
            over(inclination_error_deg, rms, after(LOOPED, 20.0), after(LOOPED, 40.0)),
            5.0,  # 2.8, 2.2 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"third loop ended": lambda flight: [LOOPED(flight)]},
)
