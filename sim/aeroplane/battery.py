"""A battery whose voltage falls with the charge drawn and sags with the current.

Voltage of a lithium-polymer cell at rest by the fraction of its charge: `CELL`, rounded from the table of ArduPilot's
simulated battery (`libraries/SITL/SIM_Battery.cpp`).  The speed controller passes the fraction d of the voltage to the
motor, an ideal transformer: the battery gives d times the current of the motor.  With the back voltage e of the turning
motor and its resistance R_m,

    I_m = (d U - e) / R_m,    U = U_0 - R d I_m,    so    U = (U_0 + R d e / R_m) / (1 + R d^2 / R_m)

with U_0 the voltage at rest and R the resistance of the battery.  A motor that is driven by the air returns no charge.
The speed controller passes no more than the voltage for which the model was designed: above about half the charge
full throttle is as strong as without this model.  Below `cutoff_v` for each cell it takes the motor back, until the
voltage holds, and does not give the power back: assumption, as the "soft cut-off" of hobby controllers.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

CELL_V: Final = 3.7  # nominal, of one cell
CELL: Final = np.array(
    [
        (0.0, 2.5), (0.02, 2.98), (0.04, 3.09), (0.1, 3.19), (0.2, 3.4), (0.3, 3.53), (0.4, 3.65), (0.5, 3.74),
        (0.6, 3.82), (0.7, 3.89), (0.8, 3.98), (0.9, 4.08), (1.0, 4.17),
    ]
)  # fmt: skip
CUTOFF_PER_S: Final = 0.5  # of full throttle, by which the speed controller takes the motor back


@dataclass(frozen=True, slots=True)
class BatteryParams:
    """A battery with as many cells as the motor of the aeroplane is designed for.

    capacity_mah : of a full battery (mAh).  Lower: empty sooner
    charge : at the start, fraction of full (default 1).  Lower: weaker, and empty sooner
    resistance_ohm : beyond that of a good battery, which is part of the motor's (ohm, default 0).  Higher: sags more
    cutoff_v : voltage of each cell below which the motor is taken back (V, default 3).  Higher: more charge is left
    """

    capacity_mah: float
    charge: float = 1.0
    resistance_ohm: float = 0.0
    cutoff_v: float = 3.0


class Battery:
    """The battery of one flight: how much of the throttle reaches the motor, and what that takes out of it.

    motor : path of the ``motor.xml`` of the aeroplane, with its voltage and resistance
    """

    def __init__(self, params: BatteryParams, motor: Path, dt_s: float) -> None:
        root = ElementTree.parse(motor).getroot()
        self.params, self._dt_s = params, dt_s
        self._design_v, self._motor_ohm = (float(root.findtext(tag, "nan")) for tag in ("maxvolts", "coilresistance"))
        self.cells = round(self._design_v / CELL_V)
        self.reset()

    def reset(self) -> None:
        """As charged before the flight."""
        self.charge = self.params.charge
        self.drawn_mah = 0.0
        self.voltage_v = self.least_v = self.rest_v
        self._most = 1.0  # throttle that the cut-off allows
        self.cut_off_tick = -1

    @property
    def rest_v(self) -> float:
        """Voltage at rest with the present charge."""
        return self.cells * float(np.interp(self.charge, CELL[:, 0], CELL[:, 1]))

    def throttle(self, k: int, wanted: float, position: float, motor_a: float) -> float:
        """Fraction of the design voltage for the motor in tick `k`, 0..1.

        wanted : 0..1 by the speed controller    position, motor_a : what the motor had in the tick before, and its
        current (A)
        """
        fraction = min(max(wanted, 0.0), self._most)
        back_v = self._design_v * position - self._motor_ohm * motor_a
        rest_v, ratio = self.rest_v, self.params.resistance_ohm / self._motor_ohm
        loaded_v = (rest_v + ratio * fraction * back_v) / (1.0 + ratio * fraction**2)
        self.voltage_v = voltage_v = max(min(loaded_v, rest_v), 0.0)
        self.least_v = min(self.least_v, voltage_v)
        drawn_a = position * self._design_v / voltage_v * max(motor_a, 0.0) if voltage_v > 0.0 else 0.0
        drawn_mah = drawn_a * self._dt_s / 3.6
        self.drawn_mah += drawn_mah
        self.charge = max(self.charge - drawn_mah / self.params.capacity_mah, 0.0)
        if voltage_v < self.cells * self.params.cutoff_v and fraction > 0.0:
            self._most = max(min(self._most, fraction) - CUTOFF_PER_S * self._dt_s, 0.0)
            if self.cut_off_tick < 0:
                self.cut_off_tick = k
        return min(fraction * voltage_v / self._design_v, 1.0)

    @property
    def figures(self) -> dict[str, float | None]:
        """What a recording keeps of it after the flight."""
        cut_off_s = self.cut_off_tick * self._dt_s if self.cut_off_tick >= 0 else math.nan
        return {
            "drawn_mah": self.drawn_mah,
            "charge": self.charge,
            "voltage_v": self.voltage_v,
            "least_voltage_v": self.least_v,
            "cut_off_s": cut_off_s if math.isfinite(cut_off_s) else None,
        }
