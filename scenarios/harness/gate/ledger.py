"""A ledger of verdicts: one small file per flight, written as it finishes, so that an interrupted command can resume.

A file is found by the fingerprint of all that decides its flight (see `sources`): after an edit, nothing old is taken.
It is written beside its place and renamed, so that it is there complete or not at all; one that has been damaged
since is left out, with a line that says so, and its flight is flown again.
"""

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from estimator.instruments import Known, to_json
from scenarios.harness.checks import Row
from scenarios.harness.cli import console
from scenarios.harness.verdict import FlightVerdict
from sim.log import Outcome
from sim.recording import check_writable, replacing

FORMAT = 1
# Of the machine and the moment, not of the flight: they are flown again.
NOT_KEPT = (Outcome.INTERRUPTED, Outcome.TIMED_OUT, Outcome.WORKER_DIED)
_NUMBERS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


@dataclass(frozen=True, slots=True)
class Ledger:
    """A folder of verdicts, created if needed.

    Raises
    ------
    ValueError      a folder that cannot be written to
    """

    folder: Path
    _told: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        check_writable(self.folder)

    def find(self, key: str, scenario: str, seed: int) -> FlightVerdict | None:
        """The verdict stored for the fingerprint `key`, or None."""
        path = self._path(key, scenario, seed)
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError):
            text = ""
        try:
            kept = json.loads(text)
            if (kept["format"], kept["key"], kept["sha256"]) == (FORMAT, key, _sha256(kept["verdict"])):
                return _read(kept["verdict"])
        except (ValueError, KeyError, TypeError, RecursionError):
            pass
        console.error(f"ledger: {path} is damaged: its flight is flown again")
        return None

    def keep(self, key: str, verdict: FlightVerdict) -> None:
        """Write a verdict, unless it is one that a machine or a moment decides."""
        if verdict.outcome in NOT_KEPT:
            return
        plain = _written(verdict)
        record = {"format": FORMAT, "key": key, "sha256": _sha256(plain), "verdict": plain}
        with replacing(self._path(key, verdict.scenario, verdict.seed)) as path:
            path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")

    def _path(self, key: str, scenario: str, seed: int) -> Path:
        return self.folder / f"{scenario[:80]}-seed{seed}-{key[:24]}.json"


def _sha256(plain: Any) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def _written(v: FlightVerdict) -> dict[str, Any]:
    """A verdict as plain data, from which `_read` makes the same one, bit for bit."""
    rows = [asdict(row) | {"measured": _number(row.measured)} for row in v.rows]
    return {
        "scenario": v.scenario, "estimator": v.estimator, "seed": v.seed, "flight": v.flight,
        "outcome": str(v.outcome), "message": v.message, "rows": rows, "metrics": dict(v.metrics),
        "known": to_json(v.known), "wall_s": v.wall_s,
    }  # fmt: skip


def _read(plain: dict[str, Any]) -> FlightVerdict:
    rows = tuple(Row(**row | {"measured": _NUMBERS.get(row["measured"], row["measured"])}) for row in plain["rows"])
    known = {name: Known.from_json(entry) for name, entry in plain["known"].items()}
    return FlightVerdict(
        plain["scenario"], plain["estimator"], plain["seed"], Outcome(plain["outcome"]), rows, plain["metrics"],
        plain["message"], plain["flight"], known, plain["wall_s"],
    )  # fmt: skip


def _number(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)
