"""Column maps: what the columns of a table mean, with their units and signs.

A map is a TOML file.  Its table ``[columns]`` gives a column one of `QUANTITIES`, with a minus sign where the column
has the opposite sign, and a unit if it is not ours.  The long form adds a linear scale: value = factor * (number in the
file - offset), in that unit.  Every entry is optional::

    delimiter = ";"           # of a text file; detected by default.  " " is any number of blanks and tabs
    decimal = ","             # decimal sign of a text file
    skip_lines = 2            # lines to skip before the header
    names = ["t", "wx"]       # column names, for a file without a header
    struct = "flight_data"    # of a MATLAB file: the structure that holds the columns
    axes = "forward-left-up"  # of gyro, accelerometer and magnetometer; forward-right-down by default
    force_reversed = true     # the accelerometer reads gravity minus acceleration
    reference = "truth"       # source of the attitude in the file: truth, filter or firmware

    [columns]
    time_ms = "time ms"
    wx = "gyro.x deg/s"
    az = "-force.z g"
    raw_x = { is = "mag.x", unit = "mG", factor = 0.92, offset = 12 }

    [instruments]  # what is known of them, by the names of `estimator.instruments.PROPERTIES`
    gps_latency_s = 0.2

``withheld = ["gps_rate_hz"]`` lists properties that are hidden from the estimators although the log shows them.
Without ``[columns]`` the columns are recognised by their names, as they are without a map (`automatic`).
"""

import math
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

import numpy as np

from estimator.instruments import PROPERTIES, Known
from estimator.interface import Array, ImuSample
from scenarios.harness.logs import column_names, units
from scenarios.harness.logs.quantities import QUANTITIES, Meaning
from scenarios.harness.logs.recorded import Kind, LogError
from scenarios.harness.logs.units import UNITS
from scenarios.harness.plugins import near_misses
from sim.outside import files
from sim.outside.wording import printable

MAPS = Path(__file__).with_name("maps")  # maps that come with the package, named without .toml
_KEYS = ("columns", "delimiter", "decimal", "skip_lines", "names", "struct", "axes", "force_reversed", "reference",
         "origin_deg", "instruments", "withheld", "on_ground")  # fmt: skip
_ENTRIES = ("is", "unit", "factor", "offset")
_DIRECTIONS = {  # of a sensor axis -> its unit vector in the body: forward, right, down
    "forward": (1, 0, 0), "back": (-1, 0, 0), "right": (0, 1, 0), "left": (0, -1, 0), "down": (0, 0, 1),
    "up": (0, 0, -1),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """What the columns mean, by name, and how to read the file; see the module.

    columns : empty if they are to be recognised by name      delimiter : empty if it is to be detected
    R_bs : shape (3, 3), from sensor axes to body axes, None where they are the same
    rivals : quantity -> columns that match it equally well      origin_deg : latitude and longitude
    on_ground : mean inertial sample at rest, taken before the log
    """

    columns: Mapping[str, Meaning] = field(default_factory=dict)
    delimiter: str = ""
    skip_lines: int = 0
    struct: str = ""
    known: Mapping[str, Known] = field(default_factory=dict)
    name: str = "automatic names"
    decimal: str = ""
    names: tuple[str, ...] = ()
    R_bs: Array | None = None
    force_reversed: bool = False
    reference: Kind = "filter"
    origin_deg: tuple[float, float] | None = None
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    on_ground: ImuSample | None = None

    def of(self, header: Iterable[str], row_of_units: Mapping[str, str] | None = None) -> "ColumnMap":
        """The same map; if it names no columns, with those of `header` that are recognised."""
        if self.columns:
            return self
        found, rivals = column_names.automatic(header, row_of_units)
        return replace(self, columns=found, rivals=rivals)


def automatic(header: Iterable[str], row_of_units: Mapping[str, str] | None = None) -> ColumnMap:
    """A map of the columns of `header` whose names are recognised; see `column_names`."""
    return ColumnMap().of(header, row_of_units)


def load(spec: str | Path) -> ColumnMap:
    """The map in the TOML file `spec`, or the shipped map of that name.

    Raises
    ------
    LogError      no such map, or an invalid entry; one line with the map and the column
    """
    path = Path(spec)
    if path.suffix != ".toml":
        path = MAPS / f"{spec}.toml"
    if not os.path.lexists(path):
        offered = sorted(p.stem for p in MAPS.glob("*.toml"))
        raise LogError(f"no column map {str(spec)!r}: {near_misses(str(spec), offered)} (or the path of a .toml file)")
    with files.reading(path, LogError):
        return _loaded(path)


def _loaded(path: Path) -> ColumnMap:
    try:
        data = files.toml(files.text(path, "column map"))
    except tomllib.TOMLDecodeError as error:
        raise LogError(f"{path}: {' '.join(str(error).split())}") from error
    for key in data:
        if key not in _KEYS:
            raise LogError(f"{path}: unknown entry {key!r}: {near_misses(key, _KEYS)}")
    if not data:
        raise LogError(f"{path}: empty; a map has a table [columns], or entries such as axes, names, [instruments]")
    entries = data.get("columns", {})
    if not isinstance(entries, dict):
        raise LogError(f'{path}: columns must be a table: [columns], with a line name = "quantity unit" for each')
    columns = {column: _meaning(entry, f"{path}: {column} = {_shown(entry)}") for column, entry in entries.items()}
    _check_twice(columns, path)

    def checked(key: str, default: Any, valid: Callable[[Any], bool], right: str) -> Any:
        if key in data and not valid(data[key]):
            raise LogError(f"{path}: {key} = {data[key]!r} must be {right}")
        return data.get(key, default)

    origin = checked("origin_deg", None, _is_place, "a latitude and a longitude in degrees")
    form = 'one character: "," ";" "|" "\\t", or " " for blanks'
    return ColumnMap(
        columns,
        delimiter=checked("delimiter", "", lambda v: isinstance(v, str) and len(v) == 1, form),
        decimal=checked("decimal", "", lambda v: v in (".", ","), '"." or ","'),
        names=tuple(checked("names", [], _is_names, 'a list of names, as in names = ["t", "gx"]')),
        skip_lines=checked("skip_lines", 0, lambda v: type(v) is int and v >= 0, "a whole number, zero or more"),
        struct=checked("struct", "", lambda v: isinstance(v, str), "the name of a structure"),
        known=_known(data, path),
        name=path.stem,
        R_bs=_axes(checked("axes", "", lambda v: isinstance(v, str), 'text, as in "forward-left-up"'), path),
        force_reversed=checked("force_reversed", False, lambda v: isinstance(v, bool), "true or false"),
        reference=checked("reference", "filter", lambda v: v in get_args(Kind), "truth, filter or firmware"),
        origin_deg=None if origin is None else (float(origin[0]), float(origin[1])),
        on_ground=_on_ground(data, path),
    )


def _is_place(value: Any) -> bool:
    if not isinstance(value, list) or len(value) != 2 or not all(isinstance(v, int | float) for v in value):
        return False
    return abs(value[0]) <= 90.0 and abs(value[1]) <= 360.0


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _on_ground(data: Mapping[str, Any], path: Path) -> ImuSample | None:
    """The mean inertial sample in the table [on_ground]: seconds averaged, rad/s, m/s^2."""
    table = data.get("on_ground")
    if table is None:
        return None
    wanted = {"seconds": 1, "gyro_b_rad_s": 3, "force_b_m_s2": 3}
    right = "[on_ground] must have seconds (a number), gyro_b_rad_s and force_b_m_s2 (three numbers each)"
    try:
        values = {name: np.array(table[name], np.float64) for name in table}
    except (TypeError, ValueError):
        raise LogError(f"{path}: {right}") from None
    if set(values) != set(wanted) or any(v.size != wanted[n] or not np.isfinite(v).all() for n, v in values.items()):
        raise LogError(f"{path}: {right}")
    return ImuSample(0.0, float(values["seconds"]), values["gyro_b_rad_s"], values["force_b_m_s2"])


def _meaning(entry: Any, where: str) -> Meaning:
    """The meaning of an entry, ``-force.z g`` or a table; `where` begins the error message."""
    factor, offset = 1.0, 0.0
    if isinstance(entry, dict):
        for key in entry:
            if key not in _ENTRIES:
                raise LogError(f"{where}: unknown entry {key!r}: {near_misses(key, _ENTRIES)}")
        spelled, unit = entry.get("is"), entry.get("unit", "")
        factor, offset = (_number(entry.get(k, d), k, where) for k, d in (("factor", 1.0), ("offset", 0.0)))
        if factor == 0.0:
            raise LogError(f"{where}: factor = 0 would make every value zero")
    else:
        spelled, _, unit = str(entry).strip().partition(" ")
    if not isinstance(spelled, str) or not isinstance(unit, str):
        raise LogError(f'{where}: write {{ is = "gyro.x", unit = "deg/s", factor = 0.07, offset = 0 }}')
    quantity, unit = spelled.strip().removeprefix("-"), unit.strip()
    if quantity not in QUANTITIES:
        raise LogError(f"{where}: unknown quantity {quantity!r}: {near_misses(quantity, QUANTITIES)}")
    dimension = QUANTITIES[quantity]
    by_unit = units.factor_of(unit, dimension) if unit else 1.0
    if by_unit is None and units.plain(unit) in units.COUNTS:
        ours = next(iter(UNITS[dimension]))
        raise LogError(
            f"{where}: {unit} is not a unit: give the size of one, as in "
            f'{{ is = "{quantity}", unit = "{ours}", factor = 0.001, offset = 0 }}'
        )
    if by_unit is None:
        raise LogError(f"{where}: unit {unit!r} of {quantity} must be one of {', '.join(UNITS[dimension])}")
    sign = -1.0 if spelled.strip().startswith("-") else 1.0
    return Meaning(quantity, sign * factor * by_unit, bool(unit), offset)


def _shown(entry: Any) -> str:
    if isinstance(entry, dict):
        return printable("{ " + ", ".join(f"{k} = {v!r}" for k, v in entry.items()) + " }", 200)
    return printable(repr(entry), 200)


def _finite(value: float) -> bool:
    """Whether `value` is neither infinite nor an integer too large to compute with."""
    return abs(value) < files.LARGEST_NUMBER


def _number(value: Any, key: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise LogError(f"{where}: {key} = {value!r} must be a number")
    return float(value)


def _check_twice(columns: Mapping[str, Meaning], path: Path) -> None:
    """Refuse two columns for one quantity, except time: columns of another length have their own times."""
    seen: dict[str, str] = {}
    for column, meaning in columns.items():
        quantity = meaning.quantity
        if quantity in seen and quantity != "time":
            raise LogError(f"{path}: {quantity} is assigned to two columns, {seen[quantity]} and {column}")
        seen[quantity] = column


def matrix_of(column: str) -> str:
    """The matrix or structure of a column such as ``IMU.GyrX`` or ``IMU[3]``; empty for a plain column."""
    if column.endswith("]"):
        return column.rpartition("[")[0]
    return column.rpartition(".")[0]


def _axes(spelled: str, path: Path) -> Array | None:
    """The rotation from sensor axes to forward, right, down."""
    if not spelled:
        return None
    words = spelled.lower().replace(",", "-").replace(" ", "-").split("-")
    if len(words) == 1 and len(spelled) == 3:  # FLU
        words = list(spelled.lower())
    full = [next((d for d in _DIRECTIONS if d == w or (len(w) == 1 and d[0] == w)), "") for w in filter(None, words)]
    R_bs = np.array([_DIRECTIONS[d] for d in full if d], dtype=np.float64).T
    if len(full) != 3 or not all(full) or abs(abs(np.linalg.det(R_bs)) - 1.0) > 0.5:
        raise LogError(
            f"{path}: axes = {spelled!r}: give the directions of x, y and z, each forward, back, right, left, down or "
            'up, as in "forward-left-up"'
        )
    if np.linalg.det(R_bs) < 0.0:
        raise LogError(f"{path}: axes = {spelled!r} are left-handed; they must be right-handed")
    return None if np.array_equal(R_bs, np.eye(3)) else R_bs


def _known(data: Mapping[str, Any], path: Path) -> dict[str, Known]:
    """What the table ``[instruments]`` and the list ``withheld`` say of the instruments."""
    entries = data.get("instruments", {})
    if not isinstance(entries, dict):
        raise LogError(f"{path}: instruments must be a table: [instruments]")
    found: dict[str, Known] = {}
    for name, value in entries.items():
        where = f"{path}: [instruments] {name}"
        if name == "calibration":  # its dotted keys make a table
            if not isinstance(value, dict):
                raise LogError(f"{where} = {_shown(value)}: must be a table")
            found |= {f"calibration.{n}": Known(v, "log", path.name) for n, v in dict(value).items()}
            continue
        if name not in PROPERTIES and name not in parameters():
            raise LogError(f"{where}: no such property: {near_misses(name, {*PROPERTIES, *parameters()})}")
        endless = name.endswith(("full_scale_rad_s", "full_scale_m_s2")) and value == math.inf
        if not isinstance(value, int | float) or not (_finite(value) or endless):
            raise LogError(f"{where} = {value!r} must be a number, true or false")
        found[name] = Known(value, "log", path.name)
    withheld = data.get("withheld", [])
    if not isinstance(withheld, list):
        raise LogError(f'{path}: withheld must be a list of properties, as in withheld = ["gps_rate_hz"]')
    for name in map(str, withheld):
        if name not in PROPERTIES:
            raise LogError(f"{path}: withheld {name!r}: {near_misses(name, PROPERTIES)}")
        if name in found:
            raise LogError(f"{path}: withheld {name!r}: it also has a value in [instruments]")
        found[name] = Known(PROPERTIES[name].assumed, "withheld", path.name)
    return found


@lru_cache(maxsize=1)
def parameters() -> frozenset[str]:
    """Names of the parameters of all registered estimators that can be loaded."""
    from dataclasses import is_dataclass

    from scenarios.harness import equipping, plugins
    from sim.params import dotted_fields

    found: set[str] = set()
    for name in plugins.estimators():
        try:
            params = equipping.params_of(name, equipping.load_estimator(name))
        except ValueError:  # its package is not installed
            continue
        if is_dataclass(params):
            found |= set(dotted_fields(params))
    return frozenset(found)
