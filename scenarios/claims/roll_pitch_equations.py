"""The note of 2011 to the letter: the signs of its equations, the yaw they see, and why they are summed up.

Computed open loop on motions in closed form, with perfect sensors, and on a flight that the oracle flew.
"""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.interface import G_M_S2, Array
from estimator.rotation import heading_error_rad, integrate
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.motions import seen, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.prescribed_plant import Motion, Rest, SteadyTurn, StraightLevel

GAIN_1_S = 0.5  # proportional gain per radian of error; the note gives none
TILTED_DEG, TURNED_DEG, BANK_DEG = 10.0, 30.0, 35.0


def note(rows: NDArray[np.void], R_start: Array, *, order: float = 1.0, summed: bool = True) -> Array:
    """Attitudes by the note to the letter, shape (n, 3, 3): gyros, and at every report Eqns 3 to 5, proportional only.

    order : -1 exchanges the factors of Eqn 4
    summed : False compares the accelerometer of the moment of the report instead of the sum since the last
    """
    R, attitudes = np.array(R_start), np.empty((len(rows), 3, 3))
    correction_b, felt_e, since_s = np.zeros(3), np.zeros(3), 0.0
    v_before_e = None
    for k, row in enumerate(rows):
        integrate(R, row["gyro_b_rad_s"] + correction_b, row["dt_s"])
        A_e = R @ -row["force_b_m_s2"]  # Eqn 2: gravity minus acceleration
        felt_e = felt_e + A_e * row["dt_s"]
        since_s += row["dt_s"]
        if row["gps_new"]:
            v_e = row["gps_v_e_m_s"].copy()
            if v_before_e is not None:
                left = felt_e if summed else A_e * since_s
                right = np.array([0.0, 0.0, since_s * G_M_S2]) - (v_e - v_before_e)  # Eqn 3
                error_e = order * np.cross(left, right)  # Eqn 4
                error_b = R.T @ error_e  # Eqn 5
                correction_b = GAIN_1_S * error_b / (since_s * G_M_S2) ** 2  # of unit size for a right angle
            v_before_e, felt_e, since_s = v_e, np.zeros(3), 0.0
        attitudes[k] = R
    return attitudes


def _tilted() -> Array:
    return np.asarray(Rotation.from_rotvec([0.0, math.radians(TILTED_DEG), 0.0]).as_matrix())


def _signs(_seeds: Sequence[int]) -> Finding:
    motions: dict[str, Motion] = {
        "at rest": Rest(),
        "in a turn": SteadyTurn(math.radians(BANK_DEG)),
        "in a surge": StraightLevel(surge_m_s2=2.5),
    }
    logs = {where: seen(motion, 30.0) for where, motion in motions.items()}
    tilts = {
        (where, order): tilt_deg(note(log.measured, _tilted() @ log.truth["R_eb"][0], order=order), log)
        for where, log in logs.items()
        for order in (1.0, -1.0)
    }
    lasting = {key: float(tilt[-1]) for key, tilt in tilts.items()}

    def draw(figure: Figure) -> None:
        for ax, order in zip(axes(figure, "Eqn 4 as printed", "Its factors exchanged"), (1.0, -1.0), strict=True):
            for where, colour in zip(logs, (BLUE, GREEN, ORANGE), strict=True):
                ax.plot(logs[where].truth["t_s"], tilts[where, order], color=colour, lw=2, label=where)
            label(ax, "time, s", "tilt error, deg")
            ax.legend(frameon=False)

    return Finding(
        stands=(
            *(line(f"tilt left {where} after 30 s", "deg", lasting[where, 1.0], "<=", 0.5) for where in logs),
            line("the same at rest, factors exchanged", "deg", lasting["at rest", -1.0], ">=", 90.0),
        ),
        told=f"A tilt of {TILTED_DEG:.0f} degrees is gone after 30 s, to {lasting['at rest', 1.0]:.3f} degrees at rest "
        f"and {lasting['in a turn', 1.0]:.2f} in a turn of {BANK_DEG:.0f} degrees of bank. With the factors exchanged "
        f"it grows to {lasting['at rest', -1.0]:.0f}: here, unlike in Eqn 27 of the paper of 2009, the order is right.",
        seeds=0,
        draw=draw,
    )


def _yaw(_seeds: Sequence[int]) -> Finding:
    turned = np.asarray(Rotation.from_rotvec([0.0, 0.0, math.radians(TURNED_DEG)]).as_matrix())

    def errors_deg(bank_deg: float) -> tuple[Array, Array]:
        log = seen(SteadyTurn(math.radians(bank_deg)), 60.0)
        R = note(log.measured, turned @ log.truth["R_eb"][0])
        return log.truth["t_s"], np.degrees(np.abs(heading_error_rad(R, log.truth["R_eb"])))

    headings = {bank: errors_deg(bank) for bank in (0.0, 20.0, BANK_DEG, 50.0)}
    straight, turning = float(headings[0.0][1][-1]), float(headings[BANK_DEG][1][-1])

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A heading 30 degrees off comes right in turns, without any yaw reference")
        for (bank, (t_s, error)), colour in zip(headings.items(), (FAINT, ORANGE, BLUE, GREEN), strict=True):
            ax.plot(t_s, error, color=colour, lw=2, label=f"{bank:.0f}° of bank" if bank else "straight ahead")
        label(ax, "time, s", "heading error, deg")
        ax.legend(frameon=False, loc="center right", bbox_to_anchor=(1.0, 0.62))

    return Finding(
        stands=(
            line("heading error left after 60 s of turn", "deg", turning, "<=", 3.0),
            line("heading error left after 60 s straight ahead", "deg", straight, ">=", 0.9 * TURNED_DEG),
        ),
        told=f"A heading {TURNED_DEG:.0f} degrees off is down to {turning:.1f} degrees after a minute of turning at "
        f"{BANK_DEG:.0f} degrees of bank, at 20 degrees of bank to {headings[20.0][1][-1]:.0f}; straight ahead "
        f"{straight:.0f} of the {TURNED_DEG:.0f} are left, for nothing accelerates sideways.",
        seeds=0,
        draw=draw,
    )


def _calibrated(log: Log) -> NDArray[np.void]:
    """What was measured, less the gyro offset of the start."""
    rows = log.measured.copy()
    rows["gyro_b_rad_s"] -= log.truth["gyro_bias_b_rad_s"][0]
    return rows


def _summed(seeds: Sequence[int]) -> Finding:
    rates_hz = (1, 4, 10)

    def left_deg(suite: str, hz: int) -> tuple[float, float]:
        changes = {
            "suite": suite, "rates.gps_hz": hz, "sensors.gps.filter_s": 0.0, "sensors.gps.latency_s": 0.0,
            "duration_s": 80.0,
        }  # fmt: skip
        logs = [flight.log for flight in flights("turns_180", seeds, changes, "sim.oracle:Oracle")]

        def tilt(way: bool) -> float:
            tilts = [tilt_deg(note(_calibrated(log), log.truth["R_eb"][0], summed=way), log)[1000:] for log in logs]
            return rms(np.concatenate(tilts))

        return tilt(True), tilt(False)

    clean = np.array([left_deg("ideal", hz) for hz in rates_hz])
    cheap = np.array([left_deg("generic", hz) for hz in rates_hz])
    at_1_hz, at_4_hz, cheaply = clean[0], clean[1], cheap[1]

    def draw(figure: Figure) -> None:
        panels = axes(figure, "Perfect sensors", "Cheap gyros and accelerometers")
        for ax, tilts in zip(panels, (clean, cheap), strict=True):
            ax.semilogx(rates_hz, tilts[:, 1], "o-", color=RED, lw=2, label="sampled at the report")
            ax.semilogx(rates_hz, tilts[:, 0], "o-", color=BLUE, lw=2, label="summed between reports")
            ax.set_xticks(rates_hz, [str(hz) for hz in rates_hz])
            ax.minorticks_off()
            ax.set_ylim(0.0)
            label(ax, "GPS reports a second", "tilt error RMS, deg")
        panels[0].legend(frameon=False)

    return Finding(
        stands=(
            line("tilt RMS, of what sampling leaves, 4 Hz", "", at_4_hz[0] / at_4_hz[1], "<=", 0.5),
            line("tilt RMS, of what sampling leaves, 1 Hz", "", at_1_hz[0] / at_1_hz[1], "<=", 0.5),
            line("the same with cheap sensors, 4 Hz", "", cheaply[0] / cheaply[1], "<=", 1.0),
        ),
        told=f"In two turns in turbulence, with perfect sensors, summing leaves {at_4_hz[0]:.2f} degrees of tilt at 4 "
        f"reports a second where the accelerometer of the moment leaves {at_4_hz[1]:.2f} ({at_1_hz[0]:.2f} against "
        f"{at_1_hz[1]:.1f} at one). With cheap sensors, whose own errors weigh more, it is {cheaply[0]:.2f} "
        f"against {cheaply[1]:.2f} at 4.",
        seeds=len(seeds),
        draw=draw,
    )


CLAIMS = (
    Claim(
        name="velocity_change_signs",
        title="Eqns 4 and 5 have the right sign",
        paper=Paper.ROLL_PITCH,
        place="Solution, Eqns 4 and 5",
        says="The cross product of what the accelerometer says in the earth frame with gravity minus the change of "
        "velocity is the error; turned into the body frame it goes to the feedback controller as it is.",
        expected=Verdict.CONFIRMED,
        measure=_signs,
        seeds=0,
    ),
    Claim(
        name="yaw_from_acceleration",
        title="Acceleration sideways shows yaw drift too",
        paper=Paper.ROLL_PITCH,
        place="Solution, below Eqn 3",
        says="The method sees a drift of yaw as well as of roll and pitch, if the aircraft accelerates sideways.",
        expected=Verdict.CONFIRMED,
        measure=_yaw,
        seeds=0,
    ),
    Claim(
        name="summed_between_reports",
        title="Summing up between reports is more accurate",
        paper=Paper.ROLL_PITCH,
        place="Solution, above Eqn 3",
        says="Both sides are best integrated from one GPS report to the next: velocity is then used, not acceleration, "
        "and that is more accurate.",
        expected=Verdict.CONFIRMED,
        measure=_summed,
        seeds=2,
    ),
)
