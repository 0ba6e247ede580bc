"""Wind and the yaw correction: where the heading points, what a reversal does to it, how large its weight should be."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.rotation import heading_rad
from scenarios.claims._flown import (
    course_error_deg,
    crab_deg,
    median,
    pooled_rms,
    roll_outs_after,
    slowest,
    tuned,
)
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import (
    heading_error_deg,
    inclination_error_deg,
    mean_size,
    settled_after_s,
    time_s,
    wind_error_m_s,
)
from sim.log import Flight

COURSE, NOSE = heading_error_deg("course"), heading_error_deg("nose")
SETTLED_S = 20.0
RECOVERED_DEG = 10.0
RECOVERY_S = 10.0
LARGE, SMALL = 1.2, 0.05
WINDS_M_S = (2.0, 3.5, 5.0)


def _along_course(seeds: Sequence[int]) -> Finding:
    flown = flights("crosswind", seeds)
    crab = pooled_rms(flown, _crab_series, SETTLED_S)
    course, nose = (pooled_rms(flown, series, SETTLED_S) for series in (COURSE, NOSE))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Straight ahead, 5 m/s of wind from the side: heading against the true course")
        for i, flight in enumerate(flown):
            side = np.sign(np.median(crab_deg(flight)))
            nose_at, believed = side * crab_deg(flight), side * course_error_deg(flight)
            ax.plot(time_s(flight), nose_at, color=ORANGE, lw=0.8, label=None if i else "the true nose")
            ax.plot(time_s(flight), believed, color=BLUE, lw=0.8, label=None if i else "the matrix")
        ax.set_xlim(0.0, 60.0)
        ax.set_ylim(-20.0, 50.0)
        ax.legend(loc="upper right")
        label(ax, "time, s", "deg, positive into the wind")

    return Finding(
        stands=(
            line("heading less course, from 20 s on", "deg RMS", course, "<=", 3.0),
            line("heading less nose, as part of the crab angle", "", nose / crab, ">=", 0.9),
        ),
        told=f"In a crosswind of 40 % of the airspeed the nose points {crab:.0f} degrees into the wind; the matrix is "
        f"{course:.1f} degrees RMS from the course and {nose:.0f} from the nose. The course is held without any "
        "knowledge of the wind.",
        seeds=len(seeds),
        draw=draw,
    )


def _crab_series(flight: Flight):  # type: ignore[no-untyped-def]
    errors = COURSE(flight)
    return type(errors)(errors.t_s, crab_deg(flight), errors.judged)


TURN_S = 90.0  # a long time across the wind, then about turn
REVERSAL = {"duration_s": 150.0, "manoeuvre.first_s": TURN_S, "manoeuvre.every_s": 60.0}


def _off_needed_deg(flight: Flight, reversed_: bool, crab: float) -> Array:
    """True nose less the one that would keep to the track asked for, in the sense of `crab`, degrees."""
    track_rad = math.radians(flight.manifest["config"]["start"]["heading_deg"] + 180.0 * reversed_)
    needed_rad = track_rad + math.radians(-crab if reversed_ else crab)
    return np.degrees(wrap(heading_rad(flight.log.truth["R_eb"]) - needed_rad))


def _turned_by_crabs(flight: Flight) -> float:
    """By how many crab angles a reversal puts the nose off the one needed: right after the roll-out, less before."""
    t_s = time_s(flight)
    before = (t_s > TURN_S - 10.0) & (t_s <= TURN_S)
    crab = float(np.mean(crab_deg(flight)[before]))
    out = roll_outs_after(flight, TURN_S)
    if not out:
        return math.nan
    after = (t_s > out[0].t_s) & (t_s <= out[0].t_s + 2.0)
    change = np.mean(_off_needed_deg(flight, True, crab)[after]) - np.mean(_off_needed_deg(flight, False, crab)[before])
    return float(change) / crab


def _recovery_s(flight: Flight, from_s: float) -> float:
    """Slowest return of the heading to the course after the roll-outs after `from_s`, s."""
    out = roll_outs_after(flight, from_s, RECOVERY_S)
    return slowest(settled_after_s(COURSE(flight).within(r.t_s, r.until_s), RECOVERED_DEG) for r in out)


def _reversal(seeds: Sequence[int]) -> Finding:
    def fly(wind_m_s: float, w_y: float) -> list[Flight]:
        # Yaw is locked with the large weight, and then held with the one in question.
        changes = {**REVERSAL, "air.wind_m_s": wind_m_s, **tuned(w_y=w_y, w_y_until_lock=LARGE)}
        return flights("turns_180", seeds, changes)

    small = {wind: [_turned_by_crabs(flight) for flight in fly(wind, SMALL)] for wind in WINDS_M_S}
    medians = {wind: float(np.median(crabs)) for wind, crabs in small.items()}
    large = fly(WINDS_M_S[-1], LARGE)
    recovered = slowest(_recovery_s(flight, TURN_S) for flight in large)
    shown = fly(WINDS_M_S[-1], SMALL)
    lasting = median([_recovery_s(flight, TURN_S) for flight in shown])
    slow = (
        f"it takes {lasting:.0f} s until the heading stays within 10 degrees of the course"
        if math.isfinite(lasting)
        else "most flights end before the heading stays within 10 degrees of the course"
    )

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "About turn in a crosswind of 5 m/s: heading against the true course")
        for flown, colour, w_y in ((shown, RED, SMALL), (large, BLUE, LARGE)):
            for i, flight in enumerate(flown):
                crab = float(np.median(crab_deg(flight)[(time_s(flight) > 60.0) & (time_s(flight) < TURN_S)]))
                crabs = -course_error_deg(flight) / crab
                ax.plot(time_s(flight) - TURN_S, crabs, color=colour, lw=1, label=None if i else f"W_Y = {w_y:g}")
        ax.axhline(2.0, color=FAINT, ls="--", lw=1)
        ax.annotate("twice the crab angle", (55.0, 2.06), color=FAINT, ha="right")
        ax.set_xlim(-20.0, 58.0)
        ax.set_ylim(-1.2, 2.6)
        ax.legend(loc="lower right")
        label(ax, "s after the turn begins", "crab angles")

    return Finding(
        stands=(
            line("small weight: nose off the one needed, in the lightest wind", "crabs", medians[2.0], ">=", 1.7),
            line("the same in the strongest wind", "crabs", medians[5.0], ">=", 1.7),
            line("and at most", "crabs", max(medians.values()), "<=", 2.3),
            line("large weight: slowest return below 10 deg", "s", recovered, "<=", RECOVERY_S),
        ),
        told=f"With a yaw weight of {SMALL:g} a reversal in 2, 3.5 and 5 m/s of crosswind puts the nose off the one "
        f"that is needed by {medians[2.0]:.1f}, {medians[3.5]:.1f} and {medians[5.0]:.1f} times the crab angle, and at "
        f"5 m/s {slow}. With {LARGE:g} it "
        f"follows during the turn: at most {recovered:.1f} s after the roll-out it is there.",
        seeds=len(seeds),
        draw=draw,
    )


WEIGHTS = (0.1, 0.3, 0.6, 1.2, 2.4)


def _large_weight(seeds: Sequence[int]) -> Finding:
    def fly(w_y: float, matched: bool) -> list[Flight]:
        ignoring = {"gps_lag_filter": False, "rotate_history": False}
        return flights("turns_180", seeds, tuned(w_y=w_y, w_y_until_lock=LARGE, **({} if matched else ignoring)))

    heading, tilt = (
        {m: [pooled_rms(fly(w, m), series, SETTLED_S) for w in WEIGHTS] for m in (False, True)}
        for series in (COURSE, inclination_error_deg)
    )

    def gained(matched: bool) -> float:
        """Heading error at the largest weight, over that at a moderate one."""
        return heading[matched][-1] / heading[matched][WEIGHTS.index(0.3)]

    def draw(figure: Figure) -> None:
        head, down = axes(figure, "Heading error, turning in wind", "Tilt error")
        for matched, colour, name in ((False, RED, "lag of the GPS ignored"), (True, BLUE, "matched")):
            head.plot(WEIGHTS, heading[matched], "o-", color=colour, label=name)
            down.plot(WEIGHTS, tilt[matched], "o-", color=colour)
        head.legend(loc="lower left")
        for ax, unit in ((head, "deg RMS, against the course"), (down, "deg RMS")):
            ax.set_xscale("log")
            ax.set_xticks(WEIGHTS, [f"{w:g}" for w in WEIGHTS])
            ax.minorticks_off()
            label(ax, "weight of the yaw correction", unit)
        head.set_ylim(0.0, 25.0)
        down.set_ylim(0.0, 5.0)

    return Finding(
        stands=(line("heading error at a weight of 2.4, over that at 0.3", "", gained(False), "<=", 0.8),),
        condition="if the lag of the receiver is matched on the matrix's side",
        under=(line("heading error at a weight of 2.4, over that at 0.3", "", gained(True), "<=", 0.8),),
        told="In reversals in wind a larger weight brings nothing once it is above 0.3, as long as the lag of the GPS "
        f"is ignored: {heading[False][1]:.0f} degrees RMS of heading error at 0.3 and {heading[False][-1]:.0f} at 2.4, "
        f"and the tilt error goes from {tilt[False][0]:.1f} to {tilt[False][-1]:.1f}. With the lag matched the heading "
        f"error falls from {heading[True][0]:.0f} degrees at 0.1 to {heading[True][-1]:.0f} at 2.4; the tilt stays.",
        seeds=len(seeds),
        draw=draw,
    )


OFF_DEG = 60.0


def _recovery(seeds: Sequence[int]) -> Finding:
    # The estimator starts out with north: a start at 60 degrees is 60 degrees wrong.
    start = {"air.wind_m_s": 0.0, "start.heading_deg": OFF_DEG, "duration_s": 60.0}
    begun = {w: flights("crosswind", seeds, {**start, **tuned(w_y=w)}) for w in WEIGHTS}
    lock = {w: [settled_after_s(COURSE(f).within(0.0, math.inf), RECOVERED_DEG) for f in begun[w]] for w in WEIGHTS}
    late = sum(not t <= RECOVERY_S for t in lock[0.1])
    turned = {w: flights("turns_180", seeds, tuned(w_y=w, w_y_until_lock=LARGE)) for w in (0.3, LARGE)}
    after = {w: slowest(_recovery_s(flight, SETTLED_S) for flight in turned[w]) for w in turned}

    def draw(figure: Figure) -> None:
        error, by_weight = axes(figure, "Heading found from 60 degrees off", "Within 10 degrees, by weight")
        for w, colour in zip((0.1, 0.3, LARGE), (RED, ORANGE, BLUE), strict=True):
            for i, flight in enumerate(begun[w]):
                series = COURSE(flight).within(0.0, 40.0)
                error.plot(series.t_s, series.value, color=colour, lw=1, label=None if i else f"W_Y = {w:g}")
        error.axhline(RECOVERED_DEG, color=FAINT, ls="--", lw=1)
        error.legend()
        label(error, "time, s", "deg, against the course")
        for w in WEIGHTS:
            by_weight.plot([w] * len(lock[w]), lock[w], "o", color=BLUE, alpha=0.6, mew=0)
        by_weight.axhline(RECOVERY_S, color=FAINT, ls="--", lw=1)
        by_weight.annotate("10 s", (2.4, RECOVERY_S + 0.7), color=FAINT, ha="right")
        by_weight.set_xscale("log")
        by_weight.set_xticks(WEIGHTS, [f"{w:g}" for w in WEIGHTS])
        by_weight.minorticks_off()
        by_weight.set_ylim(0.0)
        label(by_weight, "weight of the yaw correction", "s")

    return Finding(
        stands=(
            line("slowest from 60 deg off to within 10, W_Y = 1.2", "s", slowest(lock[LARGE]), "<=", RECOVERY_S),
            line("slowest after a turn in wind, W_Y = 1.2", "s", after[LARGE], "<=", RECOVERY_S),
        ),
        told=f"A heading 60 degrees wrong is within 10 degrees of the course after {median(lock[0.3]):.0f} s with a "
        f"yaw weight of 0.3 and {median(lock[LARGE]):.1f} s with {LARGE:g}; with 0.1 {late} of {len(seeds)} flights "
        f"take more than 10 s. After a turn in 5 m/s of wind it takes at most {after[0.3]:.1f} s with 0.3 and "
        f"{after[LARGE]:.1f} s with {LARGE:g}.",
        seeds=len(seeds),
        draw=draw,
    )


def _wind_vector(seeds: Sequence[int]) -> Finding:
    knowing = flights("turns_180", seeds, tuned(learn_wind=True))
    adapting = flights("turns_180", seeds)
    first_s = max(roll_outs_after(flight, SETTLED_S)[0].t_s for flight in knowing) + 5.0
    wind = pooled_rms(knowing, wind_error_m_s, first_s)
    own = {"knowing": pooled_rms(knowing, NOSE, first_s), "adapting": pooled_rms(adapting, COURSE, first_s)}
    worst = max(mean_size(wind_error_m_s(flight).within(100.0, math.inf).judged_values) for flight in knowing)

    def draw(figure: Figure) -> None:
        learnt, heading = axes(figure, "Error of the learnt wind (5 m/s)", "Heading error against its own reference")
        for flight in knowing:
            series = wind_error_m_s(flight)
            learnt.plot(series.t_s, series.value, color=GREEN, lw=1)
        learnt.axhline(1.0, color=FAINT, ls="--", lw=1)
        learnt.set_ylim(0.0, 2.5)
        label(learnt, "s (turns at 25, 70 and 115 s)", "m/s")
        for flown, series_of, colour, name in (
            (adapting, COURSE, ORANGE, "adapts: against the course"),
            (knowing, NOSE, GREEN, "knows the wind: against the nose"),
        ):
            squares = [np.square(series_of(flight).within(SETTLED_S, 160.0).value) for flight in flown]
            n = min(map(len, squares))
            mean = np.sqrt(np.mean([square[:n] for square in squares], axis=0))
            heading.plot(SETTLED_S + np.arange(n) * flown[0].dt_s, mean, color=colour, label=name)
        heading.set_ylim(0.0, 45.0)
        heading.legend(loc="upper right")
        label(heading, "time, s", "deg, RMS of the flights")

    return Finding(
        stands=(
            line("wind error after the first turn", "m/s RMS", wind, "<=", 1.0),
            line("heading error, over that of adapting", "", own["knowing"] / own["adapting"], "<=", 1.0),
        ),
        told=f"From the first turn on the wind of 5 m/s is known to {wind:.2f} m/s RMS (after two turns at most "
        f"{worst:.1f}). The heading is then that of the nose, {own['knowing']:.1f} degrees RMS off, turns and all; an "
        f"estimator that adapts to the wind is {own['adapting']:.1f} degrees off its course.",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="along_the_course",
        title="In wind the matrix heads along the course",
        paper=Paper.THEORY,
        place="Wind",
        says="Since yaw is locked to the course over ground, the matrix comes to point where the aeroplane goes, not "
        "where its nose points; straight ahead that is just what keeps it on its course.",
        expected=Verdict.CONFIRMED,
        measure=_along_course,
        seeds=5,
    ),
    Claim(
        name="crosswind_reversal",
        title="A reversal in a crosswind puts the nose off by twice the crab",
        paper=Paper.THEORY,
        place="GPS, second reason for a large weight",
        says="After a long time in a crosswind and a turn of 180 degrees, for a while the nose is turned by the "
        "opposite of the angle that the wind asks for; a large yaw weight shortens that.",
        expected=Verdict.CONFIRMED,
        measure=_reversal,
        seeds=6,
    ),
    Claim(
        name="large_yaw_weight",
        title="The yaw correction should have a large weight",
        paper=Paper.THEORY,
        place="GPS, reasons for a large weight",
        says="For the yaw lock, for wind and after vertical flight it is best to give the yaw correction a large "
        "weight.",
        expected=Verdict.WITH_CONDITION,
        measure=_large_weight,
        seeds=3,
    ),
    Claim(
        name="yaw_recovery",
        title="Yaw recovers in about 10 s",
        paper=Paper.THEORY,
        place="Feedback controller",
        says="With wind and saturating gyros as they are, weights and gains should be large enough to recover from a "
        "disturbance in about 10 seconds.",
        expected=Verdict.CONFIRMED,
        measure=_recovery,
        seeds=5,
    ),
    Claim(
        name="wind_vector",
        title="The wind can be computed in turns",
        paper=Paper.THEORY,
        place="Wind, second solution",
        says="In principle the wind can be computed, gyro offsets being small, provided that the aeroplane makes some "
        "turns; whether that is better than adapting to it remained to be seen.",
        expected=Verdict.CONFIRMED,
        measure=_wind_vector,
        seeds=6,
    ),
)
