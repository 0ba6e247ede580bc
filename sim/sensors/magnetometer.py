"""Magnetometer: the earth's field in the aeroplane, bent by its iron and its motor, as a three-axis part reports it.

reading = convert(M R_sb (S b + h + m (rpm / rpm_full)^2) + noise)

`b` is the earth's field in body axes, S the soft iron, h the hard iron, m the motor's field; R_sb is the crooked
mounting and M the part's own gains and cross axes (the model of Vasconcelos et al., "Geometric approach to strapdown
magnetometer calibration in sensor frame", IEEE Trans. Aerospace and Electronic Systems 47, 2011, and the motor).

A current's field is in proportion to it (Biot and Savart), a direct-current motor's torque too, and a propeller's
torque to the square of its speed; a propeller that windmills is taken for a driven one.

Sample j is true at step j * steps_per_sample of the physics (the field is interpolated between two ticks, wrong by
at most an eighth of the squared angle turned in a tick) and arrives in the first tick that ends at least the
latency later.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from estimator.rotation import from_euler
from sim import place
from sim.clock import Rates
from sim.magnetic_field import field_e_ut, require_year
from sim.sensors.noise import Source, require, require_scale

Triple = tuple[float, float, float]
NONE: Triple = (0.0, 0.0, 0.0)
_MOST_COUNTS = 2**31


@dataclass(frozen=True, slots=True)
class MagnetometerParams:
    """Errors of a three-axis magnetometer where it is fitted.  The defaults are perfect.

    rate_hz : of its samples, which divides the physics rate      latency_s : from a sample's time to its arrival
    hard_iron_b_ut : (3,) field of the magnetised iron that turns with the aeroplane
    hard_iron_ut : sigma of what each axis has of that beside it, drawn for a flight
    soft_iron : sigma of each element of the symmetric matrix by which iron bends the earth's field
    motor_b_ut : (3,) field of the motor current at the propeller speed `motor_rpm`
    noise_ut : sigma of each sample of an axis
    gain : sigma of the relative gain error      cross_axis : sigma of each axis' sensitivity to another
    mounting_deg : (3,) roll, pitch and yaw by which the part is crooked, and the firmware does not know it
    range_ut : full scale; infinite is none      step_ut : one count of the converter; 0 is not quantised
    overflow : count that an axis out of range reads; 0 is that the axis clips
    year : decimal, of the flight: the world magnetic model gives the field at the launch point
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
    year: float = place.YEAR

    def __post_init__(self) -> None:
        require(self, "Hz", "rate_hz", least=0.1)
        require(self, "s", "latency_s")
        require(self, "uT", "hard_iron_ut", "noise_ut")
        require(self, "(a fraction)", "soft_iron", "gain", "cross_axis")
        require(self, "rpm", "motor_rpm", least=1.0)
        for name, unit in (("hard_iron_b_ut", "uT"), ("motor_b_ut", "uT"), ("mounting_deg", "deg")):
            value = getattr(self, name)
            if len(value) != 3 or not all(math.isfinite(x) for x in value):
                raise ValueError(f"MagnetometerParams.{name} = {value!r} {unit}: choose three finite numbers")
        require_scale(self, "uT", "range_ut", "step_ut")
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
        ("lowest", "f8"),  # level of the converter, in counts; in microtesla where nothing is quantised
        ("highest", "f8"),
        ("overflow", "f8"),
    ],
    align=True,
)
NOISE = (("mag_noise_b_ut", "f8", (3,)),)


def _symmetric(sigma: float, normal: Array) -> Array:
    """Identity and a symmetric deviation from it, from the lower half of `normal`, shape (3, 3)."""
    lower = np.tril(normal)
    return np.eye(3) + sigma * (lower + np.tril(lower, -1).T)


def make(params: MagnetometerParams, rates: Rates, source: Source, unit: NDArray[np.void]) -> None:
    """Make one magnetometer: draw its irons, gains and cross axes, set its constants in `unit`, shape (1,) of UNIT."""
    unit["fitted"] = 1
    unit["steps_per_tick"] = rates.steps_per_tick
    unit["steps_per_sample"] = rates.steps_per_sample("magnetometer", params.rate_hz)
    unit["latency_steps"] = math.ceil(params.latency_s * rates.physics_hz - 1e-9)  # a nanostep is round-off
    unit["field_e_ut"] = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, params.year)
    soft = _symmetric(params.soft_iron, source("magnetometer soft iron").standard_normal((3, 3)))
    hard_b_ut = params.hard_iron_b_ut + params.hard_iron_ut * source("magnetometer hard iron").standard_normal(3)
    M = params.cross_axis * source("magnetometer cross axis").standard_normal((3, 3))
    np.fill_diagonal(M, 1.0 + params.gain * source("magnetometer gain").standard_normal(3))
    device = M @ from_euler(*np.radians(params.mounting_deg)).T
    unit["A"], unit["offset_ut"], unit["motor_ut"] = device @ soft, device @ hard_b_ut, device @ params.motor_b_ut
    unit["motor_rpm"] = params.motor_rpm
    unit["step_ut"] = params.step_ut
    # Two's complement; whole counts, so that the ends of the range are levels to the last bit.
    counts = np.round(params.range_ut / params.step_ut) if params.step_ut else 0.0
    unit["lowest"], unit["highest"] = (-counts, counts - 1.0) if params.step_ut else (-params.range_ut, params.range_ut)
    unit["overflow"] = params.overflow


def draw(params: MagnetometerParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:  # noqa: ARG001
    """Draw the noise of every tick into the columns NOISE of `noise`; a sample has that of its own tick."""
    if params.noise_ut > 0.0:
        noise["mag_noise_b_ut"] = params.noise_ut * source("magnetometer noise").standard_normal((len(noise), 3))


@kernel
def measure_field(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Hold the last sample in row `k`, or take in the one that has arrived; `unit` is a record of UNIT."""
    row = measured[k]
    # The newest sample that can have arrived by the end of this tick, and the step at which it was true.
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
    """Sample at `step`, which lies in the tick whose row is `at`."""
    at = (step + spt - 1) // spt - 1
    late = (step - at * spt) / spt  # share of that tick gone by, 0 < late <= 1
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
