"""Thrown from the hand without any calibration: the gyro offset is unknown.

=============  ===================================================================================================
Story          Switched on and carried off to where it is thrown, swayed a little, for 45 s: nobody waited for a
               calibration.  All that the estimator knows of its gyros is that they are no good to some degree or two a
               second on every axis; the heading is unknown as ever.  The autopilot feels the throw, climbs straight
               ahead to 30 m and stays there.
               ``cold_start_moved``: it was calibrated for 2 s, while it was waved about at up to 20 deg/s, and believes
               in an offset that is none; nor is the hand quieter after that.
               ``cold_start_no_gps``: not calibrated, and the first fix comes 30 s after the release: until then there
               is neither course nor speed nor height
Verifies       Premerlani & Bizard: the offset is found in flight by the integral term (Eqns 28-29), and the heading by
               the course (Eqns 22-24), the calibration on the ground is a comfort
Aircraft       endurance
Wind           head wind of 2 m/s, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives, never below 1.5 m; inclination error never above 20 degrees, and below 6 degrees for good
               within 20 s of the release (without fixes: of the first one); heading within 15 degrees of the course
               for good within 10 s likewise; from 60 s likewise, for 30 s, the offset learnt is right to 0.6 deg/s RMS
               and the inclination to 3 degrees RMS
=============  ===================================================================================================

The 45 s count: the integral learns with a time constant of K_P / K_I, 33 s.  Thrown after 8 s, as ``hand_launch`` is,
one of ten (seed 9, an offset of 2.5 deg/s about the pitch axis) flies into the ground: the estimate has the nose 6
degrees too high in the hand and 14 in the climb, and 12 degrees are all that is demanded.
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, HandThrowStart
from scenarios.harness.metrics import (
    at,
    end,
    gyro_bias_error_deg_s,
    heading_error_deg,
    height_m,
    highest,
    inclination_error_deg,
    lowest,
    over,
    rms,
    settling,
    start,
)
from scenarios.harness.scenario import Scenario

FIRST_FIX_S = 30.0
LEARNT_S = 60.0


def _script(config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.LAUNCH, height_m=config.manoeuvre["height_m"]))])


def _checks(known_s: float) -> tuple[Check, ...]:
    """What is demanded where the first fix comes `known_s` after the release."""
    known, learnt = at(known_s), at(known_s + LEARNT_S)
    # Measured with the default estimator over seeds 0 to 9, pooled: cold_start; moved; no_gps; and the least left.
    return (
        SURVIVED,
        Check("lowest height", "m", over(height_m, lowest, start), 1.5, ">="),  # 2.04; 1.95; 2.04; 0.45 left
        Check(
            "inclination error at its worst",
            "deg",
            over(inclination_error_deg, highest, start),
            20.0,  # 10.3; 12.3; 12.8; 7.2 left
        ),
        Check(
            "inclination within 6 deg for good",
            "s",
            settling(inclination_error_deg, 6.0, known, end),
            20.0,  # 9.1; 9.0; 11.3; 8.7 left
        ),
        Check(
            "heading within 15 deg for good",
            "s",
            settling(heading_error_deg(), 15.0, known, end),
            10.0,  # 4.2; 3.5; 2.8; 5.8 left
        ),
        Check(
            "offset not learnt",
            "deg/s",
            over(gyro_bias_error_deg_s, rms, learnt),
            0.6,  # 0.24; 0.26; 0.25; 0.34 left
            pooled="rms",
            per_flight_limit=0.85,
        ),
        Check(
            "inclination error RMS, learnt",
            "deg",
            over(inclination_error_deg, rms, learnt),
            3.0,  # 1.7; 1.7; 1.9; 1.1 left
            pooled="rms",
            per_flight_limit=4.5,
        ),
    )


SCENARIO = Scenario(
    name="cold_start",
    story=__doc__,
    config=FlightConfig(
        duration_s=90.0,
        start=HandThrowStart(hold_s=45.0, calibration_s=0.0),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="head", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 30.0},
    ),
    script=_script,
    checks=_checks(0.0),
)

VARIANTS = {
    "moved": "Thrown after a calibration during which it was waved about at up to 20 deg/s.",
    "no_gps": "Thrown without any calibration, and without a fix until 30 s after the release.",
}

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied("moved", VARIANTS["moved"], {"start.calibration_s": 2.0, "start.sway_deg_s": 20.0}),
    SCENARIO.varied(
        "no_gps",
        VARIANTS["no_gps"],
        {"faults": f"gps:outage@-60-{FIRST_FIX_S:g}", "duration_s": FIRST_FIX_S + 90.0},
        checks=_checks(FIRST_FIX_S),
    ),
)
