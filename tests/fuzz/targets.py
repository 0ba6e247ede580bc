"""What is damaged and read: for each reader a small file that is whole, how it is damaged, and how it is read."""

import copy
import gzip
import io
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.commands import export as exporting
from scenarios.harness.logs import column_map
from sim import gps_messages, recording
from sim.gps_messages import Fixes
from sim.log import Event, Flight, Log, Outcome, Phase
from sim.sensors.datasheet import load_part
from sim.sensors.fitting import load_suite, own_files
from sim.view import rerun_view

damage = sys.modules["_fuzz_mutations"]
dataflash = sys.modules["_fuzz_test_log_dataflash"]
px4 = sys.modules["_fuzz_test_log_ulog"]
LoggedFlight = sys.modules["_fuzz_conftest"].LoggedFlight
Generator = np.random.Generator
N, PLACE = 150, (47.4, 8.5, 488.0)


class Target(NamedTuple):
    """One reader.

    name : of the file, which is damaged        make : writes the file and what belongs to it into a folder
    damaged : of a generator, what the file holds instead       read : of the path of the file
    command : the arguments of a command that reads it, by its path; None where there is none that is quick
    also : what else reads it, given the path and a folder to write to; it may refuse
    """

    name: str
    make: Callable[[Path], None]
    damaged: Callable[[Generator], bytes]
    read: Callable[[Path], Any]
    command: Callable[[Path], list[str]] | None = None
    also: Callable[[Path, Path], Any] = lambda _path, _into: None


def flight() -> Any:
    """Three seconds of turning at 50 Hz, as an autopilot would log them."""
    t_us = 30_000_000 + 20_000 * np.arange(1, N + 1)
    t = t_us / 1e6 - 30.0
    R = Rotation.from_euler("ZYX", np.stack((0.3 * t, 0.1 * np.sin(2.0 * t), 0.4 * np.sin(3.0 * t)), axis=-1))
    rate = np.vstack(((R[:-1].inv() * R[1:]).as_rotvec() / 0.02, np.zeros(3)))
    force = R.inv().apply([0.0, 0.0, -9.80665])
    fix_us = np.arange(30_133_000, t_us[-1], 200_000)
    s = fix_us / 1e6 - 30.0
    v_e = np.column_stack((14.0 * np.cos(0.3 * s), 14.0 * np.sin(0.3 * s), 0.5 * np.cos(s)))
    geodetic = np.column_stack((47.4 + 1e-4 * s, 8.5 + 1e-4 * s, 488.0 - s))
    slow_us = np.arange(30_081_000, t_us[-1], 100_000)
    field = np.tile([21.5, 1.2, 43.0], (len(slow_us), 1)) + 0.1 * np.arange(len(slow_us))[:, None]
    p_e = np.cumsum(0.2 * v_e, axis=0)
    speed = 13.0 + 0.1 * np.sin(np.arange(len(slow_us)))
    return LoggedFlight(
        t_us, rate, force, R.as_matrix(), fix_us, p_e, v_e, geodetic, slow_us, field, slow_us, speed, 10.0 + 0.0 * speed
    )


FLIGHT = flight()
_AT = np.searchsorted(FLIGHT.fix_us, FLIGHT.t_us) - 1
_YAW, _PITCH, _ROLL = Rotation.from_matrix(FLIGHT.R_eb).as_euler("ZYX").T
ATTITUDE = {"roll": _ROLL, "pitch": _PITCH, "yaw": _YAW}
INERTIAL = {
    "t": FLIGHT.t_us / 1e6,
    **{f"g{a}": FLIGHT.rate[:, i] for i, a in enumerate("xyz")},
    **{f"a{a}": FLIGHT.force[:, i] for i, a in enumerate("xyz")},
}
COLUMNS = {
    **INERTIAL,
    **{f"v{a}": FLIGHT.v_e[np.maximum(_AT, 0), i] for i, a in enumerate("ned")},
    "latitude_deg": FLIGHT.geodetic[np.maximum(_AT, 0), 0],
    "longitude_deg": FLIGHT.geodetic[np.maximum(_AT, 0), 1],
    "mag_x_ut": 21.0 + INERTIAL["t"],
    "mag_y_ut": 1.2 + 0.0 * INERTIAL["t"],
    "mag_z_ut": 43.0 - INERTIAL["t"],
    "airspeed": 13.0 + 0.1 * INERTIAL["t"],
    **ATTITUDE,
}


def text(columns: dict[str, Any], delimiter: str = ",") -> str:
    """A table as text."""
    rows = np.column_stack(list(columns.values()))
    lines = [delimiter.join(columns), *(delimiter.join(f"{v:.9g}" for v in row) for row in rows)]
    return "\n".join(lines)


def _write(name: str, content: bytes) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        (folder / name).write_bytes(content)

    return make


def _replay(path: Path) -> list[str]:
    return ["replay", str(path)]


def _of_text(name: str, columns: dict[str, Any], delimiter: str, how: Callable[[bytes], bytes] = bytes) -> Target:
    made = text(columns, delimiter)

    def damaged(rng: Generator) -> bytes:
        if how is not bytes and rng.random() < 0.5:
            return bytes(damage.of_bytes(rng, how(made.encode())))
        return how(damage.of_table(rng, made, delimiter))

    return Target(name, _write(name, how(made.encode())), damaged, logs.read, _replay)


def _records(name: str, pieces: list[bytes]) -> Target:
    def damaged(rng: Generator) -> bytes:
        raw = bytes(damage.of_pieces(rng, pieces))
        return bytes(damage.of_bytes(rng, raw)) if rng.random() < 0.4 else raw

    return Target(name, _write(name, b"".join(pieces)), damaged, logs.read, _replay)


def _matlab() -> Target:
    content = {
        "t": COLUMNS["t"],
        "gyro": FLIGHT.rate,
        "acc": FLIGHT.force,
        "gps": {"vn": COLUMNS["vn"], "ve": COLUMNS["ve"]},
        "label": np.array(["one", "two"], object),
        "roll": _ROLL,
        "pitch": _PITCH,
        "yaw": _YAW,
    }

    def saved(data: dict[str, Any], packed: bool) -> bytes:
        file = io.BytesIO()
        savemat(file, data, do_compression=packed)
        return file.getvalue()

    whole = {packed: saved(content, packed) for packed in (False, True)}

    def damaged(rng: Generator) -> bytes:
        if rng.random() < 0.6:
            return bytes(damage.of_bytes(rng, whole[rng.random() < 0.3]))
        data = copy.deepcopy(content)
        name = damage.pick(rng, list(data))
        if name == "gps":
            data["gps"][damage.pick(rng, ("vn", "ve"))] = damage.of_array(rng, COLUMNS["vn"])
        else:
            data[name] = damage.of_array(rng, data[name])
        return saved(data, bool(rng.random() < 0.3))

    return Target("log.mat", _write("log.mat", whole[False]), damaged, logs.read, _replay)


def _vectors() -> Target:
    rows = np.zeros((N, len(logs.vectors.INPUT)))
    named = dict(zip(logs.vectors.INPUT, rows.T, strict=True))
    named["t"][:], named["dt"][:] = 0.02 * np.arange(1, N + 1), 0.02
    for i, a in enumerate("xyz"):
        named[f"g{a}"][:], named[f"a{a}"][:] = FLIGHT.rate[:, i], FLIGHT.force[:, i]
    named["gps_new"][::10], named["gps_fix"][:], named["gps_vn"][:] = 1.0, 3.0, 14.0
    named["mag_new"][::5], named["mx"][:], named["mz"][:], named["airspeed"][:] = 1.0, 215.0, 430.0, 13.0
    made = text(named)
    truth = text(dict(zip(logs.vectors.ATTITUDE, [named["t"], *FLIGHT.R_eb.reshape(-1, 9).T], strict=True)))

    def make(folder: Path) -> None:
        (folder / "A50_x_in.csv").write_text(made)
        (folder / "A50_x_truth.csv").write_text(truth)

    return Target("A50_x_in.csv", make, lambda rng: damage.of_table(rng, made), logs.read, _replay)


def _against_table() -> Target:
    """A log without an attitude, scored against a damaged file of attitudes."""
    made = text({"t": COLUMNS["t"], **ATTITUDE})

    def make(folder: Path) -> None:
        (folder / "log.csv").write_text(text({k: v for k, v in COLUMNS.items() if k not in ATTITUDE}))
        (folder / "attitudes.csv").write_text(made)

    def read(path: Path) -> Any:
        return logs.read(path.with_name("log.csv"), reference=path)

    def command(path: Path) -> list[str]:
        return ["replay", str(path.with_name("log.csv")), "--reference", str(path)]

    return Target("attitudes.csv", make, lambda rng: damage.of_table(rng, made), read, command)


MAP = """delimiter = ","
decimal = "."
skip_lines = 0
axes = "forward-right-down"
force_reversed = false
reference = "truth"
origin_deg = [47.4, 8.5]
withheld = ["gps_rate_hz"]
[columns]
t = "time s"
gx = "gyro.x rad/s"
gy = "gyro.y"
gz = { is = "gyro.z", unit = "rad/s", factor = 1.0, offset = 0 }
ax = "force.x m/s^2"
ay = "force.y"
az = "force.z m/s^2"
vn = "gps.vn"
ve = "gps.ve"
roll = "roll"
pitch = "pitch"
yaw = "yaw"
[instruments]
gps_latency_s = 0.2
declination_rad = 0.1
calibration.offset_b_ut = [1.0, 2.0, 3.0]
[on_ground]
seconds = 2.0
gyro_b_rad_s = [0.0, 0.0, 0.0]
force_b_m_s2 = [0.0, 0.0, -9.8]"""


def _map() -> Target:
    def make(folder: Path) -> None:
        (folder / "log.csv").write_text(text(COLUMNS))
        (folder / "my.toml").write_text(MAP)
        column_map.parameters()  # makes every estimator, which may compile for a while

    def read(path: Path) -> Any:
        column_map.load(path)
        return logs.read(path.with_name("log.csv"), columns=str(path))

    def command(path: Path) -> list[str]:
        return ["replay", str(path.with_name("log.csv")), "--columns", str(path)]

    return Target("my.toml", make, lambda rng: damage.of_toml(rng, MAP), read, command)


PART = """name = "X-1"
maker = "X"
summary = "three-axis gyro"
datasheet = ["a, 1", "b, 2"]
[gyro]
range_deg_s = { value = 2000.0, source = "Range" }
bits = { value = 16, source = "typical" }
bias_deg_s = { value = 1.0, source = "typical" }
[accelerometer]
range_g = { value = 16.0, source = "typical" }
bits = { value = 16, source = "typical" }"""
SUITE = """summary = "a suite"
gyro = "part.toml"
accelerometer = "part.toml"
gps = "generic"
[board]
[changes]
"gps.latency_s" = 0.2
"gyro.bias_deg_s" = 0.5"""


def _of_sensors(name: str) -> Target:
    def make(folder: Path) -> None:
        (folder / "part.toml").write_text(PART)
        (folder / "suite.toml").write_text(SUITE)

    def read(path: Path) -> Any:
        if name == "part.toml":
            load_part(str(path))
        suite = str(path.with_name("suite.toml"))
        own_files(suite)
        return load_suite(suite)

    def command(path: Path) -> list[str]:
        return ["fly", "no_such_scenario", "--sensors", str(path.with_name("suite.toml"))]

    return Target(name, make, lambda rng: damage.of_toml(rng, PART if name == "part.toml" else SUITE), read, command)


def recorded() -> Flight:
    """The flight as a recording of ours."""
    log = Log.empty(60)
    rows = log.measured
    rows["t_s"] = log.truth["t_s"] = 0.02 * np.arange(1, 61)
    rows["dt_s"], rows["gyro_b_rad_s"], rows["force_b_m_s2"] = 0.02, FLIGHT.rate[:60], FLIGHT.force[:60]
    rows["gps_new"][::10], rows["gps_valid"], rows["gps_v_e_m_s"][:, 0] = 1, 1, 14.0
    rows["gps_speed_m_s"], rows["gps_t_s"], rows["mag_new"][::5] = 14.0, rows["t_s"], 1
    rows["mag_b_ut"], rows["air_new"][::5], rows["equivalent_airspeed_m_s"] = (21.0, 1.0, 43.0), 1, 13.0
    log.truth["R_eb"], log.truth["phase"], log.truth["v_e_m_s"][:, 0] = FLIGHT.R_eb[:60], Phase.FLYING, 14.0
    manifest = {
        "scenario": "hand_launch",
        "seed": 3,
        "config": {
            "suite": "generic",
            "sensors": {"gyro.bias_deg_s": 1.0},
            "files": {},
            "aircraft": "endurance",
            "duration_s": 1.2,
            "estimator_params": {"calibration.offset_b_ut": [1.0, 2.0, 3.0]},
            "air": {
                "wind_m_s": 2.0,
                "wind_from_deg": 160.0,
                "shear": 0.1,
                "gusts": [],
                "turbulence_w20_m_s": 3.0,
                "thermals": [],
            },
        },
        "known": {
            "gps_latency_s": {"value": 0.2, "source": "set"},
            "gps_stamped": {"value": True, "source": "data sheet"},
        },
        "verdict": [{"name": "survived", "unit": "", "measured": 1.0, "sense": ">=", "limit": 1.0, "passed": True}],
        "on_ground": {"t_s": 1.0, "dt_s": 2.0, "gyro_b_rad_s": [0.0, 0.0, 0.0], "force_b_m_s2": [0.0, 0.0, -9.8]},
        "launch_latitude_deg": 47.0,
        "launch_longitude_deg": 8.0,
    }
    return Flight(log, 0.02, 0.1, Outcome.COMPLETED, "course", "", (Event(0.1, "released"),), manifest)


class _Saved(NamedTuple):
    """A recording in memory."""

    raw: bytes
    table: Any
    record: dict[str, Any]
    manifest: dict[str, Any]


def _saved(folder: Path) -> _Saved:
    path = recording.save(recorded(), folder)
    table = pq.read_table(path / recording.PARQUET)
    record = json.loads(table.schema.metadata[b"wingslevel"])
    raw = (path / recording.PARQUET).read_bytes()
    return _Saved(raw, table, record, json.loads((path / recording.MANIFEST).read_text()))


def _altered(rng: Generator, saved: _Saved) -> bytes:
    """The recording with altered columns, or with an altered record."""
    table, record = saved.table, saved.record
    if rng.random() < 0.5:
        record = damage.of_tree(rng, record)
    for _ in range(int(rng.integers(0, 3))):
        table = _column(rng, table)
    made = json.dumps(record) if rng.random() < 0.97 else "[" * 100_000
    file = io.BytesIO()
    pq.write_table(table.replace_schema_metadata({b"wingslevel": made.encode("utf-8", "replace")}), file)
    return file.getvalue()


def _column(rng: Generator, table: Any) -> Any:
    """The table with one column, or all of them, altered."""
    i, kind = int(rng.integers(table.num_columns)), int(rng.integers(12))
    if rng.random() < 0.2:
        i = table.column_names.index(
            damage.pick(rng, ("measured.t_s", "truth.t_s", "measured.dt_s", "measured.gps_new"))
        )
    name, values = table.column_names[i], table.column(i).combine_chunks()
    if kind == 0:
        return table.slice(0, int(rng.integers(0, 3)))
    if kind == 1:
        return table.remove_column(i)
    if kind == 2:
        return table.append_column(damage.pick(rng, (name, "x")), values)
    if kind == 3:
        return table.take(rng.permutation(table.num_rows))
    if kind == 4:
        made = damage.pick(
            rng,
            (
                values.cast("string"),
                values.dictionary_encode(),
                pa.array([[v] for v in values.to_pylist()]),
                pa.nulls(len(values)),
            ),
        )
    elif kind == 5:
        made = pa.array([None if rng.random() < 0.1 else v for v in values.to_pylist()], values.type)
    else:
        numbers = values.to_numpy(zero_copy_only=False).astype(np.float64)
        value, n = damage.pick(rng, damage.NUMBERS), len(numbers)
        if n:
            numbers[slice(None) if kind == 6 else int(rng.integers(n))] = value
        with np.errstate(all="ignore"):
            made = pa.array(numbers.astype(values.to_numpy(zero_copy_only=False).dtype))
    return table.set_column(i, name, made)


def _recording(name: str, scratch: Path) -> Target:
    saved = _saved(scratch / "saved")

    def make(folder: Path) -> None:
        (folder / (recording.PARQUET if name == recording.MANIFEST else name)).write_bytes(saved.raw)
        if name == recording.MANIFEST:
            (folder / name).write_text(json.dumps(saved.manifest))

    def damaged(rng: Generator) -> bytes:
        if name == recording.MANIFEST:
            return bytes(damage.as_json(rng, saved.manifest))
        return bytes(damage.of_bytes(rng, saved.raw)) if name == recording.PARQUET else _altered(rng, saved)

    def read(path: Path) -> Any:
        return logs.read(path.parent if name == recording.MANIFEST else path)

    def also(path: Path, into: Path) -> None:
        into.mkdir(exist_ok=True)
        try:
            rerun_view.write(recording.load(path), into / "x.rrd")
            exporting.make(path, into / "x.nmea", into / "x.ubx", csv=into / "x.csv")
        except ValueError as error:
            if str(path) not in str(error) and "nothing to export" not in str(error):
                raise

    def command(path: Path) -> list[str]:
        return _replay(path.parent if name == recording.MANIFEST else path)

    return Target(name, make, damaged, read, command, also)


def _gps(name: str, encode: Callable[..., bytes], decode: Callable[[bytes], Any]) -> Target:
    whole = encode(Fixes.from_log(recorded().log.measured))
    return Target(
        name, _write(name, whole), lambda rng: damage.of_bytes(rng, whole), lambda path: decode(path.read_bytes())
    )


def packed(raw: bytes) -> bytes:
    """By gzip, always alike."""
    return gzip.compress(raw, mtime=0)


def make(name: str, scratch: Path) -> Target:
    """The target of that name."""
    made: dict[str, Callable[[], Target]] = {
        "csv": lambda: _of_text("log.csv", COLUMNS, ","),
        "text": lambda: _of_text("log.txt", COLUMNS, " "),
        "tabs": lambda: _of_text("log.tsv", COLUMNS, "\t"),
        "gzip": lambda: _of_text("log.csv.gz", COLUMNS, ",", packed),
        "matlab": _matlab,
        "dataflash": lambda: _records("log.bin", dataflash.Writer(dataflash.TODAY).log(dataflash.messages(FLIGHT))),
        "ulog": lambda: _records("log.ulg", px4.ulog(px4.messages(FLIGHT))),
        "vectors": _vectors,
        "attitudes": _against_table,
        "map": _map,
        "part": lambda: _of_sensors("part.toml"),
        "suite": lambda: _of_sensors("suite.toml"),
        "parquet": lambda: _recording(recording.PARQUET, scratch),
        "recording": lambda: _recording("altered.parquet", scratch),
        "manifest": lambda: _recording(recording.MANIFEST, scratch),
        "nmea": lambda: _gps("log.nmea", gps_messages.encode_nmea, gps_messages.decode_nmea),
        "ubx": lambda: _gps("log.ubx", gps_messages.encode_ubx, gps_messages.decode_ubx),
    }
    return made[name]()
