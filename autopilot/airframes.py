"""What the autopilot must know of each aeroplane that it flies: a table of gains and limits by name.

A sailplane is steered by the same code.  What makes it one is here: no ailerons, so that roll control moves the
rudder; no motor, so that height is not held and the pitch is that of the glide, which alone guards the speed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from autopilot.energy import EnergyParams
from autopilot.failsafe import FailsafeParams
from autopilot.guidance import GuidanceParams
from autopilot.launch import LaunchParams
from autopilot.mixer import MixerParams
from autopilot.route import RouteParams
from autopilot.stabilise import StabiliseParams


@dataclass(frozen=True, slots=True)
class AutopilotParams:
    """All gains and limits, a group for each part; the defaults fly the aeroplane `endurance`."""

    stabilise: StabiliseParams = field(default_factory=StabiliseParams)
    energy: EnergyParams = field(default_factory=EnergyParams)
    guidance: GuidanceParams = field(default_factory=GuidanceParams)
    launch: LaunchParams = field(default_factory=LaunchParams)
    mixer: MixerParams = field(default_factory=MixerParams)
    route: RouteParams = field(default_factory=RouteParams)
    failsafe: FailsafeParams = field(default_factory=FailsafeParams)


# Steeper than the best glide (6.3 m/s, pitch -2.6 degrees): nobody measures the airspeed, and an estimate that reads
# 5 degrees too low in pitch would carry the best glide into the stall (4.6 m/s).
_GLIDE_M_S = 7.4
_GLIDE_PITCH_RAD = math.radians(-5.0)

_GENTLE_LADY = AutopilotParams(
    stabilise=StabiliseParams(
        airspeed_m_s=_GLIDE_M_S,
        # Rudder, slip, roll: the Dutch roll (a period of 1.6 s) lies between, so the bank is led slowly.
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
        # The turn's own yaw rate is demanded: the damping holds the nose against the swing, not against the turn.
        rudder_per_yaw_rate_s=0.1,
        rudder_per_rate_error_s=0.3,
        # The elevator held is the angle of attack: no more of it than the best glide has, whatever pitch is believed.
        integral_limit=0.12,
    ),
    guidance=GuidanceParams(
        bank_per_heading=0.35,  # a slow aeroplane turns twice as quickly at the same bank, and banks more slowly
        bank_limit_rad=math.radians(28.0),
        turn_back_m=45.0,
    ),
    energy=EnergyParams(
        airspeed_m_s=_GLIDE_M_S,
        stall_m_s=4.56,
        best_glide_m_s=6.3,
        fastest_m_s=10.0,
        inverted_m_s=math.nan,  # the dihedral by which the rudder rolls it would roll it over again
        inverted_stall_m_s=math.nan,
        # No height is worth a slower flight: the pitch is the glide's, or holds its speed where that is known.
        climb_per_height_1_s=0.0,
        height_weight=0.0,
        pitch_trim_rad=_GLIDE_PITCH_RAD,
        pitch_per_lift_rad=math.radians(8.5),  # of the glide: the path steepens too
        throttle_trim=0.0,
        throttle_per_speed_s_m=0.0,
        throttle_per_climb_s_m=0.0,
        throttle_per_height_1_m=0.0,
        throttle_least=0.0,
    ),
    launch=LaunchParams(climb_pitch_rad=_GLIDE_PITCH_RAD),
    mixer=MixerParams(elevator_trim=-0.12, rudder_per_roll=1.0, aileron_limit=0.0, throttle_limit=0.0),
    failsafe=FailsafeParams(
        glide_pitch_rad=_GLIDE_PITCH_RAD,
        low_height_m=10.0,  # it cannot climb: it lands, with wings near to level
        safe_height_m=15.0,
        low_bank_rad=math.radians(5.0),
    ),
)

AIRFRAMES: Mapping[str, AutopilotParams] = MappingProxyType(
    {"endurance": AutopilotParams(), "gentle_lady": _GENTLE_LADY}
)


def params_of(aircraft: str) -> AutopilotParams:
    """Gains and limits for `aircraft`; ValueError where nobody has tuned them."""
    if aircraft not in AIRFRAMES:
        raise ValueError(f"aircraft {aircraft!r}: the autopilot has no gains for it, only for {', '.join(AIRFRAMES)}")
    return AIRFRAMES[aircraft]
