"""Air data: a pitot tube with its pressure sensor for the airspeed, and a barometer for the height.

Airspeed from the pressure difference q of a pitot tube, V = sqrt(2 q / rho), the compressibility at model
speeds (0.1 % at 20 m/s) left out:

    q = convert((1 + gain) rho V^2 / 2 + offset + noise)

Height from the pressure of the standard atmosphere (ISO 2533, troposphere), lagged first:

    p = p0 (1 - L h / T0)^(g0 / R L) + drift + wander + noise

Density and pressure at the launch point are the standard atmosphere's, and the firmware knows them.  It takes the
density of the launch point at every height (the airspeed would be half a percent lower for each 100 m).

Sample j of each is true at step j * steps_per_sample of the physics (interpolated between two ticks) and is in the
first tick that ends at that time or later.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2
from sim import place
from sim.clock import Rates
from sim.sensors.noise import Source, gauss_markov, require, require_scale

# ISO 2533: at sea level, and the lapse rate.
PRESSURE_PA: Final = 101325.0
TEMPERATURE_K: Final = 288.15
LAPSE_K_M: Final = 0.0065
GAS_CONSTANT_J_KG_K: Final = 287.05287
_EXPONENT: Final = G_M_S2 / (GAS_CONSTANT_J_KG_K * LAPSE_K_M)


@dataclass(frozen=True, slots=True)
class AirspeedParams:
    """Errors of a pitot tube with its pressure sensor; the defaults are perfect.

    rate_hz : of its samples, which divides the physics rate
    noise_pa : sigma of each sample        offset_pa : sigma of what is left of the zero offset after power-up
    gain : sigma of the relative error of the pressure: the sensor's, and that of the tube's place in the flow
    axial : the tube feels the airspeed's part along the nose alone; otherwise flow from any side, as good tubes do
    range_pa : full scale; infinite is none      step_pa : one step of the converter; 0 is not quantised
    """

    rate_hz: float = 10.0
    noise_pa: float = 0.0
    offset_pa: float = 0.0
    gain: float = 0.0
    axial: bool = False
    range_pa: float = math.inf
    step_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "Hz", "rate_hz", least=0.1)
        require(self, "Pa", "noise_pa", "offset_pa")
        require(self, "(a fraction)", "gain")
        require_scale(self, "Pa", "range_pa", "step_pa")


@dataclass(frozen=True, slots=True)
class BarometerParams:
    """Errors of a barometer whose height is zero at the launch point; the defaults are perfect.

    rate_hz : of its samples, which divides the physics rate
    lag_s : time constant with which the height follows; 0 is none
    noise_pa : sigma of each sample      drift_pa_min : sigma of the steady drift of weather and temperature
    wander_pa : sigma of the slowly wandering error      wander_s : correlation time of that error
    range_pa : full scale of the pressure, 0 its other end; infinite is none
    step_pa : one step of the converter; 0 is not quantised
    """

    rate_hz: float = 10.0
    lag_s: float = 0.0
    noise_pa: float = 0.0
    drift_pa_min: float = 0.0
    wander_pa: float = 0.0
    wander_s: float = 30.0
    range_pa: float = math.inf
    step_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "Hz", "rate_hz", least=0.1)
        require(self, "s", "lag_s")
        require(self, "s", "wander_s", least=0.001)
        require(self, "Pa", "noise_pa", "wander_pa")
        require(self, "Pa/min", "drift_pa_min")
        require_scale(self, "Pa", "range_pa", "step_pa")


UNIT = np.dtype(
    [
        ("fitted", "i8"),
        ("steps_per_tick", "i8"),
        ("airspeed_steps", "i8"),  # physics steps between two samples; 0 is not fitted
        ("baro_steps", "i8"),
        ("density_kg_m3", "f8"),
        ("gain", "f8"),
        ("offset_pa", "f8"),
        ("axial", "i8"),
        ("range_pa", "f8"),
        ("airspeed_step_pa", "f8"),
        ("baro_range_pa", "f8"),
        ("baro_step_pa", "f8"),
        ("before", "f8"),  # weight of the lagged height at the start of a tick,
        ("start", "f8"),  # of the true height there,
        ("end", "f8"),  # and of the true height at its end
    ],
    align=True,
)
MEMORY = np.dtype([("height_m", "f8"), ("height_was_m", "f8")], align=True)  # lagged, at this tick and the one before
NOISE = (("airspeed_noise_pa", "f8"), ("baro_error_pa", "f8"))


def density_kg_m3(height_m: float) -> float:
    """Density of the standard atmosphere at `height_m` above the sea."""
    temperature_k = TEMPERATURE_K - LAPSE_K_M * height_m
    return float(_pressure_pa(height_m)) / (GAS_CONSTANT_J_KG_K * temperature_k)


def make(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    unit: NDArray[np.void],
) -> None:  # fmt: skip
    """Make both: draw what stays for the flight, set their constants in `unit`, shape (1,) of UNIT.

    The weights of the lag are its exact solution for a height that is linear within the tick, as the GPS's are.
    """
    unit["fitted"] = 1
    unit["steps_per_tick"] = rates.steps_per_tick
    if airspeed is not None:
        unit["airspeed_steps"] = rates.steps_per_sample("airspeed", airspeed.rate_hz)
        unit["density_kg_m3"] = density_kg_m3(place.ELEVATION_M)
        unit["gain"] = 1.0 + airspeed.gain * source("airspeed gain").standard_normal()
        unit["offset_pa"] = airspeed.offset_pa * source("airspeed offset").standard_normal()
        unit["axial"] = airspeed.axial
        unit["range_pa"], unit["airspeed_step_pa"] = airspeed.range_pa, airspeed.step_pa
    if barometer is not None:
        unit["baro_steps"] = rates.steps_per_sample("barometer", barometer.rate_hz)
        unit["baro_range_pa"], unit["baro_step_pa"] = barometer.range_pa, barometer.step_pa
        step = rates.dt_s / barometer.lag_s if barometer.lag_s > 0.0 else math.inf
        before, end = math.exp(-step), 1.0 + math.expm1(-step) / step
        unit["before"], unit["start"], unit["end"] = before, 1.0 - before - end, end


def draw(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    noise: NDArray[np.void],
) -> None:  # fmt: skip
    """Draw the errors of every tick into the columns NOISE of `noise`; a sample has those of its own tick."""
    n = len(noise)
    if airspeed is not None and airspeed.noise_pa > 0.0:
        noise["airspeed_noise_pa"] = airspeed.noise_pa * source("airspeed noise").standard_normal(n)
    if barometer is None:
        return
    error_pa = noise["baro_error_pa"]
    if barometer.noise_pa > 0.0:
        error_pa += barometer.noise_pa * source("barometer noise").standard_normal(n)
    if barometer.drift_pa_min > 0.0:
        rate_pa_s = barometer.drift_pa_min / 60.0 * source("barometer drift").standard_normal()
        error_pa += rate_pa_s * rates.dt_s * np.arange(1, n + 1)
    if barometer.wander_pa > 0.0:
        steps = source("barometer wander").standard_normal((n, 1))
        error_pa += gauss_markov(steps, np.array([barometer.wander_pa]), barometer.wander_s, rates.dt_s)[:, 0]


@kernel
def measure_air(truth, measured, noise, k, unit, memory):  # type: ignore[no-untyped-def]
    """Hold the last samples in row `k`, or take in new ones; `unit` and `memory` are records of UNIT and MEMORY."""
    row, spt = measured[k], unit.steps_per_tick
    row.air_new = 0
    row.airspeed_m_s = measured[k - 1].airspeed_m_s if k > 0 else np.nan
    row.baro_height_m = measured[k - 1].baro_height_m if k > 0 else np.nan
    older, newer = truth[max(k - 1, 0)], truth[k]
    if unit.airspeed_steps:
        step = (k + 1) * spt // unit.airspeed_steps * unit.airspeed_steps
        if step > k * spt:
            late = (step - k * spt) / spt  # share of the tick gone by, 0 < late <= 1
            speed = (1.0 - late) * _felt_m_s(older, unit) + late * _felt_m_s(newer, unit)
            row.airspeed_m_s = _airspeed_m_s(speed, noise[k].airspeed_noise_pa, unit)
            row.air_new = 1
    if unit.baro_steps:
        _lag(-older.p_e_m[2], -newer.p_e_m[2], k, unit, memory)
        step = (k + 1) * spt // unit.baro_steps * unit.baro_steps
        if step > k * spt:
            late = (step - k * spt) / spt
            height = (1.0 - late) * memory.height_was_m + late * memory.height_m
            row.baro_height_m = _height_m(height, noise[k].baro_error_pa, unit)
            row.air_new = 1


@kernel
def _felt_m_s(row, unit):  # type: ignore[no-untyped-def]
    """Airspeed that the tube feels, negative from behind."""
    return row.airspeed_m_s * np.cos(row.alpha_rad) * np.cos(row.beta_rad) if unit.axial else row.airspeed_m_s


@kernel
def _airspeed_m_s(speed_m_s, noise_pa, unit):  # type: ignore[no-untyped-def]
    """What the sensor makes of the airspeed `speed_m_s`; a pressure below zero reads no speed."""
    sensed = unit.gain * 0.5 * unit.density_kg_m3 * speed_m_s * abs(speed_m_s) + unit.offset_pa + noise_pa
    pressure = _quantised(min(max(sensed, -unit.range_pa), unit.range_pa), unit.airspeed_step_pa)
    return np.sqrt(2.0 * max(pressure, 0.0) / unit.density_kg_m3)


@kernel
def _height_m(height_m, error_pa, unit):  # type: ignore[no-untyped-def]
    """What the barometer makes of the height `height_m` above the launch point."""
    if error_pa == 0.0 and unit.baro_step_pa == 0.0 and np.isinf(unit.baro_range_pa):
        return height_m  # there and back would cost digits
    pressure = min(max(_pressure_pa(place.ELEVATION_M + height_m) + error_pa, 0.0), unit.baro_range_pa)
    return height_at_m(_quantised(pressure, unit.baro_step_pa))


@kernel
def height_at_m(pressure_pa):  # type: ignore[no-untyped-def]
    """Height above the launch point at which the standard atmosphere has this pressure."""
    return TEMPERATURE_K / LAPSE_K_M * (1.0 - (pressure_pa / PRESSURE_PA) ** (1.0 / _EXPONENT)) - place.ELEVATION_M


@kernel
def _pressure_pa(height_m):  # type: ignore[no-untyped-def]
    """Pressure of the standard atmosphere, ISO 2533, up to 11 km above the sea."""
    return PRESSURE_PA * (1.0 - LAPSE_K_M * height_m / TEMPERATURE_K) ** _EXPONENT


@kernel
def _quantised(pressure_pa, step_pa):  # type: ignore[no-untyped-def]
    return step_pa * np.floor(pressure_pa / step_pa + 0.5) if step_pa > 0.0 else pressure_pa


@kernel
def _lag(older_m, newer_m, k, unit, memory):  # type: ignore[no-untyped-def]
    """Let the height follow through tick `k`; before the first it stood still."""
    if k == 0:
        memory.height_m = memory.height_was_m = newer_m
        return
    memory.height_was_m = memory.height_m
    memory.height_m = unit.before * memory.height_m + unit.start * older_m + unit.end * newer_m
