"""The ledger of a log: how many samples of each stream were read, used, and left out, and why.

A stream is ``imu``, ``gps``, ``magnetometer``, ``airspeed``, ``barometer`` or ``reference``.  For each one

    read = used + everything left out

Readers count what they read and give a reason for everything they leave out.  What the estimators receive is counted
separately, so that `Entry.agrees` can compare the two.
"""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

STREAMS = ("imu", "gps", "magnetometer", "airspeed", "barometer", "reference")


@dataclass(slots=True)
class Entry:
    """One stream: samples in the file, those given to estimators, and the others by reason."""

    read: int = 0
    used: int = 0
    left_out: dict[str, int] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether everything read is accounted for."""
        return self.read == self.used + sum(self.left_out.values())


class Ledger(Mapping[str, Entry]):
    """The entries of one log by stream; a stream that was never read has none."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}

    def __getitem__(self, stream: str) -> Entry:
        return self._entries[stream]

    def __iter__(self) -> Any:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def read(self, stream: str, n: int) -> None:
        """`n` messages or samples of the `stream` were found in the file."""
        self._entry(stream).read += n

    def leave_out(self, stream: str, n: int, reason: str) -> None:
        """`n` of those read do not reach the estimators, for this `reason`."""
        if n:
            left_out = self._entry(stream).left_out
            left_out[reason] = left_out.get(reason, 0) + n

    def use(self, stream: str, n: int) -> None:
        """`n` of those read reach the estimators."""
        self._entry(stream).used += n

    def without(self, stream: str) -> "Ledger":
        """A copy without the entry of `stream`."""
        copy = Ledger()
        copy._entries = {name: deepcopy(entry) for name, entry in self._entries.items() if name != stream}
        return copy

    def to_json(self) -> dict[str, dict[str, Any]]:
        """As plain data: stream -> read, used, left_out."""
        return {
            name: {"read": entry.read, "used": entry.used, "left_out": dict(entry.left_out)}
            for name, entry in self._entries.items()
        }

    def _entry(self, stream: str) -> Entry:
        if stream not in STREAMS:
            raise ValueError(f"stream {stream!r}: must be one of {', '.join(STREAMS)}")
        return self._entries.setdefault(stream, Entry())
