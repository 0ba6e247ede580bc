"""The receiver: its filter, its rate, its latency, and the filter on the matrix's side that answers them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure

from estimator.interface import Array
from estimator.rotation import from_euler
from scenarios.claims._flown import PUBLISHED, TURNING_DEG, course_error_deg, pooled_rms, rms_in_turns, tuned
from scenarios.claims._open_loop import sensed
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, axes, label
from scenarios.harness.metrics import bank_size_deg, heading_error_deg, inclination_error_deg, time_s
from sim.log import Phase
from sim.motion.prescribed_plant import CALM, Kinematics

COURSE = heading_error_deg("course")
SETTLED_S = 20.0
SMALL_DEG = 10.0  # a heading error that navigation hardly sees: sideways it is a sixth of the way
LOST_DEG = 45.0  # one that leads astray
LEFT = 0.5  # whoever makes up for an error leaves less than half of it


@dataclass(frozen=True, slots=True)
class Kink:
    """North at a steady speed, then east from one moment to the next: a step for the receiver."""

    at_s: float = 10.0
    speed_m_s: float = 12.6
    phase: ClassVar[Phase] = Phase.FLYING
    wind_e_m_s: ClassVar[tuple[float, float, float]] = CALM

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`; the acceleration of the step itself is left out."""
        before, after = np.minimum(t_s, self.at_s), np.maximum(t_s - self.at_s, 0.0)
        yaw = np.where(t_s <= self.at_s, 0.0, 0.5 * math.pi)
        still = np.zeros((len(t_s), 3))
        v_e, p_e = still.copy(), still.copy()
        v_e[:, 0], v_e[:, 1] = self.speed_m_s * np.cos(yaw), self.speed_m_s * np.sin(yaw)
        p_e[:, 0], p_e[:, 1], p_e[:, 2] = self.speed_m_s * before, self.speed_m_s * after, -60.0
        return Kinematics(from_euler(0.0, 0.0, yaw), still, p_e, v_e, still)


def _filter_settles(_seeds: Sequence[int]) -> Finding:
    kink, filter_s, latency_s = Kink(), 1.0, 0.3
    rate_hz = 10.0
    log = sensed(kink, 20.0, "ideal", {"gps.filter_s": filter_s, "gps.latency_s": latency_s, "gps.rate_hz": rate_hz})
    after_s = log.truth["t_s"] - kink.at_s
    response = log.truth["gps_v_e_m_s"][:, 1] / kink.speed_m_s
    settled_s = float(after_s[np.flatnonzero(response >= 0.95)[0]])
    new = log.measured["gps_new"] == 1
    told_s, course = after_s[new], np.degrees(log.measured["gps_course_rad"][new])
    at_three = float(np.interp(3.0, after_s, response))

    def draw(figure: Figure) -> None:
        step, heard = axes(figure, "A step of velocity, inside the receiver", "The course it reports: 0.3 s later")
        for ax in (step, heard):
            ax.axvline(3.0, color=FAINT, lw=1, ls="--")
            ax.set_xlim(-1.0, 6.0)
            ax.set_xticks(range(-1, 7))
        step.plot(after_s, np.where(after_s > 0.0, 1.0, 0.0), color=FAINT, lw=1)
        step.plot(after_s, response, color=BLUE)
        step.annotate(f"{at_three:.0%} after 3 s", (3.1, 0.85), color=BLUE)
        label(step, "s after the step", "part of the step")
        heard.step(after_s, np.where(after_s > 0.0, 90.0, 0.0), color=FAINT, lw=1)
        heard.plot(told_s, course, "o", ms=3, color=ORANGE)
        heard.set_yticks((0.0, 30.0, 60.0, 90.0))
        label(heard, "s after the step", "course, deg")

    return Finding(
        stands=(
            line("until 95 % of a step are there", "s", settled_s, "<=", 3.3),
            line("and no sooner", "s", settled_s, ">=", 2.7),
        ),
        told=f"A receiver with a filter of 1 s has followed a step of velocity to 95 % after {settled_s:.2f} s, and to "
        f"{at_three:.1%} after 3 s; a report tells of it a latency later.",
        seeds=0,
        draw=draw,
    )


def _receiver(hz: float, latency_s: float, filter_s: float) -> dict[str, Any]:
    """Changes that fit a receiver and tell the estimator of it."""
    fitted = {"rates.gps_hz": hz, "sensors.gps.latency_s": latency_s, "sensors.gps.filter_s": filter_s}
    return {**fitted, **tuned(gps_latency_s=latency_s, gps_filter_s=filter_s)}


def _report_rate(seeds: Sequence[int]) -> Finding:
    fitted = {
        "1 Hz": (_receiver(1.0, 0.3, 1.0), ORANGE),
        "5 Hz": (_receiver(5.0, 0.3, 1.0), ORANGE),
        "1 Hz, no filter": (_receiver(1.0, 0.3, 0.0), BLUE),
        "5 Hz, no filter": (_receiver(5.0, 0.3, 0.0), BLUE),
        "1 Hz, 1 s late": (_receiver(1.0, 1.0, 1.0), RED),
        "5 Hz, 0.2 s late": (_receiver(5.0, 0.2, 1.0), RED),
    }
    error = {
        name: pooled_rms(flights("turns_180", seeds, changes), COURSE, SETTLED_S)
        for name, (changes, _) in fitted.items()
    }
    slow, quick, unfiltered, _both, late, prompt = error.values()
    by_rate, by_filter, with_latency = 1.0 - quick / slow, 1.0 - unfiltered / slow, 1.0 - prompt / late

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Heading error in three reversals, by receiver")
        bars = ax.bar(range(len(error)), list(error.values()), 0.6, color=[colour for _, colour in fitted.values()])
        ax.bar_label(bars, [f"{value:.1f}" for value in error.values()], padding=2)
        ax.set_xticks(range(len(error)), ["\n".join(name.split(", ")) for name in error])
        ax.grid(visible=False, axis="x")
        for at, text in ((0.5, "1 s filter, 0.3 s late"), (2.5, "0.3 s late"), (4.5, "1 s filter, late by its period")):
            ax.annotate(text, (at, 0.93), xycoords=("data", "axes fraction"), ha="center", color=FAINT)
        ax.set_ylim(0.0, 13.0)
        label(ax, "", "deg RMS, against the course")

    return Finding(
        stands=(line("gained by 5 Hz, latency a period", "", with_latency, "<=", 0.2),),
        condition="if the latency stays the same",
        under=(
            line("gained by 5 Hz", "", by_rate, "<=", 0.2),
            line("gained by a receiver without the filter, over that", "", by_filter / by_rate, ">=", 1.5),
        ),
        told=f"With the same latency 5 Hz instead of 1 Hz take {by_rate:.0%} off the heading error of turns "
        f"({slow:.1f} to {quick:.1f} degrees), a receiver without its 1 s filter {by_filter:.0%}. But where a "
        f"report is as late as its period, as the paper says it usually is, 5 Hz take off {with_latency:.0%}.",
        seeds=len(seeds),
        draw=draw,
    )


LATENCIES_S = (1.0, 2.0, 3.0, 4.0, 6.0, 12.0)


def _latency(seeds: Sequence[int]) -> Finding:
    def fly(latency_s: float, *, told: bool) -> list[Any]:
        changes: dict[str, Any] = {"sensors.gps.latency_s": latency_s}
        return flights("gps_latency", seeds, {**changes, **(tuned(gps_latency_s=latency_s) if told else {})})

    def each(latency_s: float, *, told: bool) -> list[float]:
        return [pooled_rms([flight], COURSE, SETTLED_S) for flight in fly(latency_s, told=told)]

    unaware = {s: each(s, told=False) for s in LATENCIES_S}
    aware = {s: each(s, told=True) for s in (LATENCIES_S[0], 4.0, LATENCIES_S[-1])}
    some_from = next((s for s in LATENCIES_S if max(unaware[s]) > SMALL_DEG), math.nan)
    lost_from = next((s for s in LATENCIES_S if min(unaware[s]) > LOST_DEG), math.nan)

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Heading error, flying straight ahead with fixes that come late")
        for errors, colour, name in ((unaware, RED, "the latency is not known"), (aware, BLUE, "known")):
            ax.plot(list(errors), [np.median(errors[s]) for s in errors], color=colour, label=name)
            for s in errors:
                ax.plot([s] * len(errors[s]), errors[s], "o", color=colour, ms=4, alpha=0.6, mew=0)
        ax.axhline(LOST_DEG, color=FAINT, ls="--", lw=1)
        ax.annotate("lost", (12.0, LOST_DEG + 3.0), color=FAINT, ha="right")
        ax.set_xticks(LATENCIES_S)
        ax.set_yticks((0, 45, 90, 135))
        ax.legend(loc="upper left")
        label(ax, "latency, s", "deg RMS, against the course")

    return Finding(
        stands=(
            line("12 s, unknown: heading error, the best flight", "deg RMS", min(unaware[12.0]), ">=", LOST_DEG),
            line("1 s, unknown: the worst flight", "deg RMS", max(unaware[1.0]), "<=", SMALL_DEG),
            line("12 s, known: the worst flight", "deg RMS", max(aware[12.0]), "<=", SMALL_DEG),
        ),
        told=f"Straight ahead, fixes 12 s late break an estimator that does not know "
        f"({np.median(unaware[12.0]):.0f} degrees), and far less does: the first flights go astray at {some_from:g} s, "
        f"all are lost from {lost_from:g} s on. A second is harmless there ({max(unaware[1.0]):.1f}; in turns it is "
        f"not, see where the lag is ignored), and an estimator that knows its 12 s flies straight "
        f"({np.median(aware[12.0]):.1f}).",
        seeds=len(seeds),
        draw=draw,
    )


_UNMATCHED = {"gps_lag_filter": False, "rotate_history": False}
_WAYS: Mapping[str, tuple[dict[str, Any], str]] = {
    "ignored": (_UNMATCHED, RED),
    "filtered": ({"rotate_history": False}, ORANGE),
    "filtered, loop freed of it": ({}, BLUE),
}


def _lag_ignored(seeds: Sequence[int]) -> Finding:
    banks_deg = (10.0, 20.0, 35.0)

    def turning(bank_deg: float, way: str) -> float:
        # A steady turn in calm air: no crab, nothing but the lag.
        changes = {"manoeuvre.bank_deg": bank_deg, "air.wind_m_s": 0.0, "duration_s": 80.0, **tuned(**_WAYS[way][0])}
        return pooled_rms(flights("circle", seeds, changes), COURSE, SETTLED_S)

    ignored, matched = ([turning(bank, way) for bank in banks_deg] for way in ("ignored", "filtered, loop freed of it"))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Heading error in a steady turn in calm air, by bank")
        for values, colour, name in ((ignored, RED, "lag ignored"), (matched, BLUE, "nose filtered and delayed alike")):
            ax.plot(banks_deg, values, "o-", color=colour, label=name)
        lag = [math.degrees(1.3 * 9.81 * math.tan(math.radians(bank)) / 12.6) for bank in banks_deg]
        ax.plot(banks_deg, lag, "--", color=FAINT, lw=1, label="rate of turn x 1.3 s")
        ax.axhline(SMALL_DEG, color=FAINT, ls=":", lw=1)
        ax.annotate("small", (34.8, SMALL_DEG + 0.8), color=FAINT, ha="right")
        ax.set_xticks(banks_deg)
        ax.set_ylim(0.0)
        ax.legend(loc="upper left")
        label(ax, "bank asked for, deg", "deg RMS, against the course")

    return Finding(
        stands=(
            line("heading error at 10 deg of bank", "deg RMS", ignored[0], "<=", SMALL_DEG),
            line("heading error at 35 deg of bank", "deg RMS", ignored[-1], "<=", SMALL_DEG),
        ),
        told=f"The heading follows the lagged course: {ignored[0]:.0f} degrees behind at 10 degrees of bank, "
        f"{ignored[1]:.0f} at 20 and {ignored[2]:.0f} at 35, about the rate of turn times 1.3 s; not even the gentlest "
        f"is small. With the nose filtered and delayed as the course is, {matched[2]:.1f} are left at 35.",
        seeds=len(seeds),
        draw=draw,
    )


def _lag_filter(seeds: Sequence[int]) -> Finding:
    flown = {way: flights("turns_180", seeds, tuned(**params)) for way, (params, _) in _WAYS.items()}
    published = flights("turns_180", seeds, tuned(**PUBLISHED))
    tilts = " / ".join(f"{pooled_rms(found, inclination_error_deg, SETTLED_S):.1f}" for found in flown.values())
    error = {way: pooled_rms(found, COURSE, SETTLED_S) for way, found in flown.items()}
    ignored, filtered, freed = error.values()
    turning = {way: rms_in_turns(found, COURSE, SETTLED_S) for way, found in flown.items()}

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Three reversals in a crosswind: estimated heading less course")
        for way, (_, colour) in _WAYS.items():
            flight = flown[way][0]
            t_s = time_s(flight)
            ax.plot(t_s, course_error_deg(flight), color=colour, lw=1.3, label=f"{way}: {error[way]:.1f} deg RMS")
        steep = bank_size_deg(flown["filtered"][0]).value > TURNING_DEG
        ax.fill_between(time_s(flown["filtered"][0]), -90, 90, where=steep, color=FAINT, alpha=0.15, lw=0)
        ax.set_xlim(SETTLED_S, 160.0)
        ax.set_ylim(-105.0, 85.0)
        ax.set_yticks((-90, -45, 0, 45))
        ax.legend(loc="lower left", ncols=3)
        label(ax, "s (grey: turning)", "deg")

    return Finding(
        stands=(
            line("part of the heading error that the filter leaves", "", filtered / ignored, "<=", LEFT),
            line("the same in turns", "", turning["filtered"] / turning["ignored"], "<=", LEFT),
        ),
        told=f"The filter on the matrix's side takes the heading error of turns in wind from {ignored:.1f} degrees RMS "
        f"to {filtered:.1f}, far more than the small improvement that the paper sees in it; with the paper's bare "
        f"equations it is {pooled_rms(published, COURSE, SETTLED_S):.1f}. With the corrections taken out of its loop "
        f"it is {freed:.1f}. The tilt is off by {tilts} degrees RMS (ignored, filtered, freed).",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="gps_filter_settles",
        title="A GPS filter of 1 s takes 3 s",
        paper=Paper.THEORY,
        place="GPS, on the filters of receivers",
        says="Many receivers answer like an exponential with a time constant of 1 s: a step is followed fully after "
        "about 3 s.",
        expected=Verdict.CONFIRMED,
        measure=_filter_settles,
        seeds=0,
    ),
    Claim(
        name="report_rate",
        title="Five reports a second need not be better than one",
        paper=Paper.THEORY,
        place="GPS, on reporting rates",
        says="A higher reporting rate does not by itself bring a better dynamic response: the filter in the receiver "
        "is what limits it.",
        expected=Verdict.WITH_CONDITION,
        measure=_report_rate,
        seeds=4,
    ),
    Claim(
        name="reporting_latency",
        title="A latency of 12 s must be taken into account",
        paper=Paper.THEORY,
        place="GPS, reporting latency",
        says="Reports can come 12 s late, which must be taken into account; 1 s can be lived with.",
        expected=Verdict.CONFIRMED,
        measure=_latency,
        seeds=4,
    ),
    Claim(
        name="lag_ignored",
        title="Ignoring the lag of the GPS costs a small error in turns",
        paper=Paper.THEORY,
        place="GPS, on the filters of receivers",
        says="Whoever ignores the dynamics of the GPS makes only a small error in turns.",
        expected=Verdict.REFUTED,
        measure=_lag_ignored,
        seeds=5,
    ),
    Claim(
        name="lag_filter",
        title="A filter between the matrix and the yaw correction makes up for the lag",
        paper=Paper.THEORY,
        place="GPS, on the filters of receivers",
        says="The matrix can be passed through a filter like the receiver's before it is compared with the course: the "
        "two then agree in a turn.",
        expected=Verdict.CONFIRMED,
        measure=_lag_filter,
        seeds=5,
    ),
)
