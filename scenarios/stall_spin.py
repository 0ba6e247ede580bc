"""A stall, a spin, and the recovery by the book.

=============  ===================================================================================================
Story          Straight and level until everything has settled.  Motor off and nose up until the wing stalls; then full
               up-elevator and full left rudder, with some power: the slipstream is what holds this aeroplane in the
               spin, without it the elevator lets the wing fly again.  A turn takes 1.1 s, at more than 300 deg/s of
               roll, which is more than the gyros can tell.  After five turns: power off, ailerons neutral, opposite
               rudder, elevator forward, and the autopilot pulls out of the dive on what the estimator believes.
Verifies       Premerlani & Bizard, "Saturation", and the gains' purpose: to recover in about 10 seconds; throughout the
               spin the course turns faster than the GPS tells and the accelerometer feels mostly the rotation
Aircraft       endurance
Wind           3 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and is never below 100 m (from 250 m); it truly spun for four turns, wing stalled, roll and
               yaw of one sense, faster than 300 deg/s of roll; after the last of it inclination error within 15 degrees
               for good in 5 s, heading error in 10 s, and inclination error at most 5 degrees RMS from 10 to 30 s
=============  ===================================================================================================
"""

import math

from autopilot.figures import spin
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    after,
    at,
    end,
    heading_error_deg,
    height_m,
    highest,
    inclination_error_deg,
    lowest,
    over,
    rate_size_deg_s,
    rms,
    settling,
)
from scenarios.harness.metrics.manoeuvres import last, spinning, spun_turns
from scenarios.harness.scenario import Scenario

FIRST_S = 25.0
FIRST, OVER = at(FIRST_S), last(spinning)


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    level = Setpoint(Mode.COURSE, course_rad=math.radians(config.heading_deg), height_m=m["height_m"])
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
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("spun", "turns", spun_turns, 4.0, ">="),  # 4.79, 0.79 left
        Check(
            "fastest roll", "deg/s", over(rate_size_deg_s("x"), highest, FIRST, OVER), 300.0, ">="
        ),  # 314.0, 14.0 left
        Check("lowest height", "m", over(height_m, lowest, FIRST, end), 100.0, ">="),  # 152.3, 52.3 left
        Check(
            "inclination within 15 deg for good",
            "s",
            settling(inclination_error_deg, 15.0, OVER, end),
            5.0,  # 0.0, 5.0 left
        ),
        Check(
            "heading within 15 deg for good",
            "s",
            settling(heading_error_deg(), 15.0, OVER, end),
            10.0,  # 5.4, 4.6 left
        ),
        Check(
            "inclination error RMS afterwards",
            "deg",
            over(inclination_error_deg, rms, after(OVER, 10.0), after(OVER, 30.0)),
            5.0,  # 2.8, 2.2 left
            pooled="rms",
            per_flight_limit=7.5,
        ),
    ),
    milestones={"spin ended": lambda flight: [OVER(flight)]},
)
