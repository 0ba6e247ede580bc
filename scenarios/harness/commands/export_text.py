"""A recorded flight as a text log: the measurements in columns, the true attitude beside them, and a column map.

A value stands in the row in which it arrived, and the cells below it are empty until the next.  Numbers are written
with as many digits as bring them back bit for bit.  The column map beside it carries what is known of the
instruments: properties that are withheld, unknown or only assumed are not in it.
"""

import csv
import io
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import Known
from estimator.interface import Array
from scenarios.harness.logs import ours, properties
from sim.log import Flight

KNOWN_BY = ("set", "data sheet", "log")  # sources of a property that is knowledge


class Column(NamedTuple):
    """One column of the file: its name, its entry in the map, and its numbers; NaN is an empty cell."""

    name: str
    meaning: str
    values: Array


def columns(flight: Flight) -> list[Column]:
    """The columns of `flight`; those of an instrument without samples are left out."""
    came, known = ours.arrived(flight.log.measured), ours.known_of(flight)
    rows = flight.log.measured[came]
    found = [Column("time_s", "time s", rows["t_s"]), Column("interval_s", "interval s", rows["dt_s"])]
    found += _vector("gyro_{}_rad_s", "gyro.{} rad/s", rows["gyro_b_rad_s"], "xyz")
    found += _vector("force_{}_m_s2", "force.{} m/s^2", rows["force_b_m_s2"], "xyz")
    if rows["gps_new"].any():
        found += _gps(rows, stamped=_is_stamped(known))
    if rows["mag_new"].any():
        new = rows["mag_new"] > 0
        found.append(Column("mag_new", "mag.new", rows["mag_new"].astype(np.float64)))
        found += _vector("mag_{}_ut", "mag.{} uT", _where(new, rows["mag_b_ut"]), "xyz")
    if rows["air_new"].any():
        new = rows["air_new"] > 0
        found.append(Column("air_new", "air.new", rows["air_new"].astype(np.float64)))
        for name, meaning, column in (
            ("equivalent_airspeed_m_s", "airspeed m/s", "equivalent_airspeed_m_s"),
            ("baro_height_m", "height m", "baro_height_m"),
        ):
            if np.isfinite(rows[column][new]).any():
                found.append(Column(name, meaning, _where(new, rows[column])))
    R_eb = flight.log.truth["R_eb"][came]
    found += [Column(f"r{i}{j}", f"r{i}{j}", R_eb[:, i, j]) for i in range(3) for j in range(3)]
    return found


def _gps(rows: Any, *, stamped: bool) -> list[Column]:
    new = rows["gps_new"] > 0
    found = [Column(f"gps_{flag}", f"gps.{flag}", rows[f"gps_{flag}"].astype(np.float64)) for flag in ("new", "valid")]
    if stamped and np.isfinite(rows["gps_t_s"][new]).any():
        found.append(Column("gps_t_s", "gps.time s", _where(new, rows["gps_t_s"])))
    found += _vector("gps_{}_m", "gps.{} m", _where(new, rows["gps_p_e_m"]), "ned")
    reported = "ned" if np.any(rows["gps_v_e_m_s"][new, 2] != 0.0) else "ne"  # 0 in every fix is none
    found += _vector("gps_v{}_m_s", "gps.v{} m/s", _where(new, rows["gps_v_e_m_s"]), reported)
    found.append(Column("gps_speed_m_s", "gps.speed m/s", _where(new, rows["gps_speed_m_s"])))
    found.append(Column("gps_course_rad", "gps.course rad", _where(new, rows["gps_course_rad"])))
    return found


def _is_stamped(known: dict[str, Known]) -> bool:
    """Whether the fixes are known to have stamps; older recordings do not say."""
    entry = known.get("gps_stamped")
    return entry is None or (bool(entry.value) and entry.source in KNOWN_BY)


def _vector(name: str, meaning: str, values: Array, axes: str) -> list[Column]:
    return [Column(name.format(a), meaning.format(a), values[:, i]) for i, a in enumerate(axes)]


def _where(new: NDArray[np.bool_], values: Array) -> Array:
    return np.where(new if values.ndim == 1 else new[:, None], values, np.nan)


def to_csv(found: list[Column]) -> str:
    """The text of the log."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([column.name for column in found])
    writer.writerows(zip(*(_cells(column.values) for column in found), strict=True))
    return text.getvalue()


def _cells(values: Array) -> Iterator[str]:
    """Numbers with the fewest digits that restore them bit for bit."""
    return ("" if v != v else str(int(v)) if v.is_integer() and abs(v) < 1e15 and (v or str(v) == "0.0") else repr(v)
            for v in values.tolist())  # fmt: skip


def to_map(found: list[Column], flight: Flight, name: str) -> str:
    """The column map of the log `name`, as TOML."""
    latitude_deg, longitude_deg = ours.place_of(flight)
    known = ours.known_of(flight)
    hidden = [n for n in properties.MEASURED if n in known and known[n].source not in KNOWN_BY]
    lines = [
        f"# {name}: what its columns mean, and what is known about the instruments.",
        'delimiter = ","',
        'decimal = "."',
        'reference = "truth"',
        f"origin_deg = [{latitude_deg!r}, {longitude_deg!r}]",
        *([f"withheld = {json.dumps(hidden)}"] if hidden else []),
        "",
        "[columns]",
        *(f'{column.name} = "{column.meaning}"' for column in found),
    ]
    given = {n: k.value for n, k in known.items() if k.source in KNOWN_BY and isinstance(k.value, bool | int | float)}
    calibration = {n: k.value for n, k in ours.calibration_of(flight).items()}
    given |= calibration
    if given:
        lines += ["", "[instruments]", *(f"{n} = {_toml(value)}" for n, value in given.items())]
    if (sample := ours.on_ground_of(flight)) is not None:
        lines += ["", "[on_ground]  # mean inertial sample before the flight, at rest", f"seconds = {sample.dt_s!r}"]
        lines += [f"{n} = {getattr(sample, n).tolist()}" for n in ("gyro_b_rad_s", "force_b_m_s2")]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """A value in TOML syntax."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return str(value).lower() if isinstance(value, bool) else repr(value)
