"""A claim of a paper, and what became of it when it was put to the test.

A claim is measured, not argued: its `measure` flies or computes, and returns lines with limits, as a scenario does.
The verdict follows from the lines alone:

confirmed                   every line of the claim as it stands holds
confirmed with a condition  not every one of them does, but every line of the claim under its condition
refuted                     neither
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

from scenarios.harness.checks import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Paper(StrEnum):
    """The papers, as they are cited."""

    THEORY = "Premerlani & Bizard 2009, Direction Cosine Matrix IMU: Theory"
    ROLL_PITCH = "Premerlani 2011, Roll-Pitch Gyro Drift Compensation"
    STARLINO = "Starlino 2011, DCM Tutorial: An Introduction to Orientation Kinematics"
    DILSHAD = "Dilshad & Jahan 2014, An Improvement Strategy on DCM-based Attitude Estimation for Multi-Rotor Autopilot"
    VAN_ZUNDERT = "van Zundert 2013, Direction Cosine Matrix based IMU Implementation in Matlab/Simulink"

    @property
    def short(self) -> str:
        """Authors and year."""
        return self.partition(",")[0]


class Verdict(StrEnum):
    """What became of a claim."""

    CONFIRMED = "confirmed"
    WITH_CONDITION = "confirmed with a condition"
    REFUTED = "refuted"


def line(name: str, unit: str, measured: float, sense: Literal["<=", ">="], limit: float) -> Row:
    """One measured value against the limit that the claim amounts to; NaN does not hold."""
    passed = measured <= limit if sense == "<=" else measured >= limit
    return Row(name, unit, float(measured), sense, float(limit), bool(passed and math.isfinite(measured)))


@dataclass(frozen=True, slots=True)
class Finding:
    """What was measured of a claim.

    stands      lines of the claim as it stands: at least one
    condition   under what it holds, a phrase that begins with "if" or "with"; empty where none was tried
    under       lines of the claim under that condition; none where there is none
    told        what was found, one to three sentences with the numbers that matter, units included
    seeds       over how many it was measured; 0 where nothing was left to chance
    draw        draws the picture into an empty figure, see `scenarios.harness.claims.picture`
    """

    stands: tuple[Row, ...]
    told: str
    seeds: int
    draw: Callable[["Figure"], None]
    condition: str = ""
    under: tuple[Row, ...] = ()

    def __post_init__(self) -> None:
        if not self.stands:
            raise ValueError("Finding.stands: no lines; a claim is judged by at least one")
        if bool(self.condition) != bool(self.under):
            raise ValueError(f"Finding.condition {self.condition!r}: give it with its lines, or neither")

    @property
    def verdict(self) -> Verdict:
        """See the module."""
        if all(row.passed for row in self.stands):
            return Verdict.CONFIRMED
        return Verdict.WITH_CONDITION if self.under and all(row.passed for row in self.under) else Verdict.REFUTED

    def undrawn(self) -> "Finding":
        """The same without its picture, which can be sent to another process."""
        return replace(self, draw=_nothing)


def _nothing(figure: "Figure") -> None:
    """Draw nothing."""


def deciding(finding: Finding) -> Row:
    """The line that decides: the first that does not hold, or of those that hold the one with the least margin."""
    rows = finding.stands
    return next((row for row in rows if not row.passed), min(rows, key=_margin))


def _margin(row: Row) -> float:
    return abs(row.limit - row.measured) / max(abs(row.limit), abs(row.measured), 1e-12)


@dataclass(frozen=True, slots=True)
class Claim:
    """A sentence of a paper that can be true or false.

    name        as typed on the command line, and the picture's file name
    title       a short heading, as a person would put it
    paper, place    where it stands: section, equation or page
    says        the sentence, in our own words
    expected    the verdict at the time of writing: another one is a regression
    measure     of the seeds to fly; what leaves nothing to chance ignores them
    seeds       how many are flown where nobody says otherwise
    """

    name: str
    title: str
    paper: Paper
    place: str
    says: str
    expected: Verdict
    measure: Callable[[Sequence[int]], Finding] = field(repr=False)
    seeds: int = 10

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ValueError(f"claim name {self.name!r}: must be letters, digits and underscores")
