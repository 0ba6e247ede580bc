"""Van Zundert's description of AP_AHRS_DCM: how close an implementation of it comes to the original.

The original of July 2013 is `estimator.ap_dcm` with all its quirks, which agrees with the output of the firmware within
0.02 degrees (the project's reference vectors).  "Set" and "added" refer to the integral of section 3.2.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from estimator.ap_dcm import ApDcm, spin_gain
from estimator.blocks.kernels import wrap
from estimator.interface import Array, Measurements
from estimator.params.ap_dcm import JULY_2013, ApDcmParams, Quirk
from estimator.rotation import propagate, renormalise, renormalise_exactly, to_euler
from scenarios.harness.claims.claim import Finding, Paper, Verdict, claim, line
from scenarios.harness.claims.flights import clean_log
from scenarios.harness.claims.motions import DECLINATION_RAD, felt_at_rest, seen, tilt_deg
from scenarios.harness.claims.picture import BLUE, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import highest, rms
from sim.clock import Rates
from sim.log import Log
from sim.motion.prescribed_plant import HandHeld, Motion, Rest

OFFSET_DEG_S = (0.8, -0.6, 0.5)  # of the gyros on the bench
BY_HAND = HandHeld(math.radians(50.0), ((0.035, 0.08), (0.05, 0.09), (0.03, 0.07)))  # up to 90 degrees of tilt
SPIN_LIMIT_RAD_S, LEARN_S, TARGET_DEG = math.radians(20.0), 5.0 + 1e-5, 0.5


def bench(motion: Motion, duration_s: float, imu_hz: int) -> Log:
    """Perfect sensors except for the gyro offset, without GPS."""
    log = seen(motion, duration_s, rates=Rates(imu_hz=imu_hz))
    rows = log.measured.copy()
    rows["gps_new"] = 0
    rows["gyro_b_rad_s"] += np.radians(OFFSET_DEG_S)
    return Log(log.truth, rows, log.flown)


def original(quirks: frozenset[Quirk] = JULY_2013, *, flying: bool = False, compass: bool = True) -> ApDcm:
    """The code of July 2013, or with fewer quirks; not flying: as for a copter."""
    params = ApDcmParams(quirks, declination_rad=DECLINATION_RAD, fly_forward=flying, use_magnetometer=compass)
    return ApDcm(params)


def as_reported(rows: NDArray[np.void], *, set_integral: bool = True, earth_frame: bool = True) -> Array:
    """Attitudes, shape (n, 3, 3), by the original with the integral of the report's section 3 instead of its own.

    set_integral : the integral is set to the saturated sum, as in the report; False: it is added, as in the code
    earth_frame : the error is integrated in the earth frame, Eqn 3.12 as printed; False: in the body frame
    """
    estimator = original()
    p = estimator.params
    integral, total, total_s = np.zeros(3), np.zeros(3), 0.0
    attitudes = np.empty((len(rows), 3, 3))
    before = estimator.snapshot()
    for k in range(len(rows)):
        attitudes[k] = estimator.update(Measurements(rows, k)).R_eb
        after = estimator.snapshot()
        old, new = before[0], after[0]
        slow = new["spin_rad_s"] < SPIN_LIMIT_RAD_S
        if slow and new["compass_yaw_s"] > old["compass_yaw_s"] > 0.0:
            since_s = new["compass_yaw_s"] - old["compass_yaw_s"]
            total[2] += p.ki_yaw * since_s * new["omega_yaw_p"] / p.kp_yaw  # Eqns 3.4 and 3.5
        if slow and old["begun"] and new["interval_s"] == 0.0:  # a correction was made
            interval_s = old["interval_s"] + new["dt_s"]
            error = new["R_eb"] @ new["error_b"] if earth_frame else new["error_b"]
            total += p.ki * interval_s * error  # Eqn 3.12
            total_s += interval_s
            if total_s >= LEARN_S:
                limit = p.gyro_drift_rad_s2 * total_s
                integral = np.clip(total, -limit, limit) + (0.0 if set_integral else integral)
                total, total_s = np.zeros(3), 0.0
        new["omega_i_b"] = integral
        estimator.restore(after)
        before = after
    return attitudes


def apart_deg(R_eb: Array, other_R_eb: Array) -> Array:
    """Largest difference of the three Euler angles at each time, the report's measure; NaN near vertical pitch."""
    angles, others = np.array(to_euler(R_eb)), np.array(to_euler(other_R_eb))
    largest = np.degrees(np.max(np.abs(wrap(angles - others)), axis=0))
    return np.where(np.abs(others[1]) < math.radians(85.0), largest, np.nan)


@claim(Paper.VAN_ZUNDERT, "Chapter 1, research problem, and Chapter 5", expected=Verdict.WITH_CONDITION)
def van_zundert_half_degree() -> Finding:
    """The implementation agrees with the original within half a degree.

    The aim is an implementation within half a degree of the original in every Euler angle; the result comes close but
    misses it, perhaps because a function is not implemented correctly.
    """
    log = bench(BY_HAND, 120.0, 100)
    true = original().replay(log.measured)["R_eb"]
    readings = {
        "as reported": {},
        "integral added, not set": {"set_integral": False},
        "error in the body frame": {"earth_frame": False},
        "both corrected": {"set_integral": False, "earth_frame": False},
    }
    apart = {name: apart_deg(as_reported(log.measured, **reading), true) for name, reading in readings.items()}
    reported, added, body_frame, both = (float(np.nanmax(angle)) for angle in apart.values())

    panel = Panel("Turned by hand: difference from the original", "largest Euler difference, deg")
    panel.curves(log.truth["t_s"], apart, (RED, ORANGE, BLUE, GREEN), lw=1.5)
    panel.level(TARGET_DEG, text="target")
    return Finding(
        lines=[line("as reported: largest Euler difference", "deg", reported, "<=", TARGET_DEG)],
        condition="if the integral is added and the error is integrated in the body frame, as in the code",
        conditional_lines=[line("both corrected: largest Euler difference", "deg", both, "<=", TARGET_DEG)],
        summary=f"Implemented as reported, the algorithm differs from the original by up to {reported:.1f} degrees in "
        f"two minutes of turning by hand, so it misses the target, as he found. The code adds the saturated sum to the "
        f"integral, where the report sets it, and integrates in the body frame, where Eqn 3.12 uses the earth frame. "
        f"Either alone costs {body_frame:.1f} and {added:.1f} degrees; with both corrected it is the original.",
        panels=[panel],
    )


def _tilt_of_offset_deg() -> float:
    """Inclination at which k_P times its sine equals the gyro offset that an integral at its limit leaves."""
    p = ApDcmParams()
    left = [math.radians(abs(offset)) - p.gyro_drift_rad_s2 * 5.0 for offset in OFFSET_DEG_S[:2]]
    return math.degrees(math.asin(math.hypot(*left) / p.kp))


@claim(Paper.VAN_ZUNDERT, "Section 1.1, and 3.2 below Eqn 3.12", expected=Verdict.WITH_CONDITION)
def van_zundert_offset() -> Finding:
    """Proportional and integral feedback remove the gyro offset.

    Errors from gyro offset are fed back by a proportional and integral controller; the integral is set equal to its
    sum, limited to the possible drift of the gyro in the meantime.
    """
    log = bench(Rest(), 600.0, 50)
    tilts = {
        name: tilt_deg(as_reported(log.measured, set_integral=way), log)
        for name, way in (("integral set, as reported", True), ("integral added, as in the code", False))
    }
    set_to, added = (float(tilt[-1]) for tilt in tilts.values())

    panel = Panel("At rest with gyro offsets of 0.8 and 0.6 deg/s", "inclination error, deg", "time, minutes")
    panel.curves(log.truth["t_s"] / 60.0, tilts, (RED, BLUE))
    return Finding(
        lines=[line("integral set: error after 10 minutes at rest", "deg", set_to, "<=", 0.5)],
        condition="if the saturated sum is added to the integral, as in the code",
        conditional_lines=[line("integral added: error after 10 minutes at rest", "deg", added, "<=", 0.5)],
        summary=f"Set to its saturated sum, the integral never exceeds 0.04 deg/s: gyro offsets of 0.8 and 0.6 deg/s "
        f"in roll and pitch cause a constant inclination error of {set_to:.1f} degrees ({_tilt_of_offset_deg():.1f} in "
        f"closed form: the rest of the offset over k_P). If the sum is added every 5 s, as in the code, the error "
        f"after 10 minutes is {added:.2f}.",
        panels=[panel],
    )


def _gain_at(spin_deg_s: float, quirks: frozenset[Quirk]) -> float:
    state = original(quirks).snapshot()
    state["spin_rad_s"] = math.radians(spin_deg_s)
    return float(spin_gain(state[0]))


def _flown_tilts_deg(log: Log, quirks: frozenset[Quirk], settled: int, **settings: bool) -> Array:
    """Inclination errors of an aeroplane's estimator over the log of a flight, after `settled` ticks."""
    return tilt_deg(original(quirks, flying=True, **settings).replay(log.measured)["R_eb"], log)[settled:]


@claim(Paper.VAN_ZUNDERT, "Section 3.1.2, below Eqn 3.4")
def van_zundert_spin_gain() -> Finding:
    """The gain that should increase with rotation is always one.

    The gain compares a rate in rad/s with limits that were converted from degrees the wrong way, by mistake.
    """
    spins = np.linspace(0.0, 600.0, 61)
    corrected = frozenset(JULY_2013 - {Quirk.STUCK_P_GAIN})
    ways = {"units corrected": corrected, "code of July 2013": JULY_2013}
    gains = {name: [_gain_at(spin, quirks) for spin in spins] for name, quirks in ways.items()}
    right, old = (of[50] for of in gains.values())
    log = clean_log("loops")
    tilt_corrected, tilt_old = (rms(_flown_tilts_deg(log, quirks, 500)) for quirks in ways.values())

    panel = Panel("Increase of the feedback gain with rotation", "factor", "rate of rotation, deg/s", ylim=(0.0, 11.0))
    panel.curves(spins, gains, (BLUE, RED))
    return Finding(
        lines=[
            line("code of July 2013: gain at 500 deg/s", "", old, "<=", 1.0),
            line("units corrected: gain at 500 deg/s", "", right, ">=", 10.0),
        ],
        summary=f"At 500 deg/s the gain of the code is {old:.0f} and should be {right:.0f}; it would increase only "
        f"beyond 2800 rad/s. Correcting this does not help in flight: in three loops with perfect sensors the "
        f"inclination error is {tilt_old:.1f} degrees with the mistake and {tilt_corrected:.1f} without.",
        panels=[panel],
    )


def _left_over(rate_deg_s: float, way: Callable[[Array], object]) -> tuple[float, float]:
    """Largest error of a row's length and largest cosine between two rows, in 10 s of turning about a tilted axis."""
    omega_b = math.radians(rate_deg_s) * np.ones(3) / math.sqrt(3.0)
    R, length, slant = np.eye(3), 0.0, 0.0
    for _ in range(500):
        propagate(R, omega_b, 0.02)
        way(R)
        length = max(length, float(np.abs(np.linalg.norm(R, axis=1) - 1.0).max()))
        slant = max(slant, float(np.abs(np.triu(R @ R.T, 1)).max()))
    return length, slant


@claim(Paper.VAN_ZUNDERT, "Section 2.2")
def van_zundert_normalisation() -> Finding:
    """The normalisation is exact.

    Each row is divided by its length, which is an exact normalisation, unlike the Taylor series of the paper of 2009.
    """
    rates = np.geomspace(10.0, 400.0, 17)  # beyond, the Taylor series fails
    ways = {"exact, Eqns 2.4 to 2.6": renormalise_exactly, "Taylor series of 2009, Eqns 19 to 21": renormalise}
    left = {name: np.array([_left_over(float(rate), way) for rate in rates]) for name, way in ways.items()}
    (length, slant), (taylor_length, taylor_slant) = (_left_over(300.0, way) for way in ways.values())

    panels = []
    for i, (title, y) in enumerate((("Length of the rows", "largest error"), ("Angle between rows", "largest cosine"))):
        panel = Panel(title, y, "rate of rotation, deg/s", log="xy", ylim=(1e-17, 1.0))
        shown = {name: np.maximum(values[:, i], 1e-16) for name, values in left.items()}
        panel.curves(rates, shown, (BLUE, ORANGE), "o-", ms=3, lw=1.5)
        panels.append(panel)
    return Finding(
        lines=[
            line("exact: error of a row's length at 300 deg/s", "", length, "<=", 1e-12),
            line("Taylor series: error of a row's length at 300 deg/s", "", taylor_length, ">=", 1e-12),
        ],
        summary=f"When turning at 300 deg/s with 50 steps per second, the error of the lengths of the rows is "
        f"{length:.0e}; with the Taylor series of 2009 it is {taylor_length:.0e}. Neither makes right angles exact: "
        f"the largest cosine is {slant:.0e} and {taylor_slant:.0e}, because half of the error is computed with rows "
        "that are not of unit length yet.",
        panels=panels,
    )


@claim(Paper.VAN_ZUNDERT, "Chapter 1, research problem", expected=Verdict.WITH_CONDITION)
def van_zundert_sensors_decide() -> Finding:
    """The quality depends on the sensors, not on the algorithm.

    Within half a degree of the original, the quality is determined by the accuracy of the sensors and not by the
    algorithm.
    """
    flown = {"three turns": clean_log("turns_180"), "three loops": clean_log("loops")}
    hand = seen(BY_HAND, 120.0)
    rows = hand.measured.copy()
    rows["gps_new"] = 0
    copter = original()
    copter.reset(felt_at_rest(hand.truth["R_eb"][0]))
    by_hand = highest(tilt_deg(copter.replay(rows)["R_eb"], hand)[1000:])
    july, none = (
        {name: _flown_tilts_deg(log, quirks, 1000, compass=False) for name, log in flown.items()}
        for quirks in (JULY_2013, frozenset[Quirk]())
    )
    in_hand = line("turned by hand: largest inclination error", "deg", by_hand, "<=", TARGET_DEG)

    panels = []
    for name, log in flown.items():
        panels.append(Panel(f"{name.capitalize()}, perfect sensors", "inclination error, deg"))
        shown = {"July 2013": july[name], "quirks corrected": none[name]}
        panels[-1].curves(log.truth["t_s"][1000:], shown, (RED, BLUE), lw=1.5)
    return Finding(
        lines=[
            in_hand,
            *(line(f"{n}: largest inclination error", "deg", highest(july[n]), "<=", TARGET_DEG) for n in flown),
        ],
        condition="if it is turned by hand, as on his bench, and not flown",
        conditional_lines=[in_hand],
        summary=f"With perfect sensors the inclination error of the original is at most {by_hand:.2f} degrees when "
        f"turned by hand, but {highest(july['three turns']):.1f} in turns of an aeroplane and "
        f"{highest(july['three loops']):.0f} in loops: there the algorithm decides, not the sensors. With its quirks "
        f"corrected it is {highest(none['three turns']):.1f} and {highest(none['three loops']):.1f}.",
        panels=panels,
    )
