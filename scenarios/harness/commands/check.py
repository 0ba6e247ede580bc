"""`wingslevel check`: every scenario on every seed, judged; the result does not depend on the number of processes.

A flight depends on its scenario, its overrides and its seed alone, and verdicts are collected in the order in which the
flights were named, so the result depends neither on the number of workers nor on their speed.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scenarios.harness.cli import console
from scenarios.harness.cli import reports as cli_reports
from scenarios.harness.cli.options import Changes
from scenarios.harness.cli.reports import check_file, reporting, usage, write
from scenarios.harness.commands.listing import note_ignored
from scenarios.harness.flight import fly_scenario, prepare
from scenarios.harness.gate import guard
from scenarios.harness.gate.ledger import Ledger
from scenarios.harness.gate.preparing import in_time
from scenarios.harness.gate.sources import decided_by, fingerprint
from scenarios.harness.gate.workers import fly_each, processors
from scenarios.harness.registry import find, matching
from scenarios.harness.seeds import parse_seeds
from scenarios.harness.settings import without_others
from scenarios.harness.verdict import FlightVerdict, Verdict, judge
from sim import recording
from sim.log import Outcome

MOST_FLIGHTS = 100_000  # of one command


@dataclass(frozen=True, slots=True)
class Task:
    """One flight to be flown, by names, so that it can be sent to a process."""

    scenario: str
    seed: int
    estimator: str
    overrides: Mapping[str, Any]
    name: str  # of the scenario, which may be named by its file
    key: str = ""  # fingerprint of everything that decides it, if there is a ledger

    def fly(self) -> FlightVerdict:
        """Fly it and judge it."""
        began_s, scenario = time.monotonic(), find(self.scenario)
        flight = fly_scenario(scenario, self.overrides, seed=self.seed, estimator=self.estimator, kept=True)
        return replace(judge(scenario, flight), wall_s=time.monotonic() - began_s)

    def lost(self, outcome: Outcome, message: str) -> FlightVerdict:
        """The verdict if the process was lost."""
        return FlightVerdict(self.name, self.estimator, self.seed, outcome, (), {}, message)


def tasks(
    names: Sequence[str],
    seeds: Sequence[int],
    estimator: str | None,
    changes: Mapping[str, Any],
    *,
    keyed: bool = False,
) -> list[Task]:
    """Every scenario of `names` (all by default) on every seed.

    With an estimator given, scenarios that pass only if an estimator fails are left out, unless named in full.

    keyed : with the fingerprint of what decides each, for a ledger

    Raises
    ------
    ValueError      one line: what cannot be flown, before anything is
    """
    wanted, left_out = matching(names or ["*"]), []
    if estimator is not None:
        left_out = [name for name in wanted if name not in names and find(name).expected_to_fail]
        wanted = [name for name in wanted if name not in left_out]
        if not wanted:
            raise ValueError(f"{', '.join(left_out)}: passes only if an estimator fails; to fly it, name it in full")
    if len(wanted) * len(seeds) > MOST_FLIGHTS:
        raise ValueError(
            f"{len(wanted)} scenarios on {len(seeds)} seeds: at most {MOST_FLIGHTS} flights at once; split them"
        )
    all_changes = changes if estimator is None else {**changes, "estimator": estimator}
    flies = {name: str(all_changes.get("estimator", find(name).config.estimator)) for name in wanted}
    of_each = {name: without_others(changes, flies[name], list(flies.values())) for name in wanted}
    # All of them are prepared before anything is said.
    all_prepared = [prepare(name, of_each[name], estimator=estimator) for name in wanted]
    found = []
    for name, prepared in zip(wanted, all_prepared, strict=True):
        changes = of_each[name]
        console.warn_of_faults(name, prepared.config)
        note_ignored(name, prepared.config)
        decides = decided_by(name, prepared) | {"changes": recording.plain(changes)} if keyed else {}
        for seed in seeds:
            key = fingerprint(decides | {"seed": seed}) if keyed else ""
            found.append(Task(name, seed, prepared.config.estimator, changes, prepared.scenario.name, key))
    console.note_left_out(left_out)
    return found


def print_report(verdict: Verdict) -> None:
    """The pooled tables, then the flights that failed, each on a line."""
    out = console.out()
    for pool in verdict.pooled:
        out.print(console.verdict_table(f"{pool.scenario}, {pool.estimator}, {pool.n_flights} flights", pool.rows))
    for flight in verdict.flights:
        if not flight.passed:
            failed = ", ".join(f"{row.name} {row.figure} {row.unit}".rstrip() for row in flight.rows if not row.passed)
            why = flight.ending if flight.message or flight.broken else failed
            console.line(f"FAIL {flight.scenario}, seed {flight.seed}: {why}", "red")
    flights, pooled = (f"{sum(v.passed for v in vs)} of {len(vs)}" for vs in (verdict.flights, verdict.pooled))
    missing = f"; {verdict.missing_text}" if verdict.missing else ""
    word, ending = ("passed", "") if verdict.passed else ("FAILED", " passed")
    console.last(f"{word}: {flights} flights, {pooled} scenarios pooled{ending}{missing}")


@dataclass(frozen=True, slots=True)
class Run:
    """The result of a check.

    flown, resumed : flights that were flown now, and that the ledger held      missing : that were not finished
    """

    verdict: Verdict
    flown: int
    resumed: int
    missing: int
    wall_s: float

    @property
    def exit_code(self) -> int:
        """As of the command line."""
        return console.INTERRUPTED if self.missing else self.verdict.exit_code

    def to_json(self) -> dict[str, Any]:
        """The verdict, and under ``run`` everything that may differ between two runs of the same command."""
        flights = [{"scenario": v.scenario, "seed": v.seed, "wall_s": v.wall_s} for v in self.verdict.flights]
        run = {"flown": self.flown, "resumed": self.resumed, "wall_s": self.wall_s, "flights": flights}
        return self.verdict.to_json() | {"run": run}


def fly_all(
    tasks: Sequence[Task],
    workers: int,
    advance: Callable[[int, int], None],
    *,
    limit_s: float | None = None,
    ledger: Ledger | None = None,
) -> Run:
    """Fly and judge all `tasks`, but for those whose verdict `ledger` holds, and keep there what is flown.

    limit_s : wall-clock limit of each flight       advance : called with the number done and the total

    The verdict is on the flights that were finished: Ctrl-C leaves some out.
    """
    began_s = time.monotonic()
    kept = {i: ledger.find(task.key, task.name, task.seed) for i, task in enumerate(tasks)} if ledger else {}
    done = {i: verdict for i, verdict in kept.items() if verdict is not None}
    missing = [i for i in range(len(tasks)) if i not in done]

    def keep(k: int, verdict: FlightVerdict) -> None:
        if ledger is None:
            return
        cli_reports.come_home()
        with cli_reports.attempt():  # a full disk costs the ledger its file, and no flight
            ledger.keep(tasks[missing[k]].key, verdict)

    flown = fly_each(
        [tasks[i] for i in missing],
        workers,
        lambda n, _total: advance(len(tasks) - len(missing) + n, len(tasks)),
        limit_s=limit_s,
        interrupted=lambda verdict: verdict.outcome == Outcome.INTERRUPTED,
        keep=keep,
    )
    resumed = len(done)
    done |= {missing[k]: verdict for k, verdict in flown.items()}
    verdict = Verdict.of(((find(tasks[i].scenario), done[i]) for i in sorted(done)), len(tasks) - len(done))
    return Run(verdict, len(flown), resumed, len(tasks) - len(done), time.monotonic() - began_s)


def run(
    names: Sequence[str],
    seeds: str,
    estimator: str | None,
    changes: Changes,
    *,
    workers: int | None,
    limit_s: float | None,
    ledger: Path | None,
    junit: Path | None,
    markdown: Path | None,
    json_: str | None,
) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        with usage():
            for path in (junit, markdown):
                check_file(path)
            changed = changes()
            if "seed" in changed:
                raise ValueError(f"--set seed={changed['seed']}: name the seeds to fly with --seeds")
            with in_time(limit_s):
                planned = tasks(names, parse_seeds(seeds), estimator, changed, keyed=ledger is not None)
            kept = None if ledger is None else Ledger(ledger)
            guard.stage("while it judged", guard.BROKEN)
            with console.progress("flying", "flights") as advance:
                done = fly_all(planned, workers or processors(), advance, limit_s=limit_s, ledger=kept)
        write(junit, done.verdict.to_junit)
        write(markdown, done.verdict.to_markdown)
        report(done.to_json())
        print_report(done.verdict)  # last: a reader who closes the pipe loses no report
    return done.exit_code
