"""The scripted stick: set-points by time since the release, and builders of whole manoeuvres."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from autopilot.interface import Mode, Setpoint


class Timed(NamedTuple):
    """A set-point and the time from which it holds, counted from the release."""

    t_s: float
    setpoint: Setpoint


class Script:
    """Set-points by time, immutable.  Before its time the first one holds already, the last one holds on.

    Parameters
    ----------
    timed : of `Timed`, or pairs (t_s, setpoint)     times must increase

    Raises
    ------
    ValueError      where there is no set-point, or a time is not finite or not after the one before
    """

    __slots__ = ("_setpoints", "_times")

    def __init__(self, timed: Iterable[tuple[float, Setpoint]]) -> None:
        self._times, self._setpoints = tuple(zip(*timed, strict=True)) or ((), ())
        if not self._times:
            raise ValueError("Script: no set-point; give at least one, Timed(0.0, Setpoint(Mode.STABILISE))")
        for before, t_s in zip((-math.inf, *self._times), self._times, strict=False):
            if not (math.isfinite(t_s) and t_s > before):
                raise ValueError(f"Script: t_s {t_s!r} s must be finite and later than {before!r} s")

    def at(self, t_s: float) -> Setpoint:
        """The set-point in force at `t_s` since the release: the same object until the next one is due."""
        return self._setpoints[max(bisect_right(self._times, t_s) - 1, 0)]

    def __iter__(self) -> Iterator[Timed]:
        return map(Timed, self._times, self._setpoints)

    def __len__(self) -> int:
        return len(self._times)


class Manoeuvre(NamedTuple):
    """Part of a script, and the time since the release at which its last figure ends."""

    timed: tuple[Timed, ...]
    ends_s: float


def inside_loops(
    begin_s: float,
    count: int,
    after: Setpoint,
    *,
    pitch_rate_rad_s: float = math.radians(100.0),
    run_in_s: float = 3.0,
    run_in_pitch_rad: float = 0.0,
    throttle: float = 1.0,
) -> Manoeuvre:
    """Inside loops at a constant pitch rate, wings left alone, after a run-in that gathers speed.

    Parameters
    ----------
    begin_s             start of the run-in, since the release
    count               loops
    after               what to fly when the last loop ends: level flight, usually
    pitch_rate_rad_s    slower is larger and asks more speed at the top, quicker asks more lift at the bottom
    run_in_s, run_in_pitch_rad   wings level, before the pull: time and pitch
    throttle            of run-in and loops, 0..1

    Returns
    -------
    Manoeuvre           `ends_s` is when the last loop ends, 2 pi / pitch rate each
    """
    if count < 1 or not pitch_rate_rad_s > 0.0 or not run_in_s > 0.0:
        raise ValueError(
            f"inside_loops: count {count}, pitch_rate_rad_s {pitch_rate_rad_s!r}, run_in_s {run_in_s!r} s "
            "must be at least 1, and positive"
        )
    pull_s = begin_s + run_in_s
    ends_s = pull_s + count * 2.0 * math.pi / pitch_rate_rad_s
    run_in = Setpoint(Mode.STABILISE, pitch_rad=run_in_pitch_rad, throttle=throttle)
    pull = Setpoint(Mode.RATE, rate_b_rad_s=(0.0, pitch_rate_rad_s, 0.0), throttle=throttle)
    return Manoeuvre((Timed(begin_s, run_in), Timed(pull_s, pull), Timed(ends_s, after)), ends_s)


def reversals(begin_s: float, every_s: float, count: int, course: Setpoint) -> Manoeuvre:
    """Course reversals: `count` times half a turn, the first at `begin_s`, `every_s` apart.

    Parameters
    ----------
    course      COURSE set-point flown before the first reversal; its bank limit is the bank of the turns

    Returns
    -------
    Manoeuvre   `ends_s` is when the last turn begins; when it is over depends on wind and bank
    """
    if count < 1 or not every_s > 0.0 or course.mode != Mode.COURSE:
        raise ValueError(
            f"reversals: count {count}, every_s {every_s!r} s, mode {course.mode.name} "
            "must be at least 1, positive, and COURSE"
        )
    timed = tuple(
        Timed(begin_s + i * every_s, replace(course, course_rad=course.course_rad + math.pi * ((i + 1) % 2)))
        for i in range(count)
    )
    return Manoeuvre(timed, timed[-1].t_s)
