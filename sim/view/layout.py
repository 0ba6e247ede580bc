"""The layout of the Rerun viewer: 3-D views, story, events and map on the left; plots and states on the right."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from estimator.interface import Array
from sim.log import Log
from sim.view.plots import PAGES, TRUTH, Colour, Curve, Plot, Range

if TYPE_CHECKING:
    import rerun.blueprint as rrb

TIMELINE = "sim_time"
_SKY: Colour = (118, 146, 170)


def blueprint(log: Log | None, release_s: float, ranges: Mapping[str, Range]) -> "rrb.Blueprint":
    """The layout for `log`, or for a live flight that has not begun (None).

    ranges : value axis of each plot by its path, empty for a live flight
    """
    import rerun.blueprint as rrb

    chase, overview = _views(log)
    words = rrb.Tabs(
        rrb.TextDocumentView(origin="/story", name="Story"),
        rrb.TextLogView(origin="/events", name="Events"),
        rrb.MapView(origin="/map", name="Map", zoom=_zoom(extent(log)[1])),
        active_tab=0,
    )
    span = _span(log, release_s)
    axis = rrb.TimeAxis(view_range=span) if span else None
    # A page of a sensor that is not fitted is left out.
    pages = {name: plots for name, plots in PAGES.items() if not ranges or any(p.path in ranges for p in plots)}
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(chase, rrb.Horizontal(overview, words, column_shares=[5, 4]), row_shares=[3, 2]),
            rrb.Vertical(
                rrb.Tabs(*(_page(name, plots, axis, ranges) for name, plots in pages.items()), active_tab=0),
                rrb.StateTimelineView(origin="/states", name="Phase, mode, estimator", time_view=axis),
                row_shares=[9, 2],
            ),
            column_shares=[9, 8],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, playback_speed=1.0),
        rrb.TopPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )


def _views(log: Log | None) -> "tuple[rrb.Spatial3DView, rrb.Spatial3DView]":
    """The chase view and the overview."""
    import rerun as rr
    import rerun.blueprint as rrb

    up = (0.0, 0.0, -1.0)
    sky = rrb.Background(color=_SKY)
    faint = rr.LineStrips3D.from_fields(colors=(*TRUTH, 70), radii=rr.Radius.ui_points(0.8))
    chase = rrb.Spatial3DView(
        origin="/world/chase",
        contents=["+ /world/**", "- /world/truth/body/large/**", "- /world/launch", "- /world/gps", "- /world/wind"],
        name="Chase: orange truth, blue estimate", background=sky, line_grid=False,
        overrides={"world/truth/track": faint},
        eye_controls=rrb.EyeControls3D(position=(-1.75, -0.3, -0.8), look_target=(0.0, 0.0, 0.0), eye_up=up),
    )  # fmt: skip
    centre, reach = extent(log)
    eye = rrb.EyeControls3D(position=centre + reach * np.array([-0.7, -0.42, -0.58]), look_target=centre, eye_up=up)
    overview = rrb.Spatial3DView(
        origin="/world", contents=["+ /world/**", "- /world/estimate/body/**"],
        name="The whole flight", background=sky, line_grid=False, eye_controls=eye,
    )  # fmt: skip
    return chase, overview


def _zoom(reach_m: float) -> float:
    """Zoom of the map that shows `reach_m` around its centre."""
    degrees_wide = 1.6 * reach_m / 111_320.0
    return float(np.log2(360.0 / degrees_wide) + 0.3)


def _page(name: str, plots: Sequence[Plot], axis: "rrb.TimeAxis | None", ranges: Mapping[str, Range]) -> "rrb.Vertical":
    """The plots of a page, one below the other; a legend only if it differs from that above."""
    import rerun.blueprint as rrb

    views, heights = [], []
    above: tuple[Curve, ...] = ()
    for plot in plots:
        legend = rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=plot.curves != above)
        above = plot.curves
        shown = ranges.get(plot.path)
        axis_y = rrb.ScalarAxis(range=shown) if shown else None
        views.append(
            rrb.TimeSeriesView(
                origin=f"/plots/{plot.path}", name=plot.title, axis_x=axis, axis_y=axis_y, plot_legend=legend
            )
        )
        heights.append(_height(shown))
    return rrb.Vertical(*views, row_shares=heights, name=name)


def _height(shown: Range | None) -> float:
    """Relative height of a plot, in pixels: the viewer labels powers of ten 24 pixels apart."""
    frame, least = 46.0, 70.0
    if shown is None:
        return frame + 2.0 * least
    span = shown[1] - shown[0]
    return frame + max(least, 24.0 * span / 10.0 ** np.floor(np.log10(span)))


def extent(log: Log | None) -> tuple[Array, float]:
    """Centre of the flown volume, shape (3,), and its diagonal in metres, at least 60."""
    if log is None or len(log) == 0:
        return np.array([0.0, 0.0, -30.0]), 150.0
    corners = np.array([log.truth["p_e_m"].min(axis=0), log.truth["p_e_m"].max(axis=0), np.zeros(3)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), max(60.0, float(np.linalg.norm(high - low)))


def _span(log: Log | None, release_s: float) -> "rrb.TimeRange | None":
    """Initial time range of the plots: the whole flight and a margin before it."""
    import rerun.blueprint as rrb

    if log is None or len(log) == 0:
        return None
    first_s, last_s = (float(t_s) - release_s for t_s in log.truth["t_s"][[0, -1]])
    first_s -= 0.16 * (last_s - first_s)  # room for the legends
    return rrb.TimeRange(*(rrb.TimeRangeBoundary.absolute(seconds=t_s) for t_s in (first_s, last_s)))
