"""What the data sheets of a sensor suite say of its instruments: the record that goes to flight code.

Only parameters of the parts and the board count here, never what was drawn from them for one flight.  Several small
effects that a filter cannot tell apart are one figure: their root sum of squares.
"""

import math

from estimator.instruments import Known
from sim.clock import Rates
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.fitting import SuiteParams
from sim.sensors.gps import KNOT_M_S, GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.noise import STANDARD_GRAVITY_M_S2

UNIFORM = math.sqrt(12.0)  # standard deviation of a value that is uniform over one step is the step over this
NMEA_SPEED_STEP_M_S, UBX_SPEED_STEP_M_S = 0.01 * KNOT_M_S, 0.001


def data_sheets(suite: SuiteParams, rates: Rates, origin: str = "") -> dict[str, Known]:
    """What is known of the instruments of `suite` at the `rates` of a flight, by the names of `PROPERTIES`.

    origin : what the suite is called      Source of every entry: "data sheet"
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
    """Whether a magnetometer is fitted that needs no calibration: no iron, no motor, no crooked mounting."""
    part = suite.magnetometer
    if part is None:
        return False
    errors = (part.hard_iron_ut, part.soft_iron, part.gain, *part.hard_iron_b_ut, *part.motor_b_ut, *part.mounting_deg)
    return not any(errors)


def _receiver(gps: GpsParams, rates: Rates) -> dict[str, float | bool]:
    """The receiver: two first-order lags in series delay like one with the sum of their time constants.

    A velocity worked out from three positions is as old as the middle one, a fix interval before the stamp.
    """
    from_positions = gps.course == "positions"
    step_m_s = {"none": 0.0, "nmea": NMEA_SPEED_STEP_M_S, "binary": UBX_SPEED_STEP_M_S}[gps.resolution]
    return {
        "gps_filter_s": gps.filter_s + gps.smoothing_s,
        "gps_latency_s": gps.latency_s + (1.0 / rates.gps_hz if from_positions else 0.0),
        "gps_stamped": not from_positions,
        "gps_vertical_velocity": gps.resolution != "nmea",
        "gps_rate_hz": float(rates.gps_hz),
        "gps_noise_m_s": math.hypot(gps.velocity_noise_m_s, gps.velocity_wander_m_s, step_m_s / UNIFORM),
    }


def _gyro(gyro: GyroParams, board: BoardParams, rates: Rates) -> dict[str, float]:
    dt_s = rates.dt_s
    step_deg_s = _step(gyro.range_deg_s, gyro.step_deg_s, gyro.bits)
    noise = math.hypot(gyro.noise_density_deg_s_sqrt_hz, _density(step_deg_s / UNIFORM, dt_s))
    at_power_up_deg_s = 0.0 if board.rest_s > 0.0 else gyro.bias_deg_s
    later_deg_s = gyro.bias_per_k_deg_s * board.warming_k, gyro.bias_instability_deg_s, gyro.g_sensitivity_deg_s_g
    return {
        "gyro_full_scale_rad_s": math.radians(gyro.range_deg_s),
        "gyro_noise_rad_s_sqrt_hz": math.radians(noise),
        "gyro_bias_sigma_rad_s": math.radians(math.hypot(at_power_up_deg_s, *later_deg_s)),
        "gyro_gain_sigma": math.hypot(gyro.gain, gyro.gain_per_k * board.warming_k),
        "gyro_cross_axis": gyro.cross_axis,
    }


def _accelerometer(part: AccelerometerParams, board: BoardParams, rates: Rates) -> dict[str, float]:
    step_g = _step(part.range_g, part.step_g, part.bits)
    noise_g = math.hypot(1e-6 * part.noise_density_ug_sqrt_hz, _density(step_g / UNIFORM, rates.dt_s))
    bias_g = math.hypot(part.bias_g, 1e-3 * part.bias_per_k_mg * board.warming_k, 1e-6 * part.bias_instability_ug)
    return {
        "force_full_scale_m_s2": part.range_g * STANDARD_GRAVITY_M_S2,
        "force_noise_m_s2_sqrt_hz": noise_g * STANDARD_GRAVITY_M_S2,
        "force_bias_sigma_m_s2": bias_g * STANDARD_GRAVITY_M_S2,
    }


def _step(full_scale: float, step: float, bits: int) -> float:
    """One step of the converter; 0 where it has none."""
    if step > 0.0 or not bits:
        return step
    return 2.0 * full_scale / 2.0**bits


def _density(sigma: float, dt_s: float) -> float:
    """One-sided density of a white noise with the standard deviation `sigma` in every sample of `dt_s` s."""
    return sigma * math.sqrt(2.0 * dt_s)
