"""Checks of a recording before use: the types of its record and the values of its columns.

A recording may come from anywhere and may have been edited.  Each function raises ValueError with the error and its
place; `sim.recording.load` adds the path.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from numpy.typing import NDArray

from autopilot.interface import Mode
from estimator.instruments import PROPERTIES, property_value
from estimator.interface import Health
from sim.log import Outcome, Phase
from sim.outside.wording import brief, printable

LONGEST_TICK_S, LATEST_S = 10.0, 1e11  # of a tick; beyond this, 15 digits do not resolve a tick
MOST_BYTES = 4 << 30  # of all columns in memory
_LEVELS = ("info", "warn", "error")
_SOURCES = ("set", "data sheet", "log", "learnt", "assumed", "withheld", "unknown")
_CHOICES = {  # integer columns -> valid values
    "truth.phase": tuple(Phase), "flown.health": tuple(Health), "flown.mode": tuple(Mode),
    **dict.fromkeys(("measured.gps_new", "measured.gps_valid", "measured.mag_new", "measured.air_new"), (0, 1)),
}  # fmt: skip
_TIMES = ("truth.t_s", "measured.t_s")


def record(data: Any, formats: tuple[int, ...]) -> dict[str, Any]:
    """The record of a flight as in the manifest, after checking the type of everything used."""
    if not isinstance(data, dict):
        raise _wrong("the record", data, "a table")
    if data.get("format") not in formats or isinstance(data["format"], bool | float):
        wanted = " or ".join(map(str, formats))
        raise ValueError(f"recording format {brief(data.get('format'))}; this version reads {wanted}")
    _own(data)
    tables = ("config", "known", "known_to_estimator", "on_ground", "ledger", "versions", "scores")
    for name in tables:
        if not isinstance(data.get(name), dict | None):
            raise _wrong(name, data[name], "a table")
    config = data.get("config") or {}
    for where, table in (("", data), ("config.", config)):
        _settings(where, table)
    for name in ("known", "known_to_estimator"):
        for key, entry in (data.get(name) or {}).items():
            _known(f"{name}.{key}", key, entry)
    for i, row in enumerate(_list("verdict", data.get("verdict"))):
        _verdict(f"verdict[{i}]", row)
    if data.get("on_ground") is not None:
        _on_ground(data["on_ground"])
    return data


def _own(data: Mapping[str, Any]) -> None:
    """Check the entries written by the recording itself."""
    for name in ("outcome", "message", "heading_reference", "dt_s", "release_s", "n_ticks", "events"):
        if name not in data:
            raise ValueError(f"its record lacks {name}")
    _choice("outcome", data["outcome"], tuple(Outcome))
    _choice("heading_reference", data["heading_reference"], ("course", "nose"))
    _text("message", data["message"])
    tick = f"the length of a tick, 0 to {LONGEST_TICK_S:g} s"
    _number("dt_s", data["dt_s"], lambda v: 0.0 < v <= LONGEST_TICK_S, tick)
    _number("release_s", data["release_s"], lambda v: abs(v) < LATEST_S, "a time in seconds")
    n = data["n_ticks"]
    if not isinstance(n, int) or isinstance(n, bool) or n < 0:
        raise _wrong("n_ticks", n, "a whole number, zero or more")
    for i, event in enumerate(_list("events", data["events"])):
        if not isinstance(event, dict) or set(event) != {"t_s", "text", "level"}:
            raise _wrong(f"events[{i}]", event, "a table of t_s, text and level")
        _number(f"events[{i}].t_s", event["t_s"], lambda v: abs(v) < LATEST_S, "a time in seconds")
        _text(f"events[{i}].text", event["text"])
        _choice(f"events[{i}].level", event["level"], _LEVELS)


def _settings(where: str, table: Mapping[str, Any]) -> None:
    """Check the entries of the manifest or its configuration that are used; any may be missing."""
    for name in ("scenario", "aircraft", "estimator", "autopilot", "suite", "reference"):
        if table.get(name) is not None:
            _text(f"{where}{name}", table[name])
    for name in ("sensors", "files", "estimator_params", "air"):
        if not isinstance(table.get(name), dict | None):
            raise _wrong(f"{where}{name}", table[name], "a table")
    for name, text in (table.get("files") or {}).items():
        _text(f"{where}files.{name}", text)
    for name, most in (("launch_latitude_deg", 90.0), ("launch_longitude_deg", 360.0)):
        if table.get(name) is not None:
            _number(f"{where}{name}", table[name], lambda v, most=most: abs(v) <= most, f"degrees, up to {most:g}")  # type: ignore[misc]
    seed = table.get("seed")
    if seed is not None and not isinstance(seed, int):
        raise _wrong(f"{where}seed", seed, "a whole number")
    air = table.get("air") or {}
    wanted = ("wind_m_s", "wind_from_deg", "turbulence_w20_m_s", *(("shear",) if "shear" in air else ()))
    for name in wanted if air else ():
        _number(f"{where}air.{name}", air.get(name), math.isfinite, "a number")
    for name in ("gusts", "thermals"):
        _list(f"{where}air.{name}", air.get(name))


def _known(where: str, name: str, entry: Any) -> None:
    """Check one known property of an instrument, as written by `estimator.instruments.Known`."""
    if not isinstance(entry, dict) or "value" not in entry:
        raise _wrong(where, entry, "a table of value and source")
    _choice(f"{where}.source", entry.get("source"), _SOURCES)
    if name in PROPERTIES and entry["value"] is not None:
        try:
            property_value(name, entry["value"])
        except ValueError as error:
            raise ValueError(f"{where.partition('.')[0]}: {error}") from None


def _verdict(where: str, row: Any) -> None:
    if not isinstance(row, dict) or not {"name", "unit", "measured", "limit", "passed"} <= set(row):
        raise _wrong(where, row, "a table of name, unit, measured, limit and passed")
    for name in ("name", "unit"):
        _text(f"{where}.{name}", row[name])


def _on_ground(sample: Mapping[str, Any]) -> None:
    for name in ("t_s", "dt_s"):
        _number(f"on_ground.{name}", sample.get(name), lambda v: abs(v) < LATEST_S, "a time in seconds")
    for name in ("gyro_b_rad_s", "force_b_m_s2"):
        values = sample.get(name)
        if not isinstance(values, list) or len(values) != 3:
            raise _wrong(f"on_ground.{name}", values, "three numbers")
        for value in values:
            _number(f"on_ground.{name}", value, lambda v: abs(v) < 1e6, "three numbers")


def schema(found: pa.Schema, expected: Mapping[str, bool], rows: int) -> None:
    """Reject columns of another type and too many rows: ValueError.

    expected : name of a column -> whether it holds whole numbers
    """
    most = MOST_BYTES // (8 * len(expected))
    if rows > most:
        raise ValueError(f"{rows} ticks, more than the {most} that can be read")
    for name, integer in expected.items():
        kind, wanted = found.field(name).type, pa.int64() if integer else pa.float64()
        if kind != wanted:
            raise ValueError(
                f"column {name} holds {printable(str(kind), 60)}, not {'whole ' if integer else ''}numbers ({wanted})"
            )


def column(name: str, values: pa.ChunkedArray, rows: int) -> NDArray[Any]:
    """The numbers of a column; ValueError, with the row, for an invalid one."""
    if len(values) != rows:
        raise ValueError(f"column {name} has {len(values)} rows, the file {rows}")
    if values.null_count:
        first = int(np.argmax(values.is_null().to_numpy(zero_copy_only=False)))
        raise ValueError(f"column {name}, row {first + 1}: no value")
    numbers = values.to_numpy()
    if name in _TIMES:
        _check_times(name, numbers)
    if (allowed := _CHOICES.get(name)) is not None and (wrong := ~np.isin(numbers, allowed)).any():
        first = int(np.argmax(wrong))
        raise ValueError(
            f"column {name}, row {first + 1}: {numbers[first]} must be one of {', '.join(map(str, map(int, allowed)))}"
        )
    return numbers


def _check_times(name: str, t_s: NDArray[Any]) -> None:
    wrong = ~(np.abs(t_s) < LATEST_S)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ValueError(f"column {name}, row {first + 1}: {t_s[first]:g} s is not a valid time")
    steps = np.diff(t_s)  # a lost inertial sample repeats the stamp of the one before
    late = steps < 0.0 if name == "measured.t_s" else steps <= 0.0
    if late.any():
        first = int(np.argmax(late)) + 1
        raise ValueError(
            f"column {name}, row {first + 1}: {t_s[first]:g} s is not after the row before, {t_s[first - 1]:g} s"
        )


def _number(where: str, value: Any, right: Callable[[float], bool], wanted: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not _holds(right, value):
        raise _wrong(where, value, wanted)


def _holds(right: Callable[[float], bool], value: float) -> bool:
    try:
        return math.isfinite(value) and right(float(value))
    except OverflowError:  # an integer too large for a float
        return False


def _text(where: str, value: Any) -> None:
    if not isinstance(value, str):
        raise _wrong(where, value, "a text")


def _choice(where: str, value: Any, allowed: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in allowed:
        raise _wrong(where, value, f"one of {', '.join(allowed)}")


def _list(where: str, value: Any) -> list[Any]:
    if not isinstance(value, list | None):
        raise _wrong(where, value, "a list")
    return value or []


def _wrong(where: str, value: Any, wanted: str) -> ValueError:
    return ValueError(f"its record has {printable(where, 60)} = {brief(value)}: must be {wanted}")
