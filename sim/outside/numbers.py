"""Parsing numbers typed by users: plain, finite, in ASCII digits.

Python accepts much more: ``nan``, ``inf``, ``1_000``, the digits of other scripts.
"""

import math
import re

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")
_LONGEST = 60  # characters of a sensible number
RIGHT = "write a plain finite number, for instance 5, 0.25 or 1e-3"
RIGHT_WHOLE = "write a whole number, for instance 5"


def number(text: str) -> float:
    """The number in `text`.

    Raises
    ------
    ValueError      not a plain finite number; the message says what is valid
    """
    tidy = text.strip(" ")
    if len(tidy) > _LONGEST or not _NUMBER.fullmatch(tidy):
        raise ValueError(RIGHT)
    value = float(tidy)
    if not math.isfinite(value):
        raise ValueError("must be a finite number")
    return value


def whole(text: str) -> int:
    """The whole number in `text`; ValueError with what is valid."""
    tidy = text.strip(" ")
    if not _WHOLE.fullmatch(tidy):
        raise ValueError(RIGHT_WHOLE)
    return int(tidy)


def is_odd(text: str) -> bool:
    """Whether `text` is a number to Python but not to `number`: ``nan``, ``1_000``, ``0x10``."""
    try:
        number(text)
    except ValueError:
        return _is_python(text)
    return False


def _is_python(text: str) -> bool:
    for read in (float, lambda text: int(text, 0)):
        try:
            read(text)
        except ValueError:
            continue
        return True
    digits = text.strip().lstrip("+-").replace("_", "")
    return digits.isdigit()  # too many for Python, or of several scripts
