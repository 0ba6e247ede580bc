"""A claim of a paper, and how its verdict follows from measurements.

A claim is one function in a module of `scenarios.claims`.  The function's name is the name of the claim, its docstring
holds the title and the claim in our own words, and it returns what was measured:

    @claim(Paper.THEORY, "Accelerometers, above Eqn 25", expected=Verdict.REFUTED, seeds=3)
    def ground_speed(seeds):
        '''Ground speed can be used in the centrifugal term.

        The ground speed can replace the speed along the nose, because the ground is an inertial frame.
        '''
        error = pooled_rms(flights("circle", seeds), inclination_error_deg, from_s=20.0)
        return Finding(
            [line("inclination error in a turn", "deg RMS", error, "<=", 5.0)],
            f"In a steady turn the inclination error is {error:.1f} degrees RMS."
        )

The lines alone decide the verdict:

confirmed                   every line holds
confirmed with a condition  some line fails, but every line measured under the condition holds
refuted                     otherwise
"""

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Literal

from scenarios.harness.claims.picture import Panel
from sim.rows import Row


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
    """The result of testing a claim."""

    CONFIRMED = "confirmed"
    WITH_CONDITION = "confirmed with a condition"
    REFUTED = "refuted"


def line(name: str, unit: str, measured: float, sense: Literal["<=", ">="], limit: float) -> Row:
    """One measured value and its limit.  A value that is not finite fails."""
    passed = measured <= limit if sense == "<=" else measured >= limit
    return Row(name, unit, float(measured), sense, float(limit), bool(passed and math.isfinite(measured)))


@dataclass(frozen=True, slots=True)
class Finding:
    """What was measured to test a claim.

    lines               measured values with their limits, at least one
    summary             the result in one to three sentences, with the important numbers and their units
    panels              the picture, see `scenarios.harness.claims.picture`
    condition           when the claim holds, a phrase that begins with "if" or "with"; empty if none was tested
    conditional_lines   values measured under that condition, with their limits
    """

    lines: Sequence[Row]
    summary: str
    panels: Sequence[Panel] = ()
    condition: str = ""
    conditional_lines: Sequence[Row] = ()

    def __post_init__(self) -> None:
        if not self.lines:
            raise ValueError("Finding.lines: empty; a claim needs at least one measured value with a limit")
        if bool(self.condition) != bool(self.conditional_lines):
            raise ValueError(
                f"Finding.condition {self.condition!r}: needs conditional_lines, and they need a condition"
            )

    @property
    def verdict(self) -> Verdict:
        """The verdict that follows from the lines, see the module."""
        if all(row.passed for row in self.lines):
            return Verdict.CONFIRMED
        conditional = bool(self.conditional_lines) and all(row.passed for row in self.conditional_lines)
        return Verdict.WITH_CONDITION if conditional else Verdict.REFUTED

    @property
    def deciding_line(self) -> Row:
        """The first line that fails; if all hold, the one with the smallest margin."""
        return next((row for row in self.lines if not row.passed), min(self.lines, key=_margin))

    def without_picture(self) -> "Finding":
        """The finding without its panels, which cannot be sent to another process."""
        return replace(self, panels=())


def _margin(row: Row) -> float:
    return abs(row.limit - row.measured) / max(abs(row.limit), abs(row.measured), 1e-12)


@dataclass(frozen=True, slots=True)
class Claim:
    """A testable claim of a paper, made by the decorator `claim`.

    name            as typed on the command line; also the file name of the picture
    title           short heading
    paper, place    source: section, equation or page
    says            the claim in our own words
    expected        verdict when the claim was last reviewed; any other is a regression
    seeds           number of seeds it is measured over by default; 0 if nothing is random
    function        what measures it: takes the seeds, or nothing if nothing is random
    """

    name: str
    title: str
    paper: Paper
    place: str
    says: str
    expected: Verdict
    seeds: int
    function: Callable[..., Finding] = field(repr=False)

    def measure(self, seeds: Sequence[int]) -> Finding:
        """Test the claim on `seeds`, which are ignored if nothing is random."""
        return self.function(seeds) if self.seeds else self.function()


def claim(
    paper: Paper, place: str, *, expected: Verdict = Verdict.CONFIRMED, seeds: int = 0
) -> Callable[[Callable[..., Finding]], Claim]:
    """Make a `Claim` of the decorated function, see the module.

    Raises
    ------
    ValueError      the docstring is not a title, an empty line and text, or the function does not take what it should
    """

    def made(function: Callable[..., Finding]) -> Claim:
        name = function.__name__
        title, _, says = (inspect.getdoc(function) or "").partition("\n\n")
        if not title or not says:
            raise ValueError(f"claim {name}: the docstring must be a title, an empty line and the claim")
        takes, given = len(inspect.signature(function).parameters), 1 if seeds else 0
        if takes != given:
            raise ValueError(f"claim {name}: takes {takes} arguments; with seeds={seeds} it must take {given}")
        return Claim(name, title.rstrip("."), paper, place, " ".join(says.split()), expected, seeds, function)

    return made
