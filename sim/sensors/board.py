"""The circuit board of gyro and accelerometer: position, misalignment, temperature, supply and vibration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.clock import Rates
from sim.sensors.noise import Output, Source, require, require_triple

Triple = tuple[float, float, float]
STILL: Triple = (0.0, 0.0, 0.0)
LONGEST_REST_S = 600.0  # all of it is simulated and held in memory
MOST_SUPPLY_ERROR = 0.1  # five sigma and the largest sag leave the supply above zero
MOST_SUPPLY_SAG = 0.4
MOST_JITTER = 0.4  # the shortest intervals are then next to nothing


@dataclass(frozen=True, slots=True)
class BoardParams:
    """What gyro and accelerometer share.  The defaults are a perfect board at the centre of gravity.

    A larger figure disturbs the sensors more unless stated otherwise, and 0 removes that effect.

    lever_arm_b_m : (3,) from the centre of gravity to gyro and accelerometer, body axes (m, default 0)
    mounting_deg : (3,) roll, pitch and yaw misalignment of the board, unknown to the firmware (deg, default 0)
    supply_tolerance : sigma of the relative error of the supply voltage, constant in a flight (fraction, default 0)
    supply_sag : relative fall of the supply at full throttle (fraction, default 0)
    converter_ratiometric : the converter's reference is the supply; if not, a fixed voltage (default True)
    rest_s : time the firmware averages the sensors, level on the ground, before a flight that starts in the air; a
        throw is calibrated in the hand (s, default 0: not at all).  Higher: the turn-on bias is known better
    warming_k : how much warmer the parts end up than at power-up (K, default 0)
    warming_s : time constant of the warm-up, and of a gyro's drift with it (s, default 300).  Lower: biases change
        sooner after power-up, and a drift ends sooner and smaller
    vibration_g, vibration_deg_s : amplitude per axis at the motor speed `vibration_rpm`, once per revolution; it
        grows with the square of the speed, as of an unbalanced rotor (g and deg/s, default 0)
    vibration_rpm : motor speed at which those amplitudes hold (rpm, default 8000).  Higher: less at the same speed
    dt_jitter : sigma of the length of the interval of an inertial sample, as a loop jitters; see `sim.sensors.sampling`
        (fraction of the nominal length, default 0).  Higher: less even, and older samples
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
    dt_jitter: float = 0.0

    def __post_init__(self) -> None:
        require(self, "supply_tolerance", most=MOST_SUPPLY_ERROR)
        require(self, "supply_sag", most=MOST_SUPPLY_SAG)
        require_triple(self, "lever_arm_b_m", "mounting_deg")
        require(self, "rest_s", most=LONGEST_REST_S)
        require(self, "warming_k", "vibration_g", "vibration_deg_s")
        require(self, "warming_s", least=0.001)
        require(self, "vibration_rpm", least=1.0)
        require(self, "dt_jitter", most=MOST_JITTER)

    def supply_power(self, output: Output) -> int:
        """Power of the relative supply voltage by which the reading of a part with this `output` is multiplied."""
        if not (self.supply_tolerance or self.supply_sag) or output == "digital":
            return 0
        return (output == "ratiometric") - self.converter_ratiometric


def warming(params: BoardParams, t_s: Array) -> Array:
    """Temperature rise of the parts `t_s` after power-up, K, under constant heating.

    Newton's law of cooling: dT/dt = (warming_k - T) / warming_s, T(0) = 0.
    """
    return -params.warming_k * np.expm1(-t_s / params.warming_s)


UNIT = np.dtype(
    [
        ("changes", "i8"),  # whether anything here changes from tick to tick
        ("dt_s", "f8"),
        ("lever_arm_b_m", "f8", (3,)),
        ("supply", "f8"),  # relative to nominal, without load
        ("supply_sag", "f8"),
        ("warming_k", "f8"),
        ("warming_s", "f8"),
        ("shaken_at_hz", "f8"),
    ],
    align=True,
)
MEMORY = np.dtype(
    [
        ("turned_rad", "f8"),  # rotor angle at the end of the tick, modulo a turn
        ("rotor_rad", "f8"),  # and at mid-tick
        ("rotor_hz", "f8"),  # mean over the tick
        ("warmer_k", "f8"),  # rise since power-up
        ("supply", "f8"),  # relative to nominal
    ],
    align=True,
)


def make(params: BoardParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one board: draw its supply voltage and set its constants in `unit`, shape (1,) of UNIT."""
    unit["dt_s"] = rates.dt_s
    unit["lever_arm_b_m"] = params.lever_arm_b_m
    wrong = params.supply_tolerance * source("board supply").standard_normal() if params.supply_tolerance else 0.0
    unit["supply"] = 1.0 + wrong
    for name in ("supply_sag", "warming_k", "warming_s"):
        unit[name] = getattr(params, name)
    unit["shaken_at_hz"] = params.vibration_rpm / 60.0
    names = ("supply_tolerance", "supply_sag", "warming_k", "vibration_g", "vibration_deg_s")
    unit["changes"] = any(getattr(params, name) for name in names)


@kernel
def attend(truth, k, unit, memory):  # type: ignore[no-untyped-def]
    """Update temperature, supply and rotor for tick k; `memory` is a record of MEMORY.

    The rotor speed of the tick is the mean of those at its ends.
    """
    row = truth[k]
    memory.warmer_k = -unit.warming_k * np.expm1(-row.t_s / unit.warming_s)  # as `warming`
    memory.supply = unit.supply - unit.supply_sag * row.throttle
    rpm = 0.5 * (row.rotor_rpm + truth[k - 1].rotor_rpm) if k > 0 else row.rotor_rpm
    memory.rotor_hz = rpm / 60.0
    turn = 2.0 * np.pi * memory.rotor_hz * unit.dt_s
    memory.rotor_rad = memory.turned_rad + 0.5 * turn
    memory.turned_rad = (memory.turned_rad + turn) % (2.0 * np.pi)
