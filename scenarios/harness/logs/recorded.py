"""What every reader of logs returns: measured rows, and the reference attitude that the log holds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import Array, ImuSample
from scenarios.harness.logs.ledger import Ledger

Kind = Literal["truth", "filter", "firmware"]


class LogError(ValueError):
    """A log that cannot be read or is implausible; one line that names the file, the line or row, and the column."""


class NothingToScore(LogError):
    """A reference without an attitude at the times of the log: the log is replayed, and nothing is judged.

    read : attitudes in the reference      reason : why they are left out, in a few words
    """

    def __init__(self, line: str, read: int, reason: str) -> None:
        super().__init__(line)
        self.read, self.reason = read, reason


@dataclass(frozen=True, slots=True)
class Reference:
    """The attitude that a log is scored against.

    R_eb : shape (N, 3, 3), at the times of the rows, NaN where unknown
    kind : "truth", the output of another "filter", or of the original "firmware"      name : for display
    why_none : why none of it can be used, one line; empty if some can
    """

    R_eb: Array
    kind: Kind
    name: str
    why_none: str = ""

    @property
    def known(self) -> NDArray[np.bool_]:
        """Rows that have an attitude, shape (N,)."""
        return np.asarray(np.isfinite(self.R_eb).all(axis=(1, 2)))


@dataclass(frozen=True, slots=True)
class RecordedLog:
    """A log ready for replay.

    rows : shape (N,), MEASURED_DTYPE, times increasing
    name : of the file            sensors : those that the log has samples of
    reference : or None           repairs : what was repaired and how often, one line each
    place : latitude and longitude of the origin of positions, degrees, if known
    known : what the log says about the instruments, by the names of `estimator.instruments.PROPERTIES`, and about
            parameters of single estimators
    ledger : how many samples of the file were read, used and left out
    notes : further remarks, one line each
    on_ground : mean inertial sample at rest before the log, if the log starts in the air and holds one
    """

    rows: NDArray[Any]
    name: str
    sensors: tuple[str, ...]
    reference: Reference | None = None
    repairs: tuple[str, ...] = ()
    place: tuple[float, float] | None = None
    known: Mapping[str, Known] = field(default_factory=dict)
    ledger: Ledger = field(default_factory=Ledger)
    notes: tuple[str, ...] = ()
    on_ground: ImuSample | None = None
