"""The circuit board that gyro and accelerometer sit on: where, how crooked, how warm, on what supply, how shaken."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from sim.sensors.noise import require

Triple = tuple[float, float, float]
STILL: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class BoardParams:
    """What gyro and accelerometer share.  The defaults are a perfect board at the centre of gravity.

    lever_arm_b_m : (3,) from the centre of gravity to the accelerometer, body axes
    mounting_deg : (3,) roll, pitch and yaw by which the board is crooked, and the firmware does not know it
    supply_tolerance : sigma of the supply voltage's relative error, constant in a flight
    supply_sag : relative fall of the supply at full throttle
    converter_ratiometric : the converter measures in units of the supply; otherwise of a reference of its own
    warming_k : how much warmer the parts are in the end than at power-up      warming_s : time constant of that
    vibration_g, vibration_deg_s : amplitude of each axis at the motor speed `vibration_rpm`, once per
    revolution; it grows with the square of the speed (a rotor out of balance)
    """

    lever_arm_b_m: Triple = STILL
    mounting_deg: Triple = STILL
    supply_tolerance: float = 0.0
    supply_sag: float = 0.0
    converter_ratiometric: bool = True
    warming_k: float = 0.0
    warming_s: float = 300.0
    vibration_g: float = 0.0
    vibration_deg_s: float = 0.0
    vibration_rpm: float = 8000.0

    def __post_init__(self) -> None:
        require(self, "(a fraction)", "supply_tolerance", "supply_sag")
        require(self, "K", "warming_k")
        require(self, "s", "warming_s", least=0.001)
        require(self, "g", "vibration_g")
        require(self, "deg/s", "vibration_deg_s")
        require(self, "rpm", "vibration_rpm", least=1.0)


def warming(params: BoardParams, t_s: Array) -> Array:
    """How much warmer than at power-up the parts are `t_s` later, K: a body that takes up a constant power.

    Newton's law of cooling: dT/dt = (warming_k - T) / warming_s, T(0) = 0.
    """
    return -params.warming_k * np.expm1(-t_s / params.warming_s)


UNIT = np.dtype([("lever_arm_b_m", "f8", (3,))], align=True)


def make(params: BoardParams, unit: NDArray[np.void]) -> None:
    """Make one board: set its constants in `unit`, shape (1,) of UNIT."""
    unit["lever_arm_b_m"] = params.lever_arm_b_m
