"""Making untrusted text, from user code, options and files, safe to output.

Text may contain control characters and escape sequences, lone surrogates (of file names that are not UTF-8),
bidirectional controls and markup.  `printable` is for the terminal, XML and picture labels, and the base of the
others; `markdown` is for Markdown, `plotted` for matplotlib, `json_text` for JSON.
"""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

LONGEST = 400  # characters of a message
_MARKS = re.compile(r"([\\`*\[\]|~$#!])|(?<![^\W_])_|_(?![^\W_])")  # underscores within words are not markup
_NAME_OF_CLASS = type.__dict__["__name__"]


def printable(text: str, longest: int = LONGEST) -> str:
    """`text` on one line, with unprintable characters escaped: ESC as ``\\x1b``.

    White space becomes single spaces.  Control characters, lone surrogates and bidirectional controls are escaped;
    text longer than `longest` characters is cut and its length given.
    """
    line = escaped(" ".join(text.split()))
    return line if len(line) <= longest else f"{line[:longest]}... ({len(line)} characters)"


def escaped(text: str, kept: str = "\xa0") -> str:
    """`text` with unprintable characters escaped, a line break as ``\n``; blanks stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else _escaped(c) for c in text)


def brief(value: Any) -> str:
    """The repr of a value for messages, on one printable line, cut if long."""
    try:
        return printable(repr(value), 60)
    except (ValueError, RecursionError):  # thousands of digits, or of brackets
        return f"{type(value).__name__} of great length"


def described(error: BaseException) -> str:
    """An exception on one printable line, ``ValueError: its text``, even if it cannot be printed."""
    try:
        text = str.__str__(str(error))  # a plain str: str() may return a subclass
        if str(type(error).__module__).startswith("numba"):
            text = text.partition("\n")[0]  # the first line suffices
    except BaseException as fault:  # user class
        return f"{class_name(error)}: no message (its __str__ raises {class_name(fault)})"
    return f"{class_name(error)}: {printable(text) or 'no message'}"


def class_name(value: object) -> str:
    """Name of the class of `value`, independent of its metaclass."""
    return printable(_NAME_OF_CLASS.__get__(type(value)))


def markdown(text: str, longest: int = LONGEST) -> str:
    """`text` escaped for a line, heading or table cell of Markdown; HTML stays text."""
    line = _MARKS.sub(lambda found: f"\\{found[0]}", printable(text, longest))
    return line.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def file_name(text: str, longest: int = 80) -> str:
    """`text` as part of a file name: letters, digits and ``._-+``, at most `longest` bytes."""
    tame = "".join(c if c.isalnum() or c in "._-+" else "_" for c in text)
    return tame.encode("utf-8", "replace")[:longest].decode("utf-8", "ignore")


def plotted(text: str, longest: int = 80) -> str:
    """`text` as a label of matplotlib, dollars escaped."""
    return printable(text, longest).replace("$", r"\$")


def json_text(data: Any) -> str:
    """`data` as strict JSON in ASCII.

    Lone surrogates become the text of their escape, ``\\udcff``; numbers that are not finite become null.
    """
    return json.dumps(_strict(data), indent=2, allow_nan=False)


def _strict(data: Any) -> Any:
    if isinstance(data, str):
        return _without_surrogates(data)
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {_without_surrogates(str(name)): _strict(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return [_strict(value) for value in data]
    return data


def _without_surrogates(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")
