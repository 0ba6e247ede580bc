"""A flight as a table of columns: those of the recording, and what people plot."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from numpy.typing import NDArray

from autopilot.interface import Mode
from estimator.interface import Health
from estimator.rotation import to_euler
from sim.log import Phase
from sim.recording import elements

if TYPE_CHECKING:
    import pandas as pd

    from wingslevel._flight import Flight

_NAMED = (
    ("truth.phase_name", "truth", "phase", Phase, "where in its life the flight is"),
    ("flown.health_name", "flown", "health", Health, "what the estimator says of itself"),
    ("flown.mode_name", "flown", "mode", Mode, "mode of the autopilot"),
)


class _Column(NamedTuple):
    name: str
    values: Any
    meaning: str


def to_arrow(flight: "Flight") -> pa.Table:
    """The columns of `flight`; each field says what it means."""
    columns = [*_added(flight), *_recorded(flight)]
    arrays = [pa.array(column.values) for column in columns]
    fields = [
        pa.field(column.name, array.type, metadata={"meaning": column.meaning})
        for column, array in zip(columns, arrays, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields))


def to_pandas(table: pa.Table) -> "pd.DataFrame":
    """`table` as a DataFrame; names of modes and phases are categories.

    Raises
    ------
    ImportError     pandas is not installed
    """
    require_pandas()
    frame: pd.DataFrame = table.to_pandas()
    return frame


def require_pandas() -> None:
    """Raise an ImportError of one line where pandas is missing."""
    try:
        import pandas  # noqa: F401 - whether it is there
    except ImportError as error:
        raise ImportError('to_pandas() requires pandas: pip install "wingslevel[pandas]"', name="pandas") from error


def _added(flight: "Flight") -> Iterator[_Column]:
    yield _Column("t_s", flight.t_s - flight.release_s, "time since the release, end of the tick")
    for table, whose in (("truth", "true"), ("flown", "estimated")):
        angles = np.degrees(to_euler(np.asarray(getattr(flight, table)["R_eb"])))
        for name, values, meaning in zip(
            ("roll_deg", "pitch_deg", "heading_deg"),
            (angles[0], angles[1], angles[2] % 360.0),
            ("right wing down, -180..180", "nose up, -90..90", "from north over east, 0..360"),
            strict=True,
        ):
            yield _Column(f"{table}.{name}", values, f"{whose} {name.removesuffix('_deg')} angle, {meaning}")
    yield _Column("inclination_error_deg", flight.inclination_error_deg, "between the estimated and the true vertical")
    yield _Column("heading_error_deg", flight.heading_error_deg, "0..180, NaN where not judged")
    for name, table, column, names, meaning in _NAMED:
        yield _Column(name, _names(getattr(flight, table)[column], names), meaning)


def _names(numbers: NDArray[Any], names: Any) -> pa.DictionaryArray:
    """Names of numbers, lower case; a number that has none is null."""
    words = {int(member): member.name.lower() for member in names}
    index = np.full(len(numbers), -1)
    for i, value in enumerate(words):
        index[numbers == value] = i
    return pa.DictionaryArray.from_arrays(pa.array(index, pa.int8(), mask=index < 0), list(words.values()))


def _recorded(flight: "Flight") -> Iterator[_Column]:
    for e in elements():
        values = np.ascontiguousarray(getattr(flight, e.table)[e.column.name][(slice(None), *e.at)])
        yield _Column(e.name, values, e.column.meaning)
