"""From roll, pitch and yaw control to aileron, elevator, rudder and throttle, within their limits."""

from dataclasses import dataclass

from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel


@dataclass(frozen=True, slots=True)
class MixerParams:
    """Trim and mixing.

    aileron_trim, elevator_trim, rudder_trim : deflection in level flight at cruise, -1..1 (default 0).  Wrong ones
        must be learnt by the integrators
    rudder_per_roll : rudder per roll control (default 0.4): against adverse yaw, or 1 without ailerons, to roll by
        sideslip and dihedral.  Higher: turns skid; lower: they slip
    aileron_limit, elevator_limit, rudder_limit, throttle_limit : largest command, 0..1; 0 if not fitted (default 1).
        Lower: less control authority
    """

    aileron_trim: float = 0.0
    elevator_trim: float = 0.0
    rudder_trim: float = 0.0
    rudder_per_roll: float = 0.4
    aileron_limit: float = 1.0
    elevator_limit: float = 1.0
    rudder_limit: float = 1.0
    throttle_limit: float = 1.0


@kernel
def mix(roll, pitch, yaw, throttle, p):  # type: ignore[no-untyped-def]
    """Surfaces -1..1 (roll right, nose up, nose right) and throttle 0..1.  p : record of MixerParams."""
    aileron = clip(p.aileron_trim + roll, -p.aileron_limit, p.aileron_limit)
    elevator = clip(p.elevator_trim + pitch, -p.elevator_limit, p.elevator_limit)
    rudder = clip(p.rudder_trim + yaw + p.rudder_per_roll * roll, -p.rudder_limit, p.rudder_limit)
    return aileron, elevator, rudder, clip(throttle, 0.0, p.throttle_limit)
