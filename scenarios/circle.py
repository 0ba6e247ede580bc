"""A steady turn held for three minutes.

=============  ===================================================================================================
Story          The heading is unknown to the estimator at first.  The stick is moved over and held: 30 degrees of
               bank to the right, four turns a minute.  All that time the accelerometer points as in level flight, the
               course has changed by the time the GPS reports it, and the wind comes from every side in turn.
Verifies       Premerlani & Bizard: in an aeroplane that never flies straight, the centrifugal term keeps the bank
               (Eqns 25-27) and the course keeps the heading (Eqns 22-24)
Aircraft       endurance
Wind           2 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; over the last three minutes the aeroplane was truly banked, and inclination and heading
               errors are small.  In wind the centrifugal term is not exact, because Eqn 25 uses the speed over ground;
               the inclination error in calm air is about half as large
=============  ===================================================================================================
"""

import math

import numpy as np

from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, bank_size_deg, heading_error_deg, inclination_error_deg, over
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import turning

SETTLED = at(20.0)
HEADING = heading_error_deg()


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else math.nan


SCENARIO = Scenario(
    name="circle",
    story=__doc__,
    config=FlightConfig(
        duration_s=200.0,
        start=InFlightStart(height_m=200.0),  # the height is not held: it ends 40 m lower or 70 m higher
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"bank_deg": 30.0, "pitch_deg": 3.0},
    ),
    script=turning,
    checks=(
        SURVIVED,
        Check("bank, median", "deg", over(bank_size_deg, _median, SETTLED), 20.0, ">="),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 6.5, SETTLED, per_flight_limit=9.0),
        Check.rms("heading error RMS", "deg", HEADING, 10.0, SETTLED, per_flight_limit=14.0, judged_share=0.9),
    ),
)
