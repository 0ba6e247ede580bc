"""What `check` and `compare` return."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from wingslevel._html import CHECK_HEADINGS, check_rows, mark, number, page, table, text
from wingslevel._tables import require_pandas

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from scenarios.harness.commands.check import Run
    from scenarios.harness.commands.comparison import Comparison as Compared
    from scenarios.harness.verdict import FlightVerdict, PooledVerdict

MOST_SHOWN = 12  # failed flights in a notebook


class CheckResult:
    """The verdict on many flights."""

    def __init__(self, run: "Run", notes: Sequence[str] = ()) -> None:
        self._run, self._notes = run, tuple(notes)

    @property
    def passed(self) -> bool:
        """Whether every flight and every pooled check passed, and none is missing."""
        return self._run.verdict.passed

    @property
    def flights(self) -> "tuple[FlightVerdict, ...]":
        """The verdict on each flight: `scenario`, `estimator`, `seed`, `passed`, `outcome`, `rows` and `metrics`."""
        return self._run.verdict.flights

    @property
    def pooled(self) -> "tuple[PooledVerdict, ...]":
        """The checks of each scenario over all its flights."""
        return self._run.verdict.pooled

    @property
    def missing(self) -> int:
        """Flights that were not finished; above 0 only after Ctrl-C."""
        return self._run.missing

    @property
    def notes(self) -> tuple[str, ...]:
        """What the command would print beside: scenarios left out, and the like."""
        return self._notes

    def to_json(self) -> dict[str, Any]:
        """As ``check --json`` writes it."""
        return self._run.to_json()

    def to_junit(self) -> str:
        """As JUnit XML."""
        return self._run.verdict.to_junit()

    def to_markdown(self) -> str:
        """As Markdown."""
        return self._run.verdict.to_markdown()

    def to_pandas(self) -> "pd.DataFrame":
        """A row for each flight, with its metrics as columns; requires pandas."""
        return flights_table(self.flights)

    def __len__(self) -> int:
        return len(self.flights)

    def __repr__(self) -> str:
        flights, pooled = (
            f"{sum(v.passed for v in vs)} of {len(vs)}" for vs in (self._run.verdict.flights, self._run.verdict.pooled)
        )
        missing = f", {self.missing} missing" if self.missing else ""
        word = "passed" if self.passed else "FAILED"
        return f"<CheckResult {word}: {flights} flights, {pooled} scenarios pooled{missing}>"

    def _repr_html_(self) -> str:
        parts = []
        for pool in self.pooled:
            title = f"<b>{text(pool.scenario)}</b> &middot; {text(pool.estimator)} &middot; {pool.n_flights} flights"
            below = table(CHECK_HEADINGS, check_rows(pool.rows), right=(1, 2))
            parts.append(page(f"{title} &middot; {mark(pool.passed)}", "", below))
        failed = [v for v in self.flights if not v.passed]
        rows = [(text(v.scenario), str(v.seed), text(_why(v))) for v in failed[:MOST_SHOWN]]
        more = f"{len(failed)} flights failed" + ("" if len(failed) <= MOST_SHOWN else f", {MOST_SHOWN} of them:")
        if failed:
            parts.append(page("", more, table(("scenario", "seed", "why"), rows, right=(1,))))
        return "".join(parts) or page(mark(False), "nothing was flown")


class Comparison:
    """Estimators side by side."""

    def __init__(self, compared: "Compared", notes: Sequence[str] = ()) -> None:
        self._compared, self._notes = compared, (*compared.notes, *notes)

    @property
    def scenario(self) -> str:
        """Its name."""
        return self._compared.scenario.name

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds that each estimator flew."""
        return self._compared.seeds

    @property
    def passed(self) -> bool:
        """Whether every flight was flown and judged without an error of any code: nothing is said of who is better."""
        return self._compared.exit_code == 0

    @property
    def estimators(self) -> Mapping[str, Mapping[str, Any]]:
        """Numbers of each estimator by its name: errors, flights survived, checks passed, cost of an update.

        A class or ``file.py:Class`` has the name of the class, as in `Replay`; two of one name have their full names.
        """
        numbers = (entrant.to_json() for entrant in self._compared.entrants)
        return dict(zip(self._names, numbers, strict=True))

    @cached_property
    def _names(self) -> tuple[str, ...]:
        from scenarios.harness.plugins import short_name

        names = [entrant.name for entrant in self._compared.entrants]
        short = [short_name(name) for name in names]
        return tuple(one if short.count(one) == 1 else name for name, one in zip(names, short, strict=True))

    @property
    def flights(self) -> "tuple[FlightVerdict, ...]":
        """The verdict on each flight."""
        return tuple(flown.verdict for entrant in self._compared.entrants for flown in entrant.flights)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was set for some of the estimators alone, or left out."""
        return self._notes

    def to_json(self) -> dict[str, Any]:
        """As ``compare --json`` writes it."""
        return self._compared.to_json()

    def to_markdown(self) -> str:
        """The table as Markdown."""
        return self._compared.to_markdown()

    def to_pandas(self) -> "pd.DataFrame":
        """A row for each estimator, with its numbers as columns; requires pandas.  See `flights` for single flights."""
        require_pandas()
        import pandas as pd

        lines = [
            {key: value for key, value in numbers.items() if key not in ("given", "known")} | {"estimator": name}
            for name, numbers in self.estimators.items()
        ]
        return pd.DataFrame(lines)

    def plot(self) -> "Figure":
        """A figure of Matplotlib: errors over time, how they are spread, and a line for each estimator."""
        from scenarios.harness.commands.compare_picture import figure_of
        from wingslevel._errors import one_line
        from wingslevel._picture import Picture

        with one_line():
            return figure_of(self._compared, Picture)

    def __len__(self) -> int:
        return len(self._compared.entrants)

    def __repr__(self) -> str:
        n = len(self.seeds)
        return f"<Comparison {self.scenario}, {n} {'seed' if n == 1 else 'seeds'}: {', '.join(self._names)}>"

    def _repr_html_(self) -> str:
        headings = (
            "estimator", "survived", "inclination<br>RMS, deg", "p95", "max", "heading<br>RMS, deg", "against",
            "ns per<br>update", "checks<br>passed",
        )  # fmt: skip
        rows = []
        for name, e in zip(self._names, self._compared.entrants, strict=True):
            cost = "" if e.cost is None else f"{e.cost.ns:.0f}"
            checks = f"{e.checks_passed}/{len(e.pooled.rows)}" if e.pooled else ""
            numbers = [number(value) for value in e.numbers.values()]
            survived = f"{e.survived}/{len(e.flights)}"
            rows.append((text(name), survived, *numbers, text(e.heading_reference), cost, checks))
        n = len(self.seeds)
        title = f"<b>{text(self.scenario)}</b> &middot; {n} {'seed' if n == 1 else 'seeds'}"
        below = "<br>".join(text(note) for note in self.notes)
        return page(title, below, table(headings, rows, right=(1, 2, 3, 4, 5, 7, 8)))


def flights_table(flights: "Sequence[FlightVerdict]") -> "pd.DataFrame":
    """A row for each verdict, with its metrics as columns."""
    require_pandas()
    import pandas as pd

    return pd.DataFrame(
        [
            {
                "scenario": v.scenario, "estimator": v.estimator, "seed": v.seed, "flight": v.flight,
                "outcome": str(v.outcome), "passed": v.passed, "message": v.message, **v.metrics,
            }
            for v in flights
        ]
    )  # fmt: skip


def _why(v: "FlightVerdict") -> str:
    """Why a flight failed."""
    if v.message or v.broken:
        return v.ending
    return ", ".join(f"{row.name} {row.with_unit}" for row in v.rows if not row.passed)
