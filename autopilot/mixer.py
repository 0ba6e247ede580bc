"""From roll, pitch and yaw control to aileron, elevator, rudder and throttle, within their limits."""

from dataclasses import dataclass

from estimator.jit import kernel
from estimator.kernels import clip


@dataclass(frozen=True, slots=True)
class MixerParams:
    """Trim and mixing.

    aileron_trim, elevator_trim, rudder_trim : deflection of hands-off level flight at cruise, -1..1
    rudder_per_aileron : rudder that goes with aileron, against its adverse yaw
    surface_limit : 0..1, the most of its travel that a surface is given
    """

    aileron_trim: float = 0.0
    elevator_trim: float = 0.0
    rudder_trim: float = 0.0
    rudder_per_aileron: float = 0.4
    surface_limit: float = 1.0


@kernel
def mix(roll, pitch, yaw, throttle, p):  # type: ignore[no-untyped-def]
    """Surfaces -1..1 (roll right, nose up, nose right) and throttle 0..1.  p : record of MixerParams."""
    limit = p.surface_limit
    aileron = clip(p.aileron_trim + roll, -limit, limit)
    elevator = clip(p.elevator_trim + pitch, -limit, limit)
    rudder = clip(p.rudder_trim + yaw + p.rudder_per_aileron * roll, -limit, limit)
    return aileron, elevator, rudder, clip(throttle, 0.0, 1.0)
