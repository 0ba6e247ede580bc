"""Claims put to the test over several processes.

A claim is decided by its name and its seeds alone: the number of workers shows neither in a number nor in a picture.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scenarios.harness.claims.claim import Claim, Finding
from scenarios.harness.claims.registry import claims
from scenarios.harness.cli import console
from scenarios.harness.gate.workers import fly_each
from scenarios.harness.verdict import FAILED, PASSED, SIMULATION_FAILED
from sim.log import Outcome


@dataclass(frozen=True, slots=True)
class Found:
    """What became of one claim, as it comes back from a process.

    finding     None where measuring it raised          picture     PNG; empty where none was wanted
    problem     what was raised, in one line
    """

    name: str
    finding: Finding | None
    picture: bytes = b""
    problem: str = ""

    @property
    def claim(self) -> Claim:
        """The claim."""
        return claims()[self.name]

    @property
    def as_expected(self) -> bool:
        """Whether the verdict is the one that was expected."""
        return self.finding is not None and self.finding.verdict == self.claim.expected

    def to_json(self) -> dict[str, Any]:
        """The claim and what was found, as plain data."""
        claim, finding = self.claim, self.finding
        told: dict[str, Any] = {
            "claim": claim.name, "title": claim.title, "paper": str(claim.paper), "place": claim.place,
            "says": claim.says, "expected": str(claim.expected),
        }  # fmt: skip
        if finding is None:
            return told | {"verdict": None, "problem": self.problem}
        return told | {
            "verdict": str(finding.verdict),
            "told": finding.told,
            "seeds": finding.seeds,
            "stands": [row.to_json() for row in finding.stands],
            "condition": finding.condition,
            "under": [row.to_json() for row in finding.under],
        }


@dataclass(frozen=True, slots=True)
class Task:
    """One claim to be put to the test, by name, so that it can be sent to a process."""

    name: str
    seeds: tuple[int, ...]
    drawn: bool

    def fly(self) -> Found:
        """Measure it, and draw its picture where one is wanted."""
        try:
            finding = claims()[self.name].measure(self.seeds)
            picture = b""
            if self.drawn:
                from scenarios.harness.claims.picture import png

                picture = png(finding.draw)
        except Exception as error:  # whatever is wrong with one claim, the others are measured
            why = " ".join(str(error).split()) or "no message"
            return Found(self.name, None, problem=f"{type(error).__name__}: {why}")
        return Found(self.name, finding.undrawn(), picture)

    def lost(self, outcome: Outcome, message: str) -> Found:
        """What became of it where nothing came back."""
        return Found(self.name, None, problem=f"{outcome.replace('_', ' ')}: {message}")


@dataclass(frozen=True, slots=True)
class Findings:
    """What was found of all claims that were asked for, in their order; `n_planned` of them were."""

    found: tuple[Found, ...]
    n_planned: int

    @property
    def whole(self) -> bool:
        """Whether none is missing; Ctrl-C and a worker that was killed leave some out."""
        return len(self.found) == self.n_planned

    @property
    def measured(self) -> bool:
        """Whether every claim was measured."""
        return self.whole and all(found.finding is not None for found in self.found)

    @property
    def exit_code(self) -> int:
        """0 where every verdict is as expected, 1 where one is not, 3 where measuring raised, 130 interrupted."""
        if not self.whole:
            return console.INTERRUPTED
        if not self.measured:
            return SIMULATION_FAILED
        return PASSED if all(found.as_expected for found in self.found) else FAILED

    def to_json(self) -> dict[str, Any]:
        """All of it as plain data."""
        told = {"passed": self.exit_code == PASSED, "claims": [found.to_json() for found in self.found]}
        return told | ({} if self.whole else {"interrupted": True})


def measure(
    wanted: Sequence[Claim],
    seeds: Sequence[int] | None,
    workers: int,
    advance: Callable[[int, int], None],
    *,
    drawn: bool = False,
    limit_s: float | None = None,
) -> Findings:
    """Put the claims of `wanted` to the test.

    Parameters
    ----------
    seeds       flown of each claim that leaves something to chance; None is from 0 on as many as each claim wants
    advance     is told how many claims are done, of how many
    drawn       whether their pictures are wanted
    limit_s     wall-clock limit of each
    """
    numbers = {c.name: tuple(range(c.seeds) if seeds is None or not c.seeds else seeds) for c in wanted}
    # The long ones first, so that at the end no process waits for another.
    tasks = [Task(c.name, numbers[c.name], drawn) for c in sorted(wanted, key=lambda c: -c.seeds)]
    done = fly_each(tasks, workers, advance, limit_s=limit_s)
    by_name = {found.name: found for found in done.values()}
    return Findings(tuple(by_name[c.name] for c in wanted if c.name in by_name), len(wanted))
