"""Sensor faults: one failure of one channel in one time window.

Faults act on the sensor outputs in the order given and may overlap: bias and gain combine, and a stuck reading
repeats the last output before its window, other faults included.  For a sensor slower than the loop (GPS,
magnetometer, air data) a fault acts on the reports that arrive in its window, not on values held between reports.

stuck           repeats the last report before the window
dropout         no data: gyro, accelerometer and air data read zero, a magnetometer gives no new sample
nan             readings are NaN
spikes          a fraction of the readings is off by an amplitude, up or down
bias, gain      readings are offset by an amount, or multiplied by a factor
saturated       reads full scale, or the overflow value if the part has one; a barometer saturates in pressure, so
                that 1 reads low

Those of a GPS are in `sim.sensors.gps_faults`.  Faulty readings stay within the full scale of the part, or overflow
as the part does.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.air import DENSITY_KG_M3
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, Array
from sim import params
from sim.clock import Rates
from sim.sensors.air_data import height_at_m
from sim.sensors.device import quantise
from sim.sensors.fault_kinds import Kind
from sim.sensors.gps_faults import BY_AXIS, DEFAULTS, OF_FIXES, UNITS, spoil_fix, why_impossible, why_no_such_rate
from sim.sensors.noise import Source

if TYPE_CHECKING:
    from sim.faults import Fault


class _Part(NamedTuple):
    """A sensor: its code, the unit of its faults and its SI value, number of axes, and default fault values."""

    code: int
    unit: str
    si: float
    axes: int
    bias: float
    spikes: tuple[float, float]  # amplitude, fraction of the readings
    full_scale: str = ""  # field of the part's parameters


_GYRO, _ACCELEROMETER, _MAGNETOMETER, _AIRSPEED, _BAROMETER, _GPS = range(6)
_PARTS: Final = {
    "gyro": _Part(_GYRO, "deg/s", math.radians(1.0), 3, 5.0, (200.0, 0.02), "range_deg_s"),
    "accelerometer": _Part(_ACCELEROMETER, "g", G_M_S2, 3, 0.2, (2.0, 0.02), "range_g"),
    "magnetometer": _Part(_MAGNETOMETER, "uT", 1.0, 3, 10.0, (50.0, 0.1), "range_ut"),
    "airspeed": _Part(_AIRSPEED, "m/s", 1.0, 1, 3.0, (10.0, 0.1), "range_pa"),
    "barometer": _Part(_BAROMETER, "m", 1.0, 1, 10.0, (50.0, 0.1), "range_pa"),
    "gps": _Part(_GPS, "m", 1.0, 1, 0.0, (50.0, 0.1)),
}
_AIR: Final = ("airspeed", "barometer")
_OF_READINGS: Final = ("stuck", "dropout", "nan", "spikes", "bias", "gain", "saturated")
CHANNELS: Final = tuple(
    name for part, of in _PARTS.items() for name in (part, *(f"{part}.{axis}" for axis in "xyz" if of.axes == 3))
)


def kinds_of(channel: str) -> tuple[str, ...]:
    """Kinds of fault of one of the CHANNELS."""
    if channel == "gps":
        return OF_FIXES
    if channel.startswith("magnetometer."):
        return tuple(kind for kind in _OF_READINGS if kind != "dropout")  # its axes arrive together
    return _OF_READINGS


def defaults_of(channel: str, kind: str) -> tuple[float, ...]:
    """Default values of a fault, as many as it takes, in deg/s, g, uT, m/s, m or Hz.

    spikes: amplitude, fraction of the readings; bias: amount; gain: factor; saturated: +1 or -1; jump and drift:
    north, east; rate
    """
    part = _PARTS[channel.partition(".")[0]]
    values = {"spikes": part.spikes, "bias": (part.bias,), "gain": (0.5,), "saturated": (1.0,), **DEFAULTS}
    return values.get(kind, ())


def unit_of(channel: str, kind: str = "") -> str:
    """Unit of the values of a fault of `channel`, except the fraction of spikes and the factor of gain."""
    return UNITS.get(kind, _PARTS[channel.partition(".")[0]].unit)


def wrong_values(_channel: str, kind: str, values: tuple[float, ...]) -> str:
    """What would be right, if the finite values of a fault are not."""
    if kind == "saturated" and abs(values[0]) != 1.0:
        return "must be 1, the upper end of the full scale, or -1, the lower"
    if kind == "spikes" and not 0.0 < values[1] <= 1.0:
        return "the second value is the fraction of the readings, above 0 and at most 1"
    return why_impossible(kind, values)


def require_possible(fault: "Fault", suite: Any, gps_hz: float | None = None) -> None:
    """Reject a fault that the parts of `suite` cannot have: ValueError.

    gps_hz : rate of the GPS; None is the rate of the receiver
    """
    part = getattr(suite, fault.part)
    if part is None:
        raise ValueError(f"fault {fault}: no {fault.part} fitted; choose a suite that has one")
    full_scale = _PARTS[fault.part].full_scale
    if fault.kind == "saturated" and not math.isfinite(getattr(part, full_scale)):
        field = f"{fault.part}.{full_scale}"
        raise ValueError(
            f"fault {fault}: this {fault.part} has no full scale; set {field} to a finite number of "
            f"{params.unit_of(field)}, choose a suite whose {fault.part} has one, or use bias"
        )
    if fault.kind == "rate" and (why := why_no_such_rate(fault.values[0], gps_hz or part.rate_hz)):
        raise ValueError(f"fault {fault}: {why}")


FAULT = np.dtype(
    [
        ("kind", "i8"),  # 0: no fault in this tick
        ("part", "i8"),
        ("axis", "i8"),
        ("before", "i8"),  # last row before the window
        ("value", "f8"),
        ("least", "f8"),  # full scale
        ("most", "f8"),
        ("under", "f8"),  # reading beyond it
        ("over", "f8"),
    ],
    align=True,
)
NO_FAULTS = np.zeros((0, 0), FAULT)


def fault_table(
    faults: Sequence["Fault"], release_s: float, rates: Rates, source: Source, unit: NDArray[np.void], n: int
) -> NDArray[np.void]:
    """Faults of each of `n` ticks, shape (n, m) of FAULT, a column per axis of each fault; or NO_FAULTS.

    release_s : since power-up              source : spikes use the stream "fault <its text>"
    unit : shape (1,), the sensors of the `Suite`
    """
    columns = [column for fault in faults for column in _columns(fault, source, n)]
    if not columns:
        return NO_FAULTS
    table = np.zeros((n, len(columns)), FAULT)
    for j, (fault, axis, values) in enumerate(columns):
        first, end = (_first_tick(t_s + release_s, rates.imu_hz, n) for t_s in (fault.from_s, fault.to_s))
        least, most, under, over = _span(fault.part, unit[0])
        kind = Kind[fault.kind.upper()]
        if kind is Kind.SATURATED:
            high, low = (under, over) if fault.part == "barometer" else (over, under)  # in pressure
            values = np.where(values > 0.0, high, low)
        wrong = table[first:end, j]
        hit = _sampled(fault.part, rates, unit[0], n)
        if kind is Kind.SPIKES:
            hit &= values != 0.0
        wrong["kind"] = np.where(hit[first:end], kind, 0)
        wrong["part"], wrong["axis"], wrong["before"] = _PARTS[fault.part].code, axis, max(first - 1, 0)
        wrong["value"], wrong["least"], wrong["most"] = values[first:end], least, most
        wrong["under"], wrong["over"] = under, over
    return table


def _first_tick(t_s: float, imu_hz: float, n: int) -> int:
    """The first of `n` rows that ends at or after `t_s` since power-up; less than a nanotick is round-off."""
    return n if math.isinf(t_s) else min(max(math.ceil(t_s * imu_hz - 1e-9) - 1, 0), n)


def _columns(fault: "Fault", source: Source, n: int) -> list[tuple["Fault", int, Array]]:
    """Each axis of a fault, with its SI value in each of `n` ticks."""
    part, letter = _PARTS[fault.part], fault.channel.partition(".")[2]
    axes = ["xyz".index(letter)] if letter else list(range(part.axes))
    if fault.kind in BY_AXIS:
        return [(fault, axis, np.full(n, value)) for axis, value in enumerate(fault.values)]
    if fault.kind == "spikes":
        amplitude, share = fault.values
        axes = [0, 1] if fault.part == "gps" else axes
        draws = source(f"fault {fault}").random((n, 4))
        hit = np.where(draws[:, :1] < share, amplitude * part.si, 0.0)
        azimuth = 2.0 * np.pi * draws[:, 1:2]
        ways = np.hstack([np.cos(azimuth), np.sin(azimuth)]) if fault.part == "gps" else np.sign(draws[:, 1:] - 0.5)
        return [(fault, axis, hit[:, 0] * ways[:, axis]) for axis in axes]
    if fault.kind == "dropout" and fault.part == "magnetometer":
        axes = [0]  # the whole sample is lost
    value = fault.values[0] if fault.values else 0.0
    si = part.si if fault.kind == "bias" else 1.0
    return [(fault, axis, np.full(n, value * si)) for axis in axes]


def _sampled(part: str, rates: Rates, unit: np.void, n: int) -> NDArray[np.bool_]:
    """Ticks of `n` in which a fault may act: for air data those with a sample, which the log does not mark."""
    steps = int(unit["air"][{"airspeed": "airspeed_steps", "barometer": "baro_steps"}[part]]) if part in _AIR else 1
    end = np.arange(1, n + 1) * rates.steps_per_tick
    sampled: NDArray[np.bool_] = end // steps * steps > end - rates.steps_per_tick
    return sampled


def _span(part: str, unit: np.void) -> tuple[float, float, float, float]:
    """Lowest and highest reading of a part and its readings beyond them, in SI; infinite if unlimited."""
    least, most = -math.inf, math.inf
    if part in ("gyro", "accelerometer"):
        least, most = quantise(-math.inf, unit[part]), quantise(math.inf, unit[part])
    elif part == "magnetometer":
        count = float(unit[part]["step_ut"]) or 1.0
        least, most = count * float(unit[part]["lowest"]), count * float(unit[part]["highest"])
        if unit[part]["overflow"]:
            return least, most, count * float(unit[part]["overflow"]), count * float(unit[part]["overflow"])
    elif part == "airspeed":
        least, most = 0.0, math.sqrt(2.0 * float(unit["air"]["range_pa"]) / DENSITY_KG_M3)
    elif part == "barometer" and math.isfinite(unit["air"]["baro_range_pa"]):
        elevation_m = float(unit["air"]["elevation_m"])
        least, most = (height_at_m(pa, elevation_m) for pa in (float(unit["air"]["baro_range_pa"]), 0.0))
    return least, most, least, most


@kernel
def spoil(truth, measured, k, faults):  # type: ignore[no-untyped-def]
    """Apply the faults of row `k` in order; `faults` is shape (n, m) of FAULT.

    The bias in the truth is the reading of gyro and accelerometer without signal and noise: a bias fault adds to it
    and a gain fault multiplies it; all other kinds leave it unchanged.
    """
    row = measured[k]
    for j in range(faults.shape[1]):
        fault = faults[k, j]
        before = measured[fault.before]
        i = fault.axis
        if fault.kind == 0:
            continue
        if fault.part == _GYRO:
            row.gyro_b_rad_s[i] = _wrong(row.gyro_b_rad_s[i], before.gyro_b_rad_s[i], fault)
            truth[k].gyro_bias_b_rad_s[i] = _wrong_bias(truth[k].gyro_bias_b_rad_s[i], fault)
        elif fault.part == _ACCELEROMETER:
            row.force_b_m_s2[i] = _wrong(row.force_b_m_s2[i], before.force_b_m_s2[i], fault)
            truth[k].force_bias_b_m_s2[i] = _wrong_bias(truth[k].force_bias_b_m_s2[i], fault)
        elif fault.part == _MAGNETOMETER and row.mag_new:
            if fault.kind == Kind.DROPOUT:
                row.mag_new = 0
                for axis in range(3):
                    row.mag_b_ut[axis] = measured[k - 1].mag_b_ut[axis] if k > 0 else 0.0
            else:
                row.mag_b_ut[i] = _wrong(row.mag_b_ut[i], before.mag_b_ut[i], fault)
        elif fault.part == _AIRSPEED:
            row.equivalent_airspeed_m_s = _wrong(row.equivalent_airspeed_m_s, before.equivalent_airspeed_m_s, fault)
        elif fault.part == _BAROMETER:
            row.baro_height_m = _wrong(row.baro_height_m, before.baro_height_m, fault)
        elif fault.part == _GPS and row.gps_new:
            spoil_fix(measured, k, fault)


@kernel
def _wrong(reading, before, fault):  # type: ignore[no-untyped-def]
    """The faulty value of `reading`; `before` is the last reading before the window of the fault."""
    if fault.kind == Kind.STUCK:
        return before
    if fault.kind == Kind.DROPOUT:
        return 0.0
    if fault.kind == Kind.NAN:
        return np.nan
    if fault.kind == Kind.SATURATED:
        return fault.value
    off = reading * fault.value if fault.kind == Kind.GAIN else reading + fault.value
    if off < fault.least:
        return fault.under
    return fault.over if off > fault.most else off


@kernel
def _wrong_bias(bias, fault):  # type: ignore[no-untyped-def]
    """The reading without signal, `bias` without the fault."""
    if fault.kind == Kind.BIAS:
        return bias + fault.value
    return bias * fault.value if fault.kind == Kind.GAIN else bias
