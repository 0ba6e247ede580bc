"""A stall, a spin, and the standard recovery.

=============  ===================================================================================================
Story          Straight and level until the estimator has converged.  Motor off and nose up until the wing stalls; then
               full up-elevator and full left rudder, with some power.  Only the slipstream holds this aeroplane in the
               spin: without it the elevator cannot keep the wing stalled.  A turn takes 1.1 s, and the roll rate
               exceeds 300 deg/s, the range of the gyros.  After five turns: power off, ailerons neutral, opposite
               rudder, elevator forward; then the autopilot pulls out of the dive, on the estimated attitude.
Verifies       Premerlani & Bizard, "Saturation", and the purpose of the gains: to recover in about 10 seconds.  In the
               spin the course turns faster than the GPS can report, and the accelerometer measures mostly the rotation
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and recovers well above the ground; it truly spun, wing stalled, roll and yaw in the same
               direction, faster than the range of the gyros; after the last turn inclination and heading errors settle
               within seconds, and from 10 to 30 s after it the inclination error is small
=============  ===================================================================================================
"""

from autopilot.figures import spin
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    after,
    at,
    heading_error_deg,
    height_m,
    highest,
    inclination_error_deg,
    over,
    rate_size_deg_s,
)
from scenarios.harness.metrics.manoeuvres import last, spinning, spun_turns
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead

FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(spinning)
TILT = inclination_error_deg


def _script(config: FlightConfig) -> Script:
    m, level = config.manoeuvre, ahead(config)
    spun = spin(FIRST_S, m["hold_s"], level, throttle=m["throttle"])
    return Script([Timed(0.0, level), *spun.timed])


SCENARIO = Scenario(
    name="stall_spin",
    story=__doc__,
    config=FlightConfig(
        duration_s=80.0,
        start=InFlightStart(height_m=250.0),
        air=AirConfig(wind_m_s=3.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 250.0, "hold_s": 7.0, "throttle": 0.6},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("spun", "turns", spun_turns, 4.0, ">="),
        Check("fastest roll", "deg/s", over(rate_size_deg_s("x"), highest, FIRST, OVER), 300.0, ">="),
        Check.lowest("lowest height", "m", height_m, 100.0, FIRST),
        Check.settling("inclination within 15 deg for good", TILT, 15.0, 5.0, OVER),
        Check.settling("heading within 15 deg for good", heading_error_deg(), 15.0, 10.0, OVER),
        Check.rms("inclination error RMS afterwards", "deg", TILT, 5.0, after(OVER, 10.0), after(OVER, 30.0)),
    ),
    milestones={"spin ended": lambda flight: [OVER(flight)]},
)
