"""The hand launch: what its acceleration does to an accelerometer and to the matrix, and how soon yaw is locked."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimator.interface import G_M_S2, Array
from estimator.rotation import inclination_error_rad
from scenarios.claims._flown import PUBLISHED, pooled_rms, slowest, tuned
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.metrics import heading_error_deg, height_m, inclination_error_deg, settled_after_s, time_s
from sim.log import Flight, Outcome

DIVE_S = 3.0  # whoever dives has done so by then
LOCKED_DEG = 15.0
LOCK_SOON_S = 5.0  # "shortly after take-off": the aeroplane is not higher than a house
WEIGHTS = (0.1, 0.3, 0.6, 1.2, 2.4)
LARGE = 1.2
WINDOWS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
RECOVERY_S = 10.0  # the paper's own time constant of patience, section "Feedback controller"


def _pitch_deg(R_eb: Array) -> Array:
    return np.degrees(-np.arcsin(np.clip(R_eb[:, 2, 0], -1.0, 1.0)))


def _between(flight: Flight, from_s: float, to_s: float) -> NDArray[np.bool_]:
    t_s = time_s(flight)
    return (t_s > from_s) & (t_s <= to_s)


def _crashed(flown: Sequence[Flight]) -> float:
    """Percentage of the flights that ended on the ground."""
    return 100.0 * float(np.mean([flight.outcome == Outcome.GROUND_CONTACT for flight in flown]))


def _lowest_pitch_deg(flight: Flight) -> float:
    return float(_pitch_deg(flight.log.truth["R_eb"])[_between(flight, 0.0, DIVE_S)].min())


def _fooled_deg(flight: Flight) -> float:
    """Pitch believed too much, at most, while the hand pushes."""
    log = flight.log
    too_much = _pitch_deg(log.flown["R_eb"]) - _pitch_deg(log.truth["R_eb"])
    return float(too_much[_between(flight, -0.3, 0.0)].max())


def _dives(seeds: Sequence[int]) -> Finding:
    alone = flights("hand_launch", seeds, {}, "accelerometer_only")
    # The paper's own roll-pitch correction: the push is not gated away.
    matrix = flights("hand_launch", seeds, tuned(launch_gate=PUBLISHED["launch_gate"]))
    fooled = float(np.median([_fooled_deg(flight) for flight in alone]))
    down = float(np.median([time_s(flight)[-1] for flight in alone]))
    shallowest = max(_lowest_pitch_deg(flight) for flight in alone)
    nose = min(_lowest_pitch_deg(flight) for flight in matrix)

    def draw(figure: Figure) -> None:
        pitch, height = axes(figure, "Pitch after the release", "Height")
        for flown, colour, name in ((alone, RED, "accelerometer alone"), (matrix, BLUE, "the matrix")):
            for i, flight in enumerate(flown):
                shown = _between(flight, -0.3, 4.0)
                t_s = time_s(flight)[shown]
                style = {"color": colour, "lw": 1, "label": name if i == 0 else None}
                pitch.plot(t_s, _pitch_deg(flight.log.truth["R_eb"])[shown], **style)
                height.plot(t_s, height_m(flight).value[shown], **style)
        pitch.axhline(0.0, color=FAINT, lw=1)
        pitch.legend(loc="lower right")
        label(pitch, "s after the release", "true pitch, deg")
        label(height, "s after the release", "m above the ground")

    return Finding(
        stands=(
            line("accelerometer alone: flights that hit the ground", "%", _crashed(alone), ">=", 90.0),
            line("accelerometer alone: shallowest of the dives", "deg", shallowest, "<=", -20.0),
            line("the matrix: flights that hit the ground", "%", _crashed(matrix), "<=", 0.0),
            line("the matrix: lowest the nose came", "deg", nose, ">=", 0.0),
        ),
        told=f"The push makes the accelerometer believe {fooled:.0f} degrees too much of pitch; every flight that "
        f"steers by it dives, and hits the ground {down:.1f} s after the release. By the matrix, with no gate against "
        f"the push, none comes down and the nose never drops below {nose:.0f} degrees.",
        seeds=len(seeds),
        draw=draw,
    )


def forward_acceleration_m_s2(flight: Flight) -> Array:
    """True acceleration along the nose: what the accelerometer's x axis feels beside gravity, shape (n,)."""
    truth = flight.log.truth
    return np.asarray(truth["imu_force_b_m_s2"][:, 0] + G_M_S2 * truth["R_eb"][:, 2, 0])


def _mean_over_deg(flown: Sequence[Flight], window_s: float) -> float:
    """RMS of the forward acceleration averaged over `window_s`, as the tilt that it feigns, degrees."""
    means = []
    for flight in flown:
        acceleration = forward_acceleration_m_s2(flight)[time_s(flight) > 5.0]
        n = round(window_s / flight.dt_s)
        total = np.concatenate(([0.0], np.cumsum(acceleration)))
        means.append((total[n:] - total[:-n]) / n)
    return float(np.degrees(np.sqrt(np.mean(np.square(np.concatenate(means)))) / G_M_S2))


def _felt_tilt_deg(flight: Flight) -> Array:
    """Angle between what the accelerometer feels and true down, degrees, shape (n,)."""
    force_b = flight.log.truth["imu_force_b_m_s2"]
    felt = flight.log.truth["R_eb"].copy()
    felt[:, 2] = -force_b / np.linalg.norm(force_b, axis=1)[:, None]
    return np.degrees(inclination_error_rad(felt, flight.log.truth["R_eb"]))


def _averages_out(seeds: Sequence[int]) -> Finding:
    thrown = flights("hand_launch", seeds, tuned(launch_gate=PUBLISHED["launch_gate"]))
    cruising = flights("turns_180", seeds[: max(1, len(seeds) // 2)])
    peak = max(float(inclination_error_deg(flight).within(0.0, 5.0).value.max()) for flight in thrown)
    felt = max(float(_felt_tilt_deg(flight)[_between(flight, -0.3, 0.0)].max()) for flight in thrown)
    later = pooled_rms(thrown, inclination_error_deg, RECOVERY_S)
    means = [_mean_over_deg(cruising, window_s) for window_s in WINDOWS_S]
    second, ten, long = (means[WINDOWS_S.index(w)] for w in (1.0, RECOVERY_S, 40.0))

    def draw(figure: Figure) -> None:
        launch, average = axes(figure, "Thrown: tilt the matrix is off by", "Flying: forward acceleration, averaged")
        for flight in thrown:
            shown = _between(flight, -0.3, 15.0)
            launch.plot(time_s(flight)[shown], inclination_error_deg(flight).value[shown], color=BLUE, lw=0.8)
        launch.axhline(felt, color=RED, lw=1, ls="--")
        launch.annotate("what the accelerometer feels in the push", (15.0, felt - 5.5), color=RED, ha="right")
        launch.set_ylim(0.0, felt + 8.0)
        label(launch, "s after the release", "deg")
        average.loglog(WINDOWS_S, means, "o-", color=BLUE)
        average.set_xticks(WINDOWS_S, [f"{w:g}" for w in WINDOWS_S])
        average.minorticks_off()
        average.set_yticks((0.1, 0.3, 1.0, 3.0), ("0.1", "0.3", "1", "3"))
        label(average, "averaged over, s", "feigned tilt, deg RMS")

    return Finding(
        stands=(
            line("average over 40 s, as part of that over 1 s", "", long / second, "<=", 0.2),
            line("average over 10 s, as tilt", "deg", ten, "<=", 2.0),
            line("launch: largest tilt error, as part of what is felt", "", peak / felt, "<=", 0.25),
            line("launch: tilt error 10 s later", "deg RMS", later, "<=", 4.0),
        ),
        told=f"In flight with turns the forward acceleration feigns {second:.1f} degrees over a second, {ten:.1f} over "
        f"10 s and {long:.1f} over 40 s. The push of a launch feigns {felt:.0f} degrees, of which at most {peak:.0f} "
        f"get into the matrix; 10 s later it is off by {later:.1f} degrees RMS.",
        seeds=len(seeds),
        draw=draw,
    )


def _lock_s(flight: Flight) -> float:
    return settled_after_s(heading_error_deg("course")(flight).within(0.0, math.inf), LOCKED_DEG)


def _yaw_lock(seeds: Sequence[int]) -> Finding:
    times = {w: [_lock_s(flight) for flight in flights("hand_launch", seeds, tuned(w_y=w))] for w in WEIGHTS}
    large = flights("hand_launch", seeds, tuned(w_y=LARGE))
    latest = {w: slowest(times[w]) for w in WEIGHTS}

    def draw(figure: Figure) -> None:
        course, by_weight = axes(figure, f"Heading after the release, W_Y = {LARGE:g}", "Locked, by weight")
        for flight in large:
            error = heading_error_deg("course")(flight).within(0.0, 8.0)
            course.plot(error.t_s, error.value, color=BLUE, lw=1)
        course.axhline(LOCKED_DEG, color=FAINT, ls="--", lw=1)
        course.annotate("locked below 15 deg", (8.0, LOCKED_DEG + 4.0), color=FAINT, ha="right")
        course.set_yticks((0.0, 45.0, 90.0, 135.0, 180.0))
        label(course, "s after the release", "heading less course, deg")
        for w in WEIGHTS:
            found = [t for t in times[w] if math.isfinite(t)]
            by_weight.plot([w] * len(found), found, "o", color=BLUE if w == LARGE else ORANGE, alpha=0.6, mew=0)
            if len(found) < len(times[w]):
                by_weight.annotate(f"{len(times[w]) - len(found)} never", (w, 18.4), ha="center", color=RED)
        by_weight.set_xscale("log")
        by_weight.set_xticks(WEIGHTS, [f"{w:g}" for w in WEIGHTS])
        by_weight.minorticks_off()
        by_weight.set_xlim(0.07, 3.4)
        by_weight.set_ylim(0.0, 20.0)
        by_weight.set_yticks((0.0, 5.0, 10.0, 15.0, 20.0))
        label(by_weight, "weight of the yaw correction", "s after the release")

    gentle = sum(t > LOCK_SOON_S or math.isnan(t) for t in times[0.3])
    return Finding(
        stands=(
            line(f"slowest lock, W_Y = {LARGE:g}", "s", latest[LARGE], "<=", LOCK_SOON_S),
            line("slowest lock, twice that weight", "s", latest[2.0 * LARGE], "<=", latest[LARGE]),
        ),
        told=f"Thrown in any direction with the heading unknown, yaw is within 15 degrees of the course after "
        f"{float(np.median(times[LARGE])):.1f} s (the slowest after {latest[LARGE]:.1f} s) with a weight of {LARGE:g}. "
        f"With 0.3 it takes up to {latest[0.3]:.0f} s, and {gentle} of {len(seeds)} take more than 5 s.",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="accelerometer_dives",
        title="Thrown, an accelerometer alone dives and the matrix does not",
        paper=Paper.THEORY,
        place="Accelerometers",
        says="Pitch held by the accelerometer alone takes the push of a hand launch for a climb and steers straight "
        "down; the matrix, which the gyros carry, does not.",
        expected=Verdict.CONFIRMED,
        measure=_dives,
    ),
    Claim(
        name="forward_acceleration",
        title="Forward acceleration averages out",
        paper=Paper.THEORY,
        place="Accelerometers",
        says="Forward acceleration cannot be told from gravity, but an aeroplane does not gain or lose speed for long: "
        "on average it is nothing, and a slow correction can ignore it.",
        expected=Verdict.CONFIRMED,
        measure=_averages_out,
    ),
    Claim(
        name="yaw_lock",
        title="A large yaw weight locks yaw shortly after take-off",
        paper=Paper.THEORY,
        place="GPS, first reason for a large weight",
        says="Nothing is known of the heading before the aeroplane moves; with a large weight of the yaw correction it "
        "is found shortly after take-off.",
        expected=Verdict.CONFIRMED,
        measure=_yaw_lock,
    ),
)
