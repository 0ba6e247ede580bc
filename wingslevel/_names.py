"""What can be named: scenarios, estimators, autopilots, aircraft, sensor suites; and the parameters of estimators."""

from collections.abc import Sequence
from typing import Any

from wingslevel._conditions import Estimator


def scenarios() -> dict[str, str]:
    """Names of the scenarios, with a line about each; those that installed packages offer, too."""
    return _listed("scenarios")


def estimators() -> dict[str, str]:
    """Names of the estimators that need no path, with a line about each."""
    return _listed("estimators")


def autopilots() -> dict[str, str]:
    """Names of the autopilots that need no path, with a line about each."""
    return _listed("autopilots")


def parameters(estimator: Estimator) -> dict[str, dict[str, Any]]:
    """The parameters of an estimator: name -> ``{"default": value, "unit": text}``; they go into ``params=``.

    Raises
    ------
    WingslevelError     no such estimator
    """
    from scenarios.harness import lent
    from scenarios.harness.commands.listing import parameters as listed
    from wingslevel._crew import named, objects, quietly

    found = named([estimator])
    with quietly(), lent.lend(objects(found)):
        (params,) = listed("estimators", list(found)).values()
    return params


def _listed(kind: str, names: Sequence[str] = ()) -> dict[str, str]:
    """Names of a kind, with a line about each; of one that is broken, why."""
    from scenarios.harness.commands.listing import listing
    from wingslevel._crew import quietly

    with quietly():
        things = listing(kind, names).kinds[kind]
    return {name: f"broken: {one.broken}" if one.broken else one.about for name, one in things.items()}
