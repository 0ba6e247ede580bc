"""What every command does alike: refuse in one line what it cannot do, and write its reports, whole or not at all."""

import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scenarios.harness import console

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@contextmanager
def usage() -> Iterator[None]:
    """What is refused inside the block is the user's to mend: one line, exit code 2."""
    try:
        yield
    except ValueError as problem:
        raise refusal(str(problem)) from problem


def refusal(message: str) -> typer.TyperException:
    """What ends a command with `message` as its one line and exit code 2: to be raised."""
    return typer.TyperException(message)


@contextmanager
def reporting(target: str | None) -> Iterator[Callable[[Any], None]]:
    """Gives what writes the JSON.  Where that goes to standard output, everything else goes to standard error."""
    if target == "-":
        stdout = sys.stdout
        with redirect_stdout(sys.stderr):
            yield lambda data: print(_text(data), file=stdout)
    else:
        path = Path(target) if target is not None else None
        with usage():
            check_file(path)
        yield lambda data: write(path, lambda: _text(data) + "\n")


def _text(data: Any) -> str:
    return json.dumps(data, indent=2, allow_nan=False)


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
    if not os.access(target if _is_stream(target) else target.parent, os.W_OK):
        raise refusal(f"cannot write to {path}: permission denied")


def _is_stream(path: Path) -> bool:
    """Whether `path` is there, and is neither a file nor a folder: /dev/stdout, a pipe."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write(path: Path | None, content: Callable[[], str | bytes]) -> None:
    """Write a report, complete or not at all; see `losses` for what happens where that cannot be."""
    if path is None:
        return
    from sim.recording import RecordingError, replacing

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


def write_figure(path: Path, figure: "Figure", dpi: int) -> None:
    """Write a figure of Matplotlib as a report; the ending of `path` says the format."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:].lower(), dpi=dpi)
    write(path, buffer.getvalue)


_lost: list[str] | None = None  # what could not be written inside `losses`


@contextmanager
def losses() -> Iterator[list[str]]:
    """Inside the block a report that cannot be written does not end the command: it is told, and the rest goes on.

    What was measured is not lost with the first file that finds no room.  Gives the list of the lines told.
    """
    global _lost
    before, _lost = _lost, []
    try:
        yield _lost
    finally:
        _lost = before


@contextmanager
def attempt() -> Iterator[None]:
    """What cannot be written inside the block is told on one line; outside `losses` it ends the command."""
    try:
        yield
    except ValueError as problem:
        lose(str(problem), problem)


def lose(message: str, problem: Exception | None = None) -> None:
    """Tell of something that could not be written; outside `losses` it ends the command."""
    if _lost is None:
        raise refusal(message) from problem
    console.error(message)
    _lost.append(message)
