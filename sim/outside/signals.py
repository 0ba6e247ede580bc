"""Ctrl-C, SIGTERM and the clock, told apart from whatever flight code raises.

Flight code may raise anything, KeyboardInterrupt too: that is its fault, and a result of the flight.  A person who
presses Ctrl-C, a CI system that cancels (SIGTERM) and a flight that takes too long must still get through.  So the
handlers installed here raise exceptions of their own, and remember that they did, should flight code swallow them.

While a kernel is compiled, the handlers raise nothing: the compiler calls back from C, where an exception is printed
and lost.  What they have heard is raised at the compiler's next step.

Python lets only the main thread have signal handlers; elsewhere the blocks below change nothing.
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

ECHO_S = 0.5  # a second signal within this time is the same one: a terminal and a parent both pass it on
REPEAT_S = 1.0  # between two reminders that the time is up
# What ends a command: Ctrl-C, a CI system that cancels, a terminal that is closed.
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Interrupted(KeyboardInterrupt):
    """Somebody wants the command to end."""


class TimedOut(BaseException):
    """The time for this flight is up."""


class _Limit(NamedTuple):
    """What a block may take, when it began, and what had been spent compiling by then; seconds."""

    seconds: float
    began_s: float
    spent_s: float

    @property
    def left_s(self) -> float:
        """What is left of it; compiling does not count."""
        return self.seconds + (compiling.spent_s() - self.spent_s) - (time.monotonic() - self.began_s)


class _Heard:
    """What the handlers of this process have heard."""

    at_s: float | None = None  # of the last signal that ends the command
    time_up = False
    limit = _Limit(math.inf, 0.0, 0.0)
    held: type[BaseException] | None = None  # what is to be raised at the compiler's next step
    tell_extended: Callable[[float], None] | None = None


_heard = _Heard()


@contextmanager
def listening() -> Iterator[None]:
    """Raise `Interrupted` on Ctrl-C, SIGTERM and SIGHUP inside the block.

    Signals that are ignored (``nohup``), and those that somebody else handles, are left as they are.
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
    """Raise `TimedOut` when the block takes longer than `seconds`, None for ever, and again until it ends.

    The time in which kernels are compiled does not count.
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


def on_extended(tell: Callable[[float], None] | None) -> None:
    """Call `tell` with the seconds by which the time for a block ends later, for kernels had to be compiled."""
    _heard.tell_extended = tell


def check() -> None:
    """Raise again what was heard and got lost: `Interrupted` or `TimedOut`."""
    if _heard.at_s is not None:
        raise Interrupted
    if _heard.time_up:
        raise TimedOut


def heard() -> tuple[float | None, bool]:
    """When the last signal that ends the command was heard, and whether the time is up: to compare around a block."""
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
        if _heard.tell_extended is not None:
            _heard.tell_extended(later_s)
        return
    _heard.time_up = True
    _raise(TimedOut)


def _raise(what: type[BaseException]) -> None:
    if compiling.busy():
        _heard.held = what
    else:
        raise what


def _raise_held() -> None:
    """What `_raise` held back, once; in the main thread, where it was heard."""
    if _heard.held is not None and threading.current_thread() is threading.main_thread():
        what, _heard.held = _heard.held, None
        raise what


compiling.on_pause(_raise_held)
