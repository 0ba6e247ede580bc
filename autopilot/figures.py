"""Aerobatic figures as timed set-points, for a script to fly.

A figure is flown by time alone: body rates, each held for the angle that it shall turn over the rate.  The aeroplane
follows late, by as much when a rate begins as when it ends, so that the angle is kept.  What a figure leaves wrong
(speed, crosswind, a gyro that ended) the set-point that is flown `after` it takes up.

Every figure begins with its run-in, wings level at a held pitch, which gathers speed or loses it.  Attitudes that a
figure is said to end with are those of rates followed exactly from the pitch of the run-in.
"""

import math
from dataclasses import replace
from typing import Literal, NamedTuple

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Manoeuvre, Timed

QUARTER, HALF, WHOLE = 0.5 * math.pi, math.pi, 2.0 * math.pi
Axis = Literal["roll", "pitch", "yaw"]


class RunIn(NamedTuple):
    """Wings level before a figure: for how long, at which pitch (negative dives for speed), at which throttle."""

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
    begin_s: float,
    count: int,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(100.0),
    run_in: RunIn = LEVEL,
) -> Manoeuvre:
    """Inside loops, pulled at a constant rate; the attitude is that of the run-in again.

    Parameters
    ----------
    begin_s             start of the run-in, since the release
    count               loops
    after               what to fly when the last loop ends: level flight, usually
    pitch_rate_rad_s    slower is larger and asks more speed at the top, quicker asks more lift at the bottom
    run_in              its throttle is that of the loops too

    Returns
    -------
    Manoeuvre           ends ``run-in + 2 pi count / pitch rate`` after it begins
    """
    _require_positive("inside_loops", count=count, pitch_rate_rad_s=pitch_rate_rad_s)
    return _in_turn(begin_s, after, *_rotated(run_in, ("pitch", count * WHOLE, pitch_rate_rad_s)))


def outside_loops(
    begin_s: float,
    count: int,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(68.0),
    run_in: RunIn = LEVEL,
) -> Manoeuvre:
    """Outside loops, pushed from the top at a constant rate; the attitude is that of the run-in again.

    A cambered wing lifts little and drags much upside down: one loop spends the speed of its run-in.

    Parameters
    ----------
    pitch_rate_rad_s    size of the rate, nose down
    others              see `inside_loops`

    Returns
    -------
    Manoeuvre           ends ``run-in + 2 pi count / pitch rate`` after it begins
    """
    _require_positive("outside_loops", count=count, pitch_rate_rad_s=pitch_rate_rad_s)
    return _in_turn(begin_s, after, *_rotated(run_in, ("pitch", -count * WHOLE, pitch_rate_rad_s)))


def aileron_roll(
    begin_s: float,
    turns: float,
    after: Setpoint,
    *,
    right: bool = True,
    roll_rate_rad_s: float = math.radians(180.0),
    run_in: RunIn = NOSE_UP,
) -> Manoeuvre:
    """Turns about the roll axis without a pause between them; the attitude is that of the run-in again.

    The nose falls while the lift points anywhere but up: the run-in raises it.

    Parameters
    ----------
    turns               whole turns, or halves
    roll_rate_rad_s     size of the rate
    others              see `inside_loops`

    Returns
    -------
    Manoeuvre           ends ``run-in + 2 pi turns / roll rate`` after it begins
    """
    _require_positive("aileron_roll", turns=turns, roll_rate_rad_s=roll_rate_rad_s)
    angle_rad = turns * WHOLE if right else -turns * WHOLE
    return _in_turn(begin_s, after, *_rotated(run_in, ("roll", angle_rad, roll_rate_rad_s)))


def immelmann(
    begin_s: float,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(100.0),
    roll_rate_rad_s: float = math.radians(180.0),
    run_in: RunIn = LEVEL,
) -> Manoeuvre:
    """Half a loop up, then half a roll to the right at its top: level, higher, heading reversed.

    Returns
    -------
    Manoeuvre           ends ``run-in + (pi - pitch of the run-in) / pitch rate + pi / roll rate`` after it begins
    """
    _require_positive("immelmann", pitch_rate_rad_s=pitch_rate_rad_s, roll_rate_rad_s=roll_rate_rad_s)
    up = _rotated(run_in, ("pitch", HALF - run_in.pitch_rad, pitch_rate_rad_s))
    return _in_turn(begin_s, after, *up, _rotation("roll", HALF, roll_rate_rad_s, run_in.throttle))


def split_s(
    begin_s: float,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(100.0),
    roll_rate_rad_s: float = math.radians(180.0),
    run_in: RunIn = NOSE_UP,
) -> Manoeuvre:
    """Half a roll to the right, then half a loop down, motor off: level, lower, heading reversed.

    Returns
    -------
    Manoeuvre           ends ``run-in + pi / roll rate + (pi + pitch of the run-in) / pitch rate`` after it begins
    """
    _require_positive("split_s", pitch_rate_rad_s=pitch_rate_rad_s, roll_rate_rad_s=roll_rate_rad_s)
    roll = _rotated(run_in, ("roll", HALF, roll_rate_rad_s))
    down = _rotation("pitch", HALF + run_in.pitch_rad, pitch_rate_rad_s, throttle=0.0)
    return _in_turn(begin_s, after, *roll, down)


def vertical_climb(
    begin_s: float,
    climb_s: float,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(100.0),
    pull_to_rad: float = QUARTER,
    run_in: RunIn = LEVEL,
) -> Manoeuvre:
    """Pulled to the vertical, then no rates at all for `climb_s`, then pushed over until the nose is level.

    Parameters
    ----------
    climb_s             vertical; pushed over while there is speed left
    pull_to_rad         pitch to pull to: a little beyond the vertical, where the nose falls back as the speed goes
    others              see `inside_loops`

    Returns
    -------
    Manoeuvre           ends ``run-in + (2 pull_to - pitch of the run-in) / pitch rate + climb_s`` after it begins
    """
    climb = _straight_up("vertical_climb", climb_s, pitch_rate_rad_s, pull_to_rad, run_in)
    over = _rotation("pitch", -pull_to_rad, pitch_rate_rad_s, run_in.throttle)
    return _in_turn(begin_s, after, *climb, over)


def stall_turn(
    begin_s: float,
    climb_s: float,
    after: Setpoint,
    *,
    right: bool = False,
    pitch_rate_rad_s: float = math.radians(100.0),
    pull_to_rad: float = QUARTER,
    over_s: float = 1.6,
    dive_s: float = 0.5,
    run_in: RunIn = LEVEL,
) -> Manoeuvre:
    """Vertical climb, full rudder until the nose points down, dive, pull out: level, heading reversed.

    Parameters
    ----------
    climb_s             vertical, without rates, until the rudder can turn the nose over: it lives on the slipstream
    right               which way; the torque of a motor that turns to the right helps to the left
    over_s              full rudder, full throttle; how fast that turns it is the aeroplane's business
    dive_s              straight down before the pull, motor off
    others              see `inside_loops` and `vertical_climb`

    Returns
    -------
    Manoeuvre           ends ``run-in + (2 pull_to - pitch of the run-in) / pitch rate + climb_s + over_s + dive_s``
                        after it begins
    """
    _require_positive("stall_turn", over_s=over_s, dive_s=dive_s)
    climb = _straight_up("stall_turn", climb_s, pitch_rate_rad_s, pull_to_rad, run_in)
    over = Setpoint(Mode.MANUAL, rudder=1.0 if right else -1.0, throttle=run_in.throttle)
    dive = Setpoint(Mode.RATE, throttle=0.0)
    # Yawed round by half a turn, a nose that was beyond the vertical is beyond it by as much coming down.
    pull = _rotation("pitch", pull_to_rad, pitch_rate_rad_s, throttle=0.0)
    return _in_turn(begin_s, after, *climb, _Step(over_s, over), _Step(dive_s, dive), pull)


def spin(
    begin_s: float,
    hold_s: float,
    after: Setpoint,
    *,
    right: bool = False,
    throttle: float = 0.6,
    recovery_s: float = 0.4,
    run_in: RunIn = STALLING,
) -> Manoeuvre:
    """Stalled, spun with the sticks in the corner, and brought out of it by the book.

    Manual control: full rudder and full up-elevator for `hold_s`; then power off, ailerons neutral, full opposite
    rudder, elevator forward.

    Parameters
    ----------
    hold_s              sticks in the corner; how many turns that makes is the aeroplane's business
    right               which way the rudder is put; the torque of a motor that turns to the right helps to the left
    throttle            in the spin: some of it, where the elevator cannot hold the stall without slipstream
    recovery_s          until the rotation has stopped: held longer, the opposite rudder begins something new
    run_in              motor off and nose up until the wing stalls
    others              see `inside_loops`

    Returns
    -------
    Manoeuvre           ends ``run-in + hold_s + recovery_s`` after it begins
    """
    _require_positive("spin", hold_s=hold_s, recovery_s=recovery_s)
    rudder = 1.0 if right else -1.0
    corner = Setpoint(Mode.MANUAL, elevator=1.0, rudder=rudder, throttle=throttle)
    recovery = Setpoint(Mode.MANUAL, elevator=-0.3, rudder=-rudder, throttle=0.0)
    return _in_turn(begin_s, after, *_rotated(run_in), _Step(hold_s, corner), _Step(recovery_s, recovery))


def inverted_circuit(
    begin_s: float,
    course: Setpoint,
    legs: int,
    leg_s: float,
    after: Setpoint,
    *,
    turn_rad: float = QUARTER,
) -> Manoeuvre:
    """Upside down along `legs` courses, each `turn_rad` further round: four right angles are a square.

    Parameters
    ----------
    course      COURSE set-point of the first leg, flown inverted; the roll is the autopilot's
    leg_s       time from one change of course to the next
    after       what to fly then: upright again, usually
    turn_rad    change of course, positive to the right

    Returns
    -------
    Manoeuvre   ends ``legs * leg_s`` after it begins
    """
    _require_positive("inverted_circuit", legs=legs, leg_s=leg_s)
    if course.mode != Mode.COURSE:
        raise ValueError(f"inverted_circuit: course of mode {course.mode.name} must be one of mode COURSE")
    steps = (
        _Step(leg_s, replace(course, inverted=True, course_rad=course.course_rad + i * turn_rad)) for i in range(legs)
    )
    return _in_turn(begin_s, after, *steps)


def _straight_up(
    figure: str, climb_s: float, pitch_rate_rad_s: float, pull_to_rad: float, run_in: RunIn
) -> list[_Step]:
    """The run-in, the pull, and the climb without rates."""
    _require_positive(figure, climb_s=climb_s, pitch_rate_rad_s=pitch_rate_rad_s, pull_to_rad=pull_to_rad)
    pull = _rotated(run_in, ("pitch", pull_to_rad - run_in.pitch_rad, pitch_rate_rad_s))
    return [*pull, _Step(climb_s, Setpoint(Mode.RATE, throttle=run_in.throttle))]


def _rotated(run_in: RunIn, *rotations: tuple[Axis, float, float]) -> list[_Step]:
    """The run-in, and rotations (axis, angle, rate) one after the other at its throttle."""
    _require_positive("run_in", lasts_s=run_in.lasts_s)
    level = Setpoint(Mode.STABILISE, pitch_rad=run_in.pitch_rad, throttle=run_in.throttle)
    return [_Step(run_in.lasts_s, level), *(_rotation(*rotation, run_in.throttle) for rotation in rotations)]


def _rotation(axis: Axis, angle_rad: float, rate_rad_s: float, throttle: float) -> _Step:
    """Turn about a body axis by `angle_rad`, whose sign is the way round, at the size of `rate_rad_s`."""
    rate = math.copysign(rate_rad_s, angle_rad)
    p, q, r = (rate if axis == about else 0.0 for about in ("roll", "pitch", "yaw"))
    return _Step(abs(angle_rad) / rate_rad_s, Setpoint(Mode.RATE, rate_b_rad_s=(p, q, r), throttle=throttle))


def _in_turn(begin_s: float, after: Setpoint, *steps: _Step) -> Manoeuvre:
    """The steps one after the other from `begin_s` on, then `after`."""
    timed, t_s = [], begin_s
    for step in steps:
        timed.append(Timed(t_s, step.setpoint))
        t_s += step.lasts_s
    return Manoeuvre((*timed, Timed(t_s, after)), t_s)


def _require_positive(figure: str, **values: float) -> None:
    """ValueError naming the figure and the argument that is not a positive, finite number; units are in the names."""
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{figure}: {name} = {value!r} must be positive and finite")
