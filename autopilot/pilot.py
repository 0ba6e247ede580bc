"""The scripted pilot: setpoints by time since the release; see `autopilot.figures` for figures."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from autopilot.interface import Mode, Setpoint


class Timed(NamedTuple):
    """A setpoint and its start time, since the release."""

    t_s: float
    setpoint: Setpoint


class Script:
    """Setpoints by time, immutable.  The first one also holds before its time, the last one until the end.

    Parameters
    ----------
    timed : of `Timed`, or pairs (t_s, setpoint)     times must increase

    Raises
    ------
    ValueError      no setpoint, or a time that is not finite or not after the previous one
    """

    __slots__ = ("_setpoints", "_times")

    def __init__(self, timed: Iterable[tuple[float, Setpoint]]) -> None:
        self._times, self._setpoints = tuple(zip(*timed, strict=True)) or ((), ())
        if not self._times:
            raise ValueError("Script: no setpoint; give at least one, Timed(0.0, Setpoint(Mode.STABILISE))")
        for before, t_s in zip((-math.inf, *self._times), self._times, strict=False):
            if not (math.isfinite(t_s) and t_s > before):
                raise ValueError(f"Script: t_s {t_s!r} s must be finite and later than {before!r} s")

    def at(self, t_s: float) -> Setpoint:
        """The setpoint at `t_s` since the release: the same object until the next one starts."""
        return self._setpoints[max(bisect_right(self._times, t_s) - 1, 0)]

    def __iter__(self) -> Iterator[Timed]:
        return map(Timed, self._times, self._setpoints)

    def __len__(self) -> int:
        return len(self._times)


class Manoeuvre(NamedTuple):
    """Part of a script, and the time since the release at which it ends."""

    timed: tuple[Timed, ...]
    ends_s: float


def reversals(begin_s: float, every_s: float, count: int, course: Setpoint) -> Manoeuvre:
    """Course reversals: `count` turns by 180 degrees, the first at `begin_s`, `every_s` apart.

    Parameters
    ----------
    course      COURSE setpoint before the first reversal; its bank limit is the bank of the turns

    Returns
    -------
    Manoeuvre   `ends_s` is the start of the last turn; its end depends on wind and bank
    """
    if count < 1 or not every_s > 0.0 or course.mode != Mode.COURSE:
        raise ValueError(
            f"reversals: count {count}, every_s {every_s!r} s, mode {course.mode.name}: "
            "must be at least 1, positive, and COURSE"
        )
    timed = tuple(
        Timed(begin_s + i * every_s, replace(course, course_rad=course.course_rad + math.pi * ((i + 1) % 2)))
        for i in range(count)
    )
    return Manoeuvre(timed, timed[-1].t_s)
