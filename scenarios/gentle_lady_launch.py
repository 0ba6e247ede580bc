"""A sailplane thrown off a slope into its glide, heading unknown to the estimator.

=============  ===================================================================================================
Story          Held for 8 s, swaying a little, while the gyro offset is measured in the first 2 s.  Then it is thrown
               level off a slope, 40 m above the ground below, with a twist of the wrist.  It has no motor and no
               ailerons: the autopilot levels the wings with the rudder and glides away straight ahead.
Verifies       Premerlani & Bizard, at low speed: a throw does not upset the matrix as it upsets an accelerometer
               (Eqns 25-27), and the yaw correction finds the heading from the GPS course (Eqns 22-24)
Aircraft       gentle_lady: two-metre sailplane, rudder and elevator, no motor
Wind           2 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it glides for 30 s and is far enough away by then (in the stronger winds, half as far); it never comes
               near the stall, at an angle of attack of 10 degrees, and never banks steeply; the inclination error is
               small, and the heading settles within 20 s of the release, in the variants sooner
Variants       ``calm``, without wind; ``head_wind`` and ``cross_wind``, 3 m/s, 41 % of the airspeed; ``gust``,
               4 m/s more from the side, beginning at the release and over within 2 s
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, HandThrowStart
from scenarios.harness.metrics import (
    angle_of_attack_deg,
    at,
    bank_size_deg,
    heading_error_deg,
    inclination_error_deg,
    launch_distance_at_m,
    start,
)
from scenarios.harness.scenario import Scenario

JUDGED_S = 30.0
UNTIL = at(JUDGED_S)
DISTANCE, HEADING = "distance at 30 s", "heading within 15 deg for good"
VARIANTS = {
    "calm": "A sailplane thrown off a slope in calm air.",
    "head_wind": "A sailplane thrown off a slope against 3 m/s of wind.",
    "cross_wind": "A sailplane thrown off a slope across 3 m/s of wind.",
    "gust": "A sailplane thrown off a slope as a gust from the side begins.",
}


def _script(_config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.LAUNCH))])  # the height is that of the slope: it cannot climb


SCENARIO = Scenario(
    name="gentle_lady_launch",
    story=__doc__,
    config=FlightConfig(
        aircraft="gentle_lady",
        duration_s=JUDGED_S,
        start=HandThrowStart(height_m=40.0, pitch_deg=2.0),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check(DISTANCE, "m", launch_distance_at_m(JUDGED_S), 100.0, ">="),
        Check.highest("angle of attack", "deg", angle_of_attack_deg, 8.0, start, UNTIL),
        Check.highest("bank", "deg", bank_size_deg, 15.0, start, UNTIL),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.0, start, UNTIL),
        Check.settling(HEADING, heading_error_deg(), 15.0, 20.0, start, at(20.0)),
    ),
)
SCENARIOS = (
    SCENARIO,
    SCENARIO.varied("calm", VARIANTS["calm"], {"wind": "calm", "air.turbulence_w20_m_s": 0.0}, {HEADING: 10.0}),
    SCENARIO.varied("head_wind", VARIANTS["head_wind"], {"wind": "3@head"}, {DISTANCE: 50.0, HEADING: 10.0}),
    SCENARIO.varied("cross_wind", VARIANTS["cross_wind"], {"wind": "3@cross"}, {DISTANCE: 50.0, HEADING: 10.0}),
    # A gust blows along the wind, here from the side.
    SCENARIO.varied("gust", VARIANTS["gust"], {"wind": "2@cross", "air.gusts": "4@0s"}, {HEADING: 10.0}),
)
