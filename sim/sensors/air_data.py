"""Air data: a pitot tube for the airspeed and a barometer for the height."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.jit import kernel
from sim.clock import Rates
from sim.sensors.noise import Source, require


@dataclass(frozen=True, slots=True)
class AirspeedParams:
    """Errors of a pitot tube with its pressure sensor; the defaults are perfect."""

    noise_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "Pa", "noise_pa")


@dataclass(frozen=True, slots=True)
class BarometerParams:
    """Errors of a barometer; the defaults are perfect."""

    noise_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "Pa", "noise_pa")


UNIT = np.dtype([("fitted", "i8")], align=True)
NOISE = (("airspeed_noise_pa", "f8"), ("baro_noise_pa", "f8"))


def make(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    unit: NDArray[np.void],
) -> None:  # fmt: skip
    """Make both: set their constants in `unit`, shape (1,) of UNIT."""
    unit["fitted"] = 1


def draw(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    noise: NDArray[np.void],
) -> None:  # fmt: skip
    """Draw the errors of every tick into the columns NOISE of `noise`."""


@kernel
def measure_air(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Fill the air-data columns of row `k`; `unit` is a record of UNIT."""
    measured[k].air_new = 0
