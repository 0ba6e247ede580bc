"""Text from other people's code and files, made safe to print: one line, no control characters, valid UTF-8."""

LONGEST = 400  # characters of a message; the rest is counted
_NAME_OF_CLASS = type.__dict__["__name__"]


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
        text = str.__str__(str(error))  # a plain one: str() may hand on a text whose methods are anyone's
        if str(type(error).__module__).startswith("numba"):
            text = text.partition("\n")[0]  # the first line of numba's says enough
    except BaseException as fault:  # it is anyone's class
        return f"{class_name(error)}: no message (its __str__ raises {class_name(fault)})"
    return f"{class_name(error)}: {printable(text) or 'no message'}"


def class_name(value: object) -> str:
    """Name of the class of `value`, whatever its metaclass says."""
    return printable(_NAME_OF_CLASS.__get__(type(value)))


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")
