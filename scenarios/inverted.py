"""A square flown upside down.

=============  ===================================================================================================
Story          Straight and level until the estimator has converged.  Then the autopilot rolls inverted, flies four legs
               of fifteen seconds, each at a right angle to the right of the one before, and rolls back.
Verifies       Premerlani & Bizard, "Using DCM in control and navigation", 3 and 4: navigation by cross and dot product
               works even upside down, and r_zz shows when the aeroplane is inverted
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and keeps its height; it was truly inverted for most of the minute, and its course turned
               by three right angles meanwhile, at most 36 degrees short of them; inclination and heading errors are
               limited while inverted, and from 10 to 30 s afterwards the inclination error is small
=============  ===================================================================================================
"""

from autopilot.figures import inverted_circuit
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import after, at, heading_error_deg, height_m, inclination_error_deg
from scenarios.harness.metrics.manoeuvres import course_turned, inverted, last, total_s
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

FIRST_S, LEGS = 25.0, 4
FIRST, OVER = at(FIRST_S), last(inverted)
TILT, HEADING = inclination_error_deg, heading_error_deg()


def _script(config: FlightConfig) -> Script:
    level = ahead(config)
    square = inverted_circuit(FIRST_S, level, LEGS, config.manoeuvre["leg_s"], level)
    return Script([Timed(0.0, level), *square.timed])


SCENARIO = Scenario(
    name="inverted",
    story=__doc__,
    config=FlightConfig(
        duration_s=120.0,
        start=InFlightStart(height_m=120.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 120.0, "leg_s": 15.0, "bank_deg": 25.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("upside down", "s", total_s(inverted), 50.0, ">="),
        Check("course turned upside down", "turns", course_turned(inverted), 0.65, ">="),
        Check.lowest("lowest height", "m", height_m, 80.0, FIRST),
        Check.rms("inclination error RMS upside down", "deg", TILT, 6.0, FIRST, OVER),
        Check.rms("heading error RMS upside down", "deg", HEADING, 8.0, FIRST, OVER, judged_share=0.9),
        Check.rms("inclination error RMS afterwards", "deg", TILT, 5.0, after(OVER, 10.0), after(OVER, 30.0)),
    ),
    milestones={"upright again": lambda flight: [OVER(flight)]},
)
