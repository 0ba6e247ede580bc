"""Home from 300 m out, flying away when the command comes.

=============  ===================================================================================================
Story          300 m from the launch point in level flight, nose away from it, heading unknown to the estimator; the
               autopilot is told to return at once, and flies over the launch point again and again.
Verifies       Premerlani & Bizard, steering by cross and dot product: it turns home from any course, in wind, while the
               yaw is still being found
Aircraft       endurance
Wind           5 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it survives and passes within 25 m of the launch point in under 100 s
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import SURVIVED, Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import nearest_m, pass_time_s
from scenarios.harness.scenario import Scenario

NEAR_M, SLOWEST_S = 25.0, 100.0


def _script(config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.RETURN, height_m=config.manoeuvre["height_m"]))])


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
    # Beside each limit: measured with the default estimator over seeds 0 to 9, pooled, and what is left.
    checks=(
        SURVIVED,
        Check("nearest to the launch point", "m", nearest_m(0.0, SLOWEST_S), NEAR_M),  # 1.5, 23.5 left
        Check("first within 25 m of the launch point", "s", pass_time_s(NEAR_M), SLOWEST_S),  # 52.4, 47.6 left
    ),
    milestones={"over the launch point": lambda flight: [pass_time_s(NEAR_M)(flight).value]},
)
