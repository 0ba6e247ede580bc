"""What the public functions raise."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class WingslevelError(ValueError):
    """A name, a value, a file or flight code that cannot be used: one line that says what would be right.

    A flight that ends badly is not an error: see `Flight.outcome`.
    """


class WingslevelWarning(UserWarning):
    """Something that is allowed and probably not meant, such as a fault after the end of the flight."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during flights; `result` holds those that were finished, as the function would have returned them.

    result : None where nothing was finished
    """

    def __init__(self, result: Any = None) -> None:
        super().__init__("interrupted")
        self.result = result


@contextmanager
def one_line() -> Iterator[None]:
    """Raise what is refused inside the block as `WingslevelError`, with the same line."""
    try:
        yield
    except WingslevelError:
        raise
    except ValueError as problem:
        raise WingslevelError(str(problem)) from problem
    except OSError as problem:  # a name that is too long, a folder that may not be read
        what = problem.filename or "cannot read or write"
        raise WingslevelError(f"{what}: {problem.strerror or problem}") from problem
