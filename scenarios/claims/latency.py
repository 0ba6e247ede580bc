"""The GPS receiver: its filter, report rate and latency, and the matching filter in the estimator."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.interface import Array
from estimator.rotation import from_euler
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import TURNING_DEG, course_error_deg, flights, pooled_rms, rms_in_turns, tuned
from scenarios.harness.claims.motions import EQUATIONS_ONLY, sensed
from scenarios.harness.claims.picture import BLUE, FAINT, ORANGE, RED, Panel
from scenarios.harness.metrics import bank_size_deg, heading_error_deg, inclination_error_deg, time_s
from sim.motion.prescribed_plant import Kinematics

COURSE = heading_error_deg("course")
SETTLED_S = 20.0
SMALL_DEG = 10.0  # a heading error with little effect on navigation: a sixth of the way goes sideways
LOST_DEG = 45.0
FILTERS = "GPS, on the filters of receivers"


@dataclass(frozen=True, slots=True)
class Kink:
    """North at constant speed, then suddenly east: a step for the receiver."""

    at_s: float = 10.0
    speed_m_s: float = 12.6

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`; the acceleration of the step itself is left out."""
        before, after = np.minimum(t_s, self.at_s), np.maximum(t_s - self.at_s, 0.0)
        yaw = np.where(t_s <= self.at_s, 0.0, 0.5 * math.pi)
        still = np.zeros((len(t_s), 3))
        v_e, p_e = still.copy(), still.copy()
        v_e[:, 0], v_e[:, 1] = self.speed_m_s * np.cos(yaw), self.speed_m_s * np.sin(yaw)
        p_e[:, 0], p_e[:, 1], p_e[:, 2] = self.speed_m_s * before, self.speed_m_s * after, -60.0
        return Kinematics(from_euler(0.0, 0.0, yaw), still, p_e, v_e, still)


@claim(Paper.THEORY, FILTERS)
def gps_filter_settles() -> Finding:
    """A GPS filter of 1 s settles in 3 s.

    Many receivers respond exponentially with a time constant of 1 s: they follow a step fully after about 3 s.
    """
    kink = Kink()
    log = sensed(kink, 20.0, "ideal", {"gps.filter_s": 1.0, "gps.latency_s": 0.3, "gps.rate_hz": 10.0})
    after_s = log.truth["t_s"] - kink.at_s
    response = log.truth["gps_v_e_m_s"][:, 1] / kink.speed_m_s
    settled_s = float(after_s[np.flatnonzero(response >= 0.95)[0]])
    new = log.measured["gps_new"] == 1
    at_three = float(np.interp(3.0, after_s, response))

    x = "s after the step"
    shown: dict[str, Any] = {"xlim": (-1.0, 6.0), "xticks": range(-1, 7)}
    step = Panel("A step of velocity, inside the receiver", "part of the step", x, **shown)
    step.curve(after_s, np.where(after_s > 0.0, 1.0, 0.0), FAINT, lw=1)
    step.curve(after_s, response, BLUE)
    step.note(f"{at_three:.0%} after 3 s", 3.1, 0.85, BLUE)
    reported = Panel("The reported course: 0.3 s later", "course, deg", x, yticks=(0, 30, 60, 90), **shown)
    reported.curve(after_s, np.where(after_s > 0.0, 90.0, 0.0), FAINT, lw=1, drawstyle="steps-pre")
    reported.curve(after_s[new], np.degrees(log.measured["gps_course_rad"][new]), ORANGE, style="o", ms=3)
    for panel in (step, reported):
        panel.upright(3.0)
    return Finding(
        lines=[
            line("time to reach 95 % of a step", "s", settled_s, "<=", 3.3),
            line("time to reach 95 % of a step, at least", "s", settled_s, ">=", 2.7),
        ],
        summary=f"A receiver with a filter of 1 s reaches 95 % of a step of velocity after {settled_s:.2f} s, and "
        f"{at_three:.1%} after 3 s; the reports come later by the latency.",
        panels=[step, reported],
    )


def _receiver(hz: float, latency_s: float, filter_s: float) -> dict[str, Any]:
    """Changes for a receiver that the estimator knows."""
    fitted = {"rates.gps_hz": hz, "sensors.gps.latency_s": latency_s, "sensors.gps.filter_s": filter_s}
    return {**fitted, **tuned(gps_latency_s=latency_s, gps_filter_s=filter_s)}


@claim(Paper.THEORY, "GPS, on reporting rates", expected=Verdict.WITH_CONDITION, seeds=4)
def report_rate(seeds: Sequence[int]) -> Finding:
    """Five reports per second are not necessarily better than one.

    A higher report rate alone does not improve the dynamic response, which the filter in the receiver limits.
    """
    receivers = {
        "1 Hz": _receiver(1.0, 0.3, 1.0),
        "5 Hz": _receiver(5.0, 0.3, 1.0),
        "1 Hz\nno filter": _receiver(1.0, 0.3, 0.0),
        "5 Hz\nno filter": _receiver(5.0, 0.3, 0.0),
        "1 Hz\n1 s late": _receiver(1.0, 1.0, 1.0),
        "5 Hz\n0.2 s late": _receiver(5.0, 0.2, 1.0),
    }
    error = [pooled_rms(flights("turns_180", seeds, changes), COURSE, SETTLED_S) for changes in receivers.values()]
    slow, quick, unfiltered, _both, late, prompt = error
    by_rate, by_filter, with_latency = 1.0 - quick / slow, 1.0 - unfiltered / slow, 1.0 - prompt / late

    panel = Panel("Heading error in three reversals, by receiver", "deg RMS, against the course", ylim=(0.0, 13.0))
    panel.bars(list(receivers), {"": (error, [ORANGE, ORANGE, BLUE, BLUE, RED, RED])})
    for at, text in ((0.5, "1 s filter, 0.3 s late"), (2.5, "0.3 s late"), (4.5, "1 s filter, one period late")):
        panel.note(text, at, 0.93, ha="center", fraction="y")
    return Finding(
        lines=[line("error removed by 5 Hz, latency of one period", "", with_latency, "<=", 0.2)],
        condition="if the latency is the same",
        conditional_lines=[
            line("error removed by 5 Hz", "", by_rate, "<=", 0.2),
            line("error removed by leaving out the filter, over that", "", by_filter / by_rate, ">=", 1.5),
        ],
        summary=f"With the same latency, 5 Hz instead of 1 Hz reduces the heading error in turns by {by_rate:.0%} "
        f"({slow:.1f} to {quick:.1f} degrees), a receiver without the 1 s filter by {by_filter:.0%}. If the latency is "
        f"one period, which the paper calls usual, 5 Hz reduces the error by {with_latency:.0%}.",
        panels=[panel],
    )


LATENCIES_S = (1.0, 2.0, 3.0, 4.0, 6.0, 12.0)


@claim(Paper.THEORY, "GPS, reporting latency", seeds=4)
def reporting_latency(seeds: Sequence[int]) -> Finding:
    """A latency of 12 s must be taken into account.

    Reports can be 12 s late, which must be taken into account; 1 s is acceptable.
    """

    def each(latency_s: float, **known: float) -> list[float]:
        flown = flights("gps_latency", seeds, {"sensors.gps.latency_s": latency_s, **tuned(**known)})
        return [pooled_rms([flight], COURSE, SETTLED_S) for flight in flown]

    unaware = {s: each(s) for s in LATENCIES_S}
    aware = {s: each(s, gps_latency_s=s) for s in (1.0, 4.0, 12.0)}
    some_from = next((s for s in LATENCIES_S if max(unaware[s]) > SMALL_DEG), math.nan)
    lost_from = next((s for s in LATENCIES_S if min(unaware[s]) > LOST_DEG), math.nan)

    panel = Panel(
        "Straight flight, heading error", "deg RMS", "latency, s", xticks=LATENCIES_S, yticks=(0, 45, 90, 135)
    )
    for errors, colour, name in ((unaware, RED, "latency unknown"), (aware, BLUE, "latency known")):
        panel.curve(list(errors), [np.median(values) for values in errors.values()], colour, name)
        for latency_s, values in errors.items():
            panel.cloud(latency_s, values, colour, 4.0)
    panel.level(LOST_DEG, text="lost")
    return Finding(
        lines=[
            line("12 s, unknown: heading error of the best flight", "deg RMS", min(unaware[12.0]), ">=", LOST_DEG),
            line("1 s, unknown: heading error of the worst flight", "deg RMS", max(unaware[1.0]), "<=", SMALL_DEG),
            line("12 s, known: heading error of the worst flight", "deg RMS", max(aware[12.0]), "<=", SMALL_DEG),
        ],
        summary=f"In straight flight an estimator that does not know the latency fails with fixes 12 s late "
        f"({np.median(unaware[12.0]):.0f} degrees). The first flights fail at {some_from:g} s, all "
        f"from {lost_from:g} s on. A latency of 1 s is harmless here ({max(unaware[1.0]):.1f}), but not in turns. An "
        f"estimator that knows its latency of 12 s flies straight ({np.median(aware[12.0]):.1f}).",
        panels=[panel],
    )


_WAYS: dict[str, tuple[dict[str, Any], str]] = {
    "lag ignored": ({"gps_lag_filter": False, "rotate_history": False}, RED),
    "filtered": ({"rotate_history": False}, ORANGE),
    "filtered, history corrected": ({}, BLUE),
}


@claim(Paper.THEORY, FILTERS, expected=Verdict.REFUTED, seeds=5)
def lag_ignored(seeds: Sequence[int]) -> Finding:
    """Ignoring the GPS lag causes only a small error in turns.

    If the dynamics of the GPS are ignored, the error in turns is small.
    """
    banks_deg = (10.0, 20.0, 35.0)

    def turning(bank_deg: float, way: str) -> float:
        # A steady turn in calm air: no crab, only the lag.
        changes = {"manoeuvre.bank_deg": bank_deg, "air.wind_m_s": 0.0, "duration_s": 80.0, **tuned(**_WAYS[way][0])}
        return pooled_rms(flights("circle", seeds, changes), COURSE, SETTLED_S)

    ignored, _, matched = ([turning(bank, way) for bank in banks_deg] for way in _WAYS)

    panel = Panel("Heading error in a steady turn in calm air", "deg RMS", "commanded bank, deg", ylim=(0.0, None))
    errors = {"lag ignored": ignored, "nose filtered and delayed like the course": matched}
    panel.curves(banks_deg, errors, (RED, BLUE), "o-")
    lag = [math.degrees(1.3 * 9.81 * math.tan(math.radians(bank)) / 12.6) for bank in banks_deg]
    panel.curve(banks_deg, lag, FAINT, "turn rate x 1.3 s", "--", lw=1)
    panel.level(SMALL_DEG, text="small")
    return Finding(
        lines=[
            line("heading error at 10 deg of bank", "deg RMS", ignored[0], "<=", SMALL_DEG),
            line("heading error at 35 deg of bank", "deg RMS", ignored[-1], "<=", SMALL_DEG),
        ],
        summary=f"The heading follows the lagged course: it is {ignored[0]:.0f} degrees behind at 10 degrees of bank, "
        f"{ignored[1]:.0f} at 20 and {ignored[2]:.0f} at 35, about the turn rate times 1.3 s. Even the smallest is not "
        f"small. With the nose filtered and delayed like the course, the error at 35 degrees is {matched[2]:.1f}.",
        panels=[panel],
    )


@claim(Paper.THEORY, FILTERS, seeds=5)
def lag_filter(seeds: Sequence[int]) -> Finding:
    """A filter in the yaw correction compensates for the GPS lag.

    The matrix can be passed through a filter like that of the receiver before it is compared with the course; the two
    then agree in a turn.
    """
    flown = {way: flights("turns_180", seeds, tuned(**params)) for way, (params, _) in _WAYS.items()}
    equations = pooled_rms(flights("turns_180", seeds, tuned(**EQUATIONS_ONLY)), COURSE, SETTLED_S)
    tilts = " / ".join(f"{pooled_rms(found, inclination_error_deg, SETTLED_S):.1f}" for found in flown.values())
    error = {way: pooled_rms(found, COURSE, SETTLED_S) for way, found in flown.items()}
    ignored, filtered, corrected = error.values()
    in_turns = [rms_in_turns(flown[way], COURSE, SETTLED_S) for way in ("filtered", "lag ignored")]

    panel = Panel("Reversals in a crosswind: heading minus course", "deg", "s (grey: turning)", xlim=(SETTLED_S, 160.0))
    for way, (_, colour) in _WAYS.items():
        flight, name = flown[way][0], f"{way}: {error[way]:.1f} deg RMS"
        panel.curve(time_s(flight), course_error_deg(flight), colour, name, lw=1.3)
    first = flown["filtered"][0]
    steep = bank_size_deg(first).value > TURNING_DEG
    panel.between(time_s(first), -90, 90, FAINT, where=steep, alpha=0.15)
    return Finding(
        lines=[
            line("heading error, filtered over lag ignored", "", filtered / ignored, "<=", 0.5),
            line("heading error in turns, filtered over lag ignored", "", in_turns[0] / in_turns[1], "<=", 0.5),
        ],
        summary=f"The filter reduces the heading error of turns in wind from {ignored:.1f} degrees RMS to "
        f"{filtered:.1f}, much more than the small improvement that the paper expects; with only the paper's equations "
        f"it is {equations:.1f}. If yaw corrections are also applied to the filter's history, it is {corrected:.1f}. "
        f"The inclination error is {tilts} degrees RMS (ignored, filtered, history corrected).",
        panels=[panel],
    )
