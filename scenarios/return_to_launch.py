"""Home from 300 m away, having flown away from the launch point.

=============  ===================================================================================================
Story          300 m from the launch point in level flight, flying away from it, heading unknown to the estimator.  The
               autopilot is commanded to return at once, and passes over the launch point again and again.
Verifies       Premerlani & Bizard: steering by cross and dot product turns home from any course, in wind, while the
               yaw is still converging
Aircraft       endurance
Wind           5 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and passes within 25 m of the launch point in time; the variants must keep their height, too
Variants       Home from downwind, where it is carried 100 m further before it has turned.  ``strong_wind``: against
               8 m/s, 63 % of the airspeed; ``strong_wind_nose``: the same with an estimator of the nose's heading,
               which learns the wind in the turn; ``stronger_wind``: against 11 m/s, 87 % of the cruise speed, which
               would take five minutes at cruise.  The autopilot flies the speed that takes the least energy per
               distance over ground: 13.3 m/s against 8, and 17.2 against 11.  That makes 5.3 and 6.2 m/s over ground,
               or 75 s and 65 s, plus the turn; the limits are about half as much again
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import height_m, nearest_m, pass_time_s
from scenarios.harness.scenario import Scenario

NEAR_M, SLOWEST_S = 25.0, 100.0
VARIANTS = {
    "strong_wind": "Home from downwind, against 8 m/s, 63 % of the airspeed.",
    "strong_wind_nose": "Home against 8 m/s with an estimator that knows its nose, and learns the wind in the turn.",
    "stronger_wind": "Home against 11 m/s, 87 % of the cruise speed, which would take five minutes at cruise.",
}
STRONG = {"air.wind_from_deg": "tail", "air.wind_m_s": 8.0, "duration_s": 140.0}


def _script(config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.RETURN, height_m=config.manoeuvre["height_m"]))])


def _passed(slowest_s: float) -> Check:
    return Check("first within 25 m of the launch point", "s", pass_time_s(NEAR_M), slowest_s)


def _in_time(slowest_s: float) -> tuple[Check, ...]:
    return (
        SURVIVED,
        _passed(slowest_s),
        Check.lowest("lowest height", "m", height_m, 45.0),
        Check.highest("greatest height", "m", height_m, 75.0),
    )


SCENARIO = Scenario(
    name="return_to_launch",
    story=__doc__,
    config=FlightConfig(
        duration_s=110.0,
        start=InFlightStart(height_m=60.0, out_m=300.0),
        air=AirConfig(wind_m_s=5.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 60.0},
    ),
    script=_script,
    checks=(
        SURVIVED,
        Check("nearest to the launch point", "m", nearest_m(0.0, SLOWEST_S), NEAR_M),
        _passed(SLOWEST_S),
    ),
    milestones={"over the launch point": lambda flight: [pass_time_s(NEAR_M)(flight).value]},
)

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied("strong_wind", VARIANTS["strong_wind"], STRONG, checks=_in_time(110.0)),
    SCENARIO.varied(
        "strong_wind_nose",
        VARIANTS["strong_wind_nose"],
        STRONG | {"estimator": "gps_velocity_nose"},
        checks=_in_time(100.0),
    ),
    SCENARIO.varied(
        "stronger_wind",
        VARIANTS["stronger_wind"],
        STRONG | {"estimator": "gps_velocity_nose", "air.wind_m_s": 11.0},
        checks=_in_time(110.0),
    ),
)
