"""How a flight begins: trimmed in the air, in the hand that throws, or on a table.

Random values are drawn once, each from its named stream.
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sim.rng import stream

Chance = Literal["random"]
Triple = tuple[float, float, float]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class InFlightStart(_Model):
    """Start in trimmed level flight, `out_m` from the launch point in the direction of the heading."""

    kind: Literal["in_flight"] = "in_flight"
    heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | Chance = "random"
    height_m: float = Field(default=60.0, gt=0.0, le=3000.0)
    out_m: float = Field(default=0.0, ge=0.0, le=5000.0)
    airspeed_m_s: float | None = Field(default=None, gt=0.0)


class HandMotion(_Model):
    """Motion of the hand: rates a_i sin(2 pi f_i t + phase_i) about each axis, and the twist at the release."""

    sway_deg_s: Triple
    sway_hz: Triple
    sway_phase_deg: Triple
    release_rate_deg_s: Triple


class HandThrowStart(_Model):
    """Start in the hand at the launch point, then a throw.

    roll_deg : bank in the hand and of the throw; the wings are level at 0
    backwards : thrown tail first: the push is against the nose
    height_m : of the hand above the ground; above arm's length it is a throw off a slope
    sway_deg_s : largest rate of the hand about each axis     release_rate_deg_s : sigma of the twist, each axis
    hand : "random" draws the motion from these two; a resolved configuration holds what was drawn
    calibration_s : from power-up, over which the gyro offset is measured in the hand
    """

    kind: Literal["hand_throw"] = "hand_throw"
    heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | Chance = "random"
    pitch_deg: float = Field(default=15.0, ge=-30.0, le=60.0)
    roll_deg: float = Field(default=0.0, ge=-90.0, le=90.0)
    backwards: bool = False
    height_m: float = Field(default=1.7, gt=0.0, le=300.0)
    hold_s: float = Field(default=8.0, gt=0.0, le=600.0)
    push_m_s2: float = Field(default=27.0, gt=0.0, le=100.0)
    push_s: float = Field(default=0.3, gt=0.0, le=2.0)
    sway_deg_s: float = Field(default=3.0, ge=0.0, le=60.0)
    release_rate_deg_s: float = Field(default=15.0, ge=0.0, le=90.0)
    calibration_s: float = Field(default=2.0, ge=0.0)
    hand: HandMotion | Chance = "random"

    @model_validator(mode="after")
    def _calibrate_in_the_hand(self) -> "HandThrowStart":
        if self.calibration_s > self.hold_s:
            raise ValueError(
                f"calibration_s = {self.calibration_s:g} s: at most hold_s, the {self.hold_s:g} s in the hand"
            )
        return self


class BenchStart(_Model):
    """At rest on a table indoors for the whole flight: still air, no motor, no controls.

    height_m : of the table     calibration_s : from power-up, over which the gyro offset is measured; judging
    starts after it
    """

    kind: Literal["bench"] = "bench"
    heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | Chance = "random"
    roll_deg: float = Field(default=0.0, ge=-180.0, le=180.0)
    pitch_deg: float = Field(default=0.0, ge=-90.0, le=90.0)
    height_m: float = Field(default=0.8, ge=0.0, le=10.0)
    calibration_s: float = Field(default=2.0, ge=0.0, le=600.0)


AnyStart = InFlightStart | HandThrowStart | BenchStart


def resolve_start(start: AnyStart, seed: int, flight: int) -> Any:
    """`start` in plain numbers: random values drawn, each from its named stream of `seed` and `flight`."""
    if start.heading_deg == "random":
        heading_deg = 360.0 * float(stream(seed, flight, "start_heading").random())
        start = start.model_copy(update={"heading_deg": heading_deg})
    if isinstance(start, HandThrowStart) and start.hand == "random":
        start = start.model_copy(update={"hand": _draw_hand(start, seed, flight)})
    return start


def _draw_hand(start: HandThrowStart, seed: int, flight: int) -> HandMotion:
    """The hand sways at 0.4 to 1.2 Hz, as an arm does; the twist is normal, truncated at two sigma."""
    rng = stream(seed, flight, "hand")
    sway = start.sway_deg_s * rng.uniform(0.5, 1.0, 3)
    hz, phase = rng.uniform(0.4, 1.2, 3), rng.uniform(0.0, 360.0, 3)
    twist = start.release_rate_deg_s * np.clip(rng.standard_normal(3), -2.0, 2.0)
    return HandMotion(
        sway_deg_s=_triple(sway), sway_hz=_triple(hz), sway_phase_deg=_triple(phase), release_rate_deg_s=_triple(twist)
    )


def _triple(values: np.ndarray) -> Triple:
    x, y, z = (float(v) for v in values)
    return x, y, z
