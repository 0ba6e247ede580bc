"""The equations of the note of 2011 as written: their signs, the yaw error they detect, and why they use sums.

Computed on prescribed motions with perfect sensors, and on flights steered by the true attitude.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.interface import G_M_S2, Array
from estimator.rotation import heading_error_rad, integrate
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.motions import seen, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import rms
from sim.log import Log
from sim.motion.prescribed_plant import Motion, Rest, SteadyTurn, StraightLevel

GAIN_1_S = 0.5  # proportional gain per radian of error; the note gives none
TILTED_DEG, TURNED_DEG, BANK_DEG = 10.0, 30.0, 35.0


def note(rows: NDArray[np.void], R_start: Array, *, order: float = 1.0, summed: bool = True) -> Array:
    """Attitudes by the note as written, shape (n, 3, 3): gyros, and at every report Eqns 3 to 5, proportional only.

    order : -1 exchanges the factors of Eqn 4
    summed : False uses the accelerometer reading at the report instead of the sum since the previous one
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
                correction_b = GAIN_1_S * error_b / (since_s * G_M_S2) ** 2  # unit size for a right angle
            v_before_e, felt_e, since_s = v_e, np.zeros(3), 0.0
        attitudes[k] = R
    return attitudes


@claim(Paper.ROLL_PITCH, "Solution, Eqns 4 and 5")
def velocity_change_signs() -> Finding:
    """Eqns 4 and 5 have the right sign.

    The cross product of the accelerometer reading in the earth frame with gravity minus the change of velocity is the
    error; transformed to the body frame, it is fed to the controller without a change of sign.
    """
    tilted = np.asarray(Rotation.from_rotvec([0.0, math.radians(TILTED_DEG), 0.0]).as_matrix())
    motions: dict[str, Motion] = {
        "at rest": Rest(),
        "in a turn": SteadyTurn(math.radians(BANK_DEG)),
        "in a surge": StraightLevel(surge_m_s2=2.5),
    }
    logs = {where: seen(motion, 30.0) for where, motion in motions.items()}
    printed, exchanged = (
        {
            where: tilt_deg(note(log.measured, tilted @ log.truth["R_eb"][0], order=order), log)
            for where, log in logs.items()
        }
        for order in (1.0, -1.0)
    )

    panels = []
    for title, tilts in (("Eqn 4 as printed", printed), ("Factors exchanged", exchanged)):
        panels.append(Panel(title, "inclination error, deg"))
        panels[-1].curves(logs["at rest"].truth["t_s"], tilts, (BLUE, GREEN, ORANGE))
    return Finding(
        lines=[
            *(line(f"{where}: error after 30 s", "deg", tilt[-1], "<=", 0.5) for where, tilt in printed.items()),
            line("at rest, factors exchanged: error after 30 s", "deg", exchanged["at rest"][-1], ">=", 90.0),
        ],
        summary=f"An inclination error of {TILTED_DEG:.0f} degrees falls in 30 s to {printed['at rest'][-1]:.3f} "
        f"degrees at rest and {printed['in a turn'][-1]:.2f} in a turn at {BANK_DEG:.0f} degrees of bank. With the "
        f"factors exchanged it grows to {exchanged['at rest'][-1]:.0f}: unlike in Eqn 27 of the paper of 2009, the "
        "order is right.",
        panels=panels,
    )


@claim(Paper.ROLL_PITCH, "Solution, below Eqn 3")
def yaw_from_acceleration() -> Finding:
    """Lateral acceleration reveals yaw drift.

    The method detects drift of yaw as well as of roll and pitch, if the aircraft accelerates laterally.
    """
    turned = np.asarray(Rotation.from_rotvec([0.0, 0.0, math.radians(TURNED_DEG)]).as_matrix())
    errors: dict[float, Array] = {}
    for bank in (0.0, 20.0, BANK_DEG, 50.0):
        log = seen(SteadyTurn(math.radians(bank)), 60.0)
        R = note(log.measured, turned @ log.truth["R_eb"][0])
        errors[bank] = np.degrees(np.abs(heading_error_rad(R, log.truth["R_eb"])))
    straight, turning = float(errors[0.0][-1]), float(errors[BANK_DEG][-1])

    panel = Panel("A heading error of 30 degrees vanishes in turns", "heading error, deg", columns=4, ylim=(0.0, 38.0))
    shown = {f"{bank:.0f}° of bank" if bank else "straight flight": error for bank, error in errors.items()}
    panel.curves(log.truth["t_s"], shown, (FAINT, ORANGE, BLUE, GREEN))
    return Finding(
        lines=[
            line("heading error after 60 s of turning", "deg", turning, "<=", 3.0),
            line("heading error after 60 s of straight flight", "deg", straight, ">=", 0.9 * TURNED_DEG),
        ],
        summary=f"A heading error of {TURNED_DEG:.0f} degrees falls to {turning:.1f} degrees in a minute of turning at "
        f"{BANK_DEG:.0f} degrees of bank, and to {errors[20.0][-1]:.0f} at 20 degrees of bank. In straight flight "
        f"{straight:.0f} of the {TURNED_DEG:.0f} degrees are left, because there is no lateral acceleration.",
        panels=[panel],
    )


def _errors_deg(seeds: Sequence[int], suite: str, hz: int) -> tuple[float, float]:
    """Inclination error RMS in two turns in turbulence, summed between reports and sampled at the report."""
    changes = {
        "suite": suite, "rates.gps_hz": hz, "sensors.gps.filter_s": 0.0, "sensors.gps.latency_s": 0.0,
        "duration_s": 80.0
    }  # fmt: skip
    logs = [flight.log for flight in flights("turns_180", seeds, changes, "sim.oracle:Oracle")]

    def error_deg(summed: bool) -> float:
        tilts = [tilt_deg(note(_calibrated(log), log.truth["R_eb"][0], summed=summed), log)[1000:] for log in logs]
        return rms(np.concatenate(tilts))

    return error_deg(True), error_deg(False)


def _calibrated(log: Log) -> NDArray[np.void]:
    """Measurements without the gyro offset at the start."""
    rows = log.measured.copy()
    rows["gyro_b_rad_s"] -= log.truth["gyro_bias_b_rad_s"][0]
    return rows


@claim(Paper.ROLL_PITCH, "Solution, above Eqn 3", seeds=2)
def summed_between_reports(seeds: Sequence[int]) -> Finding:
    """Summing between reports is more accurate.

    Both sides are best integrated from one GPS report to the next: velocity is then used instead of acceleration, which
    is more accurate.
    """
    rates_hz = (1, 4, 10)
    clean, cheap = (np.array([_errors_deg(seeds, suite, hz) for hz in rates_hz]) for suite in ("ideal", "generic"))
    at_1_hz, at_4_hz, cheap_at_4_hz = clean[0], clean[1], cheap[1]

    panels = []
    for title, tilts in (("Perfect sensors", clean), ("Cheap gyros and accelerometers", cheap)):
        panel = Panel(title, "inclination error RMS, deg", "GPS rate, Hz", log="x", xticks=rates_hz, ylim=(0.0, None))
        shown = {"sampled at the report": tilts[:, 1], "summed between reports": tilts[:, 0]}
        panel.curves(rates_hz, shown, (RED, BLUE), "o-")
        panels.append(panel)
    return Finding(
        lines=[
            line("4 Hz: error, summed over sampled", "", at_4_hz[0] / at_4_hz[1], "<=", 0.5),
            line("1 Hz: error, summed over sampled", "", at_1_hz[0] / at_1_hz[1], "<=", 0.5),
            line("4 Hz, cheap sensors: error, summed over sampled", "", cheap_at_4_hz[0] / cheap_at_4_hz[1], "<=", 1.0),
        ],
        summary=f"In two turns in turbulence with perfect sensors and GPS at 4 Hz, the inclination error is "
        f"{at_4_hz[0]:.2f} degrees with sums and {at_4_hz[1]:.2f} with samples; at 1 Hz {at_1_hz[0]:.2f} and "
        f"{at_1_hz[1]:.1f}. With cheap sensors, whose own errors dominate, it is {cheap_at_4_hz[0]:.2f} and "
        f"{cheap_at_4_hz[1]:.2f} at 4 Hz.",
        panels=panels,
    )
