"""The hand launch: what its acceleration does to an accelerometer and to the matrix, and how soon yaw locks."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.interface import G_M_S2, Array
from estimator.rotation import inclination_error_rad
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.flights import flights, hit_ground, percentage, pooled_rms, slowest, tuned
from scenarios.harness.claims.motions import NEVER
from scenarios.harness.claims.picture import BLUE, ORANGE, RED, Panel
from scenarios.harness.metrics import (
    Series,
    heading_error_deg,
    height_m,
    inclination_error_deg,
    settled_after_s,
    time_s,
)
from sim.log import Flight

DIVE_S = 3.0  # a dive has begun by then
LOCKED_DEG = 15.0
LOCK_SOON_S = 5.0  # "shortly after take-off": the aeroplane is not higher than a house
WEIGHTS = (0.1, 0.3, 0.6, 1.2, 2.4)
LARGE = 1.2
WINDOWS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
RECOVERY_S = 10.0  # the paper's own time to recover, section "Feedback controller"
UNGATED = tuned(launch_gate=NEVER)  # the paper's own roll-pitch correction, which does not ignore the launch


def _pitch_deg(R_eb: Array) -> Array:
    return np.degrees(-np.arcsin(np.clip(R_eb[:, 2, 0], -1.0, 1.0)))


def _true_pitch_deg(flight: Flight) -> Series:
    pitch_deg = _pitch_deg(flight.log.truth["R_eb"])
    return Series(time_s(flight), pitch_deg, np.ones(len(pitch_deg), bool))


def _between(flight: Flight, from_s: float, to_s: float) -> NDArray[np.bool_]:
    t_s = time_s(flight)
    return (t_s > from_s) & (t_s <= to_s)


def _lowest_pitch_deg(flight: Flight) -> float:
    return float(_pitch_deg(flight.log.truth["R_eb"])[_between(flight, 0.0, DIVE_S)].min())


def _false_pitch_deg(flight: Flight) -> float:
    """Largest estimated minus true pitch during the throw."""
    log = flight.log
    too_much = _pitch_deg(log.flown["R_eb"]) - _pitch_deg(log.truth["R_eb"])
    return float(too_much[_between(flight, -0.3, 0.0)].max())


@claim(Paper.THEORY, "Accelerometers", seeds=10)
def accelerometer_dives(seeds: Sequence[int]) -> Finding:
    """At a hand launch an accelerometer alone causes a dive; the matrix does not.

    Pitch control with an accelerometer alone takes the acceleration of a hand launch for a climb and dives; the matrix,
    which relies on the gyros, does not.
    """
    alone = flights("hand_launch", seeds, {}, "accelerometer_only")
    matrix = flights("hand_launch", seeds, UNGATED)
    false = float(np.median([_false_pitch_deg(flight) for flight in alone]))
    down_s = float(np.median([time_s(flight)[-1] for flight in alone]))
    shallowest = max(_lowest_pitch_deg(flight) for flight in alone)
    nose = min(_lowest_pitch_deg(flight) for flight in matrix)

    pitch = Panel("Pitch after the release", "true pitch, deg", "s after the release", legend="lower right")
    height = Panel("Height", "m above the ground", "s after the release")
    for flown, colour, name in ((alone, RED, "accelerometer alone"), (matrix, BLUE, "matrix")):
        pitch.flights(flown, _true_pitch_deg, colour, name, -0.3, 4.0)
        height.flights(flown, height_m, colour, "", -0.3, 4.0)
    pitch.level(0.0)
    return Finding(
        lines=[
            line("accelerometer alone: flights that hit the ground", "%", percentage(alone, hit_ground), ">=", 90.0),
            line("accelerometer alone: pitch of the shallowest dive", "deg", shallowest, "<=", -20.0),
            line("matrix: flights that hit the ground", "%", percentage(matrix, hit_ground), "<=", 0.0),
            line("matrix: lowest pitch", "deg", nose, ">=", 0.0),
        ],
        summary=f"During the throw the accelerometer shows {false:.0f} degrees too much pitch. Every flight controlled "
        f"by it dives and hits the ground {down_s:.1f} s after the release. With the matrix, without any gate for the "
        f"launch, no flight comes down, and the pitch never falls below {nose:.0f} degrees.",
        panels=[pitch, height],
    )


def forward_acceleration_m_s2(flight: Flight) -> Array:
    """True acceleration along the nose: the accelerometer's x axis without gravity, shape (n,)."""
    truth = flight.log.truth
    return np.asarray(truth["imu_force_b_m_s2"][:, 0] + G_M_S2 * truth["R_eb"][:, 2, 0])


def _mean_over_deg(flown: Sequence[Flight], window_s: float) -> float:
    """RMS of the forward acceleration averaged over `window_s`, as an apparent inclination, degrees."""
    means = []
    for flight in flown:
        acceleration = forward_acceleration_m_s2(flight)[time_s(flight) > 5.0]
        n = round(window_s / flight.dt_s)
        total = np.concatenate(([0.0], np.cumsum(acceleration)))
        means.append((total[n:] - total[:-n]) / n)
    return float(np.degrees(np.sqrt(np.mean(np.square(np.concatenate(means)))) / G_M_S2))


def _apparent_tilt_deg(flight: Flight) -> Array:
    """Angle between the specific force and true down, degrees, shape (n,)."""
    force_b = flight.log.truth["imu_force_b_m_s2"]
    felt = flight.log.truth["R_eb"].copy()
    felt[:, 2] = -force_b / np.linalg.norm(force_b, axis=1)[:, None]
    return np.degrees(inclination_error_rad(felt, flight.log.truth["R_eb"]))


@claim(Paper.THEORY, "Accelerometers", seeds=10)
def forward_acceleration(seeds: Sequence[int]) -> Finding:
    """Forward acceleration averages out.

    Forward acceleration cannot be distinguished from gravity, but an aeroplane does not gain or lose speed for long:
    the average is zero, and a slow correction can ignore it.
    """
    thrown = flights("hand_launch", seeds, UNGATED)
    cruising = flights("turns_180", seeds[: max(1, len(seeds) // 2)])
    peak = max(float(inclination_error_deg(flight).within(0.0, 5.0).value.max()) for flight in thrown)
    felt = max(float(_apparent_tilt_deg(flight)[_between(flight, -0.3, 0.0)].max()) for flight in thrown)
    later = pooled_rms(thrown, inclination_error_deg, RECOVERY_S)
    means = [_mean_over_deg(cruising, window_s) for window_s in WINDOWS_S]
    second, ten, long = (means[WINDOWS_S.index(w)] for w in (1.0, RECOVERY_S, 40.0))

    throw = Panel("Hand launch: inclination error of the matrix", "deg", "s after the release", ylim=(0.0, felt + 8.0))
    throw.flights(thrown, inclination_error_deg, BLUE, "", -0.3, 15.0)
    throw.level(felt, RED)
    throw.note("apparent inclination in the throw", 15.0, felt - 5.5, RED, ha="right")
    average = Panel(
        "In flight, averaged", "inclination, deg RMS", "window, s", log="xy", xticks=WINDOWS_S, yticks=(0.1, 0.3, 1, 3)
    )
    average.curve(WINDOWS_S, means, BLUE, style="o-")
    return Finding(
        lines=[
            line("average over 40 s, over that over 1 s", "", long / second, "<=", 0.2),
            line("average over 10 s, as inclination", "deg", ten, "<=", 2.0),
            line("launch: largest inclination error over apparent inclination", "", peak / felt, "<=", 0.25),
            line("launch: inclination error after 10 s", "deg RMS", later, "<=", 4.0),
        ],
        summary=f"In flight with turns, forward acceleration looks like an inclination of {second:.1f} degrees over a "
        f"second, {ten:.1f} over 10 s and {long:.1f} over 40 s. A launch looks like {felt:.0f} degrees, of which at "
        f"most {peak:.0f} get into the matrix; from 10 s later, its error is {later:.1f} degrees RMS.",
        panels=[throw, average],
    )


def _lock_s(flight: Flight) -> float:
    return settled_after_s(heading_error_deg("course")(flight).within(0.0, math.inf), LOCKED_DEG)


@claim(Paper.THEORY, "GPS, first reason for a large weight", seeds=10)
def yaw_lock(seeds: Sequence[int]) -> Finding:
    """A large yaw weight locks yaw shortly after take-off.

    Before the aeroplane moves, its heading is unknown; with a large weight of the yaw correction it is found shortly
    after take-off.
    """
    thrown = {w: flights("hand_launch", seeds, tuned(w_y=w)) for w in WEIGHTS}
    times = {w: [_lock_s(flight) for flight in flown] for w, flown in thrown.items()}
    latest = {w: slowest(times[w]) for w in WEIGHTS}
    gentle = sum(t > LOCK_SOON_S or math.isnan(t) for t in times[0.3])

    course = Panel(f"Heading after the release, W_Y = {LARGE:g}", "minus course, deg", yticks=(0, 45, 90, 135, 180))
    course.flights(thrown[LARGE], heading_error_deg("course"), BLUE, "", 0.0, 8.0)
    course.level(LOCKED_DEG, text="locked below 15 deg")
    by_weight = Panel(
        "Time to lock", "s", "weight of the yaw correction", log="x", xticks=WEIGHTS, xlim=(0.07, 3.4), ylim=(0.0, 20.0)
    )
    for w in WEIGHTS:
        found = [t for t in times[w] if math.isfinite(t)]
        by_weight.cloud(w, found, BLUE if w == LARGE else ORANGE)
        if len(found) < len(times[w]):
            by_weight.note(f"{len(times[w]) - len(found)} never", w, 18.4, RED, ha="center")
    return Finding(
        lines=[
            line(f"W_Y = {LARGE:g}: longest time to lock", "s", latest[LARGE], "<=", LOCK_SOON_S),
            line("twice that weight: longest time to lock", "s", latest[2.0 * LARGE], "<=", latest[LARGE]),
        ],
        summary=f"After a launch in any direction with the heading unknown, yaw is within 15 degrees of the course "
        f"after {float(np.median(times[LARGE])):.1f} s (at most {latest[LARGE]:.1f} s) with a weight of {LARGE:g}. "
        f"With 0.3 it takes up to {latest[0.3]:.0f} s, and {gentle} of {len(seeds)} flights take more than 5 s.",
        panels=[course, by_weight],
    )
