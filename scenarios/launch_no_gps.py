"""Thrown from the hand without a GPS: a climb that ends, and a circle until the first fix.

=============  ===================================================================================================
Story          Calibrated in the hand and thrown, with a receiver that has no fix.  Height, speed and course unknown.
               The autopilot climbs for one and a half times as long as a climb to 40 m takes at cruise, then circles
               gently at constant pitch, so as to stay in sight; after half a minute it would switch the motor off.  The
               first fix comes 50 s after the release: it goes to its height and flies on.
Verifies       the end of a launch without a GPS (`autopilot.failsafe`), and that a turn can be flown at the rate of the
               gyros by an estimator that does not know its speed
Aircraft       endurance
Wind           head wind of 2 m/s, turbulence W20 = 3 m/s
Sensors        generic; no fix until 50 s after the release
Passes when    it survives, has not climbed much above its height and not flown away, and holds its height at the end
=============  ===================================================================================================
"""

from autopilot.interface import Mode
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, HandThrowStart
from scenarios.harness.metrics import at, height_m, launch_distance_m, start, time_in_mode_s
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import launch

FIRST_FIX_S = 50.0

SCENARIO = Scenario(
    name="launch_no_gps",
    story=__doc__,
    config=FlightConfig(
        duration_s=90.0,
        start=HandThrowStart(),
        faults=(f"gps:outage@-60-{FIRST_FIX_S:g}",),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="head", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 40.0},
    ),
    script=launch,
    checks=(
        SURVIVED,
        Check("circled", "s", time_in_mode_s(Mode.CIRCLE), 15.0, ">="),
        Check.highest("greatest height", "m", height_m, 75.0),
        Check.highest("greatest distance without a fix", "m", launch_distance_m, 500.0, start, at(FIRST_FIX_S)),
        Check.lowest("lowest height in the circle and after", "m", height_m, 20.0, at(30.0)),
        Check.highest("greatest height at the end", "m", height_m, 52.0, at(80.0)),
    ),
)
