"""Find the claims and test them, in several processes.

The result of a claim depends on its name and its seeds only, so numbers and pictures do not depend on the number of
worker processes.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from types import MappingProxyType
from typing import Any

import scenarios.claims
from scenarios.harness.claims.claim import Claim, Finding, Paper
from scenarios.harness.claims.picture import png
from scenarios.harness.cli import console
from scenarios.harness.gate.workers import fly_each
from scenarios.harness.verdict import FAILED, PASSED, SIMULATION_FAILED
from sim.log import Outcome
from sim.params import near_misses

# Sections of the theory that make claims, in their order.  Claims of the other papers keep the order of their modules.
SECTIONS = (
    "Introduction",
    "Direction cosine matrices",
    "Computing direction cosines from gyro signals",
    "Renormalization",
    "Drift cancellation",
    "GPS",
    "Accelerometers",
    "Feedback controller",
    "Gyro characteristics",
    "Wind",
    "Using DCM in control and navigation",
)


@cache
def claims() -> Mapping[str, Claim]:
    """All claims in `scenarios.claims` by name, in the order of the papers and of the sections of the theory.

    Raises
    ------
    ValueError      two claims have the same name
    """
    found: dict[str, Claim] = {}
    for info in sorted(pkgutil.iter_modules(scenarios.claims.__path__), key=lambda info: info.name):
        module = importlib.import_module(f"scenarios.claims.{info.name}")
        for claim in vars(module).values():
            if not isinstance(claim, Claim):
                continue
            if found.get(claim.name, claim) is not claim:
                raise ValueError(
                    f"two claims are named {claim.name!r}: rename the one in scenarios/claims/{info.name}.py"
                )
            found[claim.name] = claim
    return MappingProxyType({claim.name: claim for claim in sorted(found.values(), key=_position)})


def _position(claim: Claim) -> tuple[int, int]:
    """Number of the claim's paper, and of the section named at the beginning of its place."""
    place = claim.place.casefold().replace("isation", "ization")
    sections = [i for i, section in enumerate(SECTIONS) if place.startswith(section.casefold())]
    return list(Paper).index(claim.paper), sections[0] if sections else len(SECTIONS)


def matching(patterns: Iterable[str]) -> list[Claim]:
    """The claims that match `patterns`, names or ``offset*``, in the order of `claims`; all if there are no patterns.

    Raises
    ------
    ValueError      a pattern matches no claim
    """
    wanted = tuple(patterns)
    for pattern in wanted:
        if not any(fnmatchcase(name, pattern) for name in claims()):
            raise ValueError(f"unknown claim {pattern!r}: {near_misses(pattern, claims())}")
    return [claim for name, claim in claims().items() if not wanted or any(fnmatchcase(name, p) for p in wanted)]


@dataclass(frozen=True, slots=True)
class Found:
    """The result of one claim, as a worker process returns it.

    finding     None if measuring it raised
    seeds       number of seeds; 0 if nothing is random
    picture     PNG; empty if none was wanted
    problem     one-line error message if measuring it raised
    """

    name: str
    finding: Finding | None
    seeds: int = 0
    picture: bytes = b""
    problem: str = ""

    @property
    def claim(self) -> Claim:
        """The claim."""
        return claims()[self.name]

    @property
    def as_expected(self) -> bool:
        """Whether the verdict is the expected one."""
        return self.finding is not None and self.finding.verdict == self.claim.expected

    def to_json(self) -> dict[str, Any]:
        """Claim and result as plain data."""
        claim, finding = self.claim, self.finding
        data: dict[str, Any] = {
            "claim": claim.name, "title": claim.title, "paper": str(claim.paper), "place": claim.place,
            "says": claim.says, "expected": str(claim.expected)
        }  # fmt: skip
        if finding is None:
            return data | {"verdict": None, "problem": self.problem}
        return data | {
            "verdict": str(finding.verdict),
            "summary": finding.summary,
            "seeds": self.seeds,
            "lines": [row.to_json() for row in finding.lines],
            "condition": finding.condition,
            "conditional_lines": [row.to_json() for row in finding.conditional_lines],
        }


@dataclass(frozen=True, slots=True)
class Task:
    """One claim to test, by name, so that it can be sent to a worker process."""

    name: str
    seeds: tuple[int, ...]
    drawn: bool

    def fly(self) -> Found:
        """Test the claim, and draw its picture if `drawn`."""
        try:
            finding = claims()[self.name].measure(self.seeds)
            picture = png(finding.panels) if self.drawn else b""
        except Exception as error:  # an error in one claim does not stop the others
            why = " ".join(str(error).split()) or "no message"
            return Found(self.name, None, problem=f"{type(error).__name__}: {why}")
        return Found(self.name, finding.without_picture(), len(self.seeds), picture)

    def lost(self, outcome: Outcome, message: str) -> Found:
        """The result if the worker process did not return one."""
        return Found(self.name, None, problem=f"{outcome.replace('_', ' ')}: {message}")


@dataclass(frozen=True, slots=True)
class Findings:
    """Results of the `n_planned` claims that were to be tested, in their order."""

    found: tuple[Found, ...]
    n_planned: int

    @property
    def whole(self) -> bool:
        """Whether there is a result for every claim; Ctrl-C and killed workers leave claims out."""
        return len(self.found) == self.n_planned

    @property
    def measured(self) -> bool:
        """Whether every claim was measured."""
        return self.whole and all(found.finding is not None for found in self.found)

    @property
    def exit_code(self) -> int:
        """0 if every verdict is as expected, 1 if one is not, 3 if measuring one raised, 130 if interrupted."""
        if not self.whole:
            return console.INTERRUPTED
        if not self.measured:
            return SIMULATION_FAILED
        return PASSED if all(found.as_expected for found in self.found) else FAILED

    def to_json(self) -> dict[str, Any]:
        """All results as plain data."""
        data = {"passed": self.exit_code == PASSED, "claims": [found.to_json() for found in self.found]}
        return data | ({} if self.whole else {"interrupted": True})


def measure(
    wanted: Sequence[Claim],
    seeds: Sequence[int] | None,
    workers: int,
    advance: Callable[[int, int], None],
    *,
    drawn: bool = False,
    limit_s: float | None = None,
) -> Findings:
    """Test the claims of `wanted`.

    Parameters
    ----------
    seeds       for every claim that is not deterministic; None: each claim's own number of seeds, from 0
    advance     called with the number of claims done and their total
    drawn       whether to draw the pictures
    limit_s     wall-clock limit for each claim
    """
    numbers = {c.name: tuple(range(c.seeds) if seeds is None or not c.seeds else seeds) for c in wanted}
    # Claims with many seeds first, so that at the end no process waits long for another.
    tasks = [Task(c.name, numbers[c.name], drawn) for c in sorted(wanted, key=lambda c: -c.seeds)]
    done = fly_each(tasks, workers, advance, limit_s=limit_s)
    by_name = {found.name: found for found in done.values()}
    return Findings(tuple(by_name[c.name] for c in wanted if c.name in by_name), len(wanted))
