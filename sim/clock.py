"""Rates of the loop, all on integer steps of the physics."""

from dataclasses import dataclass
from fractions import Fraction

_SAMPLED_HZ = (1, 2, 2.5, 4, 5, 8, 10, 12.5, 20, 25, 40, 50, 100, 200, 400)  # suggested for an invalid rate


PHYSICS_HZ = 200  # where nothing needs more


def physics_hz(imu_hz: int) -> int:
    """Physics rate for an inertial rate: PHYSICS_HZ, or the inertial rate itself where that is higher."""
    return max(PHYSICS_HZ, imu_hz)


def _divides(rate_hz: float, base_hz: int) -> bool:
    return rate_hz > 0 and (Fraction(base_hz) / Fraction(str(rate_hz))).denominator == 1


@dataclass(frozen=True, slots=True)
class Rates:
    """Physics, inertial and GPS rates in hertz; inertial and GPS rate divide the physics rate.

    A tick of the loop is one inertial sample; estimator and autopilot run once per tick.  A GPS report that falls
    between two ticks is delivered in the first tick that ends at or after its arrival.
    """

    physics_hz: int = PHYSICS_HZ
    imu_hz: int = 50
    gps_hz: float = 4.0

    def __post_init__(self) -> None:
        if self.physics_hz not in (100, 200, 400, 1000):
            raise ValueError(f"physics rate {self.physics_hz} Hz: choose 100, 200, 400 or 1000 Hz")
        for what, rate, choices in (
            ("inertial rate", self.imu_hz, (40, 50, 100, 200, 400)),
            ("GPS rate", self.gps_hz, (1, 2, 2.5, 4, 5, 10)),
        ):
            possible = [c for c in choices if _divides(c, self.physics_hz)]
            if rate not in possible:
                names = ", ".join(str(c) for c in possible)
                raise ValueError(
                    f"{what} {rate:g} Hz does not divide the physics rate of {self.physics_hz} Hz into a supported "
                    f"number of steps: choose {names} Hz"
                )

    @property
    def dt_s(self) -> float:
        """Length of a tick, s."""
        return 1.0 / self.imu_hz

    @property
    def steps_per_tick(self) -> int:
        """Physics steps per tick."""
        return self.physics_hz // self.imu_hz

    @property
    def steps_per_fix(self) -> int:
        """Physics steps between two GPS reports."""
        return int(Fraction(self.physics_hz) / Fraction(str(self.gps_hz)))

    def steps_per_sample(self, what: str, rate_hz: float) -> int:
        """Physics steps between two samples of the sensor `what` at `rate_hz`, at most one sample per tick.

        Raises
        ------
        ValueError    the rate is above the inertial rate, or does not divide the physics rate
        """
        if not (rate_hz <= self.imu_hz and _divides(rate_hz, self.physics_hz)):
            possible = [c for c in _SAMPLED_HZ if c <= self.imu_hz and _divides(c, self.physics_hz)]
            raise ValueError(
                f"{what} rate {rate_hz:g} Hz: choose one that divides the physics rate of {self.physics_hz} Hz and is "
                f"at most the inertial rate, {', '.join(f'{c:g}' for c in possible)} Hz among others"
            )
        return int(Fraction(self.physics_hz) / Fraction(str(rate_hz)))

    def ticks(self, duration_s: float) -> int:
        """Whole ticks in `duration_s`."""
        return round(duration_s * self.imu_hz)
