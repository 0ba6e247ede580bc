"""Text from other people's code and files, made safe to print: one line, no control characters, valid UTF-8."""

LONGEST = 400  # characters of a message; the rest is counted


def printable(text: str, longest: int = LONGEST) -> str:
    """`text` on one line, with everything that is not printable written as its escape: ESC as ``\\x1b``.

    White space becomes single spaces.  Control characters, lone surrogates and characters that turn the direction of
    writing are escaped; what is longer than `longest` characters is cut, and says how long it was.
    """
    line = "".join(c if c.isprintable() else _escaped(c) for c in " ".join(text.split()))
    return line if len(line) <= longest else f"{line[:longest]}... ({len(line)} characters)"


def described(error: BaseException) -> str:
    """An exception on one printable line, ``ValueError: its text``; one that cannot say what it is says so."""
    try:
        text = str(error)
    except BaseException as fault:  # it is anyone's class
        return f"{printable(type(error).__name__)}: no message (its __str__ raises {printable(type(fault).__name__)})"
    return f"{printable(type(error).__name__)}: {printable(text) or 'no message'}"


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")
