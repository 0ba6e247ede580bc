"""A progress bar for calls that take long: in a terminal or a notebook, and only if wanted."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from wingslevel._conditions import shortly
from wingslevel._errors import WingslevelError

if TYPE_CHECKING:
    from estimator.compiler.compiling import Progress as Kernels

Advance = Callable[[float, float], None]  # called with what is done, and the total
Progress = bool | Advance
PATIENCE_S = 2.0  # what is over sooner shows no bar


@contextmanager
def progress_of(wanted: Progress, what: str, unit: str) -> Iterator[Advance]:
    """Gives what is called with what is done of what is to be done, in `unit`.

    wanted : False shows nothing; True shows a bar after two seconds; a function is called instead
    """
    if not isinstance(wanted, bool) and not callable(wanted):
        raise WingslevelError(f"progress = {shortly(wanted)}: must be True, False, or a function of (done, total)")
    if not isinstance(wanted, bool):
        yield wanted
    elif not wanted or not _is_watched():
        yield lambda _done, _total: None
    else:
        from estimator.compiler import compiling

        bar = _Bar(what, unit)
        before = compiling.on_compile(bar.compiling)
        try:
            yield bar
        finally:
            compiling.on_compile(before)
            bar.close()


def _is_watched() -> bool:
    """Whether somebody sees a bar: in a notebook, or where standard error is a terminal."""
    return _in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


def _in_notebook() -> bool:
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


class _Bar:
    """A bar that appears once its patience is over."""

    def __init__(self, what: str, unit: str) -> None:
        self._what, self._unit, self._began_s = what, unit, time.monotonic()
        self._bar: Any = None
        self._task: Any = None

    def __call__(self, done: float, total: float) -> None:
        if self._is_shown():
            self._bar.update(self._task, completed=done, total=total, what=self._what)

    def compiling(self, kernels: "Kernels") -> None:
        """Count the kernels that are compiled, which takes up to half a minute the first time."""
        if self._is_shown():
            self._bar.update(self._task, what=f"compiling: {kernels.compiled} kernels")

    def _is_shown(self) -> bool:
        if self._bar is None and time.monotonic() - self._began_s >= PATIENCE_S:
            self._show()
        return self._bar is not None

    def _show(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self._bar = Progress(
            TextColumn("{task.fields[what]}", markup=False),
            BarColumn(),
            TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {self._unit}"),
            TimeElapsedColumn(),
            console=Console(stderr=not _in_notebook()),
            transient=True,
        )
        self._task = self._bar.add_task("", total=1.0, what=self._what)
        self._bar.start()

    def close(self) -> None:
        """Take it away."""
        if self._bar is not None:
            self._bar.stop()
