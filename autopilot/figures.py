"""Aerobatic figures as timed setpoints for a script.

A figure is flown by time only: body rates, each for the duration angle / rate.  The aeroplane follows with the same
delay at the start and at the end of a rate, so that the angle is right.  The setpoint flown `after` the figure corrects
remaining errors (speed, crosswind, gyro saturation).

Every figure begins with a run-in, wings level at constant pitch, to gain or lose speed.  Final attitudes are stated for
rates that are followed exactly from the pitch of the run-in.

Parameters of all figures
-------------------------
begin_s             start of the run-in, since the release
after               setpoint after the figure, usually level flight
pitch_rate_rad_s, roll_rate_rad_s    magnitude of the rates.  Lower pitch rate: larger loops, more speed needed at the
                    top; higher: more lift needed at the bottom
run_in              before the figure; its throttle is used in the figure, too, unless stated otherwise
right               direction
"""

import math
from dataclasses import replace
from typing import Literal, NamedTuple

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Manoeuvre, Timed

QUARTER, HALF, WHOLE = 0.5 * math.pi, math.pi, 2.0 * math.pi
Axis = Literal["roll", "pitch", "yaw"]


class RunIn(NamedTuple):
    """Wings level before a figure: duration, pitch (negative: dive for speed) and throttle."""

    lasts_s: float = 3.0
    pitch_rad: float = 0.0
    throttle: float = 1.0


LEVEL = RunIn()
DIVE = RunIn(3.0, math.radians(-20.0), 1.0)
NOSE_UP = RunIn(2.0, math.radians(15.0), 0.8)
STALLING = RunIn(3.0, math.radians(15.0), 0.0)


class _Step(NamedTuple):
    lasts_s: float
    setpoint: Setpoint


def inside_loops(
    begin_s: float, count: int, after: Setpoint, *, pitch_rate_rad_s: float = math.radians(100.0),
    run_in: RunIn = LEVEL,
) -> Manoeuvre:  # fmt: skip
    """`count` inside loops at constant pitch rate, ending at the attitude of the run-in.

    Ends ``run-in + 2 pi count / pitch rate`` after it begins.
    """
    _require_positive("inside_loops", count=count, pitch_rate_rad_s=pitch_rate_rad_s)
    return _in_turn(begin_s, after, *_rotated(run_in, ("pitch", count * WHOLE, pitch_rate_rad_s)))


def outside_loops(
    begin_s: float, count: int, after: Setpoint, *, pitch_rate_rad_s: float = math.radians(68.0),
    run_in: RunIn = LEVEL,
) -> Manoeuvre:  # fmt: skip
    """`count` outside loops, pushed from the top at constant pitch rate, ending at the attitude of the run-in.

    Inverted, a cambered wing has little lift and much drag: one loop uses up the speed of the run-in.
    Ends ``run-in + 2 pi count / pitch rate`` after it begins.
    """
    _require_positive("outside_loops", count=count, pitch_rate_rad_s=pitch_rate_rad_s)
    return _in_turn(begin_s, after, *_rotated(run_in, ("pitch", -count * WHOLE, pitch_rate_rad_s)))


def aileron_roll(
    begin_s: float, turns: float, after: Setpoint, *, right: bool = True,
    roll_rate_rad_s: float = math.radians(180.0), run_in: RunIn = NOSE_UP,
) -> Manoeuvre:  # fmt: skip
    """`turns` continuous aileron rolls, also halves, ending at the attitude of the run-in.

    The nose drops during the roll, as the lift points sideways and down: the run-in raises it.
    Ends ``run-in + 2 pi turns / roll rate`` after it begins.
    """
    _require_positive("aileron_roll", turns=turns, roll_rate_rad_s=roll_rate_rad_s)
    angle_rad = turns * WHOLE if right else -turns * WHOLE
    return _in_turn(begin_s, after, *_rotated(run_in, ("roll", angle_rad, roll_rate_rad_s)))


def immelmann(
    begin_s: float, after: Setpoint, *, pitch_rate_rad_s: float = math.radians(100.0),
    roll_rate_rad_s: float = math.radians(180.0), run_in: RunIn = LEVEL,
) -> Manoeuvre:  # fmt: skip
    """Half loop up, then half roll to the right: ends level and higher, heading reversed.

    Ends ``run-in + (pi - pitch of the run-in) / pitch rate + pi / roll rate`` after it begins.
    """
    _require_positive("immelmann", pitch_rate_rad_s=pitch_rate_rad_s, roll_rate_rad_s=roll_rate_rad_s)
    up = _rotated(run_in, ("pitch", HALF - run_in.pitch_rad, pitch_rate_rad_s))
    return _in_turn(begin_s, after, *up, _rotation("roll", HALF, roll_rate_rad_s, run_in.throttle))


def split_s(
    begin_s: float, after: Setpoint, *, pitch_rate_rad_s: float = math.radians(100.0),
    roll_rate_rad_s: float = math.radians(180.0), run_in: RunIn = NOSE_UP,
) -> Manoeuvre:  # fmt: skip
    """Half roll to the right, then half loop down, motor off: ends level and lower, heading reversed.

    Ends ``run-in + pi / roll rate + (pi + pitch of the run-in) / pitch rate`` after it begins.
    """
    _require_positive("split_s", pitch_rate_rad_s=pitch_rate_rad_s, roll_rate_rad_s=roll_rate_rad_s)
    roll = _rotated(run_in, ("roll", HALF, roll_rate_rad_s))
    down = _rotation("pitch", HALF + run_in.pitch_rad, pitch_rate_rad_s, throttle=0.0)
    return _in_turn(begin_s, after, *roll, down)


def vertical_climb(
    begin_s: float, climb_s: float, after: Setpoint, *, pitch_rate_rad_s: float = math.radians(100.0),
    pull_to_rad: float = QUARTER, run_in: RunIn = LEVEL,
) -> Manoeuvre:  # fmt: skip
    """Pull to the vertical, zero rates for `climb_s`, then push over to a level nose.

    Ends ``run-in + (2 pull_to - pitch of the run-in) / pitch rate + climb_s`` after it begins.

    climb_s : of the vertical part, ending with some speed left
    pull_to_rad : pitch at the end of the pull, slightly beyond the vertical if the nose falls back when slow
    """
    climb = _straight_up("vertical_climb", climb_s, pitch_rate_rad_s, pull_to_rad, run_in)
    over = _rotation("pitch", -pull_to_rad, pitch_rate_rad_s, run_in.throttle)
    return _in_turn(begin_s, after, *climb, over)


def stall_turn(
    begin_s: float, climb_s: float, after: Setpoint, *, right: bool = False,
    pitch_rate_rad_s: float = math.radians(100.0), pull_to_rad: float = QUARTER, over_s: float = 1.6,
    dive_s: float = 0.5, run_in: RunIn = LEVEL,
) -> Manoeuvre:  # fmt: skip
    """Vertical climb, full rudder until the nose points down, dive, pull-out: ends level, heading reversed.

    Ends ``run-in + (2 pull_to - pitch of the run-in) / pitch rate + climb_s + over_s + dive_s`` after it begins.

    climb_s : of the vertical part, until the rudder in the slipstream can turn the nose over
    pull_to_rad : see `vertical_climb`       right : the torque of a clockwise motor helps to the left
    over_s : of full rudder and throttle; the yaw rate depends on the aeroplane
    dive_s : of the vertical dive before the pull, motor off
    """
    _require_positive("stall_turn", over_s=over_s, dive_s=dive_s)
    climb = _straight_up("stall_turn", climb_s, pitch_rate_rad_s, pull_to_rad, run_in)
    over = Setpoint(Mode.MANUAL, rudder=1.0 if right else -1.0, throttle=run_in.throttle)
    dive = Setpoint(Mode.RATE, throttle=0.0)
    # After yawing by 180 degrees, a nose beyond the vertical is beyond it by the same angle pointing down.
    pull = _rotation("pitch", pull_to_rad, pitch_rate_rad_s, throttle=0.0)
    return _in_turn(begin_s, after, *climb, _Step(over_s, over), _Step(dive_s, dive), pull)


def spin(
    begin_s: float, hold_s: float, after: Setpoint, *, right: bool = False, throttle: float = 0.6,
    recovery_s: float = 0.4, run_in: RunIn = STALLING,
) -> Manoeuvre:  # fmt: skip
    """Stall, spin with full rudder and up-elevator, and standard recovery.

    Manual control: full rudder and full up-elevator for `hold_s`; then power off, ailerons neutral, full opposite
    rudder, elevator forward.  Ends ``run-in + hold_s + recovery_s`` after it begins.

    hold_s : of the spin controls; the number of turns depends on the aeroplane
    right : of the rudder; the torque of a clockwise motor helps to the left
    throttle : in the spin, above 0 if the elevator cannot hold the stall without slipstream
    recovery_s : until the rotation stops; longer opposite rudder may start a new spin
    run_in : motor off and nose up until the wing stalls
    """
    _require_positive("spin", hold_s=hold_s, recovery_s=recovery_s)
    rudder = 1.0 if right else -1.0
    corner = Setpoint(Mode.MANUAL, elevator=1.0, rudder=rudder, throttle=throttle)
    recovery = Setpoint(Mode.MANUAL, elevator=-0.3, rudder=-rudder, throttle=0.0)
    return _in_turn(begin_s, after, *_rotated(run_in), _Step(hold_s, corner), _Step(recovery_s, recovery))


def inverted_circuit(
    begin_s: float, course: Setpoint, legs: int, leg_s: float, after: Setpoint, *, turn_rad: float = QUARTER
) -> Manoeuvre:  # fmt: skip
    """Inverted flight along `legs` courses, each turned by `turn_rad`: four right angles form a square.

    Ends ``legs * leg_s`` after it begins.

    course : COURSE setpoint of the first leg, flown inverted; the autopilot does the roll
    leg_s : between course changes            turn_rad : positive to the right
    """
    _require_positive("inverted_circuit", legs=legs, leg_s=leg_s)
    if course.mode != Mode.COURSE:
        raise ValueError(f"inverted_circuit: course of mode {course.mode.name}: must be of mode COURSE")
    steps = (
        _Step(leg_s, replace(course, inverted=True, course_rad=course.course_rad + i * turn_rad)) for i in range(legs)
    )
    return _in_turn(begin_s, after, *steps)


def _straight_up(
    figure: str, climb_s: float, pitch_rate_rad_s: float, pull_to_rad: float, run_in: RunIn
) -> list[_Step]:
    """The run-in, the pull, and the climb at zero rates."""
    _require_positive(figure, climb_s=climb_s, pitch_rate_rad_s=pitch_rate_rad_s, pull_to_rad=pull_to_rad)
    pull = _rotated(run_in, ("pitch", pull_to_rad - run_in.pitch_rad, pitch_rate_rad_s))
    return [*pull, _Step(climb_s, Setpoint(Mode.RATE, throttle=run_in.throttle))]


def _rotated(run_in: RunIn, *rotations: tuple[Axis, float, float]) -> list[_Step]:
    """The run-in, then rotations (axis, angle, rate) at its throttle."""
    _require_positive("run_in", lasts_s=run_in.lasts_s)
    level = Setpoint(Mode.STABILISE, pitch_rad=run_in.pitch_rad, throttle=run_in.throttle)
    return [_Step(run_in.lasts_s, level), *(_rotation(*rotation, run_in.throttle) for rotation in rotations)]


def _rotation(axis: Axis, angle_rad: float, rate_rad_s: float, throttle: float) -> _Step:
    """Rotation about a body axis by the signed `angle_rad`, at the magnitude `rate_rad_s`."""
    rate = math.copysign(rate_rad_s, angle_rad)
    p, q, r = (rate if axis == about else 0.0 for about in ("roll", "pitch", "yaw"))
    return _Step(abs(angle_rad) / rate_rad_s, Setpoint(Mode.RATE, rate_b_rad_s=(p, q, r), throttle=throttle))


def _in_turn(begin_s: float, after: Setpoint, *steps: _Step) -> Manoeuvre:
    """The steps in order from `begin_s`, then `after`."""
    timed, t_s = [], begin_s
    for step in steps:
        timed.append(Timed(t_s, step.setpoint))
        t_s += step.lasts_s
    return Manoeuvre((*timed, Timed(t_s, after)), t_s)


def _require_positive(figure: str, **values: float) -> None:
    """ValueError with the figure and the argument that is not positive and finite; names contain the units."""
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{figure}: {name} = {value!r} must be positive and finite")
