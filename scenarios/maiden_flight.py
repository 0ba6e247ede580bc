"""First flight of a model that is a tenth too heavy, tail-heavy and not trimmed.

=============  ===================================================================================================
Story          It was neither weighed nor trimmed, and the autopilot has the gains of the drawing.  The ailerons are
               off by 20 % of their deflection and roll it to the right, the elevator by 10 % and pushes the nose down.
               Thrown from the hand, a little harder for its weight, it climbs; 25 s after the release it is commanded
               onto the course of the throw.
Verifies       the autopilot, with the estimator in the loop: the integrals of its rate errors learn the deflections
               that hold the attitude, and those of its energy loops the pitch and the throttle
Aircraft       endurance; mass 10 % more, centre of gravity 4 % of the mean chord aft; with standard deviations, drawn
               by seed: inertia 10 %, thrust 5 %, neutral rudder 5 %, twist between the halves of the wing 0.5 degrees
Wind           2 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives; it never sinks below the hand and keeps its height from 45 s on; from then to the end the
               inclination error is small and the course over ground is that of the throw
=============  ===================================================================================================
"""

import math
from dataclasses import replace

import numpy as np

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, HandThrowStart
from scenarios.harness.config.tolerances import AirframeConfig, TolerancesConfig
from scenarios.harness.metrics import Series, at, height_m, inclination_error_deg
from scenarios.harness.scenario import Scenario
from scenarios.harness.scripts import ahead
from sim.log import Flight

SETTLED = at(45.0)
BUILT = AirframeConfig(mass_factor=1.1, cg_aft=0.04, aileron_trim=0.2, elevator_trim=-0.1)
DRAWN = TolerancesConfig(inertia=0.1, trim=0.05, thrust=0.05, warp_deg=0.5)


def _script(config: FlightConfig) -> Script:
    throw = Setpoint(Mode.LAUNCH, height_m=config.manoeuvre["height_m"])
    return Script([Timed(0.0, throw), Timed(config.manoeuvre["course_s"], ahead(config))])


def off_course_deg(flight: Flight) -> Series:
    """Course over ground less that of the throw, degrees."""
    series, v_e = height_m(flight), flight.log.truth["v_e_m_s"]
    off_rad = np.arctan2(v_e[:, 1], v_e[:, 0]) - math.radians(flight.manifest["config"]["start"]["heading_deg"])
    return replace(series, value=np.degrees((off_rad + np.pi) % (2.0 * np.pi) - np.pi))


SCENARIO = Scenario(
    name="maiden_flight",
    story=__doc__,
    config=FlightConfig(
        duration_s=75.0,
        start=HandThrowStart(push_m_s2=30.0),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        airframe=BUILT,
        tolerances=DRAWN,
        manoeuvre={"height_m": 30.0, "course_s": 25.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check.lowest("lowest height", "m", height_m, 1.5),
        Check.lowest("lowest height, settled", "m", height_m, 15.0, SETTLED),
        Check.highest("greatest height, settled", "m", height_m, 45.0, SETTLED),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.0, SETTLED),
        Check.rms("off the course RMS", "deg", off_course_deg, 3.2, SETTLED),
    ),
)
