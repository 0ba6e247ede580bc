"""Estimators that are objects, given names; and where their flights are flown, here or in worker processes."""

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, SupportsIndex

from wingslevel._conditions import Estimator, plain
from wingslevel._errors import WingslevelError, WingslevelWarning, one_line


def named(estimators: Iterable[Estimator]) -> dict[str, Any]:
    """What each of `estimators` is called, in order: a name is its own, an object's is made of its class."""
    from scenarios.harness.plugins import maker_name

    found: dict[str, Any] = {}
    for given in estimators:
        estimator = plain(given)
        name, n = maker_name(estimator), 1
        while not _same(found.get(key := name if n == 1 else f"{name}({n})", estimator), estimator):
            n += 1
        found[key] = estimator
    return found


def _same(one: Any, other: Any) -> bool:
    return one is other or (isinstance(one, str) and isinstance(other, str) and one == other)


def objects(estimators: Mapping[str, Any]) -> dict[str, Any]:
    """Those that are not names."""
    return {name: estimator for name, estimator in estimators.items() if not isinstance(estimator, str)}


def crew(workers: SupportsIndex | None, estimators: Mapping[str, Any]) -> int:
    """How many worker processes; 0 is this process.

    workers : as the user says; None is as many as processors, and this process where one cannot be sent to others

    Raises
    ------
    WingslevelError     an invalid number, or several where an estimator cannot be sent
    """
    from scenarios.harness import lent
    from scenarios.harness.cli.options import MOST_WORKERS
    from scenarios.harness.gate.workers import processors

    number = plain(workers)
    if number is not None and not (isinstance(number, int) and 1 <= number <= MOST_WORKERS):
        raise WingslevelError(f"workers = {workers!r}: must be a whole number from 1 to {MOST_WORKERS}")
    if number == 1:
        return 0
    for name, maker in objects(estimators).items():
        why = lent.why_unsendable(maker)
        if why and number is None:
            return 0
        if why:
            raise WingslevelError(
                f"workers = {number}: estimator {name!r} cannot be sent to other processes because {why}; move it to a "
                'file and name it "file.py:Class", or leave workers out, which flies in this process'
            )
    return processors() if number is None else int(number)


@contextmanager
def quietly() -> Iterator[list[str]]:
    """Print nothing inside the block: gives the notes, which are complete after it; warnings become Python's."""
    from estimator.compiler import compiling
    from scenarios.harness.cli import console
    from scenarios.harness.cli.reports import losses

    notes: list[str] = []
    with one_line(), console.collected() as lines, losses():
        compiling.on_trouble(lambda line: lines.append(f"warning: kernel cache: {line}"))
        try:
            yield notes
        finally:
            compiling.on_trouble(None)
    for line in lines:
        start, warned, rest = line.partition("warning: ")
        if warned and not start:
            warnings.warn(rest, WingslevelWarning, stacklevel=4)
        else:
            notes.append(line)
