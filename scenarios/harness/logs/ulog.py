"""PX4's logs (.ulg), read with pyulog: sensor_combined or vehicle_imu, GPS, magnetometer, air data, attitude.

Damaged bytes are taken out before, since pyulog gives up the rest of a log where they look like a long message.

PX4's axes are ours: forward, right, down against north, east, down; its quaternions are w, x, y, z from body to earth.
Where the simulator's attitude was logged (vehicle_attitude_groundtruth) it is the truth, else vehicle_attitude is
what was flown on.
"""

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs import streams, tabular
from scenarios.harness.logs.recorded import LogError, RecordedLog
from scenarios.harness.logs.streams import Kind, Stream

ATTITUDES: tuple[tuple[str, Kind], ...] = (
    ("vehicle_attitude_groundtruth", "truth"), ("vehicle_attitude", "filter"),
)  # fmt: skip
TOPICS = [
    "sensor_combined", "vehicle_imu", "vehicle_gps_position", "sensor_gps", "vehicle_magnetometer", "sensor_mag",
    "airspeed", "airspeed_validated", "vehicle_air_data", *(name for name, _ in ATTITUDES),
]  # fmt: skip
FIX_3D = 3
GAUSS_UT = 100.0
HEADER_LENGTH, FLAGS_LENGTH = 16, 43
SHORTEST, LONGEST = 2, 8192  # bodies: of a dropout; no definition of a topic comes near the other
KINDS = frozenset(b"BFIMPQARDLCSO")  # of messages, by their letter
DATA, ANNOUNCED, FORMAT, FLAGS = b"DAFB"
SLOWEST_S = 0.1  # vehicle_imu is by default logged twice a second, for statistics: not to be integrated
NO_FORCE = 0x7FFFFFFF  # sensor_combined.accelerometer_timestamp_relative where there is no accelerometer


def read(path: Path, imu: int | None = None) -> RecordedLog:
    """The log at `path`.

    imu : which instance of vehicle_imu; unless told sensor_combined, which was flown on

    Raises
    ------
    LogError      one line: no such log, no inertial unit in it, or one that cannot be believed
    """
    repairs: list[str] = []
    log = _Log(path, repairs)
    inertial, dt_s, names = _inertial(log, imu)
    messages = streams.Messages(
        inertial, dt_s, names, _fixes(log), _field(log), _airspeed(log), _height(log), *_attitude(log)
    )
    return streams.recorded(path, messages, repairs)


def _whole(raw: bytes, repairs: list[str]) -> bytes:
    """The log without bytes that are no whole message, which are counted.

    A message is believed where another one, or the end, follows it, or it is a definition in whole words: without it
    a topic would be lost.  Data must be of a topic that was announced, and as long as the others of it.  The places of
    data appended after a crash are taken out, since they change.
    """
    end, at, since = len(raw), HEADER_LENGTH, 0
    parts, lengths = list[bytes](), dict[int, int]()  # of each topic that was announced, 0 before its first data
    bad, first = 0, -1
    while at < end:
        after = _after(raw, at)
        known = 0 < after <= end
        known = known and (after + 3 > end or _after(raw, after) > 0 or _is_definition(raw[at + 2 : after]))
        kind = raw[at + 2] if known else 0
        if kind == DATA:
            topic = raw[at + 3] | raw[at + 4] << 8
            usual = lengths.get(topic, -1)
            known = usual in (0, after - at)
            if usual == 0:
                lengths[topic] = after - at
        if not known:
            parts.append(raw[since:at])
            bad, first = bad + 1, at if first < 0 else first
            at = since = at + 1
            continue
        if kind == ANNOUNCED:
            lengths[int.from_bytes(raw[at + 4 : at + 6], "little")] = 0
        elif kind == FLAGS and after - at >= FLAGS_LENGTH:
            parts += (raw[since : at + 19], bytes(24))
            since = at + FLAGS_LENGTH
        at = after
    parts.append(raw[since:])
    if bad:
        repairs.append(f"{bad} bytes that are no whole message left out, first at byte {first}")
    return b"".join(parts)


def _is_definition(message: bytes) -> bool:
    """Whether the message, from its letter on, defines or announces a topic in printable letters to its end."""
    text = message[1:] if message[0] == FORMAT else message[4:] if message[0] == ANNOUNCED else b""
    return bool(text) and text.isascii() and text.decode().isprintable()


def _after(raw: bytes, at: int) -> int:
    """Where the message that begins at `at` would end; 0 where none does."""
    if at + 3 > len(raw) or raw[at + 2] not in KINDS:
        return 0
    length = raw[at] | raw[at + 1] << 8
    return at + 3 + length if SHORTEST <= length <= LONGEST else 0


class _Log:
    """The topics of a log by name and instance."""

    def __init__(self, path: Path, repairs: list[str]) -> None:
        try:
            from pyulog import ULog  # type: ignore[import-untyped]
        except ImportError as error:
            raise LogError(f'{path}: logs of PX4 need pyulog: pip install "wingslevel[logs]"') from error
        self.path = path
        try:
            whole = _whole(path.read_bytes(), repairs)
            with contextlib.redirect_stdout(io.StringIO()):  # it prints what it found damaged
                log = ULog(io.BytesIO(whole), TOPICS)
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error
        except Exception as error:  # pyulog raises whatever its parser meets in a file that is none or damaged
            raise LogError(f"{path}: cannot be read as a ULog file: {' '.join(str(error).split())}") from error
        self.topics: dict[tuple[str, int], Mapping[str, NDArray[Any]]] = {}
        for topic in log.data_list:
            self.topics.setdefault((topic.name, topic.multi_id), topic.data)
        if log.file_corruption:
            repairs.append("messages that contradict their topic left out")
        if log.dropouts:
            lost_s = sum(dropout.duration for dropout in log.dropouts) / 1000.0
            repairs.append(f"{len(log.dropouts)} times the logger could not follow, for {lost_s:.2f} s in all")

    def first(self, *names: str) -> tuple[str, Mapping[str, NDArray[Any]]] | None:
        """The lowest instance of the first of these topics that is there."""
        for name in names:
            instances = sorted(i for n, i in self.topics if n == name)
            if instances:
                return name, self.topics[name, instances[0]]
        return None

    def columns(self, name: str, topic: Mapping[str, NDArray[Any]], *fields: str) -> Array:
        """Fields of a topic, shape (n, m).

        Raises
        ------
        LogError      a field that is not there
        """
        missing = [field for field in fields if field not in topic]
        if missing:
            raise LogError(f"{self.path}: {name} has no field {', '.join(missing)}; it has {', '.join(topic)}")
        with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
            return np.column_stack([topic[field].astype(np.float64) for field in fields])


def _each(name: str, n: int = 3) -> tuple[str, ...]:
    return tuple(f"{name}[{i}]" for i in range(n))


def _published_s(topic: Mapping[str, NDArray[Any]]) -> Array:
    return np.asarray(topic["timestamp"].astype(np.float64) / 1e6)


def _sampled_s(topic: Mapping[str, NDArray[Any]]) -> Array:
    """When the sample was taken, where it tells, else when it was published."""
    told = topic.get("timestamp_sample")
    return _published_s(topic) if told is None else np.where(told > 0, told / 1e6, _published_s(topic))


def _inertial(log: _Log, imu: int | None) -> tuple[Stream, Array, dict[str, str]]:
    """Gyro and accelerometer, intervals, and the names of the columns."""
    combined = log.topics.get(("sensor_combined", 0))
    if imu is None and combined is not None:
        name, gyro, force, interval = "sensor_combined", "gyro_rad", "accelerometer_m_s2", "gyro_integral_dt"
        t_s, values = _published_s(combined), log.columns(name, combined, *_each(gyro), *_each(force))
        dt_s = log.columns(name, combined, interval)[:, 0]
        if combined[interval].dtype.kind != "f":  # in seconds, as a fraction, until 2017
            dt_s = dt_s / 1e6
        lacking = combined.get("accelerometer_timestamp_relative", np.zeros(len(t_s))) == NO_FORCE
        values[lacking, 3:] = np.nan
    else:
        name, gyro, force = "vehicle_imu", "delta_angle", "delta_velocity"
        topic = log.topics.get((name, imu or 0))
        if topic is None:
            which = f"{name} {imu}" if imu is not None else f"sensor_combined or {name}"
            has = ", ".join(f"{n} {i}" for n, i in sorted(log.topics)) or "none that we know"
            raise LogError(f"{log.path}: no topic {which}; it has {has}")
        t_s = _sampled_s(topic)
        spans_s = log.columns(name, topic, f"{gyro}_dt", f"{force}_dt") / 1e6
        dt_s = spans_s[:, 0]
        spans_s = np.repeat(np.where(spans_s > 0.0, spans_s, np.nan), 3, axis=1)
        values = log.columns(name, topic, *_each(gyro), *_each(force)) / spans_s
        if len(t_s) > 2 and (step := float(np.median(np.diff(t_s)))) > SLOWEST_S:
            raise LogError(f"{log.path}: {name} was logged every {step:g} s; {SLOWEST_S} s or less can be replayed")
    names = {"time": f"{name}.timestamp", "gyro": gyro, "force": force}
    for i, axis in enumerate("xyz"):
        names |= {f"gyro.{axis}": f"{gyro}[{i}]", f"force.{axis}": f"{force}[{i}]"}
    return Stream(name, t_s, values), dt_s, names


def _fixes(log: _Log) -> Stream | None:
    """Fixes of three dimensions with a velocity; degrees and metres, or as whole numbers 1e-7 degrees and mm."""
    found = log.first("vehicle_gps_position", "sensor_gps")
    if found is None:
        return None
    name, topic = found
    if "latitude_deg" in topic:
        place = log.columns(name, topic, "latitude_deg", "longitude_deg", "altitude_msl_m")
    else:
        place = log.columns(name, topic, "lat", "lon", "alt") / (1e7, 1e7, 1e3)
    velocity = log.columns(name, topic, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
    good = topic["fix_type"] >= FIX_3D
    if "vel_ned_valid" in topic:
        good &= topic["vel_ned_valid"] != 0
    values = np.column_stack((place, velocity, _sampled_s(topic)))
    return Stream(name, _published_s(topic)[good], values[good])


def _field(log: _Log) -> Stream | None:
    found = log.first("vehicle_magnetometer", "sensor_mag")
    if found is None:
        return None
    name, topic = found
    fields = _each("magnetometer_ga") if name == "vehicle_magnetometer" else ("x", "y", "z")
    return Stream(name, _published_s(topic), GAUSS_UT * log.columns(name, topic, *fields))


def _airspeed(log: _Log) -> Stream | None:
    """True airspeed, or indicated where there is none."""
    found = log.first("airspeed", "airspeed_validated")
    if found is None:
        return None
    name, topic = found
    true = log.columns(name, topic, "true_airspeed_m_s")
    if "indicated_airspeed_m_s" in topic:
        true = np.where(np.isfinite(true), true, log.columns(name, topic, "indicated_airspeed_m_s"))
    return Stream(name, _published_s(topic), true)


def _height(log: _Log) -> Stream | None:
    """Barometric height above where the log begins."""
    found = log.first("vehicle_air_data")
    if found is None:
        return None
    name, topic = found
    height = log.columns(name, topic, "baro_alt_meter")
    first = height[np.isfinite(height)][:1]
    return Stream(name, _published_s(topic), height - first if len(first) else height)


def _attitude(log: _Log) -> tuple[Stream | None, Kind]:
    for name, kind in ATTITUDES:
        found = log.first(name)
        if found is None:
            continue
        quaternion = log.columns(name, found[1], *_each("q", 4))
        R_eb = tabular.attitude(dict(zip(("qw", "qx", "qy", "qz"), quaternion.T, strict=True)))
        if R_eb is not None and np.isfinite(R_eb).any():
            return Stream(name, _sampled_s(found[1]), R_eb.reshape(-1, 9)), kind
    return None, "filter"
