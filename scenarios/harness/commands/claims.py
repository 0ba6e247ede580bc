"""`wingslevel claims`: test claims, and write their page and pictures."""

from collections.abc import Sequence
from pathlib import Path

from scenarios.harness.claims import page
from scenarios.harness.claims.run import matching, measure
from scenarios.harness.cli import console
from scenarios.harness.cli.reports import check_file, reporting, usage
from scenarios.harness.gate.workers import processors
from scenarios.harness.seeds import parse_seeds


def run(
    names: Sequence[str],
    seeds: str | None,
    *,
    workers: int | None,
    limit_s: float | None,
    list_only: bool,
    pictures: Path | None,
    markdown: Path | None,
    json_: str | None,
) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            wanted = matching(names)
            if list_only:
                report(page.titles(wanted))
                page.print_titles(wanted)
                return 0
            check_file(markdown)
            folder = page.picture_folder(markdown, pictures)
            numbers = None if seeds is None else parse_seeds(seeds)
            with console.progress("measuring", "claims") as advance:
                findings = measure(
                    wanted, numbers, workers or processors(), advance, drawn=folder is not None, limit_s=limit_s
                )
        page.write_files(findings, markdown, folder)
        report(findings.to_json())
        # Last: a reader who closes the pipe loses no file.
        page.print_report(findings, detailed=bool(names) and len(wanted) == 1)
    return findings.exit_code
