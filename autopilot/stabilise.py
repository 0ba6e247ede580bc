"""Stabilisation straight from the rows of the direction cosine matrix: no Euler angles, any attitude.

Two loops.  The outer one turns a demanded bank and pitch into demanded body rates; the inner one, which a
scripted stick uses alone, turns body rates into controls.

The *mixing problem* of Premerlani & Bizard (a bank puts the rate of the turn into the pitch gyro, and a
level turn needs up-elevator) has one answer for both halves.  A turn about the vertical, seen in the body,
is ``turn rate * r_z`` (third row of the matrix): what the pitch gyro reads of it is demanded, not damped; and
the lift that a demanded pitch rate needs, ``V q / g + r_zz``, is the up-elevator (1 / r_zz in a level turn).

Inverted flight is upright flight in axes turned half round the nose, ``(r_zx, -r_zy, -r_zz)``: that row, `leaning`,
is what bank and pitch are counted from.  Rolling and the turn about the vertical mean the same in both, pitching
the opposite; the lift that carries the weight, ``r_zz``, comes out negative by itself.

Source: Premerlani & Bizard, Direction Cosine Matrix IMU: Theory, "Using DCM in control and navigation", 1-5.
"""

import math
from dataclasses import dataclass

from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2


@dataclass(frozen=True, slots=True)
class StabiliseParams:
    """Gains of the two loops; the defaults fly the aeroplane `endurance`.

    airspeed_m_s : of cruise; stands in for the airspeed nobody measures
    roll_gain_1_s, pitch_gain_1_s : rate demanded per sine of the error; larger is quicker, then nervous
    roll_rate_limit_rad_s, pitch_rate_limit_rad_s : the most the outer loop asks for; a rate beyond what the gyros
        can tell is never seen to be there, and is flown with full deflection for ever
    recovery_pitch_rate_rad_s : the same with the nose far off
    roll_control_per_rate_s, .._per_rate_error_s, .._per_error : feed-forward, damping, integral; what moves, ailerons
        or a rudder that rolls by way of the dihedral, is the mixer's business
    elevator_per_pitch_rate_s, .._per_rate_error_s, .._per_pitch_error : the same
    elevator_per_load : up-elevator per extra g of lift        load_limit : the extra g it answers to at most
    inverted_lift : lift towards the wheels that the wing has, in units of the weight at cruise; beyond, it stalls
    rudder_per_yaw_rate_s, rudder_per_rate_error_s : feed-forward and damping; no integral
    integral_limit : deflection that the integrals may hold, against motor torque and trim
    """

    airspeed_m_s: float = 12.6
    roll_gain_1_s: float = 3.0
    roll_rate_limit_rad_s: float = 1.5
    pitch_gain_1_s: float = 2.5
    pitch_rate_limit_rad_s: float = 0.8
    recovery_pitch_rate_rad_s: float = 1.4
    roll_control_per_rate_s: float = 0.3
    roll_control_per_rate_error_s: float = 0.12
    roll_control_per_error: float = 0.12
    elevator_per_pitch_rate_s: float = 0.25
    elevator_per_rate_error_s: float = 0.35
    elevator_per_pitch_error: float = 1.0
    elevator_per_load: float = 0.155
    load_limit: float = 3.0
    inverted_lift: float = 1.3
    rudder_per_yaw_rate_s: float = 0.1
    rudder_per_rate_error_s: float = 0.3
    integral_limit: float = 0.3


@kernel
def shorter_way(sine, cosine, leaning):  # type: ignore[no-untyped-def]
    """Size of an error, -1..1, from its sine and cosine: the sine itself, and full beyond 90 degrees.

    sine, cosine : of the error, from a cross and a dot product
    leaning : the way things go now, a hint; decides near 180 degrees, where noise would toss a coin every tick
    """
    if cosine >= 0.0:
        return clip(sine, -1.0, 1.0)
    return 1.0 if sine + leaning >= 0.0 else -1.0


@kernel
def leaning(R_eb, up):  # type: ignore[no-untyped-def]
    """(r_zy, r_zz) as seen by a pilot whose head points up in the flight wanted: `up` 1 upright, -1 inverted."""
    return up * R_eb[2, 1], up * R_eb[2, 2]


@kernel
def roll_error(R_eb, omega_b_rad_s, bank_rad, up):  # type: ignore[no-untyped-def]
    """How far to roll, -1..1, positive to the right: the sine of the missing bank, times the cosine of pitch.

    Cross product of the demanded and the actual vertical in the plane of the wings, (r_zy, r_zz): for wings
    level it is -r_zy.  More than 90 degrees away, upside down above all, it saturates the shorter way round.

    R_eb : shape (3, 3)   omega_b_rad_s : shape (3,)   bank_rad : the demand, within +-90 degrees
    up : 1 upright, -1 where the bank counts from inverted flight
    """
    r_zy, r_zz = leaning(R_eb, up)
    sine = math.sin(bank_rad) * r_zz - math.cos(bank_rad) * r_zy
    cosine = math.cos(bank_rad) * r_zz + math.sin(bank_rad) * r_zy
    return shorter_way(sine, cosine, clip(0.1 * omega_b_rad_s[0], -0.2, 0.2))


@kernel
def turn_rate(R_eb, up, airspeed_m_s):  # type: ignore[no-untyped-def]
    """Rate of the coordinated level turn that belongs to the bank, g tan(bank) / V, rad/s.

    0 where the lift points down: upside down, or upright while inverted flight is wanted.  The tangent
    r_zy / r_zz, the same from either side, is held beyond 60 degrees of bank, where no level turn is flown.
    """
    r_zy, r_zz = leaning(R_eb, up)
    if r_zz <= 0.0:
        return 0.0
    return G_M_S2 / airspeed_m_s * r_zy / max(r_zz, 0.5)


@kernel
def far_off(sine):  # type: ignore[no-untyped-def]
    """How unusual a pitch is, 0..1, from its sine less that of the demand: from 20 degrees off, wholly at 45."""
    return clip((abs(sine) - 0.35) / 0.35, 0.0, 1.0)


@kernel
def rate_demand(R_eb, omega_b_rad_s, bank_rad, pitch_rad, up, airspeed_m_s, p):  # type: ignore[no-untyped-def]
    """Body rates (p, q, r), rad/s, that bring about and then hold a bank and a pitch.

    The coordinated turn, ``turn rate * r_z``, plus what the errors ask for.  The nose is raised by the elevator
    only as far as the lift points up: upside down the aeroplane rolls first.

    R_eb : shape (3, 3)   bank_rad, pitch_rad : demanded, a positive bank turns right over the ground either way
    up : 1 upright, -1 inverted   airspeed_m_s : believed   p : record of StabiliseParams
    """
    r_zx, r_zy, r_zz = R_eb[2, 0], R_eb[2, 1], R_eb[2, 2]
    turn = turn_rate(R_eb, up, airspeed_m_s)
    roll = p.roll_gain_1_s * roll_error(R_eb, omega_b_rad_s, bank_rad, up)
    roll = clip(roll, -p.roll_rate_limit_rad_s, p.roll_rate_limit_rad_s)
    lift_is_up = clip(up * r_zz / max(math.hypot(r_zy, r_zz), 0.1), 0.0, 1.0)  # cosine of the bank
    missing = math.sin(pitch_rad) + r_zx  # r_zx is minus the sine of the pitch
    most = p.pitch_rate_limit_rad_s
    most += far_off(missing) * (p.recovery_pitch_rate_rad_s - most)
    pitch = clip(p.pitch_gain_1_s * missing, -most, most)
    return roll + turn * r_zx, up * pitch * lift_is_up + turn * r_zy, turn * r_zz


@kernel
def extra_lift(pitch_rate_rad_s, r_zz, airspeed_m_s, p):  # type: ignore[no-untyped-def]
    """Lift coefficient in units of that at cruise, less its 1, for a pitch rate: (V q / g + r_zz) (V_c / V)^2 - 1.

    At cruise speed it is the extra load factor: 1 / r_zz - 1 in a level turn, V q / g at the bottom of a loop,
    V q / g - 2 at its top, -2 in level flight on the back.
    """
    load = airspeed_m_s * pitch_rate_rad_s / G_M_S2 + r_zz
    slower = p.airspeed_m_s / airspeed_m_s
    return clip(load * slower * slower, -p.inverted_lift, 1.0 + p.load_limit) - 1.0


@kernel
def hold(integral, error, gain, control, limit, dt_s):  # type: ignore[no-untyped-def]
    """The integral after one tick; it waits while `control` is at its stop in the direction of the error."""
    if (control >= 1.0 and error > 0.0) or (control <= -1.0 and error < 0.0):
        return integral
    return clip(integral + gain * error * dt_s, -limit, limit)


@kernel
def rate_control(demand, R_eb, omega_b_rad_s, airspeed_m_s, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Roll, pitch and yaw control, about -1..1, that make the body follow the demanded rates.

    The integral of a rate error is an angle held: it takes up motor torque, trim, and a gyro bias.  The gains are
    those of cruise.  A deflection makes a moment ~ V^2 against a damping ~ V: for the same rate it goes with 1 / V.

    demand : (p, q, r), rad/s   omega_b_rad_s : shape (3,), drift-corrected   airspeed_m_s : believed
    s : record with `roll_integral`, `pitch_integral`, updated   p : record of StabiliseParams
    """
    slower = p.airspeed_m_s / airspeed_m_s
    roll_wanted, pitch_wanted, yaw_wanted = slower * demand[0], slower * demand[1], slower * demand[2]
    roll_missing = roll_wanted - slower * omega_b_rad_s[0]
    pitch_missing = pitch_wanted - slower * omega_b_rad_s[1]
    yaw_missing = yaw_wanted - slower * omega_b_rad_s[2]
    roll = p.roll_control_per_rate_s * roll_wanted + p.roll_control_per_rate_error_s * roll_missing + s.roll_integral
    pitch = (
        p.elevator_per_load * extra_lift(demand[1], R_eb[2, 2], airspeed_m_s, p)
        + p.elevator_per_pitch_rate_s * pitch_wanted
        + p.elevator_per_rate_error_s * pitch_missing
        + s.pitch_integral
    )
    yaw = p.rudder_per_yaw_rate_s * yaw_wanted + p.rudder_per_rate_error_s * yaw_missing
    limit = p.integral_limit
    s.roll_integral = hold(s.roll_integral, roll_missing, p.roll_control_per_error, roll, limit, dt_s)
    s.pitch_integral = hold(s.pitch_integral, pitch_missing, p.elevator_per_pitch_error, pitch, limit, dt_s)
    return roll, pitch, yaw
