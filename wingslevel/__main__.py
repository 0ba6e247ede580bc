"""The command: ``wingslevel``, or ``python -m wingslevel``."""

import wingslevel  # noqa: F401 - first: says in one line what hides one of our packages


def main() -> None:
    """Run the command with the arguments of the process, and exit."""
    from scenarios.harness.gate import guard

    guard.main()


if __name__ == "__main__":
    main()
