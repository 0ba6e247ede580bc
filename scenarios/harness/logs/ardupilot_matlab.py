"""ArduPilot's logs as MATLAB files: their messages as records, which `dataflash` reads like those of a .bin.

A message is a matrix ``IMU`` with its ``IMU_label``, as Mission Planner writes it, or a structure ``IMU`` of vectors,
as pymavlink's mavlogdump does.  Numbers are scaled already; ``LineNo`` is where a message stood in the log.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.logs import dataflash
from scenarios.harness.logs.dataflash_records import FIELDS, DataFlash, Records, own_time_s
from scenarios.harness.logs.recorded import RecordedLog

LINE = "LineNo"
Table = dict[str, Array]


class MatlabRecords(DataFlash):
    """The messages of a log in `tables`, name -> column -> values, with the interface of `DataFlash`.

    content : all variables of the file, the parameters of the autopilot among them
    """

    def __init__(self, path: Path, tables: Mapping[str, Table], content: Mapping[str, Any]) -> None:
        self.path, self.repairs = path, list[str]()
        self._records = {_plain(name): _records(_plain(name), table) for name, table in tables.items()}
        self._records |= {"PARM": _parameters(content.get("PARM")), "MSG": _texts(content.get("MSG"))}
        self._types = {name: i for i, (name, records) in enumerate(self._records.items()) if len(records.fields)}

    def records(self, name: str) -> Records:
        """All records of that name; none where there are none."""
        return self._records[name] if name in self._types else _none(name)

    def column(self, records: Records, column: str) -> Array:
        """One column in our units (angles in degrees), shape (n,)."""
        return np.asarray(records.fields[column] * FIELDS.get(column, 1.0), np.float64)


def messages(path: Path, tables: Mapping[str, Table], content: Mapping[str, Any]) -> MatlabRecords | None:
    """`tables` as records where they are the messages of an ArduPilot log; None where they are not."""
    log = MatlabRecords(path, tables, content)
    found = [r for name in ("IMU", "GYR") for r in log.instances(name) if set(dataflash.GYRO) <= set(r.columns)]
    return log if any(own_time_s(records) is not None for records in found) else None


def read(log: MatlabRecords, imu: int | None = None) -> RecordedLog:
    """The log that the messages make; LogError as `dataflash.read`."""
    return dataflash.made(log, imu)


def _plain(name: str) -> str:
    """``IMU`` of ``IMU_0``, and ``IMU2`` of ``IMU_1``, as instances are named."""
    of, _, number = name.rpartition("_")
    if not of or not number.isdigit():
        return name
    return of if number == "0" else f"{of}{int(number) + 1}"


def _records(name: str, table: Table) -> Records:
    """A table as records; columns of another length than the most are none of it."""
    lengths = [len(values) for values in table.values()]
    n = max(set(lengths), key=lengths.count)
    columns = {label: values for label, values in table.items() if len(values) == n}
    fields = np.zeros(n, np.dtype([(label, "f8") for label in columns]))
    for label, values in columns.items():
        fields[label] = values
    lines = columns.get(LINE, np.zeros(n))
    return Records(name, 0, fields, np.nan_to_num(lines).astype(np.intp))


def _none(name: str) -> Records:
    return Records(name, 0, np.zeros(0, np.dtype([])), np.zeros(0, np.intp))


def _parameters(value: Any) -> Records:
    """The parameters, of a cell array of names and values or a structure of both."""
    pairs: list[tuple[str, float]] = []
    if isinstance(value, np.ndarray) and value.dtype.names and {"Name", "Value"} <= set(value.dtype.names):
        names, numbers = np.atleast_1d(value["Name"].item()), np.atleast_1d(value["Value"].item())
        pairs = list(zip(map(str, names), map(float, numbers), strict=False))
    elif isinstance(value, np.ndarray) and value.dtype == object and value.ndim == 2 and value.shape[1] == 2:
        pairs = [(str(name), float(number)) for name, number in value]
    fields = np.zeros(len(pairs), np.dtype([("Name", "S16"), ("Value", "f8")]))
    fields["Name"] = [name.strip().encode("ascii", "replace") for name, _ in pairs]
    fields["Value"] = [number for _, number in pairs]
    return Records("PARM", 0, fields, np.zeros(len(pairs), np.intp))


def _texts(value: Any) -> Records:
    """What the autopilot announced, of a structure; a matrix holds no words."""
    if not (isinstance(value, np.ndarray) and value.dtype.names and "Message" in value.dtype.names):
        return _none("MSG")
    said: NDArray[Any] = np.atleast_1d(value["Message"].item())
    fields = np.zeros(len(said), np.dtype([("Message", "S64")]))
    fields["Message"] = [str(text).encode("ascii", "replace") for text in said]
    return Records("MSG", 0, fields, np.zeros(len(said), np.intp))
