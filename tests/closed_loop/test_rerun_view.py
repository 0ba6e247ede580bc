"""The Rerun recording, read back and compared with the Parquet of the same flight and with independent algebra."""

import os
import socket
import subprocess
import sys
import time
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.hand_launch import SCENARIO
from scenarios.harness.flight import fly_scenario
from sim import recording
from sim.log import Event, Flight, Log, Outcome
from sim.recording import RecordingError
from sim.view import rerun_view, viewer
from sim.view.mesh import aeroplane, geometry_of
from sim.view.plots import curves, limits
from sim.view.story import story

RERUN = (str(viewer.executable()),)
FLOAT32 = 1e-6  # Rerun's transforms are single precision: 6e-8 of a component near 1, 1e-6 m below 16 m
ROWS = (
    {"name": "inclination error RMS", "unit": "deg", "measured": 3.21, "sense": "<=", "limit": 4.0, "passed": True},
    {"name": "height at 20 s", "unit": "m", "measured": None, "sense": ">=", "limit": 10.0, "passed": False},
)


@pytest.fixture(scope="module")
def flown():
    """Six seconds of a real hand launch."""
    return fly_scenario(SCENARIO, {"duration_s": 6.0}, seed=1)


@pytest.fixture(scope="module")
def folder(flown, tmp_path_factory):
    """The same flight in Parquet and in Rerun's format."""
    directory = recording.save(flown, tmp_path_factory.mktemp("flight"))
    rerun_view.write(flown, directory / "flight.rrd")
    return directory


@pytest.fixture(scope="module")
def flight(folder):
    """The flight as the Parquet has it."""
    return recording.load(folder)


@pytest.fixture(scope="module")
def shown(folder):
    """Reader of one component of the Rerun recording."""
    return Reader(folder / "flight.rrd")


class Reader:
    """Reads components of a recording back into NumPy."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        self.file = RrdReader(path)
        self.store = self.file.store()

    def column(self, entity, component, *, static=False):
        """Times [s] since the release, or None, and the values of every row, in the order of time."""
        times, values = [], []
        for chunk in self.store.stream().filter(content=entity, is_static=static):
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                values += batch.column(component).to_pylist()
                times += [] if static else batch.column("sim_time").cast("int64").to_pylist()
        if static:
            return None, values
        order = np.argsort(times, kind="stable")
        return np.array(times)[order] * 1e-9, [values[i] for i in order]


def test_only_timeline_is_seconds_since_the_release(shown, flight):
    """No wall clock, no tick counter; in the hand the time is negative."""
    assert [str(index) for index in shown.store.schema().index_columns()] == ["Index(timeline:sim_time)"]
    assert not any("start_time" in str(column) for column in shown.store.schema().component_columns())
    t_s, _ = shown.column("/world/truth/body", "Transform3D:quaternion")
    assert t_s[0] < -8.0
    np.testing.assert_allclose(t_s, flight.log.truth["t_s"] - flight.release_s, rtol=0, atol=1e-9)  # whole nanoseconds


@pytest.mark.parametrize(("body", "table"), [("truth", "truth"), ("estimate", "flown")])
def test_aeroplane_has_attitude_of_its_table_at_the_true_position(shown, flight, body, table):
    """Both are drawn at the true position, each with its own attitude; a vector turned by either is the same."""
    entity = f"/world/{body}/body"
    _, quaternion = shown.column(entity, "Transform3D:quaternion")
    _, position_m = shown.column(entity, "Transform3D:translation")
    drawn = Rotation.from_quat(np.array(quaternion)[:, 0]).as_matrix()
    # A quaternion is a rotation exactly; the estimate is one to about 1e-4 only, and is drawn as the nearest.
    tolerance = 1e-4 if body == "estimate" else FLOAT32
    np.testing.assert_allclose(drawn, getattr(flight.log, table)["R_eb"], rtol=0, atol=tolerance)
    p_e_m = flight.log.truth["p_e_m"]
    np.testing.assert_allclose(np.array(position_m)[:, 0], p_e_m, rtol=0, atol=1e-7 * np.abs(p_e_m).max())


def test_error_curves_equal_those_of_independent_algebra(shown, flight):
    """Total by SciPy's rotation angle, inclination by the arc cosine of the down axes, heading against the course."""
    estimated, true = flight.log.flown["R_eb"], flight.log.truth["R_eb"]
    _, values = shown.column("/plots/attitude/error", "Scalars:scalars")
    total_deg, heading_deg, inclination_deg = np.array(values).T
    apart = Rotation.from_matrix(estimated) * Rotation.from_matrix(true).inv()
    np.testing.assert_allclose(total_deg, np.degrees(apart.magnitude()), rtol=0, atol=0.01)  # R_est is not exact
    cosine = np.clip(np.einsum("ki,ki->k", estimated[:, 2], true[:, 2]), -1.0, 1.0)
    np.testing.assert_allclose(inclination_deg, np.degrees(np.arccos(cosine)), rtol=0, atol=0.2)  # arc cosine near 1
    v_n, v_e = flight.log.truth["v_e_m_s"][:, :2].T
    # Nose and course as complex numbers: the angle of one times the other's conjugate is the wrapped difference.
    difference_deg = np.degrees(np.angle((estimated[:, 0, 0] + 1j * estimated[:, 1, 0]) * (v_n - 1j * v_e)))
    judged = (np.hypot(v_n, v_e) > 3.0) & (np.abs(true[:, 2, 0]) < 0.9)
    assert flight.heading_reference == "course"
    assert 250 < judged.sum() < len(judged)
    np.testing.assert_array_equal(np.isnan(heading_deg), ~judged)
    np.testing.assert_allclose(heading_deg[judged], difference_deg[judged], rtol=0, atol=1e-9)


def test_attitude_curves_equal_the_euler_angles_of_scipy(shown, flight):
    """Bank and pitch of truth and estimate; the first line of each plot is the demand of the autopilot."""
    for name, angle, demand in (("bank", 2, "bank_demand_rad"), ("pitch", 1, "pitch_demand_rad")):
        _, values = shown.column(f"/plots/attitude/{name}", "Scalars:scalars")
        demand_deg, true_deg, estimated_deg = np.array(values).T
        expected_deg = Rotation.from_matrix(flight.log.truth["R_eb"]).as_euler("ZYX", degrees=True)[:, angle]
        np.testing.assert_allclose(true_deg, expected_deg, rtol=0, atol=1e-9)
        expected_deg = Rotation.from_matrix(flight.log.flown["R_eb"]).as_euler("ZYX", degrees=True)[:, angle]
        np.testing.assert_allclose(estimated_deg, expected_deg, rtol=0, atol=0.01)
        np.testing.assert_allclose(demand_deg, np.degrees(flight.log.flown[demand]), rtol=0, atol=1e-9)


def test_signal_curves_equal_the_parquet_columns(shown, flight):
    """Bias, rate, specific force and controls, each beside what it is compared with."""
    truth, measured, flown = flight.log.truth, flight.log.measured, flight.log.flown
    expected = {
        "gyro_bias/y": np.degrees([truth["gyro_bias_b_rad_s"][:, 1], flown["gyro_bias_b_rad_s"][:, 1]]),
        "gyro/x": np.degrees([measured["gyro_b_rad_s"][:, 0], truth["imu_omega_b_rad_s"][:, 0]]),
        "force/z": [measured["force_b_m_s2"][:, 2], truth["imu_force_b_m_s2"][:, 2]],
        "controls/elevator": [flown["elevator"], truth["elevator"]],
        "flight/wind_e": [truth["wind_e_m_s"][:, 1], flown["wind_e_m_s"][:, 1]],
    }
    for path, columns in expected.items():
        _, values = shown.column(f"/plots/{path}", "Scalars:scalars")
        np.testing.assert_allclose(np.array(values).T, columns, rtol=0, atol=1e-12)


def test_heading_curve_has_a_gap_where_it_leaps_round_the_circle():
    """A slow full turn: the line is interrupted once, and no step between neighbours is steep."""
    log = Log.empty(401)
    log.truth["R_eb"] = Rotation.from_euler("z", np.linspace(0.0, 2.0 * np.pi, 401)[:, None]).as_matrix()
    heading_deg = curves(log, "nose")["attitude/heading"][:, 1]
    assert np.isnan(heading_deg).sum() == 1
    assert np.nanmax(np.abs(np.diff(heading_deg))) < 1.0


def test_events_are_told_in_their_words_at_their_times(shown, flight):
    t_s, texts = shown.column("/events", "TextLog:text")
    _, levels = shown.column("/events", "TextLog:level")
    told = [(text[0], level[0]) for text, level in zip(texts, levels, strict=True)]
    assert told == [(event.text, event.level.upper()) for event in flight.events]
    assert ("released", "INFO") in told
    np.testing.assert_allclose(t_s, [e.t_s - flight.release_s for e in flight.events], rtol=0, atol=1e-9)


def test_phase_lane_changes_where_the_truth_does(shown, flight):
    t_s, states = shown.column("/states/phase", "StateChange:state")
    assert [s[0] for s in states] == ["held", "thrown", "flying"]
    first = [flight.log.truth["t_s"][np.argmax(flight.log.truth["phase"] == phase)] for phase in range(3)]
    np.testing.assert_allclose(t_s, np.array(first) - flight.release_s, rtol=0, atol=1e-9)


def test_map_shows_the_fixes_where_the_ellipsoid_has_them(shown, flight):
    """Metres from the launch point, by the radii of curvature of WGS 84 there; the flight is short, the earth flat."""
    _, points = shown.column("/map/gps", "GeoPoints:positions", static=True)
    latitude_deg, longitude_deg = np.array(points[-1]).T
    fixes_m = flight.log.measured["gps_p_e_m"][flight.log.measured["gps_new"] > 0]
    assert len(fixes_m) > 10
    a_m, e2, phi = 6378137.0, 6.69437999014e-3, np.radians(42.80)
    normal_m = a_m / np.sqrt(1.0 - e2 * np.sin(phi) ** 2)
    meridian_m = normal_m * (1.0 - e2) / (1.0 - e2 * np.sin(phi) ** 2)
    north_m = np.radians(latitude_deg - 42.80) * meridian_m
    east_m = np.radians(longitude_deg + 73.95) * normal_m * np.cos(phi)
    # 100 m from the launch point the curvature of the earth and of the parallel displace by 2 mm at most.
    np.testing.assert_allclose(np.column_stack((north_m, east_m)), fixes_m[:, :2], rtol=0, atol=3e-3)


def test_both_aeroplanes_are_the_mesh_of_their_geometry(shown):
    """Truth and estimate carry the same shape, part by part; the estimate knows nothing of a propeller."""
    for name, part in aeroplane(geometry_of("endurance")).items():
        for body in ("truth", "estimate") if name != "propeller" else ("truth",):
            _, drawn = shown.column(f"/world/{body}/body/{name}", "Mesh3D:vertex_positions", static=True)
            np.testing.assert_allclose(np.array(drawn[0]), part.mesh.vertices, rtol=0, atol=FLOAT32)


def latest(t_s, values, at_s):
    """What the viewer shows at the times `at_s`: of each the value before, or then."""
    return np.array(values)[np.searchsorted(t_s, at_s + 1e-9, side="right") - 1]


@pytest.mark.parametrize(
    ("name", "column", "axis"),
    [
        ("aileron_right", "aileron", (0, -1, 0)), ("aileron_left", "aileron", (0, 1, 0)),
        ("elevator_right", "elevator", (0, -1, 0)), ("elevator_left", "elevator", (0, -1, 0)),
        ("rudder", "rudder", (0, 0, -1)),
    ],
)  # fmt: skip
def test_control_surface_is_shown_within_half_a_degree_of_the_truth(shown, flight, name, column, axis):
    """At every tick, by what the viewer shows then, with the throw of the geometry; and the hinge stays in place."""
    entity = f"/world/truth/body/{name}"
    t_s, quaternion = shown.column(entity, "Transform3D:quaternion")
    _, translation_m = shown.column(entity, "Transform3D:translation")
    at_s = flight.log.truth["t_s"] - flight.release_s
    turned = Rotation.from_quat(latest(t_s, quaternion, at_s)[:, 0])
    drawn_deg = np.degrees(turned.magnitude() * np.sign(turned.as_rotvec() @ np.array(axis)))
    true_deg = geometry_of("endurance").get(f"{column}_throw_deg", 25.0) * flight.log.truth[column]
    assert np.ptp(true_deg) > 2.0
    np.testing.assert_allclose(drawn_deg, true_deg, rtol=0, atol=0.5 + 1e-4)
    hinge_m = aeroplane(geometry_of("endurance"))[name].hinge.point_m
    stays_m = turned.apply(hinge_m) + latest(t_s, translation_m, at_s)[:, 0]
    np.testing.assert_allclose(stays_m, np.broadcast_to(hinge_m, stays_m.shape), rtol=0, atol=FLOAT32)


def test_propeller_is_drawn_denser_with_more_throttle(shown, flight):
    """Its opacity follows the throttle to a sixteenth, and is never nothing."""
    t_s, colour = shown.column("/world/truth/body/propeller", "Mesh3D:albedo_factor")
    throttle = flight.log.truth["throttle"]
    opacity = latest(t_s, colour, flight.log.truth["t_s"] - flight.release_s)[:, 0] % 256  # 0xRRGGBBAA
    assert np.ptp(throttle) > 0.5
    np.testing.assert_allclose(opacity, 10.0 + 80.0 * throttle, rtol=0, atol=80.0 / 32.0 + 1.0)


def test_ranges_of_the_plots_hold_their_lines_and_two_marks_to_read(flight):
    """Every line but the error of the start is inside; two multiples of a power of ten are too, or degrees are lost."""
    lines = curves(flight.log, flight.heading_reference)
    found = limits(flight.log, lines)
    known = flight.log.flown["health"] > 0
    assert 0 < known.sum() < len(known)
    for path, (low, high) in found.items():
        values = lines[path][known] if path == "attitude/error" else lines[path]
        assert low < np.nanmin(values) <= np.nanmax(values) < high
        step = 10.0 ** np.floor(np.log10(high - low))
        assert np.sum((np.arange(-1000, 1001) * step >= low) & (np.arange(-1000, 1001) * step <= high)) >= 2
    lost = lines["attitude/error"].copy()
    lost[~known] = 170.0
    assert limits(flight.log, {"attitude/error": lost})["attitude/error"] == found["attitude/error"]


def test_story_names_the_flight_and_every_line_of_its_verdict(flight):
    told = story(replace(flight, manifest={**flight.manifest, "verdict": ROWS}))
    assert "hand_launch, endurance, premerlani" in told
    assert "seed 1" in told
    assert "| inclination error RMS | 3.21 deg | ≤ 4 deg | pass |" in told
    assert "| height at 20 s | not measured | ≥ 10 m | **FAIL** |" in told


def test_blueprint_is_embedded(shown):
    assert len(shown.file.blueprints()) == 1


def test_same_flight_written_twice_is_the_same_recording(shown, flight, tmp_path):
    """Every component of every entity, its times included; the second is made from the Parquet, not from memory."""
    first, again = (everything(r) for r in (shown, Reader(rerun_view.write(flight, tmp_path / "again.rrd"))))
    assert len(first) > 60
    assert set(again) == set(first)
    assert [name for name in first if again[name] != first[name]] == []


def everything(reader):
    """All data of a recording but the random row numbers, as text, in which NaN equals NaN."""
    found = {}
    for chunk in reader.store.stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name != "rerun.controls.RowId":
                found.setdefault((chunk.entity_path, name), []).append(repr(batch.column(name).to_pylist()))
    return {name: sorted(chunks) for name, chunks in found.items()}


def test_flight_without_a_single_row_is_still_told(tmp_path):
    """An estimator that fails before the first tick leaves an event and a story, and no aeroplane to draw."""
    event = Event(0.0, "no estimate", "error")
    flight = Flight(Log.empty(0), 0.02, 0.0, Outcome.ESTIMATOR_FAILED, "course", "no estimate", (event,))
    shown = Reader(rerun_view.write(flight, tmp_path / "flight.rrd"))
    assert shown.column("/events", "TextLog:text")[1] == [["no estimate"]]
    assert shown.column("/world/truth/body", "Transform3D:quaternion")[1] == []


def test_interrupted_write_leaves_nothing_behind(flight, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(rerun_view, "story", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rerun_view.write(flight, tmp_path / "flight.rrd")
    assert list(tmp_path.iterdir()) == []


def test_write_where_a_file_is_in_the_way_is_refused(flight, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot write to"):
        rerun_view.write(flight, tmp_path / "file" / "flight.rrd")


def test_live_blocks_show_what_the_finished_recording_shows(flight, tmp_path):
    """A viewer without a window records what is streamed to it second by second: nothing missing, nothing twice."""
    port = viewer.free_port()
    server = subprocess.Popen(
        [*RERUN, "--bind", "127.0.0.1", "--port", str(port), "--save", str(tmp_path / "live.rrd")],
        env={**os.environ, "RERUN_ANALYTICS": "0"}, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        viewer.await_port(server, port)
        url = f"rerun+http://127.0.0.1:{port}/proxy"
        live = rerun_view.LiveView(url, flight.manifest, flight.release_s, flight.heading_reference)
        for n_rows in range(50, len(flight.log), 50):
            live(flight.log, n_rows)
        live.close(flight)
        received = arrived(tmp_path, flight)
    finally:
        server.terminate()
        server.wait(10.0)
    t_s, values = received.column("/plots/attitude/bank", "Scalars:scalars")
    np.testing.assert_allclose(t_s, flight.log.truth["t_s"] - flight.release_s, rtol=0, atol=1e-9)
    expected = curves(flight.log, flight.heading_reference)["attitude/bank"]
    np.testing.assert_allclose(np.array(values), expected, rtol=0, atol=0)


def arrived(folder, flight):
    """Reader of what was streamed into ``live.rrd``, once its last message, the events, is there."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        # The file is still open: `optimize` takes what is whole and adds the index that a closed file has.
        command = [*RERUN, "rrd", "optimize", "live.rrd", "-o", "whole.rrd"]
        made = subprocess.run(command, cwd=folder, capture_output=True)
        if made.returncode == 0:
            reader = Reader(folder / "whole.rrd")
            if len(reader.column("/events", "TextLog:text")[1]) == len(flight.events):
                return reader
        time.sleep(0.2)
    raise TimeoutError("the streamed flight did not arrive whole within 30 s")


def test_open_viewer_without_a_display_says_what_to_do(folder, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RecordingError, match=r"no display to open .* --web"):
        viewer.open_viewer(folder / "flight.rrd")


def test_open_viewer_on_a_missing_file_names_it(tmp_path):
    with pytest.raises(RecordingError, match=r"nothing\.rrd"):
        viewer.open_viewer(tmp_path / "nothing.rrd")


def test_open_viewer_serves_a_browser_on_the_loopback_address_until_terminated(folder):
    """The page answers on 127.0.0.1, the recording is served beside it, and nothing stays when it is ended."""
    shown = viewer.open_viewer(folder / "flight.rrd", web=True)
    try:
        assert shown.address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(shown.address, timeout=10.0) as page:
            assert page.status == 200
            assert b"<canvas" in page.read()
    finally:
        shown.process.terminate()
        shown.process.wait(10.0)
    port = int(shown.url.split(":")[2].split("/")[0])
    with socket.socket() as s:
        assert s.connect_ex(("127.0.0.1", port)) != 0


def test_lanes_have_a_colour_for_every_state():
    """What is left out gets any colour: a mode as asked for in the red of a failure, or the other way round."""
    for lane, (_, _, meaning) in rerun_view._LANES.items():
        assert rerun_view._LANE_COLOURS[lane].keys() == {state.name.lower() for state in meaning}
