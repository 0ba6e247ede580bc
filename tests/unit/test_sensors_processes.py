"""Errors that change in flight: flicker noise against its theory, warming, and the walk; each from its own stream."""

import math
from dataclasses import replace
from functools import partial

import allantools
import numpy as np
import pytest
from scipy import signal, stats

from sim.clock import Rates
from sim.rng import stream
from sim.sensors import accelerometer, gyro
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.board import BoardParams, warming
from sim.sensors.gyro import GyroParams
from sim.sensors.noise import FLICKER_TIMES_S, flicker, flicker_sigmas
from sim.sensors.suite import NOISE

DEG, G0 = math.pi / 180.0, 9.80665
FLOOR = 2.0 * math.log(2.0) / math.pi  # Allan variance of flicker noise in B^2: IEEE Std 952-1997, annex C
DOUBTED_ONCE_IN = 1e-5
WARM = BoardParams(warming_k=15.0, warming_s=120.0)
FULL_GYRO = GyroParams(bias_per_k_deg_s=0.05, bias_instability_deg_s=0.02)
FULL_FORCE = AccelerometerParams(bias_per_k_mg=0.5, bias_instability_ug=200.0, walk_ug_sqrt_s=30.0)


def assert_sigma(samples, sigma):
    """The sample variance about zero lies within the chi-square bounds of independent `samples`."""
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], np.size(samples))
    assert low <= np.sum(np.square(samples)) / sigma**2 <= high


def flicker_of(flight, n, dt_s, coefficient=1.0):
    """Flicker noise of one flight, shape (n, 3)."""
    return flicker(stream(8, flight, "f").standard_normal((n, len(FLICKER_TIMES_S), 3)), coefficient, dt_s)


def gauss_markov_allan_variance(tau_s, time_s):
    """Of unit variance: IEEE Std 952-1997, annex C, exponentially correlated noise, with s^2 = q^2 T / 2."""
    x = tau_s / time_s
    return 2.0 / x * (1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x))


def flicker_allan_variance(tau_s):
    """Closed form of what `flicker` sums, for B = 1."""
    return np.sum(
        flicker_sigmas(1.0) ** 2 * gauss_markov_allan_variance(np.asarray(tau_s)[:, None], FLICKER_TIMES_S), 1
    )


@pytest.mark.parametrize(("shortest_s", "longest_s", "within"), [(1.0, 1000.0, 0.003), (0.5, 5000.0, 0.02)])
def test_flicker_has_the_flat_allan_deviation_of_its_coefficient(shortest_s, longest_s, within):
    """0.664 B over three decades within 0.3 %, over four within 2 %, by the closed form."""
    tau_s = np.geomspace(shortest_s, longest_s, 400)
    deviation = np.sqrt(flicker_allan_variance(tau_s) / FLOOR)
    assert np.abs(deviation - 1.0).max() <= within
    assert math.sqrt(FLOOR) == pytest.approx(0.664, rel=0, abs=5e-4)


def test_flicker_drawn_has_the_allan_variance_of_its_closed_form():
    """Means over 2 s to 2 minutes, of 90 axes: within 4.5 standard errors that the axes themselves show.

    The fastest process, of 0.1 s, is sampled where its mean over a tick of 0.1 s is meant: 1 % of the variance
    from 2 s on.
    """
    dt_s, taus_s = 0.1, np.array([2.0, 10.0, 40.0, 120.0])
    axes = np.hstack([flicker_of(i, 12_000, dt_s) for i in range(30)]).T
    variances = np.array([allantools.oadev(x, 1.0 / dt_s, "freq", taus_s)[1] ** 2 for x in axes])
    error = variances.mean(axis=0) - flicker_allan_variance(taus_s)
    scatter = variances.std(axis=0, ddof=1) / math.sqrt(len(axes))
    assert np.all(np.abs(error) <= 4.5 * scatter + 0.01 * FLOOR)
    assert np.all(scatter <= 0.06 * FLOOR)  # or nothing would have been shown


def test_flicker_has_a_spectrum_that_falls_with_the_frequency():
    """One-sided density B^2 / (pi f) from 0.01 to 0.5 Hz by Welch's method: slope -1 and level within 0.05."""
    B, dt_s = 0.7, 0.05
    axes = np.hstack([flicker_of(i, 40_000, dt_s, B) for i in range(20)])
    f_hz, density = signal.welch(axes, 1.0 / dt_s, nperseg=8192, axis=0)
    band = (f_hz > 0.01) & (f_hz < 0.5)
    f_hz, density = f_hz[band], density.mean(axis=1)[band]
    octaves_alike = 1.0 / f_hz  # the lines lie evenly in f
    slope, _ = np.polyfit(np.log(f_hz), np.log(density), 1, w=np.sqrt(octaves_alike))
    assert abs(slope + 1.0) <= 0.05
    assert abs(np.average(density * math.pi * f_hz / B**2, weights=octaves_alike) - 1.0) <= 0.05


def test_flicker_is_stationary_at_once():
    """Its sigma, 2.1 B, is the same in the first tick and after two hours."""
    sigma = 0.3 * math.sqrt(np.sum(flicker_sigmas(1.0) ** 2))
    assert sigma / 0.3 == pytest.approx(2.09, rel=0, abs=0.005)
    for k in (0, 1, 240):
        assert_sigma([flicker_of(i, 241, 30.0, 0.3)[k] for i in range(400)], sigma)


def test_flicker_of_a_longer_flight_begins_alike_and_scales_with_its_coefficient():
    """Tick k depends on neither the length of the flight nor, but for its size, on B; B = 0 is exactly zero."""
    np.testing.assert_array_equal(flicker_of(0, 100, 0.02), flicker_of(0, 300, 0.02)[:100])
    np.testing.assert_allclose(flicker_of(0, 100, 0.02, 5.0), 5.0 * flicker_of(0, 100, 0.02), rtol=1e-13, atol=0)
    np.testing.assert_array_equal(flicker_of(0, 100, 0.02, 0.0), 0.0)


def drawn(flight=0, gyro_params=FULL_GYRO, force_params=FULL_FORCE, board=WARM, n=3000, source=None):
    """Errors of both sensors in one flight, and the names of the streams they took."""
    names = []

    def listed(name):
        names.append(name)
        return (source or partial(stream, 9, flight))(name)

    rows, rates = np.zeros(n, NOISE), Rates()
    gyro.draw(gyro_params, board, rates, listed, rows)
    accelerometer.draw(force_params, board, rates, listed, rows)
    return rows, names


def test_warming_is_the_solution_of_newtons_law():
    """Zero at power-up, 1 - 1/e of it after the time constant, all of it in the end, rising at first by K / T."""
    board = BoardParams(warming_k=15.0, warming_s=120.0)
    t_s = np.array([0.0, 1e-6, 120.0, 240.0, 1e5])
    expected = 15.0 * np.array([0.0, 1e-6 / 120.0, 1.0 - math.exp(-1.0), 1.0 - math.exp(-2.0), 1.0])
    np.testing.assert_allclose(warming(board, t_s), expected, rtol=1e-8, atol=0)  # 1e-6 / 240 is left of the series


@pytest.mark.parametrize(
    ("column", "unit", "sigma", "cold"),
    [
        ("gyro_bias_b_rad_s", DEG, 0.05, {"gyro_params": replace(FULL_GYRO, bias_per_k_deg_s=0.0)}),
        ("force_bias_b_m_s2", 1e-3 * G0, 0.5, {"force_params": replace(FULL_FORCE, bias_per_k_mg=0.0)}),
    ],
)
def test_bias_follows_the_temperature_with_the_sigma_of_its_slope(column, unit, sigma, cold):
    """Per kelvin, on top of unchanged other errors, as 1 - exp(-t / T); the slope scatters over flights and axes."""
    t_s = np.arange(1, 3001) / 50.0
    curve_k = 15.0 * (1.0 - np.exp(-t_s / 120.0))
    warm, without = drawn()[0][column], drawn(**cold)[0][column]
    slope = (warm - without)[-1] / curve_k[-1]
    np.testing.assert_allclose(warm - without, curve_k[:, None] * slope, rtol=0, atol=1e-15)  # round-off
    ends = [(drawn(i, n=50)[0][column] - drawn(i, n=50, **cold)[0][column])[-1] for i in range(200)]
    assert_sigma(np.array(ends) / curve_k[49] / unit, sigma)


def test_bias_of_a_board_that_keeps_its_temperature_has_no_warming():
    """Whatever the part's sensitivity is, the temperature of power-up is where the turn-on bias holds."""
    still = drawn(board=BoardParams(warming_s=WARM.warming_s))[0]
    blind = drawn(0, replace(FULL_GYRO, bias_per_k_deg_s=0.0), replace(FULL_FORCE, bias_per_k_mg=0.0))[0]
    np.testing.assert_array_equal(still, blind)


def test_accelerometer_walk_grows_with_the_root_of_time():
    """30 ug after one second, 60 after four, 120 after sixteen."""
    walk = AccelerometerParams(bias_g=0.0, noise_density_ug_sqrt_hz=0.0, walk_ug_sqrt_s=30.0)
    flights = [drawn(i, force_params=walk, n=800)[0]["force_bias_b_m_s2"] for i in range(200)]
    for t_s in (1, 4, 16):
        assert_sigma([f[50 * t_s - 1] / (1e-6 * G0) for f in flights], 30.0 * math.sqrt(t_s))


ERRORS = {
    "gyro bias": ("gyro", "bias_deg_s"),
    "gyro drift": ("gyro", "drift_deg_s_min"),
    "gyro bias per kelvin": ("gyro", "bias_per_k_deg_s"),
    "gyro flicker": ("gyro", "bias_instability_deg_s"),
    "gyro walk": ("gyro", "walk_deg_s_sqrt_s"),
    "gyro noise": ("gyro", "noise_density_deg_s_sqrt_hz"),
    "accelerometer bias": ("force", "bias_g"),
    "accelerometer bias per kelvin": ("force", "bias_per_k_mg"),
    "accelerometer flicker": ("force", "bias_instability_ug"),
    "accelerometer walk": ("force", "walk_ug_sqrt_s"),
    "accelerometer noise": ("force", "noise_density_ug_sqrt_hz"),
}


def only(error, size=1.0):
    """Parameters of both sensors with one error of `size` and no other."""
    fields = {s: {f: size if n == error else 0.0 for n, (o, f) in ERRORS.items() if o == s} for s in ("gyro", "force")}
    return {"gyro_params": GyroParams(**fields["gyro"]), "force_params": AccelerometerParams(**fields["force"])}


def test_errors_have_a_stream_each_and_draw_it_only_where_they_are_not_zero():
    """All of them: eleven names; one alone: its own; none: no draw, and exactly zero."""
    assert sorted(drawn()[1]) == sorted(ERRORS)
    for error in ERRORS:
        assert drawn(**only(error))[1] == [error]
    rows, names = drawn(**only("none"))
    assert names == []
    np.testing.assert_array_equal(rows.view(np.float64), 0.0)


def test_errors_of_all_streams_add_up_and_none_moves_another():
    """Each error alone, from its own stream, sums to all together: round-off of the largest, 1 deg/s and 0.04 g."""
    full, params = drawn()[0], {"gyro": FULL_GYRO, "force": FULL_FORCE}
    total = np.zeros(len(full.view(np.float64)))
    for error, (owner, field) in ERRORS.items():
        total += drawn(**only(error, getattr(params[owner], field)))[0].view(np.float64)
    np.testing.assert_allclose(total, full.view(np.float64), rtol=0, atol=1e-14)


def test_flicker_of_gyro_and_accelerometer_and_of_their_axes_is_independent():
    """Six columns whose changes from tick to tick do not correlate: 4.5 sigma of 3000 draws."""
    gyro_rows, force_rows = (drawn(**only(f"{s} flicker"))[0] for s in ("gyro", "accelerometer"))
    columns = np.hstack([gyro_rows["gyro_bias_b_rad_s"], force_rows["force_bias_b_m_s2"]])
    correlation = np.corrcoef(np.diff(columns, axis=0).T) - np.eye(6)
    assert np.abs(correlation).max() <= 4.5 / math.sqrt(2999)
    assert np.all(columns != 0.0)
