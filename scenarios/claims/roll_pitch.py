"""The note of 2011 in flight: the velocity-change method against the paper of 2009, in turns, in wind, at the launch.

Each flight is flown by the oracle and seen by perfect sensors, unless a claim says otherwise; both methods are run
over what was seen of it, with the same weight and nothing to learn.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.ap_dcm import ApDcm
from estimator.blocks.compiled import Compiled
from estimator.gps_velocity import GpsVelocity, GpsVelocityMagnetometer, GpsVelocityParams
from estimator.interface import Array, AttitudeEstimate, Measurements
from estimator.params.ap_dcm import ApDcmParams
from estimator.premerlani import Premerlani, PremerlaniParams
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.motions import DECLINATION_RAD, felt_at_rest, seen, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import highest, inclination_error_deg, rms, survived, time_s
from sim.log import Log
from sim.motion.hover import Hover
from sim.motion.prescribed_plant import Loop, Motion, SteadyTurn

WEIGHT = 0.5  # of the roll-pitch correction, 1/s, for every estimator here
FILTER_S, LATENCY_S = 1.0, 0.3
AT_ONCE = {"gps_filter_s": 0.0, "gps_latency_s": 0.0}
LATE = {"sensors.gps.filter_s": FILTER_S, "sensors.gps.latency_s": LATENCY_S}
SETTLED = 1500  # ticks: half a minute
BANKS_DEG = (20.0, 35.0, 45.0, 50.0, 55.0, 60.0)
WINDS_M_S = (0.0, 2.5, 5.0, 7.5)


def paper_of_2009(**others: Any) -> Premerlani:
    """Centrifugal acceleration from the speed over the ground, along the nose."""
    return Premerlani(PremerlaniParams(w_rp=WEIGHT, k_i=0.0, use_airspeed=False, **others))


def note_of_2011(**others: Any) -> GpsVelocity:
    """The change of velocity."""
    return GpsVelocity(GpsVelocityParams(w_rp=WEIGHT, k_i=0.0, **others))


def note_by_course() -> ApDcm:
    """The same as ArduPilot had it, with the course for a heading."""
    return ApDcm(ApDcmParams(kp=WEIGHT, ki=0.0, ki_yaw=0.0, use_magnetometer=False))


def note_by_compass(**others: Any) -> GpsVelocityMagnetometer:
    """The same with a magnetometer."""
    params = GpsVelocityParams("magnetometer", w_rp=WEIGHT, k_i=0.0, declination_rad=DECLINATION_RAD, **others)
    return GpsVelocityMagnetometer(params)


def circle(bank_deg: float, wind_m_s: float = 0.0, changes: dict[str, Any] | None = None) -> Log:
    """A steady turn for 100 s, flown by the oracle."""
    of_circle = {
        "manoeuvre.bank_deg": bank_deg,
        "manoeuvre.pitch_deg": 3.0 + 0.1 * bank_deg,  # holds the height, about
        "air.wind_m_s": wind_m_s,
        "air.wind_from_deg": 90.0,
        "duration_s": 100.0,
    }
    return _clean("circle", {**of_circle, **(changes or {})})


def _clean(scenario: str, changes: dict[str, Any]) -> Log:
    """Flown by the oracle without turbulence, heading north, and seen by perfect sensors."""
    clean = {"air.turbulence_w20_m_s": 0.0, "suite": "ideal", "start.heading_deg": 0.0}
    (flight,) = flights(scenario, [0], {**clean, **changes}, "sim.oracle:Oracle")
    return flight.log


def loops(changes: dict[str, Any] | None = None) -> Log:
    """Three inside loops in calm air."""
    return _clean("loops", {"air.wind_m_s": 0.0, **(changes or {})})


def tilts_deg(estimator: Compiled[Any], log: Log, settled: int = SETTLED) -> Array:
    """Tilt errors of `estimator` over `log` once settled."""
    return tilt_deg(estimator.replay(log.measured)["R_eb"], log)[settled:]


def attack_costs_deg(log: Log) -> float:
    """Tilt error of the paper of 2009 in a steady turn in calm air, in closed form.

    The nose lies beside the velocity by chi = alpha sin(bank) - beta cos(bank), seen from above.  Eqn 25 points
    omega x V off by as much, which is chi tan(bank) of tilt, turning with the aeroplane at omega; a correction of
    weight W follows that to one part in sqrt(1 + (omega / W)^2).
    """
    at = log.truth[SETTLED:]
    bank, omega = np.arctan2(at["R_eb"][:, 2, 1], at["R_eb"][:, 2, 2]), np.linalg.norm(at["omega_b_rad_s"], axis=1)
    chi = at["alpha_rad"] * np.sin(bank) - at["beta_rad"] * np.cos(bank)
    return float(np.degrees(np.median(np.abs(chi) * np.tan(bank) / np.hypot(1.0, omega / WEIGHT))))


def wind_costs_deg(wind_m_s: float, omega_rad_s: float) -> float:
    """Tilt error RMS of the paper of 2009 in a steady turn in wind, in closed form.

    The ground speed is off the airspeed by w cos(heading), to the first order, and omega x V by omega as much, towards
    the inner wing.  In earth axes that is half a constant, omega w / 2 g, and half a vector that turns twice as fast.
    """
    mean = 0.5 * omega_rad_s * wind_m_s / 9.81
    return math.degrees(math.hypot(mean, mean / math.hypot(1.0, 2.0 * omega_rad_s / WEIGHT)))


def _turns(_seeds: Sequence[int]) -> Finding:
    logs = {bank: circle(bank) for bank in BANKS_DEG}
    old = {bank: rms(tilts_deg(paper_of_2009(**AT_ONCE), log)) for bank, log in logs.items()}
    new = {bank: rms(tilts_deg(note_of_2011(**AT_ONCE), log)) for bank, log in logs.items()}
    looping = loops()
    series = [tilts_deg(estimator, looping, 500) for estimator in (paper_of_2009(**AT_ONCE), note_of_2011(**AT_ONCE))]
    loops_old, loops_new = (rms(tilt) for tilt in series)

    def draw(figure: Figure) -> None:
        steady, looped = axes(figure, "Steady turns in calm air", "Three loops in calm air")
        steady.plot(BANKS_DEG, [attack_costs_deg(log) for log in logs.values()], "--", color=FAINT, label="closed form")
        steady.plot(BANKS_DEG, list(old.values()), "o", color=ORANGE, label="paper of 2009")
        steady.plot(BANKS_DEG, list(new.values()), "o-", color=BLUE, lw=2, label="note of 2011")
        label(steady, "bank, deg", "tilt error RMS, deg")
        steady.legend(frameon=False)
        for tilt, colour in zip(series, (ORANGE, BLUE), strict=True):
            looped.plot(looping.truth["t_s"][500:], tilt, color=colour, lw=1.5)
        label(looped, "time, s", "tilt error, deg")

    def better(bank: float) -> Any:
        return line(f"tilt RMS, of that of 2009, at {bank:.0f} deg of bank", "", new[bank] / old[bank], "<=", 1.0)

    of_loops = line("tilt RMS, of that of 2009, in loops", "", loops_new / loops_old, "<=", 1.0)
    return Finding(
        stands=(better(35.0), better(60.0), of_loops),
        told=f"With perfect sensors, in calm air, at 35 degrees of bank the paper of 2009 tilts by {old[35.0]:.2f} "
        f"degrees and the note by {new[35.0]:.2f}; at 60 degrees by {old[60.0]:.1f} and {new[60.0]:.1f}, in loops by "
        f"{loops_old:.1f} and {loops_new:.1f}. The angles of attack and of sideslip cost tan(bank) "
        f"(alpha sin(bank) - beta cos(bank)), which is small in gentle turns.",
        seeds=0,
        draw=draw,
        condition="with high acceleration: from 45 degrees of bank on, and in loops",
        under=(better(45.0), better(60.0), of_loops),
    )


def _late(_seeds: Sequence[int]) -> Finding:
    logs = {"35° of bank": circle(35.0, changes=LATE), "Three loops": loops(LATE)}
    come = [tilts_deg(note_of_2011(**AT_ONCE), log, 500) for log in logs.values()]
    alike = [tilts_deg(note_of_2011(gps_filter_s=FILTER_S, gps_latency_s=LATENCY_S), log, 500) for log in logs.values()]
    (turn_come, loops_come), (turn_alike, loops_alike) = ([rms(tilt) for tilt in tilts] for tilts in (come, alike))

    def draw(figure: Figure) -> None:
        panels = axes(figure, *logs)
        for ax, log, of_come, of_alike in zip(panels, logs.values(), come, alike, strict=True):
            t_s = log.truth["t_s"][500:]
            ax.plot(t_s, of_come, color=RED, lw=1.5, label="late reports as they come")
            ax.plot(t_s, of_alike, color=BLUE, lw=1.5, label="both sides filtered and late alike")
            label(ax, "time, s", "tilt error, deg")
            ax.set_ylim(0.0)
        panels[0].set_ylim(0.0, 4.0)
        panels[0].legend(frameon=False)

    return Finding(
        stands=(
            line("tilt RMS at 35 deg of bank, reports as they come", "deg", turn_come, "<=", 1.0),
            line("tilt RMS in loops, reports as they come", "deg", loops_come, "<=", 1.0),
        ),
        told=f"A receiver that filters with {FILTER_S:.0f} s and is {LATENCY_S} s late costs {turn_come:.1f} degrees "
        f"of tilt at 35 degrees of bank and {loops_come:.0f} in loops. Where the accelerometer's side of Eqn 3 is "
        f"filtered and delayed alike, {turn_alike:.2f} and {loops_alike:.2f} degrees are left.",
        seeds=0,
        draw=draw,
        condition="if what the accelerometer says is filtered and delayed as the receiver does it",
        under=(
            line("tilt RMS at 35 deg of bank, both sides alike", "deg", turn_alike, "<=", 1.0),
            line("tilt RMS in loops, both sides alike", "deg", loops_alike, "<=", 1.0),
        ),
    )


def _wind(_seeds: Sequence[int]) -> Finding:
    logs = {wind: circle(35.0, wind) for wind in WINDS_M_S}
    makers = {
        "paper of 2009": lambda: paper_of_2009(**AT_ONCE),
        "note, heading of the course": note_by_course,
        "note, heading of the nose": lambda: note_of_2011(**AT_ONCE),
        "note, heading of a compass": lambda: note_by_compass(**AT_ONCE),
    }
    tilts = {name: [rms(tilts_deg(make(), log)) for log in logs.values()] for name, make in makers.items()}
    at_5 = {name: values[WINDS_M_S.index(5.0)] for name, values in tilts.items()}
    old, course, nose, compass = at_5.values()
    omega_rad_s = float(np.median(np.linalg.norm(logs[0.0].truth["omega_b_rad_s"][SETTLED:], axis=1)))

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A turn at 35° of bank in wind")
        winds = np.linspace(0.0, WINDS_M_S[-1], 50)
        closed = [wind_costs_deg(wind, omega_rad_s) for wind in winds]
        ax.plot(winds, closed, "--", color=FAINT, label="paper of 2009, closed form")
        for (name, values), mark in zip(tilts.items(), ("o", "s-", "o-", "x"), strict=True):
            colour = {"paper of 2009": ORANGE, "note, heading of the course": RED}.get(name, BLUE)
            ax.plot(WINDS_M_S, values, mark, color=GREEN if mark == "x" else colour, lw=2, label=name)
        label(ax, "wind, m/s", "tilt error RMS, deg")
        ax.legend(frameon=False)

    return Finding(
        stands=(line("tilt RMS in 5 m/s, heading of the course", "deg", course, "<=", 1.0),),
        told=f"Turning at 35 degrees of bank in 5 m/s of wind, the paper of 2009 tilts by {old:.1f} degrees, for "
        f"ground speed is not what turns it. The note tilts by {course:.1f} where its heading is the course, "
        f"off the nose by the crab; with the heading of the nose, learnt or a compass's, by {nose:.2f} and "
        f"{compass:.2f}, as in calm.",
        seeds=0,
        draw=draw,
        condition="if the heading is that of the nose, not that of the course",
        under=(
            line("tilt RMS in 5 m/s, heading of the nose, wind learnt", "deg", nose, "<=", 1.0),
            line("tilt RMS in 5 m/s, heading of a compass", "deg", compass, "<=", 1.0),
        ),
    )


def _any_vehicle(_seeds: Sequence[int]) -> Finding:
    drone = Hover(north=((10.0, 0.08, 0.0),), east=((10.0, 0.08, 0.5 * math.pi),), yaw=((0.0, 1.0, 0.0),))
    motions: dict[str, Motion] = {
        "multi-rotor circling": drone, "aeroplane turning": SteadyTurn(math.radians(35.0)), "aeroplane looping": Loop()
    }  # fmt: skip
    logs = {name: seen(motion, 80.0) for name, motion in motions.items()}

    def tilts(estimator: Compiled[Any], log: Log) -> Array:
        estimator.reset(felt_at_rest(log.truth["R_eb"][0]))  # type: ignore[attr-defined]
        return tilts_deg(estimator, log)

    new = {name: tilts(note_by_compass(**AT_ONCE), log) for name, log in logs.items()}
    old = {name: tilts(paper_of_2009(w_y=0.0, **AT_ONCE), log) for name, log in logs.items()}
    worst = {name: highest(tilt) for name, tilt in new.items()}
    circling = "multi-rotor circling"

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A multi-rotor in circles of 10 m at 5 m/s, its nose always north")
        t_s = logs[circling].truth["t_s"][SETTLED:]
        ax.plot(t_s, old[circling], color=ORANGE, lw=2, label="paper of 2009")
        ax.plot(t_s, new[circling], color=BLUE, lw=2, label="note of 2011")
        label(ax, "time, s", "tilt error, deg")
        ax.set_ylim(0.0, 14.0)
        ax.legend(frameon=False, loc="center right")

    return Finding(
        stands=(
            *(line(f"largest tilt, {name}", "deg", worst[name], "<=", 2.0) for name in motions),
            line("tilt RMS of 2009, multi-rotor circling", "deg", rms(old[circling]), ">=", 5.0),
        ),
        told=f"A multi-rotor that circles with its nose to the north leans by 14 degrees, which the paper of 2009 "
        f"misses by {rms(old[circling]):.1f}. The note, with a compass, is never off by more than "
        f"{worst[circling]:.2f} degrees, nor by more than {worst['aeroplane looping']:.1f} in endless loops.",
        seeds=0,
        draw=draw,
    )


class NoteWithoutLock(GpsVelocity):
    """The note to the letter at a launch: trusted from the first report on, whether or not the heading is known."""

    def update(self, m: Measurements) -> AttitudeEstimate:
        """See `Compiled.update`."""
        self._state["locked"] = 1
        return super().update(m)


def _launch(seeds: Sequence[int]) -> Finding:
    unknown = flights("hand_launch", seeds, estimator=NoteWithoutLock)
    known = flights("hand_launch", seeds, {"start.heading_deg": 0.0}, NoteWithoutLock)

    def first_s(flown: Sequence[Any]) -> float:
        return rms(np.array([highest(inclination_error_deg(flight).within(0.0, 1.5).value) for flight in flown]))

    def survive(flown: Sequence[Any]) -> float:
        return float(np.mean([survived(flight).value for flight in flown]))

    def draw(figure: Figure) -> None:
        panels = axes(figure, "Heading unknown at the throw", "Heading known")
        for ax, flown in zip(panels, (unknown, known), strict=True):
            for flight in flown:
                t_s = time_s(flight)
                soon = (t_s > -1.0) & (t_s < 6.0)
                error = inclination_error_deg(flight).value[soon]
                ax.plot(t_s[soon], error, color=BLUE if survived(flight).value else RED, lw=1)
            ax.set_ylim(0.0, 30.0)
            label(ax, "time since the release, s", "tilt error, deg")
        if survive(unknown) < 1.0:
            panels[0].annotate("crashed", (0.97, 0.92), xycoords="axes fraction", color=RED, ha="right")

    return Finding(
        stands=(
            line("largest tilt in the first 1.5 s, heading unknown", "deg", first_s(unknown), "<=", 5.0),
            line("flights that survive, heading unknown", "", survive(unknown), ">=", 1.0),
        ),
        told=f"Thrown with a heading that it does not know, it takes the push for a tilt of {first_s(unknown):.0f} "
        f"degrees (RMS of the largest in 1.5 s), and {survive(unknown) * 100.0:.0f} % survive; with the heading known "
        f"it is {first_s(known):.1f} degrees and {survive(known) * 100.0:.0f} %. The method wants no airflow, "
        f"but a heading.",
        seeds=len(seeds),
        draw=draw,
        condition="if the heading is known",
        under=(
            line("largest tilt in the first 1.5 s, heading known", "deg", first_s(known), "<=", 5.0),
            line("flights that survive, heading known", "", survive(known), ">=", 1.0),
        ),
    )


CLAIMS = (
    Claim(
        name="velocity_change_in_turns",
        title="The change of velocity beats velocity times rotation",
        paper=Paper.ROLL_PITCH,
        place="Background",
        says="Velocity times rotation is right only where the angles of attack and of sideslip are known; a method "
        "that wants neither is more accurate for an aeroplane under high acceleration.",
        expected=Verdict.WITH_CONDITION,
        measure=_turns,
        seeds=0,
    ),
    Claim(
        name="reported_velocity",
        title="The velocities that the GPS reports are those of Eqn 3",
        paper=Paper.ROLL_PITCH,
        place="Solution, Eqn 3",
        says="The sum of the accelerometer from one GPS message to the next is compared with the difference of the "
        "velocities in those two messages.",
        expected=Verdict.WITH_CONDITION,
        measure=_late,
        seeds=0,
    ),
    Claim(
        name="velocity_change_in_wind",
        title="Wind does not matter to the change of velocity",
        paper=Paper.ROLL_PITCH,
        place="Problem, and Solution, Eqn 3",
        says="Roll-pitch drift is found without anything known of how the aircraft lies to the air it flies through: "
        "the difference of two ground velocities has no steady wind in it.",
        expected=Verdict.WITH_CONDITION,
        measure=_wind,
        seeds=0,
    ),
    Claim(
        name="any_vehicle",
        title="It works for whatever flies, whichever way it points",
        paper=Paper.ROLL_PITCH,
        place="Background, and Solution, below Eqn 3",
        says="No assumption is made about the orientation of the aircraft. A multi-rotor does not point where it "
        "flies: velocity times rotation makes very large errors there, the change of velocity none.",
        expected=Verdict.CONFIRMED,
        measure=_any_vehicle,
        seeds=0,
    ),
    Claim(
        name="velocity_change_at_launch",
        title="It needs nothing but accelerometer and GPS",
        paper=Paper.ROLL_PITCH,
        place="Problem",
        says="An accelerometer and GPS are enough to detect roll-pitch drift, without anything known of the airflow.",
        expected=Verdict.WITH_CONDITION,
        measure=_launch,
    ),
)
