"""ArduPilot's DataFlash logs (.bin): IMU, GPS, MAG, ARSP, BARO, and the attitude in SIM, ATT or AHR2.

A fix has no time of validity: GPS has the time of logging, and ``SMS`` in GPA the time of arrival.  MAG holds the field
after the firmware's corrections, and the offsets that it applied.  Rates in RATE are filtered and corrected for the
controller; they are not what the gyro measured, and are not used.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.instruments import Known
from estimator.interface import Array
from scenarios.harness.logs import airspeeds, attitudes, streams
from scenarios.harness.logs.ardupilot import FIX_3D, Parameters, year_of
from scenarios.harness.logs.ardupilot_matlab import MatlabMessages
from scenarios.harness.logs.dataflash_records import Clock, DataFlash, Records, own_time_s
from scenarios.harness.logs.recorded import Kind, LogError, RecordedLog
from scenarios.harness.logs.streams import IN_GAP, NO_FIX, UNHEALTHY, Stream

GYRO, FORCE, FIELD = (tuple(f"{name}{axis}" for axis in "XYZ") for name in ("Gyr", "Acc", "Mag"))
FIX = ("Lat", "Lng", "Alt", "Spd", "GCrs")
HEALTHY = ("GH", "AH", "GyHlt", "AcHlt"), ("Health",), ("H", "Health")  # of IMU, of MAG, and of ARSP and BARO
ATTITUDES: tuple[tuple[str, Kind], ...] = (("SIM", "truth"), ("ATT", "filter"), ("AHR2", "filter"))


def read(path: Path, imu: int | None = None) -> RecordedLog:
    """The log at `path`.

    imu : which inertial unit, from 0; by default the first one

    Raises
    ------
    LogError      one line: no such log, no inertial unit in it, or one that cannot be believed
    """
    return of_messages(DataFlash(path), imu)


def of_messages(records: DataFlash | MatlabMessages, imu: int | None = None) -> RecordedLog:
    """The log made of these messages; parameters and errors as `read`."""
    log = _Log(records)
    inertial = log.inertial(imu)
    fixes, receiver = log.fixes()
    field, compass = log.field()
    airspeed, pitot = log.airspeed()
    height = log.stream("BARO", ("Alt",), HEALTHY[2])
    attitude = streams.first_known(log.attitudes())
    notes = (f"only one of several instances is read: {'; '.join(log.others)}",) if log.others else ()
    messages = streams.Messages(
        inertial, np.full(len(inertial.t_s), np.nan),
        {"time": f"{inertial.name} time", "gyro": "GyrX GyrY GyrZ", "force": "AccX AccY AccZ"}
        | {f"{ours}.{a.lower()}": f"{own}{a}" for ours, own in (("gyro", "Gyr"), ("force", "Acc")) for a in "XYZ"},
        fixes, field, airspeed, height, *attitude, {**receiver, **compass, **pitot}, log.parameters.log_imu(),
    )  # fmt: skip
    return replace(streams.recorded(log.path, messages, log.repairs), notes=notes)


class _Log:
    """The streams of a log.  `others` lists which of several instances was read."""

    def __init__(self, records: DataFlash | MatlabMessages) -> None:
        self.of, self.path, self.repairs = records, records.path, records.repairs
        self.parameters = Parameters.of(records)
        self.others = list[str]()
        self.clock = Clock(np.zeros(0), np.zeros(0, np.intp))

    def readable(self, name: str, *wanted: str) -> list[Records]:
        """The instances of a message that have the columns `wanted`."""
        there = self.of.instances(name)
        found = [r for r in there if set(wanted) <= set(r.columns)]
        if there and not found:
            lacking = ", ".join(c for c in wanted if c not in there[0].columns)
            self.repairs.append(f"{name} has no {lacking}: {sum(len(r.fields) for r in there)} messages not read")
        return found

    def _one(self, instances: list[Records], chosen: Records) -> Records:
        """`chosen`, with a note that the others are not read."""
        if len(instances) > 1:
            listed = ", ".join(str(r.instance) for r in instances)
            self.others.append(f"{instances[0].name} {chosen.instance} (of {listed})")
        return chosen

    def table(self, records: Records, columns: tuple[str, ...]) -> Array:
        """Columns in our units, shape (n, m)."""
        return np.column_stack([self.of.column(records, column) for column in columns])

    def made(self, records: Records, columns: tuple[str, ...]) -> Stream:
        """A stream of those columns, on the clock of the log."""
        stream = Stream.of(records.name, np.zeros(len(records.fields)), self.table(records, columns))
        t_s = own_time_s(records)
        if t_s is not None and self.clock.agrees(records, t_s):
            return replace(stream, t_s=t_s)
        t_s, in_gap = self.clock.by_order(records)
        self.repairs.append(f"{records.name}: not on the clock of the log; placed by the order of the records")
        return replace(stream, t_s=t_s).without(np.isnan(t_s), streams.OUTSIDE).without(in_gap, IN_GAP)

    def stream(self, name: str, columns: tuple[str, ...], healthy: tuple[str, ...] = ()) -> Stream | None:
        """The messages in our units; None if none has these columns.

        healthy : columns that are zero if the sensor reports the sample as bad
        """
        found = self.readable(name, *columns)
        if not found:
            return None
        records = self._one(found, found[0])
        return _trusted(self.made(records, columns), records, healthy)

    def inertial(self, imu: int | None) -> Stream:
        """Gyro and accelerometer: of IMU, or of GYR with ACC interpolated to its times."""
        whole = [r for r in self.of.instances("IMU") if set(GYRO + FORCE) <= set(r.columns)]
        forces = {r.instance: r for r in self.of.instances("ACC") if set(FORCE) <= set(r.columns)}
        halves = [r for r in self.of.instances("GYR") if set(GYRO) <= set(r.columns) and r.instance in forces]
        found = halves if not whole or (halves and _too_slow(whole[0])) else whole
        if not found:
            has = f"it has {', '.join(self.of.names)}"
            why = f"no inertial unit (IMU, or GYR and ACC): {self.parameters.log_imu()}"
            raise LogError(f"{self.path}: {why}; {has}")
        chosen = next((r for r in found if imu is None or r.instance == imu), None)
        if chosen is None:
            there = " and ".join(str(r.instance) for r in found)
            raise LogError(f"{self.path}: no inertial unit {imu}; {found[0].name} has {there}")
        self._one(found, chosen)
        t_s = own_time_s(chosen)
        if t_s is None:
            raise LogError(f"{self.path}: {chosen.name} has no time; it has {', '.join(chosen.columns)}")
        self.clock = Clock(t_s, chosen.offsets)
        if found is whole:
            stream = replace(Stream.of(chosen.name, t_s, self.table(chosen, GYRO + FORCE)), t_s=t_s)
            stream = _trusted(stream, chosen, HEALTHY[0])
        else:
            force = self.made(forces[chosen.instance], FORCE)
            values = np.column_stack((self.table(chosen, GYRO), _at(t_s, force)))
            stream = Stream.of(chosen.name, t_s, values)
        if 2 * np.sum(stream.why != "") > len(t_s):
            n, flags = np.sum(stream.why != ""), " ".join(c for c in HEALTHY[0] if c in chosen.columns)
            why = f"{n} of {len(t_s)} samples of {chosen.name} {chosen.instance} are unhealthy by its own {flags}"
            raise LogError(f"{self.path}: {why}: choose another unit with --imu")
        return stream

    def fixes(self) -> tuple[Stream | None, dict[str, Known | None]]:
        """The fixes of the receiver that the firmware used most, and what is known of it; VZ is positive down."""
        found = self.readable("GPS", "Status", *FIX)
        if not found:
            return None, {"declination_rad": self.parameters.declination(None, np.nan)}
        records = self._one(found, max(found, key=lambda r: (_in_use(r), -r.instance)))
        reports = self._reports_vertical(records)
        vertical = reports is None or reports.value
        stream = self.made(records, (*FIX, "VZ") if vertical else FIX)
        speed, course = stream.values[:, 3], np.radians(stream.values[:, 4])
        down = stream.values[:, 5] if vertical else np.zeros(len(speed))
        unknown = np.full(len(speed), np.nan)  # time of validity
        table = (*stream.values[:, :3].T, speed * np.cos(course), speed * np.sin(course), down, unknown)
        no_fix = records.fields["Status"] < FIX_3D
        stream = Stream(stream.name, stream.t_s, np.column_stack(table), stream.why, 1, no_fix).without(no_fix, NO_FIX)
        usable = np.flatnonzero((stream.why == "") & np.isfinite(stream.values[:, :3]).all(axis=1))
        place = _place(stream.values[usable[0]]) if len(usable) else None
        return stream, {
            "gps_latency_s": self.parameters.latency(records.instance),
            "gps_vertical_velocity": reports,
            "declination_rad": self.parameters.declination(place, year_of(records.where(~no_fix))),
            **airspeeds.elevation(None if place is None else place[2], f"altitude of {records.name}"),
        }

    def _reports_vertical(self, fixes: Records) -> Known | None:
        """Whether the receiver reports a vertical velocity, by VZ or GPA.VV; None if the log does not say."""
        if "VZ" not in fixes.columns:
            return Known(False, "log", f"{fixes.name} has no VZ")
        if np.isnan(self.of.column(fixes, "VZ")).all():
            return Known(False, "log", f"{fixes.name}.VZ")
        found = [r for r in self.of.instances("GPA") if r.instance == fixes.instance and "VV" in r.columns]
        return Known(bool(np.mean(found[0].fields["VV"] != 0) > 0.5), "log", f"{found[0].name}.VV") if found else None

    def field(self) -> tuple[Stream | None, dict[str, Known | None]]:
        """The magnetic field of the first compass in use; left out if none is in use."""
        found = self.readable("MAG", *FIELD)
        if not found:
            return None, {}
        records = self._one(found, next((r for r in found if not self.parameters.compass_off(r.instance)), found[0]))
        off = self.parameters.compass_off(records.instance)
        stream = self.made(records, FIELD)
        if off:
            return streams.switched_off(stream, "magnetometer", off)
        return _trusted(stream, records, HEALTHY[1]), {}

    def airspeed(self) -> tuple[Stream | None, dict[str, Known | None]]:
        """The airspeed of the sensor in use; left out while none is in use."""
        found = self.readable("ARSP", "Airspeed")
        if not found:
            return None, {}
        on = [r for r in found if not self.parameters.airspeed_off(r.instance)] or found
        records = self._one(found, max(on, key=lambda r: (_in_use(r), -r.instance)))
        off = self.parameters.airspeed_off(records.instance)
        stream = self.made(records, ("Airspeed",))
        used = records.fields["U"] != 0 if "U" in records.columns else np.full(len(stream.t_s), not off)
        if off.endswith("is 0"):
            return streams.switched_off(stream, "airspeed", off)
        return _trusted(stream, records, HEALTHY[2]).without(~used, off or f"{records.name}.U is 0: not in use"), {}

    def attitudes(self) -> Iterator[tuple[Stream, Kind]]:
        """The simulator's attitude, then the one flown on, then that of the other filter; see `streams.first_known`."""
        for name, kind in ATTITUDES:
            for columns, ours in ((("Q1", "Q2", "Q3", "Q4"), ("qw", "qx", "qy", "qz")),
                                  (("Roll", "Pitch", "Yaw"), ("roll", "pitch", "yaw"))):  # fmt: skip
                found = [r for r in self.of.instances(name) if set(columns) <= set(r.columns)]
                if not found:
                    continue
                stream = self.made(self._one(found, found[0]), columns)
                values = stream.values if ours[0] == "qw" else np.radians(stream.values)
                R_eb = attitudes.attitude(dict(zip(ours, values.T, strict=True)))
                if R_eb is not None:
                    yield Stream(stream.name, stream.t_s, R_eb.reshape(-1, 9), stream.why), kind
                break


def _trusted(stream: Stream, records: Records, healthy: tuple[str, ...]) -> Stream:
    """The stream without samples for which one of the columns `healthy` is zero."""
    for column in healthy:
        if column in records.columns:
            stream = stream.without(records.fields[column] == 0, UNHEALTHY)
    return stream


def _in_use(records: Records) -> int:
    """How many of the messages say that the firmware used this instance."""
    return int(np.sum(records.fields["U"] != 0)) if "U" in records.columns else 0


def _too_slow(records: Records) -> bool:
    t_s = own_time_s(records)
    return t_s is not None and len(t_s) > 2 and float(np.median(np.diff(t_s))) > 1.05 * streams.SLOWEST_S


def _place(fix: Array) -> tuple[float, float, float]:
    """Latitude, longitude and altitude of a fix, limited to the range of the world magnetic model."""
    latitude, longitude, altitude = (float(x) for x in fix[:3])
    return min(max(latitude, -90.0), 90.0), min(max(longitude, -180.0), 180.0), altitude


def _at(t_s: Array, stream: Stream) -> Array:
    """The stream interpolated to other times; NaN outside it and in its gaps."""
    order = np.argsort(stream.t_s, kind="stable")
    times, values = stream.t_s[order], stream.values[order]
    after = np.clip(np.searchsorted(times, t_s), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    inside = (times[after] == t_s) | ((times[before] <= t_s) & (t_s <= times[after]))
    inside &= (times[after] == t_s) | (times[after] - times[before] <= LONGEST_GAP_S)
    there = np.column_stack([np.interp(t_s, times, column) for column in values.T])
    return np.where(inside[:, None], there, np.nan)
