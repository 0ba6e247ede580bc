"""Three course reversals in a crosswind.

=============  ===================================================================================================
Story          Straight across the wind, then three times about turn at 35 degrees of bank, with more than 30 s of
               straight flight between the turns.  Wind from the left becomes wind from the right: the nose turns by
               180 degrees less or more twice the crab angle, and what was learnt of the course does not hold.
Verifies       Premerlani & Bizard: after a 180 degree turn in a crosswind the heading is off by up to twice the crab
               angle and comes back; a turn does not tip the matrix (Eqns 25-27)
Aircraft       endurance
Wind           5 m/s across the first leg, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; from 20 s to the end inclination error at most 5 degrees RMS; after each of the three
               roll-outs (found in the truth) heading error below 10 degrees within 10 s, until the next turn
=============  ===================================================================================================
"""

import math

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed, reversals
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.manoeuvres import roll_outs, slowest_recovery
from scenarios.harness.metrics import at, heading_error_deg, inclination_error_deg, over, rms
from scenarios.harness.scenario import Scenario

TURNS = 3
RECOVERED_S, RECOVERED_DEG = 10.0, 10.0
SETTLED = at(20.0)


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    ahead = Setpoint(
        Mode.COURSE,
        course_rad=math.radians(config.heading_deg),
        height_m=m["height_m"],
        bank_limit_rad=math.radians(m["bank_deg"]),
    )
    return Script([Timed(0.0, ahead), *reversals(m["first_s"], m["every_s"], TURNS, ahead).timed])


SCENARIO = Scenario(
    name="turns_180",
    story=__doc__,
    config=FlightConfig(
        duration_s=160.0,
        start=InFlightStart(height_m=80.0),
        air=AirConfig(wind_m_s=5.0, wind_from_deg="cross", turbulence_w20_m_s=3.0),
        # A turn takes about 10 s: more than 30 s of straight flight are left until the next.
        manoeuvre={"height_m": 80.0, "bank_deg": 35.0, "first_s": 25.0, "every_s": 45.0},
    ),
    script=_script,
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check(
            "inclination error RMS",
            "deg",
            over(inclination_error_deg, rms, SETTLED),
            5.0,  # 3.6, 1.4 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
        Check(
            "heading below 10 deg after roll-out",
            "s",
            slowest_recovery(heading_error_deg(), RECOVERED_DEG, TURNS, RECOVERED_S),
            RECOVERED_S,  # 1.5, 8.5 left
        ),
    ),
    milestones={"rolled out": lambda flight: [r.t_s for r in roll_outs(flight)]},
)
