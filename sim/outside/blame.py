"""Somebody else's code runs here: whatever it raises becomes one line that names the fault and its place.

Flight code, scenario files and the packages behind entry points may raise anything: SystemExit, KeyboardInterrupt, an
exception that cannot be printed.  `theirs` is the one place that catches it.  A real Ctrl-C, SIGTERM and the time
limit pass through, for the handlers of `sim.outside.signals` remember what they heard.

The place is the innermost line of the traceback that is neither ours nor of Python or an installed library; of an
installed package that offers the code, its own lines count (`home`).
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

TRACEBACK = "WINGSLEVEL_TRACEBACK"  # set to 1 in the environment, whole tracebacks are shown, in workers too
_PACKAGES = ("estimator", "autopilot", "sim", "scenarios")
_ROOT = Path(__file__).resolve().parents[2]
_NOT_THEIRS = tuple(
    f"{path}{os.sep}"
    for path in (*(_ROOT / name for name in _PACKAGES), *(sysconfig.get_path(n) for n in ("stdlib", "platstdlib")))
)
_INSTALLED = ("site-packages", "dist-packages")


class Refused(ValueError):
    """Something that others' code gave and that cannot be used: ours, so that its text alone is the line."""


def tracebacks_shown() -> bool:
    """Whether this process was told to show whole tracebacks."""
    return _Switch.on


class _Switch:
    """Whether this process shows whole tracebacks."""

    on = False


def show_tracebacks(on: bool) -> None:
    """Whether the whole traceback of what others' code raises goes to standard error, besides the line."""
    _Switch.on = on


class theirs:
    """A block in which somebody else's code runs: what it raises becomes ``refuse(line)``.

    The working directory is afterwards what it was: paths are relative to it.

    Parameters
    ----------
    refuse      makes what is raised instead, from the line
    home        file, or name of the package, that their code is in even where it is an installed one
    """

    def __init__(self, refuse: Callable[[str], Exception], home: str = "") -> None:
        self._refuse, self._home, self._listening = refuse, home, listening()

    def __enter__(self) -> None:
        self._listening.__enter__()
        self._before, self._folder = heard(), _working_directory()

    # A generator would not do: contextlib lets StopIteration through where a RuntimeError is raised from it.
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._folder and _working_directory() != self._folder:
            os.chdir(self._folder)
        try:
            if heard() != self._before or (kind is TimedOut and heard()[1]) or (kind is Interrupted and heard()[0]):
                check()  # it may have been swallowed, and something else raised instead
            if error is not None:
                raise self._refuse(told(error, self._home)) from error
        finally:
            self._listening.__exit__(None, None, None)


def _working_directory() -> str:
    """The working directory; empty where it has been removed."""
    try:
        return os.getcwd()
    except OSError:
        return ""


def told(error: BaseException, home: str = "") -> str:
    """What others' code raised, on one line with its place; shows the traceback where that is wanted."""
    show_traceback(error)
    if issubclass(type(error), Refused):
        return printable(str(error))
    place = place_of(error, home)
    return f"{described(error)} ({place})" if place else described(error)


def place_of(error: BaseException, home: str = "") -> str:
    """Where in others' code `error` was raised: ``own.py, line 12, in update``; empty where not in theirs.

    Empty for a syntax error of a file too: its text says where.
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
    except BaseException:  # an exception's class is anyone's, and what it says of itself may raise
        return ""


def home_of(code: object) -> str:
    """The top-level package of the class of `code`, or of the class or function `code`; empty where it is ours."""
    try:
        named = code if isinstance(code, type) or hasattr(code, "__code__") else type(code)
        package = str(named.__module__).partition(".")[0]  # type: ignore[attr-defined]
    except BaseException:  # anyone's class
        return ""
    return "" if package in (*_PACKAGES, "__main__", "builtins", "functools") else package


def shown(value: Any) -> str:
    """`value` as Python writes it, on one printable line; its type where it cannot be written."""
    try:
        return printable(repr(value), 100)
    except BaseException:  # it is anyone's value
        return f"a {class_name(value)} that cannot be printed"


def _is_theirs(frame: FrameType, home: str) -> bool:
    path = frame.f_code.co_filename
    if home and (path == home or str(frame.f_globals.get("__name__", "")).partition(".")[0] == home):
        return True
    if path.startswith("<") or any(part in Path(path).parts for part in _INSTALLED):
        return False
    return not os.path.abspath(path).startswith(_NOT_THEIRS)


def show_traceback(error: BaseException) -> None:
    """Write the traceback of `error` to standard error, where tracebacks are wanted."""
    if not (_Switch.on or os.environ.get(TRACEBACK) == "1"):
        return
    try:
        text = "".join(traceback.format_exception(error))
    except BaseException as fault:  # an exception that cannot be printed
        text = f"the traceback cannot be written: {described(fault)}\n"
    sys.stderr.write(text.encode("utf-8", "backslashreplace").decode("utf-8"))
