"""What the parameters in an ArduPilot log say about the instruments.

Parameters are logged at the start and whenever they change.  The values at the time of the first flight count; in a log
without flight, the last ones.  If a parameter is not in the log, the firmware's default is used, and the source says
so.  SIM_ parameters, which configure a simulator, are not read.

| parameter | what it means here |
|-|-|
| COMPASS_AUTODEC (1 by default), COMPASS_DEC | declination by the world magnetic model at the first fix, or as set |
| COMPASS_USE, _USE2, _USE3, COMPASS_ENABLE | whether a compass is used at all, and which |
| GPS1_DELAY_MS, GPS_DELAY_MS (first), GPS2_DELAY_MS, GPS_DELAY_MS2 | latency; 0 is the driver's default, unknown here |
| ARSPD_USE, ARSPD2_USE | 0 is not used, 2 is used at zero throttle only |
| LOG_BITMASK | which bit to set for the inertial unit |
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from estimator.instruments import Known
from scenarios.harness.logs.ardupilot_matlab import MatlabMessages
from scenarios.harness.logs.dataflash_records import DataFlash, Records
from sim.magnetic_field import FIRST_YEAR, declination_rad

FLYING_M_S = 5.0
LONGEST_DELAY_MS = 2000.0
FIX_3D = 3
_WEEK_YEARS = 7.0 / 365.2425
_EPOCH = 1980.0 + 5.0 / 366.0  # 6 January 1980, when GPS time began
_IMU_BITS = {  # of LOG_BITMASK by vehicle: those that log the inertial unit, the most samples last
    "ArduPlane": ((7, "IMU"), (19, "raw IMU")),
    "ArduCopter": ((7, "IMU"), (18, "fast IMU"), (19, "raw IMU")),
    "Rover": ((7, "IMU"), (19, "raw IMU")),
    "ArduSub": ((7, "IMU"), (18, "fast IMU"), (19, "raw IMU")),
    "Tracker": ((3, "IMU"),),
    "Blimp": ((7, "IMU"), (18, "fast IMU"), (19, "raw IMU")),
}
_ANY_VEHICLE = ((7, "IMU"), (19, "raw IMU"))


@dataclass(frozen=True, slots=True)
class Parameters:
    """Parameters by name as they were in flight, and the vehicle's name, empty if the log has none."""

    values: Mapping[str, float] = field(default_factory=dict)
    vehicle: str = ""

    @classmethod
    def of(cls, log: DataFlash | MatlabMessages) -> "Parameters":
        """The parameters of a log."""
        changes = log.records("PARM")
        if not {"Name", "Value"} <= set(changes.columns):
            return cls(vehicle=_vehicle(log))
        flight = _first_flight(log)
        values: dict[str, float] = {}
        names = (raw.decode("ascii", "replace") for raw in changes.fields["Name"])
        for name, value, at in zip(names, changes.fields["Value"], changes.offsets, strict=True):
            if np.isfinite(value) and (at <= flight or name not in values):
                values[name] = float(value)
        return cls(values, _vehicle(log))

    def first(self, *names: str) -> tuple[str, float] | None:
        """Name and value of the first of these parameters that is in the log."""
        return next(((name, self.values[name]) for name in names if name in self.values), None)

    def compass_off(self, instance: int) -> str:
        """The parameter that switches a compass off, with its value; empty if it is in use."""
        enable = self.first("COMPASS_ENABLE")
        use = self.first("COMPASS_USE" if instance == 0 else f"COMPASS_USE{instance + 1}")
        for found in (enable, use):
            if found is not None and found[1] == 0.0:
                return f"{found[0]} is 0"
        return ""

    def airspeed_off(self, instance: int) -> str:
        """The parameter that switches an airspeed sensor off, fully or in part; empty if it is in use."""
        found = self.first("ARSPD_USE" if instance == 0 else f"ARSPD{instance + 1}_USE")
        if found is None or found[1] not in (0.0, 2.0):
            return ""
        return f"{found[0]} is 0" if found[1] == 0.0 else f"{found[0]} is 2: used at zero throttle only"

    def latency(self, instance: int) -> Known | None:
        """The latency of a receiver, if it is set."""
        i = instance + 1
        found = self.first(f"GPS{i}_DELAY_MS", "GPS_DELAY_MS" if i == 1 else f"GPS_DELAY_MS{i}")
        believed = found is not None and 0.0 < found[1] <= LONGEST_DELAY_MS
        return Known(1e-3 * found[1], "log", found[0]) if found is not None and believed else None

    def declination(self, place: tuple[float, float, float] | None, year: float) -> Known | None:
        """The declination as the firmware determines it.

        place : of the first fix: latitude and longitude, degrees, and altitude, or None      year : NaN if unknown
        """
        automatic, set_rad = self.first("COMPASS_AUTODEC"), self.first("COMPASS_DEC")
        if set_rad is not None and not abs(set_rad[1]) <= math.pi:  # damaged
            set_rad = None
        if automatic is not None and automatic[1] == 0.0:
            if set_rad is None:
                return Known(0.0, "log", "COMPASS_AUTODEC is 0, COMPASS_DEC is not logged: 0 by default")
            return Known(set_rad[1], "log", "COMPASS_DEC")
        if place is None:  # the firmware keeps the last one
            return None if set_rad is None else Known(set_rad[1], "log", "COMPASS_DEC, without a fix")
        why = "COMPASS_AUTODEC is 1" + (" by default" if automatic is None else "")
        return world_model(place, year, why)

    def log_imu(self) -> str:
        """How to log the inertial unit."""
        bits = _IMU_BITS.get(self.vehicle, _ANY_VEHICLE)
        listed = " or ".join(f"bit {bit} ({name})" for bit, name in bits)
        mask = self.first("LOG_BITMASK")
        add = "" if mask is None or int(mask[1]) >> bits[-1][0] & 1 else f"; add {1 << bits[-1][0]} to its {mask[1]:g}"
        return f"set {listed} of LOG_BITMASK{add}"


def world_model(place: tuple[float, float, float], year: float, why: str) -> Known:
    """Declination by the world magnetic model; `year` is NaN if the log has no date, `why` is the parameter."""
    dated = f"{year:.1f}" if np.isfinite(year) else f"{FIRST_YEAR:.0f} assumed, as the log has no date"
    value = declination_rad(*place, year if np.isfinite(year) else FIRST_YEAR)
    return Known(value, "log", f"world magnetic model at the first fix, {dated}; {why}")


def year_of(fixes: Records) -> float:
    """Decimal year of these GPS messages, by the week of GPS time; NaN if none has a date."""
    week = next((name for name in ("GWk", "Week") if name in fixes.columns), None)
    if week is None:
        return float("nan")
    weeks = fixes.fields[week][fixes.fields[week] > 0]
    return _EPOCH + _WEEK_YEARS * float(np.median(weeks)) if len(weeks) else float("nan")


def _first_flight(log: DataFlash | MatlabMessages) -> int:
    """File offset of the first fix in flight; beyond the end of the file if there is none."""
    fixes = log.records("GPS")
    if not {"Status", "Spd"} <= set(fixes.columns):
        return 1 << 62
    flying = (fixes.fields["Status"] >= FIX_3D) & (log.column(fixes, "Spd") > FLYING_M_S)
    return int(fixes.offsets[np.argmax(flying)]) if flying.any() else 1 << 62


def _vehicle(log: DataFlash | MatlabMessages) -> str:
    """The vehicle type, from the firmware's start message."""
    messages = log.records("MSG")
    if "Message" not in messages.columns:
        return ""
    said = (raw.decode("ascii", "replace") for raw in messages.fields["Message"])
    return next((name for text in said for name in _IMU_BITS if name in text and " V" in text), "")
