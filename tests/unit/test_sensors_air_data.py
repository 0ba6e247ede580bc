"""Pitot tube and barometer: every effect alone against its closed form, and samples to the tick."""

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

from estimator.blocks.air import DENSITY_KG_M3, density_ratio, true_over_equivalent
from sim.clock import Rates
from sim.log import Log
from sim.place import Place
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.suite import Suite, SuiteParams

DENSITY = 101325.0 / (287.05287 * 288.15)  # p / R T of ISO 2533 at sea level, 1.225
PA_M = DENSITY * 9.80665  # what pressure falls by in a metre there
DOUBTED_ONCE_IN = 1e-5


def sensed(airspeed=None, barometer=None, speed_m_s=0.0, height_m=0.0, n=50, rates=None, seed=0, flight=0,
           elevation_m=0.0, **truth):  # fmt: skip
    """Measured rows of a flight with this airspeed and height, numbers or shape (n,)."""
    rates = rates or Rates()
    log = Log.empty(n)
    log.truth["airspeed_m_s"], log.truth["p_e_m"][:, 2] = speed_m_s, -np.asarray(height_m)
    for name, value in truth.items():
        log.truth[name] = value
    place = Place(elevation_m=elevation_m)
    suite = Suite(SuiteParams(airspeed=airspeed, barometer=barometer), rates, seed, flight, place=place)
    suite.reset(log)
    for k in range(n):
        suite.measure(k)
    return log.measured


def speeds(params, speed_m_s, **kw):
    """The airspeeds that arrived."""
    rows = sensed(params, None, speed_m_s, **kw)
    return rows["equivalent_airspeed_m_s"][rows["air_new"] == 1]


def heights(params, height_m, **kw):
    """The heights that arrived."""
    rows = sensed(None, params, height_m=height_m, **kw)
    return rows["baro_height_m"][rows["air_new"] == 1]


def assert_sigma(values, sigma):
    """`values` are normal with zero mean and `sigma`: the sum of squares is within its chi-square bounds."""
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], np.size(values))
    assert low <= np.sum(np.square(values)) / sigma**2 <= high


@pytest.mark.parametrize(("height_m", "density"), [(0.0, 1.225), (1000.0, 1.11164), (3000.0, 0.909122)])
def test_density_is_that_of_the_standard_atmosphere(height_m, density):
    """The table of ISO 2533, to its six digits."""
    np.testing.assert_allclose(DENSITY_KG_M3 * density_ratio(height_m), density, rtol=1e-5, atol=0)


def test_perfect_air_data_are_the_truth():
    """Airspeed and height at the sample's time: to round-off the one, exactly the other."""
    rng = np.random.default_rng(1)
    speed, height = rng.uniform(0.0, 30.0, 200), rng.uniform(-5.0, 120.0, 200)
    rows = sensed(AirspeedParams(), BarometerParams(), speed, height, n=200)
    new = np.flatnonzero(rows["air_new"])
    np.testing.assert_array_equal(new, np.arange(4, 200, 5))
    share = (1.0 - 0.0065 * height[new] / 288.15) ** 2.12794  # of the root of the density
    np.testing.assert_allclose(rows["equivalent_airspeed_m_s"][new], speed[new] * share, rtol=1e-6, atol=0)
    np.testing.assert_array_equal(rows["baro_height_m"][new], height[new])


@pytest.mark.parametrize(
    ("physics_hz", "imu_hz", "rate_hz"),
    [(200, 50, 8), (200, 50, 10), (200, 50, 50), (200, 40, 8), (400, 100, 12.5), (1000, 50, 8)],
)
def test_samples_are_in_the_first_tick_that_ends_at_their_time_or_later(physics_hz, imu_hz, rate_hz):
    """In rational numbers; speed and height grow steadily, so that a sample holds its own time."""
    rates, n = Rates(physics_hz, imu_hz), 3 * imu_hz
    t_s = np.arange(1, n + 1) / imu_hz
    rows = sensed(
        AirspeedParams(rate_hz=rate_hz), BarometerParams(rate_hz=rate_hz), 2.0 + t_s, 3.0 * t_s, n=n, rates=rates
    )
    due = {}
    for j in range(1, int(3 * rate_hz) + 1):
        time = j / Fraction(str(rate_hz))
        due[math.ceil(time * imu_hz) - 1] = float(time)
    new = np.flatnonzero(rows["air_new"])
    np.testing.assert_array_equal(new, list(due))
    stamps = np.array(list(due.values()))
    # Before the end of the first tick there is nothing to interpolate from.
    later = stamps >= 1.0 / imu_hz
    shares = np.array([true_over_equivalent(3.0 * t) for t in t_s[new]])[later]
    read = rows["equivalent_airspeed_m_s"][new][later] * shares
    np.testing.assert_allclose(read, 2.0 + stamps[later], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows["baro_height_m"][new][later], 3.0 * stamps[later], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("elevation_m", "height_m", "share"), [(0.0, 1000.0, 0.953), (940.0, 60.0, 0.953), (2840.0, 60.0, 0.866)]
)
def test_pitot_tube_reads_the_equivalent_airspeed(elevation_m, height_m, share):
    """V sqrt(rho / rho0) with the densities of the ISO 2533 table, wherever the height comes from."""
    read = speeds(AirspeedParams(), 14.0, height_m=height_m, elevation_m=elevation_m)
    np.testing.assert_allclose(read / 14.0, share, rtol=0, atol=6e-4)


def test_full_scale_of_a_pitot_tube_is_a_pressure():
    """100 Pa are 12.78 m/s of equivalent airspeed at any elevation, and a faster true one where the air is thin."""
    params = AirspeedParams(range_pa=100.0)
    for elevation_m in (0.0, 3000.0):
        limit = math.sqrt(200.0 / 1.225) * true_over_equivalent(elevation_m)
        read = speeds(params, np.repeat([0.99 * limit, 1.01 * limit], 5), n=10, elevation_m=elevation_m)
        np.testing.assert_allclose(read, math.sqrt(200.0 / 1.225) * np.array([0.99, 1.0]), rtol=1e-6, atol=0)


def test_barometer_counts_from_the_launch_point_at_any_elevation():
    """12.01 Pa a metre at sea level, 9.2 at 2500 m: the same noise is more height there."""
    rows = heights(BarometerParams(noise_pa=1e-3), 30.0, elevation_m=2500.0)
    np.testing.assert_allclose(rows, 30.0, rtol=0, atol=1e-3)


def test_two_rates_hold_each_its_last_sample():
    """10 Hz of airspeed and 4 Hz of height: one flag for either, each column changes with its own samples alone."""
    t_s = np.arange(1, 101) * 0.02
    rows = sensed(AirspeedParams(rate_hz=10.0), BarometerParams(rate_hz=4.0), 10.0 + t_s, 50.0 + t_s, n=100)
    speed_ticks = {5 * j - 1 for j in range(1, 21)}
    height_ticks = {math.ceil(12.5 * j) - 1 for j in range(1, 9)}
    assert set(np.flatnonzero(rows["air_new"])) == speed_ticks | height_ticks
    for column, ticks in (("equivalent_airspeed_m_s", speed_ticks), ("baro_height_m", height_ticks)):
        first = min(ticks)
        assert np.all(np.isnan(rows[column][:first]))
        assert set(np.flatnonzero(np.diff(rows[column][first:])) + first + 1) == ticks - {first}


@pytest.mark.parametrize(("airspeed", "barometer"), [(AirspeedParams(), None), (None, BarometerParams())])
def test_part_that_is_not_fitted_reads_nan(airspeed, barometer):
    """In every row, new or not; the other reads."""
    rows = sensed(airspeed, barometer, 12.0, 30.0)
    missing, there = ("baro_height_m", "equivalent_airspeed_m_s")[:: 1 if barometer is None else -1]
    assert rows["air_new"].sum() == 10
    assert np.all(np.isnan(rows[missing]))
    assert np.all(np.isfinite(rows[there][rows["air_new"] == 1]))


def test_suite_without_air_data_reports_none():
    """No sample, ever."""
    assert not sensed(None, None, 12.0, 30.0)["air_new"].any()


@pytest.mark.parametrize(("what", "fit"), [("airspeed", (AirspeedParams, 0)), ("barometer", (BarometerParams, 1))])
def test_rate_that_does_not_divide_is_refused(what, fit):
    """Before the flight."""
    make, place = fit
    parts = [None, None]
    parts[place] = make(rate_hz=7.0)
    with pytest.raises(ValueError, match=f"{what} rate 7 Hz: choose one that divides"):
        sensed(*parts)


@pytest.mark.parametrize("flight", range(8))
def test_airspeed_offset_bends_the_square_root(flight):
    """V' = sqrt(V^2 + 2 offset / rho) at every speed; where that is not real, at low speed, no speed and never NaN."""
    params, V = AirspeedParams(offset_pa=20.0), np.repeat([0.0, 2.0, 12.0, 25.0], 5)
    read = speeds(params, V, n=20, flight=flight)
    offset_pa = 0.5 * DENSITY * (read[2] ** 2 - 12.0**2)
    assert offset_pa != 0.0
    expected = np.sqrt(np.maximum(V[::5] ** 2 + 2.0 * offset_pa / DENSITY, 0.0))
    # At zero the root makes 1e-13 Pa of round-off up to 1e-6 m/s.
    np.testing.assert_allclose(read, expected, rtol=0, atol=1e-6)
    assert (read[0] > 0.0) == (offset_pa > 0.0)


def test_airspeed_offset_is_drawn_for_each_flight_with_its_sigma():
    """Constant in a flight, normal over flights."""
    read = np.array([speeds(AirspeedParams(offset_pa=10.0), 20.0, n=10, flight=i) for i in range(300)])
    np.testing.assert_array_equal(read[:, 0], read[:, 1])
    drawn = 0.5 * DENSITY * (read[:, 0] ** 2 - 400.0)
    assert_sigma(drawn, 10.0)


def test_airspeed_gain_is_a_share_of_every_speed_with_its_sigma():
    """V' / V = sqrt(1 + gain), the same at all speeds."""
    drawn = []
    for flight in range(300):
        read = speeds(AirspeedParams(gain=0.05), np.repeat([5.0, 25.0], 5), n=10, flight=flight)
        np.testing.assert_allclose(read[0] / 5.0, read[1] / 25.0, rtol=1e-13, atol=0)
        drawn.append((read[0] / 5.0) ** 2 - 1.0)
    assert_sigma(drawn, 0.05)


def test_airspeed_noise_is_white_in_pressure_with_its_sigma():
    """3 Pa a sample, neighbours uncorrelated; at rest half the samples read no speed, and none is NaN."""
    read = speeds(AirspeedParams(noise_pa=3.0), 20.0, n=20_000)
    noise_pa = 0.5 * DENSITY * (read**2 - 400.0)
    assert_sigma(noise_pa, 3.0)
    assert abs(np.sum(noise_pa[1:] * noise_pa[:-1])) <= 4.5 * 9.0 * math.sqrt(len(noise_pa))
    still = speeds(AirspeedParams(noise_pa=3.0), 0.0, n=20_000)
    assert np.all(np.isfinite(still))
    assert abs(np.mean(still == 0.0) - 0.5) <= 4.5 * 0.5 / math.sqrt(len(still))


def test_airspeed_is_quantised_in_steps_of_pressure():
    """Each reading is the root of whole steps, the nearest: nothing at all below half a step."""
    V, step = np.linspace(0.0, 30.0, 301), 4.8828125
    read = speeds(AirspeedParams(step_pa=step), np.repeat(V, 5), n=1505)
    steps = np.floor(0.5 * DENSITY * V**2 / step + 0.5)
    np.testing.assert_allclose(read, np.sqrt(2.0 * step * steps / DENSITY), rtol=0, atol=1e-12)
    slow = math.sqrt(step / DENSITY) - 1e-9 > V
    assert slow.sum() > 10
    assert not read[slow].any()


def test_airspeed_saturates_at_the_range_of_the_sensor():
    """2 kPa are 57.14 m/s, and no more."""
    read = speeds(AirspeedParams(range_pa=2000.0), np.repeat([57.0, 57.2, 80.0], 5), n=15)
    most = math.sqrt(2.0 * 2000.0 / DENSITY)
    np.testing.assert_allclose(read, [57.0, most, most], rtol=1e-12, atol=0)


@pytest.mark.parametrize(("alpha_deg", "beta_deg"), [(0.0, 0.0), (20.0, 0.0), (-10.0, 30.0), (120.0, 0.0)])
def test_axial_tube_feels_the_flow_along_the_nose(alpha_deg, beta_deg):
    """V cos(alpha) cos(beta), nothing from behind; a tube that is not axial feels all of it."""
    alpha, beta = math.radians(alpha_deg), math.radians(beta_deg)
    along = 15.0 * math.cos(alpha) * math.cos(beta)
    flow = {"alpha_rad": alpha, "beta_rad": beta}
    np.testing.assert_allclose(speeds(AirspeedParams(axial=True), 15.0, **flow), max(along, 0.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(speeds(AirspeedParams(), 15.0, **flow), 15.0, rtol=0, atol=1e-12)


def test_barometer_noise_is_white_with_its_sigma_in_pressure():
    """12 Pa make 1 m near the ground; higher up more, as the air is thinner."""
    params, n = BarometerParams(noise_pa=12.013), 20_000
    low = heights(params, 0.0, n=n)
    assert_sigma(low, 1.0)  # 12.013 Pa / (1.225 kg/m3 g); curvature of 1e-4
    assert abs(np.sum(low[1:] * low[:-1])) <= 4.5 * math.sqrt(len(low))
    high = heights(params, 1000.0, n=n) - 1000.0
    np.testing.assert_allclose(np.std(high) / np.std(low), DENSITY / 1.11164, rtol=2e-4, atol=0)  # the same draws


def test_barometer_height_is_that_of_the_standard_pressure_at_every_height():
    """Pressures of the table of ISO 2533 within a step: quantised to 0.1 Pa, 1000 m stays 1000 m to 5 mm."""
    for height in (0.0, 500.0, 1000.0):
        read = heights(BarometerParams(step_pa=0.1), height, n=5)[0]
        assert abs(read - height) <= 0.05 / (9.80665 * 1.11) + 1e-9
    # 89874.6 Pa at 1000 m, in the table: a step of just that reads 1000 m exactly.
    assert abs(heights(BarometerParams(step_pa=89874.6), 1000.0, n=5)[0] - 1000.0) <= 0.005


def test_barometer_is_quantised_in_steps_of_pressure():
    """A metre is 12 Pa: in steps of 12 Pa a slow climb is a staircase of about a metre."""
    read = heights(BarometerParams(step_pa=12.0), np.linspace(0.0, 20.0, 2000), n=2000)
    stairs = np.unique(read)
    assert len(stairs) in (20, 21, 22)
    np.testing.assert_allclose(np.diff(stairs), 12.0 / PA_M, rtol=3e-3, atol=0)  # thinner by 0.2 % at 20 m


def test_barometer_drifts_steadily_with_the_sigma_of_its_rate():
    """A straight line from power-up; the rate is normal over flights."""
    drawn = []
    for flight in range(300):
        read = heights(BarometerParams(drift_pa_min=60.0), 0.0, n=500, flight=flight)  # 1 Pa/s, 10 s
        np.testing.assert_allclose(read[49] / read[-1], 0.5, rtol=1e-3, atol=0)  # curvature of 10 Pa: 1e-5
        drawn.append(-read[-1] * PA_M / 10.0)
    assert_sigma(drawn, 1.0)


def test_barometer_drift_levels_off():
    """After one time constant 1 - 1 / e of it, after many all of it; the same slope at power-up whatever that is."""

    def drawn(drift_s):
        suite = Suite(SuiteParams(barometer=BarometerParams(drift_pa_min=6.0, drift_s=drift_s)), Rates(), 5)
        suite.reset(Log.empty(3000))
        return suite.snapshot().noise["baro_error_pa"]

    short, long = drawn(5.0), drawn(36000.0)
    np.testing.assert_allclose(short[249] / long[249], 1.0 - math.exp(-1.0), rtol=1e-3, atol=0)
    np.testing.assert_allclose(short[-1] * 12.0 / long[-1], 1.0, rtol=2e-3, atol=0)  # 60 s are 12 of 5 s
    np.testing.assert_allclose(short[0] / long[0], 1.0, rtol=3e-3, atol=0)


def test_barometer_wanders_with_its_sigma_and_time_constant():
    """Over flights 12 Pa make 1 m at any time; after its time constant 1 / e of it is left."""
    first, later = [], []
    for flight in range(600):
        read = heights(BarometerParams(wander_pa=PA_M, wander_s=2.0), 0.0, n=105, flight=flight)
        first.append(read[0])
        later.append(read[20])  # 2 s later
    assert_sigma(first, 1.0)
    assert_sigma(later, 1.0)
    assert abs(np.mean(np.multiply(first, later)) - math.exp(-1.0)) <= 4.5 * math.sqrt(1.2 / 600)


@pytest.mark.parametrize("lag_s", [0.05, 0.5, 2.0])
def test_barometer_lags_by_its_time_constant(lag_s):
    """A climb that begins in the first tick is followed as c (t - T (1 - exp(-t / T))), exactly."""
    t_s = np.arange(400) * 0.02
    read = heights(BarometerParams(lag_s=lag_s, rate_hz=50.0), 3.0 * t_s, n=400)
    expected = 3.0 * (t_s - lag_s * -np.expm1(-t_s / lag_s))
    np.testing.assert_allclose(read, expected, rtol=0, atol=1e-11)


def test_barometer_height_without_lag_is_the_height_itself():
    """Also where it steps."""
    step = np.where(np.arange(100) < 50, 0.0, 10.0)
    np.testing.assert_array_equal(heights(BarometerParams(rate_hz=50.0), step, n=100), step)


@pytest.mark.parametrize("error", ["noise_pa", "drift_pa_min", "wander_pa"])
def test_barometer_error_switched_off_leaves_the_others_unchanged(error):
    """The three add up in pressure: whole less one is what the two others make."""
    sigmas = {"noise_pa": 2.0, "drift_pa_min": 6.0, "wander_pa": 3.0}

    def drawn(**kw):
        suite = Suite(SuiteParams(barometer=BarometerParams(**kw)), Rates(), 5)
        suite.reset(Log.empty(300))
        return suite.snapshot().noise["baro_error_pa"]

    alone, rest = drawn(**{error: sigmas[error]}), drawn(**{k: v for k, v in sigmas.items() if k != error})
    np.testing.assert_allclose(drawn(**sigmas), alone + rest, rtol=0, atol=1e-13)
    assert alone.any()
    assert not drawn().any()


@pytest.mark.parametrize(
    ("make", "field", "value", "unit"),
    [
        (AirspeedParams, "rate_hz", 0.0, "Hz"), (AirspeedParams, "noise_pa", -1.0, "Pa"),
        (AirspeedParams, "offset_pa", math.nan, "Pa"), (AirspeedParams, "gain", -0.1, "(a fraction)"),
        (AirspeedParams, "range_pa", 0.0, "Pa"), (AirspeedParams, "step_pa", -1.0, "Pa"),
        (BarometerParams, "rate_hz", math.inf, "Hz"), (BarometerParams, "lag_s", -0.1, "s"),
        (BarometerParams, "noise_pa", math.nan, "Pa"), (BarometerParams, "drift_pa_min", -1.0, "Pa/min"),
        (BarometerParams, "wander_pa", -1.0, "Pa"), (BarometerParams, "wander_s", 0.0, "s"),
        (BarometerParams, "step_pa", -1.0, "Pa"),
    ],
)  # fmt: skip
def test_impossible_parameter_is_refused(make, field, value, unit):
    """One line that names the field, its value and unit, and says what to choose."""
    with pytest.raises(ValueError, match="choose ") as error:
        make(**{field: value})
    assert str(error.value).startswith(f"{make.__name__}.{field} = {value!r} {unit}: choose ")
    assert "\n" not in str(error.value)


def test_barometer_ends_at_its_full_scale():
    """A pressure above it reads as the full scale does, one below it is as without, but for the way there and back."""
    heights_m = np.linspace(-200.0, 200.0, 50)
    limit_pa = 101325.0 * (1.0 - 0.0065 * -100.0 / 288.15) ** 5.2558797  # 100 m below the launch point, at sea level
    read = heights(BarometerParams(rate_hz=50.0, range_pa=limit_pa), heights_m)
    np.testing.assert_allclose(read, np.maximum(heights_m, -100.0), rtol=0, atol=1e-5)


def test_barometer_full_scale_that_is_none_is_refused():
    """With the unit and what would be right."""
    with pytest.raises(ValueError, match=r"BarometerParams\.range_pa = 0\.0 Pa: choose a number above 0, or infinity"):
        BarometerParams(range_pa=0.0)
