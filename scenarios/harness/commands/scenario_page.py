"""The page of the scenarios: what each one flies and verifies, its limits, measured values and margins.

The texts and limits come from the scenarios, the measured values from a verdict that ``check --json`` wrote.  Without a
verdict the page keeps the values that it holds already.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from scenarios.harness.checks import Check, Row
from scenarios.harness.cli.reports import check_file, usage, write
from scenarios.harness.commands import agree
from scenarios.harness.registry import registered
from scenarios.harness.scenario import Scenario
from sim.outside.wording import markdown
from sim.rows import NOT_MEASURED, limit_figures

TIGHTEST = 10  # checks in the table of the smallest margins

HEAD = """# Scenarios

{count} scenarios, {variants} of them variants. `wingslevel fly NAME` flies one, `wingslevel check NAME` judges it on the
seeds 0 to 9. A scenario is a file in [`scenarios/`](../scenarios); [CONTRIBUTING](../CONTRIBUTING.md#a-scenario) shows
how to write one.

A check has a limit for each flight. An RMS has a second one, for the root of the mean square over all flights, which is
tighter. The tables show, for the estimator of the scenario and the seeds 0 to 9:

- **worst**: the value of the worst flight, held against the limit of a single flight
- **RMS of all**: the root of the mean square over the flights, held against the limit of all
- **margin**: how far the value is from its limit, as a share of the limit

This page is written by

```bash
wingslevel check --json verdict.json
wingslevel list scenarios --markdown docs/scenarios.md --verdict verdict.json
```

Without `--verdict` the texts and limits are updated and the measured values stay as they are.
"""
COLUMNS = "| check | limit | worst | margin | limit of all | RMS of all | margin |"
RULE = "|-|-:|-:|-:|-:|-:|-:|"


class Cells(NamedTuple):
    """What the page says was measured of a check; empty texts if it was not flown."""

    worst: str = ""
    worst_margin: str = ""
    pooled: str = ""
    pooled_margin: str = ""


Numbers = Mapping[tuple[str, str], Cells]  # by scenario and check, as the page names it


def run(path: Path, verdict: Path | None) -> None:
    """Write the page to `path`, with the values of `verdict`, or else those that it holds.

    Raises
    ------
    TyperException      one line: a file that cannot be read or written, or holds no verdict
    """
    with usage():
        check_file(path)
        if verdict is not None:
            numbers = numbers_of(agree.read(verdict))
        else:
            numbers = numbers_in(path.read_text(encoding="utf-8")) if path.is_file() else {}
    write(path, lambda: page(registered(), numbers))


def numbers_of(verdict: Mapping[str, Any]) -> dict[tuple[str, str], Cells]:
    """The cells of every check in a verdict, as `agree.read` returns it: of the scenario's own estimator alone."""
    pooled = {(p["scenario"], p["estimator"]): p for p in verdict.get("pooled", ())}
    flights: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for flight in verdict["flights"]:
        flights.setdefault((flight["scenario"], flight["estimator"]), []).append(flight)
    found = {}
    for name, scenario in registered().items():
        which = (name, scenario.config.estimator)
        if which not in pooled or which not in flights:
            continue
        for i, check in enumerate(scenario.checks):
            rows = [Row.from_json(flight["checks"][i]) for flight in flights[which]]
            found[name, markdown(check.name)] = _cells(check, rows, Row.from_json(pooled[which]["checks"][i]))
    return found


def _cells(check: Check, rows: Sequence[Row], pooled: Row) -> Cells:
    if check.pooled == "count":
        return Cells(f"{pooled.figure} of {len(rows)} flights")
    worst = (max if check.sense == "<=" else min)(rows, key=lambda row: _least_first(row, check))
    first = (_figure(worst), _margin(worst))
    return Cells(*first, _figure(pooled), _margin(pooled)) if check.pooled == "rms" else Cells(*first)


def _least_first(row: Row, check: Check) -> float:
    """The measured value, by which the worst row is found; one that was not measured is worse than any."""
    if math.isfinite(row.measured):
        return row.measured
    return math.inf if check.sense == "<=" else -math.inf


def _figure(row: Row) -> str:
    return row.figure if math.isfinite(row.measured) else NOT_MEASURED


def _margin(row: Row) -> str:
    if not math.isfinite(row.measured) or row.limit == 0.0:
        return ""
    spare = row.limit - row.measured if row.sense == "<=" else row.measured - row.limit
    return f"{100.0 * spare / abs(row.limit):.0f} %"


def numbers_in(page: str) -> dict[tuple[str, str], Cells]:
    """The cells that a page holds."""
    found, scenario = {}, ""
    for line in page.splitlines():
        if title := re.fullmatch(r"<!-- checks of (\w+) -->", line):
            scenario = title[1]
        elif scenario and line.startswith("| ") and line.count(" | ") == 6 and line != COLUMNS:
            name, _, worst, worst_margin, _, pooled, pooled_margin = line[2:-2].split(" | ")
            found[scenario, name] = Cells(*(c.strip() for c in (worst, worst_margin, pooled, pooled_margin)))
    return found


def page(scenarios: Mapping[str, Scenario], numbers: Numbers) -> str:
    """The page as Markdown: all scenarios in a table, the smallest margins, then a section for each file."""
    families = _families(scenarios)
    variants = len(scenarios) - len(families)
    lines = [HEAD.format(count=len(scenarios), variants=variants), *_index(families, numbers), *_tightest(numbers)]
    for family in families.values():
        lines += _section(family, numbers)
    return "\n".join(lines).rstrip() + "\n"


def _families(scenarios: Mapping[str, Scenario]) -> dict[str, list[Scenario]]:
    """Each scenario with its variants, which share its name and the rest of its story."""
    families: dict[str, list[Scenario]] = {}
    for name, scenario in scenarios.items():
        first = next(
            (f for f, (head, *_) in families.items() if name.startswith(f"{f}_") and _same(head, scenario)), ""
        )
        families.setdefault(first or name, []).append(scenario)
    return families


def _same(a: Scenario, b: Scenario) -> bool:
    return a.story.splitlines()[1:] == b.story.splitlines()[1:]


def _index(families: Mapping[str, Sequence[Scenario]], numbers: Numbers) -> list[str]:
    least = _least_margins(numbers)
    lines = ["## All scenarios", "", "| scenario | what is flown | variants | smallest margin |", "|-|-|-|-:|"]
    for name, (first, *variants) in families.items():
        links = ", ".join(f"[{v.name.removeprefix(f'{name}_')}](#{v.name})" for v in variants)
        margins = [least[key] for key in least if key[0] in {first.name, *(v.name for v in variants)}]
        margin = f"{min(margins)} %" if margins else ""
        lines.append(f"| [{name}](#{name}) | {markdown(first.summary)} | {links} | {margin} |")
    return [*lines, ""]


def _least_margins(numbers: Numbers) -> dict[tuple[str, str], int]:
    """The smaller of the two margins of each check, in per cent."""
    known = {key: [m for m in (cells.worst_margin, cells.pooled_margin) if m] for key, cells in numbers.items()}
    return {key: min(int(margin.split()[0]) for margin in margins) for key, margins in known.items() if margins}


def _tightest(numbers: Numbers) -> list[str]:
    """The checks that are nearest to a limit."""
    margins = sorted((margin, *key) for key, margin in _least_margins(numbers).items())[:TIGHTEST]
    lines = ["## Smallest margins", "", "| margin | scenario | check |", "|-:|-|-|"]
    return [*lines, *(f"| {m} % | [{scenario}](#{scenario}) | {name} |" for m, scenario, name in margins), ""]


def _section(family: Sequence[Scenario], numbers: Numbers) -> list[str]:
    first, *variants = family
    table, after = story_of(first.story)
    facts = {label.lower(): table.pop(label, "") for label in ("Aircraft", "Wind", "Sensors")}
    facts |= {"estimator": f"`{first.config.estimator}`", "length": f"{first.config.duration_s:g} s"}
    lines = [f"## {first.name}", "", f"*{markdown(first.summary)}*", ""]
    lines += [line for label in ("Story", "Verifies") for line in (f"**{label}.** {_sentence(table.pop(label))}", "")]
    lines += [f"| {' | '.join(facts)} |", "|" + "-|" * len(facts), f"| {' | '.join(facts.values())} |", ""]
    lines += [line for label, text in table.items() for line in (f"**{label}** {text}.", "")]
    lines += [line for text in after for line in (text, "")]
    for scenario in family:
        if variants:
            lines += [f"### {scenario.name}" if scenario is not first else f"### {first.name} itself", ""]
        if scenario is not first:
            lines += [f"{markdown(scenario.summary)} Differs by {_changes(first, scenario)}.", ""]
        if scenario.expected_to_fail:
            lines += ["Shows a failure: it passes only if its own estimator fails as the paper predicts.", ""]
        lines += [f"<!-- checks of {scenario.name} -->", COLUMNS, RULE, *_rows(scenario, numbers), ""]
    return lines


def _sentence(text: str) -> str:
    return text if text.endswith((".", ")")) else f"{text}."


def _rows(scenario: Scenario, numbers: Numbers) -> Iterator[str]:
    for check in scenario.checks:
        name, cells = markdown(check.name), numbers.get((scenario.name, markdown(check.name)), Cells())
        each, of_all = _limit(check, check.limit if check.per_flight_limit is None else check.per_flight_limit), ""
        if check.pooled == "count":
            each = "every flight"
        elif check.pooled == "rms":
            of_all = _limit(check, check.limit)
        columns = (name, each, cells.worst, cells.worst_margin, of_all, cells.pooled, cells.pooled_margin)
        yield f"| {' | '.join(columns)} |"


def _limit(check: Check, limit: float) -> str:
    return f"{'≤' if check.sense == '<=' else '≥'} {limit_figures(limit)} {markdown(check.unit)}".strip()


def _changes(first: Scenario, variant: Scenario) -> str:
    """What the configuration of a variant changes, as ``name = value``, and whether the script is another."""
    before, now = (_flat(s.config.model_dump(mode="json")) for s in (first, variant))
    changed = [f"`{name}` = {_value(value)}" for name, value in now.items() if before.get(name) != value]
    return ", ".join(changed + ["its script"] * (variant.script is not first.script))


def _flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in data.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_value, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else markdown(str(value))


def story_of(story: str) -> tuple[dict[str, str], list[str]]:
    """The table of a story, by label, and the paragraphs after it; as Markdown."""
    _, _, rest = story.partition("\n")
    table: dict[str, str] = {}
    after: list[str] = []
    rules = 0
    for line in rest.splitlines():
        if line.startswith("=============  "):
            rules += 1
        elif rules == 1 and line.strip():
            label = line[:15].strip()
            last = label or next(reversed(table))
            table[last] = f"{table[last]} {_inline(line[15:])}" if not label else _inline(line[15:])
        elif rules > 1:
            if not line.strip():
                after.append("")
            elif after:
                after[-1] = f"{after[-1]} {_inline(line)}".strip()
    return table, [text for text in after if text]


def _inline(text: str) -> str:
    """A line of reStructuredText as Markdown."""
    return " ".join(text.split()).replace("``", "`").replace("|", r"\|")
