"""What is told of claims that were put to the test, and the files that are written of them."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.text import Text

from scenarios.harness.checks import Row
from scenarios.harness.claims.claim import Claim, Verdict, deciding
from scenarios.harness.claims.page import page
from scenarios.harness.claims.run import Findings, Found
from scenarios.harness.cli import console
from scenarios.harness.cli.reports import refusal, write

COLOURS = {Verdict.CONFIRMED: "green", Verdict.WITH_CONDITION: "yellow", Verdict.REFUTED: "red"}


def listed(wanted: Sequence[Claim]) -> dict[str, dict[str, str]]:
    """Names and titles of the claims of each paper."""
    papers = dict.fromkeys(claim.paper for claim in wanted)
    return {paper.short: {c.name: c.title for c in wanted if c.paper == paper} for paper in papers}


def tell_list(wanted: Sequence[Claim]) -> None:
    """A table of names and titles for each paper."""
    for paper, names in listed(wanted).items():
        console.out().print(console.name_table(paper, names))


def folder_of_pictures(markdown: Path | None, pictures: Path | None) -> Path | None:
    """Where pictures go: as told, else ``images/PAGE`` beside the page, else nowhere; refused where that cannot be."""
    folder = pictures if pictures is not None or markdown is None else markdown.parent / "images" / markdown.stem
    if folder is None:
        return None
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise refusal(f"cannot write pictures to {folder}: {there} is no folder that can be written to")
    return folder


def write_all(findings: Findings, markdown: Path | None, folder: Path | None) -> None:
    """Write the pictures and the page; neither where a claim was not measured: half a page would pass for a whole."""
    if folder is None or not findings.measured:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for found in findings.found:
        write(folder / f"{found.name}.png", partial(bytes, found.picture))
    if markdown is not None:
        seen_from = Path(os.path.relpath(folder.resolve(), markdown.resolve().parent)).as_posix()
        write(markdown, partial(page, findings.found, seen_from))


def line_text(row: Row) -> str:
    """A line in words: what, how much, and the limit."""
    return f"{row.name}: {row.sentence}"


def tell(findings: Findings, *, detailed: bool) -> None:
    """A table for each paper and the sums; where `detailed`, all that was found of each instead."""
    out = console.out()
    if detailed:
        for found in findings.found:
            _tell_one(found)
    else:
        for paper in dict.fromkeys(found.claim.paper for found in findings.found):
            of_it = [found for found in findings.found if found.claim.paper == paper]
            out.print(console.claim_table(paper.short, [_cells(found) for found in of_it]))
    verdicts = [found.finding.verdict for found in findings.found if found.finding]
    console.last(", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in Verdict))
    for found in findings.found:
        if found.finding is None:
            console.error(f"claim {found.name}: {found.problem}")
        elif not found.as_expected:
            expected = found.claim.expected
            console.error(f"claim {found.name}: {found.finding.verdict}, where {expected} was expected")


def _cells(found: Found) -> tuple[str, Text, str]:
    if found.finding is None:
        return found.name, Text("not measured", "bold red"), found.problem
    verdict = found.finding.verdict
    word = "conditional" if verdict == Verdict.WITH_CONDITION else str(verdict)
    return found.name, Text(word, COLOURS[verdict]), line_text(deciding(found.finding))


def _tell_one(found: Found) -> None:
    out, claim, finding = console.out(), found.claim, found.finding
    out.print(Text(f"\n{claim.title} ({claim.name})", "bold"))
    out.print(Text(f"{claim.paper}\n{claim.place}", "dim"))
    out.print(Text(f"\nsays   {claim.says}"))
    if finding is None:
        return
    out.print(Text(f"found  {finding.told}"))
    out.print(console.verdict_table("", finding.stands))
    if finding.under:
        out.print(console.verdict_table(finding.condition, finding.under))
    over = f", over {finding.seeds} seed{'s' * (finding.seeds != 1)}" if finding.seeds else ", nothing left to chance"
    out.print(Text(str(finding.verdict), f"bold {COLOURS[finding.verdict]}").append(over, "not bold default"))
