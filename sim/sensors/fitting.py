"""Sensor suites: the parts fitted and their board.  Each file ``suites/*.toml`` is one suite.

    summary = "..."                     one line of text
    gyro = "itg3200"                    a part by name, or your own file, relative to the suite: "my_gyro.toml"
    accelerometer = "bma180"
    gps = "ls20031"                     likewise, optional: magnetometer, airspeed, barometer

    [board]                             fields of BoardParams
    lever_arm_b_m = [0.05, 0.0, 0.02]

    [board.converter]                   reads the analogue parts
    bits = 10
    reference_v = 5.0

    [changes]                           individual figures, by dotted names
    "accelerometer.bias_g" = 0.02

The part ``generic`` has the defaults of its dataclass; the part ``perfect`` has no errors.

An installed package provides a suite by an entry point in the group ``wingslevel.suites``: ``my_package:suite.toml``, a
file in the package, or ``my_package:SUITE``, a path.  Its part files are in the same folder.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from sim.outside.blame import Refused, shown, theirs
from sim.outside.entry_points import Offer, offered
from sim.outside.files import reading
from sim.params import changed, near_misses
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.board import BoardParams
from sim.sensors.datasheet import KINDS, load_part, part_path, read_text, read_toml
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.noise import MOST_BITS

FOLDER: Final = Path(__file__).parent / "suites"
NO_FILES: Final[Mapping[str, str]] = MappingProxyType({})

_ALWAYS = ("gyro", "accelerometer", "gps")  # required
_ANALOGUE = {"gyro": ("sensitivity_mv_deg_s", "step_deg_s"), "accelerometer": ("sensitivity_mv_g", "step_g")}


@dataclass(frozen=True, slots=True)
class SuiteParams:
    """The parts fitted and their parameters; None: not fitted."""

    gyro: GyroParams = field(default_factory=GyroParams)
    accelerometer: AccelerometerParams = field(default_factory=AccelerometerParams)
    gps: GpsParams = field(default_factory=GpsParams)
    magnetometer: MagnetometerParams | None = None
    airspeed: AirspeedParams | None = None
    barometer: BarometerParams | None = None
    board: BoardParams = field(default_factory=BoardParams)


def load_suite(name: str, files: Mapping[str, str] = NO_FILES) -> SuiteParams:
    """The suite called `name`, or in the file ``path/to/suite.toml``.

    files : path -> text, used instead of the disk, as returned by `own_files` when the flight was first flown

    Raises
    ------
    ValueError      one line: no such suite (with suggestions) or file, or what is wrong in the file
    """
    files = _kept(name, files)
    file, data = _read(name, files)
    with reading(file):
        return _fit(file, data, _folder(name), files)


def suite_params(suite: str, changes: Mapping[str, Any], files: Mapping[str, str] = NO_FILES) -> SuiteParams:
    """The suite of that name with figures changed by dotted names; ValueError for an unknown suite or figure.

    files : path -> text, as for `load_suite`
    """
    params = SUITES[suite] if suite in set(SUITES) else load_suite(suite, files)
    return changed(params, changes, f"sensor suite {suite}")


def own_files(name: str, files: Mapping[str, str] = NO_FILES) -> dict[str, str]:
    """The text of each file that defines the suite `name`, by path; empty for a suite shipped with wingslevel.

    Paths of the suite of an installed package begin with its name: they are the same on every machine.
    """
    if not name.endswith(".toml"):
        offer = _offered().get(name)
        return {} if offer is None else _files_of(offer)
    text = read_text(Path(name), files, "sensor suite")
    return {name: text} | _part_files(read_toml(name, text), Path(name).parent, Path(name).parent, files)


def _part_files(
    data: Mapping[str, Any], folder: Path, called: Path, files: Mapping[str, str] = NO_FILES
) -> dict[str, str]:
    """The text of each part of a suite that is a file in `folder`, by its path below `called`."""
    parts = [data[kind] for kind in KINDS if isinstance(data.get(kind), str)]
    own = [part for part in parts if part.endswith(".toml")]
    return {str(part_path(part, called)): read_text(part_path(part, folder), files, "part") for part in own}


def suite_names() -> list[str]:
    """Names of all suites that need no path: wingslevel's own, then those of installed packages."""
    return [*_suite_names(), *_offered()]


def _offered() -> dict[str, Offer]:
    """The suites that installed packages offer, by name."""
    return offered("suites", _suite_names())


def _kept(name: str, files: Mapping[str, str]) -> Mapping[str, str]:
    """`files`; where the suite `name` is of an installed package and not in them, its files."""
    known = name in files or name.endswith(".toml") or name in _suite_names()
    return files if known or not (found := own_files(name)) else found


def _files_of(offer: Offer) -> dict[str, str]:
    """The files of a suite that an installed package offers, by paths that begin with its name."""

    def refuse(line: str) -> ValueError:
        return ValueError(f"sensor suite {offer.name!r} of {offer.origin}: {line}")

    with theirs(refuse, offer.package):
        found = offer.resource() or offer.load()
        path = os.fspath(found) if isinstance(found, str | os.PathLike) else ""
        if not isinstance(path, str) or not path.endswith(".toml"):
            raise Refused(f"{offer.value} is {shown(found)}; it must be the path of a .toml file")
    try:
        text = read_text(Path(path), NO_FILES, "sensor suite")
        return {offer.name: text} | _part_files(read_toml(path, text), Path(path).parent, Path(offer.name))
    except ValueError as error:
        raise refuse(str(error)) from error


def suite_parts(name: str, files: Mapping[str, str] = NO_FILES) -> dict[str, str]:
    """Contents of the suite `name` or of a file, as written: kind -> part, and the summary."""
    _, data = _read(name, _kept(name, files))
    return {key: data[key] for key in ("summary", *KINDS) if key in data}


def suite_settings(name: str, files: Mapping[str, str] = NO_FILES) -> dict[str, Any]:
    """Settings of the suite `name` or of a file for board, converter and figures: dotted name -> value."""
    file, data = _read(name, _kept(name, files))
    board = dict(_table(file, "board", data))
    converter = board.pop("converter", {})
    settings = {f"board.{key}": value for key, value in board.items()}
    settings |= {f"board.converter.{key}": value for key, value in converter.items()}
    return settings | dict(_table(file, "changes", data))


class _Suites(Mapping[str, SuiteParams]):
    """The shipped suites, each read when first used."""

    def __getitem__(self, name: str) -> SuiteParams:
        if name not in _suite_names():
            raise KeyError(name)
        return _loaded(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_suite_names())

    def __len__(self) -> int:
        return len(_suite_names())


SUITES: Final[Mapping[str, SuiteParams]] = _Suites()
"""Every shipped suite: name -> parts fitted."""


@cache
def _suite_names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


@cache
def _loaded(name: str) -> SuiteParams:
    return load_suite(name)


def _read(name: str, files: Mapping[str, str]) -> tuple[str, dict[str, Any]]:
    """Name of the suite in error messages, and its contents."""
    if name.endswith(".toml"):
        return name, read_toml(name, read_text(Path(name), files, "sensor suite"))
    if name not in _suite_names():
        if name in files:
            return name, read_toml(name, files[name])
        raise ValueError(
            f"unknown sensor suite {name!r}: {near_misses(name, suite_names())} (your own: path/to/suite.toml)"
        )
    path = FOLDER / f"{name}.toml"
    return path.name, read_toml(path.name, path.read_text(encoding="utf-8"))


def _folder(name: str) -> Path | None:
    if name.endswith(".toml"):
        return Path(name).parent
    return None if name in _suite_names() else Path(name)


def _fit(file: str, data: Mapping[str, Any], folder: Path | None, files: Mapping[str, str]) -> SuiteParams:
    known = ("summary", *KINDS, "board", "changes")
    for key in data:
        if key not in known:
            raise ValueError(f"{file}: unknown key {key!r}: {near_misses(key, known)}")
    if not isinstance(data.get("summary"), str):
        raise ValueError(f"{file}: summary = {data.get('summary')!r}: must be a line of text")
    board = dict(_table(file, "board", data))
    converter = board.pop("converter", None)
    devices = {kind: _device(file, kind, data.get(kind), folder, files) for kind in KINDS}
    if converter is not None:
        devices |= {kind: _read_by(file, kind, devices[kind], converter) for kind in _ANALOGUE}
    try:
        suite = SuiteParams(**devices, board=changed(BoardParams(), board, "board"))
        return changed(suite, _table(file, "changes", data), "this suite")
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _table(file: str, key: str, data: Mapping[str, Any]) -> Mapping[str, Any]:
    table = data.get(key, {})
    if not isinstance(table, dict):
        raise ValueError(f"{file}: {key} = {table!r}: must be a section, [{key}]")
    return table


def _device(file: str, kind: str, name: Any, folder: Path | None, files: Mapping[str, str]) -> Any:
    """Parameters of the part `name`, None if not fitted."""
    if name is None and kind not in _ALWAYS:
        return None
    if not isinstance(name, str):
        said = f"{kind} is missing" if name is None else f"{kind} = {name!r}"
        raise ValueError(f"{file}: {said}: must be the name of a part, or of your own part file")
    try:
        part = load_part(name, folder, files)
    except ValueError as error:
        raise ValueError(f"{file}: {kind}: {error}") from None
    if kind not in part.devices:
        raise ValueError(f"{file}: {kind} = {name!r}: that part has no {kind}, only {' and '.join(part.devices)}")
    return part.devices[kind]


def _read_by(file: str, kind: str, device: Any, converter: Any) -> Any:
    """An analogue part on the board's converter, whose step is reference / 2^bits / sensitivity."""
    if device.output == "digital":
        return device
    known = ("bits", "reference_v", "conversions")
    if not isinstance(converter, dict) or not {"bits", "reference_v"} <= set(converter) <= set(known):
        raise ValueError(
            f"{file}: board.converter = {converter!r}: must have bits and reference_v, may have conversions"
        )
    bits, volts = converter["bits"], converter["reference_v"]
    if isinstance(bits, bool) or bits not in range(1, MOST_BITS + 1):
        raise ValueError(f"{file}: board.converter.bits = {bits!r} bit: choose a whole number from 1 to {MOST_BITS}")
    if isinstance(volts, bool) or not isinstance(volts, int | float) or not 0.0 < volts < 1000.0:
        raise ValueError(f"{file}: board.converter.reference_v = {volts!r} V: choose a number above 0")
    sensitivity, step = _ANALOGUE[kind]
    millivolts = getattr(device, sensitivity)
    if not millivolts > 0.0:
        raise ValueError(f"{file}: {kind}: an analogue part without {sensitivity} cannot be read by a converter")
    step_value = 1000.0 * volts / 2**bits / millivolts
    changes = {"bits": bits, step: step_value, "conversions": converter.get("conversions", device.conversions)}
    return replace(device, **changes)
