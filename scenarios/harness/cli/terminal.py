"""The terminal: where text of others cannot do anything, and tables that are narrow rather than cut.

Imported on first use: it brings rich.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from scenarios.harness.cli.reports import abandon, refusal
from sim.outside.wording import escaped, printable

LEAST = 20  # columns that a terminal is taken to have at least; on fewer its own line breaks do
_WIDE = 100_000
_ASCII = box.Box(str(box.SIMPLE_HEAD).replace("\N{BOX DRAWINGS LIGHT HORIZONTAL}", "-"), ascii=True)


class Terminal(Console):
    """A console without markup that escapes what it is given, and never cuts a line."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, emoji=False, markup=False, **options)

    def print(self, *objects: Any, crop: bool = False, **options: Any) -> None:
        """As rich does, but a line that is too long is left to the terminal to break."""
        try:
            super().print(*objects, crop=crop, **options)
        except OSError as error:
            abandon(self.file)
            raise refusal(f"cannot write to standard output: {error.strerror}") from error

    def on_broken_pipe(self) -> None:
        """The reader has closed the pipe: drop the rest and keep the exit code of the command."""
        abandon(self.file)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """As rich does, with control characters and the like written as their escapes."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(escaped(segment.text, "\n\xa0"), segment.style)


class Grid(Table):
    """A plain table; where even its narrowest form is too wide, each row becomes a few lines, with nothing lost."""

    def __init__(self, heading: str) -> None:
        super().__init__(box=box.SIMPLE_HEAD, pad_edge=False)
        self.heading = printable(heading)

    def column(self, heading: str, *, right: bool = False, wraps: bool = False) -> None:
        """Add a column; only those that wrap shrink if the table is too wide."""
        # Never "ignore": rich 15 aligns nothing in such a column.
        self.add_column(Text(heading), justify="right" if right else "left", no_wrap=not wraps, overflow="fold")

    def row(self, cells: Sequence[str | Text]) -> None:
        """Add a row; what is text of others stays on one line."""
        self.add_row(*(Text(escaped(c)) if isinstance(c, str) else c for c in cells))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The heading, then the table, or its rows as lines."""
        if options.ascii_only:
            self.box = _ASCII
        if self.heading:
            yield _whole(self.heading, "bold")
        if self._narrowest(console, options) <= options.max_width:
            yield from super().__rich_console__(console, options)
            return
        headings = [" ".join(str(column.header).split()) for column in self.columns]
        for cells in zip(*(list(column.cells) for column in self.columns), strict=True):
            first, *others = (" ".join(str(cell).split()) for cell in cells)
            yield _whole(" ".join(text for text in (headings[0] if not first else "", first) if text))
            for heading, text in zip(headings[1:], others, strict=True):
                if text:
                    yield _whole(f"  {heading} {text}" if heading else f"  {text}")
        yield Text()

    def _narrowest(self, console: Console, options: ConsoleOptions) -> int:
        """Columns of the terminal that it needs: those that wrap are as wide as their longest word."""
        natural = self.__rich_measure__(console, options.update(max_width=_WIDE)).maximum
        for column in self.columns:
            if not column.no_wrap:
                texts = [str(column.header), *(str(cell) for cell in column.cells)]
                lines = max((cell_len(line) for text in texts for line in text.splitlines()), default=0)
                natural -= lines - max((cell_len(word) for text in texts for word in text.split()), default=0)
        return natural


def _whole(text: str, style: str = "") -> Text:
    return Text(text, style, no_wrap=True, overflow="ignore")
