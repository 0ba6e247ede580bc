"""Manoeuvres found in the true motion: turns with their roll-outs, loops, rolls, vertical flight, spins.

How a manoeuvre is judged must not depend on the estimate or on the script.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.interface import Array
from scenarios.harness.metrics import (
    NOTHING,
    Measured,
    Metric,
    Moment,
    Series,
    SeriesOf,
    bank_size_deg,
    highest,
    lowest,
    settled_after_s,
    time_s,
)
from sim.log import Flight

Flags = Callable[[Flight], NDArray[np.bool_]]  # of each tick, shape (n,)


def bank_rad(flight: Flight) -> Array:
    """True bank angle, -pi..pi, shape (n,)."""
    R = flight.log.truth["R_eb"]
    return np.arctan2(R[:, 2, 1], R[:, 2, 2])


@dataclass(frozen=True, slots=True)
class RollOut:
    """The end of a turn: when the bank fell below 10 degrees, and when the next turn began or the flight ended."""

    t_s: float
    until_s: float


def roll_outs(flight: Flight, steep_deg: float = 25.0, level_deg: float = 10.0, held_s: float = 1.0) -> list[RollOut]:
    """Roll-outs of the true turns, in order of time.

    A turn is a bank above `steep_deg` to one side for at least `held_s`; it begins where the bank last rose
    through `level_deg` before that, and ends where the bank next falls below it.
    """
    t_s, bank = time_s(flight), np.degrees(bank_rad(flight))
    level = np.flatnonzero(np.abs(bank) < level_deg)
    begins, ends = [], []
    for first, last in _runs(bank > steep_deg) + _runs(bank < -steep_deg):
        if (last - first + 1) * flight.dt_s < held_s:
            continue
        before, later = level[level < first], level[level > last]
        begins.append(t_s[before[-1]] if len(before) else t_s[0])
        if len(later):
            ends.append(t_s[later[0]])
    begins = sorted(begins)
    last_s = float(t_s[-1]) if len(t_s) else math.nan
    return [RollOut(float(e), next((float(b) for b in begins if b > e), last_s)) for e in sorted(set(ends))]


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def while_banked(series: SeriesOf, steeper_deg: float) -> SeriesOf:
    """`series`, judged only where the true bank is at least `steeper_deg` to either side."""

    def banked(flight: Flight) -> Series:
        whole = series(flight)
        return replace(whole, judged=whole.judged & (np.abs(np.degrees(bank_rad(flight))) >= steeper_deg))

    return banked


def time_banked_s(steeper_deg: float, from_: Moment) -> Metric:
    """Metric: total time, from `from_` on, with a true bank of at least `steeper_deg` to either side, s."""
    steep = while_banked(bank_size_deg, steeper_deg)
    return lambda flight: Measured(len(steep(flight).within(from_(flight), math.inf).judged_values) * flight.dt_s)


def slowest_recovery(series: SeriesOf, limit: float, turns: int, within_s: float) -> Metric:
    """Metric: the longest time after a roll-out until `series` stays at or below `limit` up to the next turn, s.

    Only roll-outs that are followed by at least `within_s` of flight count; `turns` of them are expected.
    """

    def metric(flight: Flight) -> Measured:
        errors = series(flight)
        watched = [r for r in roll_outs(flight) if r.until_s - r.t_s >= within_s]
        times = [settled_after_s(errors.within(r.t_s, r.until_s), limit) for r in watched]
        return Measured(highest(np.array(times)), len(times), turns)

    return metric


def turns_of_pitch(flight: Flight) -> Array:
    """Turns of the nose in the vertical plane it flew in at the release: 1 after an inside loop, shape (n,).

    The angle of the nose is taken in the plane of the vertical and the initial heading, so that rolls do not count.
    """
    nose = flight.log.truth["R_eb"][:, :, 0]
    k0 = int(np.searchsorted(time_s(flight), 0.0))
    if k0 >= len(nose):
        return np.zeros(len(nose))
    ahead = nose[k0, :2] / np.linalg.norm(nose[k0, :2])
    angle = np.unwrap(np.arctan2(-nose[:, 2], nose[:, :2] @ ahead))
    return (angle - angle[k0]) / (2.0 * np.pi)


def turns_that_count(loops: int) -> float:
    """Turns of the nose that count as `loops` full loops: the last may end 20 degrees short of level."""
    return loops - 20.0 / 360.0


def loops_end_s(loops: int) -> Moment:
    """The moment at which the nose has come round `loops` times."""

    def moment(flight: Flight) -> float:
        done = np.flatnonzero(turns_of_pitch(flight) >= turns_that_count(loops))
        return float(time_s(flight)[done[0]]) if len(done) else math.nan

    return moment


def most_loops(flight: Flight) -> Measured:
    """Metric: most turns of the nose in inside loops."""
    return Measured(highest(turns_of_pitch(flight)))


def most_outside_loops(flight: Flight) -> Measured:
    """Metric: most turns of the nose in outside loops."""
    return Measured(-lowest(turns_of_pitch(flight)))


def turned(axis: str, sense: float) -> Metric:
    """Metric: largest rotation about the body `axis`, x, y or z, in the sense +1 or -1, turns.

    The integral of the body rate, from its lowest point to the highest that follows; turning back is subtracted.
    """
    i = "xyz".index(axis)

    def metric(flight: Flight) -> Measured:
        angle = sense * np.cumsum(flight.log.truth["imu_omega_b_rad_s"][:, i]) * flight.dt_s
        if not len(angle):
            return NOTHING
        return Measured(float(np.max(angle - np.minimum.accumulate(angle))) / (2.0 * np.pi))

    return metric


def inverted(flight: Flight) -> NDArray[np.bool_]:
    """Flags: upside down within 37 degrees, ``r_zz`` below -0.8."""
    return np.asarray(flight.log.truth["R_eb"][:, 2, 2] < -0.8)


def vertical(flight: Flight) -> NDArray[np.bool_]:
    """Flags: the nose within 15 degrees of straight up."""
    return np.asarray(-flight.log.truth["R_eb"][:, 2, 0] > math.sin(math.radians(75.0)))


def spinning(flight: Flight) -> NDArray[np.bool_]:
    """Flags: wing well stalled, roll and yaw in the same sense, each faster than 45 deg/s: autorotation."""
    truth, least_rad_s = flight.log.truth, math.radians(45.0)
    roll, yaw = truth["imu_omega_b_rad_s"][:, 0], truth["imu_omega_b_rad_s"][:, 2]
    fast = (np.minimum(np.abs(roll), np.abs(yaw)) > least_rad_s) & (roll * yaw > 0.0)
    return np.asarray(fast & (truth["alpha_rad"] > math.radians(15.0)))


def total_s(flags: Flags) -> Metric:
    """Metric: total time for which `flags` are true, s."""
    return lambda flight: Measured(float(np.count_nonzero(flags(flight))) * flight.dt_s)


def longest_s(flags: Flags) -> Metric:
    """Metric: longest time for which `flags` are true without a break, s."""
    return lambda flight: Measured(max((b - a + 1 for a, b in _runs(flags(flight))), default=0) * flight.dt_s)


def last(flags: Flags) -> Moment:
    """The last moment at which `flags` are true; NaN if they never are."""

    def moment(flight: Flight) -> float:
        true = np.flatnonzero(flags(flight))
        return float(time_s(flight)[true[-1]]) if len(true) else math.nan

    return moment


def spun_turns(flight: Flight) -> Measured:
    """Metric: turns about the vertical while `spinning`; the rate is the third row times the gyro vector."""
    truth = flight.log.truth
    rate = np.sum(truth["R_eb"][:, 2] * truth["imu_omega_b_rad_s"], axis=1)
    return Measured(float(abs(np.sum(rate[spinning(flight)]))) * flight.dt_s / (2.0 * np.pi))


def course_turned(flags: Flags) -> Metric:
    """Metric: how far the true course turned to the right between the first and the last flag, turns."""

    def metric(flight: Flight) -> Measured:
        true = np.flatnonzero(flags(flight))
        if not len(true):
            return NOTHING
        v_e = flight.log.truth["v_e_m_s"]
        course = np.unwrap(np.arctan2(v_e[:, 1], v_e[:, 0]))
        return Measured(float(course[true[-1]] - course[true[0]]) / (2.0 * np.pi))

    return metric
