"""When inertial samples are taken: over intervals of uneven length, and some never arrive.

Jitter (`board.dt_jitter`).  A firmware reads gyro and accelerometer when its loop comes round, and takes the mean of
what they delivered since it last did.  In the simulation a sample ends at its tick, or earlier: by the share e of a
tick, half-normal.  Sample k covers the ticks from k - 1 + (1 - e(k-1)) to k + (1 - e(k)):

    length = 1 + e(k-1) - e(k)        reading = (e(k-1) r(k-1) + (1 - e(k)) r(k)) / length

with r the readings of whole ticks, converter and faults included.  Readings times intervals add up to the same angles
and velocities as without jitter, whatever e is; and so does the noise.  The time stamp ``t_s`` is the end of the
interval and ``dt_s`` its length: the jitter is real, and the stamps are true.  Estimate and command of such a sample
are as old as it is, by 0.94 `dt_jitter` of a tick on average.

Lost samples (the fault ``imu:dropped``).  A sample that does not arrive starts no pass of the firmware: no estimate,
no command; the last ones stay.  Its row repeats the readings and the time stamp of the last sample that arrived.  The
next one to arrive has read its own interval only, the motion in between is lost; its ``dt_s`` is the time since the
last one that arrived, as firmware computes it from the stamps.  GPS, magnetometer and air data that come during a lost
sample are handed over with the next.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from sim.clock import Rates
from sim.sensors.board import BoardParams
from sim.sensors.noise import Source

if TYPE_CHECKING:
    from sim.faults import Fault

CHANNELS: Final = ("imu",)
DROPPED, SHARE = "dropped", 0.05
MOST_EARLY: Final = 0.95  # of a tick; no sample is over before it has begun
# The difference of two half-normal numbers of scale s has the variance 2 s^2 (1 - 2 / pi).
SCALE: Final = 1.0 / math.sqrt(2.0 - 4.0 / math.pi)

SAMPLE = np.dtype([("early", "f8"), ("lost", "i8")], align=True)  # of each tick
EVERY_TICK = np.zeros(0, SAMPLE)
MEMORY = np.dtype(
    [
        ("gyro_b_rad_s", "f8", (3,)),  # readings of the whole tick before
        ("force_b_m_s2", "f8", (3,)),
        ("missing", "i8"),  # whether the sample before was lost
        ("gps_new", "i8"),  # what has arrived since the last sample
        ("mag_new", "i8"),
        ("air_new", "i8"),
    ],
    align=True,
)


def kinds_of(_channel: str) -> tuple[str, ...]:
    """Kinds of fault of the inertial unit."""
    return (DROPPED,)


def defaults_of(_channel: str, _kind: str) -> tuple[float, ...]:
    """Default share of the samples that are lost."""
    return (SHARE,)


def unit_of(_channel: str, _kind: str) -> str:
    """The share has no unit."""
    return "a fraction of the samples"


def wrong_values(_channel: str, _kind: str, values: tuple[float, ...]) -> str:
    """What would be right, if the share is not."""
    return "" if 0.0 < values[0] <= 1.0 else "must be above 0 and at most 1, the fraction of the samples that are lost"


def samples_of(
    params: BoardParams, faults: Sequence["Fault"], release_s: float, rates: Rates, source: Source, n: int
) -> NDArray[np.void]:
    """How each of `n` ticks is sampled, shape (n,) of SAMPLE; or EVERY_TICK, if each is, in full.

    release_s : since power-up         source : each fault has the stream "fault <its text>"
    """
    if not params.dt_jitter and not faults:
        return EVERY_TICK
    samples = np.zeros(n, SAMPLE)
    if params.dt_jitter:
        early = SCALE * params.dt_jitter * np.abs(source("board dt jitter").standard_normal(n))
        samples["early"] = np.minimum(early, MOST_EARLY)
    for fault in faults:
        t_s = rates.dt_s * np.arange(1, n + 1) - release_s
        within = (t_s >= fault.from_s - 1e-9) & (t_s < fault.to_s - 1e-9)
        samples["lost"] |= within & (source(f"fault {fault}").random(n) < fault.values[0])
    samples["lost"][:1] = 0  # the first row has no row before it to repeat
    return samples


@kernel
def take_sample(measured, seen, k, samples, memory):  # type: ignore[no-untyped-def]
    """Turn the readings of the whole tick in row `k` into those of its sample; `memory` is a record of MEMORY."""
    row, early, before = measured[k], samples[k].early, 0.0
    if k > 0:
        before = samples[k - 1].early
    length = 1.0 + before - early
    for i in range(3):
        gyro, force = row.gyro_b_rad_s[i], row.force_b_m_s2[i]
        if early > 0.0 or before > 0.0:
            row.gyro_b_rad_s[i] = (before * memory.gyro_b_rad_s[i] + (1.0 - early) * gyro) / length
            row.force_b_m_s2[i] = (before * memory.force_b_m_s2[i] + (1.0 - early) * force) / length
        memory.gyro_b_rad_s[i], memory.force_b_m_s2[i] = gyro, force
    if samples[k].lost:
        _miss(measured, k, memory)
    else:
        dt_s = row.dt_s
        row.t_s -= early * dt_s
        if memory.missing:
            row.dt_s = row.t_s - measured[k - 1].t_s
            _hand_over(row, memory)
        elif length != 1.0:
            row.dt_s = length * dt_s
    seen[k] = measured[k]


@kernel
def _miss(measured, k, memory):  # type: ignore[no-untyped-def]
    """Nothing arrives in row `k`: it repeats the last sample, and what else came waits."""
    row, last = measured[k], measured[k - 1]
    row.t_s, row.dt_s = last.t_s, last.dt_s
    for i in range(3):
        row.gyro_b_rad_s[i], row.force_b_m_s2[i] = last.gyro_b_rad_s[i], last.force_b_m_s2[i]
    memory.missing = 1
    memory.gps_new |= row.gps_new
    memory.mag_new |= row.mag_new
    memory.air_new |= row.air_new
    row.gps_new = row.mag_new = row.air_new = 0


@kernel
def _hand_over(row, memory):  # type: ignore[no-untyped-def]
    """Mark what came while samples were lost as new."""
    row.gps_new |= memory.gps_new
    row.mag_new |= memory.mag_new
    row.air_new |= memory.air_new
    memory.missing = memory.gps_new = memory.mag_new = memory.air_new = 0
