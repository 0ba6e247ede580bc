"""A flight to look at: the Rerun recording of truth beside estimate, and the viewer that shows it.

`write` makes a ``.rrd`` in bulk after the flight, with the layout of the viewer inside; `LiveView` streams the same
in blocks while flying.  Times are seconds since the release, negative before it.  No
wall clock goes into a recording: the same flight gives the same data.

The estimated aeroplane is drawn at the true position, so that what one sees between the two is attitude error
alone.  The chase view follows the path, not the nose: its horizon stays level, and bank and pitch are seen.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pymap3d  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

from autopilot.interface import Mode
from estimator.interface import Array, HeadingReference, Health
from estimator.rotation import from_euler
from sim.log import Event, Flight, Log, Phase
from sim.outside.wording import printable
from sim.place import LATITUDE_DEG, LONGITUDE_DEG
from sim.recording import RecordingError, digest, replacing
from sim.view.drawable import drawable
from sim.view.loft import Mesh
from sim.view.mesh import Part, aeroplane, geometry_of
from sim.view.plots import ESTIMATE, PAGES, PLOTS, TRUTH, Colour, Curve, Plot, Range, curves, limits
from sim.view.story import setting, story
from sim.view.viewer import Viewer as Viewer
from sim.view.viewer import open_viewer as open_viewer

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    _When = Callable[[Any], list[rr.TimeColumn]]

TIMELINE = "sim_time"
CONTROLS = ("aileron", "elevator", "rudder")

_SKY: Colour = (118, 146, 170)
_GROUND: Colour = (66, 84, 66)
_GRID: Colour = (92, 112, 90)
_WIND: Colour = (120, 220, 230)
_LARGE = 0.05  # the overview shows the aeroplane larger, by this times the reach in metres, or nobody would find it
_WIDTHS = (2.4, 1.7, 1.2, 1.2)  # of the lines of a plot: a lower one is seen beside those that cover it
_TRACK_HZ, _MAP_HZ = 25.0, 10.0  # the drawn tracks; the aeroplane on the map
_STEP_RAD = np.radians(0.5)  # a control surface is drawn within this of where it is
_GHOST, _THINNEST, _DENSER = 105, 10.0, 80.0  # opacity of 255: the estimate; the propeller at no throttle, more at full
_PALE = 0.75
_FOOTER = 32  # bytes: offset and length of the index, its checksum, ``RRF2FOOT`` and a one
_FLUSH_S = 120.0  # longest that Rerun may take to encode
_CHASE_S = 1.5  # the chase view follows the path smoothed over about so long
_LANES = {"phase": ("truth", "phase", Phase), "mode": ("flown", "mode", Mode), "estimator": ("flown", "health", Health)}
_LANE_COLOURS: dict[str, dict[str, Colour]] = {
    "phase": {"held": (90, 95, 105), "thrown": (190, 140, 50), "flying": (45, 110, 125), "resting": (90, 95, 105)},
    # By hand grey, held blue, led green; a failsafe is amber, and red where nobody knows the attitude.
    "mode": {
        "manual": (90, 95, 105),
        "rate": (110, 105, 130),
        "stabilise": (60, 95, 140),
        "course": (45, 110, 90),
        "return": (50, 125, 80),
        "launch": (45, 110, 125),
        "loiter": (70, 120, 60),
        "waypoints": (60, 125, 100),
        "circle": (190, 140, 50),
        "glide": (170, 105, 40),
        "level": (180, 60, 60),
        "low": (200, 120, 60),
    },
    "estimator": {"starting": (90, 95, 105), "good": (50, 125, 80), "poor": (180, 60, 60)},
}


def write(flight: Flight, path: str | Path) -> Path:
    """Write the Rerun recording of `flight` to `path`, complete or not at all, and return it.

    Raises
    ------
    RecordingError    where the system refuses to write
    """
    path = Path(path)
    with replacing(path) as temporary:
        temporary.write_bytes(_encoded(flight, path))
    return path


def _encoded(flight: Flight, path: Path) -> bytes:
    """The Rerun recording of `flight`, for a file at `path`.

    Made in memory and written by us: Rerun's own writing to a file reports a full disk in its log alone.
    """
    scene, log = Scene.of(flight.manifest, flight.release_s, flight.heading_reference), drawable(flight.log)
    rec = _stream(flight.manifest, digest(flight)[:16])
    lines = curves(log, flight.heading_reference) if len(log) else {}
    stream = rec.binary_stream()  # type: ignore[misc] # attached to the class as a function of another module
    layout = _blueprint(log, flight.release_s, limits(log, lines))
    rec.send_blueprint(layout, make_active=False, make_default=True)
    _send_fixed(rec, scene)
    _send_rows(rec, scene, log, lines, 0)
    _send_end(rec, flight)
    try:
        data = stream.read(flush=True, flush_timeout_sec=_FLUSH_S) or b""
    except RuntimeError as error:
        raise RecordingError(f"cannot write to {path}: Rerun cannot encode it ({error})") from error
    rec.disconnect()
    if not _is_complete(data):
        raise RecordingError(f"cannot write to {path}: Rerun has encoded a part of it alone")
    return data


def _is_complete(data: bytes) -> bool:
    """Whether the bytes of a Rerun recording end in its footer, and that lies where it says."""
    end = data[-_FOOTER:]
    return (
        end[20:28] == b"RRF2FOOT"
        and len(data) == sum(int.from_bytes(end[i : i + 8], "little") for i in (0, 8)) + _FOOTER
    )


class LiveView:
    """Streams a flight to a viewer while it is flown: call it with the log and the number of rows filled so far.

    url : of the viewer's gRPC server, see `Viewer`     manifest, release_s, heading_reference : as of the `Flight`
    """

    def __init__(
        self, url: str, manifest: Mapping[str, Any], release_s: float, heading_reference: HeadingReference
    ) -> None:
        self._scene = Scene.of(manifest, release_s, heading_reference)
        self._sent = 0
        self._rec = _stream(manifest, None)
        self._rec.connect_grpc(url, default_blueprint=_blueprint(None, 0.0, {}))
        _send_fixed(self._rec, self._scene)

    def __call__(self, log: Log, n_rows: int) -> None:
        """Send the rows that are new."""
        so_far = log.until(n_rows)
        _send_rows(self._rec, self._scene, so_far, curves(so_far, self._scene.heading_reference), self._sent)
        self._sent = n_rows

    def close(self, flight: Flight) -> None:
        """Send what is left of `flight`, its events and its story."""
        self(flight.log, len(flight.log))
        _send_end(self._rec, flight)
        self._rec.flush()
        self._rec.disconnect()


@dataclass(frozen=True, slots=True)
class Scene:
    """What is drawn and where, beside the rows of the log.

    parts : the aeroplane     place : latitude and longitude of the launch point, degrees
    """

    parts: dict[str, Part]
    place: tuple[float, float]
    release_s: float
    heading_reference: HeadingReference

    @classmethod
    def of(cls, manifest: Mapping[str, Any], release_s: float, heading_reference: HeadingReference) -> "Scene":
        """The scene of a flight with `manifest`; an aeroplane without a geometry is drawn as the `endurance`."""
        try:
            geometry = geometry_of(str(setting(manifest, "aircraft", "endurance")))
        except ValueError:
            geometry = geometry_of("endurance")
        place = (
            float(setting(manifest, "launch_latitude_deg", LATITUDE_DEG)),
            float(setting(manifest, "launch_longitude_deg", LONGITUDE_DEG)),
        )
        return cls(aeroplane(geometry), place, release_s, heading_reference)

    def lat_lon_deg(self, p_e_m: Array) -> Array:
        """Latitude and longitude, shape (n, 2), of positions from the launch point, shape (n, 3) (WGS 84)."""
        latitude, longitude, _ = pymap3d.ned2geodetic(*p_e_m.T, *self.place, 0.0)
        return np.column_stack((latitude, longitude))


def _stream(manifest: Mapping[str, Any], recording_id: str | None) -> "rr.RecordingStream":
    import rerun as rr

    rec = rr.RecordingStream("wingslevel", recording_id=recording_id, send_properties=False)
    rec.set_log_time_enabled(False)
    scenario, estimator = setting(manifest, "scenario", "flight"), setting(manifest, "estimator", "estimator")
    seed = setting(manifest, "seed")
    rec.send_recording_name(printable(f"{scenario}, {estimator}" + ("" if seed is None else f", seed {seed}")))
    return rec


def _send_fixed(rec: "rr.RecordingStream", scene: Scene) -> None:
    """What never moves: ground, launch point, the shapes of the aeroplanes, the names and colours of the lines."""
    import rerun as rr

    rec.log("world", rr.ViewCoordinates.FRD, static=True)  # north, east, down
    far = 4000.0
    steps = np.arange(-1000.0, 1001.0, 50.0)  # short segments: a long one is drawn as thick as its far end needs
    along = [np.column_stack((steps, np.full_like(steps, s), np.zeros_like(steps))) for s in steps]
    across = [strip[:, [1, 0, 2]] for strip in along]
    grid = rr.LineStrips3D(along + across, colors=_GRID, radii=rr.Radius.ui_points(0.5))
    rec.log("world/ground/grid", grid, static=True)
    corners = np.array([[-far, -far, 0.5], [far, -far, 0.5], [far, far, 0.5], [-far, far, 0.5]])
    plain = rr.Mesh3D(
        vertex_positions=corners, triangle_indices=[[0, 2, 1], [0, 3, 2]],
        vertex_normals=np.tile([0.0, 0.0, -1.0], (4, 1)), albedo_factor=_GROUND,
    )  # fmt: skip
    rec.log("world/ground/plain", plain, static=True)
    launch = rr.Points3D([[0.0, 0.0, 0.0]], radii=rr.Radius.ui_points(5.0), colors=(255, 255, 255), labels="launch")
    rec.log("world/launch", launch, static=True)
    home = rr.GeoPoints(lat_lon=[scene.place], radii=rr.Radius.ui_points(5.0), colors=(255, 255, 255))
    rec.log("map/launch", home, static=True)
    for lane, colours in _LANE_COLOURS.items():
        words = list(colours)
        style = rr.StateConfiguration(values=words, labels=words, colors=list(colours.values()))
        rec.log(f"states/{lane}", style, static=True)
    for name, part in scene.parts.items():
        shape = _painted(part.mesh, name, TRUTH)
        rec.log(f"world/truth/body/{name}", shape, static=True)
        rec.log(f"world/truth/body/large/{name}", shape, static=True)
        if name != "propeller":
            rec.log(f"world/estimate/body/{name}", _painted(part.mesh, name, ESTIMATE, _GHOST), static=True)
    for plot in PLOTS:
        lines = rr.SeriesLines(
            names=[c.name for c in plot.curves], colors=[c.colour for c in plot.curves],
            widths=_WIDTHS[: len(plot.curves)],
        )  # fmt: skip
        rec.log(f"plots/{plot.path}", lines, static=True)


def _painted(mesh: Mesh, name: str, colour: Colour, alpha: int | None = None) -> "rr.Mesh3D":
    """The mesh in its colours: pale fuselage and control surfaces, dark below, so that one sees which side is up."""
    import rerun as rr

    base = np.array(colour, np.float64)
    if name == "propeller":
        base = np.array([225.0, 225.0, 225.0])
    elif name in ("spinner", "canopy"):
        base = 0.15 * base + 0.1 * np.array([210.0, 225.0, 255.0])
    elif name == "fuselage" or name.startswith(CONTROLS):
        base = _PALE * np.array([244.0, 240.0, 232.0]) + (1.0 - _PALE) * base
    below = np.clip(mesh.normals[:, 2:], 0.0, 1.0) if name != "propeller" else 0.0
    rgb = np.broadcast_to(base * (1.0 - 0.6 * below), mesh.vertices.shape)
    return rr.Mesh3D(
        vertex_positions=mesh.vertices, triangle_indices=mesh.triangles, vertex_normals=mesh.normals,
        vertex_colors=rgb.astype(np.uint8), albedo_factor=None if alpha is None else (255, 255, 255, alpha),
    )  # fmt: skip


def _send_rows(rec: "rr.RecordingStream", scene: Scene, log: Log, lines: Mapping[str, Array], start: int) -> None:
    """The rows of `log` and of the `lines` of its plots from `start` on; the tracks anew as a whole."""
    import rerun as rr

    if start >= len(log):
        return
    t_s = log.truth["t_s"] - scene.release_s
    new = slice(start, None)
    p_e_m = log.truth["p_e_m"]

    def when(rows: Any) -> list[rr.TimeColumn]:
        return [rr.TimeColumn(TIMELINE, duration=_ns(t_s[rows]))]

    poses = {
        "world/truth/body": log.truth["R_eb"],
        "world/estimate/body": log.flown["R_eb"],
        "world/chase": _path_frame(log),
    }
    for path, R_eb in poses.items():
        quaternion = Rotation.from_matrix(R_eb[new]).as_quat()
        rec.send_columns(path, when(new), rr.Transform3D.columns(translation=p_e_m[new], quaternion=quaternion))
    for path, drawn in lines.items():
        values = drawn[new]
        columns = rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
        rec.send_columns(f"plots/{path}", when(new), columns)
    for lane, (table, column, meaning) in _LANES.items():
        states = getattr(log, table)[column]
        changed = _changes(states, start)
        if len(changed):
            words = [meaning(states[k]).name.lower() for k in changed]
            rec.send_columns(f"states/{lane}", when(changed), rr.StateChange.columns(state=words))
    _send_moving(rec, scene, log, start, when)
    here = scene.lat_lon_deg(p_e_m)
    size = rr.Radius.ui_points(7.0)
    rec.log("map/aeroplane", rr.GeoPoints.from_fields(colors=TRUTH, radii=size), static=True)
    every = _every(log, _MAP_HZ)
    seldom = np.arange(start + -start % every, len(log), every)
    if len(seldom):
        rec.send_columns("map/aeroplane", when(seldom), rr.GeoPoints.columns(positions=here[seldom]))
    _send_tracks(rec, scene, log, here)


def _send_moving(rec: "rr.RecordingStream", scene: Scene, log: Log, start: int, when: "_When") -> None:
    """Where the control surfaces are, whenever one has moved by a step; the propeller as dense as the throttle."""
    import rerun as rr

    for name, part in scene.parts.items():
        if part.hinge is not None:
            deflection = log.truth[part.hinge.control]
            moved = _changes(np.round(deflection * part.hinge.throw_rad / _STEP_RAD), start)
            translation, quaternion = part.hinge.pose(deflection[moved])
            columns = rr.Transform3D.columns(translation=translation, quaternion=quaternion)
            rec.send_columns(f"world/truth/body/{name}", when(moved), columns)
    if "propeller" in scene.parts:
        level = np.round(16.0 * np.clip(log.truth["throttle"], 0.0, 1.0)) / 16.0
        moved = _changes(level, start)
        rgba = np.column_stack((np.full((len(moved), 3), 255.0), _THINNEST + _DENSER * level[moved]))
        rec.send_columns(
            "world/truth/body/propeller", when(moved), rr.Mesh3D.columns(albedo_factor=rgba.astype(np.uint8))
        )


def _changes(values: NDArray[Any], start: int) -> NDArray[np.intp]:
    """Rows from `start` on whose value is not that of the row before; the very first among them."""
    changed = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    return changed[changed >= start]


def _every(log: Log, rate_hz: float) -> int:
    """How many rows lie between samples at about `rate_hz`."""
    return max(1, round(1.0 / (rate_hz * max(float(log.measured["dt_s"][-1]), 1e-3))))


def _ns(t_s: Array) -> NDArray[np.timedelta64]:
    """Seconds as whole nanoseconds, rounded, where Rerun would cut off."""
    return np.round(t_s * 1e9).astype("timedelta64[ns]")


def _send_tracks(rec: "rr.RecordingStream", scene: Scene, log: Log, here: Array) -> None:
    """The way so far: truth, its shadow on the ground, the GPS fixes; and the mean wind at the launch point."""
    import rerun as rr

    every = _every(log, _TRACK_HZ)
    track = log.truth["p_e_m"][::every]
    thin = rr.Radius.ui_points(1.0)
    rec.log("world/truth/track", rr.LineStrips3D([track], colors=TRUTH, radii=rr.Radius.ui_points(1.5)), static=True)
    shadow = track * [1.0, 1.0, 0.0]
    rec.log("world/truth/shadow", rr.LineStrips3D([shadow], colors=(0, 0, 0, 120), radii=thin), static=True)
    on_map = rr.GeoLineStrings(lat_lon=[here[::every]], colors=TRUTH, radii=rr.Radius.ui_points(2.0))
    rec.log("map/truth", on_map, static=True)
    rec.log("world/truth/body/large", rr.Transform3D(scale=_LARGE * _extent(log)[1]), static=True)
    fixes = log.measured["gps_p_e_m"][log.measured["gps_new"] > 0]
    if len(fixes):
        rec.log("world/gps", rr.Points3D(fixes, colors=ESTIMATE, radii=rr.Radius.ui_points(1.5)), static=True)
        reported = rr.GeoPoints(lat_lon=scene.lat_lon_deg(fixes), colors=ESTIMATE, radii=rr.Radius.ui_points(1.5))
        rec.log("map/gps", reported, static=True)
    known = np.isfinite(log.truth["wind_e_m_s"]).all(axis=1)
    wind_e_m_s = log.truth["wind_e_m_s"][known].mean(axis=0) if known.any() else np.zeros(3)
    speed_m_s = float(np.hypot(wind_e_m_s[0], wind_e_m_s[1]))
    if speed_m_s > 0.1:
        from_deg = float(np.degrees(np.arctan2(-wind_e_m_s[1], -wind_e_m_s[0])) % 360.0)
        arrow = rr.Arrows3D(
            vectors=[wind_e_m_s * 16.0], origins=[wind_e_m_s * -20.0 - [0.0, 0.0, 25.0]], colors=_WIND, radii=1.0,
            labels=f"wind {speed_m_s:.1f} m/s from {from_deg:.0f}°",
        )  # fmt: skip
        rec.log("world/wind", arrow, static=True)


def _path_frame(log: Log) -> Array:
    """Level frames along the smoothed path, shape (n, 3, 3); where there is no path, along the nose."""
    v_e_m_s, nose = log.truth["v_e_m_s"], log.truth["R_eb"][:, :, 0]
    ahead = v_e_m_s[:, 0] + 0.3 * nose[:, 0] + 1j * (v_e_m_s[:, 1] + 0.3 * nose[:, 1])
    half = max(1, round(_CHASE_S / max(float(log.measured["dt_s"][-1]), 1e-3)))
    window = np.hanning(2 * half + 1)
    padded = np.concatenate((np.full(half, ahead[0]), ahead, np.full(half, ahead[-1])))
    smooth = np.convolve(padded, window / window.sum(), mode="valid")
    return from_euler(0.0, 0.0, np.angle(smooth))


def _send_end(rec: "rr.RecordingStream", flight: Flight) -> None:
    """What is known when the flight has ended: its events and its story."""
    import rerun as rr

    events: Sequence[Event] = flight.events
    if events:
        when = [rr.TimeColumn(TIMELINE, duration=_ns(np.array([e.t_s for e in events]) - flight.release_s))]
        columns = rr.TextLog.columns(text=[printable(e.text) for e in events], level=[e.level.upper() for e in events])
        rec.send_columns("events", when, columns)
    rec.log("story", rr.TextDocument(story(flight), media_type=rr.MediaType.MARKDOWN), static=True)


def _blueprint(log: Log | None, release_s: float, ranges: Mapping[str, Range]) -> "rrb.Blueprint":
    """The layout: chase view, overview, story, events and map on the left; plots and states on the right.

    log, ranges : what the overview and the axes of the plots shall hold; None and empty for a flight to come
    """
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
    centre, reach = _extent(log)
    overview = rrb.Spatial3DView(
        origin="/world", contents=["+ /world/**", "- /world/estimate/body/**"],
        name="The whole flight", background=sky, line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=centre + reach * np.array([-0.7, -0.42, -0.58]), look_target=centre, eye_up=up
        ),
    )  # fmt: skip
    degrees_wide = 1.6 * reach / 111_320.0
    words = rrb.Tabs(
        rrb.TextDocumentView(origin="/story", name="Story"),
        rrb.TextLogView(origin="/events", name="Events"),
        rrb.MapView(origin="/map", name="Map", zoom=float(np.log2(360.0 / degrees_wide) + 0.3)),
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


def _page(name: str, plots: Sequence[Plot], axis: "rrb.TimeAxis | None", ranges: Mapping[str, Range]) -> "rrb.Vertical":
    """The plots of a page below one another; a legend where it differs from the one above."""
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
    """Height of a plot for its share of the page, in pixels: the viewer labels powers of ten 24 pixels apart."""
    frame, least = 46.0, 70.0
    if shown is None:
        return frame + 2.0 * least
    span = shown[1] - shown[0]
    return frame + max(least, 24.0 * span / 10.0 ** np.floor(np.log10(span)))


def _extent(log: Log | None) -> tuple[Array, float]:
    """Centre of the flown volume, shape (3,), and its reach in metres."""
    if log is None or len(log) == 0:
        return np.array([0.0, 0.0, -30.0]), 150.0
    corners = np.array([log.truth["p_e_m"].min(axis=0), log.truth["p_e_m"].max(axis=0), np.zeros(3)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), max(60.0, float(np.linalg.norm(high - low)))


def _span(log: Log | None, release_s: float) -> "rrb.TimeRange | None":
    """The time that the plots show at first: all of it, and some before."""
    import rerun.blueprint as rrb

    if log is None or len(log) == 0:
        return None
    first_s, last_s = (float(t_s) - release_s for t_s in log.truth["t_s"][[0, -1]])
    first_s -= 0.16 * (last_s - first_s)  # room for the legends
    return rrb.TimeRange(*(rrb.TimeRangeBoundary.absolute(seconds=t_s) for t_s in (first_s, last_s)))
