"""Columns recognised by their names: words for the quantity, an axis or an index, and a unit.

A header such as ``Gyroscope X (deg/s)``, ``gyroRotationX(rad/s)``, ``field.angular_velocity.x``, ``gyro_rad[0]`` or
``measured.gyro_b_rad_s.x`` is split into words.  The unit is in brackets or in the last words.  The axis is a letter,
an index, or roll, pitch or yaw for a rate.  The other words must name a quantity.  Words that only give the source
(``imu``, ``sensor``, ``raw``) are ignored, one unknown word lowers the rank of a name, and words such as ``bias``,
``desired`` or ``sigma`` rule it out.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from scenarios.harness.logs import units
from scenarios.harness.logs.quantities import QUANTITIES, Meaning

_AXES = {"x": "x", "y": "y", "z": "z", "0": "x", "1": "y", "2": "z"}
_EARTH = {"n": "n", "e": "e", "d": "d", "north": "n", "east": "e", "down": "d", "0": "n", "1": "e", "2": "d"}
_TURNS = {"roll": "x", "pitch": "y", "yaw": "z"}
_STRONG = {  # one of these words names a vector
    "gyro": {"gyro", "gyros", "gyroscope", "gyr", "omega"},
    "force": {"acc", "accel", "accelerometer", "acceleration", "accelerations", "accels", "force"},
    "mag": {"mag", "magnetometer", "magnetic", "magn", "magnet"},
}
_PHRASES = {  # these words together name it
    "gyro": ({"angular", "velocity"}, {"angular", "rate"}, {"rotation", "rate"}, {"angular", "vel"}, {"turn", "rate"},
             {"ang", "rate"}, {"ang", "vel"}),
    "force": ({"specific", "force"}, {"linear", "accel"}),
    "mag": ({"mag", "field"},),
}  # fmt: skip
_HELPING = {"gyro": {"rotation", "rate", "angular", "velocity"}, "force": {"specific", "linear"}, "mag": {"field"}}
_WEAK = {"gyro": {"g", "w"}, "force": {"a", "f"}, "mag": {"m", "h", "b"}}  # a single letter with an axis
_GLUED = re.compile(r"(gyro|gyr|omega|accel|acc|mag|magn|force|vel|[gwafmhvb])([xyzned])|(q|quat)([wxyz])")
_NEUTRAL = {
    "imu", "sensor", "sensors", "data", "measured", "raw", "b", "body", "frame", "value", "values", "combined", "axis",
    "input", "reading", "motion", "adc", "smooth", "the", "of", "in", "field", "sens", "uncalibrated", "calibrated",
    "array", "vector", "component", "msg", "message", "log", "logger", "signal", "ins", "ahrs",
}  # fmt: skip
_GPS = {"gps", "gnss", "location", "receiver", "fix", "position", "geo", "ublox"}
_NEVER = {
    "bias", "biases", "offset", "offsets", "ofs", "std", "sigma", "stddev", "var", "variance", "cov", "covariance",
    "error", "err", "temp", "temperature", "noise", "health", "healthy", "count", "clip", "clipping", "delta", "flown",
    "user", "gravity", "cmd", "command", "commanded", "desired", "des", "target", "setpoint", "sp", "demand", "nav",
    "accuracy", "acc_accuracy", "estimated_error", "trim", "scale", "gain", "unfilt", "quality", "num", "cpu", "load",
    "wind", "integral", "dot", "limit", "min", "max", "home", "integrated", "innov", "innovation", "stick", "rc",
}  # fmt: skip
_TRUTH = {"ref", "reference", "truth", "true", "groundtruth", "att", "attitude", "euler", "angle", "angles", "rpy",
          "est", "estimate", "estimated", "filter", "ekf", "orientation", "fused"}  # fmt: skip
_TIME = {"t", "time", "timestamp", "clock", "ts", "stamp", "seconds", "secs", "elapsed", "uptime", "millis", "micros"}
_TIME_BESIDE = {"since", "start", "boot", "system", "sys", "sample", "header", "logging", "up", "power", "relative",
                "local", "startup", "from", "s", "reboot"}  # fmt: skip
_ANGLES = {"roll": "roll", "phi": "roll", "pitch": "pitch", "theta": "pitch", "yaw": "yaw", "psi": "yaw",
           "heading": "yaw", "hdg": "yaw"}  # fmt: skip
_SCALARS: tuple[tuple[frozenset[str], str], ...] = tuple(
    (frozenset(words.split()), quantity)
    for quantity, spelled in {
        "gps.new": "gps new", "gps.valid": "gps valid", "mag.new": "mag new", "air.new": "air new",
        "height.new": "height new|baro new",
        "gps.fix": "gps fix|fix type|fixtype|gps fix type|gps fixtype|fix",
        "gps.time": "gps t|gps time|fix time|gps timestamp|gps fix time",
        "gps.latitude": "latitude|lat|gps lat|gps latitude",
        "gps.longitude": "longitude|lon|lng|long|gps lon|gps longitude|gps lng|gps long",
        "gps.altitude": "altitude|alt|gps alt|gps altitude|gps height|alt msl|altitude msl|amsl|hmsl|altitude asl"
                        "|alt asl|altitude amsl|gps altitude msl|gps alt msl",
        "gps.speed": "gps speed|ground speed|groundspeed|gps ground speed|gps groundspeed|speed over ground|sog|gps spd"
                     "|spd|gspd|gps velocity|gps vel|ground velocity|gps gspeed|vel m s|gps velocity m s",
        "gps.course": "gps course|course|cog|ground course|gps ground course|gps cog|gps heading|course over ground"
                      "|gcrs|gps gcrs|gps track|ground track|gps hdg",
        "airspeed": "airspeed|air speed|ias|eas|cas|indicated airspeed|indicated air speed|equivalent airspeed"
                    "|calibrated airspeed|aspd|pitot speed|pitot airspeed|airspeed ias|airspeed eas",
        "true_airspeed": "tas|true airspeed|true air speed|airspeed tas",
        "height": "baro height|height|baro alt|baro altitude|barometric height|barometric altitude|pressure altitude"
                  "|altimeter relative altitude|barometer altitude|barometer height|baro|barometer alt",
        "interval": "dt|interval|sample interval|imu dt",
    }.items()
    for words in spelled.split("|")
)  # fmt: skip


_NO_UNIT = 20  # added to the rank of a clock without a unit


class Candidate(NamedTuple):
    """What a name may mean: the quantity, a factor to our unit, if the name gives the unit, and a rank (0 is best).

    stem : the name without its axis, which the columns of one vector share
    """

    quantity: str
    factor: float
    unit_given: bool
    rank: int
    stem: str


class Name(NamedTuple):
    """The parts of a name: its words in lower case, the indices in brackets, and the unit in brackets, if any."""

    words: tuple[str, ...]
    indices: tuple[str, ...]
    unit: str


def split(header: str, unit: str = "") -> Name:
    """The parts of a header; `unit` is from the row of units below it, if there is one."""
    indices = []
    for inside in re.findall(r"[(\[<]([^()\[\]<>]*)[)\]>]", header):
        if inside.strip().isdigit():
            indices.append(inside.strip())
        elif inside.strip().lower() in _AXES:
            header = header.replace(inside, f" {inside} ")  # an axis in brackets is a word
        elif units.is_unit(inside) or re.search(r"[/^]", inside):  # also if it is unknown
            unit = unit or inside
    bare = re.sub(r"[(\[<](?!\s[xyzXYZ]\s)[^()\[\]<>]*[)\]>]", " ", header)
    bare = re.sub(r"(?<![a-zA-Z])([unµμ])T(?![a-z])", lambda m: "ut" if m[1] != "n" else "nt", bare)
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", bare)
    return Name(tuple(word.lower() for word in words), tuple(indices), unit)


def meanings(header: str, unit: str = "") -> list[Candidate]:
    """All possible meanings of a name, the best rank first."""
    name = split(header, unit)
    words = list(name.words)
    found: dict[str, Candidate] = {}
    trials = [(words, name.unit)]
    if not name.unit:
        tail = words[:-1] if len(words) > 1 and words[-1] in (*_AXES, *_EARTH, "w") else words
        ending, n = units.at_end(tail)
        if n:  # first with the unit, then without it for a quantity of another dimension
            kept = tail[: len(tail) - n] + words[len(tail) :]
            trials.insert(0, (kept, ending))
        ending, n = units.at_end(words)
        if n and tail != words:
            trials.insert(0, (words[: len(words) - n], ending))
    for tried, spelled in trials:
        for quantity, rank, stem, sign in _named(tried, name.indices):
            if quantity in found:
                continue
            factor = units.factor_of(spelled, _dimension(quantity)) if spelled else 1.0
            if factor is not None:
                unit_given = bool(spelled) or sign not in (1.0, -1.0)
                worse = 0 if unit_given or quantity != "time" else _NO_UNIT  # of two clocks the one with a unit counts
                found[quantity] = Candidate(quantity, sign * factor, unit_given, rank + worse, stem)
    return sorted(found.values(), key=lambda candidate: candidate.rank)


def _dimension(quantity: str) -> str:
    return "number" if quantity.startswith("q#") else QUANTITIES[quantity]


def _named(words: list[str], indices: tuple[str, ...]) -> list[tuple[str, int, str, float]]:
    """Quantities that the words name, each with a rank, a stem and a sign."""
    if not words or _NEVER & set(words):
        return []
    alone = len([w for w in words if w not in _NEUTRAL | _GPS | _TRUTH]) == 1
    words = [part for word in words for part in _unglued(word, alone=alone)]
    found = [*_matrix(words, indices), *_quaternion(words, indices)]
    if found:
        return found
    return [
        *_vector(words, indices),
        *_angle(words),
        *_velocity(words, indices),
        *_scalar(words, indices),
        *_time(words),
    ]


def _unglued(word: str, *, alone: bool) -> list[str]:
    """``gyrx`` is gyr and x; so is ``gx`` if it is the only word."""
    match = _GLUED.fullmatch(word)
    stem, axis = (match[1] or match[3], match[2] or match[4]) if match else ("", "")
    return [stem, axis] if stem and (alone or len(stem) > 1) else [word]


def _vector(words: list[str], indices: tuple[str, ...]) -> Iterable[tuple[str, int, str, float]]:
    """Gyro, accelerometer and magnetometer."""
    present = set(words)
    if "truth" in present or _GPS & present:
        return
    axes = [w for w in words if w in "xyz"]
    digits = [w for w in words if w.isdigit()]
    turning = [w for w in words if w in _TURNS]
    if turning and {"rate", "speed", "velocity", "gyro"} & present:
        left = present - set(turning) - {"rate", "speed", "velocity", "gyro", "angular"} - _NEUTRAL - _TRUTH
        if len(turning) == 1 and not axes and not left:
            yield f"gyro.{_TURNS[turning[0]]}", 1, "turn rate", 1.0
        return
    if len(words) == 1 and words[0] in ("p", "q", "r"):
        yield f"gyro.{'xyz'['pqr'.index(words[0])]}", 0, "pqr", 1.0
        return
    if len(axes) == 1:
        axis = axes[0]
        instance = digits + [i for i in indices if int(i)]
    elif not axes and len(indices) == 1 and indices[0] in _AXES:
        axis, instance = _AXES[indices[0]], digits
    elif not axes and not indices and len(digits) == 1 and words[-1] in _AXES:
        axis, instance = _AXES[digits[0]], []
    else:
        return
    bare = [w for w in words if w not in axes and w not in digits]
    for name, strong in _STRONG.items():
        others = set().union(*(s for n, s in _STRONG.items() if n != name))
        rest = set(bare) - _NEUTRAL - strong - _HELPING[name]
        by_words = strong & set(bare) or any(phrase <= set(bare) for phrase in _PHRASES[name])
        letters = set(bare) - _NEUTRAL or set(bare) & {"b"}  # B is the field, unless it is the body frame
        if by_words and not others & set(bare) and len(rest) <= 1:
            yield f"{name}.{axis}", 2 * len(rest) + 2 * len(instance), _stem(bare, instance), 1.0
        elif len(letters) == 1 and letters <= _WEAK[name] and not instance and not indices:
            yield f"{name}.{axis}", 0, _stem(bare, instance), 1.0


def _stem(words: Sequence[str], instance: Sequence[str]) -> str:
    return " ".join((*words, *instance))


def _velocity(words: list[str], indices: tuple[str, ...]) -> Iterable[tuple[str, int, str, float]]:
    """Velocity and position north, east, down, as a receiver reports them."""
    if {"air", "truth", "body", "b"} & set(words):
        return
    axis, bare = "", list(words)
    if words[-1] in _EARTH and (not words[-1].isdigit() or len(words) > 1):
        axis, bare = _EARTH[words[-1]], words[:-1]
    elif len(indices) == 1 and indices[0] in _EARTH:
        axis = _EARTH[indices[0]]
    elif words[-1] in ("up", "u") and len(words) > 1:
        axis, bare = "up", words[:-1]
    elif len(words) > 1 and words[0] in ("north", "east", "down"):
        axis, bare = words[0][0], words[1:]
    if not axis:
        return
    rest = set(bare) - _GPS - _NEUTRAL - {"e", "ned", "ground"}
    of_gps = bool(_GPS & set(bare))
    if rest and rest <= {"v", "vel", "velocity", "velned", "speed"}:
        yield ("gps.vd", 1, "velocity up", -1.0) if axis == "up" else (f"gps.v{axis}", 0, _stem(bare, ()), 1.0)
    elif axis != "up" and not indices and of_gps and rest <= {"p", "pos", "position"}:
        yield f"gps.{axis}", 0, _stem(bare, ()), 1.0


def _angle(words: list[str]) -> Iterable[tuple[str, int, str, float]]:
    """Roll, pitch and yaw; a reference or the truth ranks before others."""
    named = [w for w in words if w in _ANGLES]
    present = set(words)
    if len(named) != 1 or present & {"rate", "speed", "magnetic", "mag", "gyro", "accel", "acc", "velocity", *_GPS}:
        return
    rest = present - {named[0]} - _NEUTRAL - _TRUTH
    if len(rest) <= 1 and not any(w.isdigit() for w in rest):
        best = present & {"ref", "reference", "truth", "groundtruth"}
        stem = _stem([w for w in words if w != named[0]], ()) + (
            " greek" if named[0] in ("phi", "theta", "psi") else ""
        )
        rank = (0 if best else 1) + 2 * len(rest) + (named[0] in ("heading", "hdg"))
        yield _ANGLES[named[0]], rank, stem, 1.0


def _quaternion(words: list[str], indices: tuple[str, ...]) -> list[tuple[str, int, str, float]]:
    """``qw`` to ``qz``; numbered elements begin with the scalar part, see `_number_quaternions`."""
    names = {"q", "quat", "quaternion", "orientation"}
    rest = set(words) - _NEUTRAL - _TRUTH - names
    if not names & set(words):
        return []
    best = 0 if {"ref", "reference", "truth"} & set(words) else 1
    stem = _stem([w for w in words if w not in ("w", "x", "y", "z") and not w.isdigit()], ())
    letters = rest & {"w", "x", "y", "z"}
    if len(letters) == 1 and rest == letters:
        return [(f"q{letters.pop()}", best, stem, 1.0)]
    numbers = [*indices, *(w for w in rest if w.isdigit())]
    if len(numbers) == 1 and numbers[0] in "01234" and all(w.isdigit() for w in rest):
        return [(f"q#{numbers[0]}", best, stem, 1.0)]
    return []


def _matrix(words: list[str], indices: tuple[str, ...]) -> list[tuple[str, int, str, float]]:
    """``r00`` to ``r22``, or letters: ``R_eb.zx``."""
    if "flown" in words or not {"r", "dcm", "rot", "rotation"} & set(words):
        return []
    rest = [w for w in words if w not in {"r", "dcm", "rot", "rotation", "eb", "matrix"} | _TRUTH | _NEUTRAL]
    at = "".join((*rest, *indices))
    at = "".join(str("xyz".index(c)) if c in "xyz" else c for c in at)
    if re.fullmatch(r"[012][012]", at):
        return [(f"r{at}", 0, "", 1.0)]
    return []


def _scalar(words: list[str], indices: tuple[str, ...]) -> Iterable[tuple[str, int, str, float]]:
    """Quantities without axis or index; earlier entries of `_SCALARS` rank before later ones."""
    synonyms = {"gnss": "gps", "location": "gps", "receiver": "gps", "ublox": "gps", "barometer": "baro"}
    present = {synonyms.get(w, w) for w in words}
    if "truth" in present or indices:
        return
    for rank, (wanted, quantity) in enumerate(_SCALARS):
        if present == wanted or present - _NEUTRAL == wanted or present - _NEUTRAL - {"nav", "pvt"} == wanted:
            gps = 0 if "gps" in present or not quantity.startswith("gps.") else 1
            order = {"ias": 1, "indicated": 1}
            yield quantity, gps + max((order.get(w, 0) for w in wanted), default=0), str(rank), 1.0
            return


def _time(words: list[str]) -> Iterable[tuple[str, int, str, float]]:
    present = set(words) - _NEUTRAL
    core = present & _TIME
    if core and present <= _TIME | _TIME_BESIDE:
        sign = 1e-3 if "millis" in core else 1e-6 if "micros" in core else 1.0
        yield "time", len(present) - 1, "", sign


def automatic(
    header: Iterable[str], row_of_units: Mapping[str, str] | None = None
) -> tuple[dict[str, Meaning], dict[str, tuple[str, ...]]]:
    """Meanings of the columns of `header` that are recognised, and columns that compete for one quantity.

    row_of_units : column -> unit, from a row below the header

    Returns
    -------
    column -> its meaning; quantity -> two or more columns with equally good names
    """
    said = row_of_units or {}
    candidates: dict[str, list[tuple[str, Candidate]]] = {}
    for column in dict.fromkeys(header):
        for one in meanings(column, said.get(column, "")):
            candidates.setdefault(one.quantity, []).append((column, one))
    _number_quaternions(candidates)
    chosen, rivals = dict[str, Meaning](), dict[str, tuple[str, ...]]()
    for group in _groups(candidates):
        best = _best_stems(group, candidates)
        for quantity in group:
            if quantity not in candidates:
                continue
            named = [(column, one) for column, one in candidates[quantity] if best is None or one.stem in best]
            least = min(one.rank for _, one in named) if named else 0
            named = [(column, one) for column, one in named if one.rank == least and column not in chosen]
            if len(named) > 1:
                rivals[quantity] = tuple(column for column, _ in named)
            for column, one in named[:1]:
                chosen[column] = Meaning(one.quantity, one.factor, one.unit_given)
    return chosen, rivals


_VECTORS = (
    *(tuple(f"{name}.{a}" for a in "xyz") for name in ("gyro", "force", "mag")),
    ("gps.vn", "gps.ve", "gps.vd"), ("gps.n", "gps.e", "gps.d"), ("roll", "pitch", "yaw"), ("qw", "qx", "qy", "qz"),
)  # fmt: skip


def _groups(candidates: Mapping[str, object]) -> list[tuple[str, ...]]:
    """Quantities that form a vector, and all others one by one."""
    together = {quantity for group in _VECTORS for quantity in group}
    return [*_VECTORS, *((quantity,) for quantity in candidates if quantity not in together and quantity in QUANTITIES)]


def _best_stems(group: tuple[str, ...], candidates: Mapping[str, list[tuple[str, Candidate]]]) -> set[str] | None:
    """The best stems: most elements of the vector, then the best rank; None for a single quantity."""
    if len(group) == 1:
        return None
    ranks: dict[str, dict[str, int]] = {}
    for quantity in group:
        for _, one in candidates.get(quantity, []):
            of_stem = ranks.setdefault(one.stem, {})
            of_stem[quantity] = min(one.rank, of_stem.get(quantity, one.rank))
    if not ranks:
        return set()
    most = min((-len(named), max(named.values())) for named in ranks.values())
    found = {stem for stem, named in ranks.items() if (-len(named), max(named.values())) == most}
    if -most[0] < len(group):  # no single stem names the whole vector
        return set(ranks)
    return found


def _number_quaternions(candidates: dict[str, list[tuple[str, Candidate]]]) -> None:
    """Give numbered elements, from 0 or from 1, their letters; the scalar part is the first."""
    numbered = {i: candidates.pop(f"q#{i}") for i in range(5) if f"q#{i}" in candidates}
    first = 0 if 0 in numbered else 1
    if set(numbered) != set(range(first, first + 4)):
        return
    for i, letter in enumerate("wxyz"):
        renamed = [(column, one._replace(quantity=f"q{letter}")) for column, one in numbered[first + i]]
        candidates.setdefault(f"q{letter}", []).extend(renamed)
