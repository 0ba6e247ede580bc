"""The note of 2011 in flight: velocity change against the method of 2009, in turns, in wind and at a hand launch.

Unless a claim says otherwise, each flight is steered by the true attitude and seen by perfect sensors; both methods are
replayed over its log with the same weight and without an integral.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from estimator.ap_dcm import ApDcm
from estimator.blocks.compiled import Compiled
from estimator.gps_velocity import GpsVelocity, GpsVelocityMagnetometer, GpsVelocityParams
from estimator.interface import Array, AttitudeEstimate, Measurements
from estimator.params.ap_dcm import ApDcmParams
from estimator.premerlani import Premerlani, PremerlaniParams
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import NOTHING, clean_log, flights, percentage
from scenarios.harness.claims.motions import DECLINATION_RAD, LAGGED, RECEIVER, felt_at_rest, seen, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import highest, inclination_error_deg, rms, survived
from sim.log import Flight, Log
from sim.motion.hover import Hover
from sim.motion.prescribed_plant import Loop, Motion, SteadyTurn
from sim.rows import Row

WEIGHT = 0.5  # of the roll-pitch correction, 1/s, for every estimator here
AT_ONCE = {"gps_filter_s": 0.0, "gps_latency_s": 0.0}
LATE = {f"sensors.{name}": value for name, value in LAGGED.items()}
SETTLED = 1500  # ticks: half a minute
BANKS_DEG = (20.0, 35.0, 45.0, 50.0, 55.0, 60.0)
WINDS_M_S = (0.0, 2.5, 5.0, 7.5)
CALM = {"air.wind_m_s": 0.0}


def paper_of_2009(**others: Any) -> Premerlani:
    """Centrifugal acceleration from ground speed along the nose."""
    return Premerlani(PremerlaniParams(w_rp=WEIGHT, k_i=0.0, use_airspeed=False, **others))


def note_of_2011(**others: Any) -> GpsVelocity:
    """The change of velocity."""
    return GpsVelocity(GpsVelocityParams(w_rp=WEIGHT, k_i=0.0, **others))


def note_by_course() -> ApDcm:
    """The same as in ArduPilot, with the course as heading."""
    return ApDcm(ApDcmParams(kp=WEIGHT, ki=0.0, ki_yaw=0.0, use_magnetometer=False))


def note_by_compass(**others: Any) -> GpsVelocityMagnetometer:
    """The same with a magnetometer."""
    params = GpsVelocityParams("magnetometer", w_rp=WEIGHT, k_i=0.0, declination_rad=DECLINATION_RAD, **others)
    return GpsVelocityMagnetometer(params)


def circle(bank_deg: float, wind_m_s: float = 0.0, changes: Mapping[str, Any] = NOTHING) -> Log:
    """A steady turn for 100 s."""
    of_circle = {
        "manoeuvre.bank_deg": bank_deg,
        "manoeuvre.pitch_deg": 3.0 + 0.1 * bank_deg,  # roughly holds the height
        "air.wind_m_s": wind_m_s,
        "air.wind_from_deg": 90.0,
        "duration_s": 100.0,
    }
    return clean_log("circle", {**of_circle, **changes})


def tilts_deg(estimator: Compiled[Any], log: Log, settled: int = SETTLED) -> Array:
    """Inclination errors of `estimator` over `log` after `settled` ticks."""
    return tilt_deg(estimator.replay(log.measured)["R_eb"], log)[settled:]


def attack_costs_deg(log: Log) -> float:
    """Inclination error of the paper of 2009 in a steady turn in calm air, in closed form.

    Seen from above, the nose and the velocity differ by chi = alpha sin(bank) - beta cos(bank).  Eqn 25 turns omega x V
    by as much, an inclination of chi tan(bank) that rotates with the aeroplane at omega; a correction of weight W
    follows it, reduced by sqrt(1 + (omega / W)^2).
    """
    at = log.truth[SETTLED:]
    bank, omega = np.arctan2(at["R_eb"][:, 2, 1], at["R_eb"][:, 2, 2]), np.linalg.norm(at["omega_b_rad_s"], axis=1)
    chi = at["alpha_rad"] * np.sin(bank) - at["beta_rad"] * np.cos(bank)
    return float(np.degrees(np.median(np.abs(chi) * np.tan(bank) / np.hypot(1.0, omega / WEIGHT))))


def wind_costs_deg(wind_m_s: float, omega_rad_s: float) -> float:
    """Inclination error RMS of the paper of 2009 in a steady turn in wind, in closed form.

    To first order the ground speed differs from the airspeed by w cos(heading), and omega x V by omega times that,
    towards the inner wing.  In earth axes half of it is constant, omega w / 2 g, and half rotates twice as fast.
    """
    mean = 0.5 * omega_rad_s * wind_m_s / 9.81
    return math.degrees(math.hypot(mean, mean / math.hypot(1.0, 2.0 * omega_rad_s / WEIGHT)))


@claim(Paper.ROLL_PITCH, "Background", expected=Verdict.WITH_CONDITION)
def velocity_change_in_turns() -> Finding:
    """Velocity change is more accurate than velocity times rotation.

    Velocity times rotation is correct only if the angles of attack and sideslip are known; a method that needs neither
    is more accurate for an aeroplane under high acceleration.
    """
    logs = {bank: circle(bank) for bank in BANKS_DEG}
    old, new = (
        {bank: rms(tilts_deg(make(**AT_ONCE), log)) for bank, log in logs.items()}
        for make in (paper_of_2009, note_of_2011)
    )
    looping = clean_log("loops", CALM)
    series = [tilts_deg(make(**AT_ONCE), looping, 500) for make in (paper_of_2009, note_of_2011)]
    loops_old, loops_new = (rms(tilt) for tilt in series)

    steady = Panel("Steady turns in calm air", "inclination error RMS, deg", "bank, deg")
    steady.curve(BANKS_DEG, [attack_costs_deg(log) for log in logs.values()], FAINT, "closed form", "--")
    steady.curve(BANKS_DEG, list(old.values()), ORANGE, "paper of 2009", "o")
    steady.curve(BANKS_DEG, list(new.values()), BLUE, "note of 2011", "o-")
    looped = Panel("Three loops in calm air", "inclination error, deg")
    for tilt, colour in zip(series, (ORANGE, BLUE), strict=True):
        looped.curve(looping.truth["t_s"][500:], tilt, colour, lw=1.5)

    def better(bank: float) -> Row:
        return line(f"{bank:.0f} deg of bank: error over that of 2009", "", new[bank] / old[bank], "<=", 1.0)

    of_loops = line("loops: error over that of 2009", "", loops_new / loops_old, "<=", 1.0)
    return Finding(
        lines=[better(35.0), better(60.0), of_loops],
        condition="with high acceleration: at 45 degrees of bank and more, and in loops",
        conditional_lines=[better(45.0), better(60.0), of_loops],
        summary=f"With perfect sensors in calm air, the inclination error at 35 degrees of bank is {old[35.0]:.2f} "
        f"degrees by the paper of 2009 and {new[35.0]:.2f} by the note; at 60 degrees {old[60.0]:.1f} and "
        f"{new[60.0]:.1f}, in loops {loops_old:.1f} and {loops_new:.1f}. The angles of attack and sideslip cost "
        "tan(bank) (alpha sin(bank) - beta cos(bank)), which is small in gentle turns.",
        panels=[steady, looped],
    )


@claim(Paper.ROLL_PITCH, "Solution, Eqn 3", expected=Verdict.WITH_CONDITION)
def reported_velocity() -> Finding:
    """GPS velocities can be used in Eqn 3 as reported.

    The sum of the accelerometer readings between two GPS messages is compared with the difference of the velocities in
    those two messages.
    """
    logs = {"35° of bank": circle(35.0, changes=LATE), "Three loops": clean_log("loops", {**CALM, **LATE})}
    as_reported, matched = (
        {name: tilts_deg(note_of_2011(**params), log, 500) for name, log in logs.items()}
        for params in (AT_ONCE, RECEIVER)
    )
    (turn, loops), (turn_matched, loops_matched) = (map(rms, tilts.values()) for tilts in (as_reported, matched))

    panels = []
    for (name, log), legend in zip(logs.items(), ("best", ""), strict=True):
        panels.append(Panel(name, "inclination error, deg", legend=legend, ylim=(0.0, 4.0 if legend else None)))
        tilts = {"late reports as they are": as_reported[name], "accelerometer filtered and delayed": matched[name]}
        panels[-1].curves(log.truth["t_s"][500:], tilts, (RED, BLUE), lw=1.5)
    return Finding(
        lines=[
            line("35 deg of bank: error, velocities as reported", "deg RMS", turn, "<=", 1.0),
            line("loops: error, velocities as reported", "deg RMS", loops, "<=", 1.0),
        ],
        condition="if the accelerometer readings are filtered and delayed like the GPS velocity",
        conditional_lines=[
            line("35 deg of bank: error, both sides alike", "deg RMS", turn_matched, "<=", 1.0),
            line("loops: error, both sides alike", "deg RMS", loops_matched, "<=", 1.0),
        ],
        summary="A receiver with a filter of 1 s and a latency of 0.3 s causes an inclination "
        f"error of {turn:.1f} degrees at 35 degrees of bank and {loops:.0f} in loops. If the accelerometer side of "
        f"Eqn 3 is filtered and delayed alike, it is {turn_matched:.2f} and {loops_matched:.2f} degrees.",
        panels=panels,
    )


@claim(Paper.ROLL_PITCH, "Problem, and Solution, Eqn 3", expected=Verdict.WITH_CONDITION)
def velocity_change_in_wind() -> Finding:
    """Wind does not affect the velocity-change method.

    Roll-pitch drift is found without any knowledge of the airflow: the difference of two ground velocities does not
    contain a steady wind.
    """
    logs = {wind: circle(35.0, wind) for wind in WINDS_M_S}
    methods = {
        "paper of 2009": (lambda: paper_of_2009(**AT_ONCE), ORANGE, "o"),
        "note, heading is the course": (note_by_course, RED, "s-"),
        "note, heading is the nose's": (lambda: note_of_2011(**AT_ONCE), BLUE, "o-"),
        "note, heading by compass": (lambda: note_by_compass(**AT_ONCE), GREEN, "x"),
    }
    tilts = {name: [rms(tilts_deg(make(), log)) for log in logs.values()] for name, (make, *_) in methods.items()}
    old, course, nose, compass = (values[WINDS_M_S.index(5.0)] for values in tilts.values())
    omega_rad_s = float(np.median(np.linalg.norm(logs[0.0].truth["omega_b_rad_s"][SETTLED:], axis=1)))

    panel = Panel("A turn at 35° of bank in wind", "inclination error RMS, deg", "wind, m/s")
    winds = np.linspace(0.0, WINDS_M_S[-1], 50)
    closed = [wind_costs_deg(wind, omega_rad_s) for wind in winds]
    panel.curve(winds, closed, FAINT, "paper of 2009, closed form", "--")
    for name, (_, colour, style) in methods.items():
        panel.curve(WINDS_M_S, tilts[name], colour, name, style)
    return Finding(
        lines=[line("5 m/s: error, heading is the course", "deg RMS", course, "<=", 1.0)],
        condition="if the heading is that of the nose, not the course",
        conditional_lines=[
            line("5 m/s: error, heading of the nose with learnt wind", "deg RMS", nose, "<=", 1.0),
            line("5 m/s: error, heading by compass", "deg RMS", compass, "<=", 1.0),
        ],
        summary=f"In a turn at 35 degrees of bank in 5 m/s of wind, the inclination error is {old:.1f} degrees by the "
        f"paper of 2009, which needs airspeed and uses ground speed. By the note it is {course:.1f} if the heading is "
        f"the course, which differs from the nose by the crab angle. With the heading of the nose, from learnt wind or "
        f"a compass, it is {nose:.2f} and {compass:.2f}, as in calm air.",
        panels=[panel],
    )


@claim(Paper.ROLL_PITCH, "Background, and Solution, below Eqn 3")
def any_vehicle() -> Finding:
    """The method works for any aircraft, in any orientation.

    No assumption is made about the orientation of the aircraft. A multi-rotor does not point where it flies: velocity
    times rotation has very large errors there, velocity change none.
    """
    circling = "multi-rotor circling"
    motions: dict[str, Motion] = {
        circling: Hover(north=((10.0, 0.08, 0.0),), east=((10.0, 0.08, 0.5 * math.pi),), yaw=((0.0, 1.0, 0.0),)),
        "aeroplane turning": SteadyTurn(math.radians(35.0)),
        "aeroplane looping": Loop(),
    }
    logs = {name: seen(motion, 80.0) for name, motion in motions.items()}

    def tilts(estimator: Compiled[Any], log: Log) -> Array:
        estimator.reset(felt_at_rest(log.truth["R_eb"][0]))  # type: ignore[attr-defined]
        return tilts_deg(estimator, log)

    new = {name: tilts(note_by_compass(**AT_ONCE), log) for name, log in logs.items()}
    old = tilts(paper_of_2009(w_y=0.0, **AT_ONCE), logs[circling])
    worst = {name: highest(tilt) for name, tilt in new.items()}

    panel = Panel("A multi-rotor in circles, always heading north", "inclination error, deg", ylim=(0.0, 14.0))
    shown = {"paper of 2009": old, "note of 2011": new[circling]}
    panel.curves(logs[circling].truth["t_s"][SETTLED:], shown, (ORANGE, BLUE))
    return Finding(
        lines=[
            *(line(f"{name}: largest inclination error", "deg", worst[name], "<=", 2.0) for name in motions),
            line(f"{circling}: error by the paper of 2009", "deg RMS", rms(old), ">=", 5.0),
        ],
        summary=f"A multi-rotor that flies circles with its nose to the north is tilted by 14 degrees; the paper of "
        f"2009 has an error of {rms(old):.1f}. The note with a compass has an error of at most "
        f"{worst[circling]:.2f} degrees, and at most {worst['aeroplane looping']:.1f} in continuous loops.",
        panels=[panel],
    )


class NoteWithoutLock(GpsVelocity):
    """The note as written, at a launch: used from the first report on, even if the heading is unknown."""

    def update(self, m: Measurements) -> AttitudeEstimate:
        """See `Compiled.update`."""
        self._state["locked"] = 1
        return super().update(m)


@claim(Paper.ROLL_PITCH, "Problem", expected=Verdict.WITH_CONDITION, seeds=10)
def velocity_change_at_launch(seeds: Sequence[int]) -> Finding:
    """The method needs only an accelerometer and GPS.

    An accelerometer and GPS are enough to detect roll-pitch drift, without any knowledge of the airflow.
    """
    unknown = flights("hand_launch", seeds, estimator=NoteWithoutLock)
    known = flights("hand_launch", seeds, {"start.heading_deg": 0.0}, NoteWithoutLock)

    def first_deg(flown: Sequence[Flight]) -> float:
        return rms(np.array([highest(inclination_error_deg(flight).within(0.0, 1.5).value) for flight in flown]))

    def survive(flown: Sequence[Flight]) -> float:
        return percentage(flown, lambda flight: bool(survived(flight).value)) / 100.0

    panels = []
    for flown, title in ((unknown, "Heading unknown at the launch"), (known, "Heading known")):
        panel = Panel(title, "inclination error, deg", "s after the release", ylim=(0.0, 30.0))
        for flight in flown:
            panel.flights([flight], inclination_error_deg, BLUE if survived(flight).value else RED, "", -1.0, 6.0)
        if survive(flown) < 1.0:
            panel.note("crashed", 0.97, 0.92, RED, ha="right", fraction="xy")
        panels.append(panel)

    def lines(flown: Sequence[Flight], heading: str) -> list[Row]:
        return [
            line(f"heading {heading}: largest error in the first 1.5 s", "deg", first_deg(flown), "<=", 5.0),
            line(f"heading {heading}: part of the flights that survive", "", survive(flown), ">=", 1.0),
        ]

    return Finding(
        lines=lines(unknown, "unknown"),
        condition="if the heading is known",
        conditional_lines=lines(known, "known"),
        summary=f"At a launch with unknown heading, the acceleration causes an inclination error of "
        f"{first_deg(unknown):.0f} degrees (RMS of the largest in 1.5 s), and {survive(unknown):.0%} survive. With "
        f"the heading known it is {first_deg(known):.1f} degrees, and {survive(known):.0%} survive. The method needs "
        "no airflow, but a heading.",
        panels=panels,
    )
