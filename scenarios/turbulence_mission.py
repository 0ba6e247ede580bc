"""Ten minutes along a route of eight waypoints, in wind and turbulence.

=============  ===================================================================================================
Story          In flight, heading unknown to the estimator at first, along a figure of eight again and again: two
               squares with sides of 250 m that meet above the launch point, one flown to the right and one to the
               left, between 60 m and 120 m.  The wind is a third of the airspeed; gusts shake the wings all the time.
Verifies       Premerlani & Bizard, as a whole: the attitude stays correct for the whole flight, and with position and
               course from the same receiver it is enough to navigate
Aircraft       endurance
Wind           4.5 m/s from any direction, turbulence W20 = 6 m/s
Sensors        generic
Passes when    it survives and reaches three rounds of waypoints in their order, within 30 m each; after the first
               minute it stays near the legs and the height, and inclination and heading errors are small (heading
               relative to the estimator's own reference)
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint, Waypoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, inclination_error_deg
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


def _script(config: FlightConfig) -> Script:  # noqa: ARG001 - the signature of a script
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
    checks=(
        SURVIVED,
        Check("waypoints reached", "waypoints", waypoints_reached(ROUTE), 24.0, ">="),
        Check.highest("farthest off the legs", "m", off_route_m(ROUTE), 35.0, SETTLED),
        Check.rms("off the legs RMS", "m", off_route_m(ROUTE), 8.0, SETTLED, per_flight_limit=10.0),
        Check.rms("off the height RMS", "m", height_missing_m(ROUTE), 8.0, SETTLED, per_flight_limit=10.0),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.0, SETTLED),
        Check.rms("heading error RMS", "deg", heading_error_deg(), 8.0, SETTLED, judged_share=0.9),
    ),
)
