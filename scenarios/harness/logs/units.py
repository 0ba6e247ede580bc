"""Spellings of units in column maps and file headers.

Case, blanks and synonyms make no difference: ``µT``, ``uT`` and ``microtesla`` are one unit, and so are ``m/s²``,
``m/s^2`` and ``m/s/s``.  A letter may depend on the dimension: ``G`` is a gauss for a magnetic field and standard
gravity for a force.
"""

import re
from collections.abc import Mapping

import numpy as np

from estimator.interface import G_M_S2

_DEG, KN_M_S, FT_M, MI_M = np.pi / 180.0, 1852.0 / 3600.0, 0.3048, 1609.344
COUNTS = ("count", "counts", "lsb", "raw", "adc", "digit", "digits")  # not units: they need a factor

UNITS: dict[str, dict[str, float]] = {  # dimension -> unit -> factor to ours; the first one is ours
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rate": {
        "rad/s": 1.0, "deg/s": _DEG, "dps": _DEG, "mrad/s": 1e-3, "mdeg/s": 1e-3 * _DEG, "deg/h": _DEG / 3600.0,
        "rpm": 2.0 * np.pi / 60.0,
    },
    "force": {
        "m/s^2": 1.0, "m/s2": 1.0, "g": G_M_S2, "mg": 1e-3 * G_M_S2, "ug": 1e-6 * G_M_S2, "cm/s^2": 0.01,
        "mm/s^2": 1e-3, "ft/s^2": FT_M,
    },
    "field": {"uT": 1.0, "nT": 1e-3, "mT": 1e3, "T": 1e6, "gauss": 100.0, "G": 100.0, "mgauss": 0.1, "mG": 0.1},
    "angle": {"rad": 1.0, "deg": _DEG, "mrad": 1e-3, "cdeg": 0.01 * _DEG, "1e-7deg": 1e-7 * _DEG},
    "speed": {
        "m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": KN_M_S, "mph": MI_M / 3600.0, "ft/s": FT_M,
    },
    "length": {"m": 1.0, "cm": 0.01, "mm": 1e-3, "km": 1e3, "ft": FT_M},
    "number": {"1": 1.0},
}  # fmt: skip

_SPELLED: dict[str, dict[str, str]] = {  # dimension -> spelling -> unit, beside those above
    "rate": {"rad": "rad/s", "deg": "deg/s", "rads": "rad/s", "degs": "deg/s", "degps": "deg/s", "deg/hr": "deg/h",
             "rad s^-1": "rad/s", "deg s^-1": "deg/s"},
    "force": {
        "m/s/s": "m/s^2", "mps2": "m/s^2", "m s^-2": "m/s^2", "ms^-2": "m/s^2", "m/ss": "m/s^2", "m s-2": "m/s^2",
        "mps^2": "m/s^2", "gs": "g", "g0": "g", "gn": "g", "ft/s2": "ft/s^2", "ft/s/s": "ft/s^2",
    },
    "field": {"ga": "G", "mga": "mG"},
    "angle": {"deg*1e7": "1e-7deg", "dege7": "1e-7deg", "1e7deg": "1e-7deg", "deg*1e-7": "1e-7deg",
              "deg*100": "cdeg"},
    "speed": {"mps": "m/s", "m s^-1": "m/s", "kph": "km/h", "kmh": "km/h", "kmph": "km/h", "fps": "ft/s",
              "mi/h": "mph"},
    "number": {"-": "1", "": "1"},
}  # fmt: skip

_SYNONYMS = (
    ("[µμ]", "u"), ("[°º]", "deg"), ("²|⁽²⁾", "^2"), ("⁻¹", "^-1"), (r"\*\*", "^"), ("[·⋅\u00d7]", "*"),
    (r"\bper\b", "/"), ("milli", "m"), ("micro", "u"), ("nano", "n"), ("centi", "c"), ("kilo", "k"),
    ("degrees?", "deg"), ("radians?", "rad"), ("sec(ond)?s?", "s"), ("met(er|re)s?", "m"), ("tesla", "t"),
    (r"\b(knots?|kts?)\b", "kn"), (r"\b(feet|foot)\b", "ft"), (r"\b(hours?|hr)\b", "h"), (r"\bmiles?\b", "mi"),
)  # fmt: skip


def plain(spelled: str) -> str:
    """A unit with case, blanks and synonyms normalised."""
    unit = spelled.strip().lower()
    for old, new in _SYNONYMS:
        unit = re.sub(old, new, unit)
    unit = re.sub(r"\s*([/^*])\s*", r"\1", unit)
    return " ".join(unit.split())


def _table(dimension: str) -> dict[str, float]:
    units = UNITS[dimension]
    known = {plain(unit): factor for unit, factor in units.items()}
    return known | {spelled: units[unit] for spelled, unit in _SPELLED.get(dimension, {}).items()}


_KNOWN = {dimension: _table(dimension) for dimension in UNITS}


def factor_of(spelled: str, dimension: str) -> float | None:
    """Factor from the unit `spelled` to ours; None if the dimension has no such unit."""
    return _KNOWN[dimension].get(plain(spelled))


def is_unit(spelled: str) -> bool:
    """Whether `spelled` is a unit of any dimension, or a word for counts."""
    unit = plain(spelled)
    return unit in COUNTS or any(unit in known for known in _KNOWN.values())


def _parts(unit: str) -> str:
    """A unit as the end of a name, its words joined by underscores: ``m_s_2``."""
    return "_".join(re.findall(r"[a-z]+|\d+", unit))


_ENDINGS: Mapping[str, frozenset[str]] = {
    ending: frozenset(unit for known in _KNOWN.values() for unit in known if _parts(unit) == ending)
    for ending in {_parts(unit) for known in _KNOWN.values() for unit in known} - {"", "1"}
}


def at_end(words: list[str]) -> tuple[str, int]:
    """The unit in the last `words` of a name, and how many words it takes; ``("", 0)`` if there is none."""
    for n in range(min(4, len(words) - 1), 0, -1):
        found = _ENDINGS.get("_".join(words[-n:]))
        if found:
            return min(found, key=len), n
    return "", 0
