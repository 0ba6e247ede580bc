"""Magnetometer: the earth's field in body axes, with the iron, the currents and the noise of an aeroplane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.jit import kernel
from sim.clock import Rates
from sim.sensors.noise import Source, require


@dataclass(frozen=True, slots=True)
class MagnetometerParams:
    """Errors of a three-axis magnetometer; the defaults are perfect."""

    rate_hz: float = 10.0
    noise_ut: float = 0.0

    def __post_init__(self) -> None:
        require(self, "uT", "noise_ut")


UNIT = np.dtype([("fitted", "i8"), ("steps_per_sample", "i8")], align=True)
NOISE = (("mag_noise_b_ut", "f8", (3,)),)


def make(params: MagnetometerParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one magnetometer: set its constants in `unit`, shape (1,) of UNIT."""
    unit["fitted"] = 1


def draw(params: MagnetometerParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw the errors of every tick into the columns NOISE of `noise`."""


@kernel
def measure_field(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Fill the magnetometer's columns of row `k`; `unit` is a record of UNIT."""
    measured[k].mag_new = 0
