"""What a column of a log may hold: our names for it, and the dimension of each."""

from typing import NamedTuple


class Quantity(NamedTuple):
    """Something that a column may hold: its dimension, a key of `units.UNITS`."""

    dimension: str


class Meaning(NamedTuple):
    """What one column holds: the `quantity`, and value = factor * (number in the file - offset), in our unit.

    told : whether the unit is given; else it may be judged by the values
    """

    quantity: str
    factor: float = 1.0
    told: bool = True
    offset: float = 0.0


def _vector(name: str, dimension: str) -> dict[str, Quantity]:
    return {f"{name}.{axis}": Quantity(dimension) for axis in "xyz"}


QUANTITIES: dict[str, Quantity] = {
    "time": Quantity("time"),
    "interval": Quantity("time"),
    **_vector("gyro", "rate"),
    **_vector("force", "force"),
    **_vector("mag", "field"),
    "mag.new": Quantity("number"),
    "gps.new": Quantity("number"),
    "gps.valid": Quantity("number"),
    "gps.fix": Quantity("number"),
    "gps.time": Quantity("time"),
    "gps.latitude": Quantity("angle"),
    "gps.longitude": Quantity("angle"),
    "gps.altitude": Quantity("length"),
    **{f"gps.{axis}": Quantity("length") for axis in "ned"},
    **{f"gps.v{axis}": Quantity("speed") for axis in "ned"},
    "gps.speed": Quantity("speed"),
    "gps.course": Quantity("angle"),
    "airspeed": Quantity("speed"),
    "height": Quantity("length"),
    "air.new": Quantity("number"),
    "height.new": Quantity("number"),
    **dict.fromkeys(("roll", "pitch", "yaw"), Quantity("angle")),
    **{f"q{c}": Quantity("number") for c in "wxyz"},
    **{f"r{i}{j}": Quantity("number") for i in range(3) for j in range(3)},
}
INERTIAL = ("gyro.x", "gyro.y", "gyro.z", "force.x", "force.y", "force.z")
FIELD = ("mag.x", "mag.y", "mag.z")
EULER = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")  # in SciPy's order
MATRIX = tuple(f"r{i}{j}" for i in range(3) for j in range(3))
