"""The air of a configuration: wind, gusts, turbulence and thermals, as typed and as flown.

Directions are those that the air comes FROM, in degrees from north over east.
"""

import math
import re
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import BaseModel, ConfigDict, Field, field_validator

from sim.air import Air, Gust, Thermals
from sim.air.dryden import SEVERITIES_M_S
from sim.air.gust import STRONGEST_M_S
from sim.air.thermal import MOST, place
from sim.outside.numbers import number
from sim.rng import stream

FASTEST_WIND_M_S = 30.0
GUST_LENGTH_S = 2.0
_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
_GUST = re.compile(rf"({_NUMBER})@({_NUMBER})s?(?:/({_NUMBER})s?)?(?::(up|down|along|across|{_NUMBER}))?")
Degrees = Annotated[float, Field(ge=0.0, le=360.0)]
FromWord = Literal["random", "cross", "head", "tail"]
Place = tuple[float, float]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class GustConfig(_Model):
    """A gust with a 1 - cos profile.

    m_s : horizontal part at its peak, below 0 is a lull    up_m_s : vertical part, below 0 is a downdraft
    start_s : since the release                             length_s : from calm to calm
    from_deg : of the horizontal part; "along" the mean wind, or "across" it, from 90 degrees clockwise of the wind's
    """

    m_s: float = Field(ge=-STRONGEST_M_S, le=STRONGEST_M_S)
    up_m_s: float = Field(default=0.0, ge=-STRONGEST_M_S, le=STRONGEST_M_S)
    start_s: float = Field(ge=0.0, le=36000.0)
    length_s: float = Field(default=GUST_LENGTH_S, gt=0.0, le=600.0)
    from_deg: Degrees | Literal["along", "across"] = "along"


class AirConfig(_Model):
    """The mean wind at 10 m height, and shear, gusts, turbulence and thermals.

    wind_from_deg : "random" any direction; by the heading at the start "cross" from its left or right, "head", "tail"
    shear : exponent of the wind's growth with height, 0 none, 0.14 open country, see `sim.air.profile`
    gusts : each as a `GustConfig` or as text, see `parse_gust`
    turbulence_w20_m_s : wind speed at 20 ft that scales the turbulence, MIL-F-8785C, 0 none; or light, moderate, severe
    thermals : how many, placed by chance; or their places, pairs (north, east) in metres from the launch point
    thermal_m_s, inversion_m : convective velocity scale and inversion height, see `sim.air.thermal`
    """

    wind_m_s: float = Field(default=0.0, ge=0.0, le=FASTEST_WIND_M_S)
    wind_from_deg: Degrees | FromWord = 0.0
    shear: float = Field(default=0.0, ge=0.0, le=1.0)
    gusts: tuple[GustConfig, ...] = ()
    turbulence_w20_m_s: float = Field(default=0.0, ge=0.0, le=FASTEST_WIND_M_S)
    thermals: int | tuple[Place, ...] = 0
    thermal_m_s: float = Field(default=2.0, ge=0.0, le=10.0)
    inversion_m: float = Field(default=1200.0, ge=100.0, le=10000.0)

    @property
    def calm(self) -> bool:
        """Whether the air is still."""
        return not (self.wind_m_s or self.gusts or self.turbulence_w20_m_s or self.thermals)

    @field_validator("gusts", mode="before")
    @classmethod
    def _typed_gusts(cls, gusts: Any) -> Any:
        typed = gusts.split(",") if isinstance(gusts, str) else gusts
        if isinstance(typed, list | tuple):
            return [parse_gust(gust) if isinstance(gust, str) else gust for gust in typed]
        return typed

    @field_validator("turbulence_w20_m_s", mode="before")
    @classmethod
    def _typed_turbulence(cls, turbulence: Any) -> Any:
        return parse_turbulence(turbulence) if isinstance(turbulence, str) else turbulence

    @field_validator("thermals", mode="before")
    @classmethod
    def _typed_thermals(cls, thermals: Any) -> Any:
        if isinstance(thermals, list | tuple) and len(thermals) <= MOST:
            return thermals
        if not re.fullmatch(r"[0-9]{1,6}", str(thermals).strip()) or int(thermals) > MOST:
            raise ValueError(f"thermals = {thermals!r}: write their number, a whole number from 0 to {MOST}")
        return int(thermals)


class Wind(NamedTuple):
    """Speed of the wind, and the direction it comes from."""

    m_s: float
    from_deg: float | FromWord


def parse_wind(text: str) -> Wind:
    """Parse a wind: ``5@270`` is 5 m/s from the west.

    Also ``5@random``, by the heading at the start ``5@cross`` (from its left or its right), ``5@head`` and ``5@tail``,
    and ``0`` or ``calm``.

    Raises
    ------
    ValueError      naming what would be right
    """
    tidy = text.strip().lower()
    if tidy in ("0", "calm"):
        return Wind(0.0, 0.0)
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)@(random|cross|head|tail|[0-9]+(?:\.[0-9]*)?)", tidy)
    right = "write speed@direction it comes from, for instance 5@270, 5@random, 5@cross, 5@head or 5@tail, or calm"
    if not found:
        raise ValueError(f"wind = {text!r}: {right}")
    m_s, direction = float(found[1]), found[2]
    if m_s > FASTEST_WIND_M_S:
        raise ValueError(f"wind = {text!r}: {m_s:g} m/s is too much, at most {FASTEST_WIND_M_S:g} m/s")
    for word in get_args(FromWord):
        if direction == word:
            return Wind(m_s, word)
    if float(direction) > 360.0:
        raise ValueError(f"wind = {text!r}: direction {direction} deg is outside 0 to 360 deg; {right}")
    return Wind(m_s, float(direction))


def parse_gust(text: str) -> GustConfig:
    """Parse a gust: ``4@12s`` is 4 m/s more wind, 12 s after the release, over within 2 s.

    ``4@12s/3s`` lasts 3 s; ``4@12s:up``, ``:down``, ``:across`` or ``:90`` (from the east) comes from elsewhere than
    the wind; ``-4@12s`` is a lull.

    Raises
    ------
    ValueError      naming what would be right
    """
    right = (
        "write speed@start, for instance 4@12s, 4@12s/3s (3 s long), 4@12s:up, :down, :across or :90 (from the east)"
    )
    found = _GUST.fullmatch(text.strip().lower())
    if not found:
        raise ValueError(f"gust = {text!r}: {right}")
    m_s, start_s, towards = float(found[1]), float(found[2]), found[4] or "along"
    length_s = float(found[3]) if found[3] else GUST_LENGTH_S
    if not abs(m_s) <= STRONGEST_M_S:
        raise ValueError(f"gust = {text!r}: {m_s:g} m/s is too much, at most {STRONGEST_M_S:g} m/s")
    if not 0.0 <= start_s <= 36000.0:
        raise ValueError(
            f"gust = {text!r}: starts at {start_s:g} s; it must start 0 to 36000 s after the release; {right}"
        )
    if not 0.0 < length_s <= 600.0:
        raise ValueError(f"gust = {text!r}: is {length_s:g} s long; it must be above 0 and at most 600 s; {right}")
    timing = {"start_s": start_s, "length_s": length_s}
    if towards in ("up", "down"):
        return GustConfig(m_s=0.0, up_m_s=m_s if towards == "up" else -m_s, from_deg=0.0, **timing)
    if towards == "along":
        return GustConfig(m_s=m_s, from_deg="along", **timing)
    if towards == "across":
        return GustConfig(m_s=m_s, from_deg="across", **timing)
    if not 0.0 <= float(towards) <= 360.0:
        raise ValueError(f"gust = {text!r}: direction {towards} deg is outside 0 to 360 deg; {right}")
    return GustConfig(m_s=m_s, from_deg=float(towards), **timing)


def parse_turbulence(text: str) -> float:
    """Parse turbulence: a word of MIL-F-8785C or the wind at 20 ft, m/s; the number is not checked here."""
    tidy = text.strip().lower()
    if tidy in SEVERITIES_M_S:
        return SEVERITIES_M_S[tidy]
    try:
        return number(tidy)
    except ValueError:
        words = ", ".join(SEVERITIES_M_S)
        raise ValueError(f"turbulence = {text!r}: write {words}, or the wind at 20 ft in m/s, for instance 3") from None


def resolve_air(air: AirConfig, heading_deg: float, seed: int, flight: int) -> AirConfig:
    """`air` in plain numbers: random directions and places are drawn, each from its own stream."""
    from_deg = air.wind_from_deg
    if isinstance(from_deg, str):
        draw = stream(seed, flight, "wind_direction").random()
        right_of_nose_deg = {"cross": 90.0 if draw < 0.5 else 270.0, "head": 0.0, "tail": 180.0}
        from_deg = 360.0 * draw if from_deg == "random" else (heading_deg + right_of_nose_deg[from_deg]) % 360.0
    words = {"along": float(from_deg), "across": float(from_deg + 90.0) % 360.0}
    gusts = tuple(
        gust.model_copy(update={"from_deg": words[gust.from_deg]}) if isinstance(gust.from_deg, str) else gust
        for gust in air.gusts
    )
    thermals = air.thermals
    if isinstance(thermals, int):
        thermals = place(thermals, air.inversion_m, stream(seed, flight, "thermals"))
    return air.model_copy(update={"wind_from_deg": float(from_deg), "gusts": gusts, "thermals": thermals})


def build_air(air: AirConfig) -> Air:
    """The air of a resolved configuration, which says where the wind comes from; `Air` takes where it goes."""
    if isinstance(air.wind_from_deg, str) or isinstance(air.thermals, int):
        raise ValueError(f"air.wind_from_deg = {air.wind_from_deg!r}: resolve the configuration first")
    return Air(
        wind_e_m_s=_towards(air.wind_m_s, air.wind_from_deg, 0.0),
        turbulence_w20_m_s=air.turbulence_w20_m_s,
        shear=air.shear,
        gusts=tuple(_built(gust) for gust in air.gusts),
        thermals=Thermals(air.thermals, air.thermal_m_s, air.inversion_m),
    )


def _built(gust: GustConfig) -> Gust:
    if isinstance(gust.from_deg, str):
        raise ValueError(f"gust from_deg = {gust.from_deg!r}: resolve the configuration first")
    return Gust(_towards(gust.m_s, gust.from_deg, gust.up_m_s), gust.start_s, gust.length_s)


def _towards(m_s: float, from_deg: float, up_m_s: float) -> tuple[float, float, float]:
    """Velocity north, east, down."""
    from_rad = math.radians(from_deg)
    return -m_s * math.cos(from_rad), -m_s * math.sin(from_rad), -up_m_s
