"""GPS fixes as UBX NAV-PVT messages, written and read with pyubx2.

Resolution: time 1 ns, latitude and longitude 1e-7 degrees (11 mm), height and accuracies 1 mm, velocities and speed
1 mm/s, course 1e-5 degrees.  An unknown accuracy is written as the largest number of its field.

pyubx2 divides by the unit of a field and truncates: half a unit is added, away from zero, to round instead.

References: u-blox 8 / M8 receiver description including protocol specification, UBX-13003221, UBX-NAV-PVT
(0x01 0x07), UBX frame structure, and section "UTC representation": date and time are rounded to the nearest
hundredth of a second, `nano` is the remainder, -5 ms to 995 ms.
"""

import math
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from sim.gps_messages import fixes as common
from sim.gps_messages.fixes import LAUNCH, NAN, NS, START, Epoch, Fixes, Place, Problem, Reading

_SYNC: Final = b"\xb5b"
_NAV_PVT: Final = b"\x01\x07"
_SHORTEST: Final = 84  # bytes of payload, u-blox 7; 92 since u-blox 8
_FRAME: Final = 8  # bytes around the payload: sync, class, identity, length, checksum
_UNKNOWN: Final = 2**32 - 1
_GPS_EPOCH_NS: Final = common.utc_ns(datetime(1980, 1, 6, tzinfo=UTC))
_WEEK_MS: Final = 7 * 86_400 * 1000
_2D, _3D, _WITH_DEAD_RECKONING = 2, 3, 4  # fixType with satellites


def write_ubx(fixes: Fixes, file: str | Path, place: Place = LAUNCH, start: datetime = START) -> Path:
    """Write `encode_ubx` of the same arguments to `file`, complete or not at all, and return its path."""
    return common.write(file, encode_ubx(fixes, place, start))


def read_ubx(file: str | Path, place: Place | None = None, start: datetime | None = None) -> Reading:
    """`decode_ubx` of the contents of `file`; ValueError, with its name, if it cannot be read or has no fix."""
    return common.read(file, decode_ubx, place, start)


def encode_ubx(fixes: Fixes, place: Place = LAUNCH, start: datetime = START) -> bytes:
    """One NAV-PVT per fix, in the order of `fixes`.

    A message cannot omit a number: a fix with any that is not finite, vertical velocity included, becomes a message
    without a fix.

    place : origin of the positions      start : UTC at which `t_s` is zero

    Raises
    ------
    ValueError      pyubx2 is not installed, or a number or date that does not fit its field
    """
    ubx = common.needed("pyubx2")
    there = common.geodetic(fixes.p_e_m, place)
    messages = []
    for i, ns in enumerate(common.stamps_ns(fixes, start)):
        values = _time(ns) | _fix(fixes, i, there[i].tolist(), known=ns is not None)
        try:
            messages.append(ubx.UBXMessage("NAV", "NAV-PVT", ubx.GET, **values).serialize())
        except ubx.UBXTypeError as error:
            raise ValueError(f"fix {i} does not fit a NAV-PVT message: {error}") from error
    return b"".join(messages)


def decode_ubx(data: bytes, place: Place | None = None, start: datetime | None = None) -> Reading:
    """The fixes of the NAV-PVT messages in `data`, among messages and bytes of any other kind.

    place : origin of the positions, the first fix by default
    start : UTC at which `t_s` is zero, the time of the first fix by default

    Raises
    ------
    ValueError      no fix in it, or pyubx2 is not installed
    """
    ubx = common.needed("pyubx2")
    problems: list[Problem] = []
    epochs: dict[int, Epoch] = {}
    ignored = 0
    for where, frame in _frames(data, problems):
        if frame[2:4] != _NAV_PVT:
            ignored += 1
            continue
        if len(frame) < _SHORTEST + _FRAME:
            problems.append(Problem("malformed", where, f"NAV-PVT of {len(frame) - _FRAME} bytes, too short"))
            continue
        _take(where, ubx.UBXReader.parse(frame), epochs, problems)
    return common.assemble(epochs, problems, ignored, place, start)


def _time(ns: int | None) -> dict[str, Any]:
    """The time fields; empty ones if it is unknown."""
    if ns is None:
        return {"iTOW": 0, "tAcc": _UNKNOWN}
    from pynmeagps import leapsecond  # installed with pyubx2

    second = (ns + NS // 200) // (NS // 100) // 100
    utc = common.date_time(second * NS)
    gps_ns = ns - _GPS_EPOCH_NS + leapsecond(utc) * NS
    return {
        "iTOW": (gps_ns + 500_000) // 1_000_000 % _WEEK_MS,
        **dict(zip(("year", "month", "day", "hour", "min", "second"), utc.timetuple(), strict=False)),
        **dict.fromkeys(("validDate", "validTime", "fullyResolved"), 1),
        "tAcc": _UNKNOWN,
        "nano": ns - second * NS,
    }


def _fix(fixes: Fixes, i: int, there: list[float], *, known: bool) -> dict[str, Any]:
    """The other fields of fix `i`, at `there` (deg, deg, m)."""
    velocity, speed, course = fixes.v_e_m_s[i].tolist(), float(fixes.speed_m_s[i]), float(fixes.course_rad[i])
    if not (known and all(map(math.isfinite, (*there, *velocity, speed, course)))):
        accuracies = dict.fromkeys(("hAcc", "vAcc", "sAcc"), _UNKNOWN)
        return {"fixType": 0, "invalidLlh": 1, "pDOP": 99.995, "headAcc": _scaled(_UNKNOWN, 1e-5), **accuracies}
    height_mm = round(there[2] * 1000)
    return {
        "fixType": _3D,
        "gnssFixOk": 1,
        "numSV": int(fixes.satellites[i]),
        "lat": _scaled(round(there[0] * 1e7), 1e-7),
        "lon": _scaled(round(there[1] * 1e7), 1e-7),
        "height": height_mm,
        "hMSL": height_mm,  # the sea is the ellipsoid
        "hAcc": _unsigned(fixes.horizontal_acc_m[i], 1000),
        "vAcc": _unsigned(fixes.vertical_acc_m[i], 1000),
        **{f"vel{axis}": round(v * 1000) for axis, v in zip("NED", velocity, strict=True)},
        "gSpeed": round(speed * 1000),
        "headMot": _scaled(round(math.degrees(course) * 1e5) % 36_000_000, 1e-5),  # 359.999996 is 0
        "sAcc": _unsigned(fixes.speed_acc_m_s[i], 1000),
        "headAcc": _scaled(_unsigned(math.degrees(fixes.course_acc_rad[i]), 1e5), 1e-5),
        "pDOP": 99.995,  # unknown: no satellites are simulated
    }


def _scaled(units: int, unit: float) -> float:
    """The value that pyubx2 converts to `units` of a field with that `unit`."""
    return (units + math.copysign(0.5, units)) * unit


def _unsigned(value: float, per_unit: float) -> int:
    """An accuracy in whole units, at most the largest number of the field, which means unknown."""
    return min(round(value * per_unit), _UNKNOWN) if math.isfinite(value) else _UNKNOWN


def _frames(data: bytes, problems: list[Problem]) -> Iterator[tuple[str, bytes]]:
    """Complete UBX messages and their positions.

    After a damaged one the search resumes after its first two bytes, so that a wrong length hides no other message.
    """
    valid = common.needed("pyubx2").isvalid_checksum
    at = data.find(_SYNC)
    while at >= 0:
        where, end = f"byte {at}", at + _FRAME + int.from_bytes(data[at + 4 : at + 6], "little")
        if end <= len(data) and at + _FRAME <= len(data) and valid(data[at:end]):
            yield where, data[at:end]
            at = data.find(_SYNC, end)
            continue
        following = data.find(_SYNC, at + 2)
        if end > len(data) and following < 0:
            problems.append(Problem("truncated", where, f"the message ends at byte {end}, the file at {len(data)}"))
        else:
            problems.append(Problem("checksum", where, "a message with a wrong checksum"))
        at = following


def _take(where: str, m: Any, epochs: dict[int, Epoch], problems: list[Problem]) -> None:
    """Add the message `m` to `epochs`, or its problem to `problems`."""
    if not (m.validDate and m.validTime):
        problems.append(Problem("no time", where, "the receiver did not know date and time"))
        return
    try:
        second = datetime(m.year, m.month, m.day, m.hour, m.min, m.second, tzinfo=UTC)
    except ValueError as error:
        problems.append(Problem("malformed", where, f"NAV-PVT: {error}"))
        return
    ns = common.utc_ns(second) + m.nano
    if ns in epochs:
        problems.append(Problem("repeated", where, "another NAV-PVT of the same time"))
        return
    if not m.gnssFixOk or m.invalidLlh or m.fixType not in (_2D, _3D, _WITH_DEAD_RECKONING):
        epochs[ns] = Epoch(where, void=True)
        return
    horizontal_m, vertical_m, speed_m_s = (_known(units, 1000) for units in (m.hAcc, m.vAcc, m.sAcc))
    epochs[ns] = Epoch(
        where,
        latitude_deg=m.lat,
        longitude_deg=m.lon,
        height_m=NAN if m.fixType == _2D else m.height / 1000,
        v_e_m_s=(m.velN / 1000, m.velE / 1000, m.velD / 1000),
        course_deg=m.headMot % 360.0,
        speed_m_s=m.gSpeed / 1000,
        accuracy=(horizontal_m, vertical_m, speed_m_s, _known(round(m.headAcc * 1e5), 10**5)),
        satellites=m.numSV,
    )


def _known(units: int, per_unit: int) -> float:
    return units / per_unit if units != _UNKNOWN else NAN
