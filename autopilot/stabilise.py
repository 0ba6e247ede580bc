"""Stabilisation from the rows of the direction cosine matrix, without Euler angles, at any attitude.

Two loops: the outer one converts demanded bank and pitch to demanded body rates; the inner one, used alone in RATE,
converts body rates to controls.

The *mixing problem* of Premerlani & Bizard (in a bank the pitch gyro senses the turn, and a level turn needs
up-elevator) has one solution for both parts.  A turn about the vertical in body axes is ``turn rate * r_z`` (third row
of the matrix): that pitch rate is demanded, not damped; and the lift of a demanded pitch rate, ``V q / g + r_zz``,
gives the up-elevator (1 / r_zz in a level turn).

Inverted flight is upright flight in axes rotated by 180 degrees about the nose, ``(r_zx, -r_zy, -r_zz)``: bank and
pitch are relative to that row, `leaning`.  Roll and the turn about the vertical keep their sign, pitch is reversed;
the lift that carries the weight, ``r_zz``, becomes negative.

Source: Premerlani & Bizard, Direction Cosine Matrix IMU: Theory, "Using DCM in control and navigation", 1-5.
"""

import math
from dataclasses import dataclass

from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2


@dataclass(frozen=True, slots=True)
class StabiliseParams:
    """Gains of the two loops; the defaults are for the aeroplane `endurance`.

    airspeed_m_s : cruise speed, for which the gains hold (m/s, default 12.6).  Higher: larger deflections
    roll_gain_1_s, pitch_gain_1_s : rate demand per sine of the error (1/s, default 3 and 2.5).  Higher: faster, then
        oscillates; lower: sluggish
    roll_rate_limit_rad_s, pitch_rate_limit_rad_s : of the outer loop (rad/s, default 1.5 and 0.8).  Higher: faster
        large changes; must stay within the gyro range, or full deflection persists.  Lower: gentler
    recovery_pitch_rate_rad_s : pitch rate limit far from the demand (rad/s, default 1.4).  Higher: faster recovery
    roll_control_per_rate_s, roll_control_per_rate_error_s, roll_control_per_error : feed-forward (s), damping (s) and
        integral gain in roll (default 0.3, 0.12, 0.12).  Higher: stiffer, then oscillates; lower: drifts, overshoots
    elevator_per_pitch_rate_s, elevator_per_rate_error_s, elevator_per_pitch_error : the same in pitch (default 0.25,
        0.35, 1).  Higher and lower: as in roll
    elevator_per_load : up-elevator per extra g of lift (default 0.155).  Higher: climbs in turns; lower: sinks
    load_limit : largest extra g compensated (default 3).  Lower: the nose drops in steep turns
    inverted_lift : lift available inverted, over the weight at cruise (default 1.3).  Higher: may stall inverted
    rudder_per_yaw_rate_s, rudder_per_rate_error_s : feed-forward and damping in yaw (s, default 0.1 and 0.3).  Higher:
        less sideslip in turns, then tail-wag
    integral_limit : largest deflection of the integrators (default 0.3).  Higher: more trim and motor torque can be
        learnt, and more wound up
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
    """Error, -1..1, from its sine and cosine: the sine up to 90 degrees, +-1 beyond.

    sine, cosine : of the error, from a cross and a dot product
    leaning : present tendency, which decides near 180 degrees, where noise would change the sign every tick
    """
    if cosine >= 0.0:
        return clip(sine, -1.0, 1.0)
    return 1.0 if sine + leaning >= 0.0 else -1.0


@kernel
def leaning(R_eb, up):  # type: ignore[no-untyped-def]
    """(r_zy, r_zz) relative to the demanded flight: `up` 1 upright, -1 inverted."""
    return up * R_eb[2, 1], up * R_eb[2, 2]


@kernel
def roll_error(R_eb, omega_b_rad_s, bank_rad, up):  # type: ignore[no-untyped-def]
    """Roll error, -1..1, positive to the right: the sine of the bank error times the cosine of pitch.

    Cross product of the demanded and the actual vertical in the y-z plane, (r_zy, r_zz): -r_zy for wings level.  Beyond
    90 degrees, for example inverted, it saturates in the shorter direction.

    R_eb : shape (3, 3)   omega_b_rad_s : shape (3,)   bank_rad : the demand, within +-90 degrees
    up : 1 upright, -1 if the bank is relative to inverted flight
    """
    r_zy, r_zz = leaning(R_eb, up)
    sine = math.sin(bank_rad) * r_zz - math.cos(bank_rad) * r_zy
    cosine = math.cos(bank_rad) * r_zz + math.sin(bank_rad) * r_zy
    return shorter_way(sine, cosine, clip(0.1 * omega_b_rad_s[0], -0.2, 0.2))


@kernel
def turn_rate(R_eb, up, airspeed_m_s):  # type: ignore[no-untyped-def]
    """Rate of the coordinated level turn at the present bank, g tan(bank) / V, rad/s.

    0 if the lift points down: inverted, or upright while inverted flight is demanded.  The tangent r_zy / r_zz is
    limited beyond 60 degrees of bank, where level turns are not flown.
    """
    r_zy, r_zz = leaning(R_eb, up)
    if r_zz <= 0.0:
        return 0.0
    return G_M_S2 / airspeed_m_s * r_zy / max(r_zz, 0.5)


@kernel
def far_off(sine):  # type: ignore[no-untyped-def]
    """Weight of a large pitch error, 0..1, from the difference of sines: 0 up to 20 degrees, 1 from 45."""
    return clip((abs(sine) - 0.35) / 0.35, 0.0, 1.0)


@kernel
def rate_demand(R_eb, omega_b_rad_s, bank_rad, pitch_rad, up, airspeed_m_s, p):  # type: ignore[no-untyped-def]
    """Body rates (p, q, r), rad/s, that reach and hold a bank and a pitch.

    The coordinated turn, ``turn rate * r_z``, plus rates from the errors.  The elevator raises the nose only as far as
    the lift points up: if inverted, the aeroplane rolls first.

    R_eb : shape (3, 3)   bank_rad, pitch_rad : demanded; a positive bank turns right over the ground in both cases
    up : 1 upright, -1 inverted   airspeed_m_s : true, known or assumed   p : record of StabiliseParams
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
def extra_lift(pitch_rate_rad_s, r_zz, airspeed_m_s, true_factor, p):  # type: ignore[no-untyped-def]
    """Lift coefficient of a pitch rate over that at cruise, minus 1: (V q / g + r_zz) (V_c / V)^2 - 1.

    At cruise speed it is the extra load factor: 1 / r_zz - 1 in a level turn, V q / g at the bottom of a loop,
    V q / g - 2 at its top, -2 in inverted level flight.  V q takes the true airspeed, V_c / V equivalent ones.
    """
    load = true_factor * airspeed_m_s * pitch_rate_rad_s / G_M_S2 + r_zz
    slower = p.airspeed_m_s / airspeed_m_s
    return clip(load * slower * slower, -p.inverted_lift, 1.0 + p.load_limit) - 1.0


@kernel
def hold(integral, error, gain, control, limit, dt_s):  # type: ignore[no-untyped-def]
    """The integral after one tick; frozen while `control` is saturated in the direction of the error."""
    if (control >= 1.0 and error > 0.0) or (control <= -1.0 and error < 0.0):
        return integral
    return clip(integral + gain * error * dt_s, -limit, limit)


@kernel
def rate_control(demand, R_eb, omega_b_rad_s, airspeed_m_s, true_factor, s, p, dt_s):  # type: ignore[no-untyped-def]
    """Roll, pitch and yaw control, about -1..1, to follow the demanded rates.

    The integral of a rate error holds an angle; it compensates motor torque, trim and gyro bias.  The gains are those
    of cruise: a deflection gives a moment ~ V^2 against damping ~ V, so that it scales with 1 / V for the same rate.

    demand : (p, q, r), rad/s   omega_b_rad_s : shape (3,), drift-corrected   airspeed_m_s : equivalent, known or
    assumed   true_factor : true airspeed over it   s : record with `roll_integral`, `pitch_integral`, updated
    p : record of StabiliseParams
    """
    slower = p.airspeed_m_s / airspeed_m_s
    roll_wanted, pitch_wanted, yaw_wanted = slower * demand[0], slower * demand[1], slower * demand[2]
    roll_missing = roll_wanted - slower * omega_b_rad_s[0]
    pitch_missing = pitch_wanted - slower * omega_b_rad_s[1]
    yaw_missing = yaw_wanted - slower * omega_b_rad_s[2]
    roll = p.roll_control_per_rate_s * roll_wanted + p.roll_control_per_rate_error_s * roll_missing + s.roll_integral
    pitch = (
        p.elevator_per_load * extra_lift(demand[1], R_eb[2, 2], airspeed_m_s, true_factor, p)
        + p.elevator_per_pitch_rate_s * pitch_wanted
        + p.elevator_per_rate_error_s * pitch_missing
        + s.pitch_integral
    )
    yaw = p.rudder_per_yaw_rate_s * yaw_wanted + p.rudder_per_rate_error_s * yaw_missing
    limit = p.integral_limit
    s.roll_integral = hold(s.roll_integral, roll_missing, p.roll_control_per_error, roll, limit, dt_s)
    s.pitch_integral = hold(s.pitch_integral, pitch_missing, p.elevator_per_pitch_error, pitch, limit, dt_s)
    return roll, pitch, yaw
