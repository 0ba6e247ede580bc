"""A sailplane glides home from 150 m away, having flown away from the launch point.

=============  ===================================================================================================
Story          150 m from the launch point and 100 m above it, flying away from it, heading unknown to the estimator.
               The autopilot turns home at once, with the rudder alone, glides there and passes over the launch point
               again and again while the height lasts.
Verifies       Premerlani & Bizard: steering by cross and dot product, with roll by way of the dihedral; the centrifugal
               term (Eqns 25-27) in turn after turn of a slow aeroplane
Aircraft       gentle_lady: two-metre sailplane, rudder and elevator, no motor
Wind           2 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and passes within 25 m of the launch point in time; it never comes near the stall, at an
               angle of attack of 10 degrees, and never banks steeply; from 20 s to the end the inclination error is
               small
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import angle_of_attack_deg, at, bank_size_deg, inclination_error_deg, pass_time_s
from scenarios.harness.scenario import Scenario

NEAR_M, SLOWEST_S = 25.0, 70.0


def _script(_config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.RETURN))])


SCENARIO = Scenario(
    name="gentle_lady_return",
    story=__doc__,
    config=FlightConfig(
        aircraft="gentle_lady",
        duration_s=75.0,
        start=InFlightStart(height_m=100.0, out_m=150.0),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("first within 25 m of the launch point", "s", pass_time_s(NEAR_M), SLOWEST_S),
        Check.highest("angle of attack", "deg", angle_of_attack_deg, 8.0),
        Check.highest("bank", "deg", bank_size_deg, 40.0),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 5.0, at(20.0)),
    ),
    milestones={"over the launch point": lambda flight: [pass_time_s(NEAR_M)(flight).value]},
)
