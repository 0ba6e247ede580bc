"""The time limit while flight code and scenario files are loaded, before anything is flown or written."""

from collections.abc import Iterator
from contextlib import contextmanager

from scenarios.harness.gate import guard
from sim.outside.signals import TimedOut, limited

_PREPARING = "what is flown"
_LOADING = "while it was loaded, before anything was flown or written"


@contextmanager
def in_time(limit_s: float | None) -> Iterator[None]:
    """Refuse flight code and scenario files that take longer than `limit_s` to be loaded and constructed.

    Raises
    ------
    ValueError      one line, also if they ended the process
    """
    if _PREPARING in guard.lost:
        raise ValueError(f"flight code or a scenario file: the process {guard.lost[_PREPARING].message} {_LOADING}")
    try:
        with guard.watched(_PREPARING, None if limit_s is None else limit_s + guard.GRACE_S), limited(limit_s):
            yield
    except TimedOut:
        raise ValueError(f"flight code or a scenario file: took longer than {limit_s:g} s {_LOADING}") from None
