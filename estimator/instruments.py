"""Known properties of the instruments aboard, each with its source.

One record, `Instruments`, is built for each flight or log: from the data sheets of the sensor suite, from the log
itself, and from the user's settings.  An estimator or autopilot receives the properties for which it has a parameter of
the same name; one whose constructor takes an argument ``instruments`` receives the whole record.

>>> instruments.value("gps_latency_s")       # 0.3, or None if unknown
>>> instruments["gps_latency_s"].source      # "data sheet"

A property is a data-sheet value or a setting.  It never depends on the errors drawn for one flight.
"""

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, NamedTuple

Source = Literal["set", "data sheet", "log", "learnt", "assumed", "withheld", "unknown"]


class Property(NamedTuple):
    """One property: its meaning, and the value assumed if unknown; None if there is no sensible assumption."""

    meaning: str
    assumed: float | bool | None = None


# Assumed: a present-day receiver, a present-day inertial unit of 2000 deg/s and 16 g, and a place at sea level.
PROPERTIES: Mapping[str, Property] = {
    "gps_filter_s": Property("time constant of the receiver's velocity filter; 0 is none", 0.0),
    "gps_latency_s": Property("from the moment a fix is true to its arrival", 0.3),
    "gps_latency_sigma_s": Property("standard deviation of that latency", 0.15),
    "gps_stamped": Property("whether a fix carries the time at which it was true", False),
    "gps_vertical_velocity": Property("whether the receiver reports a vertical velocity; else it reads 0"),
    "gps_rate_hz": Property("fixes per second"),
    "gps_noise_m_s": Property("standard deviation of each velocity component of a fix"),
    "gyro_full_scale_rad_s": Property("largest rate that the gyro can read", 34.9),
    "gyro_noise_rad_s_sqrt_hz": Property("one-sided noise density of the gyro samples, quantisation included"),
    "gyro_bias_sigma_rad_s": Property("standard deviation of the gyro bias left after the calibration at power-up"),
    "gyro_gain_sigma": Property("standard deviation of the relative gain error of a gyro axis"),
    "gyro_cross_axis": Property("standard deviation of the sensitivity of a gyro axis to another"),
    "force_full_scale_m_s2": Property("largest specific force that the accelerometer can read", 156.9),
    "force_noise_m_s2_sqrt_hz": Property("one-sided noise density of the accelerometer samples, likewise"),
    "force_bias_sigma_m_s2": Property("standard deviation of the accelerometer bias"),
    "imu_rate_hz": Property("inertial samples per second"),
    "declination_rad": Property("magnetic north from true north, positive to the east"),
    "elevation_m": Property("elevation of the launch place above the sea", 0.0),
    "use_magnetometer": Property("whether a magnetometer is fitted and used"),
    "magnetometer_calibrated": Property("whether its readings are free of iron and motor, by nature or by calibration"),
    "use_airspeed": Property("whether an airspeed sensor is fitted and used"),
}
"""Every property: name, spelled as the parameters of estimators and autopilots -> its meaning."""

DEEPEST_M, HIGHEST_M = -500.0, 9000.0  # places on earth
SIGMA_KNOWN_S = 0.02  # standard deviation of a latency from a data sheet or a log

BOOLEAN = frozenset(
    {"gps_stamped", "gps_vertical_velocity", "use_magnetometer", "magnetometer_calibrated", "use_airspeed"}
)
"""Properties that are true or false; the others are numbers."""


def property_value(name: str, value: Any) -> float | bool:
    """`value` as the type of the property `name`, a number or a switch; it may be given as text.

    Raises
    ------
    ValueError      unknown property, or a value of the wrong type
    """
    property_names([name])
    if name in BOOLEAN:
        truth = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}
        if str(value).lower() not in truth:
            raise ValueError(f"{name} = {value!r}: must be true or false")
        return truth[str(value).lower()]
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r}: must be a number") from None
    if name == "elevation_m" and not DEEPEST_M <= number <= HIGHEST_M:
        raise ValueError(f"{name} = {value!r} m: must be {DEEPEST_M:g} to {HIGHEST_M:g} m above the sea")
    if math.isnan(number) or (number < 0.0 and name not in ("declination_rad", "elevation_m")):
        raise ValueError(f"{name} = {value!r}: must be a number, zero or more")
    return number


def property_names(names: Iterable[str]) -> tuple[str, ...]:
    """`names`, each of a property; ``all`` means every one.  ValueError for an unknown name."""
    wanted = tuple(filter(None, (name.strip() for name in names)))
    if wanted == ("all",):
        return tuple(PROPERTIES)
    for name in wanted:
        if name not in PROPERTIES:
            near = difflib.get_close_matches(name, PROPERTIES, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"choose from {', '.join(PROPERTIES)}"
            raise ValueError(f"unknown property of the instruments {name!r}: {hint}")
    return wanted


class Known(NamedTuple):
    """A property's value and its source; `origin` names the part, log parameter or map."""

    value: Any
    source: Source
    origin: str = ""

    def to_json(self) -> dict[str, Any]:
        """As plain data; JSON has no infinity, so an infinite number becomes the text ``inf``."""
        endless = isinstance(self.value, float) and math.isinf(self.value)
        return {"value": str(self.value) if endless else self.value, "source": self.source}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Known":
        """The inverse of `to_json`."""
        value = data["value"]
        return cls(math.inf if value == "inf" else value, data["source"])


def to_json(known: Mapping[str, Known]) -> dict[str, dict[str, Any]]:
    """`known` as plain data: name -> value and source."""
    return {name: entry.to_json() for name, entry in known.items()}


class Instruments(Mapping[str, Known]):
    """Known properties of the instruments; see the module.  Every name of `PROPERTIES` is in it.

    Parameters
    ----------
    known : known values by name; other names than those of `PROPERTIES` are parameters of single estimators
    settings : the user's settings by name; they override everything else
    withheld : names of properties to hide from flight code
    """

    def __init__(
        self, known: Mapping[str, Known] | None = None, settings: Mapping[str, Any] | None = None,
        withheld: Iterable[str] = (),
    ) -> None:  # fmt: skip
        record = {name: _without_knowledge(name) for name in PROPERTIES} | dict(known or {})
        record |= {name: _without_knowledge(name, withheld=True) for name in withheld}
        record |= {name: Known(value, "set") for name, value in (settings or {}).items()}
        _agree(record)
        self._record = record

    def __getitem__(self, name: str) -> Known:
        return self._record[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._record)

    def __len__(self) -> int:
        return len(self._record)

    def value(self, name: str, default: Any = None) -> Any:
        """The value of a property, `default` if it has none."""
        value = self._record[name].value if name in self._record else None
        return default if value is None else value

    def changed(self, settings: Mapping[str, Any] | None = None, withheld: Iterable[str] = ()) -> "Instruments":
        """A copy with more settings or withheld properties."""
        return Instruments(self._record, settings, withheld)

    @property
    def given(self) -> dict[str, Known]:
        """The properties that have a value, by name."""
        return {name: known for name, known in self._record.items() if known.value is not None}


def _without_knowledge(name: str, *, withheld: bool = False) -> Known:
    """The entry of a property that is unknown or withheld."""
    assumed = PROPERTIES[name].assumed if name in PROPERTIES else None
    if withheld:
        return Known(assumed, "withheld")
    return Known(assumed, "unknown" if assumed is None else "assumed")


def _agree(record: dict[str, Known]) -> None:
    """Apply what follows from other entries: a latency that the user sets overrides time stamps."""
    latency, stamped, sigma = record["gps_latency_s"], record["gps_stamped"], record["gps_latency_sigma_s"]
    if latency.source == "set" and stamped.source != "set":
        record["gps_stamped"] = Known(False, "set", "gps_latency_s is set")
    if sigma.source in ("assumed", "withheld"):
        if latency.source == "set":
            record["gps_latency_sigma_s"] = Known(0.0, "set", "gps_latency_s is set")
        elif latency.source in ("data sheet", "log"):
            record["gps_latency_sigma_s"] = Known(SIGMA_KNOWN_S, latency.source, latency.origin)
