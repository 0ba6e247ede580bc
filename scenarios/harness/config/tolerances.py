"""An aeroplane built by hand: how it differs from its drawing, and the tolerances from which that is drawn.

``airframe.mass_factor=1.1`` is a difference; ``tolerances.mass=0.05`` is the standard deviation from which one is drawn
for each flight.  A difference that is set is not drawn.  The autopilot always has the gains of the drawing.
"""

import math
from collections.abc import Mapping
from statistics import NormalDist
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from scenarios.harness.config.validation import validated
from sim.aeroplane.built import AS_DRAWN, AsBuilt, drawn_inertia_kg_m2, has_motor, require_flyable
from sim.outside.wording import brief
from sim.params import near_misses
from sim.rng import stream

if TYPE_CHECKING:
    from scenarios.harness.config.flight import FlightConfig

MOST_SIGMA = 2.0  # beyond which nothing is drawn: a builder would have noticed
Chance = Literal["random"]
Factor = Annotated[float, Field(gt=0.0, le=5.0)] | Chance
Deflection = Annotated[float, Field(ge=-1.0, le=1.0)] | Chance


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class AirframeConfig(_Model):
    """Differences of the aeroplane from its drawing, see `sim.aeroplane.built.AsBuilt`.

    "random" draws a difference from the tolerance; a resolved configuration holds what was drawn.

    mass_factor : of the drawn mass; the moments of inertia change with it
    cg_aft : centre of gravity behind the drawn one, in mean chords
    roll_inertia_factor, pitch_inertia_factor, yaw_inertia_factor : of the moments of inertia, on top of the mass's
    aileron_trim, elevator_trim, rudder_trim : deflection at neutral command, of the full one
    thrust_factor : of the thrust at the same propeller speed and airspeed
    warp_deg : incidence of the left half of the wing less that of the right half: above 0 rolls right
    """

    mass_factor: Factor = "random"
    cg_aft: Annotated[float, Field(ge=-1.0, le=1.0)] | Chance = "random"
    roll_inertia_factor: Factor = "random"
    pitch_inertia_factor: Factor = "random"
    yaw_inertia_factor: Factor = "random"
    aileron_trim: Deflection = "random"
    elevator_trim: Deflection = "random"
    rudder_trim: Deflection = "random"
    thrust_factor: Factor = "random"
    warp_deg: Annotated[float, Field(ge=-10.0, le=10.0)] | Chance = "random"


class TolerancesConfig(_Model):
    """Standard deviations of the differences from the drawing; 0, the default, is built as drawn.

    Each difference is normally distributed, up to two standard deviations, and has its own random stream.  What an
    aeroplane does not have is not drawn, and on a table nothing is.

    mass : of the mass, 0.05 is 5 %         cg : of the centre of gravity along the fuselage, of the mean chord
    inertia : of the spread of the mass along each of the three axes, which makes the moments of inertia
    trim : of the neutral position of each surface, of its full deflection
    thrust : of the thrust of the motor     warp_deg : of the twist between the halves of the wing
    """

    mass: float = Field(default=0.0, ge=0.0, le=0.3)
    cg: float = Field(default=0.0, ge=0.0, le=0.2)
    inertia: float = Field(default=0.0, ge=0.0, le=0.4)
    trim: float = Field(default=0.0, ge=0.0, le=0.4)
    thrust: float = Field(default=0.0, ge=0.0, le=0.4)
    warp_deg: float = Field(default=0.0, ge=0.0, le=4.0)

    @property
    def none(self) -> bool:
        """Whether everything is built as drawn."""
        return not any(value for _, value in self)


def resolve_airframe(
    airframe: AirframeConfig, tolerances: TolerancesConfig, aircraft: str, flies: bool, seed: int, flight: int
) -> AirframeConfig:
    """`airframe` in plain numbers: differences that are left to chance are drawn, each from its own stream."""

    def drawn(name: str, sigma: float) -> float:
        return sigma * _normal(stream(seed, flight, f"airframe_{name}")) if sigma and flies else 0.0

    t = tolerances
    roll, pitch, yaw = _inertia_factors(aircraft, [drawn(f"inertia_{axis}", t.inertia) for axis in "xyz"])
    values = {
        "mass_factor": 1.0 + drawn("mass", t.mass),
        "cg_aft": drawn("cg", t.cg),
        "roll_inertia_factor": roll,
        "pitch_inertia_factor": pitch,
        "yaw_inertia_factor": yaw,
        **{f"{surface}_trim": drawn(f"{surface}_trim", t.trim) for surface in ("aileron", "elevator", "rudder")},
        "thrust_factor": 1.0 + (drawn("thrust", t.thrust) if has_motor(aircraft) else 0.0),
        "warp_deg": drawn("warp", t.warp_deg),
    }
    left = {name: value for name, value in values.items() if getattr(airframe, name) == "random"}
    return airframe.model_copy(update=left) if left else airframe


def built(airframe: AirframeConfig) -> AsBuilt:
    """The aeroplane of a resolved configuration."""
    values: dict[str, Any] = dict(airframe)
    if "random" in values.values():
        raise ValueError("airframe: resolve the configuration first")
    return AsBuilt(**values)


def set_airframe(changes: Mapping[str, Any]) -> AsBuilt:
    """The aeroplane with differences by dotted names, ``airframe.mass_factor``, and as drawn else; ValueError."""
    names = [f"airframe.{name}" for name in AirframeConfig.model_fields]
    for name in changes:
        if name not in names:
            raise ValueError(f"unknown parameter {brief(name)}: {near_misses(name, names)}")
    values = {name.removeprefix("airframe."): value for name, value in changes.items()}
    data = {"airframe": {name: value for name, value in values.items() if value != "random"}}
    return built(resolve_airframe(validated(_Alone, data).airframe, TolerancesConfig(), "", False, 0, 0))


class _Alone(_Model):
    """So that messages name the fields as a whole configuration does."""

    airframe: AirframeConfig


def require_sound(config: "FlightConfig") -> None:
    """ValueError in one line if the aeroplane of a resolved configuration cannot fly, or does not leave its table."""
    from sim.aeroplane.jsbsim_model import Model  # takes long to load, and is needed here only for a difference

    as_built = built(config.airframe)
    if as_built != AS_DRAWN:
        if not config.flies:
            raise ValueError("airframe: the flight is on a table, where it changes nothing; leave it as it is")
        require_flyable(Model(config.aircraft, config.rates.build().physics_hz, as_built, config.place.build()))


def _normal(rng: np.random.Generator) -> float:
    """A standard normal number between -MOST_SIGMA and MOST_SIGMA, from one draw (inverse of the distribution)."""
    normal = NormalDist()
    low, high = normal.cdf(-MOST_SIGMA), normal.cdf(MOST_SIGMA)
    return normal.inv_cdf(low + (high - low) * rng.random())


def _inertia_factors(aircraft: str, spread: list[float]) -> tuple[float, float, float]:
    """Factors of the moments of inertia, with the mass spread more along x, y and z by these fractions.

    The moments are sums of two spreads each, ``Ixx = sum m (y^2 + z^2)``, so that any spread is a possible body,
    while moments drawn one by one may not be.
    """
    if not any(spread):
        return 1.0, 1.0, 1.0
    moments = drawn_inertia_kg_m2(aircraft)
    half = 0.5 * math.fsum(moments)
    x, y, z = ((half - moment) * (1.0 + more) for moment, more in zip(moments, spread, strict=True))
    roll, pitch, yaw = (now / drawn for now, drawn in zip((y + z, x + z, x + y), moments, strict=True))
    return roll, pitch, yaw
