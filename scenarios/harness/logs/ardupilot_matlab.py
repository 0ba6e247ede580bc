"""ArduPilot logs converted to MATLAB files: the messages of a DataFlash log by name, read by `dataflash`.

A message is a matrix ``IMU`` with ``IMU_label``, as Mission Planner writes it, or a structure ``IMU`` of vectors, as
pymavlink's mavlogdump writes it.  ``LineNo`` is the place of a message in the original log.  Units are ArduPilot's own:
degrees, milligauss, rad/s.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs.dataflash_records import FIELDS, Records, instances, own_time_s
from scenarios.harness.logs.recorded import LogError

INERTIAL = ("IMU", "GYR")
GYRO = ("GyrX", "GyrY", "GyrZ")
PLACE = "LineNo"
Table = dict[str, Array]


class MatlabMessages:
    """The messages of a log by name, as `dataflash_records.DataFlash` has them.

    tables : name -> label -> column      content : all variables of the file, the parameters among them
    """

    def __init__(self, path: Path, tables: Mapping[str, Table], content: Mapping[str, Any]) -> None:
        self.path, self.repairs = path, list[str]()
        self._records = {name: _records(name, table) for name, table in tables.items()}
        if parameters := _parameters(content):
            self._records["PARM"] = parameters

    def records(self, name: str) -> Records:
        """All records of that name."""
        return self._records.get(name, Records.none(name))

    def instances(self, name: str) -> list[Records]:
        """The instances of a message that have a time; see `dataflash_records.instances`."""
        found = instances(name, self.records, self._records)
        timed = [r for r in found if PLACE in r.columns or own_time_s(r) is not None]
        for r in found:
            if r not in timed:
                self.repairs.append(f"{r.name} has neither a time nor {PLACE}: {len(r.fields)} messages not read")
        return timed

    def column(self, records: Records, column: str) -> Array:
        """One column in our units (angles in degrees), shape (n,)."""
        return np.asarray(records.fields[column] * FIELDS.get(column, 1.0))

    @property
    def names(self) -> list[str]:
        """Names of the messages in the file."""
        return sorted(self._records)


def messages(path: Path, tables: Mapping[str, Table], content: Mapping[str, Any]) -> MatlabMessages | None:
    """The messages in a file with these `tables`; None if they are not from an ArduPilot log."""
    made = MatlabMessages(path, tables, content)
    found = (r for name in INERTIAL for r in instances(name, made.records, tables))
    return made if any(set(GYRO) <= set(r.columns) and own_time_s(r) is not None for r in found) else None


def _records(name: str, table: Table) -> Records:
    """A table as records; without ``LineNo`` they come before all others."""
    n = min(map(len, table.values()))
    fields = np.zeros(n, [(label, "f8") for label in table])
    for label, values in table.items():
        fields[label] = values[:n]
    place = table[PLACE][:n].astype(np.intp) if PLACE in table else np.full(n, -1, np.intp)
    return Records(name, 0, fields, place)


def _parameters(content: Mapping[str, Any]) -> Records | None:
    """The parameters of the autopilot: a cell array of names and values, or a structure with Name and Value."""
    value: Any = content.get("PARM")
    if not isinstance(value, np.ndarray):
        return None
    if value.dtype.names and {"Name", "Value"} <= set(value.dtype.names):
        pairs = list(zip(np.atleast_1d(value["Name"].item()), np.atleast_1d(value["Value"].item()), strict=False))
    elif value.dtype == object and value.ndim == 2 and value.shape[1] >= 2:
        pairs = [(row[-2], row[-1]) for row in value]  # behind a column of places or times, if there is one
    else:
        return None
    try:
        fields: NDArray[Any] = np.array(
            [(str(n).strip().encode(), float(v)) for n, v in pairs], [("Name", "S16"), ("Value", "f8")]
        )
    except (TypeError, ValueError) as error:
        raise LogError(f"PARM: {error}") from error
    return Records("PARM", 0, fields, np.full(len(fields), -1, np.intp))
