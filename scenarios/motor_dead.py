"""The motor stops on the way home: a glide with wings level, down to a landing.

=============  ===================================================================================================
Story          On its way home the motor stops at 20 s, for good.  Nothing measures the airspeed.  The autopilot, which
               is not told, opens the throttle and asks for more pitch to hold the height; when the elevator shows
               that the aeroplane is slow it lowers the nose, keeps its banks small, and goes on gliding home.
Verifies       The guard against a stall without an airspeed sensor (`autopilot.lift`); and that the estimate survives
               a deceleration that nothing measures, which it takes for a lowered nose
Aircraft       endurance; best glide 1 in 9, stalls at an angle of attack of about 13 degrees
Wind           4 m/s from any direction, turbulence W20 = 3 m/s
Sensors        generic
Passes when    it lands, which counts as survival here; it glides for as long as its height allows, never near the angle
               of attack of the stall, and touches the ground slowly, with wings level, near the launch point; the
               inclination error is limited
Variants       ``battery``: the motor does not stop, the battery is nearly empty: the voltage falls until the speed
               controller takes the motor back
=============  ===================================================================================================
"""

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script, Timed
from scenarios.harness.checks import Check
from scenarios.harness.config import AirConfig, FlightConfig, InFlightStart
from scenarios.harness.metrics import (
    angle_of_attack_deg,
    at,
    bank_size_deg,
    ground_contact_s,
    highest,
    inclination_error_deg,
    launch_distance_m,
    over,
)
from scenarios.harness.metrics.landing import at_ground, before_ground, sink_m_s, survived_by_landing
from scenarios.harness.scenario import Scenario

DEAD_S, EARLIEST_S = 20.0, 70.0
VARIANTS = {"battery": "The battery runs empty on the way home: the motor fades away."}


def _script(config: FlightConfig) -> Script:
    return Script([Timed(0.0, Setpoint(Mode.RETURN, height_m=config.manoeuvre["height_m"]))])


SCENARIO = Scenario(
    name="motor_dead",
    story=__doc__,
    config=FlightConfig(
        duration_s=120.0,
        start=InFlightStart(height_m=60.0, out_m=200.0),
        faults=(f"motor:dead@{DEAD_S:g}",),
        air=AirConfig(wind_m_s=4.0, wind_from_deg="random", turbulence_w20_m_s=3.0),
        manoeuvre={"height_m": 60.0},
    ),
    script=_script,
    checks=(
        survived_by_landing(EARLIEST_S),
        Check("time to the ground", "s", ground_contact_s, EARLIEST_S, ">="),
        Check("angle of attack", "deg", over(angle_of_attack_deg, highest, at(DEAD_S), before_ground), 13.0),
        Check("sink at the ground", "m/s", at_ground(sink_m_s), 3.0),
        Check("bank at the ground", "deg", at_ground(bank_size_deg), 25.0),
        Check("distance from the launch point at the ground", "m", at_ground(launch_distance_m), 200.0),
        Check.rms(
            "inclination error RMS in the glide", "deg", inclination_error_deg, 5.0, at(DEAD_S), before_ground,
        ),
    ),
)  # fmt: skip

SCENARIOS = (
    SCENARIO,
    SCENARIO.varied(
        "battery",
        VARIANTS["battery"],
        {"faults": (), "battery.capacity_mah": 2000.0, "battery.charge": 0.04, "battery.resistance_ohm": 0.1},
    ),
)
