"""Gains and limits of the autopilot for each aircraft, by name.

A sailplane uses the same code with other parameters: no ailerons, so that roll control moves the rudder; no motor, so
that height is not held and the glide pitch alone protects the speed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from autopilot.energy import EnergyParams
from autopilot.failsafe import FailsafeParams
from autopilot.fence import FenceParams
from autopilot.guidance import GuidanceParams
from autopilot.launch import LaunchParams
from autopilot.lift import LiftParams
from autopilot.mixer import MixerParams
from autopilot.route import RouteParams
from autopilot.stabilise import StabiliseParams
from autopilot.standby import StandbyParams


@dataclass(frozen=True, slots=True)
class AutopilotParams:
    """All gains and limits in groups; the defaults are for the aeroplane `endurance`."""

    stabilise: StabiliseParams = field(default_factory=StabiliseParams)
    energy: EnergyParams = field(default_factory=EnergyParams)
    guidance: GuidanceParams = field(default_factory=GuidanceParams)
    launch: LaunchParams = field(default_factory=LaunchParams)
    lift: LiftParams = field(default_factory=LiftParams)
    mixer: MixerParams = field(default_factory=MixerParams)
    route: RouteParams = field(default_factory=RouteParams)
    failsafe: FailsafeParams = field(default_factory=FailsafeParams)
    standby: StandbyParams = field(default_factory=StandbyParams)
    fence: FenceParams = field(default_factory=FenceParams)


# Steeper than the best glide (6.3 m/s, pitch -2.6 degrees): airspeed is not measured, and a pitch estimate 5 degrees
# too low would turn the best glide into a stall (4.6 m/s).
_GLIDE_M_S = 7.4
_GLIDE_PITCH_RAD = math.radians(-5.0)

_GENTLE_LADY = AutopilotParams(
    stabilise=StabiliseParams(
        airspeed_m_s=_GLIDE_M_S,
        # Rudder causes sideslip, which causes roll, with the Dutch roll (period 1.7 s) in between: bank is slow.
        roll_gain_1_s=1.8,
        roll_rate_limit_rad_s=0.5,
        roll_control_per_rate_s=1.2,
        roll_control_per_rate_error_s=0.5,
        roll_control_per_error=0.1,
        pitch_gain_1_s=2.0,
        pitch_rate_limit_rad_s=0.5,
        recovery_pitch_rate_rad_s=0.8,
        elevator_per_pitch_rate_s=0.2,
        elevator_per_rate_error_s=0.2,
        elevator_per_pitch_error=0.6,
        elevator_per_load=0.2,
        load_limit=1.0,
        # The yaw rate of the turn is demanded, so that damping acts on oscillations and not on the turn.
        rudder_per_yaw_rate_s=0.1,
        rudder_per_rate_error_s=0.3,
        # Elevator determines the angle of attack: limited to that of the best glide, whatever the pitch estimate.
        integral_limit=0.12,
    ),
    guidance=GuidanceParams(
        bank_per_heading=0.35,  # a slow aeroplane turns twice as fast at the same bank, and banks more slowly
        bank_limit_rad=math.radians(28.0),
        turn_back_m=45.0,
    ),
    energy=EnergyParams(
        airspeed_m_s=_GLIDE_M_S,
        stall_m_s=4.56,
        best_glide_m_s=6.3,
        fastest_m_s=10.0,
        inverted_m_s=math.nan,  # with roll by dihedral it cannot fly inverted
        inverted_stall_m_s=math.nan,
        # Height is not held: the pitch is that of the glide, or holds its airspeed if known.
        climb_per_height_1_s=0.0,
        height_weight=0.0,
        pitch_trim_rad=_GLIDE_PITCH_RAD,
        pitch_per_lift_rad=math.radians(8.5),  # of the glide, including the steeper path
        throttle_trim=0.0,
        throttle_per_speed_s_m=0.0,
        throttle_per_climb_s_m=0.0,
        throttle_per_height_1_m=0.0,
        throttle_least=0.0,
    ),
    launch=LaunchParams(climb_pitch_rad=_GLIDE_PITCH_RAD, alpha_rad=math.radians(8.5)),
    lift=LiftParams(incidence_per_elevator_rad=0.0),  # its glide pitch alone protects the speed
    mixer=MixerParams(elevator_trim=-0.12, rudder_per_roll=1.0, aileron_limit=0.0, throttle_limit=0.0),
    failsafe=FailsafeParams(
        glide_pitch_rad=_GLIDE_PITCH_RAD,
        low_height_m=10.0,  # it cannot climb: lands with wings nearly level
        safe_height_m=15.0,
        low_bank_rad=math.radians(5.0),
    ),
)

AIRFRAMES: Mapping[str, AutopilotParams] = MappingProxyType(
    {"endurance": AutopilotParams(), "gentle_lady": _GENTLE_LADY}
)


def params_of(aircraft: str) -> AutopilotParams:
    """Gains and limits for `aircraft`; ValueError if there are none."""
    if aircraft not in AIRFRAMES:
        raise ValueError(f"aircraft {aircraft!r}: the autopilot has no gains for it, only for {', '.join(AIRFRAMES)}")
    return AIRFRAMES[aircraft]
