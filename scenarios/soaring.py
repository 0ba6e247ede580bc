"""Ten minutes in the air without a motor: a sailplane circles in thermals.

=============  ===================================================================================================
Story          Released 150 m above the launch point; in still air it would glide for four and a half minutes.  The
               pilot has seen where the air rises (a bird, a field of corn) and has it circle there: three and a half
               minutes in the nearest of four thermals, then in the next nearest, then in a third.  It turns all the
               time, in air that rises on one side of the circle more than on the other.
Verifies       Premerlani & Bizard: centrifugal term (Eqns 25-27) and course (Eqns 22-24) of an aeroplane that hardly
               ever flies straight, so slow that the wind is a third of its speed
Aircraft       gentle_lady: two-metre sailplane, rudder and elevator, no motor
Wind           2 m/s from any direction, turbulence W20 = 3 m/s, four thermals (Allen) under an inversion at 1200 m
Sensors        generic
Passes when    it survives, stays clear of the ground and ends at least 100 m above its release; it never banks steeply;
               from 20 s to the end inclination and heading errors are small (heading relative to the estimator's own
               reference)
=============  ===================================================================================================
"""

import math

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import at, bank_size_deg, heading_error_deg, height_at_m, height_m, inclination_error_deg
from scenarios.harness.scenario import Scenario

DURATION_S, EACH_S = 600.0, 210.0
SETTLED = at(20.0)
HEADING = heading_error_deg()


def _nearest_first(places: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    """`places` (north, east) in the order flown: the nearest first, then the nearest to that one, and so on."""
    here, left, order = (0.0, 0.0), list(places), []
    while left:
        here = min(left, key=lambda place: math.dist(here, place))
        left.remove(here)
        order.append(here)
    return order


def _script(config: FlightConfig) -> Script:
    m = config.manoeuvre
    places = config.air.thermals
    if isinstance(places, int) or not places:
        raise ValueError(f"air.thermals = {places!r}: soaring needs at least one, with its position")
    circling = (
        Setpoint(Mode.LOITER, north_m=north_m, east_m=east_m, radius_m=m["radius_m"])
        for north_m, east_m in _nearest_first(places)
    )
    return Script(Timed(i * EACH_S, s) for i, s in enumerate(circling) if i * EACH_S < config.duration_s)


SCENARIO = Scenario(
    name="soaring",
    story=__doc__,
    config=FlightConfig(
        aircraft="gentle_lady",
        duration_s=DURATION_S,
        start=InFlightStart(height_m=150.0),
        air=AirConfig(wind_m_s=2.0, wind_from_deg="random", turbulence_w20_m_s=3.0, thermals=4),
        manoeuvre={"radius_m": 25.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check.lowest("lowest height", "m", height_m, 80.0),
        Check("height at the end", "m", height_at_m(DURATION_S), 250.0, ">="),
        Check.highest("bank", "deg", bank_size_deg, 40.0),
        Check.rms("inclination error RMS", "deg", inclination_error_deg, 4.5, SETTLED, per_flight_limit=6.5),
        Check.rms("heading error RMS", "deg", HEADING, 10.0, SETTLED, judged_share=0.9),
    ),
)
