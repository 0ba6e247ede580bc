"""Two verdicts on the same flights, from two machines or platforms: alike within what the last bits amount to.

The same wheels on the same machine give the same bits.  Another processor, compiler or mathematics library rounds
otherwise, a flight amplifies that, and what is measured of it comes out a little different.  How different was measured
by moving the heading of the start by its last bit, up and down, in every scenario that flies
(`tests/closed_loop/test_last_bits.py`; at first its height, in 200 flights with 1900 values): two values in five kept
every bit, and no flight ended otherwise.  The tolerances below are about four times the largest difference seen then,
but in `faults`, where a last bit can double an error while the accelerometer is stuck, and in `motor_dead`, whose
values are those of one moment, the touch-down after a glide through gusts.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from scenarios.harness.cli import console
from scenarios.harness.cli.reports import reporting, usage
from scenarios.harness.verdict import counted
from sim.outside.wording import brief

RELATIVE = 0.05  # of the larger of the two values; `ABSOLUTE` is added
ABSOLUTE = {"deg": 0.2, "m": 0.5, "s": 0.5, "deg/s": 0.02, "m/s": 0.1, "turns": 0.01}  # by unit
COUNTED = ("", "flights", "waypoints")  # units that are counted, not measured: no tolerance
SENSITIVE = ("faults", "motor_dead", "motor_dead_battery")  # scenarios whose values a last bit can double
SHOWN = 10  # differences and disagreements that are printed


@dataclass(frozen=True, slots=True)
class Difference:
    """One measured value in both verdicts; `allowed` by the tolerance, `judged` or only reported."""

    where: str
    check: str
    unit: str
    values: tuple[float | None, float | None]
    allowed: float
    judged: bool

    @property
    def size(self) -> float:
        """How far apart they are; infinite where only one was measured."""
        a, b = self.values
        return (0.0 if a is b else math.inf) if a is None or b is None else abs(a - b)

    @property
    def agrees(self) -> bool:
        """Whether that is within what is allowed."""
        return self.size <= self.allowed

    @property
    def ratio(self) -> float:
        """How large it is, 1 being what is allowed."""
        if self.size == 0.0:
            return 0.0
        return self.size / self.allowed if self.allowed > 0.0 else math.inf

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "where": self.where, "check": self.check, "unit": self.unit, "values": list(self.values),
            "difference": self.size if math.isfinite(self.size) else None, "allowed": self.allowed,
            "agrees": self.agrees, "judged": self.judged,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Agreement:
    """How two verdicts compare; `others` are disagreements not covered by a tolerance, one line each."""

    n_flights: int
    tolerance: float
    differences: tuple[Difference, ...]
    others: tuple[str, ...]

    @property
    def disagreeing(self) -> list[Difference]:
        """The values that are judged and are too far apart."""
        return [d for d in self.differences if d.judged and not d.agrees]

    @property
    def agree(self) -> bool:
        """Whether nothing that is judged differs by more than is allowed."""
        return not self.others and not self.disagreeing

    @property
    def exit_code(self) -> int:
        """0 if they agree, else 1."""
        return 0 if self.agree else 1

    def worst(self) -> list[Difference]:
        """The differences that are not zero, the largest first, by what is allowed."""
        return sorted((d for d in self.differences if d.size), key=lambda d: -d.ratio)

    def to_json(self) -> dict[str, Any]:
        """All of it as plain data; of the differences those that are not zero, the largest first."""
        return {
            "agree": self.agree, "flights": self.n_flights, "values": len(self.differences),
            "tolerance": {"relative": self.tolerance, "absolute": _absolute(self.tolerance)},
            "disagreements": list(self.others), "differences": [d.to_json() for d in self.worst()],
        }  # fmt: skip


def read(path: Path) -> dict[str, Any]:
    """What ``check``, ``fly`` or ``compare`` wrote with ``--json``.

    Raises
    ------
    ValueError      one line: no such file, or no verdict in it
    """
    try:
        if path.is_char_device():  # some of them never end
            raise ValueError("a device")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {' '.join(str(error).split())}") from error
    flights = data.get("flights") if isinstance(data, dict) else None
    if not isinstance(flights, list) or not flights:
        raise ValueError(f"{path}: holds no flights; write it with wingslevel check --json")
    for entry in (*flights, *_list(data.get("pooled"))):
        if not _is_verdict(entry):
            raise ValueError(
                f"{path}: {brief(entry)} is not a verdict on a flight; write it with wingslevel check --json"
            )
    return data


def _is_verdict(entry: Any) -> bool:
    if not isinstance(entry, dict) or not isinstance(entry.get("checks"), list):
        return False
    named = all(isinstance(entry.get(name), str) for name in ("scenario", "estimator"))
    return named and all(
        isinstance(check, dict)
        and all(isinstance(check.get(name), str) for name in ("name", "unit", "sense"))
        and all(_is_number(check.get(name)) for name in ("measured", "limit"))
        for check in entry["checks"]
    )


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value))


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def compare(
    a: Mapping[str, Any], b: Mapping[str, Any], tolerance: float = RELATIVE, reported: Sequence[str] = SENSITIVE
) -> Agreement:
    """Compare two verdicts, as `read` returns them.

    tolerance : relative; those by unit keep their proportion to it, so that 0 demands equal values
    reported : scenarios, or patterns of them, whose values are reported and not judged
    """
    ours, theirs = _entries(a), _entries(b)
    others = [f"{where}: only in the first" for where in ours if where not in theirs]
    others += [f"{where}: only in the second" for where in theirs if where not in ours]
    differences: list[Difference] = []
    for where, entry in ours.items():
        if where in theirs:
            other = theirs[where]
            outcomes = [_words(e.get("outcome", "")) for e in (entry, other)]
            if outcomes[0] != outcomes[1]:
                others.append(f"{where}: {outcomes[0]} in the first, {outcomes[1]} in the second")
            judged = not any(fnmatchcase(entry["scenario"], pattern) for pattern in reported)
            differences += _differences(where, entry, other, tolerance, judged, others)
    return Agreement(len(_list(a["flights"])), tolerance, tuple(differences), tuple(others))


def _entries(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Every flight and every pool by what to call it."""
    flights = {f"{_name(e)}, seed {e.get('seed')} flight {e.get('flight', 0)}": e for e in data["flights"]}
    return flights | {f"{_name(e)}, pooled over {e.get('n_flights')}": e for e in _list(data.get("pooled"))}


def _name(entry: Mapping[str, Any]) -> str:
    return f"{entry['scenario']}, {entry['estimator']}"


def _words(outcome: Any) -> str:
    return str(outcome).replace("_", " ")


def _differences(
    where: str, ours: Mapping[str, Any], theirs: Mapping[str, Any], tolerance: float, judged: bool, others: list[str]
) -> Iterator[Difference]:
    """The values of the checks that both have; what else differs goes to `others`."""
    first, second = ({check["name"]: check for check in entry["checks"]} for entry in (ours, theirs))
    others += [f"{where}: {name!r} is checked in one of them alone" for name in sorted(first.keys() ^ second.keys())]
    for name, check in first.items():
        if name not in second:
            continue
        demands = [tuple(c[key] for key in ("sense", "limit", "unit")) for c in (check, second[name])]
        if demands[0] != demands[1]:
            others.append(f"{where}: {name!r} has another limit in the second; compare verdicts of one version")
            continue
        values = check["measured"], second[name]["measured"]
        yield Difference(where, name, check["unit"], values, _allowed(values, check["unit"], tolerance), judged)


def _allowed(values: Sequence[float | None], unit: str, tolerance: float) -> float:
    if unit in COUNTED:
        return 0.0
    size = max(abs(value) for value in values if value is not None) if any(v is not None for v in values) else 0.0
    return _absolute(tolerance).get(unit, 0.0) + tolerance * size


def _absolute(tolerance: float) -> dict[str, float]:
    return {unit: amount * tolerance / RELATIVE for unit, amount in ABSOLUTE.items()}


def print_report(agreement: Agreement) -> None:
    """The largest differences, what disagrees otherwise, and the sum."""
    worst = agreement.worst()
    rows = [
        [
            f"{d.where}: {d.check}", *("none" if v is None else f"{v:.6g}" for v in d.values),
            f"{d.size:.2g}", f"{d.allowed:.2g}", d.unit, _word(d),
        ]
        for d in worst[:SHOWN]
    ]  # fmt: skip
    if rows:
        headings = ("", "first", "second", "apart", "allowed", "", "")
        console.out().print(console.table("largest differences", headings, rows, text=(0, 5, 6), wrapping=(0,)))
    for text in agreement.others[:SHOWN]:
        console.line(f"DISAGREE {text}", "red")
    if len(agreement.others) > SHOWN:
        console.line(f"and {len(agreement.others) - SHOWN} more", "red")
    equal, apart = len(agreement.differences) - len(worst), len(agreement.disagreeing)
    counts = (
        f"{counted(agreement.n_flights)}, {len(agreement.differences)} values, {equal} of them equal to the last bit"
    )
    word = "agree" if agreement.agree else f"DISAGREE in {apart} values and {len(agreement.others)} other things"
    console.last(f"{word}: {counts}")


def _word(difference: Difference) -> str:
    if not difference.judged:
        return "reported"
    return "agrees" if difference.agrees else "DISAGREES"


def run(first: Path, second: Path, tolerance: float, reported: Sequence[str], json_: str | None) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            compared = compare(read(first), read(second), tolerance, reported)
        report(compared.to_json())
        print_report(compared)  # last: a reader who closes the pipe loses no file
    return compared.exit_code
