"""Straight flight for two minutes with the wind from the side.

=============  ===================================================================================================
Story          In level flight, heading unknown to the estimator at first.  Course and height are held in a crosswind of
               40 % of the airspeed, so that the nose points 23 degrees away from the course.
Verifies       Premerlani & Bizard: the yaw locks to the course over ground, and a steady crab angle does not mislead
               the roll-pitch correction (Eqns 22-29)
Aircraft       endurance
Wind           5 m/s from the left or the right, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; from 20 s to the end inclination and heading errors are small (heading relative to the
               estimator's own reference, course or nose)
Variants       ``strong``: 7.5 m/s, 60 % of the airspeed, a crab angle of 37 degrees, for 80 s
=============  ===================================================================================================
"""

from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, inclination_error_deg
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import straight

SETTLED = at(20.0)
VARIANTS = {"strong": "Straight flight with a wind of 60 % of the airspeed from the side."}

SCENARIO = Scenario(
    name="crosswind",
    story=__doc__,
    config=FlightConfig(
        duration_s=140.0,
        start=InFlightStart(height_m=60.0),
        air=AirConfig(wind_m_s=5.0, wind_from_deg="cross", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 60.0},
    ),
    script=straight,
    checks=(
        SURVIVED,
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.0, SETTLED),
        Check.rms("heading error RMS", "deg", heading_error_deg(), 3.0, SETTLED, judged_share=0.9),
    ),
)
SCENARIOS = (SCENARIO, SCENARIO.varied("strong", VARIANTS["strong"], {"wind": "7.5@cross", "duration_s": 80.0}))
