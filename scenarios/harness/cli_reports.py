"""What every command does alike: refuse in one line what it cannot do, and write its reports, whole or not at all."""

import errno
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import IO, Any, TextIO

import typer

from sim.wording import brief, json_text


@contextmanager
def usage() -> Iterator[None]:
    """What is refused inside the block is the user's to mend: one line, exit code 2."""
    try:
        yield
    except UnicodeEncodeError as problem:
        text = problem.object[max(0, problem.start - 40) : problem.end + 40]
        raise refusal(f"{brief(text)}: holds what is no Unicode text; choose another name") from problem
    except ValueError as problem:
        raise refusal(str(problem)) from problem
    except OSError as problem:  # a name that is too long, a folder that may not be looked into
        raise refusal(f"{problem.filename or 'cannot read or write'}: {problem.strerror or problem}") from problem


def refusal(message: str) -> typer.TyperException:
    """What ends a command with `message` as its one line and exit code 2: to be raised."""
    return typer.TyperException(message)


@contextmanager
def reporting(target: str | None) -> Iterator[Callable[[Any], None]]:
    """Gives what writes the JSON.  Where that goes to standard output, everything else goes to standard error."""
    if target == "-":
        stdout = sys.stdout
        if stdout is None:
            raise refusal("--json -: standard output is closed")
        with redirect_stdout(sys.stderr):
            yield lambda data: _print(data, stdout)
    else:
        path = Path(target) if target is not None else None
        with usage():
            check_file(path)
        yield lambda data: write(path, lambda: json_text(data) + "\n")


def _print(data: Any, stdout: TextIO) -> None:
    try:
        print(json_text(data), file=stdout, flush=True)
    except BrokenPipeError:  # whoever read it has seen enough: what is still in the buffer goes nowhere, quietly
        abandon(stdout)
    except OSError as error:
        abandon(stdout)
        raise refusal(f"cannot write the JSON to standard output: {error.strerror}") from error


def abandon(stream: IO[str]) -> None:
    """Send what is still in the buffer of a stream that cannot be written to nowhere, quietly."""
    with suppress(OSError, ValueError):  # it may be no file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def check_file(path: Path | None) -> None:
    """Refuse, before flying, a report that could not be written."""
    if path is None:
        return
    if path.is_dir():
        raise refusal(f"cannot write to {path}: it is a folder")
    if not path.parent.is_dir():
        raise refusal(f"cannot write to {path}: there is no folder {path.parent}")
    # A file is replaced, which its folder must allow; a device or a pipe is written to.
    target = path.resolve()
    try:
        if not _is_stream(target):
            tempfile.TemporaryFile(dir=target.parent).close()
        elif not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        elif target.is_char_device():
            _try_device(target)
    except OSError as error:
        raise refusal(f"cannot write to {path}: {(error.strerror or str(error)).lower()}") from error


def _try_device(path: Path) -> None:
    """Write a blank to a device that is no terminal: nothing else tells one that is always full."""
    with path.open("wb", buffering=0) as device:
        if not device.isatty():
            device.write(b" ")


def _is_stream(path: Path) -> bool:
    """Whether `path` is there, and is neither a file nor a folder: /dev/stdout, a pipe."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write(path: Path | None, content: Callable[[], str | bytes]) -> None:
    """Write a report, complete or not at all."""
    if path is None:
        return
    from sim.recording import replacing

    made = content()
    data = made.encode("utf-8") if isinstance(made, str) else made
    target = path.resolve()  # what a link points to is replaced, not the link
    if _is_stream(target):
        try:
            target.write_bytes(data)
        except OSError as error:
            raise refusal(f"cannot write to {path}: {error.strerror}") from error
        return
    with usage(), replacing(target) as temporary:
        temporary.write_bytes(data)
