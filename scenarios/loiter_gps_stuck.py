"""A GPS that freezes in a circle, and keeps on reporting.

=============  ===================================================================================================
Story          A circle about the launch point until the estimator has converged.  At 60 s the receiver freezes for a
               minute: it reports the same position and velocity over and over, with new time stamps.  The autopilot
               and the estimator notice that the position does not move at the reported velocity, and fly as without
               a GPS: a gentle circle, then a glide.  At 120 s the receiver works again.  2 s later the aeroplane climbs
               and flies back to its circle, from which the wind has carried it away.
Verifies       Premerlani & Bizard: without GPS the roll-pitch correction continues with the speed of the last fix
               (Eqns 25-29); a fix that cannot be true must not be one
Aircraft       endurance
Wind           4 m/s from any direction, turbulence W20 = 2 m/s
Sensors        generic; the same fix again and again from 60 s to 120 s
Passes when    it survives, circles within 3 s of the fault and glides, and stays well clear of the ground; the
               inclination error is small from the fault on; it is back near its circle at the end
=============  ===================================================================================================
"""

from autopilot.interface import Mode
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, height_m, inclination_error_deg, nearest_m, time_in_mode_s
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import loiter

STUCK_S, BACK_S = 60.0, 120.0
STUCK, BACK = at(STUCK_S), at(BACK_S)

SCENARIO = Scenario(
    name="loiter_gps_stuck",
    story=__doc__,
    config=FlightConfig(
        duration_s=180.0,
        start=InFlightStart(height_m=120.0),
        faults=(f"gps:stuck@{STUCK_S:g}-{BACK_S:g}",),
        air=AirConfig(wind_m_s=4.0, wind_from_deg="random", turbulence_w20_m_s=2.0),
        manoeuvre={"height_m": 120.0, "radius_m": 60.0},
    ),
    script=loiter,
    checks=(
        SURVIVED,
        Check("circled", "s", time_in_mode_s(Mode.CIRCLE), 29.0, ">="),
        Check("glided", "s", time_in_mode_s(Mode.GLIDE), 25.0, ">="),
        Check.lowest("lowest height", "m", height_m, 35.0, STUCK),
        Check.rms("inclination error RMS, GPS stuck", "deg", inclination_error_deg, 6.0, STUCK, BACK),
        Check.rms("inclination error RMS afterwards", "deg", inclination_error_deg, 6.0, BACK),
        Check("nearest to the centre at the end", "m", nearest_m(150.0, 180.0), 100.0),
    ),
)
