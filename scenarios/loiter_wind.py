"""Circles about the launch point in a wind as strong as the airspeed.

=============  ===================================================================================================
Story          Above the launch point, heading unknown to the estimator, it is commanded to circle there with a radius
               of 60 m.  At cruise it would stand still into the wind and fly twice as fast with it: the course over
               ground swings round in seconds, or backwards, and an autopilot that follows it is carried off.
Verifies       circles in wind (Park, Deyst & How, with the ground speed): the autopilot flies faster, and takes its
               direction in the turn from the GPS velocity less the wind
Aircraft       endurance
Wind           12 m/s from any direction, 95 % of the cruise speed, turbulence W20 = 2 m/s
Sensors        generic
Passes when    it survives, is never further than 300 m from the centre, keeps its height, and its inclination error is
               small.  It is carried 100 to 200 m in each full turn, and flies back at 6 m/s over ground
Variants       ``nose``: with an estimator of the nose's heading, which learns the wind and has to get it right
=============  ===================================================================================================
"""

from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    at,
    heading_error_deg,
    height_m,
    inclination_error_deg,
    launch_distance_m,
    wind_error_m_s,
)
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import loiter

VARIANTS = {"nose": "Circles in 12 m/s with an estimator that knows its nose, and learns the wind in the turn."}
FOUND = at(60.0)
FARTHEST = Check.highest("greatest distance from the centre", "m", launch_distance_m, 300.0)
KEPT = (
    Check.lowest("lowest height", "m", height_m, 45.0),
    Check.highest("greatest height", "m", height_m, 115.0),
)

SCENARIO = Scenario(
    name="loiter_wind",
    story=__doc__,
    config=FlightConfig(
        duration_s=150.0,
        start=InFlightStart(height_m=80.0),
        air=AirConfig(wind_m_s=12.0, wind_from_deg="random", turbulence_w20_m_s=2.0),
        manoeuvre={"height_m": 80.0, "radius_m": 60.0},
    ),
    script=loiter,
    checks=(
        SURVIVED,
        FARTHEST,
        *KEPT,
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 12.0, FOUND, per_flight_limit=15.0),
    ),
)

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "nose",
        VARIANTS["nose"],
        {"estimator": "gps_velocity_nose"},
        checks=(
            SURVIVED,
            FARTHEST,
            *KEPT,
            Check.rms("heading error RMS", "deg", heading_error_deg(), 12.0, FOUND, per_flight_limit=15.0),
            Check.rms("wind error RMS, once found", "m/s", wind_error_m_s, 1.5, FOUND, per_flight_limit=2.0),
        ),
    ),
)
