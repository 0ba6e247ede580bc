"""Estimators in C, C++, Rust or any language that builds a shared library: ``--estimator ./mine.so``.

The interface is ``wingslevel/include/wingslevel_estimator.h``; the structs here are its structs.  `class_of_library`
makes a class of a library: its parameters are the fields of a frozen dataclass, an instance is one object of the
library.  To the rest of the program it is an estimator like any other; docs/c_estimators.md is the user's page.

The library runs in our process.  One that crashes ends it, which costs its flight only: see `scenarios.harness.gate`.
"""

import ctypes
import keyword
import platform
import shutil
import sys
import tempfile
import weakref
from ctypes import POINTER, c_char_p, c_double, c_int32, c_uint32, c_uint64, c_void_p
from dataclasses import field, make_dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.instruments import BOOLEAN
from estimator.interface import (
    MEASURED_DTYPE,
    AttitudeEstimate,
    HeadingReference,
    Health,
    ImuSample,
    Instrument,
    Measurements,
)
from scenarios.harness.own_files import Library
from sim.outside.blame import Refused
from sim.outside.wording import printable

ABI_VERSION = 2
FUNCTIONS = ("describe", "create", "reset", "update", "destroy")
STATIC_STATE = 1  # bit of the description's flags
_REFERENCES: tuple[HeadingReference, ...] = ("course", "nose")  # by number, as the header has them
_INSTRUMENTS: tuple[Instrument, ...] = ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")  # by bit
_MOST_PARAMETERS, _MESSAGE_BYTES = 1000, 400
_HEALTH = tuple(Health)
_MACHINES = {3: "x86", 40: "arm", 62: "x86_64", 183: "aarch64", 243: "riscv"}  # e_machine of an ELF file
_ALIASES = {"amd64": "x86_64", "arm64": "aarch64", "i386": "x86", "i686": "x86", "armv7l": "arm", "riscv64": "riscv"}


class _Parameter(ctypes.Structure):
    """``wingslevel_parameter``."""

    _fields_ = (("name", c_char_p), ("unit", c_char_p), ("default_value", c_double), ("doc", c_char_p))


class _Description(ctypes.Structure):
    """``wingslevel_description``."""

    _fields_ = (
        ("struct_size", c_uint32), ("abi_version", c_uint32), ("name", c_char_p), ("doc", c_char_p),
        ("heading_reference", c_uint32), ("uses", c_uint32), ("flags", c_uint32), ("parameter_size", c_uint32),
        ("parameter_count", c_uint64), ("parameters", c_void_p),
    )  # fmt: skip


# The columns of ``wingslevel_measurements`` in its order; version 2 renamed the airspeed, in its place.
_COLUMNS = (
    "t_s", "dt_s", "gyro_b_rad_s", "force_b_m_s2", "gps_new", "gps_valid", "gps_t_s", "gps_p_e_m", "gps_v_e_m_s",
    "gps_course_rad", "gps_speed_m_s", "mag_new", "mag_b_ut", "air_new",
    "equivalent_airspeed_m_s", "baro_height_m",
)  # fmt: skip
MEASUREMENTS = np.dtype(
    [("struct_size", "u4"), ("reserved", "u4"), *((name, MEASURED_DTYPE[name]) for name in _COLUMNS)], align=True
)
# ``wingslevel_estimate``.
ESTIMATE = np.dtype([
    ("struct_size", "u4"), ("health", "u4"), ("R_eb", "f8", (3, 3)), ("omega_b_rad_s", "f8", (3,)),
    ("gyro_bias_b_rad_s", "f8", (3,)), ("wind_e_m_s", "f8", (3,)), ("rejected", "i8"),
], align=True)  # fmt: skip
_BLANK = np.zeros(1, ESTIMATE)  # what an estimate is before the library writes on it
_BLANK["struct_size"], _BLANK["health"], _BLANK["rejected"] = ESTIMATE.itemsize, Health.GOOD, -1
_BLANK["R_eb"] = _BLANK["wind_e_m_s"] = np.nan
_EMPTY = _BLANK.tobytes()


class _Functions(NamedTuple):
    """A loaded library and its five functions."""

    library: ctypes.CDLL
    describe: Any
    create: Any
    reset: Any
    update: Any
    destroy: Any


class _Described(NamedTuple):
    """What a description says, checked, in Python's terms."""

    name: str
    doc: str
    heading_reference: HeadingReference
    uses: tuple[Instrument, ...]
    static_state: bool
    parameters: tuple[tuple[str, str, float, str], ...]  # name, unit, default, doc


class CEstimator:
    """An estimator of a shared library; `class_of_library` makes the class of each one.

    The object of the library is destroyed with this one.
    """

    heading_reference: ClassVar[HeadingReference]
    uses: ClassVar[tuple[Instrument, ...]]
    file: ClassVar[Library]
    Params: ClassVar[type]
    _functions: ClassVar[_Functions]
    _static_state: ClassVar[bool]

    def __init__(self, params: Any = None) -> None:
        self.params = params if params is not None else self.Params()
        functions = _private_copy(self.file) if self._static_state else self._functions
        names = list(self.Params.__dataclass_fields__)  # type: ignore[attr-defined]
        values = (c_double * max(len(names), 1))(*(float(getattr(self.params, name)) for name in names))
        message = ctypes.create_string_buffer(_MESSAGE_BYTES)
        self._object = functions.create(values, message, _MESSAGE_BYTES)
        if not self._object:
            raise Refused(f"{self.file.path.name}: {_text(message.value) or 'create returned null and gave no reason'}")
        destroyed = weakref.finalize(self, _destroy, functions, self._object, self._static_state)
        destroyed.atexit = False  # a process that ends needs no more of their code
        self._reset, self._update = functions.reset, functions.update
        self._measured = np.zeros(1, MEASUREMENTS)
        self._measured["struct_size"] = MEASUREMENTS.itemsize
        self._answer = _BLANK.copy()
        self._into, self._from = self._measured.ctypes.data, self._answer.ctypes.data
        self._question, self._reply = (struct.view(np.uint8).data for struct in (self._measured, self._answer))
        self._R_eb, self._omega_b_rad_s, self._gyro_bias_b_rad_s, self._wind_e_m_s = (
            self._answer[name][0] for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "wind_e_m_s")
        )
        at = {name: self._from + offset for name, (_, offset, *_) in ESTIMATE.fields.items()}  # type: ignore[union-attr]
        self._health, self._wind_n_m_s = c_uint32.from_address(at["health"]), c_double.from_address(at["wind_e_m_s"])
        self._rows: NDArray[Any] = np.zeros(0, MEASURED_DTYPE)
        self._runs: tuple[tuple[int, int, int], ...] = ()

    def reset(self, on_ground: ImuSample | None = None) -> None:
        """Power up, with the mean sample at rest, or None where the flight starts in the air."""
        self._answer["rejected"] = -1
        if on_ground is None:
            self._reset(self._object, None)
            return
        sample = np.zeros(1, MEASUREMENTS)
        sample["struct_size"] = MEASUREMENTS.itemsize
        for name, value in on_ground._asdict().items():
            sample[name] = value
        self._reset(self._object, sample.ctypes.data)

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Hand the library a copy of row `k`; its answer, in arrays that are the caller's to keep."""
        if m.rows is not self._rows:
            self._attach(m.rows)
        if not 0 <= m.k < len(self._rows):
            raise IndexError(f"row {m.k} of {len(self._rows)}")
        row = m.k * self._stride
        for to, start, size in self._runs:
            self._question[to : to + size] = self._bytes[row + start : row + start + size]
        self._reply[:] = _EMPTY
        status = self._update(self._object, self._into, self._from)
        if status:
            raise Refused(f"update returned {status}; it must return 0")
        health, wind_n_m_s = self._health.value, self._wind_n_m_s.value
        return AttitudeEstimate(
            self._R_eb.copy(),
            self._omega_b_rad_s.copy(),
            self._gyro_bias_b_rad_s.copy(),
            None if wind_n_m_s != wind_n_m_s else self._wind_e_m_s.copy(),  # NaN is not itself
            _HEALTH[health] if health < len(_HEALTH) else health,  # type: ignore[arg-type]
        )

    @property
    def rejected(self) -> int | None:
        """Ticks in which a sample was rejected, since the reset; None if the library does not count them."""
        rejected = int(self._answer["rejected"][0])
        return rejected if rejected >= 0 else None

    def _attach(self, rows: NDArray[Any]) -> None:
        """Note where the columns are in `rows`, as few runs of bytes as there are between rows and struct."""
        self._rows, self._stride = rows, rows.strides[0]
        size = max(len(rows) - 1, 0) * self._stride + rows.itemsize
        self._bytes = memoryview((ctypes.c_ubyte * size).from_address(rows.ctypes.data)).cast("B")  # NumPy's are slower
        runs: list[tuple[int, int, int]] = []
        for name in _COLUMNS:
            to, start = MEASUREMENTS.fields[name][1], rows.dtype.fields[name][1]  # type: ignore[index]
            size = MEASUREMENTS[name].itemsize
            if runs and (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]) == (to, start):
                runs[-1] = (*runs[-1][:2], runs[-1][2] + size)
            else:
                runs.append((to, start, size))
        self._runs = tuple(runs)


def class_of_library(file: Library) -> type[CEstimator]:
    """The class of the estimator in a shared library.

    Raises
    ------
    Refused      in one line: no such file, no library, one for another machine or version of the interface, a function
                 that is missing, or a description that cannot be used
    """
    functions = _loaded(file.path, file)
    described = _described(functions, file)
    params: Any = make_dataclass(
        "Params",
        [
            (name, bool, field(default=bool(default))) if name in BOOLEAN else
            (name, float, field(default=default))
            for name, unit, default, doc in described.parameters
        ],
        frozen=True,
    )  # fmt: skip
    lines = [f"{name} : {unit}  {doc}" for name, unit, _, doc in described.parameters]  # as `harness.parameters` reads
    params.__doc__ = "\n".join([f"Parameters of {file.path.name}.", "", *lines])
    members = {
        "__doc__": described.doc or f"The estimator of {file.path.name}.",
        "__module__": __name__,
        "heading_reference": described.heading_reference,
        "uses": described.uses,
        "file": file,
        "Params": params,
        "_functions": functions,
        "_static_state": described.static_state,
    }
    return type(described.name, (CEstimator,), members)


def _destroy(functions: _Functions, instance: int, unload: bool) -> None:
    functions.destroy(instance)
    if unload and sys.platform != "win32":
        import _ctypes

        _ctypes.dlclose(functions.library._handle)


def _private_copy(file: Library) -> _Functions:
    """The functions of a copy of the library that has static variables of its own."""
    folder = Path(tempfile.mkdtemp(prefix="wingslevel_"))
    try:
        return _loaded(Path(shutil.copy(file.path, folder)), file)
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # what is loaded needs its file no more; Windows keeps it


def _loaded(path: Path, file: Library) -> _Functions:
    if not path.is_file():
        raise Refused(f"no file {str(path)!r}")
    _check_kind(path)
    try:
        library = ctypes.CDLL(str(path.resolve()))
    except OSError as error:
        raise Refused(f"cannot be loaded: {printable(str(error))}") from None
    found: list[Any] = []
    for name in FUNCTIONS:
        try:
            found.append(library[f"{file.prefix}_{name}"])
        except AttributeError:
            raise Refused(
                f"{path.name} has no function {file.prefix}_{name}: declare all five with "
                f"WINGSLEVEL_ESTIMATOR({file.prefix}), or name another prefix, {path.name}:prefix"
            ) from None
    functions = _Functions(library, *found)
    functions.describe.argtypes, functions.describe.restype = [c_uint32], POINTER(_Description)
    functions.create.argtypes, functions.create.restype = [POINTER(c_double), c_char_p, c_uint64], c_void_p
    functions.reset.argtypes, functions.reset.restype = [c_void_p, c_void_p], None
    functions.update.argtypes, functions.update.restype = [c_void_p, c_void_p, c_void_p], c_int32
    functions.destroy.argtypes, functions.destroy.restype = [c_void_p], None
    return functions


def _check_kind(path: Path) -> None:
    """Refuse what is not a shared library, or one for another processor, in better words than the loader has."""
    with path.open("rb") as file:
        head = file.read(20)
    if head[:4] != b"\x7fELF":
        if sys.platform == "linux":
            raise Refused(f"{path.name} is not a shared library: build one with cc -shared -fPIC")
        return
    order: Any = "little" if head[5:6] != b"\x02" else "big"
    machine = int.from_bytes(head[18:20], order)
    ours = platform.machine().lower()
    ours = _ALIASES.get(ours, ours)
    if machine in _MACHINES and ours in _MACHINES.values() and _MACHINES[machine] != ours:
        raise Refused(f"{path.name} is built for {_MACHINES[machine]}, this machine is {ours}")


def _described(functions: _Functions, of: Library) -> _Described:
    """The description that the library gives; Refused if it is invalid."""
    file, pointer = of.path.name, functions.describe(ABI_VERSION)
    again = "rebuild it with the header in `python -m wingslevel.include`"
    if not pointer:
        raise Refused(f"{file} does not offer version {ABI_VERSION} of the interface: {again}")
    d = pointer.contents
    if not 1 <= d.abi_version <= ABI_VERSION:
        raise Refused(f"{file} is built for version {d.abi_version} of the interface, not {ABI_VERSION}: {again}")
    if d.struct_size < ctypes.sizeof(_Description) or d.parameter_size < ctypes.sizeof(_Parameter):
        raise Refused(f"{file} describes itself in {d.struct_size} and {d.parameter_size} bytes, too few: {again}")
    if d.heading_reference >= len(_REFERENCES):
        raise Refused(f"{file}: heading_reference is {d.heading_reference}; it must be 0 (course) or 1 (nose)")
    if d.uses >> len(_INSTRUMENTS):
        raise Refused(f"{file}: uses is {d.uses:#x}; it must be made of the bits of {', '.join(_INSTRUMENTS)}")
    if d.parameter_count > _MOST_PARAMETERS or (d.parameter_count and not d.parameters):
        raise Refused(f"{file}: {d.parameter_count} parameters; at most {_MOST_PARAMETERS} are possible")
    name = _identifier(file, "name", d.name)
    parameters: list[tuple[str, str, float, str]] = []
    for i in range(d.parameter_count):
        p = _Parameter.from_address(d.parameters + i * d.parameter_size)
        parameter = _identifier(file, f"parameter {i}", p.name)
        if parameter in [name for name, *_ in parameters]:
            raise Refused(f"{file}: two parameters are called {parameter}")
        unit = "switch" if parameter in BOOLEAN else _text(p.unit).replace(" ", "_") or "-"
        parameters.append((parameter, unit, float(p.default_value), _text(p.doc)))
    uses = tuple(name for bit, name in enumerate(_INSTRUMENTS) if d.uses >> bit & 1)
    static = bool(d.flags & STATIC_STATE)
    return _Described(name, _text(d.doc), _REFERENCES[d.heading_reference], uses, static, tuple(parameters))


def _identifier(file: str, what: str, text: bytes | None) -> str:
    name = _text(text)
    if not name.isidentifier() or keyword.iskeyword(name):
        raise Refused(f"{file}: {what} is called {name!r}; it must be an identifier of letters, digits and _")
    return name


def _text(text: bytes | None) -> str:
    return printable((text or b"").decode("utf-8", "backslashreplace"))
