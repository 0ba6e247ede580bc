"""The plots of a flight: angles, errors and signals from the log, in convenient units.

Colours have the same meaning everywhere: orange truth, blue estimate and command, green sensor (blue-green air data),
grey demand.
"""

from typing import Any, NamedTuple

import numpy as np

from estimator.blocks.kernels import wrap
from estimator.interface import Array, HeadingReference, Health
from estimator.rotation import heading_rad, inclination_error_rad, rotation_error_rad, to_euler
from sim.log import Log

Colour = tuple[int, int, int]
Range = tuple[float, float]
TRUTH: Colour = (255, 150, 30)
ESTIMATE: Colour = (60, 160, 255)
SENSOR: Colour = (110, 200, 130)
AIR_DATA: Colour = (70, 150, 190)
DEMAND: Colour = (150, 150, 160)
_INCLINATION: Colour = (240, 90, 150)
_HEADING: Colour = (170, 130, 255)
_COURSE: Colour = (255, 215, 130)

_STEEPEST_R_ZX, _SLOWEST_M_S = 0.9, 3.0  # limits of a meaningful heading, as in the metrics


class Curve(NamedTuple):
    """One line of a plot."""

    name: str
    colour: Colour


class Plot(NamedTuple):
    """One plot: path of its data, title and lines."""

    path: str
    title: str
    curves: tuple[Curve, ...]


_TRUE, _ESTIMATED, _DEMANDED = Curve("truth", TRUTH), Curve("estimate", ESTIMATE), Curve("demand", DEMAND)
_SENSED = Curve("sensor", SENSOR)
_HEADINGS = (Curve("true course", _COURSE), Curve("true nose", TRUTH), _ESTIMATED)
_ERRORS = (Curve("total", DEMAND), Curve("heading", _HEADING), Curve("inclination", _INCLINATION))
_HEIGHTS = (Curve("GPS", SENSOR), Curve("barometer", AIR_DATA), _TRUE)
_SPEEDS = (
    Curve("GPS, over ground", SENSOR), Curve("pitot tube", AIR_DATA),
    Curve("true, over ground", TRUTH), Curve("true, in the air", _COURSE),
)  # fmt: skip
PAGES: dict[str, tuple[Plot, ...]] = {
    "Attitude": (
        Plot("attitude/bank", "Bank, deg", (_DEMANDED, _TRUE, _ESTIMATED)),
        Plot("attitude/pitch", "Pitch, deg", (_DEMANDED, _TRUE, _ESTIMATED)),
        Plot("attitude/heading", "Heading, deg", _HEADINGS),
        Plot("attitude/error", "Attitude error, deg", _ERRORS),
    ),
    "Gyro bias": tuple(Plot(f"gyro_bias/{a}", f"Gyro bias {a}, deg/s", (_TRUE, _ESTIMATED)) for a in "xyz"),
    "Gyro": tuple(Plot(f"gyro/{a}", f"Rate {a}, deg/s", (_SENSED, _TRUE)) for a in "xyz"),
    "Accelerometer": tuple(Plot(f"force/{a}", f"Specific force {a}, m/s²", (_SENSED, _TRUE)) for a in "xyz"),
    "Magnetometer": tuple(Plot(f"field/{a}", f"Magnetic field {a}, µT", (_SENSED,)) for a in "xyz"),
    "Controls": tuple(
        Plot(f"controls/{c}", f"{c.capitalize()}", (Curve("command", ESTIMATE), Curve("position", TRUTH)))
        for c in ("aileron", "elevator", "rudder", "throttle")
    ),
    "Flight": (
        Plot("flight/height", "Height above launch, m", _HEIGHTS),
        Plot("flight/speed", "Speed, m/s", _SPEEDS),
        Plot("flight/wind_n", "Wind to the north, m/s", (_TRUE, _ESTIMATED)),
        Plot("flight/wind_e", "Wind to the east, m/s", (_TRUE, _ESTIMATED)),
    ),
}
PLOTS = tuple(plot for page in PAGES.values() for plot in page)


def curves(log: Log, heading_reference: HeadingReference) -> dict[str, Array]:
    """Data of each plot: path -> shape (ticks, lines of the plot), NaN for gaps.

    Angles in degrees, with gaps where they wrap around.  The heading error is relative to what the estimator's heading
    converges to, the true course or the true nose.
    """
    truth, measured, flown = log.truth, log.measured, log.flown
    v_e_m_s = truth["v_e_m_s"]
    ground_m_s = np.hypot(v_e_m_s[:, 0], v_e_m_s[:, 1])
    course_rad = np.where(ground_m_s > _SLOWEST_M_S, np.arctan2(v_e_m_s[:, 1], v_e_m_s[:, 0]), np.nan)
    true_rad, estimated_rad = to_euler(truth["R_eb"]), to_euler(flown["R_eb"])
    reference_rad = course_rad if heading_reference == "course" else heading_rad(truth["R_eb"])
    meaningful = (np.abs(truth["R_eb"][:, 2, 0]) < _STEEPEST_R_ZX) & (ground_m_s > _SLOWEST_M_S)
    heading_error_rad = np.where(meaningful, wrap(estimated_rad[2] - reference_rad), np.nan)
    errors_rad = (
        rotation_error_rad(flown["R_eb"], truth["R_eb"]),
        heading_error_rad,
        inclination_error_rad(flown["R_eb"], truth["R_eb"]),
    )
    fixed = measured["gps_valid"] > 0
    sampled, aired = np.cumsum(measured["mag_new"]) > 0, np.cumsum(measured["air_new"]) > 0
    pitot_m_s, baro_m = (np.where(aired, measured[c], np.nan) for c in ("equivalent_airspeed_m_s", "baro_height_m"))
    # Headings around north are shown from -180 to 180, around south from 0 to 360, to avoid wrapping.
    cut_rad = -np.pi if np.mean(truth["R_eb"][:, 0, 0]) > 0.0 else 0.0
    bank_rad = flown["bank_demand_rad"], true_rad[0], estimated_rad[0]
    columns: dict[str, tuple[Any, ...]] = {
        "attitude/bank": tuple(_circle_deg(a, -np.pi) for a in bank_rad),
        "attitude/pitch": tuple(np.degrees(a) for a in (flown["pitch_demand_rad"], true_rad[1], estimated_rad[1])),
        "attitude/heading": tuple(_circle_deg(a, cut_rad) for a in (course_rad, true_rad[2], estimated_rad[2])),
        "attitude/error": tuple(np.degrees(a) for a in errors_rad),
        "flight/height": (np.where(fixed, -measured["gps_p_e_m"][:, 2], np.nan), baro_m, -truth["p_e_m"][:, 2]),
        "flight/speed": (
            np.where(fixed, measured["gps_speed_m_s"], np.nan),
            pitot_m_s,
            ground_m_s,
            truth["airspeed_m_s"],
        ),
    }
    for i, axis in enumerate("xyz"):
        bias_rad_s = truth["gyro_bias_b_rad_s"][:, i], flown["gyro_bias_b_rad_s"][:, i]
        rate_rad_s = measured["gyro_b_rad_s"][:, i], truth["imu_omega_b_rad_s"][:, i]
        columns[f"gyro_bias/{axis}"] = tuple(np.degrees(a) for a in bias_rad_s)
        columns[f"gyro/{axis}"] = tuple(np.degrees(a) for a in rate_rad_s)
        columns[f"field/{axis}"] = (np.where(sampled, measured["mag_b_ut"][:, i], np.nan),)
        columns[f"force/{axis}"] = measured["force_b_m_s2"][:, i], truth["imu_force_b_m_s2"][:, i]
    for control in ("aileron", "elevator", "rudder", "throttle"):
        columns[f"controls/{control}"] = flown[control], truth[control]
    for i, axis in enumerate("ne"):
        columns[f"flight/wind_{axis}"] = truth["wind_e_m_s"][:, i], flown["wind_e_m_s"][:, i]
    return {path: np.column_stack(lines) for path, lines in columns.items()}


def limits(log: Log, lines: dict[str, Array]) -> dict[str, Range]:
    """Range of the vertical axis of each plot: all values of `lines`, and at least two axis labels.

    Errors count only after the estimator has started, as the initial ones would hide the rest.
    """
    started = log.flown["health"] != Health.STARTING
    found = {}
    for path, values in lines.items():
        shown = values[started] if path.endswith("error") and np.any(started) else values
        shown = shown[np.isfinite(shown)]
        if len(shown) == 0:
            continue
        low, high = float(shown.min()), float(shown.max())
        margin = 0.06 * max(high - low, 1e-3)
        low, high = low - margin, high + margin
        step = 10.0 ** np.floor(np.log10(high - low))
        if np.floor(high / step) - np.ceil(low / step) < 1.0:  # the viewer labels only multiples of it
            low, high = (np.floor(low / step) - 0.05) * step, (np.ceil(high / step) + 0.05) * step
        found[path] = float(low), float(high)
    return found


def _circle_deg(angle_rad: Array, cut_rad: float) -> Array:
    """Degrees from the cut upwards, with a gap at each wrap (no aeroplane turns 90 degrees in a tick)."""
    angle_deg = np.degrees((angle_rad - cut_rad) % (2.0 * np.pi) + cut_rad)
    angle_deg[1:][np.abs(np.diff(angle_deg)) > 90.0] = np.nan
    return angle_deg
