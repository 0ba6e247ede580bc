"""What all commands share: reject bad input in one line, and write reports completely or not at all."""

import errno
import io
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TextIO

import typer

from scenarios.harness.cli import console
from scenarios.harness.gate import guard
from sim.outside.wording import brief, json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PICTURES = (".png", ".svg", ".pdf")  # formats that can be drawn


@contextmanager
def usage() -> Iterator[None]:
    """A ValueError or OSError inside the block is a usage error: one line, exit code 2."""
    try:
        yield
    except UnicodeEncodeError as problem:
        text = problem.object[max(0, problem.start - 40) : problem.end + 40]
        raise refusal(f"{brief(text)}: is not valid Unicode; choose another name") from problem
    except ValueError as problem:
        raise refusal(str(problem)) from problem
    except OSError as problem:  # a name that is too long, a folder that may not be looked into
        raise refusal(f"{problem.filename or 'cannot read or write'}: {problem.strerror or problem}") from problem


def refusal(message: str) -> typer.TyperException:
    """The exception that ends a command with the line `message` and exit code 2."""
    return typer.TyperException(message)


@contextmanager
def reporting(target: str | None) -> Iterator[Callable[[Any], None]]:
    """Yields the function that writes the JSON.  With ``-`` everything else goes to standard error."""
    if target == "-":
        if sys.stdout is None:
            raise refusal("--json -: standard output is closed")
        with _aside() as stdout:
            yield lambda data: _publish(data, stdout)
    else:
        path = Path(target) if target is not None else None
        with usage():
            check_file(path)
        yield lambda data: write(path, lambda: json_text(data) + "\n")


@contextmanager
def _aside() -> Iterator[TextIO]:
    """Standard output, reserved for JSON: anything else written to its descriptor goes to standard error."""
    stdout = sys.stdout
    stdout.flush()
    try:
        descriptor = stdout.fileno()
    except (OSError, ValueError):
        descriptor = -1
    if descriptor != 1:  # a stand-in of Python's
        with redirect_stdout(sys.stderr):
            yield stdout
        return
    if guard.guarding():
        os.dup2(2, 1)  # for good: the parent has standard output
        with redirect_stdout(sys.stderr):
            yield stdout
        return
    kept = os.dup(1)
    with open(kept, "w", encoding="utf-8") as really, redirect_stdout(sys.stderr):
        os.dup2(2, 1)
        try:
            yield really
        finally:
            really.flush()
            os.dup2(kept, 1)


def _publish(data: Any, stdout: TextIO) -> None:
    if not guard.publish(json_text(data) + "\n"):
        _print(data, stdout)


def _print(data: Any, stdout: TextIO) -> None:
    try:
        print(json_text(data), file=stdout, flush=True)
    except BrokenPipeError:  # the reader has closed the pipe: drop the rest
        abandon(stdout)
    except OSError as error:
        abandon(stdout)
        raise refusal(f"cannot write the JSON to standard output: {error.strerror}") from error


def abandon(stream: IO[str]) -> None:
    """Drop what is still buffered for a stream that can no longer be written."""
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
    """Write a blank to a device other than a terminal: the only way to detect one that is always full."""
    with path.open("wb", buffering=0) as device:
        if not device.isatty():
            device.write(b" ")


def _is_stream(path: Path) -> bool:
    """Whether `path` exists and is neither a file nor a folder: /dev/stdout, a pipe."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write(path: Path | None, content: Callable[[], str | bytes]) -> None:
    """Write a report, complete or not at all; see `losses` for what happens if that cannot be."""
    if path is None:
        return
    from sim.recording import RecordingError, replacing

    come_home()
    made = content()
    data = made.encode("utf-8") if isinstance(made, str) else made
    target = path.resolve()  # what a link points to is replaced, not the link
    with attempt():
        if _is_stream(target):
            try:
                target.write_bytes(data)
            except OSError as error:
                raise RecordingError(f"cannot write to {path}: {error.strerror}") from error
            return
        try:
            with replacing(target) as temporary:
                temporary.write_bytes(data)
        except RecordingError as error:
            raise RecordingError(str(error).replace(str(target), str(path))) from error


def check_picture(path: Path | None) -> None:
    """Refuse, before anything is computed, a picture that could not be written or drawn in the format of its name."""
    check_file(path)
    if path is not None and path.suffix.lower() not in PICTURES:
        raise refusal(f"--picture {path}: end the name in {', '.join(PICTURES)}")


def write_figure(path: Path, figure: "Figure", dpi: int) -> None:
    """Write a figure of Matplotlib as a report; the ending of `path` says the format."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:].lower(), dpi=dpi)
    write(path, buffer.getvalue)


_lost: list[str] | None = None  # what could not be written inside `losses`


_home: str | None = None  # working directory at the start of the command


def come_home() -> None:
    """Undo what flight code may have done to this process before reports are written.

    It may have changed the working directory, to which paths are relative, or closed the standard streams.
    """
    if _home is not None:
        os.chdir(_home)
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        stream = getattr(sys, name)
        if stream is None or getattr(stream, "closed", False):
            setattr(sys, name, os.fdopen(os.dup(descriptor), "w", encoding="utf-8", errors="backslashreplace"))


@contextmanager
def losses() -> Iterator[list[str]]:
    """Inside the block a report that cannot be written prints one line, and the command goes on.

    Results survive a full disk.  Yields the list of lines printed.
    """
    global _lost, _home
    before, _lost, _home = (_lost, _home), [], os.getcwd()
    try:
        yield _lost
    finally:
        _lost, _home = before


@contextmanager
def attempt() -> Iterator[None]:
    """A file that cannot be written inside the block prints one line; outside `losses` it ends the command."""
    try:
        yield
    except ValueError as problem:
        lose(str(problem), problem)


def lose(message: str, problem: Exception | None = None) -> None:
    """Report something that could not be written; outside `losses` it ends the command."""
    if _lost is None:
        raise refusal(message) from problem
    console.error(message)
    _lost.append(message)
