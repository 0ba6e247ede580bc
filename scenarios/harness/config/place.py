"""The launch place of a flight, and the ground around it."""

from pydantic import BaseModel, ConfigDict, Field

from sim.place import (
    HIGHEST_LATITUDE_DEG,
    HIGHEST_M,
    LAUNCH_PLACE,
    LOWEST_M,
    MOST_GROUND_M,
    Place,
)


class PlaceConfig(BaseModel):
    """Where the launch point is: it decides the density of the air, gravity, and the earth's rate and magnetic field.

    latitude_deg, longitude_deg : geodetic, WGS 84; north and east are positive
    elevation_m : of the launch point above the sea
    ground_m : height of the ground far from the launch point, relative to it: below zero for a launch from a hill
    ground_from_m : distance from the launch point up to which the ground is level with it; from there a slope of 1 in 3
    leads to `ground_m`
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    latitude_deg: float = Field(default=LAUNCH_PLACE.latitude_deg, ge=-HIGHEST_LATITUDE_DEG, le=HIGHEST_LATITUDE_DEG)
    longitude_deg: float = Field(default=LAUNCH_PLACE.longitude_deg, ge=-180.0, le=180.0)
    elevation_m: float = Field(default=LAUNCH_PLACE.elevation_m, ge=LOWEST_M, le=HIGHEST_M)
    ground_m: float = Field(default=0.0, ge=-MOST_GROUND_M, le=MOST_GROUND_M)
    ground_from_m: float = Field(default=0.0, ge=0.0, le=20000.0)

    def build(self) -> Place:
        """The place for plant and sensors."""
        return Place(**self.model_dump())
