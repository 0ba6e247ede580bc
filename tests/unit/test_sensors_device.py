"""What gyro and accelerometer share, one term at a time: mounting, gains, curve, g-sensitivity, supply, converter."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from sim.clock import Rates
from sim.log import Log
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams
from sim.sensors.device import converter, noise_of_one_conversion
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

DEG, G0 = math.pi / 180.0, 9.80665
NO_GYRO_ERROR = GyroParams(
    bias_deg_s=0.0, drift_deg_s_min=0.0, walk_deg_s_sqrt_s=0.0, noise_density_deg_s_sqrt_hz=0.0,
    gain=0.0, cross_axis=0.0, range_deg_s=math.inf, bits=0,
)  # fmt: skip
NO_FORCE_ERROR = AccelerometerParams(bias_g=0.0, noise_density_ug_sqrt_hz=0.0, range_g=math.inf, bits=0)
DOUBTED_ONCE_IN = 1e-5


def assert_sigma(samples, sigma):
    """The sample variance about zero lies within the chi-square bounds of independent `samples`."""
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], np.size(samples))
    assert low <= np.sum(np.square(samples)) / sigma**2 <= high


def read(
    omega_deg_s=(0.0, 0.0, 0.0), force_g=(0.0, 0.0, -1.0), *, board=None, seed=0, throttle=0.0, t_s=None, **errors
):
    """Gyro in deg/s and accelerometer in g, each (n, 3); inputs (3,) or (n, 3).

    errors : of both parts where both have the field, else of the one that has it
    """
    omega_b, force_b = np.broadcast_arrays(np.atleast_2d(omega_deg_s), np.atleast_2d(force_g))
    log = Log.empty(len(omega_b))
    log.truth["imu_omega_b_rad_s"] = log.truth["omega_b_rad_s"] = omega_b * DEG
    log.truth["imu_force_b_m_s2"] = force_b * G0
    log.truth["throttle"], log.truth["t_s"] = throttle, np.arange(1, len(log) + 1) / 50.0 if t_s is None else t_s
    parts = [
        replace(part, **{name: value for name, value in errors.items() if hasattr(part, name)})
        for part in (NO_GYRO_ERROR, NO_FORCE_ERROR)
    ]
    suite = Suite(SuiteParams(*parts, board=board or BoardParams()), Rates(), seed)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log.measured["gyro_b_rad_s"] / DEG, log.measured["force_b_m_s2"] / G0


def units(n, *inputs, **errors):
    """First readings of `n` flights with the `errors`, each (n, 3)."""
    both = [read(*inputs, seed=i, **errors) for i in range(n)]
    return np.stack([g[-1] for g, _ in both]), np.stack([f[-1] for _, f in both])


RATE, FORCE = (100.0, -50.0, 200.0), (0.5, -0.25, -1.0)


def test_crooked_board_reads_along_its_own_axes():
    """Roll, pitch and yaw of the board, in SciPy's words: intrinsic z, y, x; both parts read R_sb times the truth."""
    gyro, force = read(RATE, FORCE, board=BoardParams(mounting_deg=(3.0, -5.0, 10.0)))
    R_bs = Rotation.from_euler("ZYX", [10.0, -5.0, 3.0], degrees=True).as_matrix()
    np.testing.assert_allclose(gyro[0], R_bs.T @ RATE, rtol=0, atol=1e-12)
    np.testing.assert_allclose(force[0], R_bs.T @ FORCE, rtol=0, atol=1e-14)
    # A board rolled to the right feels the ground's push on its left: f_y below zero.
    assert read(board=BoardParams(mounting_deg=(3.0, 0.0, 0.0)))[1][0, 1] == pytest.approx(-math.sin(3.0 * DEG))


def test_accelerometer_gain_and_cross_axis_errors_have_their_sigmas():
    """1.5 % of each axis' own force; 0.5 % of the force along x in the other two."""
    _, force = units(150, RATE, FORCE, gain=0.015)
    assert_sigma(force / FORCE - 1.0, 0.015)
    _, force = units(150, RATE, (1.0, 0.0, 0.0), cross_axis=0.005)
    np.testing.assert_allclose(force[:, 0], 1.0, rtol=0, atol=1e-15)
    assert_sigma(force[:, 1:], 0.005)


def test_gain_changes_with_the_warmth_of_the_board():
    """0.1 % per kelvin, 20 K warmer in the end: after one time constant 63 % of it, the rest decays with time."""
    board = BoardParams(warming_k=20.0, warming_s=100.0)
    gyro, force = units(150, RATE, FORCE, gain_per_k=1e-3, board=board, t_s=100.0)
    rise_k = 20.0 * (1.0 - math.exp(-1.0))
    assert_sigma(gyro / RATE - 1.0, 1e-3 * rise_k)
    assert_sigma(force / FORCE - 1.0, 1e-3 * rise_k)
    t_s = np.array([0.0, 10.0, 100.0, 1000.0, 1e5])
    gyro, _ = read(np.tile(RATE, (5, 1)), gain_per_k=1e-3, board=board, t_s=t_s)
    change = gyro / RATE - 1.0
    np.testing.assert_allclose(change, np.outer(1.0 - np.exp(-t_s / 100.0), change[-1]), rtol=0, atol=1e-15)


def test_curve_deviates_as_the_third_chebyshev_polynomial():
    """Zero at zero and nowhere steeper: four equal extremes of alternating sign, so the best straight line is zero."""
    z = np.linspace(-1.0, 1.0, 401)
    gyro, force = read(300.0 * z[:, None] * [1, 1, 1], 3.0 * z[:, None] * [1, 1, 1], nonlinearity=0.01,
                       range_deg_s=400.0, range_g=4.0)  # fmt: skip
    T3 = np.polynomial.chebyshev.Chebyshev([0.0, 0.0, 0.0, 1.0])
    for reading, full_scale, largest in ((gyro, 400.0, 300.0), (force, 4.0, 3.0)):
        deviation = reading - largest * z[:, None]
        shape = T3(0.75 * z)[:, None]
        size = np.sum(deviation * shape, axis=0) / np.sum(shape**2) / full_scale
        np.testing.assert_allclose(deviation, full_scale * size * shape, rtol=0, atol=1e-13 * full_scale)
        assert np.all((np.abs(size) > 1e-5) & (np.abs(size) < 0.05))
        assert np.all(deviation[200] == 0.0)


def test_curve_has_the_size_of_the_data_sheet_over_units():
    """Largest deviation 0.5 % of 300 deg/s and of 3 g, sigma over units; seen where T3 is -1, at half the scale."""
    gyro, force = units(150, (150.0, 150.0, 150.0), (1.5, 1.5, 1.5), nonlinearity=0.005, range_deg_s=300.0, range_g=3.0)
    assert_sigma(gyro - 150.0, 1.5)
    assert_sigma(force - 1.5, 0.015)


def test_gyro_leans_on_the_specific_force():
    """0.1 deg/s per g of each axis to each axis: 1 g downwards and 2 g forwards, in proportion and added up."""
    down, _ = units(120, (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), g_sensitivity_deg_s_g=0.1)
    assert_sigma(down, 0.1)
    forward, _ = units(120, (0.0, 0.0, 0.0), (2.0, 0.0, 0.0), g_sensitivity_deg_s_g=0.1)
    assert_sigma(forward, 0.2)
    both, _ = units(120, (0.0, 0.0, 0.0), (2.0, 0.0, -1.0), g_sensitivity_deg_s_g=0.1)
    np.testing.assert_allclose(both, down + forward, rtol=0, atol=1e-14)
    assert abs(np.corrcoef(down.ravel(), forward.ravel())[0, 1]) <= 4.5 / math.sqrt(360)


def test_gyro_leans_on_the_force_where_the_board_sits():
    """At a steady turn the force at r is that at the centre of gravity and omega x (omega x r), which leans as well."""
    r, omega, f = (0.1, -0.2, 0.05), (200.0, 100.0, -150.0), np.array(FORCE)
    felt = f + np.cross(np.radians(omega), np.cross(np.radians(omega), r)) / G0

    def leaned(force_g, arm):
        both = [
            read(omega, force_g, board=BoardParams(lever_arm_b_m=arm), g_sensitivity_deg_s_g=size)[0][0]
            for size in (0.1, 0.0)
        ]
        return both[0] - both[1]

    np.testing.assert_allclose(leaned(f, r), leaned(felt, (0.0, 0.0, 0.0)), rtol=0, atol=1e-13 * 200)
    assert np.abs(leaned(f, r) - leaned(f, (0.0, 0.0, 0.0))).max() > 0.01


@pytest.mark.parametrize(
    ("output", "ratiometric", "scale"),
    [
        ("absolute", True, 1.0 / 0.95),
        ("ratiometric", True, 1.0),
        ("ratiometric", False, 0.95),
        ("absolute", False, 1.0),
        ("digital", True, 1.0),
        ("digital", False, 1.0),
    ],
)
def test_supply_moves_the_reading_where_part_and_converter_disagree(output, ratiometric, scale):
    """A supply 5 % low at full throttle: sensitivity and offset change together, only for unlike references."""
    board = BoardParams(supply_sag=0.05, converter_ratiometric=ratiometric)
    gyro, force = read(RATE, FORCE, board=board, throttle=1.0, output=output, null_deg_s=280.0, null_g=2.0)
    np.testing.assert_allclose(gyro[0], (np.array(RATE) + 280.0) * scale - 280.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(force[0], (np.array(FORCE) + 2.0) * scale - 2.0, rtol=0, atol=1e-14)
    gyro, _ = read(RATE, board=board, throttle=0.0, output=output, null_deg_s=280.0)
    np.testing.assert_allclose(gyro[0], RATE, rtol=0, atol=1e-12)


def test_supply_tolerance_is_one_error_for_all_axes_of_both_parts():
    """Sigma 2 % over boards; seen through a ratiometric part and a converter with a reference of its own."""
    board = BoardParams(supply_tolerance=0.02, converter_ratiometric=False)
    gyro, force = units(200, RATE, FORCE, board=board, output="ratiometric")
    assert_sigma(gyro[:, 0] / RATE[0] - 1.0, 0.02)
    every = np.hstack([gyro / RATE, force / FORCE])
    np.testing.assert_allclose(every, every[:, :1] * np.ones(6), rtol=0, atol=1e-13)


def test_bias_in_the_truth_is_what_the_reading_has_too_much_on_a_wrong_supply():
    """At rest and without noise the reading is the bias column, shift of the offset included."""
    log = Log.empty(20)
    log.truth["throttle"] = np.linspace(0.0, 1.0, 20)
    gyro = replace(NO_GYRO_ERROR, bias_deg_s=1.0, drift_deg_s_min=0.2, output="absolute", null_deg_s=300.0)
    force = replace(NO_FORCE_ERROR, bias_g=0.02, output="absolute", null_g=2.0)
    suite = Suite(SuiteParams(gyro, force, board=BoardParams(supply_tolerance=0.01, supply_sag=0.03)), Rates(), 2)
    suite.reset(log)
    for k in range(20):
        suite.measure(k)
    for reading, bias in (("gyro_b_rad_s", "gyro_bias_b_rad_s"), ("force_b_m_s2", "force_bias_b_m_s2")):
        np.testing.assert_array_equal(log.measured[reading], log.truth[bias])
        assert np.all(np.diff(log.truth[bias], axis=0) > 0.0)  # 300 deg/s and 2 g shift by 3 % as the throttle opens


def test_converter_with_a_step_of_its_own_clips_at_range_and_at_codes():
    """14.375 steps per deg/s: 16 bits reach 2279 deg/s but the range ends at 2000; 8 bits end at their last code."""
    step = 1.0 / 14.375
    sweep = np.linspace(-2500.0, 2500.0, 4001)[:, None] * [1.0, -1.0, 0.1]
    reading, _ = read(sweep, range_deg_s=2000.0, range_g=2.0, bits=16, step_deg_s=step)
    levels = reading / step
    np.testing.assert_allclose(levels, np.round(levels), rtol=0, atol=1e-9)
    assert (round(levels.min()), round(levels.max())) == (-28750, 28750)  # 2000 deg/s
    inside = np.abs(sweep) < 1999.0
    assert np.abs(reading - sweep)[inside].max() <= step / 2 + 1e-9
    short, _ = read(sweep, range_deg_s=2000.0, range_g=2.0, bits=8, step_deg_s=step)
    assert (round(short.min() / step), round(short.max() / step)) == (-128, 127)
    free, _ = read(
        sweep, range_deg_s=2000.0, range_g=2.0, bits=0, step_deg_s=step
    )  # no converter: the step means nothing
    np.testing.assert_allclose(free, np.clip(sweep, -2000.0, 2000.0), rtol=0, atol=1e-12)


def test_converter_of_the_accelerometer_with_a_step_of_its_own_clips_at_its_range():
    """16384 steps per g over +-2 g in 16 bits: codes -32768 to 32767, exactly."""
    sweep = np.linspace(-3.0, 3.0, 601)[:, None] * [1, 1, 1]
    _, reading = read(force_g=sweep, range_deg_s=9.0, range_g=2.0, bits=16, step_g=1.0 / 16384.0)
    assert (round(reading.min() * 16384), round(reading.max() * 16384)) == (-32768, 32767)


def test_noise_of_one_conversion_is_that_of_its_bandwidth():
    """Density times the root of pi/2 times the corner; unfiltered, the noise whose mean over n has that of a sample."""
    assert noise_of_one_conversion(0.03, 50.0, 1000, 50.0) == pytest.approx(0.03 * math.sqrt(math.pi / 2.0 * 50.0))
    assert noise_of_one_conversion(0.06, math.inf, 16, 50.0) == pytest.approx(4.0 * 0.3)


@pytest.mark.parametrize(("sigma", "finer"), [(0.0, 1), (0.5, 1), (0.51, 16), (3.0, 16)])
def test_averaged_conversions_resolve_finer_only_with_enough_noise(sigma, finer):
    """16 conversions of a step of 1 over +-8: 1/16 of a step where noise exceeds half a step, over the same codes."""
    step, lowest, highest = converter(1.0, 8.0, 4, 16, sigma)
    assert (step, lowest * step, highest * step) == (1.0 / finer, -8.0, 7.0)
    assert converter(1.0, 8.0, 4, 0, sigma) == converter(1.0, 8.0, 4, 1, sigma) == (1.0, -8.0, 7.0)


def test_half_a_step_of_noise_is_where_the_mean_of_codes_becomes_fair():
    """The rule in numbers: the expected code of a level between two codes, by the normal distribution.

    With noise of half a step it is right within 0.3 % of a step; with a tenth of a step it is 29 % of one wrong.
    """
    levels, codes = np.linspace(0.0, 1.0, 101), np.arange(-20, 22)

    def worst(sigma):
        edges = stats.norm.cdf(codes[:, None] + 0.5, levels, sigma) - stats.norm.cdf(
            codes[:, None] - 0.5, levels, sigma
        )
        return np.abs(codes @ edges - levels).max()

    assert worst(0.5) <= 0.003
    assert worst(0.1) >= 0.25


def test_part_reads_finer_levels_when_its_noise_moves_the_converter():
    """Noise of 0.3 deg/s a sample, 1.2 deg/s a conversion of 16, over a step of 1: levels of a sixteenth of a step."""
    errors = {"noise_density_deg_s_sqrt_hz": 0.06, "range_deg_s": 128.0, "range_g": 2.0, "bits": 8}
    fine, _ = read(np.zeros((300, 3)), conversions=16, **errors)
    assert np.all(np.abs(16.0 * fine - np.round(16.0 * fine)) <= 1e-9)
    coarse, _ = read(np.zeros((300, 3)), conversions=1, **errors)
    assert np.all(np.abs(coarse - np.round(coarse)) <= 1e-12)
    assert len(np.unique(np.round(fine * 16.0))) > len(np.unique(np.round(coarse)))


@pytest.mark.parametrize("name", ["generic", "generic_6g", "ideal"])
def test_suites_without_a_board_of_their_own_have_every_term_off(name):
    """What is off costs a branch: no flag is set, and the accelerometer's axes are the body's, exactly."""
    suite = Suite(SUITES[name], Rates(), 0)
    suite.reset(Log.empty(1))
    unit = suite.snapshot().unit[0]
    assert not unit["board"]["changes"]
    for part in ("gyro", "accelerometer"):
        flags = [n for n in ("filters", "shakes", "distorts", "leans", "off_centre") if n in unit[part].dtype.names]
        assert not any(unit[part][flag] for flag in flags)
    np.testing.assert_array_equal(unit["accelerometer"]["M"], np.eye(3))


TERMS = {
    "gain_per_k": 1e-3, "nonlinearity": 0.01, "g_sensitivity_deg_s_g": 0.1, "bandwidth_hz": 20.0,
}  # fmt: skip


@pytest.mark.parametrize("term", TERMS)
def test_device_term_leaves_every_other_draw_unchanged(term):
    """Gains, cross-axis errors, noise and the other part keep their bits, whatever is added."""

    def snapshot(**errors):
        parts = [replace(p(), gain=0.01, **{n: v for n, v in errors.items() if hasattr(p(), n)})
                 for p in (GyroParams, AccelerometerParams)]  # fmt: skip
        board = BoardParams(vibration_g=0.1, warming_k=10.0, supply_tolerance=0.01)
        suite = Suite(SuiteParams(*parts, board=board), Rates(), 5)
        suite.reset(Log.empty(10))
        return suite.snapshot()

    without, with_term = snapshot(), snapshot(**{term: TERMS[term]})
    for part in ("gyro", "accelerometer"):
        for column in ("M", "shake_rad"):
            np.testing.assert_array_equal(without.unit[part][column], with_term.unit[part][column])
    np.testing.assert_array_equal(without.unit["board"], with_term.unit["board"])
    if term != "bandwidth_hz":  # a filter shapes the noise
        np.testing.assert_array_equal(without.noise, with_term.noise)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("supply_tolerance", 0.2, "(a fraction): choose at most 0.1"),
        ("supply_sag", 0.5, "(a fraction): choose at most 0.4"),
        ("supply_sag", -0.1, "(a fraction): choose a finite number, at least 0"),
        ("lever_arm_b_m", (0.0, math.nan, 0.0), "m: choose three finite numbers"),
        ("mounting_deg", (0.0, 1.0), "deg: choose three finite numbers"),
        ("warming_s", 0.0, "s: choose a finite number, at least 0.001"),
        ("vibration_rpm", 0.0, "rpm: choose a finite number, at least 1"),
    ],
)
def test_impossible_board_is_refused(field, value, said):
    """One line naming field, value and unit, and what to choose."""
    with pytest.raises(ValueError, match=re.escape(f"BoardParams.{field} = {value!r} {said}")) as error:
        BoardParams(**{field: value})
    assert "\n" not in str(error.value)
