"""Ctrl-C, SIGTERM and the time limit, distinguished from exceptions of flight code.

Flight code may raise anything, even KeyboardInterrupt; that is a result of the flight.  A real Ctrl-C, a CI system
that cancels (SIGTERM) and the time limit of a flight must still take effect.  The handlers installed here raise their
own exceptions, and keep a record in case flight code catches them.

While a kernel is compiled the handlers do not raise: the compiler calls back from C, where exceptions are printed and
lost.  The exception is raised at the next step of the compiler instead.

Python allows signal handlers only in the main thread; elsewhere the blocks below have no effect.
"""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from estimator.compiler import compiling

ECHO_S = 0.5  # a second signal within this time is the same one, passed on by both terminal and parent
REPEAT_S = 1.0  # between reminders after the time limit
# Signals that end a command: Ctrl-C, cancelled by CI, terminal closed.
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Interrupted(KeyboardInterrupt):
    """The command has been interrupted."""


class TimedOut(BaseException):
    """The time limit of this flight has passed."""


class _Limit(NamedTuple):
    """Time limit of a block, its start, and the compile time up to then; seconds."""

    seconds: float
    began_s: float
    spent_s: float

    @property
    def left_s(self) -> float:
        """Remaining time; compiling does not count."""
        return self.seconds + (compiling.spent_s() - self.spent_s) - (time.monotonic() - self.began_s)


class _Heard:
    """Signals received by the handlers of this process."""

    at_s: float | None = None  # time of the last signal that ends the command
    time_up = False
    limit = _Limit(math.inf, 0.0, 0.0)
    held: type[BaseException] | None = None  # to be raised at the next step of the compiler
    extended: Callable[[float], None] | None = None


_heard = _Heard()


@contextmanager
def listening() -> Iterator[None]:
    """Raise `Interrupted` on Ctrl-C, SIGTERM and SIGHUP inside the block.

    Signals that are ignored (``nohup``) or have another handler are left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    standard = {n: signal.default_int_handler if n == signal.SIGINT else signal.SIG_DFL for n in ENDING}
    before = {number: signal.getsignal(number) for number in standard}
    ours = [number for number in standard if before[number] is standard[number]]
    for number in ours:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])
        if ours:
            _heard.at_s = None


@contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """Raise `TimedOut` when the block takes longer than `seconds` (None: no limit), repeatedly until it ends.

    The time spent compiling kernels does not count.
    """
    if seconds is None or threading.current_thread() is not threading.main_thread() or not hasattr(signal, "SIGALRM"):
        yield
        return
    _heard.limit = _Limit(seconds, time.monotonic(), compiling.spent_s())
    before = signal.signal(signal.SIGALRM, _time_up)
    signal.setitimer(signal.ITIMER_REAL, seconds, REPEAT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        _heard.time_up = False


def on_extended(report: Callable[[float], None] | None) -> None:
    """Call `report` with the remaining seconds whenever a time limit is extended for compiling."""
    _heard.extended = report


def check() -> None:
    """Raise `Interrupted` or `TimedOut` again if it was raised and lost."""
    if _heard.at_s is not None:
        raise Interrupted
    if _heard.time_up:
        raise TimedOut


def heard() -> tuple[float | None, bool]:
    """Time of the last signal that ends the command, and whether the time limit has passed; compare around a block."""
    return _heard.at_s, _heard.time_up


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    now_s = time.monotonic()
    if _heard.at_s is not None and now_s - _heard.at_s < ECHO_S:
        return
    _heard.at_s = now_s
    _raise(Interrupted)


def _time_up(_number: int, _frame: FrameType | None) -> None:
    left_s = _heard.limit.left_s
    if left_s > 0.0:
        later_s = max(left_s, REPEAT_S)
        signal.setitimer(signal.ITIMER_REAL, later_s, REPEAT_S)
        if _heard.extended is not None:
            _heard.extended(later_s)
        return
    _heard.time_up = True
    _raise(TimedOut)


def _raise(what: type[BaseException]) -> None:
    if compiling.busy():
        _heard.held = what
    else:
        raise what


def _raise_held() -> None:
    """Raise what `_raise` held back, once, in the main thread."""
    if _heard.held is not None and threading.current_thread() is threading.main_thread():
        what, _heard.held = _heard.held, None
        raise what


compiling.on_pause(_raise_held)
