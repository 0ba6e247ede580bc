"""What the columns of a table mean: our names for them, their units and signs.

A map is a TOML file.  Its table ``[columns]`` gives each column that is used one of `QUANTITIES`, with a minus sign
where the column counts the other way, and a unit where it is not SI::

    delimiter = ";"         # of a text file; a comma unless told
    skip_lines = 2          # of a text file, before its header
    struct = "flight_data"  # of a MATLAB file: the structure that holds the columns

    [columns]
    time_ms = "time ms"
    wx = "gyro.x deg/s"
    az = "-force.z g"

    [instruments]  # what is known of them, by the names of `estimator.instruments.PROPERTIES`
    gps_latency_s = 0.2

Without a map, columns are known by the names in use (`automatic`), a unit at the end of a name included:
``gyro_x_deg_s``, ``acc_z [g]``.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimator.instruments import Known
from estimator.screening import G_M_S2
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.plugins import near_misses

MAPS = Path(__file__).with_name("maps")  # maps that come with the package, named without .toml

_DEG, _KN_M_S = np.pi / 180.0, 1852.0 / 3600.0
UNITS: dict[str, dict[str, float]] = {  # dimension -> unit -> factor to ours; the first one is ours
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rate": {"rad/s": 1.0, "deg/s": _DEG, "dps": _DEG, "mrad/s": 1e-3},
    "force": {"m/s^2": 1.0, "m/s2": 1.0, "g": G_M_S2, "mg": 1e-3 * G_M_S2},
    "field": {"uT": 1.0, "nT": 1e-3, "gauss": 100.0, "G": 100.0, "mgauss": 0.1, "mG": 0.1},
    "angle": {"rad": 1.0, "deg": _DEG, "1e-7deg": 1e-7 * _DEG},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": _KN_M_S},
    "length": {"m": 1.0, "cm": 0.01, "mm": 1e-3},
    "number": {"1": 1.0},
}


class Quantity(NamedTuple):
    """Something that a column may hold: its dimension, and names by which it goes in other people's logs."""

    dimension: str
    names: tuple[str, ...] = ()


def _vector(name: str, dimension: str, *patterns: str) -> dict[str, Quantity]:
    return {f"{name}.{a}": Quantity(dimension, tuple(p.replace("@", a) for p in patterns)) for a in "xyz"}


QUANTITIES: dict[str, Quantity] = {
    "time": Quantity("time", ("t", "time", "timestamp")),
    **_vector("gyro", "rate", "gyro_@", "gyro_b_@", "gyr_@", "gyr@", "g@", "w@", "omega_@", "angular_velocity_@"),
    **_vector(
        "force", "force", "force_@", "force_b_@", "accel_@", "acc_@", "acc@", "a@", "f@", "linear_acceleration_@"
    ),
    **_vector("mag", "field", "mag_@", "mag_b_@", "mag@", "m@", "h@", "magnetic_field_@"),
    "gps.new": Quantity("number", ("gps_new",)),
    "gps.fix": Quantity("number", ("gps_fix", "fix_type")),
    "gps.latitude": Quantity("angle", ("latitude", "lat", "gps_lat", "gps_latitude")),
    "gps.longitude": Quantity("angle", ("longitude", "lon", "lng", "gps_lon", "gps_longitude")),
    "gps.altitude": Quantity("length", ("altitude", "alt", "gps_alt", "gps_altitude")),
    "gps.n": Quantity("length", ("gps_n", "gps_p_e_n")),
    "gps.e": Quantity("length", ("gps_e", "gps_p_e_e")),
    "gps.d": Quantity("length", ("gps_d", "gps_p_e_d")),
    "gps.vn": Quantity("speed", ("gps_vn", "vn", "vel_n", "gps_v_e_n", "v_n")),
    "gps.ve": Quantity("speed", ("gps_ve", "ve", "vel_e", "gps_v_e_e", "v_e")),
    "gps.vd": Quantity("speed", ("gps_vd", "vd", "vel_d", "gps_v_e_d", "v_d")),
    "gps.speed": Quantity("speed", ("gps_speed", "ground_speed", "groundspeed")),
    "gps.course": Quantity("angle", ("gps_course", "course", "cog")),
    "airspeed": Quantity("speed", ("airspeed", "ias", "tas")),
    "height": Quantity("length", ("baro_height", "height", "baro_alt")),
    "roll": Quantity("angle", ("roll", "phi", "ref_roll", "roll_ref")),
    "pitch": Quantity("angle", ("pitch", "theta", "ref_pitch", "pitch_ref")),
    "yaw": Quantity("angle", ("yaw", "psi", "heading", "ref_yaw", "yaw_ref")),
    **{f"q{c}": Quantity("number", (f"q{c}", f"q_{c}", f"ref_q{c}", f"quat_{c}")) for c in "wxyz"},
    **{
        f"r{i}{j}": Quantity("number", (f"r{i}{j}", f"r_{'xyz'[i]}{'xyz'[j]}", f"truth_r_eb_{'xyz'[i]}{'xyz'[j]}"))
        for i in range(3)
        for j in range(3)
    },
}
INERTIAL = ("gyro.x", "gyro.y", "gyro.z", "force.x", "force.y", "force.z")
EULER = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")  # in SciPy's order
MATRIX = tuple(f"r{i}{j}" for i in range(3) for j in range(3))


class Meaning(NamedTuple):
    """What one column holds: the quantity, the factor to our unit, and whether somebody said the unit."""

    quantity: str
    factor: float = 1.0
    told: bool = True


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """The meaning of columns by their names, and how to get at them; see the module."""

    columns: Mapping[str, Meaning] = field(default_factory=dict)
    delimiter: str = ","
    skip_lines: int = 0
    struct: str = ""
    known: Mapping[str, Known] = field(default_factory=dict)
    name: str = "automatic names"


def load(spec: str | Path) -> ColumnMap:
    """The map in the TOML file `spec`, or the one of that name that comes with the package.

    Raises
    ------
    LogError      no such map, or an entry that means nothing; one line with the map and the column
    """
    path = Path(spec)
    if path.suffix != ".toml":
        path = MAPS / f"{spec}.toml"
    if not path.is_file():
        offered = sorted(p.stem for p in MAPS.glob("*.toml"))
        raise LogError(f"no column map {str(spec)!r}: {near_misses(str(spec), offered)} (one's own: a file.toml)")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise LogError(f"{path}: {error}") from error
    odd = sorted(set(data) - {"columns", "delimiter", "skip_lines", "struct", "instruments", "suits"})
    entries = data.get("columns")
    if odd or not isinstance(entries, dict):
        raise LogError(f"{path}: {f'unknown entry {odd[0]!r}' if odd else 'no table [columns]'}")
    delimiter, skip_lines, struct = data.get("delimiter", ","), data.get("skip_lines", 0), data.get("struct", "")
    if not (isinstance(delimiter, str) and len(delimiter) == 1 and isinstance(skip_lines, int) and skip_lines >= 0):
        raise LogError(f"{path}: delimiter must be one character and skip_lines a whole number, zero or more")
    columns = {column: _meaning(str(text), f"{path}: {column} = {text!r}") for column, text in entries.items()}
    known = {**data.get("suits", {}), **data.get("instruments", {})}  # [suits] is the older name
    if not all(isinstance(v, int | float) for v in known.values()):
        raise LogError(f"{path}: [instruments] must hold numbers by the names of properties")
    twice = [m.quantity for m in columns.values()]
    for quantity in twice:
        if twice.count(quantity) > 1:
            raise LogError(f"{path}: {quantity} is the meaning of two columns")
    return ColumnMap(
        columns,
        delimiter,
        skip_lines,
        str(struct),
        {n: Known(v, "log", path.name) for n, v in known.items()},
        path.stem,
    )


def _meaning(text: str, where: str) -> Meaning:
    """The meaning spelled ``-force.z g``; `where` begins the message where it is none."""
    spelled, _, unit = text.strip().partition(" ")
    quantity = spelled.removeprefix("-")
    if quantity not in QUANTITIES:
        raise LogError(f"{where}: unknown quantity {quantity!r}: {near_misses(quantity, QUANTITIES)}")
    units, unit = UNITS[QUANTITIES[quantity].dimension], unit.strip()
    if unit and unit not in units:
        raise LogError(f"{where}: unit {unit!r} of {quantity} must be one of {', '.join(units)}")
    factor = units[unit] if unit else 1.0
    return Meaning(quantity, -factor if spelled.startswith("-") else factor, bool(unit))


def automatic(header: Iterable[str]) -> ColumnMap:
    """Map of those columns of `header` that go by a name in use; the first of two with one meaning."""
    known: dict[tuple[str, str], list[str]] = {}
    for quantity, (dimension, names) in QUANTITIES.items():
        for name in (quantity.replace(".", "_"), *names):
            known.setdefault((name, dimension), []).append(quantity)
    columns: dict[str, Meaning] = {}
    taken: set[str] = set()
    for column in header:
        meaning = _recognised(column, known)
        if meaning is not None and meaning.quantity not in taken:
            taken.add(meaning.quantity)
            columns[column] = meaning
    return ColumnMap(columns)


def _recognised(column: str, known: Mapping[tuple[str, str], list[str]]) -> Meaning | None:
    plain = re.sub(r"[^a-z0-9]+", "_", column.lower()).strip("_").removeprefix("measured_")
    for dimension, units in UNITS.items():
        if (plain, dimension) in known:
            return Meaning(known[plain, dimension][0], told=False)
        for unit, factor in units.items():
            suffix = "_" + re.sub(r"[^a-z0-9]+", "_", unit.lower())
            for stem in (plain.removesuffix(suffix), re.sub(rf"{suffix}_([xyzned])$", r"_\1", plain)):
                if stem != plain and (stem, dimension) in known:
                    return Meaning(known[stem, dimension][0], factor)
    return None
