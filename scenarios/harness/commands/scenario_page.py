"""The catalogue of the scenarios: what each one flies and verifies, its limits, measured values and margins.

The texts and limits come from the scenarios, the measured values from a verdict that ``check --json`` wrote.  Without a
verdict the page keeps the values that it holds already.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from scenarios.harness.checks import Check, Row
from scenarios.harness.cli.reports import check_file, refusal, usage, write
from scenarios.harness.commands import agree
from scenarios.harness.registry import registered
from scenarios.harness.scenario import Scenario
from sim.outside.wording import markdown
from sim.rows import limit_figures

TIGHTEST = 10  # checks in the table of the smallest margins

HEAD = """# Scenarios

{count} scenarios, {variants} of them variants. `wingslevel fly NAME` flies one, `wingslevel check NAME` judges it on
the seeds 0 to 9. A scenario is a file in [`scenarios/`](../scenarios); [CONTRIBUTING](../CONTRIBUTING.md#a-scenario)
shows how to write one.

Each check has a limit for every single flight. An RMS has a second, tighter one for all flights together. The tables
show what the estimator of the scenario achieves on the seeds {seeds}:

- **worst**: the value of the worst flight, compared with the limit of a single flight
- **RMS of all**: the root of the mean square over the flights, compared with the limit of all
- **margin**: the distance from the value to its limit, in per cent of the limit

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


QUANTITIES = {
    "estimator": ("estimator", ""),
    "withheld": ("properties withheld from the estimator", ""),
    "turn_table": ("calibration on a turn table", ""),
    "faults": ("faults", ""),
    "duration_s": ("length", "s"),
    "start.sway_deg_s": ("sway in the hand", "deg/s"),
    "start.calibration_s": ("calibration in the hand", "s"),
    "start.height_m": ("height at the start", "m"),
    "air.wind_m_s": ("wind", "m/s"),
    "air.wind_from_deg": ("wind direction", "deg"),
    "air.turbulence_w20_m_s": ("turbulence", "m/s at 20 ft"),
    "rates.gps_hz": ("GPS rate", "Hz"),
    "sensors.gps.latency_s": ("GPS latency", "s"),
    "manoeuvre.turn_deg": ("turn", "deg"),
    "manoeuvre.bank_deg": ("bank", "deg"),
    "manoeuvre.every_s": ("time between turns", "s"),
    "manoeuvre.height_m": ("height of the manoeuvre", "m"),
    "manoeuvre.pitch_rate_deg_s": ("pitch rate", "deg/s"),
}
"""Words and unit of each field of the configuration that a variant changes; others appear by name."""
NAMES_IN = {"estimator", "withheld", "faults"}  # their values are names as typed
DIRECTIONS = {"random": "any", "cross": "from the side", "head": "from ahead", "tail": "from behind"}

Numbers = Mapping[tuple[str, str], Cells]  # by scenario and check, as the page names it


class Found(NamedTuple):
    """All that was measured, and the seeds that were flown, as ``0-9``."""

    numbers: Numbers
    seeds: str


def run(kind: str | None, names: Sequence[str], path: Path | None, verdict: Path | None) -> None:
    """Do what the command line asks for: write the page to `path`, with the values of `verdict` or those that it holds.

    Raises
    ------
    TyperException      one line: options that do not fit, a file that cannot be read or written, or holds no verdict
    """
    if kind != "scenarios" or names or path is None:
        raise refusal("the catalogue is of all scenarios: wingslevel list scenarios --markdown FILE [--verdict FILE]")
    with usage():
        check_file(path)
        if verdict is not None:
            found = measured_by(agree.read(verdict))
        else:
            found = measured_in(path.read_text(encoding="utf-8") if path.is_file() else "")
    write(path, lambda: page(registered(), found))


def measured_by(verdict: Mapping[str, Any]) -> Found:
    """What a verdict holds, as `agree.read` returns it, of the scenarios flown with their own estimators."""
    numbers = {}
    for name, scenario in registered().items():
        flights, pooled = (
            [e for e in verdict.get(key, ()) if (e["scenario"], e["estimator"]) == (name, scenario.config.estimator)]
            for key in ("flights", "pooled")
        )
        for check in scenario.checks:
            rows, of_all = (_rows_of(check.name, entries) for entries in (flights, pooled))
            if rows:
                numbers[name, markdown(check.name)] = _cells(check, rows, of_all, len(flights))
    return Found(numbers, _ranges(sorted({flight["seed"] for flight in verdict["flights"]})))


def _rows_of(check: str, entries: Sequence[Mapping[str, Any]]) -> list[Row]:
    return [Row.from_json(row) for entry in entries for row in entry["checks"] if row["name"] == check]


def _ranges(seeds: Sequence[int]) -> str:
    """Seeds in increasing order as ``--seeds`` takes them: ``0-9,12``."""
    runs: list[list[int]] = []
    for seed in seeds:
        if runs and seed == runs[-1][-1] + 1:
            runs[-1].append(seed)
        else:
            runs.append([seed])
    return ",".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)


def _cells(check: Check, rows: Sequence[Row], pooled: Sequence[Row], n_flights: int) -> Cells:
    if check.pooled == "count":
        return Cells(f"{sum(row.passed for row in rows)} of {n_flights} flights")
    missing = [row for row in rows if not math.isfinite(row.measured)]
    sign = 1.0 if check.sense == "<=" else -1.0
    worst = missing[0] if missing else max(rows, key=lambda row: sign * row.measured)
    of_all = [text for row in pooled if check.pooled == "rms" for text in (row.figure, _margin(row))]
    return Cells(worst.figure, _margin(worst), *of_all[:2])


def _margin(row: Row) -> str:
    if not math.isfinite(row.measured) or row.limit == 0.0:
        return ""
    spare = row.limit - row.measured if row.sense == "<=" else row.measured - row.limit
    return f"{100.0 * spare / abs(row.limit):.0f} %"


def measured_in(page: str) -> Found:
    """What a page holds."""
    found, scenario = {}, ""
    seeds = re.search(r"on the seeds (\S*):$", page, re.MULTILINE)
    for line in page.splitlines():
        if title := re.fullmatch(r"<!-- checks of (\w+) -->", line):
            scenario = title[1]
        elif scenario and line.startswith("| ") and line.count(" | ") == 6 and line != COLUMNS:
            name, _, worst, worst_margin, _, pooled, pooled_margin = line[2:-2].split(" | ")
            found[scenario, name] = Cells(*(c.strip() for c in (worst, worst_margin, pooled, pooled_margin)))
    return Found(found, seeds[1] if seeds else "")


def page(scenarios: Mapping[str, Scenario], found: Found) -> str:
    """The page as Markdown: all scenarios in a table, the smallest margins, then a section for each file."""
    families = _families(scenarios)
    numbers, variants = found.numbers, len(scenarios) - len(families)
    lines = [
        HEAD.format(count=len(scenarios), variants=variants, seeds=found.seeds),
        *_index(families, numbers),
        *_tightest(numbers),
    ]
    for family in families.values():
        lines += _section(family, numbers)
    return "\n".join(lines).rstrip() + "\n"


def _families(scenarios: Mapping[str, Scenario]) -> dict[str, list[Scenario]]:
    """Each scenario with its variants, which share its name and the rest of its story."""
    families: dict[str, list[Scenario]] = {}
    for name, scenario in scenarios.items():
        same = [first for first, (head, *_) in families.items() if _is_variant(scenario, head)]
        families.setdefault(same[0] if same else name, []).append(scenario)
    return families


def _is_variant(scenario: Scenario, of: Scenario) -> bool:
    same_story = scenario.story.strip().splitlines()[1:] == of.story.strip().splitlines()[1:]
    return scenario.name.startswith(f"{of.name}_") and same_story


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
    for label, text in table.items():  # "Passes when" begins a sentence
        lines += [f"**{label}{'' if label == 'Passes when' else '.'}** {_sentence(text)}", ""]
    lines += [line for text in after for line in (text, "")]
    for scenario in family:
        if variants:
            lines += [f"### {scenario.name}" if scenario is not first else f"### {first.name} itself", ""]
        if scenario is not first:
            lines += [f"{markdown(scenario.summary)} Differs in {_changes(first, scenario)}.", ""]
        if scenario.expected_to_fail:
            lines += ["Shows a failure: it passes only if its own estimator fails as the paper predicts.", ""]
        lines += [f"<!-- checks of {scenario.name} -->", "", COLUMNS, RULE, *_rows(scenario, numbers), ""]
    return lines


def _sentence(text: str) -> str:
    return text if text.endswith((".", ".)")) else f"{text}."


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
    """What the configuration of a variant changes, as ``quantity (value)``, and whether the script is another."""
    before, now = (_flat(s.config.model_dump(mode="json")) for s in (first, variant))
    if not now["air.wind_m_s"]:
        now["air.wind_from_deg"] = before["air.wind_from_deg"]
    changed = [_change(name, value) for name, value in now.items() if before.get(name) != value]
    changed += ["its script"] * (variant.script is not first.script)
    return " and ".join([", ".join(changed[:-1]), changed[-1]] if len(changed) > 1 else changed)


def _change(name: str, value: Any) -> str:
    """A changed field of the configuration in words."""
    if name == "air.gusts":
        return " and ".join(map(_gust, value)) or "gusts (none)"
    quantity, unit = QUANTITIES.get(name, (f"`{name}`", ""))
    if name in NAMES_IN and value:
        return f"{quantity} (`{_value(value).replace(', ', '`, `')}`)"
    if name == "air.wind_from_deg" and value in DIRECTIONS:
        return f"{quantity} ({DIRECTIONS[value]})"
    if unit and value == 0.0:
        return f"{quantity} (none)"
    return f"{quantity} ({_value(value)}{f' {unit}' if unit else ''})"


def _gust(gust: Mapping[str, Any]) -> str:
    along = gust["from_deg"]
    whence = f"{along} the wind" if isinstance(along, str) else f"from {along:g} degrees"
    parts = [f"a gust of {gust['m_s']:g} m/s {whence}"] if gust["m_s"] else []
    parts += [f"{gust['up_m_s']:g} m/s upwards"] if gust["up_m_s"] else []
    end_s = gust["start_s"] + gust["length_s"]
    return f"{' and '.join(parts)} from {gust['start_s']:g} s to {end_s:g} s after the release"


def _flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in data.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
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
    return " ".join(text.split()).replace("``", "`").replace("+-", "±").replace("|", r"\|")
