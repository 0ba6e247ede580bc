"""What all pictures share: palette, style of Matplotlib, resolution, heading and notes."""

from typing import Any

INK, FAINT, GRID = "#1f2933", "#7b8794", "#e4e7eb"
BLUE, ORANGE, GREEN, RED, VIOLET, TEAL = "#2563a8", "#d9730d", "#3a8f4d", "#c0392b", "#7d52a0", "#16858c"
STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.8,
}
DPI = 150
DASHED = (0, (5, 3))
BOX = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}  # behind text that lies over lines


def heading(figure: Any, left: float, right: float, name: str, facts: str, command: str) -> None:
    """Name and facts at the top left, the command at the top right; `left`, `right` in fractions of the width."""
    height = figure.get_figheight()
    figure.text(left, 1.0 - 0.55 / height, name, fontsize=25, fontweight="bold", color=INK)
    figure.text(left, 1.0 - 0.86 / height, facts, fontsize=10.5, color=FAINT)
    figure.text(right, 1.0 - 0.48 / height, command, fontsize=10.5, color=FAINT, ha="right")


def note(ax: Any, text: str, y: float = 1.012, **place: Any) -> None:
    """A small grey line of text above the axes."""
    ax.text(0.0, y, text, transform=ax.transAxes, fontsize=7.8, color=FAINT, **place)
