"""The offsets of all three gyros jump by 3 deg/s in flight.

=============  ===================================================================================================
Story          Straight flight until the estimator has converged.  At 40 s the offsets jump, roll and yaw up and pitch
               down, as if the supply voltage dropped or a part suddenly warmed up.  Left uncorrected, 3 deg/s would
               turn the estimate upside down within a minute.
Verifies       Premerlani & Bizard: drift about all three axes is eliminated while the aeroplane moves; the integral
               term removes the offset (Eqns 28-29)
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; +3, -3, +3 deg/s added to the gyros from 40 s on
Passes when    it survives; the inclination error stays limited; from 80 s after the jump on the new offset has been
               learnt and the inclination error is small; the heading settles within seconds of the jump
=============  ===================================================================================================
"""

from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, gyro_bias_error_deg_s, heading_error_deg, inclination_error_deg
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import straight

JUMP_S, LEARNING_S = 40.0, 80.0
JUMP, LEARNT = at(JUMP_S), at(JUMP_S + LEARNING_S)

SCENARIO = Scenario(
    name="gyro_offset",
    story=__doc__,
    config=FlightConfig(
        duration_s=160.0,
        start=InFlightStart(height_m=80.0),
        faults=tuple(f"gyro.{axis}:bias={deg_s}@{JUMP_S:g}" for axis, deg_s in (("x", 3), ("y", -3), ("z", 3))),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 80.0},
    ),
    script=straight,
    checks=(
        SURVIVED,
        Check.highest("inclination error at its worst", "deg", inclination_error_deg, 25.0, JUMP),
        Check.rms("offset not learnt", "deg/s", gyro_bias_error_deg_s, 0.5, LEARNT),
        Check.rms("inclination error RMS, learnt", "deg", inclination_error_deg, 4.0, LEARNT),
        Check.settling("heading within 10 deg for good", heading_error_deg(), 10.0, 15.0, JUMP),
    ),
)
