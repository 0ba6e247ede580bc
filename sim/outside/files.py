"""Reading untrusted files: what may be opened, size limits, and one-line errors.

All user files are read through here.  `check` accepts only regular files (a pipe or device could block for ever),
`read` and `unpacked` enforce size limits, and `reading` turns any exception of a reader into one line that names the
file.
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

LARGEST_FILE = 2 << 30  # bytes of a file read as a whole
LARGEST_SETTING = 1 << 20  # of a hand-written file: column map, part, sensor suite, manifest
GROWS, FREELY = 100, 64 << 20  # limits of unpacked data: a multiple of the packed size, or bytes
LARGEST_NUMBER = 1e100  # larger ones count as NaN: no sensor reads them, and squares overflow
LONGEST_LINE = 1000  # characters of a message, column names included
_PIECE = 1 << 20
_DEEP = re.compile(r"""(?:\.[ \t]*(?:"[^"\n]*"|'[^'\n]*'|[\w-]+)[ \t]*){64}""")
_KINDS = (
    (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)  # fmt: skip


def check(path: Path, what: str = "file") -> None:
    """Reject anything but a readable regular file: ValueError, one line, with the path and the reason.

    what : kind of file, in a word or two, for the message
    """
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        target = f": it is a link to {os.readlink(path)}, which does not exist" if os.path.islink(path) else ""
        raise ValueError(f"no {what} at {path}{target or ': there is no such file'}") from None
    except (OSError, ValueError) as error:  # ValueError: NUL in the name
        raise ValueError(f"no {what} at {path}: {_reason(error)}") from None
    if not stat.S_ISREG(mode):
        found = next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
        raise ValueError(f"{path}: {found}, not a {what}: only regular files are read")
    if not os.access(path, os.R_OK):
        raise ValueError(f"{path}: cannot be read: permission denied")


def read(path: Path, what: str = "file", largest: int = LARGEST_FILE) -> bytes:
    """The whole file; ValueError if it cannot be read or has more than `largest` bytes."""
    check(path, what)
    raw = b"" if os.path.getsize(path) > largest else head(path, largest + 1, what)
    if len(raw) > largest or (not raw and os.path.getsize(path) > largest):
        raise ValueError(f"{path}: more than {size(largest)}, the limit for a {what}")
    return raw


def head(path: Path, n: int, what: str = "file") -> bytes:
    """The first `n` bytes of the file, or the whole file if shorter; ValueError if it cannot be read."""
    check(path, what)
    try:
        with path.open("rb") as file:
            return file.read(n)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {_reason(error)}") from None


def text(path: Path, what: str) -> str:
    """The text of a hand-written file, without byte-order mark; ValueError if it is not text."""
    raw = read(path, what, LARGEST_SETTING)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text: {described(error)}") from None


def toml(written: str) -> dict[str, Any]:
    """Contents of a TOML text; ValueError if it is invalid, or has keys with too many parts to parse in time."""
    if _DEEP.search(written):
        raise ValueError("a key of more than 64 parts")
    return tomllib.loads(written)


def unpacked(path: Path, raw: bytes) -> bytes:
    """`raw` decompressed, if it is gzip of one or several concatenated files; unchanged if not.

    Trailing zero bytes are padding.

    Raises
    ------
    ValueError      damaged or truncated, or beyond the size limit
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
                    raise EOFError("the gzip file is truncated")
                rest = packed.unconsumed_tail
                total += len(piece)
                if total > most:
                    raise ValueError(
                        f"{path}: {size(len(raw))} compressed, more than {size(most)} decompressed: not a log"
                    )
                parts.append(piece)
            rest = packed.unused_data
        if rest.strip(b"\0"):
            raise gzip.BadGzipFile("uncompressed data follow the compressed data")
    except (zlib.error, EOFError, gzip.BadGzipFile) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from None
    return b"".join(parts)


@contextmanager
def reading(path: Path | str, refusal: type[ValueError] = ValueError) -> Iterator[None]:
    """Turn any exception raised while reading `path` into one line of `refusal`.

    A `refusal` raised by the reader passes, made printable.  Overflows in untrusted numbers are not reported; their
    result is NaN and handled as such.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except refusal as error:
        if refusal is ValueError and str(path) not in str(error):  # from any library
            raise ValueError(printable(_line(path, error), LONGEST_LINE)) from error
        error.args = (printable(str(error), LONGEST_LINE), *error.args[1:])
        raise
    except Exception as error:  # readers may raise anything on a damaged file
        raise refusal(printable(_line(path, error), LONGEST_LINE)) from error


def _line(path: Path | str, error: Exception) -> str:
    """The error of the file, in one line."""
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
    """`values` with NaN in place of infinite ones and those beyond `LARGEST_NUMBER`."""
    return np.where(np.abs(values) < LARGEST_NUMBER, values, np.nan)


def some(names: object, most: int = 40) -> str:
    """Names for a message, comma-separated and shortened; of a long list the first ones and the number of others."""
    listed = [printable(str(name), 60) for name in names]  # type: ignore[attr-defined]
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def size(n: int) -> str:
    """A number of bytes with a suitable unit."""
    for unit, factor in (("GB", 1 << 30), ("MB", 1 << 20), ("kB", 1 << 10)):
        if n >= factor:
            return f"{n / factor:.3g} {unit}"
    return f"{n} bytes"


def _reason(error: BaseException) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
