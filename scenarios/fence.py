"""Straight out through a geofence, with the wind behind: it must turn back at the line.

=============  ===================================================================================================
Story          Commanded on a course straight out, downwind, and never told to turn.  At the fence, 250 m from the
               launch point, the autopilot returns until it is well inside; then it follows its course again.
Verifies       the geofence of the autopilot (`autopilot.fence`): it acts before the line, earlier with the wind behind
Aircraft       endurance
Wind           tail wind of 5 m/s at first, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives, has turned back, is never far beyond the fence, and keeps its height
=============  ===================================================================================================
"""

from autopilot.interface import Mode
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FenceConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import height_m, launch_distance_m, time_in_mode_s
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import straight

SCENARIO = Scenario(
    name="fence",
    story=__doc__,
    config=FlightConfig(
        duration_s=90.0,
        start=InFlightStart(height_m=80.0),
        air=AirConfig(wind_m_s=5.0, wind_from_deg="tail", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 80.0},
        fence=FenceConfig(radius_m=250.0),
    ),
    script=straight,
    checks=(
        SURVIVED,
        Check.highest("greatest distance from the launch point", "m", launch_distance_m, 275.0),
        Check("returned", "s", time_in_mode_s(Mode.RETURN), 10.0, ">="),
        Check.lowest("lowest height", "m", height_m, 60.0),
    ),
)
