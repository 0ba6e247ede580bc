"""What a column of a log may hold: our names for it, and the dimension of each."""

from typing import NamedTuple


class Meaning(NamedTuple):
    """What one column holds: the `quantity`, and value = factor * (number in the file - offset), in our unit.

    unit_given : whether the unit is stated; if not, the values may show it
    """

    quantity: str
    factor: float = 1.0
    unit_given: bool = True
    offset: float = 0.0


def _vector(name: str, dimension: str) -> dict[str, str]:
    return {f"{name}.{axis}": dimension for axis in "xyz"}


QUANTITIES: dict[str, str] = {  # quantity -> dimension, a key of `units.UNITS`
    "time": "time",
    "interval": "time",
    **_vector("gyro", "rate"),
    **_vector("force", "force"),
    **_vector("mag", "field"),
    "mag.new": "number",
    "gps.new": "number",
    "gps.valid": "number",
    "gps.fix": "number",
    "gps.time": "time",
    "gps.latitude": "angle",
    "gps.longitude": "angle",
    "gps.altitude": "length",
    **{f"gps.{axis}": "length" for axis in "ned"},
    **{f"gps.v{axis}": "speed" for axis in "ned"},
    "gps.speed": "speed",
    "gps.course": "angle",
    "airspeed": "speed",
    "true_airspeed": "speed",
    "height": "length",
    "air.new": "number",
    "height.new": "number",
    **dict.fromkeys(("roll", "pitch", "yaw"), "angle"),
    **{f"q{c}": "number" for c in "wxyz"},
    **{f"r{i}{j}": "number" for i in range(3) for j in range(3)},
}
INERTIAL = ("gyro.x", "gyro.y", "gyro.z", "force.x", "force.y", "force.z")
FIELD = ("mag.x", "mag.y", "mag.z")
EULER = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")  # in SciPy's order
MATRIX = tuple(f"r{i}{j}" for i in range(3) for j in range(3))
