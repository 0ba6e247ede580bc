"""What the columns of a table mean: our names for them, their units and signs.

A map is a TOML file.  Its table ``[columns]`` gives each column that is used one of `QUANTITIES`, with a minus sign
where the column counts the other way, and a unit where it is not ours; or a table of these and a linear scale, where
value = factor * (number in the file - offset), in that unit::

    delimiter = ";"           # of a text file; found unless given.  " " is any number of blanks and tabs
    decimal = ","             # of its numbers
    skip_lines = 2            # before its header
    names = ["t", "wx"]       # of its columns, where it has no header
    struct = "flight_data"    # of a MATLAB file: the structure that holds the columns
    axes = "forward-left-up"  # of the inertial unit and the magnetometer; forward-right-down unless given
    force_reversed = true     # the accelerometer reads gravity minus acceleration
    reference = "truth"       # what the attitude in the file is: truth, filter or firmware

    [columns]
    time_ms = "time ms"
    wx = "gyro.x deg/s"
    az = "-force.z g"
    raw_x = { is = "mag.x", unit = "mG", factor = 0.92, offset = 12 }

    [instruments]  # what is known of them, by the names of `estimator.instruments.PROPERTIES`
    gps_latency_s = 0.2

``withheld = ["gps_rate_hz"]`` names properties that estimators do not receive although the log shows them.  Without a
table ``[columns]`` the columns are recognised by their names, as they are without a map (`automatic`).
"""

import math
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from estimator.instruments import PROPERTIES, Known
from estimator.interface import Array, ImuSample
from scenarios.harness.logs import column_names, units
from scenarios.harness.logs.quantities import QUANTITIES, Meaning
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.logs.units import UNITS
from scenarios.harness.plugins import near_misses
from sim.outside import files
from sim.outside.wording import printable

MAPS = Path(__file__).with_name("maps")  # maps that come with the package, named without .toml
Kind = Literal["truth", "filter", "firmware"]
_KEYS = ("columns", "delimiter", "decimal", "skip_lines", "names", "struct", "axes", "force_reversed", "reference",
         "origin_deg", "instruments", "suits", "withheld", "on_ground")  # fmt: skip
_ENTRIES = ("is", "unit", "factor", "offset")
_DIRECTIONS = {  # of a sensor axis -> its unit vector in the body: forward, right, down
    "forward": (1, 0, 0), "back": (-1, 0, 0), "right": (0, 1, 0), "left": (0, -1, 0), "down": (0, 0, 1),
    "up": (0, 0, -1),
}  # fmt: skip


_OLDER_NAMES = {"use_compass": "use_magnetometer"}


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """The meaning of columns by their names, and how to get at them; see the module.

    columns : empty where they are to be recognised       delimiter : empty where it is to be found
    R_bs : shape (3, 3), from the axes of the sensors to the body, None where they are the same
    rivals : quantity -> columns that are named for it equally well      origin_deg : latitude and longitude
    on_ground : mean inertial sample at rest from before the log
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
        """The same map, with the columns of `header` that are recognised where it names none."""
        if self.columns:
            return self
        found, rivals = column_names.automatic(header, row_of_units)
        return replace(self, columns=found, rivals=rivals)


def automatic(header: Iterable[str], row_of_units: Mapping[str, str] | None = None) -> ColumnMap:
    """Map of those columns of `header` whose names are understood; see `column_names`."""
    return ColumnMap().of(header, row_of_units)


def load(spec: str | Path) -> ColumnMap:
    """The map in the TOML file `spec`, or the one of that name that comes with the package.

    Raises
    ------
    LogError      no such map, or an entry that means nothing; one line with the map and the column
    """
    path = Path(spec)
    if path.suffix != ".toml":
        path = MAPS / f"{spec}.toml"
    if not os.path.lexists(path):
        offered = sorted(p.stem for p in MAPS.glob("*.toml"))
        raise LogError(f"no column map {str(spec)!r}: {near_misses(str(spec), offered)} (your own: a file.toml)")
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
        raise LogError(f"{path}: empty; a map has a table [columns], or says axes, names, struct or [instruments]")
    entries = data.get("columns", {})
    if not isinstance(entries, dict):
        raise LogError(f'{path}: columns must be a table: [columns], with a line name = "quantity unit" for each')
    columns = {column: _meaning(entry, f"{path}: {column} = {_shown(entry)}") for column, entry in entries.items()}
    _check_twice(columns, path)
    return ColumnMap(
        columns,
        skip_lines=_whole(data, path),
        struct=_text(data, "struct", path),
        known=_known(data, path),
        name=path.stem,
        **_form(data, path),
        R_bs=_axes(data, path),
        force_reversed=_flag(data, path),
        reference=_kind(data, path),
        origin_deg=_origin(data, path),
        on_ground=_on_ground(data, path),
    )


def _on_ground(data: Mapping[str, Any], path: Path) -> ImuSample | None:
    """The mean inertial sample of the table [on_ground]: seconds averaged, rad/s, m/s^2."""
    table = data.get("on_ground")
    if table is None:
        return None
    wanted = {"seconds": 1, "gyro_b_rad_s": 3, "force_b_m_s2": 3}
    right = "[on_ground] must have seconds, gyro_b_rad_s and force_b_m_s2: a number, and three numbers each"
    if not isinstance(table, dict) or set(table) != set(wanted):
        raise LogError(f"{path}: {right}")
    try:
        values = {name: np.array(table[name], np.float64) for name in wanted}
    except (TypeError, ValueError):
        raise LogError(f"{path}: {right}") from None
    if any(v.size != wanted[n] or not np.isfinite(v).all() for n, v in values.items()):
        raise LogError(f"{path}: {right}")
    return ImuSample(0.0, float(values["seconds"]), values["gyro_b_rad_s"], values["force_b_m_s2"])


def _meaning(entry: Any, where: str) -> Meaning:
    """The meaning spelled ``-force.z g``, or as a table; `where` begins the message where it is none."""
    factor, offset = 1.0, 0.0
    if isinstance(entry, dict):
        for key in entry:
            if key not in ("is", "unit", "factor", "offset"):
                raise LogError(
                    f"{where}: unknown entry {key!r}: {near_misses(key, ('is', 'unit', 'factor', 'offset'))}"
                )
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
    dimension = QUANTITIES[quantity].dimension
    by_unit = units.factor_of(unit, dimension) if unit else 1.0
    if by_unit is None and units.plain(unit) in units.COUNTS:
        ours = next(iter(UNITS[dimension]))
        raise LogError(
            f"{where}: {unit} is no unit: say what one of them is, as in "
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
    """Whether it is a number that can be worked with: not infinite, and no whole number beyond all others."""
    return abs(value) < files.LARGEST_NUMBER


def _number(value: Any, key: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise LogError(f"{where}: {key} = {value!r} must be a number")
    return float(value)


def _check_twice(columns: Mapping[str, Meaning], path: Path) -> None:
    """One column for each quantity, but for the time: columns of another length have one of their own."""
    seen: dict[str, str] = {}
    for column, meaning in columns.items():
        quantity = meaning.quantity
        if quantity in seen and quantity != "time":
            raise LogError(f"{path}: {quantity} is the meaning of two columns, {seen[quantity]} and {column}")
        seen[quantity] = column


def matrix_of(column: str) -> str:
    """The matrix or structure to which ``IMU.GyrX`` or ``IMU[3]`` belongs; empty for a column by itself."""
    if column.endswith("]"):
        return column.rpartition("[")[0]
    return column.rpartition(".")[0]


def _text(data: Mapping[str, Any], key: str, path: Path) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise LogError(f"{path}: {key} = {value!r} must be a text")
    return value


def _whole(data: Mapping[str, Any], path: Path) -> int:
    value = data.get("skip_lines", 0)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise LogError(f"{path}: skip_lines = {value!r} must be a whole number, zero or more")
    return value


def _flag(data: Mapping[str, Any], path: Path) -> bool:
    value = data.get("force_reversed", False)
    if not isinstance(value, bool):
        raise LogError(f"{path}: force_reversed = {value!r} must be true or false")
    return value


def _form(data: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """How a text file is written: delimiter, decimal sign, names of columns."""
    delimiter, decimal, names = _text(data, "delimiter", path), _text(data, "decimal", path), data.get("names", [])
    if "delimiter" in data and len(delimiter) != 1:
        raise LogError(f'{path}: delimiter = {delimiter!r} must be one character: "," ";" "|" "\\t", or " " for blanks')
    if decimal not in ("", ".", ","):
        raise LogError(f'{path}: decimal = {decimal!r} must be "." or ","')
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise LogError(f'{path}: names must be a list of texts, as in names = ["t", "gx"]')
    return {"delimiter": delimiter, "decimal": decimal, "names": tuple(names)}


def _kind(data: Mapping[str, Any], path: Path) -> Kind:
    kind = data.get("reference", "filter")
    if kind not in ("truth", "filter", "firmware"):
        raise LogError(f"{path}: reference = {kind!r} must be truth, filter or firmware")
    return cast(Kind, kind)


def _axes(data: Mapping[str, Any], path: Path) -> Array | None:
    """The rotation from the axes of the sensors to forward, right, down."""
    spelled = _text(data, "axes", path)
    if not spelled:
        return None
    words = spelled.lower().replace(",", "-").replace(" ", "-").split("-")
    if len(words) == 1 and len(spelled) == 3:  # FLU
        words = list(spelled.lower())
    full = [next((d for d in _DIRECTIONS if d == w or (len(w) == 1 and d[0] == w)), "") for w in filter(None, words)]
    R_bs = np.array([_DIRECTIONS[d] for d in full if d], dtype=np.float64).T
    if len(full) != 3 or not all(full) or abs(abs(np.linalg.det(R_bs)) - 1.0) > 0.5:
        raise LogError(
            f"{path}: axes = {spelled!r}: say where x, y and z point, each of forward or back, right or left, down or "
            'up, as in "forward-left-up"'
        )
    if np.linalg.det(R_bs) < 0.0:
        raise LogError(f"{path}: axes = {spelled!r} are left-handed; those of an inertial unit are right-handed")
    return None if np.array_equal(R_bs, np.eye(3)) else R_bs


def _origin(data: Mapping[str, Any], path: Path) -> tuple[float, float] | None:
    origin = data.get("origin_deg")
    if origin is None:
        return None
    numbers = isinstance(origin, list) and all(isinstance(v, int | float) for v in origin) and len(origin) == 2
    if not numbers or not (abs(origin[0]) <= 90.0 and abs(origin[1]) <= 360.0):
        raise LogError(f"{path}: origin_deg = {origin!r} must be a latitude and a longitude in degrees")
    return float(origin[0]), float(origin[1])


def _known(data: Mapping[str, Any], path: Path) -> dict[str, Known]:
    """The table ``[instruments]``; ``[suits]`` is its older name."""
    found: dict[str, Known] = {}
    for table in ("suits", "instruments"):
        entries = data.get(table, {})
        if not isinstance(entries, dict):
            raise LogError(f"{path}: {table} must be a table: [{table}]")
        for spelled, value in entries.items():
            name = str(_OLDER_NAMES.get(spelled, spelled))
            if name == "calibration":  # dotted keys make a table of it
                if not isinstance(value, dict):
                    raise LogError(f"{path}: [{table}] calibration = {_shown(value)}: must be a table")
                found |= {f"calibration.{n}": Known(v, "log", path.name) for n, v in dict(value).items()}
                continue
            if name not in PROPERTIES and name not in parameters():
                possible = {*PROPERTIES, *parameters()}
                raise LogError(f"{path}: [{table}] {name}: no such property: {near_misses(name, possible)}")
            endless = name.endswith(("full_scale_rad_s", "full_scale_m_s2")) and value == math.inf
            if not isinstance(value, int | float) or not (_finite(value) or endless):
                raise LogError(f"{path}: [{table}] {name} = {value!r} must be a number, true or false")
            found[name] = Known(value, "log", path.name)
    withheld = data.get("withheld", [])
    if not isinstance(withheld, list):
        raise LogError(f'{path}: withheld must be a list of properties, as in withheld = ["gps_rate_hz"]')
    for name in withheld:
        if not isinstance(name, str) or name not in PROPERTIES or name in found:
            why = (
                "it has a value too" if isinstance(name, str) and name in found else near_misses(str(name), PROPERTIES)
            )
            raise LogError(f"{path}: withheld {name!r}: {why}")
        found[name] = Known(PROPERTIES[name].assumed, "withheld", path.name)
    return found


@lru_cache(maxsize=1)
def parameters() -> frozenset[str]:
    """Names of the parameters of every registered estimator that can be loaded here."""
    from dataclasses import is_dataclass

    from scenarios.harness import plugins
    from sim.params import dotted_fields

    found: set[str] = set()
    for name in plugins.estimators():
        try:
            params = plugins.params_of(name, plugins.load_estimator(name))
        except ValueError:  # one that lacks its package
            continue
        if is_dataclass(params):
            found |= set(dotted_fields(params))
    return frozenset(found)
