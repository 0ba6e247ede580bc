"""`wingslevel claims`: measure claims, and write their page and pictures."""

from collections.abc import Sequence
from pathlib import Path

from scenarios.harness.claims import report as pages
from scenarios.harness.claims.registry import matching
from scenarios.harness.claims.run import measure
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
                report(pages.listed(wanted))
                pages.tell_list(wanted)
                return 0
            check_file(markdown)
            folder = pages.folder_of_pictures(markdown, pictures)
            numbers = None if seeds is None else parse_seeds(seeds)
            with console.progress("measuring", "claims") as advance:
                findings = measure(
                    wanted, numbers, workers or processors(), advance, drawn=folder is not None, limit_s=limit_s
                )
        pages.write_all(findings, markdown, folder)
        report(findings.to_json())
        # Last: a reader who closes the pipe loses no file.
        pages.tell(findings, detailed=bool(names) and len(wanted) == 1)
    return findings.exit_code
