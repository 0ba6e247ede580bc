"""What can be named: scenarios, estimators, autopilots."""


def scenarios() -> dict[str, str]:
    """Names of the scenarios, with a line about each."""
    return _catalogue("scenarios")


def estimators() -> dict[str, str]:
    """Names of the estimators that need no path, with a line about each."""
    return _catalogue("estimators")


def autopilots() -> dict[str, str]:
    """Names of the autopilots that need no path, with a line about each."""
    return _catalogue("autopilots")


def _catalogue(kind: str) -> dict[str, str]:
    from scenarios.harness.commands.catalogue import catalogue

    return catalogue()[kind]
