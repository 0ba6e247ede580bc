"""The page of the claims, as Markdown: a summary with links, then each claim with its lines and its picture."""

from collections.abc import Sequence

from scenarios.harness.checks import Row
from scenarios.harness.claims.claim import Finding, Verdict, deciding
from scenarios.harness.claims.run import Found
from sim.rows import markdown_cells

MARKS = {Verdict.CONFIRMED: "✅", Verdict.WITH_CONDITION: "🟡", Verdict.REFUTED: "❌"}

HEAD = """# What the papers claim, put to the test

Sentences of the papers that can be true or false, in our own words, flown or computed, and judged by lines with limits.
A limit is what the sentence amounts to in numbers, not what came out.

- ✅ confirmed: every line of the claim as it stands holds
- 🟡 confirmed with a condition: not every one of them does, but every line under the condition that is named
- ❌ refuted: neither

This page is written by

```bash
wingslevel claims --markdown docs/claims.md
```

and comes out the same, byte by byte, on any number of processes. `wingslevel claims NAME` measures one claim and shows
its lines; `wingslevel claims` exits with 1 where a verdict is no longer the one below. The claims are in
`scenarios/claims/`.
"""


def page(found: Sequence[Found], pictures: str) -> str:
    """The page of what was found.

    Parameters
    ----------
    found       claims that were measured, in their order
    pictures    folder of the pictures as seen from the page, with slashes
    """
    measured = [(f, f.finding) for f in found if f.finding is not None]
    lines = [HEAD, *_summary(measured)]
    for paper in dict.fromkeys(f.claim.paper for f, _ in measured):
        lines += [f"## {paper}", ""]
        for f, finding in measured:
            if f.claim.paper == paper:
                lines += [*_section(f, finding, pictures), ""]
    return "\n".join(lines).rstrip() + "\n"


def _summary(measured: Sequence[tuple[Found, Finding]]) -> list[str]:
    verdicts = [finding.verdict for _, finding in measured]
    sums = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in Verdict)
    lines = [f"{len(measured)} claims: {sums}.", ""]
    for paper in dict.fromkeys(f.claim.paper for f, _ in measured):
        lines += [f"**{paper.short}**", "", "| | claim | what decides | measured | limit |", "|-|-|-|-:|-:|"]
        for f, finding in measured:
            if f.claim.paper == paper:
                row = deciding(finding)
                link = f"[{f.claim.title}](#{f.claim.name})"
                lines.append(f"| {MARKS[finding.verdict]} | {link} | {_cells(row)} |")
        lines.append("")
    return lines


def _section(found: Found, finding: Finding, pictures: str) -> list[str]:
    claim = found.claim
    over = f"over {finding.seeds} seed{'s' * (finding.seeds != 1)}" if finding.seeds else "nothing left to chance"
    lines = [
        f'<a id="{claim.name}"></a>',
        "",
        f"### {claim.title}",
        "",
        f"> {claim.says}",
        ">",
        f"> *{claim.place}*",
        "",
        f"{MARKS[finding.verdict]} **{str(finding.verdict).capitalize()}**, {over}. {finding.told}",
        "",
        "| | measured | limit | holds |",
        "|-|-:|-:|-|",
        *(_row(row) for row in finding.stands),
    ]
    if finding.under:
        lines += [f"| *{finding.condition}:* | | | |", *(_row(row) for row in finding.under)]
    return [*lines, "", f"![{claim.title}]({pictures}/{claim.name}.png)"]


def _row(row: Row) -> str:
    return f"| {_cells(row)} | {'yes' if row.passed else '**no**'} |"


def _cells(row: Row) -> str:
    return " | ".join(markdown_cells(row))
