"""Wind and the yaw correction: what the heading converges to, reversals in a crosswind, and the weight to use."""

import math
from collections.abc import Sequence

import numpy as np

from estimator.blocks.kernels import wrap
from estimator.interface import Array
from estimator.rotation import heading_rad
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import (
    course_error_deg,
    crab_deg,
    flights,
    median,
    pooled_rms,
    roll_outs_after,
    slowest,
    tuned,
)
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import (
    Series,
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


def _crab_series(flight: Flight) -> Series:
    errors = COURSE(flight)
    return Series(errors.t_s, crab_deg(flight), errors.judged)


@claim(Paper.THEORY, "Wind", seeds=5)
def along_the_course(seeds: Sequence[int]) -> Finding:
    """In wind the heading of the matrix follows the course.

    Because yaw is locked to the course over ground, the matrix points along the course and not along the nose; in
    straight flight this is what keeps the aeroplane on course.
    """
    flown = flights("crosswind", seeds)
    crab = pooled_rms(flown, _crab_series, SETTLED_S)
    course, nose = (pooled_rms(flown, series, SETTLED_S) for series in (COURSE, NOSE))

    panel = Panel("Heading minus true course in a crosswind", "deg into the wind", xlim=(0.0, 60.0), ylim=(-20.0, 50.0))
    sides = [np.sign(np.median(crab_deg(flight))) for flight in flown]
    for angle_deg, colour, name in ((crab_deg, ORANGE, "true nose"), (course_error_deg, BLUE, "matrix")):
        curves = [(time_s(flight), side * angle_deg(flight)) for side, flight in zip(sides, flown, strict=True)]
        panel.traces(curves, colour, name, lw=0.8)
    return Finding(
        lines=[
            line("heading minus course, from 20 s on", "deg RMS", course, "<=", 3.0),
            line("heading minus nose, over the crab angle", "", nose / crab, ">=", 0.9),
        ],
        summary=f"In a crosswind of 40 % of the airspeed the nose points {crab:.0f} degrees into the wind. The matrix "
        f"differs from the course by {course:.1f} degrees RMS and from the nose by {nose:.0f}. The aeroplane holds its "
        "course without knowing the wind.",
        panels=[panel],
    )


TURN_S = 90.0  # long flight across the wind, then a reversal
REVERSAL = {"duration_s": 150.0, "manoeuvre.first_s": TURN_S, "manoeuvre.every_s": 60.0}


def _off_needed_deg(flight: Flight, reversed_: bool, crab: float) -> Array:
    """True heading minus the one needed to hold the commanded track, positive in the direction of `crab`, degrees."""
    track_rad = math.radians(flight.manifest["config"]["start"]["heading_deg"] + 180.0 * reversed_)
    needed_rad = track_rad + math.radians(-crab if reversed_ else crab)
    return np.degrees(wrap(heading_rad(flight.log.truth["R_eb"]) - needed_rad))


def _turned_by_crabs(flight: Flight) -> float:
    """Change of the heading error by a reversal in crab angles: just after the roll-out minus before the turn."""
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
    """Longest time for the heading to return to the course after the roll-outs after `from_s`, s."""
    out = roll_outs_after(flight, from_s, RECOVERY_S)
    return slowest(settled_after_s(COURSE(flight).within(r.t_s, r.until_s), RECOVERED_DEG) for r in out)


@claim(Paper.THEORY, "GPS, second reason for a large weight", seeds=6)
def crosswind_reversal(seeds: Sequence[int]) -> Finding:
    """After a reversal in a crosswind the heading is off by twice the crab angle.

    After long flight in a crosswind and a turn of 180 degrees, the nose is for a while turned to the wrong side of the
    track, opposite to the angle that the wind requires; a large yaw weight shortens this.
    """

    def fly(wind_m_s: float, w_y: float) -> list[Flight]:
        # Yaw locks with the large weight, and then the weight to be tested is used.
        changes = {**REVERSAL, "air.wind_m_s": wind_m_s, **tuned(w_y=w_y, w_y_until_lock=LARGE)}
        return flights("turns_180", seeds, changes)

    medians = {w: float(np.median([_turned_by_crabs(flight) for flight in fly(w, SMALL)])) for w in WINDS_M_S}
    small, large = (fly(WINDS_M_S[-1], w_y) for w_y in (SMALL, LARGE))
    recovered = slowest(_recovery_s(flight, TURN_S) for flight in large)
    lasting = median([_recovery_s(flight, TURN_S) for flight in small])
    slow = (
        f"the heading takes {lasting:.0f} s to stay within 10 degrees of the course"
        if math.isfinite(lasting)
        else "most flights end before the heading stays within 10 degrees of the course"
    )

    panel = Panel(
        "Reversal: heading minus course", "crabs", "s after the turn begins", xlim=(-20.0, 58.0), ylim=(-1.2, 2.6)
    )
    for flown, colour, w_y in ((small, RED, SMALL), (large, BLUE, LARGE)):
        curves = []
        for flight in flown:
            t_s = time_s(flight)
            crab = float(np.median(crab_deg(flight)[(t_s > 60.0) & (t_s < TURN_S)]))
            curves.append((t_s - TURN_S, -course_error_deg(flight) / crab))
        panel.traces(curves, colour, f"W_Y = {w_y:g}")
    panel.level(2.0, text="twice the crab angle")
    return Finding(
        lines=[
            line("small weight: heading error in the lightest wind", "crab angles", medians[2.0], ">=", 1.7),
            line("small weight: heading error in the strongest wind", "crab angles", medians[5.0], ">=", 1.7),
            line("small weight: largest heading error", "crab angles", max(medians.values()), "<=", 2.3),
            line("large weight: longest time to return within 10 deg", "s", recovered, "<=", RECOVERY_S),
        ],
        summary=f"With a yaw weight of {SMALL:g}, a reversal in 2, 3.5 and 5 m/s of crosswind turns the nose away from "
        f"the heading needed by {medians[2.0]:.1f}, {medians[3.5]:.1f} and {medians[5.0]:.1f} crab angles; at 5 m/s "
        f"{slow}. With {LARGE:g} the heading follows during the turn and is back at most {recovered:.1f} s after the "
        "roll-out.",
        panels=[panel],
    )


WEIGHTS, BY_WEIGHT = (0.1, 0.3, 0.6, 1.2, 2.4), "weight of the yaw correction"


@claim(Paper.THEORY, "GPS, reasons for a large weight", expected=Verdict.WITH_CONDITION, seeds=3)
def large_yaw_weight(seeds: Sequence[int]) -> Finding:
    """The yaw correction should have a large weight.

    For locking yaw, for wind and after vertical flight, a large weight of the yaw correction is best.
    """

    def fly(w_y: float, matched: bool) -> list[Flight]:
        ignoring = {"gps_lag_filter": False, "rotate_history": False}
        return flights("turns_180", seeds, tuned(w_y=w_y, w_y_until_lock=LARGE, **({} if matched else ignoring)))

    heading, inclination = (
        {m: [pooled_rms(fly(w, m), series, SETTLED_S) for w in WEIGHTS] for m in (False, True)}
        for series in (COURSE, inclination_error_deg)
    )
    gained = {m: errors[-1] / errors[WEIGHTS.index(0.3)] for m, errors in heading.items()}

    of_ratio = "heading error with a weight of 2.4, over that with 0.3"
    head = Panel("Heading error, turning in wind", "deg RMS", BY_WEIGHT, log="x", xticks=WEIGHTS, ylim=(0.0, 25.0))
    down = Panel("Inclination error", "deg RMS", BY_WEIGHT, log="x", xticks=WEIGHTS, ylim=(0.0, 5.0))
    for matched, colour, name in ((False, RED, "GPS lag ignored"), (True, BLUE, "GPS lag matched")):
        head.curve(WEIGHTS, heading[matched], colour, name, "o-")
        down.curve(WEIGHTS, inclination[matched], colour, style="o-")
    return Finding(
        lines=[line(of_ratio, "", gained[False], "<=", 0.8)],
        condition="if the estimator models the lag of the receiver",
        conditional_lines=[line(of_ratio, "", gained[True], "<=", 0.8)],
        summary="In reversals in wind with the GPS lag ignored, a weight above 0.3 gains nothing: the heading error is "
        f"{heading[False][1]:.0f} degrees RMS at 0.3 and {heading[False][-1]:.0f} at 2.4, and the inclination error "
        f"goes from {inclination[False][0]:.1f} to {inclination[False][-1]:.1f}. With the lag matched, the heading "
        f"error falls from {heading[True][0]:.0f} degrees at 0.1 to {heading[True][-1]:.0f} at 2.4, and the "
        "inclination error does not change.",
        panels=[head, down],
    )


OFF_DEG = 60.0


@claim(Paper.THEORY, "Feedback controller", seeds=5)
def yaw_recovery(seeds: Sequence[int]) -> Finding:
    """Yaw recovers in about 10 s.

    Because of wind and gyro saturation, weights and gains should be large enough to recover from a disturbance in about
    10 seconds.
    """
    # The estimator assumes north at the start, so a start at 60 degrees is an error of 60 degrees.
    start = {"air.wind_m_s": 0.0, "start.heading_deg": OFF_DEG, "duration_s": 60.0}
    begun = {w: flights("crosswind", seeds, {**start, **tuned(w_y=w)}) for w in WEIGHTS}
    lock = {w: [settled_after_s(COURSE(f).within(0.0, math.inf), RECOVERED_DEG) for f in begun[w]] for w in WEIGHTS}
    late = sum(not t <= RECOVERY_S for t in lock[0.1])
    turned = {w: flights("turns_180", seeds, tuned(w_y=w, w_y_until_lock=LARGE)) for w in (0.3, LARGE)}
    after = {w: slowest(_recovery_s(flight, SETTLED_S) for flight in turned[w]) for w in turned}

    error = Panel("Recovery from a heading error of 60 degrees", "deg, against the course")
    for w, colour in zip((0.1, 0.3, LARGE), (RED, ORANGE, BLUE), strict=True):
        error.flights(begun[w], COURSE, colour, f"W_Y = {w:g}", 0.0, 40.0)
    error.level(RECOVERED_DEG)
    by_weight = Panel("Time to recover to 10 degrees", "s", BY_WEIGHT, log="x", xticks=WEIGHTS, ylim=(0.0, None))
    for w in WEIGHTS:
        by_weight.cloud(w, lock[w], BLUE)
    by_weight.level(RECOVERY_S, text="10 s")
    return Finding(
        lines=[
            line("W_Y = 1.2: longest recovery from 60 to 10 deg", "s", slowest(lock[LARGE]), "<=", RECOVERY_S),
            line("W_Y = 1.2: longest recovery after a turn in wind", "s", after[LARGE], "<=", RECOVERY_S),
        ],
        summary=f"A heading error of 60 degrees falls below 10 degrees in {median(lock[0.3]):.0f} s with a yaw weight "
        f"of 0.3 and in {median(lock[LARGE]):.1f} s with {LARGE:g}; with 0.1, {late} of {len(seeds)} flights take more "
        f"than 10 s. After a turn in 5 m/s of wind, recovery takes at most {after[0.3]:.1f} s with 0.3 and "
        f"{after[LARGE]:.1f} s with {LARGE:g}.",
        panels=[error, by_weight],
    )


@claim(Paper.THEORY, "Wind, second solution", seeds=6)
def wind_vector(seeds: Sequence[int]) -> Finding:
    """The wind can be computed in turns.

    In principle the wind can be computed, if gyro offsets are small and the aeroplane makes some turns; whether that is
    better than adapting to the wind remained to be seen.
    """
    knowing = flights("turns_180", seeds, tuned(learn_wind=True))
    adapting = flights("turns_180", seeds)
    first_s = max(roll_outs_after(flight, SETTLED_S)[0].t_s for flight in knowing) + 5.0
    wind = pooled_rms(knowing, wind_error_m_s, first_s)
    of_nose, of_course = pooled_rms(knowing, NOSE, first_s), pooled_rms(adapting, COURSE, first_s)
    worst = max(mean_size(wind_error_m_s(flight).within(100.0, math.inf).judged_values) for flight in knowing)

    learnt = Panel("Error of the learnt wind (5 m/s)", "m/s", "s (turns at 25, 70 and 115 s)", ylim=(0.0, 2.5))
    learnt.flights(knowing, wind_error_m_s, GREEN)
    learnt.level(1.0, FAINT)
    heading = Panel("Heading error against its own reference", "deg, RMS of the flights", ylim=(0.0, 45.0))
    for flown, series_of, colour, name in (
        (adapting, COURSE, ORANGE, "adapts: against the course"),
        (knowing, NOSE, GREEN, "knows the wind: against the nose"),
    ):
        squares = [np.square(series_of(flight).within(SETTLED_S, 160.0).value) for flight in flown]
        n = min(map(len, squares))
        mean = np.sqrt(np.mean([square[:n] for square in squares], axis=0))
        heading.curve(SETTLED_S + np.arange(n) * flown[0].dt_s, mean, colour, name)
    return Finding(
        lines=[
            line("wind error after the first turn", "m/s RMS", wind, "<=", 1.0),
            line("heading error, over that when adapting", "", of_nose / of_course, "<=", 1.0),
        ],
        summary=f"After the first turn the wind of 5 m/s is known to {wind:.2f} m/s RMS (after two turns at most "
        f"{worst:.1f}). The estimated heading is then that of the nose, with an error of {of_nose:.1f} degrees RMS "
        f"including the turns; an estimator that adapts to the wind has an error of {of_course:.1f} degrees against "
        "the course.",
        panels=[learnt, heading],
    )
