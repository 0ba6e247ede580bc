"""The structure of GPS fixes, its origin in place and time, and the problems found in a file.

Times are integer nanoseconds of UTC while writing and reading, so that no digits are lost.  The simulated sea is the
WGS 84 ellipsoid: heights above both are equal.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import place as place_of
from sim.place import ELEVATION_M, LATITUDE_DEG, LONGITUDE_DEG, YEAR
from sim.recording import replacing

Array = NDArray[np.float64]
NAN: Final = float("nan")
NS: Final = 1_000_000_000  # in a second
EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


class Place(NamedTuple):
    """Origin of the local north-east-down frame, `height_m` above the WGS 84 ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


LAUNCH: Final = Place(LATITUDE_DEG, LONGITUDE_DEG, ELEVATION_M)
_NEW_YEAR: Final = datetime(int(YEAR), 1, 1, tzinfo=UTC)
START: Final = _NEW_YEAR + YEAR % 1.0 * (datetime(int(YEAR) + 1, 1, 1, tzinfo=UTC) - _NEW_YEAR)
"""Default time of power-up: fixed, so that the same flight gives the same file."""

SATELLITES: Final = 12
"""Number of satellites in written fixes: none are simulated, but readers reject fixes with too few."""


class Accuracy(NamedTuple):
    """One sigma of a receiver, NaN if unknown: horizontal (both axes), vertical, speed."""

    horizontal_m: float = NAN
    vertical_m: float = NAN
    speed_m_s: float = NAN


@dataclass(frozen=True, slots=True)
class Fixes:
    """Fixes in order of arrival, NaN for unknown values.

    t_s : shape (n,)            validity time, the receiver's stamp
    arrival_s : shape (n,)      time of arrival; not part of any message
    p_e_m, v_e_m_s : shape (n, 3)   north, east, down
    course_rad, speed_m_s : shape (n,)   over ground, clockwise from north; horizontal
    horizontal_acc_m, vertical_acc_m, speed_acc_m_s, course_acc_rad : shape (n,)   the receiver's own estimates
    satellites : shape (n,)     number used
    """

    t_s: Array
    arrival_s: Array
    p_e_m: Array
    v_e_m_s: Array
    course_rad: Array
    speed_m_s: Array
    horizontal_acc_m: Array
    vertical_acc_m: Array
    speed_acc_m_s: Array
    course_acc_rad: Array
    satellites: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.t_s)

    @classmethod
    def from_log(cls, measured: NDArray[Any], accuracy: Accuracy = Accuracy()) -> "Fixes":  # noqa: B008 - immutable
        """The fixes that arrived in the rows `measured` of a log, from a receiver of known `accuracy`.

        The uncertainty of the course is that of the cross-track speed over the speed.  A fix without time stamp, as in
        many recorded logs, gets its time of arrival: a message without time would mean no fix.
        """
        rows = measured[measured["gps_new"] == 1]
        n = len(rows)
        return cls(
            t_s=np.where(np.isfinite(rows["gps_t_s"]), rows["gps_t_s"], rows["t_s"]),
            arrival_s=rows["t_s"].copy(),
            **{name: rows[f"gps_{name}"].copy() for name in ("p_e_m", "v_e_m_s", "course_rad", "speed_m_s")},
            horizontal_acc_m=np.full(n, accuracy.horizontal_m),
            vertical_acc_m=np.full(n, accuracy.vertical_m),
            speed_acc_m_s=np.full(n, accuracy.speed_m_s),
            course_acc_rad=np.arctan2(accuracy.speed_m_s, rows["gps_speed_m_s"]),
            satellites=np.full(n, SATELLITES),
        )


Kind = Literal[
    "checksum",  # damaged message: dropped
    "malformed",  # invalid message: dropped
    "truncated",  # the end of the file is missing
    "no time",  # message without time: dropped
    "no fix",  # the receiver had none: dropped
    "repeated",  # second message for the same time: dropped
    "out of order",  # fix older than one before it: sorted
    "no height",  # kept, down is NaN
    "no speed",  # kept, course, speed and velocity are NaN
    "no course",  # kept, course is NaN, and so is the velocity unless zero
]


class Problem(NamedTuple):
    """A message dropped, repaired or incomplete, and its place in the file."""

    kind: Kind
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.where}: {self.kind}: {self.text}"


@dataclass(frozen=True, slots=True)
class Reading:
    """Contents of a file: its fixes in order of time, and its problems.

    place, start : origin and zero of time of `fixes`, as given or of the first fix
    ignored : number of other messages        problems : of messages about fixes
    """

    fixes: Fixes
    place: Place
    start: datetime
    ignored: int
    problems: tuple[Problem, ...]

    def count(self, kind: Kind) -> int:
        """Number of problems of that kind."""
        return sum(problem.kind == kind for problem in self.problems)


@dataclass(slots=True)
class Epoch:
    """One fix under construction from its messages."""

    where: str
    latitude_deg: float = NAN
    longitude_deg: float = NAN
    height_m: float = NAN
    v_e_m_s: tuple[float, float, float] = (NAN, NAN, NAN)
    course_deg: float = NAN
    speed_m_s: float = NAN
    accuracy: tuple[float, float, float, float] = (NAN, NAN, NAN, NAN)  # of m, m, m/s and deg
    satellites: int = 0
    void: bool = False
    seen: set[str] = field(default_factory=set)


def needed(package: str) -> Any:
    """The optional `package`; ValueError with what to install if it is missing."""
    try:
        return import_module(package)
    except ImportError as error:
        raise ValueError(f'{package} is not installed: pip install "wingslevel[logs]"') from error


def utc_ns(start: datetime) -> int:
    """Nanoseconds of UTC since 1970 at `start`; ValueError if it has no time zone."""
    if start.tzinfo is None:
        raise ValueError(f"start = {start.isoformat()}: add a time zone, for instance {start.isoformat()}Z")
    return (start - EPOCH) // timedelta(microseconds=1) * 1000


def stamps_ns(fixes: Fixes, start: datetime) -> list[int | None]:
    """UTC of each fix, None if it has no time; ValueError if outside the two-digit years of NMEA."""
    zero = utc_ns(start)
    stamps = [zero + round(t * NS) if np.isfinite(t) else None for t in fixes.t_s.tolist()]
    known = [stamp for stamp in stamps if stamp is not None]
    if known and (min(known) < _FIRST_NS or max(known) >= _END_NS):
        raise ValueError(
            f"start = {start.isoformat()}, with t_s of {np.nanmin(fixes.t_s):g} to {np.nanmax(fixes.t_s):g} s: "
            "must be between 6 January 1980, the start of GPS, and the end of 2068, that of two-digit years"
        )
    return stamps


_FIRST_NS: Final = utc_ns(datetime(1980, 1, 6, tzinfo=UTC))
_END_NS: Final = utc_ns(datetime(2069, 1, 1, tzinfo=UTC))


def date_time(ns: int) -> datetime:
    """UTC as date and time, rounded down to a microsecond."""
    return EPOCH + timedelta(microseconds=ns // 1000)


def checked(place: Place) -> Place:
    """`place`; ValueError if it is invalid."""
    if not (abs(place.latitude_deg) <= 90.0 and abs(place.longitude_deg) <= 180.0 and np.isfinite(place.height_m)):
        raise ValueError(f"{place}: latitude must be -90..90 deg, longitude -180..180 deg, height a number of metres")
    return place


def geodetic(p_e_m: Array, place: Place) -> Array:
    """Latitude, longitude (deg) and height (m) of positions of shape (n, 3), by the convention of `sim.place`.

    If down is NaN, so is the height, and the rest is computed at the level of the place; if north or east is, all are.
    """
    there = np.full_like(p_e_m, NAN)
    known = np.isfinite(p_e_m[:, :2]).all(axis=1)
    if known.any():
        n_m, e_m, d_m = p_e_m[known].T
        d_m = np.where(np.isfinite(d_m), d_m, 0.0)
        there[known] = place_of.geodetic(np.column_stack((n_m, e_m, d_m)), *checked(place))
    there[~np.isfinite(p_e_m[:, 2]), 2] = NAN
    return there


def read(
    file: str | Path, decode: Callable[[bytes, Place | None, datetime | None], Reading], place: Place | None,
    start: datetime | None,
) -> Reading:  # fmt: skip
    """`decode` the contents of `file`; ValueError, with its name, if it cannot be read or has no fix."""
    try:
        return decode(Path(file).read_bytes(), place, start)
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def write(file: str | Path, data: bytes) -> Path:
    """Write `data` to `file`, complete or not at all, and return its path."""
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(data)
    return Path(file)


def assemble(
    epochs: dict[int, Epoch], problems: list[Problem], ignored: int, place: Place | None, start: datetime | None
) -> Reading:
    """Fixes of the `epochs` (by nanosecond of UTC, in order of the file), dropping those without a fix.

    Raises
    ------
    ValueError      no fix at all; the message lists what was found
    """
    latest = None
    kept = {}
    for ns, epoch in epochs.items():
        if epoch.void or not np.isfinite(epoch.latitude_deg + epoch.longitude_deg):
            problems.append(Problem("no fix", epoch.where, "the receiver had none"))
            continue
        kept[ns] = epoch
        if latest is not None and ns < latest:
            problems.append(Problem("out of order", epoch.where, f"{(latest - ns) / NS:g} s older than one before it"))
        latest = ns if latest is None else max(ns, latest)
        problems += _gaps(epoch)
    if not kept:
        raise ValueError(f"no GPS fix in it{_found(problems, ignored)}")
    times = sorted(kept)
    ordered = [kept[ns] for ns in times]
    place = _place(ordered) if place is None else checked(place)
    start = date_time(times[0]) if start is None else start
    return Reading(_fixes(times, ordered, place, utc_ns(start)), place, start, ignored, tuple(problems))


def _gaps(epoch: Epoch) -> Iterable[Problem]:
    if not np.isfinite(epoch.height_m):
        yield Problem("no height", epoch.where, "down is unknown")
    if not np.isfinite(epoch.speed_m_s):
        yield Problem("no speed", epoch.where, "velocity is unknown")
    elif not np.isfinite(epoch.course_deg):
        yield Problem("no course", epoch.where, "only the speed is known")


def _found(problems: list[Problem], ignored: int) -> str:
    counts = Counter(str(problem.kind) for problem in problems)
    if ignored:
        counts["other messages"] = ignored
    found = ", ".join(f"{kind} {n}" for kind, n in counts.items())
    return f" (found: {found})" if found else ": no sentences or messages found"


def _place(ordered: list[Epoch]) -> Place:
    """Position of the first fix, at the first known height."""
    height_m = next((e.height_m for e in ordered if np.isfinite(e.height_m)), 0.0)
    return Place(ordered[0].latitude_deg, ordered[0].longitude_deg, height_m)


def _fixes(times: list[int], ordered: list[Epoch], place: Place, zero_ns: int) -> Fixes:
    latitude_deg, longitude_deg, height_m = np.array([(e.latitude_deg, e.longitude_deg, e.height_m) for e in ordered]).T
    known = np.isfinite(height_m)
    near_m = np.where(known, height_m, place.height_m)  # north and east hardly depend on it
    p_e_m = place_of.local(latitude_deg, longitude_deg, near_m, *place)
    p_e_m[~known, 2] = NAN
    horizontal, vertical, speed, course = np.array([e.accuracy for e in ordered]).T
    return Fixes(
        t_s=np.array([(ns - zero_ns) / NS for ns in times]),
        arrival_s=np.full(len(times), NAN),
        p_e_m=p_e_m,
        v_e_m_s=np.array([e.v_e_m_s for e in ordered]),
        course_rad=np.radians([e.course_deg for e in ordered]),
        speed_m_s=np.array([e.speed_m_s for e in ordered]),
        horizontal_acc_m=horizontal, vertical_acc_m=vertical, speed_acc_m_s=speed, course_acc_rad=np.radians(course),
        satellites=np.array([e.satellites for e in ordered]),
    )  # fmt: skip
