"""The Rerun recording of a flight, truth and estimate together, written afterwards or streamed live.

`write` makes a ``.rrd`` file after the flight, viewer layout included; `LiveView` streams the same data in blocks
during the flight.  Times are seconds since the release, negative before it.  A recording contains no wall-clock
time: the same flight gives the same data.

The estimated aeroplane is drawn at the true position, so that the visible difference is pure attitude error.  The
chase view follows the path, not the nose: its horizon stays level, so that bank and pitch are visible.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

from autopilot.interface import Mode
from estimator.interface import Array, HeadingReference, Health
from estimator.rotation import from_euler
from sim.log import Event, Flight, Log, Phase
from sim.outside.wording import printable
from sim.place import Place
from sim.recording import RecordingError, digest, replacing
from sim.view.drawable import drawable
from sim.view.layout import TIMELINE, blueprint, extent
from sim.view.loft import Mesh
from sim.view.mesh import Part, aeroplane, geometry_of
from sim.view.plots import ESTIMATE, PLOTS, TRUTH, Colour, curves, limits
from sim.view.story import launch_place, setting, story
from sim.view.viewer import Viewer as Viewer
from sim.view.viewer import open_viewer as open_viewer

if TYPE_CHECKING:
    import rerun as rr

    _When = Callable[[Any], list[rr.TimeColumn]]

CONTROLS = ("aileron", "elevator", "rudder")

_GROUND: Colour = (66, 84, 66)
_GRID: Colour = (92, 112, 90)
_WIND: Colour = (120, 220, 230)
_LARGE = 0.05  # scale of the aeroplane in the overview, per metre of extent
_WIDTHS = (2.4, 1.7, 1.2, 1.2)  # of the lines of a plot: lower ones stay visible below the others
_TRACK_HZ, _MAP_HZ = 25.0, 10.0  # of tracks; of the aeroplane on the map
_STEP_RAD = np.radians(0.5)  # resolution of control surface positions
_GHOST, _THINNEST, _DENSER = 105, 10.0, 80.0  # opacity of 255: estimate; propeller at idle; added at full throttle
_PALE = 0.75
_FOOTER = 32  # bytes: offset and length of the index, its checksum, ``RRF2FOOT`` and a one
_FLUSH_S = 120.0  # limit for encoding
_CHASE_S = 1.5  # smoothing time of the path that the chase view follows
_LANES = {"phase": ("truth", "phase", Phase), "mode": ("flown", "mode", Mode), "estimator": ("flown", "health", Health)}
_IDLE, _WARNING, _ALARM, _OK = (90, 95, 105), (190, 140, 50), (180, 60, 60), (50, 125, 80)
_LANE_COLOURS: dict[str, dict[str, Colour]] = {
    "phase": {"held": _IDLE, "thrown": _WARNING, "flying": (45, 110, 125), "resting": _IDLE},
    # Manual grey, attitude modes blue, navigation green; failsafes amber, red if the attitude is unknown.
    "mode": {
        "manual": _IDLE, "rate": (110, 105, 130), "stabilise": (60, 95, 140), "course": (45, 110, 90), "return": _OK,
        "launch": (45, 110, 125), "loiter": (70, 120, 60), "waypoints": (60, 125, 100), "circle": _WARNING,
        "glide": (170, 105, 40), "level": _ALARM, "low": (200, 120, 60), "land": (140, 45, 70),
    },
    "estimator": {"starting": _IDLE, "good": _OK, "poor": _ALARM},
}  # fmt: skip


def write(flight: Flight, path: str | Path) -> Path:
    """Write the Rerun recording of `flight` to `path`, complete or not at all, and return it.

    Raises
    ------
    RecordingError    the file cannot be written
    """
    path = Path(path)
    with replacing(path) as temporary:
        temporary.write_bytes(_encoded(flight, path))
    return path


def _encoded(flight: Flight, path: Path) -> bytes:
    """The Rerun recording of `flight`, for a file at `path`.

    Made in memory and written by us: Rerun reports a full disk only in its log.
    """
    scene, log = Scene.of(flight.manifest, flight.release_s, flight.heading_reference), drawable(flight.log)
    rec = _stream(flight.manifest, digest(flight)[:16])
    lines = curves(log, flight.heading_reference) if len(log) else {}
    stream = rec.binary_stream()  # type: ignore[misc] # attached to the class by another module
    layout = blueprint(log, flight.release_s, limits(log, lines))
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
        raise RecordingError(f"cannot write to {path}: Rerun encoded only a part of it")
    return data


def _is_complete(data: bytes) -> bool:
    """Whether the bytes of a Rerun recording end in a consistent footer."""
    end = data[-_FOOTER:]
    return (
        end[20:28] == b"RRF2FOOT"
        and len(data) == sum(int.from_bytes(end[i : i + 8], "little") for i in (0, 8)) + _FOOTER
    )


class LiveView:
    """Streams a flight to a viewer while it is flown: call it with the log and the number of rows filled.

    url : gRPC server of the viewer, see `Viewer`     manifest, release_s, heading_reference : as in `Flight`
    """

    def __init__(
        self, url: str, manifest: Mapping[str, Any], release_s: float, heading_reference: HeadingReference
    ) -> None:
        self._scene = Scene.of(manifest, release_s, heading_reference)
        self._sent = 0
        self._rec = _stream(manifest, None)
        self._rec.connect_grpc(url, default_blueprint=blueprint(None, 0.0, {}))
        _send_fixed(self._rec, self._scene)

    def __call__(self, log: Log, n_rows: int) -> None:
        """Send the new rows."""
        so_far = log.until(n_rows)
        _send_rows(self._rec, self._scene, so_far, curves(so_far, self._scene.heading_reference), self._sent)
        self._sent = n_rows

    def close(self, flight: Flight) -> None:
        """Send the remaining rows of `flight`, its events and its story."""
        self(flight.log, len(flight.log))
        _send_end(self._rec, flight)
        self._rec.flush()
        self._rec.disconnect()


@dataclass(frozen=True, slots=True)
class Scene:
    """The fixed parts of the scene.

    parts : of the aeroplane     place : of the launch
    """

    parts: dict[str, Part]
    place: Place
    release_s: float
    heading_reference: HeadingReference

    @classmethod
    def of(cls, manifest: Mapping[str, Any], release_s: float, heading_reference: HeadingReference) -> "Scene":
        """The scene of a flight with `manifest`; an aircraft without geometry is drawn as the `endurance`."""
        try:
            geometry = geometry_of(str(setting(manifest, "aircraft", "endurance")))
        except ValueError:
            geometry = geometry_of("endurance")
        return cls(aeroplane(geometry), launch_place(manifest), release_s, heading_reference)

    def lat_lon_deg(self, p_e_m: Array) -> Array:
        """Latitude and longitude, shape (n, 2), of positions from the launch point, shape (n, 3)."""
        return self.place.geodetic(p_e_m)[:, :2]


def _stream(manifest: Mapping[str, Any], recording_id: str | None) -> "rr.RecordingStream":
    import rerun as rr

    rec = rr.RecordingStream("wingslevel", recording_id=recording_id, send_properties=False)
    rec.set_log_time_enabled(False)
    scenario, estimator = setting(manifest, "scenario", "flight"), setting(manifest, "estimator", "estimator")
    seed = setting(manifest, "seed")
    rec.send_recording_name(printable(f"{scenario}, {estimator}" + ("" if seed is None else f", seed {seed}")))
    return rec


def _send_fixed(rec: "rr.RecordingStream", scene: Scene) -> None:
    """Send what never changes: ground, launch point, aircraft shapes, names and colours of the lines."""
    import rerun as rr

    rec.log("world", rr.ViewCoordinates.FRD, static=True)  # north, east, down
    far = 4000.0
    steps = np.arange(-1000.0, 1001.0, 50.0)  # short segments, as line width is constant within one
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
    home = rr.GeoPoints(
        lat_lon=[(scene.place.latitude_deg, scene.place.longitude_deg)],
        radii=rr.Radius.ui_points(5.0),
        colors=(255, 255, 255),
    )
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
    """The coloured mesh: pale fuselage and control surfaces, dark underside to show which side is up."""
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
    """Send the rows of `log` and of its plot `lines` from `start` on; tracks are sent again as a whole."""
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
    """Send control surfaces whenever one has moved by a step, and propeller opacity by throttle."""
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
    """Rows from `start` on whose value differs from the row before; the first row counts."""
    changed = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    return changed[changed >= start]


def _every(log: Log, rate_hz: float) -> int:
    """Rows between samples at about `rate_hz`."""
    return max(1, round(1.0 / (rate_hz * max(float(log.measured["dt_s"][-1]), 1e-3))))


def _ns(t_s: Array) -> NDArray[np.timedelta64]:
    """Seconds as nanoseconds, rounded, not truncated as by Rerun."""
    return np.round(t_s * 1e9).astype("timedelta64[ns]")


def _send_tracks(rec: "rr.RecordingStream", scene: Scene, log: Log, here: Array) -> None:
    """Send the path so far, its shadow on the ground, the GPS fixes and the mean wind."""
    import rerun as rr

    every = _every(log, _TRACK_HZ)
    track = log.truth["p_e_m"][::every]
    thin = rr.Radius.ui_points(1.0)
    rec.log("world/truth/track", rr.LineStrips3D([track], colors=TRUTH, radii=rr.Radius.ui_points(1.5)), static=True)
    shadow = track * [1.0, 1.0, 0.0]
    rec.log("world/truth/shadow", rr.LineStrips3D([shadow], colors=(0, 0, 0, 120), radii=thin), static=True)
    on_map = rr.GeoLineStrings(lat_lon=[here[::every]], colors=TRUTH, radii=rr.Radius.ui_points(2.0))
    rec.log("map/truth", on_map, static=True)
    rec.log("world/truth/body/large", rr.Transform3D(scale=_LARGE * extent(log)[1]), static=True)
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
    """Level frames along the smoothed path, shape (n, 3, 3); along the nose if there is no path."""
    v_e_m_s, nose = log.truth["v_e_m_s"], log.truth["R_eb"][:, :, 0]
    ahead = v_e_m_s[:, 0] + 0.3 * nose[:, 0] + 1j * (v_e_m_s[:, 1] + 0.3 * nose[:, 1])
    half = max(1, round(_CHASE_S / max(float(log.measured["dt_s"][-1]), 1e-3)))
    window = np.hanning(2 * half + 1)
    padded = np.concatenate((np.full(half, ahead[0]), ahead, np.full(half, ahead[-1])))
    smooth = np.convolve(padded, window / window.sum(), mode="valid")
    return from_euler(0.0, 0.0, np.angle(smooth))


def _send_end(rec: "rr.RecordingStream", flight: Flight) -> None:
    """Send what is known after the flight: its events and its story."""
    import rerun as rr

    events: Sequence[Event] = flight.events
    if events:
        when = [rr.TimeColumn(TIMELINE, duration=_ns(np.array([e.t_s for e in events]) - flight.release_s))]
        columns = rr.TextLog.columns(text=[printable(e.text) for e in events], level=[e.level.upper() for e in events])
        rec.send_columns("events", when, columns)
    rec.log("story", rr.TextDocument(story(flight), media_type=rr.MediaType.MARKDOWN), static=True)
