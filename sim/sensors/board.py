"""The circuit board that gyro and accelerometer sit on: where, how crooked, how warm, on what supply, how shaken."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.clock import Rates
from sim.sensors.noise import Output, Source, require

Triple = tuple[float, float, float]
STILL: Triple = (0.0, 0.0, 0.0)
LONGEST_REST_S = 600.0  # it is simulated, and held in memory
MOST_SUPPLY_ERROR = 0.1  # five sigma of it and the largest sag leave a supply above zero
MOST_SUPPLY_SAG = 0.4


@dataclass(frozen=True, slots=True)
class BoardParams:
    """What gyro and accelerometer share.  The defaults are a perfect board at the centre of gravity.

    lever_arm_b_m : (3,) from the centre of gravity to gyro and accelerometer, body axes
    mounting_deg : (3,) roll, pitch and yaw by which the board is crooked, and the firmware does not know it
    supply_tolerance : sigma of the supply voltage's relative error, constant in a flight
    supply_sag : relative fall of the supply at full throttle
    converter_ratiometric : the converter measures in units of the supply; otherwise of a reference of its own
    rest_s : how long the firmware averages the sensors, level on the ground, before a flight that starts in the air
    (a throw is calibrated in the hand); 0 is not at all
    warming_k : how much warmer the parts are in the end than at power-up      warming_s : time constant of that
    vibration_g, vibration_deg_s : amplitude of each axis at the motor speed `vibration_rpm`, once per
    revolution; it grows with the square of the speed (a rotor out of balance)
    """

    lever_arm_b_m: Triple = STILL
    mounting_deg: Triple = STILL
    supply_tolerance: float = 0.0
    supply_sag: float = 0.0
    converter_ratiometric: bool = True
    rest_s: float = 0.0
    warming_k: float = 0.0
    warming_s: float = 300.0
    vibration_g: float = 0.0
    vibration_deg_s: float = 0.0
    vibration_rpm: float = 8000.0

    def __post_init__(self) -> None:
        require(self, "(a fraction)", "supply_tolerance", "supply_sag")
        for name, most in (("supply_tolerance", MOST_SUPPLY_ERROR), ("supply_sag", MOST_SUPPLY_SAG)):
            if getattr(self, name) > most:
                raise ValueError(f"BoardParams.{name} = {getattr(self, name)!r} (a fraction): choose at most {most:g}")
        for name, unit in (("lever_arm_b_m", "m"), ("mounting_deg", "deg")):
            value = getattr(self, name)
            if len(value) != 3 or not all(map(math.isfinite, value)):
                raise ValueError(f"BoardParams.{name} = {value!r} {unit}: choose three finite numbers")
        require(self, "K", "warming_k")
        require(self, "s", "rest_s")
        if self.rest_s > LONGEST_REST_S:
            raise ValueError(f"BoardParams.rest_s = {self.rest_s:g} s: choose at most {LONGEST_REST_S:g} s")
        require(self, "s", "warming_s", least=0.001)
        require(self, "g", "vibration_g")
        require(self, "deg/s", "vibration_deg_s")
        require(self, "rpm", "vibration_rpm", least=1.0)

    def supply_power(self, output: Output) -> int:
        """Power of the supply, relative to its nominal value, that a part of this `output` is multiplied by."""
        if not (self.supply_tolerance or self.supply_sag) or output == "digital":
            return 0
        return (output == "ratiometric") - self.converter_ratiometric


def warming(params: BoardParams, t_s: Array) -> Array:
    """How much warmer than at power-up the parts are `t_s` later, K: a body that takes up a constant power.

    Newton's law of cooling: dT/dt = (warming_k - T) / warming_s, T(0) = 0.
    """
    return -params.warming_k * np.expm1(-t_s / params.warming_s)


UNIT = np.dtype(
    [
        ("changes", "i8"),  # whether anything here differs from tick to tick
        ("dt_s", "f8"),
        ("lever_arm_b_m", "f8", (3,)),
        ("supply", "f8"),  # relative to its nominal value, without load
        ("supply_sag", "f8"),
        ("warming_k", "f8"),
        ("warming_s", "f8"),
        ("shaken_at_hz", "f8"),
    ],
    align=True,
)
MEMORY = np.dtype(
    [
        ("turned_rad", "f8"),  # angle of the rotor at the end of the tick, less whole turns
        ("rotor_rad", "f8"),  # and half-way through it
        ("rotor_hz", "f8"),  # mean speed in the tick
        ("warmer_k", "f8"),  # than at power-up
        ("supply", "f8"),  # relative to its nominal value
    ],
    align=True,
)


def make(params: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one board: draw its supply and set its constants in `unit`, shape (1,) of UNIT."""
    unit["dt_s"] = rates.dt_s
    unit["lever_arm_b_m"] = params.lever_arm_b_m
    wrong = params.supply_tolerance * source("board supply").standard_normal() if params.supply_tolerance else 0.0
    unit["supply"] = 1.0 + wrong
    for name in ("supply_sag", "warming_k", "warming_s"):
        unit[name] = getattr(params, name)
    unit["shaken_at_hz"] = params.vibration_rpm / 60.0
    changing = (
        params.supply_tolerance,
        params.supply_sag,
        params.warming_k,
        params.vibration_g,
        params.vibration_deg_s,
    )
    unit["changes"] = any(changing)


@kernel
def attend(truth, k, unit, memory):  # type: ignore[no-untyped-def]
    """Follow warmth, supply and rotor through tick k; `memory` is a record of MEMORY.

    The rotor's speed in the tick is the mean of those at its ends.
    """
    row = truth[k]
    memory.warmer_k = -unit.warming_k * np.expm1(-row.t_s / unit.warming_s)  # as `warming`
    memory.supply = unit.supply - unit.supply_sag * row.throttle
    rpm = 0.5 * (row.rotor_rpm + truth[k - 1].rotor_rpm) if k > 0 else row.rotor_rpm
    memory.rotor_hz = rpm / 60.0
    turn = 2.0 * np.pi * memory.rotor_hz * unit.dt_s
    memory.rotor_rad = memory.turned_rad + 0.5 * turn
    memory.turned_rad = (memory.turned_rad + turn) % (2.0 * np.pi)
