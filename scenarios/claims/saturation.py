"""Saturation: what gyros and accelerometers lose at the end of their range, and how long it stays."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.baselines import GyroOnly
from estimator.interface import MEASURED_DTYPE
from estimator.premerlani import Premerlani
from scenarios.claims._open_loop import (
    IMU_HZ,
    LAGGED,
    begin,
    inclination_deg,
    printed,
    sensed,
)
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.flights import flights
from scenarios.harness.claims.picture import BLUE, FAINT, GREEN, ORANGE, RED, axes, label
from scenarios.harness.metrics import inclination_error_deg, settled_after_s
from scenarios.harness.metrics.manoeuvres import loops_end_s
from sim.log import Flight
from sim.motion.prescribed_plant import SteadyTurn

RANGE_DEG_S, PEAK_DEG_S, PULSE_S = 100.0, 160.0, 2.0


def _area_not_seen(_seeds: Sequence[int]) -> Finding:
    t_s = (np.arange(round(PULSE_S * IMU_HZ)) + 0.5) / IMU_HZ
    peaks = np.linspace(60.0, 240.0, 19)  # beyond, half a turn is lost
    rows = np.zeros((len(t_s),), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = t_s + 0.5 / IMU_HZ, 1.0 / IMU_HZ
    rows["force_b_m_s2"] = (0.0, 0.0, -9.8)

    def error_deg(peak: float) -> float:
        """Of the gyros alone after a pulse of pitch rate, a half sine that is clipped."""
        rate = np.minimum(peak * np.sin(np.pi * t_s / PULSE_S), RANGE_DEG_S)
        rows["gyro_b_rad_s"][:, 1] = np.radians(rate)
        R_eb = begin(GyroOnly(), np.eye(3)).replay(rows)["R_eb"][-1]
        true_rad = math.radians(2.0 * peak * PULSE_S / np.pi)
        pitched_rad = math.atan2(-R_eb[2, 0], R_eb[0, 0])
        return math.degrees(abs((true_rad - pitched_rad + np.pi) % (2.0 * np.pi) - np.pi))

    def area_deg(peak: float) -> float:
        """Between the half sine and the end of the range, in closed form."""
        if peak <= RANGE_DEG_S:
            return 0.0
        clips = math.asin(RANGE_DEG_S / peak)  # phase at which it begins to clip
        return PULSE_S / np.pi * (2.0 * peak * math.cos(clips) - RANGE_DEG_S * (np.pi - 2.0 * clips))

    measured, areas = (np.array([f(peak) for peak in peaks]) for f in (error_deg, area_deg))
    apart = float(np.abs(measured - areas).max())

    def draw(figure: Figure) -> None:
        pulse, angle = axes(figure, "A pitch rate beyond the range of the gyro", "The angle that is lost is the area")
        fine = np.linspace(0.0, PULSE_S, 200)
        true = PEAK_DEG_S * np.sin(np.pi * fine / PULSE_S)
        pulse.plot(fine, true, color=BLUE, label="true rate")
        pulse.plot(fine, np.minimum(true, RANGE_DEG_S), color=ORANGE, label="what the gyro says")
        pulse.fill_between(fine, np.minimum(true, RANGE_DEG_S), true, color=RED, alpha=0.18, lw=0)
        pulse.annotate(f"{area_deg(PEAK_DEG_S):.0f} deg", (0.84, 120.0), color=RED)
        pulse.legend(loc="lower center")
        label(pulse, "time, s", "pitch rate, deg/s")
        angle.plot(peaks, areas, color=FAINT, ls="--", label="area between the two")
        angle.plot(peaks, measured, "o", ms=4, color=BLUE, label="error of the matrix")
        angle.legend()
        label(angle, "peak of the rate, deg/s", "angle, deg")

    return Finding(
        stands=(line("angle lost against area, apart at most", "deg", apart, "<=", 1.0),),
        told=f"A pulse of two seconds with a peak of {PEAK_DEG_S:.0f} deg/s on a gyro that ends at {RANGE_DEG_S:.0f} "
        f"leaves {error_deg(PEAK_DEG_S):.1f} degrees; the area is {area_deg(PEAK_DEG_S):.1f}. From 60 to 240 deg/s the "
        f"two are never more than {apart:.2f} degrees apart.",
        seeds=0,
        draw=draw,
    )


LOOPED = loops_end_s(3)
ERASED_DEG, IN_ORDER_OF_S = 10.0, 15.0
NO_GATE = {"estimator_params.launch_gate": math.inf}  # the paper has none


def _after_the_loops(flight: Flight) -> Any:
    """Inclination error from the end of the third loop on, for 40 s."""
    looped_s = LOOPED(flight)
    return inclination_error_deg(flight).within(looped_s, looped_s + 40.0)


def _saturation_erased(seeds: Sequence[int]) -> Finding:
    flown = {
        "a weight of 0.3": flights("gyro_saturation", seeds, NO_GATE),
        "a fifth of the weight": flights("gyro_saturation", seeds, {**NO_GATE, "estimator_params.w_rp": 0.06}),
    }
    errors = {how: [_after_the_loops(flight) for flight in these] for how, these in flown.items()}
    erased = {how: [settled_after_s(series, ERASED_DEG) for series in these] for how, these in errors.items()}
    left = float(np.mean([series.value[: 2 * IMU_HZ].max() for series in errors["a weight of 0.3"]]))
    mean_s, slowest_s = float(np.mean(erased["a weight of 0.3"])), float(np.max(erased["a weight of 0.3"]))
    slack = [t for t in erased["a fifth of the weight"] if math.isfinite(t)]

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "Three loops beyond the range of the gyros, and what comes after")
        for how, colour in (("a fifth of the weight", FAINT), ("a weight of 0.3", BLUE)):
            for i, series in enumerate(errors[how]):
                since = series.t_s - series.t_s[0]
                ax.plot(since, series.value, color=colour, lw=1.3, label=how if i == 0 else None)
        ax.axhline(ERASED_DEG, color=RED, ls="--", lw=1, label="counts as erased")
        ax.legend()
        ax.set_ylim(0.0, None)
        label(ax, "time after the third loop, s", "inclination error, deg")

    return Finding(
        stands=(
            line("error left by the loops, mean", "deg", left, ">=", 2.0 * ERASED_DEG),
            line("below 10 deg for good, mean", "s", mean_s, "<=", IN_ORDER_OF_S),
            line("below 10 deg for good, slowest", "s", slowest_s, "<=", 2.0 * IN_ORDER_OF_S),
        ),
        told=f"Gyros that end at 100 deg/s in loops at 110 deg/s and more leave {left:.0f} degrees. With a weight of "
        f"0.3 they are gone after {mean_s:.0f} s in the mean; with a fifth of it {len(slack)} of {len(seeds)} flights "
        "come below 10 degrees for good within 40 s.",
        seeds=len(seeds),
        draw=draw,
    )


RANGES_G = (3.0, 6.0)
BANKS_DEG = (30.0, 45.0, 60.0, 65.0, 70.0, 72.5, 75.0)
TURNING_S, SPEED_M_S = 60.0, 18.0


def _turn_error_deg(bank_deg: float, range_g: float, find_clip: bool = False) -> float:
    """Inclination error after a minute of a steady turn, in which the accelerometers end at `range_g`."""
    turn = SteadyTurn(math.radians(bank_deg), SPEED_M_S)
    log = sensed(turn, TURNING_S, changes={**LAGGED, "accelerometer.range_g": range_g})
    out = begin(Premerlani(printed(find_clip=find_clip)), log.truth["R_eb"][0]).replay(log.measured)
    return float(inclination_deg(out["R_eb"], log)[-1])


def _saturation(_seeds: Sequence[int]) -> Finding:
    narrow, wide = ([_turn_error_deg(bank, range_g) for bank in BANKS_DEG] for range_g in RANGES_G)
    found = [_turn_error_deg(bank, RANGES_G[0], find_clip=True) for bank in BANKS_DEG]
    clips_deg = math.degrees(math.acos(1.0 / RANGES_G[0]))
    tight = BANKS_DEG.index(75.0)

    def draw(figure: Figure) -> None:
        (ax,) = axes(figure, "A minute of steady turning: inclination error by bank")
        ax.plot(BANKS_DEG, narrow, "o-", color=ORANGE, label="accelerometers of 3 g")
        ax.plot(BANKS_DEG, wide, "o-", color=BLUE, label="of 6 g")
        ax.plot(BANKS_DEG, found, "--", color=GREEN, label="of 3 g, with clipped readings left aside")
        ax.axvline(clips_deg, color=RED, ls="--", lw=1)
        ax.annotate("3 g are felt", (clips_deg - 0.6, 0.6), xycoords=("data", "axes fraction"), color=RED, ha="right")
        ax.legend(loc="upper left")
        label(ax, "bank, deg", "inclination error, deg")

    return Finding(
        stands=(
            line("75 deg of bank, 3.9 g felt with 3 g of range", "deg", narrow[tight], ">=", 5.0),
            line("the same with 6 g of range", "deg", wide[tight], "<=", 2.0),
        ),
        told=f"At 75 degrees of bank, 3.9 g, accelerometers that end at 3 g leave {narrow[tight]:.1f} degrees of "
        f"inclination error after a minute, those of 6 g {wide[tight]:.1f}. Where clipped readings are found out and "
        f"left aside it is {found[tight]:.1f}.",
        seeds=0,
        draw=draw,
    )


CHARACTERISTICS = "Gyro characteristics"
CLAIMS = (
    Claim(
        name="saturated_accelerometer",
        title="Saturated accelerometers spoil roll and pitch",
        paper=Paper.THEORY,
        place="Accelerometers, last paragraph",
        says="In very tight, continuous turns the accelerometers may saturate, and error gets into the roll-pitch "
        "estimate.",
        expected=Verdict.CONFIRMED,
        measure=_saturation,
        seeds=0,
    ),
    Claim(
        name="area_not_seen",
        title="A saturated gyro loses the area it did not see",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Saturation",
        says="A gyro beyond its range leaves an angular error equal to the area between the actual rate and the "
        "saturated one.",
        expected=Verdict.CONFIRMED,
        measure=_area_not_seen,
        seeds=0,
    ),
    Claim(
        name="saturation_erased",
        title="Feedback erases what saturation left in about 10 s",
        paper=Paper.THEORY,
        place=f"{CHARACTERISTICS}, Saturation",
        says="The simplest way with saturation are feedback gains large enough to erase the error in a reasonable "
        "time, of the order of 10 seconds.",
        expected=Verdict.CONFIRMED,
        measure=_saturation_erased,
        seeds=5,
    ),
)
