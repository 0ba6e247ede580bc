"""Inside loops faster than the gyros can measure.

=============  ===================================================================================================
Story          A shallow dive for speed.  Then the stick is pulled to 110 deg/s for the time that three loops take at
               that rate, but the gyros saturate at 100 deg/s.  The autopilot cannot see that it turns faster: the pull
               goes on beyond the third loop, and the estimate falls 50 to 100 degrees behind.
Verifies       Premerlani & Bizard, "Saturation": a saturated gyro leaves an error as large as the angle it missed;
               feedback removes it in a reasonable time, about 10 seconds
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; gyros of +-100 deg/s
Passes when    it survives; three loops were truly flown, faster than the range of the gyros; after the third the
               inclination error settles, and from 20 to 40 s after it is small
=============  ===================================================================================================
"""

import math

from autopilot.figures import inside_loops
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, end, highest, inclination_error_deg, over, rate_size_deg_s, start
from scenarios.harness.metrics.manoeuvres import loops_end_s, most_loops, turns_that_count
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

LOOPS = 3
LOOPED = loops_end_s(LOOPS)
FULL_SCALE_DEG_S = 100.0
TILT, PITCH_RATE = inclination_error_deg, over(rate_size_deg_s("y"), highest, start, end)


def _script(config: FlightConfig) -> Script:
    m, level = config.manoeuvre, ahead(config)
    loops = inside_loops(m["first_s"], LOOPS, level, pitch_rate_rad_s=math.radians(m["pitch_rate_deg_s"]))
    return Script([Timed(0.0, level), *loops.timed])


SCENARIO = Scenario(
    name="gyro_saturation",
    story=__doc__,
    config=FlightConfig(
        duration_s=85.0,
        start=InFlightStart(height_m=200.0),  # it may dive by 100 m before the vertical is found again
        sensors={"gyro.range_deg_s": FULL_SCALE_DEG_S},
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 200.0, "first_s": 25.0, "pitch_rate_deg_s": 110.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("loops flown", "turns", most_loops, turns_that_count(LOOPS), ">="),
        Check("fastest pitch rate flown", "deg/s", PITCH_RATE, 1.05 * FULL_SCALE_DEG_S, ">="),
        Check.settling("inclination within 15 deg for good", TILT, 15.0, 25.0, LOOPED),
        Check.rms("inclination error RMS", "deg", TILT, 5.0, after(LOOPED, 20.0), after(LOOPED, 40.0)),
    ),
    milestones={"third loop ended": lambda flight: [LOOPED(flight)]},
)
