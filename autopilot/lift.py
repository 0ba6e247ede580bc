"""Airspeed from the elevator: protects the speed when the motor gives less than the throttle asks.

Without a pitot tube nothing measures the airspeed, and that from an estimated wind is late.  An aeroplane that is
stable in pitch needs more up-elevator the slower it flies: the angle of attack is proportional to it, apart from what
the pitch rate q takes,

    a - a_c = i (e - d q V_c / V)

and a wing at the angle of attack a carries n times the weight at the speed

    V = V_c sqrt(n / (1 + (a - a_c) / k))

with V_c and a_c of cruise and k the angle of attack per lift coefficient relative to cruise (`pitch_per_lift_rad`).
The load n comes from the accelerometer.  No attitude is used: when the motor stops, an estimator without airspeed takes
the deceleration for a lowered nose.

The elevator also has the errors of the trim, so that this airspeed is too rough to be held; it only limits the climb
demand near the stall (`autopilot.energy`).  `tests/physics` compares it with the trimmed model.

Source: B. Etkin & L. D. Reid, Dynamics of Flight, section 2.4 (elevator angle to trim) and 3.1 (with pitch rate).
"""

import math
from dataclasses import dataclass

from autopilot.interface import LAUNCH
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from estimator.params.shared import FORCE_RANGE_M_S2, GYRO_RANGE_RAD_S


@dataclass(frozen=True, slots=True)
class LiftParams:
    """Elevator and lift; the defaults are for the aeroplane `endurance`.

    incidence_per_elevator_rad : angle of attack per full elevator, 0: no airspeed from the elevator (rad, default
        27 deg).  Higher: the nose goes down at a higher speed; lower: may stall
    elevator_per_rate_s : elevator per pitch rate at cruise (s, default 0.34).  Lower: turns look slower than they are
    lift_filter_s : time constant of the airspeed (s, default 1).  Higher: smoother but later
    """

    incidence_per_elevator_rad: float = math.radians(27.0)
    elevator_per_rate_s: float = 0.34
    lift_filter_s: float = 1.0


@kernel
def feel_lift(row, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Update the airspeed from the elevator, m/s, `s.lift_m_s`, 0 if unknown; call once per tick.

    row : measured   s : record with `elevator`, the last command, the mode, and `lift_m_s`, updated
    p : record of AutopilotParams
    """
    e, lift = p.energy, p.lift
    down_m_s2, pitching_rad_s = row.force_b_m_s2[2], row.gyro_b_rad_s[1]
    being_thrown = s.mode == LAUNCH and s.thrown_s < p.launch.full_throttle_s
    if s.inverted or being_thrown or lift.incidence_per_elevator_rad <= 0.0:
        s.lift_m_s = 0.0
    elif abs(down_m_s2) <= FORCE_RANGE_M_S2 and abs(pitching_rad_s) <= GYRO_RANGE_RAD_S:  # else a bad sample
        if s.lift_m_s <= 0.0:
            s.lift_m_s = e.airspeed_m_s
        elevator = s.elevator - lift.elevator_per_rate_s * pitching_rad_s * e.airspeed_m_s / s.lift_m_s
        coefficient = 1.0 + lift.incidence_per_elevator_rad * elevator / e.pitch_per_lift_rad
        load = clip(-down_m_s2 / G_M_S2, 0.0, 4.0)
        carried_m_s = e.airspeed_m_s * clip(math.sqrt(load / max(coefficient, 0.1)), 0.4, 2.0)
        s.lift_m_s += dt_s / (lift.lift_filter_s + dt_s) * (carried_m_s - s.lift_m_s)
