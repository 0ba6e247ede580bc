"""MATLAB files (up to version 7.2) by a column map: vectors of one length, in a structure or at the top."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat  # type: ignore[import-untyped]

from estimator.interface import Array
from scenarios.harness.logs import tabular
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import MAPS, ColumnMap, automatic, load
from scenarios.harness.logs.recorded import LogError, RecordedLog


def read(path: Path, columns: ColumnMap | None = None) -> RecordedLog:
    """The log at `path`; without `columns`, by the map that comes with the package and fits, or by its names.

    Raises
    ------
    LogError      one line with the file, the row and the column
    """
    try:
        content = {name: v for name, v in loadmat(path, squeeze_me=True).items() if not name.startswith("__")}
    except Exception as error:  # scipy raises whatever its parser meets in a file cut off or foreign
        raise LogError(f"{path}: cannot be read as a MATLAB file: {' '.join(str(error).split())}") from error
    if columns is None:
        columns = next((known for known in map(load, sorted(MAPS.glob("*.toml"))) if _fits(content, known)), None)
    table = _columns(path, content, columns.struct if columns else "")
    return tabular.recorded(table, columns or automatic(table), Source(path))


def _fits(content: dict[str, Any], known: ColumnMap) -> bool:
    struct = content.get(known.struct)
    names = getattr(getattr(struct, "dtype", None), "names", None) or ()
    return set(known.columns) <= set(names)


def _columns(path: Path, content: dict[str, Any], struct: str) -> dict[str, Array]:
    """The vectors of the longest common length in the structure of that dotted name, or at the top."""
    for name in filter(None, struct.split(".")):
        if name not in content:
            raise LogError(f"{path}: no structure {struct!r}; it has {', '.join(content) or 'nothing'}")
        record = np.asarray(content[name])
        if record.dtype.names is None:
            raise LogError(f"{path}: {name!r} is no structure")
        content = {field: record[field].item() for field in record.dtype.names}
    vectors = {name: np.asarray(v) for name, v in content.items()}
    vectors = {name: v for name, v in vectors.items() if v.ndim == 1 and v.dtype.kind in "fiub" and len(v) > 1}
    if not vectors:
        raise LogError(f"{path}: no column of numbers; it has {', '.join(content)}: name the structure in a column map")
    return {name: v.astype(np.float64) for name, v in vectors.items()}
