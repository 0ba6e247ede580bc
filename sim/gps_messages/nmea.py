"""GPS fixes as NMEA 0183 sentences, written and read with pynmeagps.

Each fix is a GGA (position, height, satellites), an RMC (position, speed, course, date) and a VTG (course, speed).
Resolution: time 1 ms, position 1e-7 minutes of arc (0.2 mm), height 1 mm, speed 0.001 knots, course 0.001 degrees,
within the 82 characters per sentence of the standard.  The sentences contain neither vertical velocity nor
accuracies: these are NaN when read, and north and east velocity are computed from course and speed.

Fields are passed to pynmeagps as text: it would truncate numeric times to hundredths and write minutes that round up
as 60.00000.  It frames, checks and parses the sentences.

References: NMEA 0183 version 2.3 (fields, checksum: exclusive or of all characters between $ and *).
"""

import math
import re
from collections.abc import Callable, Iterator
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, Final, NamedTuple

from sim.gps_messages import fixes as common
from sim.gps_messages.fixes import LAUNCH, NAN, NS, START, Epoch, Fixes, Kind, Place, Problem, Reading

KNOT_M_S: Final = 1852.0 / 3600.0  # by definition
_MINUTE: Final = 10**7  # units of position in a minute of arc
_DAY_NS: Final = 86_400 * NS
_OURS: Final = re.compile(rb"\$(?!P)[A-Z]{2}(GGA|RMC|VTG),")


def write_nmea(fixes: Fixes, file: str | Path, place: Place = LAUNCH, start: datetime = START) -> Path:
    """Write `encode_nmea` of the same arguments to `file`, complete or not at all, and return its path."""
    return common.write(file, encode_nmea(fixes, place, start))


def read_nmea(file: str | Path, place: Place | None = None, start: datetime | None = None) -> Reading:
    """`decode_nmea` of the contents of `file`; ValueError, with its name, if it cannot be read or has no fix."""
    return common.read(file, decode_nmea, place, start)


def encode_nmea(fixes: Fixes, place: Place = LAUNCH, start: datetime = START, talker: str = "GN") -> bytes:
    """GGA, RMC and VTG of each fix, in the order of `fixes`.

    Unknown times, heights, speeds and courses are empty fields; without time or position there is no fix.

    place : origin of the positions      start : UTC at which `t_s` is zero      talker : two letters

    Raises
    ------
    ValueError      pynmeagps is not installed, or a date that cannot be written
    """
    nmea = common.needed("pynmeagps")
    if not re.fullmatch("[A-Z]{2}", talker):
        raise ValueError(f"talker {talker!r}: must be two capital letters, for instance GN")
    there = common.geodetic(fixes.p_e_m, place)
    sentences = []
    for i, ns in enumerate(common.stamps_ns(fixes, start)):
        for name, payload in _payloads(fixes, i, ns, there[i].tolist()):
            sentences.append(nmea.NMEAMessage(talker, name, nmea.GET, payload=payload).serialize())
    return b"".join(sentences)


def decode_nmea(data: bytes, place: Place | None = None, start: datetime | None = None) -> Reading:
    """The fixes in `data`, from any receiver, among sentences and bytes of any other kind.

    Sentences of the same time form one fix, from any talker; the first of each kind counts.  The date is that of
    RMC, advanced at midnight between two of them, or that of `start` if there is none.

    place : origin of the positions, the first fix by default
    start : UTC at which `t_s` is zero, the time of the first fix by default

    Raises
    ------
    ValueError      no fix in it, or pynmeagps is not installed
    """
    problems: list[Problem] = []
    sentences, ignored = _sentences(data, problems)
    epochs = _epochs(_groups(sentences, problems), start or START, problems)
    return common.assemble(epochs, problems, ignored, place, start)


def _payloads(fixes: Fixes, i: int, ns: int | None, there: list[float]) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of the three sentences of fix `i`."""
    clock, day = _clock(ns)
    good = ns is not None and math.isfinite(there[0])
    position = [*_angle(there[0], 2, "NS"), *_angle(there[1], 3, "EW")] if good else [""] * 4
    height = f"{round(there[2], 3) + 0.0:.3f}" if good and math.isfinite(there[2]) else ""  # never -0.000
    speed, course = float(fixes.speed_m_s[i]), float(fixes.course_rad[i])
    known = good and math.isfinite(speed) and math.isfinite(course)
    knots = f"{speed / KNOT_M_S:.3f}" if known else ""
    km_h = f"{1.852 * float(knots):.3f}" if known else ""  # from the written knots, so that the two agree
    millidegrees = round(math.degrees(course) * 1000) % 360_000 if known else 0  # 359.9996 is 0
    degrees = f"{millidegrees // 1000}.{millidegrees % 1000:03d}" if known else ""
    satellites = f"{fixes.satellites[i] if good else 0:02d}"
    quality, status, mode = ("1", "A", "A") if good else ("0", "V", "N")
    separation = "0.000" if good else ""  # of the geoid: the sea is the ellipsoid
    yield "GGA", [clock, *position, quality, satellites, "", height, "M", separation, "M", "", ""]
    yield "RMC", [clock, status, *position, knots, degrees, day, "", "", mode]
    yield "VTG", [degrees, "T", "", "M", knots, "N", km_h, "K", mode]


def _clock(ns: int | None) -> tuple[str, str]:
    """hhmmss.sss and ddmmyy, to the nearest millisecond."""
    if ns is None:
        return "", ""
    milliseconds = (ns + 500_000) // 1_000_000
    moment = common.date_time(milliseconds * 1_000_000)
    return f"{moment:%H%M%S}.{milliseconds % 1000:03d}", f"{moment:%d%m%y}"


def _angle(angle_deg: float, digits: int, signs: str) -> tuple[str, str]:
    """Degrees and minutes, and the hemisphere; in integer units, so that minutes do not round up to 60."""
    units = round(abs(angle_deg) * 60 * _MINUTE)
    degrees, rest = divmod(units, 60 * _MINUTE)
    text = f"{degrees:0{digits}d}{rest // _MINUTE:02d}.{rest % _MINUTE:07d}"
    return text, signs[angle_deg < 0.0 and units > 0]


class _Sentence(NamedTuple):
    where: str
    name: str
    message: Any


def _sentences(data: bytes, problems: list[Problem]) -> tuple[list[_Sentence], int]:
    """The sentences about fixes, and the number of others."""
    nmea = common.needed("pynmeagps")
    found, ignored = [], 0
    lines = data.split(b"\n")
    for number, line in enumerate(lines, 1):
        text = line[line.rfind(b"$") :].strip() if b"$" in line else b""
        name = _OURS.match(text)
        if name is None:
            ignored += bool(line.strip())
            continue
        where = f"line {number}"
        try:
            message = nmea.NMEAReader.parse(text)
            if message is None:
                raise nmea.NMEAMessageError("no checksum, or bytes that are not text")
            found.append(_Sentence(where, name[1].decode(), message))
        except (nmea.NMEAParseError, nmea.NMEAMessageError, nmea.NMEATypeError) as error:
            damage: Kind = "checksum" if isinstance(error, nmea.NMEAParseError) else "malformed"
            problems.append(Problem("truncated" if number == len(lines) else damage, where, str(error)))
    return found, ignored


class _Group(NamedTuple):
    """Neighbouring sentences of one time: nanoseconds since midnight, and the date if one contains it."""

    clock_ns: int
    sentences: list[_Sentence]

    @property
    def day(self) -> int | None:
        """Date of the group in days since 1970."""
        dates = (getattr(s.message, "date", None) for s in self.sentences)
        return next(((d - common.EPOCH.date()).days for d in dates if isinstance(d, date)), None)


def _groups(sentences: list[_Sentence], problems: list[Problem]) -> list[_Group]:
    """Sentences grouped by time; VTG, which has none, belongs to the one before."""
    groups: list[_Group] = []
    current: _Group | None = None
    for sentence in sentences:
        if sentence.name != "VTG":
            clock = sentence.message.time
            if not isinstance(clock, time):
                problems.append(Problem("no time", sentence.where, f"{sentence.name} without a time"))
                current = None
                continue
            ns = ((clock.hour * 60 + clock.minute) * 60 + clock.second) * NS + clock.microsecond * 1000
            if current is None or current.clock_ns != ns:
                current = _Group(ns, [])
                groups.append(current)
        if current is not None:
            current.sentences.append(sentence)
    return groups


def _epochs(groups: list[_Group], start: datetime, problems: list[Problem]) -> dict[int, Epoch]:
    """Fixes by nanosecond of UTC, in the order of the file."""
    epochs: dict[int, Epoch] = {}
    for ns, group in zip(_dated(groups, start), groups, strict=True):
        epoch = epochs.setdefault(ns, Epoch(group.sentences[0].where))
        for sentence in group.sentences:
            if sentence.name in epoch.seen:
                problems.append(Problem("repeated", sentence.where, f"another {sentence.name} of the same time"))
                continue
            epoch.seen.add(sentence.name)
            try:
                _TAKE[sentence.name](epoch, sentence.message)
            except (AttributeError, TypeError, ValueError) as error:
                problems.append(Problem("malformed", sentence.where, f"{sentence.name}: {error}"))
    return epochs


def _dated(groups: list[_Group], start: datetime) -> Iterator[int]:
    """UTC of the groups.  A clock that drops by more than half a day has passed midnight."""
    turns, before = [], 0
    for last, group in zip([None, *groups], groups, strict=False):
        if last is not None:
            step = group.clock_ns - last.clock_ns
            before += 1 if step < -_DAY_NS // 2 else -1 if step > _DAY_NS // 2 else 0
        turns.append(before)
    days = [
        None if g.day is None else g.day - turn for g, turn in zip(groups, turns, strict=True)
    ]  # less the midnights before
    base = next((day for day in days if day is not None), common.utc_ns(start) // _DAY_NS)
    for group, day, turn in zip(groups, days, turns, strict=True):
        base = base if day is None else day
        yield (base + turn) * _DAY_NS + group.clock_ns


def _take_gga(epoch: Epoch, m: Any) -> None:
    if not m.quality:  # 0 or empty
        epoch.void = True
        return
    _take_position(epoch, m)
    epoch.height_m = _number(m.alt) + (_number(m.sep) if m.sep != "" else 0.0)
    epoch.satellites = m.numSV if m.numSV != "" else 0


def _take_rmc(epoch: Epoch, m: Any) -> None:
    if m.status != "A":
        epoch.void = True
        return
    _take_position(epoch, m)
    _take_motion(epoch, m.spd, m.cog)


def _take_position(epoch: Epoch, m: Any) -> None:
    """Set latitude and longitude, unless set by another sentence."""
    latitude_deg, longitude_deg = _number(m.lat), _number(m.lon)
    if m.NS not in ("N", "S") or m.EW not in ("E", "W"):
        raise ValueError(f"hemispheres {m.NS!r} and {m.EW!r}: must be N or S, and E or W")
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0):
        raise ValueError(f"latitude {m.lat} deg, longitude {m.lon} deg: no such place")
    if math.isnan(epoch.latitude_deg):
        epoch.latitude_deg, epoch.longitude_deg = latitude_deg, longitude_deg


def _take_motion(epoch: Epoch, speed_kn: Any, course_deg: Any) -> None:
    """Set speed, course and velocity, unless set by another sentence."""
    if math.isnan(epoch.speed_m_s):
        epoch.speed_m_s = _number(speed_kn) * KNOT_M_S
    if math.isnan(epoch.course_deg):
        epoch.course_deg = _number(course_deg) % 360.0
    course = 0.0 if epoch.speed_m_s == 0.0 else math.radians(epoch.course_deg)  # many receivers omit it at rest
    epoch.v_e_m_s = (epoch.speed_m_s * math.cos(course), epoch.speed_m_s * math.sin(course), NAN)


def _number(value: Any) -> float:
    """A field as a number; NaN if it is empty or not finite."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else NAN


_TAKE: Final[dict[str, Callable[[Epoch, Any], None]]] = {
    "GGA": _take_gga,
    "RMC": _take_rmc,
    "VTG": lambda epoch, m: _take_motion(epoch, m.sogn, m.cogt),
}
