"""The geofence of a flight: its limits, and what the autopilot does there (`autopilot.fence`)."""

from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

if TYPE_CHECKING:  # the autopilot loads the compiler
    from autopilot.fence import FenceParams


class FenceConfig(BaseModel):
    """A cylinder around the launch point; without a limit there is no fence.

    radius_m : from the launch point     height_m : ceiling above it     None is no limit
    action : "return" to the launch point, then as commanded; "loiter" around it, or "glide" with the motor off, until
    another setpoint is commanded; "report" is an event and nothing else
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    radius_m: float | None = Field(default=None, ge=50.0, le=20000.0)
    height_m: float | None = Field(default=None, ge=45.0, le=5000.0)
    action: Literal["return", "loiter", "glide", "report"] = "return"

    @model_validator(mode="after")
    def _has_a_limit(self) -> "FenceConfig":
        if not self.stands and self.action != "return":
            raise ValueError(f"action = {self.action!r}: there is no fence; set radius_m or height_m too")
        return self

    @property
    def stands(self) -> bool:
        """Whether there is a fence."""
        return self.radius_m is not None or self.height_m is not None

    def build(self) -> "FenceParams | None":
        """For the autopilot; None if there is nothing for it to do."""
        from autopilot.fence import FenceAction, FenceParams

        if not self.stands or self.action == "report":
            return None
        limits = {name: value for name in ("radius_m", "height_m") if (value := getattr(self, name)) is not None}
        return FenceParams(**limits, action=FenceAction[self.action.upper()])


def within_box(fence: FenceConfig, box_radius_m: float, box_height_m: float) -> None:
    """ValueError for a fence beyond the box, where the flight ends before it is reached."""
    for name, limit_m, box_m in (
        ("radius_m", fence.radius_m, box_radius_m),
        ("height_m", fence.height_m, box_height_m),
    ):
        if limit_m is not None and limit_m >= box_m:
            raise ValueError(
                f"fence.{name} = {limit_m:g} m: must be less than box_{name}, {box_m:g} m, where the flight ends"
            )
