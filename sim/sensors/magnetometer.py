"""Three-axis magnetometer: the earth's field, distorted by the aeroplane's iron and motor, and the part's errors.

reading = convert(M R_sb (S b + h + m (rpm / rpm_full)^2) + noise)

`b` is the earth's field in body axes, S the soft iron, h the hard iron, m the motor's field; R_sb is the mounting
misalignment and M the part's gains and cross axes (Vasconcelos et al., "Geometric approach to strapdown magnetometer
calibration in sensor frame", IEEE Trans. Aerospace and Electronic Systems 47, 2011, with the motor added).

The motor's field is proportional to its current (Biot and Savart), as is the torque of a direct-current motor; the
torque of a propeller goes with the square of its speed.  A windmilling propeller counts as a driven one.

Sample j is valid at physics step j * steps_per_sample (interpolated between two ticks, with an error of at most an
eighth of the squared angle turned in a tick) and arrives in the first tick that ends at least the latency later.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.magnetic_field import field_e_ut, require_year
from sim.place import LAUNCH_PLACE, YEAR, Place
from sim.sensors.board import Triple
from sim.sensors.noise import Source, require, require_scale, require_triple

NONE: Triple = (0.0, 0.0, 0.0)
_MOST_COUNTS = 2**31


@dataclass(frozen=True, slots=True)
class MagnetometerParams:
    """Errors of a three-axis magnetometer.  The defaults are perfect.

    A larger figure means larger heading errors unless stated otherwise, and 0 removes that error.

    rate_hz : sample rate, which must divide the physics rate (Hz, default 10).  Higher: more frequent heading
    latency_s : from the time of a sample to its arrival (s, default 0)
    hard_iron_b_ut : (3,) field of magnetised iron, fixed in the aeroplane (uT, default 0)
    hard_iron_ut : sigma per axis of additional hard iron, drawn per flight (uT, default 0)
    soft_iron : sigma of each element of the symmetric soft-iron matrix (fraction, default 0)
    motor_b_ut : (3,) field of the motor current at the propeller speed `motor_rpm` (uT, default 0)
    motor_rpm : propeller speed at which `motor_b_ut` holds (rpm, default 8000).  Higher: less field at the same speed
    noise_ut : sigma of each sample of an axis (uT, default 0)
    gain : sigma of the relative gain error (fraction, default 0)
    cross_axis : sigma of each axis' sensitivity to another axis (fraction, default 0)
    mounting_deg : (3,) roll, pitch and yaw misalignment of the part, unknown to the firmware (deg, default 0)
    range_ut : full scale (uT, default inf: none).  Lower: the axes saturate near strong hard iron
    step_ut : one count of the converter (uT, default 0: not quantised)
    overflow : count that an axis out of range reads (default 0: it clips)
    year : decimal date of the flight, for the world magnetic model (default 2026.5)
    """

    rate_hz: float = 10.0
    latency_s: float = 0.0
    hard_iron_b_ut: Triple = NONE
    hard_iron_ut: float = 0.0
    soft_iron: float = 0.0
    motor_b_ut: Triple = NONE
    motor_rpm: float = 8000.0
    noise_ut: float = 0.0
    gain: float = 0.0
    cross_axis: float = 0.0
    mounting_deg: Triple = NONE
    range_ut: float = math.inf
    step_ut: float = 0.0
    overflow: int = 0
    year: float = YEAR

    def __post_init__(self) -> None:
        require(self, "rate_hz", least=0.1)
        require(self, "latency_s", "hard_iron_ut", "noise_ut", "soft_iron", "gain", "cross_axis")
        require(self, "motor_rpm", least=1.0)
        require_triple(self, "hard_iron_b_ut", "motor_b_ut", "mounting_deg")
        require_scale(self, "range_ut", "step_ut")
        if self.overflow != 0 and (self.step_ut == 0.0 or abs(self.overflow) > _MOST_COUNTS):
            raise ValueError(
                f"MagnetometerParams.overflow = {self.overflow!r} counts: choose a count that fits in 32 bits, "
                "and a step above 0 uT; or 0 to clip"
            )
        require_year("MagnetometerParams.year", self.year)


UNIT = np.dtype(
    [
        ("fitted", "i8"),
        ("steps_per_tick", "i8"),
        ("steps_per_sample", "i8"),
        ("latency_steps", "i8"),
        ("field_e_ut", "f8", (3,)),
        ("A", "f8", (3, 3)),  # M R_sb S
        ("offset_ut", "f8", (3,)),  # M R_sb h
        ("motor_ut", "f8", (3,)),  # M R_sb m
        ("motor_rpm", "f8"),
        ("step_ut", "f8"),
        ("lowest", "f8"),  # in counts, or in microtesla if not quantised
        ("highest", "f8"),
        ("overflow", "f8"),
    ],
    align=True,
)
NOISE = (("mag_noise_b_ut", "f8", (3,)),)


def _symmetric(sigma: float, normal: Array) -> Array:
    """Identity plus a symmetric deviation, from the lower half of `normal`, shape (3, 3)."""
    lower = np.tril(normal)
    return np.eye(3) + sigma * (lower + np.tril(lower, -1).T)


def make(
    params: MagnetometerParams, rates: Rates, source: Source, unit: NDArray[np.void], place: Place = LAUNCH_PLACE
) -> None:
    """Make one magnetometer: draw iron, gains and cross axes, set its constants in `unit`, shape (1,) of UNIT."""
    unit["fitted"] = 1
    unit["steps_per_tick"] = rates.steps_per_tick
    unit["steps_per_sample"] = rates.steps_per_sample("magnetometer", params.rate_hz)
    unit["latency_steps"] = math.ceil(params.latency_s * rates.physics_hz - 1e-9)  # less than a nanostep is round-off
    unit["field_e_ut"] = field_e_ut(place.latitude_deg, place.longitude_deg, place.elevation_m, params.year)
    soft = _symmetric(params.soft_iron, source("magnetometer soft iron").standard_normal((3, 3)))
    hard_b_ut = params.hard_iron_b_ut + params.hard_iron_ut * source("magnetometer hard iron").standard_normal(3)
    M = params.cross_axis * source("magnetometer cross axis").standard_normal((3, 3))
    np.fill_diagonal(M, 1.0 + params.gain * source("magnetometer gain").standard_normal(3))
    device = M @ from_euler(*np.radians(params.mounting_deg)).T
    unit["A"], unit["offset_ut"], unit["motor_ut"] = device @ soft, device @ hard_b_ut, device @ params.motor_b_ut
    unit["motor_rpm"] = params.motor_rpm
    unit["step_ut"] = params.step_ut
    # Two's complement, in whole counts, so that the ends of the range are exact levels.
    counts = np.round(params.range_ut / params.step_ut) if params.step_ut else 0.0
    unit["lowest"], unit["highest"] = (-counts, counts - 1.0) if params.step_ut else (-params.range_ut, params.range_ut)
    unit["overflow"] = params.overflow


def draw(params: MagnetometerParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:  # noqa: ARG001
    """Draw the noise of every tick into the columns NOISE of `noise`; a sample uses that of its tick."""
    if params.noise_ut > 0.0:
        noise["mag_noise_b_ut"] = params.noise_ut * source("magnetometer noise").standard_normal((len(noise), 3))


@kernel
def measure_field(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Hold the last sample in row `k`, or write the one that has arrived; `unit` is a record of UNIT."""
    row = measured[k]
    # Step of the newest sample that can have arrived by the end of this tick.
    spt, sps = unit.steps_per_tick, unit.steps_per_sample
    step = ((k + 1) * spt - unit.latency_steps) // sps * sps
    if step + unit.latency_steps > k * spt and step >= sps:
        _sample(truth, row, noise, step, spt, unit)
        row.mag_new = 1
        return
    row.mag_new = 0
    for i in range(3):
        row.mag_b_ut[i] = measured[k - 1].mag_b_ut[i] if k > 0 else 0.0


@kernel
def _sample(truth, row, noise, step, spt, unit):  # type: ignore[no-untyped-def]
    """Sample at the physics step `step`."""
    at = (step + spt - 1) // spt - 1
    late = (step - at * spt) / spt  # fraction of that tick, 0 < late <= 1
    newer, older, error = truth[at], truth[max(at - 1, 0)], noise[at]
    f = unit.field_e_ut
    bx = by = bz = 0.0
    for i in range(3):
        bx += ((1.0 - late) * older.R_eb[i, 0] + late * newer.R_eb[i, 0]) * f[i]
        by += ((1.0 - late) * older.R_eb[i, 1] + late * newer.R_eb[i, 1]) * f[i]
        bz += ((1.0 - late) * older.R_eb[i, 2] + late * newer.R_eb[i, 2]) * f[i]
    speed = ((1.0 - late) * older.rotor_rpm + late * newer.rotor_rpm) / unit.motor_rpm
    share = speed * speed
    A = unit.A
    for i in range(3):
        sensed = A[i, 0] * bx + A[i, 1] * by + A[i, 2] * bz
        sensed += unit.offset_ut[i] + share * unit.motor_ut[i] + error.mag_noise_b_ut[i]
        row.mag_b_ut[i] = _convert(sensed, unit)


@kernel
def _convert(sensed, unit):  # type: ignore[no-untyped-def]
    step = unit.step_ut
    if step == 0.0:
        return min(max(sensed, unit.lowest), unit.highest)
    counts = np.floor(sensed / step + 0.5)
    if unit.overflow != 0.0 and (counts < unit.lowest or counts > unit.highest):
        return step * unit.overflow
    return step * min(max(counts, unit.lowest), unit.highest)
