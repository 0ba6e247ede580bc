"""Thrown from the hand into a climb, heading unknown to the estimator.

=============  ===================================================================================================
Story          Held for 8 s, swaying a little, while the gyro offset is measured in the first 2 s.  Then thrown at 64 %
               of cruise speed with a twist of the wrist.  The autopilot detects the throw, starts the motor, climbs
               straight ahead to 30 m and holds the course.
Verifies       Premerlani & Bizard: a throw does not upset the matrix as it upsets an accelerometer (Eqns 25-27); the
               yaw correction finds the heading from the GPS course (Eqns 22-24)
Aircraft       endurance
Wind           2 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; accelerometer of +-3 g (with +-6 g: ``--set accelerometer.range_g=6``)
Passes when    it lasts 20 s, has climbed by then and stayed clear of the ground before; the inclination error is small,
               and the heading settles within 20 s, in the variants sooner
Variants       ``calm``, without wind; ``head_wind`` and ``cross_wind``, 5 m/s, 40 % of the airspeed; ``gust``,
               4 m/s more from the side, beginning at the release and over within 2 s.  ``accelerometer`` shows a
               failure: if the vertical comes from the accelerometer alone, the throw, and then the thrust of the
               motor, reads as a climb, and the autopilot pushes the nose into the ground.  It passes if that happens
               within seconds.  (A sailplane, which has no thrust, does not crash.)
=============  ===================================================================================================
"""

from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, HandThrowStart
from scenarios.harness.metrics import (
    at,
    believed_pitch_deg,
    ground_contact_s,
    heading_error_deg,
    height_at_m,
    height_m,
    highest,
    inclination_error_deg,
    last,
    over,
    pitch_at_ground_deg,
    start,
)
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import launch

JUDGED_S = 20.0
UNTIL = at(JUDGED_S)
HEADING = "heading within 15 deg for good"
VARIANTS = {
    "calm": "Thrown from the hand into a climb, in calm air.",
    "head_wind": "Thrown from the hand against 5 m/s of wind.",
    "cross_wind": "Thrown from the hand across 5 m/s of wind.",
    "gust": "Thrown from the hand as a gust from the side begins.",
    "accelerometer": "Thrown with the vertical from the accelerometer alone: it must dive into the ground.",
}

SCENARIO = Scenario(
    name="hand_launch",
    story=__doc__,
    config=FlightConfig(
        duration_s=JUDGED_S,
        start=HandThrowStart(),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 30.0},
    ),
    script=launch,
    checks=(
        SURVIVED,
        Check("height at 20 s", "m", height_at_m(JUDGED_S), 10.0, ">="),
        Check.lowest("lowest height", "m", height_m, 1.5, start, UNTIL),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.0, start, UNTIL),
        Check.settling(HEADING, heading_error_deg(), 15.0, JUDGED_S, start, UNTIL),
    ),
)
SCENARIOS = (
    SCENARIO,
    SCENARIO.varied("calm", VARIANTS["calm"], {"wind": "calm", "air.turbulence_w20_m_s": 0.0}, {HEADING: 10.0}),
    SCENARIO.varied("head_wind", VARIANTS["head_wind"], {"wind": "5@head"}, {HEADING: 10.0}),
    SCENARIO.varied("cross_wind", VARIANTS["cross_wind"], {"wind": "5@cross"}, {HEADING: 10.0}),
    # A gust blows along the wind, here from the side.
    SCENARIO.varied("gust", VARIANTS["gust"], {"wind": "2@cross", "air.gusts": "4@0s"}, {HEADING: 10.0}),
    SCENARIO.varied(
        "accelerometer",
        VARIANTS["accelerometer"],
        {"estimator": "accelerometer_only"},
        expected_to_fail=True,
        checks=(
            Check("pitch when it hits the ground", "deg", pitch_at_ground_deg, -15.0),
            Check("time to the ground", "s", ground_contact_s, 3.0),
            Check("highest pitch believed", "deg", over(believed_pitch_deg, highest, start, last), 45.0, ">="),
        ),
    ),
)
