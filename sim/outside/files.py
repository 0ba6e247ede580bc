"""Files that came from anywhere: what is opened, how large it may get, and how a fault in it is told.

Everything that reads a file of somebody else goes through here.  `check` opens nothing but files (a pipe or a device
would be read for ever), `read` and `unpacked` stop at a limit, and `reading` is the border at which whatever a reader
raises over the content becomes one line that names the file.
"""

import gzip
import os
import re
import stat
import tomllib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.outside.wording import described, printable

LARGEST_FILE = 2 << 30  # bytes of a file that is read as a whole
LARGEST_SETTING = 1 << 20  # of one that a person writes: a column map, a part, a sensor suite, a manifest
GROWS, FREELY = 100, 64 << 20  # what is packed grows to so many times its size at most, or to so many bytes
LARGEST_NUMBER = 1e100  # beyond it, or infinite, is no number: no sensor reads it, and its square overflows
LONGEST_LINE = 1000  # characters of a message; names of columns are part of it
_PIECE = 1 << 20
_DEEP = re.compile(r"""(?:\.[ \t]*(?:"[^"\n]*"|'[^'\n]*'|[\w-]+)[ \t]*){64}""")
_KINDS = (
    (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)  # fmt: skip


def check(path: Path, what: str = "file") -> None:
    """Refuse what is no file that can be read: ValueError, one line, with the path and the reason.

    what : what the user named, in a word or two
    """
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        target = f": it is a link to {os.readlink(path)}, which is not there" if os.path.islink(path) else ""
        raise ValueError(f"no {what} at {path}{target or ': there is no such file'}") from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise ValueError(f"no {what} at {path}: {_reason(error)}") from None
    if not stat.S_ISREG(mode):
        found = next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
        raise ValueError(f"{path}: {found}, not a {what}: only files are read")
    if not os.access(path, os.R_OK):
        raise ValueError(f"{path}: cannot be read: permission denied")


def read(path: Path, what: str = "file", largest: int = LARGEST_FILE) -> bytes:
    """All of the file; ValueError where it cannot be read, or has more than `largest` bytes."""
    check(path, what)
    raw = b"" if os.path.getsize(path) > largest else head(path, largest + 1, what)
    if len(raw) > largest or (not raw and os.path.getsize(path) > largest):
        raise ValueError(f"{path}: more than {size(largest)}, which is the most that a {what} may have")
    return raw


def head(path: Path, n: int, what: str = "file") -> bytes:
    """The first `n` bytes of the file, or all of a shorter one; ValueError where it cannot be read."""
    check(path, what)
    try:
        with path.open("rb") as file:
            return file.read(n)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {_reason(error)}") from None


def text(path: Path, what: str) -> str:
    """The text of a file that a person wrote, without a byte-order mark; ValueError where it is none."""
    raw = read(path, what, LARGEST_SETTING)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: no text in UTF-8: {described(error)}") from None


def toml(written: str) -> dict[str, Any]:
    """Contents of a TOML text; ValueError where it is none, or has keys of so many parts that reading never ends."""
    if _DEEP.search(written):
        raise ValueError("a key of more than 64 parts")
    return tomllib.loads(written)


def unpacked(path: Path, raw: bytes) -> bytes:
    """`raw` as it was before gzip, of one file or of several behind each other; what is not packed as it is.

    Zero bytes behind the end are padding.

    Raises
    ------
    ValueError      damaged or cut off, or growing beyond the limit
    """
    if raw[:2] != b"\x1f\x8b":
        return raw
    most = max(FREELY, GROWS * len(raw))
    parts, total, rest = [], 0, raw
    try:
        while rest[:2] == b"\x1f\x8b":
            packed = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
            while not packed.eof:
                piece = packed.decompress(rest, _PIECE)
                if not piece and not packed.unconsumed_tail and not packed.eof:
                    raise EOFError("the packed file was cut off")
                rest = packed.unconsumed_tail
                total += len(piece)
                if total > most:
                    raise ValueError(
                        f"{path}: {size(len(raw))} packed, more than {size(most)} unpacked: no log grows by that much"
                    )
                parts.append(piece)
            rest = packed.unused_data
        if rest.strip(b"\0"):
            raise gzip.BadGzipFile("something that is not packed follows what is")
    except (zlib.error, EOFError, gzip.BadGzipFile) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from None
    return b"".join(parts)


@contextmanager
def reading(path: Path | str, refusal: type[ValueError] = ValueError) -> Iterator[None]:
    """The border: whatever is raised inside, while the content of `path` is read, leaves as one line of `refusal`.

    A reader's own `refusal` passes, made printable.  Numbers of strangers may overflow in any sum: that is not told;
    what comes of it is no number, and is judged as such.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except refusal as error:
        if refusal is ValueError and str(path) not in str(error):  # of anybody
            raise ValueError(printable(_told(path, error), LONGEST_LINE)) from error
        error.args = (printable(str(error), LONGEST_LINE), *error.args[1:])
        raise
    except Exception as error:  # readers, those of other packages too, raise whatever a damaged file leads them to
        line = _told(path, error)
        raise refusal(printable(line, LONGEST_LINE)) from error


def _told(path: Path | str, error: Exception) -> str:
    """What is wrong with the file, in one line."""
    said = str(error) if isinstance(error, ValueError) else ""
    if str(path) in said:
        return said
    if isinstance(error, MemoryError):
        return f"{path}: does not fit into memory"
    if isinstance(error, RecursionError):
        return f"{path}: cannot be read: it is nested too deeply"
    if isinstance(error, OSError):
        return f"{path}: cannot be read: {_reason(error)}"
    return f"{path}: cannot be read: {said or described(error)}"


def measured(values: NDArray[Any]) -> NDArray[Any]:
    """`values` with NaN for what no instrument reads: infinite, or beyond `LARGEST_NUMBER`."""
    return np.where(np.abs(values) < LARGEST_NUMBER, values, np.nan)


def some(names: object, most: int = 40) -> str:
    """Names for a message, comma-separated: the first ones of a long list, and how many there are; each cut short."""
    listed = [printable(str(name), 60) for name in names]  # type: ignore[attr-defined]
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def size(n: int) -> str:
    """A number of bytes for people."""
    for unit, factor in (("GB", 1 << 30), ("MB", 1 << 20), ("kB", 1 << 10)):
        if n >= factor:
            return f"{n / factor:.3g} {unit}"
    return f"{n} bytes"


def _reason(error: BaseException) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
