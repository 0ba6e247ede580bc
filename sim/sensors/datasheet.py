"""Sensor parts by their data sheets.  Each file ``parts/*.toml`` is one part; every figure states its source.

    name = "ITG-3200"
    maker = "InvenSense"
    summary = "three-axis digital gyro, 2000 deg/s"
    datasheet = "PS-ITG-3200A-00-01.4, revision 1.4, 30 March 2010"     or a list of such lines

    [gyro]
    range_deg_s = { value = 2000.0, source = "Full-Scale Range" }

Sections are kinds of sensors, keys the fields of their parameter dataclass.  A source names the row of the data
sheet, or is ``typical`` if the data sheet has none.  Figures not given are perfect: no error, no limit.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, get_type_hints

from sim.outside.files import check, reading, toml
from sim.outside.files import text as text_of
from sim.params import near_misses, shown, typed, unit_of
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.magnetometer import MagnetometerParams

FOLDER: Final = Path(__file__).parent / "parts"

GENERIC: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "gyro": GyroParams(),
        "accelerometer": AccelerometerParams(),
        "gps": GpsParams(),
        "magnetometer": MagnetometerParams(),
        "airspeed": AirspeedParams(),
        "barometer": BarometerParams(),
    }
)
"""A part of each kind with the defaults of its dataclass."""

PERFECT: Final[Mapping[str, Any]] = MappingProxyType(
    {
        **GENERIC,
        "gyro": GyroParams(
            bias_deg_s=0.0, drift_deg_s_min=0.0, walk_deg_s_sqrt_s=0.0, noise_density_deg_s_sqrt_hz=0.0,
            gain=0.0, cross_axis=0.0, range_deg_s=math.inf, bits=0,
        ),
        "accelerometer": AccelerometerParams(bias_g=0.0, noise_density_ug_sqrt_hz=0.0, range_g=math.inf, bits=0),
        "gps": GpsParams(
            filter_s=0.0, latency_s=0.0, first_fix_s=0.0, velocity_noise_m_s=0.0,
            wander_horizontal_m=0.0, wander_vertical_m=0.0,
        ),
    }
)  # fmt: skip
"""A part of each kind without errors; magnetometer and air data have none by default."""

KINDS: Final = tuple(GENERIC)
_BUILT_IN: Final = {
    "generic": (GENERIC, "the default of every kind: a cheap part of the time"),
    "perfect": (PERFECT, "every kind: no error, no limit, no delay"),
}
_ABOUT = ("name", "maker", "summary", "datasheet")


@dataclass(frozen=True, slots=True)
class Part:
    """One part as its data sheet describes it.

    devices : kind -> parameters, for each kind of sensor in the part
    sources : ``kind.field`` -> source of the figure, for each figure of the file
    """

    name: str
    maker: str
    summary: str
    datasheet: str
    devices: Mapping[str, Any]
    sources: Mapping[str, str]


def part_names() -> list[str]:
    """Names of all shipped parts, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_part(name: str, folder: Path | None = None, files: Mapping[str, str] = MappingProxyType({})) -> Part:
    """The part called `name` (``itg3200``, ``ITG-3200``, ``generic``, ``perfect``) or in a file, ``path/to/part.toml``.

    folder : the path of a file is relative to it       files : path -> text, used instead of the disk

    Raises
    ------
    ValueError      one line: no such part (with suggestions) or file, or what is wrong in the file: key, value,
                    unit, and what is valid
    """
    if name in _BUILT_IN:
        devices, summary = _BUILT_IN[name]
        return Part(name, "none", summary, "none", devices, MappingProxyType({}))
    if name.endswith(".toml"):
        path = part_path(name, folder)
        with reading(path):
            return read_part(str(path), read_text(path, files, "part"))
    known = {_plain(stem): stem for stem in part_names()}
    if _plain(name) not in known:
        hint = near_misses(name, [*known.values(), *_BUILT_IN])
        raise ValueError(f"unknown part {name!r}: {hint} (your own: path/to/part.toml)")
    path = FOLDER / f"{known[_plain(name)]}.toml"
    return read_part(path.name, path.read_text(encoding="utf-8"))


def part_path(name: str, folder: Path | None) -> Path:
    """Path of a user's part file, relative to `folder` if given."""
    return Path(name) if folder is None else folder / name


def read_text(path: Path, files: Mapping[str, str], what: str) -> str:
    """Text of a user's file, from `files` or from disk; ValueError if there is none."""
    if str(path) in files:
        return files[str(path)]
    try:
        check(path, what)
    except ValueError as error:
        if os.path.lexists(path):
            raise
        raise ValueError(f"{what} {str(path)!r}: no such file") from error
    return text_of(path, what)


def read_toml(file: str, text: str) -> dict[str, Any]:
    """Contents of the TOML `text`; ValueError with `file` and the place of the error."""
    try:
        with reading(file):
            return toml(text)
    except ValueError as error:  # also for integers of thousands of digits
        raise ValueError(f"{file}: not TOML: {' '.join(str(error).split())}") from None


def read_part(file: str, text: str) -> Part:
    """The part described by the TOML `text`; errors begin with `file`."""
    data = read_toml(file, text)
    about = {key: _about(file, key, data.pop(key, None)) for key in _ABOUT}
    devices: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for kind, figures in data.items():
        if kind not in KINDS or not isinstance(figures, dict):
            raise ValueError(f"{file}: unknown section [{kind}]: {near_misses(kind, [*KINDS, *_ABOUT])}")
        devices[kind], cited = _device(file, kind, figures)
        sources |= cited
    if not devices:
        raise ValueError(f"{file}: describes no sensor: give it a section, one of [{'], ['.join(KINDS)}]")
    return Part(**about, devices=MappingProxyType(devices), sources=MappingProxyType(sources))


def _about(file: str, key: str, value: Any) -> str:
    lines = value if key == "datasheet" and isinstance(value, list) else [value]
    if not lines or not all(isinstance(line, str) and line.strip() and "\n" not in line for line in lines):
        said = "is missing" if value is None else f"= {value!r}"
        right = ", or a list of such lines: document, revision, date" if key == "datasheet" else ""
        raise ValueError(f"{file}: {key} {said}: must be a line of text{right}")
    return "; ".join(lines)


def _device(file: str, kind: str, figures: Mapping[str, Any]) -> tuple[Any, dict[str, str]]:
    """Parameters of one section, and the source of each figure."""
    perfect = PERFECT[kind]
    hints = get_type_hints(type(perfect))
    known = [f.name for f in fields(perfect)]
    given: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for key, figure in figures.items():
        where = f"{file}: {kind}.{key}"
        if key not in known:
            raise ValueError(f"{where}: unknown key: {near_misses(key, known)}")
        value, sources[f"{kind}.{key}"] = _figure(where, figure)
        try:
            given[key] = typed(value, hints[key])
        except ValueError as error:
            raise ValueError(f"{shown(where, value)}: {error}") from None
    try:
        return replace(perfect, **given), sources
    except ValueError as error:  # names the dataclass: here it is the section of a file
        raise ValueError(f"{file}: {str(error).replace(f'{type(perfect).__name__}.', f'{kind}.', 1)}") from None


def _figure(where: str, figure: Any) -> tuple[Any, str]:
    """Value and source of one figure, ``{ value = 1.0, source = "typical" }``."""
    form = 'write { value = ..., source = "..." }'
    if not isinstance(figure, dict):
        raise ValueError(f"{shown(where, figure)}: source missing; {form}")
    if extra := sorted(set(figure) - {"value", "source"}):
        raise ValueError(f"{where}: unknown key {extra[0]!r}; {form}")
    if "value" not in figure:
        raise ValueError(f"{where}: value missing, {unit_of(where) or 'a number or a word'}; {form}")
    source = figure.get("source")
    if not isinstance(source, str) or not source.strip():
        raise ValueError(
            f"{shown(where, figure['value'])}: source missing; name the row of the data sheet, or write typical"
        )
    return figure["value"], source


def _plain(name: str) -> str:
    """`name` in lower case without punctuation: itg3200 for ITG-3200."""
    return "".join(c for c in name.lower() if c.isalnum())
