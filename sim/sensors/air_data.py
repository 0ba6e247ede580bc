"""Air data: airspeed from a pitot tube with its pressure sensor, and height from a barometer.

Equivalent airspeed from the pitot pressure q, EAS = sqrt(2 q / rho_0) with the density rho_0 of the standard atmosphere
at sea level; compressibility (0.1 % at 20 m/s) is neglected:

    q = convert((1 + gain) rho V^2 / 2 + offset + noise)

with the density rho of the standard atmosphere at the height of the aeroplane above the sea (`estimator.blocks.air`):
EAS is 0.953 of the true airspeed V at 1,000 m, 0.866 at 2,900 m.

Height from the pressure of the standard atmosphere (ISO 2533, troposphere), after a first-order lag:

    p = p0 (1 - L h / T0)^(g0 / R L) + drift D (1 - exp(-t / D)) + wander + noise

The pressure at the launch point is standard and known to the firmware.

Sample j of each is valid at physics step j * steps_per_sample (interpolated between two ticks) and arrives in the
first tick that ends at that time or later.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.air import DENSITY_KG_M3, EXPONENT, LAPSE_K_M, PRESSURE_PA, TEMPERATURE_K, density_ratio
from estimator.compiler.jit import kernel
from sim.clock import Rates
from sim.place import LAUNCH_PLACE, Place
from sim.sensors.noise import (
    Source,
    gauss_markov,
    lag_weights,
    levelling_off,
    require,
    require_scale,
    to_step,
)


@dataclass(frozen=True, slots=True)
class AirspeedParams:
    """Errors of a pitot tube with its pressure sensor; the defaults are perfect.

    A larger figure is a worse sensor unless stated otherwise, and 0 removes that error.

    rate_hz : sample rate, which must divide the physics rate (Hz, default 10).  Higher: fresher airspeed
    noise_pa : sigma of each sample (Pa, default 0); at low airspeed the same noise costs more m/s
    offset_pa : sigma of the zero offset that remains after power-up (Pa, default 0)
    gain : sigma of the relative pressure error, of sensor and tube position (fraction, default 0)
    axial : the tube measures only the component along the nose; if not, the full airspeed (default False)
    range_pa : full scale (Pa, default inf: none).  Lower: fast flight saturates
    step_pa : converter step (Pa, default 0: not quantised)
    """

    rate_hz: float = 10.0
    noise_pa: float = 0.0
    offset_pa: float = 0.0
    gain: float = 0.0
    axial: bool = False
    range_pa: float = math.inf
    step_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "rate_hz", least=0.1)
        require(self, "noise_pa", "offset_pa", "gain")
        require_scale(self, "range_pa", "step_pa")


@dataclass(frozen=True, slots=True)
class BarometerParams:
    """Errors of a barometer whose height is zero at the launch point; the defaults are perfect.

    A larger figure is a worse sensor unless stated otherwise, and 0 removes that error.  12 Pa are about 1 m.

    rate_hz : sample rate, which must divide the physics rate (Hz, default 10).  Higher: fresher height
    lag_s : time constant of the lag of the height (s, default 0)
    noise_pa : sigma of each sample (Pa, default 0)
    drift_pa_min : sigma of the drift with weather and temperature at power-up (Pa per minute, default 0)
    drift_s : time constant with which that levels off (s, default 36000).  Higher: it goes on for longer.  An
        assumption: 1 Pa per minute, or 1.8 hPa in three hours, ends at 6 hPa, as the weather of a season scatters
    wander_pa : sigma of the correlated error (Pa, default 0)
    wander_s : correlation time of that error (s, default 30).  Higher: averages out more slowly
    range_pa : full scale, from 0 (Pa, default inf: none).  Below the pressure on the ground: saturates there
    step_pa : converter step (Pa, default 0: not quantised)
    """

    rate_hz: float = 10.0
    lag_s: float = 0.0
    noise_pa: float = 0.0
    drift_pa_min: float = 0.0
    drift_s: float = 36000.0
    wander_pa: float = 0.0
    wander_s: float = 30.0
    range_pa: float = math.inf
    step_pa: float = 0.0

    def __post_init__(self) -> None:
        require(self, "rate_hz", least=0.1)
        require(self, "lag_s", "noise_pa", "wander_pa", "drift_pa_min")
        require(self, "wander_s", "drift_s", least=0.001)
        require_scale(self, "range_pa", "step_pa")


UNIT = np.dtype(
    [
        ("fitted", "i8"),
        ("steps_per_tick", "i8"),
        ("airspeed_steps", "i8"),  # physics steps between samples; 0: not fitted
        ("baro_steps", "i8"),
        ("elevation_m", "f8"),
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
MEMORY = np.dtype([("height_m", "f8"), ("height_was_m", "f8")], align=True)  # lagged, at the ends of the tick
NOISE = (("airspeed_noise_pa", "f8"), ("baro_error_pa", "f8"))


def make(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    unit: NDArray[np.void], place: Place = LAUNCH_PLACE,
) -> None:  # fmt: skip
    """Make both: draw the errors of the flight, set their constants in `unit`, shape (1,) of UNIT."""
    unit["fitted"], unit["elevation_m"] = 1, place.elevation_m
    unit["steps_per_tick"] = rates.steps_per_tick
    if airspeed is not None:
        unit["airspeed_steps"] = rates.steps_per_sample("airspeed", airspeed.rate_hz)
        unit["gain"] = 1.0 + airspeed.gain * source("airspeed gain").standard_normal()
        unit["offset_pa"] = airspeed.offset_pa * source("airspeed offset").standard_normal()
        unit["axial"] = airspeed.axial
        unit["range_pa"], unit["airspeed_step_pa"] = airspeed.range_pa, airspeed.step_pa
    if barometer is not None:
        unit["baro_steps"] = rates.steps_per_sample("barometer", barometer.rate_hz)
        unit["baro_range_pa"], unit["baro_step_pa"] = barometer.range_pa, barometer.step_pa
        unit["before"], unit["start"], unit["end"] = lag_weights(barometer.lag_s, rates.dt_s)


def draw(
    airspeed: AirspeedParams | None, barometer: BarometerParams | None, rates: Rates, source: Source,
    noise: NDArray[np.void],
) -> None:  # fmt: skip
    """Draw the errors of every tick into the columns NOISE of `noise`; a sample uses those of its tick."""
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
        error_pa += rate_pa_s * levelling_off(rates.dt_s * np.arange(1.0, n + 1.0), barometer.drift_s)
    if barometer.wander_pa > 0.0:
        steps = source("barometer wander").standard_normal((n, 1))
        error_pa += gauss_markov(steps, np.array([barometer.wander_pa]), barometer.wander_s, rates.dt_s)[:, 0]


@kernel
def measure_air(truth, measured, noise, k, unit, memory):  # type: ignore[no-untyped-def]
    """Hold the last samples in row `k`, or write new ones; `unit` and `memory` are records of UNIT and MEMORY."""
    row, spt = measured[k], unit.steps_per_tick
    row.air_new = 0
    row.equivalent_airspeed_m_s = measured[k - 1].equivalent_airspeed_m_s if k > 0 else np.nan
    row.baro_height_m = measured[k - 1].baro_height_m if k > 0 else np.nan
    older, newer = truth[max(k - 1, 0)], truth[k]
    if unit.airspeed_steps:
        step = (k + 1) * spt // unit.airspeed_steps * unit.airspeed_steps
        if step > k * spt:
            late = (step - k * spt) / spt  # fraction of the tick, 0 < late <= 1
            speed = (1.0 - late) * _felt_m_s(older, unit) + late * _felt_m_s(newer, unit)
            ratio = density_ratio(unit.elevation_m - newer.p_e_m[2])
            row.equivalent_airspeed_m_s = _airspeed_m_s(speed, ratio, noise[k].airspeed_noise_pa, unit)
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
    """Airspeed at the tube, negative from behind."""
    return row.airspeed_m_s * np.cos(row.alpha_rad) * np.cos(row.beta_rad) if unit.axial else row.airspeed_m_s


@kernel
def _airspeed_m_s(speed_m_s, ratio, noise_pa, unit):  # type: ignore[no-untyped-def]
    """Reading at the true airspeed `speed_m_s` in air of a density `ratio`; a negative pressure reads as zero."""
    sensed = unit.gain * 0.5 * DENSITY_KG_M3 * ratio * speed_m_s * abs(speed_m_s) + unit.offset_pa + noise_pa
    pressure = to_step(min(max(sensed, -unit.range_pa), unit.range_pa), unit.airspeed_step_pa)
    return np.sqrt(2.0 * max(pressure, 0.0) / DENSITY_KG_M3)


@kernel
def _height_m(height_m, error_pa, unit):  # type: ignore[no-untyped-def]
    """Reading at the height `height_m` above the launch point."""
    if error_pa == 0.0 and unit.baro_step_pa == 0.0 and np.isinf(unit.baro_range_pa):
        return height_m  # converting to pressure and back would cost digits
    pressure = min(max(_pressure_pa(unit.elevation_m + height_m) + error_pa, 0.0), unit.baro_range_pa)
    return height_at_m(to_step(pressure, unit.baro_step_pa), unit.elevation_m)


@kernel
def height_at_m(pressure_pa, elevation_m):  # type: ignore[no-untyped-def]
    """Height above a launch point at `elevation_m` of this pressure in the standard atmosphere."""
    return TEMPERATURE_K / LAPSE_K_M * (1.0 - (pressure_pa / PRESSURE_PA) ** (1.0 / EXPONENT)) - elevation_m


@kernel
def _pressure_pa(height_m):  # type: ignore[no-untyped-def]
    """Pressure of the standard atmosphere, ISO 2533, up to 11 km above the sea."""
    return PRESSURE_PA * (1.0 - LAPSE_K_M * height_m / TEMPERATURE_K) ** EXPONENT


@kernel
def _lag(older_m, newer_m, k, unit, memory):  # type: ignore[no-untyped-def]
    """Advance the lagged height through tick `k`; before the first tick the height was constant."""
    if k == 0:
        memory.height_m = memory.height_was_m = newer_m
        return
    memory.height_was_m = memory.height_m
    memory.height_m = unit.before * memory.height_m + unit.start * older_m + unit.end * newer_m
