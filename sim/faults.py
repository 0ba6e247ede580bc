"""Faults of a flight: one failure of one channel in one time window, whatever the channel belongs to.

A channel belongs to a family: the sensors (`sim.sensors.faults`), the inertial samples (`sim.sensors.sampling`) or
what moves the aeroplane (`sim.aeroplane.actuators`).  Each family says which channels and kinds it has, what values a
fault takes and what they mean.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Final, Literal, NamedTuple

from sim.aeroplane import actuators
from sim.sensors import faults as sensors
from sim.sensors import sampling

LATEST_S: Final = 36000.0

FamilyName = Literal["sensor", "imu", "actuator"]


class Family(NamedTuple):
    """Channels of one sort, and the faults that they have.

    kinds_of : channel -> kinds
    defaults_of : channel, kind -> default values, as many as it takes; NaN: may be left out
    unit_of : channel, kind -> unit of the values
    wrong : channel, kind, finite values -> what would be right, empty if they are
    """

    name: FamilyName
    channels: tuple[str, ...]
    kinds_of: Callable[[str], tuple[str, ...]]
    defaults_of: Callable[[str, str], tuple[float, ...]]
    unit_of: Callable[[str, str], str]
    wrong: Callable[[str, str, tuple[float, ...]], str]


FAMILIES: Final = (
    Family(
        "sensor", sensors.CHANNELS, sensors.kinds_of, sensors.defaults_of, sensors.unit_of,
        sensors.wrong_values,
    ),
    Family(
        "imu", sampling.CHANNELS, sampling.kinds_of, sampling.defaults_of, sampling.unit_of, sampling.wrong_values,
    ),
    Family(
        "actuator", actuators.CHANNELS, actuators.kinds_of, actuators.defaults_of, actuators.unit_of,
        actuators.wrong_values,
    ),
)  # fmt: skip
CHANNELS: Final = tuple(channel for family in FAMILIES for channel in family.channels)


def family_of(channel: str) -> Family:
    """The family of a channel; ValueError if there is no such channel."""
    for family in FAMILIES:
        if channel in family.channels:
            return family
    raise ValueError(f"fault of {channel!r}: choose from {', '.join(CHANNELS)}")


def kinds_of(channel: str) -> tuple[str, ...]:
    """Kinds of fault of one of the CHANNELS."""
    return family_of(channel).kinds_of(channel)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.  Its text ``channel:kind=values@from-to``, as typed by users, also names its random stream.

    channel : one of CHANNELS                       kind : one of `kinds_of` the channel
    values : see the family of the channel; missing ones are the defaults
    from_s, to_s : since the release; acts at from_s <= t < to_s, to the end if to_s is infinite
    """

    channel: str
    kind: str
    values: tuple[float, ...] = ()
    from_s: float = -LATEST_S
    to_s: float = math.inf

    def __post_init__(self) -> None:
        family = family_of(self.channel)
        if self.kind not in (kinds := family.kinds_of(self.channel)):
            raise ValueError(f"fault of {self.channel}: {self.kind!r}: choose from {', '.join(kinds)}")
        given = tuple(float(value) for value in self.values)
        defaults = family.defaults_of(self.channel, self.kind)
        if len(given) > len(defaults):
            most = len(defaults)
            takes = f"at most {most} value{'s' * (most > 1)}" if defaults else "no value"
            raise ValueError(f"{self.what} = {_numbers(given)}: takes {takes}")
        left_out = tuple(value for value in defaults[len(given) :] if not math.isnan(value))
        object.__setattr__(self, "values", given + left_out)
        self._check_values(family)
        if not (abs(self.from_s) <= LATEST_S and self.from_s < self.to_s and self.to_s > -LATEST_S):
            raise ValueError(
                f"{self.what} from {self.from_s!r} to {self.to_s!r} s: must begin within {LATEST_S:g} s of the release "
                "and end later than it begins"
            )

    def _check_values(self, family: Family) -> None:
        shown = f"{self.what} = {_numbers(self.values)}"
        if not all(math.isfinite(value) for value in self.values):
            raise ValueError(f"{shown}: must be finite, in {family.unit_of(self.channel, self.kind)}")
        if right := family.wrong(self.channel, self.kind, self.values):
            raise ValueError(f"{shown}: {right}")

    @property
    def family(self) -> FamilyName:
        """Name of the family of its channel."""
        return family_of(self.channel).name

    @property
    def part(self) -> str:
        """The sensor or actuator: the channel without its axis."""
        return self.channel.partition(".")[0]

    @property
    def what(self) -> str:
        """Channel and kind."""
        return f"{self.channel}:{self.kind}"

    def __str__(self) -> str:
        values = f"={_numbers(self.values)}" if self.values else ""
        end = f"-{_number(self.to_s)}" if math.isfinite(self.to_s) else ""
        return f"{self.what}{values}@{_number(self.from_s)}{end}"


def of_family(name: FamilyName, faults: Sequence[Fault]) -> list[Fault]:
    """Those of `faults` whose channel belongs to the family of this name, in their order."""
    return [fault for fault in faults if fault.family == name]


def _number(value: float) -> str:
    """Shortest decimal without exponent that parses to `value`."""
    if not math.isfinite(value):
        return str(value)
    return format(Decimal(repr(float(value))), "f").removesuffix(".0")


def _numbers(values: Sequence[float]) -> str:
    return ",".join(_number(value) for value in values)
