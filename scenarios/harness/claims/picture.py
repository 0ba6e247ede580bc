"""The pictures of the claims: one size, one style, one set of colours.

Imported only when a picture is drawn: it brings matplotlib.
"""

import io
from collections.abc import Callable
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarios.harness.picture_style import BLUE, FAINT, GREEN, GRID, INK, ORANGE, RED, STYLE, TEAL, VIOLET

__all__ = ["BLUE", "FAINT", "GREEN", "GRID", "INK", "ORANGE", "RED", "TEAL", "VIOLET", "axes", "label", "png"]

SIZE, DPI = (9.0, 3.6), 110


def png(draw: Callable[[Figure], None]) -> bytes:
    """The picture that `draw` makes of an empty figure of the common size and style: the same bytes each time."""
    buffer = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=SIZE, facecolor="white", layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})  # no version: it would differ
    return buffer.getvalue()


def axes(figure: Figure, *titles: str) -> list[Any]:
    """Panels side by side, each with its title (top left) and a light grid."""
    panels = list(figure.subplots(1, len(titles), squeeze=False)[0])
    for ax, title in zip(panels, titles, strict=True):
        ax.set_title(title, loc="left", fontsize=10.5)
        ax.grid(color=GRID, lw=0.6)
        ax.set_axisbelow(True)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
    return panels


def label(ax: Any, x: str, y: str) -> None:
    """Name the axes, with units."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
