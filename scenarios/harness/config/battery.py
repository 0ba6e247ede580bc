"""The battery of a configuration."""

from pydantic import BaseModel, ConfigDict, Field, model_validator

from sim.aeroplane.actuators import require_motor
from sim.aeroplane.battery import BatteryParams


class BatteryConfig(BaseModel):
    """The battery of the motor: its voltage falls with the charge drawn and sags with the current.

    capacity_mah : of a full battery; None is a battery that always gives the voltage of the design
    charge : at the start, fraction of full
    resistance_ohm : beyond that of a good battery, which is part of the model of the motor
    cutoff_v : voltage of each cell below which the speed controller takes the motor back
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    capacity_mah: float | None = Field(default=None, gt=0.0, le=100_000.0)
    charge: float = Field(default=1.0, ge=0.0, le=1.0)
    resistance_ohm: float = Field(default=0.0, ge=0.0, le=10.0)
    cutoff_v: float = Field(default=3.0, ge=0.0, le=4.0)

    @model_validator(mode="after")
    def _has_a_capacity(self) -> "BatteryConfig":
        changed = [name for name, field in type(self).model_fields.items() if getattr(self, name) != field.default]
        if self.capacity_mah is None and changed:
            raise ValueError(
                f"battery.{changed[0]} = {getattr(self, changed[0]):g}: without a capacity the voltage is constant; "
                "set battery.capacity_mah as well, in mAh"
            )
        return self

    def require_possible(self, aircraft: str, flies: bool) -> None:
        """ValueError for a battery without a motor that could draw from it."""
        if self.capacity_mah is not None:
            require_motor(aircraft)
            if not flies:
                raise ValueError("battery.capacity_mah: the flight is on a table, with the motor off; leave it out")

    def build(self) -> BatteryParams | None:
        """The battery; None for one that always gives the voltage of the design."""
        if self.capacity_mah is None:
            return None
        return BatteryParams(self.capacity_mah, self.charge, self.resistance_ohm, self.cutoff_v)
