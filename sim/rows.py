"""The result of one check, a line of a verdict, and how it is written: the same figures and words in every report.

Values are written to three significant digits, limits as they were set.  Names, units and notes may come from other
people's code; they are made safe here for Markdown, and by the writer of any other format (see `sim.outside.wording`).
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from sim.outside.wording import markdown

Sense = Literal["<=", ">="]
NOT_MEASURED = "not measured"
COUNTED = ("", "flights", "waypoints")  # units of numbers that are counted


@dataclass(frozen=True, slots=True)
class Row:
    """The result of one check: one line of a verdict.

    measured : NaN if it could not be measured
    note : how many samples are missing, or what the metric raised (`raised`)
    """

    name: str
    unit: str
    measured: float
    sense: Sense
    limit: float
    passed: bool
    note: str = ""
    raised: bool = False

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> "Row":
        """The row that `to_json`, or a recording, wrote; keys that a row does not have are ignored."""
        known = {key: entry[key] for key in cls.__dataclass_fields__ if key in entry}
        measured = known.get("measured")
        return cls(**known | {"measured": float(measured) if isinstance(measured, int | float) else math.nan})

    def to_json(self) -> dict[str, Any]:
        """As plain data for JSON; what could not be measured is None."""
        measured = self.measured if math.isfinite(self.measured) else None
        plain = {"name": self.name, "unit": self.unit, "measured": measured, "sense": self.sense, "limit": self.limit,
                 "passed": self.passed}  # fmt: skip
        return plain | ({"note": self.note} if self.note else {})

    @property
    def figure(self) -> str:
        """The measured value without its unit."""
        if self.unit in COUNTED and float(self.measured).is_integer():
            return f"{self.measured:.0f}"
        return figures(self.measured)

    @property
    def value_text(self) -> str:
        """The measured value with its unit, and the note: ``2.04 m``, ``not measured (3 of 4 samples)``."""
        return f"{self.with_unit} ({self.note})" if self.note else self.with_unit

    @property
    def with_unit(self) -> str:
        """The measured value with its unit: ``2.04 m``, ``not measured``."""
        return f"{self.figure} {self.unit}".strip() if math.isfinite(self.measured) else NOT_MEASURED

    @property
    def limit_text(self) -> str:
        """The limit with its unit: ``<= 4 m``."""
        return f"{self.sense} {limit_figures(self.limit)} {self.unit}".strip()

    @property
    def sentence(self) -> str:
        """Measured value and limit on one line: ``2.04 m, limit <= 4 m``."""
        return f"{self.value_text}, limit {self.limit_text}"


def figures(value: float) -> str:
    """`value` to three significant digits; powers of ten outside 0.001..99999; `NOT_MEASURED` if not finite."""
    if not math.isfinite(value):
        return NOT_MEASURED
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        return f"{value:.1e}"
    size = abs(float(f"{value:.2e}"))  # rounded first: 9.996 is 10.0
    return f"{value:.{max(0, 2 - math.floor(math.log10(size)))}f}"


def limit_figures(limit: float) -> str:
    """A limit as it was set: up to four significant digits, without trailing zeros."""
    return f"{limit:.4g}"


def markdown_cells(row: Row) -> tuple[str, str, str]:
    """Name, measured value and limit, as cells of a Markdown table."""
    limit = row.limit_text.replace("<=", "≤", 1).replace(">=", "≥", 1)
    return markdown(row.name), markdown(row.value_text), markdown(limit)


def markdown_table(rows: Iterable[Row]) -> list[str]:
    """The lines of a Markdown table of `rows`."""
    lines = ["| check | measured | limit | |", "|-|-:|-:|-|"]
    for row in rows:
        lines.append(f"| {' | '.join(markdown_cells(row))} | {'pass' if row.passed else '**FAIL**'} |")
    return lines
