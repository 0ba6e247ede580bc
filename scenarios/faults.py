"""Sensors that spike, stick and fall silent, one after the other.

=============  ===================================================================================================
Story          Straight flight with two course reversals.  From 30 s on, through the first turn, every 50th gyro reading
               is off by 200 deg/s, up or down, which is within the range of the gyro and so passes a range check.  In
               the second turn the accelerometer sticks for 15 s at what it read in the turn.  Later the gyros and the
               GPS return NaN, for 1 s and 2 s.
Verifies       Premerlani & Bizard: feedback removes what bad samples did to the matrix in about 10 seconds
               (Eqns 18-21, 25-29); a sample that is not a number must not stay in it
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic; gyro spikes from 30 s to 50 s, accelerometer stuck from 75 s to 90 s, gyros not a number from
               115 s to 116 s and GPS from 115 s to 117 s
Passes when    it survives; the inclination error is limited while each of the three faults lasts and small again from
               10 s after it; at the end so is the heading error, relative to the estimator's own reference
=============  ===================================================================================================
"""

from autopilot.pilot import Script, Timed, reversals
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, heading_error_deg, inclination_error_deg
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

RECOVERED_AFTER_SPIKES, SECOND_TURN = at(60.0), at(72.0)
RECOVERED_AFTER_STUCK, NAN = at(100.0), at(115.0)
RECOVERED_AFTER_NAN = at(127.0)
TILT, HEADING = inclination_error_deg, heading_error_deg()


def _script(config: FlightConfig) -> Script:
    m, course = config.manoeuvre, ahead(config)
    return Script([Timed(0.0, course), *reversals(m["first_s"], m["every_s"], 2, course).timed])


SCENARIO = Scenario(
    name="faults",
    story=__doc__,
    config=FlightConfig(
        duration_s=150.0,
        start=InFlightStart(height_m=100.0),
        faults=(
            "gyro:spikes=200,0.02@30-50",
            "accelerometer:stuck@75-90",
            "gyro:nan@115-116",
            "gps:nan@115-117",
        ),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 100.0, "bank_deg": 35.0, "first_s": 35.0, "every_s": 37.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check.highest("inclination error, gyros spiking", "deg", TILT, 35.0, at(30.0), at(50.0)),
        Check.rms("inclination error RMS after the spikes", "deg", TILT, 4.0, RECOVERED_AFTER_SPIKES, SECOND_TURN),
        Check.highest("inclination error, accelerometer stuck", "deg", TILT, 25.0, at(75.0), at(90.0)),
        Check.rms("inclination error RMS after sticking", "deg", TILT, 4.0, RECOVERED_AFTER_STUCK, NAN),
        Check.highest("inclination error, no numbers", "deg", TILT, 25.0, NAN, at(117.0)),
        Check.rms("inclination error RMS after the silence", "deg", TILT, 4.0, RECOVERED_AFTER_NAN),
        Check.rms("heading error RMS after the silence", "deg", HEADING, 3.0, RECOVERED_AFTER_NAN, judged_share=0.9),
    ),
)
