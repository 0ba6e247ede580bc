"""Running user code: any exception becomes one line that names the fault and its place.

Flight code, scenario files and the packages behind entry points may raise anything: SystemExit, KeyboardInterrupt, an
exception that cannot be printed.  `theirs` is the only place that catches them.  A real Ctrl-C, SIGTERM and the time
limit pass through, because the handlers of `sim.outside.signals` keep a record.

The place is the innermost line of the traceback that belongs neither to wingslevel nor to Python or an installed
library; lines of the installed package that provides the code do count (`home`).
"""

import os
import sys
import sysconfig
import traceback
from collections.abc import Callable
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

from sim.outside.signals import Interrupted, TimedOut, check, heard, listening
from sim.outside.wording import class_name, described, printable

TRACEBACK = "WINGSLEVEL_TRACEBACK"  # environment variable: 1 shows full tracebacks, in workers too
_PACKAGES = ("estimator", "autopilot", "sim", "scenarios", "wingslevel")
_ROOT = Path(__file__).resolve().parents[2]
_NOT_THEIRS = tuple(
    f"{path}{os.sep}"
    for path in (*(_ROOT / name for name in _PACKAGES), *(sysconfig.get_path(n) for n in ("stdlib", "platstdlib")))
)
_INSTALLED = ("site-packages", "dist-packages")


class Refused(ValueError):
    """User code returned something invalid; the message is the text alone, without class and place."""


_switch = {"tracebacks": False}


def tracebacks_shown() -> bool:
    """Whether this process shows full tracebacks."""
    return _switch["tracebacks"]


def show_tracebacks(on: bool) -> None:
    """Write full tracebacks of user code to standard error, besides the one-line message, or not."""
    _switch["tracebacks"] = on


class theirs:
    """A block that runs user code: any exception becomes ``refuse(line)``.

    The working directory is restored afterwards, as paths are relative to it.

    Parameters
    ----------
    refuse      makes the exception to raise instead, from the line
    home        file, or name of the installed package, that contains the user code
    """

    def __init__(self, refuse: Callable[[str], Exception], home: str = "") -> None:
        self._refuse, self._home, self._listening = refuse, home, listening()

    def __enter__(self) -> None:
        self._listening.__enter__()
        self._before, self._folder = heard(), _working_directory()

    # Not a generator: contextlib mishandles StopIteration raised by the block.
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._folder and _working_directory() != self._folder:
            os.chdir(self._folder)
        try:
            if heard() != self._before or (kind is TimedOut and heard()[1]) or (kind is Interrupted and heard()[0]):
                check()  # the block may have caught it and raised something else
            if error is not None:
                raise self._refuse(summary(error, self._home)) from error
        finally:
            self._listening.__exit__(None, None, None)


def _working_directory() -> str:
    """The working directory; empty if it has been removed."""
    try:
        return os.getcwd()
    except OSError:
        return ""


def summary(error: BaseException, home: str = "") -> str:
    """An exception of user code on one line, with its place; also shows the traceback if enabled."""
    show_traceback(error)
    if issubclass(type(error), Refused):
        return printable(str(error))
    place = place_of(error, home)
    return f"{described(error)} ({place})" if place else described(error)


def place_of(error: BaseException, home: str = "") -> str:
    """Where in user code `error` was raised: ``own.py, line 12, in update``; empty if not in user code.

    Also empty for a syntax error of a file, whose text includes the place.
    """
    try:
        if issubclass(type(error), SyntaxError) and not str(error.filename or "<").startswith("<"):  # type: ignore[attr-defined]
            return ""
        found, step = "", BaseException.__dict__["__traceback__"].__get__(error)
        while step is not None:
            if _is_theirs(step.tb_frame, home):
                code = step.tb_frame.f_code
                within = "" if code.co_name == "<module>" else f", in {code.co_name}"
                found = f"{Path(code.co_filename).name}, line {step.tb_lineno}{within}"
            step = step.tb_next
        return printable(found)
    except BaseException:  # the exception is of a user class, which may raise in turn
        return ""


def home_of(code: object) -> str:
    """The top-level package of `code`, an object, class or function; empty if it is part of wingslevel."""
    try:
        named = code if isinstance(code, type) or hasattr(code, "__code__") else type(code)
        package = str(named.__module__).partition(".")[0]  # type: ignore[attr-defined]
    except BaseException:  # user class
        return ""
    return "" if package in (*_PACKAGES, "__main__", "builtins", "functools") else package


def shown(value: Any) -> str:
    """The repr of `value` on one printable line; its type if it has none."""
    try:
        return printable(repr(value), 100)
    except BaseException:  # user class
        return f"a {class_name(value)} that cannot be printed"


def _is_theirs(frame: FrameType, home: str) -> bool:
    path = frame.f_code.co_filename
    if home and (path == home or str(frame.f_globals.get("__name__", "")).partition(".")[0] == home):
        return True
    if path.startswith("<") or any(part in Path(path).parts for part in _INSTALLED):
        return False
    return not os.path.abspath(path).startswith(_NOT_THEIRS)


def show_traceback(error: BaseException) -> None:
    """Write the traceback of `error` to standard error, if tracebacks are enabled."""
    if not (tracebacks_shown() or os.environ.get(TRACEBACK) == "1"):
        return
    try:
        text = "".join(traceback.format_exception(error))
    except BaseException as fault:  # an exception that cannot be printed
        text = f"the traceback cannot be written: {described(fault)}\n"
    sys.stderr.write(text.encode("utf-8", "backslashreplace").decode("utf-8"))
