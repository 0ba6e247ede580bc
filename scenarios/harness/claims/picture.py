"""Pictures of the claims: a row of panels, recorded while a claim is measured and drawn only if a picture is wanted.

`Panel` has the few kinds of curves, bars and marks that the claims use.  matplotlib is imported when a picture is
drawn.
"""

import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from estimator.interface import Array
from scenarios.harness.metrics import SeriesOf
from scenarios.harness.picture_style import BLUE, FAINT, GREEN, GRID, INK, ORANGE, RED, STYLE, TEAL, VIOLET
from sim.log import Flight

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["BLUE", "FAINT", "GREEN", "GRID", "INK", "ORANGE", "RED", "TEAL", "VIOLET", "Panel", "png"]

SIZE, DPI = (9.0, 3.6), 110


class Panel:
    """One panel of a picture.

    Parameters
    ----------
    title       printed at the top left
    y, x        labels of the axes, with units
    log         axes with a logarithmic scale: "x", "y" or "xy"
    legend      where the legend goes, if any curve has a label; empty for no legend
    columns     number of columns of the legend
    **settings  of the axes, as `matplotlib.axes.Axes.set` takes them: xlim, ylim, xticks, yticks ...
    """

    def __init__(
        self, title: str, y: str, x: str = "time, s", *, log: str = "", legend: str = "best", columns: int = 1,
        **settings: Any
    ) -> None:  # fmt: skip
        self.title, self.y, self.x = title, y, x
        self._log, self._legend, self._columns = log, legend, columns
        self._settings = settings
        self._calls: list[Callable[[Any], object]] = []
        self._labelled = False

    def curve(
        self, x: "ArrayLike", y: "ArrayLike", colour: str, label: str = "", style: str = "-", **more: Any
    ) -> None:
        """A curve, or markers where `style` says so: "o-" for values against a swept parameter."""
        self._labelled |= bool(label)
        self._calls.append(lambda ax: ax.plot(x, y, style, color=colour, label=label or None, **more))

    def curves(
        self,
        x: "ArrayLike",
        y_by_label: Mapping[str, "ArrayLike"],
        colours: Sequence[str],
        style: str = "-",
        **more: Any,
    ) -> None:
        """Several curves over the same x, each with its label."""
        for (label, y), colour in zip(y_by_label.items(), colours, strict=True):
            self.curve(x, y, colour, label, style, **more)

    def traces(
        self, curves: Iterable[tuple[Array, Array]], colour: str, label: str = "", *, lw: float = 1.0, **more: Any
    ) -> None:
        """Several thin curves that share one colour and one label, such as the same quantity in several flights."""
        for i, (x, y) in enumerate(curves):
            self.curve(x, y, colour, "" if i else label, lw=lw, **more)

    def flights(
        self,
        flown: Sequence[Flight],
        series: SeriesOf,
        colour: str,
        label: str = "",
        from_s: float = -math.inf,
        to_s: float = math.inf,
    ) -> None:
        """Time histories of `series` between two times since the release, a curve for each flight."""
        shown = (series(flight).within(from_s, to_s) for flight in flown)
        self.traces([(one.t_s, one.value) for one in shown], colour, label)

    def cloud(self, x: float, values: Sequence[float], colour: str, size: float = 6.0) -> None:
        """All `values`, one for each flight, above one value of the swept parameter."""
        self.curve([x] * len(values), values, colour, style="o", ms=size, alpha=0.6, mew=0)

    def bars(
        self, names: Sequence[str], groups: Mapping[str, tuple[Iterable[float], Any]], form: str = "{:.1f}"
    ) -> None:
        """Bars above `names` with their values written on them: `groups` are label -> (values, colour or colours)."""
        self._labelled |= len(groups) > 1
        self.x = ""
        step = 0.78 / len(groups) if len(groups) > 1 else 0.62
        backed = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.5}, "zorder": 5}

        def draw(ax: Any) -> None:
            for i, (label, (values, colour)) in enumerate(groups.items()):
                at = [k + step * (i - 0.5 * (len(groups) - 1)) for k in range(len(names))]
                heights = list(values)
                bars = ax.bar(at, heights, step - 0.02, color=colour, label=label or None)
                ax.bar_label(bars, [form.format(height) for height in heights], padding=2, fontsize=8.5, **backed)
            ax.set_xticks(range(len(names)), names)
            ax.grid(visible=False, axis="x")

        self._calls.append(draw)

    def level(self, y: float, colour: str = FAINT, text: str = "", *, side: str = "right", label: str = "") -> None:
        """A dashed horizontal line, with a text above its right or left end."""
        self._labelled |= bool(label)
        self._calls.append(lambda ax: ax.axhline(y, color=colour, ls="--", lw=1, label=label or None))
        if text:
            at = (0.99 if side == "right" else 0.01, y)
            placed = {"xycoords": ("axes fraction", "data"), "xytext": (0, 3), "textcoords": "offset points"}
            self._calls.append(lambda ax: ax.annotate(text, at, color=colour, ha=side, **placed))

    def upright(self, x: float, colour: str = FAINT) -> None:
        """A dashed vertical line."""
        self._calls.append(lambda ax: ax.axvline(x, color=colour, ls="--", lw=1))

    def shade(self, from_x: float, to_x: float, text: str = "") -> None:
        """A grey band from one value of x to another, with a text at its top."""
        self._calls.append(lambda ax: ax.axvspan(from_x, to_x, color=FAINT, alpha=0.15, lw=0))
        self.note(text, 0.5 * (from_x + to_x), 0.93, ha="center", fraction="y")

    def between(self, x: "ArrayLike", low: "ArrayLike", high: "ArrayLike", colour: str, **more: Any) -> None:
        """The area between two curves."""
        self._calls.append(lambda ax: ax.fill_between(x, low, high, color=colour, lw=0, **more))

    def note(self, text: str, x: float, y: float, colour: str = FAINT, *, ha: str = "left", fraction: str = "") -> None:
        """A text; coordinates that `fraction` names ("y", "xy") are fractions of the panel, the others are data."""
        coords = tuple("axes fraction" if axis in fraction else "data" for axis in "xy")
        self._calls.append(lambda ax: ax.annotate(text, (x, y), xycoords=coords, color=colour, ha=ha))

    def draw(self, ax: Any) -> None:
        """Draw it all on matplotlib's axes `ax`."""
        ax.set_title(self.title, loc="left", fontsize=10.5)
        ax.grid(color=GRID, lw=0.6)
        for call in self._calls:
            call(ax)
        # Scales first: they bring their own ticks.
        ax.set(**{f"{axis}scale": "log" for axis in self._log}, xlabel=self.x, ylabel=self.y)
        ax.set(**self._settings)
        for name, axis in (("xticks", ax.xaxis), ("yticks", ax.yaxis)):
            if name in self._settings:
                axis.set_ticks(self._settings[name], [f"{tick:g}" for tick in self._settings[name]])
                ax.minorticks_off()
        if self._labelled and self._legend:
            ax.legend(loc=self._legend, ncols=self._columns)


def png(panels: Sequence[Panel]) -> bytes:
    """The picture of `panels`, side by side: the same bytes each time."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    buffer = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=SIZE, facecolor="white", layout="constrained")
        FigureCanvasAgg(figure)
        for panel, ax in zip(panels, figure.subplots(1, len(panels), squeeze=False)[0], strict=True):
            panel.draw(ax)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})  # no version: it would differ
    return buffer.getvalue()
