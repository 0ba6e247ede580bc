"""PX4's logs (.ulg), read with pyulog: sensor_combined or vehicle_imu, GPS, magnetometer, air data, attitude.

PX4's axes are ours: body forward, right, down and earth north, east, down; its quaternions are w, x, y, z from body to
earth.  The reference is the simulator's attitude (vehicle_attitude_groundtruth) if it was logged, otherwise
vehicle_attitude, which the aeroplane was flown on.  Until 2017 the magnetometer and the barometer were in
sensor_combined.

A fix was valid at its ``timestamp_sample``, unless that is 0 or less than 10 ms before its arrival: drivers that do not
know the time of validity fill in the time of arrival.
"""

import contextlib
import io
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import Array
from scenarios.harness.logs import airspeeds, attitudes, foreign, px4, streams
from scenarios.harness.logs.ardupilot import FLYING_M_S
from scenarios.harness.logs.recorded import Kind, LogError, RecordedLog
from scenarios.harness.logs.streams import NO_FIX, UNHEALTHY, Stream
from scenarios.harness.logs.ulog_bytes import whole
from sim.outside import files

ATTITUDES: tuple[tuple[str, Kind], ...] = (
    ("vehicle_attitude_groundtruth", "truth"), ("vehicle_attitude", "filter"),
)  # fmt: skip
TOPICS = [
    "sensor_combined", "vehicle_imu", "vehicle_gps_position", "sensor_gps", "vehicle_magnetometer", "sensor_mag",
    "airspeed", "airspeed_validated", "vehicle_air_data", *(name for name, _ in ATTITUDES),
]  # fmt: skip
FIX_3D = 3
GAUSS_UT = 100.0
NOT_THERE = 0x7FFFFFFF  # in sensor_combined.*_timestamp_relative: no sample
SOONEST_S, LATEST_S = 0.01, 2.0  # a fix arrives at least and at most so long after its validity
NO_VELOCITY, NOT_MEASURED = "no velocity (vel_ned_valid is 0)", "not measured: from ground speed and wind"
Topic = Mapping[str, NDArray[Any]]


def read(path: Path, imu: int | None = None) -> RecordedLog:
    """The log at `path`.

    imu : which instance of vehicle_imu; by default sensor_combined, which was flown on

    Raises
    ------
    LogError      one line: no such log, no inertial unit in it, or one that cannot be believed
    """
    repairs: list[str] = []
    log = _Log(path, repairs)
    inertial, dt_s, names = _inertial(log, imu)
    fixes, receiver = _fixes(log)
    field, compass = _switched(log, "magnetometer", _field(log))
    airspeed, pitot = _switched(log, "airspeed", _airspeed(log))
    height = _height(log)
    attitude = streams.first_known(_attitudes(log))
    notes = (f"only one of several instances is read: {'; '.join(log.others)}",) if log.others else ()
    messages = streams.Messages(
        inertial, dt_s, names, fixes, field, airspeed, height, *attitude,
        {**receiver, **compass, **pitot}, px4.LOG_FASTER,
    )  # fmt: skip
    return replace(streams.recorded(path, messages, repairs), notes=notes)


class _Log:
    """The topics of a log by name and instance, and its parameters; `others` lists which of several was read."""

    def __init__(self, path: Path, repairs: list[str]) -> None:
        try:
            from pyulog import ULog  # type: ignore[import-untyped]
        except ImportError as error:
            raise LogError(f'{path}: logs of PX4 need pyulog: pip install "wingslevel[logs]"') from error
        self.path, self.repairs = path, repairs
        try:
            raw = files.read(path, "ULog file")
            foreign.refuse(path, raw, "a ULog file of PX4 (.ulg)")
            clean = whole(path, raw, repairs)
            with contextlib.redirect_stdout(io.StringIO()):  # it prints what it found damaged
                self._log = ULog(io.BytesIO(clean), TOPICS)
        except LogError:
            raise
        except Exception as error:  # pyulog raises many kinds of errors for damaged files
            raise LogError(f"{path}: cannot be read as a ULog file: {' '.join(str(error).split())}") from error
        self.topics: dict[tuple[str, int], Topic] = {}
        for topic in self._log.data_list:
            if "timestamp" not in topic.data:  # pyulog stops after its first message
                raise LogError(f"{path}: the definition of topic {topic.name} has no timestamp: it is damaged")
            self.topics.setdefault((topic.name, topic.multi_id), topic.data)
        self.others = list[str]()
        changes = self._log.changed_parameters
        self.parameters = px4.parameters(self._log.initial_parameters, changes, self._first_flight_us())
        if self._log.file_corruption:
            repairs.append("messages that contradict their topic left out")
        if self._log.dropouts:
            lost_s = sum(dropout.duration for dropout in self._log.dropouts) / 1000.0
            repairs.append(f"{len(self._log.dropouts)} times the logger could not follow, for {lost_s:.2f} s in all")

    def _first_flight_us(self) -> float:
        """When the aeroplane first flew, by GPS; infinite if it did not."""
        for name in ("vehicle_gps_position", "sensor_gps"):
            topic = self.topics.get((name, 0), {})
            if {"vel_n_m_s", "vel_e_m_s", "fix_type"} <= set(topic):
                with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
                    fast = np.hypot(topic["vel_n_m_s"], topic["vel_e_m_s"]) > FLYING_M_S
                flying = fast & (topic["fix_type"] >= FIX_3D)
                return float(topic["timestamp"][np.argmax(flying)]) if flying.any() else np.inf
        return np.inf

    def first(self, *names: str) -> tuple[str, Topic] | None:
        """The lowest instance of the first of these topics in the log."""
        for name in names:
            if instances := self.instances(name):
                return name, self.topics[name, self.one(name, instances[0])]
        return None

    def instances(self, name: str) -> list[int]:
        """The instances of a topic in the log."""
        return sorted(i for n, i in self.topics if n == name)

    def one(self, name: str, chosen: int) -> int:
        """`chosen`, with a note that the other instances of the topic are not read."""
        if len(there := self.instances(name)) > 1:
            self.others.append(f"{name} {chosen} (of {', '.join(map(str, there))})")
        return chosen

    def columns(self, name: str, topic: Topic, *fields: str) -> Array:
        """Fields of a topic, shape (n, m).

        Raises
        ------
        LogError      a field is missing
        """
        missing = [field for field in fields if field not in topic]
        if missing:
            raise LogError(f"{self.path}: {name} has no field {', '.join(missing)}; it has {', '.join(topic)}")
        with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
            return np.column_stack([topic[field].astype(np.float64) for field in fields])


def _each(name: str, n: int = 3) -> tuple[str, ...]:
    return tuple(f"{name}[{i}]" for i in range(n))


def _published_s(topic: Topic) -> Array:
    return np.asarray(topic["timestamp"].astype(np.float64) / 1e6)


def _sampled_s(topic: Topic) -> Array:
    """When the sample was taken, or, if the topic does not say, when it was published."""
    sampled = topic.get("timestamp_sample")
    return _published_s(topic) if sampled is None else np.where(sampled > 0, sampled / 1e6, _published_s(topic))


def _inertial(log: _Log, imu: int | None) -> tuple[Stream, Array, dict[str, str]]:
    """Gyro and accelerometer, intervals, and the names of the columns."""
    combined, units = log.topics.get(("sensor_combined", 0)), log.instances("vehicle_imu")
    if imu is None and combined is not None:
        name, gyro, force, interval = "sensor_combined", "gyro_rad", "accelerometer_m_s2", "gyro_integral_dt"
        t_s, values = _published_s(combined), log.columns(name, combined, *_each(gyro), *_each(force))
        dt_s = log.columns(name, combined, interval)[:, 0]
        if combined[interval].dtype.kind != "f":  # in seconds, as a fraction, until 2017
            dt_s = dt_s / 1e6
        values[combined.get("accelerometer_timestamp_relative", np.zeros(len(t_s))) == NOT_THERE, 3:] = np.nan
    else:
        name, gyro, force = "vehicle_imu", "delta_angle", "delta_velocity"
        if not units and imu is None:
            has = ", ".join(f"{n} {i}" for n, i in sorted(log.topics)) or "none that we know"
            why = "no inertial unit (topic sensor_combined or vehicle_imu)"
            raise LogError(f"{log.path}: {why}: {px4.LOG_FASTER}; it has {has}")
        if imu is not None and imu not in units:
            there = f"{name} has {' and '.join(map(str, units))}" if units else f"there is no topic {name}"
            alone = "" if combined is None else "; without --imu sensor_combined is read"
            raise LogError(f"{log.path}: no inertial unit {imu}; {there}{alone}")
        topic = log.topics[name, log.one(name, units[0] if imu is None else imu)]
        t_s = _sampled_s(topic)
        spans_s = log.columns(name, topic, f"{gyro}_dt", f"{force}_dt") / 1e6
        dt_s = spans_s[:, 0]
        spans_s = np.repeat(np.where(spans_s > 0.0, spans_s, np.nan), 3, axis=1)
        values = log.columns(name, topic, *_each(gyro), *_each(force)) / spans_s
    names = {"time": f"{name}.timestamp", "gyro": gyro, "force": force}
    for i, axis in enumerate("xyz"):
        names |= {f"gyro.{axis}": f"{gyro}[{i}]", f"force.{axis}": f"{force}[{i}]"}
    return Stream.of(name, t_s, values), dt_s, names


def _fixes(log: _Log) -> tuple[Stream | None, dict[str, Known | None]]:
    """The fixes, and what is known of the receiver.  Integer positions are in 1e-7 degrees and millimetres."""
    found = log.first("vehicle_gps_position", "sensor_gps")
    if found is None:
        return None, {"declination_rad": px4.declination(log.parameters, None, 0.0)}
    name, topic = found
    if "latitude_deg" in topic:
        place = log.columns(name, topic, "latitude_deg", "longitude_deg", "altitude_msl_m")
    else:
        place = log.columns(name, topic, "lat", "lon", "alt") / (1e7, 1e7, 1e3)
    velocity = log.columns(name, topic, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
    if level := bool(np.isnan(velocity[:, 2]).all()):
        velocity[:, 2] = 0.0
    t_s, true_s = _published_s(topic), _true_s(topic)
    stream = Stream.of(name, t_s, np.column_stack((place, velocity, true_s)))
    stream = stream.without(topic["fix_type"] < FIX_3D, NO_FIX)
    if "vel_ned_valid" in topic:
        stream = stream.without(topic["vel_ned_valid"] == 0, NO_VELOCITY)
    stream = replace(stream, optional=1, lost=stream.why != "")
    usable = np.flatnonzero((stream.why == "") & (np.abs(place) <= (90.0, 180.0, 1e5)).all(axis=1))
    latitude, longitude, altitude = place[usable[0]].tolist() if len(usable) else (0.0, 0.0, 0.0)
    where = (latitude, longitude, altitude) if len(usable) else None
    return stream, {
        "gps_vertical_velocity": Known(False, "log", f"{name}.vel_d_m_s") if level else None,
        "gps_latency_s": px4.latency(log.parameters),
        "declination_rad": px4.declination(log.parameters, where, _year(topic)),
        **airspeeds.elevation(altitude if len(usable) else None, f"altitude of {name}"),
    }


def _true_s(topic: Topic) -> Array:
    """Time of validity of each fix, NaN if unknown; see the module."""
    sampled_us = topic.get("timestamp_sample")
    if sampled_us is None:
        return np.full(len(topic["timestamp"]), np.nan)
    true_s = sampled_us.astype(np.float64) / 1e6
    late_s = _published_s(topic) - true_s
    return np.where((true_s > 0.0) & (late_s >= SOONEST_S) & (late_s <= LATEST_S), true_s, np.nan)


def _year(topic: Topic) -> float:
    """Decimal year of the fixes, NaN if none has a date."""
    utc_us = topic.get("time_utc_usec", np.zeros(0))
    dated = utc_us[utc_us > 0]
    return 1970.0 + float(np.median(dated)) / (365.2425 * 86400e6) if len(dated) else float("nan")


def _switched(log: _Log, what: str, stream: Stream | None) -> tuple[Stream | None, dict[str, Known | None]]:
    """The stream; if a parameter switches the sensor off, all of it left out, and this fact."""
    off = px4.off(log.parameters, what)
    if stream is None or not off:
        return stream, {}
    return streams.switched_off(stream, what, off)


def _combined(log: _Log, sensor: str, *fields: str) -> Stream | None:
    """Samples of a sensor in sensor_combined, which repeats each until the next one; None if it has none."""
    topic, relative = log.topics.get(("sensor_combined", 0)), f"{sensor}_timestamp_relative"
    if topic is None or relative not in topic or not set(fields) <= set(topic):
        return None
    at = np.flatnonzero(topic[relative] != NOT_THERE)
    sampled_us = topic["timestamp"][at].astype(np.int64) + topic[relative][at]
    fresh = np.append(True, np.diff(sampled_us) != 0)[: len(at)]
    if not len(at):
        return None
    values = log.columns("sensor_combined", topic, *fields)[at[fresh]]
    return Stream.of(f"sensor_combined.{fields[0].partition('[')[0]}", sampled_us[fresh] / 1e6, values)


def _field(log: _Log) -> Stream | None:
    """The magnetic field: of vehicle_magnetometer, sensor_combined or sensor_mag."""
    combined = _combined(log, "magnetometer", *_each("magnetometer_ga"))
    found = log.first("vehicle_magnetometer", *(() if combined else ("sensor_mag",)))
    if found is None:
        return combined and replace(combined, values=GAUSS_UT * combined.values)
    name, topic = found
    fields = _each("magnetometer_ga") if name == "vehicle_magnetometer" else ("x", "y", "z")
    return Stream.of(name, _published_s(topic), GAUSS_UT * log.columns(name, topic, *fields))


def _airspeed(log: _Log) -> Stream | None:
    """Calibrated or indicated airspeed, which are equivalent; else the true one, converted by the height."""
    found = log.first("airspeed", "airspeed_validated")
    if found is None:
        return None
    name, topic = found
    t_s = _published_s(topic)
    fields = [f for f in ("calibrated_airspeed_m_s", "indicated_airspeed_m_s") if f in topic]
    values = np.full((len(t_s), 1), np.nan)
    for field in fields:
        values = np.where(np.isfinite(values), values, log.columns(name, topic, field))
    missing = ~np.isfinite(values)
    if not fields or (missing.any() and "true_airspeed_m_s" in topic):
        true = np.where(missing, log.columns(name, topic, "true_airspeed_m_s"), np.nan)
        values = np.where(missing, _equivalent(log, t_s, true[:, 0])[:, None], values)
    stream = Stream.of(name, t_s, values)
    if name != "airspeed_validated":
        confidence = topic.get("confidence", np.zeros(0))
        return stream.without(confidence == 0.0, UNHEALTHY) if np.any(confidence) else stream  # all 0: not filled in
    for source in ("airspeed_source", "selected_airspeed_index", "airspeed_sensor_measurement_valid"):
        if source in topic:  # 0 or less: from the wind triangle or a model
            stream = stream.without(topic[source] < 1, NOT_MEASURED)
    return stream


def _equivalent(log: _Log, t_s: Array, true_m_s: Array) -> Array:
    """True airspeeds as equivalent ones: by the pressure altitude, or by the altitude of the fixes."""
    if not np.isfinite(true_m_s).any():
        return true_m_s
    if (found := log.first("vehicle_air_data")) is not None:
        at_s, height_m = _published_s(found[1]), log.columns(*found, "baro_alt_meter")[:, 0]
    else:
        fixes, _ = _fixes(log)
        at_s, height_m = (np.zeros(0), np.zeros(0)) if fixes is None else (fixes.t_s, fixes.values[:, 2])
    there = np.isfinite(at_s + height_m)
    if not there.any():
        log.repairs.append(airspeeds.AT_SEA_LEVEL)
        return true_m_s
    order = np.argsort(at_s[there], kind="stable")
    log.repairs.append(airspeeds.BY_HEIGHT)
    return airspeeds.equivalent_m_s(true_m_s, np.interp(t_s, at_s[there][order], height_m[there][order]))


def _height(log: _Log) -> Stream | None:
    """Barometric height above the start of the log."""
    found = log.first("vehicle_air_data")
    if found is None:
        stream = _combined(log, "baro", "baro_alt_meter")
    else:
        stream = Stream.of(found[0], _published_s(found[1]), log.columns(*found, "baro_alt_meter"))
    first = np.zeros(0) if stream is None else stream.values[np.isfinite(stream.values)][:1]
    return stream if stream is None or not len(first) else replace(stream, values=stream.values - first)


def _attitudes(log: _Log) -> Iterator[tuple[Stream, Kind]]:
    """The true attitude, then the one flown on; see `streams.first_known`."""
    for name, kind in ATTITUDES:
        found = log.first(name)
        if found is None:
            continue
        quaternion = log.columns(name, found[1], *_each("q", 4))
        R_eb = attitudes.attitude(dict(zip(("qw", "qx", "qy", "qz"), quaternion.T, strict=True)))
        if R_eb is not None:
            yield Stream.of(name, _sampled_s(found[1]), R_eb.reshape(-1, 9)), kind
