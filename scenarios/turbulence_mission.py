"""Ten minutes along a route of eight waypoints, in wind and turbulence.

=============  ===================================================================================================
Story          In flight, heading unknown to the estimator, sent round a figure of eight again and again: two squares
               with sides of 250 m that meet above the launch point, one flown to the right and one to the left, up and
               down between 60 m and 120 m.  The wind is a third of the airspeed; gusts shake the wings all the time.
Verifies       Premerlani & Bizard, as a whole: the matrix keeps its attitude for as long as one flies, and position and
               course from the same receiver lead round a route with it
Aircraft       endurance
Wind           4.5 m/s from any direction, turbulence W20 = 6 m/s
Sensors        generic
Passes when    it survives and reaches at least 24 waypoints in their order, within 30 m each; after the first minute
               it is never more than 35 m off the legs, 8 m RMS, and 8 m RMS off the height; inclination error at most
               4 degrees RMS, heading error against what the estimator's heading means at most 8 degrees RMS
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint, Waypoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, highest, inclination_error_deg, over, rms
from scenarios.harness.metrics.routes import height_missing_m, off_route_m, waypoints_reached
from scenarios.harness.scenario import Scenario

SETTLED = at(60.0)
ROUTE = (
    Waypoint(250.0, 0.0, 80.0),
    Waypoint(250.0, 250.0, 100.0),
    Waypoint(0.0, 250.0, 120.0),
    Waypoint(0.0, 0.0, 100.0),
    Waypoint(0.0, -250.0, 80.0),
    Waypoint(-250.0, -250.0, 60.0),
    Waypoint(-250.0, 0.0, 60.0),
    Waypoint(0.0, 0.0, 70.0),
)


def _script(config: FlightConfig) -> Script:  # noqa: ARG001 - a script like any other
    return Script([Timed(0.0, Setpoint(Mode.WAYPOINTS, route=ROUTE))])


SCENARIO = Scenario(
    name="turbulence_mission",
    story=__doc__,
    config=FlightConfig(
        duration_s=600.0,
        start=InFlightStart(height_m=70.0),
        air=AirConfig(wind_m_s=4.5, wind_from_deg="random", turbulence_w20_m_s=6.0),
    ),
    script=_script,
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("waypoints reached", "waypoints", waypoints_reached(ROUTE), 24.0, ">="),  # 26, 2 left
        Check("farthest off the legs", "m", over(off_route_m(ROUTE), highest, SETTLED), 35.0),  # 25.4, 9.6 left
        Check(
            "off the legs RMS",
            "m",
            over(off_route_m(ROUTE), rms, SETTLED),
            8.0,  # 4.9, 3.1 left
            pooled="rms",
            per_flight_limit=10.0,
        ),
        Check(
            "off the height RMS",
            "m",
            over(height_missing_m(ROUTE), rms, SETTLED),
            8.0,  # 4.1, 3.9 left
            pooled="rms",
            per_flight_limit=10.0,
        ),
        Check(
            "inclination error RMS",
            "deg",
            over(inclination_error_deg, rms, SETTLED),
            4.0,  # 2.7, 1.3 left
            pooled="rms",
            per_flight_limit=6.0,
        ),
        Check(
            "heading error RMS",
            "deg",
            over(heading_error_deg(), rms, SETTLED, judged_share=0.9),
            8.0,  # 5.1, 2.9 left
            pooled="rms",
            per_flight_limit=12.0,
        ),
    ),
)
