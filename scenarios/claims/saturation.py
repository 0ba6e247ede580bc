"""Saturation: the errors of gyros and accelerometers beyond their range, and how long they last."""

import math
from collections.abc import Sequence

import numpy as np

from estimator.baselines import GyroOnly
from estimator.interface import MEASURED_DTYPE
from estimator.premerlani import Premerlani
from scenarios.harness.claims.claim import Finding, Paper, claim, line
from scenarios.harness.claims.flights import flights, tuned
from scenarios.harness.claims.motions import IMU_HZ, LAGGED, NEVER, begin, printed, sensed, tilt_deg
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, Panel
from scenarios.harness.metrics import Series, inclination_error_deg, settled_after_s
from scenarios.harness.metrics.manoeuvres import loops_end_s
from sim.log import Flight
from sim.motion.prescribed_plant import SteadyTurn

RANGES_G = (3.0, 6.0)
BANKS_DEG = (30.0, 45.0, 60.0, 65.0, 70.0, 72.5, 75.0)


def _turn_error_deg(bank_deg: float, range_g: float, find_clip: bool = False) -> float:
    """Inclination error after a minute of steady turning with accelerometers of that range."""
    log = sensed(SteadyTurn(math.radians(bank_deg), 18.0), 60.0, changes={**LAGGED, "accelerometer.range_g": range_g})
    out = begin(Premerlani(printed(find_clip=find_clip)), log.truth["R_eb"][0]).replay(log.measured)
    return float(tilt_deg(out["R_eb"], log)[-1])


@claim(Paper.THEORY, "Accelerometers, last paragraph")
def saturated_accelerometer() -> Finding:
    """Saturated accelerometers cause roll and pitch errors.

    In very tight, continuous turns the accelerometers may saturate, which causes an error of the roll-pitch estimate.
    """
    narrow, wide = ([_turn_error_deg(bank, range_g) for bank in BANKS_DEG] for range_g in RANGES_G)
    found = [_turn_error_deg(bank, RANGES_G[0], find_clip=True) for bank in BANKS_DEG]
    clips_deg = math.degrees(math.acos(1.0 / RANGES_G[0]))
    tight = BANKS_DEG.index(75.0)

    panel = Panel("Inclination error after a minute of steady turning", "inclination error, deg", "bank, deg")
    panel.curve(BANKS_DEG, narrow, ORANGE, "range of 3 g", "o-")
    panel.curve(BANKS_DEG, wide, BLUE, "range of 6 g", "o-")
    panel.curve(BANKS_DEG, found, GREEN, "range of 3 g, clipped readings ignored", "--")
    panel.upright(clips_deg, RED)
    panel.note("load factor 3", clips_deg - 0.6, 0.6, RED, ha="right", fraction="y")
    return Finding(
        lines=[
            line("75 deg of bank (3.9 g), range of 3 g", "deg", narrow[tight], ">=", 5.0),
            line("75 deg of bank (3.9 g), range of 6 g", "deg", wide[tight], "<=", 2.0),
        ],
        summary=f"At 75 degrees of bank (3.9 g), the inclination error after a minute is {narrow[tight]:.1f} degrees "
        f"with accelerometers of 3 g and {wide[tight]:.1f} with 6 g. If clipped readings are detected and ignored, it "
        f"is {found[tight]:.1f} with 3 g.",
        panels=[panel],
    )


RANGE_DEG_S, PEAK_DEG_S, PULSE_S = 100.0, 160.0, 2.0


def _pulse_error_deg(peak: float) -> float:
    """Error of the gyros alone after a pulse of pitch rate, a half sine that is clipped."""
    t_s = (np.arange(round(PULSE_S * IMU_HZ)) + 0.5) / IMU_HZ
    rows = np.zeros((len(t_s),), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t_s + 0.5 / IMU_HZ, 1.0 / IMU_HZ
    rows["force_b_m_s2"] = (0.0, 0.0, -9.8)
    rows["gyro_b_rad_s"][:, 1] = np.radians(np.minimum(peak * np.sin(np.pi * t_s / PULSE_S), RANGE_DEG_S))
    R_eb = begin(GyroOnly(), np.eye(3)).replay(rows)["R_eb"][-1]
    true_rad = math.radians(2.0 * peak * PULSE_S / np.pi)
    pitched_rad = math.atan2(-R_eb[2, 0], R_eb[0, 0])
    return math.degrees(abs((true_rad - pitched_rad + np.pi) % (2.0 * np.pi) - np.pi))


def _area_deg(peak: float) -> float:
    """Area between the half sine and the range of the gyro, in closed form."""
    if peak <= RANGE_DEG_S:
        return 0.0
    clips = math.asin(RANGE_DEG_S / peak)  # phase at which it begins to clip
    return PULSE_S / np.pi * (2.0 * peak * math.cos(clips) - RANGE_DEG_S * (np.pi - 2.0 * clips))


@claim(Paper.THEORY, "Gyro characteristics, Saturation")
def area_not_seen() -> Finding:
    """A saturated gyro loses the area beyond its range.

    A gyro beyond its range leaves an angular error equal to the area between the actual rate and the saturated one.
    """
    peaks = np.linspace(60.0, 240.0, 19)  # beyond, the lost angle exceeds 180 degrees
    measured, areas = (np.array([of(peak) for peak in peaks]) for of in (_pulse_error_deg, _area_deg))
    apart = float(np.abs(measured - areas).max())

    pulse = Panel("Pitch rate beyond the range of the gyro", "pitch rate, deg/s", legend="lower center")
    fine = np.linspace(0.0, PULSE_S, 200)
    true = PEAK_DEG_S * np.sin(np.pi * fine / PULSE_S)
    clipped = np.minimum(true, RANGE_DEG_S)
    pulse.curves(fine, {"true rate": true, "gyro reading": clipped}, (BLUE, ORANGE))
    pulse.between(fine, clipped, true, RED, alpha=0.18)
    pulse.note(f"{_area_deg(PEAK_DEG_S):.0f} deg", 0.84, 120.0, RED)
    angle = Panel("The lost angle is the area", "angle, deg", "peak of the rate, deg/s")
    angle.curve(peaks, areas, FAINT, "area between the two", "--")
    angle.curve(peaks, measured, BLUE, "error of the matrix", "o", ms=4)
    return Finding(
        lines=[line("lost angle minus area, at most", "deg", apart, "<=", 1.0)],
        summary=f"A pulse of two seconds with a peak of {PEAK_DEG_S:.0f} deg/s on a gyro with a range of "
        f"{RANGE_DEG_S:.0f} leaves an error of {_pulse_error_deg(PEAK_DEG_S):.1f} degrees; the area is "
        f"{_area_deg(PEAK_DEG_S):.1f}. From 60 to 240 deg/s the two differ by at most {apart:.2f} degrees.",
        panels=[pulse, angle],
    )


LOOPED = loops_end_s(3)
ERASED_DEG, IN_ORDER_OF_S = 10.0, 15.0


def _after_the_loops(flight: Flight) -> Series:
    """Inclination error in the 40 s after the third loop."""
    looped_s = LOOPED(flight)
    return inclination_error_deg(flight).within(looped_s, looped_s + 40.0)


@claim(Paper.THEORY, "Gyro characteristics, Saturation", seeds=5)
def saturation_erased(seeds: Sequence[int]) -> Finding:
    """Feedback removes the error of saturation in about 10 s.

    The simplest way to handle saturation is to make the feedback gains large enough to remove the error in a reasonable
    time, of the order of 10 seconds.
    """
    series = {
        w: [_after_the_loops(f) for f in flights("gyro_saturation", seeds, tuned(launch_gate=NEVER, w_rp=w))]
        for w in (0.06, 0.3)
    }
    erased = {w: [settled_after_s(one, ERASED_DEG) for one in these] for w, these in series.items()}
    left = float(np.mean([one.value[: 2 * IMU_HZ].max() for one in series[0.3]]))
    mean_s, slowest_s = float(np.mean(erased[0.3])), float(np.max(erased[0.3]))
    slack = sum(math.isfinite(t) for t in erased[0.06])

    panel = Panel("After three loops beyond the gyro range", "inclination error, deg", "time after the third loop, s")
    for w, colour in ((0.06, FAINT), (0.3, BLUE)):
        panel.traces([(one.t_s - one.t_s[0], one.value) for one in series[w]], colour, f"a weight of {w:g}", lw=1.3)
    panel.level(ERASED_DEG, RED, label="counts as removed")
    return Finding(
        lines=[
            line("error after the loops, mean", "deg", left, ">=", 2.0 * ERASED_DEG),
            line("time to stay below 10 deg, mean", "s", mean_s, "<=", IN_ORDER_OF_S),
            line("time to stay below 10 deg, longest", "s", slowest_s, "<=", 2.0 * IN_ORDER_OF_S),
        ],
        summary=f"Gyros with a range of 100 deg/s have an error of {left:.0f} degrees after loops at 110 deg/s and "
        f"more. With a weight of 0.3 it is removed after {mean_s:.0f} s on average; with a fifth of that "
        f"weight, {slack} of {len(seeds)} flights are below 10 degrees within 40 s.",
        panels=[panel],
    )
