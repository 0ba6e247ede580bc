"""What can be named: scenarios, estimators, autopilots, aircraft, sensor suites; and the parameters of estimators."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wingslevel._conditions import Estimator

if TYPE_CHECKING:
    from scenarios.harness.parameters import Parameter


def scenarios() -> dict[str, str]:
    """Names of the scenarios, with a line about each; those that installed packages offer, too."""
    return listed("scenarios")


def estimators() -> dict[str, str]:
    """Names of the estimators that need no path, with a line about each."""
    return listed("estimators")


def autopilots() -> dict[str, str]:
    """Names of the autopilots that need no path, with a line about each."""
    return listed("autopilots")


def parameters(estimator: Estimator) -> "dict[str, Parameter]":
    """The parameters of an estimator by name, as ``params=`` takes them.

    Each has `default`, `unit`, `meaning`, and `raised` and `lowered`: what happens if it is.

    Raises
    ------
    WingslevelError     no such estimator
    """
    from scenarios.harness import lent
    from scenarios.harness.parameters import estimator_parameters
    from wingslevel._crew import named, objects
    from wingslevel._errors import one_line

    found = named([estimator])
    with one_line(), lent.lend(objects(found)):
        return {parameter.name: parameter for parameter in estimator_parameters(next(iter(found)))}


def listed(kind: str, names: Sequence[str] = ()) -> dict[str, str]:
    """Names of a kind, with a line about each; of one that is broken, why."""
    from scenarios.harness.commands.listing import listing
    from wingslevel._crew import quietly

    with quietly():
        things = listing(kind, names).kinds[kind]
    return {name: f"broken: {one.broken}" if one.broken else one.about for name, one in things.items()}
