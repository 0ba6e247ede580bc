"""`check` and `compare`: many flights."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, SupportsFloat, SupportsIndex, Unpack

from wingslevel._conditions import (
    Conditions,
    Estimator,
    changes_of,
    number_of,
    path_of,
    seeds_of,
    shortly,
    with_conditions,
)
from wingslevel._crew import crew, named, objects, quietly
from wingslevel._errors import Interrupted, WingslevelError
from wingslevel._progress import Progress, progress_of
from wingslevel._results import CheckResult, Comparison

Seeds = str | SupportsIndex | Iterable[SupportsIndex]


@with_conditions
def check(
    scenarios: "str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None" = None,
    *,
    seeds: Seeds = "0-9",
    estimator: Estimator | None = None,
    params: Mapping[str, Any] | None = None,
    workers: SupportsIndex | None = None,
    timeout: SupportsFloat | None = 600.0,
    ledger: str | os.PathLike[str] | None = None,
    progress: Progress = False,
    **conditions: Unpack[Conditions],
) -> CheckResult:
    """Fly scenarios on many seeds, judge each flight and all of them pooled.

    Parameters
    ----------
    scenarios       names, patterns as ``"gps_*"``, or ``file.py``: one or several; None is all of them
    seeds           ``"0-9"``, ``"0,2,5-7"``, or numbers; each seed is one flight of each scenario
    estimator       as for `fly`; None is that of each scenario
    params          parameters of the estimator by name
    workers         processes; None is as many as processors.  1 flies in this process, and so does None where the
                    estimator is defined in the script or notebook itself
    timeout         wall-clock limit of each flight, seconds; None is no limit
    ledger          folder that keeps each verdict as it comes: the same call flies only what is missing
    progress        True shows a bar where it takes longer than two seconds; or a function of (done, total) flights

    Raises
    ------
    WingslevelError     one line: what cannot be flown; nothing has been flown then
    Interrupted         Ctrl-C; its `result` is that of the flights that were finished
    """
    from scenarios.harness import lent
    from scenarios.harness.commands import check as command
    from scenarios.harness.gate.ledger import Ledger

    changes = changes_of(check, conditions, params)
    estimators = {} if estimator is None else named([estimator])
    limit_s = _limit_s(timeout)
    with quietly() as notes, lent.lend(objects(estimators)):
        names = _names(scenarios)
        n_workers = crew(workers, estimators)
        if ledger is not None and objects(estimators):
            raise WingslevelError(
                'ledger: name the estimator ("module:Class" or "file.py:Class"), whose files it reads'
            )
        tasks = command.tasks(names, seeds_of(seeds), next(iter(estimators), None), changes, keyed=ledger is not None)
        kept = None if ledger is None else Ledger(Path(path_of("ledger", ledger)))
        with progress_of(progress, "flying", "flights") as advance:
            run = command.fly_all(tasks, n_workers, advance, limit_s=limit_s, ledger=kept)
    result = CheckResult(run, notes)
    if run.missing:
        raise Interrupted(result)
    return result


@with_conditions
def compare(
    scenario: "str | os.PathLike[str]",
    estimators: "Estimator | Sequence[Estimator] | None" = None,
    *,
    seeds: Seeds = "0-9",
    params: Mapping[str, Any] | None = None,
    workers: SupportsIndex | None = None,
    timeout: SupportsFloat | None = 600.0,
    progress: Progress = False,
    **conditions: Unpack[Conditions],
) -> Comparison:
    """Fly a scenario with several estimators, each on the same seeds, through the same air and noise.

    Parameters
    ----------
    scenario        name or ``file.py``
    estimators      one or several, each as for `fly`; None is all of them
    params          parameters of all that have them, or, as ``"premerlani.k_p"``, of one
    seeds, workers, timeout, progress   as for `check`

    Raises
    ------
    WingslevelError     one line: what cannot be flown; nothing has been flown then
    Interrupted         Ctrl-C; its `result` is that of the flights that were finished
    """
    from scenarios.harness import lent
    from scenarios.harness.commands import compare as command

    changes = changes_of(compare, conditions, params)
    found = named(_several("estimators", estimators))
    limit_s = _limit_s(timeout)
    with quietly() as notes, lent.lend(objects(found)):
        n_workers = crew(workers, found)
        plan = command.prepare(path_of("scenario", scenario), list(found), seeds_of(seeds), changes)
        with progress_of(progress, "flying", "flights") as advance:
            compared = command.fly(plan, n_workers, advance, limit_s=limit_s)
    result = Comparison(compared, notes)
    if not compared.whole:
        raise Interrupted(result)
    return result


def _several(what: str, given: Any) -> list[Any]:
    """One or several of a thing, as a list; a class is one, None is an empty list."""
    if given is None:
        return []
    several = list(given) if isinstance(given, list | tuple | set | frozenset | dict) else [given]
    if not several:
        raise WingslevelError(f"{what} holds none: name at least one, or leave {what} out for all of them")
    return several


def _names(scenarios: Any) -> list[str]:
    return [path_of("scenario", name) for name in _several("scenarios", scenarios)]


def _limit_s(timeout: Any) -> float | None:
    limit_s = None if timeout is None else number_of("timeout", timeout)
    if limit_s is not None and not 0.0 < limit_s <= 1e6:
        raise WingslevelError(f"timeout = {shortly(timeout)} s: must be above 0 and at most 1e6, or None")
    return limit_s
