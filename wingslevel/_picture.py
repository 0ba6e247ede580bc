"""A figure of Matplotlib that looks the same wherever it is drawn, and that a notebook shows without pyplot."""

import io
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from scenarios.harness.picture_style import STYLE


class Picture(Figure):
    """A figure in the style of the project: ``savefig`` writes it, as PNG, SVG or PDF."""

    def draw(self, renderer: Any) -> None:
        """Draw it; some parts of a figure are made only now, and take their style from the settings."""
        with matplotlib.rc_context(STYLE):
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()
