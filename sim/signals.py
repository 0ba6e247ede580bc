"""Ctrl-C, SIGTERM and the clock, told apart from whatever flight code raises.

Flight code may raise anything, KeyboardInterrupt too: that is its fault, and a result of the flight.  A person who
presses Ctrl-C, a CI system that cancels (SIGTERM) and a flight that takes too long must still get through.  So the
handlers installed here raise exceptions of their own, and remember that they did, should flight code swallow them.

Python lets only the main thread have signal handlers; elsewhere the blocks below change nothing.
"""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ECHO_S = 0.5  # a second signal within this time is the same one: a terminal and a parent both pass it on
REPEAT_S = 1.0  # between two reminders that the time is up


class Interrupted(KeyboardInterrupt):
    """Somebody wants the command to end: Ctrl-C, or SIGTERM."""


class TimedOut(BaseException):
    """The time for this flight is up."""


class _Heard:
    """What the handlers of this process have heard."""

    at_s: float | None = None  # of the last signal that ends the command
    time_up = False


_heard = _Heard()


@contextmanager
def listening() -> Iterator[None]:
    """Raise `Interrupted` on Ctrl-C and SIGTERM inside the block.

    Signals that are ignored (``nohup``), and those that somebody else handles, are left as they are.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    standard = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
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
    """Raise `TimedOut` when the block takes longer than `seconds`, None for ever, and again until it ends."""
    if seconds is None or threading.current_thread() is not threading.main_thread() or not hasattr(signal, "SIGALRM"):
        yield
        return
    before = signal.signal(signal.SIGALRM, _time_up)
    signal.setitimer(signal.ITIMER_REAL, seconds, REPEAT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        _heard.time_up = False


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
    raise Interrupted


def _time_up(_number: int, _frame: FrameType | None) -> None:
    _heard.time_up = True
    raise TimedOut
