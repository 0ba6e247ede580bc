"""MATLAB files (up to version 7.2): vectors and matrices, also in structures, by a column map or by their names.

A column of a matrix is named ``name[0]``, or ``name.Label`` if an array ``name_label`` beside it holds the labels.
Files with the messages of an ArduPilot log are read as such, see `ardupilot_matlab`.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.interface import Array
from scenarios.harness.logs import ardupilot_matlab, column_groups, dataflash, foreign, tabular
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import MAPS, ColumnMap, load, matrix_of
from scenarios.harness.logs.column_names import automatic
from scenarios.harness.logs.quantities import Meaning
from scenarios.harness.logs.recorded import LogError, RecordedLog
from sim.outside import files, sandbox

LABELS = ("_label", "_labels", "_names", "_header")  # appended to the name of a matrix: the array of its column names
WIDEST = 64  # a matrix with more columns is not a table
_SAVE = "save it again with save('file.mat', '-v7')"
_OBJECTS = (
    "save its columns as arrays, for instance with S = table2struct(T, 'ToScalar', true); "
    "save('file.mat', '-struct', 'S', '-v7')"
)


def read(path: Path, columns: ColumnMap | None = None, imu: int | None = None) -> RecordedLog:
    """The log at `path`; without `columns`, by the shipped map that fits, or by its names.

    imu : which inertial unit of an autopilot's messages, from 0; by default the first one

    Raises
    ------
    LogError      one line with the file, the row and the column
    """
    content = _content(path)
    if columns is None and (messages := ardupilot_matlab.messages(path, _tables(content), content)):
        return dataflash.of_messages(messages, imu)
    if imu is not None:
        raise LogError(f"{path}: --imu chooses an inertial unit of an autopilot's log; this is not one")
    found, columns = _columns(path, content, columns or _fitting(content))
    return tabular.recorded(found, columns, Source(path, offered=_offered(found)), matrix_of)


def groups(path: Path) -> tuple[list[column_groups.Group], Source, tuple[str, ...]]:
    """Columns of the file by our names, and the source; LogError as `read`."""
    content = _content(path)
    found, meanings = _columns(path, content, _fitting(content))
    made, source = column_groups.take(found, meanings, Source(path, offered=_offered(found)), matrix_of)
    return made, source, ()


def _content(path: Path) -> dict[str, Any]:
    """The variables of a file; LogError if it cannot be read."""
    head = files.head(path, 520, "log")
    if head.startswith(b"MATLAB 7.3") or b"\x89HDF\r\n" in head:
        raise LogError(f"{path}: a MATLAB file of version 7.3 (HDF5): {_SAVE}")
    try:
        content = sandbox.call("scipy.io:loadmat", path, squeeze_me=True)
    except sandbox.TooLong:
        raise LogError(f"{path}: cannot be read: the MATLAB reader took more than {sandbox.LONGEST_S:g} s") from None
    except sandbox.TooLarge as error:
        size, most = files.size(path.stat().st_size), files.size(int(str(error)))
        raise LogError(f"{path}: {size}, but its content needs more than {most}: damaged, or no log") from None
    except sandbox.Crashed:
        raise LogError(f"{path}: cannot be read: the MATLAB reader crashed on it (the file is damaged)") from None
    except sandbox.Failed as error:  # scipy raises many kinds of errors for damaged files
        found = foreign.hint(head) if head else "an empty file"
        if found and not head.startswith(b"MATLAB"):
            raise LogError(f"{path}: not a MATLAB file; this is {found}") from None
        raise LogError(f"{path}: cannot be read as a MATLAB file: {error}") from None
    content = {name: v for name, v in content.items() if not name.startswith("__")}
    objects = [name for name, v in content.items() if type(v).__name__ in ("MatlabOpaque", "MatlabFunction")]
    if objects and not any(np.asarray(v).dtype.kind in "fiubV" for n, v in content.items() if n not in objects):
        names = ", ".join(name for name in objects if name != "None") or "it"
        raise LogError(f"{path}: {names} holds MATLAB objects (tables, time series, maps): {_OBJECTS}")
    return {name: v for name, v in content.items() if name not in objects}


def _fitting(content: Mapping[str, Any]) -> ColumnMap:
    """The shipped map whose structure and columns are in `content`; an empty one if none fits."""
    for known in map(load, sorted(MAPS.glob("*.toml"))):
        names = getattr(getattr(content.get(known.struct), "dtype", None), "names", None) or ()
        if known.columns and set(known.columns) <= set(names):
            return known
    return ColumnMap()


def _tables(content: Mapping[str, Any]) -> dict[str, dict[str, Array]]:
    """Matrices with labels, and structures of vectors: name -> label -> column."""
    tables: dict[str, dict[str, Array]] = {}
    for name, value in content.items():
        labels = _labels(name, content)
        if labels and (matrix := _matrix(value, len(labels))) is not None:
            tables[name] = dict(zip(labels, matrix.T, strict=True))
        elif _is_struct(value):
            fields = {field: np.asarray(value[field].item()) for field in value.dtype.names}
            columns = {f: v.astype(np.float64) for f, v in fields.items() if v.ndim == 1 and v.dtype.kind in "fiub"}
            if columns:
                tables[name] = columns
            else:  # a structure of messages
                tables |= {n: t for n, t in _tables({f: v.item() for f, v in fields.items() if v.size == 1} | {
                    f: v for f, v in fields.items() if v.size != 1}).items() if n not in tables}  # fmt: skip
    return tables


def _labels(name: str, content: Mapping[str, Any]) -> list[str]:
    """Column names of the matrix `name`, from a cell array or a matrix of characters; empty without one."""
    value = next((content[f"{name}{end}"] for end in LABELS if f"{name}{end}" in content), None)
    if value is None or np.asarray(value).dtype.kind not in "UO":
        return []
    cells = np.atleast_1d(np.asarray(value)).ravel()
    return [str(np.asarray(cell).item() if np.asarray(cell).size == 1 else cell).strip() for cell in cells]


def _matrix(value: Any, columns: int = 0) -> Array | None:
    """A matrix of numbers with a row per sample, shape (n, `columns`); None for anything else."""
    matrix = np.asarray(value)
    if matrix.dtype.kind not in "fiub" or matrix.ndim not in (1, 2):
        return None
    if matrix.ndim == 1:  # of one row, or of one column
        matrix = matrix[None, :] if columns == len(matrix) else matrix[:, None]
    if (columns and matrix.shape[1] != columns) or (not columns and matrix.shape[0] < matrix.shape[1]):
        matrix = matrix.T
    if matrix.shape[1] > WIDEST or (columns and matrix.shape[1] != columns):
        return None
    return matrix.astype(np.float64)


def _is_struct(value: Any) -> bool:
    return isinstance(value, np.ndarray | np.void) and value.dtype.names is not None and value.size == 1


def _columns(path: Path, content: dict[str, Any], how: ColumnMap) -> tuple[dict[str, Array], ColumnMap]:
    """All numeric columns by name, and what they mean."""
    at = ""
    for name in filter(None, how.struct.split(".")):
        if name not in content:
            raise LogError(f"{path}: no structure {how.struct!r}; it has {', '.join(content) or 'nothing'}")
        if not _is_struct(content[name]):
            raise LogError(f"{path}: {name!r} is not a structure")
        content = {field: content[name][field].item() for field in content[name].dtype.names}
        at = f" of {how.struct}"
    columns = dict(_flat(content))
    if not columns:
        shown = ", ".join(f"{name} ({_shape(v)})" for name, v in content.items()) or "nothing"
        raise LogError(f"{path}: no column of numbers{at}; it has {shown}")
    if not how.columns:
        found, rivals = _recognised(columns)
        how = replace(how, columns=found, rivals=rivals)
    if not how.columns:
        raise LogError(
            f"{path}: no column name is recognised; it has {', '.join(_offered(columns))}: name them in a column "
            'map (--columns MAP.toml), a column of a matrix as "name[0]"'
        )
    return columns, how


def _recognised(columns: Mapping[str, Array]) -> tuple[dict[str, Meaning], dict[str, tuple[str, ...]]]:
    """Meanings of the columns by their names, matrix by matrix, as each has its own times.

    A name is tried with that of its structure (``imu.gyro[0]``), then without it (``flight.p``).
    """
    parts: dict[tuple[str, int], list[str]] = {}
    for name, values in columns.items():
        parts.setdefault((matrix_of(name.partition("[")[0]), len(values)), []).append(name)
    chosen, rivals = dict[str, Meaning](), dict[str, tuple[str, ...]]()
    owner: dict[str, str] = {}
    for (prefix, _), names in parts.items():
        found, competing = automatic(names)
        short = {name.removeprefix(f"{prefix}."): name for name in names if name not in found}
        taken = {m.quantity for m in found.values()}
        local, _ = automatic(short)
        found |= {short[name]: m for name, m in local.items() if m.quantity not in taken}
        rivals |= competing
        for name, meaning in found.items():
            other = owner.setdefault(meaning.quantity, name)
            if other == name or meaning.quantity == "time":
                chosen[name] = meaning
            else:
                rivals[meaning.quantity] = other, name
    return chosen, rivals


def _flat(content: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Array]]:
    """Vectors, and columns of matrices by index and by label; those in structures have dotted names."""
    found: list[tuple[str, Array]] = []
    for name, value in content.items():
        if _is_struct(value):
            value = np.atleast_1d(value)[0]
            inner = {field: value[field] for field in value.dtype.names}
            inner = {f: v.item() if isinstance(v, np.ndarray) and v.dtype == object and v.size == 1 else v
                     for f, v in inner.items()}  # fmt: skip
            found += _flat(inner, f"{prefix}{name}.")
            continue
        matrix = _matrix(value) if not isinstance(value, str) else None
        if matrix is None or len(matrix) < 2:
            continue
        if matrix.shape[1] == 1:
            found.append((f"{prefix}{name}", matrix[:, 0]))
            continue
        labels = _labels(name, content)
        if labels and (labelled := _matrix(value, len(labels))) is not None:
            found += [(f"{prefix}{name}.{label}", column) for label, column in zip(labels, labelled.T, strict=True)]
        found += [(f"{prefix}{name}[{j}]", column) for j, column in enumerate(matrix.T)]
    return found


def _offered(columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Column names for a message; those of a matrix without labels are summarised."""
    short: dict[str, int] = {}
    for name in columns:
        of = matrix_of(name) if name.endswith("]") else name
        short[of] = short.get(of, 0) + 1
    labelled = {matrix_of(name) for name in columns if not name.endswith("]")}
    return tuple(
        f"{name}[0] to [{n - 1}]" if f"{name}[0]" in columns else name
        for name, n in short.items()
        if not (f"{name}[0]" in columns and name in labelled)
    )


def _shape(value: Any) -> str:
    return " x ".join(str(n) for n in np.shape(value)) or type(value).__name__
