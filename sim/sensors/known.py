"""The instruments of a sensor suite according to their data sheets: the record passed to flight code.

It uses only the parameters of parts and board, never the errors drawn for one flight.  Small effects that a filter
cannot distinguish are combined into one figure, their root sum of squares.
"""

import math

from estimator.instruments import Known
from estimator.interface import G_M_S2
from sim.clock import Rates
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.device import converter, noise_filter, noise_of_one_conversion
from sim.sensors.fitting import SuiteParams
from sim.sensors.gps import KNOT_M_S, GpsParams
from sim.sensors.gyro import GyroParams

UNIFORM = math.sqrt(12.0)  # step / standard deviation of a value uniform over one step
NMEA_SPEED_STEP_M_S, UBX_SPEED_STEP_M_S = 0.01 * KNOT_M_S, 0.001


def data_sheets(suite: SuiteParams, rates: Rates, origin: str = "") -> dict[str, Known]:
    """Properties of the instruments of `suite` at the `rates` of a flight, by the names of `PROPERTIES`.

    origin : name of the suite      The source of each entry is "data sheet".
    """
    figures = {
        **_receiver(suite.gps, rates),
        **_gyro(suite.gyro, suite.board, rates),
        **_accelerometer(suite.accelerometer, suite.board, rates),
        "imu_rate_hz": float(rates.imu_hz),
        "use_airspeed": suite.airspeed is not None,
        "use_magnetometer": suite.magnetometer is not None,
        "magnetometer_calibrated": has_clean_magnetometer(suite),
    }
    return {name: Known(value, "data sheet", origin) for name, value in figures.items()}


def has_clean_magnetometer(suite: SuiteParams) -> bool:
    """Whether a magnetometer is fitted that needs no calibration: no iron, motor field or misalignment."""
    part = suite.magnetometer
    if part is None:
        return False
    errors = (part.hard_iron_ut, part.soft_iron, part.gain, *part.hard_iron_b_ut, *part.motor_b_ut, *part.mounting_deg)
    return not any(errors)


def _receiver(gps: GpsParams, rates: Rates) -> dict[str, float | bool]:
    """The receiver: two first-order lags in series count as one with the sum of their time constants.

    A velocity from three positions is valid at the middle one, a fix interval before the stamp.
    """
    from_positions = gps.course == "positions"
    step_m_s = {"none": 0.0, "nmea": NMEA_SPEED_STEP_M_S, "binary": UBX_SPEED_STEP_M_S}[gps.resolution]
    noise_m_s = math.hypot(gps.velocity_noise_m_s, gps.velocity_wander_m_s, step_m_s / UNIFORM)
    if from_positions:  # the difference of two positions, two intervals apart
        noise_m_s = gps.noise_horizontal_m * math.sqrt(2.0) * rates.gps_hz / 2.0
    return {
        "gps_filter_s": gps.filter_s + gps.smoothing_s,
        "gps_latency_s": gps.latency_s + (1.0 / rates.gps_hz if from_positions else 0.0),
        "gps_stamped": not from_positions,
        "gps_vertical_velocity": from_positions or gps.resolution != "nmea",
        "gps_rate_hz": float(rates.gps_hz),
        "gps_noise_m_s": noise_m_s,
    }


def _gyro(gyro: GyroParams, board: BoardParams, rates: Rates) -> dict[str, float]:
    """The gyro: calibration at rest removes the turn-on bias, but not later changes.

    Mounting misalignment acts on a filter like cross-axis sensitivity.
    """
    noise = _density(gyro, gyro.noise_density_deg_s_sqrt_hz, gyro.step_deg_s, gyro.range_deg_s, rates)
    at_power_up_deg_s = 0.0 if board.rest_s > 0.0 else gyro.bias_deg_s
    later_deg_s = (
        gyro.bias_per_k_deg_s * board.warming_k, 2.0 * gyro.bias_instability_deg_s, gyro.drift_deg_s_min,
        gyro.g_sensitivity_deg_s_g, _analogue(gyro.output, gyro.null_deg_s * board.supply_sag),
    )  # fmt: skip
    gains = gyro.gain, gyro.gain_per_k * board.warming_k, gyro.nonlinearity
    return {
        "gyro_full_scale_rad_s": math.radians(gyro.range_deg_s),
        "gyro_noise_rad_s_sqrt_hz": math.radians(noise),
        "gyro_bias_sigma_rad_s": math.radians(math.hypot(at_power_up_deg_s, *later_deg_s)),
        "gyro_gain_sigma": math.hypot(*gains, _analogue(gyro.output, board.supply_tolerance)),
        "gyro_cross_axis": math.hypot(gyro.cross_axis, _mounting_rad(board)),
    }


def _accelerometer(part: AccelerometerParams, board: BoardParams, rates: Rates) -> dict[str, float]:
    """The accelerometer: in steady flight gain, cross axes and misalignment act on 1 g and look like a bias."""
    noise = _density(part, 1e-6 * part.noise_density_ug_sqrt_hz, part.step_g, part.range_g, rates)
    biases_g = part.bias_g, 1e-3 * part.bias_per_k_mg * board.warming_k, part.gain, part.cross_axis
    return {
        "force_full_scale_m_s2": part.range_g * G_M_S2,
        "force_noise_m_s2_sqrt_hz": noise * G_M_S2,
        "force_bias_sigma_m_s2": math.hypot(*biases_g, _mounting_rad(board)) * G_M_S2,
    }


def _mounting_rad(board: BoardParams) -> float:
    return math.radians(max(map(abs, board.mounting_deg)))


def _analogue(output: str, figure: float) -> float:
    """A figure that applies only to analogue outputs: the effect of the supply."""
    return 0.0 if output == "digital" else figure


def _density(
    part: GyroParams | AccelerometerParams, density_sqrt_hz: float, step: float, full_scale: float, rates: Rates
) -> float:
    """One-sided noise density of the samples: of the part including aliasing, and of its converter.

    White noise with the standard deviation sigma per sample of dt has the density sigma sqrt(2 dt).
    """
    _, folded = noise_filter(part.bandwidth_hz, part.conversions, rates.imu_hz)
    of_one = noise_of_one_conversion(density_sqrt_hz, part.bandwidth_hz, part.conversions, rates.imu_hz)
    one_step, _, _ = converter(step, full_scale, part.bits, part.conversions, of_one)
    return math.hypot(folded * density_sqrt_hz, one_step / UNIFORM * math.sqrt(2.0 * rates.dt_s))
