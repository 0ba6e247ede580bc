"""A minute without a fix: a gentle circle, then a glide.

=============  ===================================================================================================
Story          Straight flight until the estimator has converged.  At 60 s the GPS falls silent for a minute: position,
               height and course are unknown.  After 3 s the autopilot circles gently at cruise, so as not to fly away;
               half a minute later it switches the motor off and glides, still circling.  At 120 s the fixes are back.
               2 s later it is on its course again and climbs back to its height.
Verifies       Premerlani & Bizard: without GPS the roll-pitch correction continues with the speed of the last fix
               (Eqns 25-29), and the heading is found again when the course is back (Eqns 22-24)
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; no fix from 60 s to 120 s
Passes when    it survives, has truly circled and then glided, and stays well clear of the ground; the inclination error
               is small during the outage and after it; the heading error is limited during the outage (it turns in
               wind, and 14 degrees of the error are the crab angle, which an estimator of the course cannot see) and
               soon settles after it
=============  ===================================================================================================
"""

from autopilot.interface import Mode
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, height_m, inclination_error_deg, time_in_mode_s
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import straight

LOST_S, BACK_S = 60.0, 120.0
LOST, BACK = at(LOST_S), at(BACK_S)
TILT, HEADING = inclination_error_deg, heading_error_deg()

SCENARIO = Scenario(
    name="gps_outage",
    story=__doc__,
    config=FlightConfig(
        duration_s=160.0,
        start=InFlightStart(height_m=120.0),
        faults=(f"gps:outage@{LOST_S:g}-{BACK_S:g}",),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 120.0},
    ),
    script=straight,
    checks=(
        SURVIVED,
        Check("circled", "s", time_in_mode_s(Mode.CIRCLE), 25.0, ">="),
        Check("glided", "s", time_in_mode_s(Mode.GLIDE), 20.0, ">="),
        Check.lowest("lowest height", "m", height_m, 50.0, LOST),
        Check.rms("inclination error RMS without fixes", "deg", TILT, 4.0, LOST, BACK),
        Check.highest("heading error without fixes", "deg", HEADING, 40.0, LOST, BACK, judged_share=0.9),
        Check.rms("inclination error RMS afterwards", "deg", TILT, 4.0, BACK),
        Check.settling("heading within 10 deg for good", HEADING, 10.0, 10.0, BACK),
    ),
)
